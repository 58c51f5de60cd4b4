#include "tree/mask_pool.h"

#include <unseen/vdtree/internal/parallel.h>

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

bool are_equal(const NormalMask& a, const NormalMask& b) {
    std::uint64_t differing = 0;
    for (std::size_t i = 0; i < a.faces.size(); ++i) differing |= a.faces[i] ^ b.faces[i];
    return differing == 0;
}

struct HashedNode {
    std::uint32_t hash;
    NodeId node;
};

constexpr std::size_t grain = 4096; // nodes of a task
std::size_t chunks_of(std::size_t nodes) { return (nodes + grain - 1) / grain; }

// Calls f(chunk, node) for all nodes, chunks at the same time.
template <class F>
void for_each_node(std::size_t nodes, F&& f) {
    parallel_loop(std::size_t{0}, chunks_of(nodes), [&](std::size_t chunk) {
        for (std::size_t n = chunk * grain; n < std::min(nodes, (chunk + 1) * grain); ++n) f(chunk, n);
    });
}

// For each node, the first one with the same mask.
std::vector<NodeId> find_equal(std::span<const Directions> nodes) {
    constexpr std::size_t groups = std::size_t{1} << group_bits;
    std::vector<std::uint32_t> hashes(nodes.size());
    const auto group_of = [&](std::size_t n) { return hashes[n] >> (32 - group_bits); };
    std::vector<std::array<NodeId, groups>> next(chunks_of(nodes.size())); // how many, then where the next one goes
    for_each_node(nodes.size(), [&](std::size_t chunk, std::size_t n) {
        hashes[n] = hash(nodes[n].mask);
        ++next[chunk][group_of(n)];
    });
    std::array<NodeId, groups + 1> start{};
    NodeId total = 0;
    for (std::size_t g = 0; g < groups; ++g) {
        start[g] = total;
        for (auto& counts : next) total += std::exchange(counts[g], total);
    }
    start[groups] = total;
    std::vector<HashedNode> grouped(nodes.size());
    for_each_node(nodes.size(), [&](std::size_t chunk, std::size_t n) {
        grouped[next[chunk][group_of(n)]++] = {hashes[n], static_cast<NodeId>(n)};
    });
    std::vector<NodeId> first(nodes.size());
    parallel_loop(std::size_t{0}, groups, [&](std::size_t g) {
        const auto group = std::span(grouped).subspan(start[g], start[g + 1] - start[g]);
        const std::size_t wrap = std::bit_ceil(2 * group.size() + 1) - 1;
        std::vector<HashedNode> table(wrap + 1, {0, no_node});
        for (const HashedNode& n : group) {
            std::size_t slot = n.hash & wrap;
            while (table[slot].node != no_node &&
                   !(table[slot].hash == n.hash && are_equal(nodes[table[slot].node].mask, nodes[n.node].mask)))
                slot = (slot + 1) & wrap;
            if (table[slot].node == no_node) table[slot] = n;
            first[n.node] = table[slot].node;
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
    PooledMasks pool;
    pool.at = find_equal(nodes);
    std::vector<std::uint8_t> sizes(nodes.size(), 0); // of the records, by first node; 0: none
    std::vector<std::vector<std::uint8_t>> records(
        chunks_of(nodes.size())); // of each chunk's first nodes, one after another
    for_each_node(nodes.size(), [&](std::size_t chunk, std::size_t n) {
        if (pool.at[n] != n) return;
        std::array<std::uint8_t, most_mask_bytes> record;
        sizes[n] = static_cast<std::uint8_t>(pack(nodes[n].mask, record));
        records[chunk].insert(records[chunk].end(), record.begin(), record.begin() + sizes[n]);
    });
    std::vector<std::uint32_t> begin; // by chunk: of its records in the pool
    std::uint32_t end = 0;
    bool full = false;
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        if (n % grain == 0) begin.push_back(end);
        const NodeId first = pool.at[n];
        if (first == n) full = full || sizes[n] > no_record - most_mask_bytes - end;
        if (first == n && full) sizes[n] = 0;
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
    begin.push_back(end);
    parallel_loop(std::size_t{0}, records.size(), [&](std::size_t chunk) {
        std::copy_n(records[chunk].data(), begin[chunk + 1] - begin[chunk], pool.records.data() + begin[chunk]);
    });
    return pool;
}

} // namespace unseen::vdtree
