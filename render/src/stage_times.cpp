// Time stamps of the GPU's own clock.
#include <unseen/render/internal/stage_times.h>

#include <deque>

#include "query_pool.h"

namespace unseen::render {
namespace {

constexpr std::size_t most_open_frames = 64; // where nobody takes them, the oldest go

} // namespace

struct StageTimes::Impl {
    explicit Impl(const Context& context_) : context(context_), queries(context_, GL_TIMESTAMP) {}

    void stamp() {
        present.push_back(queries.take());
        glQueryCounter(present.back(), GL_TIMESTAMP);
    }
    void forget(std::vector<GLuint>& frame) {
        for (const GLuint query : frame) queries.put_back(query);
        frame.clear();
    }

    Context context;
    QueryPool queries;
    std::vector<GLuint> present;
    std::deque<std::vector<GLuint>> open;
};

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
        if (!is_there(stamps.back())) break;
        std::vector<double>& stages = frames.emplace_back();
        GLuint64 before = 0;
        for (std::size_t i = 0; i < stamps.size(); ++i) {
            const GLuint64 nanoseconds = result_of(stamps[i]);
            if (i > 0) stages.push_back(static_cast<double>(nanoseconds - before) * 1e-6);
            before = nanoseconds;
        }
        impl_->forget(stamps);
        impl_->open.pop_front();
    }
    return frames;
}

} // namespace unseen::render
