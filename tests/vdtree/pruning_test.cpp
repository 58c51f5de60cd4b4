// Optimal pruning, against the recursion that defines it.
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/pruning.h>

#include "built.h"
#include "shapes.h"
#include "testing.h"

namespace unseen::vdtree::pruning_test {

// Errors that mostly grow up the tree, as those of folds do, but not always.
std::vector<float> random_errors(const VertexTree& tree, std::mt19937_64& random) {
    std::vector<float> errors(tree.interior_count());
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        const float radius = tree.support_spheres()[node].radius;
        errors[node] = radius * radius * static_cast<float>(std::exp2(shapes::random_between(random, -4, 0)));
        if (random() % 16 == 0) errors[node] = 0;
    }
    return errors;
}

// The least of errors and paid triangles over all cuts.
double least_sum(const SoundTree& tree, std::span<const float> errors, double price) {
    std::vector<double> best(tree.interior_count());
    std::vector<double> below(tree.interior_count(), 0);
    for (NodeId node = tree.interior_count(); node-- > 0;) {
        const double triangles = tree.first_triangle()[node + 1] - tree.first_triangle()[node];
        best[node] = std::min(static_cast<double>(errors[node]), price * triangles + below[node]);
        if (node > 0) below[tree.parents()[node]] += best[node];
    }
    return best[0];
}

TEST(Pruning, LeavesTheLeastSumAtEveryPrice) {
    std::mt19937_64 random(5);
    const SoundTree tree = *SoundTree::of(support::built(shapes::bumpy_sphere(4, 0.1)));
    for (int round = 0; round < 4; ++round) {
        const std::vector<float> errors = random_errors(tree, random);
        const auto prices = require(pruning_prices(tree, errors));
        for (NodeId node = 1; node < tree.interior_count(); ++node)
            ASSERT_LE((*prices)[node], (*prices)[tree.parents()[node]]) << node;
        for (int i = 0; i < 50; ++i) {
            const double price = std::exp2(shapes::random_between(random, -24, 0));
            double sum = 0;
            for (NodeId node = 0; node < tree.interior_count(); ++node) {
                const auto is_unfolded = [&](NodeId n) { return static_cast<double>((*prices)[n]) > price; };
                if (is_unfolded(node)) sum += price * (tree.first_triangle()[node + 1] - tree.first_triangle()[node]);
                else if (node == 0 || is_unfolded(tree.parents()[node])) sum += static_cast<double>(errors[node]);
            }
            EXPECT_NEAR(sum, least_sum(tree, errors, price), 1e-6 * sum + 1e-12) << price;
        }
    }
}

TEST(Pruning, RefusesWhatIsNoError) {
    const VertexTree tree = support::built(shapes::icosphere(2));
    std::vector<float> errors(tree.interior_count(), 1.0f);
    EXPECT_TRUE(pruning_prices(tree, errors));
    EXPECT_FALSE(pruning_prices(tree, std::span(errors).first(3)));
    for (const float bad : {-1.0f, std::nanf(""), std::numeric_limits<float>::infinity()}) {
        errors[2] = bad;
        const auto none = pruning_prices(tree, errors);
        ASSERT_FALSE(none);
        EXPECT_NE(none.error().message.find("node 2"), std::string::npos);
    }
}

TEST(Pruning, CostsOfAPictureAreTheLargerOnes) {
    const VertexTree tree = support::built(shapes::icosphere(4));
    View view;
    view.eye = {0, 0, 6};
    const DistanceCriterion own = *displacement_criterion(tree, view, 1);
    const Viewpoint viewpoint{.eye = view.eye - tree.origin()};
    const std::vector<float> before = *find_every_cost(tree, own, viewpoint);
    std::vector<float> least(tree.interior_count());
    for (NodeId node = 0; node < tree.interior_count(); ++node)
        least[node] = 2 / (1 + static_cast<float>(tree.interior_count()) / static_cast<float>(node + 2));
    const DistanceCriterion raised = *costing_at_least(tree, own, viewpoint, least);
    const std::vector<float> after = *find_every_cost(tree, raised, viewpoint);
    int higher = 0;
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        if (is_unbounded(before[node])) continue;
        EXPECT_NEAR(after[node], std::max(before[node], least[node]), 1e-4f * after[node]) << node;
        higher += after[node] > 1.01f * before[node];
    }
    EXPECT_GT(higher, 100);
    EXPECT_FALSE(costing_at_least(tree, own, viewpoint, std::span(least).first(3)));
}

} // namespace unseen::vdtree::pruning_test
