#include "simplification.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>

#include "terminal.h"

namespace unseen::app {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double undefined = std::numeric_limits<double>::quiet_NaN();

double milliseconds_since(Clock::time_point start) {
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

Simplification begun(const Scene& scene) {
    Simplification result;
    result.source_triangles = scene.tree.triangle_count();
    result.dropped = scene.tree.dropped_triangles();
    return result;
}

// Cost is v*/v for the perceptual test alone; the others count pixels.
double imperceptible_from(const Scene& scene, const WhatOptions& what, const vdtree::AdjustStats& stats) {
    if (what.mode == Mode::full) return 0;
    if (!is_perceptual(what)) return undefined;
    if (vdtree::is_unbounded(stats.max_fold_cost)) return infinity;
    return scene.display.distance.value() * static_cast<double>(stats.max_fold_cost);
}

void conclude(Simplification& result, const Scene& scene, const WhatOptions& what, Purpose purpose, CutFacts facts = {}) {
    result.imperceptible_from_m = facts.imperceptible_from_m = imperceptible_from(scene, what, result.stats);
    facts.is_complete = result.stats.is_complete;
    result.effects = effects_of(scene, what, purpose, facts);
}

// The view through a window whose sides are so much farther from its centre.
vdtree::View widened(const vdtree::View& view) {
    constexpr double wider = 1.3, widest_degrees = 179;
    const double half_tangent = std::tan(view.fov_y_degrees * (std::numbers::pi / 360));
    vdtree::View wide = view;
    wide.fov_y_degrees =
        std::max(view.fov_y_degrees, std::min(std::atan(wider * half_tangent) * (360 / std::numbers::pi), widest_degrees));
    return wide;
}

} // namespace

Result<Simplification> simplify(vdtree::Cut& cut, const Scene& scene, const WhatOptions& what, Purpose purpose) {
    if (what.mode != Mode::full) {
        Follower follower;
        follower.set_hysteresis(1);
        return follower.follow(cut, scene, what, purpose);
    }
    Simplification result = begun(scene);
    const auto start = Clock::now();
    cut.unfold_all();
    result.stats.triangles = cut.triangle_count();
    result.adapt_ms = milliseconds_since(start);
    const auto adapted = Clock::now();
    static_cast<void>(cut.indices());
    result.extract_ms = milliseconds_since(adapted);
    conclude(result, scene, what, purpose);
    return result;
}

Result<void> Follower::set_geomorph(const Scene& scene, double seconds) {
    if (!scene.tree.texture().empty())
        return Error{ErrorCode::invalid_argument, "--geomorph does not move textures: leave it out, or add --no-texture."};
    auto made = vdtree::Geomorph::create(scene.tree, {.seconds = seconds});
    if (!made) return made.error();
    geomorph_ = std::move(*made);
    passed_ = 0;
    return {};
}

vdtree::Viewpoint Follower::viewpoint_for(const Scene& scene, const WhatOptions& what, Purpose purpose) const {
    vdtree::Viewpoint viewpoint = viewpoint_of(scene, what, purpose);
    // What comes into the window shall not glide there any more.
    if (geomorph_ && !viewpoint.frusta.empty()) viewpoint.frusta = {vdtree::frustum_of(scene.tree, widened(scene.view), scene.placement)};
    return viewpoint;
}

Result<Simplification> Follower::change(vdtree::Cut& cut, const Scene& scene, const WhatOptions& what, Purpose purpose) {
    Simplification result = begun(scene);
    if (what.mode == Mode::full) {
        if (cut.triangle_count() != scene.tree.triangle_count()) return simplify(cut, scene, what, purpose);
        result.stats.triangles = cut.triangle_count();
        conclude(result, scene, what, purpose);
        return result;
    }
    auto criterion = distance_criterion(scene, what);
    if (!criterion) return criterion.error();
    criterion_ = std::move(*criterion);
    vdtree::FollowOptions options = follow_options(scene, purpose);
    options.threshold = static_cast<float>(threshold_);
    options.milliseconds = what.milliseconds;
    if (what.mode == Mode::budget) {
        options.triangle_budget = what.triangles;
        options.fill_budget = what.fill_budget;
        options.hysteresis = hysteresis_;
    }
    const vdtree::Viewpoint viewpoint = viewpoint_for(scene, what, purpose);
    const auto start = Clock::now();
    const auto stats = cut.follow(*criterion_, viewpoint, options);
    result.adapt_ms = milliseconds_since(start);
    if (!stats) return stats.error();
    result.stats = *stats;
    CutFacts facts;
    facts.occluders = viewpoint.occluders.size();
    if (what.mode != Mode::budget) facts.threshold = threshold_;
    conclude(result, scene, what, purpose, facts);
    return result;
}

Result<void> Follower::glide(const vdtree::Cut& cut, Simplification& result) {
    if (auto stepped = geomorph_->step(cut, passed_); !stepped) return stepped;
    passed_ = 0;
    result.drawn_triangles = geomorph_->drawn().triangle_count();
    result.gliding = geomorph_->moved().size();
    return {};
}

Result<Simplification> Follower::follow(vdtree::Cut& cut, const Scene& scene, const WhatOptions& what, Purpose purpose) {
    auto result = change(cut, scene, what, purpose);
    if (!result) return result;
    const auto changed = Clock::now();
    if (geomorph_)
        if (auto glided = glide(cut, *result); !glided) return glided.error();
    static_cast<void>(geomorph_ ? geomorph_->drawn().indices() : cut.indices());
    result->extract_ms += milliseconds_since(changed);
    result->effects.push_back(geomorph_effect(geomorph(), cut));
    return result;
}

Json to_json(const Simplification& s, double draw_ms) {
    const double cost =
        vdtree::is_unbounded(s.stats.max_fold_cost) ? infinity : static_cast<double>(s.stats.max_fold_cost);
    return {{"source_triangles", s.source_triangles},
            {"triangles", s.stats.triangles},
            {"dropped", s.dropped},
            {"node_tests", s.stats.node_tests},
            {"adapt_ms", number_or_null(s.adapt_ms)},
            {"extract_ms", number_or_null(s.extract_ms)},
            {"draw_ms", number_or_null(draw_ms)},
            {"imperceptible_from_m", number_or_null(s.imperceptible_from_m)},
            {"max_fold_cost", number_or_null(cost)},
            {"effects", to_json(s.effects)}};
}

void print(const Simplification& s, double draw_ms) {
    const double share = 100.0 * s.stats.triangles / static_cast<double>(s.source_triangles);
    std::vector<std::vector<std::string>> rows = {
        {"triangles",
         grouped(s.stats.triangles) + " of " + grouped(s.source_triangles) + " (" + rounded(share, 3) + "%)"},
        {"dropped", grouped(s.dropped)},
        {"nodes tested", grouped(s.stats.node_tests)},
        {"adapted in", rounded(s.adapt_ms, 3) + " ms"},
        {"extracted in", rounded(s.extract_ms, 3) + " ms"}};
    if (!std::isnan(draw_ms)) rows.push_back({"drawn in", rounded(draw_ms, 3) + " ms"});
    const std::string metres = std::isfinite(s.imperceptible_from_m) ? " m" : "";
    rows.push_back({"imperceptible from", rounded(s.imperceptible_from_m, 3) + metres});
    print_table(rows);
    std::printf("effects\n");
    print(s.effects);
}

} // namespace unseen::app
