// Properties of PLY's vertices that have a meaning.
#pragma once

#include <cstdint>
#include <string_view>

namespace unseen::meshio::ply {

// Where a property of vertices goes. `ignored` must be last: it is a slot like the others.
enum Slot : std::uint8_t { x, y, z, nx, ny, nz, red, green, blue, alpha, u, v, ignored, slot_count };

inline Slot slot_of(std::string_view property) {
    struct Name {
        std::string_view name;
        Slot slot;
    };
    constexpr Name names[] = {{"x", x},
                              {"y", y},
                              {"z", z},
                              {"nx", nx},
                              {"ny", ny},
                              {"nz", nz},
                              {"red", red},
                              {"green", green},
                              {"blue", blue},
                              {"alpha", alpha},
                              {"r", red},
                              {"g", green},
                              {"b", blue},
                              {"diffuse_red", red},
                              {"diffuse_green", green},
                              {"diffuse_blue", blue},
                              {"s", u},
                              {"t", v},
                              {"u", u},
                              {"v", v},
                              {"texture_u", u},
                              {"texture_v", v},
                              {"texture_s", u},
                              {"texture_t", v}};
    for (const Name& candidate : names)
        if (property == candidate.name) return candidate.slot;
    return ignored;
}

} // namespace unseen::meshio::ply
