// What people read on the terminal: notes and warnings on stderr, numbers in words of people.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <unseen/vdtree/internal/number_format.h> // IWYU pragma: export

namespace unseen::app {

// The program that speaks, at the beginning of what is printed here; "unseen" unless it is said. For a literal.
void name_program(std::string_view name);

void print_warning(std::string_view text);          // "unseen: warning: ..." on stderr
const std::vector<std::string>& printed_warnings(); // all so far
void print_note(std::string_view text);             // "unseen: note: ..." on stderr
void print_error(std::string_view text);            // "unseen: ..." on stderr, with a full stop where there is none

// Names of files, and what stands in them, must not steer the terminal: control characters, and bytes that are no
// UTF-8, become \xNN. All that this header and report.h print goes through it.
std::string printable(std::string_view text);

// At most so many bytes of a printable text: long ones lose their middle, for which "..." stands.
std::string shortened(std::string text, std::size_t most_bytes);

std::string duration(double milliseconds);   // "0.05 ms", "620 ms", "61.8 s", "2 min 5 s"
std::string file_size(std::uintmax_t bytes); // "812 bytes", "1.2 MB"

// The name that a slip of the fingers may have become `typed`: ": did you mean 'simplify'?". Empty where none is near.
std::string suggestion(std::string_view typed, const std::vector<std::string>& names);

} // namespace unseen::app
