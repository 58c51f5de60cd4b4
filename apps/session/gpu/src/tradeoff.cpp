#include <unseen/session_gpu/tradeoff.h>

#include <algorithm>

#include <unseen/session_gpu/as_seen.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/number_format.h>
#include <unseen/vdtree/internal/stopwatch.h>

namespace unseen::session {
namespace {

constexpr int timed_frames = 9;         // followed, and drawn
constexpr double degrees_a_frame = 0.1; // around the scene's centre

// The median, and the middle half around it.
Timing timing(std::vector<double> ms) {
    std::ranges::sort(ms);
    return {ms[ms.size() / 2], ms[ms.size() / 4], ms[ms.size() - 1 - ms.size() / 4]};
}

// Points that are not measured yet, the most telling ones first.
std::vector<TradeoffPoint> usual_points(const Session& session) {
    std::vector<TradeoffPoint> all;
    const auto add = [&](std::string name, Goal goal, std::optional<FoldTest> test = {}) {
        all.push_back(
            {{}, std::move(name), {.goal = goal, .fold_test = test, .purpose = Purpose::picture, .reasons = false}});
    };
    const Goal imperceptible = Goal::imperceptible();
    add("full", Goal::full());
    add("imperceptible", imperceptible);
    for (const double cost : {2.0, 0.5}) add("imperceptible, threshold " + shortest(cost), Goal::up_to(cost));
    all.push_back({{}, "imperceptible, by this picture", all[1].request, true});
    for (const QualityFacts& facts : qualities().subspan(1)) {
        const Request request = {.goal = Goal::quality(facts.quality), .purpose = Purpose::picture, .reasons = false};
        all.push_back({{}, std::string(facts.name) + ", by this picture", request, true});
    }
    add("luebke-hallen-safe", imperceptible, FoldTest::luebke_hallen_safe);
    for (const double pixels : {1.0, 0.5, 2.0}) add(shortest(pixels) + " px, extent", Goal::pixels(pixels));
    add("luebke-hallen", imperceptible, FoldTest::luebke_hallen);
    for (const double pixels : {0.25, 0.5, 1.0})
        add(shortest(pixels) + " px, displacement", Goal::pixels(pixels), FoldTest::displacement);
    for (const double share : {0.5, 0.25, 0.1, 0.05}) {
        const double triangles = std::clamp(share * static_cast<double>(session.triangle_count()), 1.0, 4e9);
        add("budget of " + shortest(100 * share) + "%", Goal::budget(static_cast<vdtree::Index>(triangles)));
    }
    for (const double pixels : {4.0, 8.0}) add(shortest(pixels) + " px, extent", Goal::pixels(pixels));
    return all;
}

class Measurement {
public:
    static Result<Measurement> create(Session& session, const render::Context& context, const vdtree::View& view,
                                      const TradeoffOptions& options) {
        auto renderer = SceneRenderer::create(context, session);
        if (!renderer) return renderer.error();
        return Measurement(session, context, view, options, std::make_shared<SceneRenderer>(std::move(*renderer)));
    }

    // As many as keep this number of pictures to half of the time. Then judges are ready.
    Result<int> choose_samples(std::size_t pictures) {
        const auto whole = session_.simplify(view_, {.goal = Goal::full(), .purpose = Purpose::picture});
        if (!whole) return whole.error();
        constexpr int tried = 4;
        double sample_ms = 0; // of the second picture: the first one compiles and uploads
        for (int i = 0; i < 2; ++i) {
            const auto frame = draw(whole->cuts, tried);
            if (!frame) return frame.error();
            sample_ms = frame->draw_ms / tried;
        }
        const double allowed_ms = 1e3 * options_.seconds / 2 / static_cast<double>(pictures);
        const int samples = std::clamp(static_cast<int>(allowed_ms / std::max(sample_ms, 1e-3)), options_.least_samples,
                                       options_.samples);
        auto judge = PictureJudge::create(renderer_, session_, view_, samples);
        if (!judge) return judge.error();
        judge_ = std::move(*judge);
        return samples;
    }

    Result<TradeoffPoint> measure(TradeoffPoint point) {
        const auto start = vdtree::Clock::now();
        auto made = point.is_of_view ? simplify_as_seen(session_, context_, view_, point.request)
                                     : session_.simplify(view_, point.request);
        if (!made) return made.error();
        point.make_ms = vdtree::ms_since(start);
        point.triangles = made->stats.triangles;
        point.shift = largest_shift(session_, made->cuts);
        const auto verdict = judge_->judge(made->cuts);
        if (!verdict) return verdict.error();
        static_cast<PictureVerdict&>(point) = *verdict;
        std::vector<double> drawn;
        for (int i = 0; i < timed_frames; ++i) {
            const auto one = draw(made->cuts, 1);
            if (!one) return one.error();
            drawn.push_back(one->draw_ms);
        }
        point.draw_ms = timing(std::move(drawn));
        if (point.is_of_view) return point;
        const auto followed = follow(point.request);
        if (!followed) return followed.error();
        point.follow_ms = *followed;
        return point;
    }

private:
    Measurement(Session& session, const render::Context& context, const vdtree::View& view,
                const TradeoffOptions& options, std::shared_ptr<SceneRenderer> renderer)
        : session_(session), context_(context), view_(view), options_(options), renderer_(std::move(renderer)) {}

    Result<render::Frame> draw(const std::vector<vdtree::Cut>& cuts, int samples) {
        return renderer_->draw(drawn_cuts(cuts), view_, {.samples = samples, .background = session_.background()});
    }

    Result<Timing> follow(const Request& request) {
        Follower follower(session_);
        std::vector<double> times;
        for (int i = 0; i <= timed_frames + 1; ++i) {
            const auto start = vdtree::Clock::now();
            const auto followed = follower.follow(vdtree::orbited(view_, degrees_a_frame * i), request);
            if (!followed) return followed.error();
            if (i > 1) times.push_back(vdtree::ms_since(start)); // the first makes the cut, the second what to watch
        }
        return timing(std::move(times));
    }

    Session& session_;
    const render::Context& context_;
    const vdtree::View& view_;
    const TradeoffOptions& options_;
    std::shared_ptr<SceneRenderer> renderer_;
    std::optional<PictureJudge> judge_ = {}; // against the full model
};

void find_front(std::vector<TradeoffPoint>& points) {
    for (TradeoffPoint& point : points)
        point.is_on_front = std::ranges::none_of(points, [&](const TradeoffPoint& other) {
            const bool is_no_worse = other.triangles <= point.triangles && other.v <= point.v;
            return is_no_worse && (other.triangles < point.triangles || other.v < point.v);
        });
}

void recommend(std::vector<TradeoffPoint>& points) {
    TradeoffPoint* best = &points.front();
    for (TradeoffPoint& point : points) {
        const bool shows_nothing = point.visible_pixels == 0 && point.second_visible_pixels == 0;
        // A claim about all views like this one, not the luck of one.
        const FoldTest test = point.request.fold_test.value_or(FoldTest::error);
        const bool is_a_claim = is_perceptual(test) && facts_of(test).is_safe &&
                                point.request.goal.kind == Goal::Kind::quality && point.request.goal.cost <= 1;
        if (!point.is_of_view && shows_nothing && is_a_claim && point.triangles < best->triangles) best = &point;
    }
    best->is_recommended = true;
}

} // namespace

double largest_shift(const Session& session, std::span<const vdtree::Cut> cuts) {
    double most = 0;
    for (std::size_t i = 0; i < cuts.size(); ++i) {
        const auto displacement = cuts[i].tree().displacement();
        float in_mesh = 0;
        for (vdtree::NodeId node = 0; node < cuts[i].tree().interior_count(); ++node)
            if (cuts[i].is_active(node)) in_mesh = std::max(in_mesh, displacement[node]);
        most = std::max(most, session.scene().objects[i].placement.scale * static_cast<double>(in_mesh));
    }
    return most;
}

Result<Tradeoff> measure_tradeoff(Session& session, const render::Context& context, const vdtree::View& view,
                                  const TradeoffOptions& options) {
    constexpr int most_samples = 256;
    if (!(options.seconds > 0)) return invalid_argument("The seconds of a trade-off must be above 0.");
    if (options.samples < 1 || options.samples > most_samples)
        return invalid_argument("The samples of a trade-off must be 1 to 256.");
    if (options.least_samples < 1) return invalid_argument("The least samples of a trade-off must be 1 or more.");
    const auto start = vdtree::Clock::now();
    const auto prepared = session.prepare(view, {.purpose = Purpose::picture});
    if (!prepared) return prepared.error();
    Tradeoff result;
    result.measuring_s = vdtree::ms_since(start) / 1e3;
    auto measurement = Measurement::create(session, context, view, options);
    if (!measurement) return measurement.error();
    const auto begin = vdtree::Clock::now();
    std::vector<TradeoffPoint> all = usual_points(session);
    if (!options.requests.empty()) all.resize(1);
    for (const auto& [name, request] : options.requests) all.push_back({{}, name, request});
    const auto samples = measurement->choose_samples(all.size());
    if (!samples) return samples.error();
    result.samples = *samples;
    for (std::size_t i = 0; i < all.size(); ++i) {
        if (options.progress && !options.progress(static_cast<double>(i) / static_cast<double>(all.size()), "ways"))
            return Error{ErrorCode::cancelled, "Measuring what accuracy costs was stopped."};
        if (!result.points.empty() && vdtree::ms_since(begin) > 1e3 * options.seconds) {
            result.left_out.push_back(all[i].name);
            continue;
        }
        auto point = measurement->measure(all[i]);
        if (point) result.points.push_back(std::move(*point));
        else if (all[i].request.fold_test && point.error().code == ErrorCode::invalid_argument)
            result.left_out.push_back(all[i].name + ": " + point.error().message);
        else return point.error();
    }
    find_front(result.points);
    recommend(result.points);
    return result;
}

} // namespace unseen::session
