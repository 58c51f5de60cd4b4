// The command `unseen`.
#include <string>

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

'unseen VERB --help' tells more. Exit status: 0 done, 1 failed, 2 wrong usage.)";

} // namespace

int main(int argc, char** argv) {
    using namespace unseen::app;
    const std::string notes = licence_notes();
    const std::string version = UNSEEN_VERSION + (notes.empty() ? notes : "\n" + notes);
    const Program program{
        "unseen", about, examples, version.c_str(), {{"bench", "measuring is a program of its own, unseen-bench."}}};
    return run_program(argc, argv, program, [](CLI::App& app) {
        return std::vector<Command>{build_command(app),     info_command(app),  simplify_command(app),
                                    render_command(app),    sheet_command(app), compare_command(app),
                                    tradeoff_command(app),  lod_command(app),   csf_command(app),
                                    calibrate_command(app), view_command(app),  demo_command(app),
                                    make_command(app),      scene_command(app), select_command(app),
                                    study_command(app),     cache_command(app)};
    });
}
