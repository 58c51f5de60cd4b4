// unseen sheet: what the four kinds of cuts of a model look like, side by side, and how visible they are.
#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <utility>

#include <unseen/perception/image.h>

#include "contact_sheet.h"
#include "cut_report.h"
#include "output_files.h"
#include "progress_bar.h"
#include "report.h"
#include "session_options.h"
#include "sheet_report.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

struct SheetArguments {
    ViewOptions& view;
    DisplayOptions& display;
    std::string model = {}, out = {}, maps = {}, json = {};
    TriangleCount budget = {}; // not given: the sheet's own
    SheetOptions sheet = {};
    bool is_verbose = false;
};

Result<ContactSheet> draw(session::Session& session, render::Context& context, const SheetArguments& a) {
    SheetOptions options = a.sheet;
    options.model = std::filesystem::path(a.model).filename().string();
    options.has_cuts = !a.out.empty();
    options.has_maps = !a.maps.empty();
    if (a.budget.is_given()) options.budget = a.budget.of(session.tree().triangle_count());
    ProgressBar bar("drawing and judging");
    options.progress = std::ref(bar);
    return draw_contact_sheet(session, make_view(session, a.view), context, options);
}

Result<int> run(const SheetArguments& a) {
    auto report = open_report(inputs_of(a.model, a.view, a.display), {a.out, a.maps}, a.json);
    if (!report) return report.error();
    auto context = render::Context::headless();
    if (!context) return context.error();
    auto session = open_session(a.model, a.view, a.display);
    if (!session) return session.error();
    if (session->scene().lights && !session->scene().lights->casting().empty())
        return Error{ErrorCode::unsupported, "Sheets are drawn without shadows: give --no-shadows."};
    const auto sheet = draw(*session, *context, a);
    if (!sheet) return sheet.error();
    if (auto ok = report->prepare(sheet_json(sheet->cuts)); !ok) return ok.error();
    for (const auto& [file, image] : {std::pair(&a.out, &sheet->sheet), std::pair(&a.maps, &sheet->maps)}) {
        if (file->empty()) continue;
        if (auto ok = perception::write_image(*file, *image); !ok) return ok.error();
    }
    if (auto ok = report->publish(); !ok) return ok.error();
    if (report->is_on_stdout()) return exit_done;
    print_sheet(sheet->cuts);
    print_written({a.out, a.maps, a.json});
    if (a.is_verbose) print_sheet_effects(sheet->cuts);
    return exit_done;
}

} // namespace

Command sheet_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<SheetArguments>(SheetArguments{setup.view_options(), setup.display_options()});
    CLI::App* verb =
        app.add_subcommand("sheet", "Draw and judge the full, imperceptible, budget and gaze-directed cuts");
    add_model_option(*verb, a->model, false);
    add_value(*verb, "-o,--output", a->out, ending_in({".png"}), "SHEET.png", "The contact sheet, wireframes below");
    add_value(*verb, "--maps", a->maps, ending_in({".png"}), "MAPS.png",
              "A sheet without the budget and, below, with maps of the folds' cost, frequency, contrast and "
              "eccentricity; both sheets are drawn and judged once");
    add_triangles_option(*verb, a->budget, "The budget (default: a quarter of the triangles)");
    add_gaze_option(*verb, a->sheet.gaze_px);
    verb->get_option("--gaze")->description(
        "Gaze of the gaze-directed cut, in pixels from the top left; may lie outside "
        "(default: 29 degrees to the right of the window's centre)");
    add_samples_option(*verb, a->sheet.samples, "64");
    add_value(*verb, "--cell", a->sheet.cell_px, whole(16, 4096), "PIXELS",
              "The longer side of a picture (default: " + std::to_string(usual_cell_px) + ", with maps " +
                  std::to_string(usual_maps_cell_px) + ")");
    add_fold_test_option(*verb, a->sheet.fold_test, true);
    add_json_option(*verb, a->json);
    add_verbose_option(*verb, a->is_verbose);
    setup.act_in(*verb, Setup::view | Setup::model);
    verb->callback([o = a.get()] {
        if (o->out.empty() && o->maps.empty()) refuse("-o is required, or --maps.");
    });
    verb->footer("Examples:\n  unseen sheet bunny.vdt -o bunny.png\n"
                 "  unseen sheet bunny.vdt -o bunny.png --maps maps.png\n"
                 "  unseen sheet bunny.vdt -o bunny.png --direction 1 1 1 --triangles 10000 --gaze 0 512");
    return {verb,
            [a] { return run(*a); },
            {{"--triangles", Rule::needs_one_of, {"-o"}, "the sheet of maps has no budget"}}};
}

} // namespace unseen::app
