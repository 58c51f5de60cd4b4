// What is believed about an observer's contrast sensitivity everywhere, from answers at some frequencies and eccentricities.
#pragma once

#include <span>
#include <vector>

#include <perception/csf.h>

namespace unseen::calibration {

// A static grating patch of 1.5 cycles radius at an eccentricity, as CsfTable has them.
struct GratingPlace {
    double frequency_cpd = 0, eccentricity_deg = 0;
    bool operator==(const GratingPlace&) const = default;
};

// A Gaussian process over log10 sensitivity: an expected table, plus a deviation d(f, e) of mean 0 and covariance
//   gain^2 + tilt^2 u u' + cutoff^2 f f' + decline^2 e e' + fall^2 (f e)(f' e') + local^2 exp(-du^2 / 2 lu^2 - dv^2 / 2 lv^2)
// with u octaves from 3 cpd, and v = log2(1 + e / 2 deg). The first five terms are a shape with five parameters: how sensitive
// the observer is, how steep over frequency, how fine, how fast it falls aside; the last lets every place differ from it.
// So what is measured in one place tells about the others, and what does not fit the shape still comes through.
//
// Answers come in as likelihoods by place, and are combined by expectation propagation (Minka 2001) with one Gaussian
// factor for each place. Cost of set_own(): places^2, of a prediction places^3.
class SensitivityField {
public:
    struct Belief {
        double mean = 0, deviation = 0; // log10 sensitivity
    };

    // `expected` gives the mean at `luminance`.
    SensitivityField(std::vector<GratingPlace> places, const perception::CsfTable& expected, perception::Luminance luminance);

    std::size_t size() const noexcept { return places_.size(); }
    const GratingPlace& place(std::size_t i) const noexcept { return places_[i]; }
    double expected(std::size_t i) const noexcept { return expected_[i]; } // log10 sensitivity

    // What the other places say about this one: the belief without this place's own answers.
    Belief without_own(std::size_t i) const;
    Belief belief(std::size_t i) const;
    // The deviation from the expected table anywhere, and its parts: the shape, and what is local.
    Belief deviation(const GratingPlace& at) const;
    Belief local_deviation(std::size_t i) const;

    // A place's own answers as a Gaussian factor that makes this belief of the one without them: moments of the product
    // of without_own() and the answers' likelihood. Then all beliefs are computed anew.
    void set_own(std::size_t i, const Belief& with_own);

private:
    void update();
    void change_factor(std::size_t i, double more_precision, double more_shift);

    std::vector<GratingPlace> places_;
    std::vector<double> expected_;
    std::vector<double> prior_;     // covariance of the deviations, square
    std::vector<double> precision_; // of the places' own factors
    std::vector<double> shift_;     // precision times mean of the deviation
    std::vector<double> covariance_, mean_; // posterior, of the deviations
    int changes_ = 0;                       // since all was computed
};

} // namespace unseen::calibration
