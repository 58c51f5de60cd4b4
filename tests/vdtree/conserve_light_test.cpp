// Proxies that conserve light: what curved surfaces radiate, and bounds that hold.
#include <unseen/vdtree/internal/conserve_light.h>

#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/view.h>

#include "built.h"
#include "shapes.h"
#include "testing.h"

namespace unseen::vdtree::conserve_light_test {

using support::built;

// Colours that vary all over, each in its own way.
Mesh coloured(Mesh mesh) {
    for (const glm::dvec3& p : mesh.positions) {
        const auto wave = [](double x) { return static_cast<float>(0.5 + 0.45 * std::sin(x)); };
        mesh.colours.push_back({wave(3 * p.x), wave(5 * p.y + 1), wave(4 * p.z + 2), 1});
    }
    return mesh;
}

// Proxies brighter than the mean of their leaves make good for what a curved surface loses.
TEST(ConserveLight, KeepsTheLightOfACurvedSurface) {
    const Mesh mesh = shapes::icosphere(5);
    const VertexTree plain = built(mesh);
    const Result<VertexTree> conserved = require(conserve_light(plain));
    const auto mean_light = [](const VertexTree& tree, std::span<const Index> corners, glm::dvec3 direction) {
        double light = 0, area = 0;
        for (std::size_t i = 0; i < corners.size(); i += 3) {
            const auto at = [&](std::size_t k) { return glm::dvec3(tree.positions()[corners[i + k]]); };
            const auto grey = [&](std::size_t k) { return static_cast<double>(tree.luminance()[corners[i + k]]); };
            const double facing = 0.5 * glm::dot(glm::cross(at(1) - at(0), at(2) - at(0)), direction);
            if (facing <= 0) continue;
            area += facing;
            light += facing * (grey(0) + grey(1) + grey(2)) / 3;
        }
        return light / area;
    };
    const auto light_towards = [&](const VertexTree& tree, glm::dvec3 direction) {
        Cut cut(tree);
        const View view = frame_sphere({0, 0, 0}, 1, direction, 0.1, View{});
        EXPECT_TRUE(cut.follow(*extent_criterion(tree, view, 16), {.eye = eye_in_tree(tree, view, {})}));
        return mean_light(tree, cut.indices(), direction);
    };
    const auto whole_towards = [&](glm::dvec3 direction) {
        Cut cut(plain);
        cut.unfold_all();
        return mean_light(plain, cut.indices(), direction);
    };
    const glm::dvec3 lit(plain.light().direction);
    const double whole = whole_towards(lit);
    EXPECT_GT(whole - light_towards(plain, lit), 2e-3);
    EXPECT_LT(std::abs(whole - light_towards(*conserved, lit)), 0.7 * std::abs(whole - light_towards(plain, lit)));
}

// What light its edges lose is no reason to shade a face.
TEST(ConserveLight, LeavesFlatFacesEven) {
    const VertexTree plain = built(shapes::cube(6));
    ASSERT_TRUE(plain.has_seams());
    const Result<VertexTree> conserved = require(conserve_light(plain));
    const auto leaves = plain.luminance().subspan(plain.interior_wedge_count());
    WedgeId even = 0;
    for (WedgeId w = 0; w < plain.interior_wedge_count(); ++w) {
        if (std::ranges::find(leaves, plain.luminance()[w]) == leaves.end()) continue; // stands for several faces
        EXPECT_EQ(conserved->luminance()[w], plain.luminance()[w]) << w;
        ++even;
    }
    EXPECT_GT(even, plain.interior_wedge_count() / 2);
}

// Proxies of other luminances are drawn in other colours: all bounds go with them.
TEST(ConserveLight, MovesTheBoundsWithTheProxies) {
    for (const Mesh& mesh : {shapes::torus(24, 12), shapes::bumpy_sphere(2, 0.03), shapes::grid(8),
                             shapes::random_soup(200, 300, 1), shapes::cube(6), shapes::torus(64, 4)}) {
        const VertexTree tree = built(coloured(mesh));
        const Result<VertexTree> conserved = require(conserve_light(tree));
        const Result<void> sound = verify(*conserved);
        EXPECT_TRUE(sound) << sound.error().message;
    }
}

TEST(ConserveLight, ChangesProxiesOnlyAndNothingWhenDoneAgain) {
    const VertexTree once = *conserve_light(built(coloured(shapes::torus(24, 12))));
    const VertexTree tree = *once.with_attribute("mark", AttributeDomain::tree, std::vector<float>{1});
    const VertexTree means = built(coloured(shapes::torus(24, 12)));
    const Result<VertexTree> again = require(conserve_light(tree));
    EXPECT_FALSE(std::ranges::equal(tree.luminance(), means.luminance()));
    EXPECT_TRUE(std::ranges::equal(tree.luminance().subspan(tree.interior_count()),
                                   means.luminance().subspan(tree.interior_count())));
    EXPECT_TRUE(std::ranges::equal(again->luminance(), tree.luminance()));
    EXPECT_TRUE(std::ranges::equal(again->support_luminance(), tree.support_luminance()));
    EXPECT_TRUE(again->attributes().empty()) << "measured before";
}

} // namespace unseen::vdtree::conserve_light_test
