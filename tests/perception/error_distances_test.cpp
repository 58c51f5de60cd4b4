// The fold test by errors, where nodes differ in more ways than its table has rows.
#include <unseen/perception/criterion.h>

#include <unseen/perception/csf.h>
#include <unseen/vdtree/cut.h>

#include "built.h"
#include "fold/error_distances.h"
#include "measured.h"
#include "shapes.h"
#include "sound.h"
#include "testing.h"

namespace unseen::perception::error_distances_test {

using vdtree::Mesh;
using vdtree::NodeId;
using vdtree::VertexTree;

// error_distances() of a tree whose errors these are.
Result<vdtree::DistanceCriterion> criterion_of(const vdtree::SoundTree& tree, std::span<const FoldError> errors,
                                               const vdtree::View& view, const FoldTestOptions& options) {
    const LitErrors own{&tree, errors};
    return vdtree::DistanceCriterion::create(tree, criterion_parts({&own, 1}, {}, view, options));
}

// A noisy height field of n x n quads, each vertex of a grey of its own.
Mesh noisy_height_field(int n, std::mt19937_64& random) {
    Mesh mesh = shapes::grid(n);
    for (glm::dvec3& p : mesh.positions) {
        p.z += shapes::random_between(random, 0, 1.0 / n);
        const auto grey = static_cast<float>(std::exp2(shapes::random_between(random, -6, 0)));
        mesh.colours.push_back({grey, grey, grey, 1});
    }
    return mesh;
}

// Errors as different as can be, which nest.
std::vector<FoldError> various_errors(const VertexTree& tree, std::mt19937_64& random) {
    const auto log_uniform = [&](double low, double high) {
        return static_cast<float>(std::exp2(shapes::random_between(random, low, high)));
    };
    const vdtree::SoundTree sound = support::sound(tree);
    const auto parents = sound.parents();
    std::vector<FoldError> errors(tree.interior_count());
    for (NodeId node = tree.interior_count(); node-- > 0;) {
        FoldError& e = errors[node];
        const float radius = tree.support_spheres()[node].radius;
        e.distance = std::max(e.distance, radius * log_uniform(-8, -2));
        e.mean_distance = e.distance * log_uniform(-3, 0);
        e.luminance = log_uniform(-10, 0);
        e.wide_luminance = e.luminance * log_uniform(-6, 0);
        e.extent = std::max(e.extent, radius * log_uniform(-1, 0));
        e.bias = log_uniform(-10, -2);
        e.fading = static_cast<std::uint8_t>(random() % 4);
        if (node == 0) break;
        FoldError& above = errors[parents[node]];
        above.distance = std::max(above.distance, e.distance);
        above.extent = std::max(above.extent, e.extent);
    }
    return errors;
}

// By interior node: the longest way down to a leaf.
std::vector<int> heights_of(const VertexTree& tree) {
    const vdtree::SoundTree sound = support::sound(tree);
    const auto parents = sound.parents();
    std::vector<int> heights(tree.interior_count(), 1);
    for (NodeId node = tree.interior_count(); node-- > 1;) {
        int& above = heights[parents[node]];
        above = std::max(above, heights[node] + 1);
    }
    return heights;
}

// Here about 80,000 patterns are rounded to fewer. The exact distances are those of nodes with no errors below them,
// few enough for a row each.
TEST(ErrorDistances, OfMorePatternsThanRowsAreNoLess) {
    constexpr std::size_t most_rows = 0x10000;
    std::mt19937_64 random(5);
    const VertexTree tree = support::built(noisy_height_field(320, random), {.prelit = true});
    const vdtree::SoundTree sound = support::sound(tree);
    const std::vector<FoldError> errors = various_errors(tree, random);
    const std::vector<int> heights = heights_of(tree);
    vdtree::View view;
    FoldTestOptions options;
    view.eye = {0.5, 0.5, 3};
    view.fov_y_degrees = physical_field(options.display, view.height).value();
    options.gaze_px = glm::dvec2(100, 100);
    const auto all = require(criterion_of(sound, errors, view, options));
    EXPECT_TRUE(all->is_monotone());
    const vdtree::DistanceCriterion::Parts& parts = all->parts();
    const std::size_t bins = parts.eccentricity_bins;
    EXPECT_LE(parts.switch_distance.size(), most_rows * bins);
    std::size_t exact_rows = 0;
    for (int height = 1; height <= heights[VertexTree::root()]; ++height) {
        std::vector<FoldError> of_height(errors.size());
        for (NodeId node = 0; node < errors.size(); ++node)
            if (heights[node] == height) of_height[node] = errors[node];
        const auto exact = require(criterion_of(sound, of_height, view, options));
        const vdtree::DistanceCriterion::Parts& own = exact->parts();
        ASSERT_LT(own.switch_distance.size(), most_rows * bins);
        exact_rows += own.switch_distance.size() / bins;
        for (NodeId node = 0; node < errors.size(); ++node) {
            if (heights[node] != height) continue;
            const std::size_t patch = parts.classes[node].interior * bins,
                              own_patch = own.classes[node].interior * bins;
            const std::size_t strip = parts.classes[node].silhouette * bins,
                              own_strip = own.classes[node].silhouette * bins;
            for (std::size_t bin = 0; bin < bins; ++bin) {
                ASSERT_GE(parts.lengths[node] * parts.switch_distance[patch + bin],
                          own.lengths[node] * own.switch_distance[own_patch + bin])
                    << "node " << node << ", bin " << bin;
                ASSERT_GE(parts.silhouette_lengths[node] * parts.switch_distance[strip + bin],
                          own.silhouette_lengths[node] * own.switch_distance[own_strip + bin])
                    << "node " << node << ", bin " << bin;
            }
        }
    }
    EXPECT_GT(exact_rows, most_rows) << "there are rows for all";
}

TEST(ErrorDistances, GrowWithWhatTheViewerSumsOverSpace) {
    const VertexTree tree = support::measured(support::built(shapes::bumpy_sphere(5, 0.03)));
    vdtree::View view;
    view.eye = {0, 0, 60};
    const auto triangles = [&](double summation) {
        CsfSamples samples = csf_of(default_person)->samples();
        samples.summation = summation;
        FoldTestOptions options;
        options.csf = std::make_shared<const CsfTable>(*CsfTable::create(std::move(samples)));
        view.fov_y_degrees = physical_field(options.display, view.height).value();
        const auto criterion = error_distances(tree, view, options);
        EXPECT_TRUE(criterion);
        vdtree::Cut cut(tree);
        EXPECT_TRUE(cut.follow(*criterion, viewpoint_of(tree, view, options)));
        return cut.triangle_count();
    };
    EXPECT_GT(triangles(2), triangles(1));
    EXPECT_LT(triangles(0.5), triangles(1));
}

// A wide shift of light is seen best aside, where sensitivity is highest at the lowest frequencies: the wider the area,
// the better, far beyond the width of what is looked at.
TEST(ErrorDistances, CountAreasOfManyDegreesAside) {
    const VertexTree tree = support::built(shapes::grid(64), {.prelit = true});
    const vdtree::SoundTree sound = support::sound(tree);
    FoldTestOptions options;
    vdtree::View view;
    view.eye = {0.5, 0.5, 3};
    view.fov_y_degrees = physical_field(options.display, view.height).value();
    options.gaze_px = glm::dvec2(5000, 100);
    const auto switch_degrees = [&](float bias, float behind) {
        options.scene = {behind, 0.9f};
        std::vector<FoldError> errors(tree.interior_count());
        for (FoldError& e : errors) e.bias = bias;
        const auto criterion = criterion_of(sound, errors, view, options);
        EXPECT_TRUE(criterion);
        const vdtree::DistanceCriterion::Parts& parts = criterion->parts();
        const auto bin = static_cast<std::size_t>(50 / parts.bin_degrees);
        const NodeId small = tree.interior_count() - 1;
        const double distance =
            static_cast<double>(parts.lengths[small] *
                                parts.switch_distance[parts.classes[small].interior * parts.eccentricity_bins + bin]);
        const double radius = static_cast<double>(tree.support_spheres()[VertexTree::root()].radius);
        return distance > radius ? 2 * std::asin(radius / distance) * 180 / std::numbers::pi : 180;
    };
    // The largest areas that go unseen, of less and less contrast.
    const double wide = switch_degrees(0.6f, 0.9f), wider = switch_degrees(0.3f, 0.9f);
    EXPECT_GT(wide, 2);
    EXPECT_GT(wider, 1.3 * wide);
    // Before black the mean light around the mesh is less than its own, and the same shift is more of it.
    EXPECT_LT(switch_degrees(0.3f, 0), 0.8 * wider);
}

TEST(ErrorDistances, RefuseFactorsThatAreNone) {
    const VertexTree tree = support::measured(support::built(shapes::icosphere(2)));
    FoldTestOptions options;
    vdtree::View view;
    view.eye = {0, 0, 5};
    EXPECT_TRUE(error_distances(tree, view, options));
    for (const double none : {-1.0, std::nan(""), std::numeric_limits<double>::infinity()})
        for (double FoldModel::*factor : {&FoldModel::neighbourhood, &FoldModel::needed_by_outlines,
                                          &FoldModel::contact_reach, &FoldModel::least_sine}) {
            options.model = {};
            options.model.*factor = none;
            EXPECT_FALSE(error_distances(tree, view, options));
        }
}

} // namespace unseen::perception::error_distances_test
