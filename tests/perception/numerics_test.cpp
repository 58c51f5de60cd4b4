// Hard cases of numbers in light, sensitivity and pictures: the entries of docs/numerics.md, each by its name. In each
// the naive twin, a formula as papers have it, is shown to fail where what the library does holds its bound.

#include <unseen/perception/csf.h>
#include <unseen/perception/display.h>
#include <unseen/perception/internal/motion.h>
#include <unseen/perception/judge.h>
#include <unseen/vdtree/internal/contrast_classes.h>

#include "fold/fold_classes.h"
#include "judge/fast_math.h"
#include "judge/modern_masking.h"
#include "luminance_images.h"
#include "spatiovelocity.h"
#include "testing.h"

namespace unseen::perception::numerics_test {

using support::flat;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double denormal = 5e-324;

double naive_contrast(double lo, double hi) { return (hi - lo) / (hi + lo); }

TEST(Numerics, ContrastOfNothingOverNothing) {
    EXPECT_TRUE(std::isnan(naive_contrast(0, 0)));
    // Under lights, in classes: nothing to see is class 0, also where 0 is no light at all.
    const vdtree::ContrastClasses classes({.offset = 0, .span = 100});
    EXPECT_EQ(classes.class_of({0, 0}, 0), 0);
    EXPECT_GT(classes.class_of({0, 1}, 0), 0);
    // On a display black is some light, and where differences are none, so is the contrast.
    const Classes looks(Display{}, fine_contrasts);
    EXPECT_EQ(looks.contrast(0, {0, 0}), 0);
    EXPECT_EQ(looks.contrast(vdtree::LuminanceRange{0, 0}), 0);
    // Nothing but a number that says so folds.
    EXPECT_EQ(fine_contrasts.of(naive_contrast(0, 0)), fine_contrasts.count() - 1);
    EXPECT_EQ(CsfTable::standard().highest_visible_frequency(not_a_number, Degrees(0), Luminance(50)).value(),
              infinity);
}

double naive_steps(double cdm2, double lowest, double log2_step) {
    return std::ceil(std::log2(cdm2 / lowest) / log2_step);
}

TEST(Numerics, LuminancesOf0AndDenormalAndDimAndBright) {
    EXPECT_EQ(naive_steps(0, 0.5, 0.5), -infinity) << "no number of a class";
    EXPECT_LT(naive_steps(1e-6, 0.5, 0.5), 0);
    EXPECT_GT(naive_steps(1e5, 0.5, 0.5), static_cast<double>(LuminanceClasses::count));
    const LuminanceClasses classes{Display{}};
    for (const double dim : {0.0, denormal, 1e-300, 1e-6}) EXPECT_EQ(classes.of(dim), 0u) << dim;
    EXPECT_EQ(classes.of(1e5), LuminanceClasses::count - 1);
    const CsfTable& table = CsfTable::standard();
    double before = 0;
    for (const double cdm2 : {0.0, denormal, 1e-300, 1e-6, 1e-3, 0.1, 10.0, 100.0}) {
        for (const double degrees : {0.0, 20.0, 90.0}) {
            const double s = table.monotone_sensitivity(CyclesPerDegree(2), Degrees(degrees), Luminance(cdm2));
            ASSERT_TRUE(std::isfinite(s) && s >= 0) << cdm2;
            if (degrees == 0) {
                EXPECT_GE(s, before);
                before = s;
            }
        }
    }
    EXPECT_EQ(table.monotone_sensitivity(CyclesPerDegree(2), Degrees(0), Luminance(1e5)),
              table.monotone_sensitivity(CyclesPerDegree(2), Degrees(0), Luminance(1e4)));
    // What is negative or no number is never called invisible.
    for (const double none : {-1.0, -denormal, not_a_number})
        EXPECT_EQ(table.highest_visible_frequency(0.5, Degrees(0), Luminance(none)).value(), infinity);
}

float naive_weber(float difference, float mean) { return difference / mean; }

TEST(Numerics, PicturesOfNoLightAndOfTheSun) {
    EXPECT_TRUE(std::isnan(naive_weber(0, 0)));
    for (const float cdm2 : {0.0f, std::numeric_limits<float>::denorm_min(), 1e-6f, 1.0f, 1e5f, 1e6f}) {
        Display display;
        display.peak = Luminance(1e6);
        const Image reference = flat(33, 17, cdm2);
        const auto judge = require(Judge::create(reference, {.display = display}));
        EXPECT_EQ(judge->judge(reference)->max_ratio, 0) << "the same is the same";
        for (const float other : {0.0f, 1e-6f, 1e5f, 1e6f}) {
            const auto seen = require(judge->judge(flat(33, 17, other)));
            ASSERT_TRUE(std::isfinite(seen->max_ratio)) << cdm2 << " " << other;
            if (other >= 1e5f && other > 2 * cdm2) EXPECT_GT(seen->max_ratio, 1) << cdm2 << " " << other;
            for (const float v : seen->visibility.values)
                ASSERT_TRUE(v >= 0 && std::isfinite(v)) << cdm2 << " " << other;
        }
    }
}

double naive_decode(double code) { return std::pow(code, 2.2); }

TEST(Numerics, CodesBelow0AndAbove1) {
    EXPECT_TRUE(std::isnan(naive_decode(-1e-9)));
    constexpr double bound = 1e-12;
    for (const TransferFunction transfer : {TransferFunction::srgb, TransferFunction::gamma, TransferFunction::linear,
                                            TransferFunction::pq, TransferFunction::table}) {
        Display display;
        display.transfer = transfer;
        display.table = {0, 0.1, 0.4, 1};
        ASSERT_TRUE(validate(display));
        double before = -infinity;
        for (int i = -200; i <= 300; ++i) {
            const double light = decode(display, i / 200.0);
            ASSERT_GE(light, before) << i;
            before = light;
            if (i >= 0 && i <= 200 && transfer != TransferFunction::pq)
                EXPECT_NEAR(encode(display, light), i / 200.0, bound) << i;
        }
        EXPECT_TRUE(std::isnan(decode(display, not_a_number)));
    }
}

// Of castleCSF's law of glare, by the paper: 1 - (1 + p4 / L)^-p5.
double naive_glare(double p4, double p5, double cdm2) { return 1 - std::pow(1 + p4 / cdm2, -p5); }

TEST(Numerics, GlareInBrightLight) {
    constexpr double p4 = 5.58341e-7, p5 = 9.66862e9;
    const auto truth = [&](long double cdm2) {
        return -std::expm1(-static_cast<long double>(p5) * std::log1p(p4 / cdm2));
    };
    EXPECT_GT(std::abs(naive_glare(p4, p5, 1e8) / static_cast<double>(truth(1e8)) - 1), 1e-3);
    // What the sensitivity to a grating owes to the law, twice: bright light takes it away as 1 / L does, smoothly.
    const auto at = [](double cdm2) { return sensitivity(CsfModel::castle, {.luminance = Luminance(cdm2)}); };
    const double first = std::log(at(1.00e8) / at(1.01e8)), second = std::log(at(1.01e8) / at(1.0201e8));
    EXPECT_NEAR(second / first, 1, 1e-3);
    const auto naive = [&](double cdm2) { return naive_glare(p4, p5, cdm2); };
    const double naive_first = std::log(naive(1.00e8) / naive(1.01e8)),
                 naive_second = std::log(naive(1.01e8) / naive(1.0201e8));
    EXPECT_FALSE(std::abs(naive_second / naive_first - 1) <= 1e-3);
}

double naive_place(double cpd) { return 12 * std::log2(cpd * 16); } // on an axis of twelfths of octaves from 1/16 cpd

TEST(Numerics, FrequenciesOf0AtTheClampAndBeyondTheCutoff) {
    EXPECT_EQ(naive_place(0), -infinity);
    const CsfTable& table = CsfTable::standard();
    for (const double cdm2 : {1e-3, 0.5, 50.0, 1e4}) {
        for (const double degrees : {0.0, 10.0, 90.0, 180.0}) {
            const Degrees e(degrees);
            const Luminance l(cdm2);
            const double peak = table.peak_sensitivity(e, l);
            double before = infinity;
            for (const double cpd :
                 {0.0, denormal, 1e-300, 1e-3, 1 / 16.0, 1.0, 30.0, 64.0, 64.0000001, 100.0, 1e4, 1e300}) {
                const double s = table.monotone_sensitivity(CyclesPerDegree(cpd), e, l);
                ASSERT_TRUE(std::isfinite(s) && s >= 0) << cpd;
                ASSERT_LE(s, before) << cpd << ": finer is not seen better";
                if (cpd <= 1 / 16.0) EXPECT_EQ(s, peak) << cpd << ": nothing coarse is folded";
                before = s;
            }
            EXPECT_LT(before, 1e-100) << "far above the cutoff nothing is seen";
        }
    }
    // The closed form has no frequency of 0: it says so.
    for (const CsfModel model : csf_models)
        EXPECT_TRUE(std::isnan(sensitivity(model, {.frequency = CyclesPerDegree(0)}))) << name(model);
}

// The frequency at which castleCSF's transient channel peaks, to a power.
double naive_transient(double cdm2) { return std::pow(4.7036 + 2.41482 * std::log10(cdm2), 0.1898); }

TEST(Numerics, LuminancesAt00113AndBelow) {
    EXPECT_TRUE(std::isnan(naive_transient(0.0112)));
    EXPECT_TRUE(std::isnan(naive_transient(1e-6)));
    double before = 0;
    for (double cdm2 = 1e-9; cdm2 < 1; cdm2 *= 1.05) {
        for (const double hertz : {0.0, 8.0}) {
            const double s =
                sensitivity(CsfModel::castle,
                            {.frequency = CyclesPerDegree(1), .luminance = Luminance(cdm2), .temporal = Hertz(hertz)});
            ASSERT_TRUE(std::isfinite(s) && s >= 0 && s < 100) << cdm2;
            if (hertz > 0) continue;
            if (before > 1e-3) EXPECT_LT(std::abs(std::log(s / before)), 0.3) << "a spike at " << cdm2;
            before = s;
        }
    }
}

double naive_decay(double decades_per_degree, double degrees) {
    return 1 / std::pow(10.0, -decades_per_degree * degrees);
}

TEST(Numerics, EccentricitiesUpTo180DegreesInTables) {
    EXPECT_EQ(naive_decay(11.6, 180), infinity) << "a threshold that no double holds";
    const auto fading = require(CsfTable::from_model(CsfModel::castle_red_green, {.field = VisualField::nasal}));
    for (const CsfTable& table : {CsfTable::standard(), *fading}) {
        for (const double cpd : {1 / 16.0, 2.0, 64.0}) {
            double before = infinity;
            for (const double degrees :
                 {0.0, denormal, 1e-9, 20.0, 90.0, 119.999, 120.0, 150.0, 180.0, 1e300, infinity}) {
                const double s = table.monotone_sensitivity(CyclesPerDegree(cpd), Degrees(degrees), Luminance(100));
                ASSERT_TRUE(std::isfinite(s) && s >= 0) << degrees;
                ASSERT_LE(s, before) << degrees;
                before = s;
            }
        }
        EXPECT_EQ(table.highest_visible_frequency(0.5, Degrees(not_a_number), Luminance(50)).value(), infinity);
    }
}

// Along the table's last slope.
double naive_inverse(double log2_s, double slope, double contrast) {
    return std::exp2((std::log2(1 / contrast) - log2_s) / slope);
}

TEST(Numerics, FrequenciesBackFromContrastsAtBothEnds) {
    EXPECT_EQ(naive_inverse(-20, -3, 0), 0) << "1 / 0 is what the next one takes for the finest";
    EXPECT_TRUE(std::isnan(naive_inverse(-20, 0, std::exp2(20)))) << "a plateau";
    const CsfTable& table = CsfTable::standard();
    constexpr double bound = 1e-9; // of the sensitivity, there and back
    for (const double degrees : {0.0, 15.0, 60.0}) {
        const Degrees e(degrees);
        const Luminance l(50);
        const auto inverse = [&](double contrast) { return table.highest_visible_frequency(contrast, e, l).value(); };
        const double peak = table.peak_sensitivity(e, l);
        EXPECT_EQ(inverse(0), 0);
        for (const double faint : {denormal, 1e-300, 0.999 / peak}) EXPECT_EQ(inverse(faint), 0) << faint;
        double before = 0;
        for (const double contrast : {1.001 / peak, 0.01, 0.5, 1.0, 1e3, 1e100, 1e300}) {
            if (contrast * peak <= 1) continue;
            const double cpd = inverse(contrast);
            ASSERT_TRUE(std::isfinite(cpd) && cpd >= before) << contrast;
            before = cpd;
            const double s = table.monotone_sensitivity(CyclesPerDegree(cpd), e, l);
            if (s > 0) EXPECT_NEAR(std::log(s * contrast), 0, bound * std::max(1.0, std::log(contrast))) << contrast;
        }
        for (const double none : {-denormal, -1.0, not_a_number}) EXPECT_EQ(inverse(none), infinity) << none;
        EXPECT_EQ(inverse(infinity) > before, true);
    }
}

double naive_inhibition(double x) { return 1 - std::exp(-x * x); }

TEST(Numerics, InhibitionOfCoarseGratings) {
    EXPECT_EQ(naive_inhibition(1e-9), 0) << "and the noise infinite";
    for (const CsfModel model : {CsfModel::barten_1999, CsfModel::barten_fitted, CsfModel::barten_2004}) {
        const auto at = [&](double cpd) { return sensitivity(model, {.frequency = CyclesPerDegree(cpd)}); };
        EXPECT_NEAR(at(1e-9) / at(1e-10), 10, 1e-9) << name(model);
    }
}

double naive_damping(double x) { return std::exp(-x) * std::sqrt(1 + 0.06 * std::exp(x)); }

TEST(Numerics, DampingOfFineGratings) {
    EXPECT_TRUE(std::isnan(naive_damping(800))) << "0 times infinity";
    // What remains is sqrt(0.06) e^(-x / 2).
    const double b = 0.3 * std::pow(1 + 100 / 1e-5, 0.15), cpd = 800 / b;
    const double truth = 440 * std::pow(1 + 0.7 / 1e-5, -0.2) * cpd * std::sqrt(0.06) * std::exp(-400.0);
    const Stimulus s{.frequency = CyclesPerDegree(cpd), .luminance = Luminance(1e-5)};
    EXPECT_NEAR(sensitivity(CsfModel::barten_1989, s) / truth, 1, 1e-9);
}

double naive_area_gain(double area, double whole) { return std::sqrt(area / (area + whole)); }

TEST(Numerics, PatchesWithoutEnd) {
    EXPECT_TRUE(std::isnan(naive_area_gain(infinity, 1)));
    const CyclesPerDegree f(2);
    const double unlimited = summation_gain(f, SquareDegrees(infinity));
    EXPECT_TRUE(std::isfinite(unlimited));
    EXPECT_NEAR(summation_gain(f, SquareDegrees(1e200)), unlimited, 1e-12);
    EXPECT_NEAR(summation_share(f, SquareDegrees(infinity)), 1, 1e-12);
    EXPECT_NEAR(summation_gain(f, patch_area(f)), 1, 1e-12);
    for (const double none : {0.0, -1.0, not_a_number}) EXPECT_TRUE(std::isnan(summation_gain(f, SquareDegrees(none))));
    EXPECT_GE(summation_gain(f, SquareDegrees(denormal)), 0);
}

double naive_velocity_factor(double cpd, double deg_s) {
    return support::spatiovelocity_sensitivity(cpd, deg_s) / support::spatiovelocity_sensitivity(cpd, 0);
}

TEST(Numerics, MotionOfWhatNobodySees) {
    EXPECT_TRUE(std::isnan(naive_velocity_factor(2000, 0.2))) << "0 / 0";
    const auto factor = [](double cpd, double deg_s) {
        return velocity_factor(CyclesPerDegree(cpd), DegreesPerSecond(deg_s));
    };
    EXPECT_GT(factor(2000, 0.2), 0);
    EXPECT_LT(factor(2000, 0.2), 1);
    EXPECT_EQ(factor(2000, 0), 1);
    for (const double cpd : {1e-3, 1.0, 30.0})
        EXPECT_NEAR(factor(cpd, 3) / naive_velocity_factor(cpd, 3), 1, 1e-9) << cpd;
}

double naive_pixels_per_degree(const Display& d) { return d.distance / d.pixel_pitch * std::numbers::pi / 180; }

TEST(Numerics, DisplaysOfOnePixelAndOf1And1000PixelsPerDegree) {
    constexpr double bound = 1e-12;
    for (const double ppd : {1.0, 34.0, 1000.0, 0.006}) {
        Display display;
        display.width_px = display.height_px = 1;
        set_pixels_per_degree(display, PixelsPerDegree(ppd));
        EXPECT_NEAR(pixels_per_degree(display).value() / ppd, 1, bound) << ppd;
        EXPECT_EQ(std::abs(naive_pixels_per_degree(display) / ppd - 1) > 1e-5, ppd <= 1)
            << "small angles are their tangents";
        if (ppd < 1) continue;
        ASSERT_TRUE(validate(display)) << ppd;
        const Image dark = flat(1, 1, 10), bright = flat(1, 1, 90);
        const auto judged = require(judge_modern(dark, bright, {.display = display, .gaze_px = glm::dvec2(0.5)}));
        EXPECT_TRUE(std::isfinite(judged->max_ratio));
        EXPECT_EQ(judge_modern(dark, dark, {.display = display})->max_ratio, 0);
    }
}

// Between an angle and half a pixel more, on a flat screen.
double naive_pixels_per_degree_at(double ppd, double angle_deg) {
    const double a = angle_deg * std::numbers::pi / 180, delta = 0.5 / ppd * std::numbers::pi / 180;
    return ppd * (std::tan(a + delta) - std::tan(a)) / std::tan(delta);
}

TEST(Numerics, PixelsOfADisplayFromNoDistance) {
    Display display;
    for (const double metres : {1e-300, denormal, 1e-9, 1e-3, 0.5}) {
        display.distance = Metres(metres);
        const double ppd = pixels_per_degree(display).value();
        if (metres < 1e-9) EXPECT_LT(naive_pixels_per_degree_at(ppd, 45), 0) << "beyond a right angle";
        double before = 0;
        for (const double angle : {0.0, 45.0, 89.0, 89.9, 90.0, 135.0, 180.0}) {
            const double there = pixels_per_degree_at(display, Degrees(angle)).value();
            ASSERT_TRUE(std::isfinite(there) && there > 0) << metres << " " << angle;
            ASSERT_GE(there, before * (1 - 1e-12)) << metres << " " << angle;
            before = there;
        }
        EXPECT_TRUE(std::isnan(pixels_per_degree_at(display, Degrees(not_a_number)).value()));
        // Such displays are refused by the field's name wherever one is taken.
        const auto valid = validate(display);
        EXPECT_EQ(static_cast<bool>(valid), metres >= 1e-3);
        if (!valid) EXPECT_THAT(valid.error().message, HasSubstr("viewing_distance_m must be a length from 1 mm"));
    }
    display = {};
    display.lens = {{0, 20}, {40, 10}};
    EXPECT_TRUE(std::isnan(pixels_per_degree_at(display, Degrees(not_a_number)).value()));
}

double naive_levels(int width, int height) { return std::log2(std::min(width, height) / 4); }

TEST(Numerics, PyramidsOf1By1And1ByN) {
    EXPECT_EQ(naive_levels(1, 100), -infinity);
    for (const auto& [width, height] : {std::pair(1, 1), {1, 2}, {2, 1}, {1, 100}, {1000, 1}, {3, 5}, {1, 4097}}) {
        const Image dark = support::noise(width, height, 20, 0.5, 1);
        Image other = dark;
        for (float& v : other.values) v *= 3;
        const auto judge = require(Judge::create(dark, {.gaze_px = glm::dvec2(0, 0)}));
        EXPECT_EQ(judge->judge(dark)->max_ratio, 0) << width << "x" << height;
        const auto seen = require(judge->judge(other));
        EXPECT_TRUE(std::isfinite(seen->max_ratio)) << width << "x" << height;
        EXPECT_GT(seen->max_ratio, 0) << width << "x" << height;
        const auto map = require(threshold_map_modern(dark, {}));
        for (const float v : map->values) ASSERT_TRUE(std::isfinite(v) && v > 0) << width << "x" << height;
    }
}

double naive_elevation(double masker) {
    return std::pow(1 + std::pow(0.015286700226364008 * std::pow(392.4980480517423 * masker, 0.7), 4), 0.25);
}

TEST(Numerics, MaskersOfAnyStrength) {
    EXPECT_EQ(naive_elevation(1e120), infinity);
    for (const double masker : {0.0, 1e-300, 1e-20, 1e-3, 1.0, 1e3, 1e10}) {
        const double exact = daly_elevation(masker);
        EXPECT_NEAR(exact / naive_elevation(masker), 1, 1e-12) << masker;
        EXPECT_NEAR(static_cast<double>(fast_daly_elevation(static_cast<float>(masker))) / exact, 1, 1e-5) << masker;
    }
    EXPECT_NEAR(daly_elevation(1e200) / std::pow(1e200, 0.7), 1, 1e-6);
    EXPECT_TRUE(std::isfinite(fast_daly_elevation(std::numeric_limits<float>::infinity())));
    EXPECT_EQ(fast_daly_elevation(0), 1);
}

} // namespace unseen::perception::numerics_test
