#include "level_flight.h"

#include <algorithm>
#include <utility>
#include <vector>

#include <unseen/render/internal/layers.h>
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

namespace unseen::app {
namespace {

using session::LevelControl;
using session::LevelMethod;
using session::SelectionFollower;

// Follows the file of selected levels, for the levels that are drawn.
Result<SelectionFollower> follower_of(session::Selections selections, const session::Session& session,
                                      const LevelControl& control, const LevelFlightOptions& options) {
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
                                      const vdtree::View& view, const LevelFlightOptions& options) {
        session::LevelControlOptions control_options = options.control;
        std::optional<session::Selections> selections;
        if (control_options.method == LevelMethod::given) {
            auto read = session::read_selections(options.selection);
            if (!read) return read.error();
            selections = std::move(*read);
            control_options.chain.levels = selections->levels;
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
    LevelFlight(session::Session& session, const LevelFlightOptions& options, LevelControl control,
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
    const LevelFlightOptions* options_;
    LevelControl control_;
    vdtree::View view_;
    std::optional<SelectionFollower> follower_; // of selections
    std::size_t over_budget_ = 0;
    LevelRecords records_;
};

void print(const LevelFlightOptions& options, const LevelFlight& flight, const session::Session& session,
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

} // namespace

Result<void> draw_levels(const std::string& model, const ViewOptions& view_options, const DisplayOptions& display,
                         const LevelFlightOptions& options) {
    std::vector<std::string> inputs = inputs_of(model, view_options, display);
    inputs.insert(inputs.end(), {options.selection, options.path});
    if (const auto ready = check_outputs(inputs, {options.json, options.out}); !ready) return ready;
    std::optional<CameraPath> path;
    if (!options.path.empty()) {
        auto read = CameraPath::read(options.path, view_options.up.value_or(vdtree::View().up));
        if (!read) return read.error();
        path = std::move(*read);
    }
    auto report = JsonReport::open(options.json);
    if (!report) return report.error();
    const auto context = render::Context::headless();
    if (!context) return context.error();
    auto session = open_session(model, view_options, display);
    if (!session) return session.error();
    session->set_velocity(options.what.velocity());
    if (options.what.gaze_px) session->set_gaze(session::Gaze{*options.what.gaze_px});
    const vdtree::View view = make_view(*session, view_options);
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

} // namespace unseen::app
