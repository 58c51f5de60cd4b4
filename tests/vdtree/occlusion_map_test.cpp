// What a picture hides from eyes near it, against lines of sight from such eyes.
#include <unseen/vdtree/occlusion_map.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/depth_picture.h>

#include "built.h"
#include "shapes.h"

namespace unseen::vdtree::occlusion_map_test {
namespace {

using shapes::random_between;

View looking_down_z() {
    View view;
    view.eye = {0.3, -0.2, 10};
    view.target = {0.5, 0.1, 0};
    view.up = {0.1, 1, 0};
    view.fov_y_degrees = 60;
    view.width = 200, view.height = 150;
    return view;
}

// A rectangle that faces +Z.
struct Plate {
    glm::dvec2 low, high;
    double z;

    // Where along the line from `eye` in the direction it is met; infinite: nowhere ahead.
    double meets(glm::dvec3 eye, glm::dvec3 direction) const {
        constexpr double nowhere = std::numeric_limits<double>::infinity();
        if (!(std::abs(direction.z) > 0)) return nowhere;
        const double t = (z - eye.z) / direction.z;
        const glm::dvec3 p = eye + t * direction;
        const bool hits = t > 0 && p.x >= low.x && p.x <= high.x && p.y >= low.y && p.y <= high.y;
        return hits ? t : nowhere;
    }
};

std::vector<Plate> random_plates(std::mt19937_64& random) {
    std::vector<Plate> plates;
    const int count = 2 + static_cast<int>(random() % 12);
    for (int i = 0; i < count; ++i) {
        const glm::dvec2 low(random_between(random, -6, 4), random_between(random, -5, 3));
        const glm::dvec2 size(std::exp2(random_between(random, -2, 3)), std::exp2(random_between(random, -2, 3)));
        plates.push_back({low, low + size, random_between(random, -4, 8)});
    }
    return plates;
}

// Reciprocal distances along the view's axis, some samples a pixel.
struct Depths {
    static constexpr int a_side = 4;
    int width, height; // samples
    std::vector<double> reciprocal;

    Depths(const View& view, const std::vector<Plate>& plates)
        : width(view.width * a_side), height(view.height * a_side),
          reciprocal(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
        const CameraFrame camera = camera_frame(view);
        const double f = view.height / (2 * std::tan(view.fov_y_degrees * std::numbers::pi / 360));
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
                const double px = (x + 0.5) / a_side - 0.5 * view.width, py = 0.5 * view.height - (y + 0.5) / a_side;
                const glm::dvec3 direction = px / f * camera.right + py / f * camera.up - camera.back;
                double nearest = std::numeric_limits<double>::infinity();
                for (const Plate& plate : plates) nearest = std::min(nearest, plate.meets(view.eye, direction));
                at(x, y) = 1 / nearest;
            }
    }
    double& at(int x, int y) { return reciprocal[static_cast<std::size_t>(y * width + x)]; }

    DepthCells cells(const View& view, int cell_px) {
        DepthCells cells{cell_px, (view.width + cell_px - 1) / cell_px, (view.height + cell_px - 1) / cell_px, {}, {},
                         {}};
        for (int row = 0; row < cells.rows; ++row)
            for (int column = 0; column < cells.columns; ++column) {
                double least = 1e9, most = 0, jump = 0;
                const int side = cell_px * a_side;
                for (int y = row * side; y < std::min((row + 1) * side, height); ++y)
                    for (int x = column * side; x < std::min((column + 1) * side, width); ++x) {
                        least = std::min(least, at(x, y)), most = std::max(most, at(x, y));
                        for (const int step : {-a_side, a_side}) {
                            if (x + step >= 0 && x + step < width)
                                jump = std::max(jump, std::abs(at(x, y) - at(x + step, y)));
                            if (y + step >= 0 && y + step < height)
                                jump = std::max(jump, std::abs(at(x, y) - at(x, y + step)));
                        }
                    }
                cells.least.push_back(static_cast<float>(least));
                cells.most.push_back(static_cast<float>(most));
                cells.jump.push_back(static_cast<float>(jump));
            }
        return cells;
    }
};

bool is_seen(const std::vector<Plate>& plates, glm::dvec3 eye, glm::dvec3 place) {
    for (const Plate& plate : plates)
        if (plate.meets(eye, place - eye) < 1) return false;
    return true;
}

glm::dvec3 random_within(std::mt19937_64& random, glm::dvec3 centre, double radius) {
    return centre + radius * std::cbrt(random_between(random, 0, 1)) * shapes::random_direction(random);
}

TEST(OcclusionMap, HidesFromAllEyesWithinReach) {
    std::mt19937_64 random(17);
    const View view = looking_down_z();
    int hidden = 0, of_one_eye = 0, seen_by_others = 0;
    for (int trial = 0; trial < 60; ++trial) {
        const auto plates = random_plates(random);
        Depths depths(view, plates);
        const double reach = trial % 3 == 0 ? 0.02 : trial % 3 == 1 ? 0.1 : 0.3;
        // Standing, walking ahead, and aside.
        const glm::dvec3 along = trial / 3 % 3 == 0   ? glm::dvec3(0)
                                 : trial / 3 % 3 == 1 ? glm::dvec3(0.05, 0.02, -0.4)
                                                      : glm::dvec3(0.2, -0.1, 0.1);
        const auto map = OcclusionMap::create(view, depths.cells(view, 4), {along, reach});
        ASSERT_TRUE(map) << map.error().message;
        for (int i = 0; i < 400; ++i) {
            const glm::dvec3 centre(random_between(random, -6, 6), random_between(random, -5, 5),
                                    random_between(random, -14, 6));
            const double radius = std::exp2(random_between(random, -7, 0));
            const bool is_hidden = map->hides(centre, radius);
            hidden += is_hidden;
            bool is_hidden_here = true, is_seen_elsewhere = false;
            for (int k = 0; k < 60; ++k) {
                const glm::dvec3 place = random_within(random, centre, radius),
                                 eye = random_within(random, view.eye + random_between(random, 0, 1) * along, reach);
                ASSERT_TRUE(map->holds_for(eye));
                is_hidden_here = is_hidden_here && !is_seen(plates, view.eye, place);
                is_seen_elsewhere = is_seen_elsewhere || is_seen(plates, eye, place);
            }
            ASSERT_FALSE(is_hidden && is_seen_elsewhere) << "trial " << trial << ", ball " << i;
            of_one_eye += is_hidden_here;
            seen_by_others += is_hidden_here && is_seen_elsewhere;
        }
    }
    EXPECT_GT(hidden, 1500);
    EXPECT_GT(hidden, of_one_eye / 4); // balls of which random places of 60 were hidden
    EXPECT_GT(seen_by_others, 100);    // what the one eye's picture would have hidden
}

TEST(OcclusionMap, AGapThatOpensIsAHole) {
    // Two plates whose edges meet in the picture, one behind the other.
    View view = looking_down_z();
    view.eye = {0, 0, 10}, view.target = {0, 0, 0}, view.up = {0, 1, 0};
    const std::vector<Plate> plates = {{{-20, -20}, {0, 20}, 5}, {{0, -20}, {20, 20}, 0}};
    Depths depths(view, plates);
    const glm::dvec3 behind(-0.2, 0, -5);
    ASSERT_FALSE(is_seen(plates, view.eye, behind));
    ASSERT_TRUE(is_seen(plates, {0.2, 0, 10}, behind));
    EXPECT_TRUE(OcclusionMap::create(view, depths.cells(view, 4), {.around = 0})->hides(behind, 0.05));
    EXPECT_FALSE(OcclusionMap::create(view, depths.cells(view, 4), {.around = 0.2})->hides(behind, 0.05));
    // Far from the edge both hide.
    EXPECT_TRUE(OcclusionMap::create(view, depths.cells(view, 4), {.around = 0.2})->hides({2, 0, -5}, 0.05));
    EXPECT_TRUE(OcclusionMap::create(view, depths.cells(view, 4), {.around = 0.2})->hides({-3, 0, -5}, 0.05));
}

TEST(OcclusionMap, NothingIsHiddenBesideTheWindowOrBehindTheEye) {
    View view = looking_down_z();
    const std::vector<Plate> wall = {{{-100, -100}, {100, 100}, 5}};
    Depths depths(view, wall);
    const auto map = *OcclusionMap::create(view, depths.cells(view, 4), {.around = 0.1});
    EXPECT_TRUE(map.hides({0, 0, 0}, 0.5));
    EXPECT_FALSE(map.hides({0, 0, 20}, 0.5));
    EXPECT_FALSE(map.hides({0, 0, 10}, 0.5));
    EXPECT_FALSE(map.hides({90, 0, 0}, 0.5));
    EXPECT_FALSE(map.hides({0, 0, 7}, 0.5)); // before the wall
    EXPECT_FALSE(map.hides({0, 0, 5}, 0.5)); // through it
    EXPECT_FALSE(map.hides(glm::dvec3(std::numeric_limits<double>::quiet_NaN()), 0.5));
    EXPECT_FALSE(map.hides({0, 0, 0}, std::numeric_limits<double>::quiet_NaN()));
    EXPECT_FALSE(map.hides({0, 0, 0}, std::numeric_limits<double>::infinity()));
    EXPECT_TRUE(map.holds_for(view.eye + glm::dvec3(0.05)));
    EXPECT_FALSE(map.holds_for(view.eye + glm::dvec3(0.1)));
    EXPECT_FALSE(map.holds_for(glm::dvec3(std::numeric_limits<double>::quiet_NaN())));
    const auto ahead = *OcclusionMap::create(view, depths.cells(view, 4), {{0, 0, -1}, 0.1});
    EXPECT_TRUE(ahead.holds_for(view.eye - glm::dvec3(0.05, 0, 1)));
    EXPECT_FALSE(ahead.holds_for(view.eye + glm::dvec3(0, 0, 0.2)));
    EXPECT_FALSE(ahead.holds_for(view.eye - glm::dvec3(0, 0, 1.2)));
    EXPECT_FALSE(OcclusionMap::create(view, depths.cells(view, 4), {{0, 0, -8}, 0.1})->hides({0, 0, 0}, 0.5));
}

TEST(OcclusionMap, BadCellsAreRefused) {
    const View view = looking_down_z();
    const std::vector<Plate> wall = {{{-100, -100}, {100, 100}, 5}};
    const DepthCells good = Depths(view, wall).cells(view, 8);
    ASSERT_TRUE(OcclusionMap::create(view, good, {.around = 0.1}));
    EXPECT_FALSE(OcclusionMap::create(view, good, {.around = -1}));
    EXPECT_FALSE(OcclusionMap::create(view, good, {.around = std::numeric_limits<double>::quiet_NaN()}));
    DepthCells few = good;
    few.columns -= 1;
    EXPECT_FALSE(OcclusionMap::create(view, few, {.around = 0.1}));
    for (std::vector<float> DepthCells::*values : {&DepthCells::least, &DepthCells::most, &DepthCells::jump})
        for (const float bad :
             {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -1.0f}) {
            DepthCells cells = good;
            (cells.*values)[5] = bad;
            const auto made = OcclusionMap::create(view, cells, {.around = 0.1});
            ASSERT_FALSE(made);
            EXPECT_NE(made.error().message.find("Cell 5 "), std::string::npos) << made.error().message;
        }
}

// The nodes of a ball behind a wall fold, and a cut that follows what is hidden is that from scratch.
TEST(OcclusionMap, CutsFollowWhatIsHidden) {
    const VertexTree tree = support::built(shapes::icosphere(5));
    View view = looking_down_z();
    view.target = {0, 0, 0};
    const Similarity placement{.scale = 2};
    const auto criterion = extent_criterion(tree, view, 1);
    ASSERT_TRUE(criterion);
    Cut followed(tree);
    std::mt19937_64 random(5);
    Viewpoint viewpoint;
    int times_hidden = 0;
    for (int frame = 0; frame < 60; ++frame) {
        view.eye += glm::dvec3(0.02, 0.01, -0.01);
        viewpoint.eye = placement.to_mesh(view.eye) - tree.origin();
        if (frame % 5 == 1) {
            Depths depths(view, random_plates(random));
            const auto found =
                find_hidden(tree, placement, *OcclusionMap::create(view, depths.cells(view, 4), {.around = 0.05}));
            ASSERT_TRUE(found);
            viewpoint.hidden = *found;
            times_hidden += *found != nullptr;
        }
        if (frame % 11 == 10) viewpoint.hidden = nullptr;
        if (viewpoint.hidden) {
            for (NodeId node = 0; node < tree.interior_count(); ++node)
                if ((*viewpoint.hidden)[node / 64] >> (node % 64) & 1)
                    tree.for_each_child(node, [&](NodeId child) {
                        EXPECT_TRUE(tree.is_leaf(child) || ((*viewpoint.hidden)[child / 64] >> (child % 64) & 1));
                    });
        }
        for (const auto budget : {std::optional<Index>(), std::optional<Index>(900)}) {
            if (budget && frame % 7 != 0) continue;
            FollowOptions options;
            options.triangle_budget = budget;
            Cut fresh(tree);
            ASSERT_TRUE(followed.follow(*criterion, viewpoint, options));
            ASSERT_TRUE(fresh.follow(*criterion, viewpoint, options));
            EXPECT_EQ(followed.triangle_count(), fresh.triangle_count()) << "frame " << frame;
            for (NodeId node = 0; node < tree.interior_count(); ++node) {
                ASSERT_EQ(followed.is_unfolded(node), fresh.is_unfolded(node))
                    << "frame " << frame << ", node " << node;
                if (viewpoint.hidden && !budget) {
                    ASSERT_FALSE(fresh.is_unfolded(node) && ((*viewpoint.hidden)[node / 64] >> (node % 64) & 1));
                }
            }
        }
    }
    EXPECT_GT(times_hidden, 3);
    // A few tests, not all, where little changes.
    viewpoint.hidden = nullptr;
    ASSERT_TRUE(followed.follow(*criterion, viewpoint));
    viewpoint.eye.x += 1e-6;
    ASSERT_TRUE(followed.follow(*criterion, viewpoint));
    auto one = std::make_shared<std::vector<std::uint64_t>>((tree.interior_count() + 63) / 64, 0);
    const NodeId last = tree.interior_count() - 1;
    (*one)[last / 64] |= std::uint64_t{1} << (last % 64);
    viewpoint.hidden = one;
    const auto stats = followed.follow(*criterion, viewpoint);
    ASSERT_TRUE(stats);
    EXPECT_LT(stats->node_tests, 20u);
    viewpoint.hidden = std::make_shared<const std::vector<std::uint64_t>>(1, 0);
    EXPECT_FALSE(followed.follow(*criterion, viewpoint));
}

} // namespace
} // namespace unseen::vdtree::occlusion_map_test
