// Sets of nodes, one bit each in whole words, the first one's lowest.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

namespace unseen::vdtree {

constexpr std::size_t words_for(std::size_t bits) { return (bits + 63) / 64; }

inline bool test_bit(std::span<const std::uint64_t> words, std::size_t i) { return (words[i / 64] >> (i % 64)) & 1; }
inline void set_bit(std::span<std::uint64_t> words, std::size_t i) { words[i / 64] |= std::uint64_t{1} << (i % 64); }
inline void clear_bit(std::span<std::uint64_t> words, std::size_t i) {
    words[i / 64] &= ~(std::uint64_t{1} << (i % 64));
}

// Calls f for the number of each bit that is set, ascending. The first bit of a single word is number `first`.
template <class F>
void for_each_bit(std::uint64_t word, std::size_t first, F&& f) {
    for (; word; word &= word - 1)
        f(static_cast<std::uint32_t>(first + static_cast<std::size_t>(std::countr_zero(word))));
}
template <class F>
void for_each_bit(std::span<const std::uint64_t> words, F&& f) {
    for (std::size_t word = 0; word < words.size(); ++word) for_each_bit(words[word], 64 * word, f);
}
// The same, descending.
template <class F>
void for_each_bit_down(std::uint64_t word, std::size_t first, F&& f) {
    while (word) {
        const int highest = 63 - std::countl_zero(word);
        word &= ~(std::uint64_t{1} << highest);
        f(static_cast<std::uint32_t>(first + static_cast<std::size_t>(highest)));
    }
}

} // namespace unseen::vdtree
