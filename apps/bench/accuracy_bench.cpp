#include "accuracy_bench.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include <unseen/vdtree/internal/csv.h>

#include "accuracy_axes.h"
#include "accuracy_plot.h"
#include "bench_tools.h"
#include "made_scenes.h"
#include "progress_bar.h"
#include "terminal.h"

namespace unseen::app {
namespace {

enum class Of { nothing, meshes, scenes, all };

struct AxisMeasure {
    AccuracyAxis axis;
    Of of = Of::all;
    std::function<Result<AccuracyPoints>(AccuracySubject&, const AccuracyBenchOptions&)> measure = {};
    std::function<Result<AccuracyPoints>(const AccuracyBenchOptions&)> measure_alone = {}; // of nothing

    bool takes(bool is_scene) const { return of == Of::all || of == (is_scene ? Of::scenes : Of::meshes); }
};

const std::vector<AxisMeasure>& all_axes() {
    static const std::vector<AxisMeasure> axes = {
        {{"folds",
          "fold decision",
          "Which fold test, threshold and budget, or which other simplification: what is left, whether it shows, and "
          "what a frame takes.",
          {"ms a frame, followed and drawn", "V: the largest difference that a judge sees, in thresholds", "triangles",
           "pixels visible", "by the second judge", "1 - SSIM", "largest shift, mm", "seconds of preparation",
           "bytes a triangle"},
          {{0, 1}, {2, 3}}},
         Of::all,
         fold_points},
        {{"csf",
          "contrast sensitivity",
          "How sensitivity is known: by its formula, or by tables of so many samples an axis.",
          {"ns a look-up", "largest relative error against the closed form, where anything is seen",
           "95% err by less than", "bytes"}},
         Of::nothing,
         {},
         csf_points},
        {{"spheres",
          "bounding spheres",
          "What a node's support is enclosed by: spheres of the same points, against the exact smallest ones.",
          {"us a node", "radius beyond the exact one, mean share", "largest share",
           "points outside, largest share of the radius"}},
         Of::meshes,
         sphere_points},
        {{"facing",
          "facing",
          "How a node knows that all of its ring faces the eye, or faces away, without a look at each triangle.",
          {"ns a test", "false silhouettes, share of the tests that need none", "misses", "bytes a node"},
          {{0, 1}, {3, 1}}},
         Of::meshes,
         facing_points},
        {{"measurement",
          "fold measurement",
          "What the errors of folds are measured by, and whether what folds by them shows.",
          {"seconds", "V", "triangles", "pixels visible", "triangles from 8 times as far", "V from there"},
          {{0, 1}, {2, 1}}},
         Of::meshes,
         measurement_points},
        {{"maps",
          "threshold maps",
          "How the map of just visible steps of a picture is made, against the CPU's of the same recipe.",
          {"ms a map", "relative error, 99% of pixels below", "median", "bytes a pixel of the picture"}},
         Of::all,
         map_points},
        {{"levels",
          "levels by masking",
          "What decides on discrete levels while the eye walks: recipe, layers, resolution and bits of maps, and how "
          "often objects are tested. In half of the window.",
          {"ms a frame", "V at the end of the walk", "triangles", "pixels visible", "MB of textures"},
          {{0, 1}, {2, 3}}},
         Of::scenes,
         level_points},
        {{"cut",
          "following a cut",
          "How a cut is kept at what a moving eye asks for.",
          {"us a frame", "triangles off those of the cut from scratch, share"}},
         Of::all,
         cut_points},
        {{"tests",
          "testing nodes",
          "In which precision nodes are tested, all of them one by one, by extent.",
          {"ns a node", "nodes decided otherwise than in double, share"}},
         Of::meshes,
         node_test_points},
        {{"trees",
          "trees",
          "How vertices are clustered, and by how many threads: the surface at a tenth of the triangles.",
          {"seconds to build", "mean distance of vertices from the surface, millionths of the extent",
           "V, drawn in the default view", "bytes a triangle", "us a frame, followed at 1 px"}},
         Of::meshes,
         tree_points},
        {{"gaze",
          "age of a gaze",
          "What shows when the cut is made for where the viewer looked some frames ago, and what a margin for that "
          "costs. The gaze moves at 30 degrees a second; frames are 1/60 s.",
          {"triangles, of those without a gaze", "V, for the gaze as it is by now", "pixels visible"}},
         Of::all,
         gaze_age_points}};
    return axes;
}

std::vector<const AxisMeasure*> wanted_axes(const AccuracyBenchOptions& options) {
    std::vector<const AxisMeasure*> wanted;
    for (const AxisMeasure& axis : all_axes())
        if (options.only.empty() || std::ranges::find(options.only, axis.axis.key) != options.only.end())
            wanted.push_back(&axis);
    return wanted;
}

// ---- subjects

struct LoadedSubject {
    std::unique_ptr<session::Session> session;
    AccuracySubject subject;
};

// Built and measured anew, whatever is kept: that is timed.
Result<LoadedSubject> load_subject(const std::string& file, const render::Context& context,
                                   const AccuracyBenchOptions& options) {
    session::LoadOptions load;
    load.as = session::LoadAs::automatic;
    load.cache.is_off = true;
    load.measures = false;
    const auto start = BenchClock::now();
    auto scene = session::Scene::load(file, load);
    if (!scene) return scene.error();
    const double build_s = seconds_since(start);
    const bool is_scene = scene->is_of_file();
    auto made = session::Session::create(std::move(*scene));
    if (!made) return made.error();
    auto session = std::make_unique<session::Session>(std::move(*made));
    vdtree::View window;
    window.width = window.height = options.window_px;
    window.fov_y_degrees = perception::physical_field(session->observer().display, options.window_px).value();
    const auto camera = session->camera_view(window);
    constexpr double filled = 0.5; // of the window's height
    const vdtree::View view = camera ? *camera : session->frame({0.6, 0.5, 0.62}, filled, window);
    const auto begin = BenchClock::now();
    if (const auto ready = session->prepare(view, {.purpose = session::Purpose::picture}); !ready) return ready.error();
    session::Session& lasting = *session;
    return LoadedSubject{std::move(session),
                         {.name = std::filesystem::path(file).stem().string(),
                          .session = lasting,
                          .context = context,
                          .view = view,
                          .is_scene = is_scene,
                          .build_s = build_s,
                          .measure_s = seconds_since(begin)}};
}

// ---- fronts

// Whether a beats b in both columns, or equals it in one.
bool beats(const AccuracyPoint& a, const AccuracyPoint& b, std::array<std::size_t, 2> columns) {
    const double ax = a.values[columns[0]], ay = a.values[columns[1]], bx = b.values[columns[0]],
                 by = b.values[columns[1]];
    return ax <= bx && ay <= by && (ax < bx || ay < by);
}

void find_fronts(const std::vector<AccuracyAxis>& axes, std::vector<AccuracyPoint>& points) {
    for (AccuracyPoint& point : points) {
        const auto axis = std::ranges::find(axes, point.axis, &AccuracyAxis::key);
        point.is_on_front = std::isfinite(point.cost()) && std::isfinite(point.error()) &&
                            std::ranges::none_of(points, [&](const AccuracyPoint& other) {
                                return other.axis == point.axis && other.subject == point.subject &&
                                       beats(other, point, axis->plots[0]);
                            });
    }
}

// ---- tables

BenchTable axis_table(const AccuracyAxis& axis, const std::vector<AccuracyPoint>& points,
                      const std::vector<AccuracyGap>& gaps) {
    BenchTable table;
    table.title = axis.name + ": " + axis.question;
    std::vector<std::string> header = {"of", ""};
    header.insert(header.end(), axis.columns.begin(), axis.columns.end());
    header.insert(header.end(), {"", ""});
    table.rows.push_back(std::move(header));
    for (const AccuracyPoint& p : points) {
        if (p.axis != axis.key) continue;
        std::vector<std::string> row = {p.subject, p.name};
        for (const double value : p.values) row.push_back(accuracy_number(value));
        row.push_back(std::string(p.is_on_front ? "*" : "") + (p.is_default ? " default" : ""));
        row.push_back(p.note);
        table.rows.push_back(std::move(row));
    }
    table.notes.push_back("* on the front: no other costs less and is nearer to the truth.");
    for (const AccuracyGap& gap : gaps)
        if (gap.axis == axis.key) table.notes.push_back("Not measured of " + gap.subject + ": " + gap.what);
    return table;
}

// One choice over all subjects.
struct Choice {
    std::vector<double> cost_ratios; // to the default's of the same subject
    double worst_error = 0;
};

// What the default of an axis is among its other choices: of all subjects, the largest error, and the median of cost.
std::vector<std::vector<std::string>> default_rows(const AccuracyAxis& axis, const std::vector<AccuracyPoint>& points) {
    std::vector<std::string> defaults;
    for (const AccuracyPoint& p : points)
        if (p.axis == axis.key && p.is_default && std::ranges::find(defaults, p.name) == defaults.end())
            defaults.push_back(p.name);
    std::vector<std::vector<std::string>> rows;
    for (const std::string& name : defaults) {
        std::vector<double> costs;
        double worst = 0;
        std::map<std::string, Choice> others;
        for (const AccuracyPoint& d : points) {
            if (d.axis != axis.key || !d.is_default || d.name != name) continue;
            costs.push_back(d.cost());
            worst = std::max(worst, d.error());
            for (const AccuracyPoint& p : points) {
                if (p.axis != axis.key || p.subject != d.subject || p.is_default || std::isnan(p.cost()) ||
                    std::isnan(p.error()))
                    continue;
                Choice& choice = others[p.name];
                if (d.cost() > 0) choice.cost_ratios.push_back(p.cost() / d.cost());
                choice.worst_error = std::max(choice.worst_error, p.error());
            }
        }
        const std::pair<const std::string, Choice>*cheapest = nullptr, *nearest = nullptr;
        const auto ratio = [](const Choice& c) {
            return c.cost_ratios.empty() ? std::numeric_limits<double>::infinity() : median(c.cost_ratios);
        };
        for (const auto& other : others) {
            if (!cheapest || ratio(other.second) < ratio(cheapest->second)) cheapest = &other;
            const auto key = [&](const Choice& c) { return std::pair(c.worst_error, ratio(c)); };
            if (!nearest || key(other.second) < key(nearest->second)) nearest = &other;
        }
        const auto cell = [&](const std::pair<const std::string, Choice>* other) {
            if (!other) return std::string();
            const double times = ratio(other->second);
            return other->first + ": " + (std::isfinite(times) ? accuracy_number(times) + " x, " : "") +
                   accuracy_number(other->second.worst_error);
        };
        rows.push_back({axis.name, name, accuracy_number(median(costs)) + " " + axis.columns[0], accuracy_number(worst),
                        axis.columns[1], cell(cheapest), cell(nearest)});
    }
    return rows;
}

BenchTable defaults_table(const std::vector<AccuracyAxis>& axes, const std::vector<AccuracyPoint>& points) {
    BenchTable table;
    table.title = "What the defaults buy and cost";
    table.rows.push_back({"of", "default", "cost", "error", "which is", "cheapest instead: cost, error",
                          "most exact instead: cost, error"});
    for (const AccuracyAxis& axis : axes)
        for (std::vector<std::string>& row : default_rows(axis, points)) table.rows.push_back(std::move(row));
    table.notes.push_back(
        "Costs are medians over the models, in the last two columns in times the default's; errors are "
        "the largest of all models.");
    return table;
}

// ---- files

Json to_json(const AccuracyBenchResult& result) {
    Json axes = Json::array(), points = Json::array();
    for (const AccuracyAxis& axis : result.axes)
        axes.push_back(
            {{"key", axis.key}, {"name", axis.name}, {"question", axis.question}, {"columns", axis.columns}});
    for (const AccuracyPoint& p : result.points) {
        Json values = Json::array();
        for (const double value : p.values) values.push_back(number_or_null(value));
        points.push_back({{"axis", p.axis},
                          {"subject", p.subject},
                          {"name", p.name},
                          {"values", std::move(values)},
                          {"default", p.is_default},
                          {"pareto", p.is_on_front},
                          {"note", p.note}});
    }
    Json gaps = Json::array();
    for (const AccuracyGap& gap : result.gaps)
        gaps.push_back({{"axis", gap.axis}, {"subject", gap.subject}, {"what", gap.what}});
    return {{"axes", std::move(axes)}, {"points", std::move(points)}, {"not_measured", std::move(gaps)}};
}

} // namespace

std::vector<std::string> accuracy_axis_keys() {
    std::vector<std::string> keys;
    for (const AxisMeasure& axis : all_axes()) keys.push_back(axis.axis.key);
    return keys;
}

std::vector<bool> accuracy_front(const std::vector<AccuracyPoint>& points, std::array<std::size_t, 2> columns) {
    std::vector<bool> front;
    for (const AccuracyPoint& point : points)
        front.push_back(
            std::isfinite(point.values[columns[0]]) && std::isfinite(point.values[columns[1]]) &&
            std::ranges::none_of(points, [&](const AccuracyPoint& other) { return beats(other, point, columns); }));
    return front;
}

namespace {

Result<void> add(AccuracyBenchResult& result, const AccuracyAxis& axis, const std::string& subject,
                 Result<AccuracyPoints> points) {
    if (!points)
        return Error{points.error().code,
                     axis.name + (subject.empty() ? "" : " of " + subject) + ": " + points.error().message};
    for (AccuracyPoint& point : *points) {
        point.axis = axis.key;
        if (point.subject.empty()) point.subject = subject;
        point.values.resize(axis.columns.size(), std::numeric_limits<double>::quiet_NaN());
        result.points.push_back(std::move(point));
    }
    return {};
}

// Along each axis that takes it; `begin` hears of each.
Result<void> measure(LoadedSubject& loaded, const std::vector<const AxisMeasure*>& axes,
                     const AccuracyBenchOptions& options, const std::function<void(const AxisMeasure&)>& begin,
                     AccuracyBenchResult& result) {
    for (const AxisMeasure* axis : axes) {
        begin(*axis);
        if (axis->of == Of::nothing || !axis->takes(loaded.subject.is_scene)) continue;
        const auto start = BenchClock::now();
        if (auto ok = add(result, axis->axis, loaded.subject.name, axis->measure(loaded.subject, options)); !ok)
            return ok;
        for (std::string& what : std::exchange(loaded.subject.left_out, {}))
            result.gaps.push_back({axis->axis.key, loaded.subject.name, std::move(what)});
        result.json["seconds"].push_back({{"axis", axis->axis.key},
                                          {"subject", loaded.subject.name},
                                          {"seconds", number_or_null(seconds_since(start))}});
    }
    return {};
}

} // namespace

Result<AccuracyBenchResult> bench_accuracy(const AccuracyBenchOptions& options) {
    const std::vector<const AxisMeasure*> axes = wanted_axes(options);
    std::vector<std::string> models = options.models;
    std::optional<MadeScenes> made;
    const bool is_default = models.empty();
    if (is_default) models = installed_meshes();
    if (is_default || options.has_scenes) {
        made.emplace();
        auto scenes = made->make(options.scene_triangles);
        if (!scenes) return scenes.error();
        models.insert(models.end(), scenes->begin(), scenes->end());
    }
    auto context = render::Context::headless();
    if (!context) return context.error();
    AccuracyBenchResult result;
    result.json["seconds"] = Json::array(); // that the benchmark took
    for (const AxisMeasure* axis : axes) result.axes.push_back(axis->axis);
    for (const AxisMeasure* axis : axes)
        if (axis->of == Of::nothing)
            if (auto ok = add(result, axis->axis, "", axis->measure_alone(options)); !ok) return ok.error();
    if (std::ranges::all_of(axes, [](const AxisMeasure* a) { return a->of == Of::nothing; })) models.clear();
    ProgressBar bar("Measuring");
    const double steps = static_cast<double>(models.size() * (axes.size() + 1));
    double step = 0;
    for (const std::string& file : models) {
        bar(step++ / steps, "loading");
        auto loaded = load_subject(file, *context, options);
        if (!loaded) return loaded.error();
        const auto begin = [&](const AxisMeasure& axis) { bar(step++ / steps, axis.axis.name.c_str()); };
        if (auto ok = measure(*loaded, axes, options, begin, result); !ok) return ok.error();
    }
    // Levels are of scenes alone, and other axes of meshes.
    std::erase_if(result.axes, [&](const AccuracyAxis& axis) {
        return std::ranges::find(result.points, axis.key, &AccuracyPoint::axis) == result.points.end();
    });
    find_fronts(result.axes, result.points);
    result.tables.push_back(defaults_table(result.axes, result.points));
    for (const AccuracyAxis& axis : result.axes) result.tables.push_back(axis_table(axis, result.points, result.gaps));
    result.json.update(to_json(result));
    return result;
}

std::string to_csv(const AccuracyBenchResult& result) {
    std::string text = "axis,subject,name,default,pareto,cost,cost_unit,error,error_unit,more,note\n";
    for (const AccuracyPoint& p : result.points) {
        const auto axis = std::ranges::find(result.axes, p.axis, &AccuracyAxis::key);
        const auto number = [](double value) { return std::isfinite(value) ? shortest(value) : std::string(); };
        std::string more;
        for (std::size_t i = 2; i < p.values.size(); ++i)
            if (std::isfinite(p.values[i]))
                more += (more.empty() ? "" : "; ") + axis->columns[i] + " = " + shortest(p.values[i]);
        text += p.axis + "," + csv_field(p.subject) + "," + csv_field(p.name) + "," + (p.is_default ? "1" : "0") + "," +
                (p.is_on_front ? "1" : "0") + "," + number(p.cost()) + "," + csv_field(axis->columns[0]) + "," +
                number(p.error()) + "," + csv_field(axis->columns[1]) + "," + csv_field(more) + "," +
                csv_field(p.note) + "\n";
    }
    return text;
}

} // namespace unseen::app
