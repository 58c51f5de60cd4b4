#include "fold_test.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include <vdtree/conserve_light.h>
#include <vdtree/fold_errors.h>

#include "terminal.h"

namespace unseen::app {
namespace {

perception::FoldTestOptions test_options(const Scene& scene, const WhatOptions& what) {
    perception::FoldTestOptions test;
    test.display = scene.display;
    test.scene = scene_luminance(scene);
    test.csf = scene.csf;
    test.chroma = what.chroma;
    if (!what.gaze_px) return test;
    if (what.gaze_margin_deg != 0) {
        auto around_gaze = scene.csf_table(perception::Degrees(what.gaze_margin_deg));
        if (!around_gaze) return test;
        test.csf = std::move(around_gaze);
    }
    test.gaze_px = what.gaze_px;
    return test;
}

// A budget goes by the order of the costs alone, for which any tolerance will do.
double tolerance_px(const WhatOptions& what) { return what.mode == Mode::pixels ? what.pixels : 1; }

// Whether the test that was chosen knows what it would have to look at.
Result<void> check_knowledge(const Scene& scene, const WhatOptions& what) {
    if (!is_perceptual(what.test())) return {};
    const auto complaint = [](const std::string& message) { return Error{ErrorCode::invalid_argument, message}; };
    if (scene.lighting && what.test() != FoldTest::luebke_hallen)
        return complaint("--fold-test " + name_of(what.test()) +
                         " knows only the light that the tree was built for: with --lights, use --fold-test luebke-hallen.");
    if (scene.lighting && what.chroma)
        return complaint("--chroma and --lights exclude each other: ranges of colour are those of the tree's own light.");
    if (scene.tree.texture().empty()) return {};
    if (what.chroma) return complaint("--chroma does not look at the colours of textures: leave it out, or add --no-texture.");
    if (what.test() == FoldTest::error)
        return complaint("--fold-test error does not measure textures: use --fold-test luebke-hallen-safe, or add --no-texture.");
    return {};
}

Result<void> measure_errors(Scene& scene) {
    constexpr vdtree::NodeId told_from = 20'000; // nodes; about half a second on one core
    if (scene.tree.interior_count() >= told_from)
        print_note("measuring what folds change (unseen build --fold-errors keeps that in the tree) ...");
    auto tree = measured(scene.tree);
    if (!tree) return tree.error();
    scene.replace_tree(std::move(*tree));
    return {};
}

bool is_wholly_in_window(const Scene& scene) {
    const vdtree::Sphere sphere = scene.tree.bounding_sphere();
    const vdtree::Frustum frustum = vdtree::frustum_of(scene.tree, scene.view, scene.placement);
    return std::all_of(frustum.planes.begin(), frustum.planes.end(), [&](const vdtree::Plane& plane) {
        return glm::dot(plane.normal, glm::dvec3(sphere.centre)) + plane.offset > static_cast<double>(sphere.radius);
    });
}

// What a criterion depends on, besides what a scene never changes.
struct Key {
    FoldTest test = FoldTest::error;
    double pixels = 0; // of the others than perceptual tests; and of these alone:
    std::optional<double> farthest_gaze_px = {};
    perception::SceneLuminance scene = {0, 0};
    bool is_lit = false, chroma = false;
    std::shared_ptr<const perception::CsfTable> csf = {}; // kept, so that no other table comes to its address
    int width = 0, height = 0;
    double fov_y_degrees = 0;
    bool operator==(const Key&) const = default;
};

// A gaze off the window reaches into larger magnifications: one criterion must do for all gazes up to there, so they are rounded up to whole
// windows.
double farthest_gaze_px(const vdtree::View& view, glm::dvec2 gaze_px) {
    const double side = std::max(view.width, view.height);
    const glm::dvec2 from_centre = gaze_px - glm::dvec2(view.width, view.height) * 0.5;
    return std::ceil(std::max(glm::length(from_centre) / side, 1.0)) * side;
}

Key key_of(const Scene& scene, const WhatOptions& what) {
    Key key;
    key.test = what.test();
    key.width = scene.view.width;
    key.height = scene.view.height;
    key.fov_y_degrees = scene.view.fov_y_degrees;
    if (!is_perceptual(what)) {
        key.pixels = tolerance_px(what);
        return key;
    }
    const perception::FoldTestOptions options = test_options(scene, what);
    key.scene = options.scene;
    key.is_lit = scene.lighting.has_value();
    key.chroma = options.chroma;
    key.csf = options.csf;
    if (options.gaze_px) key.farthest_gaze_px = farthest_gaze_px(scene.view, *options.gaze_px);
    return key;
}

Result<vdtree::DistanceCriterion> make_criterion(const Scene& scene, const WhatOptions& what, const Key& key) {
    if (what.test() == FoldTest::extent) return vdtree::extent_criterion(scene.tree, scene.view, key.pixels);
    if (what.test() == FoldTest::displacement) return vdtree::displacement_criterion(scene.tree, scene.view, key.pixels);
    perception::FoldTestOptions options = test_options(scene, what);
    if (key.farthest_gaze_px)
        options.gaze_px = glm::dvec2(scene.view.width * 0.5 + *key.farthest_gaze_px, scene.view.height * 0.5);
    if (scene.lighting) return perception::lit_distances(scene.tree, scene.light_bounds, scene.view, options);
    if (what.test() == FoldTest::luebke_hallen) return perception::luebke_hallen_distances(scene.tree, scene.view, options);
    if (what.test() == FoldTest::luebke_hallen_safe) {
        const auto rings = scene.cut_rings();
        if (!rings) return rings.error();
        return perception::luebke_hallen_safe_distances(scene.tree, **rings, scene.view, options);
    }
    return perception::error_distances(scene.tree, scene.view, options);
}

} // namespace

struct KeptCriterion {
    Key key;
    vdtree::DistanceCriterion criterion;
};

// ---- which test

ChosenTest suitable_test(const Scene& scene, bool chroma, bool may_measure) {
    constexpr vdtree::NodeId most_measured = 2'000'000; // nodes; about a minute on one core
    if (scene.lighting) return {FoldTest::luebke_hallen, "the test error does not know lights that move"};
    if (!scene.tree.texture().empty()) return {FoldTest::luebke_hallen_safe, "the test error does not know textures"};
    if (chroma) return {FoldTest::luebke_hallen, "the test error does not know colours"};
    if (!scene.tree.fold_errors().empty() || (may_measure && scene.tree.interior_count() <= most_measured)) return {FoldTest::error};
    return {FoldTest::luebke_hallen, "the tree does not hold the errors of its folds, and measuring them takes long: unseen build --fold-errors"};
}

Result<vdtree::VertexTree> measured(const vdtree::VertexTree& tree, int threads) {
    const auto conserved = vdtree::conserve_light(tree);
    if (!conserved) return conserved.error();
    return vdtree::with_fold_errors(*conserved, threads);
}

Result<void> settle_fold_test(Scene& scene, WhatOptions& what) {
    const bool folds = what.mode != Mode::full;
    const ChosenTest suitable = suitable_test(scene, what.chroma, folds);
    if (!what.chosen) what.chosen = suitable;
    if (const auto known = check_knowledge(scene, what); !known) {
        if (folds) return known;
        what.chosen = suitable;
    }
    if (what.test() != FoldTest::error || !scene.tree.fold_errors().empty()) return {};
    if (folds) return measure_errors(scene);
    what.chosen = suitable;
    return {};
}

bool is_perceptual(const WhatOptions& what) { return what.mode != Mode::full && is_perceptual(what.test()); }

// ---- what it looks at

perception::SceneLuminance scene_luminance(const Scene& scene) {
    if (scene.lighting)
        return perception::lit_scene(scene.tree, *scene.light_bounds, *scene.lighting,
                                     vdtree::eye_in_tree(scene.tree, scene.view, scene.placement), scene.background);
    const vdtree::LuminanceRange range = scene.tree.luminance_range();
    const vdtree::LuminanceRange behind{scene.background, scene.background};
    return {std::min(range.lo, scene.background), std::max(range.hi, scene.background), behind};
}

bool is_translucent(const Scene& scene) { return scene.tree.bounds()[vdtree::VertexTree::root()].flags & vdtree::translucent_ring; }

bool culls_back_faces(const Scene& scene) {
    const PlacedSphere sphere = placed_sphere(scene.tree, scene.placement);
    return !is_translucent(scene) && scene.tree.closedness() != vdtree::Closedness::open &&
           glm::length(scene.view.eye - sphere.centre) > sphere.radius;
}

// Extent and displacement look at supports, which do not contain all that a fold changes.
bool folds_hidden(const Scene& scene, const WhatOptions& what, Purpose purpose) {
    return purpose == Purpose::picture && is_perceptual(what) && culls_back_faces(scene);
}

vdtree::Viewpoint viewpoint_of(const Scene& scene, const WhatOptions& what, Purpose purpose) {
    // Where all is seen, a turning window must not cost anything.
    const bool window_only = purpose == Purpose::picture && !is_wholly_in_window(scene);
    vdtree::Viewpoint viewpoint =
        perception::viewpoint_of(scene.tree, scene.view, test_options(scene, what), scene.placement, window_only);
    if (scene.lighting) viewpoint.lighting = *scene.lighting;
    if (folds_hidden(scene, what, purpose)) viewpoint.occluders.assign(scene.inner_spheres().begin(), scene.inner_spheres().end());
    return viewpoint;
}

vdtree::FollowOptions follow_options(const Scene& scene, Purpose purpose) {
    vdtree::FollowOptions options;
    options.cull_back_faces = purpose == Purpose::picture && culls_back_faces(scene);
    return options;
}

// ---- what it asks

Result<std::shared_ptr<const vdtree::DistanceCriterion>> distance_criterion(const Scene& scene, const WhatOptions& what) {
    const Key key = key_of(scene, what);
    std::shared_ptr<const KeptCriterion>& last = scene.kept.criterion;
    if (!last || !(last->key == key)) {
        auto made = make_criterion(scene, what, key);
        if (!made) return made.error();
        last = std::make_shared<const KeptCriterion>(KeptCriterion{key, std::move(*made)});
    }
    return std::shared_ptr<const vdtree::DistanceCriterion>(last, &last->criterion);
}

Result<std::vector<float>> fold_costs(const Scene& scene, const WhatOptions& what, Purpose purpose) {
    const auto criterion = distance_criterion(scene, what);
    if (!criterion) return criterion.error();
    return vdtree::find_every_cost(scene.tree, **criterion, viewpoint_of(scene, what, purpose), follow_options(scene, purpose));
}

} // namespace unseen::app
