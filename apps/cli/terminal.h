// What people read on the terminal: notes and warnings on stderr, numbers in words of people.
#pragma once

#include <string_view>

#include <vdtree/internal/number_format.h> // IWYU pragma: export

namespace unseen::app {

// The program that speaks, at the beginning of what is printed here; "unseen" unless it is said. For a literal.
void name_program(std::string_view name);

void print_warning(std::string_view text); // "unseen: warning: ..." on stderr
void print_note(std::string_view text);    // "unseen: note: ..." on stderr
void print_error(std::string_view text);   // "unseen: ..." on stderr, with a full stop where there is none

} // namespace unseen::app
