// What the fold tests call invisible, under the oracle's eyes.
#include <algorithm>
#include <cmath>
#include <string>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <perception/criterion.h>
#include <perception/display.h>
#include <perception/judge.h>
#include <render/context.h>
#include <render/renderer.h>

#include "measured.h"
#include "oracle.h"
#include "shapes.h"

namespace unseen {
namespace {

using support::built;
using vdtree::Cut;
using vdtree::Mesh;
using vdtree::VertexTree;
using vdtree::View;

VertexTree measured(const Mesh& mesh) { return support::measured(built(mesh), 0); }

Mesh painted(Mesh mesh, double (*grey)(glm::dvec3)) {
    for (const glm::dvec3& p : mesh.positions) {
        const auto g = static_cast<float>(grey(p));
        mesh.colours.push_back({g, g, g, 1});
    }
    return mesh;
}

double noise_at(glm::dvec3 p) { // one value for a place, evenly spread over 4% of grey
    const double n = std::sin(glm::dot(p, glm::dvec3(1271.3, 3117.7, 741.9))) * 43758.5453;
    return 0.5 + 0.04 * (n - std::floor(n) - 0.5);
}

struct Case {
    const char* name;
    Mesh (*make)();
};
const Case cases[] = {
    {"organic", [] { return shapes::bumpy_sphere(5, 0.02); }},
    {"cad", [] { return shapes::together(shapes::cube(16), shapes::placed(shapes::torus(60, 24), 0.5, {4, 0.5, 0})); }},
    {"checkerboard",
     [] { return painted(shapes::icosphere(5), [](glm::dvec3 p) { return std::sin(20 * p.x) * std::sin(20 * p.y) > 0 ? 0.8 : 0.2; }); }},
    {"noise", [] { return painted(shapes::icosphere(5), noise_at); }},
    {"inside_out", [] { return shapes::inside_out(shapes::bumpy_sphere(4, 0.03)); }},
    {"open", [] { return shapes::grid(40); }},
};

class FoldOracleRuns : public testing::TestWithParam<Case> {
protected:
    template <class MakeCriterion, class Check>
    void run(const VertexTree& tree, MakeCriterion&& make_criterion, Check&& check) const {
        auto context = render::Context::headless();
        ASSERT_TRUE(context) << context.error().message;
        auto renderer = render::Renderer::create(*context, tree);
        ASSERT_TRUE(renderer) << renderer.error().message;
        for (const oracle::Look& look : oracle::looks_at(tree)) {
            const auto criterion = make_criterion(look.view, look.options);
            ASSERT_TRUE(criterion) << criterion.error().message;
            EXPECT_TRUE(criterion->is_monotone());
            Cut whole(tree), cut(tree);
            whole.unfold_all();
            const bool is_closed = tree.closedness() != vdtree::Closedness::open;
            ASSERT_TRUE(cut.follow(*criterion, perception::viewpoint_of(tree, look.view, look.options), {.cull_back_faces = is_closed}));
            const perception::Image before = oracle::draw(*renderer, whole, look.view), after = oracle::draw(*renderer, cut, look.view);
            for (const perception::CsfModel model : oracle::judges) {
                const perception::Judgement judged = oracle::judge(before, after, look, model);
                SCOPED_TRACE("from " + oracle::words(look) + ", " + std::to_string(cut.triangle_count()) + " of " +
                             std::to_string(tree.triangle_count()) + " triangles, largest V " + std::to_string(judged.max_ratio));
                check(judged);
            }
        }
    }
};
INSTANTIATE_TEST_SUITE_P(Meshes, FoldOracleRuns, testing::ValuesIn(cases), [](const auto& test) { return std::string(test.param.name); });

TEST_P(FoldOracleRuns, SeeNothingOfWhatLuebkeAndHallensTestFolds) {
    const VertexTree tree = built(GetParam().make());
    run(
        tree, [&](const View& view, const perception::FoldTestOptions& options) { return perception::luebke_hallen_distances(tree, view, options); },
        [](const perception::Judgement& judged) { EXPECT_EQ(judged.visible_pixels, 0u); });
}

TEST_P(FoldOracleRuns, SeeNothingOfWhatTheSafeTestFolds) {
    const VertexTree tree = built(GetParam().make());
    const perception::CutRings rings = *perception::bound_cut_rings(tree);
    run(
        tree, [&](const View& view, const perception::FoldTestOptions& options) { return perception::luebke_hallen_safe_distances(tree, rings, view, options); },
        [](const perception::Judgement& judged) { EXPECT_EQ(judged.visible_pixels, 0u); });
}

// It is measured, not proven: differences may exceed the threshold a little (see docs/perception.md), but no more.
TEST_P(FoldOracleRuns, SeeLittleOfWhatTheErrorTestFolds) {
    const VertexTree tree = measured(GetParam().make());
    run(
        tree, [&](const View& view, const perception::FoldTestOptions& options) { return perception::error_distances(tree, view, options); },
        [](const perception::Judgement& judged) { EXPECT_LT(judged.max_ratio, 2); });
}

// From far away everything folds to a few triangles, and in the corner of the eye sooner.
TEST(FoldDistance, LeavesLittleOfAFarObject) {
    const VertexTree tree = measured(shapes::bumpy_sphere(6, 0.002)); // rougher ones grow darker where they are folded, which shows
    const perception::Display display;
    View view;
    view.fov_y_degrees = perception::physical_field(display, view.height).value();
    const vdtree::Sphere sphere = tree.bounding_sphere();
    const auto triangles = [&](double fill, bool aside) {
        perception::FoldTestOptions options;
        options.display = display;
        if (aside) options.gaze_px = glm::dvec2(1603, 512);
        const View from = vdtree::frame_sphere(tree.origin() + glm::dvec3(sphere.centre), sphere.radius, {0, 0, 1}, fill, view);
        const auto criterion = perception::error_distances(tree, from, options);
        if (!criterion) throw std::runtime_error(criterion.error().message);
        Cut cut(tree);
        EXPECT_TRUE(cut.follow(*criterion, perception::viewpoint_of(tree, from, options)));
        return cut.triangle_count();
    };
    const auto near = triangles(0.9, false), far = triangles(0.02, false), farther = triangles(0.002, false), farthest = triangles(1e-6, false);
    EXPECT_LT(far, near);
    EXPECT_LT(farther, near / 2);
    EXPECT_LE(farthest, 4u);
    EXPECT_LT(triangles(0.9, true), near);
}

} // namespace
} // namespace unseen
