// Types of values by the names that VTK's XML gives them.
#pragma once

#include <array>
#include <optional>
#include <string_view>

#include <unseen/meshio/source_document.h>

namespace unseen::meshio {

inline constexpr std::array<const char*, 10> vtp_names{"Int8",   "UInt8", "Int16",  "UInt16",  "Int32",
                                                       "UInt32", "Int64", "UInt64", "Float32", "Float64"};

inline const char* vtp_name(ValueType type) { return vtp_names[static_cast<std::size_t>(type) - 1]; }

// Nothing for types that hold no numbers of whole bytes: Bit, String.
inline std::optional<ValueType> vtp_type(std::string_view name) {
    for (std::size_t i = 0; i < vtp_names.size(); ++i)
        if (name == vtp_names[i]) return static_cast<ValueType>(i + 1);
    return std::nullopt;
}

} // namespace unseen::meshio
