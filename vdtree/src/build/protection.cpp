#include "build/protection.h"

#include <algorithm>

#include <unseen/vdtree/internal/parallel.h>

namespace unseen::vdtree {

namespace {

// Whether an edge at the place has one triangle alone.
bool is_at_border(std::span<const Index> corners, std::span<const Triangle> triangles, std::vector<Index>& neighbours) {
    neighbours.clear();
    for (const Index corner : corners)
        for (const Index k : {1, 2}) neighbours.push_back(triangles[corner / 3][(corner + k) % 3]);
    std::ranges::sort(neighbours);
    for (auto run = neighbours.begin(); run != neighbours.end();) {
        const auto end = std::find_if(run, neighbours.end(), [&](Index other) { return other != *run; });
        if (end - run == 1) return true;
        run = end;
    }
    return false;
}

} // namespace

std::vector<float> place_weights(const PlaceMesh& places, const MeshView& mesh, const CornersByPlace& corners,
                                 float border_weight) {
    if (mesh.weights.empty() && border_weight == 1) return {};
    const std::span<const Triangle> triangles = places.mesh().triangles;
    std::vector<float> weights(places.mesh().positions.size(), 1);
    for (Index t = 0; t < triangles.size() && !mesh.weights.empty(); ++t)
        for (std::size_t k = 0; k < 3; ++k) {
            float& weight = weights[triangles[t][k]];
            weight = std::max(weight, mesh.weights[mesh.triangles[places.source_triangle(t)][k]]);
        }
    if (border_weight > 1)
        parallel_loop_over(tbb::blocked_range<std::size_t>(0, weights.size()), [&](const auto& range) {
            std::vector<Index> neighbours;
            for (std::size_t place = range.begin(); place < range.end(); ++place)
                if (is_at_border(corners.at(place), triangles, neighbours))
                    weights[place] = std::max(weights[place], border_weight);
        });
    if (std::ranges::all_of(weights, [](float weight) { return weight == 1; })) weights.clear();
    return weights;
}

Clustering with_locked_apart(const Clustering& given, std::span<const float> weights) {
    const Index places = static_cast<Index>(weights.size()), clusters = static_cast<Index>(given.parents.size());
    std::vector<std::uint8_t> has_folds(clusters, 0); // whether a place under it folds
    std::vector<Index> number(clusters);
    Clustering out;
    Index next = places;
    for (Index c = 0; c < clusters; ++c) {
        if (c < places) has_folds[c] = may_fold(weights[c]);
        if (!has_folds[c]) continue;
        has_folds[given.parents[c]] = 1;
        number[c] = c < places ? c : next++;
        if (c >= places && !given.positions.empty()) out.positions.push_back(given.positions[c - places]);
        if (c >= places && !given.deviations.empty()) out.deviations.push_back(given.deviations[c - places]);
    }
    out.parents.assign(next + 1, next);
    for (Index c = 0; c + 1 < clusters; ++c)
        if (has_folds[c]) out.parents[number[c]] = number[given.parents[c]];
    if (!given.positions.empty()) out.positions.push_back(given.positions.back());
    if (!given.deviations.empty()) out.deviations.push_back(given.deviations.back());
    return out;
}

std::vector<float> fold_weights(const NodeOrder& nodes, std::span<const float> weights) {
    const TreeShape& shape = nodes.shape;
    std::vector<float> out(weights.empty() ? 0 : shape.interior(), 1);
    for (std::size_t v = 0; v < weights.size(); ++v) {
        float& parent = out[shape.parents[shape.place_of_leaf(nodes.leaf_of_vertex[v])]];
        parent = std::max(parent, weights[v]);
    }
    for (std::size_t node = out.size(); node-- > 1;)
        out[shape.parents[node]] = std::max(out[shape.parents[node]], out[node]);
    if (std::ranges::count(out, 1.0f) + 1 >= std::ssize(out)) out.resize(std::min<std::size_t>(out.size(), 1));
    return out;
}

std::vector<glm::dvec3> locked_positions(const NodeOrder& nodes, std::span<const float> weights,
                                         std::span<const glm::dvec3> positions, const glm::dvec3& origin) {
    if (std::ranges::all_of(weights, may_fold)) return {};
    const TreeShape& shape = nodes.shape;
    std::vector<Index> vertex_of_leaf(weights.size());
    for (Index v = 0; v < weights.size(); ++v) vertex_of_leaf[nodes.leaf_of_vertex[v]] = v;
    std::vector<glm::dvec3> out;
    bool is_rounded = false;
    for (Index leaf = 0; leaf < vertex_of_leaf.size(); ++leaf) {
        if (shape.parents[shape.place_of_leaf(leaf)] != VertexTree::root()) continue;
        const Index v = vertex_of_leaf[leaf];
        out.push_back(positions[v]);
        is_rounded |= origin + glm::dvec3(glm::vec3(positions[v] - origin)) != positions[v];
    }
    if (!is_rounded) out.clear();
    return out;
}

} // namespace unseen::vdtree
