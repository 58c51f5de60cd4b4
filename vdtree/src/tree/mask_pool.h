// The normal masks of a tree in few bytes: most have set cells in a few rows of one or two faces, and many are equal.
//
// A record: a byte of the faces with set cells; for each of these, a byte of its rows with set cells, and a byte for
// each of those. Equal masks share one record. Dragon, quadric: 7 bytes a node instead of 48.
#pragma once

#include <unseen/vdtree/internal/normal_mask.h>
#include <unseen/vdtree/vertex_tree.h>

#include "tree/directions.h"

namespace unseen::vdtree {

// The longest record. The records of a tree are followed by as many zeros, so that one which begins in front of these
// can be read without a look at the end.
inline constexpr std::size_t most_mask_bytes = 1 + 6 * (1 + 8);

// The mask whose record begins at `at`; everything where that leads beyond the last record.
NormalMask unpack_mask(std::span<const std::uint8_t> records, std::size_t at) noexcept;

struct PooledMasks {
    std::vector<std::uint8_t> records; // with the zeros behind
    std::vector<std::uint32_t> at;     // by node: where the record of its mask begins
};

// Records in the order of the nodes that have their mask first; parallel. Where records would outgrow their 32-bit
// offsets, nodes get their parents' masks, which include theirs; a parent has a lower number.
PooledMasks pool_masks(std::span<const Directions> nodes, std::span<const NodeId> parents);

} // namespace unseen::vdtree
