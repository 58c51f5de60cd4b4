#include "index_buffer.h"

#include <algorithm>
#include <bit>
#include <cassert>

#include "prefetch.h"

namespace unseen::vdtree {

namespace {

constexpr unsigned least_log2_size = 3; // a cache line: the head and the seven corners that nearly every vertex makes do with
constexpr unsigned most_log2_size = 27;
// While lists are made, what a node has is a count with this bit, then a block.
constexpr std::uint32_t is_count = 1u << 31;

unsigned log2_size_for(std::uint32_t corners) {
    return std::max<unsigned>(least_log2_size, static_cast<unsigned>(std::bit_width(corners)));
}

template <class F>
void for_each_set(std::span<const std::uint64_t> bits, F&& f) {
    for (std::size_t word = 0; word < bits.size(); ++word)
        for (std::uint64_t left = bits[word]; left; left &= left - 1)
            f(static_cast<NodeId>(word * 64 + static_cast<std::size_t>(std::countr_zero(left))));
}

} // namespace

// Calls f(node) for the nodes that have triangles to show, in order, with their triangles on the way.
template <class F>
void IndexBuffer::for_each_unfolded(std::span<const std::uint64_t> unfolded, F&& f) {
    nodes_.clear();
    for_each_set(unfolded, [&](NodeId node) { nodes_.push_back(node); });
    const auto first = tree_->first_triangle();
    const auto triangles = tree_->triangles();
    constexpr std::size_t far = 16, near = 8; // nodes between a prefetch and its use
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
        if (i + far < nodes_.size()) prefetch(&first[nodes_[i + far]]);
        if (i + near < nodes_.size()) prefetch(triangles.data() + first[nodes_[i + near]]);
        f(nodes_[i]);
    }
}

void IndexBuffer::gather(std::span<const std::uint64_t> unfolded, std::span<const NodeId> proxies, Index triangles) {
    drop_lists();
    indices_.resize(std::size_t{3} * triangles);
    const auto first = tree_->first_triangle();
    const auto corners = tree_->triangles();
    // First which triangles: most nodes have two or less, and nobody could foretell how many, so nothing branches on that.
    constexpr Index mostly = 2;
    shown_.resize(std::size_t{triangles} + mostly);
    Index* next = shown_.data();
    for_each_set(unfolded, [&](NodeId node) {
        const Index begin = first[node], end = first[node + 1];
        for (Index i = 0; i < mostly; ++i) next[i] = begin + i;
        for (Index t = begin + mostly; t < end; ++t) next[t - begin] = t;
        next += end - begin;
    });
    constexpr std::size_t far = 32, near = 12; // triangles between a prefetch and its use
    NodeId* out = indices_.data();
    for (std::size_t i = 0; i < triangles; ++i) {
        if (i + far < triangles) prefetch(&corners[shown_[i + far]]);
        if (i + near < triangles)
            for (const Index leaf : corners[shown_[i + near]]) prefetch(&proxies[leaf]);
        for (const Index leaf : corners[shown_[i]]) *out++ = proxies[leaf];
    }
}

void IndexBuffer::make_lists(std::span<const std::uint64_t> unfolded) {
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
        else if (log2_size_for(count + 1) > log2_size_for(count)) all_entries += std::uint64_t{1} << log2_size_for(count);
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
    const auto first = tree_->first_triangle();
    const auto triangles = tree_->triangles();
    for_each_unfolded(unfolded, [&](NodeId at) {
        for (Index t = first[at]; t < first[at + 1]; ++t) {
            for (const Index leaf : triangles[t]) {
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
    });
}

// A node has a list only while a corner shows it.
void IndexBuffer::drop_lists() noexcept {
    if (!has_lists_) return;
    has_lists_ = false;
    for (const NodeId node : indices_)
        if (node != no_node) block_of_node_[node] = no_block;
}

void IndexBuffer::write(Index corner, NodeId node) {
    indices_[corner] = node;
    writes_.push_back({corner, node});
}

std::span<IndexBuffer::Entry> IndexBuffer::list(Block block) {
    if (block == no_block) return {};
    return {entries(block) + 1, entries(block)->leaf};
}

IndexBuffer::Block IndexBuffer::allocate(unsigned log2_size) {
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

void IndexBuffer::discard(Block block) {
    if (block != no_block) free_blocks_[entries(block)->corner].push_back(block);
}

void IndexBuffer::append(NodeId node, Entry entry) {
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

void IndexBuffer::remove(NodeId node, Index corner) {
    const Block block = block_of_node_[node];
    const auto shown = list(block);
    *std::find_if(shown.begin(), shown.end(), [&](const Entry& entry) { return entry.corner == corner; }) = shown.back();
    if (--entries(block)->leaf > 0) return;
    discard(block);
    block_of_node_[node] = no_block;
}

void IndexBuffer::replace(NodeId node, Index corner, Index by) {
    for (Entry& entry : list(block_of_node_[node]))
        if (entry.corner == corner) entry.corner = by;
}

Index IndexBuffer::new_triangle() {
    if (!holes_.empty()) {
        const Index triangle = holes_.back();
        holes_.pop_back();
        return triangle;
    }
    const Index triangle = static_cast<Index>(indices_.size() / 3);
    indices_.resize(indices_.size() + 3, no_node);
    return triangle;
}

void IndexBuffer::fold(NodeId node, std::span<const NodeId> children) {
    // The triangles that vanish are those that show the node twice now.
    scratch_.clear();
    vanished_.clear();
    for (const NodeId child : children) {
        const Block block = block_of_node_[child];
        for (const Entry& entry : list(block)) {
            const Index triangle = entry.corner / 3, c0 = triangle * 3;
            const int shown = (indices_[c0] == node) + (indices_[c0 + 1] == node) + (indices_[c0 + 2] == node);
            write(entry.corner, node);
            scratch_.push_back(entry);
            if (shown == 1) vanished_.push_back(triangle);
        }
        discard(block);
        block_of_node_[child] = no_block;
    }
    for (const Index triangle : vanished_) {
        const Index c0 = triangle * 3;
        for (Index corner = c0; corner < c0 + 3; ++corner) {
            if (indices_[corner] != node) remove(indices_[corner], corner);
            write(corner, no_node);
        }
        holes_.push_back(triangle);
    }
    std::erase_if(scratch_, [&](const Entry& entry) { return indices_[entry.corner] == no_node; });
    block_of_node_[node] = no_block;
    if (scratch_.empty()) return;
    const auto count = static_cast<std::uint32_t>(scratch_.size());
    const Block block = allocate(log2_size_for(count));
    entries(block)->leaf = count;
    std::copy(scratch_.begin(), scratch_.end(), entries(block) + 1);
    block_of_node_[node] = block;
}

void IndexBuffer::unfold(NodeId node, std::span<const NodeId> children, std::span<const NodeId> proxies) {
    // Children have their leaves in ascending order, so a corner's child is found by its leaf; the proxies know it.
    const Block block = block_of_node_[node];
    const auto shown = list(block);
    scratch_.assign(shown.begin(), shown.end()); // appending moves the pool
    discard(block);
    block_of_node_[node] = no_block;
    for (const NodeId child : children) block_of_node_[child] = no_block;
    for (const Entry& entry : scratch_) {
        const NodeId child = proxies[entry.leaf];
        write(entry.corner, child);
        append(child, entry);
    }
    for (Index t = tree_->first_triangle()[node]; t < tree_->first_triangle()[node + 1]; ++t) {
        const Index triangle = new_triangle();
        for (Index k = 0; k < 3; ++k) {
            const Entry entry{triangle * 3 + k, tree_->triangles()[t][k]};
            const NodeId proxy = proxies[entry.leaf];
            write(entry.corner, proxy);
            append(proxy, entry);
        }
    }
}

void IndexBuffer::prefetch_places(std::span<const NodeId> active) const {
    for (const NodeId node : active) prefetch(&block_of_node_[node]);
}

void IndexBuffer::prefetch_lists(std::span<const NodeId> active) const {
    for (const NodeId node : active)
        if (const Block block = block_of_node_[node]; block != no_block) prefetch(entries(block));
}

void IndexBuffer::prefetch_corners(std::span<const NodeId> active) const {
    for (const NodeId node : active) {
        const Block block = block_of_node_[node];
        if (block == no_block) continue;
        const Entry* const head = entries(block);
        const std::uint32_t count = std::min<std::uint32_t>(head->leaf, (1u << least_log2_size) - 1);
        for (std::uint32_t i = 1; i <= count; ++i) prefetch(&indices_[head[i].corner]);
    }
}

void IndexBuffer::find_others(std::span<const NodeId> children, std::vector<NodeId>& others) const {
    for (std::size_t i = 0; i + 1 < children.size(); ++i) {
        const Block block = block_of_node_[children[i]];
        if (block == no_block) continue;
        const NodeId neighbour = children[i + 1];
        const Entry* const head = entries(block);
        const std::uint32_t count = std::min<std::uint32_t>(head->leaf, (1u << least_log2_size) - 1);
        for (std::uint32_t e = 1; e <= count; ++e) {
            const NodeId* const shown = &indices_[head[e].corner / 3 * 3];
            if (shown[0] != neighbour && shown[1] != neighbour && shown[2] != neighbour) continue;
            for (int k = 0; k < 3; ++k)
                if (shown[k] != neighbour && shown[k] != children[i]) others.push_back(shown[k]);
        }
    }
}

void IndexBuffer::end_patch() {
    std::size_t end = indices_.size() / 3;
    for (const Index hole : holes_) {
        while (end > 0 && is_hole(static_cast<Index>(end - 1))) --end;
        if (hole >= end) continue;
        --end;
        for (Index k = 0; k < 3; ++k) {
            const Index to = hole * 3 + k, from = static_cast<Index>(end) * 3 + k;
            write(to, indices_[from]);
            replace(indices_[from], from, to);
        }
    }
    while (end > 0 && is_hole(static_cast<Index>(end - 1))) --end;
    holes_.clear();
    indices_.resize(3 * end);
}

std::uint64_t IndexBuffer::byte_size() const noexcept {
    std::uint64_t bytes = sizeof(NodeId) * indices_.capacity() + sizeof(Block) * block_of_node_.capacity() +
                          sizeof(Line) * pool_.capacity() + sizeof(IndexWrite) * writes_.capacity();
    for (const auto& blocks : free_blocks_) bytes += sizeof(Block) * blocks.capacity();
    return bytes;
}

} // namespace unseen::vdtree
