// Cuts that pictures have checked: fewer triangles than bounds allow, and nothing seen where nobody looked before.
#include <unseen/session_gpu/checked.h>

#include <random>

#include <glm/geometric.hpp>

#include <unseen/session_gpu/as_seen.h>
#include <unseen/session_gpu/picture_judge.h>

#include "built.h"
#include "measured.h"
#include "shapes.h"
#include "testing.h"

namespace unseen::session::checked_test {

using ::testing::HasSubstr;

class Checked : public testing::Test {
protected:
    static Session session_of(const vdtree::Mesh& mesh) {
        return *Session::create(Scene::of(support::measured(support::built(mesh))));
    }
    static vdtree::View view_of(const Session& session, glm::dvec3 direction, int size_px, double fill) {
        vdtree::View window = session.default_view();
        window.fov_y_degrees *= static_cast<double>(size_px) / window.height;
        window.width = window.height = size_px;
        return session.frame(direction, fill, window);
    }
    // The largest V of either judge.
    double seen(const Simplification& made, const vdtree::View& view) {
        auto judge = require(PictureJudge::create(context_, session_, view, 64));
        const auto verdict = require(judge->judge(made.cuts));
        return std::max(verdict->v, verdict->second_v);
    }
    // So far around the target, one way or the other.
    static std::vector<vdtree::View> views_around(const vdtree::View& view, double degrees) {
        return {vdtree::orbited(view, degrees), vdtree::orbited(view, -degrees), vdtree::orbited(view, 0.4 * degrees)};
    }
    double seen_around(const Simplification& made, double degrees) {
        double most = 0;
        for (const vdtree::View& view : views_around(view_, degrees)) most = std::max(most, seen(made, view));
        return most;
    }

    render::Context context_ = *render::Context::headless();
    Session session_ = *Session::create(Scene::of(support::measured(support::built(shapes::bumpy_sphere(5, 0.03)))));
    vdtree::View view_ = view_of(session_, {0.2, 0.3, 1}, 128, 0.5);
};

TEST_F(Checked, KeepsLessThanBoundsAndShowsNothing) {
    const auto bounded = require(simplify_as_seen(session_, context_, view_, {}));
    const auto checked = require(simplify_checked(session_, context_, view_, {}));
    EXPECT_LT(checked->stats.triangles, 0.95 * bounded->stats.triangles);
    const CheckFacts& facts = *checked->check;
    EXPECT_TRUE(facts.is_settled);
    EXPECT_GE(facts.verified_views, 3);
    EXPECT_GT(facts.cost, 0);
    EXPECT_LT(std::max(facts.v, facts.second_v), 1);
    EXPECT_GT(std::max(facts.v, facts.second_v), 0.4); // the fewest triangles, about
    vdtree::View beside = view_;
    beside.shift = {0.37 / 128, -0.61 / 128};
    EXPECT_LT(seen(*checked, beside), 1);
    const auto again = require(simplify_checked(session_, context_, view_, {}));
    EXPECT_EQ(again->stats.triangles, checked->stats.triangles);
}

TEST_F(Checked, OneViewDoesNotDoForACell) {
    // A ball behind a wall that hides it, until the eye goes aside.
    const vdtree::Mesh wall = shapes::placed(shapes::cube(8), 2.4, {-1.2, -1.2, 5});
    session_ = session_of(shapes::together(shapes::bumpy_sphere(4, 0.05), wall));
    view_ = view_of(session_, {0, 0, 1}, 128, 0.9);
    const auto of_view = require(simplify_checked(session_, context_, view_, {}));
    EXPECT_GE(seen_around(*of_view, 5), 1);
    const auto of_cell = require(simplify_checked(session_, context_, view_, {}, {.cell_degrees = 5}));
    EXPECT_LT(seen_around(*of_cell, 5), 1);
    EXPECT_LT(seen(*of_cell, view_), 1);
    EXPECT_GT(of_cell->stats.triangles, of_view->stats.triangles);
    EXPECT_EQ(of_cell->check->fitted_views, 9);
}

TEST_F(Checked, QualitiesMayShowWhatTheySay) {
    std::uint64_t before = session_.triangle_count();
    for (const Quality quality : {Quality::invisible, Quality::draft}) {
        const QualityFacts& facts = facts_of(quality);
        const auto made = require(simplify_checked(session_, context_, view_, {.goal = Goal::quality(facts.quality)}));
        EXPECT_LT(made->stats.triangles, before) << facts.name;
        before = made->stats.triangles;
        EXPECT_LT(std::max(made->check->v, made->check->second_v), facts.cost);
    }
}

TEST_F(Checked, EndsWithTheLastThatPassed) {
    int looks = 0;
    const auto told = [&](double, const char* stage) { return std::string_view(stage) != "other views"; };
    const auto made = require(simplify_checked(session_, context_, view_, {}, {.progress = told}));
    EXPECT_FALSE(made->check->is_settled);
    EXPECT_EQ(made->check->verified_views, 0);
    EXPECT_LT(made->stats.triangles, session_.triangle_count());
    const auto at_once = simplify_checked(session_, context_, view_, {}, {.progress = [&](double, const char*) {
                                              ++looks;
                                              return false;
                                          }});
    ASSERT_FALSE(at_once);
    EXPECT_EQ(at_once.error().code, ErrorCode::cancelled);
    EXPECT_EQ(looks, 1);
    // No time for a second cut.
    const auto quick = require(simplify_checked(session_, context_, view_, {}, {.seconds = 1e-9}));
    EXPECT_FALSE(quick->check->is_settled);
    EXPECT_LT(quick->stats.triangles, session_.triangle_count());
}

TEST_F(Checked, RefusesWhatItCannotCheck) {
    const auto complaint = [&](const Request& request, const CheckOptions& options = {}) {
        const auto made = simplify_checked(session_, context_, view_, request, options);
        return made ? std::string() : std::string(made.error().message);
    };
    EXPECT_THAT(complaint({.goal = Goal::budget(100)}), HasSubstr("check"));
    EXPECT_THAT(complaint({.goal = Goal::full()}), HasSubstr("check"));
    EXPECT_THAT(complaint({}, {.cell_degrees = 11}), HasSubstr("cell_degrees"));
    EXPECT_THAT(complaint({}, {.cell_degrees = std::nan("")}), HasSubstr("cell_degrees"));
    EXPECT_THAT(complaint({}, {.seconds = 0}), HasSubstr("seconds"));
    EXPECT_THAT(complaint({}, {.samples = 0}), HasSubstr("samples"));
    // The eye goes around a point beside the ball, and would pass through it.
    vdtree::View beside = view_;
    const double radius = session_.bounding_sphere().radius;
    beside.eye = session_.bounding_sphere().centre + glm::dvec3(0, 0, 1.05 * radius);
    beside.target = beside.eye + glm::dvec3(radius, 0, 0);
    const auto inside = simplify_checked(session_, context_, beside, {}, {.cell_degrees = 10});
    ASSERT_FALSE(inside);
    EXPECT_THAT(std::string(inside.error().message), HasSubstr("into the solid of object 0"));
    vdtree::View flat = view_;
    flat.orthographic_height = 3;
    EXPECT_FALSE(simplify_checked(session_, context_, flat, {}));
}

} // namespace unseen::session::checked_test
