// The verbs that draw, in a build without OpenGL: they say so.
#include "calibration_window.h"
#include "on_gpu.h"
#include "verbs.h"

namespace unseen::app {
namespace {

Command absent(CLI::App& app, const std::string& name) {
    CLI::App* verb = app.add_subcommand(name, "Not in this build: it was made without OpenGL");
    verb->allow_extras();
    return {verb, [name]() -> Result<int> {
                return Error{ErrorCode::unsupported, "This build cannot '" + name +
                                                         "', for it was made without OpenGL; "
                                                         "configure it with -DUNSEEN_BUILD_RENDER=ON."};
            }};
}

Error no_window() {
    return {ErrorCode::unsupported, "This build has no windows, for it was made without OpenGL; configure it with "
                                    "-DUNSEEN_BUILD_RENDER=ON, or use --simulate."};
}

} // namespace

Result<void> run_calibration_window(calibration::Procedure&, const CalibrationWindowOptions&,
                                    const std::filesystem::path&) {
    return no_window();
}
Result<std::vector<GammaMatch>> match_gamma(const CalibrationWindowOptions&) { return no_window(); }

Result<session::Simplification> simplify_by(const WhatOptions& what, session::Session& session,
                                            const vdtree::View& view, const session::Request& request,
                                            const render::Context*) {
    if (what.hiding == Hiding::spheres && !what.is_checked) return session.simplify(view, request);
    return Error{ErrorCode::unsupported,
                 "--visibility picture and --checked are not in this build, for it was made without OpenGL; configure "
                 "it with -DUNSEEN_BUILD_RENDER=ON."};
}

Result<Verdict> compare_on_gpu(const perception::Image&, const perception::Image&, const perception::JudgeOptions&) {
    return Error{ErrorCode::unsupported,
                 "This build cannot judge on the GPU, for it was made without OpenGL; configure it "
                 "with -DUNSEEN_BUILD_RENDER=ON, or use --device cpu."};
}

Command demo_command(CLI::App& app, Setup&) { return absent(app, "demo"); }
Command fly_command(CLI::App& app, Setup&) { return absent(app, "fly"); }
Command levels_command(CLI::App& app, Setup&) { return absent(app, "levels"); }
Command lod_command(CLI::App& app, Setup&) { return absent(app, "lod"); }
Command render_command(CLI::App& app, Setup&) { return absent(app, "render"); }
Command sheet_command(CLI::App& app, Setup&) { return absent(app, "sheet"); }
Command study_command(CLI::App& app, Setup&) { return absent(app, "study"); }
Command tradeoff_command(CLI::App& app, Setup&) { return absent(app, "tradeoff"); }
Command view_command(CLI::App& app, Setup&) { return absent(app, "view"); }

} // namespace unseen::app
