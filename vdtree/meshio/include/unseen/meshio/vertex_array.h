// Values that a mesh file has for its vertices beside positions, normals, colours and texture coordinates: scalars of a
// simulation, labels, numbers. They go with a tree in a SourceDocument, and cuts are written with them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace unseen::meshio {

// The numbers are those in files.
enum class ValueType : std::uint32_t {
    int8 = 1,
    uint8 = 2,
    int16 = 3,
    uint16 = 4,
    int32 = 5,
    uint32 = 6,
    int64 = 7,
    uint64 = 8,
    float32 = 9,
    float64 = 10
};

constexpr std::size_t byte_size(ValueType type) {
    constexpr std::size_t sizes[] = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
    return sizes[static_cast<std::size_t>(type) - 1];
}
const char* name_of(ValueType type); // "int8", "float32", ...
bool is_integer(ValueType type);

struct VertexArray {
    // What the mesh has taken from it. Of all but `value` only the name is kept here, and the values are the mesh's.
    enum class Role : std::uint32_t { value = 0, normals = 1, colours = 2, uvs = 3 };

    std::string name;
    ValueType type = ValueType::float32;
    std::uint32_t components = 1; // at least
    Role role = Role::value;
    std::vector<std::byte> values = {}; // by vertex its components, in the host's byte order

    std::size_t tuple_bytes() const { return byte_size(type) * components; }
    std::size_t size() const { return values.size() / tuple_bytes(); } // vertices
    // Preconditions: vertex < size(), component < components. 64-bit integers are rounded.
    double number(std::size_t vertex, std::uint32_t component = 0) const;
};

// Of the finite values of one component; low is above high where there are none.
struct ValueRange {
    double low = 0, high = 0;
    std::uint64_t not_finite = 0; // values that are NaN or infinite
};
ValueRange range_of(const VertexArray& array, std::uint32_t component);

} // namespace unseen::meshio
