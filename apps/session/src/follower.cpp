#include <unseen/session/follower.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/number_format.h>
#include <unseen/vdtree/internal/stopwatch.h>

#include "session_state.h"
#include "shadow_outlines.h"

namespace unseen::session {
namespace {

constexpr double undefined = std::numeric_limits<double>::quiet_NaN();

// Cost is v*/v for the perceptual tests alone; the others count pixels.
double imperceptible_from(const Sight& sight, const Decision& decision, float largest_cost) {
    if (decision.request.goal.kind == Goal::Kind::full) return 0;
    if (!is_perceptual(decision)) return undefined;
    if (vdtree::is_unbounded(largest_cost)) return std::numeric_limits<double>::infinity();
    return sight.observer.display.distance.value() * static_cast<double>(largest_cost);
}

// The view through a window whose sides are so much farther from its centre.
vdtree::View widened(const vdtree::View& view) {
    constexpr double wider = 1.3, widest_degrees = 179;
    vdtree::View wide = view;
    if (view.orthographic_height) {
        *wide.orthographic_height *= wider;
        return wide;
    }
    const double half_tangent = std::tan(view.fov_y_degrees * (std::numbers::pi / 360));
    // The middle stays where it is: halves of a wider window are longer.
    wide.fov_y_degrees = std::max(view.fov_y_degrees,
                                  std::min(std::atan(wider * half_tangent) * (360 / std::numbers::pi), widest_degrees));
    wide.shift *= half_tangent / std::tan(wide.fov_y_degrees * (std::numbers::pi / 360));
    return wide;
}

void add(vdtree::AdjustStats& sum, const vdtree::AdjustStats& stats) {
    sum.node_tests += stats.node_tests;
    sum.folds += stats.folds;
    sum.unfolds += stats.unfolds;
    sum.triangles += stats.triangles;
    sum.max_fold_cost = std::max(sum.max_fold_cost, stats.max_fold_cost);
    sum.is_complete = sum.is_complete && stats.is_complete;
}

} // namespace

class Follower::State {
public:
    explicit State(std::shared_ptr<Session::State> session)
        : session_(std::move(session)), objects_(session_->scene.objects.size()) {}

    Result<Report> follow(const vdtree::View& view, const Request& request) {
        auto prepared = session_->prepare(view, request, shadows_);
        if (!prepared) return prepared.error();
        if (const auto taken = take_up_trees(); !taken) return taken.error();
        const bool folds = request.goal.kind != Goal::Kind::full;
        tell_of_locks(request.goal);
        tell_of_maps(*prepared);
        if (folds) {
            if (const auto made = make_recipes(*prepared); !made) return made.error();
        } else {
            for (Followed& object : objects_) object.stats_out_of_sight.reset();
        }
        Report report;
        const auto start = vdtree::Clock::now();
        const bool is_shared = prepared->shares_budget();
        auto stats = !folds ? unfold_all() : is_shared ? share_budget(request) : follow_each(request, *prepared);
        report.adapt_ms = vdtree::ms_since(start);
        if (!stats) return stats.error();
        if (const auto judged = judge_by_fold_test(*stats); !judged) return judged.error();
        conclude(report, *prepared, *stats);

        if (glide_s_) {
            const auto adapted = vdtree::Clock::now();
            if (const auto glided = glide(report); !glided) return glided.error();
            report.adapt_ms += vdtree::ms_since(adapted);
        }
        for (std::size_t i = 0; request.reasons && i < objects_.size(); ++i) {
            const Followed& object = objects_[i];
            report.effects.push_back(geomorph_effect(object.geomorph ? &*object.geomorph : nullptr, *object.cut));
            report.effects.back().object = i;
        }
        return report;
    }

    void expect_one_view() { shadows_.has_one_view = true; }

    // In every cut, whatever the goal.
    vdtree::Index locked_triangles() const {
        vdtree::Index sum = 0;
        for (const Object& object : session_->scene.objects) sum += object.tree.locked_triangles();
        return sum;
    }

    Result<void> set_glide(double seconds) {
        for (std::size_t i = 0; i < objects_.size(); ++i) {
            const vdtree::VertexTree& tree = session_->scene.objects[i].tree;
            if (!tree.texture().empty())
                return invalid_field("{Follower::set_glide()} does not move textures: leave it out, or add "
                                     "{load.without_textures}.");
            auto made = vdtree::Geomorph::create(tree, seconds);
            if (!made) return made.error();
            objects_[i].geomorph = std::move(*made);
        }
        glide_s_ = seconds;
        passed_s_ = 0;
        return {};
    }

    // One object's cut.
    struct Followed {
        std::uint64_t tree_count = 0; // of the tree that the cut is of
        std::optional<vdtree::Cut> cut;
        std::optional<vdtree::Geomorph> geomorph;
        std::optional<CutRecipe> recipe; // of the last cut, which refers to its criterion; none: out of sight
        // From the last call in which nothing of the object was in the window, and so all was folded.
        std::optional<vdtree::AdjustStats> stats_out_of_sight;
        FoldTest test_out_of_sight = FoldTest::error;
    };
    std::vector<Followed>& objects() { return objects_; }
    void let_pass(double seconds) { passed_s_ += seconds; }

private:
    // A cut is of one tree: where another has come in its place, it begins anew.
    Result<void> take_up_trees() {
        for (std::size_t i = 0; i < objects_.size(); ++i) {
            Followed& object = objects_[i];
            const vdtree::VertexTree& tree = session_->scene.objects[i].tree;
            if (object.cut && object.tree_count == session_->tree_count[i]) continue;
            object.cut.emplace(tree);
            object.stats_out_of_sight.reset();
            object.tree_count = session_->tree_count[i];
            if (!glide_s_) continue;
            auto made = vdtree::Geomorph::create(tree, *glide_s_);
            if (!made) return made.error();
            object.geomorph = std::move(*made);
        }
        return {};
    }

    Result<void> make_recipes(Prepared& prepared) {
        const bool is_shared = prepared.shares_budget();
        for (std::size_t i = 0; i < objects_.size(); ++i) {
            Followed& object = objects_[i];
            Sight& sight = prepared.sights[i];
            const Decision& decision = prepared.decisions[i];
            object.recipe.reset();
            if (!is_shared && stays_out_of_sight(object, sight, decision)) continue;
            auto recipe = make_recipe(sight, decision);
            if (!recipe) return recipe.error();
            // What comes into the window shall not glide there any more.
            if (glide_s_ && !recipe->viewpoint.frusta.empty()) {
                recipe->viewpoint.frusta.clear();
                for (const vdtree::View& eye : vdtree::eyes_of(sight.view))
                    recipe->viewpoint.frusta.push_back(
                        vdtree::frustum_of(sight.object.tree, widened(eye), sight.object.placement));
            }
            object.recipe = std::move(*recipe);
            object.stats_out_of_sight.reset();
        }
        return {};
    }

    // Nothing of the object is in the window, nor was it when its cut was made: all is folded, and stays so.
    bool stays_out_of_sight(const Followed& object, Sight& sight, const Decision& decision) const {
        return object.stats_out_of_sight && object.test_out_of_sight == decision.test && !glide_s_ &&
               is_out_of_sight(sight, decision);
    }

    Result<std::vector<vdtree::AdjustStats>> unfold_all() {
        std::vector<vdtree::AdjustStats> stats(objects_.size());
        for (std::size_t i = 0; i < objects_.size(); ++i) {
            vdtree::Cut& cut = *objects_[i].cut;
            if (cut.triangle_count() != cut.tree().triangle_count()) cut.unfold_all();
            stats[i].triangles = cut.triangle_count();
        }
        return stats;
    }

    Result<std::vector<vdtree::AdjustStats>> share_budget(const Request& request) {
        if (request.goal.fill || request.milliseconds)
            return unsupported(Message::of("Several objects share a budget without {request.goal.fill} and "
                                           "{request.milliseconds}: leave these out."));
        std::vector<vdtree::SceneObject> objects;
        for (Followed& object : objects_) {
            CutRecipe& recipe = *object.recipe;
            objects.push_back({*object.cut, *recipe.criterion, recipe.viewpoint, recipe.options.cull_back_faces});
        }
        return vdtree::follow_scene(objects, request.goal.triangles);
    }

    // Each has the time that the ones before have left.
    Result<std::vector<vdtree::AdjustStats>> follow_each(const Request& request, Prepared& prepared) {
        std::vector<vdtree::AdjustStats> stats;
        const auto start = vdtree::Clock::now();
        for (std::size_t i = 0; i < objects_.size(); ++i) {
            Followed& object = objects_[i];
            if (!object.recipe) {
                stats.push_back(*object.stats_out_of_sight);
                continue;
            }
            CutRecipe& recipe = *object.recipe;
            if (request.milliseconds && i > 0)
                recipe.options.milliseconds = std::max(0.0, *request.milliseconds - vdtree::ms_since(start));
            auto followed = object.cut->follow(*recipe.criterion, recipe.viewpoint, recipe.options);
            if (!followed) return followed.error();
            stats.push_back(*followed);
            Sight& sight = prepared.sights[i];
            const Decision& decision = prepared.decisions[i];
            if (followed->triangles > 0 || !followed->is_complete || !is_out_of_sight(sight, decision)) continue;
            object.stats_out_of_sight = *followed;
            object.stats_out_of_sight->node_tests = 0; // of the calls that are spared
            object.stats_out_of_sight->folds = object.stats_out_of_sight->unfolds = 0;
            object.test_out_of_sight = decision.test;
        }
        return stats;
    }

    // From how far nobody sees a difference, the fold test says, whatever else a criterion counts.
    Result<void> judge_by_fold_test(std::vector<vdtree::AdjustStats>& stats) const {
        for (std::size_t i = 0; i < objects_.size(); ++i) {
            const Followed& object = objects_[i];
            if (!object.recipe || !object.recipe->fold_test) continue;
            const vdtree::VertexTree& tree = object.cut->tree();
            const auto costs = vdtree::find_every_cost(tree, *object.recipe->fold_test, object.recipe->viewpoint,
                                                       object.recipe->options);
            if (!costs) return costs.error();
            float largest = 0;
            for (vdtree::NodeId node = 0; node < tree.interior_count(); ++node)
                if (object.cut->is_active(node)) largest = std::max(largest, (*costs)[node]);
            stats[i].max_fold_cost = largest;
        }
        return {};
    }

    void conclude(Report& report, Prepared& prepared, const std::vector<vdtree::AdjustStats>& stats) const {
        for (std::size_t i = 0; i < objects_.size(); ++i) {
            Sight& sight = prepared.sights[i];
            const Decision& decision = prepared.decisions[i];
            report.source_triangles += sight.object.tree.triangle_count();
            report.dropped += sight.object.tree.dropped_triangles();
            add(report.stats, stats[i]);
            report.fold_tests.push_back(decision.test);
            CutFacts facts;
            facts.imperceptible_from_m = imperceptible_from(sight, decision, stats[i].max_fold_cost);
            facts.is_complete = stats[i].is_complete;
            if (decision.request.reasons && folds_hidden(sight, decision))
                facts.occluders = inner_spheres(sight.object, sight.cache).size();
            if (decision.request.reasons && objects_[i].recipe) facts.outlines = count(shadow_of(sight).kept);
            if (decision.request.reasons)
                std::ranges::move(effects_of(sight, decision, facts), std::back_inserter(report.effects));
            const bool is_unknown = std::isnan(report.imperceptible_from_m) || std::isnan(facts.imperceptible_from_m);
            report.imperceptible_from_m =
                is_unknown ? undefined : std::max(report.imperceptible_from_m, facts.imperceptible_from_m);
        }
    }

    Result<void> glide(Report& report) {
        vdtree::Index drawn = 0;
        for (Followed& object : objects_) {
            if (auto stepped = object.geomorph->step(*object.cut, passed_s_); !stepped) return stepped;
            drawn += object.geomorph->drawn().triangle_count();
            report.gliding += object.geomorph->moved().size();
        }
        passed_s_ = 0;
        report.drawn_triangles = drawn;
        return {};
    }

    void tell_of_locks(const Goal& goal) {
        const vdtree::Index locked = locked_triangles();
        if (goal.kind != Goal::Kind::budget || goal.triangles >= locked || !session_->messages.warning) return;
        if (std::exchange(has_told_of_locks_, true)) return;
        session_->messages.warning(
            Message::of("{} triangles never fold, for {load.protect} says so: that is the least, "
                        "and more than the {} that are asked for.",
                        {grouped(locked), grouped(goal.triangles)}));
    }

    // That the tests of 2001 look at the vertices' light and the texture alone.
    void tell_of_maps(const Prepared& prepared) {
        if (has_told_of_maps_ || !session_->messages.warning) return;
        for (std::size_t i = 0; i < prepared.decisions.size(); ++i) {
            const Decision& decision = prepared.decisions[i];
            const vdtree::TextureView texture = prepared.sights[i].object.tree.texture();
            const bool has_maps = !texture.relief.empty() || !texture.emission.empty();
            if (!has_maps || !is_perceptual(decision) || decision.test == FoldTest::error) continue;
            has_told_of_maps_ = true;
            session_->messages.warning("the fold test " + name_of(decision.test) +
                                       " knows no normal maps and little of emission: what is said of visibility does "
                                       "not know them.");
            return;
        }
    }

    std::shared_ptr<Session::State> session_;
    bool has_told_of_locks_ = false, has_told_of_maps_ = false;
    std::vector<Followed> objects_;
    ShadowMemory shadows_;
    std::optional<double> glide_s_;
    double passed_s_ = 0; // since the last step of glides
};

Follower::Follower(const Session& session) : state_(std::make_unique<State>(session.state_)) {}

Result<void> Follower::set_glide(double seconds) { return state_->set_glide(seconds); }
void Follower::let_pass(double seconds) { state_->let_pass(seconds); }
Result<Report> Follower::follow(const vdtree::View& view, const Request& request) {
    return state_->follow(view, request);
}
const vdtree::Cut& Follower::cut(std::size_t object) const { return *state_->objects()[object].cut; }

const vdtree::Geomorph* Follower::geomorph(std::size_t object) const {
    const auto& geomorph = state_->objects()[object].geomorph;
    return geomorph ? &*geomorph : nullptr;
}

Result<Simplification> Session::simplify(const vdtree::View& view, const Request& request) {
    Request once = request;
    once.hysteresis = 1; // with no cut before, nothing is to keep still
    Follower follower(*this);
    follower.state_->expect_one_view();
    auto report = follower.follow(view, once);
    if (!report) return report.error();
    Simplification result{std::move(*report), {}};
    const auto followed = vdtree::Clock::now();
    for (Follower::State::Followed& object : follower.state_->objects()) {
        result.cuts.push_back(std::move(*object.cut));
        static_cast<void>(result.cuts.back().indices());
    }
    result.extract_ms = vdtree::ms_since(followed);
    return result;
}

} // namespace unseen::session
