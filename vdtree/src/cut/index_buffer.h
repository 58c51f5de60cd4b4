// The index buffer of a cut: gathered as a whole, or kept current by patches around what folds and unfolds.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <unseen/vdtree/cut.h>

namespace unseen::vdtree {

// For patches, every vertex in use has a list of the corners that show it, with the leaves that these stand for. A fold
// hands its children's corners to the proxy, an unfold deals them out again, so its cost is the valence of what
// changes, whatever the tree's size; the lists' memory goes with the triangles shown. A list is a block of power-of-two
// size in one pool: nearly always one cache line. For gathering, the leaves at the corners are kept, so that only what
// has come since is looked up in the tree.
class IndexBuffer {
public:
    explicit IndexBuffer(const VertexTree& tree) : tree_(&tree) {}

    std::span<const NodeId> indices() const noexcept { return indices_; }
    bool can_patch() const noexcept { return has_lists_; }

    // Everything anew, in the order of the triangles. `unfolded` has one bit a node, `proxies` one node a leaf. Cost: a
    // nanosecond for each corner, and what triangles take that were not there when it was gathered last.
    void gather(std::span<const std::uint64_t> unfolded, std::span<const NodeId> proxies, Index triangles);
    // Makes the lists for what was gathered just now. Cost: a few times gather()'s. Buffers that are too large for them
    // stay without (a vertex in 2^27 triangles, or more than some 10^9 corners).
    void make_lists();
    void drop_lists() noexcept;

    // Precondition of all: can_patch(). Between begin_patch() and end_patch() the buffer may have holes.
    void begin_patch() { write_count_ = 0; }
    // All children are active, and `children` are they.
    void fold(NodeId node, std::span<const NodeId> children);
    // `proxies` is current: the children stand for their leaves.
    void unfold(NodeId node, std::span<const NodeId> children, std::span<const NodeId> proxies);
    // Bring nearer what changes around active nodes will read: their lists' places, then the lists, then what these
    // show. In this order, for some nodes at once, so that the reads overlap.
    void prefetch_places(std::span<const NodeId> active) const;
    void prefetch_lists(std::span<const NodeId> active) const;
    void prefetch_corners(std::span<const NodeId> active) const;
    // Closes the holes with triangles from the end.
    void end_patch();

    // What the patches since begin_patch() wrote, in order; places may come twice, and lie beyond the end by now.
    std::span<const IndexWrite> writes() const noexcept { return std::span(writes_).first(write_count_); }
    std::uint64_t byte_size() const noexcept;

private:
    using Block = std::uint32_t; // where a list starts in pool_
    static constexpr Block no_block = 0xffffffffu;
    struct Entry {
        Index corner =
            0;          // of the buffer; of a block's first entry, its head: log2 of the entries in it, itself included
        Index leaf = 0; // whose proxy it shows; of the head: the entries in use
    };

    struct alignas(64) Line {
        Entry entries[8];
    };

    // Lines follow each other without gaps: one array of entries.
    static_assert(sizeof(Line) == sizeof(Line::entries));
    Entry* entries(Block block) { return reinterpret_cast<Entry*>(pool_.data()) + block; }
    const Entry* entries(Block block) const { return reinterpret_cast<const Entry*>(pool_.data()) + block; }
    void find_leaves(std::span<const std::uint64_t> unfolded, Index triangles);
    IndexWrite* room_for(std::size_t writes);
    void take_room_until(const IndexWrite* end) { write_count_ = static_cast<std::size_t>(end - writes_.data()); }
    void give(NodeId node, std::span<const Entry> shown);
    void append(NodeId node, Entry entry);
    void remove(NodeId node, Index corner);
    void remove_all();
    void replace(NodeId node, Index corner, Index by);
    std::span<Entry> list(Block block);
    Block allocate(unsigned log2_size);
    void discard(Block block);
    Index new_triangle();
    bool is_hole(Index triangle) const { return indices_[std::size_t{3} * triangle] == no_node; }

    const VertexTree* tree_;
    std::vector<NodeId> indices_;
    bool has_lists_ = false;
    std::vector<Block> block_of_node_;   // by node; no_block without lists
    std::vector<Line> pool_;             // of entries; blocks are whole lines
    std::vector<Block> free_blocks_[28]; // by log2 of the size
    std::vector<Index> holes_;           // triangles without corners
    std::vector<IndexWrite>
        removals_; // what such triangles showed, still in its list until all of these are done at once
    // From the last gathering: the leaves at the corners, in the buffer's order; the nodes whose triangles these are, one
    // bit each; and where the triangles of each word of these begin.
    std::vector<Triangle> leaves_;
    std::vector<std::uint64_t> shown_by_;
    std::vector<Index> places_;
    struct Run {
        Index place, count; // in leaves_
    };
    std::vector<Run> runs_; // scratch
    std::vector<Triangle> next_leaves_;
    std::vector<Index> coming_;
    std::vector<Entry> scratch_, dealt_;
    std::vector<Index> vanished_;
    std::vector<NodeId> moving_;
    std::vector<IndexWrite> writes_; // the first ones of it
    std::size_t write_count_ = 0;
};

} // namespace unseen::vdtree
