// The normal masks of a tree in few bytes: most have set cells in a few rows of one or two faces, and many are equal.
//
// A record: a byte of the faces with set cells; for each of these, a byte of its rows with set cells, and a byte for each of
// those. Equal masks share one record. Dragon, quadric: 7 bytes a node instead of 48.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <vdtree/normal_mask.h>

namespace unseen::vdtree {

// The longest record. The records of a tree are followed by as many zeros, so that one which begins in front of these can be
// read without a look at the end.
inline constexpr std::size_t most_mask_bytes = 1 + 6 * (1 + 8);

// The mask whose record begins at `at`; everything where that leads beyond the last record.
NormalMask unpack_mask(std::span<const std::uint8_t> records, std::size_t at) noexcept;

class MaskPool {
public:
    static constexpr std::uint32_t no_record = 0xffffffffu;

    // Where the mask's record begins; no_record when the records would outgrow their 32-bit offsets.
    std::uint32_t add(const NormalMask& mask);

    std::vector<std::uint8_t> take(); // the records with the zeros behind

private:
    void grow();
    std::size_t slot_of(std::span<const std::uint8_t> record) const;
    std::span<const std::uint8_t> record_at(std::uint32_t at) const;

    std::vector<std::uint8_t> records_;
    std::vector<std::uint32_t> slots_; // hash table of records; its length is a power of two
    std::size_t used_ = 0;
};

} // namespace unseen::vdtree
