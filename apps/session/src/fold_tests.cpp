// The fold tests: what each is called, what it looks at and how its criterion is made. A new test is a value of
// FoldTest and a row here.
#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include "fold_test.h"

namespace unseen::session {
namespace {

using Criterion = Result<vdtree::DistanceCriterion>;

struct Row {
    FoldTestFacts facts;
    std::string (*looks_at)(const Sight& sight);
    Criterion (*make)(Sight& sight, const Key& key);
};

Criterion make_luebke_hallen(Sight& sight, const Key& key) {
    const perception::FoldTestOptions options = test_options(sight, key);
    return sight.lighting ? perception::lit_distances(sight.object.tree, sight.cache.light_bounds, sight.view, options)
                          : perception::luebke_hallen_distances(sight.object.tree, sight.view, options);
}

Criterion make_luebke_hallen_safe(Sight& sight, const Key& key) {
    const perception::FoldTestOptions options = test_options(sight, key);
    const vdtree::VertexTree& tree = sight.object.tree;
    const auto rings = cut_rings(sight.object, sight.cache);
    if (!rings) return rings.error();
    if (!sight.lighting) return perception::luebke_hallen_safe_distances(tree, **rings, sight.view, options);
    auto bounds = lit_cut_rings(sight.object, sight.cache);
    if (!bounds) return bounds.error();
    return perception::lit_safe_distances(tree, **rings, std::move(*bounds), sight.view, options);
}

// The lights that are left when a set of those that cast shadows is hidden, for each set that leaves some light.
std::vector<vdtree::Lighting> without_hidden(const vdtree::Lighting& lighting) {
    std::vector<vdtree::Lighting> all;
    const std::size_t casting = vdtree::shadow_lights(lighting);
    for (unsigned hidden = 1; hidden < 1u << casting; ++hidden) {
        vdtree::Lighting left = lighting;
        left.lights.clear();
        unsigned number = 0;
        for (const vdtree::LightSource& light : lighting.lights)
            if (!light.casts_shadow || (hidden >> number++ & 1) == 0) left.lights.push_back(light);
        if (vdtree::validate(left)) all.push_back(std::move(left));
    }
    return all;
}

Criterion make_error(Sight& sight, const Key& key) {
    const perception::FoldTestOptions options = test_options(sight, key);
    const vdtree::VertexTree& tree = sight.object.tree;
    if (!sight.lighting) return perception::error_distances(tree, sight.view, options);
    std::vector<vdtree::Lighting> lightings; // of which the worst counts
    if (sight.stretch) {
        lightings = *sight.stretch;
    } else {
        lightings = without_hidden(*sight.lighting);
        lightings.insert(lightings.begin(), *sight.lighting);
    }
    std::vector<perception::TreeAsLit> all;
    const glm::dvec3 eye = vdtree::eye_in_tree(tree, sight.view, sight.object.placement);
    for (vdtree::Lighting& lighting : lightings) {
        auto lit = sight.cache.lit_folds->under(tree, lighting, eye);
        if (!lit) return lit.error();
        all.push_back({std::move(*lit), std::move(lighting)});
    }
    if (all.size() == 1) return perception::error_distances(all.front().tree, sight.view, options);
    return perception::error_distances(all, sight.view, options);
}

Criterion make_extent(Sight& sight, const Key& key) {
    return vdtree::extent_criterion(sight.object.tree, sight.view, key.pixels);
}

Criterion make_displacement(Sight& sight, const Key& key) {
    return vdtree::displacement_criterion(sight.object.tree, sight.view, key.pixels);
}

std::string pixels_on_the_screen(const Sight&) { return "pixels on the screen, whether they can be seen or not"; }

constexpr Row rows[] = {
    {{FoldTest::error, "error", "measured errors", "perceptual: what folds change in fact; default", true, true},
     [](const Sight& sight) {
         return std::string("what each fold changes in luminance and outline, ") +
                (sight.lighting ? "from whichever side the lights come, " : "") + "against the contrast sensitivity";
     },
     make_error},
    {{FoldTest::luebke_hallen_safe, "luebke-hallen-safe", "Luebke-Hallen, safe",
      "perceptual: what they could change at most, more triangles", true, true},
     [](const Sight& sight) {
         return std::string("the worst grating of each fold with any neighbours folded, ") +
                (sight.lighting ? "under the lights, " : "and the shift of the mean, ") +
                "against the contrast sensitivity";
     },
     make_luebke_hallen_safe},
    {{FoldTest::luebke_hallen, "luebke-hallen", "Luebke-Hallen", "as published, unsafe: some folds can be seen", true,
      false},
     [](const Sight&) { return std::string("the worst grating of each fold against the contrast sensitivity"); },
     make_luebke_hallen},
    {{FoldTest::extent, "extent", "extent in pixels", "in pixels; the default with --pixels", false, false},
     pixels_on_the_screen,
     make_extent},
    {{FoldTest::displacement, "displacement", "displacement in pixels", "in pixels", false, false},
     pixels_on_the_screen,
     make_displacement},
};

constexpr auto all_facts = [] {
    std::array<FoldTestFacts, std::size(rows)> all{};
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = rows[i].facts;
    return all;
}();

const Row& row_of(FoldTest test) {
    return *std::ranges::find_if(rows, [&](const Row& row) { return row.facts.test == test; });
}

} // namespace

std::span<const FoldTestFacts> fold_tests() noexcept { return all_facts; }
const FoldTestFacts& facts_of(FoldTest test) noexcept { return row_of(test).facts; }
bool is_perceptual(FoldTest test) noexcept { return facts_of(test).is_perceptual; }
std::string name_of(FoldTest test) { return std::string(facts_of(test).name); }

std::string what_it_looks_at(const Sight& sight, FoldTest test) { return row_of(test).looks_at(sight); }

Result<vdtree::DistanceCriterion> make_criterion(Sight& sight, const Key& key) {
    return row_of(key.test).make(sight, key);
}

// ---- what criteria depend on

namespace {

// The view without its place, which only viewpoints depend on; so do they on the height of an orthographic one.
vdtree::View lens_of(vdtree::View view) {
    const vdtree::View nowhere;
    view.eye = nowhere.eye, view.target = nowhere.target, view.up = nowhere.up;
    if (view.orthographic_height) view.orthographic_height = 1;
    return view;
}

// A gaze off the window reaches into larger magnifications: one criterion must do for all gazes up to there, so they
// are rounded up to whole windows.
double farthest_gaze_px(const vdtree::View& view, glm::dvec2 gaze_px) {
    const double side = std::max(view.width, view.height);
    return std::ceil(std::max(glm::length(gaze_px - vdtree::axis_px(view)) / side, 1.0)) * side;
}

// A budget goes by the order of the costs alone, for which any tolerance will do.
double tolerance_px(const Goal& goal) { return goal.kind == Goal::Kind::pixels ? goal.tolerance_px : 1; }

} // namespace

Key key_of(const Sight& sight, const Decision& decision) {
    Key key;
    key.test = decision.test;
    key.lens = lens_of(sight.view);
    if (!is_perceptual(decision.test)) {
        key.pixels = tolerance_px(decision.request.goal);
        return key;
    }
    key.scene = sight.luminance;
    key.is_lit = sight.lighting != nullptr;
    if (decision.test == FoldTest::error && sight.stretch) key.stretch = sight.stretch;
    else if (decision.test == FoldTest::error) key.still_lights = sight.lighting;
    if (key.still_lights && key.still_lights->specular > 0) key.eye = sight.view.eye;
    key.csf = sight.csf;
    if (sight.gaze_px) key.farthest_gaze_px = farthest_gaze_px(sight.view, *sight.gaze_px);
    return key;
}

perception::FoldTestOptions test_options(const Sight& sight, const Key& key) {
    perception::FoldTestOptions options = test_options(sight);
    if (key.farthest_gaze_px) options.gaze_px = vdtree::axis_px(sight.view) + glm::dvec2(*key.farthest_gaze_px, 0);
    return options;
}

std::shared_ptr<const KeptCriterion>& last_criterion(Sight& sight, const Key& key) {
    return key.still_lights || key.stretch ? sight.lit_criterion : sight.cache.criterion;
}

} // namespace unseen::session
