// Bytes of numbers in the other order, for hosts whose numbers are not little-endian.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace unseen::vdtree {

inline void swap_components(std::byte* data, std::size_t bytes, std::size_t component) {
    if (component < 2) return;
    for (std::size_t i = 0; i + component <= bytes; i += component) std::reverse(data + i, data + i + component);
}

// Elements that begin with numbers of `component_bytes` each, `number_bytes` of them, and end with single bytes.
struct ElementLayout {
    std::size_t element_bytes, number_bytes, component_bytes;
};

// Swaps the numbers in a piece of an array of elements, from byte `at` of it on: elements may cross the ends of the
// piece, numbers may not.
inline void swap_elements(std::byte* data, std::size_t bytes, std::uint64_t at, const ElementLayout& layout) {
    const std::size_t component = layout.component_bytes;
    if (layout.number_bytes == layout.element_bytes) return swap_components(data, bytes, component);
    if (component < 2) return;
    for (std::size_t i = 0; i + component <= bytes; i += component)
        if ((at + i) % layout.element_bytes < layout.number_bytes) std::reverse(data + i, data + i + component);
}

} // namespace unseen::vdtree
