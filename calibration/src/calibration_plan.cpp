// Plans: which gratings to measure on a display.
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>

#include <unseen/vdtree/internal/errors.h>

#include "json_file.h"
#include "procedure_state.h"

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
    std::vector<double> frequencies, eccentricities;
    for (const GratingPlace& place : plan.places) {
        if (place.is_wide()) continue;
        frequencies.push_back(place.frequency_cpd);
        eccentricities.push_back(place.eccentricity_deg);
    }
    for (std::vector<double>* values : {&frequencies, &eccentricities}) {
        std::sort(values->begin(), values->end());
        values->erase(std::unique(values->begin(), values->end()), values->end());
    }
    frequencies.resize(std::min(frequencies.size(), coarsest));
    // The display's smaller side, in circles of two standard deviations.
    const double side = std::min(perception::physical_field(display, display.width_px).value(),
                                 perception::physical_field(display, display.height_px).value());
    const double area = std::min(most_wide_deg2, std::numbers::pi * side * side / 16 * (1 - 1e-9)); // rounding
    std::vector<GratingPlace> wide;
    const auto is_useful = [&](const GratingPlace& place) {
        return area >= least_wide_deg2 && summation_gain(place) >= least_improvement && fits(display, place) &&
               is_measurable(plan, expected, place);
    };
    for (const double frequency : frequencies) {
        const auto nearest = std::find_if(eccentricities.begin(), eccentricities.end(), [&](double e) {
            return is_useful({frequency, e, area});
        });
        if (nearest == eccentricities.end()) continue;
        wide.push_back({frequency, *nearest, area});
        const auto farthest = std::find_if(eccentricities.rbegin(), eccentricities.rend(), [&](double e) {
            return is_useful({frequency, e, area});
        });
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
    for (std::size_t i = 0; i < plan.places.size(); ++i) {
        const auto& [frequency, eccentricity, area] = plan.places[i];
        const std::string where = in_brackets("places", i);
        constexpr double coarsest_cpd = 1.0 / 16, finest_cpd = 64; // of the tables
        if (!(frequency >= coarsest_cpd && frequency <= finest_cpd))
            return invalid_argument(where + ": the frequency must lie in 1/16 to 64 cpd, not " + to_text(frequency) +
                                    ".");
        if (!(eccentricity >= 0 && eccentricity <= widest_eccentricity_deg))
            return invalid_argument(where + ": the eccentricity must lie in 0 to 90 degrees, not " +
                                    to_text(eccentricity) + ".");
        constexpr double largest_deg2 = 1e4; // a quarter of the sphere
        if (!(area >= 0 && area <= largest_deg2))
            return invalid_argument(where + ": the area must lie in 0 to 10,000 square degrees, not " + to_text(area) +
                                    ".");
        if (std::find(plan.places.begin(), plan.places.begin() + static_cast<std::ptrdiff_t>(i), plan.places[i]) !=
            plan.places.begin() + static_cast<std::ptrdiff_t>(i))
            return invalid_argument(where + " is there twice.");
    }
    if (std::all_of(plan.places.begin(), plan.places.end(), std::mem_fn(&GratingPlace::is_wide)))
        return invalid_argument("All places are of wide patches: add one of 1.5 cycles radius.");
    if (plan.trials < 1 || plan.trials > most_plan_trials)
        return invalid_argument("There must be 1 to 100,000 trials, not " + std::to_string(plan.trials) + ".");
    if (plan.settings < 2 || plan.settings > most_plan_settings)
        return invalid_argument("There must be 2 to 1000 settings a place, not " + std::to_string(plan.settings) + ".");
    if (!(plan.luminance.value() > 0 && plan.luminance.value() <= brightest_cdm2))
        return invalid_argument("The luminance must be above 0 and at most 1e6 cd/m2, not " +
                                to_text(plan.luminance.value()) + ".");
    if (plan.seed > exact_integers)
        return invalid_argument("The seed must be at most 2^53, not " + std::to_string(plan.seed) + ".");
    if (!(plan.highest_contrast > 0 && plan.highest_contrast <= 1))
        return invalid_argument("The highest contrast must lie in 0..1, not " + to_text(plan.highest_contrast) + ".");
    return {};
}

} // namespace unseen::calibration
