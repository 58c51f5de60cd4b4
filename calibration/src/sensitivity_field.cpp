// A Gaussian process over log sensitivity: covariances, and posteriors by Cholesky's factorisation.
#include <unseen/calibration/internal/sensitivity_field.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calibration_plan.h"

namespace unseen::calibration {
namespace {

using Site = SensitivityField::Site;

// Standard deviations of an observer from the expected one, in log10 units (0.05 is 1 dB). Observers of one age differ
// by about 6 dB in gain; the rest is chosen wide enough for the published models to be reached from one another.
constexpr double gain = 0.3;
constexpr double tilt_per_octave = 0.08;
constexpr double cutoff_per_cpd = 0.015;
constexpr double decline_per_degree = 0.012;
constexpr double fall_per_cpd_degree = 0.006; // castleCSF's nasal and temporal fields lie 0.011 apart
constexpr double share_of_loss = 0.2;
constexpr double local = 0.07, local_share_of_loss = 0.16;
// How people sum over area: only the spread over all people is known, which is that of the gain.
constexpr double summation = 0.3;
constexpr double local_octaves = 1.5; // length over which it stays alike; also in octaves of 2 deg + eccentricity
// What lies lower is not seen at any contrast, and need not vary more.
constexpr double most_loss = 2.5;

constexpr double middle_cpd = 3; // near the peak of sensitivity, where tilting leaves the gain as it is
constexpr double fovea_deg = 2;
// Added to variances, so that places which nothing tells apart do not make the matrix singular; 0.02 dB.
constexpr double jitter = 1e-6;

double octaves(const GratingPlace& p) { return std::log2(p.frequency_cpd / middle_cpd); }
double aside(const GratingPlace& p) { return std::log2(1 + p.eccentricity_deg / fovea_deg); }

double shape_covariance(const Site& a, const Site& b) {
    const auto square = [](double x) { return x * x; };
    const double fa = a.place.frequency_cpd, fb = b.place.frequency_cpd, ea = a.place.eccentricity_deg,
                 eb = b.place.eccentricity_deg;
    return square(gain) + square(tilt_per_octave) * octaves(a.place) * octaves(b.place) +
           square(cutoff_per_cpd) * fa * fb + square(decline_per_degree) * ea * eb +
           square(fall_per_cpd_degree) * fa * ea * fb * eb + square(share_of_loss) * a.loss * b.loss +
           square(summation) * a.share * b.share;
}

double local_deviation_of(const Site& s) { return local + local_share_of_loss * s.loss; }

double local_covariance(const Site& a, const Site& b) {
    const double du = (octaves(a.place) - octaves(b.place)) / local_octaves,
                 dv = (aside(a.place) - aside(b.place)) / local_octaves;
    return local_deviation_of(a) * local_deviation_of(b) * std::exp(-(du * du + dv * dv) / 2);
}

double covariance(const Site& a, const Site& b) { return shape_covariance(a, b) + local_covariance(a, b); }

// The lower factor of a symmetric positive definite matrix, in place; the upper part is left as it is.
void factorise(std::vector<double>& m, std::size_t n) {
    for (std::size_t j = 0; j < n; ++j) {
        for (std::size_t i = j; i < n; ++i) {
            double sum = m[i * n + j];
            for (std::size_t k = 0; k < j; ++k) sum -= m[i * n + k] * m[j * n + k];
            m[i * n + j] = i == j ? std::sqrt(sum) : sum / m[j * n + j];
        }
    }
}

// Solves L x = b in place.
void solve_lower(const std::vector<double>& factor, std::size_t n, std::vector<double>& x) {
    for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t k = 0; k < i; ++k) x[i] -= factor[i * n + k] * x[k];
        x[i] /= factor[i * n + i];
    }
}

// The factor of I + R K R, R the roots of the precisions: well conditioned, whatever is not measured.
std::vector<double> weighted_factor(const std::vector<double>& prior, const std::vector<double>& precision) {
    const std::size_t n = precision.size();
    std::vector<double> b(n * n);
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = 0; j < n; ++j)
            b[i * n + j] = std::sqrt(precision[i] * precision[j]) * prior[i * n + j] + (i == j ? 1.0 : 0.0);
    factorise(b, n);
    return b;
}

} // namespace

double GratingPlace::sigma_deg() const {
    return is_wide() ? std::sqrt(area_deg2 / std::numbers::pi) : 1.5 / frequency_cpd;
}

double summation_gain(const GratingPlace& place, double own) {
    if (!place.is_wide()) return 1;
    return perception::summation_gain(perception::CyclesPerDegree(place.frequency_cpd),
                                      perception::SquareDegrees(place.area_deg2), own);
}

SensitivityField::SensitivityField(const std::vector<GratingPlace>& places, perception::CsfTable expected,
                                   perception::Luminance luminance)
    : table_(std::move(expected)), luminance_(luminance), precision_(places.size(), 0.0), shift_(places.size(), 0.0) {
    for (const GratingPlace& place : places) {
        sites_.push_back(site(place));
        expected_.push_back(log10_expected(table_, place, luminance_));
    }
    const std::size_t n = places.size();
    prior_.resize(n * n);
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = 0; j < n; ++j)
            prior_[i * n + j] = covariance(sites_[i], sites_[j]) + (i == j ? jitter : 0.0);
    update();
}

Site SensitivityField::site(const GratingPlace& at) const {
    // What a place has lost does not depend on the patch there.
    const double here = log10_expected(table_, {at.frequency_cpd, at.eccentricity_deg}, luminance_),
                 best = log10_expected(table_, {middle_cpd, 0}, luminance_);
    const double share = at.is_wide() ? perception::summation_share(perception::CyclesPerDegree(at.frequency_cpd),
                                                                    perception::SquareDegrees(at.area_deg2))
                                      : 0;
    return {at, std::clamp(best - here, 0.0, most_loss), share};
}

Belief SensitivityField::belief(std::size_t i) const {
    return {expected_[i] + mean_[i], std::sqrt(covariance_[i * size() + i])};
}

Belief SensitivityField::without_own(std::size_t i) const {
    const double variance = covariance_[i * size() + i];
    // At least the posterior's own precision is left: a factor's can exceed it by rounding only.
    const double rest = std::max(1 / variance - precision_[i], 1e-9 / variance);
    return {expected_[i] + (mean_[i] / variance - shift_[i]) / rest, std::sqrt(1 / rest)};
}

std::vector<double> SensitivityField::pulled_by(std::size_t i) const {
    std::vector<double> shares;
    for (std::size_t j = 0; j < size(); ++j)
        shares.push_back(covariance_[i * size() + j] / covariance_[i * size() + i]);
    return shares;
}

void SensitivityField::set_own(std::size_t i, const Belief& with_own) {
    const Belief rest = without_own(i);
    const double rest_precision = 1 / (rest.deviation * rest.deviation);
    const double precision = 1 / (with_own.deviation * with_own.deviation);
    // Surprising answers can widen a belief; a factor of negative precision would be no distribution.
    const double own = std::max(precision - rest_precision, 1e-6 * rest_precision);
    const double shift =
        (with_own.mean - expected_[i]) * (own + rest_precision) - (rest.mean - expected_[i]) * rest_precision;
    const double more_precision = own - precision_[i], more_shift = shift - shift_[i];
    precision_[i] += more_precision;
    shift_[i] += more_shift;
    // One factor changes the covariance by a matrix of rank one. Rounding adds up, so that now and then all is computed
    // anew.
    constexpr int most_changes = 200;
    if (++changes_ > most_changes) return update();
    const std::size_t n = size();
    const double weight = more_precision / (1 + more_precision * covariance_[i * n + i]);
    const std::vector<double> column(covariance_.begin() + static_cast<std::ptrdiff_t>(i * n),
                                     covariance_.begin() + static_cast<std::ptrdiff_t>((i + 1) * n));
    const double pull = more_shift - weight * (mean_[i] + column[i] * more_shift);
    for (std::size_t j = 0; j < n; ++j) {
        mean_[j] += column[j] * pull;
        for (std::size_t k = 0; k < n; ++k) covariance_[j * n + k] -= weight * column[j] * column[k];
    }
}

void SensitivityField::update() {
    changes_ = 0;
    const std::size_t n = size();
    const std::vector<double> factor = weighted_factor(prior_, precision_);
    // K - K R (I + R K R)^-1 R K, by columns v = L^-1 R K.
    std::vector<std::vector<double>> columns(n, std::vector<double>(n));
    for (std::size_t j = 0; j < n; ++j) {
        for (std::size_t i = 0; i < n; ++i) columns[j][i] = std::sqrt(precision_[i]) * prior_[i * n + j];
        solve_lower(factor, n, columns[j]);
    }
    covariance_.resize(n * n);
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = 0; j < n; ++j) {
            double sum = prior_[i * n + j];
            for (std::size_t k = 0; k < n; ++k) sum -= columns[i][k] * columns[j][k];
            covariance_[i * n + j] = sum;
        }
    mean_.assign(n, 0.0);
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = 0; j < n; ++j) mean_[i] += covariance_[i * n + j] * shift_[j];
}

Belief SensitivityField::predict(double variance, const FunctionRef<double(const Site&)>& covariance_with) const {
    const std::size_t n = size();
    const std::vector<double> factor = weighted_factor(prior_, precision_);
    // w = R (I + R K R)^-1 R applied to the factors' means, where they have any precision.
    std::vector<double> pull(n), reach(n);
    for (std::size_t i = 0; i < n; ++i) {
        const double root = std::sqrt(precision_[i]);
        pull[i] = root > 0 ? shift_[i] / root : 0;
        reach[i] = root * covariance_with(sites_[i]);
    }
    solve_lower(factor, n, pull);
    solve_lower(factor, n, reach);
    Belief belief;
    for (std::size_t i = 0; i < n; ++i) {
        belief.mean += reach[i] * pull[i];
        variance -= reach[i] * reach[i];
    }
    belief.deviation = std::sqrt(std::max(0.0, variance));
    return belief;
}

Belief SensitivityField::deviation(const GratingPlace& at) const {
    const Site here = site(at);
    return predict(covariance(here, here), [&](const Site& s) { return covariance(here, s); });
}

Belief SensitivityField::log10_summation() const {
    return predict(summation * summation, [](const Site& s) { return summation * summation * s.share; });
}

Belief SensitivityField::local_deviation(std::size_t i) const {
    const Site& here = sites_[i];
    return predict(local_covariance(here, here), [&](const Site& s) { return local_covariance(here, s); });
}

} // namespace unseen::calibration
