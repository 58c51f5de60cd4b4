#include "index_buffer.h"

#include <algorithm>
#include <bit>
#include <cassert>

namespace unseen::vdtree {

namespace {

constexpr unsigned least_log2_size = 3; // eight words: the head and the seven corners that nearly every vertex makes do with
constexpr unsigned count_bits = 27;
constexpr std::uint32_t count_mask = (1u << count_bits) - 1;
// While lists are made, what a node has is a count, then a block with this bit.
constexpr std::uint32_t is_block = 1u << 31;

unsigned log2_size_for(std::uint32_t corners) {
    return std::max<unsigned>(least_log2_size, static_cast<unsigned>(std::bit_width(corners)));
}

void prefetch([[maybe_unused]] const void* what) {
#if defined(__GNUC__)
    __builtin_prefetch(what);
#endif
}

template <class F>
void for_each_set(std::span<const std::uint64_t> bits, F&& f) {
    for (std::size_t word = 0; word < bits.size(); ++word)
        for (std::uint64_t left = bits[word]; left; left &= left - 1)
            f(static_cast<NodeId>(word * 64 + static_cast<std::size_t>(std::countr_zero(left))));
}

} // namespace

void IndexBuffer::gather(std::span<const std::uint64_t> unfolded, std::span<const NodeId> proxies, Index triangles) {
    drop_lists();
    indices_.resize(std::size_t{3} * triangles);
    const auto first = tree_->first_triangle();
    const auto corners = tree_->triangles();
    NodeId* out = indices_.data();
    for_each_set(unfolded, [&](NodeId node) {
        for (Index t = first[node]; t < first[node + 1]; ++t)
            for (const Index leaf : corners[t]) *out++ = proxies[leaf];
    });
}

void IndexBuffer::make_lists(std::span<const std::uint64_t> unfolded) {
    const auto first = tree_->first_triangle();
    const auto corners = tree_->triangles();
    leaves_.resize(indices_.size());
    Index* out = leaves_.data();
    for_each_set(unfolded, [&](NodeId node) {
        for (Index t = first[node]; t < first[node + 1]; ++t)
            for (const Index leaf : corners[t]) *out++ = leaf;
    });

    // Only what is shown is touched, so that the cost does not go with the tree.
    if (block_of_node_.empty()) block_of_node_.assign(tree_->node_count(), no_block);
    for (const NodeId node : indices_) block_of_node_[node] = 0;
    for (const NodeId node : indices_) ++block_of_node_[node];
    // Counts become blocks, in the order in which the buffer first shows the nodes, so that neighbours lie together.
    std::uint64_t words = 0;
    std::uint32_t longest = 0;
    for (const NodeId node : indices_) {
        std::uint32_t& entry = block_of_node_[node];
        if (entry & is_block) continue;
        longest = std::max(longest, entry);
        words += std::uint64_t{1} << log2_size_for(entry);
        entry |= is_block; // still the count: seen
    }
    has_lists_ = true;
    if (longest >= count_mask || words >= is_block) {
        drop_lists();
        return;
    }
    for (const NodeId node : indices_) block_of_node_[node] &= ~is_block;
    for (auto& blocks : free_blocks_) blocks.clear();
    holes_.clear();
    pool_.clear();
    pool_.resize(words);
    Block end = 0;
    for (std::size_t corner = 0; corner < indices_.size(); ++corner) {
        std::uint32_t& entry = block_of_node_[indices_[corner]];
        if (!(entry & is_block)) {
            const unsigned log2_size = log2_size_for(entry);
            pool_[end] = log2_size << count_bits;
            entry = end | is_block;
            end += Block{1} << log2_size;
        }
        std::uint32_t* const block = &pool_[entry & ~is_block];
        block[1 + (*block & count_mask)] = static_cast<Index>(corner);
        ++*block;
    }
    for (const NodeId node : indices_) block_of_node_[node] &= ~is_block;
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

std::span<Index> IndexBuffer::list(Block block) {
    if (block == no_block) return {};
    return {&pool_[block] + 1, pool_[block] & count_mask};
}

IndexBuffer::Block IndexBuffer::allocate(unsigned log2_size) {
    auto& free = free_blocks_[log2_size];
    Block block;
    if (free.empty()) {
        block = static_cast<Block>(pool_.size());
        pool_.resize(pool_.size() + (std::size_t{1} << log2_size));
    } else {
        block = free.back();
        free.pop_back();
    }
    pool_[block] = log2_size << count_bits;
    return block;
}

void IndexBuffer::discard(Block block) {
    if (block != no_block) free_blocks_[pool_[block] >> count_bits].push_back(block);
}

void IndexBuffer::append(NodeId node, Index corner) {
    Block& block = block_of_node_[node];
    if (block == no_block) block = allocate(least_log2_size);
    std::uint32_t count = pool_[block] & count_mask;
    const unsigned log2_size = pool_[block] >> count_bits;
    if (count + 1 == (1u << log2_size)) {
        const Block larger = allocate(log2_size + 1);
        std::copy_n(&pool_[block] + 1, count, &pool_[larger] + 1);
        pool_[larger] |= count;
        discard(block);
        block = larger;
    }
    pool_[block + 1 + count] = corner;
    ++pool_[block];
}

void IndexBuffer::remove(NodeId node, Index corner) {
    const Block block = block_of_node_[node];
    const auto corners = list(block);
    *std::find(corners.begin(), corners.end(), corner) = corners.back();
    if ((--pool_[block] & count_mask) > 0) return;
    discard(block);
    block_of_node_[node] = no_block;
}

void IndexBuffer::replace(NodeId node, Index corner, Index by) {
    const auto corners = list(block_of_node_[node]);
    *std::find(corners.begin(), corners.end(), corner) = by;
}

Index IndexBuffer::new_triangle() {
    if (!holes_.empty()) {
        const Index triangle = holes_.back();
        holes_.pop_back();
        return triangle;
    }
    const Index triangle = static_cast<Index>(indices_.size() / 3);
    indices_.resize(indices_.size() + 3, no_node);
    leaves_.resize(leaves_.size() + 3, 0);
    return triangle;
}

void IndexBuffer::fold(NodeId node, std::span<const NodeId> children) {
    // The triangles that vanish are those that show the node twice now.
    scratch_.clear();
    vanished_.clear();
    for (const NodeId child : children) {
        const Block block = block_of_node_[child];
        for (const Index corner : list(block)) {
            const Index triangle = corner / 3, c0 = triangle * 3;
            const int shown = (indices_[c0] == node) + (indices_[c0 + 1] == node) + (indices_[c0 + 2] == node);
            write(corner, node);
            scratch_.push_back(corner);
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
    const auto left = std::remove_if(scratch_.begin(), scratch_.end(), [&](Index corner) { return indices_[corner] == no_node; });
    const auto count = static_cast<std::uint32_t>(left - scratch_.begin());
    block_of_node_[node] = no_block;
    if (count == 0) return;
    const Block block = allocate(log2_size_for(count));
    pool_[block] |= count;
    std::copy(scratch_.begin(), left, &pool_[block] + 1);
    block_of_node_[node] = block;
}

void IndexBuffer::unfold(NodeId node, std::span<const NodeId> children, std::span<const NodeId> proxies) {
    // Children have their leaves in ascending order, so a corner's child is found by its leaf; the proxies know it.
    const Block block = block_of_node_[node];
    const auto corners = list(block);
    scratch_.assign(corners.begin(), corners.end()); // appending moves the pool
    discard(block);
    block_of_node_[node] = no_block;
    for (const NodeId child : children) block_of_node_[child] = no_block;
    for (const Index corner : scratch_) {
        const NodeId child = proxies[leaves_[corner]];
        write(corner, child);
        append(child, corner);
    }
    for (Index t = tree_->first_triangle()[node]; t < tree_->first_triangle()[node + 1]; ++t) {
        const Index triangle = new_triangle();
        for (Index k = 0; k < 3; ++k) {
            const Index corner = triangle * 3 + k, leaf = tree_->triangles()[t][k];
            leaves_[corner] = leaf;
            write(corner, proxies[leaf]);
            append(proxies[leaf], corner);
        }
    }
}

void IndexBuffer::prefetch_place(NodeId node) const {
    prefetch(&block_of_node_[node]);
    prefetch(tree_->first_triangle().data() + node);
    prefetch(tree_->first_leaf().data() + node);
}

void IndexBuffer::prefetch_list(NodeId node) const {
    const Block block = block_of_node_[node];
    if (block != no_block) prefetch(&pool_[block]);
    const Index triangle = tree_->first_triangle()[node];
    if (triangle < tree_->triangle_count()) prefetch(tree_->triangles().data() + triangle);
}

void IndexBuffer::prefetch_corners(NodeId node) const {
    const Block block = block_of_node_[node];
    if (block == no_block) return;
    const std::uint32_t* const corners = &pool_[block] + 1;
    const std::uint32_t count = std::min<std::uint32_t>(pool_[block] & count_mask, (1u << least_log2_size) - 1);
    for (std::uint32_t i = 0; i < count; ++i) {
        prefetch(&indices_[corners[i]]);
        prefetch(&leaves_[corners[i]]);
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
            leaves_[to] = leaves_[from];
            write(to, indices_[from]);
            replace(indices_[from], from, to);
        }
    }
    while (end > 0 && is_hole(static_cast<Index>(end - 1))) --end;
    holes_.clear();
    indices_.resize(3 * end);
    leaves_.resize(3 * end);
}

std::uint64_t IndexBuffer::byte_size() const noexcept {
    std::uint64_t bytes = sizeof(NodeId) * indices_.capacity() + sizeof(Index) * leaves_.capacity() +
                          sizeof(Block) * block_of_node_.capacity() + sizeof(std::uint32_t) * pool_.capacity() +
                          sizeof(IndexWrite) * writes_.capacity();
    for (const auto& blocks : free_blocks_) bytes += sizeof(Block) * blocks.capacity();
    return bytes;
}

} // namespace unseen::vdtree
