#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <unseen/perception/judge.h>
#include <unseen/session/internal/selections.h>
#include <unseen/session_gpu/internal/level_pictures.h>
#include <unseen/session_gpu/precompute_selections.h>
#include <unseen/session_gpu/scene_renderer.h>

#include "bench_tools.h"
#include "benches.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr double field_degrees = 60; // vertical
// Share of the window's height that an object has at least, by level: the source's.
constexpr std::array<double, 4> height_shares = {0.5, 0.25, 0.125, 0.075};

// Tables 4.2 to 4.4 and 5.1 of the source: means at 1920 x 1080, of meshes of its own.
struct Thesis {
    const char* scene;
    int cameras;
    const char* precompute;
    double ssim_by_area, ssim_selected, pixels_by_area, pixels_selected, correlation;
};
constexpr std::array<Thesis, 3> thesis = {{{"spheres", 404, "13 h 25 min", 0.999579, 0.999916, 354, 346, -0.746},
                                           {"bunnies", 378, "30 h 11 min", 0.995292, 0.989877, 11483, 29134, -0.761},
                                           {"models", 284, "15 h 39 min", 0.988967, 0.988706, 31668, 32052, -0.854}}};

const Thesis* thesis_of(const std::string& scene) {
    const auto found = std::ranges::find(thesis, scene, &Thesis::scene);
    return found != thesis.end() ? &*found : nullptr;
}

// ---- the way

// A Bezier curve over the ground that corners are on, at their height; the eye looks along it.
std::vector<vdtree::View> flight(const session::Selections& selections, const SelectionOptions& options) {
    const session::SelectionGrid& grid = selections.data().grid;
    const std::int32_t size = grid.cell_size();
    const glm::dvec3 low = grid.place({0, 0, 0}), high = grid.place({grid.cells.x * size, 0, grid.cells.z * size});
    const auto at = [&](double x, double z) { return glm::mix(low, high, glm::dvec3(x, 0, z)); };
    const std::array<glm::dvec3, 4> p = {at(0, 0.2), at(0.45, 1.3), at(0.55, -0.3), at(1, 0.8)};
    std::vector<vdtree::View> views;
    for (int i = 0; i < options.frames; ++i) {
        const double t = (i + 0.5) / options.frames, u = 1 - t;
        vdtree::View view;
        view.eye = u * u * u * p[0] + 3 * u * u * t * p[1] + 3 * u * t * t * p[2] + t * t * t * p[3];
        view.target =
            view.eye + glm::normalize(u * u * (p[1] - p[0]) + 2 * u * t * (p[2] - p[1]) + t * t * (p[3] - p[2]));
        view.fov_y_degrees = field_degrees;
        view.width = options.size[0], view.height = options.size[1];
        views.push_back(view);
    }
    return views;
}

// ---- what is measured

struct FrameFigures {
    std::size_t number = 0; // of the flight
    std::uint64_t triangles = 0;
    double visible = 0, ssim = 0;
};

// Those that are told apart by more than their name.
enum class Way { selected, thresholds, area, tree, other };

// A way to choose what is drawn, and what came of it.
struct Method {
    using Levels = std::vector<int>; // by object; below 0: not drawn

    Way way;
    std::string name;
    std::function<Levels(const vdtree::View&)> choose = {}; // not set: the tree's cuts
    Levels last = {};                                       // of the frame before
    std::vector<FrameFigures> frames = {};                  // those that were judged
    double triangles = 0, changes = 0, count = 0;           // of all frames, sums
    double most_triangles = 0, most_changes = 0;            // of all frames

    std::array<double, 3> range(double FrameFigures::*value) const { // largest, least, mean
        std::array<double, 3> r = {-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
                                   0};
        for (const FrameFigures& f : frames) {
            r[0] = std::max(r[0], f.*value), r[1] = std::min(r[1], f.*value);
            r[2] += f.*value / static_cast<double>(frames.size());
        }
        return r;
    }
    // Pearson's, of SSIM and visible pixels. NaN if one of them never changes.
    double correlation() const {
        const double ssim = range(&FrameFigures::ssim)[2], pixels = range(&FrameFigures::visible)[2];
        double both = 0, a = 0, b = 0;
        for (const FrameFigures& f : frames) {
            const double x = f.ssim - ssim, y = f.visible - pixels;
            both += x * y, a += x * x, b += y * y;
        }
        return both / std::sqrt(a * b);
    }
};

// ---- ways to choose levels

struct Scene {
    Scene(const render::Context& context, const std::string& file, int levels)
        : name(std::filesystem::path(file).stem().string()), session(load(file)),
          pictures(require(session::LevelPictures::create(context, session, levels))) {
        for (const session::Object& object : session.scene().objects) spheres.push_back(session::world_sphere(object));
    }

    // Larger ones finer, by how large an object is against the window's height, or, by distance, one of mean size.
    Method::Levels switched(const vdtree::View& view, bool by_distance, double bias) const {
        double mean = 0;
        for (const session::WorldSphere& s : spheres) mean += s.radius / static_cast<double>(spheres.size());
        Method::Levels levels(spheres.size(), -1);
        for (std::size_t i = 0; i < spheres.size(); ++i) {
            if (!session::is_in_sight(spheres[i], view)) continue;
            const double distance = std::max(glm::length(spheres[i].centre - view.eye), spheres[i].radius);
            const double share = bias * (by_distance ? mean : spheres[i].radius) / distance /
                                 std::tan(field_degrees * std::numbers::pi / 360);
            const auto level = std::ranges::find_if(height_shares, [&](double least) { return !(share < least); });
            levels[i] = std::min(static_cast<int>(level - height_shares.begin()), pictures.chain(i).size() - 1);
        }
        return levels;
    }

    // The finest within the budget.
    Method::Levels switched_within(const vdtree::View& view, bool by_distance, std::uint64_t budget) const {
        return switched(view, by_distance, bisect(1e-3, 1e3, 24, [&](double bias) {
                            return triangles(switched(view, by_distance, bias)) <= budget;
                        }));
    }

    std::uint64_t triangles(const Method::Levels& levels) const {
        std::uint64_t sum = 0;
        for (std::size_t i = 0; i < levels.size(); ++i)
            if (levels[i] >= 0) sum += pictures.triangles()[i][static_cast<std::size_t>(levels[i])];
        return sum;
    }

    std::string name;
    session::Session session;
    session::LevelPictures pictures;
    std::vector<session::WorldSphere> spheres;

private:
    static session::Session load(const std::string& file) {
        session::LoadOptions how;
        how.as = session::LoadAs::scene;
        return require(session::Session::create(require(session::Scene::load(file, how))));
    }
};

// Those with levels first. The first selections are those that others are held against.
std::vector<Method> methods_of(const Scene& scene, const std::vector<session::Selections>& selections,
                               const SelectionOptions& options) {
    std::vector<Method> methods;
    using session::SelectionBlend;
    const auto add_selected = [&](Way way, const std::string& name, const session::Selections& selected,
                                  SelectionBlend blend) {
        const auto follower = std::make_shared<session::SelectionFollower>(require(session::SelectionFollower::create(
            selected, scene.session.scene(), scene.pictures.triangles(), {.budget = options.budget, .blend = blend})));
        methods.push_back(
            {way, name, [follower](const vdtree::View& view) { return require(follower->choose(view)).levels; }});
    };
    for (const session::Selections& selected : selections)
        add_selected(&selected == &selections.front() ? Way::selected : Way::other,
                     "selected, by " + name_of(selected.data().quality), selected, SelectionBlend::costs);
    add_selected(Way::other, "selected, combined as in the thesis", selections.front(), SelectionBlend::nearest);
    methods.push_back({Way::thresholds, "by area, the thesis's thresholds",
                       [&scene](const vdtree::View& v) { return scene.switched(v, false, 1); }});
    for (const bool by_distance : {false, true})
        methods.push_back({by_distance ? Way::other : Way::area,
                           by_distance ? "by distance, within the budget" : "by area, within the budget",
                           [&scene, by_distance, budget = options.budget](const vdtree::View& v) {
                               return scene.switched_within(v, by_distance, budget);
                           }});
    methods.push_back({Way::tree, "the tree's budget"});
    return methods;
}

class Flight {
public:
    Flight(const render::Context& context, Scene& scene, const SelectionOptions& options)
        : scene_(scene), options_(options), renderer_(require(session::SceneRenderer::create(context, scene.session))) {
    }

    void run(std::vector<Method>& methods, const std::vector<vdtree::View>& views) {
        for (std::size_t number = 0; number < views.size(); ++number) {
            const bool is_judged = number % static_cast<std::size_t>(options_.judged_every) == 0;
            if (is_judged) begin(views[number]);
            for (Method& method : methods)
                if (is_judged || method.choose) step(method, views[number], number, is_judged);
        }
    }

private:
    void begin(const vdtree::View& view) {
        Method::Levels full;
        for (const session::WorldSphere& sphere : scene_.spheres)
            full.push_back(session::is_in_sight(sphere, view) - 1);
        const render::Frame frame = require(scene_.pictures.draw_frame(view, full, options_.samples));
        const session::Observer& observer = scene_.session.observer();
        codes_ = session::code_image(frame, observer.display);
        judge_ = std::make_unique<perception::Judge>(require(perception::Judge::create(
            session::light_image(frame, observer.display), session::judge_options(observer))));
    }

    void step(Method& method, const vdtree::View& view, std::size_t number, bool is_judged) {
        std::uint64_t triangles = 0;
        std::optional<render::Frame> frame;
        if (method.choose) {
            const Method::Levels levels = method.choose(view);
            triangles = scene_.triangles(levels);
            double changes = 0;
            for (std::size_t i = 0; i < method.last.size(); ++i)
                changes += method.last[i] >= 0 && levels[i] >= 0 && method.last[i] != levels[i];
            method.last = levels;
            method.changes += changes;
            method.most_changes = std::max(method.most_changes, changes);
            if (is_judged) frame = require(scene_.pictures.draw_frame(view, levels, options_.samples));
        } else {
            const auto cuts = cuts_of(view);
            triangles = cuts.stats.triangles;
            frame = require(renderer_.draw(session::drawn_cuts(cuts.cuts), view,
                                           {.samples = options_.samples, .background = scene_.session.background()}));
        }
        ++method.count;
        method.triangles += static_cast<double>(triangles);
        method.most_triangles = std::max(method.most_triangles, static_cast<double>(triangles));
        if (!is_judged) return;
        const perception::Display& display = scene_.session.observer().display;
        method.frames.push_back(
            {number, triangles,
             static_cast<double>(require(judge_->judge(session::light_image(*frame, display))).visible_pixels),
             require(perception::ssim(codes_, session::code_image(*frame, display)))});
    }

    session::Simplification cuts_of(const vdtree::View& view) {
        const session::Request request{.goal = session::Goal::budget(static_cast<vdtree::Index>(options_.budget)),
                                       .purpose = session::Purpose::picture,
                                       .reasons = false};
        return require(scene_.session.simplify(view, request));
    }

    Scene& scene_;
    const SelectionOptions& options_;
    session::SceneRenderer renderer_;
    perception::Image codes_;
    std::unique_ptr<perception::Judge> judge_;
};

// ---- tables

BenchTable table_of(const std::string& scene, const std::vector<Method>& methods) {
    BenchTable table{scene,
                     {{"levels"},
                      {"triangles"},
                      {"most"},
                      {"SSIM, most"},
                      {"least"},
                      {"mean"},
                      {"visible pixels, most"},
                      {"least"},
                      {"mean"},
                      {"changes a frame"},
                      {"most"}}};
    for (const Method& m : methods) {
        const double frames = std::max(m.count, 1.0);
        std::vector<Cell>& row =
            table.rows.emplace_back(std::vector<Cell>{m.name, count(m.triangles / frames), count(m.most_triangles)});
        for (const double value : m.range(&FrameFigures::ssim)) row.push_back(number(value, 6));
        for (const double value : m.range(&FrameFigures::visible)) row.push_back(count(value));
        row.push_back(m.choose ? number(m.changes / frames, 2) : "");
        row.push_back(m.choose ? count(m.most_changes) : "");
    }
    return table;
}

Json to_json(const std::vector<Method>& methods) {
    Json json = Json::array();
    for (const Method& m : methods) {
        Json frames = Json::array();
        for (const FrameFigures& f : m.frames)
            frames.push_back(
                {{"frame", f.number}, {"triangles", f.triangles}, {"ssim", f.ssim}, {"visible_pixels", f.visible}});
        json.push_back({{"levels", m.name},
                        {"correlation", number_or_null(m.correlation())},
                        {"changes", m.changes},
                        {"most_changes", m.most_changes},
                        {"frames", frames}});
    }
    return json;
}

void add_means(BenchTable& means, const std::string& scene, const std::vector<Method>& methods) {
    const Thesis* const there = thesis_of(scene);
    std::vector<Cell>& row = means.rows.emplace_back(std::vector<Cell>{scene});
    for (const bool is_ssim : {true, false}) {
        const auto text = [&](double v) { return is_ssim ? number(v, 6) : count(v); };
        row.push_back(there ? text(is_ssim ? there->ssim_by_area : there->pixels_by_area) : "");
        row.push_back(there ? text(is_ssim ? there->ssim_selected : there->pixels_selected) : "");
        for (const Way way : {Way::thresholds, Way::area, Way::selected, Way::tree}) {
            const Method& m = *std::ranges::find(methods, way, &Method::way);
            row.push_back(text(m.range(is_ssim ? &FrameFigures::ssim : &FrameFigures::visible)[2]));
        }
    }
}

// Searches by each quality that is asked for.
std::vector<session::Selections> search(const render::Context& context, Scene& scene, const std::string& file,
                                        const SelectionOptions& options, BenchTable& before, Json& json) {
    const Thesis* const there = thesis_of(scene.name);
    std::vector<session::Selections> selections;
    for (const session::SelectionQuality quality : options.qualities) {
        const auto done = require(session::precompute_selections(context, scene.session, file,
                                                                 {.budget = options.budget,
                                                                  .quality = quality,
                                                                  .window_px = options.window_px,
                                                                  .spacing = options.spacing}));
        before.rows.push_back({scene.name, name_of(quality), grouped(scene.spheres.size()),
                               grouped(scene.session.triangle_count()), grouped(done.cameras), number(done.seconds, 3),
                               number(done.load_seconds, 3), number(done.draw_seconds, 3), number(done.read_seconds, 3),
                               number(done.search_seconds, 3), grouped(done.drawings), grouped(done.evaluations),
                               there ? std::to_string(there->cameras) + " cameras in " + there->precompute : ""});
        json.push_back({{"quality", name_of(quality)}, {"cameras", done.cameras}, {"seconds", done.seconds}});
        selections.push_back(require(session::Selections::read(file)));
    }
    return selections;
}

} // namespace

BenchReport bench_selection(const SelectionOptions& options) {
    const BenchFolder folder;
    const std::vector<std::string> files =
        options.scenes.empty() ? make_scenes_to_select_in(folder, options.statues) : options.scenes;
    if (!options.selections.empty() && options.selections.size() != files.size())
        throw BenchFailure{{ErrorCode::invalid_argument, "Give as many selections as scenes, in the same order."}};
    const render::Context context = require(render::Context::headless());
    BenchReport report{{},
                       {{"scenes", Json::array()},
                        {"budget", options.budget},
                        {"width", options.size[0]},
                        {"height", options.size[1]},
                        {"samples", options.samples}}};
    BenchTable before{"Before the flight",
                      {{"scene"},
                       {"by"},
                       {"objects"},
                       {"triangles"},
                       {"cameras"},
                       {"s"},
                       {"of it levels"},
                       {"drawing"},
                       {"reading back"},
                       {"searching, all threads"},
                       {"drawings"},
                       {"evaluations"},
                       {"the thesis"}}};
    BenchTable means{"Means, beside the thesis's (1920 x 1080 pixels, its own judge and meshes)",
                     {{"scene"},
                      {"SSIM, by area: thesis"},
                      {"its selection"},
                      {"here, thresholds"},
                      {"within the budget"},
                      {"selected"},
                      {"tree"},
                      {"visible pixels, by area: thesis"},
                      {"its selection"},
                      {"here, thresholds"},
                      {"within the budget"},
                      {"selected"},
                      {"tree"}}};
    BenchTable correlations{"Correlation of SSIM and visible pixels, levels selected",
                            {{"scene"}, {"Pearson's"}, {"the thesis"}}};
    for (std::size_t i = 0; i < files.size(); ++i) {
        std::vector<session::Selections> selections;
        if (!options.selections.empty())
            selections.push_back(require(session::Selections::read(options.selections[i])));
        Scene scene(context, files[i],
                    selections.empty() ? session::default_selected_levels : selections.front().levels());
        Json json = {{"scene", scene.name}};
        if (selections.empty())
            selections =
                search(context, scene, (folder / (scene.name + ".sel")).string(), options, before, json["precompute"]);
        std::vector<Method> methods = methods_of(scene, selections, options);
        Flight(context, scene, options).run(methods, flight(selections.front(), options));
        report.tables.push_back(table_of(scene.name, methods));
        json["methods"] = to_json(methods);
        report.json["scenes"].push_back(std::move(json));
        add_means(means, scene.name, methods);
        const Thesis* const there = thesis_of(scene.name);
        correlations.rows.push_back(
            {scene.name, number(methods.front().correlation(), 3), there ? number(there->correlation, 3) : ""});
    }
    report.tables.insert(report.tables.end(), {std::move(means), std::move(correlations)});
    if (!before.rows.empty()) report.tables.push_back(std::move(before));
    return report;
}

} // namespace unseen::app
