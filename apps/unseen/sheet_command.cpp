// unseen sheet: what the four kinds of cuts of a model look like, side by side, and how visible they are.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>

#include <perception/image.h>
#include <perception/judge.h>
#include <render/renderer.h>

#include "cut_report.h"
#include "drawing.h"
#include "fold_map.h"
#include "frame_image.h"
#include "output_files.h"
#include "progress_bar.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

struct SheetArguments {
    std::string model, out, json;
    ViewOptions view;
    DisplayOptions display;
    TriangleCount budget = {.share = 0.25};
    std::optional<glm::dvec2> gaze_px; // default: default_gaze
    int samples = 64;
    int cell_px = 480;
    bool maps = false, is_verbose = false;
    std::optional<FoldTest> test; // default: as in 'unseen render'
};

// One column of the sheet.
struct Column {
    std::string name;
    session::Request request;
    std::optional<session::Gaze> gaze;
    session::Report report;
    double draw_ms = 0;
    perception::Image luminance;                    // cd/m2, of the whole window
    std::vector<perception::Image> pictures;        // one below the other; code values, of a cell's size
    std::optional<perception::Judgement> judgement; // against the full model; none for that itself
};

// By one fold test, in four ways.
std::vector<Column> wishes(const session::Session& session, const vdtree::View& view, const SheetArguments& a) {
    std::vector<Column> columns(4);
    for (Column& column : columns) {
        column.request.fold_test = a.test;
        column.request.purpose = session::Purpose::picture;
    }
    columns[0].name = "full";
    columns[0].request.goal = Goal::full();
    columns[1].name = "imperceptible";
    columns[2].name = "budget";
    columns[2].request.goal = Goal::budget(a.budget.of(session.tree().triangle_count()));
    columns[3].name = "gaze-directed";
    columns[3].gaze = session::Gaze{
        a.gaze_px.value_or(session::gaze_aside(session.observer().display, view, session::usual_degrees_aside))};
    if (a.maps) columns.erase(columns.begin() + 2); // a budget is another matter
    return columns;
}

// The same camera in a window that fits a cell. Pixels are coarser there, so nothing is measured in it.
vdtree::View small_view(const vdtree::View& view, int cell_px) {
    vdtree::View small = view;
    const double shrink = std::min(1.0, static_cast<double>(cell_px) / std::max(view.width, view.height));
    small.width = std::max(1, static_cast<int>(std::lround(view.width * shrink)));
    small.height = std::max(1, static_cast<int>(std::lround(view.height * shrink)));
    return small;
}

// Where there is none, as that of the cost in the full model, nothing: such columns are shorter.
Result<void> draw_maps(Column& column, const vdtree::Cut& cut, session::Session& session, const vdtree::View& view,
                       const vdtree::View& small) {
    for (const FoldMap map : {FoldMap::cost, FoldMap::frequency, FoldMap::contrast, FoldMap::eccentricity}) {
        if (column.request.goal.kind == Goal::Kind::full || (map == FoldMap::eccentricity && !column.gaze)) continue;
        auto drawn = draw_fold_map(cut, session, view, column.request, map, small);
        if (!drawn) return drawn.error();
        column.pictures.push_back(std::move(*drawn));
    }
    return {};
}

Result<void> draw_pictures(Column& column, const vdtree::Cut& cut, session::Session& session, const vdtree::View& view,
                           const SheetArguments& a, render::Renderer& renderer) {
    auto lighting = session.lighting(view);
    if (!lighting) return lighting.error();
    const vdtree::Similarity& placement = session.scene().objects.front().placement;
    const perception::Display& display = session.observer().display;
    render::DrawOptions options;
    options.samples = a.samples;
    options.background = session.background();
    options.lighting = std::move(*lighting);
    const auto whole = renderer.draw(cut, view, options, placement);
    if (!whole) return whole.error();
    column.draw_ms = whole->draw_ms;
    column.luminance = luminance_image(*whole, display);

    const vdtree::View small = small_view(view, a.cell_px);
    const auto shaded = renderer.draw(cut, small, options, placement);
    if (!shaded) return shaded.error();
    column.pictures.push_back(code_image(*shaded, display));
    options.wireframe = true;
    const auto wired = renderer.draw(cut, small, options, placement);
    if (!wired) return wired.error();
    column.pictures.push_back(code_image(*wired, display));
    return a.maps ? draw_maps(column, cut, session, view, small) : Result<void>();
}

Result<void> judge(Column& column, const Column& full, const session::Observer& observer) {
    perception::JudgeOptions options;
    options.display = observer.display;
    if (column.gaze) options.gaze_px = column.gaze->px;
    options.csf_table = observer.csf;
    auto judgement = perception::judge_modern(full.luminance, column.luminance, options);
    if (!judgement) return judgement.error();
    column.judgement = std::move(*judgement);
    return {};
}

Result<std::vector<Column>> make_columns(session::Session& session, const vdtree::View& view, const SheetArguments& a,
                                         render::Context& context) {
    std::vector<Column> columns = wishes(session, view, a);
    if (const auto ready = session.prepare(view, columns[1].request); !ready) return ready.error();
    auto renderer = render::Renderer::create(context, session.tree());
    if (!renderer) return renderer.error();
    ProgressBar bar("drawing and judging");
    for (Column& column : columns) {
        bar(static_cast<double>(&column - columns.data()) / static_cast<double>(columns.size()), column.name.c_str());
        session.set_gaze(column.gaze);
        auto simplified = session.simplify(view, column.request);
        if (!simplified) return simplified.error();
        if (auto ok = draw_pictures(column, simplified->cuts.front(), session, view, a, *renderer); !ok)
            return ok.error();
        column.report = std::move(*simplified);
        if (&column == &columns.front()) continue;
        if (auto ok = judge(column, columns.front(), session.observer()); !ok) return ok.error();
    }
    return columns;
}

double visible_pixels(const Column& column) {
    return column.judgement ? static_cast<double>(column.judgement->visible_pixels)
                            : std::numeric_limits<double>::quiet_NaN();
}

std::string effects_that_ran(const session::Report& report) {
    std::string list;
    for (const session::Effect& effect : report.effects)
        if (effect.on) list += (list.empty() ? "" : ", ") + effect.name;
    return list;
}

std::string metres(double value) { return rounded(value, 3) + (std::isfinite(value) ? " m" : ""); }

// ---- the picture --------------------------------------------------------------------------------------------------

// The lines above a column of pictures.
struct Caption {
    std::string name, verdict;

    explicit Caption(const Column& column)
        : name(column.name + ": " + grouped(column.report.stats.triangles) + " triangles") {
        if (column.judgement)
            verdict = grouped(column.judgement->visible_pixels) + " pixels visible; from " +
                      metres(column.report.imperceptible_from_m) + " none";
    }
};

Result<perception::Image> compose(const std::vector<Column>& columns, const perception::Display& display,
                                  const vdtree::View& view, const std::string& model) {
    constexpr int gap = 12, text_height = 17, line_height = 22; // pixels
    constexpr glm::vec3 paper{0.12f}, ink{0.95f}, weak{0.7f};
    int height = 0, cell_width = 0; // of the tallest column, and of the widest picture or line of text
    std::vector<Caption> captions;
    for (const Column& column : columns) {
        const Caption& caption = captions.emplace_back(column);
        for (const std::string& line : {caption.name, caption.verdict})
            cell_width = std::max(cell_width, static_cast<int>(std::ceil(Drawing::text_width(line, text_height))));
        int below = 0;
        for (const perception::Image& picture : column.pictures) {
            cell_width = std::max(cell_width, picture.width);
            below += picture.height + gap;
        }
        height = std::max(height, below);
    }
    const int count = static_cast<int>(columns.size());
    const int header = 2 * gap + line_height, above = 2 * line_height + gap;
    auto drawing = Drawing::create(gap + count * (cell_width + gap), header + above + height, paper);
    if (!drawing) return drawing.error();

    const std::string title = std::filesystem::path(model).filename().string() + "   " + std::to_string(view.width) +
                              "x" + std::to_string(view.height) + " pixels, " +
                              rounded(perception::pixels_per_degree(display).value(), 4) + " per degree, seen from " +
                              rounded(display.distance.value(), 3) + " m";
    drawing->text({gap, gap}, title, ink, Drawing::fitting_height(title, text_height, drawing->width() - 2 * gap));
    for (int i = 0; i < count; ++i) {
        const int left = gap + i * (cell_width + gap);
        const Caption& caption = captions[static_cast<std::size_t>(i)];
        drawing->text({left, header}, caption.name, ink, text_height);
        drawing->text({left, header + line_height}, caption.verdict, weak, text_height);
        int top = header + above;
        for (const perception::Image& picture : columns[static_cast<std::size_t>(i)].pictures) {
            drawing->picture({left, top}, picture);
            top += picture.height + gap;
        }
    }
    return drawing->image();
}

// ---- the report ---------------------------------------------------------------------------------------------------

Json to_json(const std::vector<Column>& columns) {
    Json cuts = Json::array();
    for (const Column& column : columns) {
        Json cut = {{"name", column.name}};
        cut.update(app::to_json(column.report, column.draw_ms));
        cut["visible_pixels"] = number_or_null(visible_pixels(column));
        cut["pixels"] = column.luminance.values.size();
        cut["max_ratio"] = column.judgement ? number_or_null(column.judgement->max_ratio) : Json(nullptr);
        cuts.push_back(std::move(cut));
    }
    return {{"cuts", cuts}};
}

void print(const std::vector<Column>& columns) {
    std::vector<std::vector<std::string>> rows = {
        {"cut", "triangles", "nodes tested", "adapted in", "drawn in", "visible px", "imperceptible from"}};
    for (const Column& column : columns) {
        const session::Report& s = column.report;
        rows.push_back({column.name, grouped(s.stats.triangles), grouped(s.stats.node_tests), duration(s.adapt_ms),
                        duration(column.draw_ms),
                        column.judgement ? grouped(column.judgement->visible_pixels) : "reference",
                        metres(s.imperceptible_from_m)});
    }
    print_table(rows);
}

void print_effects(const std::vector<Column>& columns) {
    print_line("effects that ran");
    for (const Column& column : columns) print_line("  " + column.name + ": " + effects_that_ran(column.report));
}

Result<int> run(const SheetArguments& a) {
    if (const auto ready = check_outputs(inputs_of(a.model, a.view, a.display), {a.out, a.json}); !ready)
        return ready.error();
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    auto context = render::Context::headless();
    if (!context) return context.error();
    auto session = open_session(a.model, a.view, a.display);
    if (!session) return session.error();
    const vdtree::View view = make_view(*session, a.view);
    const auto columns = make_columns(*session, view, a, *context);
    if (!columns) return columns.error();

    const auto sheet = compose(*columns, session->observer().display, view, a.model);
    if (!sheet) return sheet.error();
    if (auto ok = report->prepare(to_json(*columns)); !ok) return ok.error();
    if (auto ok = perception::write_image(a.out, *sheet); !ok) return ok.error();
    if (auto ok = report->publish(); !ok) return ok.error();
    if (report->is_on_stdout()) return exit_done;
    print(*columns);
    print_written({a.out, a.json});
    if (a.is_verbose) print_effects(*columns);
    return exit_done;
}

} // namespace

Command sheet_command(CLI::App& app) {
    auto a = std::make_shared<SheetArguments>();
    CLI::App* verb =
        app.add_subcommand("sheet", "Draw and judge the full, imperceptible, budget and gaze-directed cuts");
    verb->add_option("TREE", a->model, "A tree, or a mesh")->required()->type_name("TREE.vdt|MESH");
    verb->add_option("-o,--output", a->out, "The contact sheet, wireframes below")
        ->type_name("SHEET.png")
        ->required()
        ->check(ending_in({".png"}));
    add_triangles_option(*verb, a->budget, "The budget (default: a quarter of the triangles)");
    add_gaze_option(*verb, a->gaze_px);
    verb->get_option("--gaze")->description(
        "Gaze of the gaze-directed cut, in pixels from the top left; may lie outside "
        "(default: 29 degrees to the right of the window's centre)");
    verb->add_option("--samples", a->samples, "Samples a pixel, 1 to 256 (default: 64)")
        ->type_name("N")
        ->check(whole(1, 256));
    verb->add_option("--cell", a->cell_px, "The longer side of a picture on the sheet (default: 480)")
        ->type_name("PIXELS")
        ->check(whole(16, 4096));
    add_fold_test_option(*verb, a->test,
                         std::array{FoldTest::luebke_hallen, FoldTest::luebke_hallen_safe, FoldTest::error},
                         "luebke-hallen, luebke-hallen-safe or error (default: as in 'unseen render')");
    verb->add_flag("--maps", a->maps,
                   "Below, in place of the budget: maps of the folds' cost, frequency, contrast and eccentricity");
    add_json_option(*verb, a->json);
    add_verbose_option(*verb, a->is_verbose);
    add_view_options(*verb, a->view);
    add_display_options(*verb, a->display);
    verb->footer("Examples:\n  unseen sheet bunny.vdt -o bunny.png\n"
                 "  unseen sheet bunny.vdt -o maps.png --maps --cell 320\n"
                 "  unseen sheet bunny.vdt -o bunny.png --direction 1 1 1 --triangles 10000 --gaze 0 512");
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
