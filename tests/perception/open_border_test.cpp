// Where a surface ends, and by how far folds move that.
#include "measure/open_border.h"

#include <ctime>

#include "fold/fold_errors.h"
#include "measured.h"
#include "shapes.h"
#include "sound.h"
#include "testing.h"

namespace unseen::perception {

using namespace vdtree;

namespace open_border_test {

using Place = std::array<float, 3>;

// The edges by their places, each once.
std::set<std::pair<Place, Place>> border_of(const Mesh& mesh) {
    const VertexTree tree = support::built(mesh);
    const SoundTree sound = support::sound(tree);
    const PlaceTriangles triangles(sound);
    const OpenBorder border(sound, triangles);
    const auto place = [&](Index number) {
        const glm::vec3 p = tree.position(tree.interior_count() + number);
        return Place{p.x, p.y, p.z};
    };
    std::set<std::pair<Place, Place>> edges, by_triangle;
    for (const OpenBorder::End& end : border.at(0, tree.place_count()))
        edges.insert(std::minmax(place(end.place), place(end.other)));
    for (Index t = 0; t < sound.triangles().size(); ++t)
        for (unsigned k = 0; k < 3; ++k)
            if ((border.edges_of(t) >> k) & 1)
                by_triangle.insert(
                    std::minmax(place(triangles.corners(t)[k]), place(triangles.corners(t)[(k + 1) % 3])));
    EXPECT_EQ(edges, by_triangle);
    return edges;
}

TEST(OpenBorders, AreWhereASurfaceEnds) {
    EXPECT_TRUE(border_of(shapes::cube(3)).empty());
    EXPECT_TRUE(border_of(shapes::unwelded(shapes::cube(3))).empty());
    EXPECT_EQ(border_of(shapes::grid(5)).size(), 20u);
    EXPECT_EQ(border_of(shapes::single_triangle()).size(), 3u);
    EXPECT_EQ(border_of(shapes::moebius_strip(20)).size(), 40u);
}

TEST(OpenBorders, DoNotDependOnHowVerticesAreShared) {
    EXPECT_EQ(border_of(shapes::unwelded(shapes::grid(5))), border_of(shapes::grid(5)));
    EXPECT_EQ(border_of(shapes::with_degenerate_triangles(shapes::grid(5))), border_of(shapes::grid(5)));
    Mesh twice = shapes::grid(5);
    twice.triangles.insert(twice.triangles.end(), twice.triangles.begin(), twice.triangles.end());
    EXPECT_EQ(border_of(twice), border_of(shapes::grid(5)));
}

TEST(OpenBorders, AreWhereAnOddNumberOfPagesMeet) {
    // The edges of a fan's pages, and the one that all share if they are odd.
    for (const int pages : {3, 4, 5}) {
        const auto edges = border_of(shapes::non_manifold_fan(pages));
        EXPECT_EQ(edges.size(), static_cast<std::size_t>(2 * pages + pages % 2)) << pages;
    }
}

TEST(OpenBorders, TellTheirSide) {
    // A square's two lower edges, at a corner that is cut in: below and right of the surface.
    //    . . . .
    //    . . . .---
    //    . . . |
    const Segment right{{0, -1, 0}, {0, 0, 0}}, up{{0, 0, 0}, {1, 0, 0}};
    const auto outside = [&](glm::vec3 p) {
        BorderSide side(p);
        side.look_at(right, {-1, 0, 0});
        side.look_at(up, {0, 1, 0});
        return side.outside();
    };
    EXPECT_FLOAT_EQ(outside({0.5f, -0.25f, 0}), 0.25f);
    EXPECT_EQ(outside({0.5f, 0.25f, 0}), 0);
    EXPECT_EQ(outside({-0.25f, -0.5f, 0}), 0);
    EXPECT_EQ(outside({-0.25f, 0.25f, 0}), 0) << "the corner is nearest";
    EXPECT_EQ(BorderSide({0, 0, 0}).outside(), 0) << "there is none";
}

TEST(OpenBorders, AreComparedAsLines) {
    const std::vector<Segment> corner = {{{0, 0, 0}, {1, 0, 0}}, {{1, 0, 0}, {1, 1, 0}}};
    const std::vector<glm::vec3> points = {{0.5f, 0, 0}, {0.5f, 0.25f, 0}, {2, 2, 0}};
    EXPECT_FLOAT_EQ(farthest_from(corner, points), std::sqrt(2.0f));
    EXPECT_EQ(farthest_from(corner, std::span(points).first(1)), 0);
    EXPECT_EQ(farthest_from(corner, {}), 0);
    EXPECT_EQ(farthest_from({}, points), std::numeric_limits<float>::infinity());
}

// A flat sheet with a jagged outline and a hole; every fold is nothing but what it does to these.
Mesh cut_out() {
    Mesh mesh = shapes::placed(shapes::grid(24), 1.0 / 24);
    std::erase_if(mesh.triangles, [&](const Triangle& t) {
        const glm::dvec3 p = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3.0;
        const double x = p.x - 0.5, y = p.y - 0.5, r = std::hypot(x, y);
        return r < 0.12 || r > 0.4 + 0.06 * std::sin(7 * std::atan2(y, x));
    });
    return mesh;
}

// A square with rows of holes.
Mesh sieve() {
    constexpr int holes = 4, side = 8 * holes - 1;
    Mesh mesh = shapes::placed(shapes::grid(side), 1.0 / side);
    std::erase_if(mesh.triangles, [&](const Triangle& t) {
        const glm::dvec3 p = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3.0 * double{holes};
        return std::hypot(p.x - std::floor(p.x) - 0.5, p.y - std::floor(p.y) - 0.5) < 0.22;
    });
    return mesh;
}

// Points of a polyline, so dense that nothing is missed.
std::vector<glm::vec3> points_of(std::span<const Segment> segments) {
    std::vector<glm::vec3> points;
    for (const auto& [a, b] : segments)
        for (int i = 0; i <= 16; ++i) points.push_back(a + (b - a) * (static_cast<float>(i) / 16));
    return points;
}

class BorderFolds {
public:
    explicit BorderFolds(const Mesh& mesh)
        : tree_(support::measured(support::built(mesh))), sound_(support::sound(tree_)),
          border_(sound_, PlaceTriangles(sound_)), errors_(fold_errors_of(sound_)->of_nodes) {}

    const VertexTree& tree() const { return tree_; }
    float counted(NodeId node) const { return errors_[node].outline; }
    bool touches(NodeId node) const {
        const NodeId first = tree_.place_of_leaf(sound_.first_leaf()[node]),
                     last = tree_.place_of_leaf(sound_.leaf_end()[node] - 1);
        return !border_.at(first - tree_.interior_count(), last - tree_.interior_count() + 1).empty();
    }

    // The distance of the whole border from what it becomes where `is_folded` says which nodes are folded.
    template <class IsFolded>
    float moved(const IsFolded& is_folded) const {
        std::vector<Segment> before, after;
        const auto place = [&](NodeId node) { return tree_.position(node); };
        const auto shown = [&](Index number) {
            NodeId at = tree_.interior_count() + number;
            for (NodeId up = at; up != no_node; up = sound_.parents()[up])
                if (up < tree_.interior_count() && is_folded(up)) at = up;
            return at;
        };
        for (const OpenBorder::End& end : border_.at(0, tree_.place_count())) {
            before.push_back({place(tree_.interior_count() + end.place), place(tree_.interior_count() + end.other)});
            if (shown(end.place) != shown(end.other))
                after.push_back({place(shown(end.place)), place(shown(end.other))});
        }
        return std::max(farthest_from(after, points_of(before)), farthest_from(before, points_of(after)));
    }

private:
    VertexTree tree_;
    SoundTree sound_;
    OpenBorder border_;
    std::vector<FoldError> errors_;
};

TEST(FoldedBorders, MoveByNoMoreThanIsCounted) {
    struct Case {
        Mesh mesh;
        float largest;     // radius of nodes: wider ones close a hole, which leaves nothing to compare it with
        std::size_t moved; // at least so many folds move the border
    };
    for (const auto& [mesh, largest, least_moved] :
         {Case{shapes::grid(16), 8, 0}, Case{cut_out(), 0.1f, 20}, Case{shapes::unwelded(cut_out()), 0.1f, 20}}) {
        const BorderFolds folds(mesh);
        std::size_t moved = 0;
        for (NodeId node = 1; node < folds.tree().interior_count(); ++node) {
            if (!folds.touches(node) || folds.tree().support_spheres()[node].radius > largest) continue;
            const float alone = folds.moved([&](NodeId at) { return at == node; });
            // Sixteenths of the edges of a folded border are looked at here, quarters there.
            ASSERT_LE(alone, 1.1f * folds.counted(node) + 1e-6f) << node;
            moved += alone > 0.1f * folds.tree().support_spheres()[node].radius;
        }
        EXPECT_GE(moved, least_moved);
    }
}

// Rings of random triangles lie through each other: that none of the others' edges is nearer, no sphere around some of
// them tells.
TEST(FoldedBorders, DoNotCostTheSquareOfWhatLiesThroughEachOther) {
    const VertexTree tree = support::built(shapes::unwelded(shapes::random_soup(72000, 24000, 1)));
    const SoundTree sound = support::sound(tree);
    const PlaceTriangles triangles(sound);
    BorderShifts shifts(sound, triangles);
    NodeId node = 1; // with most leaves, but for the root
    const auto leaves = [&](NodeId n) { return sound.leaf_end()[n] - sound.first_leaf()[n]; };
    for (NodeId other = 1; other < tree.interior_count(); ++other)
        if (leaves(other) > leaves(node)) node = other;
    std::vector<Index> crossing;
    for (Index t = 0; t < sound.triangles().size(); ++t)
        if (std::ranges::any_of(sound.triangles()[t],
                                [&](Index leaf) { return leaf - sound.first_leaf()[node] < leaves(node); }))
            crossing.push_back(t);
    ASSERT_GT(crossing.size(), 4000u);
    const auto cpu_seconds = [] {
        timespec now{};
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
        return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
    };
    const double start = cpu_seconds();
    const float shift = shifts.shift(node, crossing, [&](Index leaf) { return tree.place_of_leaf(leaf); });
    const double seconds = cpu_seconds() - start;
    EXPECT_GT(shift, 0);
    EXPECT_LT(shift, 2 * tree.support_spheres()[node].radius);
#ifdef __SANITIZE_THREAD__
    constexpr double most_seconds = 50; // each read and write is looked up
#else
    constexpr double most_seconds = 5;
#endif
    EXPECT_LT(seconds, most_seconds) << crossing.size() << " triangles";
}

// What is inside moves no outline, however far it moves along the sheet.
TEST(FoldedBorders, AreNotMovedFromInside) {
    const BorderFolds folds(shapes::grid(32));
    std::size_t inside = 0;
    for (NodeId node = 1; node < folds.tree().interior_count(); ++node) {
        const NodeBounds& bounds = folds.tree().bounds()[node];
        if (bounds.ring.radius > 4 || (bounds.flags & irregular_ring)) continue; // others' neighbours move it
        EXPECT_LT(folds.counted(node), 1e-3f * bounds.ring.radius) << node;
        ++inside;
    }
    EXPECT_GT(inside, 200u);
}

// Two triangles of a sheet's ragged border whose vertices fold one by one: whatever the state of the others, what turns
// over beyond the border counts.
TEST(FoldedBorders, CountWhatTurnsOverBeyondThem) {
    const BorderFolds folds(sieve());
    const VertexTree& tree = folds.tree();
    const SoundTree sound = support::sound(tree);
    const PlaceTriangles triangles(sound);
    const OpenBorder border(sound, triangles);
    const auto place = [&](NodeId node) { return tree.position(node); };
    const auto outside = [&](glm::vec3 p) {
        BorderSide side(p);
        for (const auto& [end, other, opposite] : border.at(0, tree.place_count()))
            side.look_at({place(tree.interior_count() + end), place(tree.interior_count() + other)},
                         place(tree.interior_count() + opposite));
        return side.outside();
    };
    const auto leaves = [&](NodeId node) { // of a sheet without seams, where each place has one leaf
        if (tree.is_place(node)) return std::pair(node - tree.interior_count(), node - tree.interior_count());
        return std::pair(sound.first_leaf()[node], sound.leaf_end()[node] - 1);
    };
    const auto nest = [&](NodeId x, NodeId y) {
        return leaves(x).first <= leaves(y).second && leaves(y).first <= leaves(x).second;
    };
    std::size_t turned_over = 0;
    for (const Triangle& t : sound.triangles()) {
        std::array<std::vector<NodeId>, 3> chains;
        for (std::size_t k = 0; k < 3; ++k)
            for (NodeId up = tree.place_of_leaf(t[k]); up != no_node && up != 0; up = sound.parents()[up])
                chains[k].push_back(up);
        const glm::vec3 normal =
            glm::cross(place(chains[1][0]) - place(chains[0][0]), place(chains[2][0]) - place(chains[0][0]));
        for (const NodeId a : chains[0])
            for (const NodeId b : chains[1])
                for (const NodeId c : chains[2]) {
                    if (nest(a, b) || nest(b, c) || nest(c, a)) continue; // no cut has both
                    if (!(glm::dot(glm::cross(place(b) - place(a), place(c) - place(a)), normal) < 0)) continue;
                    float counted = 0;
                    for (const NodeId node : {a, b, c})
                        if (node < tree.interior_count()) counted = std::max(counted, folds.counted(node));
                    const float reach = outside((place(a) + place(b) + place(c)) / 3.0f);
                    ASSERT_LE(reach, counted + 1e-6f) << a << " " << b << " " << c;
                    turned_over += reach > 0.005f;
                }
    }
    EXPECT_GT(turned_over, 10u);
}

} // namespace open_border_test
} // namespace unseen::perception
