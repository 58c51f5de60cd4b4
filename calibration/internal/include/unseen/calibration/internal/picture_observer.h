// A simulated observer of picture pairs: sees by a model that no fold test uses, with noise of its own.
#pragma once

#include <cstdint>

#include <unseen/calibration/study.h>
#include <unseen/perception/csf.h>
#include <unseen/perception/display.h>
#include <unseen/perception/image.h>
#include <unseen/vdtree/result.h>

namespace unseen::calibration {

// Signal detection. The signal of a pair is d' = threshold_d V^exponent, with the largest V of the second judge
// (perception::second_judge_options(): Barten's sensitivity, sum of squares over the bands). Each look at a picture adds
// noise of standard deviation 1.
//   which   names the picture that looks more changed: right with the probability Phi(d' / sqrt 2), 75% at V = 1
//   differ  says yes if d' plus noise exceeds the criterion
struct PictureObserver {
    // sqrt 2 times the 75% quantile of the normal distribution.
    static constexpr double threshold_d = 0.95387;
    // With noise, a Weibull function of the slope 3.5, as people have: 3.5 / 1.25 (Pelli 1987).
    double exponent = 2.8;
    double criterion = 1; // false alarms: 16%
    double lapse = 0.01;  // of answers at random
    perception::Person person = perception::median_person;
    std::uint64_t seed = 1;

    // The largest V of two images in cd/m2. Fails like perception::judge_modern().
    Result<double> visibility(const perception::Image& original, const perception::Image& other,
                              const perception::Display& display) const;
    // Depends on the seed, the trial's number and the visibility alone.
    StudyChoice choose(StudyTask task, const StudyTrial& trial, double visibility) const;
};

} // namespace unseen::calibration
