// Which options of a verb go together: a table for each verb, checked after the parse.
#pragma once

#include <span>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace unseen::app {

// Options are named as people give them: "--show", or with a value, "--show cost".
struct Rule {
    enum Kind { needs_one_of, excludes };
    std::string option;
    Kind kind;
    std::vector<std::string> others;
    std::string why = {}; // a clause, where the sentence without it would not be understood
};

// Ends the parse with a sentence where a rule is broken.
void check_rules(const CLI::App& verb, std::span<const Rule> rules);

} // namespace unseen::app
