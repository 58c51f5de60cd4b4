// unseen fly: a camera's path through a scene, with one cut that follows it.
#include <memory>
#include <optional>

#include <unseen/perception/image.h>
#include <unseen/render/renderer.h>
#include <unseen/session/follower.h>
#include <unseen/session_gpu/scene_renderer.h>
#include <unseen/vdtree/internal/stopwatch.h>

#include "camera_path.h"
#include "flight_changes.h"
#include "flight_report.h"
#include "interruption.h"
#include "numbered_pictures.h"
#include "output_files.h"
#include "progress_bar.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

struct FlyArguments {
    ViewOptions& view;
    DisplayOptions& display;
    std::string model = {};
    std::string path = "walk"; // see camera_path.h
    std::string pictures = {}; // a name with one %d (or %04d, ...) for the frame's number; empty: no pictures
    std::string csv = {}, plot = {}, json = {};
    bool draws = false; // even where there are no pictures to write
    bool is_verbose = false;
    bool judges_changes = false; // whether one sees the cut change, frame by frame: draws, see flight_changes.h
    std::optional<double> geomorph_seconds = {}; // that vertices glide for; not set: they jump
    double frames_a_second = 60;                 // of the glides, moving gazes and moving lights
    WhatOptions what = {};
    GazeOptions gaze = {};
    render::DrawOptions draw = {.samples = 1};
};

bool draws_frames(const FlyArguments& options) {
    return options.draws || !options.pictures.empty() || options.judges_changes;
}

// The parts that draw, where anything is drawn.
struct Drawing {
    std::unique_ptr<render::Context> context; // whose place does not change: the others refer to it
    session::SceneRenderer renderer;
};

Result<std::optional<Drawing>> make_drawing(const session::Session& session, std::optional<render::Context> context) {
    if (!context) return std::optional<Drawing>();
    auto kept = std::make_unique<render::Context>(std::move(*context));
    auto renderer = session::SceneRenderer::create(*kept, session);
    if (!renderer) return renderer.error();
    return std::optional<Drawing>(Drawing{std::move(kept), std::move(*renderer)});
}

class FlyThrough {
public:
    FlyThrough(session::Session& session, const vdtree::View& view, const session::Request& request,
               const FlyArguments& options)
        : session_(session), options_(options), view_(view), request_(request), gaze_px_(options.what.gaze_px),
          follower_(session) {}

    Result<void> run(const std::vector<CameraPose>& poses, session::GazePlayer gaze,
                     std::optional<render::Context> context, Pictures& pictures) {
        if (options_.judges_changes) {
            auto made = FlightChanges::create(session_, *context, options_.geomorph_seconds);
            if (!made) return made.error();
            changes_.emplace(std::move(*made));
        }
        auto drawing = make_drawing(session_, std::move(context));
        if (!drawing) return drawing.error();
        if (options_.geomorph_seconds)
            if (auto set = follower_.set_glide(*options_.geomorph_seconds); !set) return set;
        const double frame_s = 1 / options_.frames_a_second;
        if (auto begun = gaze.begin(display(), view_, static_cast<double>(poses.size()) * frame_s, terminal_messages());
            !begun)
            return begun;
        ProgressBar bar("flying");
        const Interruptible until_interrupted;
        for (std::size_t i = 0; i < poses.size() && !until_interrupted.is_interrupted(); ++i) {
            bar(static_cast<double>(i) / static_cast<double>(poses.size()), "frames");
            take(poses[i]);
            request_.reasons = i + 1 == poses.size() || i == 0; // of the last frame; of the first, where interrupted
            session_.set_time(static_cast<double>(i) * frame_s);
            session_.set_gaze(gaze.at(static_cast<double>(i) * frame_s, view_, gaze_px_));
            auto frame = next(*drawing);
            if (!frame) return Error{frame.error().code, "Frame " + std::to_string(i) + ": " + frame.error().message};
            if (!pictures.are_wanted()) continue;
            if (auto written = pictures.write_next(session::code_image(*frame, display())); !written) return written;
        }
        if (const std::string why = *drawing ? (*drawing)->renderer.why_whole() : std::string(); !why.empty())
            print_note("whole index buffers were uploaded: " + why);
        return {};
    }

    const std::vector<FrameRecord>& records() const { return records_; }
    const session::Report& last() const { return last_; }

private:
    const perception::Display& display() const { return session_.observer().display; }

    void take(const CameraPose& pose) {
        view_.eye = pose.eye;
        view_.target = pose.target;
        view_.up = pose.up;
        if (pose.gaze_px) gaze_px_ = pose.gaze_px;
    }

    Result<render::DrawOptions> draw_options() const {
        render::DrawOptions draw = options_.draw;
        draw.background = session_.background();
        // Changes are judged in one model.
        auto lighting = session_.scene().is_of_file()
                            ? Result<std::optional<vdtree::Lighting>>(std::optional<vdtree::Lighting>())
                            : session_.lighting(view_);
        if (!lighting) return lighting.error();
        draw.lighting = std::move(*lighting);
        return draw;
    }

    Result<render::Frame> next(std::optional<Drawing>& drawing) {
        if (options_.geomorph_seconds) follower_.let_pass(1 / options_.frames_a_second);
        const auto draw = draw_options();
        if (!draw) return draw.error();
        if (changes_)
            if (auto drawn = changes_->before(follower_, request_, view_, *draw); !drawn) return drawn.error();
        const auto start = vdtree::Clock::now();
        auto simplified = follower_.follow(view_, request_);
        if (!simplified) return simplified.error();
        if (!request_.reasons) simplified->effects = std::move(last_.effects);
        last_ = std::move(*simplified);
        FrameRecord record;
        record.stats = last_.stats;
        record.cut_ms = last_.adapt_ms;
        if (last_.drawn_triangles) {
            record.drawn_triangles = *last_.drawn_triangles;
            record.gliding = static_cast<double>(last_.gliding);
        }
        Result<render::Frame> frame = render::Frame{};
        if (drawing) {
            frame =
                drawing->renderer.draw(session::drawn_cuts(follower_, session_.scene().objects.size()), view_, *draw);
            if (!frame) return frame;
            record.draw_ms = frame->draw_ms;
            record.uploaded_bytes = static_cast<double>(drawing->renderer.uploaded_bytes());
        } else { // what draws makes indices of its own
            const auto followed = vdtree::Clock::now();
            for (const session::DrawnCut& drawn : session::drawn_cuts(follower_, session_.scene().objects.size()))
                static_cast<void>((drawn.geomorph ? drawn.geomorph->drawn() : *drawn.cut).indices());
            record.index_ms = vdtree::ms_since(followed);
        }
        record.frame_ms = vdtree::ms_since(start);
        if (changes_) {
            const auto judged =
                changes_->after(follower_, request_, view_, *draw, *frame, 1 / options_.frames_a_second);
            if (!judged) return judged.error();
            record.change_v = judged->change.visibility;
            record.flicker_v = judged->change.flicker;
            record.picture_v = judged->picture;
        }
        records_.push_back(record);
        return frame;
    }

    session::Session& session_;
    const FlyArguments& options_;
    vdtree::View view_;
    session::Request request_;
    std::optional<glm::dvec2> gaze_px_; // of the options, or of the path
    session::Follower follower_;
    std::optional<FlightChanges> changes_; // where they are judged
    std::vector<FrameRecord> records_;
    session::Report last_;
};

// What is read and opened before anything that takes long.
struct Preparation {
    CameraPath path;
    session::GazePlayer gaze;
    JsonReport report;
    std::optional<render::Context> context;
};

Result<Preparation> prepare(const FlyArguments& options) {
    std::vector<std::string> inputs = inputs_of(options.model, options.view, options.display);
    inputs.insert(inputs.end(), {options.path, options.gaze.trace});
    auto report = open_report(inputs, {options.plot, options.pictures}, options.json, options.csv);
    if (!report) return report.error();
    auto path = CameraPath::read(options.path, options.view.up.value_or(vdtree::View().up));
    if (!path) return path.error();
    if (path->has_gaze() && (options.what.gaze_px || options.gaze.source != GazeSource::none))
        return Error{ErrorCode::invalid_argument,
                     "'" + options.path +
                         "' says where the viewer looks: leave out --gaze and --gaze-mode, or its columns "
                         "gaze_x and gaze_y."};
    auto gaze = session::GazePlayer::create(options.gaze);
    if (!gaze) return gaze.error();
    std::optional<render::Context> context;
    if (draws_frames(options)) {
        auto made = render::Context::headless();
        if (!made) return made.error();
        context = std::move(*made);
    }
    return Preparation{std::move(*path), std::move(*gaze), std::move(*report), std::move(context)};
}

Result<void> write(const session::Session& session, const FlyThrough& flight, const FlyArguments& options,
                   JsonReport& report) {
    if (auto ok = report.prepare(to_json(session, flight.records(), flight.last()), to_csv(flight.records())); !ok)
        return ok;
    if (!options.plot.empty()) {
        const std::string title = grouped(session.triangle_count()) + " triangles, " + options.path;
        if (auto ok = write_plot(options.plot, plot_of(flight.records(), title)); !ok) return ok;
    }
    return report.publish();
}

// Prints a summary, and writes what was asked for. If the user interrupts it, the rows and pictures so far are kept. Reads
// and checks all files before anything that takes long, such as the fold errors that the fold test may need.
Result<int> run(const FlyArguments& options) {
    auto prepared = prepare(options);
    if (!prepared) return prepared.error();
    auto session = open_session(options.model, options.view, options.display);
    if (!session) return session.error();
    session->set_velocity(options.what.velocity());
    const vdtree::View first_view = make_view(*session, options.view);
    session::Request request = options.what.request_for(session->triangle_count());
    request.purpose = session::Purpose::flight;
    if (const auto ready = session->prepare(first_view, request); !ready) return ready.error();
    if (options.judges_changes && session->scene().is_of_file())
        return Error{ErrorCode::unsupported,
                     "--changes are judged of one model, and '" + options.model + "' is a scene: give --as model."};

    FlyThrough flight(*session, first_view, request, options);
    Pictures pictures(options.pictures);
    const std::vector<CameraPose> poses = prepared->path.poses_from(first_view);
    if (auto flown = flight.run(poses, std::move(prepared->gaze), std::move(prepared->context), pictures); !flown)
        return flown.error();
    if (flight.records().empty()) return exit_done; // interrupted
    if (auto ok = write(*session, flight, options, prepared->report); !ok) return ok.error();
    pictures.keep();
    if (flight.records().size() < poses.size())
        print_note("interrupted after " + grouped(flight.records().size()) + " of " + grouped(poses.size()) +
                   " frames.");
    if (prepared->report.is_on_stdout()) return exit_done;
    print(*session, flight.records(), flight.last(), options.display);
    print_written({options.csv, options.plot, options.json});
    if (!options.pictures.empty())
        print_line("wrote " + grouped(flight.records().size()) + " pictures, " + options.pictures);
    if (options.is_verbose) print_details(flight.records(), flight.last());
    return exit_done;
}

void add_outputs(CLI::App& verb, FlyArguments& o) {
    verb.add_option("-o,--output", o.pictures, "A picture of each frame, with one %d or %04d for its number")
        ->type_name("FRAMES_%04d.png");
    verb.add_option("--csv", o.csv, "A line for each frame: triangles, changes, node tests, times, uploaded bytes")
        ->type_name("FILE.csv");
    add_value(verb, "--plot", o.plot, ending_in({".png"}), "FILE.png",
              "Times, triangles, changes and uploaded bytes over the frames");
    add_json_option(verb, o.json);
    add_verbose_option(verb, o.is_verbose);
}

std::vector<Rule> fly_rules() {
    const std::string judged = "changes are judged in pictures of the model";
    return {{"--fps", Rule::needs_one_of, {"--geomorph", "--changes", "--lights", "--gaze-mode"}},
            {"--no-draw", Rule::excludes, {"-o", "--changes", "--draw"}, "these draw"},
            {"--wireframe", Rule::needs_one_of, {"-o", "--draw"}},
            {"--samples", Rule::needs_one_of, {"-o", "--draw", "--changes"}},
            {"--changes", Rule::excludes, {"--wireframe"}, judged}};
}

} // namespace

Command fly_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<FlyArguments>(FlyArguments{setup.view_options(), setup.display_options()});
    FlyArguments& o = *a;
    CLI::App* verb = app.add_subcommand("fly", "Move through a model or a scene, with one cut that follows the eye");
    add_model_option(*verb, a->model);
    verb->add_option("--path", o.path,
                     "orbit:DEGREES[:FRAMES], around the target, that many degrees a frame (default: once around); "
                     "walk[:METRES_A_SECOND[:FRAMES]], towards the target (default: 1.5 m/s for 60 frames); or a CSV "
                     "file with a header line and the columns eye_x, eye_y, eye_z, target_x, target_y, target_z, "
                     "optionally up_x, up_y, up_z and gaze_x, gaze_y (pixels). Default: walk")
        ->type_name("orbit:D[:N]|walk[:V[:N]]|FILE.csv");
    add_outputs(*verb, o);
    verb->add_flag("--changes", o.judges_changes,
                   "Judge whether the cut can be seen changing from frame to frame, although each picture passes; some "
                   "seconds a frame");
    add_value(*verb, "--fps", o.frames_a_second, within(1, 1e6), "N",
              "Frames a second of the path, for all that takes time: glides, changes, lights, gazes (default: 60)");
    verb->add_flag("--draw", o.draws, "Draw the frames even where no -o keeps them, to time that");
    verb->add_flag("--no-draw")->group(""); // the default
    add_samples_option(*verb, o.draw.samples, "1; with --changes 64");
    verb->add_flag("--wireframe", o.draw.wireframe, "Draw the triangles' edges, too");
    std::vector<Rule> rules = fly_rules();
    add_geomorph_option(*verb, o.geomorph_seconds, rules);
    add_what_options(*verb, o.what, rules);
    add_moving_gaze_options(*verb, o.gaze, false, rules);
    setup.act_in(*verb, Setup::view | Setup::parallel | Setup::two_eyes | Setup::model | Setup::scenes);
    verb->callback([&o, samples = verb->get_option("--samples")] {
        if (samples->empty() && o.judges_changes) o.draw.samples = samples_to_judge;
        if (o.pictures.empty()) return;
        if (const auto complaint = complaint_about_picture_names(o.pictures); !complaint.empty()) refuse(complaint);
    });
    verb->footer("Examples:\n  unseen fly dragon.vdt --path orbit:1 --csv orbit.csv --plot orbit.png\n"
                 "  unseen fly dragon.vdt --path flight.csv -o frames/%04d.png --quality good\n"
                 "  unseen fly dragon.vdt --path orbit:1 --gaze-mode simulated --tracker seed=7,error=0.5,latency=50\n"
                 "  unseen fly dragon.vdt --path orbit:0:240 --lights lights.json --fps 60 --csv light.csv\n"
                 "  unseen fly dragon.vdt --path orbit:1 -o frames/%04d.png --triangles 20k --geomorph 0.25 --fps 60\n"
                 "  unseen fly dragon.vdt --path orbit:1:60 --changes --gaze 1603 512 --csv changes.csv\n"
                 "  unseen fly museum.glb --path walk:1.5:120 --csv walk.csv --json -");
    return {verb, [a] { return run(*a); }, std::move(rules)};
}

} // namespace unseen::app
