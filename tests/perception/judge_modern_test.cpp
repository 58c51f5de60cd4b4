// The modern judge is not blind and not nervous: single gratings, a disc and an offset become visible where the
// contrast sensitivity function says so; what is identical, masked by the reference or far from the gaze does not. Here
// it judges for the median person, who is castleCSF. People: tests/calibration/people_test.cpp.
#include <unseen/perception/judge.h>

#include <unseen/perception/internal/chroma.h>

#include "testing.h"

namespace unseen::perception::judge_modern_test {

Image flat(int width, int height, double value) {
    const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    return {width, height, 1, std::vector<float>(pixels, static_cast<float>(value))};
}

double default_ppd() { return pixels_per_degree(Display{}).value(); }

struct Gabor {
    double freq_cpd = 4, contrast = 0.1, luminance = 20, orientation_deg = 0, phase = 0;
    double radius_cycles = 1.5; // the envelope's standard deviation; its area is pi radius^2

    double sigma_deg() const { return radius_cycles / freq_cpd; }
    SquareDegrees area() const { return SquareDegrees(std::numbers::pi * sigma_deg() * sigma_deg()); }
};

// Over the luminance, by column and row.
double modulation(const Gabor& g, int side, int x, int y) {
    const double sigma = g.sigma_deg(), angle = g.orientation_deg * std::numbers::pi / 180;
    const double dx = (x - side / 2) / default_ppd(), dy = (y - side / 2) / default_ppd();
    const double along = dx * std::cos(angle) + dy * std::sin(angle);
    const double envelope = std::exp(-(dx * dx + dy * dy) / (2 * sigma * sigma));
    return g.contrast * envelope * std::cos(2 * std::numbers::pi * g.freq_cpd * along + g.phase);
}

Image draw(const Gabor& g, int side) {
    Image image = flat(side, side, 0);
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x)
            image.at(x, y) = static_cast<float>(g.luminance * (1 + modulation(g, side, x, y)));
    return image;
}

// The same in a direction of colour (0: red-green, 1: yellow-violet), of one luminance.
Image draw_isoluminant(const Gabor& g, int side, int direction) {
    Image image{side, side, 3, std::vector<float>(static_cast<std::size_t>(3 * side * side))};
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x) {
            glm::dvec2 chroma(0);
            chroma[direction] = g.luminance * modulation(g, side, x, y);
            const glm::dvec3 rgb = rgb_of(g.luminance, chroma);
            for (int k = 0; k < 3; ++k) image.at(x, y, k) = static_cast<float>(rgb[k]);
        }
    return image;
}

JudgeOptions median() { return {.gain = median_person.gain}; }

// A gaze that sees the window's centre at `degrees`.
JudgeOptions looking_aside(double degrees, int side) {
    JudgeOptions options = median();
    if (degrees > 0) {
        const double px = std::tan(degrees * std::numbers::pi / 180) * options.display.distance.value() /
                          options.display.pixel_pitch.value();
        options.gaze_px = glm::dvec2(0.5 * side + px, 0.5 * side);
    }
    return options;
}

double closed_form(const Gabor& g, double eccentricity, CsfModel model = CsfModel::castle) {
    Stimulus s;
    s.frequency = CyclesPerDegree(g.freq_cpd);
    s.luminance = Luminance(g.luminance);
    s.eccentricity = Degrees(eccentricity);
    s.area = g.area();
    return sensitivity(model, s);
}
// Of a patch of patch_area().
double closed_form(double freq_cpd, double luminance, double eccentricity) {
    return closed_form({.freq_cpd = freq_cpd, .luminance = luminance}, eccentricity);
}

// 5 standard deviations of the envelope across, at least 256 pixels and at most 700.
int side_for(const Gabor& g) {
    return std::clamp(static_cast<int>(5 * g.sigma_deg() * default_ppd()) / 2 * 2, 256, 700);
}

double largest_ratio(const Gabor& g, double eccentricity) {
    const int side = side_for(g);
    const auto judged = judge_modern(flat(side, side, g.luminance), draw(g, side), looking_aside(eccentricity, side));
    EXPECT_TRUE(judged.has_value());
    return judged ? judged->max_ratio : 0;
}

constexpr double three_decibels = 1.4125375446227544; // 10^(3/20)

// Below 1/S by 3 dB a grating must not be visible, above it by 3 dB it must be.
void expect_threshold_within_3_db(Gabor g, double eccentricity, int& tested) {
    const double threshold = 1 / closed_form(g, eccentricity);
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
            for (const double freq : {0.5, 1.0, 2.0, 4.0, 8.0, 16.0})
                expect_threshold_within_3_db({freq, 0, luminance, 0, 0}, eccentricity, tested);
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

TEST(JudgeModern, SeesGaborsOfAnyAreaAtTheirThreshold) {
    int tested = 0;
    for (const double freq : {1.0, 2.0, 4.0, 5.5, 8.0, 13.0}) {
        for (const double radius_cycles : {1.0, 3.0, 6.0}) {
            for (const double orientation : {0.0, 45.0})
                expect_threshold_within_3_db({freq, 0, 20, orientation, 0, radius_cycles}, 0, tested);
        }
    }
    EXPECT_EQ(tested, 36);
}

TEST(JudgeModern, SeesMoreOfWhatIsLarger) {
    double last = 0;
    for (const double radius_cycles : {0.4, 1.2, 4.0, 8.0}) {
        const double v = largest_ratio({4, 0.02, 20, 0, 0, radius_cycles}, 0);
        EXPECT_GT(v, 1.1 * last) << radius_cycles;
        last = v;
    }
}

// Gratings of one luminance, by both judges: castleCSF's branches of colour.
TEST(JudgeModern, SeesIsoluminantGaborsAtTheirThreshold) {
    constexpr std::array models = {CsfModel::castle_red_green, CsfModel::castle_yellow_violet};
    const JudgeOptions second = second_judge_options(median_person);
    for (const int direction : {0, 1}) {
        std::vector<double> all;
        for (const double luminance : {5.0, 50.0})
            for (const double freq : {0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.5, 8.0})
                for (const double radius_cycles : {1.0, 1.5, 4.0})
                    for (const double eccentricity : {0.0, 10.0}) {
                        Gabor g{freq, 0, luminance, 30, 0.5, radius_cycles};
                        const int side = side_for(g);
                        if (5 * g.sigma_deg() * default_ppd() > side) continue; // cut off by the picture's border
                        g.contrast = 1 / closed_form(g, eccentricity, models[static_cast<std::size_t>(direction)]);
                        if (g.contrast > (direction == 0 ? 0.1 : 0.8)) continue; // no display shows it
                        JudgeOptions options = looking_aside(eccentricity, side);
                        const Image grey = flat(side, side, luminance), test = draw_isoluminant(g, side, direction);
                        const auto judged = require(judge_modern(grey, test, options));
                        EXPECT_TRUE(judged->judges_colour);
                        all.push_back(judged->max_ratio);
                        EXPECT_GT(judged->max_ratio, 1 / three_decibels) << direction << ' ' << freq << ' ' << luminance
                                                                         << ' ' << radius_cycles << ' ' << eccentricity;
                        EXPECT_LT(judged->max_ratio, three_decibels) << direction << ' ' << freq << ' ' << luminance
                                                                     << ' ' << radius_cycles << ' ' << eccentricity;
                        options.csf = second.csf, options.beta = second.beta, options.gain = second.gain;
                        options.colour_gain = second.colour_gain;
                        EXPECT_NEAR(require(judge_modern(grey, test, options))->max_ratio / judged->max_ratio, 1, 0.15);
                    }
        ASSERT_GE(all.size(), 30u);
        std::ranges::nth_element(all, all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2));
        EXPECT_NEAR(all[all.size() / 2], 1, 0.1) << direction;
    }
}

// A pattern in all three channels is seen as their root sum of squares, as castleCSF pools them.
TEST(JudgeModern, AddsTheEnergiesOfChannels) {
    const Gabor g{2, 0.02, 20, 0, 0};
    const int side = side_for(g);
    const Image grey = flat(side, side, 20), luminance = draw(g, side), red_green = draw_isoluminant(g, side, 0);
    Image both = red_green;
    for (std::size_t i = 0; i < both.values.size(); ++i) both.values[i] += luminance.values[i / 3] - grey.values[i / 3];
    const auto seen = [&](const Image& test) { return require(judge_modern(grey, test, median()))->max_ratio; };
    EXPECT_NEAR(seen(both), std::hypot(seen(luminance), seen(red_green)), 0.05 * seen(both));
}

// Greys are judged alike whether they are told by one number or by three, and colours that do not differ add nothing.
TEST(JudgeModern, JudgesColourOnlyWhereItDiffers) {
    const Gabor g{4, 0.03, 20, 0, 0};
    const Image reference = flat(96, 96, 20), test = draw(g, 96);
    const auto three = [](const Image& grey, glm::vec3 tint) {
        Image rgb{grey.width, grey.height, 3, {}};
        for (const float value : grey.values)
            for (int k = 0; k < 3; ++k) rgb.values.push_back(value * tint[k]);
        return rgb;
    };
    const auto as_grey = require(judge_modern(reference, test, {}));
    EXPECT_FALSE(as_grey->judges_colour);
    for (const auto& [a, b] : {std::pair(three(reference, glm::vec3(1)), three(test, glm::vec3(1))),
                               std::pair(reference, three(test, glm::vec3(1)))}) {
        const auto judged = require(judge_modern(a, b, {}));
        EXPECT_FALSE(judged->judges_colour);
        EXPECT_NEAR(judged->max_ratio, as_grey->max_ratio, 1e-4 * as_grey->max_ratio);
    }
    const glm::vec3 tint = glm::vec3(rgb_of(1, {0.05, -0.1}));
    EXPECT_FALSE(require(judge_modern(three(reference, tint), three(reference, tint), {}))->judges_colour);
    EXPECT_TRUE(require(judge_modern(three(reference, tint), three(test, tint), {}))->judges_colour);
}

// A seam of red and green of one luminance moves: nothing that luminance tells.
TEST(JudgeModern, SeesASeamOfOneLuminanceMove) {
    const auto seam = [](int at) {
        Image image{128, 128, 3, std::vector<float>(3 * 128 * 128)};
        for (int y = 0; y < 128; ++y)
            for (int x = 0; x < 128; ++x) {
                const glm::dvec3 rgb = rgb_of(30, {x < at ? 2.0 : -2.0, 0});
                for (int k = 0; k < 3; ++k) image.at(x, y, k) = static_cast<float>(rgb[k]);
            }
        return image;
    };
    EXPECT_GT(require(judge_modern(seam(64), seam(67), {}))->max_ratio, 2);
    EXPECT_EQ(require(judge_modern(seam(64), seam(64), {}))->max_ratio, 0);
}

TEST(JudgeModern, SeesSoManyTimesAsMuchAsThePerson) {
    const Image reference = flat(128, 128, 20), test = draw({4, 0.01, 20, 0, 0}, 128);
    const auto seen = [&](const Person& person) {
        return judge_modern(reference, test, {.gain = person.gain})->max_ratio;
    };
    for (const Person& person : people)
        EXPECT_NEAR(seen(person) / seen(median_person), person.gain, 1e-4) << person.name;
    EXPECT_EQ(judge_modern(reference, test, {})->max_ratio, seen(default_person));
}

// Prepared once, it judges as if it had been made for each picture.
TEST(JudgeModern, MayBeAskedAgain) {
    const Image reference = flat(96, 96, 20), a = draw({4, 0.03, 20, 0, 0}, 96), b = draw({2, 0.05, 20, 0, 0}, 96);
    const auto judge = Judge::create(reference, {});
    const double first = judge->judge(a)->max_ratio;
    EXPECT_NE(judge->judge(b)->max_ratio, first);
    EXPECT_EQ(judge->judge(a)->max_ratio, first);
    EXPECT_EQ(judge_modern(reference, b, {})->max_ratio, judge->judge(b)->max_ratio);
}

// Of patches of any size.
TEST(SecondJudge, SeesWhatBartenSays) {
    for (const double freq : {2.0, 5.5}) {
        for (const double radius_cycles : {2.0, 6.0}) {
            Gabor g{freq, 0, 20, 0, 0, radius_cycles};
            g.contrast = 1 / closed_form(g, 0, CsfModel::barten_fitted);
            const int side = side_for(g);
            JudgeOptions options = second_judge_options(median_person);
            options.gain = 1;
            const auto judged = judge_modern(flat(side, side, 20), draw(g, side), options);
            EXPECT_NEAR(20 * std::log10(judged->max_ratio), 0, 3) << freq << " cpd, " << radius_cycles;
        }
    }
}

TEST(SecondJudge, FadesWithEccentricityAsTheFirstDoes) {
    const Image reference = flat(256, 256, 20), test = draw({4, 0.1, 20, 0, 0}, 256);
    const auto fading = [&](JudgeOptions options) {
        options.gaze_px.reset();
        const double looked_at = judge_modern(reference, test, options)->max_ratio;
        options.gaze_px = looking_aside(15, 256).gaze_px;
        return judge_modern(reference, test, options)->max_ratio / looked_at;
    };
    EXPECT_NEAR(fading(second_judge_options(median_person)) / fading(median()), 1, 0.3);
}

TEST(SecondJudge, SeesForItsPerson) {
    const Image reference = flat(128, 128, 20), test = draw({4, 0.01, 20, 0, 0}, 128);
    double last = 0;
    for (const Person& person : people) {
        const double v = judge_modern(reference, test, second_judge_options(person))->max_ratio;
        EXPECT_GT(v, last) << person.name;
        last = v;
    }
    Display far;
    far.distance = Metres(1);
    const auto options = second_judge_options(default_person, far, glm::dvec2(3, 4));
    EXPECT_EQ(options.display.distance.value(), 1);
    EXPECT_EQ(options.gaze_px, glm::dvec2(3, 4));
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
            const auto judged = judge_modern(flat(side, side, 20), with_disc(20, contrast, 1, side), median());
            EXPECT_GE(judged->max_ratio, 1) << side;
            EXPECT_GE(judged->visibility.at(side / 2 + 30, side / 2), 1) << side; // near its edge
        }
    }
}

TEST(JudgeModern, SeesAChangeWithoutAnyEdge) {
    for (const int width : {1, 2, 5, 64, 300}) {
        const auto judged = judge_modern(flat(width, 64, 20), flat(width, 64, 22), median());
        EXPECT_EQ(judged->visible_pixels, judged->pixels) << width;
    }
}

std::uint32_t next(std::uint32_t& seed) { return seed = seed * 1664525U + 1013904223U; }

Image noise(int side, double luminance, double amplitude, std::uint32_t seed) {
    Image image = flat(side, side, 0);
    for (float& v : image.values) v = static_cast<float>(luminance * (1 + amplitude * (next(seed) / 2147483648.0 - 1)));
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
    EXPECT_GT(judge_modern(smooth, smooth_test, median())->visible_pixels,
              2 * judge_modern(rough, rough_test, median())->visible_pixels);
    // The strong error in `rough` against `smooth` is not its own mask: twice the error, twice the visibility.
    Image half = smooth;
    for (std::size_t i = 0; i < half.values.size(); ++i) half.values[i] = 0.5F * (smooth.values[i] + rough.values[i]);
    EXPECT_NEAR(judge_modern(smooth, rough, median())->max_ratio / judge_modern(smooth, half, median())->max_ratio, 2,
                1e-4);
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
    const auto corner = judge_modern(flat(512, 512, 20), test, median());
    Image centred = flat(512, 512, 20);
    centred.at(256, 256) += 5;
    const auto centre = judge_modern(flat(512, 512, 20), centred, median());
    EXPECT_NEAR(corner->max_ratio / centre->max_ratio, 1, 0.2); // sample phases differ
    JudgeOptions aside = median();
    aside.gaze_px = glm::dvec2(1603, 256);
    EXPECT_LT(judge_modern(flat(512, 512, 20), test, aside)->max_ratio, 0.2 * corner->max_ratio);
}

TEST(JudgeModern, CountsTheWholeBlockOfALowBand) {
    Gabor g{0.35, 0.03, 20, 0, 0};
    const Image test = draw(g, 512);
    const auto judged = judge_modern(flat(512, 512, 20), test, median());
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
    JudgeOptions options = median();
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
    auto dull_viewer = require(CsfTable::create(std::move(dull)));
    options.csf_table = std::make_shared<const CsfTable>(*std::move(dull_viewer));
    EXPECT_LT(judge_modern(reference, test, options)->max_ratio, 0.6 * by_model); // less masking makes up for some
}

// Of small patches a viewer's table knows how well they are seen; of large ones so many times as well as by castle's
// law.
TEST(JudgeModern, SumsOverSpaceAsTheViewerDoes) {
    const Gabor small{4, 0.005, 20, 0, 0, 1.5}, large{4, 0.002, 20, 0, 0, 12};
    const auto seen = [](const Gabor& g, double summation) {
        CsfSamples samples = CsfTable::from_model(CsfModel::castle).samples();
        samples.summation = summation;
        const int side = side_for(g);
        JudgeOptions options = median();
        options.csf_table = std::make_shared<const CsfTable>(*CsfTable::create(std::move(samples)));
        return judge_modern(flat(side, side, g.luminance), draw(g, side), options)->max_ratio;
    };
    EXPECT_NEAR(seen(small, 1.5) / seen(small, 1), 1, 0.1);
    const double expected =
        summation_gain(CyclesPerDegree(4), large.area(), 1.5) / summation_gain(CyclesPerDegree(4), large.area());
    EXPECT_GT(expected, 1.3);
    EXPECT_NEAR(seen(large, 1.5) / seen(large, 1) / expected, 1, 0.12);
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
        const auto map = require(threshold_map_modern(flat(side, side, 20), options));
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
            const auto map = require(threshold_map_modern(image, looking_beside_the_corner(e, side)));
            double best = closed_form(default_ppd() / 2, luminance, e);
            for (int k = 1; k < 8; ++k)
                best = std::max(best, closed_form(0.3228 * std::exp2(1 - k) * default_ppd() / 2, luminance, e));
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
    const auto map = threshold_map_modern(image, median());
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
    const auto dotted = [&](float cdm2) {
        Image dots = black;
        for (int y = 0; y < 128; y += 2)
            for (int x = 0; x < 128; x += 2) dots.at(x, y) = cdm2;
        return dots;
    };
    JudgeOptions steep, opposite = looking_aside(20, 128);
    steep.beta = 8, steep.gain = 1000;
    opposite.gaze_px = glm::dvec2(-1e300, 1e300);
    for (const float cdm2 : {1e4f, 1e30f}) {
        const Image dots = dotted(cdm2);
        for (const auto& options :
             {JudgeOptions{}, second_judge_options(strict_person), steep, looking_aside(20, 128), opposite}) {
            for (const auto& [a, b] : {std::pair(black, dots), std::pair(dots, black)}) {
                const auto judged = judge_modern(a, b, options);
                EXPECT_TRUE(std::isfinite(judged->max_ratio));
                // Nobody sees in light of 1e30 cd/m2, nor behind the head.
                if (cdm2 == 1e4f && options.gaze_px != opposite.gaze_px)
                    EXPECT_EQ(judged->visible_pixels, judged->pixels);
            }
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
        EXPECT_FALSE(Judge::create(bad, {}));
        EXPECT_FALSE(threshold_map_modern(bad, {}));
    }
    EXPECT_FALSE(judge_modern(good, flat(9, 8, 1), {}));
    EXPECT_FALSE(judge_modern(flat(0, 0, 1), flat(0, 0, 1), {}));
    Image colour = flat(8, 8, 1);
    colour.channels = 3;
    EXPECT_FALSE(judge_modern(colour, colour, {})); // a third of the numbers
    colour.values = std::vector<float>(3 * 64, 1.0f);
    EXPECT_TRUE(judge_modern(colour, colour, {}));
    colour.values[35] = -20; // its luminance is below 0
    EXPECT_FALSE(judge_modern(good, colour, {}));
    JudgeOptions options;
    options.beta = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(judge_modern(good, good, options));
    for (const double gain : {0.0, -1.0, 1e4, std::nan("")}) {
        EXPECT_FALSE(judge_modern(good, good, {.gain = gain}));
        EXPECT_FALSE(judge_modern(good, good, {.colour_gain = gain}));
    }
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

} // namespace unseen::perception::judge_modern_test
