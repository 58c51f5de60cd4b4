// Cells of depth against the depth of each pixel, sample by sample.
#include <unseen/render/depth_cells.h>

#include "gl_test.h"
#include "scenes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <unseen/render/sample_sum.h>
#include <unseen/render/target.h>
#include <unseen/vdtree/cut.h>

namespace depth_cells_test {

using namespace unseen::render;
using namespace unseen::render::testing;
using unseen::vdtree::DepthCells;
using unseen::vdtree::View;

class DepthCellsTest : public GlTest {
protected:
    // Two cubes, one before the other, and beside them the background.
    std::vector<Item> two_cubes() {
        auto tree = GpuTree::create(context(), scene_.tree);
        EXPECT_TRUE(tree);
        GpuCut cut(*tree);
        EXPECT_TRUE(cut.follow(scene_.cut));
        std::vector<Item> items(2, Item{cut});
        items[1].placement.translation = {1.2, 0.7, -3};
        return items;
    }
    static View view() {
        View view = frontal_view(101, 67);
        view.eye = {1.5, 2, 6};
        view.fov_y_degrees = 45;
        return view;
    }
    Scene scene_{cube()};
};

// What cells are, from pixels that are read one draw after the other.
DepthCells by_pixels(const unseen::render::Context& context, const std::vector<Item>& items, const View& view,
                     int cell_px, int samples) {
    DepthCells cells{cell_px, (view.width + cell_px - 1) / cell_px, (view.height + cell_px - 1) / cell_px, {}, {}, {}};
    const auto count = static_cast<std::size_t>(cells.columns * cells.rows);
    cells.least.assign(count, std::numeric_limits<float>::infinity());
    cells.most.assign(count, 0);
    cells.jump.assign(count, 0);
    auto target = Target::create(context, view.width, view.height, {.colours = {}});
    const double near = *near_plane(items, view);
    for (const glm::dvec2 point : n_rooks(samples, 1)) {
        EXPECT_TRUE(draw(items, {view, point, near}, *target, {.colour = std::nullopt}));
        const auto depth = *read_depth(*target);
        const auto at = [&](int x, int y) {
            return depth[static_cast<std::size_t>(y * view.width + x)] / static_cast<float>(near);
        };
        for (int y = 0; y < view.height; ++y)
            for (int x = 0; x < view.width; ++x) {
                const auto cell = static_cast<std::size_t>(y / cell_px * cells.columns + x / cell_px);
                cells.least[cell] = std::min(cells.least[cell], at(x, y));
                cells.most[cell] = std::max(cells.most[cell], at(x, y));
                const glm::ivec2 neighbours[] = {{x - 1, y}, {x + 1, y}, {x, y - 1}, {x, y + 1}};
                for (const glm::ivec2 n : neighbours)
                    if (n.x >= 0 && n.y >= 0 && n.x < view.width && n.y < view.height)
                        cells.jump[cell] = std::max(cells.jump[cell], std::abs(at(x, y) - at(n.x, n.y)));
            }
    }
    return cells;
}

TEST_F(DepthCellsTest, AreTheExtremesOfTheirPixels) {
    const auto items = two_cubes();
    for (const int cell_px : {1, 4, 7}) {
        auto reader = DepthCellReader::create(context(), view().width, view().height, cell_px);
        ASSERT_TRUE(reader) << reader.error().message;
        for (const int samples : {1, 3}) {
            EXPECT_FALSE(reader->is_under_way());
            ASSERT_TRUE(reader->begin(items, view(), samples));
            EXPECT_TRUE(reader->is_under_way());
            const auto cells = reader->take(true);
            ASSERT_TRUE(cells) << cells.error().message;
            ASSERT_TRUE(*cells);
            const DepthCells expected = by_pixels(context(), items, view(), cell_px, samples);
            ASSERT_EQ((*cells)->columns, expected.columns);
            ASSERT_EQ((*cells)->rows, expected.rows);
            int background = 0, edges = 0;
            for (std::size_t i = 0; i < expected.least.size(); ++i) {
                constexpr float rounding = 1e-6f; // of a product, 1 / m
                ASSERT_NEAR((*cells)->least[i], expected.least[i], rounding) << i;
                ASSERT_NEAR((*cells)->most[i], expected.most[i], rounding) << i;
                ASSERT_NEAR((*cells)->jump[i], expected.jump[i], rounding) << i;
                background += expected.most[i] == 0;
                edges += expected.jump[i] > 0.01f;
            }
            EXPECT_GT(background, 10);
            EXPECT_GT(edges, 10);
            EXPECT_TRUE(unseen::vdtree::OcclusionMap::create(view(), **cells, {.around = 0.1}));
        }
    }
}

TEST_F(DepthCellsTest, AreGivenOnceAndOfTheLastPicture) {
    const auto items = two_cubes();
    auto reader = *DepthCellReader::create(context(), view().width, view().height);
    EXPECT_FALSE(*reader.take(true)); // nothing was begun
    ASSERT_TRUE(reader.begin(items, view(), 1));
    ASSERT_TRUE(reader.begin({}, view(), 1)); // in place of the first
    const auto cells = reader.take(true);
    ASSERT_TRUE(cells && *cells);
    EXPECT_TRUE(std::ranges::all_of((*cells)->most, [](float x) { return x == 0; }));
    EXPECT_FALSE(reader.is_under_way());
    EXPECT_FALSE(*reader.take(true));
    // Without waiting it comes as well, sooner or later.
    ASSERT_TRUE(reader.begin(items, view(), 1));
    std::optional<DepthCells> later;
    for (int i = 0; i < 1'000'000 && !later; ++i) later = *reader.take();
    EXPECT_TRUE(later);
}

TEST_F(DepthCellsTest, RefuseWhatIsNone) {
    EXPECT_FALSE(DepthCellReader::create(context(), 64, 64, 0));
    EXPECT_FALSE(DepthCellReader::create(context(), 64, 64, 65));
    EXPECT_FALSE(DepthCellReader::create(context(), 0, 64));
    auto reader = *DepthCellReader::create(context(), 64, 64);
    EXPECT_FALSE(reader.begin(two_cubes(), view(), 1));
    View small = view();
    small.width = small.height = 64;
    EXPECT_FALSE(reader.begin(two_cubes(), small, 0));
    EXPECT_TRUE(reader.begin(two_cubes(), small, 1));
}

} // namespace depth_cells_test
