// What frames before tell a moving view to be hidden: pictures of what is left, and what that takes.
#include <unseen/session_gpu/moving_occlusion.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <unseen/perception/judge.h>
#include <unseen/session_gpu/frame_image.h>
#include <unseen/session_gpu/trial.h>

#include "built.h"
#include "gl_test.h"
#include "measured.h"
#include "shapes.h"

namespace unseen::session::moving_occlusion_test {
namespace {

using perception::Image;
using ::testing::HasSubstr;
using vdtree::Mesh;

constexpr int side = 256;

// ---- whether it is worth it

// Feeds so many frames of these times, and returns in how many it was on.
int run(Trial& trial, int frames, double on_ms, double off_ms) {
    int on = 0;
    for (int i = 0; i < frames; ++i) {
        on += trial.is_on();
        trial.add(trial.is_on() ? on_ms : off_ms);
    }
    return on;
}

TEST(Trial, StaysOnWhereItSavesTime) {
    Trial trial;
    EXPECT_FALSE(trial.is_on());
    EXPECT_TRUE(std::isnan(trial.milliseconds(true)));
    const int on = run(trial, 1000, 8, 10);
    EXPECT_TRUE(trial.is_chosen());
    EXPECT_EQ(trial.milliseconds(true), 8);
    EXPECT_EQ(trial.milliseconds(false), 10);
    EXPECT_GT(on, 1000 - 12 * (trial.tries() + 1));
}

TEST(Trial, IsLeftOffWhereItDoesNotAndTriedLessAndLess) {
    Trial trial;
    const int on = run(trial, 4000, 10.2, 10);
    EXPECT_FALSE(trial.is_chosen());
    EXPECT_EQ(on, 12 * trial.tries());
    EXPECT_LE(trial.tries(), 7); // after 12, 120, 240, ... frames
    EXPECT_GE(trial.tries(), 4);
}

TEST(Trial, ASmallGainChangesNothing) {
    Trial a, b;
    run(a, 1000, 9.7, 10);
    EXPECT_FALSE(a.is_chosen());
    run(b, 1000, 8, 10);
    run(b, 1000, 10.3, 10);
    EXPECT_TRUE(b.is_chosen());
}

TEST(Trial, FollowsTheScene) {
    Trial trial;
    run(trial, 1000, 12, 10);
    EXPECT_FALSE(trial.is_chosen());
    run(trial, 4000, 5, 10);
    EXPECT_TRUE(trial.is_chosen());
    run(trial, 8000, 12, 10);
    EXPECT_FALSE(trial.is_chosen());
}

TEST(Trial, OneLongFrameDecidesNothing) {
    Trial trial;
    for (int i = 0; i < 1000; ++i) trial.add(i % 10 == 9 ? 500 : trial.is_on() ? 8 : 10);
    EXPECT_TRUE(trial.is_chosen());
}

// ---- in a scene

// As rough as sandpaper: what its folds change is fine.
Mesh rough_ball() {
    Mesh mesh = shapes::icosphere(6);
    std::mt19937_64 random(11);
    for (glm::dvec3& p : mesh.positions) p *= shapes::random_between(random, 0.998, 1.002);
    return mesh;
}

// A dark wall before the left half of it.
Mesh wall() {
    Mesh mesh = shapes::placed(shapes::cube(1), 1.5, {-1.6, 0, 3.5});
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) mesh.colours.push_back({0.02F, 0.02F, 0.02F, 1});
    return mesh;
}

class MovingOcclusionTest : public render::testing::GlTest {
protected:
    static Session session() {
        static const vdtree::VertexTree ball = support::measured(support::built(rough_ball()), 0);
        Scene scene = Scene::of(ball.share());
        scene.backdrop.push_back({support::built(wall(), {.prelit = true})});
        return *Session::create(std::move(scene));
    }
    // Walking ahead, and a little aside.
    static vdtree::View view(double steps) {
        vdtree::View view;
        view.width = view.height = side;
        view.fov_y_degrees = 7.5;
        view.eye = glm::dvec3(0.002, 0.001, -0.03) * steps + glm::dvec3(0, 0, 18);
        view.target = {0, 0, 0};
        return view;
    }
    Image picture(const Session& session, const vdtree::Cut& cut, const vdtree::View& view) {
        auto renderer = SceneRenderer::create(context(), session);
        render::DrawOptions options;
        options.samples = 16;
        options.background = session.background();
        const DrawnCut drawn[] = {{&cut}};
        const auto frame = renderer->draw(drawn, view, options);
        EXPECT_TRUE(frame) << frame.error().message;
        return luminance_image(*frame, {});
    }
    struct Flight {
        std::vector<vdtree::Index> triangles;
        MovingOcclusion::Facts facts;
        PassEffect effect;
    };
    // `speed`: steps a frame. Pictures of the last frames are judged where `judges`.
    Flight fly(const MovingOcclusionOptions& options, double speed, int frames, bool draws_depth, bool judges = false) {
        Session session = this->session();
        auto occlusion = MovingOcclusion::create(context(), session, options);
        EXPECT_TRUE(occlusion);
        EXPECT_TRUE(session.prepare(view(0), {.purpose = Purpose::picture}));
        auto renderer = SceneRenderer::create(context(), session);
        Follower follower(session);
        vdtree::Cut whole(session.tree());
        whole.unfold_all();
        Flight flight;
        for (int i = 0; i < frames; ++i) {
            const vdtree::View now = view(speed * i);
            Request request{.purpose = Purpose::picture};
            auto hidden = occlusion->begin_frame(now);
            EXPECT_TRUE(hidden) << hidden.error().message;
            request.hidden = *hidden;
            const auto made = follower.follow(now, request);
            EXPECT_TRUE(made) << made.error().message;
            flight.triangles.push_back(made->stats.triangles);
            const auto cuts = drawn_cuts(follower, 1);
            render::DrawOptions draw;
            draw.samples = 1;
            EXPECT_TRUE(renderer->draw(cuts, now, draw));
            const auto ended = draws_depth ? occlusion->end_frame(*renderer->items(cuts, now), now, 1)
                                           : occlusion->end_frame(*renderer->drawn_depth(), now, 1);
            EXPECT_TRUE(ended) << ended.error().message;
            if (!judges || i < frames - 3) continue;
            const auto judged =
                perception::judge_modern(picture(session, whole, now), picture(session, follower.cut(), now), {});
            EXPECT_EQ(judged->visible_pixels, 0u) << "frame " << i << ", V " << judged->max_ratio;
        }
        flight.facts = occlusion->facts();
        flight.effect = occlusion->effect();
        return flight;
    }
};

TEST_F(MovingOcclusionTest, WhatIsBehindAWallFoldsAndNobodySeesIt) {
    for (const bool draws_depth : {false, true}) {
        const Flight flight = fly({}, 1, 12, draws_depth, true);
        EXPECT_LT(flight.triangles.back(), 0.8 * flight.triangles.front());
        EXPECT_GT(flight.triangles.back(), 0.4 * flight.triangles.front());
        EXPECT_TRUE(flight.effect.on);
        EXPECT_EQ(flight.facts.objects, 1u);
        EXPECT_GE(flight.facts.pictures, 5u);
        EXPECT_LE(flight.facts.pictures, 11u);
        EXPECT_EQ(flight.facts.drawings, draws_depth ? flight.facts.pictures : 0);
        EXPECT_GT(flight.effect.texture_bytes, 0u);
        // The same once more, whatever the machine does.
        EXPECT_EQ(fly({}, 1, 12, draws_depth).triangles, flight.triangles);
    }
}

TEST_F(MovingOcclusionTest, AViewThatStandsStillHasOnePicture) {
    const Flight flight = fly({}, 0, 8, false);
    EXPECT_EQ(flight.facts.pictures, 1u);
    EXPECT_LT(flight.triangles.back(), 0.8 * flight.triangles.front());
    for (std::size_t i = 2; i < flight.triangles.size(); ++i) EXPECT_EQ(flight.triangles[i], flight.triangles[1]);
}

TEST_F(MovingOcclusionTest, WithoutWaitingItComesLater) {
    const Flight flight = fly({.waits = false}, 0, 30, false);
    EXPECT_EQ(flight.facts.pictures, 1u);
    EXPECT_EQ(flight.triangles.back(), fly({}, 0, 8, false).triangles.back());
}

TEST_F(MovingOcclusionTest, IsNotDrawnBeforeItIsTried) {
    const Flight few = fly({.use = MovingOcclusionOptions::Use::where_it_saves_time}, 1, 6, false);
    EXPECT_EQ(few.facts.pictures, 0u);
    EXPECT_EQ(few.facts.bytes, 0u);
    EXPECT_FALSE(few.effect.on);
    EXPECT_THAT(few.effect.why, HasSubstr("not tried"));
    EXPECT_EQ(few.triangles[3],
              fly({.use = MovingOcclusionOptions::Use::where_it_saves_time}, 1, 4, false).triangles[3]);
    const Flight more = fly({.use = MovingOcclusionOptions::Use::where_it_saves_time}, 1, 30, false);
    EXPECT_GT(more.facts.pictures, 0u);
    EXPECT_EQ(more.facts.tries, 1u);
    EXPECT_LE(more.facts.frames_on, 18u);
}

TEST_F(MovingOcclusionTest, DoesNotCountWhereTheEyeHasGoneTooFar) {
    Session session = this->session();
    auto occlusion = *MovingOcclusion::create(context(), session);
    ASSERT_TRUE(session.prepare(view(0), {.purpose = Purpose::picture}));
    auto renderer = SceneRenderer::create(context(), session);
    const auto made = session.simplify(view(0), {.purpose = Purpose::picture});
    ASSERT_TRUE(*occlusion.begin_frame(view(0)) == nullptr);
    ASSERT_TRUE(occlusion.end_frame(*renderer->items(drawn_cuts(made->cuts), view(0)), view(0), 1));
    const auto hidden = *occlusion.begin_frame(view(0));
    ASSERT_TRUE(hidden);
    EXPECT_FALSE(*occlusion.begin_frame(view(50)));
    // Nor where somebody keeps it for too long.
    const Request kept{.purpose = Purpose::picture, .hidden = hidden}, none{.purpose = Purpose::picture};
    EXPECT_EQ(session.simplify(view(50), kept)->stats.triangles, session.simplify(view(50), none)->stats.triangles);
    EXPECT_LT(session.simplify(view(0), kept)->stats.triangles, session.simplify(view(0), none)->stats.triangles);
    // Nor of meshes that may be looked at from elsewhere, and of tests that count pixels.
    EXPECT_EQ(session.simplify(view(0), {.hidden = hidden})->stats.triangles,
              session.simplify(view(0), {})->stats.triangles);
    const Request pixels{.goal = Goal::pixels(1), .purpose = Purpose::picture, .hidden = hidden};
    EXPECT_TRUE(session.simplify(view(0), pixels));
}

TEST_F(MovingOcclusionTest, RefusesWhatIsNone) {
    const Session session = this->session();
    EXPECT_FALSE(MovingOcclusion::create(context(), session, {.samples = 0}));
    EXPECT_FALSE(MovingOcclusion::create(context(), session, {.cell_px = 0}));
    EXPECT_FALSE(MovingOcclusion::create(context(), session, {.frames = 0}));
}

} // namespace
} // namespace unseen::session::moving_occlusion_test
