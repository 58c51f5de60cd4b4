// What a picture hides folds, and nobody sees it: by drawings of scenes whose parts lie behind others.
#include <unseen/session_gpu/as_seen.h>

#include <unseen/calibration/light_rig.h>
#include <unseen/perception/judge.h>
#include <unseen/render/internal/frame.h>
#include <unseen/render/renderer.h>
#include <unseen/session/load.h>
#include <unseen/session_gpu/scene_renderer.h>

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

// Upright dark bars before what stands in the middle, across the view, so many a unit of length, half of it open.
VertexTree bars(double bars_per_unit, bool is_prelit) {
    Mesh mesh;
    for (double x = -1.6; x < 1.6; x += 1 / bars_per_unit)
        mesh = shapes::together(mesh, shapes::placed(shapes::cube(1), 1 / (4 * bars_per_unit), {x, 0, 1.5}));
    for (glm::dvec3& p : mesh.positions) p.y = p.y > 0 ? 1.6 : -1.6;
    mesh.colours.assign(mesh.positions.size(), {0.02F, 0.02F, 0.02F, 1});
    return support::built(mesh, {.prelit = is_prelit});
}

constexpr int side = 256;

vdtree::View from_afar() {
    vdtree::View view;
    view.eye = {0, 0, 18};
    view.width = view.height = side;
    view.fov_y_degrees = perception::physical_field({}, side).value();
    return view;
}

TEST_F(AsSeen, WhatIsBehindBarsOfTheBackdropFolds) {
    Mesh ball = shapes::icosphere(6); // rough, so that it keeps many triangles
    std::mt19937_64 random(11);
    for (glm::dvec3& p : ball.positions) p *= shapes::random_between(random, 0.998, 1.002);
    Scene scene = Scene::of(support::measured(support::built(ball), 0));
    scene.backdrop.push_back({bars(1, true)});
    Session session = *Session::create(std::move(scene));
    const auto made = [&](bool folds_hidden) {
        return require(simplify_as_seen(session, context_, from_afar(), {}, {.folds_hidden = folds_hidden}));
    };
    const auto hidden = made(true);
    EXPECT_LT(hidden->stats.triangles, 0.8 * made(false)->stats.triangles);
    auto renderer = require(SceneRenderer::create(context_, session));
    const auto picture = [&](const vdtree::Cut& cut) {
        const DrawnCut drawn[] = {{&cut}};
        return luminance_image(
            *require(renderer->draw(drawn, from_afar(), {.samples = 16, .background = session.background()})), {});
    };
    vdtree::Cut whole(session.tree());
    whole.unfold_all();
    const auto judged = require(perception::judge_modern(picture(whole), picture(hidden->cuts[0]), {}));
    EXPECT_EQ(judged->visible_pixels, 0u) << judged->max_ratio;
}

class PassesTest : public AsSeen {
protected:
    // Two balls, one far behind the other, behind bars; lit by a sun, which casts shadows or none, if wanted.
    static Session session_of(std::optional<bool> casts) {
        static const VertexTree ball =
            *measured_under_lights(support::measured(support::built(shapes::bumpy_sphere(4, 0.01)))); // once for all
        Scene scene = Scene::of(ball.share());
        scene.objects.push_back({ball.share(), {.translation = {1, 0, -60}}, "far"});
        scene.backdrop.push_back({bars(12, !casts.has_value())});
        if (casts) {
            vdtree::LightSource sun;
            sun.direction = glm::normalize(glm::dvec3(0.3, 0.5, 1));
            sun.intensity = 0.7;
            sun.casts_shadow = *casts;
            scene.lights = *calibration::LightRig::of({.lights = {sun}, .ambient = 0.2}, "a sun");
        }
        return *Session::create(std::move(scene));
    }
    std::vector<Effect> passes(Session& session, const Request& request = {}, bool folds_hidden = true) {
        const auto made = require(
            simplify_as_seen(session, context_, from_afar(), request, {.folds_hidden = folds_hidden, .samples = 4}));
        for (const Effect& effect : made->passes) {
            EXPECT_FALSE(effect.why.empty()) << effect.name;
            const bool was_drawn = effect.surface_passes > 0;
            EXPECT_EQ(was_drawn, effect.on) << effect.name;
            EXPECT_EQ(was_drawn, effect.texture_bytes > 0) << effect.name;
            EXPECT_EQ(was_drawn, effect.milliseconds > 0) << effect.name;
        }
        return made->passes;
    }
    static const Effect& of(const std::vector<Effect>& passes, const char* name) {
        return *std::ranges::find(passes, name, &Effect::name);
    }
};

TEST_F(PassesTest, OfOcclusionAreThoseOfItsDepths) {
    Session session = session_of({});
    const auto all = passes(session);
    EXPECT_EQ(of(all, "occlusion").surface_passes, 4);
    EXPECT_EQ(of(all, "occlusion").texture_bytes, 4u * side * side);
    EXPECT_FALSE(of(all, "shadows").on);
}

TEST_F(PassesTest, AreNoneWhereNothingIsAskedFor) {
    Session session = session_of(true);
    EXPECT_THAT(passes(session, {}, false), ::testing::IsEmpty());
}

TEST_F(PassesTest, AreOffWherePicturesTellNothing) {
    Session session = session_of(true);
    const auto all = passes(session, {.goal = Goal::full()});
    for (const char* off : {"occlusion", "shadows"}) {
        EXPECT_FALSE(of(all, off).on) << off;
        EXPECT_THAT(of(all, off).why, HasSubstr("nothing is folded")) << off;
    }
}

TEST_F(PassesTest, OfShadowsAreThereWhereALightCastsSome) {
    Session dark = session_of(false), cast = session_of(true);
    const auto without = passes(dark), with = passes(cast);
    EXPECT_FALSE(of(without, "shadows").on);
    EXPECT_EQ(of(with, "shadows").surface_passes, 1);
    EXPECT_TRUE(of(with, "occlusion").on);
}

TEST_F(PassesTest, AreDrawnOnceForACameraThatStandsStill) {
    Session session = session_of(true);
    const Request request{.purpose = Purpose::picture};
    const auto made = require(session.simplify(from_afar(), request));
    auto renderer = require(SceneRenderer::create(context_, session));
    for (int frame = 0; frame < 3; ++frame)
        ASSERT_TRUE(renderer->draw(drawn_cuts(made->cuts), from_afar(), {.samples = 1}));
    EXPECT_EQ(renderer->shadows()->redraws, 1u);
    Follower follower(session);
    ASSERT_TRUE(follower.follow(from_afar(), request));
    EXPECT_EQ(follower.follow(from_afar(), request)->stats.node_tests, 0u);
}

} // namespace unseen::session::as_seen_test
