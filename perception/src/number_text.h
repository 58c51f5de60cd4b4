// Private to perception: numbers in messages.
#pragma once

#include <array>
#include <charconv>
#include <string>

namespace unseen::perception {

// The shortest text that reads back as the same number.
inline std::string number(double value) {
    std::array<char, 32> text;
    return std::string(text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr);
}

} // namespace unseen::perception
