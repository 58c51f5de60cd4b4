// What folds change under lights, against what is measured of a tree that these light.
#include <perception/lit_folds.h>

#include <algorithm>
#include <cmath>
#include <random>

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <perception/criterion.h>
#include <perception/fold_measurement.h>

#include "built.h"
#include "measure/fold_record.h"
#include "shapes.h"

namespace unseen::perception {
namespace {

using ::testing::HasSubstr;
using namespace vdtree;

Lighting one_light(glm::dvec3 direction, double ambient = 0.1) {
    Lighting lighting;
    lighting.ambient = ambient;
    lighting.lights.push_back({.intensity = 0.7, .direction = glm::normalize(direction)});
    return lighting;
}

TEST(LitFolds, LightEveryVertexAsItIsDrawn) {
    const VertexTree tree = support::built(shapes::with_attributes(shapes::torus(30, 15)));
    const auto folds = LitFolds::measure(tree);
    ASSERT_TRUE(folds) << folds.error().message;
    const Lighting lighting = one_light({1, 2, 0.5});
    const auto lit = folds->under(tree, lighting);
    ASSERT_TRUE(lit) << lit.error().message;
    EXPECT_TRUE(has_fold_measurement(*lit));
    constexpr float half_step = 0.51f / 65535; // of stored luminances
    for (NodeId node = 0; node < tree.node_count(); ++node) {
        const auto drawn = static_cast<float>(lit_luminance(lighting, glm::dvec3(tree.positions()[node]),
                                                            glm::dvec3(glm::vec3(tree.normals()[node])),
                                                            static_cast<double>(albedo_of(tree, node)), glm::dvec3(0)));
        const float stored = lit->luminance()[node];
        ASSERT_NEAR(stored, drawn, half_step) << node;
        ASSERT_GE(lit->luminance_range().hi, stored);
        ASSERT_LE(lit->luminance_range().lo, stored);
    }
}

// Not for every fold: max(0, n.l) bends where the light ends, and vectors along the axes are added up as if each were
// at its worst in one place. But a fold that a measurement under the very light finds visible is found by this one.
TEST(LitFolds, AreHardlyEverLessThanWhatIsMeasuredUnderTheLight) {
    for (const bool is_painted : {false, true}) {
        Mesh mesh = shapes::bumpy_sphere(4, 0.04);
        if (is_painted) mesh = shapes::with_attributes(std::move(mesh));
        const VertexTree tree = support::built(mesh);
        const auto folds = LitFolds::measure(tree);
        ASSERT_TRUE(folds);
        std::mt19937_64 random(8);
        int all = 0, shorter = 0, compared = 0, less = 0, far_more = 0;
        for (int trial = 0; trial < 6; ++trial) {
            const Lighting lighting = one_light(shapes::random_direction(random));
            const VertexTree lit = *folds->under(tree, lighting);
            const VertexTree exact = *measure_folds(*tree.shaded([&](NodeId node) { return lit.luminance()[node]; }));
            const auto bound = lit.attribute<FoldRecord>(record_name), found = exact.attribute<FoldRecord>(record_name);
            ASSERT_EQ(bound.size(), found.size());
            for (NodeId node = 0; node < tree.interior_count(); ++node) {
                shorter += bound[node].shift < 0.9f * found[node].shift;
                ++all;
                const float most = found[node].amplitudes[0][0];
                if (most < 0.01f) continue;
                ++compared;
                less += bound[node].amplitudes[0][0] < 0.9f * most;
                far_more += bound[node].amplitudes[0][0] > 4 * most;
            }
        }
        EXPECT_LT(shorter, 0.02 * all);
        EXPECT_GT(compared, 1000);
        EXPECT_LT(less, 0.02 * compared);
        EXPECT_LT(far_more, 0.3 * compared);
    }
}

TEST(LitFolds, CostNothingWhereNoLightReaches) {
    const VertexTree tree = support::built(shapes::icosphere(4));
    const auto folds = LitFolds::measure(tree);
    ASSERT_TRUE(folds);
    const VertexTree lit = *folds->under(tree, one_light({0, 0, 1}, 0.2));
    const auto records = lit.attribute<FoldRecord>(record_name);
    int dark = 0;
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        const Sphere ring = tree.bounds()[node].ring;
        if (ring.centre.z + 1.2f * ring.radius > -0.2f) continue;
        ++dark;
        EXPECT_EQ(records[node].largest_luminance, 0) << node;
        EXPECT_EQ(records[node].bias, 0) << node;
    }
    EXPECT_GT(dark, 100);
}

TEST(LitFolds, RefuseWhatTheyDoNotKnow) {
    const VertexTree tree = support::built(shapes::icosphere(2)), other = support::built(shapes::icosphere(3));
    const auto folds = LitFolds::measure(tree);
    ASSERT_TRUE(folds);
    Lighting shiny = one_light({0, 0, 1});
    shiny.specular = 0.1;
    const auto highlights = folds->under(tree, shiny);
    ASSERT_FALSE(highlights);
    EXPECT_EQ(highlights.error().code, ErrorCode::unsupported);
    EXPECT_THAT(highlights.error().message, HasSubstr("highlights"));
    EXPECT_FALSE(folds->under(other, one_light({0, 0, 1})));
    EXPECT_FALSE(folds->under(tree, Lighting()));
    int told = 0;
    const auto cancelled = LitFolds::measure(other, 1, [&](double, const char*) { return ++told < 2; });
    ASSERT_FALSE(cancelled);
    EXPECT_EQ(cancelled.error().code, ErrorCode::cancelled);
}

} // namespace
} // namespace unseen::perception
