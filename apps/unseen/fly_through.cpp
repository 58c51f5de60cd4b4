#include "fly_through.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>

#include <panel_plot.h>
#include <unseen/perception/image.h>
#include <unseen/session/follower.h>
#include <unseen/session_gpu/frame_image.h>
#include <unseen/session_gpu/scene_renderer.h>
#include <unseen/vdtree/internal/atomic_file.h>
#include <unseen/vdtree/internal/stopwatch.h>

#include "camera_path.h"
#include "cut_report.h"
#include "flight_changes.h"
#include "interruption.h"
#include "numbered_pictures.h"
#include "output_files.h"
#include "progress_bar.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr double not_drawn = std::numeric_limits<double>::quiet_NaN();

bool draws_frames(const FlyThroughOptions& options) {
    return options.draws.value_or(!options.pictures.empty() || options.judges_changes);
}

// What one frame came to. Times in milliseconds of the wall clock.
struct FrameRecord {
    vdtree::AdjustStats stats;
    double cut_ms = 0, index_ms = 0; // the cut with its patches, and gathering where patches did not do
    double draw_ms = not_drawn, frame_ms = 0;
    double uploaded_bytes = not_drawn;
    double drawn_triangles = not_drawn, gliding = not_drawn;                   // of geomorphs
    double change_v = not_drawn, flicker_v = not_drawn, picture_v = not_drawn; // where changes are judged

    std::uint64_t changes() const { return stats.folds + stats.unfolds; }
};

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

std::string cell(double value) { return std::isfinite(value) ? shortest(value) : std::string(); }

std::string to_csv(const std::vector<FrameRecord>& frames) {
    std::string text =
        "frame,triangles,folds,unfolds,changes,node_tests,cut_ms,index_ms,uploaded_bytes,draw_ms,frame_ms,"
        "drawn_triangles,gliding,change_v,flicker_v,picture_v\n";
    for (std::size_t i = 0; i < frames.size(); ++i) {
        const FrameRecord& f = frames[i];
        text += std::to_string(i) + "," + std::to_string(f.stats.triangles) + "," + std::to_string(f.stats.folds) +
                "," + std::to_string(f.stats.unfolds) + "," + std::to_string(f.changes()) + "," +
                std::to_string(f.stats.node_tests) + "," + cell(f.cut_ms) + "," + cell(f.index_ms) + "," +
                cell(f.uploaded_bytes) + "," + cell(f.draw_ms) + "," + cell(f.frame_ms) + "," +
                cell(f.drawn_triangles) + "," + cell(f.gliding) + "," + cell(f.change_v) + "," + cell(f.flicker_v) +
                "," + cell(f.picture_v) + "\n";
    }
    return text;
}

template <class Value>
std::vector<double> column(const std::vector<FrameRecord>& frames, Value value) {
    std::vector<double> values;
    values.reserve(frames.size());
    for (const FrameRecord& frame : frames) values.push_back(static_cast<double>(value(frame)));
    return values;
}

PanelPlot plot_of(const std::vector<FrameRecord>& frames, const std::string& title) {
    PanelPlot plot;
    plot.title = title;
    plot.x_label = "frame";
    plot.settled_from = 1; // the first frame makes the cut, which the others only change
    plot.panels = {
        {"cut and index buffer, ms",
         {0.75f, 0.2f, 0.1f},
         column(frames, [](auto& f) { return f.cut_ms + f.index_ms; })},
        {"triangles", {0.1f, 0.35f, 0.75f}, column(frames, [](auto& f) { return f.stats.triangles; })},
        {"changes (folds and unfolds)", {0.1f, 0.55f, 0.25f}, column(frames, [](auto& f) { return f.changes(); })}};
    if (!frames.empty() && !std::isnan(frames.front().frame_ms) && !std::isnan(frames.front().draw_ms)) {
        plot.panels.insert(plot.panels.begin(),
                           {"frame, ms", {0.35f, 0.2f, 0.5f}, column(frames, [](auto& f) { return f.frame_ms; })});
        plot.panels.push_back(
            {"uploaded bytes", {0.7f, 0.45f, 0.0f}, column(frames, [](auto& f) { return f.uploaded_bytes; })});
    }
    return plot;
}

double median(std::vector<double> values) {
    values.erase(std::remove_if(values.begin(), values.end(), [](double v) { return !std::isfinite(v); }),
                 values.end());
    if (values.empty()) return not_drawn;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

double largest(const std::vector<double>& values) {
    double most = not_drawn;
    for (const double v : values) most = std::fmax(most, v);
    return most;
}

// The columns of the summary: their names in JSON, for people, and their values. Frames after the first: that one makes
// the cut.
struct Measure {
    const char* key;
    const char* label;
    std::vector<double> values;
};

std::vector<Measure> measures_of(const std::vector<FrameRecord>& frames) {
    const std::vector<FrameRecord> later(frames.begin() + (frames.size() > 1 ? 1 : 0), frames.end());
    return {{"triangles", "triangles", column(later, [](auto& f) { return f.stats.triangles; })},
            {"changes", "changes", column(later, [](auto& f) { return f.changes(); })},
            {"node_tests", "nodes tested", column(later, [](auto& f) { return f.stats.node_tests; })},
            {"cut_ms", "cut, ms", column(later, [](auto& f) { return f.cut_ms; })},
            {"index_ms", "index buffer, ms", column(later, [](auto& f) { return f.index_ms; })},
            {"uploaded_bytes", "uploaded bytes", column(later, [](auto& f) { return f.uploaded_bytes; })},
            {"draw_ms", "drawn in, ms", column(later, [](auto& f) { return f.draw_ms; })},
            {"frame_ms", "frame, ms", column(later, [](auto& f) { return f.frame_ms; })},
            {"drawn_triangles", "drawn triangles", column(later, [](auto& f) { return f.drawn_triangles; })},
            {"gliding", "gliding vertices", column(later, [](auto& f) { return f.gliding; })}};
}

// What was seen of the cut's changes. A picture passes where it shows no visible difference from the full model.
struct SeenChanges {
    std::size_t judged = 0, seen = 0, although_pictures_pass = 0, failing_pictures = 0;
    double largest_v = 0, largest_flicker = 0;
    std::size_t frame = 0; // of the largest

    static std::optional<SeenChanges> of(const std::vector<FrameRecord>& frames) {
        if (frames.empty() || std::isnan(frames.front().picture_v)) return std::nullopt;
        SeenChanges s;
        for (std::size_t i = 0; i < frames.size(); ++i) {
            const FrameRecord& f = frames[i];
            s.failing_pictures += !(f.picture_v < 1);
            if (i == 0) continue; // makes the cut
            ++s.judged;
            if (!(f.change_v <= s.largest_v)) s.largest_v = f.change_v, s.frame = i;
            s.largest_flicker = std::fmax(s.largest_flicker, f.flicker_v);
            if (f.change_v < 1) continue;
            ++s.seen;
            s.although_pictures_pass += f.picture_v < 1 && frames[i - 1].picture_v < 1;
        }
        return s;
    }
};

std::string to_text(const SeenChanges& s, bool glides) {
    const std::string what = glides ? "glides of the cut" : "changes of the cut";
    const std::string most = "V up to " + rounded(s.largest_v, 3) +
                             (s.largest_v > 0 ? " in frame " + std::to_string(s.frame) : std::string());
    if (s.seen == 0) return "no " + what + " could be seen from frame to frame (" + most + ")";
    return what + " could be seen in " + grouped(s.seen) + " of " + grouped(s.judged) + " frames (" + most + "), in " +
           grouped(s.although_pictures_pass) + " of them although the pictures before and after pass";
}

Json to_json(const session::Session& session, const std::vector<FrameRecord>& frames, const session::Report& last) {
    Json json = {{"source_triangles", session.triangle_count()},
                 {"frames", frames.size()},
                 {"first_cut_ms", number_or_null(frames.front().cut_ms + frames.front().index_ms)}};
    for (const Measure& m : measures_of(frames))
        json[m.key] = {{"median", number_or_null(median(m.values))}, {"largest", number_or_null(largest(m.values))}};
    if (const auto seen = SeenChanges::of(frames))
        json["changes_seen"] = {{"judged", seen->judged},
                                {"seen", seen->seen},
                                {"although_pictures_pass", seen->although_pictures_pass},
                                {"failing_pictures", seen->failing_pictures},
                                {"largest_v", number_or_null(seen->largest_v)},
                                {"largest_flicker", number_or_null(seen->largest_flicker)},
                                {"frame", seen->frame}};
    json["imperceptible_from_m"] = number_or_null(last.imperceptible_from_m);
    json["effects"] = app::to_json(last.effects);
    if (!last.passes.empty()) json["passes"] = app::to_json(last.passes);
    return json;
}

// "0.12 ms (largest: 1.3 ms)".
std::string middle_and_most(const std::vector<double>& values) {
    return duration(median(values)) + " (largest: " + duration(largest(values)) + ")";
}

void print(const session::Session& session, const std::vector<FrameRecord>& frames, const session::Report& last,
           const DisplayOptions& display) {
    const auto kept = static_cast<std::uint64_t>(median(column(frames, [](auto& f) { return f.stats.triangles; })));
    print_line(grouped(frames.size()) + " frames; the median frame " + kept_text(kept, session.triangle_count()));
    print_line("in the median frame, the cut took " +
               middle_and_most(column(frames, [](auto& f) { return f.cut_ms + f.index_ms; })) +
               (std::isnan(frames.back().draw_ms)
                    ? ", and nothing was drawn"
                    : " and drawing " + middle_and_most(column(frames, [](auto& f) { return f.draw_ms; }))));
    print_line(visibility_text(last, session.observer(), display, "in the last frame"));
    const auto is_shadowed = [](const session::Effect& effect) { return effect.name == "shadows" && effect.on; };
    if (std::ranges::any_of(last.effects, is_shadowed))
        print_line(
            "that holds for shadows of pictures with many samples a pixel; with one, as in flights, their edges may "
            "move by a texel");
    if (const auto seen = SeenChanges::of(frames)) print_line(to_text(*seen, !std::isnan(frames.back().gliding)));
}

void print_details(const std::vector<FrameRecord>& frames, const session::Report& last) {
    print_table({{"first cut", duration(frames.front().cut_ms + frames.front().index_ms)}});
    std::vector<std::vector<std::string>> rows = {{"of the later frames", "median", "largest"}};
    for (const Measure& m : measures_of(frames))
        if (std::isfinite(median(m.values)))
            rows.push_back({m.label, rounded(median(m.values), 4), rounded(largest(m.values), 4)});
    print_table(rows);
    print_line("effects of the last frame");
    app::print(last.effects);
    app::print(last.passes);
}

class FlyThrough {
public:
    FlyThrough(session::Session& session, const vdtree::View& view, const session::Request& request,
               const FlyThroughOptions& options)
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
        // Of one model, whose changes are judged.
        auto lighting = session_.scene().is_of_file()
                            ? Result<std::optional<vdtree::Lighting>>(std::optional<vdtree::Lighting>())
                            : session_.lighting(view_);
        if (!lighting) return lighting.error();
        draw.lighting = std::move(*lighting);
        return draw;
    }

    Result<render::Frame> next(std::optional<Drawing>& drawing) {
        if (options_.geomorph_seconds) follower_.let_pass(1 / options_.frames_a_second);
        if (changes_) {
            const auto draw = draw_options();
            if (!draw) return draw.error();
            if (auto drawn = changes_->before(follower_, request_, view_, *draw); !drawn) return drawn.error();
        }
        const auto start = vdtree::Clock::now();
        auto simplified = follower_.follow(view_, request_);
        if (!simplified) return simplified.error();
        if (!request_.reasons) simplified->effects = std::move(last_.effects);
        last_ = std::move(*simplified);
        FrameRecord record;
        record.stats = last_.stats;
        record.cut_ms = last_.adapt_ms;
        record.index_ms = last_.extract_ms;
        if (last_.drawn_triangles) {
            record.drawn_triangles = *last_.drawn_triangles;
            record.gliding = static_cast<double>(last_.gliding);
        }
        Result<render::Frame> frame = render::Frame{};
        if (drawing) {
            const auto draw = draw_options();
            if (!draw) return draw.error();
            const auto cuts = session::drawn_cuts(follower_, session_.scene().objects.size());
            if (draws_frames(options_)) {
                frame = drawing->renderer.draw(cuts, view_, *draw);
                if (!frame) return frame;
                record.draw_ms = frame->draw_ms;
                record.uploaded_bytes = static_cast<double>(drawing->renderer.uploaded_bytes());
            }
        }
        record.frame_ms = vdtree::ms_since(start);
        if (changes_) {
            const auto draw = draw_options();
            if (!draw) return draw.error();
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
    const FlyThroughOptions& options_;
    vdtree::View view_;
    session::Request request_;
    std::optional<glm::dvec2> gaze_px_; // of the options, or of the path
    session::Follower follower_;
    std::optional<FlightChanges> changes_; // where they are judged
    std::vector<FrameRecord> records_;
    session::Report last_;
};

} // namespace

Result<void> fly_through(const std::string& model, const ViewOptions& view, const DisplayOptions& display,
                         const FlyThroughOptions& options) {
    std::vector<std::string> inputs = inputs_of(model, view, display);
    inputs.insert(inputs.end(), {options.path, options.gaze.trace});
    if (const auto ready = check_outputs(inputs, {options.csv, options.plot, options.json, options.pictures}); !ready)
        return ready;
    const auto path = CameraPath::read(options.path, view.up.value_or(vdtree::View().up));
    if (!path) return path.error();
    if (path->has_gaze() && (options.what.gaze_px || options.gaze.source != GazeSource::none))
        return Error{ErrorCode::invalid_argument, "'" + options.path +
                                                      "' says where the viewer looks: leave --gaze, --gaze-mode and "
                                                      "--gaze-trace away, or its columns gaze_x and gaze_y."};
    auto gaze = session::GazePlayer::create(options.gaze);
    if (!gaze) return gaze.error();
    auto report = JsonReport::open(options.json);
    if (!report) return report.error();
    auto opened = open_if_named(options.csv);
    if (!opened) return opened.error();
    std::optional<vdtree::AtomicFile> csv = std::move(*opened);
    std::optional<render::Context> context;
    if (draws_frames(options)) {
        auto made = render::Context::headless();
        if (!made) return made.error();
        context = std::move(*made);
    }
    auto session = open_session(model, view, display);
    if (!session) return session.error();
    session->set_velocity(options.what.velocity());
    const vdtree::View first_view = make_view(*session, view);
    session::Request request = options.what.request_for(session->triangle_count());
    request.purpose = session::Purpose::picture;
    if (const auto ready = session->prepare(first_view, request); !ready) return ready.error();

    if (options.judges_changes && session->scene().is_of_file())
        return Error{ErrorCode::unsupported,
                     "--changes are judged of one model, and '" + model + "' is a scene: give --as model."};
    FlyThrough flight(*session, first_view, request, options);
    Pictures pictures(options.pictures);
    const std::vector<CameraPose> poses = path->poses_from(first_view);
    if (auto flown = flight.run(poses, std::move(*gaze), std::move(context), pictures); !flown) return flown;
    if (flight.records().empty()) return {}; // interrupted
    if (csv)
        if (auto ok = csv->write(to_csv(flight.records())); !ok) return ok;
    if (auto ok = report->prepare(to_json(*session, flight.records(), flight.last())); !ok) return ok;
    if (!options.plot.empty()) {
        const std::string title = grouped(session->triangle_count()) + " triangles, " + options.path;
        if (auto ok = write_plot(options.plot, plot_of(flight.records(), title)); !ok) return ok;
    }
    if (csv)
        if (auto ok = csv->commit(); !ok) return ok;
    if (auto ok = report->publish(); !ok) return ok;
    pictures.keep();
    if (flight.records().size() < poses.size())
        print_note("interrupted after " + grouped(flight.records().size()) + " of " + grouped(poses.size()) +
                   " frames.");
    if (report->is_on_stdout()) return {};
    print(*session, flight.records(), flight.last(), display);
    print_written({options.csv, options.plot, options.json});
    if (!options.pictures.empty())
        print_line("wrote " + grouped(flight.records().size()) + " pictures, " + options.pictures);
    if (options.is_verbose) print_details(flight.records(), flight.last());
    return {};
}

} // namespace unseen::app
