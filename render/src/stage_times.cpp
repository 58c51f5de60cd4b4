// Time stamps of the GPU's own clock.
#include <unseen/render/internal/stage_times.h>

#include <deque>

#include "context_impl.h"
#include "gl.h"

namespace unseen::render {
namespace {

constexpr std::size_t most_open_frames = 64; // where nobody takes them, the oldest go

} // namespace

struct StageTimes::Impl {
    explicit Impl(const Context& context_) : context(context_) {}
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;
    ~Impl() {
        if (!context.make_current()) return;
        open.push_back(std::move(present));
        for (const auto& frame : open) free.insert(free.end(), frame.begin(), frame.end());
        glDeleteQueries(static_cast<GLsizei>(free.size()), free.data());
    }

    void stamp() {
        GLuint query = 0;
        if (free.empty()) {
            glCreateQueries(GL_TIMESTAMP, 1, &query);
        } else {
            query = free.back();
            free.pop_back();
        }
        glQueryCounter(query, GL_TIMESTAMP);
        present.push_back(query);
    }
    void forget(std::vector<GLuint>& frame) {
        free.insert(free.end(), frame.begin(), frame.end());
        frame.clear();
    }

    Context context; // first, and so gone last
    std::vector<GLuint> present, free;
    std::deque<std::vector<GLuint>> open;
};

StageTimes::StageTimes(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
StageTimes::StageTimes(StageTimes&&) noexcept = default;
StageTimes& StageTimes::operator=(StageTimes&&) noexcept = default;
StageTimes::~StageTimes() = default;

Result<StageTimes> StageTimes::create(const Context& context) {
    if (auto current = context.make_current(); !current) return current.error();
    return StageTimes(std::make_unique<Impl>(context));
}

void StageTimes::begin() {
    if (!impl_->context.make_current()) return;
    impl_->forget(impl_->present);
    impl_->stamp();
}

void StageTimes::end_stage() {
    if (!impl_->present.empty() && impl_->context.make_current()) impl_->stamp();
}

void StageTimes::end() {
    if (impl_->present.empty()) return;
    impl_->open.push_back(std::exchange(impl_->present, {}));
    if (impl_->open.size() <= most_open_frames) return;
    impl_->forget(impl_->open.front());
    impl_->open.pop_front();
}

std::vector<std::vector<double>> StageTimes::take() {
    std::vector<std::vector<double>> frames;
    if (!impl_->context.make_current()) return frames;
    while (!impl_->open.empty()) {
        auto& stamps = impl_->open.front();
        GLuint is_there = GL_FALSE;
        glGetQueryObjectuiv(stamps.back(), GL_QUERY_RESULT_AVAILABLE, &is_there);
        if (is_there == GL_FALSE) break;
        std::vector<double>& stages = frames.emplace_back();
        GLuint64 before = 0;
        for (std::size_t i = 0; i < stamps.size(); ++i) {
            GLuint64 nanoseconds = 0;
            glGetQueryObjectui64v(stamps[i], GL_QUERY_RESULT, &nanoseconds);
            if (i > 0) stages.push_back(static_cast<double>(nanoseconds - before) * 1e-6);
            before = nanoseconds;
        }
        impl_->forget(stamps);
        impl_->open.pop_front();
    }
    return frames;
}

} // namespace unseen::render
