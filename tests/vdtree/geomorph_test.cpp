// Geomorphs: what is drawn moves continuously, is a valid cut at any time, and comes to rest at the followed cut.
#include <unseen/vdtree/geomorph.h>

#include <glm/common.hpp>

#include <unseen/vdtree/builder.h>

#include "shapes.h"
#include "sound.h"
#include "testing.h"
#include "tree_checks.h"

namespace unseen::vdtree::geomorph_test {

using shapes::random_unit;

constexpr double glide_seconds = 0.25;
constexpr double frame_seconds = 1 / 60.0;

VertexTree built(Mesh mesh, ClustererKind kind, std::optional<float> crease = {}) {
    // Colours that vary, so that all that glides is seen to.
    for (const glm::dvec3 p : mesh.positions) {
        const glm::dvec3 wave = 0.5 + 0.4 * glm::sin(7.0 * p);
        mesh.colours.push_back(glm::vec4(glm::vec3(wave), 1));
    }
    return std::move(
        *require(build_tree(mesh.view(), {.clusterer = kind, .prelit = true, .crease = crease, .threads = 1})));
}

Geomorph made(const VertexTree& tree, double seconds = 0.25, double jump_share = 0.25) {
    return std::move(*require(Geomorph::create(tree, seconds, jump_share)));
}

struct TreeClass {
    const char* name;
    std::function<VertexTree()> make;
};
const TreeClass tree_classes[] = {
    {"organic", [] { return built(shapes::bumpy_sphere(3, 0.05), ClustererKind::quadric); }},
    {"octree", [] { return built(shapes::bumpy_sphere(4, 0.05), ClustererKind::octree); }},
    {"cad", [] { return built(shapes::together(shapes::cube(6), shapes::torus(30, 12)), ClustererKind::quadric); }},
    {"soup", [] { return built(shapes::random_soup(300, 900, 7), ClustererKind::octree); }},
};

// Costs that rise and fall from node to node, each at its own pace: folds and unfolds everywhere, many of them taken
// back soon.
class Waves {
public:
    Waves(const VertexTree& tree, std::uint64_t seed) {
        std::mt19937_64 random(seed);
        for (NodeId node = 0; node < tree.interior_count(); ++node) {
            pace_.push_back(static_cast<float>(0.02 + 0.3 * random_unit(random)));
            phase_.push_back(static_cast<float>(2 * std::numbers::pi * random_unit(random)));
        }
    }
    void adjust(Cut& cut, int frame) const {
        const auto costs = [&](const VertexTree&, std::span<const NodeId> nodes, std::span<float> out) {
            for (std::size_t i = 0; i < nodes.size(); ++i)
                out[i] = 1.7f + std::sin(phase_[nodes[i]] + pace_[nodes[i]] * static_cast<float>(frame));
        };
        cut.adjust(costs);
    }

private:
    std::vector<float> pace_, phase_;
};

// What stands for each leaf, as it is drawn.
std::vector<MovedVertex> drawn_by_leaf(const Geomorph& geomorph) {
    const VertexTree& tree = geomorph.drawn().tree();
    std::map<WedgeId, MovedVertex> moved;
    for (const MovedVertex& vertex : geomorph.moved()) moved[vertex.wedge] = vertex;
    EXPECT_EQ(moved.size(), geomorph.moved().size()) << "each once";
    std::vector<MovedVertex> out;
    for (Index leaf = 0; leaf < tree.leaf_count(); ++leaf) {
        const WedgeId w = geomorph.drawn().wedge_of_leaf(leaf);
        const auto found = moved.find(w);
        if (found == moved.end()) out.push_back({w, tree.positions()[w], tree.luminance()[w], tree.colours()[w]});
        else out.push_back(found->second);
    }
    const auto is_drawn = [&](WedgeId w) {
        return std::ranges::any_of(out, [&](const MovedVertex& vertex) { return vertex.wedge == w; });
    };
    for (const auto& [w, vertex] : moved) EXPECT_TRUE(is_drawn(w));
    return out;
}

// By leaf: the largest difference between any two nodes that may stand for it; no glide of one node is longer.
struct Longest {
    float position = 0, luminance = 0;
};
std::vector<Longest> longest_glides(const VertexTree& tree) {
    std::vector<Longest> out;
    for (Index leaf = 0; leaf < tree.leaf_count(); ++leaf) {
        std::vector<WedgeId> chain;
        for (NodeId node = tree.place_of_leaf(leaf); node != no_node; node = support::sound(tree).parents()[node])
            chain.push_back(tree.wedge_at(node, leaf));
        Longest longest;
        for (const WedgeId a : chain)
            for (const WedgeId b : chain) {
                longest.position = std::max(longest.position, glm::distance(tree.positions()[a], tree.positions()[b]));
                longest.luminance = std::max(longest.luminance, std::abs(tree.luminance()[a] - tree.luminance()[b]));
            }
        out.push_back(longest);
    }
    return out;
}

// Which nodes may be gliding: those that the followed cut has changed within the time of a glide.
class Changed {
public:
    explicit Changed(const VertexTree& tree) : was_(tree.interior_count()), when_(tree.interior_count(), -1e9) {}
    void look_at(const Cut& cut, double now) {
        for (NodeId node = 0; node < was_.size(); ++node) {
            if (cut.is_unfolded(node) != was_[node]) when_[node] = now;
            was_[node] = cut.is_unfolded(node);
        }
    }
    // Above a leaf.
    int count(const VertexTree& tree, Index leaf, double now) const {
        int nodes = 0;
        for (NodeId node = support::sound(tree).parents()[tree.place_of_leaf(leaf)]; node != no_node;
             node = support::sound(tree).parents()[node])
            nodes += now - when_[node] <= glide_seconds + 1e-6;
        return nodes;
    }

private:
    std::vector<bool> was_;
    std::vector<double> when_;
};

// Of float arithmetic on coordinates and luminances of about 1: a few units in the last place.
constexpr float rounding = 2e-6f;

bool is_same_cut(const Cut& a, const Cut& b) {
    for (NodeId node = 0; node < a.tree().interior_count(); ++node)
        if (a.is_unfolded(node) != b.is_unfolded(node)) return false;
    return true;
}

std::string fault(const Geomorph& geomorph, const Cut& cut) {
    for (NodeId node = 0; node < cut.tree().interior_count(); ++node)
        if (cut.is_unfolded(node) && !geomorph.drawn().is_unfolded(node))
            return "a node is unfolded in the followed cut only";
    return support::fault_in_cut(geomorph.drawn());
}

class Geomorphs : public testing::TestWithParam<TreeClass> {};
INSTANTIATE_TEST_SUITE_P(TreeClasses, Geomorphs, testing::ValuesIn(tree_classes),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(Geomorphs, NothingPopsWhateverTheFollowedCutDoes) {
    const VertexTree tree = GetParam().make();
    const std::vector<Longest> longest = longest_glides(tree);
    for (const std::uint64_t seed : {1, 2, 3, 4, 5}) {
        const Waves waves(tree, seed);
        std::mt19937_64 random(seed);
        Cut cut(tree);
        Geomorph geomorph = made(tree, glide_seconds, std::numeric_limits<double>::infinity());
        waves.adjust(cut, 0);
        ASSERT_TRUE(geomorph.step(cut, 0));
        ASSERT_TRUE(is_same_cut(geomorph.drawn(), cut)) << "the first step is a jump";
        std::vector<MovedVertex> before = drawn_by_leaf(geomorph);
        double most_moved = 0, clock = 0;
        bool had_more = false;
        Changed changed(tree);
        changed.look_at(cut, -1e9);
        for (int frame = 1; frame < 120; ++frame) {
            const double seconds = frame % 10 == 3 ? 0 : frame_seconds * 2 * random_unit(random);
            if (frame % 4 != 1) waves.adjust(cut, frame);
            if (frame % 9 == 5) waves.adjust(cut, frame + 1); // one change is missed
            if (frame % 17 == 8) cut.fold_subtree(static_cast<NodeId>(random() % tree.interior_count()));
            ASSERT_TRUE(geomorph.step(cut, seconds));
            ASSERT_EQ(fault(geomorph, cut), "") << "frame " << frame;
            std::vector<MovedVertex> now = drawn_by_leaf(geomorph);
            for (Index leaf = 0; leaf < tree.leaf_count(); ++leaf) {
                const int glides = changed.count(tree, leaf, clock);
                const float share = static_cast<float>(glides * std::min(1.0, seconds / glide_seconds));
                const float moved = glm::distance(now[leaf].position, before[leaf].position);
                ASSERT_LE(moved, longest[leaf].position * share + rounding) << "leaf " << leaf << ", frame " << frame;
                ASSERT_LE(std::abs(now[leaf].luminance - before[leaf].luminance),
                          longest[leaf].luminance * share + rounding);
                most_moved = std::max(most_moved, static_cast<double>(moved));
            }
            clock += seconds;
            changed.look_at(cut, clock);
            had_more |= geomorph.drawn().triangle_count() > cut.triangle_count();
            before = std::move(now);
        }
        EXPECT_GT(most_moved, 100 * static_cast<double>(rounding));
        EXPECT_TRUE(had_more) << "folds wait for their vertices";

        // It stands still: everything comes to rest, bit for bit.
        for (double passed = 0; passed < glide_seconds + frame_seconds; passed += frame_seconds)
            ASSERT_TRUE(geomorph.step(cut, frame_seconds));
        EXPECT_FALSE(geomorph.is_gliding());
        EXPECT_TRUE(geomorph.moved().empty());
        EXPECT_TRUE(is_same_cut(geomorph.drawn(), cut));
        EXPECT_EQ(geomorph.drawn().triangle_count(), cut.triangle_count());
    }
}

// The extra triangles are those of the folds within one glide's time.
TEST_P(Geomorphs, DrawsNoMoreThanTheLatestFoldsTookAway) {
    const VertexTree tree = GetParam().make();
    const Waves waves(tree, 8);
    Cut cut(tree);
    Geomorph geomorph = made(tree, glide_seconds, std::numeric_limits<double>::infinity());
    std::vector<double> folded; // triangles, by frame
    constexpr std::size_t frames_a_glide = 16;
    static_assert(frames_a_glide * frame_seconds > glide_seconds);
    for (int frame = 0; frame < 100; ++frame) {
        waves.adjust(cut, frame);
        double triangles = 0;
        for (const FoldChange& change : cut.changes())
            if (change.folded)
                triangles += support::sound(tree).first_triangle()[change.node + 1] -
                             support::sound(tree).first_triangle()[change.node];
        folded.push_back(triangles);
        ASSERT_TRUE(geomorph.step(cut, frame_seconds));
        double most = cut.triangle_count();
        for (std::size_t i = folded.size(); i-- > 0 && folded.size() - i <= frames_a_glide;) most += folded[i];
        ASSERT_LE(geomorph.drawn().triangle_count(), most) << "frame " << frame;
    }
}

TEST_P(Geomorphs, FollowsACutThatFollowsAnEye) {
    const VertexTree tree = GetParam().make();
    View view;
    view.width = view.height = 256;
    const auto criterion = require(extent_criterion(tree, view, 12));
    const std::vector<Longest> longest = longest_glides(tree);
    const Sphere sphere = tree.bounding_sphere();
    Cut cut(tree);
    Geomorph geomorph = made(tree);
    std::vector<MovedVertex> before;
    support::GpuCopy copy(tree);
    std::uint64_t changes = 0;
    Changed changed(tree);
    for (int frame = 0; frame < 240; ++frame) {
        const double distance = sphere.radius * (5 - 0.015 * frame);
        const auto stats =
            cut.follow(*criterion, {.eye = glm::dvec3(sphere.centre) + glm::dvec3(0.2 * distance, 0, distance)});
        ASSERT_TRUE(stats);
        changes += frame > 0 ? stats->folds + stats->unfolds : 0;
        ASSERT_TRUE(geomorph.step(cut, frame_seconds));
        ASSERT_EQ(fault(geomorph, cut), "") << "frame " << frame;
        const std::vector<MovedVertex> now = drawn_by_leaf(geomorph);
        for (Index leaf = 0; frame > 0 && leaf < tree.leaf_count(); ++leaf) {
            const float share = static_cast<float>(changed.count(tree, leaf, (frame - 1) * frame_seconds) *
                                                   frame_seconds / glide_seconds);
            ASSERT_LE(glm::distance(now[leaf].position, before[leaf].position),
                      longest[leaf].position * share + rounding);
        }
        changed.look_at(cut, frame * frame_seconds);
        before = now;

        copy.update(geomorph.drawn());
        ASSERT_EQ(copy.sorted_triangles(), support::sorted_triangles(geomorph.drawn())) << "frame " << frame;
    }
    EXPECT_GT(changes, 40u);
}

class OneNode : public testing::Test {
protected:
    OneNode() { // a node whose children are all leaves, apart from its own place
        cut_.unfold_all();
        while (support::sound(tree_).subtree_end()[node_] > node_ + 1) ++node_;
        EXPECT_TRUE(geomorph_.step(cut_, 0));
    }
    MovedVertex drawn(NodeId vertex) const {
        for (const MovedVertex& moved : geomorph_.moved())
            if (moved.wedge == vertex) return moved;
        return {vertex, tree_.positions()[vertex], tree_.luminance()[vertex], tree_.colours()[vertex]};
    }
    void pass(double seconds) { ASSERT_TRUE(geomorph_.step(cut_, seconds)); }
    // no_node: the child itself.
    void expect_between(NodeId from, NodeId to, float share) const {
        tree_.for_each_child(node_, [&](NodeId child) {
            const NodeId a = from == no_node ? child : from, b = to == no_node ? child : to;
            EXPECT_LT(glm::distance(drawn(child).position, glm::mix(tree_.positions()[a], tree_.positions()[b], share)),
                      rounding);
            EXPECT_NEAR(drawn(child).luminance,
                        glm::mix(float(tree_.luminance()[a]), float(tree_.luminance()[b]), share), rounding);
            EXPECT_LT(glm::distance(drawn(child).colour, glm::mix(tree_.colours()[a], tree_.colours()[b], share)),
                      rounding);
        });
    }

    VertexTree tree_ = built(shapes::bumpy_sphere(3, 0.05), ClustererKind::quadric, 180); // nodes have one wedge
    Cut cut_{tree_};
    Geomorph geomorph_ = made(tree_, 0.5);
    NodeId node_ = 0;
};

TEST_F(OneNode, FoldsWhenItsChildrenHaveCome) {
    cut_.fold(node_);
    pass(7); // before anybody sets out
    EXPECT_TRUE(geomorph_.is_gliding());
    for (const float share : {0.25f, 0.5f, 0.75f}) {
        pass(0.125);
        EXPECT_TRUE(geomorph_.drawn().is_unfolded(node_));
        expect_between(no_node, node_, share);
    }
    pass(0.125);
    EXPECT_FALSE(geomorph_.drawn().is_unfolded(node_));
    EXPECT_FALSE(geomorph_.is_gliding());
}

TEST_F(OneNode, AFoldThatIsTakenBackTurnsAround) {
    cut_.fold(node_);
    pass(0);
    pass(0.125);
    cut_.unfold(node_);
    pass(0.125); // to the middle first
    expect_between(no_node, node_, 0.5f);
    pass(0.125); // the way back takes as long as the way there
    expect_between(no_node, node_, 0.25f);
    EXPECT_TRUE(geomorph_.drawn().is_unfolded(node_));
    pass(0.125);
    EXPECT_FALSE(geomorph_.is_gliding());
    EXPECT_TRUE(geomorph_.drawn().is_unfolded(node_)) << "the fold must not come after all";
    pass(10);
    EXPECT_TRUE(geomorph_.drawn().is_unfolded(node_));
}

TEST_F(OneNode, AnUnfoldThatIsTakenBackTurnsAround) {
    cut_.fold(node_);
    pass(0);
    pass(1);
    ASSERT_FALSE(geomorph_.drawn().is_unfolded(node_));
    cut_.unfold(node_);
    pass(0);
    expect_between(node_, no_node, 0);
    pass(0.25);
    expect_between(node_, no_node, 0.5f);
    cut_.fold(node_);
    pass(0);
    pass(0.125);
    expect_between(node_, no_node, 0.25f);
    EXPECT_TRUE(geomorph_.drawn().is_unfolded(node_));
    pass(0.125);
    EXPECT_FALSE(geomorph_.drawn().is_unfolded(node_));
    EXPECT_TRUE(geomorph_.moved().empty());
}

TEST_F(OneNode, WhatUnfoldsUnderAGlidingVertexBeginsWhereThatIs) {
    const NodeId parent = support::sound(tree_).parents()[node_];
    cut_.fold_subtree(parent);
    pass(0);
    pass(1);
    cut_.unfold(parent);
    pass(0);
    pass(0.125);
    const MovedVertex at = drawn(node_);
    EXPECT_LT(glm::distance(at.position, glm::mix(tree_.positions()[parent], tree_.positions()[node_], 0.25f)),
              rounding);
    cut_.unfold(node_);
    pass(0);
    tree_.for_each_child(node_, [&](NodeId child) { EXPECT_EQ(drawn(child).position, at.position); });
    pass(0.5);
    EXPECT_FALSE(geomorph_.is_gliding());
}

TEST(Geomorph, JumpsAreCutShort) {
    const VertexTree tree = tree_classes[1].make();
    Cut cut(tree);
    Geomorph geomorph = made(tree, 1);
    const Waves waves(tree, 4);
    waves.adjust(cut, 0);
    ASSERT_TRUE(geomorph.step(cut, 0));
    waves.adjust(cut, 1);
    ASSERT_TRUE(geomorph.step(cut, 0.1));
    EXPECT_TRUE(geomorph.is_gliding());
    cut.unfold_all();
    ASSERT_TRUE(geomorph.step(cut, 0.1));
    EXPECT_FALSE(geomorph.is_gliding());
    EXPECT_TRUE(is_same_cut(geomorph.drawn(), cut));
    cut.fold_all();
    ASSERT_TRUE(geomorph.step(cut, 0.1));
    EXPECT_TRUE(is_same_cut(geomorph.drawn(), cut));
    EXPECT_EQ(geomorph.drawn().triangle_count(), 0u);
}

TEST(Geomorph, FewChangesGlideHoweverCoarseTheCut) {
    const VertexTree tree = tree_classes[0].make();
    Cut cut(tree);
    Geomorph geomorph = made(tree);
    ASSERT_TRUE(geomorph.step(cut, 0));
    cut.unfold(VertexTree::root());
    ASSERT_TRUE(geomorph.step(cut, 0));
    EXPECT_TRUE(geomorph.is_gliding());
}

// A tree as deep as it has vertices, all of it gliding at once.
TEST(Geomorph, GlidesDownChainsOfAnyDepth) {
    constexpr Index leaves = 30'000;
    Mesh mesh;
    for (Index i = 0; i < leaves; ++i) mesh.positions.push_back({0.001 * i, i % 2, 0.0});
    for (Index i = 0; i + 2 < leaves; ++i) mesh.triangles.push_back({i, i + 1, i + 2});
    const auto chain = [](const ClusterInput&) -> Result<Clustering> {
        Clustering clustering; // cluster leaves + k has leaf k + 1 and the cluster before, or leaf 0
        clustering.parents.resize(2 * leaves - 1);
        clustering.parents[0] = leaves;
        for (Index k = 0; k + 1 < leaves; ++k) {
            clustering.parents[k + 1] = leaves + k;
            clustering.parents[leaves + k] = std::min(leaves + k + 1, 2 * leaves - 2);
        }
        return clustering;
    };
    const auto tree = require(build_tree(mesh.view(), chain, {.crease = 180}));
    Cut cut(*tree);
    Geomorph geomorph = made(*tree, 0.25, std::numeric_limits<double>::infinity());
    ASSERT_TRUE(geomorph.step(cut, 0));
    cut.unfold_all();
    ASSERT_TRUE(geomorph.step(cut, 0));
    ASSERT_TRUE(geomorph.step(cut, 0.1));
    EXPECT_EQ(geomorph.moved().size(), leaves);
    ASSERT_TRUE(geomorph.step(cut, 0.2));
    EXPECT_FALSE(geomorph.is_gliding());
    cut.fold_all();
    ASSERT_TRUE(geomorph.step(cut, 0));
    ASSERT_TRUE(geomorph.step(cut, 0.3));
    EXPECT_EQ(geomorph.drawn().triangle_count(), 0u);
}

TEST(Geomorph, InNoTimeIsTheFollowedCut) {
    const VertexTree tree = tree_classes[0].make();
    const Waves waves(tree, 6);
    Cut cut(tree);
    Geomorph geomorph = made(tree, 0, std::numeric_limits<double>::infinity());
    for (int frame = 0; frame < 50; ++frame) {
        waves.adjust(cut, frame);
        ASSERT_TRUE(geomorph.step(cut, frame % 2 ? frame_seconds : 0));
        ASSERT_FALSE(geomorph.is_gliding());
        ASSERT_TRUE(is_same_cut(geomorph.drawn(), cut));
    }
}

TEST(Geomorph, TheSameStepsDrawTheSame) {
    const VertexTree tree = tree_classes[0].make();
    const Waves waves(tree, 7);
    Cut cut(tree);
    Geomorph one = made(tree), other = made(tree);
    std::size_t moved = 0;
    for (int frame = 0; frame < 60; ++frame) {
        waves.adjust(cut, frame);
        ASSERT_TRUE(one.step(cut, frame_seconds));
        ASSERT_TRUE(other.step(cut, frame_seconds));
        ASSERT_EQ(one.moved().size(), other.moved().size());
        ASSERT_TRUE(one.moved().empty() ||
                    std::memcmp(one.moved().data(), other.moved().data(), one.moved().size_bytes()) == 0);
        ASSERT_TRUE(is_same_cut(one.drawn(), other.drawn()));
        moved += one.moved().size();
    }
    EXPECT_GT(moved, 0u);
}

TEST(Geomorph, TakesAnotherCutForAChange) {
    const VertexTree tree = tree_classes[0].make();
    const Waves waves(tree, 9);
    Cut one(tree), other(tree);
    waves.adjust(one, 0);
    waves.adjust(other, 3);
    Geomorph geomorph = made(tree);
    ASSERT_TRUE(geomorph.step(one, 0));
    ASSERT_TRUE(geomorph.step(other, 0));
    ASSERT_TRUE(geomorph.step(other, 1));
    EXPECT_TRUE(is_same_cut(geomorph.drawn(), other));
    const Cut moved = std::move(other);
    ASSERT_TRUE(geomorph.step(moved, 1));
    EXPECT_TRUE(is_same_cut(geomorph.drawn(), moved));
}

TEST(Geomorph, RefusesWhatIsNoTime) {
    const VertexTree tree = tree_classes[0].make(), twin = tree_classes[0].make();
    const double nan = std::numeric_limits<double>::quiet_NaN(), infinite = std::numeric_limits<double>::infinity();
    for (const double seconds : {nan, -0.1, infinite}) EXPECT_FALSE(Geomorph::create(tree, seconds));
    for (const double share : {nan, -0.1}) EXPECT_FALSE(Geomorph::create(tree, 1, share));
    Cut cut(tree);
    const Cut of_another_tree(twin);
    Geomorph geomorph = made(tree);
    ASSERT_TRUE(geomorph.step(cut, 0));
    cut.unfold(VertexTree::root());
    for (const double seconds : {nan, -0.1, infinite}) {
        const auto refused = geomorph.step(cut, seconds);
        ASSERT_FALSE(refused);
        EXPECT_NE(refused.error().message.find("seconds"), std::string::npos);
    }
    EXPECT_FALSE(geomorph.step(of_another_tree, 0));
    EXPECT_FALSE(geomorph.is_gliding()) << "nothing was taken up";
    ASSERT_TRUE(geomorph.step(cut, 0));
    EXPECT_TRUE(geomorph.is_gliding());
}

} // namespace unseen::vdtree::geomorph_test
