#include "fold/lit_trees.h"

#include <algorithm>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/light_bounds.h>

namespace unseen::perception {

using vdtree::NodeId;

double LitErrors::edge_of_shadow(NodeId node) const {
    double sum = 0;
    for (const vdtree::LightSource& light : casting) {
        double most = light.intensity;
        if (light.kind != vdtree::LightSource::Kind::directional) {
            const vdtree::Sphere ring = tree->bounds()[node].ring;
            const double nearest =
                glm::length(light.position - glm::dvec3(ring.centre)) - static_cast<double>(ring.radius);
            most = nearest > 0 ? most * (light.distance / nearest) * (light.distance / nearest) : 1;
        }
        sum += most;
    }
    return std::min(sum * largest_albedo, 1.0); // luminances end there
}

Result<LitTrees> LitTrees::of(std::span<const TreeAsLit> trees, const FoldModel& model) {
    if (trees.empty()) return Error{ErrorCode::invalid_argument, "fold test: there is no tree under lights to look at"};
    double albedo = 0;
    const vdtree::VertexTree& first = trees.front().tree;
    for (NodeId node = 0; node < first.node_count(); ++node)
        albedo = std::max(albedo, static_cast<double>(vdtree::albedo_of(first, node)));
    LitTrees all;
    all.sound_.reserve(trees.size()), all.errors_.reserve(trees.size()); // they are referred to
    for (const TreeAsLit& one : trees) {
        if (one.tree.interior_count() != first.interior_count())
            return Error{ErrorCode::invalid_argument, "fold test: the trees under lights are not of one tree"};
        auto tree = vdtree::SoundTree::of(one.tree);
        if (!tree) return tree.error();
        all.sound_.push_back(std::move(*tree));
        auto measured = fold_errors_of(all.sound_.back(), model);
        if (!measured) return measured.error();
        all.errors_.push_back(std::move(*measured));
        all.lit_.push_back({&all.sound_.back(), all.errors_.back().of_nodes, {}, albedo});
        for (const vdtree::LightSource& light : one.lighting.lights)
            if (light.casts_shadow) all.lit_.back().casting.push_back(light);
    }
    // Parts of the mesh may be lit in either way: no contrast is larger than the larger one of both (LitStages).
    const std::span<const FoldStage> own = all.errors_.front().stages;
    all.stages_.assign(own.begin(), own.end());
    for (const FoldErrors& errors : all.errors_) {
        if (errors.stages.size() != own.size()) all.stages_.clear(); // somewhere no light is left
        for (std::size_t i = 0; i < all.stages_.size(); ++i) include(errors.stages[i], all.stages_[i]);
    }
    return all;
}

} // namespace unseen::perception
