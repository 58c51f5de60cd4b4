// The command `unseen`.
#include <optional>
#include <string>

#include "old_spellings.h"
#include "other_libraries.h"
#include "program.h"
#include "verbs.h"

namespace {

constexpr const char* about =
    "Unseen simplifies meshes where nobody can see it: view-dependent, by what a human eye perceives on a display.";
constexpr const char* examples = R"(Examples:
  unseen demo
  unseen build bunny.ply -o bunny.vdt
  unseen render bunny.vdt -o bunny.png
  unseen simplify bunny.vdt --triangles 5000 -o small.ply
  unseen sheet bunny.vdt -o sheet.png
  unseen view bunny.vdt

'unseen VERB --help' explains a verb, 'unseen help setup' the options that verbs share.
Exit status: 0 done, 1 failed, 2 wrong usage.)";

} // namespace

int main(int argc, char** argv) {
    using namespace unseen::app;
    const std::string notes = licence_notes();
    const std::string version = UNSEEN_VERSION + (notes.empty() ? notes : "\n" + notes);
    std::optional<Setup> setup;
    Program program{
        "unseen", about, examples, version.c_str(), {{"bench", "measuring is a program of its own, unseen-bench."}}};
    program.verb_for_files = "view";
    program.setup = &setup;
    program.renew = renew_spelling;
    return run_program(argc, argv, program, [&](CLI::App& app) {
        Setup& s = setup.emplace(app);
        return std::vector<Command>{build_command(app, s),     info_command(app, s),   simplify_command(app, s),
                                    render_command(app, s),    fly_command(app, s),    view_command(app, s),
                                    compare_command(app, s),   sheet_command(app, s),  tradeoff_command(app, s),
                                    lod_command(app, s),       levels_command(app, s), csf_command(app),
                                    calibrate_command(app, s), study_command(app, s),  demo_command(app, s),
                                    make_command(app, s),      cache_command(app)};
    });
}
