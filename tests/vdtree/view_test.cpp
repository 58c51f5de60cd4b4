// Views: the camera's frame, framing a sphere, and what is no view.
#include <unseen/vdtree/internal/footprint.h>
#include <unseen/vdtree/view.h>

#include <glm/gtc/matrix_transform.hpp>

#include <unseen/vdtree/depth_picture.h>

#include "shapes.h"
#include "testing.h"

namespace unseen::vdtree::view_test {

using shapes::random_between;
using shapes::random_direction;

constexpr double rounding = 1e-12; // of unit vectors after a few operations in double

TEST(View, HasAValidDefault) { EXPECT_TRUE(validate(View{})); }

TEST(View, RefusesWhatIsNone) {
    const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    const std::vector<std::pair<const char*, std::function<void(View&)>>> faults = {
        {"eye at the target", [](View& v) { v.eye = v.target; }},
        {"eye nowhere", [=](View& v) { v.eye.x = nan; }},
        {"eye at infinity", [=](View& v) { v.eye.z = inf; }},
        {"target nowhere", [=](View& v) { v.target.y = nan; }},
        {"up nowhere", [=](View& v) { v.up.y = nan; }},
        {"up at infinity", [=](View& v) { v.up.y = -inf; }},
        {"no up", [](View& v) { v.up = glm::dvec3(0); }},
        {"up along the line of sight",
         [](View& v) {
             v.up = {0, 0, -3};
         }},
        {"up nearly along the line of sight",
         [](View& v) {
             v.up = {0, 1e-9, 1};
         }},
        {"no field", [](View& v) { v.fov_y_degrees = 0; }},
        {"negative field", [](View& v) { v.fov_y_degrees = -30; }},
        {"field of a half-space", [](View& v) { v.fov_y_degrees = 180; }},
        {"field that is no number", [=](View& v) { v.fov_y_degrees = nan; }},
        {"no width", [](View& v) { v.width = 0; }},
        {"no height", [](View& v) { v.height = 0; }},
        {"negative width", [](View& v) { v.width = -1024; }},
        {"width beyond all windows", [](View& v) { v.width = 32769; }},
        {"height beyond all windows", [](View& v) { v.height = std::numeric_limits<int>::max(); }},
        {"a distance beyond doubles", [](View& v) { v.eye.x = 1.7e308, v.target.x = -1.7e308; }},
    };
    for (const auto& [what, spoil] : faults) {
        View view;
        spoil(view);
        const auto valid = validate(view);
        ASSERT_FALSE(valid) << what;
        EXPECT_EQ(valid.error().code, ErrorCode::invalid_argument);
        EXPECT_FALSE(valid.error().message.empty());
    }
}

TEST(View, TakesExtremesThatAreFine) {
    for (const double scale : {1e-200, 1e-19, 1e30, 1e150})
        EXPECT_TRUE(validate({.eye = {0, 0, scale}, .up = {0, scale, 0}})) << scale;
    EXPECT_TRUE(validate({.fov_y_degrees = 179.9}));
    EXPECT_TRUE(validate({.fov_y_degrees = 1e-3}));
    EXPECT_TRUE(validate(View{.width = 1, .height = 32768}));
    EXPECT_TRUE(validate({.eye = {0, 0, 1}, .up = {0, 1e-3, 1}}));
}

TEST(CameraFrame, IsOrthonormalAndRightHanded) {
    std::mt19937_64 random(1);
    for (int round = 0; round < 10'000; ++round) {
        const double scale = std::pow(10.0, random_between(random, -100, 100));
        const View view{.eye = scale * random_direction(random),
                        .target = scale * random_direction(random),
                        .up = std::pow(10.0, random_between(random, -100, 100)) * random_direction(random)};
        if (!validate(view)) continue;
        const CameraFrame f = camera_frame(view);
        for (const glm::dvec3 axis : {f.right, f.up, f.back}) ASSERT_NEAR(glm::length(axis), 1, rounding);
        ASSERT_NEAR(glm::dot(f.right, f.up), 0, rounding);
        ASSERT_NEAR(glm::dot(f.up, f.back), 0, rounding);
        ASSERT_NEAR(glm::dot(f.back, f.right), 0, rounding);
        ASSERT_NEAR(glm::dot(glm::cross(f.right, f.up), f.back), 1, rounding);
        ASSERT_GT(glm::dot(f.back, glm::normalize((view.eye - view.target) / scale)), 1 - rounding);
        ASSERT_GT(glm::dot(f.up, view.up), 0);
    }
}

TEST(CameraFrame, LooksDownMinusZByDefault) {
    const CameraFrame f = camera_frame({});
    EXPECT_EQ(f.right, glm::dvec3(1, 0, 0));
    EXPECT_EQ(f.up, glm::dvec3(0, 1, 0));
    EXPECT_EQ(f.back, glm::dvec3(0, 0, 1));
}

TEST(Orbited, TurnsTheEyeAroundTheUprightAxis) {
    View view;
    view.eye = {1, 5, 3}, view.target = {1, 2, 1}, view.up = {0, 2, 0};
    const View quarter = orbited(view, 90), back = orbited(quarter, -90);
    EXPECT_LT(glm::distance(quarter.eye, glm::dvec3(3, 5, 1)), 10 * rounding);
    EXPECT_LT(glm::distance(back.eye, view.eye), 10 * rounding);
    EXPECT_EQ(quarter.target, view.target);
    EXPECT_EQ(orbited(view, 0).eye, view.eye);
    view.up = {0, 0, 1};
    EXPECT_LT(glm::distance(orbited(view, 180).eye, glm::dvec3(1, -1, 3)), 10 * rounding);
}

// The largest height above the middle of the window, as a share of half its height, of points of the sphere.
double outline_share(const View& view, glm::dvec3 centre, double radius) {
    const CameraFrame f = camera_frame(view);
    const double tan_y = std::tan(view.fov_y_degrees * std::numbers::pi / 360);
    double highest = 0;
    constexpr int samples = 200'000;
    for (int i = 0; i < samples; ++i) { // in the plane of the eye, the centre and up
        const double a = 2 * std::numbers::pi * i / samples;
        const glm::dvec3 p = centre + radius * (std::cos(a) * f.up + std::sin(a) * f.back) - view.eye;
        highest = std::max(highest, glm::dot(p, f.up) / -glm::dot(p, f.back) / tan_y);
    }
    return highest;
}

TEST(FrameSphere, GivesTheOutlineTheShareAskedFor) {
    std::mt19937_64 random(2);
    for (int round = 0; round < 30; ++round) {
        const double fill = random_between(random, 0.05, 1.2), radius = std::pow(10.0, random_between(random, -3, 3));
        const View window{.fov_y_degrees = random_between(random, 5, 120), .width = 640, .height = 480};
        const glm::dvec3 centre = 10 * radius * random_direction(random), direction = 7.0 * random_direction(random);
        const View view = frame_sphere(centre, radius, direction, fill, window);
        ASSERT_TRUE(validate(view));
        EXPECT_EQ(view.target, centre);
        EXPECT_EQ(view.width, 640);
        EXPECT_EQ(view.height, 480);
        EXPECT_EQ(view.fov_y_degrees, window.fov_y_degrees);
        EXPECT_GT(glm::dot(glm::normalize(view.eye - centre), glm::normalize(direction)), 1 - rounding);
        EXPECT_NEAR(outline_share(view, centre, radius), fill, 1e-6 * fill);
    }
}

TEST(FrameSphere, LooksAlongEveryAxis) {
    for (int axis = 0; axis < 3; ++axis) {
        for (const double sign : {-1.0, 1.0}) {
            glm::dvec3 direction(0);
            direction[axis] = sign;
            const View view = frame_sphere({1, 2, 3}, 1, direction, 0.9, {});
            EXPECT_TRUE(validate(view)) << axis << ' ' << sign;
            EXPECT_NEAR(outline_share(view, {1, 2, 3}, 1), 0.9, 1e-6);
        }
    }
}

TEST(FrameSphere, MakesNoValidViewOfImpossibleWishes) {
    const View window;
    EXPECT_FALSE(validate(frame_sphere({0, 0, 0}, 1, {0, 0, 0}, 0.9, window))); // no direction
    EXPECT_FALSE(validate(frame_sphere({0, 0, 0}, 1, {0, 0, 1}, 0, window)));   // from infinitely far away
    EXPECT_FALSE(validate(frame_sphere({0, 0, 0}, 0, {0, 0, 1}, 0.9, window))); // a point fills nothing
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(validate(frame_sphere({0, 0, 0}, 1, {0, nan, 1}, 0.9, window)));
    EXPECT_FALSE(validate(frame_sphere({0, 0, 0}, 1, {0, 0, 1}, nan, window)));
}

TEST(Similarity, GoesToTheWorldAndBack) {
    std::mt19937_64 random(3);
    for (int round = 0; round < 1000; ++round) {
        Similarity s;
        s.scale = std::pow(10.0, random_between(random, -6, 6));
        s.rotation = glm::angleAxis(random_between(random, -3, 3), random_direction(random));
        s.translation = s.scale * 5.0 * random_direction(random);
        const glm::dvec3 p = random_direction(random), q = random_direction(random);
        EXPECT_LT(glm::distance(s.to_mesh(s.to_world(p)), p), rounding);
        EXPECT_NEAR(glm::distance(s.to_world(p), s.to_world(q)) / s.scale, glm::distance(p, q), rounding);
        EXPECT_LT(glm::distance(s.direction_to_mesh(s.rotation * p), p), rounding);
    }
}

glm::dmat4 frustum_matrix(double left, double right, double bottom, double top, double near_distance,
                          double far_distance) {
    return glm::frustum(left, right, bottom, top, near_distance, far_distance);
}

struct Matrices {
    glm::dmat4 view, projection;
};
// Of a camera somewhere, whose window of 800 x 600 lies anywhere before it.
Matrices random_matrices(std::mt19937_64& random, bool orthographic) {
    const glm::dvec3 eye = 3.0 * random_direction(random);
    const glm::dmat4 view = glm::lookAt(eye, eye + random_direction(random), random_direction(random));
    const double height = std::pow(10.0, random_between(random, -1, 1)), width = height * 800 / 600;
    const double left = random_between(random, -2, 1) * width, bottom = random_between(random, -2, 1) * height;
    return {view, orthographic ? glm::ortho(left, left + width, bottom, bottom + height, -3.0, 100.0)
                               : frustum_matrix(left, left + width, bottom, bottom + height, 0.5, 100)};
}

// Where a view shows a point: by what Projector and the frame say.
glm::dvec2 shown_at(const View& view, glm::dvec3 point) {
    if (!view.orthographic_height) {
        const Footprint at = Projector(view)(point);
        return {at.left, at.top};
    }
    const CameraFrame frame = camera_frame(view);
    const double px = view.height / *view.orthographic_height;
    return {view.width / 2.0 + px * glm::dot(point - view.eye, frame.right),
            view.height / 2.0 - px * glm::dot(point - view.eye, frame.up)};
}

TEST(ViewFromMatrices, ShowsPointsWhereTheMatricesDo) {
    std::mt19937_64 random(3);
    int seen = 0;
    for (int i = 0; i < 400; ++i) {
        const Matrices m = random_matrices(random, i % 2 == 1);
        const auto view = require(view_from_matrices(m.view, m.projection, 800, 600));
        EXPECT_EQ(view->orthographic_height.has_value(), i % 2 == 1);
        for (int k = 0; k < 20; ++k) {
            const glm::dvec3 point = 5.0 * random_direction(random);
            const glm::dvec4 clip = m.projection * m.view * glm::dvec4(point, 1);
            if (!(clip.w > 0.1)) continue;
            const glm::dvec2 expected((clip.x / clip.w + 1) * 400, (1 - clip.y / clip.w) * 300);
            const glm::dvec2 at = shown_at(*view, point);
            const double tolerance_px = 1e-8 * (1 + glm::length(expected));
            EXPECT_NEAR(at.x, expected.x, tolerance_px);
            EXPECT_NEAR(at.y, expected.y, tolerance_px);
            ++seen;
        }
    }
    EXPECT_GT(seen, 2000);
}

TEST(ViewFromMatrices, IsTheViewThatTheyAreOf) {
    const glm::dmat4 view = glm::lookAt(glm::dvec3(1, 2, 3), glm::dvec3(0, 0, 0), glm::dvec3(0, 1, 0));
    const auto made = require(view_from_matrices(view, glm::perspective(0.7, 2.0, 0.1, 10.0), 640, 320));
    EXPECT_NEAR(glm::length(made->eye - glm::dvec3(1, 2, 3)), 0, 1e-12);
    EXPECT_NEAR(made->fov_y_degrees, 0.7 * 180 / std::numbers::pi, 1e-12);
    EXPECT_EQ(made->shift, glm::dvec2(0));
    // The same in floats, with reversed infinite depth, and as a multiple of itself.
    glm::dmat4 reversed(0);
    reversed[0][0] = 1 / (2 * std::tan(0.35)), reversed[1][1] = 1 / std::tan(0.35), reversed[2][3] = -1;
    reversed[3][2] = 0.1;
    const auto other =
        require(view_from_matrices(glm::dmat4(glm::mat4(view)), 3.0 * glm::dmat4(glm::mat4(reversed)), 640, 320));
    EXPECT_NEAR(glm::length(other->eye - made->eye), 0, 1e-5);
    EXPECT_NEAR(other->fov_y_degrees, made->fov_y_degrees, 1e-4);
}

TEST(ViewFromMatrices, RefusesWhatIsNoCameraAndSaysWhatToDo) {
    const glm::dmat4 view = glm::lookAt(glm::dvec3(1, 2, 3), glm::dvec3(0), glm::dvec3(0, 1, 0));
    const glm::dmat4 perspective = glm::perspective(0.7, 1.0, 0.1, 10.0), ortho = glm::ortho(-1.0, 1.0, -1.0, 1.0);
    const auto with = [](glm::dmat4 m, int column, int row, double value) {
        m[column][row] = value;
        return m;
    };
    const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
    const auto scaled = [](double x, double y, double z) { return glm::scale(glm::dmat4(1), glm::dvec3(x, y, z)); };
    struct Fault {
        const char* says;
        glm::dmat4 view, projection;
    };
    const std::vector<Fault> faults = {
        {"view matrix must be finite", with(view, 3, 0, nan), perspective},
        {"view matrix must be finite", with(view, 0, 0, inf), perspective},
        {"view matrix is singular", scaled(1, 0, 1), perspective},
        {"view matrix mirrors", scaled(-1, 1, 1) * view, perspective},
        {"scales or shears", scaled(2, 2, 2) * view, perspective},
        {"scales or shears", with(glm::dmat4(1), 1, 0, 0.5), perspective},
        {"last row of the view matrix", perspective, perspective},
        {"last row of the view matrix", glm::transpose(view), perspective},
        {"projection matrix must be finite", view, with(perspective, 1, 1, nan)},
        {"projection matrix is singular", view, glm::dmat4(0)},
        {"projection matrix is singular", view, with(perspective, 0, 0, 0)},
        {"projection matrix is singular", view, with(perspective, 3, 2, 0)},
        {"projection matrix is singular", view, with(ortho, 2, 2, 0)},
        {"looks along +z", view, glm::perspectiveLH(0.7, 1.0, 0.1, 10.0)},
        {"mirrors the picture", view, scaled(1, -1, 1) * perspective},
        {"mirrors the picture", view, scaled(-1, 1, 1) * perspective},
        {"mirrors the picture", view, scaled(1, -1, 1) * ortho},
        {"last row of the projection matrix", view, perspective * view},
        {"turns or shears", view, with(perspective, 1, 0, 0.4)},
        {"turns or shears", view, with(ortho, 2, 0, 0.4)},
        {"not be square", view, glm::perspective(0.7, 1.5, 0.1, 10.0)},
        {"not be square", view, glm::ortho(-2.0, 2.0, -1.0, 1.0)},
    };
    for (const auto& [says, of_view, projection] : faults) {
        const auto made = view_from_matrices(of_view, projection, 500, 500);
        ASSERT_FALSE(made) << says;
        EXPECT_NE(made.error().message.find(says), std::string::npos) << made.error().message << " for: " << says;
    }
    EXPECT_FALSE(view_from_matrices(view, perspective, 0, 500));
    EXPECT_TRUE(view_from_matrices(view, perspective, 500, 500));
    EXPECT_TRUE(view_from_matrices(view, ortho, 500, 500));
}

TEST(View, RefusesShiftsAndHeightsThatAreNone) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(validate({.shift = {0.5, -2}}));
    EXPECT_FALSE(validate({.shift = {nan, 0}}));
    EXPECT_FALSE(validate({.shift = {0, 1e9}}));
    EXPECT_TRUE(validate({.orthographic_height = 2}));
    for (const double none : {0.0, -1.0, nan, std::numeric_limits<double>::infinity()})
        EXPECT_FALSE(validate({.orthographic_height = none}));
    EXPECT_FALSE(validate({.shift = {1, 0}, .orthographic_height = 2}));
    EXPECT_FALSE(validate_perspective({.orthographic_height = 2}, "This"));
    EXPECT_TRUE(validate_perspective({.shift = {1, 0}}, "This"));
}

} // namespace unseen::vdtree::view_test
