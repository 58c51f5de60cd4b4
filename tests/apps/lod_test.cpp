// Levels of detail: what is said of their distances, looked at once more from elsewhere.
#include <unseen/session_gpu/lod.h>

#include <unseen/session_gpu/picture_judge.h>

#include "gl_test.h"
#include "measured.h"
#include "shapes.h"

namespace lod_test {

using namespace unseen;
using namespace unseen::session;
using LodTest = render::testing::GlTest;

Session bumpy() {
    Scene scene;
    scene.objects.push_back(Object{support::measured(support::built(shapes::bumpy_sphere(5, 0.05)))});
    scene.objects[0].placement.translation = {3, 1, -2};
    scene.objects[0].placement.scale = 2;
    auto session = Session::create(std::move(scene));
    EXPECT_TRUE(session) << session.error().message;
    return std::move(*session);
}

// Pixels that either judge sees.
std::uint64_t seen(const render::Context& context, const Session& session, const Lod& lod, std::size_t level,
                   double distance, glm::dvec3 direction) {
    auto judge = PictureJudge::create(context, session, lod_view(lod, lod.objects[0].sphere, direction, distance), 64);
    EXPECT_TRUE(judge) << judge.error().message;
    std::vector<vdtree::Cut> cuts;
    cuts.push_back(lod.objects[0].cut(level));
    const auto verdict = judge->judge(cuts);
    EXPECT_TRUE(verdict) << verdict.error().message;
    return verdict->visible_pixels + verdict->second_visible_pixels;
}

TEST_F(LodTest, NobodySeesALevelFromItsDistanceAndSomebodyFromNearBy) {
    Session session = bumpy();
    const auto lod = require(make_levels(session, context()));
    ASSERT_EQ(lod->objects.size(), 1u);
    const LodObject& object = lod->objects[0];
    ASSERT_GE(object.levels.size(), 3u);
    EXPECT_EQ(object.levels[0].triangles, session.tree().triangle_count());
    EXPECT_EQ(object.levels[0].distance, 0);
    std::uint64_t seen_near = 0;
    double nearest = 1; // share of what the fold test promises
    for (std::size_t i = 1; i < object.levels.size(); ++i) {
        const LodLevel& level = object.levels[i];
        EXPECT_LT(level.triangles, object.levels[i - 1].triangles);
        EXPECT_EQ(level.triangles, object.cut(i).triangle_count());
        EXPECT_GE(level.distance, lod_step * object.levels[i - 1].distance);
        nearest = std::min(nearest, level.distance / level.promised_distance);
        EXPECT_LT(level.coverage, object.levels[i - 1].coverage);
        EXPECT_GT(level.pixel_error, 0);
        EXPECT_EQ(level.checks.size(), 12u);
        for (const LodCheck& check : level.checks) {
            EXPECT_EQ(check.visible_pixels + check.second_visible_pixels, 0u);
            EXPECT_LT(check.v, 1);
            EXPECT_LT(check.second_v, 1);
        }
        for (const glm::dvec3& direction : lod_directions(2, 98765 + i)) {
            EXPECT_EQ(seen(context(), session, *lod, i, level.distance, direction), 0u) << "level " << i;
            const double near = object.sphere.radius + 0.25 * (level.distance - object.sphere.radius);
            seen_near += seen(context(), session, *lod, i, near, direction);
        }
    }
    EXPECT_LT(nearest, 0.9);
    EXPECT_GT(seen_near, 0u); // the distances are worth something, and the judges are not blind
}

TEST_F(LodTest, LowerQualitiesBeginNearer) {
    Session session = bumpy();
    LodOptions options{.chain = {.levels = 3}, .directions = 3, .samples = 16};
    const auto unseen = require(make_levels(session, context(), options));
    options.cost = Goal::quality(Quality::draft).cost;
    const auto draft = require(make_levels(session, context(), options));
    const LodLevel &far = unseen->objects[0].levels.back(), &near = draft->objects[0].levels.back();
    EXPECT_EQ(near.triangles, far.triangles);
    const double radius = draft->objects[0].sphere.radius;
    EXPECT_LT(near.distance - radius, 0.5 * (far.distance - radius));
    double largest = 0;
    for (const LodCheck& check : near.checks) largest = std::max({largest, check.v, check.second_v});
    EXPECT_GT(largest, 1) << "what is nearer is seen";
    EXPECT_LE(largest, lod_most * options.cost);
}

TEST_F(LodTest, TheSameSeedLooksFromTheSameSides) {
    Session session = bumpy();
    const LodOptions options{.chain = {.levels = 2}, .directions = 2, .samples = 4};
    const auto once = require(make_levels(session, context(), options)),
               again = require(make_levels(session, context(), options));
    EXPECT_EQ(once->objects[0].levels[1].distance, again->objects[0].levels[1].distance);
    EXPECT_EQ(once->objects[0].levels[1].checks[0].direction, again->objects[0].levels[1].checks[0].direction);
    EXPECT_EQ(once->objects[0].levels[1].checks[0].v, again->objects[0].levels[1].checks[0].v);
}

TEST_F(LodTest, WhatHasNoUnseenLevelSaysSo) {
    Scene scene; // too few triangles for any level
    scene.objects.push_back(Object{support::measured(support::built(shapes::bumpy_sphere(1, 0.05)))});
    auto session = require(Session::create(std::move(scene)));
    const auto lod = require(make_levels(*session, context()));
    EXPECT_EQ(lod->objects[0].levels.size(), 1u);
    ASSERT_FALSE(lod->objects[0].notes.empty());
    EXPECT_THAT(lod->objects[0].notes.back(), HasSubstr("no level below the full mesh"));
}

// So many that some begin at nearly the same distance.
TEST_F(LodTest, LevelsThatCannotBeToldApartBecomeOne) {
    Session session = bumpy();
    LodOptions options{.chain = {.levels = most_levels}, .directions = 1, .samples = 4};
    options.chain.least_share = 0.3;
    const auto lod = require(make_levels(session, context(), options));
    const LodObject& object = lod->objects[0];
    EXPECT_LT(object.levels.size(), static_cast<std::size_t>(object.chain.size()));
    EXPECT_THAT(object.notes, ::testing::Contains(HasSubstr("was merged with that of")));
    for (std::size_t i = 2; i < object.levels.size(); ++i)
        EXPECT_GE(object.levels[i].distance, lod_step * object.levels[i - 1].distance);
}

TEST_F(LodTest, OptionsOutOfRangeAreErrors) {
    Session session = bumpy();
    EXPECT_THAT(make_levels(session, context(), {.directions = 0}).error().message, HasSubstr("lod.directions"));
    EXPECT_THAT(make_levels(session, context(), {.samples = 257}).error().message, HasSubstr("lod.samples"));
    EXPECT_THAT(make_levels(session, context(), {.cost = 0}).error().message, HasSubstr("lod.cost"));
    EXPECT_THAT(make_levels(session, context(), {.fov_y_degrees = std::nan("")}).error().message,
                HasSubstr("lod.fov_y_degrees"));
    const auto stopped = make_levels(session, context(), {.progress = [](double, const char*) { return false; }});
    ASSERT_FALSE(stopped);
    EXPECT_EQ(stopped.error().code, ErrorCode::cancelled);
}

TEST(LodDirections, AreSpreadAndOffTheAxes) {
    for (const int count : {1, 12, 1000}) {
        const auto directions = lod_directions(count, 7);
        ASSERT_EQ(directions.size(), static_cast<std::size_t>(count));
        glm::dvec3 sum(0);
        for (const glm::dvec3& d : directions) {
            EXPECT_NEAR(glm::length(d), 1, 1e-12);
            for (int axis = 0; axis < 3; ++axis) EXPECT_LT(std::abs(d[axis]), std::cos(4.999 * 3.14159265 / 180));
            sum += d / static_cast<double>(count);
        }
        if (count > 1) EXPECT_LT(glm::length(sum), 0.6);
    }
    EXPECT_NE(lod_directions(1, 1)[0], lod_directions(1, 2)[0]);
}

} // namespace lod_test
