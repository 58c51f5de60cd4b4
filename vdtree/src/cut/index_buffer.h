// The index buffer of a cut: gathered as a whole, or kept current by patches around what folds and unfolds.
#pragma once

#include <bit>

#include <unseen/vdtree/cut.h>

#include "tree/unchecked_links.h"

namespace unseen::vdtree {

// For patches, every vertex in use has a list of the corners that show it, with the leaves that these stand for. A fold
// hands its children's corners to the proxy, an unfold deals them out again, so its cost is the valence of what
// changes, whatever the tree's size; the lists' memory goes with the triangles shown. A list is a block of power-of-two
// size in one pool: nearly always one cache line. For gathering, the leaves at the corners are kept, so that only what
// has come since is looked up in the tree.
class IndexBuffer {
public:
    explicit IndexBuffer(const VertexTree& tree) : tree_(&tree), has_seams_(tree.has_seams()) {}

    // Wedges.
    std::span<const WedgeId> indices() const noexcept { return has_seams_ ? wedges_ : indices_; }
    bool can_patch() const noexcept { return has_lists_; }

    // Everything anew, in the order of the triangles. `unfolded` has one bit a node, `proxies` one node a leaf. Cost: a
    // nanosecond for each corner, and what triangles take that were not there when it was gathered last.
    void gather(std::span<const std::uint64_t> unfolded, std::span<const NodeId> proxies, Index triangles) {
        drop_lists();
        find_leaves(unfolded, triangles);
        indices_.resize(std::size_t{3} * triangles);
        NodeId* out = indices_.data();
        constexpr std::size_t ahead = 32; // triangles between a prefetch and its use
        for (std::size_t i = 0; i < triangles; ++i) {
            if (i + ahead < triangles)
                for (const Index leaf : leaves_[i + ahead]) prefetch(&proxies[leaf]);
            for (const Index leaf : leaves_[i]) *out++ = proxies[leaf];
        }
        if (!has_seams_) return;
        wedges_.resize(indices_.size());
        for (std::size_t i = 0; i < triangles; ++i)
            for (std::size_t k = 0; k < 3; ++k)
                wedges_[3 * i + k] = tree_->wedge_at(indices_[3 * i + k], leaves_[i][k]);
    }

    // Makes the lists for what was gathered just now. Cost: a few times gather()'s. Buffers that are too large for them
    // stay without (a vertex in 2^27 triangles, or more than some 10^9 corners).
    void make_lists() {
        // Only what is shown is touched, so that the cost does not go with the tree.
        if (block_of_node_.empty()) block_of_node_.assign(tree_->node_count(), no_block);
        constexpr std::size_t ahead = 16; // corners between a prefetch and its use
        const auto prefetch_ahead = [&](std::size_t corner) {
            if (corner + ahead < indices_.size()) prefetch(&block_of_node_[indices_[corner + ahead]]);
        };
        // First counts, and what lists of them take.
        std::uint64_t all_entries = 0;
        std::uint32_t longest = 0;
        for (std::size_t corner = 0; corner < indices_.size(); ++corner) {
            prefetch_ahead(corner);
            std::uint32_t& counted = block_of_node_[indices_[corner]];
            const std::uint32_t count = counted == no_block ? 0 : counted & ~is_count;
            if (count == 0) all_entries += std::uint64_t{1} << least_log2_size;
            else if (log2_size_for(count + 1) > log2_size_for(count))
                all_entries += std::uint64_t{1} << log2_size_for(count);
            longest = std::max(longest, count + 1);
            counted = (count + 1) | is_count;
        }
        has_lists_ = true;
        if (log2_size_for(longest) > most_log2_size || all_entries >= is_count) {
            drop_lists();
            return;
        }
        for (auto& blocks : free_blocks_) blocks.clear();
        holes_.clear();
        pool_.clear();
        pool_.resize(all_entries / std::size(Line{}.entries));
        // Counts become blocks, in the order in which the buffer first shows the nodes, so that neighbours lie together.
        Block end = 0;
        Index corner = 0;
        for (const Triangle& triangle : leaves_) {
            for (const Index leaf : triangle) {
                prefetch_ahead(corner);
                std::uint32_t& block = block_of_node_[indices_[corner]];
                if (block & is_count) {
                    const unsigned log2_size = log2_size_for(block & ~is_count);
                    *entries(end) = {log2_size, 0};
                    block = end;
                    end += Block{1} << log2_size;
                }
                Entry* const head = entries(block);
                head[++head->leaf] = {corner++, leaf};
            }
        }
    }

    // A node has a list only while a corner shows it.
    void drop_lists() noexcept {
        if (!has_lists_) return;
        has_lists_ = false;
        for (const NodeId node : indices_)
            if (node != no_node) block_of_node_[node] = no_block;
        for (const Removal& removal : removals_) block_of_node_[removal.node] = no_block;
        removals_.clear();
    }

    // Precondition of all: can_patch(). Up to end_patch() the buffer may have holes.
    // All children are active, and `children` are they.
    void fold(NodeId node, std::span<const NodeId> children) {
        if (has_seams_) fold_to<true>(node, children);
        else fold_to<false>(node, children);
    }
    // `proxies` is current: the children stand for their leaves.
    void unfold(NodeId node, std::span<const NodeId> children, std::span<const NodeId> proxies) {
        if (has_seams_) unfold_to<true>(node, children, proxies);
        else unfold_to<false>(node, children, proxies);
    }

    // Bring nearer what changes around active nodes will read: their lists' places, then the lists, then what these
    // show. In this order, for some nodes at once, so that the reads overlap.
    void prefetch_places(std::span<const NodeId> active) const {
        for (const NodeId node : active) prefetch(&block_of_node_[node]);
    }
    void prefetch_lists(std::span<const NodeId> active) const {
        for (const NodeId node : active)
            if (const Block block = block_of_node_[node]; block != no_block) prefetch(entries(block));
    }
    void prefetch_corners(std::span<const NodeId> active) const {
        for (const NodeId node : active) {
            const Block block = block_of_node_[node];
            if (block == no_block) continue;
            const Entry* const head = entries(block);
            const std::uint32_t count = std::min<std::uint32_t>(head->leaf, (1u << least_log2_size) - 1);
            for (std::uint32_t i = 1; i <= count; ++i) prefetch(&indices_[head[i].corner]);
        }
    }

    // Closes the holes with triangles from the end.
    void end_patch() {
        remove_all();
        std::size_t end = indices_.size() / 3;
        // What fills the holes, and its lists.
        moving_.clear();
        for (std::size_t corner = indices_.size() - 3 * std::min(holes_.size(), end); corner < indices_.size();
             ++corner)
            if (indices_[corner] != no_node) moving_.push_back(indices_[corner]);
        prefetch_places(moving_);
        prefetch_lists(moving_);
        for (const Index hole : holes_) {
            while (end > 0 && is_hole(static_cast<Index>(end - 1))) --end;
            if (hole >= end) continue;
            --end;
            for (Index k = 0; k < 3; ++k) {
                const Index to = hole * 3 + k, from = static_cast<Index>(end) * 3 + k;
                indices_[to] = indices_[from];
                if (has_seams_) wedges_[to] = wedges_[from];
                replace(indices_[from], from, to);
            }
        }
        while (end > 0 && is_hole(static_cast<Index>(end - 1))) --end;
        holes_.clear();
        indices_.resize(3 * end);
        if (has_seams_) wedges_.resize(3 * end);
    }

    std::uint64_t byte_size() const noexcept {
        std::uint64_t bytes = sizeof(NodeId) * (indices_.capacity() + wedges_.capacity()) +
                              sizeof(Triangle) * (leaves_.capacity() + next_leaves_.capacity()) +
                              sizeof(std::uint64_t) * shown_by_.capacity() +
                              sizeof(Index) * (places_.capacity() + coming_.capacity()) +
                              sizeof(Block) * block_of_node_.capacity() + sizeof(Line) * pool_.capacity();
        for (const auto& blocks : free_blocks_) bytes += sizeof(Block) * blocks.capacity();
        return bytes;
    }

private:
    // A cache line: the head and the seven corners that nearly every vertex makes do with.
    static constexpr unsigned least_log2_size = 3;
    static constexpr unsigned most_log2_size = 27;
    // While lists are made, what a node has is a count with this bit, then a block.
    static constexpr std::uint32_t is_count = 1u << 31;
    static unsigned log2_size_for(std::uint32_t corners) {
        return std::max<unsigned>(least_log2_size, static_cast<unsigned>(std::bit_width(corners)));
    }

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

    // Which triangles vanish, and which corners are whose, is unpredictable: branch-free, here and below.
    template <bool seams>
    void fold_to(NodeId node, std::span<const NodeId> children) {
        std::size_t most = 0;
        for (const NodeId child : children) most += list(block_of_node_[child]).size();
        scratch_.resize(most);
        vanished_.resize(most);
        NodeId* const indices = indices_.data();
        std::size_t count = 0, vanished = 0, kept = 0;
        for (const NodeId child : children) {
            const Block block = block_of_node_[child];
            for (const Entry& entry : list(block)) {
                const Index c0 = entry.corner / 3 * 3;
                const bool is_shown = indices[entry.corner] == child; // else it waits for its removal
                // The triangles that vanish are those that show the node twice now.
                const bool is_second =
                    (indices[c0] == node) + (indices[c0 + 1] == node) + (indices[c0 + 2] == node) == 1;
                indices[entry.corner] = is_shown ? node : no_node;
                if constexpr (seams) wedges_[entry.corner] = is_shown ? tree_->wedge_at(node, entry.leaf) : no_node;
                scratch_[count] = entry;
                count += is_shown;
                vanished_[vanished] = c0;
                vanished += is_shown & is_second;
            }
            discard(block);
            block_of_node_[child] = no_block;
        }
        for (std::size_t i = 0; i < vanished; ++i) {
            const Index c0 = vanished_[i];
            for (Index corner = c0; corner < c0 + 3; ++corner) {
                if (indices[corner] != node) removals_.push_back({corner, indices[corner]});
                indices[corner] = no_node;
                if constexpr (seams) wedges_[corner] = no_node;
            }
            holes_.push_back(c0 / 3);
        }
        for (std::size_t i = 0; i < count; ++i) {
            const Entry entry = scratch_[i];
            scratch_[kept] = entry;
            kept += indices[entry.corner] == node;
        }
        block_of_node_[node] = no_block;
        give(node, std::span(scratch_).first(kept));
    }

    template <bool seams>
    void unfold_to(NodeId node, std::span<const NodeId> children, std::span<const NodeId> proxies) {
        remove_all();
        const auto& links = unchecked_links(*tree_);
        const auto first_leaf = links.first_leaf, leaf_end = links.leaf_end;
        // The corners under the node, those of the triangles that come last.
        const Block block = block_of_node_[node];
        const auto shown = list(block);
        scratch_.assign(shown.begin(), shown.end());
        discard(block);
        block_of_node_[node] = no_block;
        const Index first_triangle = links.first_triangle[node], triangle_end = links.first_triangle[node + 1];
        for (Index t = first_triangle; t < triangle_end; ++t) {
            const Index c0 = new_triangle() * 3;
            for (Index k = 0; k < 3; ++k) {
                const Entry entry{c0 + k, links.triangles[t][k]};
                if (entry.leaf - first_leaf[node] < leaf_end[node] - first_leaf[node]) {
                    scratch_.push_back(entry);
                } else {
                    const NodeId other = proxies[entry.leaf];
                    indices_[entry.corner] = other;
                    show<seams>(entry, other);
                    append(other, entry);
                }
            }
        }
        // Every child takes its own.
        const WedgeId first_of_leaves = tree_->interior_wedge_count();
        dealt_.resize(scratch_.size());
        NodeId* const indices = indices_.data();
        for (const NodeId child : children) {
            const bool is_place = tree_->is_place(child);
            const Index begin = is_place ? tree_->first_wedge(child) - first_of_leaves : first_leaf[child];
            const Index leaves =
                is_place ? tree_->wedge_end(child) - tree_->first_wedge(child) : leaf_end[child] - begin;
            std::size_t count = 0;
            for (const Entry& entry : scratch_) {
                dealt_[count] = entry;
                count += entry.leaf - begin < leaves;
            }
            for (std::size_t i = 0; i < count; ++i) {
                indices[dealt_[i].corner] = child;
                show<seams>(dealt_[i], child);
            }
            block_of_node_[child] = no_block;
            give(child, std::span(dealt_).first(count));
        }
    }

    // Puts the wedge of a node that shows an entry's leaf where it is shown.
    template <bool seams>
    void show(const Entry& entry, NodeId node) {
        if constexpr (seams) wedges_[entry.corner] = tree_->wedge_at(node, entry.leaf);
    }

    // Lines follow each other without gaps: one array of entries.
    static_assert(sizeof(Line) == sizeof(Line::entries));
    Entry* entries(Block block) { return reinterpret_cast<Entry*>(pool_.data()) + block; }
    const Entry* entries(Block block) const { return reinterpret_cast<const Entry*>(pool_.data()) + block; }
    // Brings leaves_ to what unfolded nodes show: what showed there before is copied, word by word of them.
    void find_leaves(std::span<const std::uint64_t> unfolded, Index triangles) {
        const auto& links = unchecked_links(*tree_);
        const auto first = links.first_triangle;
        const auto corners = links.triangles;
        shown_by_.resize(unfolded.size()); // by none before the first time
        places_.resize(unfolded.size() + 1);
        // First the triangles that come. Most nodes have at most two; their number is unpredictable, so branch-free.
        constexpr Index mostly = 2;
        coming_.resize(std::size_t{triangles} + mostly);
        runs_.clear();
        next_leaves_.resize(triangles);
        Index* next = coming_.data();
        Index place = 0, kept_from = 0, kept = 0; // what is to be copied to before `place`
        const auto copy_kept = [&] {
            std::copy_n(leaves_.begin() + kept_from, kept, next_leaves_.begin() + (place - kept));
            kept = 0;
        };
        for (std::size_t word = 0; word < unfolded.size(); ++word) {
            const Index from = places_[word], count = places_[word + 1] - from;
            places_[word] = place;
            if (unfolded[word] == shown_by_[word]) {
                if (kept == 0) kept_from = from;
                kept += count;
                place += count;
                continue;
            }
            copy_kept();
            shown_by_[word] = unfolded[word];
            Index* const begin = next;
            for (std::uint64_t left = unfolded[word]; left; left &= left - 1) {
                const std::size_t node = word * 64 + static_cast<std::size_t>(std::countr_zero(left));
                const Index t0 = first[node], t1 = first[node + 1];
                for (Index i = 0; i < mostly; ++i) next[i] = t0 + i;
                for (Index t = t0 + mostly; t < t1; ++t) next[t - t0] = t;
                next += t1 - t0;
            }
            const auto come = static_cast<Index>(next - begin);
            if (!runs_.empty() && runs_.back().place + runs_.back().count == place) runs_.back().count += come;
            else runs_.push_back({place, come});
            place += come;
        }
        copy_kept();
        places_.back() = place;
        constexpr std::size_t ahead = 128; // triangles between a prefetch and its use
        const Index* coming = coming_.data();
        for (const Run& run : runs_)
            for (Index i = 0; i < run.count; ++i, ++coming) {
                if (coming + ahead < next) prefetch(&corners[coming[ahead]]);
                next_leaves_[run.place + i] = corners[*coming];
            }
        leaves_.swap(next_leaves_);
    }

    // A list of its own for a node that has none.
    void give(NodeId node, std::span<const Entry> shown) {
        if (shown.empty()) return;
        const auto count = static_cast<std::uint32_t>(shown.size());
        const Block block = allocate(log2_size_for(count));
        entries(block)->leaf = count;
        std::copy(shown.begin(), shown.end(), entries(block) + 1);
        block_of_node_[node] = block;
    }

    void append(NodeId node, Entry entry) {
        Block& block = block_of_node_[node];
        if (block == no_block) block = allocate(least_log2_size);
        const std::uint32_t count = entries(block)->leaf, log2_size = entries(block)->corner;
        if (count + 1 == (1u << log2_size)) {
            const Block larger = allocate(log2_size + 1);
            std::copy_n(entries(block) + 1, count, entries(larger) + 1);
            entries(larger)->leaf = count;
            discard(block);
            block = larger;
        }
        entries(block)[1 + count] = entry;
        ++entries(block)->leaf;
    }

    // Does nothing for nodes whose list a fold has taken.
    void remove(NodeId node, Index corner) {
        const Block block = block_of_node_[node];
        const auto shown = list(block);
        const auto found =
            std::find_if(shown.begin(), shown.end(), [&](const Entry& entry) { return entry.corner == corner; });
        if (found == shown.end()) return;
        *found = shown.back();
        if (--entries(block)->leaf > 0) return;
        discard(block);
        block_of_node_[node] = no_block;
    }

    // What waits, with what that reads on its way ahead of time.
    void remove_all() {
        constexpr std::size_t far = 32, near = 16; // removals between a prefetch and its use
        for (std::size_t i = 0; i < removals_.size(); ++i) {
            if (i + far < removals_.size()) prefetch(&block_of_node_[removals_[i + far].node]);
            if (i + near < removals_.size())
                if (const Block block = block_of_node_[removals_[i + near].node]; block != no_block)
                    prefetch(entries(block));
            remove(removals_[i].node, removals_[i].corner);
        }
        removals_.clear();
    }

    void replace(NodeId node, Index corner, Index by) {
        for (Entry& entry : list(block_of_node_[node]))
            if (entry.corner == corner) entry.corner = by;
    }
    std::span<Entry> list(Block block) {
        if (block == no_block) return {};
        return {entries(block) + 1, entries(block)->leaf};
    }
    Block allocate(unsigned log2_size) {
        auto& free = free_blocks_[log2_size];
        Block block;
        if (free.empty()) {
            constexpr std::size_t in_line = std::size(Line{}.entries);
            block = static_cast<Block>(pool_.size() * in_line);
            pool_.resize(pool_.size() + (std::size_t{1} << log2_size) / in_line);
        } else {
            block = free.back();
            free.pop_back();
        }
        *entries(block) = {log2_size, 0};
        return block;
    }

    void discard(Block block) {
        if (block != no_block) free_blocks_[entries(block)->corner].push_back(block);
    }
    Index new_triangle() {
        if (!holes_.empty()) {
            const Index triangle = holes_.back();
            holes_.pop_back();
            return triangle;
        }
        const Index triangle = static_cast<Index>(indices_.size() / 3);
        indices_.resize(indices_.size() + 3, no_node);
        if (has_seams_) wedges_.resize(indices_.size(), no_node);
        return triangle;
    }

    bool is_hole(Index triangle) const { return indices_[std::size_t{3} * triangle] == no_node; }

    const VertexTree* tree_;
    bool has_seams_;
    std::vector<NodeId> indices_; // the nodes at the corners
    std::vector<WedgeId> wedges_; // their wedges, where these are not the nodes themselves
    bool has_lists_ = false;
    std::vector<Block> block_of_node_;   // by node; no_block without lists
    std::vector<Line> pool_;             // of entries; blocks are whole lines
    std::vector<Block> free_blocks_[28]; // by log2 of the size
    std::vector<Index> holes_;           // triangles without corners
    struct Removal {
        Index corner;
        NodeId node;
    };
    std::vector<Removal> removals_; // what such triangles showed, still in its list until all of these are done at once
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
};

} // namespace unseen::vdtree
