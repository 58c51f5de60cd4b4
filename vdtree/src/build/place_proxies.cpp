#include "build/place_proxies.h"

#include "build/parallel_array.h"

namespace unseen::vdtree {

namespace {

// Every place counts a little, so that places without an area have a mean too: share of the largest area.
constexpr double least_weight = 1e-6;

struct PositionSum {
    glm::dvec3 position{0};
    double weight = 0;
    PositionSum& operator+=(const PositionSum& other) {
        position += other.position;
        weight += other.weight;
        return *this;
    }
};

// Gives every node whose places are at one point that point, which means would round.
void keep_equal(const TreeShape& shape, const TreeParts& parts, std::span<glm::vec3> values) {
    std::vector<std::uint8_t> equal(shape.interior(), 1);
    parts.bottom_up([&] {
        return [&](NodeId node) {
            const glm::vec3 first = values[shape.place_of_leaf(shape.first_leaf[node])];
            bool all = true;
            shape.for_each_child(
                node, [&](NodeId child) { all = all && equal[child] && values[child] == first; },
                [&](Index leaf) { all = all && values[shape.place_of_leaf(leaf)] == first; });
            equal[node] = all;
            if (all) values[node] = first;
        };
    });
}

} // namespace

std::vector<glm::vec3> place_proxies(const TreeShape& shape, const TreeParts& parts, const PlacesToMerge& places,
                                     const GivenProxies& given) {
    std::vector<glm::vec3> out(shape.parents.size());
    double largest = 0;
    for (const double a : places.areas) largest = std::max(largest, a);
    ParallelArray<double> weights(shape.leaves(), Unfilled());
    parallel_loop(std::size_t{0}, places.positions.size(), [&](std::size_t v) {
        const Index leaf = places.leaf_of_vertex[v];
        weights[leaf] = (largest > 0 ? places.areas[v] / largest : 0) + least_weight;
        out[shape.place_of_leaf(leaf)] = glm::vec3(places.positions[v] - places.origin);
    });
    ParallelArray<PositionSum> sums(shape.interior(), Unfilled());
    parts.bottom_up([&] {
        return [&](NodeId node) {
            PositionSum sum;
            shape.for_each_child(
                node, [&](NodeId child) { sum += sums[child]; },
                [&](Index leaf) {
                    sum += PositionSum{weights[leaf] * glm::dvec3(out[shape.place_of_leaf(leaf)]), weights[leaf]};
                });
            out[node] = glm::vec3(sum.position / sum.weight);
            sums[node] = sum;
        };
    });
    parallel_loop(std::size_t{0}, given.positions.size(), [&](std::size_t i) {
        if (given.nodes[i] != no_node) out[given.nodes[i]] = glm::vec3(given.positions[i] - places.origin);
    });
    keep_equal(shape, parts, out);
    return out;
}

} // namespace unseen::vdtree
