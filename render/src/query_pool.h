// Queries that are used again.
#pragma once

#include "context_impl.h"

namespace unseen::render {

class QueryPool {
public:
    QueryPool(const Context& context, GLenum kind) : context_(context), kind_(kind) {}
    QueryPool(const QueryPool&) = delete;
    QueryPool& operator=(const QueryPool&) = delete;
    ~QueryPool() {
        if (context_.make_current()) glDeleteQueries(static_cast<GLsizei>(all_.size()), all_.data());
    }

    GLuint take() {
        if (free_.empty()) glCreateQueries(kind_, 1, &free_.emplace_back()), all_.push_back(free_.back());
        const GLuint query = free_.back();
        free_.pop_back();
        return query;
    }
    void put_back(GLuint query) { free_.push_back(query); }

private:
    Context context_;
    GLenum kind_;
    std::vector<GLuint> all_, free_;
};

inline bool is_there(GLuint query) {
    GLuint there = GL_FALSE;
    glGetQueryObjectuiv(query, GL_QUERY_RESULT_AVAILABLE, &there);
    return there != GL_FALSE;
}

inline GLuint64 result_of(GLuint query) { // waits
    GLuint64 result = 0;
    glGetQueryObjectui64v(query, GL_QUERY_RESULT, &result);
    return result;
}

} // namespace unseen::render
