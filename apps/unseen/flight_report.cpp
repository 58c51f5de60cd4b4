#include "flight_report.h"

#include <algorithm>
#include <optional>

#include "cut_report.h"
#include "terminal.h"

namespace unseen::app {
namespace {

template <class Value>
std::vector<double> column(const std::vector<FrameRecord>& frames, Value value) {
    std::vector<double> values;
    values.reserve(frames.size());
    for (const FrameRecord& frame : frames) values.push_back(static_cast<double>(value(frame)));
    return values;
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

// Where changes of the cut could be seen. A picture passes if it shows no visible difference from the full model.
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

// "0.12 ms (largest: 1.3 ms)".
std::string middle_and_most(const std::vector<double>& values) {
    return duration(median(values)) + " (largest: " + duration(largest(values)) + ")";
}

} // namespace

std::string to_csv(const std::vector<FrameRecord>& frames) {
    std::string text =
        "frame,triangles,folds,unfolds,changes,node_tests,cut_ms,index_ms,uploaded_bytes,draw_ms,frame_ms,"
        "drawn_triangles,gliding,change_v,flicker_v,picture_v\n";
    for (std::size_t i = 0; i < frames.size(); ++i) {
        const FrameRecord& f = frames[i];
        text += csv_line({i, f.stats.triangles, f.stats.folds, f.stats.unfolds, f.changes(), f.stats.node_tests,
                          f.cut_ms, f.index_ms, f.uploaded_bytes, f.draw_ms, f.frame_ms, f.drawn_triangles, f.gliding,
                          f.change_v, f.flicker_v, f.picture_v});
    }
    return text;
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
    json["effects"] = to_json(last.effects);
    if (!last.passes.empty()) json["passes"] = passes_to_json(last.passes);
    return json;
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
    print(last.effects);
    print_passes(last.passes);
}

} // namespace unseen::app
