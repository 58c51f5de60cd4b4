// Names that stand in files: as messages show them, and as files with such names are called.
#pragma once

#include <cctype>
#include <charconv>
#include <cstddef>
#include <string>
#include <string_view>

namespace unseen {

// As it may stand in a message: quoted, without control characters, and cut if it is long.
inline std::string in_quotes(std::string_view text) {
    constexpr std::size_t longest = 40; // than any word of the formats; the rest of a longer one helps nobody
    std::string result = "'";
    for (const char c : text.substr(0, longest)) result += std::isprint(static_cast<unsigned char>(c)) ? c : '?';
    return result + (text.size() > longest ? "...'" : "'");
}

// A URI without its %20 and the like.
inline std::string decode_percent(std::string_view uri) {
    std::string decoded;
    for (std::size_t i = 0; i < uri.size(); ++i) {
        unsigned code = 0;
        const bool is_code = uri[i] == '%' && i + 2 < uri.size() &&
                             std::from_chars(&uri[i + 1], &uri[i + 1] + 2, code, 16).ptr == &uri[i + 1] + 2;
        decoded += is_code ? static_cast<char>(code) : uri[i];
        if (is_code) i += 2;
    }
    return decoded;
}

} // namespace unseen
