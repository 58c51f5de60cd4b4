// Hard cases of numbers in drawing: the entries of docs/numerics.md, each by its name, with its naive twin.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include <unseen/render/draw.h>
#include <unseen/render/shadows.h>
#include <unseen/render/visibility.h>

#include "gl_test.h"
#include "one_band.h"
#include "scenes.h"

namespace unseen::render::numerics_test {
namespace {

using Numerics = testing::GlTest;

// Whether a plane hides itself where its depth is compared with that of a texel's middle, up to half a texel aside, less a
// bias of half a texel. `slope`: depth over width, seen from the light.
bool naive_hides_itself(double slope, double texel) { return 0.5 * texel * slope > 0.5 * texel; }

TEST_F(Numerics, ShadowMapsAtGrazingLight) {
    constexpr int window_px = 128, map_px = 256;
    const testing::Scene floor(testing::rectangle({-1, -1}, {1, 1}, 0, testing::grey(1)));
    vdtree::View view;
    view.eye = {0, 0, 10}, view.target = {0, 0, 0}, view.up = {0, 1, 0};
    view.width = view.height = window_px;
    view.fov_y_degrees = 2 * std::atan(0.09) * 180 / std::numbers::pi; // a tenth of the floor's rim is out of it
    int naive_hidden = 0;
    for (const double elevation_deg : {90.0, 45.0, 20.0, 5.0, 2.0, 1.2, 0.5, 0.01}) {
        const double elevation = elevation_deg * std::numbers::pi / 180;
        naive_hidden += naive_hides_itself(1 / std::tan(elevation), 2.0 / map_px);
        vdtree::Lighting lighting;
        lighting.ambient = 0.2;
        vdtree::LightSource sun;
        sun.direction = {std::cos(elevation) * 0.8, std::cos(elevation) * 0.6, std::sin(elevation)};
        sun.intensity = 0.7;
        sun.casts_shadow = true;
        lighting.lights = {sun};
        GpuCut cut(*GpuTree::create(context(), floor.tree));
        ASSERT_TRUE(cut.follow(floor.cut));
        const std::vector<Item> items = {{cut, {}, Shading::smooth, false, lighting}};
        auto shadows = Shadows::create(context(), {.size = map_px});
        ASSERT_TRUE(shadows);
        ASSERT_TRUE(shadows->update(items));
        auto target = Target::create(context(), window_px, window_px,
                                     {.colours = {ColourFormat::rgba32f, ColourFormat::rgba32f}});
        ASSERT_TRUE(target);
        ASSERT_TRUE(render::draw(items, {.view = view, .shadows = &*shadows, .shadow_mask = 1}, *target));
        float least = 1;
        const auto mask = read_pixels(*target, 1);
        ASSERT_TRUE(mask);
        for (const glm::vec4& seen : *mask) {
            ASSERT_GE(seen[0], 0) << elevation_deg; // and so a number
            ASSERT_LE(seen[0], 1) << elevation_deg;
            least = std::min(least, seen[0]);
        }
        // Steeper than 64 to 1 the light is a 64th of itself, and what is lost of it counts for nothing.
        if (std::tan(elevation) > 1 / 64.0) {
            EXPECT_NEAR(least, 1, 1e-6) << elevation_deg;
        }
    }
    EXPECT_GE(naive_hidden, 6);
}

// As halves keep it: 11 bits, from 2^-24 to 65504.
float naive_half(double x) {
    if (!(x < 65520)) return std::numeric_limits<float>::infinity();
    if (x < 0x1p-25) return 0;
    const double step = std::exp2(std::max(std::floor(std::log2(x)), -14.0) - 10);
    return static_cast<float>(std::round(x / step) * step);
}

TEST_F(Numerics, MaskingExponentsIn16Bits) {
    EXPECT_TRUE(std::isinf(naive_half(300.0 * 300.0))) << "the energy of 300 thresholds";
    EXPECT_TRUE(std::isinf(naive_half(std::pow(100.0, 2.8)))) << "what a masker of 100 thresholds comes to";
    EXPECT_EQ(naive_half(1e-4 * 1e-4), 0);
    constexpr double bound = 0.01; // of V, from 0.1 to 5,000
    constexpr int side = 16;
    std::vector<float> textured(side * side); // masks by some fifty thresholds
    for (int i = 0; i < side * side; ++i) textured[static_cast<std::size_t>(i)] = (i + i / side) % 2 ? 1.f : 199.f;
    const auto texture = LuminanceImage::create(context(), side, side, textured);
    ASSERT_TRUE(texture);
    const auto plain = testing::picture(context(), side, side, 10);
    for (const bool masks : {false, true}) {
        const LuminanceTexture reference = masks ? texture->texture() : plain.texture();
        auto in_full = VisibilityPasses::create(context(), testing::tables(side, side), reference);
        auto in_half =
            VisibilityPasses::create(context(), testing::tables(side, side), reference, VisibilityPrecision::half);
        ASSERT_TRUE(in_full && in_half);
        for (const float difference : {0.1f, 1.f, 30.f, 1e3f, 4e3f, 1e9f}) {
            std::vector<float> values(side * side);
            for (std::size_t i = 0; i < values.size(); ++i) values[i] = (masks ? textured[i] : 10.f) + difference;
            const auto test = LuminanceImage::create(context(), side, side, values);
            ASSERT_TRUE(test);
            ASSERT_TRUE(in_full->judge(test->texture()));
            ASSERT_TRUE(in_half->judge(test->texture()));
            const auto expected = in_full->read_visibility(), found = in_half->read_visibility();
            ASSERT_TRUE(expected && found);
            for (std::size_t i = 0; i < found->size(); ++i) {
                const float v = (*expected)[i];
                ASSERT_TRUE(std::isfinite((*found)[i])) << difference;
                if (v >= 0.1f && v <= 5e3f) {
                    ASSERT_NEAR((*found)[i], v, bound * v) << difference;
                }
                if (v > 5e3f) {
                    ASSERT_GT((*found)[i], 4.9e3f) << difference;
                }
            }
        }
    }
}

} // namespace
} // namespace unseen::render::numerics_test
