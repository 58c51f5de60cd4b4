#include <algorithm>
#include <filesystem>
#include <memory>
#include <numeric>
#include <optional>

#include <unseen/session_gpu/as_seen.h>
#include <unseen/session_gpu/level_control.h>
#include <unseen/session_gpu/picture_judge.h>

#include "bench_tools.h"
#include "benches.h"
#include "level_cuts.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using session::LevelControl;
using session::LevelMethod;

// A way to make less of a scene, and what came of it.
struct Row {
    std::string method;
    double seconds = 0; // to choose, from nothing, without what is measured once
    double triangles = 0;
    session::PictureVerdict verdict = {};
    std::vector<session::Effect> passes = {};
};

class JudgedScene {
public:
    JudgedScene(const render::Context& context, const std::string& file, const ScenesOptions& options)
        : name(std::filesystem::path(file).stem().string()), session(load(file, options)), context_(context) {
        view.width = view.height = options.window_px;
        view = *session.camera_view(view);
        require(session.prepare(view, {.purpose = session::Purpose::picture}));
        const int samples = options.quick ? 16 : 64; // a pixel of what is judged
        judge_ = std::make_unique<session::PictureJudge>(
            require(session::PictureJudge::create(context, session, view, samples)));
    }

    Row judge(const std::string& method, const std::vector<vdtree::Cut>& cuts, double seconds = 0) {
        Row row{.method = method, .seconds = seconds, .verdict = require(judge_->judge(cuts))};
        for (const vdtree::Cut& cut : cuts) row.triangles += cut.triangle_count();
        return row;
    }
    Row judge(const std::string& method, const LevelControl& control, const session::LevelFrame& frame,
              double seconds = 0) {
        return judge(method, level_cuts(session, control, frame), seconds);
    }
    Row as_seen(const std::string& method, const session::AsSeenOptions& how, double threshold = 1) {
        const auto start = BenchClock::now();
        const session::Request request{.goal = Goal::up_to(threshold), .purpose = session::Purpose::picture};
        const auto made = require(session::simplify_as_seen(session, context_, view, request, how));
        Row row = judge(method, made.cuts, seconds_since(start));
        row.passes = made.passes;
        return row;
    }
    LevelControl levels(const session::LevelControlOptions& how) {
        return require(LevelControl::create(context_, session, view, how));
    }

    std::string name;
    session::Session session;
    vdtree::View view;

private:
    static session::Session load(const std::string& file, const ScenesOptions& options) {
        session::LoadOptions how;
        how.as = session::LoadAs::scene;
        session::Scene scene = require(session::Scene::load(file, how));
        if (!options.has_shadows && scene.lights) require(scene.lights->set_shadows(false));
        if (!scene.camera)
            throw BenchFailure{
                {ErrorCode::invalid_argument, "'" + file + "' has no camera: the views of scenes are theirs."}};
        return require(session::Session::create(std::move(scene)));
    }

    const render::Context& context_;
    std::unique_ptr<session::PictureJudge> judge_;
};

// ---- triangles and what shows

// The fewest triangles at which nothing shows, by bisection, as if less always showed more. `tried`: the row of a value
// between `low` and `high`, of which larger ones leave less. If something shows at all of them, the row of the least.
template <class Tried>
Row without_visible_pixels(double low, double high, int steps, Tried&& tried) {
    std::optional<Row> best;
    const double least = bisect(low, high, steps, [&](double value) {
        Row row = tried(value);
        const bool shows_nothing = row.verdict.visible_pixels == 0;
        if (shows_nothing && (!best || row.triangles < best->triangles)) best = std::move(row);
        return shows_nothing;
    });
    return best ? std::move(*best) : tried(least);
}

std::vector<Row> rows_of(JudgedScene& scene) {
    std::vector<Row> rows;
    rows.push_back(scene.as_seen("tree", {.folds_hidden = false}));
    rows.push_back(scene.as_seen("tree, without what the picture hides", {}));
    const double least = rows.back().triangles;
    const auto hiding = [&](double threshold) {
        return scene.as_seen("tree, without what the picture hides, where nothing shows", {}, threshold);
    };
    rows.push_back(hiding(1));
    if (rows.back().verdict.visible_pixels == 0) {
        rows.back() = without_visible_pixels(1, 64, 6, hiding);
        rows.back().seconds = 0;
    }
    for (const auto& [recipe, name] : {std::pair{session::MapRecipe::modern, "levels by masking, modern maps"},
                                       {session::MapRecipe::rpg99, "levels by masking, rpg99 maps"}}) {
        const auto start = BenchClock::now();
        LevelControl control = scene.levels({.maps = recipe});
        const session::LevelFrame frame = require(control.settle(scene.view));
        rows.push_back(scene.judge(name, control, frame, seconds_since(start)));
    }
    for (const auto& [method, name] :
         {std::pair{LevelMethod::distance, "levels by distance"}, {LevelMethod::area, "levels by area"}}) {
        LevelControl control = scene.levels({.method = method});
        const auto draw = [&](double bias) {
            control.set_bias(bias);
            return require(control.draw(scene.view));
        };
        const auto start = BenchClock::now();
        // The finest bias that keeps to the budget.
        const session::LevelFrame frame = draw(
            bisect(1e-4, 1e4, 24, [&](double bias) { return static_cast<double>(draw(bias).triangles) <= least; }));
        rows.push_back(scene.judge(name + std::string(", in as many triangles"), control, frame, seconds_since(start)));
        // Smaller biases leave less.
        rows.push_back(without_visible_pixels(1e-4, 1e4, 7, [&](double inverse) {
            return scene.judge(name + std::string(", where nothing shows"), control, draw(1 / inverse));
        }));
    }
    return rows;
}

BenchTable table_of(const JudgedScene& scene, const std::vector<Row>& rows) {
    const auto all = static_cast<double>(scene.session.triangle_count());
    BenchTable table{scene.name + ", " + count(all).text + " triangles",
                     {{"method", "method"},
                      {"triangles", "triangles"},
                      {"of all", "share"},
                      {"visible pixels", "visible_pixels"},
                      {"V", "v"},
                      {"second judge: pixels", "second_visible_pixels"},
                      {"V", "second_v"},
                      {"s", "seconds"}}};
    for (const Row& r : rows)
        table.rows.push_back({r.method, count(r.triangles), percent(r.triangles / all, 3),
                              count(static_cast<double>(r.verdict.visible_pixels)), number(r.verdict.v, 2),
                              count(static_cast<double>(r.verdict.second_visible_pixels)),
                              number(r.verdict.second_v, 2), r.seconds > 0 ? number(r.seconds, 2) : Cell("", 0)});
    return table;
}

// ---- the walk: renderings by level, and times

constexpr double session::LevelTimes::*level_times[] = {
    &session::LevelTimes::layers_ms, &session::LevelTimes::combinations_ms, &session::LevelTimes::maps_ms,
    &session::LevelTimes::depth_ms, &session::LevelTimes::control_ms};

struct Walk {
    std::string scene;
    std::vector<double> shown, controlled; // renderings by level
    session::LevelTimes times;             // means, milliseconds
    double frame_ms = 0;                   // wall-clock
    double texture_bytes = 0;
};

// Forwards by a tenth of the way to what the camera looks at.
Walk walk(JudgedScene& scene, int frames) {
    LevelControl control = scene.levels({.maps = session::MapRecipe::rpg99});
    require(control.settle(scene.view));
    Walk walk;
    walk.scene = scene.name;
    double timed = 0;
    const auto take = [&](const session::LevelFrame& frame) {
        for (const session::LevelTimes& t : frame.times) {
            ++timed;
            for (const auto ms : level_times) walk.times.*ms += t.*ms;
        }
    };
    const auto add_to = [](std::vector<double>& by_level, const std::vector<int>& levels) {
        for (const int level : levels) {
            if (level < 0) continue;
            by_level.resize(std::max(by_level.size(), static_cast<std::size_t>(level) + 1));
            ++by_level[static_cast<std::size_t>(level)];
        }
    };
    const auto start = BenchClock::now();
    for (int i = 0; i < frames; ++i) {
        constexpr double way = 0.1;
        vdtree::View view = scene.view;
        view.eye += way * ((i + 1.0) / frames) * (view.target - view.eye);
        const session::LevelFrame frame = require(control.draw(view));
        take(frame);
        walk.texture_bytes = std::max(walk.texture_bytes, static_cast<double>(frame.texture_bytes));
        add_to(walk.shown, frame.levels);
        add_to(walk.controlled, frame.tested_with);
        take(require(control.wait()));
    }
    walk.frame_ms = 1e3 * seconds_since(start) / frames;
    for (const auto ms : level_times) walk.times.*ms *= 1 / std::max(timed, 1.0);
    return walk;
}

BenchTable renderings_table(const std::vector<Walk>& walks) {
    BenchTable table{"Renderings by level", {{"scene", "scene"}, {"for", "renderings_for"}}};
    std::size_t levels = 1;
    for (const Walk& walk : walks) levels = std::max({levels, walk.shown.size(), walk.controlled.size()});
    for (std::size_t i = 0; i < levels; ++i)
        table.columns.push_back({"level " + std::to_string(i), "level_" + std::to_string(i)});
    table.columns.push_back({"all", "all"});
    for (const Walk& walk : walks)
        for (const bool is_control : {true, false}) {
            auto by_level = is_control ? walk.controlled : walk.shown;
            by_level.resize(levels);
            std::vector<Cell>& row =
                table.rows.emplace_back(std::vector<Cell>{walk.scene, is_control ? "control" : "display"});
            for (const double renderings : by_level) row.push_back(count(renderings));
            row.push_back(count(std::accumulate(by_level.begin(), by_level.end(), 0.0)));
        }
    return table;
}

BenchTable times_table(const std::vector<Walk>& walks) {
    BenchTable table{"Milliseconds a frame of levels by masking",
                     {{"scene", "scene"},
                      {"all", "frame_ms"},
                      {"layers", "layers_ms"},
                      {"combinations", "combinations_ms"},
                      {"maps", "maps_ms"},
                      {"depth", "depth_ms"},
                      {"control", "control_ms"},
                      {"textures, MB", "texture_mb"}}};
    for (const Walk& walk : walks) {
        std::vector<Cell>& row = table.rows.emplace_back(std::vector<Cell>{walk.scene, number(walk.frame_ms, 3)});
        for (const auto ms : level_times) row.push_back(number(walk.times.*ms, 3));
        row.push_back(number(walk.texture_bytes / 1e6, 3));
    }
    return table;
}

} // namespace

BenchReport bench_scenes(const ScenesOptions& options) {
    const BenchFolder folder;
    const std::vector<std::string> files =
        options.inputs.empty() ? make_scenes(folder, options.triangles) : options.inputs;
    const render::Context context = require(render::Context::headless());
    BenchReport report;
    std::vector<Walk> walks;
    BenchTable passes{"What is drawn for a cut, and why",
                      {{"scene"}, {"effect"}, {}, {"why"}, {"drawings"}, {"textures, MB"}, {"ms"}}};
    for (const std::string& file : files) {
        JudgedScene scene(context, file, options);
        const std::vector<Row> rows = rows_of(scene);
        report.tables.push_back(table_of(scene, rows));
        constexpr std::size_t by_picture = 1; // of the tree, without what the picture hides
        for (const session::Effect& e : rows[by_picture].passes)
            passes.rows.push_back({scene.name, e.name, e.on ? "on" : "off", e.why, std::to_string(e.surface_passes),
                                   number(static_cast<double>(e.texture_bytes) / 1e6, 3), number(e.milliseconds, 3)});
        walks.push_back(walk(scene, options.quick ? 6 : 24));
    }
    report.tables.insert(report.tables.end(), {std::move(passes), renderings_table(walks), times_table(walks)});
    return report;
}

} // namespace unseen::app
