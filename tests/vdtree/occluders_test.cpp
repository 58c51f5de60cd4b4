// Spheres inside of solids, and what they hide.
#include <unseen/vdtree/criteria.h>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>

#include "built.h"
#include "shapes.h"
#include "sound.h"
#include "testing.h"
#include "triangle_distance.h"

namespace unseen::vdtree::occluders_test {

using support::built;

double distance_from_surface(const VertexTree& tree, glm::dvec3 at) {
    double least = std::numeric_limits<double>::infinity();
    const auto corner = [&](const Triangle& t, std::size_t k) {
        return glm::dvec3(tree.positions()[tree.wedge_of_leaf(t[k])]);
    };
    for (const Triangle& t : support::sound(tree).triangles())
        least = std::min(least, support::distance_to_triangle(at, corner(t, 0), corner(t, 1), corner(t, 2)));
    return least;
}

struct Solid {
    const char* name;
    Mesh (*make)();
    double least_radius; // of the largest sphere, as a share of the bounding sphere's
};
const Solid solids[] = {
    {"sphere", [] { return shapes::icosphere(4); }, 0.94},
    {"cube", [] { return shapes::cube(); }, 0.55}, // of two triangles a side; exactly 1 / sqrt(3)
    {"torus", [] { return shapes::torus(48, 20); }, 0.2},
    {"inside_out", [] { return shapes::inside_out(shapes::bumpy_sphere(4)); }, 0.6},
    {"two_parts", [] { return shapes::two_parts(); }, 0.2},
    {"one_in_the_other",
     [] { return shapes::together(shapes::icosphere(3), shapes::placed(shapes::icosphere(3), 0.5)); }, 0.2},
};

class InnerSpheres : public testing::TestWithParam<Solid> {};
INSTANTIATE_TEST_SUITE_P(Solids, InnerSpheres, testing::ValuesIn(solids),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(InnerSpheres, AreEnclosedAndTouchNothing) {
    const VertexTree tree = built(GetParam().make());
    const std::vector<Sphere> spheres = inner_spheres(tree);
    ASSERT_FALSE(spheres.empty());
    EXPECT_LE(spheres.size(), 8u);
    EXPECT_GE(spheres.front().radius, GetParam().least_radius * static_cast<double>(tree.bounding_sphere().radius));
    for (const Sphere& sphere : spheres) {
        const glm::dvec3 centre(sphere.centre);
        EXPECT_GT(distance_from_surface(tree, centre), static_cast<double>(sphere.radius));
        EXPECT_GT(std::abs(winding_number(tree, centre)), 0.5);
    }
}

TEST(InnerSpheresOf, OpenSurfacesAreNone) {
    EXPECT_TRUE(inner_spheres(built(shapes::grid(8))).empty());
    EXPECT_TRUE(inner_spheres(built(shapes::random_soup(40, 60, 3))).empty());
}

TEST(InnerSpheresOf, AFlatSolidAreNone) {
    Mesh flat = shapes::cube(2);
    for (glm::dvec3& p : flat.positions) p.y *= 1e-6;
    EXPECT_TRUE(inner_spheres(built(flat)).empty());
}

// A criterion that unfolds all that is in sight.
DistanceCriterion all_of(const VertexTree& tree) {
    return std::move(
        *require(DistanceCriterion::create(tree, {.switch_distance = {DistanceCriterion::always_visible}})));
}

TEST(Occluders, FoldOnlyWhatNoLineOfSightReaches) {
    const VertexTree tree = built(shapes::bumpy_sphere(5, 0.01));
    const std::vector<Sphere> spheres = inner_spheres(tree);
    const DistanceCriterion criterion = all_of(tree);
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> unit(-1, 1);
    for (const double distance : {1.3, 4.0, 300.0}) {
        const glm::dvec3 eye = distance * glm::normalize(glm::dvec3(0.4, 0.8, -0.3));
        Cut cut(tree);
        ASSERT_TRUE(cut.follow(criterion, {.eye = eye, .occluders = spheres}));
        std::size_t hidden = 0;
        for (NodeId node = 0; node < tree.interior_count(); ++node) {
            if (cut.is_wanted(node)) continue;
            ++hidden;
            const Sphere ring = tree.bounds()[node].ring;
            for (int k = 0; k < 20; ++k) {
                const glm::dvec3 at =
                    glm::dvec3(ring.centre) + static_cast<double>(ring.radius) *
                                                  glm::dvec3(unit(random), unit(random), unit(random)) / std::sqrt(3.0);
                bool is_hidden = false;
                for (const Sphere& sphere : spheres)
                    is_hidden |= support::distance_to_segment(glm::dvec3(sphere.centre), eye, at) <
                                 static_cast<double>(sphere.radius) * (1 + 1e-5);
                EXPECT_TRUE(is_hidden) << "node " << node << " from " << distance;
            }
        }
        EXPECT_GT(hidden, tree.interior_count() / 8) << distance; // much of the far side
    }
}

TEST(Occluders, RefuseWhatHidesNothing) {
    const VertexTree tree = built(shapes::icosphere(2));
    const DistanceCriterion criterion = all_of(tree);
    Cut cut(tree);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const auto follows = [&](const Sphere& occluder) {
        return cut.follow(criterion, {.eye = {0, 0, 5}, .occluders = {occluder}}) ? true : false;
    };
    EXPECT_TRUE(follows({{0, 0, 0}, 0.5f}));
    EXPECT_FALSE(follows({{0, 0, 4.9f}, 0.5f})); // the eye is inside
    EXPECT_FALSE(follows({{nan, 0, 0}, 0.5f}));
    EXPECT_FALSE(follows({{0, 0, 0}, nan}));
    EXPECT_FALSE(follows({{0, 0, 0}, -1}));
    const auto extent = require(extent_criterion(tree, View{}, 1));
    ASSERT_EQ(extent->parts().spheres, DistanceCriterion::Spheres::support);
    EXPECT_FALSE(cut.follow(*extent, {.eye = {0, 0, 5}, .occluders = {{{0, 0, 0}, 0.5f}}}));
}

} // namespace unseen::vdtree::occluders_test
