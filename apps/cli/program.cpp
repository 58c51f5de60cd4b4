#include "program.h"

#include <csignal>
#include <cstdio>
#include <exception>
#include <new>
#include <typeinfo>

#include "terminal.h"

namespace unseen::app {
namespace {

// The parser only says that a verb is missing.
std::string complaint_about_verb(const CLI::App& app, const Program& program, const CLI::ParseError& error) {
    const auto unknown = app.remaining();
    if (!unknown.empty()) {
        const auto hint = program.hints.find(unknown.front());
        const std::string why = hint == program.hints.end() ? "." : ": " + hint->second;
        return "there is no verb or option '" + unknown.front() + "'" + why;
    }
    if (error.get_name() != "RequiredError") return error.what();
    std::string some;
    const auto verbs = app.get_subcommands([](const CLI::App*) { return true; });
    constexpr std::size_t enough = 4;
    for (std::size_t i = 0; i < verbs.size() && i < enough; ++i) some += (i ? ", " : "") + verbs[i]->get_name();
    return "a verb is missing: " + some + (verbs.size() > enough ? ", ..." : "");
}

int report_usage(const CLI::App& app, const Program& program, const CLI::ParseError& error) {
    if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) return app.exit(error); // --help, --version
    print_error(app.get_subcommands().empty() ? complaint_about_verb(app, program, error) : error.what());
    std::string verb;
    for (auto verbs = app.get_subcommands(); !verbs.empty(); verbs = verbs.front()->get_subcommands())
        verb += " " + verbs.front()->get_name();
    std::fprintf(stderr, "Run '%s%s --help' for more information.\n", program.name, verb.c_str());
    return exit_usage;
}

int run(const std::vector<Command>& commands) {
    for (const Command& command : commands) {
        if (!command.parser->parsed()) continue;
        const auto status = command.run();
        if (!status) print_error(status.error().message);
        if (!status) return exit_failed;
        if (std::fflush(stdout) == 0 && !std::ferror(stdout)) return *status;
        print_error("cannot write to the standard output: is the disk full?");
        return exit_failed;
    }
    return exit_usage; // the parser insists on a verb
}

} // namespace

int run_program(int argc, char** argv, const Program& program, FunctionRef<std::vector<Command>(CLI::App&)> verbs) {
    std::signal(SIGXFSZ,
                SIG_IGN); // a file beyond the user's limit is an error like a full disk, and not the end without a word
    name_program(program.name);
    CLI::App app(program.about, program.name);
    app.footer(program.examples);
    app.set_version_flag("--version", std::string(program.name) + " " + program.version);
    app.require_subcommand(1);
    try {
        const std::vector<Command> commands = verbs(app);
        app.parse(argc, argv);
        return run(commands);
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

} // namespace unseen::app
