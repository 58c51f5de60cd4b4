// Draws what a view shows, and simplifies by it.
#include <unseen/session_gpu/as_seen.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

#include <unseen/render/internal/frame.h>
#include <unseen/session_gpu/scene_renderer.h>
#include <unseen/vdtree/internal/stopwatch.h>

#include "shown_depths.h"

namespace unseen::session {
namespace {

// Pictures from all around: fine enough for what nodes of a tenth of a per cent of the area show.
constexpr int sides = 14, side_px = 768, side_samples = 4;
constexpr double side_fill = 0.9;

// On a spiral from pole to pole, evenly.
glm::dvec3 direction_of(int side) {
    const double turn = std::numbers::pi * (3 - std::sqrt(5)) * side, z = 1 - (2 * side + 1.0) / sides;
    const double across = std::sqrt(1 - z * z);
    return {across * std::cos(turn), z, across * std::sin(turn)};
}

Effect occlusion_effect(const vdtree::View& view, int samples, double milliseconds) {
    constexpr std::uint64_t depth_bytes = 4; // a pixel
    return {"occlusion",
            true,
            "what lies behind what the view shows is folded",
            samples,
            depth_bytes * static_cast<std::uint64_t>(view.width) * static_cast<std::uint64_t>(view.height),
            milliseconds};
}

Effect shadow_effect(SceneRenderer& renderer) {
    const auto facts = renderer.shadows();
    if (!facts) return {"shadows", false, "no light casts a shadow"};
    return {"shadows",
            true,
            std::to_string(facts->lights) + (facts->lights == 1 ? " light casts" : " lights cast"),
            facts->maps,
            facts->bytes,
            facts->draw_ms};
}

} // namespace

const char* why_pictures_tell_nothing(const Session& session, const Request& request, const Simplification& made) {
    if (request.goal.kind == Goal::Kind::full) return "nothing is folded in the full model";
    if (made.fold_tests.empty()) return "there is no object";
    if (!is_perceptual(made.fold_tests.front())) return "the fold test counts pixels, seen or not";
    if (session.scene().lights &&
        std::ranges::any_of(made.fold_tests, [](FoldTest test) { return test != FoldTest::error; }))
        return "under lights only the fold test error goes by pictures";
    return nullptr;
}

Result<vdtree::DepthPicture> draw_depths(const render::Context& context, const SceneItems& scene,
                                         const vdtree::View& view, int samples) {
    const auto depths = render::farthest_depth(context, scene.items, view, samples);
    if (!depths) return depths.error();
    return vdtree::DepthPicture::create(view, *depths);
}

Result<Simplification> simplify_as_seen(Session& session, const render::Context& context, const vdtree::View& view,
                                        Request request, const AsSeenOptions& options) {
    if (auto valid = vdtree::validate_perspective(view, "A simplification by what pictures show"); !valid)
        return valid.error();
    request.purpose = Purpose::picture;
    request.shown.clear();
    // What a budget leaves may be far off the mesh, and then its picture does not tell what of the mesh is shown.
    Request first = request;
    const bool has_other_goal = goes_by_sum(request) && options.folds_hidden;
    if (has_other_goal) first.goal = Goal::imperceptible();
    auto all = session.simplify(view, first);
    if (!all) return all;
    if (const char* why = why_pictures_tell_nothing(session, request, *all)) {
        if (has_other_goal) all = session.simplify(view, request);
        if (!all) return all;
        all->passes = {{"occlusion", false, why}, {"shadows", false, why}};
        return all;
    }
    if (!options.folds_hidden) return all;
    auto renderer = SceneRenderer::create(context, session);
    if (!renderer) return renderer.error();
    const auto scene = renderer->items(drawn_cuts(all->cuts), view);
    if (!scene) return scene.error();
    const auto start = vdtree::Clock::now();
    auto shown = draw_depths(context, *scene, view, options.samples);
    if (!shown) return shown.error();
    std::vector<Effect> passes = {occlusion_effect(view, options.samples, vdtree::ms_since(start)),
                                  shadow_effect(*renderer)};
    request.shown.push_back(std::move(*shown));
    all = session.simplify(view, request);
    if (all) all->passes = std::move(passes);
    return all;
}

Result<Simplification> simplify_from_all_sides(Session& session, const render::Context& context,
                                               const vdtree::View& view, Request request) {
    request.purpose = Purpose::mesh;
    request.shown.clear();
    const WorldSphere all = session.bounding_sphere();
    const bool is_outside = !view.orthographic_height && glm::length(view.eye - all.centre) > all.radius;
    const bool has_budget = request.goal.kind == Goal::Kind::budget;
    if (!has_budget || !goes_by_sum(request) || !is_outside) return session.simplify(view, request);
    if (auto prepared = session.prepare(view, request); !prepared) return prepared.error();
    auto renderer = SceneRenderer::create(context, session);
    if (!renderer) return renderer.error();
    const std::vector<vdtree::Cut> whole = whole_cuts(session);
    vdtree::View window;
    window.width = window.height = side_px;
    for (int side = 0; side < sides; ++side) {
        const vdtree::View seen = session.frame(direction_of(side), side_fill, window);
        const auto scene = renderer->items(drawn_cuts(whole), seen);
        if (!scene) return scene.error();
        auto shown = draw_depths(context, *scene, seen, side_samples);
        if (!shown) return shown.error();
        request.shown.push_back(std::move(*shown));
    }
    return session.simplify(view, request);
}

} // namespace unseen::session
