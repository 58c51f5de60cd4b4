// The vertices of all cuts' rings, one by one: bound_cut_rings() has their luminances' ranges, which lights change.
#include <unseen/perception/internal/cut_rings.h>

#include <vector>

#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/internal/tree_parts.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

#include "measure/ring_neighbours.h"

namespace unseen::perception {

using namespace vdtree;

namespace {

// Trees are some tens of nodes deep, and chains of so many nodes that are no larger than those of another have some
// hundreds of pairs. Where there are more, as in made-up trees, whatever is above counts as reaching everywhere, so
// that no tree costs the square of its depth.
constexpr std::size_t most_added = 4096;

class ChainWalker {
public:
    ChainWalker(const SoundTree& tree, const LightBounds::FurtherVertex& add)
        : tree_(tree), g_(*tree.data().geometry), parts_(links_of(g_)), add_(add) {
        parts_.assign_triangles(g_.first_triangle, g_.triangles);
    }

    void run() {
        parts_.for_each_triangle([&](const TreePart& part) {
            return [&](Index triangle) {
                const Triangle& t = g_.triangles[triangle];
                for (std::size_t k = 0; k < 3; ++k) {
                    walk(part, t[k], t[(k + 1) % 3]);
                    walk(part, t[k], t[(k + 2) % 3]);
                }
            };
        });
    }

private:
    // What the nodes above `here` that do not support its neighbour must know of those above the neighbour.
    void walk(const TreePart& part, Index here, Index neighbour) {
        thread_local std::vector<NodeId> others;
        others.clear();
        NodeId other = parent_of(neighbour);
        std::size_t added = 0;
        for (NodeId node = parent_of(here); node != no_node && !supports(node, neighbour); node = g_.parents[node]) {
            for (; !supports(other, here) && !is_larger(other, node); other = g_.parents[other])
                others.push_back(other);
            added += others.size() + 1;
            if (added > most_added) return reach_everywhere(part, node);
            if (!parts_.owns(part, node)) continue;
            for (const NodeId vertex : others) add_(node, vertex);
        }
    }
    // What is true of the lowest node that the part owns is true of all above.
    void reach_everywhere(const TreePart& part, NodeId node) {
        while (node != no_node && !parts_.owns(part, node)) node = parts_.is_top(node) ? no_node : g_.parents[node];
        if (node != no_node) add_(node, no_node);
    }

    NodeId parent_of(Index leaf) const { return g_.parents[tree_.interior_count() + leaf]; }
    bool supports(NodeId node, Index leaf) const { return perception::supports(g_, node, leaf); }
    bool is_larger(NodeId a, NodeId b) const { return perception::is_larger(g_, a, b); }

    const SoundTree& tree_;
    const TreeGeometry& g_;
    TreeParts parts_;
    const LightBounds::FurtherVertex& add_;
};

} // namespace

Result<LightBounds> bound_lit_cut_rings(const VertexTree& tree, const CutRings& rings) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return sound.error();
    if (rings.radius.size() != tree.interior_count())
        return Error{ErrorCode::invalid_argument, "The rings are not those of the tree."};
    return LightBounds::measure(tree, rings.radius,
                                [&](const LightBounds::FurtherVertex& add) { ChainWalker(*sound, add).run(); });
}

} // namespace unseen::perception
