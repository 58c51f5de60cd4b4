// Orthographic views: where things are drawn, what hides what, and that nobody sees what is folded for them.
#include "gl_test.h"
#include "scenes.h"

#include <unseen/render/renderer.h>
#include <unseen/render/sample_sum.h>

#include "measured.h"
#include "oracle.h"
#include "shapes.h"

namespace orthographic_test {

using namespace unseen;
using namespace unseen::render;
using namespace unseen::render::testing;
using vdtree::Similarity;
using vdtree::View;

constexpr float exactly = 1e-5f; // relative luminance: a rasteriser's interpolation in float

float at(const Frame& frame, int column, int row) {
    return frame.luminance[static_cast<std::size_t>(row * frame.width + column)];
}

class Orthographic : public GlTest {
protected:
    Frame draw(const Scene& scene, const View& view, const DrawOptions& options = {}) {
        auto renderer = require(Renderer::create(context(), scene.tree));
        auto frame = require(renderer->draw(scene.cut, view, options));
        EXPECT_EQ(context().take_errors(), "");
        return std::move(*frame);
    }
};

// Four units high and eight wide, so that a unit is 16 pixels; and one square unit at each depth, also behind the eye.
TEST_F(Orthographic, PlacesAndSizesDoNotDependOnTheDepth) {
    for (const double depth : {-1e4, -3.0, 0.0, 1.0, 2.5, 1e4}) {
        const Scene scene(rectangle({1, 0.5}, {2, 1.5}, depth, grey(0.9f)));
        DrawOptions options;
        options.background = 0.25f;
        const Frame frame = draw(scene, {.width = 128, .height = 64, .orthographic_height = 4}, options);
        for (int row = 0; row < 64; ++row)
            for (int column = 0; column < 128; ++column) {
                const bool is_in = column >= 80 && column < 96 && row >= 8 && row < 24;
                ASSERT_NEAR(at(frame, column, row), is_in ? 0.9f : 0.25f, exactly)
                    << column << " " << row << ", depth " << depth;
            }
    }
}

// In one tree, and of two that share a target: one is a thousand times as large in its own units as the other.
TEST_F(Orthographic, WhatIsNearerHidesWhatIsFarther) {
    const View view{.eye = {0, 0, 5}, .width = 32, .height = 32, .orthographic_height = 2};
    Mesh both = rectangle({-1, -1}, {1, 1}, -2, grey(0.2f));
    add_rectangle(both, {0, -1}, {1, 1}, 7, grey(0.8f)); // behind the eye
    const Frame one = draw(Scene(both), view);
    EXPECT_NEAR(at(one, 8, 16), 0.2f, exactly);
    EXPECT_NEAR(at(one, 24, 16), 0.8f, exactly);

    const Scene far(rectangle({-1, -1}, {1, 1}, 0, grey(0.3f)));
    const Scene near(rectangle({0, -1000}, {1000, 1000}, 0, grey(0.6f)));
    const auto item = [&](const Scene& scene, Similarity placement) {
        auto tree = require(GpuTree::create(context(), scene.tree));
        GpuCut cut(*tree);
        EXPECT_TRUE(cut.follow(scene.cut));
        return Item{cut, placement};
    };
    auto sum = require(SampleSum::create(context(), 32, 32));
    for (const double distance : {1e-4, 1.0, 50.0}) {
        const Item back = item(far, {}), front = item(near, {.scale = 1e-3, .translation = {0, 0, distance}});
        for (const auto& items : {std::vector{back, front}, {front, back}}) {
            ASSERT_TRUE(sum->draw(items, view, Sampling{}));
            const auto pixels = require(sum->mean());
            EXPECT_NEAR((*pixels)[16 * 32 + 8].a, 0.3f, exactly) << distance;
            EXPECT_NEAR((*pixels)[16 * 32 + 24].a, 0.6f, exactly) << distance;
        }
    }
}

// From so far away that what perspective is left moves nothing by more than a thousandth of a pixel.
TEST_F(Orthographic, IsWhatPerspectiveBecomesFarAway) {
    constexpr double away = 1e5, height = 2.4; // in radii of the model; units
    const Scene scene(bumpy_sphere(24));
    View parallel{.eye = {1, 2, 3}, .width = 96, .height = 96, .orthographic_height = height};
    View perspective = parallel;
    perspective.orthographic_height.reset();
    perspective.eye = away * glm::normalize(parallel.eye);
    perspective.fov_y_degrees = glm::degrees(2 * std::atan(height / 2 / away));
    const Frame a = draw(scene, parallel, {.samples = 16}), b = draw(scene, perspective, {.samples = 16});
    int covered = 0, differ = 0;
    for (std::size_t i = 0; i < a.luminance.size(); ++i) {
        const double off = std::abs(static_cast<double>(a.luminance[i]) - b.luminance[i]);
        differ += off > 1e-3;
        covered += a.luminance[i] != a.luminance[0]; // a corner shows the background
    }
    EXPECT_GT(covered, 96 * 96 / 3);
    EXPECT_LE(differ, 96 * 96 / 100); // outlines that a sample falls on
}

TEST_F(Orthographic, PassesThatKnowOnlyPerspectiveSaySo) {
    const Scene scene(rectangle({-1, -1}, {1, 1}, 0, grey(0.5f)));
    auto tree = require(GpuTree::create(context(), scene.tree));
    const Item item{GpuCut(*tree)};
    const View view{.width = 16, .height = 16, .orthographic_height = 2};
    const auto near = near_plane({&item, 1}, view);
    ASSERT_FALSE(near);
    EXPECT_NE(near.error().message.find("orthographic"), std::string::npos) << near.error().message;
    auto target = require(Target::create(context(), 16, 16, {}));
    EXPECT_FALSE(render::draw({&item, 1}, {.view = view, .near_plane = 1}, *target));
    EXPECT_TRUE(render::draw({&item, 1}, {.view = view}, *target));
}

// Whole, a part that fills the window, and small, from all around.
TEST_F(Orthographic, NobodySeesWhatIsFolded) {
    const vdtree::VertexTree tree =
        support::measured(support::built(shapes::placed(shapes::bumpy_sphere(5, 0.02), 0.1, {0, 0, 0})), 0);
    auto renderer = require(Renderer::create(context(), tree));
    int i = 0;
    for (oracle::Look look : oracle::looks_at(tree, {.window_px = 320, .count = 6})) {
        look.view.orthographic_height = std::array{0.25, 0.05, 2.0}.at(static_cast<std::size_t>(i++ % 3));
        look.options.gaze_px = {};
        const auto criterion = require(perception::error_distances(tree, look.view, look.options));
        vdtree::Cut whole(tree), cut(tree);
        whole.unfold_all();
        ASSERT_TRUE(cut.follow(*criterion, vdtree::viewpoint_of(tree, look.view, {}, true), {.cull_back_faces = true}));
        EXPECT_LT(cut.triangle_count(), whole.triangle_count());
        EXPECT_GT(cut.triangle_count(), 0u);
        const auto judged = oracle::judge(oracle::draw(*renderer, whole, look.view),
                                          oracle::draw(*renderer, cut, look.view), look, perception::CsfModel::castle);
        EXPECT_EQ(judged.visible_pixels, 0u) << oracle::words(look) << ", largest V " << judged.max_ratio;
        std::printf("%g units high: %u of %u triangles, largest V %.2f\n", *look.view.orthographic_height,
                    cut.triangle_count(), whole.triangle_count(), static_cast<double>(judged.max_ratio));
    }
}

} // namespace orthographic_test
