// Counts of pixels that look different: only what shows, only from the threshold on, and a frame late.
#include "gl_test.h"
#include "scenes.h"

#include <unseen/render/internal/difference_count.h>
#include <unseen/render/internal/stage_times.h>

namespace difference_count_test {

using namespace unseen::render;
using namespace unseen::render::testing;
using DifferenceCountTest = unseen::render::testing::GlTest;

constexpr int side = 32;

class Wall {
public:
    Wall(const Context& context, double z, float luminance, glm::dvec2 low = {-1, -1}, glm::dvec2 high = {1, 1})
        : scene_(rectangle(low, high, z, grey(luminance))), tree_(*GpuTree::create(context, scene_.tree)) {
        GpuCut cut(tree_);
        EXPECT_TRUE(cut.follow(scene_.cut));
        item_ = std::make_unique<Item>(Item{cut});
    }
    const Item& item() const { return *item_; }

private:
    Scene scene_;
    GpuTree tree_;
    std::unique_ptr<Item> item_;
};

LuminanceImage image(const Context& context, int width, int height, float value) {
    return *LuminanceImage::create(context, width, height,
                                   std::vector<float>(static_cast<std::size_t>(width * height), value));
}

class Counting {
public:
    explicit Counting(const Context& context)
        : context_(context), counts_(*DifferenceCounts::create(context, side, side)) {}
    std::uint64_t count(const std::vector<Item>& all, const Item& item, const LuminanceTexture& picture,
                        unsigned thresholds) {
        EXPECT_TRUE(counts_.draw_depth(all, {.view = frontal_view(side, side)}));
        const auto name = counts_.begin(item, picture, thresholds);
        EXPECT_TRUE(name) << name.error().message;
        EXPECT_TRUE(context_.finish());
        const auto taken = counts_.take();
        EXPECT_TRUE(taken);
        EXPECT_EQ(taken->size(), 1u);
        EXPECT_EQ(taken->front().name, *name);
        return taken->front().pixels;
    }
    DifferenceCounts& counts() { return counts_; }

private:
    Context context_;
    DifferenceCounts counts_;
};

TEST_F(DifferenceCountTest, CountsFromTheThresholdOn) {
    const Wall wall(context(), 0, 0.5f);
    Counting counting(context());
    auto picture = image(context(), side, side, 0.25f);
    auto seen = picture.texture();
    seen.scale = 100; // the wall differs by 25 cd/m2
    std::vector<float> thresholds(side * side, 26);
    for (std::size_t i = 0; i < 100; ++i) thresholds[i] = 25; // just visible
    auto map = LuminanceImage::create(context(), side, side, thresholds);
    EXPECT_EQ(counting.count({wall.item()}, wall.item(), seen, map->texture().id), 100u);
    // A picture that is no number differs.
    std::vector<float> bad(side * side, 0.5f);
    bad[5] = std::nanf("");
    ASSERT_TRUE(picture.set(bad));
    EXPECT_EQ(counting.count({wall.item()}, wall.item(), seen, map->texture().id), 1u);
}

TEST_F(DifferenceCountTest, CountsWhatNothingHides) {
    const Wall wall(context(), 0, 0.5f), before(context(), 0.2, 0.5f, {-1, -1}, {0, 1});
    Counting counting(context());
    const auto picture = image(context(), side, side, 0), map = image(context(), side, side, 0.1f);
    EXPECT_EQ(counting.count({wall.item()}, wall.item(), picture.texture(), map.texture().id), side * side);
    // The one before is nearer, so it is larger than the half that it has of the plane.
    const auto all = counting.count({wall.item(), before.item()}, wall.item(), picture.texture(), map.texture().id);
    EXPECT_EQ(all, side * side / 2);
    EXPECT_EQ(counting.count({wall.item(), before.item()}, before.item(), picture.texture(), map.texture().id),
              side * side / 2);
}

TEST_F(DifferenceCountTest, RefusesWhatDoesNotFit) {
    const Wall wall(context(), 0, 0.5f);
    auto counts = DifferenceCounts::create(context(), side, side);
    const auto picture = image(context(), side, side, 0), small = image(context(), 8, 8, 0);
    EXPECT_THAT(counts->begin(wall.item(), picture.texture(), picture.texture().id).error().message,
                HasSubstr("draw_depth()"));
    const std::vector<Item> all = {wall.item()};
    ASSERT_TRUE(counts->draw_depth(all, {.view = frontal_view(side, side)}));
    EXPECT_THAT(counts->begin(wall.item(), small.texture(), picture.texture().id).error().message, HasSubstr("8x8"));
    EXPECT_FALSE(counts->begin(wall.item(), picture.texture(), small.texture().id));
    EXPECT_FALSE(counts->begin(wall.item(), picture.texture(), 0));
    EXPECT_FALSE(DifferenceCounts::create(context(), 0, 1));
}

TEST_F(DifferenceCountTest, TimesStages) {
    auto times = require(StageTimes::create(context()));
    EXPECT_TRUE(times->take().empty());
    times->begin(); // forgotten
    times->begin();
    times->end_stage();
    times->end_stage();
    times->end();
    ASSERT_TRUE(context().finish());
    const auto frames = times->take();
    ASSERT_EQ(frames.size(), 1u);
    ASSERT_EQ(frames[0].size(), 2u);
    for (const double ms : frames[0]) EXPECT_GE(ms, 0);
    EXPECT_TRUE(times->take().empty());
}

} // namespace difference_count_test
