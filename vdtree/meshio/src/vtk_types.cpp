#include "vtk_types.h"

#include <array>

namespace unseen::meshio {

namespace {

struct TypeNames {
    ValueType type;
    const char *vtp, *legacy;
};

constexpr std::array<TypeNames, 10> vtk_type_names{{{ValueType::int8, "Int8", "char"},
                                                    {ValueType::uint8, "UInt8", "unsigned_char"},
                                                    {ValueType::int16, "Int16", "short"},
                                                    {ValueType::uint16, "UInt16", "unsigned_short"},
                                                    {ValueType::int32, "Int32", "int"},
                                                    {ValueType::uint32, "UInt32", "unsigned_int"},
                                                    {ValueType::int64, "Int64", "vtktypeint64"},
                                                    {ValueType::uint64, "UInt64", "vtktypeuint64"},
                                                    {ValueType::float32, "Float32", "float"},
                                                    {ValueType::float64, "Float64", "double"}}};

const TypeNames& names_of_type(ValueType type) { return vtk_type_names[static_cast<std::size_t>(type) - 1]; }

} // namespace

std::optional<ValueType> vtp_type(std::string_view name) {
    for (const TypeNames& names : vtk_type_names)
        if (name == names.vtp) return names.type;
    return std::nullopt;
}

std::optional<ValueType> legacy_type(std::string_view name) {
    for (const TypeNames& names : vtk_type_names)
        if (name == names.legacy) return names.type;
    if (name == "signed_char") return ValueType::int8;
    if (name == "vtkidtype") return ValueType::int32; // as which it is written
    if (name == "long") return ValueType::int64;      // of Unix; Windows writes 32 bits under this name
    if (name == "unsigned_long") return ValueType::uint64;
    return std::nullopt;
}

const char* vtp_name(ValueType type) { return names_of_type(type).vtp; }
const char* legacy_name(ValueType type) { return names_of_type(type).legacy; }

} // namespace unseen::meshio
