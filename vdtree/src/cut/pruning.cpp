#include <unseen/vdtree/pruning.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include <unseen/vdtree/internal/errors.h>

namespace unseen::vdtree {
namespace {

// The least of errors and paid triangles below a node is a concave line of straight pieces over the price: with every
// price at which a node below unfolds, the triangles that it shows, and the errors that it saves, join in. Nodes wait in
// heaps (skew heaps: Sleator and Tarjan 1986), the one that unfolds at the highest price on top.
class Heaps {
public:
    static constexpr std::uint32_t none = 0;

    struct Joining {
        double price = 0;     // below which it joins in
        double triangles = 0; // more
        double errors = 0;    // more; 0 or less
        std::uint32_t left = none, right = none;
    };

    explicit Heaps(std::size_t nodes) { all_.reserve(nodes + 1), all_.emplace_back(); }

    const Joining& operator[](std::uint32_t heap) const { return all_[heap]; }
    std::uint32_t make(double price, double triangles, double errors) {
        all_.push_back({price, triangles, errors});
        return static_cast<std::uint32_t>(all_.size() - 1);
    }
    std::uint32_t unite(std::uint32_t a, std::uint32_t b) {
        std::uint32_t root = none, *end = &root;
        while (a != none && b != none) {
            if (all_[a].price < all_[b].price) std::swap(a, b);
            Joining& top = all_[a];
            *end = a;
            a = std::exchange(top.right, top.left);
            end = &top.left;
        }
        *end = a != none ? a : b;
        return root;
    }
    std::uint32_t without_top(std::uint32_t heap) { return unite(all_[heap].left, all_[heap].right); }

private:
    std::vector<Joining> all_;
};

} // namespace

Result<std::vector<float>> pruning_prices(const VertexTree& tree, std::span<const float> errors) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    const NodeId nodes = tree.interior_count();
    if (errors.size() != nodes) return invalid_argument("The errors of folds are not of this tree.");
    for (NodeId node = 0; node < nodes; ++node)
        if (!(errors[node] >= 0) || !std::isfinite(errors[node]))
            return invalid_argument("The error of node " + std::to_string(node) + " must be 0 or more and finite.");
    Heaps heaps(nodes);
    std::vector<std::uint32_t> below(nodes, Heaps::none);
    std::vector<double> folded_below(nodes, 0); // the errors of the interior children, all folded
    std::vector<double> prices(nodes);
    for (NodeId node = nodes; node-- > 0;) { // children before parents
        const auto error = static_cast<double>(errors[node]);
        // Unfolded, at a price so high that all below is folded.
        double triangles = sound->first_triangle()[node + 1] - sound->first_triangle()[node];
        double left = folded_below[node];
        const auto worth = [&] {
            if (!(error > left)) return 0.0;
            return triangles > 0 ? (error - left) / triangles : std::numeric_limits<double>::infinity();
        };
        std::uint32_t& heap = below[node];
        while (heap != Heaps::none && heaps[heap].price > worth()) { // it unfolds with this node or before
            triangles += heaps[heap].triangles;
            left += heaps[heap].errors;
            heap = heaps.without_top(heap);
        }
        prices[node] = worth();
        heap = heaps.unite(heap, heaps.make(prices[node], triangles, left - error));
        if (node == VertexTree::root()) break;
        const NodeId parent = sound->parents()[node];
        folded_below[parent] += error;
        below[parent] = heaps.unite(below[parent], heap);
    }
    // What would unfold before what is above unfolds with it.
    std::vector<float> result(nodes);
    for (NodeId node = 0; node < nodes; ++node) {
        if (node > 0) prices[node] = std::min(prices[node], prices[sound->parents()[node]]);
        result[node] = static_cast<float>(prices[node]);
    }
    return result;
}

} // namespace unseen::vdtree
