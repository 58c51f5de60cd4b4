// unseen levels: discrete levels of detail in place of cuts, for comparison, and levels selected beforehand.
#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include <unseen/session/selection.h>
#include <unseen/session_gpu/scene_renderer.h>

#include "camera_path.h"
#include "interruption.h"
#include "level_report.h"
#include "numbered_pictures.h"
#include "output_files.h"
#include "progress_bar.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

using session::LevelControl;
using session::LevelMethod;
using session::SelectionFollower;

// Follows the file of selected levels, for the levels that are drawn.
Result<SelectionFollower> follower_of(session::Selections selections, const session::Session& session,
                                      const LevelControl& control, const LevelsArguments& options) {
    std::vector<std::vector<std::uint32_t>> triangles;
    for (std::size_t i = 0; i < session.scene().objects.size(); ++i) {
        auto& counts = triangles.emplace_back();
        for (int level = 0; level < control.chain(i).size(); ++level)
            counts.push_back(control.chain(i).triangles(level));
    }
    const bool has_budget = options.what.budget.is_given();
    auto follower = SelectionFollower::create(
        std::move(selections), session.scene(), triangles,
        {.budget = has_budget ? std::uint64_t{options.what.budget.of(session.triangle_count())} : 0});
    if (!follower) return Error{follower.error().code, "'" + options.selection + "': " + follower.error().message};
    return follower;
}

// Levels in use, from the first view on.
class LevelFlight {
public:
    static Result<LevelFlight> create(session::Session& session, const render::Context& context,
                                      const vdtree::View& view, const LevelsArguments& options) {
        session::LevelControlOptions control_options = options.control;
        std::optional<session::Selections> selections;
        if (control_options.method == LevelMethod::given) {
            auto read = session::Selections::read(options.selection);
            if (!read) return read.error();
            selections = std::move(*read);
            control_options.chain.levels = selections->levels();
        }
        auto control = LevelControl::create(context, session, view, control_options,
                                            options.what.request_for(session.triangle_count()));
        if (!control) return control.error();
        LevelFlight flight(session, options, std::move(*control), view);
        if (!selections) return flight;
        auto follower = follower_of(std::move(*selections), session, flight.control_, options);
        if (!follower) return follower.error();
        flight.follower_ = std::move(*follower);
        return flight;
    }

    // Until nothing changes any more; with a path, from its first pose.
    Result<void> settle(const std::vector<CameraPose>& poses) {
        if (!poses.empty()) aim(poses.front());
        if (auto selected = select(); !selected) return selected;
        auto settled = control_.settle(view_);
        if (!settled) return settled.error();
        records_.settling_frames = settled->number + 1;
        if (poses.empty()) records_.add(*settled);
        return {};
    }

    Result<void> fly(const std::vector<CameraPose>& poses, Pictures& pictures) {
        ProgressBar bar("flying");
        const Interruptible until_interrupted;
        for (std::size_t i = 0; i < poses.size() && !until_interrupted.is_interrupted(); ++i) {
            bar(static_cast<double>(i) / static_cast<double>(poses.size()), "frames");
            aim(poses[i]);
            session_->set_time(static_cast<double>(i) / options_->frames_a_second);
            if (auto selected = select(); !selected) return selected;
            auto frame = control_.draw(view_);
            if (!frame) return Error{frame.error().code, "Frame " + std::to_string(i) + ": " + frame.error().message};
            records_.add(std::move(*frame));
            // So that a flight is the same whatever the machine: counts are one frame late.
            const auto known = control_.wait();
            if (!known) return known.error();
            records_.learn(*known);
            if (!pictures.are_wanted()) continue;
            const auto image = picture();
            if (!image) return image.error();
            if (auto written = pictures.write_next(*image); !written) return written;
        }
        return {};
    }

    // For people, or with `is_luminance` in cd/m2.
    Result<perception::Image> picture(bool is_luminance = false) {
        const perception::Display& display = session_->observer().display;
        if (!is_luminance) return picture_of(control_, display, options_->show, levels());
        const auto frame = frame_of(control_.picture());
        if (!frame) return frame.error();
        return session::luminance_image(*frame, display);
    }

    // Most levels of an object.
    int levels() const {
        int most = 1;
        for (std::size_t i = 0; i < session_->scene().objects.size(); ++i)
            most = std::max(most, control_.chain(i).size());
        return most;
    }
    const LevelControl& control() const { return control_; }
    const LevelRecords& records() const { return records_; }
    std::size_t over_budget() const { return over_budget_; } // frames

private:
    LevelFlight(session::Session& session, const LevelsArguments& options, LevelControl control,
                const vdtree::View& view)
        : session_(&session), options_(&options), control_(std::move(control)), view_(view) {}

    void aim(const CameraPose& pose) {
        view_.eye = pose.eye;
        view_.target = pose.target;
        view_.up = pose.up;
        if (pose.gaze_px) session_->set_gaze(session::Gaze{*pose.gaze_px});
    }

    Result<void> select() {
        if (!follower_) return {};
        const auto chosen = follower_->choose(view_);
        if (!chosen) return chosen.error();
        control_.set_levels(chosen->levels);
        over_budget_ += !chosen->holds;
        return {};
    }

    session::Session* session_;
    const LevelsArguments* options_;
    LevelControl control_;
    vdtree::View view_;
    std::optional<SelectionFollower> follower_; // of selections
    std::size_t over_budget_ = 0;
    LevelRecords records_;
};

void print(const LevelsArguments& options, const LevelFlight& flight, const session::Session& session,
           std::size_t frames) {
    const auto drawn = static_cast<std::uint64_t>(flight.records().frames.size());
    if (drawn < frames) print_note("interrupted after " + grouped(drawn) + " of " + grouped(frames) + " frames.");
    print_summary(options, flight.records(), session, flight.levels());
    if (flight.over_budget() > 0)
        print_note("in " + grouped(flight.over_budget()) +
                   " frames even the coarsest levels have more triangles than the budget.");
    if (frames == 0) print_written({options.out, options.json});
    else print_written({options.json});
    if (frames > 0 && !options.out.empty()) print_line("wrote " + grouped(drawn) + " pictures, " + options.out);
}

// Prints a summary, and writes what was asked for.
Result<void> draw_levels(const LevelsArguments& options) {
    std::vector<std::string> inputs = inputs_of(options.model, options.view, options.display);
    inputs.insert(inputs.end(), {options.selection, options.path});
    auto report = open_report(inputs, {options.out}, options.json);
    if (!report) return report.error();
    std::optional<CameraPath> path;
    if (!options.path.empty()) {
        auto read = CameraPath::read(options.path, options.view.up.value_or(vdtree::View().up));
        if (!read) return read.error();
        path = std::move(*read);
    }
    const auto context = render::Context::headless();
    if (!context) return context.error();
    auto session = open_session(options.model, options.view, options.display);
    if (!session) return session.error();
    session->set_velocity(options.what.velocity());
    if (options.what.gaze_px) session->set_gaze(session::Gaze{*options.what.gaze_px});
    const vdtree::View view = make_view(*session, options.view);
    auto flight = LevelFlight::create(*session, *context, view, options);
    if (!flight) return flight.error();

    const std::vector<CameraPose> poses = path ? path->poses_from(view) : std::vector<CameraPose>();
    Pictures pictures(options.out);
    if (auto settled = flight->settle(poses); !settled) return settled;
    if (auto flown = flight->fly(poses, pictures); !flown) return flown;
    if (flight->records().frames.empty()) return {}; // interrupted
    if (auto ok = report->prepare(to_json(*session, flight->control(), options, flight->records(), flight->levels()));
        !ok)
        return ok;
    if (poses.empty() && !options.out.empty()) {
        const auto picture = flight->picture(!has_ending(options.out, ".png"));
        if (!picture) return picture.error();
        if (auto ok = perception::write_image(options.out, *picture); !ok) return ok;
    }
    if (auto ok = report->publish(); !ok) return ok;
    pictures.keep();
    if (!report->is_on_stdout()) print(options, *flight, *session, poses.size());
    return {};
}

void add_methods(CLI::App& verb, LevelsArguments& o) {
    add_choice<LevelMethod, LevelMethod>(
        verb, "--method", o.control.method,
        {{"perceptual", LevelMethod::perceptual},
         {"distance", LevelMethod::distance},
         {"area", LevelMethod::area},
         {"selection", LevelMethod::given}},
        "perceptual (by what the rest of the picture masks, after Drettakis and others "
        "2007; default), distance, area (of the bounding sphere in the picture), or "
        "selection (as 'unseen levels precompute' found them)");
    verb.add_option_function<std::string>(
            "--selection", [&o](const std::string& file) { o.selection = file, o.control.method = LevelMethod::given; },
            "The selections, and so --method selection")
        ->type_name("FILE.sel");
    add_triangles_option(verb, o.what.budget, "With --selection: the budget of a frame (default: the file's)");
    auto& control = o.control;
    add_value(verb, "--bias", control.bias, positive(), "X",
              "With distance and area: above 1 finer levels, below 1 coarser ones (default: 1)");
    add_value(verb, "--levels", control.chain.levels, whole(1, session::most_levels), "N",
              "Most levels of a mesh, the whole one included (default: 6)");
    add_choice<session::MapRecipe, session::MapRecipe>(
        verb, "--maps", control.maps, {{"modern", session::MapRecipe::modern}, {"rpg99", session::MapRecipe::rpg99}},
        "With perceptual: thresholds of the modern judge (default), or as in the paper");
    add_value(verb, "--fade", control.fade_frames, whole(0, 1000), "N",
              "With --path: for N frames both levels of an object share its pixels (default: 0)");
}

std::vector<Rule> level_rules() {
    const std::vector<std::string> others = {"--method distance", "--method area", "--method selection", "--selection"};
    const std::string why = "only --method perceptual draws layers and maps";
    return {{"--method selection", Rule::needs_one_of, {"--selection"}, "make one with 'unseen levels precompute'"},
            {"--selection", Rule::excludes, {"--method perceptual", "--method distance", "--method area"}},
            {"--selection", Rule::excludes, {"--levels", "--fold-test"}, "the levels are the file's"},
            {"--triangles", Rule::needs_one_of, {"--selection"}, "--bias gives other methods more or fewer triangles"},
            {"--bias", Rule::needs_one_of, {"--method distance", "--method area"}},
            {"--maps", Rule::excludes, others, why},
            {"--show maps", Rule::excludes, others, why},
            {"--fps", Rule::needs_one_of, {"--lights"}}};
}

void check(LevelsArguments& o, bool has_fade) {
    if (o.model.empty()) refuse("TREE is required.");
    if (o.out.empty() && o.json.empty()) refuse("-o is required, or --json.");
    const bool is_picture = has_ending(o.out, ".png");
    if (o.path.empty() && !o.show && parse_pattern(o.out)) o.path = "walk";
    if (o.path.empty()) {
        if (o.show && !is_picture) refuse("--show draws pictures for people: -o must end in .png.");
        if (has_fade) refuse("--fade needs --path: a still picture does not change.");
        return;
    }
    if (o.out.empty()) return;
    if (const auto complaint = complaint_about_picture_names(o.out); !complaint.empty()) refuse(complaint);
}

} // namespace

Command levels_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<LevelsArguments>(LevelsArguments{setup.view_options(), setup.display_options()});
    LevelsArguments& o = *a;
    CLI::App* verb =
        app.add_subcommand("levels", "Draw discrete levels of detail in place of cuts; select levels beforehand");
    add_model_option(*verb, a->model);
    verb->get_option("TREE")->required(false); // the parts have files of their own
    add_value(*verb, "-o,--output", o.out, ending_in({".png", ".pfm", ".exr"}), "OUT.png|.pfm|.exr",
              "The picture in which nothing changes any more: PNG, or PFM or EXR for judging; with --path one for "
              "each frame, FRAMES_%04d.png");
    add_choice<std::optional<LevelView>, LevelView>(
        *verb, "--show", o.show, {{"maps", LevelView::maps}, {"levels", LevelView::levels}},
        "In place of the picture: maps of thresholds, for each layer of depth what the others hide; or the levels");
    verb->add_option("--path", o.path, "As in 'unseen fly' (default: a still view)")
        ->type_name("orbit:D[:N]|walk[:V[:N]]|FILE.csv");
    add_value(*verb, "--fps", o.frames_a_second, within(1, 1e6), "N",
              "With --lights that move: frames a second (default: 60)");
    add_json_option(*verb, o.json);
    add_verbose_option(*verb, o.is_verbose);
    add_methods(*verb, o);
    add_fold_test_option(*verb, o.what.request.fold_test, true);
    add_gaze_option(*verb, o.what.gaze_px);
    add_velocity_option(*verb, o.what.velocity_deg_s);
    setup.act_in(*verb, Setup::view | Setup::parallel | Setup::model | Setup::scenes);
    const Command precompute = precompute_command(*verb, setup), info = selection_info_command(*verb);
    verb->require_subcommand(0, 1);
    verb->callback([=] {
        if (!precompute.parser->parsed() && !info.parser->parsed()) check(*a, !verb->get_option("--fade")->empty());
    });
    verb->footer(
        "Examples:\n  unseen levels museum.glb -o levels.png --show levels --maps rpg99\n"
        "  unseen levels house.glb --method area --bias 0.5 --path orbit:1:90 -o frames/%04d.png --json stats.json\n"
        "  unseen levels precompute spheres.glb --triangles 300k -o spheres.sel\n"
        "  unseen levels spheres.glb --selection spheres.sel --path walk:3:120 --json -");
    return {verb,
            [=]() -> Result<int> {
                if (precompute.parser->parsed()) return precompute.run();
                if (info.parser->parsed()) return info.run();
                if (auto drawn = draw_levels(*a); !drawn) return drawn.error();
                return exit_done;
            },
            level_rules()};
}

} // namespace unseen::app
