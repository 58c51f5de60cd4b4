// Hard cases of numbers in drawing: the entries of docs/numerics.md, each by its name, with its naive twin.

#include <unseen/render/draw.h>
#include <unseen/render/internal/visibility_passes.h>
#include <unseen/render/shadows.h>

#include "gl_test.h"
#include "one_band.h"
#include "scenes.h"

namespace unseen::render::numerics_test {

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
        auto shadows = require(Shadows::create(context(), {}, map_px));
        ASSERT_TRUE(shadows->update(items));
        auto target = require(Target::create(context(), window_px, window_px,
                                             {.colours = {ColourFormat::rgba32f, ColourFormat::rgba32f}}));
        ASSERT_TRUE(render::draw(items, {.view = view, .shadows = &*shadows, .shadow_mask = 1}, *target));
        float least = 1;
        const auto mask = require(read_pixels(*target, 1));
        for (const glm::vec4& seen : *mask) {
            ASSERT_GE(seen[0], 0) << elevation_deg; // and so a number
            ASSERT_LE(seen[0], 1) << elevation_deg;
            least = std::min(least, seen[0]);
        }
        // Steeper than 64 to 1 the light is a 64th of itself, and what is lost of it counts for nothing.
        if (std::tan(elevation) > 1 / 64.0) EXPECT_NEAR(least, 1, 1e-6) << elevation_deg;
    }
    EXPECT_GE(naive_hidden, 6);
}

} // namespace unseen::render::numerics_test
