// Small pictures of what folds change: gratings, steps and shifts of known size.
#include "measure/fold_picture.h"
#include "testing.h"

namespace unseen::perception {

namespace fold_picture_test {

using Layer = FoldPicture::Layer;
constexpr float half_width = 1;

auto amplitudes_of(const FoldPicture& picture) { return picture.difference().amplitudes[0]; }

FoldPicture looking(glm::vec3 normal = {0, 0, 1}) {
    FoldPicture picture;
    picture.look({0, 0, 0}, normal, half_width);
    return picture;
}

// A plane far over the picture's border, in steps as fine as its cells.
template <class Grey>
void draw_plane(FoldPicture& picture, Layer layer, float height, Grey&& grey) {
    constexpr int steps = 64;
    const auto corner = [&](int x, int y) {
        const glm::vec3 p(4.0f * static_cast<float>(x) / steps - 2, 4.0f * static_cast<float>(y) / steps - 2, height);
        return LitPoint{p, grey(p)};
    };
    for (int y = 0; y < steps; ++y) {
        for (int x = 0; x < steps; ++x) {
            picture.draw(layer, corner(x, y), corner(x + 1, y), corner(x + 1, y + 1));
            picture.draw(layer, corner(x, y), corner(x + 1, y + 1), corner(x, y + 1));
        }
    }
}

float even(const glm::vec3&) { return 0.5f; }

TEST(FoldPicture, NothingDiffersFromItself) {
    FoldPicture picture = looking();
    const auto grey = [](const glm::vec3& p) { return 0.5f + 0.3f * p.x * p.y; };
    for (const Layer layer : {Layer::mesh, Layer::folded}) draw_plane(picture, layer, 0, grey);
    for (const float amplitude : amplitudes_of(picture)) EXPECT_EQ(amplitude, 0);
    EXPECT_EQ(picture.difference().shift, 0);
    EXPECT_TRUE(picture.is_height_field());
}

TEST(FoldPicture, WhatOnlyOneShowsDoesNotDiffer) {
    FoldPicture picture = looking();
    draw_plane(picture, Layer::mesh, 0, even);
    for (const float amplitude : amplitudes_of(picture)) EXPECT_EQ(amplitude, 0);
    EXPECT_EQ(picture.difference().shift, 0);
}

// Each band sees a grating of its own frequency as large as it is, wherever its phase; others see less of it.
TEST(FoldPicture, MeasuresGratings) {
    for (std::size_t band = 0; band + 1 < FoldPicture::bands; ++band) { // the lowest has waves longer than the picture
        for (const float phase : {0.0f, 0.5f, 1.0f}) {
            FoldPicture picture = looking();
            const float frequency = 2 * std::numbers::pi_v<float> / picture.wavelength(band);
            draw_plane(picture, Layer::mesh, 0, even);
            draw_plane(picture, Layer::folded, 0,
                       [&](const glm::vec3& p) { return 0.5f + 0.1f * std::cos(frequency * p.x + phase); });
            const auto amplitudes = amplitudes_of(picture);
            // The finest has two cells a wave: what it sees depends on the phase. The coarser ones have a wave and a
            // half or more in the picture.
            if (band > 0) EXPECT_NEAR(amplitudes[band], 0.1f, 0.025f) << band << ", phase " << phase;
            for (std::size_t other = band + 2; other < FoldPicture::bands; ++other)
                EXPECT_LT(amplitudes[other], 0.06f) << other << " of " << band;
        }
    }
}

TEST(FoldPicture, SeesASpotInTheBandOfItsSize) {
    const auto of_spot = [](float radius) {
        FoldPicture picture = looking();
        draw_plane(picture, Layer::mesh, 0, even);
        draw_plane(picture, Layer::folded, 0, [&](const glm::vec3& p) {
            return 0.5f + 0.2f * std::exp(-(p.x * p.x + p.y * p.y) / (radius * radius));
        });
        return amplitudes_of(picture);
    };
    const auto narrow = of_spot(0.15f), wide = of_spot(0.6f);
    EXPECT_GT(narrow[1], 2 * narrow[3]);
    EXPECT_GT(wide[2], 2 * wide[0]);
    EXPECT_GT(wide[3], narrow[3]);
}

TEST(FoldPicture, MeasuresShiftsAlongTheNormal) {
    for (const glm::vec3& normal : {glm::vec3(0, 0, 1), glm::vec3(0, 0, -1)}) {
        FoldPicture picture = looking(normal);
        draw_plane(picture, Layer::mesh, 0, even);
        draw_plane(picture, Layer::folded, 0.125f, even);
        EXPECT_NEAR(picture.difference().shift, 0.125f, 1e-5f);
        EXPECT_TRUE(picture.is_height_field());
    }
}

TEST(FoldPicture, ShowsWhatLiesHighest) {
    FoldPicture picture = looking();
    draw_plane(picture, Layer::mesh, 0.25f, even);
    draw_plane(picture, Layer::mesh, -0.25f, [](const glm::vec3&) { return 0.9f; });
    draw_plane(picture, Layer::folded, 0.25f, even);
    for (const float amplitude : amplitudes_of(picture)) EXPECT_EQ(amplitude, 0);
    EXPECT_EQ(picture.difference().shift, 0);
}

TEST(FoldPicture, KnowsWhetherASurfaceIsFolded) {
    FoldPicture picture = looking();
    const LitPoint a{{-1, -1, 0}, 0.5f}, b{{1, -1, 0}, 0.5f}, c{{0, 1, 0}, 0.5f}, d{{0, -3, 1}, 0.5f},
        under{{0, 1, -1}, 0.5f};
    picture.draw(Layer::mesh, a, b, c);
    picture.draw(Layer::mesh, b, a, d);
    EXPECT_TRUE(picture.is_height_field());
    picture.draw(Layer::mesh, b, a, under);
    EXPECT_FALSE(picture.is_height_field());
    picture.look({0, 0, 0}, {0, 0, 1}, half_width);
    EXPECT_TRUE(picture.is_height_field());
    picture.draw(Layer::mesh, a, a, c); // no area
    EXPECT_TRUE(picture.is_height_field());
}

TEST(FoldPicture, SurvivesPlacesThatAreNoNumbers) {
    FoldPicture picture = looking();
    const float nan = std::nanf(""), infinity = std::numeric_limits<float>::infinity();
    for (const float bad : {nan, infinity, -infinity, 1e38f, -1e38f})
        picture.draw(Layer::folded, {{bad, 0, 0}, 0.5f}, {{1, bad, 0}, 0.5f}, {{0, 1, bad}, bad});
    draw_plane(picture, Layer::mesh, 0, even);
    for (const float amplitude : amplitudes_of(picture)) EXPECT_FALSE(amplitude > 1e37f);
}

} // namespace fold_picture_test
} // namespace unseen::perception
