#include <unseen/vdtree/internal/number_format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>

namespace unseen {
namespace {

constexpr double smallest_written_out = 1e-6, largest_written_out = 1e15;

bool is_written_out(double value) {
    const double size = std::abs(value);
    return size == 0 || (size >= smallest_written_out && size < largest_written_out);
}

template <class... Format>
std::string text_of(double value, Format... format) {
    std::array<char, 64> text;
    return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value, format...).ptr};
}

// "-61800.5" -> "-61,800.5".
std::string with_groups(const std::string& digits) {
    const std::size_t begin = digits.starts_with('-') ? 1 : 0, end = std::min(digits.find('.'), digits.size());
    std::string text;
    for (std::size_t i = 0; i < digits.size(); ++i) {
        if (i > begin && i < end && (end - i) % 3 == 0) text += ',';
        text += digits[i];
    }
    return text;
}

std::string without_trailing_zeros(std::string digits) {
    if (digits.find('.') == std::string::npos) return digits;
    digits.erase(digits.find_last_not_of('0') + 1);
    if (digits.ends_with('.')) digits.pop_back();
    return digits;
}

} // namespace

std::string grouped(std::uint64_t count) { return with_groups(std::to_string(count)); }

std::string rounded(double value, int significant) {
    if (std::isnan(value)) return "none";
    if (std::isinf(value)) return "infinite";
    const std::string scientific = text_of(value, std::chars_format::scientific, significant - 1);
    const double nearest = std::strtod(scientific.c_str(), nullptr);
    if (!is_written_out(nearest)) return text_of(value, std::chars_format::general, significant);
    const int exponent = std::atoi(scientific.c_str() + scientific.find('e') + 1);
    return without_trailing_zeros(with_decimals(nearest, std::max(0, significant - 1 - exponent)));
}

std::string with_decimals(double value, int decimals) {
    if (!std::isfinite(value)) return rounded(value, 1);
    if (!(std::abs(value) < largest_written_out)) return text_of(value, std::chars_format::general, decimals + 1);
    return with_groups(text_of(value, std::chars_format::fixed, decimals));
}

std::string shortest(double value) {
    return std::isfinite(value) && is_written_out(value) ? text_of(value, std::chars_format::fixed) : text_of(value);
}

} // namespace unseen
