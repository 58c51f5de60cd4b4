// Types of VTK by the names that its two file formats give them.
#pragma once

#include <optional>
#include <string_view>

#include <unseen/meshio/vertex_array.h>

namespace unseen::meshio {

// Nothing for those that hold no numbers of whole bytes: Bit, String.
std::optional<ValueType> vtp_type(std::string_view name);    // Int8, Float32, ...
std::optional<ValueType> legacy_type(std::string_view name); // char, float, vtktypeint64, ...; in small letters
const char* vtp_name(ValueType type);
const char* legacy_name(ValueType type);

} // namespace unseen::meshio
