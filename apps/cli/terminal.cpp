#include "terminal.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>

namespace unseen::app {
namespace {

std::string_view program = "unseen";

void print_to_stderr(std::string_view kind, std::string_view text) {
    constexpr std::size_t longest = 2000; // bytes of a sentence: files may have names of any length in them
    const std::string line =
        std::string(program) + ": " + std::string(kind) + shortened(printable(text), longest) + "\n";
    std::fwrite(line.data(), 1, line.size(), stderr);
}

// Bytes of the printable character that the text begins with; 0: there is none.
std::size_t printable_bytes(std::string_view text) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const unsigned char first = byte(0);
    if (first < 0x80) return first >= 0x20 && first != 0x7f;
    const std::size_t length = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
    if (first < 0xc2 || first > 0xf4 || text.size() < length) return 0;
    char32_t code = first & (0xff >> (length + 1));
    for (std::size_t i = 1; i < length; ++i) {
        if ((byte(i) & 0xc0) != 0x80) return 0;
        code = code << 6 | (byte(i) & 0x3f);
    }
    constexpr std::array<char32_t, 5> least = {0, 0, 0xa0, 0x800, 0x10000}; // by length, less the controls below 0xa0
    const bool is_surrogate = code >= 0xd800 && code < 0xe000;
    return code >= least[length] && code <= 0x10ffff && !is_surrogate ? length : 0;
}

} // namespace

void name_program(std::string_view name) { program = name; }

void print_warning(std::string_view text) { print_to_stderr("warning: ", text); }
void print_note(std::string_view text) { print_to_stderr("note: ", text); }
void print_error(std::string_view text) {
    const bool is_ended = text.ends_with('.') || text.ends_with('?');
    print_to_stderr("", std::string(text) + (is_ended ? "" : "."));
}

std::string printable(std::string_view text) {
    std::string result;
    while (!text.empty()) {
        const std::size_t bytes = printable_bytes(text);
        if (bytes > 0) {
            result += text.substr(0, bytes);
        } else {
            constexpr const char* digits = "0123456789abcdef";
            const auto byte = static_cast<unsigned char>(text.front());
            result += {'\\', 'x', digits[byte >> 4], digits[byte & 15]};
        }
        text.remove_prefix(bytes > 0 ? bytes : 1);
    }
    return result;
}

std::string shortened(std::string text, std::size_t most_bytes) {
    if (text.size() <= most_bytes) return text;
    const auto is_inside = [&](std::size_t at) { return (static_cast<unsigned char>(text[at]) & 0xc0) == 0x80; };
    std::size_t begin = most_bytes / 2, end = text.size() - (most_bytes - 3 - begin);
    while (is_inside(begin)) --begin; // not in the middle of a letter
    while (end < text.size() && is_inside(end)) ++end;
    return text.replace(begin, end - begin, "...");
}

std::string duration(double milliseconds) {
    constexpr double second = 1000, minute = 60 * second;
    if (!(milliseconds >= second)) return rounded(milliseconds, milliseconds < 1 ? 2 : 3) + " ms";
    if (milliseconds < 2 * minute) return rounded(milliseconds / second, 3) + " s";
    const auto seconds = static_cast<std::uint64_t>(std::lround(milliseconds / second));
    return grouped(seconds / 60) + " min " + std::to_string(seconds % 60) + " s";
}

std::string file_size(std::uintmax_t bytes) {
    constexpr std::array units = {"kB", "MB", "GB", "TB"};
    if (bytes < 1000) return std::to_string(bytes) + " bytes";
    double size = static_cast<double>(bytes) / 1000;
    std::size_t unit = 0;
    for (; size >= 999.5 && unit + 1 < units.size(); ++unit) size /= 1000;
    return rounded(size, size < 100 ? 2 : 3) + " " + units[unit];
}

} // namespace unseen::app
