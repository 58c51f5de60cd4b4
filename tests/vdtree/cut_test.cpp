// Cuts: what must hold after anything that can be done to them, and that adjust() gives what it promises.
#include <unseen/vdtree/cut.h>

#include <unseen/vdtree/builder.h>

#include "shapes.h"
#include "sound.h"
#include "testing.h"
#include "textures.h"
#include "tree_checks.h"

namespace unseen::vdtree::cut_test {

using shapes::random_unit;
using support::fault_in_cut;

VertexTree built(const Mesh& mesh, ClustererKind kind = ClustererKind::quadric) {
    // On one thread: a thread sanitizer that does not know how TBB synchronises is to see the cuts' threads only.
    return std::move(*require(build_tree(mesh.view(), {.clusterer = kind, .threads = 1})));
}

struct State {
    std::vector<bool> unfolded;
    std::vector<NodeId> proxies, indices;
    Index triangles;
    bool operator==(const State&) const = default;
};

State state_of(const Cut& cut) {
    State s;
    for (NodeId node = 0; node < cut.tree().interior_count(); ++node) s.unfolded.push_back(cut.is_unfolded(node));
    for (Index leaf = 0; leaf < cut.tree().leaf_count(); ++leaf) s.proxies.push_back(cut.proxy_of_leaf(leaf));
    s.indices.assign(cut.indices().begin(), cut.indices().end());
    s.triangles = cut.triangle_count();
    return s;
}

NodeId random_node(std::mt19937_64& random, NodeId end) { return static_cast<NodeId>(random() % end); }

bool can_fold(const Cut& cut, NodeId node) {
    if (!cut.is_unfolded(node)) return false;
    bool children_folded = true;
    cut.tree().for_each_child(node, [&](NodeId child) { children_folded &= !cut.is_unfolded(child); });
    return children_folded;
}

// One random, permitted operation.
void disturb(Cut& cut, std::mt19937_64& random) {
    const VertexTree& tree = cut.tree();
    const NodeId interior = random_node(random, tree.interior_count());
    switch (random() % 8) {
    case 0: cut.fold_subtree(interior); break;
    case 1: cut.unfold_ancestors(random_node(random, tree.node_count())); break;
    case 2:
        if (random() % 20 == 0) cut.unfold_all();
        break;
    case 3:
        if (random() % 20 == 0) cut.fold_all();
        break;
    case 4:
        if (can_fold(cut, interior)) cut.fold(interior);
        break;
    default:
        if (cut.is_active(interior)) cut.unfold(interior);
        break;
    }
}

// Random costs that do not fall from a node to its parent, with ties, zeros, unbounded ones and values of exactly 1.
std::vector<float> random_costs(const VertexTree& tree, std::mt19937_64& random) {
    std::vector<float> costs(tree.interior_count());
    for (NodeId node = tree.interior_count(); node-- > 0;) {
        const int kind = static_cast<int>(random() % 8);
        float own = static_cast<float>(2 * random_unit(random));
        if (kind == 0) own = 0;
        if (kind == 1) own = 1;
        if (kind == 2) own = 0.5f;
        if (kind == 3 && random() % 8 == 0) own = 1e30f * (1 + static_cast<float>(random_unit(random)));
        costs[node] = std::max(costs[node], own);
        if (node > 0)
            costs[support::sound(tree).parents()[node]] =
                std::max(costs[support::sound(tree).parents()[node]], costs[node]);
    }
    return costs;
}

auto look_up(const std::vector<float>& costs) {
    return [&costs](const VertexTree&, std::span<const NodeId> nodes, std::span<float> out) {
        for (std::size_t i = 0; i < nodes.size(); ++i) out[i] = costs[nodes[i]];
    };
}

TEST(Cut, StartsWhollyFolded) {
    const VertexTree tree = built(shapes::torus(12, 6));
    const Cut cut(tree);
    EXPECT_EQ(cut.triangle_count(), 0u);
    EXPECT_TRUE(cut.indices().empty());
    EXPECT_TRUE(cut.is_active(VertexTree::root()));
    EXPECT_EQ(fault_in_cut(cut), "");
}

TEST(Cut, KeepsItsInvariantsUnderRandomOperations) {
    std::mt19937_64 random(1);
    for (const shapes::Named& named : shapes::all()) {
        for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
            SCOPED_TRACE(named.name + ", " + std::string(name(kind)));
            const VertexTree tree = built(named.mesh, kind);
            Cut cut(tree);
            for (int step = 0; step < 150; ++step) {
                disturb(cut, random);
                ASSERT_EQ(fault_in_cut(cut), "") << "step " << step;
            }
        }
    }
}

TEST(Cut, FoldThenUnfoldRestoresEveryBit) {
    std::mt19937_64 random(2);
    const VertexTree tree = built(shapes::unwelded(shapes::bumpy_sphere(2)));
    Cut cut(tree);
    int pairs = 0;
    for (int step = 0; step < 3000; ++step) {
        disturb(cut, random);
        const NodeId node = random_node(random, tree.interior_count());
        const State before = state_of(cut);
        if (cut.is_active(node)) {
            EXPECT_TRUE(cut.unfold(node));
            EXPECT_TRUE(cut.fold(node));
        } else if (can_fold(cut, node)) {
            EXPECT_TRUE(cut.fold(node));
            EXPECT_TRUE(cut.unfold(node));
        } else {
            continue;
        }
        ++pairs;
        ASSERT_EQ(state_of(cut), before);
    }
    EXPECT_GT(pairs, 500);
}

TEST(Cut, OperationsTellWhetherTheyChangedAnything) {
    const VertexTree tree = built(shapes::icosphere(1));
    Cut cut(tree);
    const NodeId root = VertexTree::root(), last_leaf = tree.node_count() - 1;
    EXPECT_FALSE(cut.fold(root));
    EXPECT_FALSE(cut.fold_subtree(root));
    EXPECT_FALSE(cut.fold_subtree(last_leaf));
    EXPECT_FALSE(cut.unfold_ancestors(root));
    EXPECT_TRUE(cut.unfold(root));
    EXPECT_FALSE(cut.unfold(root));
    EXPECT_TRUE(cut.unfold_ancestors(last_leaf) || support::sound(tree).parents()[last_leaf] == root);
    EXPECT_TRUE(cut.is_active(last_leaf));
    EXPECT_FALSE(cut.unfold_ancestors(last_leaf));
    EXPECT_TRUE(cut.fold_subtree(root));
    EXPECT_TRUE(cut.is_active(root));
}

TEST(Cut, UnfoldAncestorsUnfoldsNothingElse) {
    const VertexTree tree = built(shapes::bumpy_sphere(2));
    std::mt19937_64 random(3);
    for (int round = 0; round < 100; ++round) {
        Cut cut(tree);
        const NodeId node = random_node(random, tree.node_count());
        cut.unfold_ancestors(node);
        EXPECT_TRUE(cut.is_active(node));
        std::vector<bool> above(tree.interior_count(), false);
        for (NodeId up = support::sound(tree).parents()[node]; up != no_node; up = support::sound(tree).parents()[up])
            above[up] = true;
        for (NodeId n = 0; n < tree.interior_count(); ++n) ASSERT_EQ(cut.is_unfolded(n), above[n]);
    }
}

// ---- seams, hard edges and triangles turned over, in any cut

struct AnyMesh {
    const char* name;
    Mesh mesh;
    bool is_closed;
};

std::vector<AnyMesh> any_meshes() {
    const Texture checks = textures::checkerboard(16, 16, 4, 0, 255);
    Mesh hard_box = shapes::unwelded(shapes::cube(8)); // flat faces with normals of their own
    hard_box.normals.resize(hard_box.positions.size());
    for (const Triangle& t : hard_box.triangles) {
        const auto p = [&](std::size_t k) { return hard_box.positions[t[k]]; };
        for (const Index v : t) hard_box.normals[v] = glm::vec3(glm::normalize(glm::cross(p(1) - p(0), p(2) - p(0))));
    }
    return {{"bumpy sphere", shapes::bumpy_sphere(4), true},
            {"spiky star", shapes::spiky_star(3), true},
            {"torus", shapes::torus(40, 20), true},
            {"cube with creases", shapes::cube(8), true},
            {"hard box", hard_box, true},
            {"two parts", shapes::two_parts(), true},
            {"textured sphere", textures::textured_sphere(3, checks), true},
            {"sphere with a seam", textures::with_seams(textures::textured_sphere(3, checks)), true},
            {"materials", shapes::with_attributes(shapes::bumpy_sphere(3)), true},
            {"grid", shapes::grid(24), false},
            {"grid with a seam", textures::with_seams(textures::textured_grid(16, checks), 4), false}};
}

// Random cuts: of costs that grow with the size of the node, jittered by e^+-2.
void make_noisy_cut(Cut& cut, std::mt19937_64& random) {
    const VertexTree& tree = cut.tree();
    std::vector<float> costs(tree.interior_count());
    const double limit = tree.support_spheres()[0].radius * std::exp(-4 * shapes::random_between(random, 0, 1));
    for (NodeId node = tree.interior_count(); node-- > 0;) {
        costs[node] = static_cast<float>(tree.support_spheres()[node].radius / limit *
                                         std::exp(shapes::random_between(random, -2, 2)));
        tree.for_each_child(node, [&](NodeId child) {
            if (!tree.is_place(child)) costs[node] = std::max(costs[node], costs[child]);
        });
    }
    cut.adjust([&](const VertexTree&, std::span<const NodeId> nodes, std::span<float> found) {
        for (std::size_t i = 0; i < nodes.size(); ++i) found[i] = costs[nodes[i]];
    });
}

glm::dvec3 random_unit_vector(std::mt19937_64& random) {
    for (;;) {
        const glm::dvec3 v(shapes::random_between(random, -1, 1), shapes::random_between(random, -1, 1),
                           shapes::random_between(random, -1, 1));
        if (glm::length(v) > 0.1 && glm::length(v) <= 1) return glm::normalize(v);
    }
}

std::vector<NodeId> nodes_of_wedges(const VertexTree& tree) {
    std::vector<NodeId> nodes(tree.wedge_count());
    for (NodeId node = 0; node < tree.node_count(); ++node)
        for (WedgeId w = tree.first_wedge(node); w < tree.wedge_end(node); ++w) nodes[w] = node;
    return nodes;
}

TEST(AnyCut, OfAClosedMeshHasNoBorder) {
    std::mt19937_64 random(31);
    for (const AnyMesh& any : any_meshes()) {
        if (!any.is_closed) continue;
        for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
            const VertexTree tree = built(any.mesh, kind);
            ASSERT_NE(tree.closedness(), Closedness::open) << any.name;
            const std::vector<NodeId> node_of = nodes_of_wedges(tree);
            Cut cut(tree);
            for (int trial = 0; trial < 6; ++trial) {
                make_noisy_cut(cut, random);
                std::map<std::pair<NodeId, NodeId>, int> sides;
                const auto indices = cut.indices();
                for (std::size_t i = 0; i < indices.size(); i += 3)
                    for (std::size_t k = 0; k < 3; ++k) {
                        const NodeId a = node_of[indices[i + k]], b = node_of[indices[i + (k + 1) % 3]];
                        ++sides[{a, b}], --sides[{b, a}];
                    }
                for (const auto& [side, balance] : sides) ASSERT_EQ(balance, 0) << any.name << ", trial " << trial;
            }
        }
    }
}

// Half of the model as far as it is wanted, the other half coarse.
void make_half_cut(Cut& cut, std::mt19937_64& random) {
    const VertexTree& tree = cut.tree();
    const glm::vec3 side(random_unit_vector(random));
    const float limit =
        tree.support_spheres()[0].radius * static_cast<float>(shapes::random_between(random, 0.02, 0.2));
    cut.adjust([&](const VertexTree&, std::span<const NodeId> nodes, std::span<float> costs) {
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            const Sphere& sphere = tree.support_spheres()[nodes[i]];
            const bool is_near = glm::dot(sphere.centre - tree.bounding_sphere().centre, side) + sphere.radius > 0;
            costs[i] = sphere.radius / (is_near ? limit / 8 : limit);
        }
    });
}

// What the repair finds and adds in all of these cuts.
struct Repair {
    std::uint64_t turned = 0, wanted = 0, added = 0;
};
void check_repair(const Cut& cut, const std::vector<bool>& on_mirror, Repair& sum, const std::string& what) {
    ASSERT_EQ(support::fault_in_needs(cut), "") << what;
    const VertexTree& tree = cut.tree();
    const auto turned = support::turned_triangles(tree, on_mirror, [&](NodeId node) { return cut.is_wanted(node); });
    sum.turned += turned.in_space + turned.in_texture;
    const auto first = support::sound(tree).first_triangle();
    Index wanted = 0;
    for (NodeId node = 0; node < tree.interior_count(); ++node)
        if (cut.is_wanted(node)) wanted += first[node + 1] - first[node];
    sum.wanted += wanted;
    sum.added += cut.triangle_count() - wanted;
}

TEST(AnyCut, HasNoTriangleTurnedOver) {
    std::mt19937_64 random(33);
    Repair sum;
    for (const AnyMesh& any : any_meshes()) {
        for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
            const VertexTree tree = built(any.mesh, kind);
            const auto on_mirror = tree.uvs().empty() ? std::vector<bool>() : support::wedges_on_mirrors(tree);
            Cut cut(tree);
            for (int trial = 0; trial < 8; ++trial) {
                if (trial % 2) make_half_cut(cut, random);
                else make_noisy_cut(cut, random);
                check_repair(cut, on_mirror, sum, any.name);
                EXPECT_EQ(support::fault_in_cut(cut), "") << any.name;
            }
        }
    }
    EXPECT_GT(sum.turned, 20u) << "of these there are some to find";
    EXPECT_LT(sum.added, sum.wanted / 50);
}

// In small steps and jumps; by a threshold, budgets, and in time.
TEST(AnyCut, HasNoTriangleTurnedOverWhereverItIsFollowedTo) {
    std::mt19937_64 random(34);
    Repair sum;
    for (const AnyMesh& any : any_meshes()) {
        const VertexTree tree = built(any.mesh);
        const auto on_mirror = tree.uvs().empty() ? std::vector<bool>() : support::wedges_on_mirrors(tree);
        const DistanceCriterion criterion = *require(extent_criterion(tree, View{}, 12));
        const Index budget = tree.triangle_count() / 3;
        for (const FollowOptions& options :
             {FollowOptions{}, FollowOptions{.triangle_budget = budget},
              FollowOptions{.triangle_budget = budget, .hysteresis = 1.2f}, FollowOptions{.milliseconds = 0}}) {
            Cut cut(tree), fresh(tree);
            const double radius = static_cast<double>(tree.bounding_sphere().radius);
            glm::dvec3 eye(0, 0, 3 * radius);
            for (int frame = 0; frame < 24; ++frame) {
                eye += radius * (frame % 8 == 7 ? 2.0 : 0.05) * glm::dvec3(random_unit_vector(random));
                ASSERT_TRUE(cut.follow(criterion, {.eye = eye}, options));
                static_cast<void>(cut.indices());
                check_repair(cut, on_mirror, sum, any.name);
                EXPECT_EQ(support::fault_in_cut(cut), "") << any.name << ", frame " << frame;
                if (options.triangle_budget && !options.milliseconds) EXPECT_LE(cut.triangle_count(), budget);
                if (options.milliseconds || options.hysteresis > 1) continue;
                ASSERT_TRUE(fresh.follow(criterion, {.eye = eye}, options));
                EXPECT_EQ(support::sorted_triangles(cut), support::sorted_triangles(fresh));
                fresh = Cut(tree);
            }
        }
    }
    EXPECT_GT(sum.turned, 0u);
    EXPECT_LT(sum.added, sum.wanted / 50);
}

// A map that folds over itself: the repair leaves alone what is drawn across the line, and budgets are met.
TEST(AnyCut, OfAMirroredMapNeedsHardlyMore) {
    std::mt19937_64 random(35);
    const VertexTree tree = built(textures::textured_sphere(5, textures::checkerboard(16, 16, 4, 0, 255)));
    const auto on_mirror = support::wedges_on_mirrors(tree);
    Repair sum;
    Cut cut(tree);
    for (int trial = 0; trial < 8; ++trial) {
        make_noisy_cut(cut, random);
        check_repair(cut, on_mirror, sum, "noisy");
        const std::vector<float> costs(tree.interior_count(), 2.0f);
        const Index budget = tree.triangle_count() >> (trial + 1);
        EXPECT_LE(cut.adjust(look_up(costs), budget).triangles, budget);
        EXPECT_GT(cut.triangle_count(), budget * 9 / 10);
    }
    EXPECT_LT(sum.added, sum.wanted / 100);
}

TEST(Adjust, FoldsWhereTheCostIsAtMostOne) {
    std::mt19937_64 random(4);
    for (const shapes::Named& named : shapes::all()) {
        SCOPED_TRACE(named.name);
        const VertexTree tree = built(named.mesh);
        for (int round = 0; round < 10; ++round) {
            const std::vector<float> costs = random_costs(tree, random);
            const auto criterion = look_up(costs);
            Cut cut(tree);
            const AdjustStats stats = cut.adjust(criterion);
            ASSERT_EQ(fault_in_cut(cut), "");
            float largest = 0;
            for (NodeId node = 0; node < tree.interior_count(); ++node) {
                const NodeId parent = support::sound(tree).parents()[node];
                const bool reached = parent == no_node || cut.is_wanted(parent);
                ASSERT_EQ(cut.is_wanted(node), reached && costs[node] > 1);
                if (reached && costs[node] <= 1) largest = std::max(largest, costs[node]);
            }
            EXPECT_EQ(stats.max_fold_cost, largest);
            EXPECT_EQ(stats.triangles, cut.triangle_count());
            EXPECT_LE(stats.max_fold_cost, 1);
        }
    }
}

TEST(Adjust, TreatsNotANumberAsUnfold) {
    const VertexTree tree = built(shapes::cube(3));
    Cut cut(tree);
    const auto nothing_known = [](const VertexTree&, std::span<const NodeId>, std::span<float> costs) {
        for (float& cost : costs) cost = std::numeric_limits<float>::quiet_NaN();
    };
    AdjustStats stats = cut.adjust(nothing_known);
    EXPECT_EQ(cut.triangle_count(), tree.triangle_count());
    EXPECT_EQ(stats.max_fold_cost, 0);
    // Under a budget too: they come first.
    const auto half_known = [](const VertexTree&, std::span<const NodeId> nodes, std::span<float> costs) {
        for (std::size_t i = 0; i < nodes.size(); ++i)
            costs[i] = nodes[i] % 2 == 0 ? std::numeric_limits<float>::quiet_NaN() : 5.0f;
    };
    stats = cut.adjust(half_known, tree.triangle_count() / 2);
    EXPECT_LE(cut.triangle_count(), tree.triangle_count() / 2);
    EXPECT_EQ(fault_in_cut(cut), "");
    EXPECT_FALSE(std::isnan(stats.max_fold_cost));
}

TEST(Adjust, FoldsAtExactlyOneAndUnfoldsJustAbove) {
    const VertexTree tree = built(shapes::icosphere(1));
    Cut cut(tree);
    const auto constant = [](float value) {
        return [value](const VertexTree&, std::span<const NodeId>, std::span<float> costs) {
            for (float& cost : costs) cost = value;
        };
    };
    const AdjustStats folded = cut.adjust(constant(1.0f));
    EXPECT_EQ(cut.triangle_count(), 0u);
    EXPECT_EQ(folded.max_fold_cost, 1.0f);
    EXPECT_EQ(folded.node_tests, 1u);
    const AdjustStats unfolded = cut.adjust(constant(std::nextafter(1.0f, 2.0f)));
    EXPECT_EQ(cut.triangle_count(), tree.triangle_count());
    EXPECT_EQ(unfolded.max_fold_cost, 0);
    EXPECT_EQ(unfolded.node_tests, tree.interior_count());
    EXPECT_EQ(unfolded.unfolds, tree.interior_count());
    EXPECT_EQ(unfolded.folds, 0u);
    const AdjustStats again = cut.adjust(constant(0.0f));
    EXPECT_EQ(again.folds, tree.interior_count());
    EXPECT_EQ(again.unfolds, 0u);
}

TEST(Adjust, DoesNotDependOnTheStateBefore) {
    std::mt19937_64 random(5);
    const VertexTree tree = built(shapes::bumpy_sphere(3));
    Cut kept(tree);
    for (int round = 0; round < 60; ++round) {
        for (int step = 0; step < 20; ++step) disturb(kept, random);
        const State before = state_of(kept);
        const std::vector<float> costs = random_costs(tree, random);
        const auto criterion = look_up(costs);
        std::optional<Index> budget;
        if (round % 2) budget = static_cast<Index>(random() % (tree.triangle_count() + 100));
        Cut fresh(tree);
        const AdjustStats incremental = kept.adjust(criterion, budget), scratch = fresh.adjust(criterion, budget);
        ASSERT_EQ(state_of(kept), state_of(fresh));
        EXPECT_EQ(incremental.max_fold_cost, scratch.max_fold_cost);
        EXPECT_EQ(incremental.triangles, scratch.triangles);
        std::uint64_t folds = 0, unfolds = 0;
        for (NodeId node = 0; node < tree.interior_count(); ++node) {
            folds += before.unfolded[node] && !kept.is_unfolded(node);
            unfolds += !before.unfolded[node] && kept.is_unfolded(node);
        }
        EXPECT_EQ(incremental.folds, folds);
        EXPECT_EQ(incremental.unfolds, unfolds);
    }
}

Index triangles_of(const VertexTree& tree, const std::vector<bool>& unfolded) {
    Index triangles = 0;
    for (NodeId node = 0; node < tree.interior_count(); ++node)
        if (unfolded[node])
            triangles += support::sound(tree).first_triangle()[node + 1] - support::sound(tree).first_triangle()[node];
    return triangles;
}

TEST(Budget, NeverExceedsAndNeverWastes) {
    std::mt19937_64 random(6);
    for (const shapes::Named& named : shapes::all()) {
        SCOPED_TRACE(named.name);
        const VertexTree tree = built(named.mesh);
        for (int round = 0; round < 12; ++round) {
            const std::vector<float> costs = random_costs(tree, random);
            const auto criterion = look_up(costs);
            const Index budget = static_cast<Index>(random() % (tree.triangle_count() + 5));
            Cut cut(tree);
            const AdjustStats stats = cut.adjust(criterion, budget);
            ASSERT_EQ(fault_in_cut(cut), "");
            ASSERT_LE(cut.triangle_count(), budget);
            // The costliest folded node is 0, or does not fit.
            float largest = 0;
            NodeId first = no_node;
            std::vector<bool> more(tree.interior_count());
            for (NodeId node = 0; node < tree.interior_count(); ++node) {
                more[node] = cut.is_wanted(node);
                const NodeId parent = support::sound(tree).parents()[node];
                const bool is_folded = !more[node] && (parent == no_node || more[parent]);
                if (!is_folded || (first != no_node && costs[node] <= largest)) continue;
                largest = costs[node];
                first = node;
            }
            ASSERT_EQ(stats.max_fold_cost, largest);
            if (first != no_node) more[first] = true;
            const bool fits = first != no_node && triangles_of(tree, support::with_needs(tree, more)) <= budget;
            ASSERT_TRUE(largest == 0 || !fits);
        }
    }
}

// The least largest cost over all cuts within the budget, by trying every one.
float least_largest_cost(const VertexTree& tree, const std::vector<float>& costs, Index budget) {
    float least = std::numeric_limits<float>::infinity();
    const NodeId n = tree.interior_count();
    for (std::uint32_t unfolded = 0; unfolded < (1u << n); ++unfolded) {
        const auto is_unfolded = [&](NodeId node) { return (unfolded >> node) & 1; };
        bool closed = true;
        Index triangles = 0;
        float largest = 0;
        for (NodeId node = 0; node < n; ++node) {
            const NodeId parent = support::sound(tree).parents()[node];
            const bool reached = parent == no_node || is_unfolded(parent);
            closed &= reached || !is_unfolded(node);
            if (is_unfolded(node))
                triangles +=
                    support::sound(tree).first_triangle()[node + 1] - support::sound(tree).first_triangle()[node];
            else if (reached) largest = std::max(largest, costs[node]);
        }
        if (!closed || triangles > budget) continue;
        std::vector<bool> bits(n);
        for (NodeId node = 0; node < n; ++node) bits[node] = is_unfolded(node);
        if (support::with_needs(tree, bits) == bits) least = std::min(least, largest);
    }
    return least;
}

TEST(Budget, GivesTheLeastLargestCostOfAllCuts) {
    std::mt19937_64 random(7);
    int compared = 0;
    for (unsigned seed = 0; seed < 30; ++seed) {
        const VertexTree tree =
            built(shapes::random_soup(11, 18, seed), seed % 2 ? ClustererKind::quadric : ClustererKind::octree);
        if (tree.interior_count() > 12) continue;
        for (int round = 0; round < 10; ++round) {
            const std::vector<float> costs = random_costs(tree, random);
            const auto criterion = look_up(costs);
            const Index budget = static_cast<Index>(random() % 20);
            Cut cut(tree);
            const AdjustStats stats = cut.adjust(criterion, budget);
            ASSERT_EQ(stats.max_fold_cost, least_largest_cost(tree, costs, budget)) << "seed " << seed;
            ++compared;
        }
    }
    EXPECT_GT(compared, 100);
}

TEST(Budget, LeavesFoldsThatCostNothing) {
    const VertexTree tree = built(shapes::torus(10, 6));
    const std::vector<float> costs(tree.interior_count(), 0.0f);
    const auto criterion = look_up(costs);
    Cut cut(tree);
    EXPECT_EQ(cut.adjust(criterion, tree.triangle_count()).triangles, 0u);
}

TEST(Adjust, AsksInBatchesOfLevels) {
    const VertexTree tree = built(shapes::bumpy_sphere(4));
    std::size_t calls = 0, largest = 0;
    const auto criterion = [&](const VertexTree&, std::span<const NodeId> nodes, std::span<float> costs) {
        ASSERT_EQ(nodes.size(), costs.size());
        ++calls;
        largest = std::max(largest, nodes.size());
        for (float& cost : costs) cost = 2;
    };
    Cut cut(tree);
    cut.adjust(criterion);
    EXPECT_GT(largest, 100u); // many nodes a call
    EXPECT_LT(calls, tree.interior_count() / 4);
}

constexpr float packed_normal_error = 6.6e-5f; // length; see <unseen/vdtree/vertex_tree.h>

TEST(ExtractMesh, GivesTheVerticesInUseInDoublePrecision) {
    const Mesh mesh =
        shapes::in_floats(shapes::with_attributes(shapes::placed(shapes::bumpy_sphere(2), 30, {5e5, 5e6, 100})));
    const VertexTree tree = built(mesh);
    Cut cut(tree);
    cut.unfold_all();
    const Mesh whole = extract_mesh(cut);
    ASSERT_TRUE(validate(whole.view()));
    EXPECT_EQ(whole.positions.size(), tree.leaf_count()) << "a vertex of two materials is two leaves";
    ASSERT_EQ(whole.triangles.size(), mesh.triangles.size());
    // Sorted by input triangle, for there are ranges: every corner is the same vertex with the same attributes.
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        for (std::size_t k = 0; k < 3; ++k) {
            const Index v = mesh.triangles[t][k], w = whole.triangles[t][k];
            ASSERT_EQ(whole.positions[w], mesh.positions[v]);
            ASSERT_EQ(whole.colours[w], mesh.colours[v]);
            ASSERT_EQ(whole.uvs[w], mesh.uvs[v]);
            ASSERT_LT(glm::distance(whole.normals[w], glm::normalize(mesh.normals[v])), packed_normal_error);
        }
    }
    ASSERT_EQ(whole.ranges.size(), mesh.ranges.size());
    for (std::size_t r = 0; r < whole.ranges.size(); ++r) {
        EXPECT_EQ(whole.ranges[r].name, mesh.ranges[r].name);
        EXPECT_EQ(whole.ranges[r].first_triangle, mesh.ranges[r].first_triangle);
        EXPECT_EQ(whole.ranges[r].triangle_count, mesh.ranges[r].triangle_count);
    }
}

TEST(ExtractMesh, KeepsEveryTriangleInItsRange) {
    std::mt19937_64 random(8);
    const Mesh mesh = shapes::with_degenerate_triangles(shapes::with_attributes(shapes::bumpy_sphere(2)));
    const VertexTree tree = built(mesh);
    Cut cut(tree);
    for (int round = 0; round < 20; ++round) {
        for (int step = 0; step < 10; ++step) disturb(cut, random);
        const Mesh part = extract_mesh(cut);
        ASSERT_TRUE(validate(part.view()));
        ASSERT_EQ(part.triangles.size(), cut.triangle_count());
        for (const MeshRange& range : tree.ranges()) {
            std::uint64_t expected = 0;
            for (NodeId node = 0; node < tree.interior_count(); ++node)
                for (Index t = support::sound(tree).first_triangle()[node];
                     cut.is_unfolded(node) && t < support::sound(tree).first_triangle()[node + 1]; ++t)
                    expected += tree.source_triangles()[t] >= range.first_triangle &&
                                tree.source_triangles()[t] < range.first_triangle + range.triangle_count;
            std::uint64_t found = 0;
            for (const MeshRange& r : part.ranges)
                if (r.name == range.name && r.kind == range.kind) found += r.triangle_count;
            ASSERT_EQ(found, expected) << range.name;
        }
    }
}

// The index buffer's order is another one when it has been patched.
TEST(ExtractMesh, DoesNotDependOnTheHistoryOfTheCut) {
    const VertexTree tree = built(shapes::with_attributes(shapes::bumpy_sphere(4, 0.03)));
    ASSERT_FALSE(tree.ranges().empty());
    const auto criterion = require(extent_criterion(tree, View{}, 100));
    Cut cut(tree);
    int changed = 0;
    for (int frame = 0; frame < 60; ++frame) {
        const Viewpoint viewpoint{.eye = {0, 0.3, 3 + 0.01 * frame}};
        ASSERT_TRUE(cut.follow(*criterion, viewpoint));
        static_cast<void>(cut.indices());
        changed += !cut.changes().empty();
        Cut fresh(tree);
        ASSERT_TRUE(fresh.follow(*criterion, viewpoint));
        const Mesh mesh = extract_mesh(cut), expected = extract_mesh(fresh);
        ASSERT_EQ(mesh.positions, expected.positions) << "frame " << frame;
        ASSERT_EQ(mesh.triangles, expected.triangles) << "frame " << frame;
    }
    EXPECT_GT(changed, 20);
}

TEST(ExtractMesh, IsEmptyForAFoldedCut) {
    const VertexTree tree = built(shapes::with_attributes(shapes::cube(2)));
    const Mesh nothing = extract_mesh(Cut(tree));
    EXPECT_TRUE(nothing.positions.empty() && nothing.triangles.empty() && nothing.ranges.empty());
}

} // namespace unseen::vdtree::cut_test
