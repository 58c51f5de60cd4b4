#include "simplification.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include <glm/geometric.hpp>

#include <perception/criterion.h>

#include "terminal.h"

namespace unseen::app {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double undefined = std::numeric_limits<double>::quiet_NaN();
// The default field is the physical one, computed by way of degrees: rounding is no magnification.
constexpr double same_field_degrees = 1e-7;

double milliseconds_since(Clock::time_point start) {
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

bool is_perceptual(const WhatOptions& what) { return what.mode != Mode::full && is_perceptual(what.test); }

bool has_distance_form_only(FoldTest test) { return test == FoldTest::error || test == FoldTest::luebke_hallen_safe; }

// Whether a single cut is made by a criterion in distance form, or asks about each node.
bool goes_by_distances(const Scene& scene, const WhatOptions& what) {
    const bool is_lit = scene.lighting && is_perceptual(what);
    return what.fill_budget || what.milliseconds || what.chroma || is_lit || has_distance_form_only(what.test);
}

// What silhouettes can be seen against.
perception::SceneLuminance scene_luminance(const Scene& scene) {
    if (scene.lighting)
        return perception::lit_scene(scene.tree, *scene.light_bounds, *scene.lighting,
                                     vdtree::eye_in_tree(scene.tree, scene.view, scene.placement), scene.background);
    const vdtree::LuminanceRange range = scene.tree.luminance_range();
    return {std::min(range.lo, scene.background), std::max(range.hi, scene.background),
            vdtree::LuminanceRange{scene.background, scene.background}};
}

perception::FoldTestOptions test_options(const Scene& scene, const WhatOptions& what) {
    perception::FoldTestOptions test;
    test.display = scene.display;
    test.scene = scene_luminance(scene);
    test.csf = &scene.csf_table();
    test.chroma = what.chroma;
    if (!what.gaze_px) return test;
    const perception::CsfTable* around_gaze = scene.csf_table(perception::Degrees(what.gaze_margin_deg));
    if (!around_gaze) return test;
    test.gaze_px = what.gaze_px;
    test.csf = around_gaze;
    return test;
}

// Calls f(criterion) with the test that asks about each node.
template <class F>
auto with_criterion(const Scene& scene, const WhatOptions& what, F&& f) {
    // A budget goes by the order of the costs alone, for which any tolerance will do.
    const double tolerance_px = what.mode == Mode::pixels ? what.pixels : 1;
    switch (what.test) {
    case FoldTest::extent: return f(vdtree::ExtentCriterion(scene.tree, scene.view, tolerance_px, scene.placement));
    case FoldTest::displacement: return f(vdtree::DisplacementCriterion(scene.tree, scene.view, tolerance_px, scene.placement));
    case FoldTest::luebke_hallen_safe: // these have the distance form only
    case FoldTest::error:
    case FoldTest::luebke_hallen: break;
    }
    return f(perception::LuebkeHallenCriterion(scene.tree, scene.view, test_options(scene, what), scene.placement));
}

vdtree::AdjustStats adjust(vdtree::Cut& cut, const Scene& scene, const WhatOptions& what, Purpose purpose) {
    if (what.mode == Mode::full) {
        cut.unfold_all();
        vdtree::AdjustStats stats;
        stats.triangles = cut.triangle_count();
        return stats;
    }
    const vdtree::FrustumVisibility visibility(scene.tree, scene.view, scene.placement);
    vdtree::AdjustOptions options;
    if (purpose == Purpose::picture) options.visibility = visibility;
    if (what.mode == Mode::budget) options.triangle_budget = what.triangles;
    return with_criterion(scene, what, [&](const auto& criterion) { return cut.adjust(criterion, options); });
}

// Cost is v*/v for the perceptual test alone; the others count pixels.
double imperceptible_from(const Scene& scene, const WhatOptions& what, const vdtree::AdjustStats& stats) {
    if (what.mode == Mode::full) return 0;
    if (!is_perceptual(what)) return undefined;
    if (vdtree::is_unbounded(stats.max_fold_cost)) return infinity;
    return scene.display.distance.value() * static_cast<double>(stats.max_fold_cost);
}

std::string name_of(FoldTest test) { return std::string(perception::fold_test_names[static_cast<std::size_t>(test)]); }

Effect fold_test_effect(const WhatOptions& what) {
    if (what.mode == Mode::full) return {"fold test", false, "nothing is folded in the full model"};
    const std::string instead = what.why_not_error.empty() ? "" : " (" + what.why_not_error + ")";
    if (what.test == FoldTest::error)
        return {"fold test", true, "error: what each fold changes in luminance and outline, against the contrast sensitivity"};
    if (what.test == FoldTest::luebke_hallen_safe)
        return {"fold test", true,
                "luebke-hallen-safe: the worst grating of each fold with any neighbours folded, and the shift of the mean, against the contrast "
                "sensitivity" + instead};
    if (what.test == FoldTest::luebke_hallen)
        return {"fold test", true, "luebke-hallen: the worst grating of each fold against the contrast sensitivity" + instead};
    return {"fold test", true, name_of(what.test) + ": pixels on the screen, whether they can be seen or not"};
}

Effect gaze_effect(const WhatOptions& what) {
    if (what.mode == Mode::full) return {"gaze", false, "nothing is folded in the full model"};
    if (!is_perceptual(what)) return {"gaze", false, "the fold test " + name_of(what.test) + " does not use it"};
    if (!what.gaze_px) return {"gaze", false, "no gaze is given, so everything counts as looked at"};
    const std::string around =
        what.gaze_margin_deg > 0 ? ", give or take " + rounded(what.gaze_margin_deg, 3) + " degrees," : std::string(",");
    return {"gaze", true,
            "the viewer looks at pixel " + rounded(what.gaze_px->x, 6) + ", " + rounded(what.gaze_px->y, 6) + around +
                " and sees less sharply elsewhere"};
}

Effect silhouette_effect(const Scene& scene, const WhatOptions& what) {
    if (!is_perceptual(what)) return {"silhouettes", false, "only the perceptual fold test knows them"};
    const perception::SceneLuminance range = scene_luminance(scene);
    const auto cdm2 = [&](float relative) {
        return rounded(perception::to_luminance(scene.display, static_cast<double>(relative)).value(), 3);
    };
    return {"silhouettes", true,
            "folds on outlines are tested against " + cdm2(range.darkest) + " to " + cdm2(range.brightest) +
                " cd/m2, the whole scene with its background"};
}

Effect csf_effect(const Scene& scene, const WhatOptions& what) {
    if (!is_perceptual(what)) return {"csf table", false, "only the perceptual fold test looks sensitivity up"};
    return {"csf table", scene.csf.has_value(),
            scene.csf ? "by --csf: " + scene.csf->samples().source
                      : "the standard observer is used, castleCSF"};
}

Effect prelit_effect(const Scene& scene) {
    if (scene.lighting && !scene.tree.colours().empty()) return {"pre-lit colours", false, "--lights lights the colours"};
    if (scene.tree.is_prelit())
        return {"pre-lit colours", true, scene.tree.colours().empty() ? "the texture is taken as lit" : "the mesh's colours are taken as lit"};
    if (!scene.tree.texture().empty()) return {"pre-lit colours", false, "--light or --ambient lights the texture"};
    return {"pre-lit colours", false,
            scene.tree.colours().empty() ? "the mesh has no colours" : "--light or --ambient lights the colours"};
}

Effect texture_effect(const Scene& scene, const WhatOptions& what) {
    if (scene.tree.texture().empty())
        return {"texture", false, scene.is_texture_left_out ? "--no-texture leaves it out" : "the model has none"};
    if (!is_perceptual(what)) return {"texture", true, "drawn; folds are not tested against it"};
    if (what.test == FoldTest::luebke_hallen_safe)
        return {"texture", true, "folds are tested against its darkest and brightest texels around them, and by how far they move it"};
    return {"texture", true, "folds are tested against its darkest and brightest texels around them"};
}

Effect chroma_effect(const Scene& scene, const WhatOptions& what) {
    if (!is_perceptual(what)) return {"chroma", false, "only the perceptual fold test knows it"};
    if (!what.chroma) return {"chroma", false, "without --chroma only luminance counts"};
    if (scene.tree.ring_chroma().empty()) return {"chroma", false, "nothing has any colour"};
    return {"chroma", true, "red-green and yellow-violet contrast count beside that of luminance, by castleCSF"};
}

Effect light_effect(const Scene& scene, const WhatOptions& what) {
    if (scene.lighting)
        return {"light", true,
                scene.rig->description() +
                    (is_perceptual(what) ? ": folds are tested against what these can make of the normals and places in their rings"
                                         : "; drawn, for the fold test does not look at luminance")};
    if (scene.is_relit)
        return {"light", true, "luminance and its bounds were computed again for another light than the tree's"};
    return {"light", false,
            scene.tree.is_prelit() ? "the colours are pre-lit" : "the light that the tree was built for"};
}

Effect frustum_effect(const WhatOptions& what, Purpose purpose) {
    if (what.mode == Mode::full) return {"frustum culling", false, "nothing is folded in the full model"};
    if (purpose == Purpose::mesh) return {"frustum culling", false, "the mesh may be looked at from elsewhere"};
    return {"frustum culling", true, "what lies outside of the window is folded"};
}

Effect culling_effect(const Scene& scene, Purpose purpose) {
    const PlacedSphere sphere = placed_sphere(scene.tree, scene.placement);
    const bool is_open = scene.tree.closedness() == vdtree::Closedness::open;
    const bool is_outside = glm::length(scene.view.eye - sphere.centre) > sphere.radius;
    if (purpose == Purpose::mesh) return {"back-face culling", false, "nothing is drawn"};
    if (is_open) return {"back-face culling", false, "the surface is open, so both sides are drawn"};
    if (!is_outside) return {"back-face culling", false, "the eye is in the model, so both sides are drawn"};
    return {"back-face culling", true,
            scene.tree.closedness() == vdtree::Closedness::closed_outward
                ? "the surface is closed, so its inner side cannot be seen"
                : "the surface is closed but inside out, so it is turned"};
}

Effect magnification_effect(const Scene& scene, const WhatOptions& what) {
    const double physical = perception::physical_field(scene.display, scene.view.height).value();
    const std::string fields =
        rounded(scene.view.fov_y_degrees, 4) + " degrees, the window fills " + rounded(physical, 4);
    if (std::abs(scene.view.fov_y_degrees - physical) <= same_field_degrees)
        return {"magnification", false, "the camera's field is the one that the window fills on the display"};
    if (!is_perceptual(what)) return {"magnification", false, "pixels do not depend on it (camera " + fields + ")"};
    return {"magnification", true, "the camera's field is " + fields + ": angles are those on the screen"};
}

constexpr const char* imperceptible_distance = "imperceptible distance";

Effect distance_effect(const WhatOptions& what, const Simplification& result) {
    const std::string name = imperceptible_distance;
    if (what.mode == Mode::full) return {name, true, "nothing is folded, so it holds from any distance"};
    if (!is_perceptual(what))
        return {name, false, "costs of the fold test " + name_of(what.test) + " are no distances"};
    if (std::isinf(result.imperceptible_from_m))
        return {name, false, "a fold around the eye or across its plane stays visible from everywhere"};
    return {name, true, "the display's distance times the largest fold cost"};
}

bool is_translucent(const Scene& scene) { return scene.tree.bounds()[vdtree::VertexTree::root()].flags & vdtree::translucent_ring; }

// Whether faces that look away can be folded: they are not drawn, and nothing shows them from outside.
bool culls_back_faces(const Scene& scene) {
    const PlacedSphere sphere = placed_sphere(scene.tree, scene.placement);
    return !is_translucent(scene) && scene.tree.closedness() != vdtree::Closedness::open &&
           glm::length(scene.view.eye - sphere.centre) > sphere.radius;
}

bool is_wholly_in_window(const Scene& scene) {
    const vdtree::Sphere sphere = scene.tree.bounding_sphere();
    const vdtree::Frustum frustum = vdtree::frustum_of(scene.tree, scene.view, scene.placement);
    return std::all_of(frustum.planes.begin(), frustum.planes.end(), [&](const vdtree::Plane& plane) {
        return glm::dot(plane.normal, glm::dvec3(sphere.centre)) + plane.offset > static_cast<double>(sphere.radius);
    });
}

Effect back_face_effect(const Scene& scene, Purpose purpose) {
    if (purpose == Purpose::mesh) return {"back-face folding", false, "the mesh may be looked at from elsewhere"};
    if (culls_back_faces(scene)) return {"back-face folding", true, "what faces away is not drawn, so it is folded"};
    if (scene.tree.closedness() == vdtree::Closedness::open)
        return {"back-face folding", false, "the surface is open"};
    if (is_translucent(scene)) return {"back-face folding", false, "what faces away may show through"};
    return {"back-face folding", false, "the eye is in the model"};
}

// Whether what a solid's inside hides can be folded. Extent and displacement look at supports, which do not contain all that a fold changes.
bool folds_hidden(const Scene& scene, const WhatOptions& what, Purpose purpose) {
    return purpose == Purpose::picture && is_perceptual(what) && culls_back_faces(scene);
}

Effect hidden_effect(const Scene& scene, const WhatOptions& what, Purpose purpose, std::size_t occluders) {
    const std::string name = "hidden folding";
    if (purpose == Purpose::mesh) return {name, false, "the mesh may be looked at from elsewhere"};
    if (!folds_hidden(scene, what, purpose))
        return {name, false, is_perceptual(what) ? "nothing solid is looked at from outside" : "only the perceptual fold tests know what a fold changes"};
    if (occluders == 0) return {name, false, "no sphere fits into the solid"};
    return {name, true, "what is behind one of " + std::to_string(occluders) + " spheres inside the solid is folded"};
}

Effect translucency_effect(const Scene& scene, const WhatOptions& what) {
    if (!is_perceptual(what)) return {"translucency", false, "only the perceptual fold test knows it"};
    if (!is_translucent(scene)) return {"translucency", false, "no vertex has an alpha below 1"};
    return {"translucency", true, "where a vertex has an alpha below 1, anything in the scene may show through"};
}

// Every effect with its reason.
void add_effects(Simplification& result, const Scene& scene, const WhatOptions& what, Purpose purpose) {
    result.effects = {fold_test_effect(what),
                      gaze_effect(what),
                      silhouette_effect(scene, what),
                      csf_effect(scene, what),
                      chroma_effect(scene, what),
                      translucency_effect(scene, what),
                      texture_effect(scene, what),
                      prelit_effect(scene),
                      light_effect(scene, what),
                      frustum_effect(what, purpose),
                      culling_effect(scene, purpose),
                      magnification_effect(scene, what),
                      distance_effect(what, result)};
}

Effect time_limit_effect(const WhatOptions& what, const Simplification& result) {
    if (!what.milliseconds) return {"time limit", false, "none is given"};
    return {"time limit", true,
            result.stats.is_complete ? "the cut was made within it" : "it ended the cut; the worst folds were undone first"};
}

Effect geomorph_effect(const vdtree::Geomorph* geomorph, const Simplification& result) {
    if (!geomorph) return {"geomorphs", false, "vertices do not glide unless --geomorph says for how long"};
    return {"geomorphs", true,
            "vertices glide for " + rounded(geomorph->seconds(), 3) + " s; " + grouped(result.gliding) + " do now, and " +
                grouped(*result.drawn_triangles - result.stats.triangles) + " triangles wait for them to be folded"};
}

// What is taken in place of the test by errors where that does not know the scene, or would have to measure a very large tree first.
void take_default(const Scene& scene, WhatOptions& what) {
    constexpr vdtree::NodeId most_measured = 2'000'000; // nodes; about a minute on one core
    const auto take = [&](FoldTest test, const char* why) {
        what.test = test;
        what.fold_test = name_of(test);
        what.why_not_error = why;
    };
    if (!scene.tree.texture().empty()) take(FoldTest::luebke_hallen_safe, "the test error does not know textures");
    else if (scene.lighting) take(FoldTest::luebke_hallen, "the test error does not know lights that move");
    else if (what.chroma) take(FoldTest::luebke_hallen, "the test error does not know colours");
    else if (scene.tree.fold_errors().empty() && scene.tree.interior_count() > most_measured)
        take(FoldTest::luebke_hallen, "the tree does not hold the errors of its folds, and measuring them takes long: unseen build --fold-errors");
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

Result<void> settle_fold_test(Scene& scene, WhatOptions& what) {
    if (what.mode == Mode::full || what.test != FoldTest::error) return {};
    if (!what.is_fold_test_given) take_default(scene, what);
    if (what.test != FoldTest::error || !scene.tree.fold_errors().empty()) return {};
    if (!scene.tree.texture().empty())
        return Error{ErrorCode::invalid_argument, "--fold-test error does not measure textures: use --fold-test luebke-hallen-safe, or add --no-texture."};
    constexpr vdtree::NodeId told_from = 20'000; // nodes; about half a second on one core
    if (scene.tree.interior_count() >= told_from)
        print_note("measuring what folds change (unseen build --fold-errors keeps that in the tree) ...");
    auto measured = vdtree::with_fold_errors(scene.tree);
    if (!measured) return measured.error();
    scene.tree = std::move(*measured);
    return {};
}

Result<Simplification> simplify(vdtree::Cut& cut, const Scene& scene, const WhatOptions& what, Purpose purpose) {
    if (what.mode != Mode::full && goes_by_distances(scene, what)) {
        Follower follower;
        follower.set_hysteresis(1);
        return follower.follow(cut, scene, what, purpose);
    }
    if (is_perceptual(what)) scene.csf_table(); // built once; not this cut's time
    Simplification result;
    result.source_triangles = scene.tree.triangle_count();
    result.dropped = scene.tree.dropped_triangles();

    const auto start = Clock::now();
    result.stats = adjust(cut, scene, what, purpose);
    result.adapt_ms = milliseconds_since(start);
    const auto adapted = Clock::now();
    static_cast<void>(cut.indices());
    result.extract_ms = milliseconds_since(adapted);

    result.imperceptible_from_m = imperceptible_from(scene, what, result.stats);
    add_effects(result, scene, what, purpose);
    return result;
}

Result<std::vector<float>> fold_costs(const Scene& scene, const WhatOptions& what, Purpose purpose) {
    if (goes_by_distances(scene, what)) {
        Follower follower;
        const auto criterion = follower.criterion_for(scene, what);
        if (!criterion) return criterion.error();
        vdtree::FollowOptions options;
        options.cull_back_faces = purpose == Purpose::picture && culls_back_faces(scene);
        return vdtree::find_every_cost(scene.tree, **criterion, follower.viewpoint_for(scene, what, purpose), options);
    }
    std::vector<vdtree::NodeId> nodes(scene.tree.interior_count());
    std::iota(nodes.begin(), nodes.end(), vdtree::NodeId(0));
    std::vector<float> costs(nodes.size());
    with_criterion(scene, what, [&](const auto& criterion) { criterion(scene.tree, nodes, costs); });
    return costs;
}

Result<const vdtree::DistanceCriterion*> Follower::criterion_for(const Scene& scene, const WhatOptions& what) {
    const bool perceptual = is_perceptual(what);
    // A budget goes by the order of the costs alone, for which any tolerance will do.
    const double tolerance_px = what.mode == Mode::pixels ? what.pixels : 1;
    Key key{what.test, perceptual ? 0 : tolerance_px, false, 0, scene.view.width, scene.view.height, scene.view.fov_y_degrees, {0, 0}, false, nullptr};
    if (perceptual) {
        const perception::FoldTestOptions options = test_options(scene, what);
        key.scene = options.scene;
        key.is_lit = scene.lighting.has_value();
        key.has_gaze = options.gaze_px.has_value();
        key.csf = options.csf;
        key.chroma = options.chroma;
        // A gaze off the window reaches into larger magnifications: one criterion must do for all gazes up to there, so they are
        // rounded up to whole windows.
        if (key.has_gaze) {
            const double side = std::max(scene.view.width, scene.view.height);
            const glm::dvec2 from_centre = *what.gaze_px - glm::dvec2(scene.view.width, scene.view.height) * 0.5;
            key.farthest_gaze_px = std::ceil(std::max(glm::length(from_centre) / side, 1.0)) * side;
        }
    }
    if (criterion_ && key == key_) return &*criterion_;

    auto made = [&]() -> Result<vdtree::DistanceCriterion> {
        if (what.test == FoldTest::extent) return vdtree::extent_criterion(scene.tree, scene.view, tolerance_px);
        if (what.test == FoldTest::displacement) return vdtree::displacement_criterion(scene.tree, scene.view, tolerance_px);
        perception::FoldTestOptions options = test_options(scene, what);
        if (key.has_gaze)
            options.gaze_px = glm::dvec2(scene.view.width * 0.5 + key.farthest_gaze_px, scene.view.height * 0.5);
        if (scene.lighting && what.test != FoldTest::luebke_hallen)
            return Error{ErrorCode::invalid_argument, "--fold-test " + name_of(what.test) + " knows only the light that the tree was built for: "
                                                      "with --lights, use --fold-test luebke-hallen."};
        if (scene.lighting && what.chroma)
            return Error{ErrorCode::invalid_argument, "--chroma and --lights exclude each other: ranges of colour are those of the tree's own light."};
        if (what.chroma && !scene.tree.texture().empty())
            return Error{ErrorCode::invalid_argument, "--chroma does not look at the colours of textures: leave it out, or add --no-texture."};
        if (scene.lighting) return perception::lit_distances(scene.tree, scene.light_bounds, scene.view, options);
        if (what.test == FoldTest::luebke_hallen) return perception::luebke_hallen_distances(scene.tree, scene.view, options);
        if (what.test == FoldTest::luebke_hallen_safe) {
            if (!rings_) rings_ = vdtree::bound_cut_rings(scene.tree);
            return perception::luebke_hallen_safe_distances(scene.tree, *rings_, scene.view, options);
        }
        return perception::error_distances(scene.tree, scene.view, options);
    }();
    if (!made) return made.error();
    criterion_ = std::move(*made);
    key_ = key;
    return &*criterion_;
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

vdtree::Viewpoint Follower::viewpoint_for(const Scene& scene, const WhatOptions& what, Purpose purpose) {
    // Where all is seen, a turning window must not cost anything.
    const bool window_only = purpose == Purpose::picture && !is_wholly_in_window(scene);
    vdtree::Viewpoint viewpoint =
        perception::viewpoint_of(scene.tree, scene.view, test_options(scene, what), scene.placement, window_only);
    if (scene.lighting) viewpoint.lighting = *scene.lighting;
    if (folds_hidden(scene, what, purpose)) {
        if (!inner_spheres_) inner_spheres_ = vdtree::inner_spheres(scene.tree);
        viewpoint.occluders = *inner_spheres_;
    }
    // What comes into the window shall not glide there any more.
    if (window_only && geomorph_) viewpoint.frusta = {vdtree::frustum_of(scene.tree, widened(scene.view), scene.placement)};
    return viewpoint;
}

Result<Simplification> Follower::change(vdtree::Cut& cut, const Scene& scene, const WhatOptions& what, Purpose purpose) {
    const bool is_full = what.mode == Mode::full && cut.triangle_count() == scene.tree.triangle_count();
    if (what.mode == Mode::full && !is_full) return simplify(cut, scene, what, purpose);
    Simplification result;
    result.source_triangles = scene.tree.triangle_count();
    result.dropped = scene.tree.dropped_triangles();
    result.stats.triangles = cut.triangle_count();
    vdtree::Viewpoint viewpoint;
    if (!is_full) {
        const auto criterion = criterion_for(scene, what);
        if (!criterion) return criterion.error();
        vdtree::FollowOptions options;
        options.threshold = static_cast<float>(threshold_);
        options.cull_back_faces = purpose == Purpose::picture && culls_back_faces(scene);
        options.milliseconds = what.milliseconds;
        if (what.mode == Mode::budget) {
            options.triangle_budget = what.triangles;
            options.fill_budget = what.fill_budget;
            options.hysteresis = hysteresis_;
        }
        viewpoint = viewpoint_for(scene, what, purpose);
        const auto start = Clock::now();
        const auto stats = cut.follow(**criterion, viewpoint, options);
        result.adapt_ms = milliseconds_since(start);
        if (!stats) return stats.error();
        result.stats = *stats;
    }
    result.imperceptible_from_m = imperceptible_from(scene, what, result.stats);
    add_effects(result, scene, what, purpose);
    if (is_full) return result;
    result.effects.push_back(back_face_effect(scene, purpose));
    result.effects.push_back(hidden_effect(scene, what, purpose, viewpoint.occluders.size()));
    result.effects.push_back(time_limit_effect(what, result));
    if (is_perceptual(what) && what.mode != Mode::budget)
        for (Effect& effect : result.effects)
            if (effect.name == imperceptible_distance)
                effect.why = "the display's distance times " + rounded(threshold_, 4) + ", above which no fold costs";
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
    result->effects.push_back(geomorph_effect(geomorph(), *result));
    return result;
}

Json to_json(const Simplification& s, double draw_ms) {
    Json effects = Json::array();
    for (const Effect& effect : s.effects)
        effects.push_back({{"name", effect.name}, {"on", effect.on}, {"why", effect.why}});
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
            {"effects", effects}};
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
    for (const Effect& effect : s.effects)
        std::printf("  %-3s  %s: %s\n", effect.on ? "on" : "off", effect.name.c_str(), effect.why.c_str());
}

} // namespace unseen::app
