// Which nodes stand for leaves around a node when it folds: how far its neighbours are folded by then.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include <unseen/vdtree/vertex_tree.h>

#include "measure/measurement.h"

namespace unseen::perception {

// Neighbours are folded where any of the luminances says so, or where all of them do.
enum class Says { any, all };

template <std::size_t luminances>
class FoldNeighbours {
    using Index = vdtree::Index;
    using NodeId = vdtree::NodeId;

public:
    // `trees`: the same except for their luminances.
    explicit FoldNeighbours(std::span<const vdtree::SoundTree> trees)
        : tree_(trees.front()), interior_(tree_.interior_count()), first_leaf_(tree_.first_leaf()),
          leaf_end_(tree_.leaf_end()), parents_(tree_.parents()), support_(tree_.support_spheres()),
          luminance_span_(interior_), most_changed_(interior_) {
        for (NodeId node = 0; node < interior_; ++node) {
            for (std::size_t i = 0; i < luminances; ++i) {
                const vdtree::PackedRange support = trees[i].support_luminance()[node];
                luminance_span_[node][i] = support.hi.value - support.lo.value;
            }
            most_changed_[node] = most_changed(node, trees);
        }
    }

    // The node that stands for a leaf outside of `node`. Nodes up to its size are folded unless they have more to hide,
    // and so are nodes of any size that hardly anybody sees fold, such as the faces beside an edge.
    NodeId stand_in(Index leaf, NodeId node, Says says) const {
        NodeId at = interior_ + leaf;
        const auto folds_earlier = [&](NodeId up) {
            const bool is_smaller = is_larger(node, up);
            for (std::size_t i = 0; i < luminances; ++i) {
                const bool so =
                    (is_smaller && luminance_span_[up][i] <= measurement::much_more * luminance_span_[node][i]) ||
                    (changes_much_less(up, node, i) && !supports(up, node));
                if (so == (says == Says::any)) return so;
            }
            return says == Says::all;
        };
        int steps = 0;
        for (NodeId up = parents_[at]; up != vdtree::no_node && folds_earlier(up) && ++steps <= measurement::most_steps;
             up = parents_[at])
            at = up;
        return at;
    }

private:
    bool is_larger(NodeId a, NodeId b) const { // ancestors are larger than their descendants
        return support_[a].radius != support_[b].radius ? support_[a].radius > support_[b].radius : a < b;
    }

    // The most that a fold inside the surface can change, up to a factor: luminance times area, and heights. Neither
    // falls from a node to its parent.
    struct Change {
        std::array<float, luminances> light = {};
        float height = 0;
    };
    Change most_changed(NodeId node, std::span<const vdtree::SoundTree> trees) const {
        const vdtree::NormalSlabs& normals = tree_.bounds()[node].slabs;
        int turn = 0; // by which the normals differ
        for (std::size_t i = 0; i < vdtree::NormalSlabs::axis_count; ++i)
            turn = std::max(turn, normals.hi[i] - normals.lo[i]);
        const float radius = support_[node].radius;
        Change change{{}, static_cast<float>(turn) * radius};
        for (std::size_t i = 0; i < luminances; ++i) {
            const vdtree::PackedRange luminance = trees[i].ring_luminance()[node];
            change.light[i] = static_cast<float>(luminance.hi.value - luminance.lo.value) * radius * radius;
        }
        return change;
    }
    bool changes_much_less(NodeId a, NodeId node, std::size_t luminance) const {
        const Change &less = most_changed_[a], &more = most_changed_[node];
        return measurement::much_less * less.light[luminance] <= more.light[luminance] &&
               measurement::much_less * less.height <= more.height &&
               !(tree_.bounds()[a].flags & vdtree::irregular_ring); // whose border may move as far as it likes
    }
    bool supports(NodeId a, NodeId b) const { return first_leaf_[a] <= first_leaf_[b] && leaf_end_[b] <= leaf_end_[a]; }

    const vdtree::SoundTree& tree_;
    NodeId interior_;
    std::span<const Index> first_leaf_, leaf_end_;
    std::span<const NodeId> parents_;
    std::span<const vdtree::Sphere> support_;
    std::vector<std::array<int, luminances>> luminance_span_; // of the support, by interior node
    std::vector<Change> most_changed_;                        // likewise
};

} // namespace unseen::perception
