#include "accuracy_bench.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <random>
#include <utility>

#include <perception/csf.h>
#include <perception/person.h>
#include <session/session.h>
#include <session_gpu/moving_occlusion.h>
#include <session_gpu/tradeoff.h>

#include "bench_tools.h"
#include "made_scenes.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr const char *fold_axis = "fold decision", *csf_axis = "contrast sensitivity", *cut_axis = "following a cut",
                     *stale_axis = "age of a picture of depth";

const std::vector<AccuracyAxis> all_axes = {
    {fold_axis, "ms a frame, followed and drawn", "V: the largest difference that a judge sees, in thresholds",
     "Which fold test, threshold and budget: what is left out, whether it shows, and what a frame takes."},
    {csf_axis, "ns a look-up", "largest relative error against the closed form, where anything is seen",
     "How sensitivity is known: by its formula, or by tables of so many samples an axis."},
    {cut_axis, "us a frame", "triangles beyond those of the cut from scratch, of all",
     "How a cut is kept at what a moving eye asks for."},
    {stale_axis, "pictures a frame", "triangles kept, of those without occlusion",
     "How long one picture of depth serves a moving eye: what it may not hide for that."}};

// ---- fold decisions

Result<std::vector<AccuracyPoint>> fold_points(session::Session& session, const render::Context& context,
                                               const vdtree::View& view, const std::string& subject,
                                               const AccuracyBenchOptions& options) {
    session::TradeoffOptions tradeoff;
    tradeoff.seconds = options.seconds;
    tradeoff.samples = options.samples;
    const auto measured = session::measure_tradeoff(session, context, view, tradeoff);
    if (!measured) return measured.error();
    std::vector<AccuracyPoint> points;
    for (const session::TradeoffPoint& p : measured->points) {
        AccuracyPoint point{fold_axis, subject, p.name};
        point.time = p.draw_ms + (std::isnan(p.follow_ms) ? 0 : p.follow_ms);
        point.error = p.v;
        point.note = grouped(p.triangles) + " triangles, " + grouped(p.visible_pixels) + " px visible, " +
                     grouped(p.second_visible_pixels) + " by the second judge, SSIM " +
                     (std::isnan(p.ssim) ? "-" : rounded(p.ssim, 5)) + ", shift " + rounded(1e3 * p.shift, 2) + " mm" +
                     (p.is_of_view ? ", this view alone" : "");
        point.is_default = p.name == "imperceptible";
        points.push_back(std::move(point));
    }
    return points;
}

// ---- contrast sensitivity

struct Stimuli {
    std::vector<double> cpd, degrees, cdm2;
};

Stimuli random_stimuli(std::size_t count) {
    std::mt19937_64 random(1);
    const auto between = [&](double a, double b) {
        return a + (b - a) * static_cast<double>(random() >> 11) * 0x1p-53;
    };
    Stimuli all;
    for (std::size_t i = 0; i < count; ++i) {
        all.cpd.push_back(std::exp2(between(-3, 5)));
        all.degrees.push_back(between(0, 60));
        all.cdm2.push_back(std::exp2(between(-3, 8)));
    }
    return all;
}

std::vector<double> steps(double first, double last, int count, bool is_log) {
    std::vector<double> values;
    for (int i = 0; i < count; ++i) {
        const double share = static_cast<double>(i) / (count - 1);
        values.push_back(is_log ? first * std::pow(last / first, share) : first + share * (last - first));
    }
    return values;
}

// By the closed form, so many samples an axis.
Result<perception::CsfTable> table_of(int samples) {
    perception::CsfSamples s;
    s.source = "castle, " + std::to_string(samples) + " samples an axis";
    s.frequency_cpd = steps(1.0 / 16, 64, samples, true);
    s.eccentricity_deg = steps(0, 120, samples, false);
    s.luminance_cdm2 = steps(1e-3, 1e4, samples, true);
    for (const double e : s.eccentricity_deg)
        for (const double l : s.luminance_cdm2)
            for (const double f : s.frequency_cpd)
                s.sensitivity.push_back(std::max(
                    perception::sensitivity(perception::CsfModel::castle,
                                            perception::stimulus_of({}, perception::CyclesPerDegree(f),
                                                                    perception::Degrees(e), perception::Luminance(l))),
                    1e-6));
    return perception::CsfTable::create(std::move(s));
}

Result<std::vector<AccuracyPoint>> csf_points(int repeats) {
    constexpr std::size_t count = 100'000;
    const Stimuli stimuli = random_stimuli(count);
    std::vector<double> truth(count), found(count);
    const auto timed = [&](const std::function<double(std::size_t)>& look_up, std::vector<double>& into) {
        std::vector<double> times;
        for (int i = 0; i < std::max(1, repeats / 3); ++i) {
            const auto start = BenchClock::now();
            for (std::size_t k = 0; k < count; ++k) into[k] = look_up(k);
            times.push_back(1e9 * seconds_since(start) / count);
        }
        return median(std::move(times));
    };
    const auto arguments = [&](std::size_t k) {
        return perception::stimulus_of({}, perception::CyclesPerDegree(stimuli.cpd[k]),
                                       perception::Degrees(stimuli.degrees[k]), perception::Luminance(stimuli.cdm2[k]));
    };
    std::vector<AccuracyPoint> points;
    AccuracyPoint closed{csf_axis, "castleCSF", "closed form, double"};
    closed.time = timed(
        [&](std::size_t k) { return perception::sensitivity(perception::CsfModel::castle, arguments(k)); }, truth);
    points.push_back(closed);
    const auto add = [&](const std::string& name, const perception::CsfTable& table, bool is_default) {
        AccuracyPoint point{csf_axis, "castleCSF", name};
        point.time = timed(
            [&](std::size_t k) {
                return table.sensitivity(perception::CyclesPerDegree(stimuli.cpd[k]),
                                         perception::Degrees(stimuli.degrees[k]),
                                         perception::Luminance(stimuli.cdm2[k]));
            },
            found);
        for (std::size_t k = 0; k < count; ++k)
            if (truth[k] > 1) point.error = std::max(point.error, std::abs(found[k] / truth[k] - 1));
        const perception::CsfSamples& s = table.samples();
        point.note = std::to_string(s.frequency_cpd.size()) + " x " + std::to_string(s.eccentricity_deg.size()) +
                     " x " + std::to_string(s.luminance_cdm2.size()) + " samples, " +
                     file_size(sizeof(double) * s.sensitivity.size());
        point.is_default = is_default;
        points.push_back(std::move(point));
    };
    for (const int samples : {16, 32, 64}) {
        const auto table = table_of(samples);
        if (!table) return table.error();
        add("table, " + std::to_string(samples) + " an axis, linear", *table, false);
    }
    add("the program's table", perception::CsfTable::standard(), true);
    return points;
}

// ---- cuts

vdtree::View turned(const vdtree::View& view, double degrees) {
    const double angle = degrees / perception::degrees_per_radian;
    const glm::dvec3 from = view.eye - view.target;
    vdtree::View other = view;
    other.eye = view.target + glm::dvec3(std::cos(angle) * from.x + std::sin(angle) * from.z, from.y,
                                         std::cos(angle) * from.z - std::sin(angle) * from.x);
    return other;
}

Result<std::vector<AccuracyPoint>> cut_points(session::Session& session, const vdtree::View& view,
                                              const std::string& subject, int repeats) {
    constexpr double degrees_a_frame = 0.1;
    session::Request imperceptible{.purpose = session::Purpose::picture};
    imperceptible.reasons = false;
    session::Request budget = imperceptible;
    const auto first = session.simplify(view, imperceptible);
    if (!first) return first.error();
    budget.goal = session::Goal::budget(std::max<vdtree::Index>(first->stats.triangles / 2, 1));
    const Pinned pinned;
    std::vector<AccuracyPoint> points;
    const auto add = [&](const std::string& name, const session::Request& request, bool is_from_scratch,
                         bool is_default) -> Result<void> {
        AccuracyPoint point{cut_axis, subject, name};
        point.is_default = is_default;
        session::Request exact = request;
        exact.hysteresis = 1;
        exact.milliseconds.reset();
        session::Follower follower(session);
        std::vector<double> times;
        for (int i = 0; i < repeats + 2; ++i) {
            const vdtree::View now = turned(view, degrees_a_frame * i);
            if (is_from_scratch) follower = session::Follower(session);
            const auto start = BenchClock::now();
            const auto made = follower.follow(now, request);
            if (!made) return made.error();
            if (i > 1) times.push_back(1e6 * seconds_since(start));
            const auto truth = session.simplify(now, exact);
            if (!truth) return truth.error();
            const double all = std::max<double>(1, truth->stats.triangles);
            point.error = std::max(point.error, std::abs(static_cast<double>(made->stats.triangles) / all - 1));
        }
        point.time = median(std::move(times));
        points.push_back(std::move(point));
        return {};
    };
    session::Request still = budget, limited = imperceptible;
    still.hysteresis = 1;
    limited.milliseconds = 0.2;
    if (auto ok = add("imperceptible, from scratch", imperceptible, true, false); !ok) return ok.error();
    if (auto ok = add("imperceptible, followed", imperceptible, false, true); !ok) return ok.error();
    if (auto ok = add("imperceptible, followed, 0.2 ms at most", limited, false, false); !ok) return ok.error();
    if (session.scene().objects.size() > 1) return points;
    if (auto ok = add("budget, exact", still, false, false); !ok) return ok.error();
    if (auto ok = add("budget, hysteresis 1.1", budget, false, true); !ok) return ok.error();
    return points;
}

// ---- pictures of depth

Result<std::vector<AccuracyPoint>> stale_points(session::Session& session, const render::Context& context,
                                                const vdtree::View& first, const std::string& subject) {
    constexpr int frames = 24;
    constexpr double metres_a_frame = 1.5 / 60;
    std::vector<AccuracyPoint> points;
    double without = 0;
    for (const int served : {0, 1, 2, 4, 8}) { // frames; 0: no pictures
        std::optional<session::MovingOcclusion> occlusion;
        if (served > 0) {
            auto made = session::MovingOcclusion::create(context, session, {.frames = served});
            if (!made) return made.error();
            occlusion = std::move(*made);
        }
        auto renderer = session::SceneRenderer::create(context, session);
        if (!renderer) return renderer.error();
        session::Follower follower(session);
        session::Request request{.purpose = session::Purpose::picture};
        request.reasons = false;
        vdtree::View view = first;
        const glm::dvec3 step = metres_a_frame * glm::normalize(view.target - view.eye);
        double triangles = 0;
        for (int i = 0; i < frames; ++i, view.eye += step, view.target += step) {
            if (occlusion) {
                auto hidden = occlusion->begin_frame(view);
                if (!hidden) return hidden.error();
                request.hidden = std::move(*hidden);
            }
            const auto made = follower.follow(view, request);
            if (!made) return made.error();
            if (i >= 3) triangles += static_cast<double>(made->stats.triangles); // the first ones have no pictures yet
            if (!occlusion) continue;
            const auto cuts = session::drawn_cuts(follower, session.scene().objects.size());
            const auto items = renderer->items(cuts, view);
            if (!items) return items.error();
            if (auto ended = occlusion->end_frame(*items, view, 0); !ended) return ended.error();
        }
        if (served == 0) without = triangles;
        AccuracyPoint point{stale_axis, subject,
                            served == 0 ? "no pictures"
                                        : "serves " + std::to_string(served) + (served == 1 ? " frame" : " frames")};
        if (occlusion) point.time = static_cast<double>(occlusion->facts().pictures) / frames;
        point.error = triangles / std::max(without, 1.0);
        point.is_default = served == session::MovingOcclusionOptions().frames;
        points.push_back(std::move(point));
    }
    return points;
}

// ---- all of it

void find_fronts(std::vector<AccuracyPoint>& points) {
    for (AccuracyPoint& point : points)
        point.is_on_front = std::ranges::none_of(points, [&](const AccuracyPoint& other) {
            return other.axis == point.axis && other.subject == point.subject && other.time <= point.time &&
                   other.error <= point.error && (other.time < point.time || other.error < point.error);
        });
}

std::string shown(double value) { return value == 0 ? "0" : rounded(value, 3); }

BenchTable table_of(const AccuracyAxis& axis, const std::vector<AccuracyPoint>& points) {
    BenchTable table;
    table.title = axis.name + ": " + axis.question;
    table.rows.push_back({"of", "", axis.time_unit, axis.error_unit, "", ""});
    for (const AccuracyPoint& p : points)
        if (p.axis == axis.name)
            table.rows.push_back({p.subject, p.name, shown(p.time), shown(p.error),
                                  std::string(p.is_on_front ? "*" : "") + (p.is_default ? " default" : ""), p.note});
    table.notes.push_back("* on the front: no other is both faster and nearer to the truth.");
    return table;
}

BenchTable defaults_table(const std::vector<AccuracyPoint>& points) {
    BenchTable table;
    table.title = "What the defaults cost, and are off by";
    table.rows.push_back({"axis", "of", "default", "time", "error", "on the front"});
    for (const AccuracyPoint& p : points) {
        if (!p.is_default) continue;
        const auto axis = std::ranges::find(all_axes, p.axis, &AccuracyAxis::name);
        table.rows.push_back({p.axis, p.subject, p.name, shown(p.time) + " " + axis->time_unit, shown(p.error),
                              p.is_on_front ? "yes" : "no"});
    }
    return table;
}

Json to_json(const std::vector<AccuracyPoint>& points) {
    Json list = Json::array();
    for (const AccuracyPoint& p : points)
        list.push_back({{"axis", p.axis},
                        {"subject", p.subject},
                        {"name", p.name},
                        {"time", number_or_null(p.time)},
                        {"error", number_or_null(p.error)},
                        {"default", p.is_default},
                        {"pareto", p.is_on_front},
                        {"note", p.note}});
    return list;
}

std::string quoted(const std::string& text) {
    std::string out = "\"";
    for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
    return out + "\"";
}

} // namespace

Result<AccuracyBenchResult> bench_accuracy(const AccuracyBenchOptions& options) {
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
    result.axes = all_axes;
    const auto add = [&](Result<std::vector<AccuracyPoint>> points) -> Result<void> {
        if (!points) return points.error();
        result.points.insert(result.points.end(), points->begin(), points->end());
        return {};
    };
    if (auto ok = add(csf_points(options.repeats)); !ok) return ok.error();
    for (const std::string& file : models) {
        session::LoadOptions load;
        load.as = session::LoadAs::automatic;
        auto scene = session::Scene::load(file, load);
        if (!scene) return scene.error();
        const bool is_scene = scene->is_of_file();
        auto session = session::Session::create(std::move(*scene));
        if (!session) return session.error();
        vdtree::View window;
        window.width = window.height = options.window_px;
        window.fov_y_degrees = perception::physical_field(session->observer().display, options.window_px).value();
        const auto camera = session->camera_view(window);
        constexpr double filled = 0.5; // of the window's height
        const vdtree::View view = camera ? *camera : session->frame({0.6, 0.5, 0.62}, filled, window);
        if (const auto ready = session->prepare(view, {.purpose = session::Purpose::picture}); !ready)
            return ready.error();
        const std::string name = std::filesystem::path(file).stem().string();
        if (auto ok = add(fold_points(*session, *context, view, name, options)); !ok) return ok.error();
        if (auto ok = add(cut_points(*session, view, name, options.repeats)); !ok) return ok.error();
        if (is_scene)
            if (auto ok = add(stale_points(*session, *context, view, name)); !ok) return ok.error();
    }
    find_fronts(result.points);
    result.tables.push_back(defaults_table(result.points));
    for (const AccuracyAxis& axis : result.axes) result.tables.push_back(table_of(axis, result.points));
    result.json = {{"points", to_json(result.points)}};
    return result;
}

std::string to_csv(const AccuracyBenchResult& result) {
    std::string text = "axis,subject,name,time,error,default,pareto,note\n";
    for (const AccuracyPoint& p : result.points)
        text += quoted(p.axis) + "," + quoted(p.subject) + "," + quoted(p.name) + "," + shortest(p.time) + "," +
                shortest(p.error) + "," + (p.is_default ? "1" : "0") + "," + (p.is_on_front ? "1" : "0") + "," +
                quoted(p.note) + "\n";
    return text;
}

} // namespace unseen::app
