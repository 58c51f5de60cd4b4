// The modern judge is not blind and not nervous: single gratings, a disc and an offset become visible where the
// contrast sensitivity function says so; what is identical, masked by the reference or far from the gaze does not.
#include <perception/judge.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <numbers>
#include <string>

#include <gtest/gtest.h>

namespace unseen::perception {
namespace {

Image flat(int width, int height, double value) {
    const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    return {width, height, 1, std::vector<float>(pixels, static_cast<float>(value))};
}

double default_ppd() { return pixels_per_degree(Display{}).value(); }

struct Gabor {
    double freq_cpd = 4, contrast = 0.1, luminance = 20, orientation_deg = 0, phase = 0;
};

// Envelope of 1.5 cycles radius, so its area is patch_area(frequency).
Image draw(const Gabor& g, int side) {
    Image image = flat(side, side, 0);
    const double sigma = 1.5 / g.freq_cpd, angle = g.orientation_deg * std::numbers::pi / 180;
    for (int y = 0; y < side; ++y) {
        for (int x = 0; x < side; ++x) {
            const double dx = (x - side / 2) / default_ppd(), dy = (y - side / 2) / default_ppd();
            const double along = dx * std::cos(angle) + dy * std::sin(angle);
            const double envelope = std::exp(-(dx * dx + dy * dy) / (2 * sigma * sigma));
            const double wave = std::cos(2 * std::numbers::pi * g.freq_cpd * along + g.phase);
            image.at(x, y) = static_cast<float>(g.luminance * (1 + g.contrast * envelope * wave));
        }
    }
    return image;
}

// A gaze that sees the window's centre at `degrees`.
JudgeOptions looking_aside(double degrees, int side) {
    JudgeOptions options;
    if (degrees > 0) {
        const double px = std::tan(degrees * std::numbers::pi / 180) * options.display.distance.value() /
                          options.display.pixel_pitch.value();
        options.gaze_px = glm::dvec2(0.5 * side + px, 0.5 * side);
    }
    return options;
}

double closed_form(double freq_cpd, double luminance, double eccentricity) {
    Stimulus s;
    s.frequency = CyclesPerDegree(freq_cpd);
    s.luminance = Luminance(luminance);
    s.eccentricity = Degrees(eccentricity);
    s.area = patch_area(s.frequency);
    return sensitivity(CsfModel::castle, s);
}

// 5 standard deviations of the envelope across, at least 256 pixels.
int side_for(double freq_cpd) { return std::max(256, static_cast<int>(5 * 1.5 / freq_cpd * default_ppd()) / 2 * 2); }

double largest_ratio(const Gabor& g, double eccentricity) {
    const int side = side_for(g.freq_cpd);
    const auto judged = judge_modern(flat(side, side, g.luminance), draw(g, side), looking_aside(eccentricity, side));
    EXPECT_TRUE(judged.has_value());
    return judged ? judged->max_ratio : 0;
}

constexpr double three_decibels = 1.4125375446227544; // 10^(3/20)

// Below 1/S by 3 dB a grating must not be visible, above it by 3 dB it must be.
void expect_threshold_within_3_db(Gabor g, double eccentricity, int& tested) {
    const double threshold = 1 / closed_form(g.freq_cpd, g.luminance, eccentricity);
    const auto where = [&] {
        return std::to_string(g.freq_cpd) + " cpd, " + std::to_string(g.luminance) + " cd/m2, " +
               std::to_string(eccentricity) + " deg, orientation " + std::to_string(g.orientation_deg);
    };
    g.contrast = std::min(1.0, threshold / three_decibels);
    EXPECT_LT(largest_ratio(g, eccentricity), 1) << where();
    if (threshold * three_decibels > 1) return; // no grating has a contrast above 1
    g.contrast = threshold * three_decibels;
    EXPECT_GE(largest_ratio(g, eccentricity), 1) << where();
    ++tested;
}

TEST(JudgeModern, SeesGaborsAtTheirThreshold) {
    int tested = 0;
    for (const double luminance : {5.0, 50.0}) {
        for (const double eccentricity : {0.0, 10.0, 20.0}) {
            for (const double freq : {0.5, 1.0, 2.0, 4.0, 8.0, 16.0}) {
                expect_threshold_within_3_db({freq, 0, luminance, 0, 0}, eccentricity, tested);
            }
        }
    }
    EXPECT_GE(tested, 28); // the others cannot be seen at any contrast
}

TEST(JudgeModern, SeesGaborsBetweenItsBandsAndAtAnyOrientationAndPhase) {
    int tested = 0;
    for (const double freq : {0.7, 1.4, 2.8, 3.9, 5.5, 6.5, 9.5, 11.0, 13.0}) {
        expect_threshold_within_3_db({freq, 0, 20, 45, 0}, 0, tested);
        expect_threshold_within_3_db({freq, 0, 20, 20, 1.57}, 10, tested);
    }
    EXPECT_GE(tested, 15);
}

Image with_disc(double luminance, double contrast, double radius_deg, int side) {
    Image image = flat(side, side, luminance);
    for (int y = 0; y < side; ++y) {
        for (int x = 0; x < side; ++x) {
            const double r = std::hypot(x - 0.5 * side, y - 0.5 * side) / default_ppd();
            if (r < radius_deg) image.at(x, y) = static_cast<float>(luminance * (1 + contrast));
        }
    }
    return image;
}

TEST(JudgeModern, SeesATenthMoreOrLessOnATwoDegreeDisc) {
    for (const int side : {96, 256, 512}) {
        for (const double contrast : {0.1, -0.1}) {
            const auto judged = judge_modern(flat(side, side, 20), with_disc(20, contrast, 1, side), {});
            EXPECT_GE(judged->max_ratio, 1) << side;
            EXPECT_GE(judged->visibility.at(side / 2 + 30, side / 2), 1) << side; // near its edge
        }
    }
}

TEST(JudgeModern, SeesAChangeWithoutAnyEdge) {
    for (const int width : {1, 2, 5, 64, 300}) {
        const auto judged = judge_modern(flat(width, 64, 20), flat(width, 64, 22), {});
        EXPECT_EQ(judged->visible_pixels, judged->pixels) << width;
    }
}

std::uint32_t next(std::uint32_t& seed) { return seed = seed * 1664525U + 1013904223U; }

Image noise(int side, double luminance, double amplitude, std::uint32_t seed) {
    Image image = flat(side, side, 0);
    for (float& v : image.values) {
        v = static_cast<float>(luminance * (1 + amplitude * (next(seed) / 2147483648.0 - 1)));
    }
    return image;
}

TEST(JudgeModern, GivesExactlyZeroForIdenticalImages) {
    const Image image = noise(257, 30, 0.9, 3);
    const auto judged = judge_modern(image, image, looking_aside(15, 257));
    EXPECT_EQ(judged->max_ratio, 0);
    EXPECT_EQ(judged->visible_pixels, 0U);
    EXPECT_EQ(judged->pixels, 257U * 257U);
    EXPECT_EQ(judged->visibility.values, std::vector<float>(257 * 257, 0.0F));
}

TEST(JudgeModern, MasksByTheReferenceButNotByTheError) {
    const Image smooth = flat(256, 256, 20), rough = noise(256, 20, 0.8, 9);
    Image smooth_test = smooth, rough_test = rough;
    const Image gabor = draw({5.5, 0.05, 20, 0, 0}, 256);
    for (std::size_t i = 0; i < gabor.values.size(); ++i) {
        smooth_test.values[i] += gabor.values[i] - 20;
        rough_test.values[i] += gabor.values[i] - 20;
    }
    // Where the mask crosses zero it hides nothing, so the largest ratio says little and the number of pixels much.
    EXPECT_GT(judge_modern(smooth, smooth_test, {})->visible_pixels,
              2 * judge_modern(rough, rough_test, {})->visible_pixels);
    // The strong error in `rough` against `smooth` is not its own mask: twice the error, twice the visibility.
    Image half = smooth;
    for (std::size_t i = 0; i < half.values.size(); ++i) half.values[i] = 0.5F * (smooth.values[i] + rough.values[i]);
    EXPECT_NEAR(judge_modern(smooth, rough, {})->max_ratio / judge_modern(smooth, half, {})->max_ratio, 2, 1e-4);
}

TEST(JudgeModern, FadesWithEccentricityAsTheClosedFormSays) {
    const double nominal = 0.3228 * default_ppd() / 2; // a band's own frequency: no neighbour helps much
    const Gabor g{nominal, 0.3, 20, 0, 0};
    const double fovea = largest_ratio(g, 0);
    double last = fovea;
    for (const double e : {5.0, 10.0, 20.0, 30.0}) {
        const double ratio = largest_ratio(g, e);
        EXPECT_LT(ratio, last);
        const double expected = closed_form(nominal, 20, e) / closed_form(nominal, 20, 0);
        EXPECT_NEAR(20 * std::log10(ratio / fovea / expected), 0, 3) << e; // dB; far out its lower sideband helps
        last = ratio;
    }
}

TEST(JudgeModern, WithoutGazeTreatsEveryPixelAsFoveal) {
    Image test = flat(512, 512, 20);
    test.at(40, 64) += 5;
    const auto corner = judge_modern(flat(512, 512, 20), test, {});
    Image centred = flat(512, 512, 20);
    centred.at(256, 256) += 5;
    const auto centre = judge_modern(flat(512, 512, 20), centred, {});
    EXPECT_NEAR(corner->max_ratio / centre->max_ratio, 1, 0.2); // sample phases differ
    JudgeOptions aside;
    aside.gaze_px = glm::dvec2(1603, 256);
    EXPECT_LT(judge_modern(flat(512, 512, 20), test, aside)->max_ratio, 0.2 * corner->max_ratio);
}

TEST(JudgeModern, CountsTheWholeBlockOfALowBand) {
    Gabor g{0.35, 0.03, 20, 0, 0};
    const Image test = draw(g, 512);
    const auto judged = judge_modern(flat(512, 512, 20), test, {});
    ASSERT_GE(judged->max_ratio, 1);
    // Band 5 has blocks of 32 pixels: within one, the coarse part of V does not change, so runs of equal values are
    // long.
    const auto peak = std::max_element(judged->visibility.values.begin(), judged->visibility.values.end());
    const auto count = std::count_if(judged->visibility.values.begin(), judged->visibility.values.end(),
                                     [&](float v) { return v > 0.98F * *peak; });
    EXPECT_GE(count, 256);
}

// Degrees from the gaze to the centre of pixel (0, 0), which is exactly a sample of every level of the pyramid.
JudgeOptions looking_beside_the_corner(double degrees, int side) {
    JudgeOptions options;
    const double pixel = options.display.pixel_pitch.value() / options.display.distance.value();
    const double corner = (0.5 * side - 0.5) * pixel; // left of and above the centre, in viewing distances
    const double depth = std::hypot(1.0, corner);     // from the eye to the corner's row
    const double x = depth * std::tan(std::atan2(corner, depth) + degrees * std::numbers::pi / 180);
    options.gaze_px = glm::dvec2(0.5 * side - x / pixel, 0.5);
    return options;
}

TEST(JudgeModern, TakesAViewersOwnTableInPlaceOfTheModel) {
    const Image reference = noise(128, 20, 0.05, 3), test = noise(128, 20, 0.06, 4);
    JudgeOptions options = looking_aside(10, 128);
    const double by_model = judge_modern(reference, test, options)->max_ratio;
    options.csf_table = std::make_shared<const CsfTable>(CsfTable::from_model(CsfModel::castle));
    EXPECT_NEAR(judge_modern(reference, test, options)->max_ratio / by_model, 1, 0.02); // the table's own error

    CsfSamples dull = options.csf_table->samples();
    for (double& s : dull.sensitivity) s /= 4;
    auto dull_viewer = CsfTable::create(std::move(dull));
    ASSERT_TRUE(dull_viewer);
    options.csf_table = std::make_shared<const CsfTable>(*std::move(dull_viewer));
    EXPECT_LT(judge_modern(reference, test, options)->max_ratio, 0.6 * by_model); // less masking makes up for some
}

// The images are the flat picture that is drawn for a headset: its lens is none of their business.
TEST(JudgeModern, TakesTheAnglesOfThePictureWhateverTheLens) {
    constexpr int side = 256;
    const Image reference = flat(side, side, 20), test = draw({8, 0.1, 20, 0, 0}, side);
    JudgeOptions options = looking_aside(10, side);
    const double without = judge_modern(reference, test, options)->max_ratio;
    options.display.lens = {{0, 2 * default_ppd()}, {50, 1.2 * default_ppd()}};
    EXPECT_EQ(judge_modern(reference, test, options)->max_ratio, without);
}

// Daly's model depends on the distance of what is looked at.
TEST(ThresholdMapModern, IsOfTheDisplaysDistance) {
    constexpr int side = 256;
    for (const double metres : {0.5, 3.0}) {
        JudgeOptions options = looking_aside(28, side);
        options.csf = CsfModel::daly;
        options.display.distance = Metres(metres);
        set_pixels_per_degree(options.display, PixelsPerDegree(default_ppd()));
        const auto map = threshold_map_modern(flat(side, side, 20), options);
        ASSERT_TRUE(map) << map.error().message;
        double best = 0;
        for (int k = 0; k < 8; ++k) {
            const double cpd = (k == 0 ? 1 : 0.3228 * std::exp2(1 - k)) * default_ppd() / 2;
            best = std::max(best,
                            sensitivity(CsfModel::daly, stimulus_of({.distance = Metres(metres)}, CyclesPerDegree(cpd),
                                                                    Degrees(28), Luminance(20))));
        }
        constexpr double base_band = 0.02; // which may know a better frequency
        EXPECT_NEAR(map->at(side / 2, side / 2) * best / 20, 1, base_band) << metres;
    }
}

TEST(ThresholdMapModern, OnFlatFieldsIsTheClosedForm) {
    constexpr double tolerance = 1e-3; // of the judge's tables
    constexpr int side = 1024;
    for (const double luminance : {0.7, 21.0, 95.0}) {
        // A dim strip, too far to matter at (0, 0), moves the tables' nodes away from `luminance`.
        Image image = flat(side, side, luminance);
        for (int y = 0; y < side; ++y) {
            for (int x = side - 8; x < side; ++x) image.at(x, y) = 0.6F;
        }
        for (const double e : {0.0, 7.3, 24.6}) {
            const auto map = threshold_map_modern(image, looking_beside_the_corner(e, side));
            ASSERT_TRUE(map.has_value());
            double best = closed_form(default_ppd() / 2, luminance, e);
            for (int k = 1; k < 8; ++k) {
                best = std::max(best, closed_form(0.3228 * std::exp2(1 - k) * default_ppd() / 2, luminance, e));
            }
            EXPECT_NEAR(map->at(0, 0) * best / luminance, 1, tolerance) << luminance << " cd/m2, " << e << " degrees";
        }
    }
}

TEST(ThresholdMapModern, RisesWhereTheReferenceMasks) {
    Image image = flat(256, 256, 20);
    const Image rough = noise(256, 20, 0.8, 4);
    for (int y = 0; y < 256; ++y) {
        for (int x = 128; x < 256; ++x) image.at(x, y) = rough.at(x, y);
    }
    const auto map = threshold_map_modern(image, {});
    double left = 0, right = 0;
    for (int y = 96; y < 160; ++y) {
        for (int x = 16; x < 48; ++x) {
            left += map->at(x, y);
            right += map->at(x + 160, y);
        }
    }
    EXPECT_GT(right, 1.05 * left);
}

TEST(JudgeModern, StaysFiniteInTheDarkAndInFullContrast) {
    const Image black = flat(128, 128, 0);
    Image dots = black;
    for (int y = 0; y < 128; y += 2) {
        for (int x = 0; x < 128; x += 2) dots.at(x, y) = 10000;
    }
    for (const auto& options : {JudgeOptions{}, looking_aside(20, 128)}) {
        for (const auto& [a, b] : {std::pair(black, dots), std::pair(dots, black)}) {
            const auto judged = judge_modern(a, b, options);
            EXPECT_TRUE(std::isfinite(judged->max_ratio));
            EXPECT_EQ(judged->visible_pixels, judged->pixels);
        }
    }
}

TEST(JudgeModern, RefusesBadInput) {
    const Image good = flat(8, 8, 1);
    for (const float value : {-1.0F, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
        Image bad = good;
        bad.values[11] = value;
        const auto judged = judge_modern(good, bad, {});
        ASSERT_FALSE(judged);
        EXPECT_NE(judged.error().message.find("(3, 1)"), std::string::npos) << judged.error().message;
        EXPECT_FALSE(judge_modern(bad, good, {}));
        EXPECT_FALSE(threshold_map_modern(bad, {}));
    }
    EXPECT_FALSE(judge_modern(good, flat(9, 8, 1), {}));
    EXPECT_FALSE(judge_modern(flat(0, 0, 1), flat(0, 0, 1), {}));
    Image colour = flat(8, 8, 1);
    colour.channels = 3;
    EXPECT_FALSE(judge_modern(colour, colour, {}));
    JudgeOptions options;
    options.beta = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(judge_modern(good, good, options));
    options = {};
    options.gaze_px = glm::dvec2(std::numeric_limits<double>::infinity(), 0);
    EXPECT_FALSE(judge_modern(good, good, options));
    options = {};
    options.display.distance = Metres(-1);
    EXPECT_FALSE(judge_modern(good, good, options));
    options = {};
    options.csf = CsfModel::castle_yellow_violet; // of colour
    EXPECT_FALSE(judge_modern(good, good, options));
    EXPECT_FALSE(threshold_map_modern(good, options));
    options.csf_table = std::make_shared<const CsfTable>(CsfTable::standard()); // in the model's place
    EXPECT_TRUE(judge_modern(good, good, options));
}

} // namespace
} // namespace unseen::perception
