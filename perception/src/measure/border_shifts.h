// By how far folds move the border of an open surface.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/vertex_tree.h>

#include "measure/leaf_triangles.h"
#include "measure/open_border.h"

namespace unseen::perception {

class BorderShifts {
public:
    // Keeps references to both.
    BorderShifts(const vdtree::SoundTree& tree, const LeafTriangles& of_leaf);

    // The largest distance, mesh units, between the mesh's own border and the one that the node's fold leaves: with no
    // neighbour folded, and with those that `stand_in` gives for leaves outside of the support. And how far triangles
    // that turn over reach beyond the border, in any state of the neighbours that are no larger than the node.
    // `crossing`: triangles with a corner in the support, among them all with one outside. 0 where the node is nowhere
    // near a border. Ask about the children before; threads may ask about different nodes at once. Cost: some products
    // for each edge of the border below the node, as long as the mesh's parts do not lie through each other and the tree
    // is no deeper than foliage's; at most some hundreds, after which the answer errs upwards.
    float shift(vdtree::NodeId node, std::span<const vdtree::Index> crossing,
                const FunctionRef<vdtree::NodeId(vdtree::Index leaf)>& stand_in);

private:
    struct Scratch {
        std::vector<Segment> folded, folded_alone; // with neighbours, and without
        std::vector<glm::vec3> points;
        std::vector<vdtree::NodeId> waiting, second, third;
        std::size_t looks_left = 0; // at nodes and edges of the mesh's own border
    };

    bool supports(vdtree::NodeId node, vdtree::Index leaf) const {
        return leaf - first_leaf_[node] < leaf_end_[node] - first_leaf_[node];
    }
    bool is_larger(vdtree::NodeId a, vdtree::NodeId b) const { // ancestors are larger than their descendants
        return support_[a].radius != support_[b].radius ? support_[a].radius > support_[b].radius : a < b;
    }
    const glm::vec3& place(vdtree::NodeId node) const { return positions_[node]; }
    const glm::vec3& leaf_place(vdtree::Index leaf) const { return positions_[interior_ + leaf]; }
    std::span<const OpenBorder::End> border_of(vdtree::NodeId node) const;
    bool look_at_border(vdtree::NodeId top, BorderSide& side, Scratch& scratch) const;
    float distance_of_borders(vdtree::NodeId node, std::span<const vdtree::Index> crossing,
                              const FunctionRef<vdtree::NodeId(vdtree::Index)>& stand_in, Scratch& scratch) const;
    void find_stand_ins(vdtree::Index leaf, vdtree::NodeId node, vdtree::Index without,
                        std::vector<vdtree::NodeId>& nodes) const;
    float turned_reach(vdtree::NodeId node, std::span<const vdtree::Index> crossing, float least,
                       Scratch& scratch) const;
    // Infinite where there is too much to be looked at.
    float reach_of(vdtree::NodeId a, vdtree::NodeId b, vdtree::NodeId c, Scratch& scratch) const;

    const vdtree::SoundTree& tree_;
    OpenBorder border_;
    vdtree::NodeId interior_;
    std::span<const glm::vec3> positions_; // of nodes
    std::span<const vdtree::Index> first_leaf_, leaf_end_;
    std::span<const vdtree::NodeId> parents_;
    std::span<const vdtree::Triangle> triangles_;
    std::span<const vdtree::Sphere> support_;
    // By interior node, of those near the border; most_border_levels where there was too much to be looked at, or below.
    std::vector<std::uint16_t> levels_below_;
};

} // namespace unseen::perception
