#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include <unseen/vdtree/internal/atomic_file.h>
#include <unseen/vdtree/internal/csv.h>

#include "accuracy.h"
#include "benches.h"
#include "progress_bar.h"
#include "terminal.h"

namespace unseen::app {
namespace {

enum class Of { nothing, meshes, scenes, all };

struct AxisMeasure : AccuracyAxis {
    Of of;
    AccuracyPoints (*measure)(AccuracySubject&); // null of nothing: csf_points()

    bool takes(bool is_scene) const { return of == Of::all || of == (is_scene ? Of::scenes : Of::meshes); }
};

const AxisMeasure all_axes[] = {
    {{"folds",
      "fold decision",
      "Which fold test, threshold and budget, or which other simplification: what is left, whether it shows, and what "
      "a "
      "frame takes.",
      {"ms a frame, followed and drawn", "V: the largest difference that a judge sees, in thresholds", "triangles",
       "pixels visible", "by the second judge", "1 - SSIM", "largest shift, mm", "seconds of preparation",
       "bytes a triangle"}},
     Of::all,
     fold_points},
    {{"csf",
      "contrast sensitivity",
      "How sensitivity is known: by its formula, or by tables of so many samples an axis.",
      {"ns a look-up", "largest relative error against the closed form, where anything is seen", "95% err by less than",
       "bytes"}},
     Of::nothing,
     nullptr},
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
      {"ns a test", "false silhouettes, share of the tests that need none", "misses", "bytes a node"}},
     Of::meshes,
     facing_points},
    {{"measurement",
      "fold measurement",
      "What the errors of folds are measured by, and whether what folds by them shows.",
      {"seconds", "V", "triangles", "pixels visible", "triangles from 8 times as far", "V from there"}},
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
      "What decides on discrete levels while the eye walks: the recipe of maps, layers, and how often objects "
      "are tested. In half of the window.",
      {"ms a frame", "V at the end of the walk", "triangles", "pixels visible", "MB of textures"}},
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
    {{"corners",
      "seams and hard edges",
      "What static levels look like where charts of textures meet and normals are split, from six sides.",
      {"triangles", "visible pixels, of all sides and the larger count of two judges", "V",
       "area of the triangles in the texture, of the whole model's",
       "corners' normals > 20 degrees off their face, share",
       "mean distance of vertices from the surface, millionths of the extent"}},
     Of::meshes,
     corner_points},
    {{"gaze",
      "age of a gaze",
      "What shows when the cut is made for where the viewer looked some frames ago, and what a margin for that costs. "
      "The gaze moves at 30 degrees a second; frames are 1/60 s.",
      {"triangles, of those without a gaze", "V, for the gaze as it is by now", "pixels visible"}},
     Of::all,
     gaze_age_points}};

// Built and measured anew, whatever is kept: that is timed.
AccuracySubject load_subject(const std::string& file, const render::Context& context, const AccuracyOptions& options) {
    session::LoadOptions load;
    load.as = session::LoadAs::automatic;
    load.cache.is_off = true;
    load.measures = false;
    auto start = BenchClock::now();
    session::Scene scene = require(session::Scene::load(file, load));
    const double build_s = seconds_since(start);
    const bool is_scene = scene.is_of_file();
    session::Session session = require(session::Session::create(std::move(scene)));
    vdtree::View window;
    window.width = window.height = options.window_px;
    window.fov_y_degrees = perception::physical_field(session.observer().display, options.window_px).value();
    const auto camera = session.camera_view(window);
    constexpr double filled = 0.5; // of the window's height
    const vdtree::View view = camera ? *camera : session.frame({0.6, 0.5, 0.62}, filled, window);
    start = BenchClock::now();
    require(session.prepare(view, {.purpose = session::Purpose::picture}));
    return {.name = std::filesystem::path(file).stem().string(),
            .session = std::move(session),
            .context = context,
            .view = view,
            .is_scene = is_scene,
            .build_s = build_s,
            .measure_s = seconds_since(start),
            .seconds = options.seconds,
            .nodes = options.quick ? 500u : 2000u,
            .pictures = options.plots};
}

// What was asked for and not measured.
struct AccuracyGap {
    const AccuracyAxis* axis;
    std::string subject, what; // names of points and why, as a sentence
};

void add(AccuracyPoints& points, const AxisMeasure& axis, AccuracySubject* subject) {
    AccuracyPoints more;
    try {
        more = subject ? axis.measure(*subject) : csf_points();
    } catch (const BenchFailure& failure) {
        throw BenchFailure{
            {failure.error.code, axis.name + (subject ? " of " + subject->name : "") + ": " + failure.error.message}};
    }
    for (AccuracyPoint& point : more) {
        point.axis = &axis;
        point.subject = subject ? subject->name : "castleCSF";
        point.values.resize(axis.columns.size(), std::numeric_limits<double>::quiet_NaN());
        const auto beats = [&](const AccuracyPoint& other) { // in both columns, or in one and equals it in the other
            return other.cost() <= point.cost() && other.error() <= point.error() &&
                   (other.cost() < point.cost() || other.error() < point.error());
        };
        point.is_on_front =
            std::isfinite(point.cost()) && std::isfinite(point.error()) && std::ranges::none_of(more, beats);
    }
    points.insert(points.end(), more.begin(), more.end());
}

// ---- tables and files

BenchTable axis_table(const AccuracyAxis& axis, const AccuracyPoints& points, const std::vector<AccuracyGap>& gaps) {
    BenchTable table{axis.name + ": " + axis.question, {{"of"}, {}}};
    for (const std::string& column : axis.columns) table.columns.push_back({column});
    table.columns.insert(table.columns.end(), 2, {});
    for (const AccuracyPoint& p : points) {
        if (p.axis != &axis) continue;
        std::vector<Cell>& row = table.rows.emplace_back(std::vector<Cell>{p.subject, p.name});
        for (const double value : p.values) row.push_back(accuracy_number(value));
        row.push_back(std::string(p.is_on_front ? "*" : "") + (p.is_default ? " default" : ""));
        row.push_back(p.note);
    }
    table.notes.push_back("* on the front: no other costs less and is nearer to the truth.");
    for (const AccuracyGap& gap : gaps)
        if (gap.axis == &axis) table.notes.push_back("Not measured of " + gap.subject + ": " + gap.what);
    return table;
}

// One choice over all subjects.
struct Choice {
    std::vector<double> cost_ratios; // to the default's of the same subject
    double worst_error = 0;
};

// What a default is among the other choices: of all subjects, the largest error, and the median of cost.
std::vector<Cell> default_row(const AccuracyAxis& axis, const std::string& name, const AccuracyPoints& points) {
    std::vector<double> costs;
    double worst = 0;
    std::map<std::string, Choice> others;
    for (const AccuracyPoint& p : points) {
        if (p.axis != &axis || !p.is_default || p.name != name) continue;
        costs.push_back(p.cost());
        worst = std::max(worst, p.error());
        for (const AccuracyPoint& q : points) {
            if (q.axis != &axis || q.subject != p.subject || q.is_default || std::isnan(q.cost()) ||
                std::isnan(q.error()))
                continue;
            Choice& other = others[q.name];
            other.worst_error = std::max(other.worst_error, q.error());
            if (p.cost() > 0) other.cost_ratios.push_back(q.cost() / p.cost());
        }
    }
    const auto ratio = [](const Choice& choice) {
        return choice.cost_ratios.empty() ? std::numeric_limits<double>::infinity() : median(choice.cost_ratios);
    };
    const auto cheapest = std::ranges::min_element(others, {}, [&](const auto& o) { return ratio(o.second); });
    const auto nearest = std::ranges::min_element(
        others, {}, [&](const auto& o) { return std::pair(o.second.worst_error, ratio(o.second)); });
    const auto cell = [&](const auto& other) -> std::string {
        if (other == others.end()) return "";
        const double times = ratio(other->second);
        return other->first + ": " + (std::isfinite(times) ? accuracy_number(times) + " x, " : "") +
               accuracy_number(other->second.worst_error);
    };
    return {axis.name,
            name,
            accuracy_number(median(costs)) + " " + axis.columns[0],
            accuracy_number(worst),
            axis.columns[1],
            cell(cheapest),
            cell(nearest)};
}

BenchTable defaults_table(const std::vector<const AccuracyAxis*>& axes, const AccuracyPoints& points) {
    BenchTable table{"What the defaults buy and cost",
                     {{"of"},
                      {"default"},
                      {"cost"},
                      {"error"},
                      {"which is"},
                      {"cheapest instead: cost, error"},
                      {"most exact instead: cost, error"}}};
    for (const AccuracyAxis* axis : axes) {
        std::vector<std::string> defaults;
        for (const AccuracyPoint& p : points)
            if (p.axis == axis && p.is_default && std::ranges::find(defaults, p.name) == defaults.end())
                defaults.push_back(p.name);
        for (const std::string& name : defaults) table.rows.push_back(default_row(*axis, name, points));
    }
    table.notes.push_back("Costs are medians over the models, in the last two columns in times the default's; errors "
                          "are the largest of all models.");
    return table;
}

Json to_json(const std::vector<const AccuracyAxis*>& axes, const AccuracyPoints& points,
             const std::vector<AccuracyGap>& gaps) {
    Json json = {{"axes", Json::array()}, {"points", Json::array()}, {"not_measured", Json::array()}};
    for (const AccuracyAxis* axis : axes)
        json["axes"].push_back(
            {{"key", axis->key}, {"name", axis->name}, {"question", axis->question}, {"columns", axis->columns}});
    for (const AccuracyPoint& p : points) {
        Json values = Json::array();
        for (const double value : p.values) values.push_back(number_or_null(value));
        json["points"].push_back({{"axis", p.axis->key},
                                  {"subject", p.subject},
                                  {"name", p.name},
                                  {"values", std::move(values)},
                                  {"default", p.is_default},
                                  {"pareto", p.is_on_front},
                                  {"note", p.note}});
    }
    for (const AccuracyGap& gap : gaps)
        json["not_measured"].push_back({{"axis", gap.axis->key}, {"subject", gap.subject}, {"what", gap.what}});
    return json;
}

std::string to_csv(const AccuracyPoints& points) {
    std::string text = "axis,subject,name,default,pareto,cost,cost_unit,error,error_unit,more,note\n";
    const auto number = [](double value) { return std::isfinite(value) ? shortest(value) : std::string(); };
    for (const AccuracyPoint& p : points) {
        const std::vector<std::string>& columns = p.axis->columns;
        std::string more;
        for (std::size_t i = 2; i < p.values.size(); ++i)
            if (std::isfinite(p.values[i]))
                more += (more.empty() ? "" : "; ") + columns[i] + " = " + shortest(p.values[i]);
        text += p.axis->key + "," + csv_field(p.subject) + "," + csv_field(p.name) + "," + (p.is_default ? "1" : "0") +
                "," + (p.is_on_front ? "1" : "0") + "," + number(p.cost()) + "," + csv_field(columns[0]) + "," +
                number(p.error()) + "," + csv_field(columns[1]) + "," + csv_field(more) + "," + csv_field(p.note) +
                "\n";
    }
    return text;
}

} // namespace

std::vector<std::string> accuracy_axis_keys() {
    std::vector<std::string> keys;
    for (const AxisMeasure& axis : all_axes) keys.push_back(axis.key);
    return keys;
}

BenchReport bench_accuracy(const AccuracyOptions& options) {
    std::vector<const AxisMeasure*> wanted;
    for (const AxisMeasure& axis : all_axes)
        if (options.only.empty() || std::ranges::find(options.only, axis.key) != options.only.end())
            wanted.push_back(&axis);
    const auto is_of_corners = [](const AxisMeasure* axis) { return axis->measure == &corner_points; };
    const auto is_of_others = [&](const AxisMeasure* axis) { return axis->of != Of::nothing && !is_of_corners(axis); };
    std::vector<std::string> models = options.inputs.empty() ? installed_meshes() : options.inputs;
    const BenchFolder folder;
    if (options.inputs.empty() || options.has_scenes) {
        constexpr std::uint64_t scene_triangles = 200'000; // of each, about
        const std::vector<std::string> scenes = make_scenes(folder, scene_triangles);
        models.insert(models.end(), scenes.begin(), scenes.end());
    }
    if (options.inputs.empty() && std::ranges::none_of(wanted, is_of_others)) models.clear();
    const std::size_t others = models.size();
    if (options.inputs.empty() && std::ranges::any_of(wanted, is_of_corners))
        for (std::string& file : make_corner_models(folder)) models.push_back(std::move(file));
    const render::Context context = require(render::Context::headless());
    AccuracyPoints points;
    std::vector<AccuracyGap> gaps;
    for (const AxisMeasure* axis : wanted)
        if (axis->of == Of::nothing) add(points, *axis, nullptr);
    if (std::ranges::all_of(wanted, [](const AxisMeasure* a) { return a->of == Of::nothing; })) models.clear();
    ProgressBar bar("Measuring");
    const double steps = static_cast<double>(models.size() * (wanted.size() + 1));
    double step = 0;
    for (std::size_t i = 0; i < models.size(); ++i) {
        bar(step++ / steps, "loading");
        AccuracySubject subject = load_subject(models[i], context, options);
        for (const AxisMeasure* axis : wanted) {
            bar(step++ / steps, axis->name.c_str());
            const bool has_own_models = options.inputs.empty(); // this axis, and the others
            if (!axis->takes(subject.is_scene) || (has_own_models && is_of_corners(axis) != (i >= others))) continue;
            add(points, *axis, &subject);
            for (std::string& what : std::exchange(subject.left_out, {}))
                gaps.push_back({axis, subject.name, std::move(what)});
        }
    }
    std::vector<const AccuracyAxis*> axes; // with points: levels are of scenes alone, and other axes of meshes
    for (const AxisMeasure* axis : wanted)
        if (std::ranges::find(points, axis, &AccuracyPoint::axis) != points.end()) axes.push_back(axis);
    if (!options.csv.empty()) {
        auto out = require(vdtree::AtomicFile::create(options.csv));
        require(out.write(to_csv(points)));
        require(out.commit());
    }
    if (!options.plots.empty()) write_accuracy_pictures(axes, points, options.plots);
    BenchReport report{{defaults_table(axes, points)}, to_json(axes, points, gaps)};
    for (const AccuracyAxis* axis : axes)
        if (!options.is_brief) report.tables.push_back(axis_table(*axis, points, gaps));
    return report;
}

} // namespace unseen::app
