// An observer without a person: answers as somebody with a known contrast sensitivity would.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <unseen/calibration/procedure.h>
#include <unseen/calibration/quest.h>
#include <unseen/perception/csf.h>
#include <unseen/vdtree/result.h>

namespace unseen::calibration {

// S(f, e, L) = gain * csf(f / frequency, e * eccentricity, L), and of wide patches summation_gain() times that.
struct SimulatedObserver {
    perception::CsfTable csf;
    double gain = 1, frequency = 1, eccentricity = 1, summation = 1;
    Psychometric psychometric; // of two-interval answers
    // Settings scatter by so much (log10 units), and come too late by `delay` in either direction.
    double scatter = 0.08, delay = 0.03;
    std::uint64_t seed = 1;

    double sensitivity(const GratingPlace& place, perception::Luminance luminance) const;
    // Answers depend on the seed, the trial's number and the grating alone.
    int choose(const Trial& trial, perception::Luminance luminance) const; // an interval
    double set(const Trial& trial, const CalibrationPlan& plan) const;     // a contrast, at most the highest
};

// Fails where the observer sees more at one of the plan's places than can be measured: contrasts below the lowest.
Result<void> check_measurable(const SimulatedObserver& observer, const CalibrationPlan& plan);

// "NAME[:key=value,...]": NAME is a CSF model or the file of an observer profile; the keys are gain, frequency,
// eccentricity, summation, slope, lapse, scatter, delay. Such as "castle:gain=0.7,slope=3". The error names the key.
Result<SimulatedObserver> simulated_observer(std::string_view description, std::uint64_t seed);

} // namespace unseen::calibration
