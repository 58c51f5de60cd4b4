// Checks nodes of trees that come from files, one by one: that what they refer to lies within the tree.
#pragma once

#include <atomic>

#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::vdtree {

// What is wrong with how an interior node refers to others; null where nothing is. It looks at the node, the links of
// its children and the triangles that vanish at it, whatever they say, and at nothing else; where the root's parts are
// the whole tree and every node from the root down to here is sound, children tile their parents, triangles their
// nodes, and each number lies within its array; triangles vanish where they are said to. Any node may be asked about.
// Cost: the number of children and triangles.
// The section that contradicts the others about how wedges hang on nodes; null: none does, and every number that follows
// from them lies within the arrays. Cost: a few bits a wedge.
const char* section_against_wedges(const TreeGeometry& geometry) noexcept;

// Likewise, about what nodes need. Cost: a few bits a node and a number a need.
const char* section_against_needs(const TreeGeometry& geometry) noexcept;

const char* fault_in_links(const TreeGeometry& g, NodeId node);

// That the root stands for the whole tree.
const char* fault_in_root(const TreeGeometry& g) noexcept;

// What is wrong with the values that are drawn of a node, and tested of an interior one: floats that are not finite, a
// negative radius.
const char* fault_in_values(const TreeGeometry& g, NodeId node) noexcept;

// What is wrong with the values of all nodes, triangles and leaves, as a sentence; empty where nothing is. With links
// in order everywhere nothing that is made of the tree can lead out of bounds then. Cost: one pass over the arrays.
std::string fault_in_sections(const TreeGeometry& g, const TreeLuminance& l);

// The same of the sections of protected trees, which are looked at when a file is opened: mapped ones, too.
std::string fault_in_fold_weights(const TreeGeometry& g);

class NodeChecks {
public:
    // Checks the arrays of a file, which must stay in place.
    NodeChecks(const TreeGeometry& g, const TreeLuminance& l);

    // Whether the links of an interior node and the values of its children can be used. Looks at them the first time.
    bool is_sound(NodeId node) {
        return (sound_[node >> 6].load(std::memory_order_relaxed) >> (node & 63) & 1) != 0 || is_in_order(node);
    }
    // Everything; see VertexTree::check().
    Result<void> check_all();

private:
    bool is_in_order(NodeId node);

    const TreeGeometry& g_;
    const TreeLuminance& l_;
    std::unique_ptr<std::atomic<std::uint64_t>[]> sound_; // one bit a node
    std::atomic<bool> all_sound_{false};
};

} // namespace unseen::vdtree
