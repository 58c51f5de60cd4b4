// What folds change at hard edges and seams: nothing where both sides stay as they are.
#include <unseen/perception/fold_measurement.h>

#include <numbers>

#include <unseen/vdtree/builder.h>

#include "built.h"
#include "measure/contacts.h"
#include "measure/fold_record.h"
#include "shapes.h"
#include "sound.h"
#include "testing.h"
#include "textures.h"

namespace unseen::perception::seam_folds_test {

using namespace vdtree;

// Merges of places, each to a position of its own; all other places stay until the root.
struct Merge {
    std::vector<glm::dvec3> places;
    glm::dvec3 proxy;
};

Clustering merged(const ClusterInput& input, std::span<const Merge> merges) {
    const auto places = static_cast<Index>(input.mesh.positions.size()),
               root = places + static_cast<Index>(merges.size());
    Clustering clustering;
    clustering.parents.assign(root + 1, root);
    for (std::size_t i = 0; i < merges.size(); ++i) {
        for (const glm::dvec3& wanted : merges[i].places)
            for (Index place = 0; place < places; ++place)
                if (glm::distance(input.mesh.positions[place], wanted) < 1e-9)
                    clustering.parents[place] = places + static_cast<Index>(i);
        clustering.positions.push_back(merges[i].proxy);
    }
    clustering.positions.push_back({0, 0, 0});
    return clustering;
}

// A measured tree of these merges, and what was measured of each.
struct Measured {
    std::shared_ptr<const VertexTree> tree;
    std::vector<NodeId> nodes;
    std::vector<FoldRecord> folds;
    std::vector<FoldTexture> textures;

    Measured(const Mesh& mesh, std::span<const Merge> merges, bool prelit = false) {
        const auto merge = [&](const ClusterInput& input) -> Result<Clustering> { return merged(input, merges); };
        auto built = require(build_tree(mesh.view(), merge, {.prelit = prelit}));
        auto measured = require(measure_folds(*built, 1));
        tree = std::make_shared<const VertexTree>(std::move(*measured));
        for (const Merge& merge : merges) {
            NodeId node = 1;
            while (node < tree->interior_count() &&
                   !(glm::distance(glm::dvec3(tree->position(node)) + tree->origin(), merge.proxy) < 1e-5))
                ++node;
            if (node == tree->interior_count()) throw std::runtime_error("a merge is not in the tree");
            nodes.push_back(node);
            folds.push_back(tree->attribute<FoldRecord>(record_name)[node]);
            if (const auto all = tree->attribute<FoldTexture>(texture_name); !all.empty())
                textures.push_back(all[node]);
        }
    }
};

float largest_amplitude(const FoldRecord& record) {
    float largest = 0;
    for (const auto& of_size : record.amplitudes) largest = std::max(largest, *std::ranges::max_element(of_size));
    return largest;
}
float largest_contrast(const FoldTexture& texture) { return *std::ranges::max_element(texture.contrast); }

// The cube [0, n]^3 whose faces have vertices and normals of their own.
Mesh hard_cube(int n) {
    Mesh mesh;
    for (int axis = 0; axis < 3; ++axis)
        for (const bool is_far : {false, true}) {
            const auto first = static_cast<Index>(mesh.positions.size());
            glm::dvec3 normal(0);
            normal[axis] = is_far ? 1 : -1;
            for (int v = 0; v <= n; ++v)
                for (int u = 0; u <= n; ++u) {
                    glm::dvec3 p;
                    p[axis] = is_far ? n : 0;
                    p[(axis + 1) % 3] = u, p[(axis + 2) % 3] = v;
                    mesh.positions.push_back(p);
                    mesh.normals.push_back(glm::vec3(normal));
                }
            for (int v = 0; v < n; ++v)
                for (int u = 0; u < n; ++u) {
                    const auto a = first + static_cast<Index>(v * (n + 1) + u), b = a + 1,
                               c = a + static_cast<Index>(n + 1), d = c + 1;
                    for (Triangle t : {Triangle{a, b, d}, Triangle{a, d, c}}) {
                        if (!is_far) std::swap(t[1], t[2]);
                        mesh.triangles.push_back(t);
                    }
                }
        }
    return mesh;
}

TEST(HardEdges, CostNothingAlongThemAndMuchAcross) {
    const Merge merges[] = {
        {{{4, 4, 8}, {5, 4, 8}}, {4.5, 4, 8}},             // within a face
        {{{8, 3, 8}, {8, 4, 8}, {8, 5, 8}}, {8, 4.25, 8}}, // along an edge
        {{{8, 4, 0}, {7, 4, 0}}, {7, 4, 0}},               // an edge pulled into one of its faces
        {{{0, 0, 0}, {0, 1, 0}}, {0, 1, 0}},               // a corner along one of its edges
    };
    const Measured measured(hard_cube(8), merges);
    ASSERT_TRUE(measured.tree->has_seams());
    EXPECT_EQ(measured.tree->wedge_end(measured.nodes[0]) - measured.tree->first_wedge(measured.nodes[0]), 1u);
    EXPECT_EQ(measured.tree->wedge_end(measured.nodes[1]) - measured.tree->first_wedge(measured.nodes[1]), 2u);
    for (const std::size_t flat : {0, 1}) {
        const FoldRecord& fold = measured.folds[flat];
        EXPECT_LT(fold.shift, 1e-5f) << flat;
        EXPECT_LT(fold.farthest, 1e-5f) << flat;
        EXPECT_LT(fold.largest_luminance, 1e-4f) << flat;
        EXPECT_LT(largest_amplitude(fold), 1e-4f) << flat;
        EXPECT_LT(fold.border, 1e-5f) << flat;
        EXPECT_EQ(fold.gap, std::numeric_limits<float>::infinity()) << "faces that meet at an edge are neighbours";
    }
    for (const std::size_t rounded : {2, 3}) {
        const FoldRecord& fold = measured.folds[rounded];
        EXPECT_GT(fold.farthest, 0.3f) << rounded;
        EXPECT_GT(largest_amplitude(fold), 0.03f) << rounded;
    }
}

// Two halves of a square, x from 0 to 2n, each with a part of the texture of its own, which do not fit together.
Mesh seamed_sheet(int n, const Texture& texture) {
    Mesh mesh;
    for (const int half : {0, 1}) {
        const auto first = static_cast<Index>(mesh.positions.size());
        for (int y = 0; y <= n; ++y)
            for (int x = 0; x <= n; ++x) {
                mesh.positions.push_back({x + half * n, y, 0});
                const glm::vec2 own(static_cast<float>(x) / static_cast<float>(2 * n),
                                    static_cast<float>(y) / static_cast<float>(n));
                mesh.uvs.push_back(half == 0 ? own : glm::vec2(1 - own.x, own.y * 0.5f + 0.25f));
            }
        for (int y = 0; y < n; ++y)
            for (int x = 0; x < n; ++x) {
                const auto a = first + static_cast<Index>(y * (n + 1) + x), b = a + 1,
                           c = a + static_cast<Index>(n + 1), d = c + 1;
                mesh.triangles.push_back({a, b, d});
                mesh.triangles.push_back({a, d, c});
            }
    }
    mesh.texture = texture;
    return mesh;
}

TEST(Seams, CostNothingAlongThemAndTheirTextureAcross) {
    constexpr int n = 16;
    const Merge merges[] = {
        {{{n, 4, 0}, {n, 5, 0}}, {n, 4.5, 0}},          // along the seam
        {{{n, 10, 0}, {n - 1, 10, 0}}, {n - 1, 10, 0}}, // the seam pulled to one side
    };
    // Without an image there may be others, such as a normal map.
    for (const Texture& texture : {textures::checkerboard(256, 256, 8, 0, 255), Texture()}) {
        const Measured measured(seamed_sheet(n, texture), merges, true);
        ASSERT_EQ(measured.textures.size(), 2u);
        EXPECT_LT(measured.textures[0].slide, 1e-4f);
        EXPECT_LT(largest_contrast(measured.textures[0]), 1e-3f);
        EXPECT_LT(largest_amplitude(measured.folds[0]), 1e-3f);
        EXPECT_LT(measured.folds[0].largest_luminance, 1e-3f);
        EXPECT_GT(largest_amplitude(measured.folds[1]), 0.05f);
        for (const FoldRecord& fold : measured.folds) EXPECT_LT(fold.shift, 1e-5f);
    }
}

// A disc of so many spokes, facing up.
Mesh disc(int spokes, double height) {
    Mesh mesh;
    mesh.positions.push_back({0, 0, height});
    for (int i = 0; i < spokes; ++i) {
        const double angle = 2 * std::numbers::pi * i / spokes;
        mesh.positions.push_back({std::cos(angle), std::sin(angle), height});
        mesh.triangles.push_back({0, static_cast<Index>(1 + i), static_cast<Index>(1 + (i + 1) % spokes)});
    }
    return mesh;
}

// Spokes are neighbours, however many meet at the hub; what lies over them is not.
TEST(Contacts, AreFoundAroundHubs) {
    const auto contacts_of = [](const Mesh& mesh) {
        const VertexTree tree = support::built(mesh);
        const SoundTree sound = support::sound(tree);
        const Progress nobody;
        MeasuringProgress progress(nobody);
        return find_contacts(std::span(&sound, 1), progress);
    };
    for (const int spokes : {90, 1000, 9000})
        for (const Contact& contact : contacts_of(disc(spokes, 0))) ASSERT_FALSE(contact.is_any()) << spokes;
    for (const int spokes : {90, 1000}) {
        // The other one faces down: it does not look alike.
        const Mesh both = shapes::together(disc(spokes, 0), shapes::inside_out(disc(spokes, 0.05)));
        for (const Contact& contact : contacts_of(both)) ASSERT_NEAR(contact.gap, 0.05f, 1e-4f) << spokes;
    }
}

} // namespace unseen::perception::seam_folds_test
