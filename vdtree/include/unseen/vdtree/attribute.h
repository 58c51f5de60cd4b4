// Named values that others keep with a tree: measurements, marks, whatever a file is to carry along.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <type_traits>

namespace unseen::vdtree {

// What an attribute has one value for. The numbers are those in files.
enum class AttributeDomain : std::uint32_t {
    tree = 1,          // the whole tree: any number of values
    interior_node = 2, // each interior node
    node = 3,          // each node, leaves included
};

inline constexpr std::size_t longest_attribute_name = 20; // characters
inline constexpr std::size_t most_attributes = 32;        // of one tree

// The size of the numbers that a value consists of, all of one size: what hosts of the other byte order swap in files.
// A struct names the type of its numbers as `Component`.
template <class T>
constexpr std::uint32_t attribute_component_bytes() {
    if constexpr (std::is_arithmetic_v<T>) return sizeof(T);
    else return attribute_component_bytes<typename T::Component>();
}

template <class T>
constexpr bool is_attribute_value() {
    return std::is_trivially_copyable_v<T> && alignof(T) <= 16 && sizeof(T) % attribute_component_bytes<T>() == 0;
}

struct AttributeInfo {
    std::string name; // 1 to 20 printable ASCII characters without spaces
    AttributeDomain domain = AttributeDomain::tree;
    std::uint32_t element_bytes = 1, component_bytes = 1;
    std::size_t count = 0; // of values
};

struct Attribute : AttributeInfo {
    std::shared_ptr<const void> owner; // of the bytes
    std::span<const std::byte> bytes;  // aligned to 16 bytes at least
};

} // namespace unseen::vdtree
