#include "rules.h"

#include "options.h"

namespace unseen::app {
namespace {

// "--show cost": the option, given with that value. Options of the setup lie in the program, not in the verb.
bool is_given(const CLI::App& verb, const std::string& words) {
    const std::size_t blank = words.find(' ');
    const CLI::Option* option = nullptr;
    for (const CLI::App* app = &verb; app && !option; app = app->get_parent())
        option = app->get_option_no_throw(words.substr(0, blank));
    if (!option || option->empty()) return false;
    return blank == words.npos || option->results().back() == words.substr(blank + 1);
}

} // namespace

void check_rules(const CLI::App& verb, std::span<const Rule> rules) {
    const auto given = [&](const std::string& option) { return is_given(verb, option); };
    for (const Rule& rule : rules) {
        if (!given(rule.option)) continue;
        const std::string why = rule.why.empty() ? "." : ": " + rule.why + ".";
        if (rule.kind == Rule::needs_one_of) {
            if (std::ranges::none_of(rule.others, given)) refuse(rule.option + " needs " + listed(rule.others) + why);
            continue;
        }
        for (const std::string& other : rule.others)
            if (given(other)) refuse(rule.option + " and " + other + " exclude each other" + why);
    }
}

} // namespace unseen::app
