// Equal vertices, found by hashing in expected linear time. The seed of the hash is random, so that no file can be made
// to collide; results do not depend on it.
#pragma once

#include <bit>
#include <limits>
#include <random>

#include <unseen/vdtree/mesh.h>

namespace unseen::meshio {

using namespace vdtree; // the types that are compared

// Mixes 64-bit words (the finaliser of MurmurHash3 after each).
class SeededHash {
public:
    static SeededHash random() {
        SeededHash hash;
        hash.state_ = (std::uint64_t{std::random_device{}()} << 32) | std::random_device{}();
        return hash;
    }

    SeededHash& add(std::uint64_t word) {
        state_ ^= word;
        state_ = (state_ ^ state_ >> 33) * 0xFF51AFD7ED558CCDu;
        state_ = (state_ ^ state_ >> 33) * 0xC4CEB9FE1A85EC53u;
        state_ ^= state_ >> 33;
        return *this;
    }
    SeededHash& add(const glm::dvec3& p) { // 0 and -0 are equal
        for (int i = 0; i < 3; ++i) add(std::bit_cast<std::uint64_t>(p[i] + 0.0));
        return *this;
    }
    std::uint64_t value() const { return state_; }

private:
    std::uint64_t state_ = 0;
};

// By bits, so that NaN is equal to itself.
template <class Vector>
bool has_same_bits(std::span<const Vector> values, std::size_t a, std::size_t b) {
    if (values.empty()) return true;
    for (int i = 0; i < Vector::length(); ++i)
        if (std::bit_cast<std::uint32_t>(values[a][i]) != std::bit_cast<std::uint32_t>(values[b][i])) return false;
    return true;
}
template <class Vector>
void add_bits(SeededHash& hash, std::span<const Vector> values, std::size_t at) {
    if (values.empty()) return;
    for (int i = 0; i < Vector::length(); ++i) hash.add(std::bit_cast<std::uint32_t>(values[at][i]));
}

// For each of `count` items the first one that is the same. `add_to(hash, i)` adds what `same(i, j)` compares.
template <class AddTo, class Same>
std::vector<Index> find_first_same(std::size_t count, AddTo&& add_to, Same&& same) {
    constexpr Index none = std::numeric_limits<Index>::max();
    const SeededHash seeded = SeededHash::random();
    std::vector<Index> table(std::bit_ceil(count + count / 2 + 1), none);
    std::vector<Index> first(count);
    for (std::size_t i = 0; i < count; ++i) {
        SeededHash hash = seeded;
        add_to(hash, i);
        std::size_t slot = hash.value() & (table.size() - 1);
        while (table[slot] != none && !same(table[slot], i)) slot = (slot + 1) & (table.size() - 1);
        if (table[slot] == none) table[slot] = static_cast<Index>(i);
        first[i] = table[slot];
    }
    return first;
}

// For each vertex the first one at its place. Positions must be finite.
inline std::vector<Index> find_first_at_place(std::span<const glm::dvec3> positions) {
    return find_first_same(
        positions.size(), [&](SeededHash& hash, std::size_t v) { hash.add(positions[v]); },
        [&](std::size_t a, std::size_t b) { return positions[a] == positions[b]; });
}

} // namespace unseen::meshio
