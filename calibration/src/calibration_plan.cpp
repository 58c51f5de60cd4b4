// Plans: which gratings to measure on a display.
#include "calibration_plan.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <ranges>
#include <set>

#include <unseen/vdtree/internal/errors.h>

#include "json_file.h"

namespace unseen::calibration {

using perception::CsfTable;
using perception::CyclesPerDegree;
using perception::Degrees;
using perception::Luminance;

double log10_expected(const CsfTable& table, const GratingPlace& place, Luminance luminance) {
    return std::log10(
        table.sensitivity(CyclesPerDegree(place.frequency_cpd), Degrees(place.eccentricity_deg), luminance) *
        summation_gain(place));
}

namespace {

// How far a patch reaches: two standard deviations of its envelope.
double patch_radius_deg(const GratingPlace& place) { return 2 * place.sigma_deg(); }

constexpr double cross_deg = 1; // what the fixation cross takes

// Between a fixation cross near one edge of the screen and a patch near the other.
double farthest_eccentricity_deg(const perception::Display& display, double radius_deg) {
    return perception::physical_field(display, display.width_px).value() - radius_deg - cross_deg;
}

// Whether a threshold can be measured: well below the highest contrast.
bool is_measurable(const CalibrationPlan& plan, const CsfTable& expected, const GratingPlace& place) {
    constexpr double visible_share = 3;
    return std::pow(10, log10_expected(expected, place, plan.luminance)) * plan.highest_contrast >= visible_share;
}

} // namespace

bool fits(const perception::Display& display, const GratingPlace& place) {
    const double height = perception::physical_field(display, display.height_px).value();
    const double radius = patch_radius_deg(place);
    return 2 * radius <= height && place.eccentricity_deg <= farthest_eccentricity_deg(display, radius);
}

std::vector<GratingPlace> wide_places(const CalibrationPlan& plan, const perception::Display& display,
                                      const CsfTable& expected) {
    constexpr std::size_t coarsest = 2;         // frequencies
    constexpr double least_improvement = 1.189; // 1.5 dB, or the patch says nothing about summation
    std::set<double> frequencies, eccentricities;
    for (const GratingPlace& place : plan.places) {
        if (place.is_wide()) continue;
        frequencies.insert(place.frequency_cpd);
        eccentricities.insert(place.eccentricity_deg);
    }
    // The display's smaller side, in circles of two standard deviations.
    const double side = std::min(perception::physical_field(display, display.width_px).value(),
                                 perception::physical_field(display, display.height_px).value());
    const double area = std::min(most_wide_deg2, std::numbers::pi * side * side / 16 * (1 - 1e-9)); // rounding
    const auto count = static_cast<std::ptrdiff_t>(std::min(coarsest, frequencies.size()));
    std::vector<GratingPlace> wide;
    const auto is_useful = [&](const GratingPlace& place) {
        return area >= least_wide_deg2 && summation_gain(place) >= least_improvement && fits(display, place) &&
               is_measurable(plan, expected, place);
    };
    for (const double frequency : std::vector(frequencies.begin(), std::next(frequencies.begin(), count))) {
        const auto is_useful_at = [&](double eccentricity) { return is_useful({frequency, eccentricity, area}); };
        const auto nearest = std::ranges::find_if(eccentricities, is_useful_at);
        if (nearest == eccentricities.end()) continue;
        wide.push_back({frequency, *nearest, area});
        const auto farthest = std::find_if(eccentricities.rbegin(), eccentricities.rend(), is_useful_at);
        if (*farthest != *nearest) wide.push_back({frequency, *farthest, area});
    }
    return wide;
}

std::string_view name(Method method) { return method == Method::two_interval ? "2ifc" : "adjustment"; }

CalibrationPlan plan_for(const perception::Display& display, const CsfTable& expected,
                         std::optional<Luminance> luminance) {
    CalibrationPlan plan;
    const double black = perception::black_level(display).value(), white = perception::to_luminance(display, 1).value();
    plan.luminance = luminance.value_or(Luminance((black + white) / 2));
    const double mean = plan.luminance.value();
    plan.highest_contrast = luminance ? std::min(mean - black, white - mean) / mean : (white - black) / (white + black);
    const double finest = perception::coarsest_pixels_per_degree(display).value() / pixels_per_cycle;
    std::vector<double> frequencies;
    for (double f = 0.5; f <= std::min(16.0, finest); f *= 2) frequencies.push_back(f);
    if (frequencies.empty()) frequencies.push_back(finest);
    constexpr double visibly_finer = 1.4; // half an octave
    if (finest < 16 && finest > visibly_finer * frequencies.back()) frequencies.push_back(finest);
    for (const double eccentricity : {0.0, 5.0, 10.0, 20.0})
        for (const double frequency : frequencies) {
            const GratingPlace place{frequency, eccentricity};
            if (fits(display, place) && is_measurable(plan, expected, place)) plan.places.push_back(place);
        }
    for (const GratingPlace& place : wide_places(plan, display, expected)) {
        plan.places.push_back(place);
        plan.trials += trials_of_wide_place;
    }
    return plan;
}

Result<void> validate(const CalibrationPlan& plan) {
    if (plan.places.empty() || plan.places.size() > most_plan_places)
        return invalid_argument("A calibration needs 1 to " + std::to_string(most_plan_places) + " places, not " +
                                std::to_string(plan.places.size()) + ".");
    Result<void> result;
    const auto expect = [&](bool holds, const std::string& rule, const std::string& value) {
        if (!holds && result) result = invalid_argument(rule + ", not " + value + ".");
    };
    for (auto place = plan.places.begin(); place != plan.places.end(); ++place) {
        const auto& [frequency, eccentricity, area] = *place;
        const std::string where = in_brackets("places", static_cast<std::size_t>(place - plan.places.begin()));
        constexpr double coarsest_cpd = 1.0 / 16, finest_cpd = 64; // of the tables
        constexpr double largest_deg2 = 1e4;                       // a quarter of the sphere
        expect(frequency >= coarsest_cpd && frequency <= finest_cpd,
               where + ": the frequency must lie in 1/16 to 64 cpd", number_text(frequency));
        expect(eccentricity >= 0 && eccentricity <= widest_eccentricity_deg,
               where + ": the eccentricity must lie in 0 to 90 degrees", number_text(eccentricity));
        expect(area >= 0 && area <= largest_deg2, where + ": the area must lie in 0 to 10,000 square degrees",
               number_text(area));
        if (result && std::find(plan.places.begin(), place, *place) != place)
            result = invalid_argument(where + " is there twice.");
    }
    if (result && std::ranges::all_of(plan.places, &GratingPlace::is_wide))
        result = invalid_argument("All places are of wide patches: add one of 1.5 cycles radius.");
    const double luminance = plan.luminance.value(), contrast = plan.highest_contrast;
    expect(plan.trials >= 1 && plan.trials <= most_plan_trials, "There must be 1 to 100,000 trials",
           std::to_string(plan.trials));
    expect(plan.settings >= 2 && plan.settings <= most_plan_settings, "There must be 2 to 1000 settings a place",
           std::to_string(plan.settings));
    expect(luminance > 0 && luminance <= brightest_cdm2, "The luminance must be above 0 and at most 1e6 cd/m2",
           number_text(luminance));
    expect(plan.seed <= exact_integers, "The seed must be at most 2^53", std::to_string(plan.seed));
    expect(contrast > 0 && contrast <= 1, "The highest contrast must lie in 0..1", number_text(contrast));
    return result;
}

} // namespace unseen::calibration
