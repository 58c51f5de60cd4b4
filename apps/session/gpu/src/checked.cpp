// The cost at which pictures just show nothing, sought in some views and verified in others.
#include <unseen/session_gpu/checked.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <glm/geometric.hpp>

#include <unseen/session_gpu/picture_judge.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/number_format.h>
#include <unseen/vdtree/internal/stopwatch.h>

#include "shown_depths.h"

namespace unseen::session {
namespace {

constexpr double largest_cell = 10, ring_degrees = 5; // views stand on rings so far apart, eight more on each
constexpr int most_check_samples = 256;
// Pictures of fewer samples differ more: a cut that passes in them is not looked at in finer ones, nor is one that shows so
// many times what may show.
constexpr int coarse_samples = 16;
constexpr double hopeless = 3;
constexpr int depth_samples = 16;
// The first views may show this share of what is allowed. The rest is a margin: other views show up to a tenth more.
constexpr double aimed_share = 0.9;
// Cuts are sought until the cost is known within this factor, which is one or two per cent of the triangles.
constexpr double cost_step = 1.08;
constexpr double least_cost = 0.05, most_cost = 1e4;
constexpr int most_cuts = 12;
constexpr int verifying_views = 8, shifted_views = 3; // in a cell, and of one view
constexpr int most_rounds = 6;

// The eye gone so far around the target, `way` degrees from the right counterclockwise.
vdtree::View gone(const vdtree::View& view, double degrees, double way_degrees) {
    const vdtree::CameraFrame camera = vdtree::camera_frame(view);
    const double angle = degrees * std::numbers::pi / 180, way = way_degrees * std::numbers::pi / 180;
    const double distance = glm::length(view.eye - view.target);
    const glm::dvec3 aside = std::cos(way) * camera.right + std::sin(way) * camera.up;
    vdtree::View there = view;
    there.eye = view.target + distance * (std::cos(angle) * camera.back + std::sin(angle) * aside);
    there.up = camera.up;
    return there;
}

std::vector<vdtree::View> views_to_fit(const vdtree::View& view, double cell_degrees) {
    std::vector<vdtree::View> views = {view};
    const int rings = static_cast<int>(std::ceil(cell_degrees / ring_degrees));
    for (int ring = 1; ring <= rings; ++ring)
        for (int i = 0; i < 8 * ring; ++i)
            views.push_back(gone(view, cell_degrees * ring / rings, 360.0 * i / (8 * ring)));
    return views;
}

Result<void> check(const Request& request, const vdtree::View& view, const CheckOptions& options) {
    if (request.goal.kind != Goal::Kind::quality)
        return invalid_field("{check} finds the number of triangles itself: ask for a quality, or for none.");
    if (!(options.cell_degrees >= 0 && options.cell_degrees <= largest_cell))
        return invalid_field("{check.cell_degrees} must be 0 to 10.");
    if (!(options.seconds > 0)) return invalid_field("{check.seconds} must be above 0.");
    if (options.samples < 1 || options.samples > most_check_samples)
        return invalid_field("{check.samples} must be 1 to 256.");
    return vdtree::validate_perspective(view, "A check by pictures");
}

class Checker {
public:
    Checker(Session& session, const render::Context& context, const vdtree::View& view, Request request,
            const CheckOptions& options)
        : session_(session), context_(context), view_(view), request_(std::move(request)), options_(options),
          most_v_(request_.goal.cost) {
        request_.purpose = options.cell_degrees > 0 ? Purpose::mesh : Purpose::picture;
        request_.shown.clear();
        facts_.most_v = most_v_, facts_.cell_degrees = options.cell_degrees;
    }

    Result<Simplification> run() {
        if (auto ready = look_around(); !ready) return ready.error();
        if (auto found = seek(); !found) return found.error();
        if (auto held = verify(); !held) return held.error();
        if (!best_) {
            request_.goal = Goal::full();
            request_.shown.clear();
            auto full = session_.simplify(view_, request_);
            if (!full) return full;
            best_ = std::move(*full);
            facts_.cost = 0;
        }
        facts_.fitted_views = static_cast<int>(fitted_.size());
        facts_.seconds = vdtree::ms_since(start_) / 1000;
        best_->check = facts_;
        return std::move(*best_);
    }

private:
    struct Tried {
        double cost = 0, share = 0; // of what is allowed
    };
    struct Place {
        vdtree::View view;
        std::optional<PictureJudge> quick = {}, fine = {}; // made when first asked
        double share = 0;                                  // of the last cut that was looked at from here
    };

    bool is_over() const { return is_stopped_ || vdtree::ms_since(start_) > 1000 * options_.seconds; }

    Result<void> tell(double share, const char* stage) {
        if (options_.progress && !options_.progress(share, stage)) is_stopped_ = true;
        if (is_stopped_ && !best_) return Error{ErrorCode::cancelled, "Checking by pictures was stopped."};
        return {};
    }

    // What the views show, and the judges there.
    Result<void> look_around() {
        const std::vector<vdtree::View> views = views_to_fit(view_, options_.cell_degrees);
        if (const auto outside = stay_outside(views); !outside) return outside;
        Request first = request_;
        first.goal = Goal::imperceptible();
        const auto fine = session_.simplify(view_, first); // measures where that is called for
        if (!fine) return fine.error();
        auto renderer = SceneRenderer::create(context_, session_);
        if (!renderer) return renderer.error();
        renderer_ = std::make_shared<SceneRenderer>(std::move(*renderer));
        const bool tells = !why_pictures_tell_nothing(session_, request_, *fine);
        for (const vdtree::View& view : views) {
            if (auto told =
                    tell(0.3 * static_cast<double>(fitted_.size()) / static_cast<double>(views.size()), "views");
                !told)
                return told;
            fitted_.push_back({view});
            if (!tells) continue;
            const auto scene = renderer_->items(drawn_cuts(fine->cuts), view);
            if (!scene) return scene.error();
            auto shown = draw_depths(context_, *scene, view, depth_samples);
            if (!shown) return shown.error();
            request_.shown.push_back(std::move(*shown));
        }
        return {};
    }

    Result<Simplification> made_up_to(double cost) {
        request_.goal = {.cost = cost, .summed_cost = cost};
        return session_.simplify(view_, request_);
    }

    // No view may pass through a surface that the first one looks at from outside.
    Result<void> stay_outside(std::span<const vdtree::View> views) const {
        for (const Object& object : session_.scene().objects) {
            const WorldSphere sphere = world_sphere(object);
            const auto is_inside = [&](const vdtree::View& view) {
                if (glm::length(view.eye - sphere.centre) > sphere.radius) return false;
                const glm::dvec3 eye = vdtree::eye_in_tree(object.tree, view, object.placement);
                return vdtree::winding_number(object.tree, eye) > 0.5;
            };
            if (object.tree.closedness() == vdtree::Closedness::open || is_inside(views[0])) continue;
            if (std::ranges::none_of(views, is_inside)) continue;
            const auto number = static_cast<std::uint64_t>(&object - session_.scene().objects.data());
            return invalid_field(
                "{check.cell_degrees = }{} takes the eye into the solid of object {}: move it away, or "
                "make the cell smaller.",
                {rounded(options_.cell_degrees, 3), std::to_string(number)});
        }
        return {};
    }

    // The larger difference, as a share of what is allowed: in fine pictures where coarse ones show more than `enough`.
    Result<double> look(Place& place, std::span<const vdtree::Cut> cuts, double enough) {
        const int quick = std::min(options_.samples, coarse_samples);
        auto share = look(place.quick, place.view, quick, cuts);
        if (share && *share > enough && *share < hopeless * enough && quick < options_.samples)
            share = look(place.fine, place.view, options_.samples, cuts);
        if (share) place.share = *share;
        return share;
    }

    Result<double> look(std::optional<PictureJudge>& judge, const vdtree::View& view, int samples,
                        std::span<const vdtree::Cut> cuts) {
        if (!judge) {
            auto made = PictureJudge::create(renderer_, session_, view, samples);
            if (!made) return made.error();
            judge = std::move(*made);
        }
        const auto verdict = judge->judge(cuts);
        if (!verdict) return verdict.error();
        ++facts_.looks;
        last_ = *verdict;
        return std::max(verdict->v, verdict->second_v) / most_v_;
    }

    // The largest share of all views, or that of the first one that is too large; views that showed most before come first.
    Result<double> look_from_all(std::span<const vdtree::Cut> cuts) {
        std::ranges::sort(fitted_, std::greater(), &Place::share);
        double most = 0;
        for (Place& place : fitted_) {
            const auto share = look(place, cuts, aimed_share);
            if (!share) return share;
            most = std::max(most, *share);
            if (most > aimed_share) break;
        }
        return most;
    }

    // The largest cost that passes in the first views.
    Result<void> seek() {
        Tried low, high;       // the largest cost that passed, and the least that did not
        double cost = most_v_; // by the model it passes
        int in_a_row = 0;      // that passed; below 0: that did not
        for (int i = 0; i < most_cuts && (i == 0 || !is_over()); ++i) {
            if (auto told = tell(0.3 + 0.4 * i / most_cuts, "cuts"); !told) return told;
            auto cut = made_up_to(cost);
            if (!cut) return cut.error();
            const auto share = look_from_all(cut->cuts);
            if (!share) return share.error();
            const bool passes = *share <= aimed_share;
            (passes ? low : high) = {cost, *share};
            in_a_row = passes ? std::max(in_a_row, 0) + 1 : std::min(in_a_row, 0) - 1;
            if (passes) best_ = std::move(*cut), facts_.cost = cost;
            const bool is_between = low.cost > 0 && high.cost > 0;
            if ((is_between && high.cost <= cost_step * low.cost) || cost <= least_cost || cost >= most_cost) return {};
            // Where differences are far from a power, one side would move in small steps.
            const bool halves = is_between && std::abs(in_a_row) > 1;
            cost = std::clamp(halves ? std::sqrt(low.cost * high.cost) : next_cost(low, high), least_cost, most_cost);
        }
        facts_.is_settled = false;
        return {};
    }

    // Differences grow about as a power of the cost does; while one side is missing, as the cost itself.
    static double next_cost(const Tried& low, const Tried& high) {
        constexpr double aim = 0.97 * aimed_share, next_to_nothing = 1e-3;
        if (!(high.cost > 0)) return low.cost * std::clamp(aim / std::max(low.share, next_to_nothing), 1.5, 5.0);
        if (!(low.cost > 0)) return high.cost * std::clamp(aim / high.share, 0.2, 0.7);
        const double at_low = std::max(low.share, next_to_nothing);
        const double part = std::log(aim / at_low) / std::log(high.share / at_low);
        return low.cost * std::pow(high.cost / low.cost, std::clamp(part, 0.2, 0.8));
    }

    // In views that had no part in it; where one fails, with a lower cost in others.
    Result<void> verify() {
        while (best_ && facts_.rounds <= most_rounds) {
            double most = 0;
            facts_.v = facts_.second_v = 0, facts_.verified_views = 0;
            const int count = options_.cell_degrees > 0 ? verifying_views : shifted_views;
            const std::uint64_t seed = options_.seed * 1'000'003 + static_cast<std::uint64_t>(facts_.rounds);
            const auto views = views_in_cell(view_, options_.cell_degrees, count, seed);
            for (const vdtree::View& view : views) {
                const double share = facts_.verified_views / static_cast<double>(views.size());
                if (auto told = tell(0.7 + 0.3 * share, "other views"); !told) return told;
                if (is_stopped_) {
                    facts_.is_settled = false, facts_.verified_views = 0;
                    return {};
                }
                Place place{view};
                const auto looked = look(place, best_->cuts, 1);
                if (!looked) return looked.error();
                facts_.v = std::max(facts_.v, last_.v), facts_.second_v = std::max(facts_.second_v, last_.second_v);
                most = std::max(most, *looked);
                ++facts_.verified_views;
                if (most >= 1) break;
            }
            if (most < 1) return {};
            ++facts_.rounds;
            auto lower = made_up_to(facts_.cost *= std::clamp(aimed_share / most, 0.5, 0.9));
            if (!lower) return lower.error();
            best_ = std::move(*lower);
        }
        best_.reset();
        facts_.v = facts_.second_v = 0, facts_.verified_views = 0;
        return {};
    }

    Session& session_;
    const render::Context& context_;
    const vdtree::View& view_;
    Request request_;
    const CheckOptions& options_;
    double most_v_;
    vdtree::Clock::time_point start_ = vdtree::Clock::now();
    std::shared_ptr<SceneRenderer> renderer_;
    std::vector<Place> fitted_;
    std::optional<Simplification> best_; // that has passed so far
    PictureVerdict last_;
    CheckFacts facts_;
    bool is_stopped_ = false;
};

} // namespace

std::vector<vdtree::View> views_in_cell(const vdtree::View& view, double cell_degrees, int count, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    // What the standard's distributions make of the bits is up to the library.
    const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
    std::vector<vdtree::View> views;
    for (int i = 0; i < count; ++i) {
        const double degrees = cell_degrees * std::sqrt(uniform()), way = 360 * uniform();
        vdtree::View there = cell_degrees > 0 ? gone(view, degrees, way) : view;
        const double right = uniform() - 0.5, up = uniform() - 0.5; // pixels
        there.shift += 2.0 * glm::dvec2(right, up) / glm::dvec2(view.width, view.height);
        views.push_back(there);
    }
    return views;
}

Result<Simplification> simplify_checked(Session& session, const render::Context& context, const vdtree::View& view,
                                        Request request, const CheckOptions& options) {
    if (auto valid = check(request, view, options); !valid) return valid.error();
    return Checker(session, context, view, std::move(request), options).run();
}

} // namespace unseen::session
