// The simulated observer: thresholds from a table, chance from the seed and the trial.
#include <unseen/calibration/internal/simulated_observer.h>

#include <algorithm>
#include <cmath>

#include <unseen/calibration/observer_profile.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/random.h>

#include "json_file.h"

namespace unseen::calibration {
namespace {

struct Key {
    std::string_view name;
    double& (*value)(SimulatedObserver&);
    double least, most;
};
// Wider than people differ; whether the thresholds that come of it can be measured, check_measurable() says.
constexpr Key keys[] = {
    {"gain", [](SimulatedObserver& o) -> double& { return o.gain; }, 1e-2, 1e2},
    {"frequency", [](SimulatedObserver& o) -> double& { return o.frequency; }, 0.1, 10},
    {"eccentricity", [](SimulatedObserver& o) -> double& { return o.eccentricity; }, 0, 10},
    {"summation", [](SimulatedObserver& o) -> double& { return o.summation; }, 1e-2, 1e2},
    {"slope", [](SimulatedObserver& o) -> double& { return o.psychometric.slope; }, 0.1, 20},
    {"lapse", [](SimulatedObserver& o) -> double& { return o.psychometric.lapse; }, 0, 0.3},
    {"scatter", [](SimulatedObserver& o) -> double& { return o.scatter; }, 0, 1},
    {"delay", [](SimulatedObserver& o) -> double& { return o.delay; }, -1, 1},
};

Result<void> apply(SimulatedObserver& observer, std::string_view assignment) {
    const std::size_t equals = assignment.find('=');
    const std::string_view name = assignment.substr(0, equals);
    const auto key = std::find_if(std::begin(keys), std::end(keys), [&](const Key& k) { return k.name == name; });
    if (key == std::end(keys) || equals == assignment.npos)
        return invalid_argument(
            "observer: '" + std::string(assignment) +
            "' is none of gain=, frequency=, eccentricity=, summation=, slope=, lapse=, scatter= and delay=.");
    const std::string_view text = assignment.substr(equals + 1);
    const auto parsed = number_from<double>(text);
    if (!parsed || !(*parsed >= key->least && *parsed <= key->most))
        return invalid_argument("observer: " + std::string(name) + " must be a number from " + number_text(key->least) +
                                " to " + number_text(key->most) + ", not '" + std::string(text) + "'.");
    key->value(observer) = *parsed;
    return {};
}

Result<perception::CsfTable> table_named(const std::string& name) {
    if (name.ends_with(".json")) return read_csf(name);
    const auto model = perception::csf_model(name);
    if (!model)
        return invalid_argument("observer: '" + name + "' is neither a CSF model nor the file of a profile (.json).");
    if (!perception::is_achromatic(*model))
        return invalid_argument("observer: " + name + " is sensitivity to colour, not to luminance contrast.");
    return perception::CsfTable::from_model(*model);
}

// Numbers of its own for each trial, other than those that make the trial.
Random chance(std::uint64_t seed, int trial) {
    constexpr std::uint64_t observers = 0x6f62736572766572u;
    return random_for(seed ^ observers, static_cast<std::uint64_t>(trial));
}

} // namespace

double SimulatedObserver::sensitivity(const GratingPlace& place, perception::Luminance luminance) const {
    return gain * summation_gain(place, summation) *
           csf.sensitivity(perception::CyclesPerDegree(place.frequency_cpd / frequency),
                           perception::Degrees(place.eccentricity_deg * eccentricity), luminance);
}

int SimulatedObserver::choose(const Trial& trial, perception::Luminance luminance) const {
    const double right = psychometric.probability(std::log10(trial.contrast * sensitivity(trial.grating, luminance)));
    return chance(seed, trial.number).uniform() < right ? trial.interval : 3 - trial.interval;
}

double SimulatedObserver::set(const Trial& trial, const CalibrationPlan& plan) const {
    const double threshold = -std::log10(sensitivity(trial.grating, plan.luminance));
    const double setting =
        threshold + scatter * chance(seed, trial.number).normal() + (trial.is_ascending ? delay : -delay);
    return std::min(std::pow(10, setting), plan.highest_contrast);
}

Result<void> check_measurable(const SimulatedObserver& observer, const CalibrationPlan& plan) {
    for (const GratingPlace& place : plan.places) {
        const double sensitivity = observer.sensitivity(place, plan.luminance);
        if (!(std::log10(sensitivity) <= -lowest_log10_contrast))
            return invalid_argument("observer: the sensitivity at " + number_text(place.frequency_cpd) + " cpd and " +
                                    number_text(place.eccentricity_deg) + " degrees" +
                                    (place.is_wide() ? " over " + number_text(place.area_deg2) + " deg2" : "") +
                                    " is " + number_text(std::round(sensitivity)) + ", but none above " +
                                    number_text(std::round(std::pow(10, -lowest_log10_contrast))) +
                                    " can be measured: give a lower gain.");
    }
    return {};
}

Result<SimulatedObserver> simulated_observer(std::string_view description, std::uint64_t seed) {
    const std::size_t colon = description.find(':');
    auto table = table_named(std::string(description.substr(0, colon)));
    if (!table) return table.error();
    SimulatedObserver observer{.csf = std::move(*table), .psychometric = {}, .seed = seed};
    std::string_view rest = colon == description.npos ? "" : description.substr(colon + 1);
    while (!rest.empty()) {
        const std::size_t comma = rest.find(',');
        if (auto ok = apply(observer, rest.substr(0, comma)); !ok) return ok.error();
        rest = comma == rest.npos ? "" : rest.substr(comma + 1);
    }
    return observer;
}

} // namespace unseen::calibration
