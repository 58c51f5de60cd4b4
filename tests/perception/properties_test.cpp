// What holds of displays, sensitivity and judges whatever the numbers are. As many cases as
// tests/vdtree/properties_test.cpp says.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <unseen/perception/csf.h>
#include <unseen/perception/display.h>
#include <unseen/perception/judge.h>

#include "any_number.h"
#include "fold/fold_classes.h"
#include "judge/fast_math.h"
#include "judge/modern_masking.h"
#include "testing.h"

namespace unseen::perception {
namespace {

using support::any_number;
using support::between;

double any_magnitude(double least, double most) { return std::pow(10.0, *between(least, most)); }

RC_GTEST_PROP(Properties, FrequenciesComeBackFromContrasts, ()) {
    const CsfTable& table = CsfTable::standard();
    const Degrees e(*between(0, 180));
    const Luminance l(any_magnitude(-9, 9));
    const double contrast = any_magnitude(-6, 6);
    const double cpd = table.highest_visible_frequency(contrast, e, l).value();
    RC_ASSERT(cpd >= 0 && std::isfinite(cpd));
    if (cpd == 0) {
        RC_ASSERT(table.peak_sensitivity(e, l) * contrast <= 1 + 1e-9);
    } else {
        const double s = table.monotone_sensitivity(CyclesPerDegree(cpd), e, l);
        RC_ASSERT(std::abs(std::log(s * contrast)) <= 1e-6);
    }
}

RC_GTEST_PROP(Properties, WhatIsHarderToSeeIsNotSeenBetter, ()) {
    const CsfTable& table = CsfTable::standard();
    const double cpd = any_magnitude(-3, 3), degrees = *between(0, 180), cdm2 = any_magnitude(-6, 6);
    const double s = table.monotone_sensitivity(CyclesPerDegree(cpd), Degrees(degrees), Luminance(cdm2));
    const double more = 1 + any_magnitude(-6, 1);
    constexpr double rounding = 1 + 1e-9;
    RC_ASSERT(s >= 0 && std::isfinite(s));
    RC_ASSERT(table.monotone_sensitivity(CyclesPerDegree(cpd * more), Degrees(degrees), Luminance(cdm2)) <=
              s * rounding);
    RC_ASSERT(table.monotone_sensitivity(CyclesPerDegree(cpd), Degrees(degrees * more), Luminance(cdm2)) <=
              s * rounding);
    RC_ASSERT(table.monotone_sensitivity(CyclesPerDegree(cpd), Degrees(degrees), Luminance(cdm2 / more)) <=
              s * rounding);
}

RC_GTEST_PROP(Properties, ModelsAreFiniteInTheirDomain, ()) {
    const CsfModel model = csf_models[*rc::gen::inRange<std::size_t>(0, csf_models.size())];
    const double s = sensitivity(model, {.frequency = CyclesPerDegree(any_magnitude(-6, 4)),
                                         .luminance = Luminance(any_magnitude(-9, 9)),
                                         .eccentricity = Degrees(*between(0, 180)),
                                         .area = SquareDegrees(any_magnitude(-12, 12))});
    RC_ASSERT(std::isfinite(s) && s >= 0);
}

Display any_display() {
    Display display;
    display.pixel_pitch = Metres(any_magnitude(-9, 0));
    display.distance = Metres(any_magnitude(-3, 4));
    display.peak = Luminance(any_magnitude(-5, 6));
    display.black = display.peak * any_magnitude(-2, -0.1);
    display.gamma = *between(0.5, 5);
    display.transfer = *rc::gen::element(TransferFunction::srgb, TransferFunction::gamma, TransferFunction::linear);
    display.ambient = Lux(any_magnitude(-3, 6));
    return display;
}

RC_GTEST_PROP(Properties, CodesComeBackFromLight, ()) {
    const Display display = any_display();
    RC_ASSERT(validate(display).has_value());
    const double code = *between(-1, 1);
    RC_ASSERT(std::abs(encode(display, decode(display, code)) - code) <= 1e-7);
    RC_ASSERT(decode(display, code + any_magnitude(-9, 0)) >= decode(display, code));
    const double y = *between(0, 1), range = (display.peak - display.black) / black_level(display);
    RC_ASSERT(std::abs(to_relative(display, to_luminance(display, y)) - y) <= 1e-14 * (1 + 1 / range));
}

RC_GTEST_PROP(Properties, PixelsGrowAside, ()) {
    const Display display = any_display();
    const double near = *between(0, 180), far = near + *between(0, 90);
    const double centre = pixels_per_degree(display).value();
    const double a = pixels_per_degree_at(display, Degrees(near)).value(),
                 b = pixels_per_degree_at(display, Degrees(far)).value();
    RC_ASSERT(centre > 0 && std::isfinite(b));
    RC_ASSERT(a >= centre * (1 - 1e-9) && b >= a * (1 - 1e-9));
}

RC_GTEST_PROP(Properties, ClassesRoundUp, ()) {
    const double value = std::abs(*any_number(-12, 3));
    for (const ClassSeries& series : {coarse_contrasts, fine_contrasts, shifts, chroma_contrasts}) {
        const std::size_t index = series.of(value);
        RC_ASSERT(index < series.count());
        RC_ASSERT(index + 1 == series.count() || series.value(index) >= value);
        RC_ASSERT(index <= 1 || series.value(index - 1) < value * (1 + 1e-6)); // and no farther than it takes
    }
    const LuminanceClasses luminances(any_display());
    const std::size_t index = luminances.of(value);
    RC_ASSERT(index < LuminanceClasses::count);
    RC_ASSERT(index + 1 == LuminanceClasses::count || luminances.value(index) >= value);
}

RC_GTEST_PROP(Properties, FastFunctionsAreNearTheExactOnes, ()) {
    const auto x = static_cast<float>(any_magnitude(-37, 38));
    const double exact = std::log2(static_cast<double>(x));
    RC_ASSERT(std::abs(static_cast<double>(fast_log2(x)) - exact) <= 4e-7 * std::max(1.0, std::abs(exact)));
    const auto y = static_cast<float>(*between(-125.9, 126.9));
    RC_ASSERT(std::abs(static_cast<double>(fast_exp2(y)) / std::exp2(static_cast<double>(y)) - 1) <= 4e-7);
    const auto masker = static_cast<float>(std::abs(*any_number(-30, 9)));
    RC_ASSERT(std::abs(static_cast<double>(fast_daly_elevation(masker)) / daly_elevation(static_cast<double>(masker)) -
                       1) <= 1e-5);
    const auto up = static_cast<float>(std::abs(*any_number(-18, 18))),
               along = static_cast<float>(*any_number(-18, 18));
    if (up != 0 || along != 0)
        RC_ASSERT(std::abs(static_cast<double>(fast_angle(up, along)) -
                           std::atan2(static_cast<double>(up), static_cast<double>(along))) <= 4e-7);
}

RC_GTEST_PROP(Properties, JudgesOfSmallPicturesSeeNumbers, ()) {
    const int width = *rc::gen::inRange(1, 12), height = *rc::gen::inRange(1, 12);
    const auto pixels = static_cast<std::size_t>(width * height);
    const auto picture = [&] {
        Image image{width, height, 1, std::vector<float>(pixels)};
        const double level = any_magnitude(-9, 5), contrast = *between(0, 1);
        for (std::size_t i = 0; i < pixels; ++i)
            image.values[i] = static_cast<float>(level * (1 + contrast * std::sin(static_cast<double>(i * i))));
        return image;
    };
    const Image reference = picture(), test = picture();
    const auto judge = Judge::create(reference, {});
    RC_ASSERT(judge.has_value());
    const auto seen = judge->judge(test), same = judge->judge(reference);
    RC_ASSERT(seen.has_value() && same.has_value());
    RC_ASSERT(same->max_ratio == 0);
    RC_ASSERT(seen->max_ratio >= 0 && std::isfinite(seen->max_ratio));
}

} // namespace
} // namespace unseen::perception
