// Built trees: that they are what they should be, by brute force, for every awkward mesh and both clusterers.
#include <unseen/vdtree/builder.h>

#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/internal/normal_mask.h>

#include "exact.h"
#include "shapes.h"
#include "sound.h"
#include "testing.h"
#include "tree_checks.h"

namespace unseen::vdtree::builder_test {

// The direction of a normal is computed in double from float positions, here and there by other formulas.
constexpr double direction_rounding = 1e-7;
// Luminance goes through a few float operations.
constexpr float luminance_rounding = 1.0f / 65535; // one step of a stored luminance
constexpr float packed_normal_error = 6.6e-5f;     // length; see <unseen/vdtree/vertex_tree.h>

struct Case {
    std::string shape;
    ClustererKind kind;
};

const std::map<std::string, Mesh>& meshes() {
    static const std::map<std::string, Mesh> all = [] {
        std::map<std::string, Mesh> by_name;
        for (shapes::Named& named : shapes::all()) by_name.emplace(named.name, std::move(named.mesh));
        return by_name;
    }();
    return all;
}

std::vector<Case> cases() {
    std::vector<Case> all;
    for (const auto& [shape, mesh] : meshes())
        for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) all.push_back({shape, kind});
    return all;
}

class Regions {
public:
    explicit Regions(const VertexTree& tree)
        : tree_(tree), around_(tree.leaf_count()), around_place_(tree.node_count()) {
        for (Index t = 0; t < tree.triangle_count(); ++t)
            for (const Index leaf : support::sound(tree).triangles()[t]) {
                around_[leaf].push_back(t);
                around_place_[tree.place_of_leaf(leaf)].insert(t);
            }
        find_irregular_places();
    }

    glm::dvec3 position(NodeId node) const { return glm::dvec3(tree_.position(node)); }
    NodeId node_of(Index leaf) const { return tree_.place_of_leaf(leaf); }
    std::set<Index> triangles_around(NodeId node) const {
        std::set<Index> found;
        for (Index leaf = support::sound(tree_).first_leaf()[node]; leaf < support::sound(tree_).leaf_end()[node];
             ++leaf)
            found.insert(around_[leaf].begin(), around_[leaf].end());
        return found;
    }
    std::set<Index> ring_leaves(NodeId node) const {
        std::set<Index> found;
        for (const Index t : triangles_around(node))
            found.insert(support::sound(tree_).triangles()[t].begin(), support::sound(tree_).triangles()[t].end());
        return found;
    }
    // Triangles that touch a place in the ring: the ring dilated by one more.
    std::set<Index> dilated_triangles(NodeId node) const {
        std::set<Index> found;
        for (const Index leaf : ring_leaves(node)) {
            const auto& here = around_place_[tree_.place_of_leaf(leaf)];
            found.insert(here.begin(), here.end());
        }
        return found;
    }
    bool ring_is_irregular(NodeId node) const {
        const auto leaves = ring_leaves(node);
        return std::any_of(leaves.begin(), leaves.end(),
                           [&](Index leaf) { return irregular_places_.contains(tree_.place_of_leaf(leaf)); });
    }
    // Floats may put several places at one point: then nothing moves when they fold.
    bool is_coincident(NodeId node) const { return tree_.support_spheres()[node].radius == 0; }

private:
    void find_irregular_places() {
        std::map<std::pair<Index, Index>, std::vector<bool>> uses; // by edge: whether it is run from low to high
        for (const Triangle& t : support::sound(tree_).triangles()) {
            const Triangle w = {node_of(t[0]), node_of(t[1]), node_of(t[2])};
            for (std::size_t k = 0; k < 3; ++k)
                uses[std::minmax(w[k], w[(k + 1) % 3])].push_back(w[k] < w[(k + 1) % 3]);
        }
        for (const auto& [edge, runs] : uses)
            if (runs.size() != 2 || runs[0] == runs[1]) irregular_places_.insert({edge.first, edge.second});
    }

    const VertexTree& tree_;
    std::vector<std::vector<Index>> around_;
    std::vector<std::set<Index>> around_place_; // by node
    std::set<NodeId> irregular_places_;
};

glm::dvec3 normal_of(glm::dvec3 a, glm::dvec3 b, glm::dvec3 c) {
    const glm::dvec3 n = glm::cross(b - a, c - a);
    const double largest = std::max({std::abs(n.x), std::abs(n.y), std::abs(n.z)});
    return largest > 0 ? glm::normalize(n / largest) : glm::dvec3(0);
}

// Whether a mask and slabs know a direction; on the border of two cells either will do.
bool knows(const VertexTree& tree, NodeId node, glm::dvec3 n) {
    if (n == glm::dvec3(0)) return true;
    bool in_mask = false;
    for (int axis = -1; axis < 6; ++axis) {
        glm::dvec3 near = n;
        if (axis >= 0) near[axis / 2] += axis % 2 ? direction_rounding : -direction_rounding;
        in_mask |= tree.mask(node).contains(normal_cell(near));
    }
    const double s = 1 / std::sqrt(3.0);
    const double along[] = {
        n.x, n.y, n.z, (n.x + n.y + n.z) * s, (-n.x + n.y + n.z) * s, (n.x - n.y + n.z) * s, (n.x + n.y - n.z) * s};
    bool in_slabs = true;
    for (std::size_t i = 0; i < NormalSlabs::axis_count; ++i)
        in_slabs &= tree.bounds()[node].slabs.lo[i] / 127.0 <= along[i] + direction_rounding &&
                    along[i] - direction_rounding <= tree.bounds()[node].slabs.hi[i] / 127.0;
    return in_mask && in_slabs;
}

class BuiltTree : public testing::TestWithParam<Case> {
protected:
    const Mesh& mesh() const { return meshes().at(GetParam().shape); }
    Result<VertexTree> build() const { return build_tree(mesh().view(), {.clusterer = GetParam().kind}); }
};

INSTANTIATE_TEST_SUITE_P(All, BuiltTree, testing::ValuesIn(cases()), [](const auto& param_info) {
    return param_info.param.shape + "_" + std::string(name(param_info.param.kind));
});

TEST_P(BuiltTree, IsVerified) {
    const auto tree = require(build());
    const auto verified = verify(*tree);
    EXPECT_TRUE(verified) << verified.error().message;
}

TEST_P(BuiltTree, IsNumberedDepthFirst) {
    const auto tree = require(build());
    EXPECT_EQ(support::fault_in_structure(*tree), "");
    EXPECT_GT(tree->byte_size(), tree->node_count() * sizeof(glm::vec3));
}

TEST_P(BuiltTree, GivesBackTheInputWhenUnfolded) {
    EXPECT_EQ(support::fault_when_unfolded(*require(build()), mesh().view()), "");
    const Mesh floats = shapes::in_floats(mesh());
    const auto from_floats = require(build_tree(floats.view(), {.clusterer = GetParam().kind}));
    EXPECT_EQ(support::fault_when_unfolded(*from_floats, floats.view()), "");
}

TEST_P(BuiltTree, LosesEachTriangleWhereTwoCornersFirstMerge) {
    const auto tree = require(build());
    for (NodeId node = 0; node < tree->interior_count(); ++node) {
        for (Index t = support::sound(*tree).first_triangle()[node];
             t < support::sound(*tree).first_triangle()[node + 1]; ++t) {
            const auto supported = [&](NodeId n) {
                int corners = 0;
                for (const Index leaf : support::sound(*tree).triangles()[t])
                    corners +=
                        support::sound(*tree).first_leaf()[n] <= leaf && leaf < support::sound(*tree).leaf_end()[n];
                return corners;
            };
            ASSERT_GE(supported(node), 2) << "triangle " << t;
            tree->for_each_child(node, [&](NodeId child) {
                if (!tree->is_place(child)) ASSERT_LT(supported(child), 2) << "triangle " << t;
            });
        }
    }
}

TEST_P(BuiltTree, HasSpheresThatContainTheirRegionsExactly) {
    const auto tree = require(build());
    const Regions regions(*tree);
    for (NodeId node = 0; node < tree->interior_count(); ++node) {
        const Sphere support = tree->support_spheres()[node], ring = tree->bounds()[node].ring;
        for (NodeId below = node; below < support::sound(*tree).subtree_end()[node]; ++below) {
            ASSERT_TRUE(support::contains(support, tree->position(below))) << "node " << node << ", proxy " << below;
            ASSERT_TRUE(support::contains(ring, tree->position(below))) << "node " << node << ", proxy " << below;
            const Sphere s = tree->support_spheres()[below], r = tree->bounds()[below].ring;
            ASSERT_TRUE(support::contains(support, s.centre, s.radius)) << "node " << node << ", node " << below;
            ASSERT_TRUE(support::contains(ring, r.centre, r.radius)) << "node " << node << ", node " << below;
        }
        for (Index leaf = support::sound(*tree).first_leaf()[node]; leaf < support::sound(*tree).leaf_end()[node];
             ++leaf)
            ASSERT_TRUE(support::contains(support, tree->position(regions.node_of(leaf)))) << "node " << node;
        for (const Index leaf : regions.ring_leaves(node))
            ASSERT_TRUE(support::contains(ring, tree->position(regions.node_of(leaf)))) << "node " << node;
    }
    for (const Triangle& t : support::sound(*tree).triangles())
        for (const Index leaf : t)
            ASSERT_TRUE(support::contains(tree->bounding_sphere(), tree->position(regions.node_of(leaf))));
}

TEST_P(BuiltTree, KnowsTheNormalsOfTheDilatedRing) {
    const auto tree = require(build());
    const Regions regions(*tree);
    for (NodeId node = 0; node < tree->interior_count(); ++node) {
        if (regions.is_coincident(node)) {
            EXPECT_TRUE(tree->mask(node).empty());
            continue;
        }
        for (const Index t : regions.dilated_triangles(node)) {
            const Triangle& corners = support::sound(*tree).triangles()[t];
            const glm::dvec3 n =
                normal_of(regions.position(regions.node_of(corners[0])), regions.position(regions.node_of(corners[1])),
                          regions.position(regions.node_of(corners[2])));
            ASSERT_TRUE(knows(*tree, node, n)) << "node " << node << ", triangle " << t;
        }
    }
}

// Replays the contractions in the order in which the clusterer made them. After each, the triangles around the new
// cluster have the normals that a viewer sees when the node folds.
TEST_P(BuiltTree, KnowsTheNormalsAfterEachFold) {
    Clustering clustering;
    std::vector<Triangle> triangles; // over places
    std::size_t vertices = 0;
    std::vector<Index> place_of_source(mesh().positions.size());
    const auto remember = [&](const ClusterInput& input) {
        vertices = input.mesh.positions.size();
        triangles.assign(input.mesh.triangles.begin(), input.mesh.triangles.end());
        for (Index v = 0; v < mesh().positions.size(); ++v)
            for (Index place = 0; place < vertices; ++place)
                if (input.mesh.positions[place] == mesh().positions[v]) place_of_source[v] = place;
        Result<Clustering> made =
            GetParam().kind == ClustererKind::octree ? cluster_octree(input) : cluster_quadric(input);
        if (made) clustering = *made;
        return made;
    };
    const auto tree = require(build_tree(mesh().view(), remember));
    const std::size_t clusters = clustering.parents.size();
    std::vector<NodeId> node_of_vertex(vertices);
    for (Index leaf = 0; leaf < tree->leaf_count(); ++leaf)
        node_of_vertex[place_of_source[tree->source_vertices()[leaf]]] = tree->place_of_leaf(leaf);

    // Nodes are known by their places.
    std::map<std::pair<NodeId, NodeId>, NodeId> node_by_leaves;
    for (NodeId node = 0; node < tree->interior_count(); ++node)
        node_by_leaves[{tree->place_of_leaf(support::sound(*tree).first_leaf()[node]),
                        tree->place_of_leaf(support::sound(*tree).leaf_end()[node] - 1)}] = node;
    std::vector<std::set<NodeId>> leaves(clusters);
    for (Index v = 0; v < vertices; ++v) leaves[v] = {node_of_vertex[v]};
    for (std::size_t c = 0; c + 1 < clusters; ++c)
        leaves[clustering.parents[c]].insert(leaves[c].begin(), leaves[c].end());
    const auto node_of = [&](Index cluster) {
        if (cluster < vertices) return node_of_vertex[cluster];
        return node_by_leaves.at({*leaves[cluster].begin(), *leaves[cluster].rbegin()});
    };

    std::vector<Index> live(vertices); // by vertex: the cluster that it is in now
    std::iota(live.begin(), live.end(), Index{0});
    std::map<Index, std::vector<Index>> merged;
    for (Index c = 0; c + 1 < clusters; ++c) merged[clustering.parents[c]].push_back(c);
    for (Index c = static_cast<Index>(vertices); c < clusters; ++c) {
        for (Index& v : live)
            if (std::find(merged[c].begin(), merged[c].end(), v) != merged[c].end()) v = c;
        const NodeId node = node_of(c);
        if (tree->support_spheres()[node].radius == 0) continue;
        for (const Triangle& t : triangles) {
            const Index now[3] = {live[t[0]], live[t[1]], live[t[2]]};
            if (now[0] != c && now[1] != c && now[2] != c) continue;
            if (now[0] == now[1] || now[1] == now[2] || now[2] == now[0]) continue;
            glm::dvec3 p[3];
            for (int k = 0; k < 3; ++k) p[k] = glm::dvec3(tree->position(node_of(now[k])));
            ASSERT_TRUE(knows(*tree, node, normal_of(p[0], p[1], p[2]))) << "node " << node;
        }
    }
}

TEST_P(BuiltTree, FlagsRingsWithIrregularEdges) {
    const auto tree = require(build());
    const Regions regions(*tree);
    for (NodeId node = 0; node < tree->interior_count(); ++node) {
        if (regions.is_coincident(node)) continue;
        ASSERT_EQ((tree->bounds()[node].flags & irregular_ring) != 0, regions.ring_is_irregular(node))
            << "node " << node;
    }
}

TEST_P(BuiltTree, BoundsLuminance) {
    const auto tree = require(build());
    const Regions regions(*tree);
    for (NodeId node = tree->interior_count(); node-- > 0;) {
        const auto y = tree->luminance();
        float low = 1, high = 0;
        const auto take = [&](WedgeId w) {
            low = std::min<float>(low, y[w]);
            high = std::max<float>(high, y[w]);
        };
        for (NodeId below = node; below < support::sound(*tree).subtree_end()[node]; ++below)
            for (WedgeId w = tree->first_wedge(below); w < tree->wedge_end(below); ++w) take(w);
        for (Index leaf = support::sound(*tree).first_leaf()[node]; leaf < support::sound(*tree).leaf_end()[node];
             ++leaf)
            take(tree->wedge_of_leaf(leaf));
        const LuminanceRange support = tree->support_luminance()[node], ring = tree->ring_luminance()[node];
        ASSERT_EQ(support.lo, low) << "node " << node;
        ASSERT_EQ(support.hi, high) << "node " << node;
        for (const Index leaf : regions.ring_leaves(node)) take(tree->wedge_of_leaf(leaf));
        ASSERT_EQ(ring.lo, low) << "node " << node;
        ASSERT_EQ(ring.hi, high) << "node " << node;
        double adaptation = 0.5 * (double{ring.lo} + double{ring.hi});
        tree->for_each_child(node, [&](NodeId child) {
            if (!tree->is_place(child)) adaptation = std::max<double>(adaptation, tree->adaptation_luminance()[child]);
        });
        // Rounded up to the next of 65536 steps.
        const double rounding = tree->adaptation_luminance()[node] - adaptation, floats = 1e-7;
        ASSERT_GE(rounding, -floats) << "node " << node;
        ASSERT_LE(rounding, luminance_rounding / 2 + floats) << "node " << node;
    }
    float low = 1, high = 0;
    for (const Triangle& t : support::sound(*tree).triangles()) {
        for (const Index leaf : t) {
            low = std::min<float>(low, tree->luminance()[tree->wedge_of_leaf(leaf)]);
            high = std::max<float>(high, tree->luminance()[tree->wedge_of_leaf(leaf)]);
        }
    }
    EXPECT_EQ(tree->luminance_range().lo, low);
    EXPECT_EQ(tree->luminance_range().hi, high);
}

TEST_P(BuiltTree, HasOnePlaceAtEachPosition) {
    const auto tree = require(build());
    std::map<std::tuple<double, double, double>, std::set<NodeId>> places;
    for (Index leaf = 0; leaf < tree->leaf_count(); ++leaf) {
        const glm::dvec3 p = mesh().positions[tree->source_vertices()[leaf]];
        places[{p.x, p.y, p.z}].insert(tree->place_of_leaf(leaf));
    }
    EXPECT_EQ(places.size(), tree->place_count());
    for (const auto& [position, nodes] : places) ASSERT_EQ(nodes.size(), 1u);
}

// By the definition: two leaves under a node are of one wedge if triangles join them there.
TEST_P(BuiltTree, KeepsTogetherWhatTrianglesJoin) {
    const auto tree = require(build());
    for (NodeId node = 0; node < tree->interior_count(); ++node) {
        const Index begin = support::sound(*tree).first_leaf()[node], end = support::sound(*tree).leaf_end()[node];
        const auto inside = [&](Index leaf) { return begin <= leaf && leaf < end; };
        for (const Triangle& t : support::sound(*tree).triangles())
            for (std::size_t k = 0; k < 3; ++k)
                if (inside(t[k]) && inside(t[(k + 1) % 3]))
                    ASSERT_EQ(tree->wedge_at(node, t[k]), tree->wedge_at(node, t[(k + 1) % 3])) << "node " << node;
        for (Index leaf = begin; leaf < end; ++leaf) {
            const WedgeId wedge = tree->wedge_at(node, leaf);
            ASSERT_GE(wedge, tree->first_wedge(node));
            ASSERT_LT(wedge, tree->wedge_end(node));
            if (node != VertexTree::root()) {
                const NodeId above = support::sound(*tree).parents()[node];
                ASSERT_EQ(tree->wedge_above(above, wedge), tree->wedge_at(above, leaf)) << "node " << node;
            }
        }
    }
}

TEST_P(BuiltTree, DoesNotDependOnThreads) {
    const auto one = require(build_tree(mesh().view(), {.clusterer = GetParam().kind, .threads = 1}));
    for (const int threads : {2, 8, 0}) {
        const auto several = require(build_tree(mesh().view(), {.clusterer = GetParam().kind, .threads = threads}));
        EXPECT_EQ(support::difference(*one, *several), "") << threads << " threads";
    }
}

TEST(BuildTree, DoesNotDependOnThreadsWhereThereIsWorkForAll) {
    for (const Mesh& mesh : {shapes::bumpy_sphere(5), shapes::unwelded(shapes::bumpy_sphere(4))}) {
        for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
            const auto one = require(build_tree(mesh.view(), {.clusterer = kind, .threads = 1}));
            for (const int threads : {2, 8}) {
                const auto several = require(build_tree(mesh.view(), {.clusterer = kind, .threads = threads}));
                EXPECT_EQ(support::difference(*one, *several), "") << name(kind) << ", " << threads << " threads";
            }
            EXPECT_TRUE(verify(*one));
        }
    }
}

// A clusterer that says what it was told to say.
auto fixed(const Clustering& clustering) {
    return [&clustering](const ClusterInput&) { return Result<Clustering>(clustering); };
}

std::vector<Triangle> triangles_of(const Cut& cut) {
    std::vector<Triangle> out;
    const auto indices = cut.indices();
    for (std::size_t i = 0; i < indices.size(); i += 3) out.push_back({indices[i], indices[i + 1], indices[i + 2]});
    return out;
}

template <class T>
std::vector<T> copy(std::span<const T> values) {
    return {values.begin(), values.end()};
}

// The tree's triangles in its order, by input vertices.
std::vector<Triangle> corners_of(const VertexTree& tree) {
    std::vector<Triangle> out = copy(support::sound(tree).triangles());
    for (Triangle& t : out)
        for (Index& leaf : t) leaf = tree.source_vertices()[leaf];
    return out;
}

TEST(LiteralTree, QuadOfTwoTriangles) {
    //  3---2      4 = {0, 1}, 5 = {2, 3}, 6 = {4, 5}
    //  | / |
    //  0---1
    Mesh quad;
    quad.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    quad.triangles = {{0, 1, 2}, {0, 2, 3}};
    const Clustering clustering{{4, 4, 5, 5, 6, 6, 6}, {{0.5, 0, 0}, {0.5, 1, 0}, {0.5, 0.5, 0}}};
    const auto tree = require(build_tree(quad.view(), fixed(clustering)));
    //        0            nodes 0 to 2, leaves 3 to 6
    //      /   \.
    //     1     2
    //    / \   / \.
    //   3   4 5   6
    EXPECT_EQ(tree->interior_count(), 3u);
    EXPECT_THAT(copy(support::sound(*tree).parents()), ElementsAre(no_node, 0, 0, 1, 1, 2, 2));
    EXPECT_THAT(copy(support::sound(*tree).first_leaf()), ElementsAre(0, 0, 2));
    EXPECT_THAT(copy(support::sound(*tree).leaf_end()), ElementsAre(4, 2, 4));
    EXPECT_THAT(copy(support::sound(*tree).subtree_end()), ElementsAre(3, 2, 3));
    EXPECT_THAT(copy(tree->source_vertices()), ElementsAre(0, 1, 2, 3));
    // Triangle 0 has 0 and 1 in common with node 1; triangle 1 has 2 and 3 in common with node 2.
    EXPECT_THAT(copy(support::sound(*tree).first_triangle()), ElementsAre(0, 0, 1, 2));
    EXPECT_THAT(corners_of(*tree), ElementsAre(quad.triangles[0], quad.triangles[1]));
    EXPECT_EQ(tree->positions()[0], glm::vec3(0.5, 0.5, 0));
    EXPECT_EQ(tree->positions()[1], glm::vec3(0.5, 0, 0));
    EXPECT_EQ(tree->positions()[2], glm::vec3(0.5, 1, 0));
    EXPECT_NEAR(tree->displacement()[1], 0.5, 1e-6); // half a side from both planes that stand on the other sides
    EXPECT_NEAR(tree->displacement()[0], std::sqrt(0.5), 1e-6);
    EXPECT_NEAR(tree->support_spheres()[1].radius, 0.5, 1e-6);
    EXPECT_NEAR(tree->bounds()[1].ring.radius, std::sqrt(0.5), 1e-6);

    Cut cut(*tree);
    cut.unfold_all();
    EXPECT_THAT(triangles_of(cut), ElementsAre(Triangle{3, 4, 5}, Triangle{3, 5, 6}));
    cut.fold(1);
    EXPECT_THAT(triangles_of(cut), ElementsAre(Triangle{1, 5, 6}));
    cut.fold(2); // an edge is left, and an edge has no triangle
    EXPECT_THAT(triangles_of(cut), ElementsAre());
    cut.unfold(1); // 3 4 2: the triangle at the bottom, with the proxy of the top
    EXPECT_THAT(triangles_of(cut), ElementsAre(Triangle{3, 4, 2}));
    cut.fold(1), cut.fold(0);
    EXPECT_THAT(triangles_of(cut), ElementsAre());
}

TEST(LiteralTree, Fan) {
    //     3---2          6 = {2, 3}
    //    / \ / \.        7 = {4, 6}
    //   4---0---1        8 = {5, 7}
    //    \ /             9 = {0, 1, 8}
    //     5
    Mesh fan;
    fan.positions = {{0, 0, 0}, {2, 0, 0}, {1, 2, 0}, {-1, 2, 0}, {-2, 0, 0}, {-1, -2, 0}};
    fan.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}};
    const Clustering clustering{{9, 9, 6, 6, 7, 8, 7, 8, 9, 9}, {}};
    const auto tree = require(build_tree(fan.view(), fixed(clustering)));
    // Leaves in depth-first order: 0 1 (5 (4 (2 3))).
    EXPECT_EQ(tree->interior_count(), 4u);
    EXPECT_THAT(copy(tree->source_vertices()), ElementsAre(0, 1, 5, 4, 2, 3));
    EXPECT_THAT(copy(support::sound(*tree).first_leaf()), ElementsAre(0, 2, 3, 4));
    EXPECT_THAT(copy(support::sound(*tree).leaf_end()), ElementsAre(6, 6, 6, 6));
    EXPECT_THAT(copy(support::sound(*tree).parents()), ElementsAre(no_node, 0, 1, 2, 0, 0, 1, 2, 3, 3));
    EXPECT_THAT(copy(support::sound(*tree).first_triangle()), ElementsAre(0, 1, 2, 3, 4));
    EXPECT_THAT(corners_of(*tree), ElementsAre(fan.triangles[0], fan.triangles[3], fan.triangles[2], fan.triangles[1]));

    Cut cut(*tree);
    cut.unfold_all();
    EXPECT_THAT(triangles_of(cut),
                ElementsAre(Triangle{4, 5, 8}, Triangle{4, 7, 6}, Triangle{4, 9, 7}, Triangle{4, 8, 9}));
    cut.fold(3);
    EXPECT_THAT(triangles_of(cut), ElementsAre(Triangle{4, 5, 3}, Triangle{4, 7, 6}, Triangle{4, 3, 7}));
    cut.fold(2);
    EXPECT_THAT(triangles_of(cut), ElementsAre(Triangle{4, 5, 2}, Triangle{4, 2, 6}));
    cut.fold(1);
    EXPECT_THAT(triangles_of(cut), ElementsAre(Triangle{4, 5, 1}));
    cut.unfold(1);
    EXPECT_THAT(triangles_of(cut), ElementsAre(Triangle{4, 5, 2}, Triangle{4, 2, 6}));
}

TEST(LiteralTree, ClustersWithOneChildAreThatChild) {
    const Mesh mesh = shapes::single_triangle();
    // 3 = {0, 1}, 4 = {3}, 5 = {2}, 6 = {4, 5}, 7 = {6}
    const Clustering clustering{{3, 3, 5, 4, 6, 6, 7, 7}, {}};
    const auto tree = require(build_tree(mesh.view(), fixed(clustering)));
    EXPECT_EQ(tree->interior_count(), 2u);
    EXPECT_EQ(support::fault_in_structure(*tree), "");
    EXPECT_EQ(support::fault_when_unfolded(*tree, mesh.view()), "");
    EXPECT_TRUE(verify(*tree));
}

TEST(LiteralTree, OneClusterForAll) {
    const Mesh mesh = shapes::cube(2);
    const Index n = static_cast<Index>(mesh.positions.size());
    const Clustering clustering{std::vector<Index>(n + 1, n), {}};
    const auto tree = require(build_tree(mesh.view(), fixed(clustering)));
    EXPECT_EQ(tree->interior_count(), 1u);
    EXPECT_EQ(support::fault_when_unfolded(*tree, mesh.view()), "");
    EXPECT_TRUE(verify(*tree));
}

TEST(UserClustering, MayBeAsDeepAsItHasVertices) {
    const Mesh mesh = shapes::grid(141); // 20164 vertices
    const Index n = static_cast<Index>(mesh.positions.size());
    for (const bool shuffled : {false, true}) {
        // Each vertex joins the cluster of all those before it.
        std::vector<Index> order(n);
        std::iota(order.begin(), order.end(), Index{0});
        std::mt19937_64 random(1);
        if (shuffled)
            for (Index i = n; i > 1; --i) std::swap(order[i - 1], order[random() % i]);
        Clustering chain;
        chain.parents.resize(2 * n - 1);
        chain.parents[order[0]] = n;
        for (Index i = 1; i < n; ++i) chain.parents[order[i]] = n + i - 1;
        for (Index c = n; c + 1 < 2 * n - 1; ++c) chain.parents[c] = c + 1;
        chain.parents.back() = 2 * n - 2;
        const auto begin = std::chrono::steady_clock::now();
        const auto tree = build_tree(mesh.view(), fixed(chain));
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
        ASSERT_TRUE(tree) << tree.error().message;
        EXPECT_EQ(tree->interior_count(), n - 1);
        EXPECT_LT(took.count(), 30) << "seconds; some with optimisation, and room for sanitizers";
        RecordProperty(shuffled ? "seconds_shuffled" : "seconds", std::to_string(took.count()));
        EXPECT_EQ(support::fault_when_unfolded(*tree, mesh.view()), "");
        if (!shuffled) {
            const auto verified = verify(*tree);
            EXPECT_TRUE(verified) << verified.error().message;
        }
        Cut cut(*tree);
        cut.unfold_ancestors(tree->node_count() - 1);
        cut.fold_all();
        EXPECT_EQ(cut.triangle_count(), 0u);
    }
}

TEST(UserClustering, IsCheckedBeforeUse) {
    const Mesh mesh = shapes::tetrahedron(); // 4 vertices
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const std::vector<std::pair<const char*, Clustering>> invalid = {
        {"nothing", {}},
        {"too few", {{1, 2, 3, 3}, {}}},
        {"no parent", {{4, 4, 4, no_node, 4}, {}}},
        {"a parent out of range", {{4, 4, 4, 5, 4}, {}}},
        {"a vertex for a parent", {{1, 4, 4, 4, 4}, {}}},
        {"its own parent", {{4, 4, 5, 5, 4, 5}, {}}},
        {"a parent made before", {{5, 5, 6, 6, 6, 4, 6}, {}}},
        {"a cluster without children", {{5, 5, 5, 5, 5, 5}, {}}},
        {"a root without children", {{4, 4, 4, 4, 4, 5}, {}}},
        {"too few proxies", {{4, 4, 5, 5, 5, 5}, {{0, 0, 0}}}},
        {"too many proxies", {{4, 4, 4, 4, 4}, {{0, 0, 0}, {0, 0, 0}}}},
        {"a proxy that is nowhere", {{4, 4, 4, 4, 4}, {{0, nan, 0}}}},
        {"a proxy at infinity", {{4, 4, 4, 4, 4}, {{0, std::numeric_limits<double>::infinity(), 0}}}},
        {"a proxy beyond floats", {{4, 4, 4, 4, 4}, {{0, 1e200, 0}}}},
    };
    for (const auto& [what, clustering] : invalid) {
        const auto tree = build_tree(mesh.view(), fixed(clustering));
        EXPECT_FALSE(tree) << what;
        if (!tree) EXPECT_EQ(tree.error().code, ErrorCode::invalid_argument) << what;
    }
}

TEST(UserClustering, MayFail) {
    const auto failing = [](const ClusterInput&) {
        return Result<Clustering>(Error{ErrorCode::unsupported, "no clusters today"});
    };
    const auto tree = build_tree(shapes::cube(1).view(), failing);
    ASSERT_FALSE(tree);
    EXPECT_EQ(tree.error().message, "no clusters today");
}

TEST(UserClustering, IsGivenPlacesAndLeaves) {
    Mesh mesh = shapes::unwelded(shapes::cube(1));
    const auto look = [&](const ClusterInput& input) {
        EXPECT_EQ(input.mesh.positions.size(), 8u);
        EXPECT_EQ(input.mesh.triangles.size(), 12u);
        EXPECT_EQ(input.luminance.size(), 8u);
        EXPECT_EQ(input.leaves.places.size(), 8u) << "all vertices at a corner are equal";
        double area = 0;
        for (const double a : input.areas) area += a;
        EXPECT_NEAR(area, 24, 1e-9);
        for (Index v = 0; v < 8; ++v) {
            EXPECT_GT(glm::dot(glm::dvec3(input.normals[v]), input.mesh.positions[v]),
                      0.5); // outward, over all faces of the corner
            EXPECT_NEAR(glm::length(input.normals[v]), 1, 1e-6);
            const float facing = glm::dot(input.normals[v], Light{}.direction);
            const float lit = facing > 0 ? facing : -0.25f * facing;
            EXPECT_NEAR(input.luminance[v], 0.8f * (0.2f + 0.8f * lit), luminance_rounding);
        }
        return cluster_octree(input);
    };
    EXPECT_TRUE(build_tree(mesh.view(), look, {.crease = 180}));
    for (Index t = 0; t < 12; ++t) // a face each
        for (const Index v : mesh.triangles[t]) mesh.uvs.resize(36), mesh.uvs[v] = {static_cast<float>(t), 0};
    const auto look_at_leaves = [&](const ClusterInput& input) {
        EXPECT_EQ(input.mesh.positions.size(), 8u);
        EXPECT_EQ(input.leaves.places.size(), 36u);
        for (Index t = 0; t < 12; ++t)
            for (std::size_t k = 0; k < 3; ++k) {
                const Index leaf = input.leaves.triangles[t][k];
                EXPECT_EQ(input.leaves.places[leaf], input.mesh.triangles[t][k]);
                EXPECT_EQ(input.leaves.uvs[leaf], mesh.uvs[mesh.triangles[t][k]]);
            }
        return cluster_octree(input);
    };
    EXPECT_TRUE(build_tree(mesh.view(), look_at_leaves));
}

TEST(BuildTree, CountsTheTrianglesItDrops) {
    const Mesh mesh = shapes::with_degenerate_triangles(shapes::cube(2));
    const auto tree = require(build_tree(mesh.view()));
    EXPECT_EQ(tree->dropped_triangles(), 16u);
    EXPECT_EQ(tree->triangle_count(), 48u);
}

TEST(BuildTree, RefusesWhatItCannotBuildOn) {
    const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    const auto expect_refused = [](const Mesh& mesh, const char* what) {
        for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
            const auto tree = build_tree(mesh.view(), {.clusterer = kind});
            EXPECT_FALSE(tree) << what;
            if (!tree) EXPECT_FALSE(tree.error().message.empty());
        }
    };
    expect_refused({}, "an empty mesh");
    Mesh mesh = shapes::cube(1);
    mesh.triangles.clear();
    expect_refused(mesh, "no triangles");
    mesh.triangles = {{0, 1, 1}, {2, 2, 2}};
    expect_refused(mesh, "only triangles that use a vertex twice");
    mesh = shapes::cube(1);
    mesh.triangles[3][1] = 8;
    expect_refused(mesh, "an index out of range");
    for (const double bad : {nan, inf, -inf}) {
        mesh = shapes::cube(1);
        mesh.positions[5].y = bad;
        expect_refused(mesh, "a position that is not finite");
    }
    mesh = shapes::with_attributes(shapes::cube(1));
    mesh.colours.pop_back();
    expect_refused(mesh, "a missing colour");
    EXPECT_FALSE(build_tree(shapes::cube(1).view(), {.threads = -1}));
}

// A tree's positions are floats: what they cannot hold is refused, not turned into infinity.
TEST(BuildTree, RefusesCoordinatesBeyondFloats) {
    for (const double scale : {1e39, 1e150, 1e300}) {
        for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
            const auto tree = build_tree(shapes::placed(shapes::cube(1), scale).view(), {.clusterer = kind});
            EXPECT_FALSE(tree) << scale;
        }
    }
}

// What floats cannot measure, and what doubles have rounded to a few places, would be trees of nothing.
TEST(BuildTree, RefusesSizesThatNumbersCannotHold) {
    const Mesh ball = shapes::bumpy_sphere(3); // about 2 units large
    const auto far = [&](double x) {
        Mesh mesh = ball;
        for (glm::dvec3& p : mesh.positions) p.x += x;
        return mesh;
    };
    for (const double scale : {1e-300, 1e-100, 1e-38}) {
        EXPECT_THAT(error_in(build_tree(shapes::placed(ball, scale).view())), testing::HasSubstr("scale it up"))
            << scale;
    }
    EXPECT_TRUE(verify(*require(build_tree(shapes::placed(ball, 1e-36).view()))));
    for (const double x : {1e15, -1e15, 1e30})
        EXPECT_THAT(error_in(build_tree(far(x).view())), testing::HasSubstr("move it nearer to the origin")) << x;
    EXPECT_TRUE(verify(*require(build_tree(far(1e13).view()))));
    Mesh wall = shapes::grid(4); // exact there, since one of its coordinates is the same everywhere
    for (glm::dvec3& p : wall.positions) p.z = 1e15;
    EXPECT_TRUE(build_tree(wall.view()));
    EXPECT_THAT(error_in(build_tree(shapes::all_coincident(6).view())),
                testing::HasSubstr("three different positions"));
}

// Vertices that only doubles tell apart are one point in a tree, several nodes deep.
TEST(BuildTree, IsSoundWhereFloatsDoNotTellVerticesApart) {
    for (const double apart : {1e-8, 1e-10, 1e-14}) {
        Mesh mesh = shapes::unwelded(shapes::bumpy_sphere(3));
        for (std::size_t v = 0; v < mesh.positions.size(); ++v)
            mesh.positions[v] += apart * glm::dvec3(v % 3, v % 5, v % 7);
        mesh = shapes::with_attributes(mesh);
        for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
            const auto tree = require(build_tree(mesh.view(), {.clusterer = kind}));
            const auto sound = verify(*tree);
            EXPECT_TRUE(sound) << apart << ": " << sound.error().message;
        }
    }
}

// Colours and UVs that are no numbers would make luminances that are none.
TEST(BuildTree, RefusesOrRepairsAttributesThatAreNotFinite) {
    const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    for (const float bad : {nan, inf, -inf}) {
        for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
            for (const bool colour : {true, false}) {
                Mesh mesh = shapes::with_attributes(shapes::bumpy_sphere(2));
                for (std::size_t v = 0; v < mesh.positions.size(); v += 5)
                    (colour ? mesh.colours[v].g : mesh.uvs[v].x) = bad;
                const auto tree = build_tree(mesh.view(), {.clusterer = kind});
                if (!tree) continue;
                for (const float y : tree->luminance()) ASSERT_TRUE(y >= 0 && y <= 1);
                for (const glm::vec4& c : tree->colours()) ASSERT_TRUE(std::isfinite(c.r + c.g + c.b + c.a));
                for (const glm::vec2& uv : tree->uvs()) ASSERT_TRUE(std::isfinite(uv.x + uv.y));
                EXPECT_TRUE(verify(*tree));
            }
        }
    }
}

TEST(BuildTree, FindsOutWhetherTheSurfaceIsClosed) {
    Mesh one_turned = shapes::icosphere(1);
    std::swap(one_turned.triangles[7][0], one_turned.triangles[7][1]);
    Mesh one_missing = shapes::icosphere(1);
    one_missing.triangles.pop_back();
    const std::vector<std::tuple<const char*, Mesh, Closedness>> expected = {
        {"icosphere", shapes::icosphere(1), Closedness::closed_outward},
        {"tetrahedron", shapes::tetrahedron(), Closedness::closed_outward},
        {"inside out", shapes::inside_out(shapes::icosphere(1)), Closedness::closed_inward},
        {"inside-out torus", shapes::inside_out(shapes::torus(9, 6)), Closedness::closed_inward},
        {"unwelded", shapes::unwelded(shapes::torus(9, 6)), Closedness::closed_outward},
        {"two parts", shapes::two_parts(), Closedness::closed_outward},
        {"far away", shapes::placed(shapes::icosphere(2), 1, {5e5, 5e6, 0}), Closedness::closed_outward},
        {"tiny", shapes::placed(shapes::icosphere(1), 1e-19), Closedness::closed_outward},
        {"huge", shapes::placed(shapes::inside_out(shapes::icosphere(1)), 1e30), Closedness::closed_inward},
        {"grid", shapes::grid(3), Closedness::open},
        {"Moebius strip", shapes::moebius_strip(12), Closedness::open},
        {"fan", shapes::non_manifold_fan(4), Closedness::open},
        {"one triangle turned", one_turned, Closedness::open},
        {"one triangle missing", one_missing, Closedness::open},
    };
    for (const auto& [what, mesh, closedness] : expected) {
        EXPECT_EQ(require(build_tree(mesh.view()))->closedness(), closedness) << what;
    }
}

// Two vertices at each position of the seam, of one colour or of two.
TEST(BuildTree, KeepsTheSidesOfASeamApart) {
    for (const bool colours_differ : {false, true}) {
        for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
            const Mesh mesh = shapes::seam(colours_differ);
            const auto tree = require(build_tree(mesh.view(), {.clusterer = kind, .prelit = true}));
            EXPECT_TRUE(tree->is_prelit());
            EXPECT_EQ(tree->has_seams(), colours_differ);
            EXPECT_EQ(tree->place_count(), mesh.positions.size() - 2);
            EXPECT_EQ(tree->leaf_count(), mesh.positions.size() - (colours_differ ? 0 : 2));
        }
    }
}

TEST(Relit, EqualsATreeBuiltWithThatLight) {
    const Light light{.direction = glm::normalize(glm::vec3(-1, 0.2f, 0.5f)), .ambient = 0.4f};
    for (const char* shape :
         {"bumpy_sphere", "unwelded_sphere", "flat_grid", "unreferenced", "tiny", "huge", "moebius_strip"}) {
        const Mesh& mesh = meshes().at(shape);
        const auto tree = build_tree(mesh.view(), {.clusterer = ClustererKind::octree}); // does not look at luminance
        const auto expected = build_tree(mesh.view(), {.clusterer = ClustererKind::octree, .light = light});
        ASSERT_TRUE(tree && expected);
        EXPECT_EQ(support::difference(*tree->relit(light), *expected), "") << shape;
        EXPECT_EQ(support::difference(*tree->relit(light)->relit(tree->light()), *tree), "") << shape;
    }
    EXPECT_TRUE(verify(*require(build_tree(meshes().at("bumpy_sphere").view()))->relit(light)));
}

TEST(BuildTree, LightsColoursUnlessTheyArePrelit) {
    Mesh mesh = shapes::with_attributes(shapes::icosphere(2));
    mesh.colours[0] = glm::vec4(1);
    mesh.normals[0] = Light().direction; // as bright as can be
    const BuildOptions lit_options{.clusterer = ClustererKind::octree},
        prelit_options{.clusterer = ClustererKind::octree, .prelit = true};
    const auto lit = require(build_tree(mesh.view(), lit_options)),
               prelit = require(build_tree(mesh.view(), prelit_options));
    EXPECT_FALSE(lit->is_prelit());
    EXPECT_TRUE(prelit->is_prelit());
    EXPECT_TRUE(verify(*lit));
    EXPECT_EQ(support::difference(*lit, *prelit->relit(Light())), "");
    for (Index leaf = 0; leaf < lit->leaf_count(); ++leaf)
        if (lit->source_vertices()[leaf] == 0)
            EXPECT_NEAR(lit->luminance()[lit->wedge_of_leaf(leaf)], 1, packed_normal_error);
    // Without colours there is nothing that light could be baked into.
    mesh.colours.clear();
    const auto grey = require(build_tree(mesh.view(), lit_options)),
               same = require(build_tree(mesh.view(), prelit_options));
    EXPECT_FALSE(same->is_prelit());
    EXPECT_EQ(support::difference(*grey, *same), "");
}

TEST(Relit, ShadesColoursByTheLight) {
    const Mesh mesh = shapes::with_attributes(shapes::icosphere(2));
    const auto tree = require(build_tree(mesh.view(), {.prelit = true}));
    EXPECT_TRUE(tree->is_prelit());
    const Light light{.direction = {0, 0, 1}, .ambient = 0.3f, .fill = 0};
    const VertexTree lit = *tree->relit(light);
    EXPECT_FALSE(lit.is_prelit());
    EXPECT_TRUE(verify(lit));
    for (Index leaf = 0; leaf < tree->leaf_count(); ++leaf) {
        const Index v = tree->source_vertices()[leaf];
        const WedgeId node = tree->wedge_of_leaf(leaf);
        const glm::vec4 c = mesh.colours[v];
        const float albedo = 0.2126f * c.r + 0.7152f * c.g + 0.0722f * c.b;
        EXPECT_NEAR(tree->luminance()[node], albedo, luminance_rounding);
        const float cosine = std::max(0.0f, glm::normalize(mesh.normals[v]).z);
        EXPECT_NEAR(lit.luminance()[node], albedo * (0.3f + 0.7f * cosine), luminance_rounding + packed_normal_error);
    }
}

TEST(Relit, StaysWithinTheRangeOfLuminance) {
    Mesh white = shapes::icosphere(2);
    white.colours.assign(white.positions.size(), glm::vec4(1));
    const auto tree = require(build_tree(white.view()));
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (const Light& light : {Light{{0, 0, 1.0009f}, 0}, Light{{0, 0, 9}, 0.5f}, Light{{nan, 0, 0}, 0.2f},
                               Light{{0, 0, 1}, nan}, Light{{0, 0, 1}, -3}}) {
        const VertexTree lit = *tree->relit(light);
        for (const float y : lit.luminance()) ASSERT_TRUE(y >= 0 && y <= 1);
        for (const LuminanceRange r : lit.ring_luminance()) ASSERT_TRUE(r.lo >= 0 && r.lo <= r.hi && r.hi <= 1);
    }
}

// By the formula beside Light: faces turned away are lit from the opposite side, and those that see neither by no more
// than what comes from everywhere.
TEST(BuildTree, LightsFacesThatTurnAwayMoreWeakly) {
    const Mesh mesh = shapes::icosphere(3);
    const Light light{.direction = {0, 0, 1}, .ambient = 0.25f, .fill = 0.5f};
    const auto tree = require(build_tree(mesh.view(), {.light = light}));
    const auto expected = [](float facing) {
        return default_albedo * (0.25f + 0.75f * (facing > 0 ? facing : -0.5f * facing));
    };
    float darkest = 1;
    for (Index leaf = 0; leaf < tree->leaf_count(); ++leaf) {
        const WedgeId node = tree->wedge_of_leaf(leaf);
        const float facing = glm::vec3(tree->normals()[node]).z, luminance = tree->luminance()[node];
        EXPECT_NEAR(luminance, expected(facing), 1e-4f) << facing;
        darkest = std::min(darkest, luminance);
    }
    EXPECT_NEAR(darkest, default_albedo * 0.25f, 0.02f);
}

// A light that would make luminances beyond 0..1, or none at all, is not taken.
TEST(BuildTree, RefusesImpossibleLights) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const Mesh mesh = shapes::icosphere(1);
    const std::vector<std::pair<const char*, Light>> lights = {
        {"no direction", {.direction = {nan, 0, 0}, .ambient = 0.2f}},
        {"no ambient share", {.direction = {0, 0, 1}, .ambient = nan}},
        {"too much ambient", {.direction = {0, 0, 1}, .ambient = 2}},
        {"negative ambient", {.direction = {0, 0, 1}, .ambient = -1}},
        {"no fill share", {.direction = {0, 0, 1}, .fill = nan}},
        {"too much fill", {.direction = {0, 0, 1}, .fill = 1.5f}},
        {"negative fill", {.direction = {0, 0, 1}, .fill = -0.1f}},
    };
    for (const auto& [what, light] : lights) EXPECT_FALSE(build_tree(mesh.view(), {.light = light})) << what;
    // A direction of another length counts by its direction alone, or is refused.
    const auto long_direction = build_tree(mesh.view(), {.light = {.direction = {0, 0, 9}, .ambient = 0}});
    if (!long_direction) return;
    for (const float y : long_direction->luminance()) ASSERT_TRUE(y >= 0 && y <= 1);
}

TEST(BuildTree, CanBeCancelledAtAnyTime) {
    const Mesh mesh = shapes::bumpy_sphere(3);
    for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
        bool cancelled = true;
        for (int calls = 0; cancelled; ++calls) {
            ASSERT_LT(calls, 1000);
            int left = calls;
            const auto stop = [&](double share, const char* stage) {
                EXPECT_TRUE(share >= 0 && share <= 1) << share;
                EXPECT_NE(stage, nullptr);
                return left-- > 0;
            };
            const auto tree = build_tree(mesh.view(), {.clusterer = kind, .progress = stop});
            cancelled = !tree;
            if (cancelled) {
                ASSERT_EQ(tree.error().code, ErrorCode::cancelled);
            } else {
                EXPECT_GE(calls, 4);
            }
        }
    }
}

TEST(BuildTree, ReportsProgressThatGrows) {
    double last = 0;
    const auto watch = [&](double share, const char*) {
        EXPECT_GE(share, last);
        last = share;
        return true;
    };
    ASSERT_TRUE(build_tree(shapes::bumpy_sphere(4).view(), {.progress = watch}));
    EXPECT_EQ(last, 1);
}

} // namespace unseen::vdtree::builder_test
