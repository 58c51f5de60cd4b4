#include "program.h"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <new>
#include <span>
#include <string_view>
#include <typeinfo>

#include <poll.h>
#include <unistd.h>

#include "interruption.h"
#include "option_names.h"
#include "output_files.h"
#include "suggestion.h"
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

std::string complaint_about(const std::string& word, const CLI::App& app, const Program& program) {
    const bool is_option = word.starts_with("-");
    const bool takes_verbs = !parts_of(app, true).empty();
    if (!is_option && !takes_verbs) return "'" + word + "' is one word too many.";
    const auto hint = program.hints.find(word);
    if (hint != program.hints.end()) return "there is no verb or option '" + word + "': " + hint->second;
    const std::string near =
        suggestion(word.substr(0, word.find('=')), is_option ? names_of_options(app) : verb_names(app));
    return std::string("there is no ") + (is_option ? "option '" : "verb '") + word + "'" + (near.empty() ? "." : near);
}

// What the parser could not place comes first: it may be why something else is missing.
std::string complaint(const CLI::App& app, const Program& program, const CLI::ParseError& error) {
    const bool is_missing = error.get_exit_code() == static_cast<int>(CLI::ExitCodes::RequiredError);
    if (!is_missing && error.get_exit_code() != static_cast<int>(CLI::ExitCodes::ExtrasError)) return error.what();
    const bool takes_verbs = !parts_of(app, true).empty();
    const auto unknown = app.remaining();
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
    print_error(complaint(last_parsed(app), program, error));
    std::string verb;
    for (auto verbs = app.get_subcommands(); !verbs.empty(); verbs = verbs.front()->get_subcommands())
        verb += " " + verbs.front()->get_name();
    std::fprintf(stderr, "Run '%s%s --help' for more information.\n", program.name, verb.c_str());
    return exit_usage;
}

// `help VERB ...`, which people type, too.
int help(const CLI::App& app, const Program& program, std::span<char* const> words) {
    const CLI::App* verb = &app;
    std::string parents;
    for (const std::string word : words) {
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
void refuse_empty_values(std::span<char* const> words) {
    for (std::size_t i = 1; i < words.size(); ++i) {
        const std::string_view word = words[i];
        const bool is_assigned = word.starts_with("--") && word.ends_with("=");
        if (!word.empty() && !is_assigned) continue;
        const std::string_view option = is_assigned ? word.substr(0, word.size() - 1) : words[i - 1];
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
        if (argc > 1 && std::string_view(argv[1]) == "help")
            return help(app, program, std::span<char* const>(argv, static_cast<std::size_t>(argc)).subspan(2));
        refuse_empty_values(std::span(argv, static_cast<std::size_t>(argc)));
        app.parse(argc, argv);
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
