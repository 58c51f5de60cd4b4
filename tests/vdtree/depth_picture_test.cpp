// What a picture's depths hide, against points between others, looked up one by one.
#include <unseen/vdtree/depth_picture.h>
#include <unseen/vdtree/internal/footprint.h>

#include <set>

#include <unseen/vdtree/cut.h>

#include "built.h"
#include "shapes.h"
#include "testing.h"

namespace unseen::vdtree::depth_picture_test {

constexpr float infinity = std::numeric_limits<float>::infinity();

View small_view() {
    View view;
    view.eye = {1, 2, 10};
    view.target = {0.3, 1, 0};
    view.up = {0.2, 1, 0.1};
    view.fov_y_degrees = 50;
    view.width = 61, view.height = 43;
    return view;
}

// Plates at two depths in a random pattern of blocks, and holes.
std::vector<float> blocks(const View& view, std::mt19937_64& random) {
    std::vector<float> depth(static_cast<std::size_t>(view.width * view.height));
    std::vector<float> block(64);
    for (float& d : block) d = random() % 4 == 0 ? infinity : random() % 2 ? 4.0f : 8.0f;
    for (int y = 0; y < view.height; ++y)
        for (int x = 0; x < view.width; ++x)
            depth[static_cast<std::size_t>(y * view.width + x)] = block[static_cast<std::size_t>(y / 12 * 8 + x / 8)];
    return depth;
}

// Whether a point is beside the window or behind what is shown at its pixel.
bool is_hidden(const View& view, const std::vector<float>& depth, glm::dvec3 point) {
    const CameraFrame camera = camera_frame(view);
    const glm::dvec3 p = point - view.eye;
    const double along = -glm::dot(p, camera.back);
    if (!(along > 0)) return false;
    const double focal = view.height / (2 * std::tan(view.fov_y_degrees * std::numbers::pi / 360));
    const double x = std::floor(0.5 * view.width + focal * glm::dot(p, camera.right) / along),
                 y = std::floor(0.5 * view.height - focal * glm::dot(p, camera.up) / along);
    if (x < 0 || y < 0 || x >= view.width || y >= view.height) return true;
    return static_cast<double>(depth[static_cast<std::size_t>(y) * static_cast<std::size_t>(view.width) +
                                     static_cast<std::size_t>(x)]) < along;
}

// So many places around one.
std::vector<glm::dvec3> random_places(std::mt19937_64& random, int count) {
    const glm::dvec3 centre(shapes::random_between(random, -6, 6), shapes::random_between(random, -5, 6),
                            shapes::random_between(random, -8, 10));
    const double radius = std::exp2(shapes::random_between(random, -6, 1));
    std::vector<glm::dvec3> places;
    for (int i = 0; i < count; ++i) places.push_back(centre + radius * shapes::random_direction(random));
    return places;
}

Footprint footprint_of(const DepthPicture& picture, std::span<const glm::dvec3> places) {
    Footprint all;
    const Projector project(picture.view());
    for (const glm::dvec3& place : places) all.add(project(place));
    return all;
}

TEST(DepthPicture, HidesOnlyWhatIsHiddenBetweenAllPoints) {
    std::mt19937_64 random(3);
    const View view = small_view();
    int hidden = 0, seen = 0;
    for (int trial = 0; trial < 4000; ++trial) {
        const std::vector<float> depth = blocks(view, random);
        const DepthPicture picture = *DepthPicture::create(view, depth);
        const auto places = random_places(random, 4);
        if (!picture.hides(footprint_of(picture, places))) {
            ++seen;
            continue;
        }
        ++hidden;
        for (int i = 0; i < 100; ++i) {
            glm::dvec3 between(0);
            double left = 1;
            for (std::size_t k = 0; k < places.size(); ++k) {
                const double share = k + 1 < places.size() ? left * shapes::random_between(random, 0, 1) : left;
                between += share * places[k];
                left -= share;
            }
            ASSERT_TRUE(is_hidden(view, depth, between)) << "trial " << trial;
        }
    }
    EXPECT_GT(hidden, 500);
    EXPECT_GT(seen, 500);
}

TEST(DepthPicture, WhatHoldsWhatIsSeenIsSeen) {
    std::mt19937_64 random(4);
    const View view = small_view();
    const DepthPicture picture = *DepthPicture::create(view, blocks(view, random));
    for (int trial = 0; trial < 20000; ++trial) {
        const auto places = random_places(random, 4);
        if (picture.hides(footprint_of(picture, places)))
            ASSERT_TRUE(picture.hides(footprint_of(picture, std::span(places).first(2)))) << trial;
    }
}

TEST(DepthPicture, FoldsWhatIsBehindAPlate) {
    const VertexTree tree = support::built(shapes::icosphere(5));
    View view;
    view.eye = {0, 0, 6};
    view.fov_y_degrees = 30;
    view.width = view.height = 64;
    const DistanceCriterion extent = *extent_criterion(tree, view, 0.01);
    const Viewpoint viewpoint{.eye = view.eye - tree.origin()};
    Cut whole(tree);
    ASSERT_TRUE(whole.follow(extent, viewpoint));
    // Left half covered by a plate before the ball.
    std::vector<float> depth(64 * 64, infinity);
    for (std::size_t i = 0; i < depth.size(); ++i)
        if (i % 64 < 32) depth[i] = 3;
    const auto hidden = require(find_hidden(tree, {}, *DepthPicture::create(view, depth)));
    const auto criterion = require(folding_hidden(tree, extent, *hidden));
    EXPECT_TRUE(criterion->is_monotone());
    Cut half(tree);
    ASSERT_TRUE(half.follow(*criterion, viewpoint));
    EXPECT_LT(half.triangle_count(), 0.65 * whole.triangle_count());
    EXPECT_GT(half.triangle_count(), 0.45 * whole.triangle_count());
    for (Index leaf = 0; leaf < tree.leaf_count(); ++leaf) {
        const NodeId place = tree.place_of_leaf(leaf);
        if (tree.position(place).x + tree.origin().x > 0.05) ASSERT_TRUE(half.is_active(place)) << leaf;
    }
}

// Rough balls behind plates with holes, from several sides.
TEST(DepthPicture, WhatFoldsStaysHidden) {
    const Mesh ball = shapes::bumpy_sphere(4, 0.05);
    const VertexTree tree = support::built(shapes::together(ball, shapes::placed(ball, 0.5, {0.9, 0.1, 0.8})));
    std::mt19937_64 random(5);
    for (int trial = 0; trial < 6; ++trial) {
        View view;
        view.eye = 7.0 * shapes::random_direction(random);
        view.fov_y_degrees = 25;
        view.width = 90, view.height = 80;
        const std::vector<float> depth = blocks(view, random);
        const DepthPicture picture = *DepthPicture::create(view, depth);
        const auto hidden = require(find_hidden(tree, {}, picture));
        // Nothing but what is hidden folds.
        const DistanceCriterion never = *extent_criterion(tree, view, 1e-9);
        const auto criterion = require(folding_hidden(tree, never, *hidden));
        Cut cut(tree);
        ASSERT_TRUE(cut.follow(*criterion, {.eye = view.eye - tree.origin()}));
        EXPECT_LT(cut.triangle_count(), tree.triangle_count()) << trial;
        const Mesh mesh = extract_mesh(cut);
        const Projector project(view);
        std::set<std::array<double, 9>> original;
        const auto key = [](const Mesh& of, const Triangle& t) {
            std::array<double, 9> all{};
            for (std::size_t k = 0; k < 3; ++k)
                for (std::size_t axis = 0; axis < 3; ++axis)
                    all[3 * k + axis] = of.positions[t[k]][static_cast<glm::length_t>(axis)];
            return all;
        };
        Cut whole(tree);
        whole.unfold_all();
        const Mesh full = extract_mesh(whole);
        for (const Triangle& t : full.triangles) original.insert(key(full, t));
        int others = 0;
        for (const Triangle& t : mesh.triangles) {
            if (original.contains(key(mesh, t))) continue;
            ++others;
            for (int i = 0; i < 30; ++i) {
                const double u = shapes::random_between(random, 0, 1), v = shapes::random_between(random, 0, 1 - u);
                const glm::dvec3 point = (1 - u - v) * glm::dvec3(mesh.positions[t[0]]) +
                                         u * glm::dvec3(mesh.positions[t[1]]) + v * glm::dvec3(mesh.positions[t[2]]);
                ASSERT_TRUE(is_hidden(view, depth, point)) << trial;
            }
        }
        EXPECT_GT(others, 0) << trial;
    }
}

TEST(DepthPicture, ShowsADiscOfABall) {
    const VertexTree tree = support::built(shapes::icosphere(5));
    View view;
    view.eye = {0, 0, 40};
    view.fov_y_degrees = 4;
    view.width = view.height = 256;
    const double focal = 128 / std::tan(2 * std::numbers::pi / 180), radius = focal / std::sqrt(40.0 * 40 - 1);
    const double disc = std::numbers::pi * radius * radius, circle = 2 * std::numbers::pi * radius;
    for (const bool is_covered : {false, true}) { // its left half, by a plate
        std::vector<float> depth(256 * 256, infinity);
        for (int y = 0; y < 256; ++y)
            for (int x = 0; x < 256; ++x) {
                const glm::dvec2 at = glm::dvec2(x - 127.5, y - 127.5) / focal * 40.0;
                float& here = depth[static_cast<std::size_t>(256 * y + x)];
                if (glm::dot(at, at) < 1) here = static_cast<float>(40 - std::sqrt(1 - glm::dot(at, at)));
                if (is_covered && x < 128) here = 20;
            }
        const DepthPicture picture = *DepthPicture::create(view, depth);
        for (const bool only_front : {true, false}) { // the back is behind the front
            const auto shown = require(find_shown(tree, {}, picture, only_front));
            const double share = is_covered ? 0.5 : 1;
            EXPECT_NEAR(shown->area[0], share * disc, 0.05 * disc) << only_front;
            EXPECT_NEAR(shown->outline[0], share * circle, 0.06 * circle);
            for (NodeId node = 0; node < tree.interior_count(); ++node) {
                const Sphere& support = tree.support_spheres()[node];
                if (support.centre.z + tree.origin().z + static_cast<double>(support.radius) < -0.2)
                    EXPECT_EQ(shown->area[node] + shown->outline[node], 0) << node;
            }
        }
    }
}

TEST(DepthPicture, RefusesWhatIsNone) {
    const View view = small_view();
    std::vector<float> depth(static_cast<std::size_t>(view.width * view.height), 1.0f);
    EXPECT_TRUE(DepthPicture::create(view, depth));
    EXPECT_FALSE(DepthPicture::create(view, std::span(depth).first(5)));
    for (const float bad : {0.0f, -1.0f, std::nanf("")}) {
        depth[7] = bad;
        const auto none = DepthPicture::create(view, depth);
        ASSERT_FALSE(none);
        EXPECT_NE(none.error().message.find("pixel 7"), std::string::npos);
    }
    const VertexTree tree = support::built(shapes::icosphere(2)), other = support::built(shapes::icosphere(3));
    const DistanceCriterion extent = *extent_criterion(tree, view, 1);
    EXPECT_FALSE(folding_hidden(other, extent, std::vector<std::uint64_t>((other.interior_count() + 63) / 64)));
    EXPECT_FALSE(folding_hidden(tree, extent, {}));
}

} // namespace unseen::vdtree::depth_picture_test
