#include "terminal.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>

#include <printable.h>

namespace unseen::app {
namespace {

std::string_view program = "unseen";
std::vector<std::string> warnings;

void print_to_stderr(std::string_view kind, std::string_view text) {
    constexpr std::size_t longest = 2000; // bytes of a sentence: files may have names of any length in them
    const std::string line =
        std::string(program) + ": " + std::string(kind) + shortened(printable(text), longest) + "\n";
    std::fwrite(line.data(), 1, line.size(), stderr);
}

// Letters to insert, leave out, replace or swap with their neighbour (optimal string alignment).
std::size_t slips(std::string_view a, std::string_view b) {
    std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
    for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
    for (std::size_t k = 0; k <= b.size(); ++k) d[0][k] = k;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        for (std::size_t k = 1; k <= b.size(); ++k) {
            const bool is_other = a[i - 1] != b[k - 1];
            d[i][k] = std::min({d[i - 1][k] + 1, d[i][k - 1] + 1, d[i - 1][k - 1] + is_other});
            if (i > 1 && k > 1 && a[i - 1] == b[k - 2] && a[i - 2] == b[k - 1])
                d[i][k] = std::min(d[i][k], d[i - 2][k - 2] + 1);
        }
    }
    return d[a.size()][b.size()];
}

} // namespace

void name_program(std::string_view name) { program = name; }

void print_warning(std::string_view text) {
    warnings.emplace_back(text);
    print_to_stderr("warning: ", text);
}
const std::vector<std::string>& printed_warnings() { return warnings; }
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

std::string suggestion(std::string_view typed, const std::vector<std::string>& names) {
    constexpr std::size_t longest = 40, letters_a_slip = 3; // a third of the letters may be wrong
    if (typed.size() > longest) return {};
    std::size_t least = std::max<std::size_t>(1, typed.size() / letters_a_slip) + 1;
    const std::string* nearest = nullptr;
    for (const std::string& name : names) {
        const std::size_t count = slips(typed, name);
        if (count >= least) continue;
        least = count;
        nearest = &name;
    }
    return nearest ? ": did you mean '" + *nearest + "'?" : std::string();
}

} // namespace unseen::app
