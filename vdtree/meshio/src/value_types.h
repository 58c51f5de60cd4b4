// Values whose type a file tells.
#pragma once

#include <array>
#include <bit>
#include <cstring>

#include <unseen/meshio/source_document.h>

#include "text_scanner.h"

namespace unseen::meshio {

static_assert(std::endian::native == std::endian::little, "Files are written as numbers lie in memory.");

// Calls f(std::type_identity<T>) with the type of the values.
template <class F>
decltype(auto) with_type(ValueType type, F&& f) {
    switch (type) {
    case ValueType::int8: return f(std::type_identity<std::int8_t>());
    case ValueType::uint8: return f(std::type_identity<std::uint8_t>());
    case ValueType::int16: return f(std::type_identity<std::int16_t>());
    case ValueType::uint16: return f(std::type_identity<std::uint16_t>());
    case ValueType::int32: return f(std::type_identity<std::int32_t>());
    case ValueType::uint32: return f(std::type_identity<std::uint32_t>());
    case ValueType::int64: return f(std::type_identity<std::int64_t>());
    case ValueType::uint64: return f(std::type_identity<std::uint64_t>());
    case ValueType::float32: return f(std::type_identity<float>());
    case ValueType::float64: break;
    }
    return f(std::type_identity<double>());
}

template <class T>
T load_value(const void* from, std::endian order = std::endian::native) {
    std::array<std::byte, sizeof(T)> raw;
    std::memcpy(raw.data(), from, raw.size());
    if (order != std::endian::native) std::reverse(raw.begin(), raw.end());
    return std::bit_cast<T>(raw);
}

template <class T>
void append_value(std::vector<std::byte>& to, T value) {
    const auto raw = std::bit_cast<std::array<std::byte, sizeof(T)>>(value);
    to.insert(to.end(), raw.begin(), raw.end());
}

// Between the host's byte order and another.
inline void change_order(std::span<std::byte> values, std::size_t value_bytes, std::endian order) {
    if (order == std::endian::native || value_bytes < 2) return;
    for (std::size_t i = 0; i + value_bytes <= values.size(); i += value_bytes)
        std::reverse(values.data() + i, values.data() + i + value_bytes);
}

// The values of an array of whole numbers. Those beyond 63 bits become the largest one, which is no index.
inline std::vector<std::int64_t> whole_numbers(const VertexArray& array) {
    std::vector<std::int64_t> numbers;
    numbers.reserve(array.values.size() / byte_size(array.type));
    with_type(array.type, [&](auto tag) {
        using T = typename decltype(tag)::type;
        for (std::size_t at = 0; at < array.values.size(); at += sizeof(T)) {
            if constexpr (std::is_integral_v<T>) {
                const T value = load_value<T>(array.values.data() + at);
                numbers.push_back(std::in_range<std::int64_t>(value) ? static_cast<std::int64_t>(value)
                                                                     : std::numeric_limits<std::int64_t>::max());
            }
        }
    });
    return numbers;
}

// False where the whole word is no number, or none of the type. Too large for a floating-point type becomes infinite.
template <class T>
bool parse_value(std::string_view word, T& value) {
    if (word.starts_with('+')) word.remove_prefix(1);
    const char* const last = word.data() + word.size();
    const auto [end, error] = std::from_chars(word.data(), last, value);
    if constexpr (std::is_floating_point_v<T>) {
        double special = 1;
        if (end != last && *end == '#' && to_number(word, special)) return value = static_cast<T>(special), true;
    }
    if (end != last || word.empty() || word.starts_with('+')) return false;
    if constexpr (std::is_floating_point_v<T>) {
        if (error == std::errc::result_out_of_range) value = static_cast<T>(out_of_range_number(word));
        return error == std::errc() || error == std::errc::result_out_of_range;
    }
    return error == std::errc();
}

} // namespace unseen::meshio
