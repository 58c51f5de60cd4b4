// Lights that move: the test by errors folds for a stretch of time, and nothing is seen within it.
#include <fstream>

#include <unseen/session/follower.h>
#include <unseen/session_gpu/as_seen.h>
#include <unseen/session_gpu/picture_judge.h>

#include "built.h"
#include "measured.h"
#include "shapes.h"
#include "temp_folder.h"
#include "testing.h"

namespace unseen::session::moving_lights_test {

class MovingLights : public testing::Test {
protected:
    // Under the lights of a file with this text.
    Session session_under(const std::string& text) {
        const auto file = folder_.path() / "lights.json";
        std::ofstream(file) << text;
        Scene scene = Scene::of(support::measured(support::built(shapes::bumpy_sphere(4, 0.05))));
        scene.lights = *calibration::LightRig::read(file);
        return *Session::create(std::move(scene));
    }
    static vdtree::View view_of(const Session& session) {
        vdtree::View window = session.default_view();
        window.fov_y_degrees *= 128.0 / window.height;
        window.width = window.height = 128;
        return session.frame({0.2, 0.3, 1}, 0.3, window);
    }
    void expect_invisible(Session& session, std::initializer_list<double> times) {
        expect_invisible(session, times, view_of(session));
    }
    void expect_invisible(Session& session, std::initializer_list<double> times, const vdtree::View& view) {
        for (const double seconds : times) {
            session.set_time(seconds);
            const auto made = require(session.simplify(view, {.purpose = Purpose::picture}));
            EXPECT_EQ(made->fold_tests.front(), FoldTest::error);
            EXPECT_LT(made->stats.triangles, made->source_triangles);
            auto judge = require(PictureJudge::create(context_, session, view, 64));
            const auto verdict = require(judge->judge(made->cuts));
            EXPECT_LT(std::max(verdict->v, verdict->second_v), 1) << seconds;
        }
    }

    support::TempFolder folder_;
    render::Context context_ = *render::Context::headless();
};

constexpr const char* orbiting = R"({"ambient": 0.1, "lights": [{"type": "directional", "direction": [0.4, 0.7, 0.6],
    "intensity": 0.8, "orbit": {"axis": [0, 1, 0], "degrees_per_second": 60}}]})";
constexpr const char* still = R"({"ambient": 0.1, "lights": [{"type": "directional", "direction": [0.4, 0.7, 0.6],
    "intensity": 0.8}]})";

TEST_F(MovingLights, ShowNothingAtAnyTime) {
    Session session = session_under(orbiting);
    expect_invisible(session, {0, 1.9, 4.8});
}

TEST_F(MovingLights, ShowNothingOnTheirWay) {
    Session session = session_under(R"({"ambient": 0.05, "lights": [
        {"type": "point", "position": [3, 0, 3], "intensity": 0.8, "distance": 4,
         "keyframes": [{"time_s": 0, "position": [3, 0, 3]}, {"time_s": 2, "position": [-3, 1, 2]}]}]})");
    expect_invisible(session, {0, 1.5, 2});
}

TEST_F(MovingLights, KeepLittleMoreThanLightsThatStandStill) {
    Session moving = session_under(orbiting), at_rest = session_under(still);
    const vdtree::View view = view_of(moving);
    const Request request{.purpose = Purpose::picture};
    const auto now = require(moving.simplify(view, request)), one = require(at_rest.simplify(view, request));
    EXPECT_GT(now->stats.triangles, 0.95 * one->stats.triangles);
    EXPECT_LT(now->stats.triangles, 1.3 * one->stats.triangles);
    moving.set_time(0.2); // 12 degrees: the same cut
    EXPECT_EQ(require(moving.simplify(view, request))->stats.triangles, now->stats.triangles);
    moving.set_time(1);
    EXPECT_NE(require(moving.simplify(view, request))->stats.triangles, now->stats.triangles);
    moving.set_time(6); // once around
    EXPECT_NEAR(require(moving.simplify(view, request))->stats.triangles, now->stats.triangles,
                0.01 * now->stats.triangles);
}

// Shadows of lights that move take the safe test, which goes by no picture.
TEST_F(MovingLights, BudgetsHoldWherePicturesTellNothing) {
    Session session = session_under(R"({"ambient": 0.1, "lights": [{"type": "directional", "direction": [0.4, 0.7, 0.6],
        "intensity": 0.8, "shadow": true, "orbit": {"axis": [0, 1, 0], "degrees_per_second": 60}}]})");
    const auto made = require(simplify_as_seen(session, context_, view_of(session), {.goal = Goal::budget(500)}));
    EXPECT_EQ(made->fold_tests.front(), FoldTest::luebke_hallen_safe);
    EXPECT_LE(made->stats.triangles, 500u);
}

// A stretch takes a good part of a second for 100,000 triangles.
TEST_F(MovingLights, TakeTheSafeTestWhereNobodyWaits) {
    Session session = session_under(orbiting);
    const auto made = require(session.simplify(view_of(session), {.may_measure = false}));
    EXPECT_EQ(made->fold_tests.front(), FoldTest::luebke_hallen_safe);
}

constexpr const char* on_the_camera = R"({"ambient": 0.1, "lights": [{"type": "headlight", "intensity": 0.6}]})";
constexpr const char* glossy = R"({"ambient": 0.1, "material": {"specular": 0.08, "shininess": 30},
    "lights": [{"type": "directional", "direction": [0.1, 0.4, 0.9], "intensity": 0.6}]})";

// In a single picture the eye is known, and nothing shows of what is folded for it; fewer triangles are left than by bounds.
TEST_F(MovingLights, ThatFollowTheEyeAreKnownInPictures) {
    for (const char* const text : {on_the_camera, glossy}) {
        Session session = session_under(text);
        expect_invisible(session, {0});
        const vdtree::View view = view_of(session);
        const auto measured = require(session.simplify(view, {.purpose = Purpose::picture}));
        const auto bounded =
            require(session.simplify(view, {.fold_test = FoldTest::luebke_hallen_safe, .purpose = Purpose::picture}));
        EXPECT_LT(measured->stats.triangles, bounded->stats.triangles);
        // From elsewhere a highlight is elsewhere.
        const vdtree::View aside = session.frame({1, 0.3, 0.2}, 0.3, view);
        expect_invisible(session, {0}, aside);
    }
}

TEST_F(MovingLights, ThatFollowTheEyeTakeTheSafeTestInMeshesAndOnPaths) {
    for (const char* const text : {on_the_camera, glossy}) {
        Session session = session_under(text);
        const auto mesh = require(session.simplify(view_of(session), {}));
        EXPECT_EQ(mesh->fold_tests.front(), FoldTest::luebke_hallen_safe);
        Follower follower(session);
        const auto report = require(follower.follow(view_of(session), {.purpose = Purpose::picture}));
        EXPECT_EQ(report->fold_tests.front(), FoldTest::luebke_hallen_safe);
        EXPECT_FALSE(session.simplify(view_of(session), {.fold_test = FoldTest::error}));
    }
}

} // namespace unseen::session::moving_lights_test
