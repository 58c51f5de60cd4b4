#include "place_proxies.h"

#include <algorithm>

#include <glm/geometric.hpp>

namespace unseen::vdtree {

namespace {

// Every vertex counts a little, so that vertices without an area have a mean too: share of the largest vertex area.
constexpr double least_weight = 1e-6;

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

// Means of an attribute: `values` has those of the leaves and gets those of the interior nodes.
template <class Wide, class Value>
void average(const TreeShape& shape, std::span<const double> weights, std::span<Value> values) {
    struct Sum {
        Wide value{0};
        double weight = 0;
    };
    std::vector<Sum> sums(shape.interior());
    const auto add = [&](NodeId to, const Wide& value, double weight) {
        sums[to].value += value;
        sums[to].weight += weight;
    };
    for (Index leaf = 0; leaf < shape.leaves(); ++leaf) {
        const NodeId node = shape.node_of_leaf(leaf);
        add(shape.parents[node], weights[leaf] * Wide(values[node]), weights[leaf]);
    }
    for (NodeId node = shape.interior(); node-- > 0;) {
        values[node] = Value(sums[node].value / sums[node].weight);
        if (shape.parents[node] != no_node) add(shape.parents[node], sums[node].value, sums[node].weight);
    }
}

} // namespace

ProxyVertices place_proxies(const TreeShape& shape, const LeafVertices& leaves) {
    const std::size_t nodes = shape.parents.size();
    const NodeId interior = shape.interior();
    ProxyVertices out;
    out.positions.resize(nodes);
    out.normals.resize(nodes);

    double largest = 0;
    for (const double a : leaves.areas) largest = std::max(largest, a);
    std::vector<double> weights(shape.leaves());
    std::vector<ShapeSum> sums(interior);
    for (Index leaf = 0; leaf < shape.leaves(); ++leaf) {
        const NodeId node = shape.node_of_leaf(leaf);
        const double w = weights[leaf] = (largest > 0 ? leaves.areas[leaf] / largest : 0) + least_weight;
        const glm::dvec3 relative = leaves.mesh.positions[leaves.sources[leaf]] - leaves.origin;
        out.positions[node] = glm::vec3(relative);
        out.normals[node] = PackedNormal::nearest(leaves.normals[leaf]);
        sums[shape.parents[node]] += {w * relative, w * glm::dvec3(leaves.normals[leaf]), w};
    }
    for (NodeId node = interior; node-- > 0;) {
        const ShapeSum& sum = sums[node];
        out.positions[node] = glm::vec3(sum.position / sum.weight);
        out.normals[node] = PackedNormal::nearest(glm::vec3(sum.normal));
        if (shape.parents[node] != no_node) sums[shape.parents[node]] += sum;
    }

    if (!leaves.mesh.colours.empty()) {
        out.colours.resize(nodes);
        for (Index leaf = 0; leaf < shape.leaves(); ++leaf)
            out.colours[shape.node_of_leaf(leaf)] = leaves.mesh.colours[leaves.sources[leaf]];
        average<glm::dvec4, glm::vec4>(shape, weights, out.colours);
    }
    if (!leaves.mesh.uvs.empty()) {
        out.uvs.resize(nodes);
        for (Index leaf = 0; leaf < shape.leaves(); ++leaf)
            out.uvs[shape.node_of_leaf(leaf)] = leaves.mesh.uvs[leaves.sources[leaf]];
        average<glm::dvec2, glm::vec2>(shape, weights, out.uvs);
    }
    return out;
}

void keep_coincident_proxies(const TreeShape& shape, std::span<glm::vec3> positions) {
    std::vector<bool> coincident(shape.interior(), true);
    for (NodeId node = shape.interior(); node-- > 0;) {
        const glm::vec3 first = positions[shape.node_of_leaf(shape.first_leaf[node])];
        bool all = true;
        shape.for_each_child(
            node, [&](NodeId child) { all = all && coincident[child] && positions[child] == first; },
            [&](Index leaf) { all = all && positions[shape.node_of_leaf(leaf)] == first; });
        coincident[node] = all;
        if (all) positions[node] = first;
    }
}

} // namespace unseen::vdtree
