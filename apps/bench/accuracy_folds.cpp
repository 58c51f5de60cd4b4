// Fold tests, thresholds and budgets, and what others make of the same count of triangles.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include <glm/geometric.hpp>

#include <unseen/session_gpu/picture_judge.h>
#include <unseen/session_gpu/tradeoff.h>

#include "accuracy.h"
#include "peer_simplify.h"
#include "terminal.h"

namespace unseen::app {
namespace {

// Bytes a triangle of the trees, each counted once, with and without what is kept with them of their folds.
struct TreeBytes {
    double measured = 0, plain = 0;
};
TreeBytes bytes_a_triangle(const session::Session& session) {
    std::set<const vdtree::VertexTree::Data*> seen;
    double all = 0, attributes = 0, triangles = 0;
    for (std::size_t i = 0; i < session.scene().objects.size(); ++i) {
        const vdtree::VertexTree& tree = session.tree(i);
        if (!seen.insert(&tree.data()).second) continue;
        all += static_cast<double>(tree.byte_size());
        triangles += tree.triangle_count();
        for (const vdtree::Attribute& attribute : tree.attributes())
            attributes += static_cast<double>(attribute.count * attribute.element_bytes);
    }
    return {all / triangles, (all - attributes) / triangles};
}

// Discrete levels of each object, those of one tree made once.
class Levels {
public:
    explicit Levels(AccuracySubject& subject) : subject_(subject) {
        const auto start = BenchClock::now();
        double bytes = 0, full = 0;
        for (std::size_t i = 0; i < subject.session.scene().objects.size(); ++i) {
            const auto* const tree = &subject.session.tree(i).data();
            if (!chains_.contains(tree)) {
                auto chain = require(
                    session::level_chain(subject.session, subject.view, {.purpose = session::Purpose::picture}, i));
                constexpr double of_triangle = 12, of_vertex = 16; // bytes; half as many vertices
                for (int level = 0; level < chain.size(); ++level)
                    bytes += chain.triangles(level) * (of_triangle + 0.5 * of_vertex);
                full += chain.triangles(0);
                chains_.emplace(tree, std::move(chain));
            }
            of_object_.push_back(&chains_.at(tree));
        }
        bytes_ = bytes / full;
        seconds_ = seconds_since(start);
    }
    double seconds() const { return seconds_; }
    double bytes() const { return bytes_; } // a triangle of the full trees

    // Each object's coarsest level that nobody sees from where the eye is, times the bias.
    std::vector<vdtree::Cut> cuts(double bias) const {
        std::vector<vdtree::Cut> all;
        for (std::size_t i = 0; i < of_object_.size(); ++i) all.push_back(of_object_[i]->cut(level(i, bias)));
        return all;
    }
    // The finest bias that leaves at most so many triangles; the worst levels if none does.
    double bias_of(double triangles) const {
        return bisect(1e-6, 1e6, 48, [&](double bias) {
            double sum = 0;
            for (std::size_t i = 0; i < of_object_.size(); ++i) sum += of_object_[i]->triangles(level(i, bias));
            return sum <= triangles;
        });
    }

private:
    int level(std::size_t i, double bias) const {
        const session::Object& object = subject_.session.scene().objects[i];
        const session::WorldSphere sphere = session::world_sphere(object);
        const double away = std::max(glm::distance(sphere.centre, subject_.view.eye) - sphere.radius, 0.0);
        int level = of_object_[i]->size() - 1;
        while (level > 0 && !(of_object_[i]->unseen_from(level) * bias <= away / object.placement.scale)) --level;
        return level;
    }

    const AccuracySubject& subject_;
    std::map<const vdtree::VertexTree::Data*, session::LevelChain> chains_;
    std::vector<const session::LevelChain*> of_object_;
    double seconds_ = 0, bytes_ = 0;
};

// The scene with meshoptimizer's meshes, each object with as many triangles as its cut has.
struct PeerScene {
    PeerScene(const session::Session& full, const std::vector<vdtree::Cut>& cuts)
        : session(require(session::Session::create(scene_of(full, cuts), full.observer()))) {
        bytes /= static_cast<double>(full.triangle_count());
        for (std::size_t i = 0; i < cuts.size(); ++i) {
            vdtree::Cut& cut = own_cuts.emplace_back(session.tree(i));
            if (cuts[i].triangle_count() > 0) cut.unfold_all();
        }
    }

    double seconds = 0, bytes = 0; // of meshoptimizer alone; a triangle of the full scene
    session::Session session;
    std::vector<vdtree::Cut> own_cuts;

private:
    static session::Object placed(vdtree::VertexTree tree, const session::Object& like) {
        session::Object object{.tree = std::move(tree)};
        object.placement = like.placement;
        object.is_relit = like.is_relit;
        return object;
    }
    vdtree::VertexTree simplified(const vdtree::VertexTree& tree, vdtree::Index triangles) {
        if (triangles == 0 || triangles == tree.triangle_count()) return tree.share();
        const vdtree::Mesh mesh = whole_mesh(tree);
        vdtree::Mesh simple;
        seconds += seconds_of([&] { simple = simplified_by_meshoptimizer(mesh, triangles); });
        bytes += static_cast<double>(simple.triangles.size() * sizeof(vdtree::Triangle) +
                                     simple.positions.size() * 4 * sizeof(float));
        return simple.triangles.empty() ? tree.share() : tree_like(tree, simple);
    }
    session::Scene scene_of(const session::Session& full, const std::vector<vdtree::Cut>& cuts) {
        session::Scene scene;
        scene.background = full.scene().background;
        scene.lights = full.scene().lights;
        for (const session::Object& part : full.scene().backdrop)
            scene.backdrop.push_back(placed(part.tree.share(), part));
        for (std::size_t i = 0; i < cuts.size(); ++i)
            scene.objects.push_back(
                placed(simplified(full.tree(i), cuts[i].triangle_count()), full.scene().objects[i]));
        return scene;
    }
};

// Levels and meshoptimizer's cuts, beside measure_tradeoff()'s own: the same columns.
void add_others(AccuracySubject& subject, int samples, AccuracyPoints& points) {
    auto judge = require(session::PictureJudge::create(subject.context, subject.session, subject.view, samples));
    const auto add = [&](const std::string& name, session::SceneRenderer& renderer,
                         const std::vector<vdtree::Cut>& cuts, double preparation_s, double of_triangle,
                         const std::string& note) {
        render::DrawOptions drawing = judge.drawing();
        const auto drawn = session::drawn_cuts(cuts);
        const auto verdict = require(judge.judge(require(renderer.draw(drawn, subject.view, drawing))));
        drawing.samples = 1;
        std::vector<double> times;
        for (int i = 0; i < accuracy_repeats; ++i)
            times.push_back(require(renderer.draw(drawn, subject.view, drawing)).draw_ms);
        double triangles = 0;
        for (const vdtree::Cut& cut : cuts) triangles += cut.triangle_count();
        const double shift_mm = &renderer == &judge.renderer() ? 1e3 * session::largest_shift(subject.session, cuts)
                                                               : std::numeric_limits<double>::quiet_NaN();
        points.push_back(
            {.name = name,
             .values = {median(std::move(times)), verdict.v, triangles, static_cast<double>(verdict.visible_pixels),
                        static_cast<double>(verdict.second_visible_pixels), 1 - verdict.ssim, shift_mm, preparation_s,
                        of_triangle},
             .note = note});
    };
    const session::Request request{.purpose = session::Purpose::picture};
    const auto imperceptible = require(subject.session.simplify(subject.view, request));
    const double prepared_s = subject.build_s + subject.measure_s;
    const Levels levels(subject);
    const double count = imperceptible.stats.triangles;
    for (const auto& [name, bias] : {std::pair{"discrete levels, where nobody sees them", 1.0},
                                     {"discrete levels, as many triangles", levels.bias_of(count)}})
        add(name, judge.renderer(), levels.cuts(bias), prepared_s + levels.seconds(), levels.bytes(),
            "without following");
    if (!has_meshoptimizer()) return;
    const PeerScene peer(subject.session, imperceptible.cuts);
    auto renderer = require(session::SceneRenderer::create(subject.context, peer.session));
    add("meshoptimizer, as many triangles", renderer, peer.own_cuts, peer.seconds, peer.bytes,
        "one mesh for all views");
}

} // namespace

AccuracyPoints fold_points(AccuracySubject& subject) {
    session::TradeoffOptions tradeoff;
    tradeoff.seconds = subject.seconds;
    tradeoff.samples = tradeoff.least_samples = accuracy_samples; // what is seen must not depend on what else runs
    const auto measured = require(session::measure_tradeoff(subject.session, subject.context, subject.view, tradeoff));
    for (const std::string& name : measured.left_out) { // a name, or a name and why
        const bool is_for_time = name.find(": ") == std::string::npos;
        subject.left_out.push_back(is_for_time ? name + ": no time was left (--seconds)." : name);
    }
    const TreeBytes bytes = bytes_a_triangle(subject.session);
    AccuracyPoints points;
    for (const session::TradeoffPoint& p : measured.points) {
        const bool is_full = p.request.goal.kind == session::Goal::Kind::full;
        const bool is_error = !p.request.fold_test && p.request.goal.kind != session::Goal::Kind::pixels && !is_full;
        points.push_back({.name = p.name,
                          .values = {p.draw_ms.median + (std::isnan(p.follow_ms.median) ? 0 : p.follow_ms.median), p.v,
                                     static_cast<double>(p.triangles), static_cast<double>(p.visible_pixels),
                                     static_cast<double>(p.second_visible_pixels), 1 - p.ssim, 1e3 * p.shift,
                                     is_full ? 0 : subject.build_s + (is_error ? subject.measure_s : 0),
                                     is_error ? bytes.measured : bytes.plain},
                          .note = p.is_of_view ? "this view alone" : "",
                          .is_default = p.name == "imperceptible"});
    }
    add_others(subject, measured.samples, points);
    return points;
}

} // namespace unseen::app
