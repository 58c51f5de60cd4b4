// Words and numbers out of a text that lies in memory.
#pragma once

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <locale>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>

namespace unseen::meshio {

inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
inline bool is_newline(char c) { return c == '\n' || c == '\r'; }
inline bool is_space(char c) { return is_blank(c) || is_newline(c); }

inline bool equals_ignoring_case(std::string_view word, std::string_view lower) {
    return std::equal(word.begin(), word.end(), lower.begin(), lower.end(),
                      [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; });
}

// A digit of base64 as 0 to 63, or -1.
constexpr int base64_value(char c) {
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    if (c == '+' || c == '-') return 62; // the second of each pair: RFC 4648's alphabet for URLs
    if (c == '/' || c == '_') return 63;
    return -1;
}

// What a decimal number stands for that is too large for a double, or too small: infinity or 0, of its sign.
inline double out_of_range_number(std::string_view digits) {
    std::istringstream in{std::string(digits)};
    in.imbue(std::locale::classic());
    double value = 0;
    in >> value;
    return in ? value : std::copysign(std::numeric_limits<double>::infinity(), value);
}

// "1.#IND", "1.#QNAN", "1.#INF00": what C libraries of Windows printed for NaN and infinity. `end` is the end of "1.".
inline const char* parse_windows_nan(const char* end, const char* last, double& value) {
    if (end == last || *end != '#' || end[-1] != '.') return end;
    const std::string_view rest(end + 1, static_cast<std::size_t>(last - end - 1));
    if (rest.empty() || rest[0] < 'A' || rest[0] > 'Z') return end;
    value = rest.starts_with("INF") ? std::copysign(std::numeric_limits<double>::infinity(), value)
                                    : std::numeric_limits<double>::quiet_NaN();
    const std::size_t size = rest.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789");
    return end + 1 + std::min(size, rest.size());
}

// Parses a number at `first`, with an optional leading '+', which std::from_chars does not know. Returns the end of
// the number, or nullptr if there is none. Numbers too large become infinite, or the largest or smallest integer, which
// no index accepts; those too small become 0.
template <class Value>
const char* parse_number(const char* first, const char* last, Value& value) {
    if (first != last && *first == '+' && ++first != last && *first == '-') return nullptr;
    const auto [end, error] = std::from_chars(first, last, value);
    if (error == std::errc::invalid_argument) return nullptr;
    if constexpr (std::is_integral_v<Value>) {
        if (error == std::errc::result_out_of_range)
            value = *first == '-' ? std::numeric_limits<Value>::min() : std::numeric_limits<Value>::max();
        return end;
    } else {
        if (error == std::errc::result_out_of_range) value = out_of_range_number({first, end});
        return parse_windows_nan(end, last, value);
    }
}

// The whole word must be the number.
template <class Value>
bool to_number(std::string_view word, Value& value) {
    const char* last = word.data() + word.size();
    return parse_number(word.data(), last, value) == last;
}

// Lines before `position`, plus one; a lone CR counts as a newline. Linear: for messages only.
inline std::uint64_t line_number(std::string_view text, std::size_t position) {
    std::uint64_t line = 1;
    for (std::size_t i = 0; i < position && i < text.size(); ++i)
        if (text[i] == '\n' || (text[i] == '\r' && !(i + 1 < text.size() && text[i + 1] == '\n'))) ++line;
    return line;
}

// Cuts the next word off the front of a line; empty at its end.
inline std::string_view take_word(std::string_view& line) {
    std::size_t first = 0;
    while (first < line.size() && is_space(line[first])) ++first;
    std::size_t last = first;
    while (last < line.size() && !is_space(line[last])) ++last;
    const std::string_view word = line.substr(first, last - first);
    line.remove_prefix(last);
    return word;
}

inline std::string_view trimmed(std::string_view text) {
    while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
    while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
    return text;
}

// Lines ending in LF, CRLF or a lone CR, in any mixture.
class LineScanner {
public:
    explicit LineScanner(std::string_view text) : text_(text) {}

    // The next line without its newline; false at the end of the text.
    bool next(std::string_view& line) {
        if (position_ >= text_.size()) return false;
        // Both finds are remembered, so that a text without the one or the other is still scanned once.
        if (next_lf_ < position_ || line_ == 0) next_lf_ = std::min(text_.find('\n', position_), text_.size());
        if (next_cr_ < position_ || line_ == 0) next_cr_ = std::min(text_.find('\r', position_), text_.size());
        const std::size_t end = std::min(next_lf_, next_cr_);
        line = text_.substr(position_, end - position_);
        const bool is_crlf = end == next_cr_ && end + 1 == next_lf_ && next_lf_ < text_.size();
        position_ = std::min(end + (is_crlf ? 2 : 1), text_.size());
        ++line_;
        return true;
    }

    std::uint64_t line() const { return line_; } // of the line last returned, from 1
    std::size_t position() const { return position_; }

private:
    std::string_view text_;
    std::size_t position_ = 0;
    std::size_t next_lf_ = 0;
    std::size_t next_cr_ = 0;
    std::uint64_t line_ = 0;
};

// Words separated by white space, newlines included; optionally '#' starts a comment up to the end of the line.
class WordScanner {
public:
    WordScanner(std::string_view text, bool has_comments, std::size_t position = 0)
        : text_(text), position_(position), has_comments_(has_comments) {}

    // Empty at the end of the text.
    std::string_view next() {
        skip_space();
        return word();
    }

    // The next word of the present line; empty at its end, which is not passed.
    std::string_view next_in_line() {
        while (position_ < text_.size() && is_blank(text_[position_])) ++position_;
        if (position_ < text_.size() && has_comments_ && text_[position_] == '#') skip_line();
        return word();
    }

    // Moves to the newline that ends the present line.
    void skip_line() {
        while (position_ < text_.size() && !is_newline(text_[position_])) ++position_;
    }

    std::size_t position() const { return position_; }
    std::size_t remaining() const { return text_.size() - position_; }
    std::uint64_t line() const { return line_number(text_, position_); }

private:
    void skip_space() {
        while (position_ < text_.size())
            if (has_comments_ && text_[position_] == '#') skip_line();
            else if (is_space(text_[position_])) ++position_;
            else break;
    }
    std::string_view word() {
        const std::size_t first = position_;
        while (position_ < text_.size() && !is_space(text_[position_])) ++position_;
        return text_.substr(first, position_ - first);
    }

    std::string_view text_;
    std::size_t position_;
    bool has_comments_;
};

} // namespace unseen::meshio
