// What a picture hides folds, and nobody sees it: by drawings of scenes whose parts lie behind others.
#include <unseen/session_gpu/as_seen.h>

#include <unseen/perception/judge.h>
#include <unseen/render/internal/frame.h>
#include <unseen/render/renderer.h>

#include "built.h"
#include "measured.h"
#include "shapes.h"
#include "testing.h"

namespace unseen::session::as_seen_test {

using vdtree::Mesh;
using vdtree::VertexTree;

// A wall before a bumpy ball, which it covers for the most part.
Mesh ball_behind_wall() {
    Mesh wall = shapes::placed(shapes::cube(24), 1.2, {-1.6, -0.6, 2});
    return shapes::together(shapes::bumpy_sphere(5, 0.01), wall);
}

perception::Image picture_of(const render::Context& context, const Session& session, const vdtree::Cut& cut,
                             const vdtree::View& view) {
    auto renderer = render::Renderer::create(context, session.tree());
    render::DrawOptions options;
    options.samples = 64;
    options.background = session.background();
    const auto frame = renderer->draw(cut, view, options);
    EXPECT_TRUE(frame);
    perception::Image image{frame->width, frame->height, 1, frame->luminance};
    for (float& value : image.values)
        value = static_cast<float>(
            perception::to_luminance(session.observer().display, static_cast<double>(value)).value());
    return image;
}

class AsSeen : public testing::Test {
protected:
    static Session session_of(const Mesh& mesh) {
        return *Session::create(Scene::of(support::measured(support::built(mesh))));
    }
    static vdtree::View view_of(const Session& session, glm::dvec3 direction) {
        vdtree::View window = session.default_view();
        window.fov_y_degrees *= 256.0 / window.height;
        window.width = window.height = 256;
        return session.frame(direction, 0.8, window);
    }

    render::Context context_ = *render::Context::headless();
};

TEST_F(AsSeen, FoldsWhatIsBehindAndShowsTheSame) {
    Session session = session_of(ball_behind_wall());
    for (const glm::dvec3 direction : {glm::dvec3(0, 0, 1), glm::dvec3(-0.3, 0.2, 1), glm::dvec3(1, 0.1, 0.3)}) {
        const vdtree::View view = view_of(session, direction);
        const Request request{.purpose = Purpose::picture};
        const auto usual = require(session.simplify(view, request));
        const auto as_seen = require(simplify_as_seen(session, context_, view, request));
        if (direction.x <= 0) {
            EXPECT_LT(as_seen->stats.triangles, 0.9 * usual->stats.triangles);
        } else {
            EXPECT_LE(as_seen->stats.triangles, usual->stats.triangles);
        }
        vdtree::Cut whole(session.tree());
        whole.unfold_all();
        const auto judged = require(perception::judge_modern(
            picture_of(context_, session, whole, view), picture_of(context_, session, as_seen->cuts[0], view), {}));
        EXPECT_EQ(judged->visible_pixels, 0u) << judged->max_ratio;
    }
}

// The sum over the picture of squared differences of luminance.
double squared_error(const perception::Image& a, const perception::Image& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.values.size(); ++i) sum += std::pow(a.values[i] - b.values[i], 2.0);
    return sum;
}

TEST_F(AsSeen, BudgetsMakeTheSumOfErrorsLeast) {
    Session session = session_of(ball_behind_wall());
    const vdtree::View view = view_of(session, {-0.3, 0.2, 1});
    vdtree::Cut whole(session.tree());
    whole.unfold_all();
    const perception::Image full = picture_of(context_, session, whole, view);
    for (const vdtree::Index budget : {2'000u, 800u, 300u}) {
        const auto simplified = [&](Order order) {
            return require(simplify_as_seen(
                session, context_, view, {.goal = Goal::budget(budget), .purpose = Purpose::picture, .order = order}));
        };
        const auto sum = simplified(Order::sum), largest = simplified(Order::largest);
        EXPECT_LE(sum->stats.triangles, budget);
        EXPECT_GE(sum->stats.triangles, 0.9 * budget);
        EXPECT_LT(squared_error(picture_of(context_, session, sum->cuts[0], view), full),
                  0.9 * squared_error(picture_of(context_, session, largest->cuts[0], view), full))
            << budget;
        EXPECT_TRUE(std::isfinite(sum->imperceptible_from_m));
        for (const auto* made : {&*sum, &*largest}) {
            const auto effect = std::ranges::find(made->effects, "sum of errors", &Effect::name);
            ASSERT_NE(effect, made->effects.end());
            EXPECT_EQ(effect->on, made == &*sum);
        }
    }
}

// A bumpy ball in another with an opening: what that hides counts for little, but does not fold for nothing, as somebody may
// look in.
TEST_F(AsSeen, BudgetsOfMeshesAddUpFromAllSides) {
    Mesh outer = shapes::placed(shapes::bumpy_sphere(5, 0.01), 2, glm::dvec3(0));
    std::erase_if(outer.triangles, [&](const vdtree::Triangle& t) { return outer.positions[t[0]].z > 1.9; });
    Session session = session_of(shapes::together(shapes::bumpy_sphere(5, 0.01), outer));
    vdtree::Cut whole(session.tree());
    whole.unfold_all();
    const vdtree::Index budget = session.tree().triangle_count() / 10;
    const vdtree::View view = view_of(session, {-0.3, 0.2, 1});
    const auto simplified = [&](Order order) {
        return require(
            simplify_from_all_sides(session, context_, view, {.goal = Goal::budget(budget), .order = order}));
    };
    const auto sum = simplified(Order::sum), largest = simplified(Order::largest);
    EXPECT_LE(sum->stats.triangles, budget);
    const auto effect_of = [](const Simplification& made, const char* name) {
        return std::ranges::find(made.effects, name, &Effect::name)->on;
    };
    EXPECT_TRUE(effect_of(*sum, "sum of errors"));
    EXPECT_FALSE(effect_of(*largest, "sum of errors"));
    EXPECT_FALSE(effect_of(*sum, "hidden folding"));
    double of_sum = 0, of_largest = 0;
    for (const glm::dvec3 direction : {glm::dvec3(0.2, 0.1, 1), {1, 0.4, -0.5}, {-0.7, 1.1, -0.4}, {0.3, -1, 0.2}}) {
        const vdtree::View seen = view_of(session, direction);
        const perception::Image full = picture_of(context_, session, whole, seen);
        of_sum += squared_error(picture_of(context_, session, sum->cuts[0], seen), full);
        of_largest += squared_error(picture_of(context_, session, largest->cuts[0], seen), full);
    }
    EXPECT_LT(of_sum, 0.9 * of_largest);
    // The inner ball is there.
    const Mesh kept = sum->mesh();
    const auto of_ball =
        std::ranges::count_if(kept.positions, [](const glm::dvec3& p) { return glm::length(p) < 1.1; });
    EXPECT_GT(of_ball, 20);
    // From inside, pictures of the outside tell nothing.
    vdtree::View inside = view;
    inside.eye = {0, 0, 1.1}, inside.target = {0, 0, 0};
    EXPECT_FALSE(effect_of(*require(simplify_from_all_sides(session, context_, inside, {.goal = Goal::budget(budget)})),
                           "sum of errors"));
}

TEST_F(AsSeen, QualitiesGoByTheSum) {
    Session session = session_of(ball_behind_wall());
    const vdtree::View view = view_of(session, {-0.3, 0.2, 1});
    std::uint64_t before = session.triangle_count();
    for (const QualityFacts& facts : qualities()) {
        const auto made = require(simplify_as_seen(
            session, context_, view, {.goal = Goal::quality(facts.quality), .purpose = Purpose::picture}));
        EXPECT_LT(made->stats.triangles, before) << facts.name;
        before = made->stats.triangles;
        const auto effect = std::ranges::find(made->effects, "sum of errors", &Effect::name);
        ASSERT_NE(effect, made->effects.end());
        EXPECT_EQ(effect->on, facts.quality != Quality::invisible);
    }
}

TEST_F(AsSeen, DepthsAreThoseOfTheFarthestSample) {
    const VertexTree tree = support::built(shapes::icosphere(5));
    vdtree::View view;
    view.eye = {0, 0, 5};
    view.fov_y_degrees = 30;
    view.width = view.height = 64;
    vdtree::Cut whole(tree);
    whole.unfold_all();
    render::GpuCut cut(*render::GpuTree::create(context_, tree));
    ASSERT_TRUE(cut.follow(whole));
    const render::Item item{cut, {}};
    const auto depth = require(render::farthest_depth(context_, {&item, 1}, view));
    const double focal = 32 / std::tan(view.fov_y_degrees * std::acos(-1.0) / 360);
    int on_ball = 0;
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 64; ++x) {
            const double found = static_cast<double>((*depth)[static_cast<std::size_t>(y * 64 + x)]);
            // Between the depths at the pixel's nearest and farthest corner from the middle.
            const auto depth_at = [&](double px, double py) {
                const double tx = (px - 32) / focal, ty = (py - 32) / focal, t2 = 1 + tx * tx + ty * ty;
                const double root = 25 - 24 * t2;
                return root >= 0 ? (5 - std::sqrt(root)) / t2 : std::numeric_limits<double>::infinity();
            };
            const double far_x = x < 32 ? x : x + 1, far_y = y < 32 ? y : y + 1;
            const double near_x = x < 32 ? x + 1 : x, near_y = y < 32 ? y + 1 : y;
            constexpr double facets = 2e-3; // of the ball, which lie inside of it
            const double farthest = depth_at(far_x, far_y), nearest = depth_at(near_x, near_y);
            if (std::isinf(nearest)) {
                EXPECT_TRUE(std::isinf(found));
            } else if (std::isfinite(farthest)) {
                ++on_ball;
                EXPECT_GE(found, nearest - facets) << x << " " << y;
                EXPECT_LE(found, farthest + facets + 0.01 * (farthest - nearest)) << x << " " << y;
            }
        }
    EXPECT_GT(on_ball, 1000);
    EXPECT_FALSE(render::farthest_depth(context_, {&item, 1}, view, 0));
}

TEST_F(AsSeen, PicturesAreOfTheirOwnViewAlone) {
    Session session = session_of(shapes::bumpy_sphere(3, 0.02));
    vdtree::View view = view_of(session, {0, 0, 1});
    const std::vector<float> depth(static_cast<std::size_t>(view.width * view.height), 1e9f);
    Request request{.purpose = Purpose::picture};
    request.shown = {*vdtree::DepthPicture::create(view, depth)};
    EXPECT_TRUE(session.simplify(view, request));
    view.eye.x += 1e-3;
    EXPECT_THAT(error_in(session.simplify(view, request)), HasSubstr("request.shown is of another view"));
    request.shown.push_back(request.shown[0]);
    EXPECT_THAT(error_in(session.simplify(view, request)), HasSubstr("request.shown is of several views"));
    request.purpose = Purpose::mesh; // looked at from all of them
    EXPECT_TRUE(session.simplify(view, request));
}

} // namespace unseen::session::as_seen_test
