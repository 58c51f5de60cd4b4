#include <unseen/meshio/source_document.h>

#include <cmath>
#include <limits>

#include "value_types.h"

namespace unseen::meshio {

const char* name_of(ValueType type) {
    switch (type) {
    case ValueType::int8: return "int8";
    case ValueType::uint8: return "uint8";
    case ValueType::int16: return "int16";
    case ValueType::uint16: return "uint16";
    case ValueType::int32: return "int32";
    case ValueType::uint32: return "uint32";
    case ValueType::int64: return "int64";
    case ValueType::uint64: return "uint64";
    case ValueType::float32: return "float32";
    case ValueType::float64: break;
    }
    return "float64";
}

bool is_integer(ValueType type) { return type != ValueType::float32 && type != ValueType::float64; }

double VertexArray::number(std::size_t vertex, std::uint32_t component) const {
    return with_type(type, [&](auto tag) {
        using T = typename decltype(tag)::type;
        return static_cast<double>(load_value<T>(values.data() + vertex * tuple_bytes() + component * sizeof(T)));
    });
}

ValueRange range_of(const VertexArray& array, std::uint32_t component) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    ValueRange range{infinity, -infinity, 0};
    for (std::size_t v = 0; v < array.size(); ++v) {
        const double value = array.number(v, component);
        if (!std::isfinite(value)) {
            ++range.not_finite;
            continue;
        }
        range.low = std::min(range.low, value);
        range.high = std::max(range.high, value);
    }
    return range;
}

} // namespace unseen::meshio
