#include "numbered_pictures.h"

#include "output_files.h"

namespace unseen::app {
namespace {

constexpr std::size_t most_digits = 9; // of a frame's number in a file name

} // namespace

std::optional<NamePattern> parse_pattern(const std::string& pattern) {
    const std::size_t begin = pattern.find('%');
    if (begin == std::string::npos || pattern.find_first_of("%/", begin + 1) != std::string::npos) return std::nullopt;
    std::size_t end = begin + 1;
    while (end < pattern.size() && pattern[end] >= '0' && pattern[end] <= '9') ++end;
    if (end == pattern.size() || pattern[end] != 'd' || end - begin > 3) return std::nullopt;
    NamePattern result{pattern.substr(0, begin), pattern.substr(end + 1), 0};
    if (end > begin + 1)
        result.digits = static_cast<std::size_t>(std::stoi(pattern.substr(begin + 1, end - begin - 1)));
    return result.digits <= most_digits ? std::optional(result) : std::nullopt;
}

std::string complaint_about_picture_names(const std::string& pattern) {
    if (parse_pattern(pattern) && has_ending(pattern, ".png")) return {};
    return "-o must be a name with one %d or %04d for the frame's number, not in its folder's name, and "
           "end in .png, not '" +
           pattern + "'.";
}

} // namespace unseen::app
