#include "terminal.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>

namespace unseen::app {
namespace {

void print_to_stderr(std::string_view kind, std::string_view text) {
    std::fprintf(stderr, "unseen: %.*s%.*s\n", static_cast<int>(kind.size()), kind.data(),
                 static_cast<int>(text.size()), text.data());
}

} // namespace

void print_warning(std::string_view text) { print_to_stderr("warning: ", text); }
void print_note(std::string_view text) { print_to_stderr("note: ", text); }
void print_error(std::string_view text) {
    const bool is_ended = text.ends_with('.') || text.ends_with('?');
    print_to_stderr("", std::string(text) + (is_ended ? "" : "."));
}

std::string grouped(std::uint64_t count) {
    const std::string digits = std::to_string(count);
    std::string text;
    for (std::size_t i = 0; i < digits.size(); ++i) {
        if (i > 0 && (digits.size() - i) % 3 == 0) text += ',';
        text += digits[i];
    }
    return text;
}

std::string rounded(double value, int significant) {
    if (std::isnan(value)) return "none";
    if (std::isinf(value)) return "infinite";
    std::array<char, 64> text;
    const auto result =
        std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, significant);
    return {text.data(), result.ptr};
}

std::string shortest(double value) {
    std::array<char, 64> text;
    return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

} // namespace unseen::app
