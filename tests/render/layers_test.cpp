// Layers: where planes stand, that together they are the picture, and that without one they are the others'.
#include "gl_test.h"
#include "scenes.h"
#include "shapes.h"

#include <unseen/render/internal/layers.h>
#include <unseen/render/shadows.h>

namespace layers_test {

using namespace unseen::render;
using namespace unseen::render::testing;
using LayersTest = unseen::render::testing::GlTest;
using unseen::vdtree::View;

// Looks along -z from the origin.
View ahead(int width, int height) {
    View view = frontal_view(width, height);
    view.eye = {0, 0, 0}, view.target = {0, 0, -1};
    return view;
}

TEST(LayerSplit, StandsAtEqualFactorsOfDistance) {
    const std::vector<glm::dvec3> centres = {{0, 0, -1}, {5, 0, -3}, {0, 0, -9}, {0, 2, -27}, {0, 0, -81}, {0, 0, 4}};
    const auto split = require(split_into_layers(centres, ahead(8, 8), 4));
    EXPECT_EQ(split->count, 4);
    EXPECT_THAT(split->layer_of, ElementsAre(0, 1, 2, 3, 3, 0));
    ASSERT_EQ(split->borders.size(), 3u);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(split->borders[static_cast<std::size_t>(i)], std::pow(3, i + 1), 1e-9);
}

TEST(LayerSplit, LeavesOutWhatHoldsNothing) {
    const std::vector<glm::dvec3> centres = {{0, 0, -1}, {0, 0, -100}, {0, 0, -101}};
    const auto split = require(split_into_layers(centres, ahead(8, 8)));
    EXPECT_EQ(split->count, 2);
    EXPECT_THAT(split->layer_of, ElementsAre(0, 1, 1));
    // One object, one distance, or none at all: no layers.
    for (const auto& few :
         {std::vector<glm::dvec3>{}, {{0, 0, -1}}, {{0, 0, -2}, {1, 0, -2}}, {{0, 0, 3}, {0, 0, 4}}}) {
        const auto none = require(split_into_layers(few, ahead(8, 8)));
        EXPECT_EQ(none->count, 0);
        EXPECT_THAT(none->borders, IsEmpty());
        EXPECT_EQ(none->layer_of, std::vector<int>(few.size(), 0));
    }
}

TEST(LayerSplit, RefusesWhatIsNone) {
    const std::vector<glm::dvec3> one = {{0, 0, -1}};
    EXPECT_THAT(split_into_layers(one, ahead(8, 8), 0).error().message, HasSubstr("1 to 16 layers, not 0"));
    EXPECT_THAT(split_into_layers(one, ahead(8, 8), 17).error().message, HasSubstr("not 17"));
    const std::vector<glm::dvec3> bad = {{0, 0, -1}, {0, std::nan(""), 1}};
    EXPECT_THAT(split_into_layers(bad, ahead(8, 8)).error().message, HasSubstr("Object 1 "));
    View view = ahead(8, 8);
    view.target = view.eye;
    EXPECT_FALSE(split_into_layers(one, view));
}

// Three slanted strips that cross each other, and a wall.
class Strips {
public:
    explicit Strips(const Context& context) {
        const auto slanted = [](double turn, glm::vec4 colour) {
            return transformed(rectangle({-0.9, -0.4}, {0.9, 0.4}, 0, colour), [=](glm::dvec3 p) {
                return glm::dvec3(p.x * std::cos(turn) - p.y * std::sin(turn),
                                  p.x * std::sin(turn) + p.y * std::cos(turn),
                                  -2 + 0.8 * p.x - 0.01 * turn); // no two of one depth
            });
        };
        add(context, slanted(0, {0.5, 0.1, 0.1, 1}), objects);
        add(context, slanted(1, {0.1, 0.6, 0.1, 1}), objects);
        add(context, slanted(2, {0.1, 0.1, 0.7, 1}), objects);
        add(context, rectangle({-2, -1}, {2, 1.2}, -3, grey(0.3f)), background);
    }

    std::vector<Item> objects, background;
    const LayerSplit split = {.layer_of = {2, 0, 1}, .count = 3, .borders = {1, 2}};

private:
    void add(const Context& context, const Mesh& mesh, std::vector<Item>& to) {
        Scene& scene = *scenes_.emplace_back(std::make_unique<Scene>(mesh));
        auto tree = require(GpuTree::create(context, scene.tree));
        GpuCut cut(*tree);
        ASSERT_TRUE(cut.follow(scene.cut));
        to.push_back({cut});
    }
    std::vector<std::unique_ptr<Scene>> scenes_;
};

std::vector<glm::vec4> drawn(const Context& context, std::vector<Item> items, const std::vector<Item>& background,
                             const View& view) {
    auto target = Target::create(context, view.width, view.height);
    items.insert(items.end(), background.begin(), background.end());
    EXPECT_TRUE(draw(items, {.view = view, .near_plane = 0.01}, *target));
    return *read_pixels(*target);
}

TEST_F(LayersTest, TogetherAreThePictureToTheBit) {
    const Strips strips(context());
    for (const auto& [width, height] : {std::pair{37, 23}, {64, 64}, {1, 1}}) {
        const View view = ahead(width, height);
        auto passes = require(LayerPasses::create(context(), width, height));
        ASSERT_TRUE(passes->draw(strips.objects, strips.background, {.view = view, .near_plane = 0.01}, strips.split));
        EXPECT_EQ(*read_pixels(passes->composite()), drawn(context(), strips.objects, strips.background, view));
        ASSERT_EQ(passes->combination_count(), 3);
        for (int left_out = 0; left_out < 3; ++left_out) {
            ASSERT_TRUE(passes->combine(left_out));
            std::vector<Item> others;
            for (std::size_t i = 0; i < 3; ++i)
                if (strips.split.layer_of[i] != left_out) others.push_back(strips.objects[i]);
            EXPECT_EQ(*read_pixels(passes->combination()), drawn(context(), others, strips.background, view));
        }
        // 3 layers, the background; the composite and 3 combinations.
        EXPECT_EQ(passes->counts().surface_passes, 4);
        EXPECT_EQ(passes->counts().full_screen_passes, 4);
        EXPECT_EQ(passes->counts().textures, 5);
        const std::uint64_t pixels = static_cast<std::uint64_t>(width * height);
        EXPECT_EQ(passes->counts().texture_bytes, pixels * (6 * 20 + 20 + 16));
    }
}

TEST_F(LayersTest, DrawsAtOnceWhatIsNotSplit) {
    const Strips strips(context());
    const View view = ahead(40, 30);
    auto passes = LayerPasses::create(context(), 40, 30);
    const std::vector<Item> one = {strips.objects[0]};
    ASSERT_TRUE(passes->draw(one, strips.background, {.view = view, .near_plane = 0.01}, {.layer_of = {0}}));
    EXPECT_EQ(*read_pixels(passes->composite()), drawn(context(), one, strips.background, view));
    EXPECT_EQ(passes->counts().surface_passes, 1);
    EXPECT_EQ(passes->counts().full_screen_passes, 0);
    EXPECT_EQ(passes->counts().textures, 3) << "no layers";
    // All but the object is the background.
    ASSERT_EQ(passes->combination_count(), 1);
    ASSERT_TRUE(passes->combine(0));
    EXPECT_EQ(*read_pixels(passes->combination()), drawn(context(), {}, strips.background, view));
    EXPECT_EQ(passes->counts().surface_passes, 2);
    // Without objects there is the background, and nothing to leave out.
    ASSERT_TRUE(passes->draw({}, strips.background, {.view = view, .near_plane = 0.01}, {}));
    EXPECT_EQ(*read_pixels(passes->composite()), drawn(context(), {}, strips.background, view));
    EXPECT_EQ(passes->combination_count(), 0);
    EXPECT_THAT(passes->combine(0).error().message, HasSubstr("no layer 0 to leave out"));
    // And without anything, what it is cleared to.
    ASSERT_TRUE(passes->draw({}, {}, {.view = view}, {}, glm::vec4(0.25f)));
    EXPECT_THAT(*read_pixels(passes->composite()), ::testing::Each(glm::vec4(0.25f)));
}

// A wall behind, a screen before it, and a board that the sun casts a shadow with, from the left. Luminance of the wall
// where the screen was is what the board's shadow leaves of the screen's light, and the screen's own shadow is not in it.
TEST_F(LayersTest, ShadowsOnALayerMaskWhatIsBehindItAndItsOwnDoNot) {
    const auto lit = [](const Mesh& mesh) {
        unseen::vdtree::LightSource sun;
        sun.direction = glm::normalize(glm::dvec3(-1, 0, 1));
        sun.intensity = 0.6;
        sun.casts_shadow = true;
        auto scene = std::make_unique<Scene>(mesh);
        unseen::vdtree::Lighting lighting;
        lighting.ambient = 0.2;
        lighting.lights = {sun};
        return std::pair{std::move(scene), lighting};
    };
    std::vector<std::unique_ptr<Scene>> scenes;
    const auto item_of = [&](const Mesh& mesh) {
        auto [scene, lighting] = lit(mesh);
        GpuCut cut(*GpuTree::create(context(), scene->tree));
        EXPECT_TRUE(cut.follow(scene->cut));
        scenes.push_back(std::move(scene));
        Item item{cut};
        item.lighting = lighting;
        return item;
    };
    // The board's shadow falls on the right half of the screen, and the screen's on the wall. A thorn of the screen's own
    // stands before its upper left corner, and casts a shadow on it.
    const Item wall = item_of(rectangle({-4, -4}, {4, 4}, -5, grey(0.5f)));
    const Item screen = item_of(unseen::shapes::together(rectangle({-0.6, -0.6}, {0.6, 0.6}, -3, grey(0.8f)),
                                                         rectangle({-0.9, 0.2}, {-0.7, 0.5}, -2.6, grey(0.8f))));
    const Item board = item_of(rectangle({-1.2, -0.8}, {0.2, 0.1}, -1.8, grey(0.8f)));
    const std::vector<Item> objects = {screen, board}, background = {wall}, all = {screen, board, wall},
                            others = {board, wall};
    const View view = ahead(64, 64);
    auto shadows = Shadows::create(context(), {}, 1024), by_others = Shadows::create(context(), {}, 1024);
    ASSERT_TRUE(shadows->update(all) && by_others->update(others));
    const auto at = [](const std::vector<glm::vec4>& pixels, double x, double y, double z) {
        const double focal = 32 / std::tan(ahead(64, 64).fov_y_degrees * std::acos(-1.0) / 360);
        const int column = static_cast<int>(32 + focal * x / -z), row = static_cast<int>(32 - focal * y / -z);
        return pixels[static_cast<std::size_t>(row * 64 + column)].a;
    };
    for (const bool is_split : {true, false}) {
        auto passes = LayerPasses::create(context(), 64, 64);
        const LayerSplit split =
            is_split ? LayerSplit{.layer_of = {1, 0}, .count = 2, .borders = {2}} : LayerSplit{.layer_of = {0}};
        const auto shown = std::span(objects).first(is_split ? 2 : 1);
        std::vector<Item> behind = background;
        if (!is_split) behind.push_back(board);
        ASSERT_TRUE(passes->draw(shown, behind, {.view = view, .shadows = &*shadows}, split));
        ASSERT_EQ(passes->combination_count(), is_split ? 2 : 1);
        const int layer = is_split ? 1 : 0;
        ASSERT_TRUE(passes->combine(layer));
        EXPECT_EQ(passes->mask(), nullptr);
        EXPECT_EQ(passes->counts().mask_passes, 0);
        const std::uint64_t bytes = passes->counts().texture_bytes;
        const auto plain = *read_pixels(passes->combination());
        const auto masked = require(passes->combine(layer, &*by_others));
        EXPECT_EQ(passes->counts().mask_passes, 1);
        EXPECT_EQ(passes->counts().texture_bytes, bytes + 20 * 64 * 64);
        const auto pixels = *read_pixels(passes->combination()), mask = *read_pixels(*passes->mask());
        // Of the light 0.2 + 0.6 cos 45 degrees the ambient share is left.
        const double hidden = 0.2 / (0.2 + 0.6 / std::sqrt(2.0));
        EXPECT_NEAR(static_cast<double>(at(mask, 0.5, -0.3, -3)), hidden, 1e-4);
        EXPECT_EQ(at(mask, 0.3, 0.5, -3), 1.0f);
        EXPECT_EQ(at(mask, -0.45, 0.35, -3), 1.0f) << "the thorn's shadow is the layer's own";
        EXPECT_LT(at(*read_pixels(passes->composite()), -0.45, 0.35, -3), 0.2f) << "and it is there";
        EXPECT_EQ(at(mask, 1.5, 0, -3), 1.0f) << "nothing of the layer is there";
        for (std::size_t i = 0; i < pixels.size(); ++i)
            EXPECT_NEAR(pixels[i].a, plain[i].a * (pixels[i].a == plain[i].a ? 1 : mask[i].a), 1e-6f) << i;
        EXPECT_LT(at(pixels, 0.5, -0.3, -3), 0.5f * at(plain, 0.5, -0.3, -3));
        // Not on what stands before the layer: the board hides a part of the screen's shadow.
        std::size_t before = 0;
        for (std::size_t i = 0; i < pixels.size(); ++i) before += mask[i].a < 0.9f && pixels[i] == plain[i];
        EXPECT_GT(before, 0u);
        // The next one has none again.
        ASSERT_TRUE(passes->combine(layer));
        EXPECT_EQ(*read_pixels(passes->combination()), plain);
    }
}

// Two cuts of one object on the way from one to the other.
TEST_F(LayersTest, StippledItemsShareThePixels) {
    const Strips strips(context());
    const View view = ahead(32, 32);
    const auto walls = [&](float share) {
        std::vector<Item> both = {strips.background[0], strips.background[0]};
        both[0].stipple = {0, share}, both[1].stipple = {share, 1};
        return both;
    };
    for (const float share : {0.f, 0.25f, 0.5f, 1.f}) {
        auto both = walls(share);
        EXPECT_EQ(drawn(context(), both, {}, view), drawn(context(), {}, strips.background, view)) << share;
        // The first alone.
        both.pop_back();
        const auto alone = drawn(context(), both, {}, view);
        const auto covered = std::count_if(alone.begin(), alone.end(),
                                           [](const glm::vec4& pixel) { return pixel.a > default_background + 0.01f; });
        const auto whole = drawn(context(), {}, strips.background, view);
        const auto all = std::count_if(whole.begin(), whole.end(),
                                       [](const glm::vec4& pixel) { return pixel.a > default_background + 0.01f; });
        EXPECT_NEAR(static_cast<double>(covered) / static_cast<double>(all), static_cast<double>(share), 0.03);
    }
}

TEST_F(LayersTest, RefusesWhatCannotBeSplit) {
    const auto why = [&](int width, int height, int most = default_layers) {
        const auto made = LayerPasses::create(context(), width, height, most);
        return made ? "" : made.error().message;
    };
    EXPECT_THAT(why(8, 8, 17), HasSubstr("1 to 16 layers, not 17"));
    EXPECT_THAT(why(8, 8, 0), HasSubstr("not 0"));
    EXPECT_THAT(why(0, 8), HasSubstr("at least 1x1"));
    EXPECT_THAT(why(largest_target_side() + 1, 8), HasSubstr("choose a smaller size"));

    const Strips strips(context());
    auto passes = LayerPasses::create(context(), 8, 8, 2);
    const auto refused = [&](const LayerSplit& split) {
        const auto done = passes->draw(strips.objects, {}, {.view = ahead(8, 8)}, split);
        return done ? "" : done.error().message;
    };
    EXPECT_THAT(refused(strips.split), HasSubstr("in 3 layers, and there are only 2"));
    EXPECT_THAT(refused({.layer_of = {0, 1}, .count = 2}), HasSubstr("of 2 objects, not of 3"));
    EXPECT_THAT(refused({.layer_of = {0, 1, 2}, .count = 2}), HasSubstr("a layer that is none"));
    EXPECT_THAT(
        passes->draw(strips.objects, {}, {.view = ahead(9, 8)}, {.layer_of = {0, 1, 0}, .count = 2}).error().message,
        HasSubstr("9x8"));
}

} // namespace layers_test
