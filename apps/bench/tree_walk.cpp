#include "tree_walk.h"

#include <glm/geometric.hpp>

#include "bench_tools.h"

namespace unseen::app {

vdtree::View view_on_walk(const vdtree::View& first, int frame) {
    constexpr double metres_a_second = 1.5, frames_a_second = 60;
    const glm::dvec3 way = frame * (metres_a_second / frames_a_second) * glm::normalize(first.target - first.eye);
    vdtree::View view = first;
    view.eye += way;
    view.target += way;
    return view;
}

Result<TreeWalk> walk_tree(const session::Session& session, const render::Context& context,
                           session::SceneRenderer& renderer, const vdtree::View& first,
                           const TreeWalkOptions& options) {
    std::optional<session::MovingOcclusion> occlusion;
    if (options.occlusion) {
        auto made = session::MovingOcclusion::create(context, session, *options.occlusion);
        if (!made) return made.error();
        occlusion = std::move(*made);
    }
    session::Follower follower(session);
    session::Request request{.purpose = session::Purpose::picture};
    request.reasons = false;
    render::DrawOptions drawing;
    drawing.samples = 1;
    drawing.background = session.background();
    const double counted = options.frames + 1 - options.first_counted;
    TreeWalk walk;
    for (int i = 0; i <= options.frames; ++i) {
        const vdtree::View view = view_on_walk(first, i);
        const auto start = BenchClock::now();
        if (occlusion) {
            auto hidden = occlusion->begin_frame(view);
            if (!hidden) return hidden.error();
            request.hidden = std::move(*hidden);
        }
        const auto report = follower.follow(view, request);
        if (!report) return report.error();
        const auto drawn = renderer.draw(session::drawn_cuts(follower, session.scene().objects.size()), view, drawing);
        if (!drawn) return drawn.error();
        if (occlusion) {
            const auto ended = occlusion->end_frame(*renderer.drawn_depth(), view, 1e3 * seconds_since(start));
            if (!ended) return ended.error();
        }
        if (i < options.first_counted) continue;
        walk.triangles += static_cast<double>(report->stats.triangles) / counted;
        walk.frame_ms += 1e3 * seconds_since(start) / counted;
    }
    if (options.judge) {
        const auto frame = renderer.draw(session::drawn_cuts(follower, session.scene().objects.size()),
                                         view_on_walk(first, options.frames), options.judge->drawing());
        if (!frame) return frame.error();
        auto verdict = options.judge->judge(*frame);
        if (!verdict) return verdict.error();
        walk.verdict = *verdict;
    }
    if (!occlusion) return walk;
    walk.pictures = occlusion->facts().pictures;
    walk.occlusion_ms = occlusion->facts().milliseconds / static_cast<double>(occlusion->facts().frames);
    walk.effect = occlusion->effect();
    return walk;
}

} // namespace unseen::app
