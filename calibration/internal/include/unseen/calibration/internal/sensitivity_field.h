// Beliefs about an observer's contrast sensitivity everywhere, from answers at some frequencies and eccentricities.
#pragma once

#include <vector>

#include <unseen/calibration/procedure.h>
#include <unseen/perception/csf.h>
#include <unseen/vdtree/function_ref.h>

namespace unseen::calibration {

// A Gaussian process over log10 sensitivity: an expected table, plus a deviation d(f, e) of mean 0 and covariance
//   gain^2 + tilt^2 u u' + cutoff^2 f f' + decline^2 e e' + fall^2 (f e)(f' e') + loss^2 s s'
//   + local(s) local(s') exp(-du^2 / 2 lu^2 - dv^2 / 2 lv^2) + area^2 t t'
// with u octaves from 3 cpd, v = log2(1 + e / 2 deg), and s the expected observer's loss here, in log10 units below the
// sensitivity to 3 cpd in the fovea. The first six terms are a shape with six parameters: sensitivity, slope over
// frequency, acuity, decline with eccentricity, and share of every loss. The local term lets every place differ from the
// shape, more so the more is lost. So one place informs about the others, and answers that do not fit the shape still
// count.
//
// Wide patches are expected to be seen better by castle's law of area, except for one number: how the observer sums over
// area, log10 of `own` in perception::summation_gain(), of which a patch shows the share t.
//
// Answers arrive as likelihoods by place and are combined by expectation propagation (Minka 2001) with one Gaussian factor
// for each place. Cost of set_own(): places^2; of a prediction: places^3.
class SensitivityField {
public:
    // `expected` gives the mean at `luminance`.
    SensitivityField(const std::vector<GratingPlace>& places, perception::CsfTable expected,
                     perception::Luminance luminance);

    std::size_t size() const noexcept { return sites_.size(); }
    double expected(std::size_t i) const noexcept { return expected_[i]; } // log10 sensitivity

    // The belief from the other places alone, without this place's own answers.
    Belief without_own(std::size_t i) const;
    Belief belief(std::size_t i) const;
    // The deviation from the expected table anywhere, and its local part.
    Belief deviation(const GratingPlace& at) const;
    Belief local_deviation(std::size_t i) const;
    Belief log10_summation() const; // of `own`: how the observer sums over area
    // How far the beliefs of all places move if that of place i moves by one.
    std::vector<double> pulled_by(std::size_t i) const;

    // Replaces a place's own answers by the Gaussian factor that leads from without_own() to this belief, the moments of the
    // product of without_own() and the answers' likelihood. Recomputes all beliefs.
    void set_own(std::size_t i, const Belief& with_own);

    // A place, and the expected observer's loss there.
    struct Site {
        GratingPlace place;
        double loss = 0;
        double share = 0; // of the summation over area that it shows
    };

private:
    Site site(const GratingPlace& at) const;
    void update();
    // The posterior of a quantity of mean 0, by its covariances with the places' deviations.
    Belief predict(double variance, const FunctionRef<double(const Site&)>& covariance_with) const;

    perception::CsfTable table_;
    perception::Luminance luminance_;
    std::vector<Site> sites_;
    std::vector<double> expected_;
    std::vector<double> prior_;             // covariance of the deviations, square
    std::vector<double> precision_;         // of the places' own factors
    std::vector<double> shift_;             // precision times mean of the deviation
    std::vector<double> covariance_, mean_; // posterior, of the deviations
    int changes_ = 0;                       // since all was computed
};

} // namespace unseen::calibration
