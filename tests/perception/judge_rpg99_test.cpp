// The rpg99 judge: known values, the behaviour of the program it reproduces, and numbers at which that program fails.
#include <unseen/perception/judge.h>

#include "testing.h"

namespace unseen::perception::judge_rpg99_test {

constexpr double usual_field = 45;

Image flat(int width, int height, float value) {
    return {width, height, 1,
            std::vector<float>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), value)};
}

// A disc and a ramp under noise, in cd/m2. The golden table was made from it.
Image scene(std::uint32_t seed, float noise) {
    Image image = flat(96, 80, 0);
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            seed = seed * 1664525U + 1013904223U;
            const float random = static_cast<float>(seed >> 16) / 65536.0F;
            const bool in_disc = (x - 60) * (x - 60) + (y - 30) * (y - 30) < 400;
            image.at(x, y) = 2.0F + 0.25F * static_cast<float>(x) + (in_disc ? 40.0F : 0.0F) + noise * random;
        }
    }
    return image;
}

// tests/data/rpg99_scene.csv comes from this module after it had been compared with an independent port in double
// precision: 200 samples of threshold maps within 3e-6, and the same failing pixels for 15 image pairs at two fields.
TEST(JudgeRpg99, KeepsItsVerifiedValues) {
    constexpr double tolerance = 1e-6; // maps are floats
    const auto map = require(rpg99_map(scene(1, 6), scene(2, 6), 14.8192332));
    std::ifstream table("tests/data/rpg99_scene.csv");
    ASSERT_TRUE(table) << "run from the source root";
    std::string line;
    int rows = 0;
    while (std::getline(table, line)) {
        if (line.empty() || line[0] == '#' || line[0] == 'x') continue;
        std::replace(line.begin(), line.end(), ',', ' ');
        std::istringstream words(line);
        int x = 0, y = 0;
        double adaptation = 0, elevation = 0, threshold = 0;
        ASSERT_TRUE(words >> x >> y >> adaptation >> elevation >> threshold) << line;
        EXPECT_NEAR(map->adaptation.at(x, y) / adaptation, 1, tolerance) << line;
        EXPECT_NEAR(map->elevation.at(x, y) / elevation, 1, tolerance) << line;
        EXPECT_NEAR(map->threshold.at(x, y) / threshold, 1, tolerance) << line;
        ++rows;
    }
    EXPECT_EQ(rows, 20);
}

TEST(JudgeRpg99, OnFlatFieldsIsThresholdVersusIntensity) {
    // log10 of luminance and threshold, one for each piece of the curve.
    const double pieces[][2] = {{-4.5, -2.86},
                                {-2.0, std::pow(0.405 * -2.0 + 1.6, 2.18) - 2.86},
                                {-1.0, -1.395},
                                {1.0, std::pow(0.249 + 0.65, 2.7) - 0.72},
                                {2.5, 1.245}};
    for (const auto& [luminance, threshold] : pieces) {
        const Image image = flat(40, 24, static_cast<float>(std::pow(10.0, luminance)));
        const auto map = require(rpg99_map(image, image, usual_field));
        EXPECT_EQ(map->elevation.at(20, 12), 1.0F);
        EXPECT_NEAR(std::log10(map->threshold.at(20, 12)), threshold, 1e-5) << luminance;
    }
}

// In single precision the contrast sensitivity of dim, fine detail is infinity times zero and everything passes.
TEST(JudgeRpg99, SeesASquareInTheDarkAtAnyField) {
    Image black = flat(128, 128, 0), square = black;
    for (int y = 32; y < 96; ++y) {
        for (int x = 32; x < 96; ++x) square.at(x, y) = 0.5F;
    }
    for (const double field : {3.0, 14.8, 45.0, 85.0}) {
        const auto judged = require(judge_rpg99(black, square, field));
        EXPECT_GT(judged->visible_pixels, 1500U) << field;
        EXPECT_TRUE(std::isfinite(judged->max_ratio));
    }
}

TEST(JudgeRpg99, IsBlindToAFineGratingThatEverybodySees) {
    const Image grey = flat(256, 256, 21);
    Image gabor = grey;
    for (int y = 0; y < 256; ++y) {
        for (int x = 0; x < 256; ++x) {
            const double degrees_x = (x - 128) / 34.357, degrees_y = (y - 128) / 34.357;
            const double envelope = std::exp(-(degrees_x * degrees_x + degrees_y * degrees_y) / (2 * 0.375 * 0.375));
            gabor.at(x, y) *= static_cast<float>(1 + 0.2 * envelope * std::cos(2 * std::numbers::pi * 4 * degrees_x));
        }
    }
    EXPECT_EQ(judge_rpg99(grey, gabor, 7.43)->visible_pixels, 0U);
    EXPECT_GT(judge_modern(grey, gabor, {})->visible_pixels, 1000U);
}

TEST(JudgeRpg99, MasksByTheError) {
    const Image reference = scene(1, 0), test = scene(1, 30);
    const auto both = rpg99_map(reference, test, usual_field), alone = rpg99_map(reference, reference, usual_field);
    EXPECT_GT(both->elevation.at(20, 60), alone->elevation.at(20, 60));
}

TEST(JudgeRpg99, CountsTheTwoSides) {
    const Image reference = flat(64, 64, 20);
    Image test = reference;
    test.at(30, 30) += 60;
    const auto judged = judge_rpg99(reference, test, usual_field);
    EXPECT_EQ(judged->pixels, 64U * 64U);
    EXPECT_EQ(judged->visible_pixels, 1U);
    EXPECT_EQ(judged->visibility.at(30, 30), static_cast<float>(judged->max_ratio));
    EXPECT_GT(judged->max_ratio, 1);
    EXPECT_EQ(judge_rpg99(test, test, usual_field)->visible_pixels, 0U);
    EXPECT_EQ(judge_rpg99(test, test, usual_field)->max_ratio, 0);
}

TEST(JudgeRpg99, TakesImagesSmallerThanItsKernel) {
    for (const int side : {1, 2, 3})
        EXPECT_TRUE(judge_rpg99(flat(side, 1, 5), flat(side, 1, 6), usual_field).has_value());
}

TEST(JudgeRpg99, RefusesBadInput) {
    const Image good = flat(8, 8, 1);
    Image bad = good;
    bad.values[11] = std::numeric_limits<float>::quiet_NaN();
    const auto judged = judge_rpg99(good, bad, usual_field);
    ASSERT_FALSE(judged);
    EXPECT_NE(judged.error().message.find("(3, 1)"), std::string::npos) << judged.error().message;
    bad.values[11] = -1;
    EXPECT_FALSE(judge_rpg99(bad, good, usual_field));
    EXPECT_FALSE(judge_rpg99(good, flat(8, 9, 1), usual_field));
    EXPECT_FALSE(judge_rpg99(flat(0, 0, 1), flat(0, 0, 1), usual_field));
    for (const double field : {0.0, 180.0, std::numeric_limits<double>::quiet_NaN()})
        EXPECT_FALSE(rpg99_map(good, good, field));
}

} // namespace unseen::perception::judge_rpg99_test
