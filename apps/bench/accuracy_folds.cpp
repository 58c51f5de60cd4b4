// Fold tests, thresholds and budgets, and what others make of the same count of triangles.
#include "accuracy_axes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include <glm/geometric.hpp>

#include <unseen/session/level_chain.h>
#include <unseen/session_gpu/as_seen.h>
#include <unseen/session_gpu/picture_judge.h>
#include <unseen/session_gpu/tradeoff.h>
#include <unseen/vdtree/builder.h>

#include "bench_tools.h"
#include "peer_simplify.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

// Of the trees, each once: bytes a triangle, with and without what is kept with them of their folds.
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
        for (const vdtree::AttributeInfo& attribute : tree.attributes())
            attributes += static_cast<double>(attribute.count * attribute.element_bytes);
    }
    return {all / triangles, (all - attributes) / triangles};
}

// What is drawn beside measure_tradeoff()'s own ways: the same columns.
class Others {
public:
    Others(AccuracySubject& subject, const AccuracyBenchOptions& options, session::PictureJudge judge)
        : subject_(subject), options_(options), judge_(std::move(judge)) {}

    Result<AccuracyPoint> point(const std::string& name, const std::vector<vdtree::Cut>& cuts, double preparation_s,
                                double bytes, const std::string& note) {
        return point(name, judge_.renderer(), cuts, preparation_s, bytes, note);
    }

    // Cuts of another session, which that renderer draws.
    Result<AccuracyPoint> point(const std::string& name, session::SceneRenderer& renderer,
                                const std::vector<vdtree::Cut>& cuts, double preparation_s, double bytes,
                                const std::string& note) {
        render::DrawOptions drawing = judge_.drawing();
        const auto drawn = session::drawn_cuts(cuts);
        const auto frame = renderer.draw(drawn, subject_.view, drawing);
        if (!frame) return frame.error();
        const auto verdict = judge_.judge(*frame);
        if (!verdict) return verdict.error();
        drawing.samples = 1;
        std::vector<double> times;
        for (int i = 0; i < options_.repeats; ++i) {
            const auto one = renderer.draw(drawn, subject_.view, drawing);
            if (!one) return one.error();
            times.push_back(one->draw_ms);
        }
        double triangles = 0;
        for (const vdtree::Cut& cut : cuts) triangles += cut.triangle_count();
        const bool is_of_subject = &renderer == &judge_.renderer();
        const double shift_mm = is_of_subject ? 1e3 * session::largest_shift(subject_.session, cuts) : unknown;
        return AccuracyPoint{
            .name = name,
            .values = {median(std::move(times)), verdict->v, triangles, static_cast<double>(verdict->visible),
                       static_cast<double>(verdict->second_visible), 1 - verdict->ssim, shift_mm, preparation_s, bytes},
            .note = note};
    }

private:
    AccuracySubject& subject_;
    const AccuracyBenchOptions& options_;
    session::PictureJudge judge_;
};

// Discrete levels of each object, those of one tree made once.
class Levels {
public:
    static Result<Levels> create(AccuracySubject& subject) {
        Levels made(subject);
        const auto start = BenchClock::now();
        for (std::size_t i = 0; i < subject.session.scene().objects.size(); ++i) {
            const auto* const tree = &subject.session.tree(i).data();
            if (!made.chains_.contains(tree)) {
                auto chain =
                    session::level_chain(subject.session, subject.view, {.purpose = session::Purpose::picture}, i);
                if (!chain) return chain.error();
                for (int level = 0; level < chain->size(); ++level) {
                    const double triangles = chain->triangles(level);
                    constexpr double of_triangle = 12, of_vertex = 16; // bytes; half as many vertices
                    made.bytes_ += triangles * of_triangle + 0.5 * triangles * of_vertex;
                }
                made.full_ += chain->triangles(0);
                made.chains_.emplace(tree, std::move(*chain));
            }
            made.of_object_.push_back(&made.chains_.at(tree));
        }
        made.seconds_ = seconds_since(start);
        return made;
    }
    double seconds() const { return seconds_; }
    double bytes() const { return bytes_ / full_; } // a triangle of the full trees

    // Of each object the worst level that nobody sees from where the eye is, times the bias.
    std::vector<int> levels(double bias) const {
        std::vector<int> all;
        for (std::size_t i = 0; i < of_object_.size(); ++i) {
            const session::Object& object = subject_.session.scene().objects[i];
            const session::WorldSphere sphere = session::world_sphere(object);
            const double away = std::max(glm::distance(sphere.centre, subject_.view.eye) - sphere.radius, 0.0);
            int level = of_object_[i]->size() - 1;
            while (level > 0 && !(of_object_[i]->unseen_from(level) * bias <= away / object.placement.scale)) --level;
            all.push_back(level);
        }
        return all;
    }
    // The finest bias that leaves at most so many triangles, by bisection; the worst levels where none does.
    std::vector<int> levels_of(double triangles) const {
        double low = 1e-6, high = 1e6;
        for (int step = 0; step < 48; ++step) {
            const double middle = std::sqrt(low * high);
            double sum = 0;
            const std::vector<int> all = levels(middle);
            for (std::size_t i = 0; i < all.size(); ++i) sum += of_object_[i]->triangles(all[i]);
            (sum <= triangles ? low : high) = middle;
        }
        return levels(low);
    }
    std::vector<vdtree::Cut> cuts(const std::vector<int>& levels) const {
        std::vector<vdtree::Cut> all;
        for (std::size_t i = 0; i < levels.size(); ++i) all.push_back(of_object_[i]->cut(levels[i]));
        return all;
    }

private:
    explicit Levels(const AccuracySubject& subject) : subject_(subject) {}

    const AccuracySubject& subject_;
    std::map<const vdtree::VertexTree::Data*, session::LevelChain> chains_;
    std::vector<const session::LevelChain*> of_object_;
    double seconds_ = 0, bytes_ = 0, full_ = 0;
};

// The scene with meshoptimizer's meshes, each object with as many triangles as its cut has.
struct PeerScene {
    session::Session session;
    std::vector<vdtree::Cut> cuts;
    double seconds = 0, bytes = 0; // of meshoptimizer alone; a triangle of the full scene
};

Result<PeerScene> peer_scene(const AccuracySubject& subject, const std::vector<vdtree::Cut>& cuts) {
    const session::Session& full = subject.session;
    session::Scene scene;
    scene.background = full.scene().background;
    scene.lights = full.scene().lights;
    for (const session::Object& part : full.scene().backdrop) {
        session::Object& copy = scene.backdrop.emplace_back(session::Object{.tree = part.tree.share()});
        copy.placement = part.placement;
        copy.is_relit = part.is_relit;
    }
    double seconds = 0, bytes = 0;
    std::vector<bool> is_folded;
    for (std::size_t i = 0; i < cuts.size(); ++i) {
        const vdtree::VertexTree& tree = full.tree(i);
        const vdtree::Index wanted = cuts[i].triangle_count();
        const bool is_kept = wanted == 0 || wanted == tree.triangle_count();
        std::optional<vdtree::VertexTree> made;
        if (is_kept) {
            made = tree.share();
        } else {
            const vdtree::Mesh mesh = whole_mesh(tree);
            const auto start = BenchClock::now();
            const vdtree::Mesh simple = simplified_by_meshoptimizer(mesh, wanted);
            seconds += seconds_since(start);
            bytes += static_cast<double>(simple.triangles.size() * sizeof(vdtree::Triangle) +
                                         simple.positions.size() * 4 * sizeof(float));
            if (!simple.triangles.empty()) {
                vdtree::BuildOptions build;
                build.light = tree.light();
                build.prelit = tree.is_prelit();
                auto built = vdtree::build_tree(simple.view(), build);
                if (!built) return built.error();
                made = std::move(*built);
            } else {
                made = tree.share();
            }
        }
        is_folded.push_back(wanted == 0);
        session::Object& object = scene.objects.emplace_back(session::Object{.tree = std::move(*made)});
        object.placement = full.scene().objects[i].placement;
        object.is_relit = full.scene().objects[i].is_relit;
    }
    auto session = session::Session::create(std::move(scene), full.observer());
    if (!session) return session.error();
    PeerScene peer{std::move(*session), {}, seconds, bytes / static_cast<double>(full.triangle_count())};
    for (std::size_t i = 0; i < cuts.size(); ++i) {
        vdtree::Cut& cut = peer.cuts.emplace_back(peer.session.tree(i));
        if (!is_folded[i]) cut.unfold_all();
    }
    return peer;
}

// Masked cuts, levels, and meshoptimizer's, beside measure_tradeoff()'s own.
Result<void> add_others(AccuracySubject& subject, const AccuracyBenchOptions& options, int samples,
                        const TreeBytes& bytes, AccuracyPoints& points) {
    auto judge = session::PictureJudge::create(subject.context, subject.session, subject.view, samples);
    if (!judge) return judge.error();
    Others others(subject, options, std::move(*judge));
    const auto add = [&](Result<AccuracyPoint> point) -> Result<void> {
        if (!point) return point.error();
        points.push_back(std::move(*point));
        return {};
    };
    session::Request request{.purpose = session::Purpose::picture};
    const auto imperceptible = subject.session.simplify(subject.view, request);
    if (!imperceptible) return imperceptible.error();
    const double prepared_s = subject.build_s + subject.measure_s;
    const session::Scene& scene = subject.session.scene();
    if (scene.objects.size() > 1 || !scene.backdrop.empty()) {
        const auto masked = session::simplify_as_seen(subject.session, subject.context, subject.view, request,
                                                      {.folds_hidden = true, .masking = session::Masking::scene});
        if (!masked) return masked.error();
        if (auto ok = add(others.point("imperceptible, masked, by this picture", masked->cuts, prepared_s,
                                       bytes.measured, "this view alone"));
            !ok)
            return ok;
    }
    const auto levels = Levels::create(subject);
    if (!levels) return levels.error();
    const double count = imperceptible->stats.triangles;
    if (auto ok = add(others.point("discrete levels, where nobody sees them", levels->cuts(levels->levels(1)),
                                   prepared_s + levels->seconds(), levels->bytes(), "without following"));
        !ok)
        return ok;
    if (auto ok = add(others.point("discrete levels, as many triangles", levels->cuts(levels->levels_of(count)),
                                   prepared_s + levels->seconds(), levels->bytes(), "without following"));
        !ok)
        return ok;
    if (!has_meshoptimizer()) return {};
    const auto peer = peer_scene(subject, imperceptible->cuts);
    if (!peer) return peer.error();
    auto renderer = session::SceneRenderer::create(subject.context, peer->session);
    if (!renderer) return renderer.error();
    return add(others.point("meshoptimizer, as many triangles", *renderer, peer->cuts, peer->seconds, peer->bytes,
                            "one mesh for all views"));
}

} // namespace

Result<AccuracyPoints> fold_points(AccuracySubject& subject, const AccuracyBenchOptions& options) {
    session::TradeoffOptions tradeoff;
    tradeoff.seconds = options.seconds;
    tradeoff.samples = tradeoff.least_samples = options.samples; // what is seen must not depend on what else runs
    const auto measured = session::measure_tradeoff(subject.session, subject.context, subject.view, tradeoff);
    if (!measured) return measured.error();
    for (const std::string& name : measured->left_out) { // a name, or a name and why
        const bool is_for_time = name.find(": ") == std::string::npos;
        subject.left_out.push_back(is_for_time ? name + ": no time was left (--seconds)." : name);
    }
    const TreeBytes bytes = bytes_a_triangle(subject.session);
    AccuracyPoints points;
    for (const session::TradeoffPoint& p : measured->points) {
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
    if (auto added = add_others(subject, options, measured->samples, bytes, points); !added) return added.error();
    return points;
}

} // namespace unseen::app
