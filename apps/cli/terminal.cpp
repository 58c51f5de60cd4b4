#include "terminal.h"

#include <cstdio>
#include <string>

namespace unseen::app {
namespace {

std::string_view program = "unseen";

void print_to_stderr(std::string_view kind, std::string_view text) {
    std::fprintf(stderr, "%.*s: %.*s%.*s\n", static_cast<int>(program.size()), program.data(),
                 static_cast<int>(kind.size()), kind.data(), static_cast<int>(text.size()), text.data());
}

} // namespace

void name_program(std::string_view name) { program = name; }

void print_warning(std::string_view text) { print_to_stderr("warning: ", text); }
void print_note(std::string_view text) { print_to_stderr("note: ", text); }
void print_error(std::string_view text) {
    const bool is_ended = text.ends_with('.') || text.ends_with('?');
    print_to_stderr("", std::string(text) + (is_ended ? "" : "."));
}

} // namespace unseen::app
