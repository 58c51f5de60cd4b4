// Colour as a source of contrast: isoluminant patterns that luminance alone would fold.
#include <unseen/perception/criterion.h>
#include <unseen/perception/fold_measurement.h>
#include <unseen/perception/internal/chroma.h>
#include <unseen/perception/internal/cut_rings.h>

#include <glm/mat3x3.hpp>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/tree_io.h>

#include "cone_contrast.h"
#include "testing.h"

namespace unseen::perception::chroma_test {

using vdtree::Cut;
using vdtree::DistanceCriterion;
using vdtree::Index;
using vdtree::Mesh;
using vdtree::NodeId;
using vdtree::VertexTree;
using vdtree::View;
using vdtree::WedgeId;

constexpr glm::dvec3 rec709(0.2126, 0.7152, 0.0722);

// A colour of the luminance 0.3: grey, and so much of the way from there to red or, if negative, to the green of equal
// luminance.
glm::vec4 red_or_green(double saturation) {
    const glm::dvec3 grey(0.3), red = glm::dvec3(1, 0.0874 / 0.7152, 0);
    return glm::vec4(grey + saturation * (red - grey), 1);
}

// A flat square of 40 x 40 units with a checkerboard of cells of 4 x 4.
template <class Colour>
VertexTree checkerboard(Colour&& colour, vdtree::Light light = {}) {
    constexpr int n = 41;
    Mesh mesh;
    for (int row = 0; row < n; ++row) {
        for (int column = 0; column < n; ++column) {
            mesh.positions.push_back({column - n / 2, row - n / 2, 0});
            mesh.colours.push_back(colour((row / 4 + column / 4) % 2 == 0));
        }
    }
    const auto at = [](int row, int column) { return static_cast<Index>(row * n + column); };
    for (int row = 0; row + 1 < n; ++row) {
        for (int column = 0; column + 1 < n; ++column) {
            mesh.triangles.push_back({at(row, column), at(row, column + 1), at(row + 1, column + 1)});
            mesh.triangles.push_back({at(row, column), at(row + 1, column + 1), at(row + 1, column)});
        }
    }
    return std::move(*require(vdtree::build_tree(mesh.view(), {.light = light, .prelit = true})));
}
VertexTree red_green_checkerboard(double saturation) {
    return checkerboard([&](bool is_red) { return red_or_green(is_red ? saturation : -saturation); });
}

View view_from(double eye_distance) {
    View view;
    view.width = view.height = 256;
    view.eye = {0, 0, eye_distance};
    view.fov_y_degrees = physical_field(Display(), view.height).value();
    return view;
}

// Where a unit is four pixels, a cell is half a degree, and the checkerboard has a cycle a degree.
constexpr double near = 1968.5 / 4;

enum class By { error, safe, published };
constexpr By all_tests[] = {By::error, By::safe, By::published};

Result<DistanceCriterion> criterion_of(const VertexTree& tree, const View& view, By test, bool gazes = false) {
    FoldTestOptions options;
    options.scene = {0.2f, 0.4f};
    if (gazes) options.gaze_px = glm::dvec2(128, 128);
    if (test == By::error) return error_distances(*measure_folds(tree), view, options);
    return test == By::safe ? luebke_hallen_safe_distances(tree, *bound_cut_rings(tree), view, options)
                            : luebke_hallen_distances(tree, view, options);
}

Cut cut_of(const VertexTree& tree, double eye_distance, By test) {
    const View view = view_from(eye_distance);
    const auto criterion = require(criterion_of(tree, view, test));
    EXPECT_TRUE(criterion->is_monotone());
    Cut cut(tree);
    EXPECT_TRUE(cut.follow(*criterion, viewpoint_of(tree, view, {}, {}, false)));
    return cut;
}

// Triangles, without those at the border: an open edge is an outline for any test.
int inner_triangles(const Cut& cut) {
    int count = 0;
    const auto indices = cut.indices();
    for (std::size_t i = 0; i < indices.size(); i += 3) {
        bool is_inner = true;
        for (std::size_t k = 0; k < 3; ++k) {
            const glm::vec3 p = cut.tree().positions()[indices[i + k]] + glm::vec3(cut.tree().origin());
            is_inner = is_inner && std::max(std::abs(p.x), std::abs(p.y)) < 14;
        }
        count += is_inner;
    }
    return count;
}

TEST(Chroma, IsNoneOfGreysAndThatOfTheConesOtherwise) {
    for (const double grey : {0.0, 0.1, 1.0}) EXPECT_LT(glm::length(opponent_chroma(glm::dvec3(grey))), 1e-15);
    // By way of XYZ and the cones, in their own terms.
    const glm::dmat3 xyz_of_rgb =
        glm::transpose(glm::dmat3(0.41239, 0.35758, 0.18048, 0.21264, 0.71517, 0.07219, 0.01933, 0.11919, 0.95053));
    const glm::dmat3 lms_of_xyz = glm::transpose(glm::dmat3(0.187596268556126, 0.585168649077728, -0.026384263306304,
                                                            -0.133397430663221, 0.405505777260049, 0.034502127690364,
                                                            0.000244379021663, -0.000542995890619, 0.019406849066323));
    const glm::dvec3 white = lms_of_xyz * (xyz_of_rgb * glm::dvec3(1));
    for (const glm::dvec3 rgb :
         {glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1), glm::dvec3(0.3, 0.5, 0.1)}) {
        const glm::dvec3 delta = lms_of_xyz * (xyz_of_rgb * rgb) - white * glm::dot(rgb, rec709);
        const support::OpponentContrast contrast = support::opponent_contrast(white, delta);
        const glm::dvec2 chroma = opponent_chroma(rgb);
        // Published for another white and for L + M as the luminance: these are the differences.
        EXPECT_NEAR(std::abs(chroma.x), contrast.red_green, 0.01) << rgb.r;
        EXPECT_NEAR(std::abs(chroma.y), contrast.yellow_violet, 0.03) << rgb.r;
    }
}

// In greys of the colours' luminances.
template <class Colour>
VertexTree grey_checkerboard(Colour&& colour) {
    return checkerboard(
        [&](bool is_one) { return glm::vec4(glm::vec3(rec709_luminance(glm::vec3(colour(is_one)))), 1); });
}

TEST(Chroma, KeepsAnIsoluminantPatternThatLuminanceFolds) {
    const VertexTree tree = red_green_checkerboard(0.2),
                     grey = grey_checkerboard([](bool is_red) { return red_or_green(is_red ? 0.2 : -0.2); });
    // There is next to no contrast of luminance, and the pattern can be seen all the same.
    const vdtree::LuminanceRange range = tree.luminance_range();
    EXPECT_LT(range.hi - range.lo, 1e-4f);
    Stimulus cycles;
    cycles.frequency = CyclesPerDegree(1);
    cycles.luminance = to_luminance(Display(), 0.3);
    cycles.area = patch_area(cycles.frequency);
    const glm::dvec2 chroma = opponent_chroma(glm::dvec3(red_or_green(0.2))) / 0.3;
    EXPECT_GT(support::castle_visibility({0, std::abs(chroma.x), std::abs(chroma.y)}, cycles), 5);

    EXPECT_TRUE(has_colours(tree));
    EXPECT_FALSE(has_colours(grey));
    EXPECT_TRUE(ring_chroma(grey)->empty());
    for (const By test : all_tests) {
        const int whole = 2 * 27 * 27;
        EXPECT_LT(inner_triangles(cut_of(grey, near, test)), whole / 20);
        // `error` needs no more than the corners of the cells.
        EXPECT_GT(inner_triangles(cut_of(tree, near, test)), whole / (test == By::error ? 5 : 2));
    }
}

// Colours that nobody bounded are not taken for greys.
TEST(Chroma, IsRefusedOfRingsBoundedWithoutIt) {
    const VertexTree tree = red_green_checkerboard(0.2);
    const auto rings = require(bound_cut_rings(tree, false));
    EXPECT_TRUE(rings->chroma.empty());
    EXPECT_FALSE(luebke_hallen_safe_distances(tree, *rings, view_from(near), {}));
}

// Rings hold their corners and proxies, and those of the nodes below.
TEST(Chroma, OfRingsNests) {
    const VertexTree tree = checkerboard(
        [](bool is_one) { return is_one ? glm::vec4(0.6f, 0.2f, 0.1f, 1) : glm::vec4(0.1f, 0.2f, 0.9f, 1); });
    const auto sound = require(vdtree::SoundTree::of(tree));
    const auto rings = require(ring_chroma(tree));
    ASSERT_EQ(rings->size(), tree.interior_count());
    const auto includes = [](const ChromaRange& outer, glm::vec2 lo, glm::vec2 hi) {
        return outer.lo.x <= lo.x && outer.lo.y <= lo.y && hi.x <= outer.hi.x && hi.y <= outer.hi.y;
    };
    for (NodeId node = 1; node < tree.interior_count(); ++node) {
        const ChromaRange &own = (*rings)[node], &above = (*rings)[sound->parents()[node]];
        EXPECT_TRUE(includes(above, own.lo, own.hi)) << node;
    }
    for (const vdtree::Triangle& t : sound->triangles()) {
        for (const Index corner : t) {
            const WedgeId leaf = tree.wedge_of_leaf(corner);
            const glm::dvec3 rgb(tree.colours()[leaf]);
            const glm::vec2 chroma(opponent_chroma(rgb) *
                                   (static_cast<double>(tree.luminance()[leaf]) / glm::dot(rgb, rec709)));
            for (const Index other : t)
                EXPECT_TRUE(
                    includes((*rings)[sound->parents()[tree.place_of_leaf(other)]], chroma + 1e-6f, chroma - 1e-6f));
        }
    }
}

TEST(Chroma, LetsGoWhatNobodySees) {
    const VertexTree tree = red_green_checkerboard(0.0005);
    ASSERT_FALSE(ring_chroma(tree)->empty());
    for (const By test : all_tests) EXPECT_LT(inner_triangles(cut_of(tree, near, test)), 2 * 27 * 27 / 20);
}

TEST(Chroma, GrowsUpTheTreeWithAGazeToo) {
    const VertexTree tree = checkerboard(
        [](bool is_one) { return is_one ? glm::vec4(0.6f, 0.2f, 0.1f, 1) : glm::vec4(0.1f, 0.2f, 0.9f, 1); });
    for (const By test : all_tests)
        EXPECT_TRUE(require(criterion_of(tree, view_from(near), test, true))->is_monotone());
}

// Colours are drawn at the luminance that the light gives them, and their chroma is that of what is drawn.
TEST(Chroma, FollowsTheLight) {
    const VertexTree tree = red_green_checkerboard(0.3);
    const VertexTree dim = *tree.relit({.direction = {0, 0, 1}, .ambient = 0.5f, .fill = 0}),
                     dark = *tree.relit({.direction = {0, 0, -1}, .ambient = 0.25f, .fill = 0});
    ASSERT_TRUE(vdtree::verify(dark));
    const auto red = [](const VertexTree& t) { return (*ring_chroma(t))[0].hi.x; };
    EXPECT_NEAR(red(dim), red(tree), 1e-4f);
    EXPECT_NEAR(red(dark), 0.25f * red(tree), 1e-4f);
}

} // namespace unseen::perception::chroma_test
