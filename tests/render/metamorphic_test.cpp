// That the picture does not depend on how a mesh numbers its vertices and faces; like tests/perception/metamorphic_test.cpp.

#include <unseen/perception/criterion.h>
#include <unseen/vdtree/cut.h>

#include "built.h"
#include "gl_test.h"
#include "measured.h"
#include "oracle.h"
#include "shapes.h"

namespace unseen::metamorphic_test {

using namespace vdtree;
using Metamorphic = render::testing::GlTest;

Mesh permuted(const Mesh& mesh) {
    std::mt19937_64 random(1);
    Mesh out = mesh;
    std::vector<Index> place(mesh.positions.size());
    std::iota(place.begin(), place.end(), Index{0});
    std::ranges::shuffle(place, random);
    for (std::size_t v = 0; v < place.size(); ++v) out.positions[place[v]] = mesh.positions[v];
    for (Triangle& t : out.triangles)
        for (Index& corner : t) corner = place[corner];
    std::ranges::shuffle(out.triangles, random);
    return out;
}

TEST_F(Metamorphic, PicturesOfPermutedMeshes) {
    const Mesh mesh = shapes::bumpy_sphere(4);
    const VertexTree tree = support::measured(support::built(mesh)),
                     other = support::measured(support::built(permuted(mesh)));
    auto renderer = require(render::Renderer::create(context(), tree)),
         renderer_of_other = require(render::Renderer::create(context(), other));
    std::uint64_t folded = 0; // triangles
    for (const oracle::Look& look : oracle::looks_at(tree, {.count = 4})) {
        Cut whole(tree), whole_other(other);
        whole.unfold_all(), whole_other.unfold_all();
        const perception::Image a = oracle::draw(*renderer, whole, look.view),
                                b = oracle::draw(*renderer_of_other, whole_other, look.view);
        double most = 0;
        for (std::size_t i = 0; i < a.values.size(); ++i)
            most = std::max(most, static_cast<double>(std::abs(a.values[i] - b.values[i])));
        // Of 100 cd/m2: normals are sums of faces in the order of their numbers, and luminances have sixteen bits.
        EXPECT_LE(most, 0.02) << oracle::words(look);
        // What is left where nobody sees it may differ, but nobody sees it.
        for (const VertexTree* one : {&tree, &other}) {
            const auto criterion = require(perception::error_distances(*one, look.view, look.options));
            Cut cut(*one);
            const auto stats = require(cut.follow(*criterion, perception::viewpoint_of(*one, look.view, look.options)));
            folded += one->triangle_count() - stats->triangles;
            const auto judged =
                oracle::judge(a, oracle::draw(one == &tree ? *renderer : *renderer_of_other, cut, look.view), look,
                              oracle::judges[0]);
            EXPECT_EQ(judged.visible_pixels, 0u) << oracle::words(look);
        }
    }
    EXPECT_GT(folded, 2 * tree.triangle_count());
}

} // namespace unseen::metamorphic_test
