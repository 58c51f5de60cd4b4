// Shadows: where geometry says they are, still when the eye moves, none where nothing hides the light, and free where no
// light casts one.

#include <unseen/render/draw.h>
#include <unseen/render/shadows.h>

#include "context_impl.h"
#include "gl_test.h"
#include "scenes.h"
#include "shapes.h"
#include "textures.h"

namespace unseen::render::shadow_test {

using vdtree::Lighting;
using vdtree::LightSource;
using Kind = LightSource::Kind;

using testing::Scene;

constexpr int window_px = 256, map_px = 512;
constexpr double eye_height = 10;

// Looks down from z = 10 at a window that spans -1 to 1 on the plane z = 0.
vdtree::View from_above(glm::dvec2 over = glm::dvec2(0)) {
    vdtree::View view;
    view.eye = {over.x, over.y, eye_height};
    view.target = {over.x, over.y, 0};
    view.up = {0, 1, 0};
    view.width = view.height = window_px;
    view.fov_y_degrees = 2 * std::atan(1 / eye_height) * 180 / std::numbers::pi;
    return view;
}

// The middle of a pixel, on the plane.
double place(int pixel) { return 2 * (pixel + 0.5) / window_px - 1; }
int pixel_at(double place) { return static_cast<int>(std::floor((place + 1) / 2 * window_px)); }

LightSource sun(glm::dvec3 towards) {
    LightSource light;
    light.direction = glm::normalize(towards);
    light.intensity = 0.7;
    light.casts_shadow = true;
    return light;
}

LightSource lamp(glm::dvec3 at) {
    LightSource light;
    light.kind = Kind::point;
    light.position = at;
    light.intensity = 0.5;
    light.distance = 1.5;
    light.casts_shadow = true;
    return light;
}

LightSource torch(glm::dvec3 at, glm::dvec3 to, double outer_degrees) {
    LightSource light = lamp(at);
    light.kind = Kind::spot;
    light.direction = glm::normalize(to - at);
    light.outer_cosine = std::cos(outer_degrees * std::numbers::pi / 180);
    light.inner_cosine = std::cos((outer_degrees - 2) * std::numbers::pi / 180);
    return light;
}

struct Drawn {
    std::vector<glm::vec4> colour, mask; // by pixel
    ShadowFacts facts;
    const glm::vec4& mask_at(int x, int y) const { return mask[static_cast<std::size_t>(y * window_px + x)]; }
};

class ShadowTest : public testing::GlTest {
protected:
    // Each mesh is an object of its own, in the world where it is in its file.
    Drawn draw(const std::vector<const Scene*>& scenes, const Lighting& lighting, const vdtree::View& view,
               bool with_mask = true) {
        std::vector<Item> items;
        for (const Scene* scene : scenes) {
            GpuCut cut(*GpuTree::create(context(), scene->tree));
            EXPECT_TRUE(cut.follow(scene->cut));
            Lighting own = lighting;
            for (LightSource& light : own.lights)
                if (light.kind != Kind::directional) light.position -= scene->tree.origin();
            items.push_back({cut, {}, Shading::smooth, false, own});
        }
        auto shadows = Shadows::create(context(), {}, map_px);
        EXPECT_TRUE(shadows);
        const auto updated = shadows->update(items);
        EXPECT_TRUE(updated) << updated.error().message;
        std::vector<ColourFormat> colours = {ColourFormat::rgba32f};
        if (with_mask) colours.push_back(ColourFormat::rgba32f);
        auto target = Target::create(context(), view.width, view.height, {.colours = colours});
        EXPECT_TRUE(target) << target.error().message;
        const auto mask = with_mask ? std::optional<int>(1) : std::nullopt;
        const auto drawn = render::draw(items, {.view = view, .shadows = &*shadows, .shadow_mask = mask}, *target);
        EXPECT_TRUE(drawn) << drawn.error().message;
        Drawn result{*read_pixels(*target, 0), {}, shadows->facts()};
        if (with_mask) result.mask = *read_pixels(*target, 1);
        return result;
    }

    const Scene floor{testing::rectangle({-1, -1}, {1, 1}, 0, testing::grey(1))};
    const Scene board{testing::rectangle({-0.2, -0.2}, {0.2, 0.2}, 0.5, testing::grey(1))};
    const std::vector<const Scene*> both = {&floor, &board};
};

// Where the mask falls below a half, from the left, along a row; and rises again.
std::pair<double, double> edges_of_row(const Drawn& drawn, double y, int light, double until) {
    const int row = pixel_at(-y);
    double left = 2, right = 2;
    for (int x = 1; place(x) < until; ++x) {
        const float a = drawn.mask_at(x - 1, row)[light], b = drawn.mask_at(x, row)[light];
        if ((a > 0.5f) == (b > 0.5f)) continue;
        const double at = place(x - 1) + (place(x) - place(x - 1)) * (0.5 - a) / (b - a);
        (b < a ? left : right) = at;
    }
    return {left, right};
}

std::pair<double, double> edges_of_column(const Drawn& drawn, double x, int light) {
    const int column = pixel_at(x);
    double low = 2, high = 2;
    for (int y = 1; y < window_px; ++y) {
        const float a = drawn.mask_at(column, y - 1)[light], b = drawn.mask_at(column, y)[light];
        if ((a > 0.5f) == (b > 0.5f)) continue;
        const double at = place(y - 1) + (place(y) - place(y - 1)) * (0.5 - a) / (b - a);
        (b < a ? low : high) = at;
    }
    return {low, high};
}

constexpr double ball_radius = 1.45; // of the floor and the board, at most
constexpr double texel = 2 * ball_radius / map_px;

TEST_F(ShadowTest, OfADirectionalLightIsWhereGeometrySays) {
    const Drawn drawn = draw(both, {.lights = {sun({1, 0, 1})}, .ambient = 0.2}, from_above());
    EXPECT_EQ(drawn.facts.lights, 1);
    EXPECT_EQ(drawn.facts.maps, 1);
    EXPECT_EQ(drawn.facts.bytes, 4u * map_px * map_px);
    EXPECT_EQ(drawn.facts.redraws, 1u);
    const double stretched = texel * std::sqrt(2.0); // on the floor, which the light meets at 45 degrees
    const auto [left, right] = edges_of_row(drawn, 0, 0, -0.22);
    EXPECT_NEAR(left, -0.7, stretched);
    EXPECT_NEAR(right, -0.3, stretched);
    const auto [low, high] = edges_of_column(drawn, -0.5, 0);
    EXPECT_NEAR(low, -0.2, texel);
    EXPECT_NEAR(high, 0.2, texel);
    // The whole is in the shade or in the light, but for three texels at the edge.
    double dark = 0;
    for (int y = 0; y < window_px; ++y)
        for (int x = 0; x < window_px; ++x) {
            const glm::dvec2 at(place(x), place(y));
            if (std::abs(at.x) < 0.22 && std::abs(at.y) < 0.22) continue; // the board
            const double inside = std::min(0.2 - std::abs(at.x + 0.5), 0.2 - std::abs(at.y));
            const float seen = drawn.mask_at(x, y)[0];
            dark += 1 - static_cast<double>(seen);
            if (inside > 3 * stretched) ASSERT_EQ(seen, 0) << at.x << " " << at.y;
            if (inside < -3 * stretched) ASSERT_NEAR(seen, 1, 1e-6) << at.x << " " << at.y;
        }
    EXPECT_NEAR(dark * 4 / (window_px * window_px), 0.16, 0.003);
    // Shade has the ambient light alone.
    EXPECT_NEAR(drawn.colour[static_cast<std::size_t>(window_px / 2 * window_px + pixel_at(-0.5))].a, 0.2, 1e-5);
    EXPECT_NEAR(drawn.colour[static_cast<std::size_t>(window_px / 2 * window_px + pixel_at(0.5))].a,
                0.2 + 0.7 / std::sqrt(2.0), 1e-5);
}

// From (1, 0, 1.5) the board at half of the way throws one half as large again.
void expect_shadow_of_lamp(const Drawn& drawn, int light, double tolerance) {
    const auto [left, right] = edges_of_row(drawn, 0, light, -0.4);
    EXPECT_NEAR(left, -0.8, tolerance);
    const auto [low, high] = edges_of_column(drawn, -0.5, light);
    EXPECT_NEAR(low, -0.3, tolerance);
    EXPECT_NEAR(high, 0.3, tolerance);
}

TEST_F(ShadowTest, OfAPointLightAndOfSpotsIsWhereGeometrySays) {
    const glm::dvec3 at(1, 0, 1.5);
    const Drawn drawn =
        draw(both, {.lights = {lamp(at), torch(at, {-0.4, 0, 0}, 35), torch(at, {-0.4, 0, 0}, 70)}, .ambient = 0.1},
             from_above());
    EXPECT_EQ(drawn.facts.lights, 3);
    EXPECT_EQ(drawn.facts.maps, 6 + 1 + 6);
    for (int light = 0; light < 3; ++light) expect_shadow_of_lamp(drawn, light, 0.03);
    for (const glm::vec4& mask : drawn.mask) ASSERT_EQ(mask.a, 1); // there is no fourth
    // No seams where the maps of a point light meet, and none on the floor right below it.
    for (int y = 0; y < window_px; ++y)
        for (int x = pixel_at(0.0) + window_px / 8; x < window_px; ++x) ASSERT_NEAR(drawn.mask_at(x, y)[0], 1, 1e-6);
}

TEST_F(ShadowTest, StandsStillWhenTheEyeMoves) {
    const Lighting lighting{.lights = {sun({1, 0.3, 1}), lamp({1, 0.2, 1.5})}, .ambient = 0.2};
    constexpr int pixels = 7;
    const Drawn before = draw(both, lighting, from_above()),
                after = draw(both, lighting, from_above({2.0 * pixels / window_px, 0}));
    for (int y = 0; y < window_px; ++y)
        for (int x = pixels; x < window_px; ++x) {
            if (std::abs(place(x)) < 0.3 && std::abs(place(y)) < 0.3) continue; // the board, seen from elsewhere
            for (int light = 0; light < 2; ++light)
                ASSERT_NEAR(before.mask_at(x, y)[light], after.mask_at(x - pixels, y)[light], 0.01) << x << " " << y;
        }
}

// A sphere hides no part of itself that faces the light, however coarse it is and however low the light.
TEST_F(ShadowTest, NothingThatFacesTheLightHidesItself) {
    for (const int level : {2, 4, 5}) {
        const Scene sphere(shapes::icosphere(level));
        for (const glm::dvec3& towards : {glm::dvec3(0.3, 0.4, 1), glm::dvec3(1, 0.2, 0.3)}) {
            const Drawn drawn =
                draw({&sphere}, {.lights = {sun(towards), lamp(3.0 * towards)}, .ambient = 0.2}, from_above());
            int lit = 0;
            for (int y = 0; y < window_px; ++y)
                for (int x = 0; x < window_px; ++x) {
                    const glm::dvec2 at(place(x), -place(y));
                    const double squared = glm::dot(at, at);
                    if (squared > 0.95) continue;
                    const glm::dvec3 normal(at, std::sqrt(1 - squared));
                    // Triangles are turned against the sphere by as much as they are large.
                    const double least = level == 2 ? 0.45 : 0.2;
                    const glm::dvec3 to_sun = glm::normalize(towards), to_lamp = glm::normalize(3.0 * towards - normal);
                    if (glm::dot(normal, to_lamp) < least) continue; // the sun is seen from farther around
                    ++lit;
                    ASSERT_GT(glm::dot(normal, to_sun), least);
                    ASSERT_NEAR(drawn.mask_at(x, y)[0], 1, 1e-6) << level << ": " << at.x << " " << at.y;
                    ASSERT_NEAR(drawn.mask_at(x, y)[1], 1, 1e-6) << level << ": " << at.x << " " << at.y;
                }
            EXPECT_GT(lit, 1000);
        }
    }
}

// Nor do the facets of a hollow, finer than the maps' texels, that the light looks straight into.
TEST_F(ShadowTest, AHollowHidesNothingOfItself) {
    vdtree::Mesh bowl = shapes::placed(shapes::grid(160), 1.0 / 80, {-1, -1, 0});
    for (glm::dvec3& p : bowl.positions) p.z = 0.4 * (p.x * p.x + p.y * p.y);
    const Scene hollow(bowl);
    const Drawn drawn = draw({&hollow}, {.lights = {sun({0.3, 0.2, 1})}, .ambient = 0.2}, from_above());
    for (int y = window_px / 8; y < window_px * 7 / 8; ++y)
        for (int x = window_px / 8; x < window_px * 7 / 8; ++x)
            ASSERT_NEAR(drawn.mask_at(x, y)[0], 1, 1e-6) << place(x) << " " << place(y);
}

// A box that stands on the floor: its shadow begins at its foot.
TEST_F(ShadowTest, BeginsAtTheFoot) {
    const Scene box(
        testing::transformed(testing::cube(), [](glm::dvec3 p) { return 0.2 * p + glm::dvec3(0, 0, 0.2); }));
    const Drawn drawn = draw({&floor, &box}, {.lights = {sun({1, 0, 1})}, .ambient = 0.2}, from_above());
    // The box is seen up to 0.2 * 10 / 9.6 from the middle.
    for (int x = pixel_at(-0.5); place(x) < -0.215; ++x) ASSERT_EQ(drawn.mask_at(x, window_px / 2)[0], 0) << place(x);
    EXPECT_NEAR(edges_of_row(drawn, 0, 0, -0.3).first, -0.6, texel * std::sqrt(2.0));
    for (int x = pixel_at(0.25); x < window_px; ++x) ASSERT_NEAR(drawn.mask_at(x, window_px / 2)[0], 1, 1e-6);
}

TEST_F(ShadowTest, CostsNothingWhereNoLightCastsOne) {
    Lighting lighting{.lights = {sun({1, 0, 1}), lamp({1, 0, 1.5})}, .ambient = 0.2};
    for (LightSource& light : lighting.lights) light.casts_shadow = false;
    std::vector<Item> items;
    for (const Scene* scene : both) {
        GpuCut cut(*GpuTree::create(context(), scene->tree));
        ASSERT_TRUE(cut.follow(scene->cut));
        Lighting own = lighting;
        own.lights[1].position -= scene->tree.origin();
        items.push_back({cut, {}, Shading::smooth, false, own});
    }
    auto target = Target::create(context(), window_px, window_px);
    ASSERT_TRUE(render::draw(items, {.view = from_above()}, *target));
    const auto without = *read_pixels(*target);
    auto shadows = Shadows::create(context(), {}, map_px);
    ASSERT_TRUE(shadows->update(items));
    ASSERT_TRUE(render::draw(items, {.view = from_above(), .shadows = &*shadows}, *target));
    EXPECT_EQ(*read_pixels(*target), without); // to the bit
    const ShadowFacts facts = shadows->facts();
    EXPECT_EQ(facts.lights, 0);
    EXPECT_EQ(facts.maps, 0);
    EXPECT_EQ(facts.bytes, 0u);
    EXPECT_EQ(facts.redraws, 0u);
}

TEST_F(ShadowTest, MapsAreDrawnAgainOnlyWhereSomethingChanged) {
    Scene sphere(shapes::icosphere(3));
    GpuCut cut(*GpuTree::create(context(), sphere.tree));
    ASSERT_TRUE(cut.follow(sphere.cut));
    std::vector<Item> items = {{cut, {}, Shading::smooth, false, Lighting{.lights = {sun({1, 0, 1})}}}};
    auto shadows = Shadows::create(context(), {}, map_px);
    for (int i = 0; i < 3; ++i) {
        ASSERT_TRUE(cut.follow(sphere.cut));
        ASSERT_TRUE(shadows->update(items));
    }
    EXPECT_EQ(shadows->facts().redraws, 1u);
    items[0].lighting->lights[0] = sun({1, 0.1, 1});
    ASSERT_TRUE(shadows->update(items));
    EXPECT_EQ(shadows->facts().redraws, 2u);
    items[0].placement.translation = {0.5, 0, 0};
    ASSERT_TRUE(shadows->update(items));
    EXPECT_EQ(shadows->facts().redraws, 3u);
    vdtree::Cut folded(sphere.tree);
    ASSERT_TRUE(cut.follow(folded));
    ASSERT_TRUE(shadows->update(items));
    EXPECT_EQ(shadows->facts().redraws, 4u);
    items[0].lighting->lights[0].casts_shadow = false;
    ASSERT_TRUE(shadows->update(items));
    EXPECT_EQ(shadows->facts().redraws, 4u);
    EXPECT_EQ(shadows->facts().bytes, 0u);
}

// Maps that are drawn where a pebble lies alone have the same shadows on it, to the bit.
TEST_F(ShadowTest, AreTheSameWhereTheyAreLookedFor) {
    const Scene pebble(shapes::icosphere(2));
    GpuCut ground(*GpuTree::create(context(), floor.tree)), above(*GpuTree::create(context(), board.tree)),
        stone(*GpuTree::create(context(), pebble.tree));
    ASSERT_TRUE(ground.follow(floor.cut));
    ASSERT_TRUE(above.follow(board.cut));
    ASSERT_TRUE(stone.follow(pebble.cut));
    const LightSource lights[] = {sun({1, 0.3, 1}), lamp({0.1, 0.2, 1}), lamp({0.35, 0, 0.2}),
                                  torch({0.5, 0.5, 2}, {0, 0, 0}, 40)};
    auto target = Target::create(context(), window_px, window_px, {.colours = {2, ColourFormat::rgba32f}});
    for (const LightSource& light : lights) {
        const auto item = [&](const GpuCut& cut, double scale, glm::dvec3 at) {
            Item made{cut, {}, Shading::smooth, false, Lighting{.lights = {light}}};
            made.placement.scale = scale;
            made.placement.translation = at;
            made.lighting->lights[0].position = (light.position - at) / scale - cut.tree().tree().origin();
            return made;
        };
        std::vector<Item> items = {item(ground, 1, {0, 0, 0}), item(above, 1, {0, 0, 0})};
        for (const glm::dvec3 at : {glm::dvec3(-0.5, -0.1, 0.1), glm::dvec3(0, 0, 0.1), glm::dvec3(0.2, 0.3, 0.3),
                                    glm::dvec3(0.35, 0, 0.3), glm::dvec3(0.7, 0, 0.1)})
            items.push_back(item(stone, 0.1, at));
        const Ball bounds = ball_around(items);
        auto all = Shadows::create(context(), bounds, map_px), some = Shadows::create(context(), bounds, map_px);
        ASSERT_TRUE(all->update(items));
        bool is_any_dark = false;
        for (std::size_t i = 2; i < items.size(); ++i) {
            const std::span<const Item> own(&items[i], 1);
            const auto mask = [&](const Shadows& shadows) {
                EXPECT_TRUE(render::draw(own, {.view = from_above(), .shadows = &shadows, .shadow_mask = 1}, *target));
                return *read_pixels(*target, 1);
            };
            ASSERT_TRUE(some->update(items, own));
            const std::vector<glm::vec4> expected = mask(*all);
            EXPECT_EQ(mask(*some), expected);
            for (const glm::vec4& pixel : expected) is_any_dark |= pixel[0] < 0.5f;
        }
        EXPECT_TRUE(is_any_dark);
        // What is there is not drawn again, and what is not is.
        auto redraws = [&, fresh = Shadows::create(context(), bounds, map_px)](
                           const std::optional<std::span<const Item>>& receivers) mutable {
            EXPECT_TRUE(fresh->update(items, receivers));
            return fresh->facts().redraws;
        };
        EXPECT_EQ(redraws(std::span<const Item>(&items.back(), 1)), 1u);
        EXPECT_EQ(redraws(std::span<const Item>(&items.back(), 1)), 1u);
        EXPECT_EQ(redraws(std::nullopt), 2u);
        EXPECT_EQ(redraws(std::span<const Item>(&items[2], 1)), 2u);
    }
}

TEST_F(ShadowTest, NothingIsCastWhereTexelsAreNotThere) {
    vdtree::Texture left_half{8, 8, {}, {}, {}};
    for (int i = 0; i < 64; ++i)
        left_half.texels.push_back({255, 255, 255, static_cast<std::uint8_t>(i % 8 < 4 ? 255 : 0)});
    const Scene card(shapes::placed(textures::textured_grid(4, left_half), 0.125, {-0.25, -0.25, 0.5}));
    const Drawn drawn = draw({&floor, &card}, {.lights = {sun({1, 0, 1})}}, from_above());
    const auto lit = [&](double x) { return drawn.mask_at(pixel_at(x), window_px / 2)[0]; };
    for (const double x : {-0.72, -0.6, -0.53}) EXPECT_LT(lit(x), 0.01f) << x;
    for (const double x : {-0.8, -0.47, -0.4, -0.3}) EXPECT_GT(lit(x), 0.99f) << x;
}

TEST_F(ShadowTest, RefusesWhatCannotBe) {
    for (const int size : {0, 1 << 20}) {
        const auto shadows = Shadows::create(context(), {}, size);
        ASSERT_FALSE(shadows);
        EXPECT_NE(shadows.error().message.find("texels a side cannot be drawn"), std::string::npos);
    }
    GpuCut cut(*GpuTree::create(context(), floor.tree));
    ASSERT_TRUE(cut.follow(floor.cut));
    Item item{cut, {}, Shading::smooth, false, Lighting{.lights = {5, sun({1, 0, 1})}}};
    auto shadows = Shadows::create(context(), {}, map_px);
    const auto many = shadows->update({{item}});
    ASSERT_FALSE(many);
    EXPECT_NE(many.error().message.find("at most 4"), std::string::npos);
    item.lighting->lights.resize(1);
    Item other = item;
    other.lighting->lights[0] = sun({0, 1, 1});
    const Item two[] = {item, other};
    ASSERT_FALSE(shadows->update(two));
    ASSERT_TRUE(shadows->update({{item}}));
    auto target = Target::create(context(), window_px, window_px, {.colours = {2, ColourFormat::rgba32f}});
    const auto drawn = render::draw(two, {.view = from_above(), .shadows = &*shadows}, *target);
    ASSERT_FALSE(drawn);
    EXPECT_NE(drawn.error().message.find("update them before drawing"), std::string::npos);
    EXPECT_FALSE(render::draw({{item}}, {.view = from_above(), .shadows = &*shadows, .shadow_mask = 0}, *target));
    EXPECT_FALSE(render::draw({{item}}, {.view = from_above(), .shadows = &*shadows, .shadow_mask = 2}, *target));
    EXPECT_TRUE(render::draw({{item}}, {.view = from_above(), .shadows = &*shadows, .shadow_mask = 1}, *target));
}

// Flat shading, wireframes and textures have shaders of their own.
TEST_F(ShadowTest, AllKindsOfSurfacesAreDrawnWithThem) {
    GpuCut cut(*GpuTree::create(context(), floor.tree)), above(*GpuTree::create(context(), board.tree));
    ASSERT_TRUE(cut.follow(floor.cut));
    ASSERT_TRUE(above.follow(board.cut));
    Lighting lighting{.lights = {sun({1, 0, 1})}, .ambient = 0.2};
    for (const Shading shading : {Shading::smooth, Shading::flat})
        for (const bool wireframe : {false, true}) {
            const Item items[] = {{cut, {}, shading, wireframe, lighting}, {above, {}, shading, wireframe, lighting}};
            auto shadows = Shadows::create(context(), {}, map_px);
            ASSERT_TRUE(shadows->update(items));
            auto target = Target::create(context(), window_px, window_px);
            const auto drawn = require(render::draw(items, {.view = from_above(), .shadows = &*shadows}, *target));
            const auto pixels = *read_pixels(*target);
            EXPECT_NEAR(pixels[static_cast<std::size_t>(window_px * pixel_at(0.05) + pixel_at(-0.5))].a, 0.2, 1e-5);
        }
}

} // namespace unseen::render::shadow_test
