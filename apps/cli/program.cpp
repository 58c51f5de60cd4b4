#include "program.h"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <iterator>
#include <new>
#include <string_view>
#include <typeinfo>

#include <poll.h>
#include <unistd.h>

#include "interruption.h"
#include "option_names.h"
#include "output_files.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using Apps = std::vector<const CLI::App*>;

// Verbs, or the nameless groups of options.
Apps parts_of(const CLI::App& app, bool named) {
    return app.get_subcommands([named](const CLI::App* part) { return part->get_name().empty() != named; });
}

std::vector<std::string> verb_names(const CLI::App& app) {
    std::vector<std::string> names;
    for (const CLI::App* verb : parts_of(app, true)) names.push_back(verb->get_name());
    return names;
}

std::vector<std::string> names_of_options(const CLI::App& app) {
    std::vector<std::string> names;
    for (const CLI::Option* option : app.get_options())
        for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    for (const CLI::App* group : parts_of(app, false)) {
        const auto more = names_of_options(*group);
        names.insert(names.end(), more.begin(), more.end());
    }
    return names;
}

// The verb that was found last; at first the program.
const CLI::App& last_parsed(const CLI::App& app) {
    const auto verbs = app.get_subcommands();
    return verbs.empty() ? app : last_parsed(*verbs.front());
}

// The verbs that have an option, by their full names: "study make".
std::vector<std::string> owners_of(const std::string& option, const CLI::App& app, const std::string& name) {
    std::vector<std::string> owners;
    if (!name.empty() && app.get_option_no_throw(option)) owners.push_back(name);
    for (const CLI::App* verb : parts_of(app, true))
        for (const std::string& owner :
             owners_of(option, *verb, name.empty() ? verb->get_name() : name + " " + verb->get_name()))
            owners.push_back(owner);
    return owners;
}

const CLI::App& root_of(const CLI::App& app) { return app.get_parent() ? root_of(*app.get_parent()) : app; }

std::string complaint_about_option(const std::string& word, const CLI::App& app, const Program& program) {
    const std::string option = word.substr(0, word.find('='));
    std::vector<std::string> owners = owners_of(option, root_of(app), "");
    if (!owners.empty()) {
        constexpr std::size_t enough = 3;
        owners.resize(std::min(owners.size(), enough));
        for (std::string& owner : owners) owner = std::string("'") + program.name + " " + owner + "'";
        return "there is no option '" + word + "' here; see " + listed(owners) + ".";
    }
    std::vector<std::string> names = names_of_options(app);
    if (program.setup && *program.setup) std::ranges::copy((*program.setup)->names_in(app), std::back_inserter(names));
    const std::string near = suggestion(option, names);
    return "there is no option '" + word + "'" + (near.empty() ? "." : near);
}

std::string complaint_about(const std::string& word, const CLI::App& app, const Program& program) {
    const bool takes_verbs =
        !parts_of(app, true).empty() && app.get_options([](auto* option) { return option->get_positional(); }).empty();
    const auto hint = program.hints.find(word);
    if (hint != program.hints.end()) return "there is no verb or option '" + word + "': " + hint->second;
    if (word.starts_with("-")) return complaint_about_option(word, app, program);
    if (!takes_verbs) return "'" + word + "' is one word too many.";
    std::string near = suggestion(word, verb_names(app));
    std::error_code unknown;
    if (program.verb_for_files && (word.find('.') != word.npos || std::filesystem::exists(word, unknown)))
        near = std::string(": did you mean '") + program.name + " " + program.verb_for_files + " " + word + "'?";
    return "there is no verb '" + word + "'" + (near.empty() ? "." : near);
}

// What the parser could not place comes first: it may be why something else is missing. With options of the whole
// program, what a verb does not know ends up at the program.
std::string complaint(const CLI::App& root, const Program& program, const CLI::ParseError& error) {
    const CLI::App& app = last_parsed(root);
    const bool is_missing = error.get_exit_code() == static_cast<int>(CLI::ExitCodes::RequiredError);
    if (!is_missing && error.get_exit_code() != static_cast<int>(CLI::ExitCodes::ExtrasError)) return error.what();
    const bool takes_verbs = !parts_of(app, true).empty();
    const auto unknown = root.remaining(true);
    const auto option = std::find_if(unknown.begin(), unknown.end(), [](auto& word) { return word.starts_with("-"); });
    if (!unknown.empty())
        return complaint_about(takes_verbs || option == unknown.end() ? unknown.front() : *option, app, program);
    if (!is_missing || !takes_verbs) return error.what();
    std::string some;
    const auto verbs = verb_names(app);
    constexpr std::size_t enough = 4;
    for (std::size_t i = 0; i < verbs.size() && i < enough; ++i) some += (i ? ", " : "") + verbs[i];
    return "a verb is missing: " + some + (verbs.size() > enough ? ", ..." : "");
}

// Brings out what was printed. The files of a run that comes so far are written.
int finish(int status) {
    if (std::fflush(stdout) == 0 && !std::ferror(stdout)) return status;
    pollfd out{STDOUT_FILENO, 0, 0};
    const bool is_closed = ::poll(&out, 1, 0) == 1 && (out.revents & POLLERR);
    std::string kept;
    for (const std::string& file : written_outputs()) kept += (kept.empty() ? " Written: " : ", ") + file;
    print_error("cannot write to the standard output: " +
                std::string(is_closed ? "who reads it has closed it." : "is the disk full?") + kept);
    return exit_failed;
}

int report_usage(const CLI::App& app, const Program& program, const CLI::ParseError& error) {
    if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) // --help, --version
        return finish(app.exit(error));
    print_error(complaint(app, program, error));
    std::string verb;
    for (auto verbs = app.get_subcommands(); !verbs.empty(); verbs = verbs.front()->get_subcommands())
        verb += " " + verbs.front()->get_name();
    std::fprintf(stderr, "Run '%s%s --help' for more information.\n", program.name, verb.c_str());
    return exit_usage;
}

// Every option that is no silent alias, a line each: "render --show"; of the setup, where it acts, "render --eye setup".
void print_options(const CLI::App& app, const std::string& verb, const Setup* setup) {
    const auto is_shown = [&](const CLI::Option* option) {
        return option->nonpositional() && !option->get_group().empty() && option != app.get_help_ptr();
    };
    if (!verb.empty())
        for (const CLI::Option* option : app.get_options(is_shown))
            std::printf("%s %s\n", verb.c_str(), option->get_name().c_str());
    if (setup)
        for (const std::string& name : setup->names_in(app)) std::printf("%s %s setup\n", verb.c_str(), name.c_str());
    for (const CLI::App* part : parts_of(app, false)) print_options(*part, verb, nullptr);
    for (const CLI::App* part : parts_of(app, true))
        print_options(*part, verb.empty() ? part->get_name() : verb + "-" + part->get_name(), setup);
}

// `help VERB ...`, which people type, too; `help setup`; and for scripts `help --options`.
int help(const CLI::App& app, const Program& program, const std::vector<std::string>& words) {
    const bool has_setup = program.setup && *program.setup;
    if (words == std::vector<std::string>{"--options"}) {
        print_options(app, "", has_setup ? &**program.setup : nullptr);
        if (has_setup)
            for (const std::string& name : (*program.setup)->names()) std::printf("setup %s\n", name.c_str());
        return finish(exit_done);
    }
    if (has_setup && words == std::vector<std::string>{"setup"}) {
        std::fputs((*program.setup)->help().c_str(), stdout);
        return finish(exit_done);
    }
    const CLI::App* verb = &app;
    std::string parents;
    for (const std::string& word : words) {
        const Apps verbs = parts_of(*verb, true);
        const auto next = std::find_if(verbs.begin(), verbs.end(), [&](auto* v) { return v->get_name() == word; });
        if (next == verbs.end()) {
            print_error(complaint_about(word, *verb, program));
            return exit_usage;
        }
        parents += (parents.empty() ? "" : " ") + verb->get_name();
        verb = *next;
    }
    std::fputs(verb->help(parents).c_str(), stdout);
    return finish(exit_done);
}

// What of the setup acts in a verb goes before its examples.
void add_setup_to_help(CLI::App& app, const Setup& setup) {
    for (CLI::App* verb : app.get_subcommands([](const CLI::App* part) { return !part->get_name().empty(); })) {
        const std::string summary = setup.summary_of(*verb);
        if (!summary.empty()) verb->footer(summary + "\n" + verb->get_footer());
        add_setup_to_help(*verb, setup);
    }
}

void check(const CLI::App& app, const Program& program, const std::vector<Command>& commands) {
    const CLI::App& verb = last_parsed(app);
    if (program.setup && *program.setup) (*program.setup)->check(verb);
    for (const Command& command : commands)
        if (command.parser->parsed()) check_rules(*command.parser, command.rules);
}

int run(const std::vector<Command>& commands) {
    for (const Command& command : commands) {
        if (!command.parser->parsed()) continue;
        const auto status = command.run();
        end_if_interrupted();
        if (status) return finish(*status);
        print_error(with_option_names(with_file_name(status.error())));
        return exit_failed;
    }
    return exit_usage; // the parser insists on a verb
}

// A variable of a shell that is not set must not look like an option that is not given.
void refuse_empty_values(const std::vector<std::string>& words) {
    for (std::size_t i = 0; i < words.size(); ++i) {
        const std::string_view word = words[i];
        const bool is_assigned = word.starts_with("--") && word.ends_with("=");
        if (!word.empty() && !is_assigned) continue;
        const std::string_view option = is_assigned ? word.substr(0, word.size() - 1) : words[i == 0 ? 0 : i - 1];
        throw CLI::ValidationError(option.starts_with("-") ? std::string(option) + " has an empty value: give one, or "
                                                                                   "leave the option out."
                                                           : "a word is empty: leave it out.");
    }
}

int run(int argc, char** argv, const Program& program, const FunctionRef<std::vector<Command>(CLI::App&)>& verbs) {
    CLI::App app(program.about, program.name);
    app.footer(program.examples);
    app.set_version_flag("--version", std::string(program.name) + " " + program.version);
    app.require_subcommand(1);
    // Ends after the options were read: tests check with it that the documentation's commands are accepted.
    const CLI::Option* parse_only = app.add_flag("--parse-only")->group("");
    try {
        const std::vector<Command> commands = verbs(app);
        if (program.setup && *program.setup) add_setup_to_help(app, **program.setup);
        std::vector<std::string> words(argv + 1, argv + std::max(argc, 1));
        if (!words.empty() && words.front() == "help") return help(app, program, {words.begin() + 1, words.end()});
        if (program.renew) program.renew(words);
        refuse_empty_values(words);
        app.parse(std::vector<std::string>(words.rbegin(), words.rend())); // which takes them from the end
        check(app, program, commands);
        return parse_only->count() > 0 ? exit_done : run(commands);
    } catch (const CLI::ParseError& error) {
        return report_usage(app, program, error);
    } catch (const std::bad_alloc& error) {
        const bool says_nothing =
            typeid(error) == typeid(std::bad_alloc) || typeid(error) == typeid(std::bad_array_new_length);
        print_error(says_nothing ? "there is not enough memory for this." : error.what());
    } catch (const std::exception& error) {
        print_error(error.what());
    }
    return exit_failed;
}

} // namespace

int run_program(int argc, char** argv, const Program& program,
                const FunctionRef<std::vector<Command>(CLI::App&)>& verbs) {
    // A file beyond the user's limit is an error like a full disk, and so is a pipe that nobody reads any more: not the
    // end without a word.
    for (const int signal : {SIGXFSZ, SIGPIPE}) std::signal(signal, SIG_IGN);
    clean_up_on_signals();
    name_program(program.name);
    const int status = run(argc, argv, program, verbs);
    if (status != exit_done) remove_empty_made_folders();
    return status;
}

} // namespace unseen::app
