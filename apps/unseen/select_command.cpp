// unseen select: levels of detail selected beforehand, for cameras all over a scene.
#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>

#include <unseen/session/selection.h>
#include <unseen/session_gpu/precompute_selections.h>

#include "build_team.h"
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
using session::Selections;

struct SelectArguments {
    std::string scene, out, json, file;
    ViewOptions view;
    DisplayOptions display;
    TriangleCount budget;
    PrecomputeOptions options;
    std::optional<double> eye_height;
    std::vector<double> grid;
    bool is_info = false, is_verbose = false, begins_anew = false;
};

Json to_json(const PrecomputeReport& r) {
    return {{"corners", r.corners},
            {"cells", r.cells},
            {"cameras", r.cameras},
            {"resumed_corners", r.resumed},
            {"cameras_over_budget", r.over_budget},
            {"processes", r.processes},
            {"seconds", r.seconds},
            {"load_seconds", r.load_seconds},
            {"draw_seconds", r.draw_seconds},
            {"read_seconds", r.read_seconds},
            {"search_seconds", r.search_seconds},
            {"drawings", r.drawings},
            {"drawn_triangles", r.drawn_triangles},
            {"evaluations", r.evaluations}};
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

Result<Ready> get_ready(const SelectArguments& a, bool is_first) {
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

Result<int> precompute(SelectArguments& a) {
    const auto joined = ProcessTeam::join();
    if (!joined) return joined.error();
    ProcessTeam* const team = joined->get();
    const bool is_first = !team || team->rank() == 0;
    auto ready = get_ready(a, is_first);
    if (team) {
        const auto ok = agree(*team, ready ? Result<void>() : Result<void>(ready.error()), 0);
        if (!ok) {
            team->leave();
            if (!is_first) return exit_failed; // the first one says why
            return ok.error();
        }
    } else if (!ready) {
        return ready.error();
    }
    auto& [report, context, session] = *ready;
    PrecomputeOptions options = a.options;
    options.budget = a.budget.of(session.triangle_count());
    options.eye_height = a.eye_height;
    if (!a.grid.empty()) {
        options.low = glm::dvec3(a.grid[0], 0, a.grid[1]);
        options.high = glm::dvec3(a.grid[2], 0, a.grid[3]);
    }
    if (team && options.threads == 0) options.threads = std::max(1, team->cores() / team->members_on_machine());
    if (is_first && a.begins_anew) {
        std::error_code ignored;
        std::filesystem::remove(a.out + ".part", ignored);
    }
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
    if (!done && is_interrupted) print_note("interrupted: the same command goes on from '" + a.out + ".part'.");
    if (!done) return done.error();
    if (auto ok = report.prepare(to_json(*done)); !ok) return ok.error();
    if (auto ok = report.publish(); !ok) return ok.error();
    if (report.is_on_stdout()) return exit_done;
    print_line("selected levels for " + counted(done->cameras, "camera", "cameras") + " at " +
               counted(done->corners, "corner", "corners") + " of " + counted(done->cells, "cell", "cells") + " in " +
               duration(1e3 * done->seconds) +
               (done->resumed > 0 ? "; " + counted(done->resumed, "corner was", "corners were") + " there" : ""));
    if (done->over_budget > 0)
        print_note(counted(done->over_budget, "camera has", "cameras have") +
                   " more triangles in sight than half of the budget, even at the coarsest levels.");
    if (a.is_verbose)
        print_table({{"seconds", ""},
                     {"loading, levels", rounded(done->load_seconds, 3)},
                     {"drawing", rounded(done->draw_seconds, 3)},
                     {"reading back", rounded(done->read_seconds, 3)},
                     {"searching, of all threads", rounded(done->search_seconds, 3)},
                     {"drawings", grouped(done->drawings)},
                     {"triangles drawn", grouped(done->drawn_triangles)},
                     {"evaluations", grouped(done->evaluations)}});
    print_written({a.out, a.json});
    return exit_done;
}

Result<int> info(SelectArguments& a) {
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    const auto read = session::read_selections(a.file);
    if (!read) return read.error();
    const Selections& s = *read;
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
    const Json json = {{"quality", name_of(s.quality)},
                       {"budget", s.budget},
                       {"window_px", s.window_px},
                       {"objects", s.triangles.size()},
                       {"levels", levels},
                       {"is_in_space", !s.grid.is_on_ground()},
                       {"corners", s.corners.size()},
                       {"cells", s.cells.size()},
                       {"cameras", cameras},
                       {"low", triple(low)},
                       {"high", triple(high)},
                       {"objects_in_sight", in_sight / of},
                       {"mean_loss", loss / of},
                       {"selected_by_level", by_level}};
    if (auto ok = report->prepare(json); !ok) return ok.error();
    if (auto ok = report->publish(); !ok) return ok.error();
    if (report->is_on_stdout()) return exit_done;
    std::vector<std::vector<std::string>> rows = {
        {"quality", name_of(s.quality)},
        {"budget, triangles a frame", grouped(s.budget)},
        {"cameras' windows, pixels a side", grouped(static_cast<std::uint64_t>(s.window_px))},
        {"objects", grouped(s.triangles.size())},
        {"levels of an object", grouped(levels)},
        {"corners", grouped(s.corners.size())},
        {"cells", grouped(s.cells.size())},
        {"cameras with objects in sight", grouped(cameras)},
        {"objects in sight, mean", rounded(in_sight / of, 3)},
        {"lost a pixel, mean", rounded(loss / of, 3)}};
    for (std::size_t level = 0; level < levels; ++level)
        rows.push_back({"selected at level " + std::to_string(level), grouped(by_level[level])});
    print_table(std::move(rows));
    print_written({a.json});
    return exit_done;
}

CLI::App* add_precompute(CLI::App& verb, const std::shared_ptr<SelectArguments>& a) {
    CLI::App* sub = verb.add_subcommand(
        "precompute", "For cameras all over a scene, the levels that lose least within a budget of triangles");
    PrecomputeOptions& o = a->options;
    sub->add_option("SCENE", a->scene, "A scene (glTF)")->required()->type_name("SCENE.glb");
    sub->add_option("-o,--output", a->out, "The selections; OUT.sel.part keeps what is done until then")
        ->required()
        ->type_name("OUT.sel")
        ->check(ending_in({".sel"}));
    CLI::Option* budget =
        add_triangles_option(*sub, a->budget, "Triangles of a frame, or a share of the scene's")->required();
    (void)budget;
    add_choice<SelectionQuality, SelectionQuality>(*sub, "--quality", o.quality,
                                                   {{"ssim", SelectionQuality::ssim},
                                                    {"pixels", SelectionQuality::pixels},
                                                    {"contrast", SelectionQuality::contrast}},
                                                   "What pictures lose least of: structural similarity (ssim; "
                                                   "default), pixels that differ visibly, or visible contrast");
    sub->add_option("--grid", a->grid,
                    "The ground that corners are on, world units (default: around the middles of all objects)")
        ->type_name("X0 Z0 X1 Z1")
        ->expected(4)
        ->check(finite_numbers(1));
    sub->add_option("--spacing", o.spacing, "Of the corners, world units (default: a tenth of the longer side)")
        ->type_name("X")
        ->check(positive());
    sub->add_option("--depth", o.depth, "How often a cell is halved where its corners select differently (default: 1)")
        ->type_name("N")
        ->check(whole(0, session::most_selection_depth));
    sub->add_option("--differ", o.differ, "Differently: by more levels than so many, in the mean (default: 0.5)")
        ->type_name("X")
        ->check(not_negative());
    add_number(*sub, "--height", a->eye_height, finite_numbers(1), "Y",
               "Of eyes, world units (default: that of the scene's camera, or 1.7 above the lowest object)");
    sub->add_flag("--space", o.is_in_space, "A grid in space, cameras in six directions; else on the ground, in four");
    sub->add_option("--levels", o.levels,
                    "Of each object, full detail among them, each of half of the triangles (default: 5)")
        ->type_name("N")
        ->check(whole(2, session::most_levels));
    sub->add_option("--window", o.window_px, "Of the cameras, a side (default: 256)")
        ->type_name("PIXELS")
        ->check(whole(11, 8192));
    sub->add_option("--threads", o.threads, "One draws, the others search; the result is the same (default: all cores)")
        ->type_name("N")
        ->check(whole(1, 1024));
    sub->add_flag("--anew", a->begins_anew, "Do not go on from what an interrupted search left");
    add_json_option(*sub, a->json);
    add_verbose_option(*sub, a->is_verbose);
    add_display_options(*sub, a->display);
    sub->callback([a] { a->view.as = session::LoadAs::scene; });
    return sub;
}

} // namespace

Command select_command(CLI::App& app) {
    auto a = std::make_shared<SelectArguments>();
    CLI::App* verb = app.add_subcommand("select", "Select levels of detail beforehand, within a budget of triangles");
    verb->require_subcommand(1);
    CLI::App* precompute_verb = add_precompute(*verb, a);
    CLI::App* info_verb = verb->add_subcommand("info", "What a file of selections holds");
    info_verb->add_option("FILE", a->file, "Selections")->required()->type_name("FILE.sel");
    add_json_option(*info_verb, a->json);
    info_verb->callback([a] { a->is_info = true; });
    const std::string examples =
        "Examples:\n  unseen scene make spheres -o spheres.glb\n"
        "  unseen select precompute spheres.glb --triangles 300000 -o spheres.sel\n"
        "  unseen select precompute spheres.glb --triangles 10% --spacing 2 --depth 2 -o fine.sel\n"
        "  unseen select info spheres.sel\n"
        "  unseen render spheres.glb --method selection --selection spheres.sel --path walk -o frames/%04d.png" +
        std::string(ProcessTeam::is_there()
                        ? "\n  mpirun -np 4 unseen select precompute spheres.glb --triangles 300000 -o spheres.sel"
                        : "");
    precompute_verb->footer(examples);
    verb->footer(examples + "\n\n'unseen select precompute --help' tells more.");
    return {verb, [a] { return a->is_info ? info(*a) : precompute(*a); }};
}

} // namespace unseen::app
