#include "mask_pool.h"

#include <algorithm>
#include <array>
#include <bit>
#include <functional>
#include <string_view>
#include <utility>

namespace unseen::vdtree {

namespace {

constexpr std::size_t first_slots = 1024;

std::uint8_t row_of(std::uint64_t face, int row) { return static_cast<std::uint8_t>(face >> (8 * row)); }

// The number of bytes of the record.
std::size_t pack(const NormalMask& mask, std::array<std::uint8_t, most_mask_bytes>& out) {
    std::size_t size = 1;
    out[0] = 0;
    for (std::size_t face = 0; face < mask.faces.size(); ++face) {
        if (mask.faces[face] == 0) continue;
        out[0] |= static_cast<std::uint8_t>(1u << face);
        std::uint8_t& rows = out[size++];
        rows = 0;
        for (int row = 0; row < 8; ++row) {
            const std::uint8_t cells = row_of(mask.faces[face], row);
            if (cells == 0) continue;
            rows |= static_cast<std::uint8_t>(1u << row);
            out[size++] = cells;
        }
    }
    return size;
}

std::size_t record_bytes(const std::uint8_t* record) {
    std::size_t size = 1;
    for (int face = std::popcount(record[0]); face > 0; --face)
        size += 1 + static_cast<std::size_t>(std::popcount(record[size]));
    return size;
}

std::size_t hash(std::span<const std::uint8_t> record) {
    return std::hash<std::string_view>{}({reinterpret_cast<const char*>(record.data()), record.size()});
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

std::span<const std::uint8_t> MaskPool::record_at(std::uint32_t at) const {
    return std::span(records_).subspan(at, record_bytes(records_.data() + at));
}

// The slot that holds the record, or the empty one where it belongs.
std::size_t MaskPool::slot_of(std::span<const std::uint8_t> record) const {
    const std::size_t wrap = slots_.size() - 1;
    std::size_t slot = hash(record) & wrap;
    while (slots_[slot] != no_record && !std::ranges::equal(record_at(slots_[slot]), record)) slot = (slot + 1) & wrap;
    return slot;
}

void MaskPool::grow() {
    const std::vector<std::uint32_t> old = std::exchange(
        slots_, std::vector<std::uint32_t>(std::max(first_slots, 2 * slots_.size()), std::uint32_t{no_record}));
    for (const std::uint32_t at : old)
        if (at != no_record) slots_[slot_of(record_at(at))] = at;
}

std::uint32_t MaskPool::add(const NormalMask& mask) {
    if (used_ * 2 >= slots_.size()) grow();
    std::array<std::uint8_t, most_mask_bytes> bytes;
    const std::span<const std::uint8_t> record(bytes.data(), pack(mask, bytes));
    std::uint32_t& slot = slots_[slot_of(record)];
    if (slot == no_record) {
        if (records_.size() >= no_record - most_mask_bytes) return no_record;
        slot = static_cast<std::uint32_t>(records_.size());
        records_.insert(records_.end(), record.begin(), record.end());
        ++used_;
    }
    return slot;
}

std::vector<std::uint8_t> MaskPool::take() {
    records_.resize(records_.size() + most_mask_bytes, 0);
    records_.shrink_to_fit();
    slots_ = {};
    used_ = 0;
    return std::exchange(records_, {});
}

} // namespace unseen::vdtree
