// What people read on the terminal: notes and warnings on stderr, numbers in words of people.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace unseen::app {

void print_warning(std::string_view text); // "unseen: warning: ..." on stderr
void print_note(std::string_view text);    // "unseen: note: ..." on stderr
void print_error(std::string_view text);   // "unseen: ..." on stderr, with a full stop where there is none

std::string grouped(std::uint64_t count);           // 69666 -> "69,666"
std::string rounded(double value, int significant); // shortest of so many digits; "infinite" and "none" (NaN) in words
std::string shortest(double value);                 // as many digits as needed to read the same value again

} // namespace unseen::app
