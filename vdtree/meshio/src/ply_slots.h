// Names in PLY: of types, and of those properties of vertices that have a meaning.
#pragma once

#include <unseen/meshio/source_document.h>

namespace unseen::meshio::ply {

// Empty: PLY has no such type.
constexpr std::string_view classic_name(ValueType type) {
    constexpr std::string_view names[] = {"char", "uchar", "short", "ushort", "int", "uint", "", "", "float", "double"};
    return names[static_cast<std::size_t>(type) - 1];
}

// Where a property of vertices goes. `ignored` must be last: it is a slot like the others.
enum Slot : std::uint8_t { x, y, z, nx, ny, nz, red, green, blue, alpha, u, v, ignored, slot_count };

inline Slot slot_of(std::string_view property) {
    using Name = std::pair<std::string_view, Slot>;
    for (const auto& [name, slot] : {Name("x", x),
                                     Name("y", y),
                                     Name("z", z),
                                     Name("nx", nx),
                                     Name("ny", ny),
                                     Name("nz", nz),
                                     Name("red", red),
                                     Name("green", green),
                                     Name("blue", blue),
                                     Name("alpha", alpha),
                                     Name("r", red),
                                     Name("g", green),
                                     Name("b", blue),
                                     Name("diffuse_red", red),
                                     Name("diffuse_green", green),
                                     Name("diffuse_blue", blue),
                                     Name("s", u),
                                     Name("t", v),
                                     Name("u", u),
                                     Name("v", v),
                                     Name("texture_u", u),
                                     Name("texture_v", v),
                                     Name("texture_s", u),
                                     Name("texture_t", v)})
        if (property == name) return slot;
    return ignored;
}

} // namespace unseen::meshio::ply
