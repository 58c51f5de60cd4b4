// unseen levels precompute, unseen levels info: levels of detail selected beforehand, for cameras all over a scene.
#include <algorithm>
#include <memory>

#include <unseen/session/internal/selections.h>
#include <unseen/session_gpu/precompute_selections.h>

#include "interruption.h"
#include "output_files.h"
#include "process_team.h"
#include "progress_bar.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

using session::PrecomputeOptions;
using session::PrecomputeReport;
using session::SelectionQuality;

struct PrecomputeArguments {
    ViewOptions& view;
    DisplayOptions& display;
    std::string scene = {}, out = {}, json = {};
    TriangleCount budget = {};
    PrecomputeOptions options = {};
    std::optional<double> eye_height = {};
    std::vector<double> grid = {};
    bool is_verbose = false;
};

std::vector<Fact> facts_of(const PrecomputeReport& r) {
    const auto seconds = [](const char* key, const char* label, double value) {
        return Fact{key, label, value, rounded(value, 3)};
    };
    return {{"corners", "", r.corners},
            {"cells", "", r.cells},
            {"cameras", "", r.cameras},
            {"resumed_corners", "", r.resumed},
            {"cameras_over_budget", "", r.over_budget},
            {"processes", "", r.processes},
            {"seconds", "seconds", r.seconds},
            seconds("load_seconds", "loading, levels", r.load_seconds),
            seconds("draw_seconds", "drawing", r.draw_seconds),
            seconds("read_seconds", "reading back", r.read_seconds),
            seconds("search_seconds", "searching, of all threads", r.search_seconds),
            count_of("drawings", "drawings", r.drawings),
            count_of("drawn_triangles", "triangles drawn", r.drawn_triangles),
            count_of("evaluations", "evaluations", r.evaluations)};
}

std::string counted(std::size_t count, const char* one, const char* many) {
    return grouped(count) + " " + (count == 1 ? one : many);
}

// What there has to be before anything is drawn.
struct Ready {
    JsonReport report;
    render::Context context;
    session::Session session;
};

Result<Ready> get_ready(const PrecomputeArguments& a, bool is_first) {
    if (is_first)
        if (const auto ready = check_outputs(inputs_of(a.scene, a.view, a.display), {a.out, a.json}); !ready)
            return ready.error();
    auto report = JsonReport::open(is_first ? a.json : std::string());
    if (!report) return report.error();
    auto context = render::Context::headless();
    if (!context) return context.error();
    auto session = open_session(a.scene, a.view, a.display);
    if (!session) return session.error();
    return Ready{std::move(*report), std::move(*context), std::move(*session)};
}

// All members of a team have to be ready, or none goes on. The first one says why.
Result<Ready> get_ready_together(const PrecomputeArguments& a, ProcessTeam* team, bool is_first) {
    auto ready = get_ready(a, is_first);
    if (!team) return ready;
    const auto ok = agree(*team, ready ? Result<void>() : Result<void>(ready.error()), 0);
    if (ok) return ready;
    team->leave();
    return ok.error();
}

PrecomputeOptions options_of(const PrecomputeArguments& a, const session::Session& session, const ProcessTeam* team) {
    PrecomputeOptions options = a.options;
    options.budget = a.budget.of(session.triangle_count());
    options.eye_height = a.eye_height;
    if (!a.grid.empty()) {
        options.low = glm::dvec3(a.grid[0], 0, a.grid[1]);
        options.high = glm::dvec3(a.grid[2], 0, a.grid[3]);
    }
    if (team && options.threads == 0) options.threads = std::max(1, team->cores() / team->members_on_machine());
    return options;
}

void print(const PrecomputeReport& done, bool is_verbose) {
    print_line("selected levels for " + counted(done.cameras, "camera", "cameras") + " at " +
               counted(done.corners, "corner", "corners") + " of " + counted(done.cells, "cell", "cells") + " in " +
               duration(1e3 * done.seconds) +
               (done.resumed > 0 ? "; " + counted(done.resumed, "corner was", "corners were") + " there" : ""));
    if (done.over_budget > 0)
        print_note(counted(done.over_budget, "camera has", "cameras have") +
                   " more triangles in sight than half of the budget, even at the coarsest levels.");
    if (is_verbose) print_facts(facts_of(done));
}

Result<int> precompute(PrecomputeArguments& a) {
    a.view.as = session::LoadAs::scene;
    const auto joined = ProcessTeam::join();
    if (!joined) return joined.error();
    ProcessTeam* const team = joined->get();
    const bool is_first = !team || team->rank() == 0;
    auto ready = get_ready_together(a, team, is_first);
    if (!ready) return is_first ? Result<int>(ready.error()) : Result<int>(exit_failed);
    auto& [report, context, session] = *ready;
    PrecomputeOptions options = options_of(a, session, team);
    Result<PrecomputeReport> done = PrecomputeReport{};
    bool is_interrupted = false;
    {
        ProgressBar bar("selecting");
        const Interruptible until_interrupted;
        if (is_first)
            options.progress = [&](double share, const char* stage) {
                bar(share, stage);
                return !(is_interrupted = until_interrupted.is_interrupted());
            };
        done = session::precompute_selections(context, session, a.out, options, team);
    }
    if (team) team->leave();
    if (!is_first) return done ? exit_done : exit_failed; // the first one says why
    if (!done && is_interrupted)
        print_note("interrupted: the same command goes on from '" + a.out +
                   ".part', which may be removed to begin anew.");
    if (!done) return done.error();
    if (auto ok = report.write(to_json(facts_of(*done))); !ok) return ok.error();
    if (report.is_on_stdout()) return exit_done;
    print(*done, a.is_verbose);
    print_written({a.out, a.json});
    return exit_done;
}

struct SelectionInfoArguments {
    std::string file, json;
};

Result<int> selection_info(const SelectionInfoArguments& a) {
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    const auto read = session::read_selections(a.file);
    if (!read) return read.error();
    const session::Selections::Data& s = *read;
    std::size_t cameras = 0;
    const auto levels = static_cast<std::size_t>(s.levels);
    double in_sight = 0, loss = 0;
    std::vector<std::uint64_t> by_level(levels, 0);
    for (const session::SelectionCorner& corner : s.corners)
        for (const session::SelectionCamera& camera : corner.cameras) {
            if (camera.objects.empty()) continue;
            ++cameras;
            in_sight += static_cast<double>(camera.objects.size());
            loss += static_cast<double>(camera.loss);
            for (const session::SelectedLevel& o : camera.objects) ++by_level[o.level];
        }
    const double of = static_cast<double>(std::max<std::size_t>(cameras, 1));
    const glm::dvec3 low = s.grid.place({0, 0, 0});
    const std::int32_t cell = s.grid.cell_size();
    const glm::dvec3 high = s.grid.place({s.grid.cells.x * cell, s.grid.cells.y * cell, s.grid.cells.z * cell});
    const auto triple = [](const glm::dvec3& v) { return Json::array({v.x, v.y, v.z}); };
    std::vector<Fact> facts = {
        {"quality", "quality", name_of(s.quality), name_of(s.quality)},
        count_of("budget", "budget, triangles a frame", s.budget),
        count_of("window_px", "cameras' windows, pixels a side", static_cast<std::uint64_t>(s.window_px)),
        count_of("objects", "objects", s.triangles.size()),
        count_of("levels", "levels of an object", levels),
        {"is_in_space", "", !s.grid.is_on_ground()},
        count_of("corners", "corners", s.corners.size()),
        count_of("cells", "cells", s.cells.size()),
        count_of("cameras", "cameras with objects in sight", cameras),
        {"low", "", triple(low)},
        {"high", "", triple(high)},
        {"objects_in_sight", "objects in sight, mean", in_sight / of, rounded(in_sight / of, 3)},
        {"mean_loss", "lost a pixel, mean", loss / of, rounded(loss / of, 3)},
        {"selected_by_level", "", by_level}};
    if (auto ok = report->write(to_json(facts)); !ok) return ok.error();
    if (report->is_on_stdout()) return exit_done;
    for (std::size_t level = 0; level < levels; ++level)
        facts.push_back(count_of("", "selected at level " + std::to_string(level), by_level[level]));
    print_facts(facts);
    print_written({a.json});
    return exit_done;
}

void add_search_options(CLI::App& verb, PrecomputeArguments& a) {
    PrecomputeOptions& o = a.options;
    add_choice<SelectionQuality, SelectionQuality>(verb, "--quality", o.quality,
                                                   {{"ssim", SelectionQuality::ssim},
                                                    {"pixels", SelectionQuality::pixels},
                                                    {"contrast", SelectionQuality::contrast}},
                                                   "What pictures should lose least of: structural similarity (ssim; "
                                                   "default), pixels that differ visibly, or visible contrast");
    add_value(verb, "--grid", a.grid, finite_numbers(1), "X0 Z0 X1 Z1",
              "The ground that corners are on, world units (default: around the middles of all objects)")
        ->expected(4);
    add_value(verb, "--spacing", o.spacing, positive(), "X",
              "Distance of corners, world units (default: a tenth of the longer side)");
    add_value(verb, "--depth", o.depth, whole(0, session::most_selection_depth), "N",
              "How often a cell is halved where its corners select differently (default: 1)");
    add_value(verb, "--height", a.eye_height, finite_numbers(1), "Y",
              "Height of the eyes, world units (default: the scene camera's, or 1.7 above the lowest object)");
    verb.add_flag("--space", o.is_in_space, "A grid in space, cameras in six directions; else on the ground, in four");
    add_value(verb, "--levels", o.levels, whole(2, session::most_levels), "N",
              "Levels of each object, each with half the triangles (default: 5)");
    add_value(verb, "--window", o.window_px, whole(11, 8192), "PIXELS",
              "Width and height of the cameras' pictures (default: 256)");
}

} // namespace

Command precompute_command(CLI::App& levels, Setup& setup) {
    auto a = std::make_shared<PrecomputeArguments>(PrecomputeArguments{setup.view_options(), setup.display_options()});
    CLI::App* verb = levels.add_subcommand(
        "precompute", "For cameras all over a scene, select the levels that lose least within a budget of triangles");
    verb->add_option("SCENE", a->scene, "A scene (glTF)")->required()->type_name("SCENE.glb");
    add_value(*verb, "-o,--output", a->out, ending_in({".sel"}), "OUT.sel",
              "The selections; OUT.sel.part keeps what is done until then")
        ->required();
    add_triangles_option(*verb, a->budget, "Triangles a frame, or a share of the scene's")->required();
    add_search_options(*verb, *a);
    add_json_option(*verb, a->json);
    add_verbose_option(*verb, a->is_verbose);
    setup.act_in(*verb, Setup::display | Setup::observer | Setup::csf);
    verb->footer(
        "Examples:\n  unseen levels precompute spheres.glb --triangles 300k -o spheres.sel\n"
        "  unseen levels precompute spheres.glb --triangles 10% --spacing 2 --depth 2 -o fine.sel" +
        std::string(ProcessTeam::is_there()
                        ? "\n  mpirun -np 4 unseen levels precompute spheres.glb --triangles 300k -o spheres.sel"
                        : ""));
    return {verb, [a] { return precompute(*a); }};
}

Command selection_info_command(CLI::App& levels) {
    auto a = std::make_shared<SelectionInfoArguments>();
    CLI::App* verb = levels.add_subcommand("info", "Say what a file of selections holds");
    verb->add_option("FILE", a->file, "Selections")->required()->type_name("FILE.sel");
    add_json_option(*verb, a->json);
    verb->footer("Examples:\n  unseen levels info spheres.sel");
    return {verb, [a] { return selection_info(*a); }};
}

} // namespace unseen::app
