// Hard cases of numbers in budgets, sums and long runs: entries of docs/numerics.md, like those of numerics_test.cpp. With
// UNSEEN_NUMERICS=full in as many frames, terms and triangles as the catalogue says; else in a part of that.
#include <queue>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/geomorph.h>

#include "built.h"
#include "cut/budget.h"
#include "cut/cut_front.h"
#include "cut/kernel/fold_tester.h"
#include "shapes.h"
#include "sound.h"
#include "testing.h"
#include "tree_checks.h"

namespace unseen::vdtree {
namespace {

using shapes::random_between;
using shapes::random_direction;
using support::built;

bool is_in_full() {
    const char* asked = std::getenv("UNSEEN_NUMERICS");
    return asked && std::string_view(asked) == "full";
}

DistanceCriterion extent(const VertexTree& tree, double pixels) {
    return std::move(*require(extent_criterion(tree, View{}, pixels)));
}

AdjustStats followed(Cut& cut, const DistanceCriterion& criterion, const Viewpoint& viewpoint,
                     const FollowOptions& options = {}) {
    const auto stats = require(cut.follow(criterion, viewpoint, options));
    return *stats;
}

// Whether so many triangles more fit, in numbers without a sign.
bool naive_fits(Index budget, Index used, Index more) { return budget - used - more < no_node; }
Index naive_budget(std::uint64_t asked) { return static_cast<Index>(asked); }

TEST(Numerics, BudgetsOf0And1AndMoreThanThereAre) {
    EXPECT_TRUE(naive_fits(1, 1, 2)) << "1 - 1 - 2 is 4,294,967,294";
    EXPECT_EQ(naive_budget(std::uint64_t{1} << 32), 0u);
    const VertexTree tree = built(shapes::bumpy_sphere(3));
    const Index all = tree.triangle_count();
    const DistanceCriterion criterion = extent(tree, 1e-6); // asks for all of them
    const Viewpoint viewpoint{.eye = {3, 1, 2}};
    const FoldCriterion costs = [](const VertexTree&, std::span<const NodeId>, std::span<float> out) {
        std::ranges::fill(out, 2.0f);
    };
    for (const Index budget : {Index{0}, Index{1}, Index{2}, all - 1, all, all + 1, ~Index{0} - 1, ~Index{0}}) {
        Cut cut(tree);
        for (int again = 0; again < 2; ++again) {
            const Index triangles =
                followed(cut, criterion, viewpoint, {.triangle_budget = budget, .fill_budget = true}).triangles;
            EXPECT_LE(triangles, budget);
            if (budget >= all) EXPECT_EQ(triangles, all);
        }
        Cut adjusted(tree);
        EXPECT_LE(adjusted.adjust(costs, budget).triangles, budget);
        const SceneObject objects[] = {{cut, criterion, viewpoint}, {adjusted, criterion, viewpoint}};
        const auto shared = require(follow_scene(objects, budget));
        EXPECT_LE(std::uint64_t{(*shared)[0].triangles} + (*shared)[1].triangles, budget);
    }
    // Inside, budgets are of 64 bits, and so are sums over a scene.
    FoldTester tester(tree, criterion, false, 1, false);
    tester.look_from(viewpoint, 1);
    const CostSource* const sources[] = {&tester};
    for (const std::uint64_t budget : {std::uint64_t{1} << 32, ~std::uint64_t{0}}) {
        const BudgetDecision decision = decide_budget(sources, {.triangles = budget, .fill = true});
        std::uint64_t triangles = 0;
        for (NodeId node = 0; node < tree.interior_count(); ++node)
            if (decision.unfolded[0][node / 64] >> (node % 64) & 1)
                triangles +=
                    support::sound(tree).first_triangle()[node + 1] - support::sound(tree).first_triangle()[node];
        EXPECT_EQ(triangles, all);
    }
}

// Unfolds by cost alone: what is equal comes as the heap has it.
std::vector<bool> naive_order(const VertexTree& tree, std::uint64_t budget, bool turned) {
    const auto less = [](std::pair<float, NodeId> a, std::pair<float, NodeId> b) { return a.first < b.first; };
    std::priority_queue<std::pair<float, NodeId>, std::vector<std::pair<float, NodeId>>, decltype(less)> open(less);
    std::vector<bool> unfolded(tree.interior_count(), false);
    open.push({2.0f, VertexTree::root()});
    const auto first = support::sound(tree).first_triangle();
    for (std::uint64_t used = 0; !open.empty();) {
        const NodeId node = open.top().second;
        open.pop();
        used += first[node + 1] - first[node];
        if (used > budget) break;
        unfolded[node] = true;
        std::vector<NodeId> children;
        tree.for_each_child(node, [&](NodeId child) {
            if (!tree.is_place(child)) children.push_back(child);
        });
        if (turned) std::ranges::reverse(children);
        for (const NodeId child : children) open.push({2.0f, child});
    }
    return unfolded;
}

TEST(Numerics, MillionsOfEqualCosts) {
    const VertexTree tree = built(shapes::grid(is_in_full() ? 1500 : 200), {.clusterer = ClustererKind::octree});
    if (is_in_full()) ASSERT_GT(tree.triangle_count(), 4'000'000u);
    const Index budget = tree.triangle_count() / 3;
    EXPECT_NE(naive_order(tree, budget, false), naive_order(tree, budget, true));
    // By definition: the lowest number of those that can unfold, until one does not fit.
    std::vector<bool> expected(tree.interior_count(), false);
    std::priority_queue<NodeId, std::vector<NodeId>, std::greater<>> open;
    open.push(VertexTree::root());
    const auto first = support::sound(tree).first_triangle();
    for (std::uint64_t used = 0; !open.empty();) {
        const NodeId node = open.top();
        open.pop();
        used += first[node + 1] - first[node];
        if (used > budget) break;
        expected[node] = true;
        tree.for_each_child(node, [&](NodeId child) {
            if (!tree.is_place(child)) open.push(child);
        });
    }
    const auto expect_expected = [&](const Cut& cut, const char* how) {
        std::uint64_t differ = 0;
        for (NodeId node = 0; node < tree.interior_count(); ++node) differ += cut.is_wanted(node) != expected[node];
        EXPECT_EQ(differ, 0u) << how;
    };
    Cut cut(tree);
    const FoldCriterion costs = [](const VertexTree&, std::span<const NodeId>, std::span<float> out) {
        std::ranges::fill(out, 2.0f);
    };
    cut.adjust(costs, budget);
    expect_expected(cut, "by a criterion of one's own");
    cut.unfold_all();
    cut.adjust(costs, budget);
    expect_expected(cut, "from another cut");
    DistanceCriterion::Parts parts;
    parts.switch_distance = {DistanceCriterion::always_visible}; // all costs are infinite
    const auto criterion = require(DistanceCriterion::create(tree, parts));
    Cut follower(tree);
    followed(follower, *criterion, {.eye = {0.5, 0.5, 3}}, {.triangle_budget = budget});
    expect_expected(follower, "by distances");
    followed(follower, *criterion, {.eye = {-40, 0.5, 300}}, {.triangle_budget = budget});
    expect_expected(follower, "from elsewhere");
}

TEST(Numerics, PatchesOfTheIndexBufferOverAMillionFrames) {
    const int frames = is_in_full() ? 1'000'000 : 30'000;
    const VertexTree tree = built(shapes::bumpy_sphere(2));
    const DistanceCriterion criterion = extent(tree, 200);
    Cut cut(tree);
    support::GpuCopy copy(tree);
    std::mt19937_64 random(1);
    glm::dvec3 eye(0, 0, 4);
    int told = 0;
    std::int64_t naive_triangles = 0;
    for (int frame = 0; frame < frames; ++frame) {
        eye = glm::normalize(eye + 0.02 * random_direction(random)) * (3 + std::sin(frame * 0.01));
        followed(cut, criterion, {.eye = eye});
        static_cast<void>(cut.indices());
        if (frame % 100 == 50) continue; // a frame that nobody draws
        told += copy.update(cut);
        for (const FoldChange& change : cut.changes()) {
            const auto first = support::sound(tree).first_triangle();
            const auto triangles = static_cast<std::int64_t>(first[change.node + 1] - first[change.node]);
            naive_triangles += change.folded ? -triangles : triangles;
        }
        if (frame % 1000 != 999) continue;
        ASSERT_EQ(copy.sorted_triangles(), support::sorted_triangles(cut)) << frame;
        if (frame % 10'000 == 9'999) ASSERT_EQ(support::fault_in_cut(cut), "") << frame;
    }
    EXPECT_GT(told, frames / 2);
    EXPECT_NE(naive_triangles, cut.triangle_count()) << "what was missed is missing for ever";
    EXPECT_GT(copy.written(), static_cast<std::uint64_t>(frames) / 2);
}

// Two nodes of one block that are watched: unfolded, with so much slack, seen from so far away.
struct Watched {
    CutFront front{2};
    static constexpr double distance = 100;

    explicit Watched(float slack) {
        front.set_longest_slack(2 * distance);
        front.reserve(2);
        front.move_to({distance, 0, 0}, 0);
        CutFront::Slot slot = CutFront::no_slot;
        for (const NodeId node : {0u, 1u}) {
            FoldCandidate candidate;
            candidate.node = node;
            candidate.sphere = {{0, node ? 10 : -10, 0}, 1};
            slot = front.insert(candidate, slot);
        }
        set(slack);
    }
    void set(float slack) {
        constexpr float never = 1e30f;
        for (const NodeId node : {0u, 1u})
            front.set_deadlines(front.slot_of(node), Verdict{slack, never, never, never, never, true});
    }
    bool is_due() { return !front.collect_due().empty(); }
};

TEST(Numerics, AddingAHundredMillionSmallTerms) {
    const int terms = is_in_full() ? 100'000'000 : 10'000'000;
    const double term = 1.0 / terms;
    constexpr float slack = 4.5f;
    constexpr double begin = 4, loss = 1e-5 * Watched::distance; // what deadlines are early by
    // The clock has run for a while, then come the terms.
    float naive_clock = static_cast<float>(begin);
    Watched watched(slack);
    watched.front.advance(begin);
    EXPECT_FALSE(watched.is_due());
    int due_at = 0;
    for (int i = 1; i <= terms; ++i) {
        naive_clock += static_cast<float>(term);
        watched.front.advance(term);
        if (i % (terms / 1000) == 0 && due_at == 0 && watched.is_due()) due_at = i;
    }
    EXPECT_EQ(naive_clock, static_cast<float>(begin)) << "half a unit in the last place, and less, is nothing";
    ASSERT_GT(due_at, 0);
    EXPECT_LE(begin + due_at * term, static_cast<double>(slack) + 1e-3) << "not late";
    EXPECT_GE(begin + due_at * term, static_cast<double>(slack) - loss - 1e-3) << "and not early";
}

TEST(Numerics, DeadlinesAfterDaysOfRunning) {
    // Seconds in floats, a frame of a sixtieth more each time.
    float naive_seconds = 7 * 86'400;
    const float naive_before = naive_seconds;
    for (int frame = 0; frame < 60; ++frame) naive_seconds += 1 / 60.0f;
    EXPECT_GT(std::abs(naive_seconds - naive_before - 1), 0.5f) << "of a second";

    // Days of an eye that hardly moves: the node comes due no sooner than by its own way.
    const int frames = is_in_full() ? 100'000'000 : 20'000'000; // 19 days at 60 a second, or 4
    constexpr double tremor = 1e-9, longest_run = 16 * Watched::distance;
    Watched watched(5);
    int due = 0;
    for (int frame = 0; frame < frames; ++frame) {
        watched.front.move_to({Watched::distance + (frame % 2 ? 0 : tremor), 0, 0}, 0);
        watched.front.restart_clocks(longest_run);
        if (frame % 10'000 == 0) due += watched.is_due();
    }
    EXPECT_EQ(due, 0);
    // And days of one that goes round and round: clocks are set back, and deadlines still come in time.
    Watched walked(5);
    for (int frame = 0; frame < 1'000'000; ++frame) {
        walked.front.move_to({Watched::distance + (frame % 2 ? 0 : 1), 0, 0}, 0);
        walked.front.restart_clocks(longest_run);
        if (frame % 1000 == 0 && walked.is_due()) walked.set(5);
    }
    walked.set(5);
    walked.front.move_to({Watched::distance + 4, 0, 0}, 0);
    EXPECT_FALSE(walked.is_due());
    walked.front.move_to({Watched::distance + 7, 0, 0}, 0);
    EXPECT_TRUE(walked.is_due());
}

// A child's way to its own place.
double naive_weight(double weight, double seconds, double glide_seconds) { return weight + seconds / glide_seconds; }

TEST(Numerics, TimeStepsOf0AndBelow) {
    EXPECT_TRUE(std::isnan(naive_weight(0, 0, 0)));
    EXPECT_LT(naive_weight(0, -1, 0.25), 0) << "beyond the proxy, on the other side";
    const VertexTree tree = built(shapes::bumpy_sphere(3));
    const DistanceCriterion criterion = extent(tree, 20);
    const double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
    for (const double seconds : {0.0, 5e-324, 0.25, 1e300}) {
        auto geomorph = require(Geomorph::create(tree, seconds, inf));
        Cut cut(tree);
        double distance = 6;
        for (const double step : {0.0, -0.0, 5e-324, 1e-300, 1 / 60.0, 1e300}) {
            for (int i = 0; i < 3; ++i) {
                followed(cut, criterion, {.eye = {0, 0, distance -= 0.2}});
                ASSERT_TRUE(geomorph->step(cut, step));
                for (const MovedVertex& moved : geomorph->moved()) {
                    ASSERT_TRUE(std::isfinite(moved.position.x + moved.position.y + moved.position.z));
                    ASSERT_LE(glm::length(glm::dvec3(moved.position) - glm::dvec3(tree.bounding_sphere().centre)),
                              static_cast<double>(tree.bounding_sphere().radius) * 1.0001);
                }
            }
        }
        for (const double none : {-1.0, -5e-324, -inf, inf, nan}) EXPECT_FALSE(geomorph->step(cut, none)) << none;
    }
    for (const double none : {-1.0, inf, nan}) EXPECT_FALSE(Geomorph::create(tree, none));
}

std::uint64_t naive_end_ns(std::uint64_t now_ns, std::uint64_t limit_ms) { return now_ns + limit_ms * 1'000'000; }

TEST(Numerics, TimeLimitsOfAnySize) {
    constexpr std::uint64_t now_ns = 86'400'000'000'000, years = 18'446'744'073'709; // 585, in milliseconds
    EXPECT_LT(naive_end_ns(now_ns, years), now_ns) << "is over before it began";
    const VertexTree tree = built(shapes::bumpy_sphere(3));
    const DistanceCriterion criterion = extent(tree, 5);
    const double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
    for (const double limit : {0.0, 5e-324, 1e-300, 1e-6, 1e9, 9.3e12, 1.8e13, 1e300, inf}) {
        Cut cut(tree);
        AdjustStats stats;
        for (int i = 0; i < 100'000 && (i == 0 || !stats.is_complete); ++i)
            stats = followed(cut, criterion, {.eye = {0, 0, 4}}, {.milliseconds = limit});
        EXPECT_TRUE(stats.is_complete) << limit << ": a step of each is always done";
        if (limit >= 1e9) {
            Cut fresh(tree);
            EXPECT_TRUE(followed(fresh, criterion, {.eye = {0, 0, 4}}, {.milliseconds = limit}).is_complete) << limit;
        }
    }
    Cut cut(tree);
    for (const double none : {-1.0, -5e-324, -inf, nan})
        EXPECT_FALSE(cut.follow(criterion, {.eye = {0, 0, 4}}, {.milliseconds = none})) << none;
}

} // namespace
} // namespace unseen::vdtree
