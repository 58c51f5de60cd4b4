#include "scenes_bench.h"

#include <cmath>
#include <filesystem>
#include <functional>
#include <numeric>
#include <optional>
#include <utility>

#include <unseen/session/session.h>
#include <unseen/session_gpu/as_seen.h>
#include <unseen/session_gpu/level_control.h>
#include <unseen/session_gpu/picture_judge.h>

#include "bench_tools.h"
#include "level_cuts.h"
#include "made_scenes.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using session::LevelControl;
using session::LevelMethod;

// A way to make less of a scene, and what came of it.
struct Row {
    std::string method;
    std::uint64_t triangles = 0;
    std::uint64_t visible = 0, second_visible = 0; // pixels, by both judges
    double v = 0, second_v = 0;
    double seconds = 0; // to choose, from nothing, without what is measured once
    std::vector<session::PassEffect> passes = {};
};

constexpr const char* most_asked_for = "tree, masked, without what the picture hides";

class JudgedScene {
public:
    static Result<JudgedScene> create(const render::Context& context, const std::string& file,
                                      const ScenesBenchOptions& options) {
        session::LoadOptions load;
        load.as = session::LoadAs::scene;
        auto scene = session::Scene::load(file, load);
        if (!scene) return scene.error();
        if (!options.has_shadows && scene->lights)
            if (auto set = scene->lights->set_shadows(false); !set) return set.error();
        if (!scene->camera)
            return Error{ErrorCode::invalid_argument, "'" + file + "' has no camera: the views of scenes are theirs."};
        auto session = session::Session::create(std::move(*scene));
        if (!session) return session.error();
        vdtree::View window;
        window.width = window.height = options.window_px;
        const vdtree::View view = *session->camera_view(window);
        JudgedScene judged(context, std::filesystem::path(file).stem().string(),
                           std::make_unique<session::Session>(std::move(*session)), view, options);
        if (auto ready = judged.prepare(); !ready) return ready.error();
        return judged;
    }

    const std::string& name() const { return name_; }
    session::Session& session() const { return *session_; }
    const vdtree::View& view() const { return view_; }

    Result<Row> judge(std::string method, const std::vector<vdtree::Cut>& cuts, double seconds) {
        const auto verdict = judge_->judge(cuts);
        if (!verdict) return verdict.error();
        Row row{.method = std::move(method), .seconds = seconds};
        for (const vdtree::Cut& cut : cuts) row.triangles += cut.triangle_count();
        row.visible = verdict->visible, row.v = verdict->v;
        row.second_visible = verdict->second_visible, row.second_v = verdict->second_v;
        return row;
    }

    Result<Row> as_seen(std::string method, const session::AsSeenOptions& how, double threshold = 1) {
        const auto start = BenchClock::now();
        session::Request request{.threshold = threshold, .purpose = session::Purpose::picture};
        auto made = session::simplify_as_seen(*session_, context_, view_, request, how);
        if (!made) return made.error();
        auto row = judge(std::move(method), made->cuts, seconds_since(start));
        if (row) row->passes = std::move(made->passes);
        return row;
    }

    std::vector<vdtree::Cut> cuts_of(const LevelControl& control, const session::LevelFrame& frame) const {
        return level_cuts(*session_, control, frame);
    }

    Result<LevelControl> levels(const session::LevelControlOptions& how) const {
        return LevelControl::create(context_, *session_, view_, how);
    }

private:
    JudgedScene(const render::Context& context, std::string name, std::unique_ptr<session::Session> session,
                const vdtree::View& view, const ScenesBenchOptions& options)
        : context_(context), name_(std::move(name)), session_(std::move(session)), view_(view), options_(options) {}

    // Measures, and draws the full scene.
    Result<void> prepare() {
        const session::Request request{.purpose = session::Purpose::picture};
        if (const auto prepared = session_->prepare(view_, request); !prepared) return prepared.error();
        auto judge = session::PictureJudge::create(context_, *session_, view_, options_.samples);
        if (!judge) return judge.error();
        judge_ = std::make_unique<session::PictureJudge>(std::move(*judge));
        return {};
    }

    const render::Context& context_;
    std::string name_;
    std::unique_ptr<session::Session> session_;
    vdtree::View view_;
    const ScenesBenchOptions& options_;
    std::unique_ptr<session::PictureJudge> judge_;
};

// ---- triangles and what shows

// Levels by distance or by area in a budget of triangles: the finest bias that keeps to it, by bisection.
Result<session::LevelFrame> with_triangles(LevelControl& control, const vdtree::View& view, std::uint64_t triangles) {
    double low = 1e-4, high = 1e4; // within it, and more
    for (int step = 0; step < 24; ++step) {
        const double middle = std::sqrt(low * high);
        control.set_bias(middle);
        const auto frame = control.draw(view);
        if (!frame) return frame;
        (frame->triangles <= triangles ? low : high) = middle;
    }
    control.set_bias(low);
    return control.draw(view);
}

// The fewest triangles at which nothing shows, among biases in steps of a quarter of an octave: by bisection, as if less
// always showed more.
Result<Row> without_visible_pixels(JudgedScene& scene, LevelControl& control, const std::string& method) {
    double low = 1e-4, high = 1e4;
    std::optional<Row> best;
    for (int step = 0; step < 7; ++step) {
        const double middle = std::sqrt(low * high);
        control.set_bias(middle);
        const auto frame = control.draw(scene.view());
        if (!frame) return frame.error();
        auto row = scene.judge(method, scene.cuts_of(control, *frame), 0);
        if (!row) return row;
        (row->visible == 0 ? high : low) = middle;
        if (row->visible == 0 && (!best || row->triangles < best->triangles)) best = std::move(*row);
    }
    if (best) return std::move(*best);
    control.set_bias(high);
    const auto frame = control.draw(scene.view());
    if (!frame) return frame.error();
    return scene.judge(method, scene.cuts_of(control, *frame), 0);
}

// The same of the tree: the largest cost that folds may have.
Result<Row> without_visible_pixels(JudgedScene& scene, const std::string& method, const session::AsSeenOptions& how) {
    double low = 1, high = 64;
    std::optional<Row> best;
    for (int step = 0; step < 7; ++step) {
        const double middle = step == 0 ? 1 : std::sqrt(low * high);
        auto row = scene.as_seen(method, how, middle);
        if (!row) return row;
        (row->visible == 0 ? low : high) = middle;
        if (row->visible == 0 && (!best || row->triangles < best->triangles)) best = std::move(*row);
        else if (step == 0) return row;
    }
    best->seconds = 0;
    return std::move(*best);
}

Result<std::vector<Row>> rows_of(JudgedScene& scene) {
    using session::Masking;
    std::vector<Row> rows;
    std::optional<Error> error;
    const auto add = [&](Result<Row> row) {
        if (row) rows.push_back(std::move(*row));
        else if (!error) error = row.error();
    };
    add(scene.as_seen("tree", {.folds_hidden = false}));
    add(scene.as_seen("tree, masked", {.folds_hidden = false, .masking = Masking::scene}));
    add(scene.as_seen("tree, without what the picture hides", {}));
    add(scene.as_seen(most_asked_for, {.masking = Masking::scene}));
    if (error) return *error;
    const std::uint64_t least = rows.back().triangles;
    add(without_visible_pixels(scene, "tree, without what the picture hides, where nothing shows", {}));
    for (const auto& [recipe, name] : {std::pair{session::MapRecipe::modern, "levels by masking, modern maps"},
                                       {session::MapRecipe::rpg99, "levels by masking, rpg99 maps"}}) {
        const auto start = BenchClock::now();
        auto control = scene.levels({.maps = recipe});
        if (!control) return control.error();
        const auto frame = control->settle(scene.view());
        if (!frame) return frame.error();
        add(scene.judge(name, scene.cuts_of(*control, *frame), seconds_since(start)));
    }
    for (const auto& [method, name] :
         {std::pair{LevelMethod::distance, "levels by distance"}, {LevelMethod::area, "levels by area"}}) {
        auto control = scene.levels({.method = method});
        if (!control) return control.error();
        const auto start = BenchClock::now();
        const auto frame = with_triangles(*control, scene.view(), least);
        if (!frame) return frame.error();
        add(scene.judge(std::string(name) + ", in as many triangles", scene.cuts_of(*control, *frame),
                        seconds_since(start)));
        add(without_visible_pixels(scene, *control, std::string(name) + ", where nothing shows"));
    }
    if (error) return *error;
    return rows;
}

// ---- the walk: renderings by level, and times

// Forwards by a tenth of the way to what the camera looks at.
vdtree::View on_the_way(const vdtree::View& from, double share) {
    constexpr double way = 0.1;
    vdtree::View view = from;
    view.eye += way * share * (from.target - from.eye);
    return view;
}

struct Walk {
    std::vector<std::uint64_t> shown, controlled; // renderings by level
    session::LevelTimes times;                    // means, milliseconds
    double frame_ms = 0;                          // wall-clock
    std::uint64_t texture_bytes = 0;
};

Result<Walk> walk(JudgedScene& scene, int frames) {
    auto control = scene.levels({.maps = session::MapRecipe::rpg99});
    if (!control) return control.error();
    if (const auto settled = control->settle(scene.view()); !settled) return settled.error();
    Walk walk;
    std::size_t timed = 0;
    const auto take = [&](const session::LevelFrame& frame) {
        for (const session::LevelTimes& t : frame.times) {
            ++timed;
            walk.times.layers_ms += t.layers_ms, walk.times.combinations_ms += t.combinations_ms;
            walk.times.maps_ms += t.maps_ms, walk.times.depth_ms += t.depth_ms, walk.times.control_ms += t.control_ms;
        }
    };
    const auto start = BenchClock::now();
    for (int i = 0; i < frames; ++i) {
        const auto frame = control->draw(on_the_way(scene.view(), (i + 1.0) / frames));
        if (!frame) return frame.error();
        take(*frame);
        walk.texture_bytes = std::max(walk.texture_bytes, frame->texture_bytes);
        const auto count = [](std::vector<std::uint64_t>& by_level, int level) {
            if (level < 0) return;
            by_level.resize(std::max(by_level.size(), static_cast<std::size_t>(level) + 1));
            ++by_level[static_cast<std::size_t>(level)];
        };
        for (const int level : frame->levels) count(walk.shown, level);
        for (const int level : frame->tested_with) count(walk.controlled, level);
        const auto counted = control->wait();
        if (!counted) return counted.error();
        take(*counted);
    }
    walk.frame_ms = 1e3 * seconds_since(start) / frames;
    const double share = 1.0 / static_cast<double>(std::max<std::size_t>(timed, 1));
    for (double session::LevelTimes::*ms :
         {&session::LevelTimes::layers_ms, &session::LevelTimes::combinations_ms, &session::LevelTimes::maps_ms,
          &session::LevelTimes::depth_ms, &session::LevelTimes::control_ms})
        walk.times.*ms *= share;
    return walk;
}

// ---- tables

BenchTable table_of(const std::string& scene, const std::vector<Row>& rows, std::uint64_t all) {
    BenchTable table;
    table.title = scene + ", " + grouped(all) + " triangles";
    table.rows.push_back({"method", "triangles", "of all", "visible pixels", "V", "second judge: pixels", "V", "s"});
    for (const Row& r : rows)
        table.rows.push_back({r.method, grouped(r.triangles),
                              rounded(100 * static_cast<double>(r.triangles) / static_cast<double>(all), 3) + "%",
                              grouped(r.visible), rounded(r.v, 2), grouped(r.second_visible), rounded(r.second_v, 2),
                              r.seconds > 0 ? rounded(r.seconds, 2) : std::string()});
    return table;
}

// Of the last way by the tree, which asks for everything.
BenchTable passes_table(const std::vector<std::pair<std::string, std::vector<session::PassEffect>>>& scenes) {
    BenchTable table;
    table.title = "What is drawn for a cut, and why";
    table.rows.push_back({"scene", "effect", "", "why", "drawings", "passes", "textures, MB", "ms"});
    for (const auto& [name, passes] : scenes)
        for (const session::PassEffect& e : passes)
            table.rows.push_back({name, e.name, e.on ? "on" : "off", e.why, std::to_string(e.surface_passes),
                                  std::to_string(e.full_screen_passes),
                                  rounded(static_cast<double>(e.texture_bytes) / 1e6, 3), rounded(e.milliseconds, 3)});
    return table;
}

BenchTable renderings_table(const std::vector<std::pair<std::string, Walk>>& walks) {
    BenchTable table;
    table.title = "Renderings by level";
    std::size_t levels = 1;
    for (const auto& [name, walk] : walks) levels = std::max({levels, walk.shown.size(), walk.controlled.size()});
    table.rows.push_back({"scene", "for"});
    for (std::size_t i = 0; i < levels; ++i) table.rows[0].push_back("level " + std::to_string(i));
    table.rows[0].push_back("all");
    for (const auto& [name, walk] : walks)
        for (const bool is_control : {true, false}) {
            auto by_level = is_control ? walk.controlled : walk.shown;
            by_level.resize(levels);
            std::vector<std::string> row = {name, is_control ? "control" : "display"};
            for (const std::uint64_t count : by_level) row.push_back(grouped(count));
            row.push_back(grouped(std::accumulate(by_level.begin(), by_level.end(), std::uint64_t{0})));
            table.rows.push_back(std::move(row));
        }
    return table;
}

BenchTable times_table(const std::vector<std::pair<std::string, Walk>>& walks) {
    BenchTable table;
    table.title = "Milliseconds a frame of levels by masking";
    table.rows.push_back({"scene", "all", "layers", "combinations", "maps", "depth", "control", "textures, MB"});
    for (const auto& [name, walk] : walks)
        table.rows.push_back({name, rounded(walk.frame_ms, 3), rounded(walk.times.layers_ms, 3),
                              rounded(walk.times.combinations_ms, 3), rounded(walk.times.maps_ms, 3),
                              rounded(walk.times.depth_ms, 3), rounded(walk.times.control_ms, 3),
                              rounded(static_cast<double>(walk.texture_bytes) / 1e6, 3)});
    return table;
}

Json to_json(const Row& row, const std::string& scene) {
    return {{"scene", scene},
            {"method", row.method},
            {"triangles", row.triangles},
            {"visible_pixels", row.visible},
            {"v", row.v},
            {"second_visible_pixels", row.second_visible},
            {"second_v", row.second_v},
            {"seconds", row.seconds}};
}

Json to_json(const Walk& walk, const std::string& scene) {
    return {{"scene", scene},
            {"display_renderings", walk.shown},
            {"control_renderings", walk.controlled},
            {"frame_ms", walk.frame_ms},
            {"layers_ms", walk.times.layers_ms},
            {"combinations_ms", walk.times.combinations_ms},
            {"maps_ms", walk.times.maps_ms},
            {"depth_ms", walk.times.depth_ms},
            {"control_ms", walk.times.control_ms},
            {"texture_bytes", walk.texture_bytes}};
}

} // namespace

Result<ScenesBenchResult> bench_scenes(const ScenesBenchOptions& options) {
    const MadeScenes made;
    auto files = options.scenes;
    if (files.empty()) {
        auto own = made.make(options.triangles);
        if (!own) return own.error();
        files = std::move(*own);
    }
    auto context = render::Context::headless();
    if (!context) return context.error();
    ScenesBenchResult result;
    std::vector<std::pair<std::string, Walk>> walks;
    std::vector<std::pair<std::string, std::vector<session::PassEffect>>> passes;
    for (const std::string& file : files) {
        auto scene = JudgedScene::create(*context, file, options);
        if (!scene) return scene.error();
        const auto rows = rows_of(*scene);
        if (!rows) return rows.error();
        result.tables.push_back(table_of(scene->name(), *rows, scene->session().triangle_count()));
        for (const Row& row : *rows) {
            result.rows.push_back(to_json(row, scene->name()));
            if (row.method == most_asked_for) passes.emplace_back(scene->name(), row.passes);
        }
        auto walked = walk(*scene, options.path_frames);
        if (!walked) return walked.error();
        result.walks.push_back(to_json(*walked, scene->name()));
        walks.emplace_back(scene->name(), std::move(*walked));
    }
    result.tables.push_back(passes_table(passes));
    result.tables.push_back(renderings_table(walks));
    result.tables.push_back(times_table(walks));
    return result;
}

} // namespace unseen::app
