#include "points_bench.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include <unseen/render/context.h>
#include <unseen/session_gpu/tradeoff.h>

#include "bench_tools.h"
#include "load_model.h"
#include "session_options.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using session::FoldTest;
using session::Goal;

// Requests that share a gaze and lights, named as the options of `unseen`.
struct Group {
    bool has_gaze = false, has_lights = false;
    std::vector<std::pair<std::string, session::Request>> requests;
};

std::vector<Group> usual_groups(vdtree::Index budget) {
    constexpr double pixels = 5;
    const Goal imperceptible = Goal::imperceptible(), spent = Goal::budget(budget);
    const std::string triangles = "--triangles " + std::to_string(budget);
    const std::vector<std::pair<std::string, session::Request>> perceptual = {
        {"--imperceptible", {.goal = imperceptible}},
        {"--fold-test luebke-hallen", {.goal = imperceptible, .fold_test = FoldTest::luebke_hallen}},
        {"--fold-test luebke-hallen-safe", {.goal = imperceptible, .fold_test = FoldTest::luebke_hallen_safe}},
        {"--fold-test luebke-hallen --chroma",
         {.goal = imperceptible, .fold_test = FoldTest::luebke_hallen, .chroma = true}}};
    std::vector<Group> groups = {{.requests = perceptual}, {.has_gaze = true, .requests = perceptual}};
    groups[0].requests.pop_back(); // colour is told with the gaze
    for (auto& request : std::vector<std::pair<std::string, session::Request>>{
             {triangles, {.goal = spent}},
             {triangles + " --fold-test luebke-hallen", {.goal = spent, .fold_test = FoldTest::luebke_hallen}},
             {triangles + " --fold-test extent", {.goal = spent, .fold_test = FoldTest::extent}},
             {"--pixels 5", {.goal = Goal::pixels(pixels)}}})
        groups[0].requests.push_back(std::move(request));
    groups.push_back({true, true, {{"--fold-test luebke-hallen --lights", perceptual[1].second}}});
    return groups;
}

// Of one model.
class PointsTable {
public:
    PointsTable(const render::Context& context, const PointsBenchOptions& options, const std::string& model)
        : context_(context), options_(options), model_(model) {
        table_.title = model;
        table_.rows = {{"request", "triangles", "in the picture", "first cut, ms", "following, ms", "visible pixels",
                        "V", "second judge: V", "unseen from, m"}};
    }

    Result<void> add(const vdtree::VertexTree& tree, const Group& group) {
        session::Scene scene = session::Scene::of(tree.share());
        if (group.has_lights) {
            auto lights = session::light_rig();
            if (!lights) return lights.error();
            scene.lights = std::move(*lights);
        }
        auto session = session::Session::create(std::move(scene));
        if (!session) return session.error();
        ViewOptions seen;
        seen.direction = options_.direction, seen.up = options_.up;
        const vdtree::View view = make_view(*session, seen);
        std::string gaze;
        if (group.has_gaze) {
            const glm::dvec2 px =
                glm::round(session::gaze_aside(session->observer().display, view, session::usual_degrees_aside));
            session->set_gaze(session::Gaze{px});
            gaze = " --gaze " + std::to_string(std::lround(px.x)) + " " + std::to_string(std::lround(px.y));
        }
        session::TradeoffOptions how;
        how.seconds = 1e6;
        how.samples = how.least_samples = options_.samples;
        how.requests = group.requests;
        for (auto& [name, request] : how.requests) request.purpose = session::Purpose::picture, request.reasons = false;
        const auto measured = session::measure_tradeoff(*session, context_, view, how);
        if (!measured) return measured.error();
        for (const session::TradeoffPoint& point : measured->points) {
            const bool is_full = point.request.goal.kind == Goal::Kind::full;
            if (is_full && has_full_) continue;
            has_full_ = true;
            session::Request request = point.request;
            request.purpose = session::Purpose::mesh;
            auto mesh = session->simplify(view, request);
            if (!mesh) return mesh.error();
            add(is_full ? "--full" : point.name + gaze, point, *mesh);
        }
        return {};
    }

    BenchTable table_;
    Json points_ = Json::array();

private:
    void add(const std::string& request, const session::TradeoffPoint& point, const session::Report& mesh) {
        const double from = mesh.imperceptible_from_m;
        table_.rows.push_back({"`" + request + "`", grouped(mesh.stats.triangles), grouped(point.triangles),
                               rounded(mesh.adapt_ms, 2), rounded(point.follow_ms.median, 2),
                               grouped(point.visible_pixels), rounded(point.v, 3), rounded(point.second_v, 3),
                               std::isnan(from) ? "" : rounded(from, 3)});
        points_.push_back({{"model", model_},
                           {"request", request},
                           {"triangles", mesh.stats.triangles},
                           {"picture_triangles", point.triangles},
                           {"adapt_ms", mesh.adapt_ms},
                           {"follow_ms", number_or_null(point.follow_ms.median)},
                           {"draw_ms", point.draw_ms.median},
                           {"visible_pixels", point.visible_pixels},
                           {"v", point.v},
                           {"second_visible_pixels", point.second_visible_pixels},
                           {"second_v", point.second_v},
                           {"imperceptible_from_m", number_or_null(from)}});
    }

    const render::Context& context_;
    const PointsBenchOptions& options_;
    std::string model_;
    bool has_full_ = false;
};

Result<std::vector<std::pair<std::string, vdtree::VertexTree>>> load(const std::vector<std::string>& files) {
    std::vector<std::pair<std::string, vdtree::VertexTree>> trees;
    for (const std::string& file : files.empty() ? installed_meshes() : files) {
        auto tree = load_tree(file);
        if (!tree) return tree.error();
        trees.emplace_back(std::filesystem::path(file).stem().string(), std::move(*tree));
    }
    if (!trees.empty()) return trees;
    auto tree = sample_tree();
    if (!tree) return tree.error();
    trees.emplace_back("sphere", std::move(*tree));
    return trees;
}

} // namespace

Result<PointsBenchResult> bench_points(const PointsBenchOptions& options) {
    auto context = render::Context::headless();
    if (!context) return context.error();
    auto trees = load(options.models);
    if (!trees) return trees.error();
    PointsBenchResult result;
    for (auto& [name, tree] : *trees) {
        auto measured = session::measured(tree, 1);
        if (!measured) return measured.error();
        PointsTable points(*context, options, name);
        for (const Group& group : usual_groups(options.budget.of(tree.triangle_count())))
            if (auto ok = points.add(*measured, group); !ok) return ok.error();
        result.tables.push_back(std::move(points.table_));
        result.points.insert(result.points.end(), points.points_.begin(), points.points_.end());
    }
    return result;
}

} // namespace unseen::app
