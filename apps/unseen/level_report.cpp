#include "level_report.h"

#include <algorithm>

#include "terminal.h"

namespace unseen::app {
namespace {

using session::LevelDecision;
using session::LevelFrame;
using session::LevelMethod;
using session::LevelTest;
using session::LevelTimes;

const char* name_of(LevelMethod method) {
    return method == LevelMethod::distance ? "distance"
           : method == LevelMethod::area   ? "area"
           : method == LevelMethod::given  ? "selection"
                                           : "perceptual";
}

const char* name_of(LevelDecision decision) {
    return decision == LevelDecision::better ? "better" : decision == LevelDecision::worse ? "worse" : "keep";
}

Json to_json(const LevelTimes& times) {
    return {{"layers", times.layers_ms},
            {"combinations", times.combinations_ms},
            {"maps", times.maps_ms},
            {"depth", times.depth_ms},
            {"control", times.control_ms}};
}

std::vector<std::uint64_t> histogram(const std::vector<int>& levels, int count) {
    std::vector<std::uint64_t> objects(static_cast<std::size_t>(count), 0);
    for (const int level : levels)
        if (level >= 0) ++objects[static_cast<std::size_t>(level)];
    return objects;
}

struct Totals {
    std::vector<std::uint64_t> drawn, control; // renderings by level
    std::uint64_t all_drawn = 0, all_control = 0, triangles = 0;
    LevelTimes mean;
    bool has_times = false;

    Totals(const LevelRecords& records, int levels)
        : drawn(static_cast<std::size_t>(levels), 0), control(static_cast<std::size_t>(levels), 0) {
        double timed = 0;
        for (const LevelFrame& frame : records.frames) {
            triangles += frame.triangles;
            const auto of_frame = histogram(frame.levels, levels), tested = histogram(frame.tested_with, levels);
            for (std::size_t level = 0; level < drawn.size(); ++level) {
                drawn[level] += of_frame[level], all_drawn += of_frame[level];
                control[level] += tested[level], all_control += tested[level];
            }
            for (const LevelTimes& t : frame.times) {
                ++timed;
                mean.layers_ms += t.layers_ms, mean.combinations_ms += t.combinations_ms, mean.maps_ms += t.maps_ms;
                mean.depth_ms += t.depth_ms, mean.control_ms += t.control_ms;
            }
        }
        has_times = timed > 0;
        for (double* ms : {&mean.layers_ms, &mean.combinations_ms, &mean.maps_ms, &mean.depth_ms, &mean.control_ms})
            *ms /= std::max(timed, 1.0);
    }
};

Json to_json(const LevelFrame& frame, int levels) {
    Json tests = Json::array();
    for (const LevelTest& test : frame.tests)
        tests.push_back({{"object", test.object},
                         {"level", test.level},
                         {"compared_with", test.compared_with},
                         {"p_pass", test.pixels},
                         {"decision", name_of(test.decision)}});
    Json row = {{"triangles", frame.triangles},
                {"levels", frame.levels},
                {"objects_by_level", histogram(frame.levels, levels)},
                {"changed", frame.changed},
                {"layers", frame.layers},
                {"surface_passes", frame.surface_passes},
                {"full_screen_passes", frame.full_screen_passes},
                {"masked_layers", frame.masked_layers},
                {"shadow_maps", frame.shadow_maps},
                {"shadow_passes", frame.shadow_passes},
                {"texture_bytes", frame.texture_bytes},
                {"tests", std::move(tests)}};
    row["ms"] = frame.times.empty() ? Json() : to_json(frame.times.front());
    return row;
}

} // namespace

Json to_json(const session::Session& session, const session::LevelControl& control, const LevelsArguments& options,
             const LevelRecords& records, int levels) {
    Json json;
    json["method"] = name_of(options.control.method);
    if (options.control.method == LevelMethod::perceptual) {
        json["maps"] = options.control.maps == session::MapRecipe::modern ? "modern" : "rpg99";
        json["layers"] = options.control.layers;
    } else if (options.control.method == LevelMethod::given) {
        json["selection"] = options.selection;
    } else {
        json["bias"] = options.control.bias;
    }
    json["source_triangles"] = session.triangle_count();
    json["settling_frames"] = records.settling_frames;
    json["is_settled"] = control.is_settled();
    json["objects"] = Json::array();
    for (std::size_t i = 0; i < session.scene().objects.size(); ++i) {
        const session::LevelChain& chain = control.chain(i);
        Json triangles = Json::array();
        for (int level = 0; level < chain.size(); ++level) triangles.push_back(chain.triangles(level));
        json["objects"].push_back({{"name", session.scene().objects[i].name}, {"level_triangles", triangles}});
    }
    json["frames"] = Json::array();
    for (const LevelFrame& frame : records.frames) json["frames"].push_back(to_json(frame, levels));
    const Totals totals(records, levels);
    json["totals"] = {{"triangles", totals.triangles},
                      {"renderings_by_level", totals.drawn},
                      {"control_renderings_by_level", totals.control},
                      {"renderings", totals.all_drawn},
                      {"control_renderings", totals.all_control}};
    json["totals"]["mean_ms"] = totals.has_times ? to_json(totals.mean) : Json();
    return json;
}

void print_summary(const LevelsArguments& options, const LevelRecords& records, const session::Session& session,
                   int levels) {
    const Totals totals(records, levels);
    const auto frames = static_cast<std::uint64_t>(records.frames.size());
    print_line(grouped(frames) + (frames == 1 ? " frame, " : " frames, on average ") +
               grouped(totals.triangles / frames) + " of " + grouped(session.triangle_count()) +
               " triangles, by method " + name_of(options.control.method));
    if (records.settling_frames > 0)
        print_line("levels were found in " + grouped(records.settling_frames) +
                   (records.settling_frames == 1 ? " frame" : " frames") + " of the first view");
    std::vector<std::vector<std::string>> rows = {{"level"}, {"drawn"}, {"for control"}};
    for (std::size_t level = 0; level < totals.drawn.size(); ++level) {
        rows[0].push_back(std::to_string(level));
        rows[1].push_back(grouped(totals.drawn[level]));
        rows[2].push_back(grouped(totals.control[level]));
    }
    rows[0].push_back("all"), rows[1].push_back(grouped(totals.all_drawn)),
        rows[2].push_back(grouped(totals.all_control));
    if (options.control.method != LevelMethod::perceptual) rows.pop_back();
    print_table(rows);
    if (!options.is_verbose || !totals.has_times) return;
    print_table({{"on average, ms", ""},
                 {"layers", rounded(totals.mean.layers_ms, 4)},
                 {"combinations", rounded(totals.mean.combinations_ms, 4)},
                 {"maps of thresholds", rounded(totals.mean.maps_ms, 4)},
                 {"depth", rounded(totals.mean.depth_ms, 4)},
                 {"control of levels", rounded(totals.mean.control_ms, 4)}});
}

} // namespace unseen::app
