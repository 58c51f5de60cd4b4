#include "mask_pool.h"

#include <algorithm>
#include <array>
#include <bit>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace unseen::vdtree {

namespace {

// Equal masks are found in so many independent groups.
constexpr std::uint32_t group_bits = 3;

constexpr std::uint32_t no_record = 0xffffffffu;

// Which of the eight bytes are not 0.
std::uint8_t rows_of(std::uint64_t face) {
    constexpr std::uint64_t low_bits = 0x7f7f7f7f7f7f7f7f, gather_bytes = 0x0102040810204080;
    const std::uint64_t high_bits = (((face & low_bits) + low_bits) | face) & ~low_bits;
    return static_cast<std::uint8_t>((high_bits >> 7) * gather_bytes >> 56);
}

// The number of bytes of the record.
std::size_t pack(const NormalMask& mask, std::array<std::uint8_t, most_mask_bytes>& out) {
    std::size_t size = 1;
    out[0] = 0;
    for (std::size_t face = 0; face < mask.faces.size(); ++face) {
        const std::uint8_t face_rows = rows_of(mask.faces[face]);
        if (face_rows == 0) continue;
        out[0] |= static_cast<std::uint8_t>(1u << face);
        out[size++] = face_rows;
        for (unsigned rows = face_rows; rows; rows &= rows - 1)
            out[size++] = static_cast<std::uint8_t>(mask.faces[face] >> (8 * std::countr_zero(rows)));
    }
    return size;
}

std::uint32_t hash(const NormalMask& mask) {
    constexpr std::uint64_t odd = 0x9e3779b97f4a7c15;
    std::uint64_t h = 0;
    for (const std::uint64_t face : mask.faces) h = (std::rotl(h, 23) ^ face) * odd;
    return static_cast<std::uint32_t>((h ^ h >> 29) * odd >> 32);
}

// For each node, the first one with the same mask.
std::vector<NodeId> find_equal(std::span<const Directions> nodes) {
    std::vector<std::uint32_t> hashes(nodes.size());
    tbb::parallel_for(std::size_t{0}, nodes.size(), [&](std::size_t n) { hashes[n] = hash(nodes[n].mask); });
    std::vector<NodeId> first(nodes.size());
    tbb::parallel_for(std::uint32_t{0}, std::uint32_t{1} << group_bits, [&](std::uint32_t group) {
        const auto is_ours = [&](std::size_t n) { return hashes[n] >> (32 - group_bits) == group; };
        std::size_t count = 0;
        for (std::size_t n = 0; n < nodes.size(); ++n) count += is_ours(n);
        const std::size_t wrap = std::bit_ceil(2 * count + 1) - 1;
        std::vector<NodeId> table(wrap + 1, no_node);
        for (std::size_t n = 0; n < nodes.size(); ++n) {
            if (!is_ours(n)) continue;
            std::size_t slot = hashes[n] & wrap;
            while (table[slot] != no_node &&
                   !(hashes[table[slot]] == hashes[n] && nodes[table[slot]].mask == nodes[n].mask))
                slot = (slot + 1) & wrap;
            if (table[slot] == no_node) table[slot] = static_cast<NodeId>(n);
            first[n] = table[slot];
        }
    });
    return first;
}

} // namespace

NormalMask unpack_mask(std::span<const std::uint8_t> records, std::size_t at) noexcept {
    NormalMask mask;
    if (records.size() < most_mask_bytes || at > records.size() - most_mask_bytes) {
        mask.faces.fill(~std::uint64_t{0});
        return mask;
    }
    const std::uint8_t* next = records.data() + at;
    for (unsigned faces = *next++ & 63u; faces; faces &= faces - 1) {
        std::uint64_t& face = mask.faces[static_cast<std::size_t>(std::countr_zero(faces))];
        for (unsigned rows = *next++; rows; rows &= rows - 1)
            face |= std::uint64_t{*next++} << (8 * std::countr_zero(rows));
    }
    return mask;
}

PooledMasks pool_masks(std::span<const Directions> nodes, std::span<const NodeId> parents) {
    constexpr std::size_t grain = 4096; // nodes
    PooledMasks pool;
    pool.at = find_equal(nodes);
    std::vector<std::uint8_t> sizes(nodes.size(), 0); // of the records, by first node; 0: none
    const auto for_each_first = [&](auto&& f) {
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, nodes.size(), grain), [&](const auto& range) {
            std::array<std::uint8_t, most_mask_bytes> record;
            for (std::size_t n = range.begin(); n < range.end(); ++n) f(n, record);
        });
    };
    for_each_first([&](std::size_t n, auto& record) {
        if (pool.at[n] == n) sizes[n] = static_cast<std::uint8_t>(pack(nodes[n].mask, record));
    });
    std::uint32_t end = 0;
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        const NodeId first = pool.at[n];
        if (first == n && sizes[n] > no_record - most_mask_bytes - end) sizes[n] = 0;
        if (sizes[first] == 0) {
            pool.at[n] = pool.at[parents[n]];
        } else if (first == n) {
            pool.at[n] = end;
            end += sizes[n];
        } else {
            pool.at[n] = pool.at[first];
        }
    }
    pool.records.assign(end + most_mask_bytes, 0);
    for_each_first([&](std::size_t n, auto& record) {
        if (sizes[n] == 0) return;
        pack(nodes[n].mask, record);
        std::copy_n(record.data(), sizes[n], pool.records.data() + pool.at[n]);
    });
    return pool;
}

} // namespace unseen::vdtree
