// The command `unseen`: finds the verb, runs it, and says in one sentence what went wrong.
#include <csignal>
#include <cstdio>
#include <exception>
#include <new>
#include <string>
#include <vector>

#include "command.h"
#include "option_names.h"
#include "paged_memory.h"
#include "terminal.h"

namespace {

using namespace unseen::app;

constexpr const char* about =
    "Unseen simplifies meshes where nobody can see it: view-dependent, by what a human eye perceives on a display.";
constexpr const char* examples = R"(Examples:
  unseen build bunny.ply -o bunny.vdt
  unseen render bunny.vdt -o bunny.png
  unseen simplify bunny.vdt --triangles 5000 -o small.ply
  unseen sheet bunny.vdt -o sheet.png
  unseen view bunny.vdt

'unseen VERB --help' tells more. Exit status: 0 done, 1 failed, 2 wrong usage.)";

// The parser only says that a verb is missing.
std::string complaint_about_verb(const CLI::App& app, const CLI::ParseError& error) {
    const auto unknown = app.remaining();
    if (!unknown.empty()) return "there is no verb or option '" + unknown.front() + "'.";
    return error.get_name() == "RequiredError" ? "a verb is missing: build, info, simplify, render, ..." : error.what();
}

int report_usage(const CLI::App& app, const CLI::ParseError& error) {
    if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) return app.exit(error); // --help, --version
    print_error(app.get_subcommands().empty() ? complaint_about_verb(app, error) : error.what());
    std::string verb;
    for (auto verbs = app.get_subcommands(); !verbs.empty(); verbs = verbs.front()->get_subcommands())
        verb += " " + verbs.front()->get_name();
    std::fprintf(stderr, "Run 'unseen%s --help' for more information.\n", verb.c_str());
    return exit_usage;
}

int run(const std::vector<Command>& commands) {
    for (const Command& command : commands) {
        if (!command.parser->parsed()) continue;
        const auto status = command.run();
        if (!status) print_error(with_option_names(status.error().message));
        if (!status) return exit_failed;
        if (std::fflush(stdout) == 0 && !std::ferror(stdout)) return *status;
        print_error("cannot write to the standard output: is the disk full?");
        return exit_failed;
    }
    return exit_usage; // the parser insists on a verb
}

} // namespace

int main(int argc, char** argv) {
    std::signal(SIGXFSZ, SIG_IGN); // a file beyond the user's limit is an error like a full disk, and not the end without a word
    CLI::App app(about, "unseen");
    app.footer(examples);
    app.set_version_flag("--version", "unseen " UNSEEN_VERSION);
    app.require_subcommand(1);
    try {
        const std::vector<Command> commands = {build_command(app),  info_command(app),  simplify_command(app),
                                               render_command(app), sheet_command(app), compare_command(app),
                                               csf_command(app),    calibrate_command(app),
                                               view_command(app),  make_command(app),
                                               bench_command(app)};
        app.parse(argc, argv);
        return run(commands);
    } catch (const CLI::ParseError& error) {
        return report_usage(app, error);
    } catch (const DiskFull& error) {
        print_error(error.what());
    } catch (const std::bad_alloc&) {
        print_error("there is not enough memory for this.");
    } catch (const std::exception& error) {
        print_error(error.what());
    }
    return exit_failed;
}
