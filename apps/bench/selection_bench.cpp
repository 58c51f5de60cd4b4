#include "selection_bench.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <numbers>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <unseen/perception/judge.h>
#include <unseen/session/selection.h>
#include <unseen/session/session.h>
#include <unseen/session_gpu/as_seen.h>
#include <unseen/session_gpu/gpu_judge.h>
#include <unseen/session_gpu/precompute_selections.h>
#include <unseen/session_gpu/scene_renderer.h>

#include "bench_tools.h"
#include "made_scenes.h"
#include "make_scene.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using session::LevelPictures;
using session::SelectionFollower;

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

// ---- the way ----------------------------------------------------------------------------------------------------------

// A Bezier curve over the ground that corners are on, at their height; the eye looks along it.
std::vector<vdtree::View> flight(const session::Selections& selections, const SelectionBenchOptions& options) {
    const session::SelectionGrid& grid = selections.grid;
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
        view.width = options.width, view.height = options.height;
        views.push_back(view);
    }
    return views;
}

// ---- what is measured ---------------------------------------------------------------------------------------------------

struct FrameFigures {
    int number = 0; // of the flight
    std::uint64_t triangles = 0, visible = 0;
    double ssim = 0;
};

// What is told apart by more than its name.
enum class Way { selected, selected_otherwise, nearest, thresholds, area, distance, tree, masked_tree };

struct MethodFigures {
    Way way;
    std::string name;
    std::vector<FrameFigures> frames = {};                         // those that were judged
    double triangles = 0, changes = 0;                             // of all frames, sums
    std::uint64_t most_triangles = 0, most_changes = 0, count = 0; // of all frames

    template <class Value>
    std::array<double, 3> range(Value&& value) const { // largest, least, mean
        std::array<double, 3> r = {-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
                                   0};
        for (const FrameFigures& f : frames) {
            const double v = value(f);
            r[0] = std::max(r[0], v), r[1] = std::min(r[1], v);
            r[2] += v / static_cast<double>(frames.size());
        }
        return r;
    }
    double mean_ssim() const {
        return range([](auto& f) { return f.ssim; })[2];
    }
    double mean_visible() const {
        return range([](auto& f) { return static_cast<double>(f.visible); })[2];
    }
    bool is_tree() const { return way == Way::tree || way == Way::masked_tree; }
};

// Pearson's, of SSIM and visible pixels.
double correlation(const MethodFigures& m) {
    const double ssim = m.mean_ssim(), pixels = m.mean_visible();
    double both = 0, a = 0, b = 0;
    for (const FrameFigures& f : m.frames) {
        const double x = f.ssim - ssim, y = static_cast<double>(f.visible) - pixels;
        both += x * y, a += x * x, b += y * y;
    }
    return both / std::sqrt(a * b); // NaN where one of them never changes
}

// ---- ways to choose levels --------------------------------------------------------------------------------------------

Result<session::Session> session_of(const std::string& file) {
    session::LoadOptions load;
    load.as = session::LoadAs::scene;
    auto scene = session::Scene::load(file, load);
    if (!scene) return scene.error();
    return session::Session::create(std::move(*scene));
}

class Scene {
public:
    static Result<Scene> create(const render::Context& context, const std::string& file, int levels) {
        auto session = session_of(file);
        if (!session) return session.error();
        Scene made;
        made.name = std::filesystem::path(file).stem().string();
        made.session = std::make_unique<session::Session>(std::move(*session));
        auto pictures = LevelPictures::create(context, *made.session, levels);
        if (!pictures) return pictures.error();
        made.pictures = std::make_unique<LevelPictures>(std::move(*pictures));
        for (const session::Object& object : made.session->scene().objects)
            made.spheres.push_back(session::world_sphere(object));
        return made;
    }

    // Larger ones finer, by how large an object is against the window's height, or, by distance, one of mean size.
    std::vector<int> switched(const vdtree::View& view, bool by_distance, double bias) const {
        double mean = 0;
        for (const session::WorldSphere& s : spheres) mean += s.radius / static_cast<double>(spheres.size());
        std::vector<int> levels(spheres.size(), -1);
        for (std::size_t i = 0; i < spheres.size(); ++i) {
            if (!session::is_in_sight(spheres[i], view)) continue;
            const double distance = std::max(glm::length(spheres[i].centre - view.eye), spheres[i].radius);
            const double share = bias * (by_distance ? mean : spheres[i].radius) / distance /
                                 std::tan(field_degrees * std::numbers::pi / 360);
            int level = 0;
            while (level < static_cast<int>(height_shares.size()) &&
                   share < height_shares[static_cast<std::size_t>(level)])
                ++level;
            levels[i] = std::min(level, pictures->chain(i).size() - 1);
        }
        return levels;
    }

    // The finest within the budget, by bisection of the bias.
    std::vector<int> switched_within(const vdtree::View& view, bool by_distance, std::uint64_t budget) const {
        double low = 1e-3, high = 1e3;
        for (int step = 0; step < 24; ++step) {
            const double middle = std::sqrt(low * high);
            (triangles(switched(view, by_distance, middle)) <= budget ? low : high) = middle;
        }
        return switched(view, by_distance, low);
    }

    std::uint64_t triangles(const std::vector<int>& levels) const {
        std::uint64_t sum = 0;
        for (std::size_t i = 0; i < levels.size(); ++i)
            if (levels[i] >= 0) sum += pictures->triangles()[i][static_cast<std::size_t>(levels[i])];
        return sum;
    }

    std::string name;
    std::unique_ptr<session::Session> session;
    std::unique_ptr<LevelPictures> pictures;
    std::vector<session::WorldSphere> spheres;
};

class Flight {
public:
    // The first selections are those that others are held against.
    Flight(const render::Context& context, Scene& scene, const std::vector<session::Selections>& selections,
           const SelectionBenchOptions& options)
        : context_(context), scene_(scene), selections_(selections), options_(options) {}

    Result<std::vector<MethodFigures>> run() {
        if (auto added = add_methods(); !added) return added.error();
        auto renderer = session::SceneRenderer::create(context_, *scene_.session);
        if (!renderer) return renderer.error();
        const auto views = flight(selections_.front(), options_);
        for (std::size_t number = 0; number < views.size(); ++number) {
            const bool is_judged = number % static_cast<std::size_t>(options_.judged_every) == 0;
            if (is_judged)
                if (auto begun = begin(views[number]); !begun) return begun.error();
            for (std::size_t m = 0; m < methods_.size(); ++m) {
                const bool has_levels = m < ways_.size();
                if (!has_levels && !is_judged) continue;
                auto judged =
                    has_levels ? step(m, views[number], is_judged) : step_tree(methods_[m], *renderer, views[number]);
                if (!judged) return judged.error();
                if (!is_judged) continue;
                judged->number = static_cast<int>(number);
                methods_[m].frames.push_back(*judged);
            }
        }
        return std::move(methods_);
    }

private:
    // Those with levels first, each with its way.
    Result<void> add_methods() {
        using session::SelectionBlend;
        for (const session::Selections& selections : selections_) {
            const Way way = &selections == &selections_.front() ? Way::selected : Way::selected_otherwise;
            const std::string name = "selected, by " + name_of(selections.quality);
            if (auto ok = add_selected(way, name, selections, SelectionBlend::costs); !ok) return ok;
        }
        if (auto ok = add_selected(Way::nearest, "selected, combined as in the thesis", selections_.front(),
                                   SelectionBlend::nearest);
            !ok)
            return ok;
        add(Way::thresholds, "by area, the thesis's thresholds",
            [&](const vdtree::View& v) { return scene_.switched(v, false, 1); });
        add(Way::area, "by area, within the budget",
            [&](const vdtree::View& v) { return scene_.switched_within(v, false, options_.budget); });
        add(Way::distance, "by distance, within the budget",
            [&](const vdtree::View& v) { return scene_.switched_within(v, true, options_.budget); });
        methods_.push_back({Way::tree, "the tree's budget"});
        if (options_.has_masked_tree) methods_.push_back({Way::masked_tree, "the tree's budget, masked"});
        last_.resize(ways_.size());
        return {};
    }

    using Choose = std::function<Result<std::vector<int>>(const vdtree::View&)>;
    void add(Way way, const std::string& name, Choose choose) {
        methods_.push_back({way, name});
        ways_.push_back(std::move(choose));
    }
    Result<void> add_selected(Way way, const std::string& name, const session::Selections& selections,
                              session::SelectionBlend blend) {
        auto follower = SelectionFollower::create(selections, scene_.session->scene(), scene_.pictures->triangles(),
                                                  {.budget = options_.budget, .blend = blend});
        if (!follower) return follower.error();
        followers_.push_back(std::make_unique<SelectionFollower>(std::move(*follower)));
        add(way, name, [&own = *followers_.back()](const vdtree::View& view) -> Result<std::vector<int>> {
            auto chosen = own.choose(view);
            if (!chosen) return chosen.error();
            return std::move(chosen->levels);
        });
        return {};
    }

    // A frame of a method with levels; judged if that is asked for.
    Result<FrameFigures> step(std::size_t m, const vdtree::View& view, bool is_judged) {
        const auto levels = ways_[m](view);
        if (!levels) return levels.error();
        MethodFigures& method = methods_[m];
        const std::uint64_t triangles = scene_.triangles(*levels);
        std::uint64_t changes = 0;
        for (std::size_t i = 0; i < last_[m].size(); ++i)
            changes += last_[m][i] >= 0 && (*levels)[i] >= 0 && last_[m][i] != (*levels)[i];
        last_[m] = *levels;
        count(method, triangles);
        method.changes += static_cast<double>(changes);
        method.most_changes = std::max(method.most_changes, changes);
        if (!is_judged) return FrameFigures{};
        const auto frame = scene_.pictures->draw_frame(view, *levels, options_.samples);
        if (!frame) return frame.error();
        auto figures = judge(*frame);
        if (figures) figures->triangles = triangles;
        return figures;
    }

    Result<FrameFigures> step_tree(MethodFigures& method, session::SceneRenderer& renderer, const vdtree::View& view) {
        auto figures = of_tree(renderer, view, method.way == Way::masked_tree);
        if (figures) count(method, figures->triangles);
        return figures;
    }

    static void count(MethodFigures& method, std::uint64_t triangles) {
        ++method.count;
        method.triangles += static_cast<double>(triangles);
        method.most_triangles = std::max(method.most_triangles, triangles);
    }

    Result<void> begin(const vdtree::View& view) {
        std::vector<int> full;
        for (const session::WorldSphere& sphere : scene_.spheres)
            full.push_back(session::is_in_sight(sphere, view) - 1);
        const auto frame = scene_.pictures->draw_frame(view, full, options_.samples);
        if (!frame) return frame.error();
        const session::Observer& observer = scene_.session->observer();
        codes_ = session::code_image(*frame, observer.display);
        auto judge = perception::Judge::create(session::luminance_image(*frame, observer.display),
                                               session::judge_options(observer));
        if (!judge) return judge.error();
        judge_ = std::make_unique<perception::Judge>(std::move(*judge));
        return {};
    }

    Result<FrameFigures> judge(const render::Frame& frame) const {
        const perception::Display& display = scene_.session->observer().display;
        const auto ssim = perception::ssim(codes_, session::code_image(frame, display));
        if (!ssim) return ssim.error();
        const auto verdict = judge_->judge(session::luminance_image(frame, display));
        if (!verdict) return verdict.error();
        return FrameFigures{.visible = verdict->visible_pixels, .ssim = *ssim};
    }

    Result<FrameFigures> of_tree(session::SceneRenderer& renderer, const vdtree::View& view, bool masks) {
        const session::Request request{.goal = session::Goal::budget(static_cast<vdtree::Index>(options_.budget)),
                                       .purpose = session::Purpose::picture,
                                       .reasons = false};
        const auto cuts = masks ? session::simplify_as_seen(*scene_.session, context_, view, request,
                                                            {.folds_hidden = false, .masking = session::Masking::scene})
                                : scene_.session->simplify(view, request);
        if (!cuts) return cuts.error();
        const auto frame = renderer.draw(session::drawn_cuts(cuts->cuts), view,
                                         {.samples = options_.samples, .background = scene_.session->background()});
        if (!frame) return frame.error();
        auto figures = judge(*frame);
        if (figures) figures->triangles = cuts->stats.triangles;
        return figures;
    }

    const render::Context& context_;
    Scene& scene_;
    const std::vector<session::Selections>& selections_;
    const SelectionBenchOptions& options_;
    perception::Image codes_;
    std::unique_ptr<perception::Judge> judge_;
    std::vector<MethodFigures> methods_;
    std::vector<Choose> ways_; // of the first methods
    std::vector<std::unique_ptr<SelectionFollower>> followers_;
    std::vector<std::vector<int>> last_; // levels of the frame before, by way
};

// ---- tables -----------------------------------------------------------------------------------------------------

BenchTable table_of(const std::string& scene, const std::vector<MethodFigures>& methods) {
    BenchTable table;
    table.title = scene;
    table.rows.push_back({"levels", "triangles", "most", "SSIM, most", "least", "mean", "visible pixels, most", "least",
                          "mean", "changes a frame", "most"});
    const auto count = [](double v) { return grouped(static_cast<std::uint64_t>(std::llround(v))); };
    for (const MethodFigures& m : methods) {
        const auto ssim = m.range([](auto& f) { return f.ssim; });
        const auto visible = m.range([](auto& f) { return static_cast<double>(f.visible); });
        const auto frames = static_cast<double>(std::max<std::uint64_t>(m.count, 1));
        table.rows.push_back({m.name, count(m.triangles / frames), grouped(m.most_triangles), rounded(ssim[0], 6),
                              rounded(ssim[1], 6), rounded(ssim[2], 6), count(visible[0]), count(visible[1]),
                              count(visible[2]), m.is_tree() ? "" : rounded(m.changes / frames, 2),
                              m.is_tree() ? "" : grouped(m.most_changes)});
    }
    return table;
}

Json to_json(const std::vector<MethodFigures>& methods) {
    Json json = Json::array();
    for (const MethodFigures& m : methods) {
        Json frames = Json::array();
        for (const FrameFigures& f : m.frames)
            frames.push_back(
                {{"frame", f.number}, {"triangles", f.triangles}, {"ssim", f.ssim}, {"visible_pixels", f.visible}});
        json.push_back({{"levels", m.name},
                        {"correlation", number_or_null(correlation(m))},
                        {"changes", m.changes},
                        {"most_changes", m.most_changes},
                        {"frames", frames}});
    }
    return json;
}

const MethodFigures& figures_of(const std::vector<MethodFigures>& methods, Way way) {
    return *std::ranges::find(methods, way, &MethodFigures::way);
}

// Scene by scene.
class SelectionBench {
public:
    SelectionBench(const render::Context& context, const MadeScenes& made, const SelectionBenchOptions& options)
        : context_(context), made_(made), options_(options) {
        result_.json["scenes"] = Json::array();
        before_.title = "Before the flight";
        before_.rows = {{"scene", "by", "objects", "triangles", "cameras", "s", "of it levels", "drawing",
                         "reading back", "searching, all threads", "drawings", "evaluations", "the thesis"}};
        means_.title = "Means, beside the thesis's (1920 x 1080 pixels, its own judge and meshes)";
        means_.rows = {{"scene", "SSIM, by area: thesis", "its selection", "here, thresholds", "within the budget",
                        "selected", "tree", "visible pixels, by area: thesis", "its selection", "here, thresholds",
                        "within the budget", "selected", "tree"}};
        correlations_.title = "Correlation of SSIM and visible pixels, levels selected";
        correlations_.rows = {{"scene", "Pearson's", "the thesis"}};
    }

    // `selected`: levels that are given for it; empty: they are searched.
    Result<void> add(const std::string& file, const std::string& selected) {
        std::vector<session::Selections> selections;
        if (!selected.empty())
            if (auto read = read_into(selections, selected); !read) return read;
        auto scene = Scene::create(context_, file,
                                   selected.empty() ? session::default_selected_levels : selections.front().levels);
        if (!scene) return scene.error();
        Json json = {{"scene", scene->name}};
        if (selected.empty())
            if (auto searched = search(*scene, selections, json); !searched) return searched;
        const auto methods = Flight(context_, *scene, selections, options_).run();
        if (!methods) return methods.error();
        result_.tables.push_back(table_of(scene->name, *methods));
        json["methods"] = to_json(*methods);
        add_means(scene->name, *methods);
        result_.json["scenes"].push_back(std::move(json));
        return {};
    }

    SelectionBenchResult take() {
        result_.tables.push_back(std::move(means_));
        result_.tables.push_back(std::move(correlations_));
        if (before_.rows.size() > 1) result_.tables.push_back(std::move(before_));
        return std::move(result_);
    }

private:
    static Result<void> read_into(std::vector<session::Selections>& selections, const std::string& file) {
        auto read = session::read_selections(file);
        if (!read) return read.error();
        selections.push_back(std::move(*read));
        return {};
    }

    Result<void> search(Scene& scene, std::vector<session::Selections>& selections, Json& json) {
        const Thesis* const there = thesis_of(scene.name);
        const std::string file = made_.file(scene.name + ".sel");
        for (const session::SelectionQuality quality : options_.qualities) {
            const auto done = session::precompute_selections(context_, *scene.session, file,
                                                             {.budget = options_.budget,
                                                              .quality = quality,
                                                              .window_px = options_.window_px,
                                                              .spacing = options_.spacing});
            if (!done) return done.error();
            before_.rows.push_back(
                {scene.name, name_of(quality), grouped(scene.spheres.size()), grouped(scene.session->triangle_count()),
                 grouped(done->cameras), rounded(done->seconds, 3), rounded(done->load_seconds, 3),
                 rounded(done->draw_seconds, 3), rounded(done->read_seconds, 3), rounded(done->search_seconds, 3),
                 grouped(done->drawings), grouped(done->evaluations),
                 there ? std::to_string(there->cameras) + " cameras in " + there->precompute : ""});
            json["precompute"].push_back({{"quality", name_of(quality)},
                                          {"cameras", done->cameras},
                                          {"seconds", done->seconds},
                                          {"load_seconds", done->load_seconds},
                                          {"draw_seconds", done->draw_seconds},
                                          {"read_seconds", done->read_seconds},
                                          {"search_seconds", done->search_seconds}});
            if (auto read = read_into(selections, file); !read) return read;
        }
        return {};
    }

    void add_means(const std::string& scene, const std::vector<MethodFigures>& methods) {
        const Thesis* const there = thesis_of(scene);
        std::vector<std::string> row = {scene};
        for (const bool is_ssim : {true, false}) {
            const auto text = [&](double v) {
                return is_ssim ? rounded(v, 6) : grouped(static_cast<std::uint64_t>(std::llround(v)));
            };
            row.push_back(there ? text(is_ssim ? there->ssim_by_area : there->pixels_by_area) : "");
            row.push_back(there ? text(is_ssim ? there->ssim_selected : there->pixels_selected) : "");
            for (const Way way : {Way::thresholds, Way::area, Way::selected, Way::tree}) {
                const MethodFigures& m = figures_of(methods, way);
                row.push_back(text(is_ssim ? m.mean_ssim() : m.mean_visible()));
            }
        }
        means_.rows.push_back(std::move(row));
        correlations_.rows.push_back(
            {scene, rounded(correlation(methods.front()), 3), there ? rounded(there->correlation, 3) : ""});
    }

    const render::Context& context_;
    const MadeScenes& made_;
    const SelectionBenchOptions& options_;
    SelectionBenchResult result_;
    BenchTable before_, means_, correlations_;
};

} // namespace

Result<SelectionBenchResult> bench_selection(const SelectionBenchOptions& options) {
    const MadeScenes made;
    auto files = options.scenes;
    if (files.empty()) {
        auto own = made.make_to_select_in(options.scene_triangles, options.statues);
        if (!own) return own.error();
        files = std::move(*own);
    }
    if (!options.selections.empty() && options.selections.size() != files.size())
        return Error{ErrorCode::invalid_argument, "Give as many selections as scenes, in the same order."};
    if (auto folder = made.make_folder(); !folder) return folder.error();
    auto context = render::Context::headless();
    if (!context) return context.error();
    SelectionBench bench(*context, made, options);
    for (std::size_t i = 0; i < files.size(); ++i)
        if (auto added = bench.add(files[i], options.selections.empty() ? "" : options.selections[i]); !added)
            return added.error();
    return bench.take();
}

} // namespace unseen::app
