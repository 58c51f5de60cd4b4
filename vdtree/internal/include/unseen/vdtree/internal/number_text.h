// Numbers from text and back, without locales.
#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>

namespace unseen {

// The number that the whole text is, with an optional leading '+', which std::from_chars does not know. Nothing where
// there is more or less than a number, or one beyond the type's range. "inf" and "nan" are taken.
template <class Number>
std::optional<Number> number_from(std::string_view text) {
    if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
    Number value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return value;
}

// The same, and finite.
inline std::optional<double> finite_from(std::string_view text) {
    const auto value = number_from<double>(text);
    return value && std::isfinite(*value) ? value : std::nullopt;
}

// Without spaces, tabs and carriage returns at both ends.
inline std::string_view trimmed(std::string_view text) {
    constexpr std::string_view blanks = " \t\r";
    const std::size_t first = text.find_first_not_of(blanks);
    return first == text.npos ? std::string_view() : text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

// The shortest text that reads back as the same number.
inline std::string number_text(double value) {
    std::array<char, 32> text;
    return std::string(text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr);
}

} // namespace unseen
