// A simulated observer of gratings, with a known contrast sensitivity.
#pragma once

#include <cstdint>
#include <string_view>

#include <unseen/calibration/internal/quest.h>
#include <unseen/calibration/procedure.h>
#include <unseen/perception/csf.h>
#include <unseen/vdtree/result.h>

namespace unseen::calibration {

// S(f, e, L) = gain * csf(f / frequency, e * eccentricity, L); for wide patches, times summation_gain().
struct SimulatedObserver {
    perception::CsfTable csf;
    double gain = 1, frequency = 1, eccentricity = 1, summation = 1;
    Psychometric psychometric;           // of two-interval answers
    double scatter = 0.08, delay = 0.03; // of settings, log10 units; they come too late in either direction
    std::uint64_t seed = 1;

    double sensitivity(const GratingPlace& place, perception::Luminance luminance) const;
    // Answers depend on the seed, the trial's number and the grating alone.
    int choose(const Trial& trial, perception::Luminance luminance) const; // an interval
    double set(const Trial& trial, const CalibrationPlan& plan) const;     // a contrast, at most the highest
};

// Fails if a threshold of the observer at one of the plan's places is below the lowest contrast that can be measured.
Result<void> check_measurable(const SimulatedObserver& observer, const CalibrationPlan& plan);

// "NAME[:key=value,...]": NAME is a CSF model or the file of an observer profile; the keys are gain, frequency,
// eccentricity, summation, slope, lapse, scatter, delay. Such as "castle:gain=0.7,slope=3". The error names the key.
Result<SimulatedObserver> simulated_observer(std::string_view description, std::uint64_t seed);

} // namespace unseen::calibration
