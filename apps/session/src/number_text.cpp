#include "number_text.h"

#include <array>
#include <charconv>
#include <cmath>

namespace unseen::session {

std::string grouped(std::uint64_t count) {
    std::string text = std::to_string(count);
    for (std::size_t place = text.size(); place > 3; place -= 3) text.insert(place - 3, ",");
    return text;
}

std::string rounded(double value, int significant) {
    if (std::isnan(value)) return "none";
    if (std::isinf(value)) return "infinite";
    std::array<char, 64> text;
    return {text.data(),
            std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, significant).ptr};
}

} // namespace unseen::session
