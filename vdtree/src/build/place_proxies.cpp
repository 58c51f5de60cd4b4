#include "build/place_proxies.h"

#include "build/parallel_array.h"
#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

namespace {

// Every vertex counts a little, so that vertices without an area have a mean too: share of the largest vertex area.
constexpr double least_weight = 1e-6;

// Sources lie anywhere in memory: prefetch them this many leaves ahead.
constexpr Index ahead = 16;

// Weighted sums of positions and normals, and their weight.
struct ShapeSum {
    glm::dvec3 position{0}, normal{0};
    double weight = 0;
    ShapeSum& operator+=(const ShapeSum& other) {
        position += other.position;
        normal += other.normal;
        weight += other.weight;
        return *this;
    }
};

// The sums of all nodes, parts at the same time: leaf_sum(leaf) says what a leaf adds to its parent.
template <class Sum, class LeafSum, class Finish>
void sum_up(const TreeShape& shape, const TreeParts& parts, LeafSum&& leaf_sum, Finish&& finish) {
    ParallelArray<Sum> sums(shape.interior(), Unfilled());
    parts.bottom_up([&] {
        return [&](NodeId node) {
            Sum sum;
            shape.for_each_child(
                node, [&](NodeId child) { sum += sums[child]; }, [&](Index leaf) { sum += leaf_sum(leaf); });
            finish(node, sum);
            sums[node] = sum;
        };
    });
}

// Copies an attribute to the leaves, and its means to the other nodes.
template <class Wide, class Value>
std::vector<Value> average(const TreeShape& shape, const TreeParts& parts, std::span<const double> weights,
                           std::span<const Index> sources, std::span<const Value> values) {
    struct Sum {
        Wide value{0};
        double weight = 0;
        void operator+=(const Sum& other) {
            value += other.value;
            weight += other.weight;
        }
    };
    std::vector<Value> out(shape.parents.size());
    const auto leaf_sum = [&](Index leaf) -> Sum {
        const Value value = values[sources[leaf]];
        out[shape.node_of_leaf(leaf)] = value;
        return {weights[leaf] * Wide(value), weights[leaf]};
    };
    sum_up<Sum>(shape, parts, leaf_sum,
                [&](NodeId node, const Sum& sum) { out[node] = Value(sum.value / sum.weight); });
    return out;
}

// Gives every node whose leaves have one value that value, which means would round.
template <class Value>
void keep_equal(const TreeShape& shape, const TreeParts& parts, std::span<Value> values) {
    std::vector<std::uint8_t> equal(shape.interior(), 1);
    parts.bottom_up([&] {
        return [&](NodeId node) {
            const Value first = values[shape.node_of_leaf(shape.first_leaf[node])];
            bool all = true;
            shape.for_each_child(
                node, [&](NodeId child) { all = all && equal[child] && values[child] == first; },
                [&](Index leaf) { all = all && values[shape.node_of_leaf(leaf)] == first; });
            equal[node] = all;
            if (all) values[node] = first;
        };
    });
}

} // namespace

ProxyVertices place_proxies(const TreeShape& shape, const TreeParts& parts, const LeafVertices& leaves,
                            const GivenProxies& given) {
    const std::size_t nodes = shape.parents.size();
    ProxyVertices out;
    out.positions.resize(nodes);
    out.normals.resize(nodes);

    double largest = 0;
    for (const double a : leaves.areas) largest = std::max(largest, a);
    ParallelArray<double> weights(shape.leaves(), Unfilled());
    const auto leaf_sum = [&](Index leaf) -> ShapeSum {
        const NodeId node = shape.node_of_leaf(leaf);
        if (leaf >= ahead) prefetch(&leaves.mesh.positions[leaves.sources[leaf - ahead]]); // from the last to the first
        const double w = weights[leaf] = (largest > 0 ? leaves.areas[leaf] / largest : 0) + least_weight;
        const glm::dvec3 relative = leaves.mesh.positions[leaves.sources[leaf]] - leaves.origin;
        out.positions[node] = glm::vec3(relative);
        out.normals[node] = PackedNormal::nearest(leaves.normals[leaf]);
        return {w * relative, w * glm::dvec3(leaves.normals[leaf]), w};
    };
    sum_up<ShapeSum>(shape, parts, leaf_sum, [&](NodeId node, const ShapeSum& sum) {
        out.positions[node] = glm::vec3(sum.position / sum.weight);
        out.normals[node] = PackedNormal::nearest(glm::vec3(sum.normal));
    });
    if (!leaves.mesh.colours.empty())
        out.colours = average<glm::dvec4, glm::vec4>(shape, parts, weights, leaves.sources, leaves.mesh.colours);
    if (!leaves.mesh.uvs.empty())
        out.uvs = average<glm::dvec2, glm::vec2>(shape, parts, weights, leaves.sources, leaves.mesh.uvs);
    parallel_loop(std::size_t{0}, given.positions.size(), [&](std::size_t i) {
        if (given.nodes[i] != no_node) out.positions[given.nodes[i]] = glm::vec3(given.positions[i] - leaves.origin);
    });
    keep_equal<glm::vec3>(shape, parts, out.positions);
    if (!leaves.mesh.texture.empty()) keep_equal<glm::vec2>(shape, parts, out.uvs);
    return out;
}

} // namespace unseen::vdtree
