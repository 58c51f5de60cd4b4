// QUEST+: a posterior on a grid, and what stimuli's answers are expected to tell of the threshold.
#include <unseen/calibration/internal/quest.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace unseen::calibration {

double Psychometric::shift() const {
    const double still_unseen = (1 - (at_threshold - lapse * guess) / (1 - lapse)) / (1 - guess);
    return std::log10(-std::log(still_unseen)) / slope;
}

double Psychometric::probability(double x) const {
    const double unseen = std::exp(-std::pow(10.0, slope * (x + shift())));
    return lapse * guess + (1 - lapse) * (1 - (1 - guess) * unseen);
}

QuestGrid standard_grid() {
    QuestGrid grid;
    for (int i = 0; i <= 160; ++i) grid.log10_threshold.push_back(-3.5 + 0.025 * i);
    for (int i = 0; i <= 70; ++i) grid.log10_contrast.push_back(-3.5 + 0.05 * i);
    grid.slope = {Psychometric().slope};
    return grid;
}

QuestPlus::QuestPlus(const QuestGrid& grid)
    : log_prior_(grid.log10_threshold.size(), 0.0), log_prior_of_slopes_(grid.slope.size(), 0.0),
      log_likelihood_(log_prior_.size() * grid.slope.size(), 0.0), posterior_(log_likelihood_.size()) {
    auto tables = std::make_shared<Tables>();
    tables->grid = grid;
    tables->right.reserve(grid.log10_contrast.size() * posterior_.size());
    for (const double contrast : grid.log10_contrast)
        for (const double slope : grid.slope)
            for (const double threshold : grid.log10_threshold)
                tables->right.push_back(
                    static_cast<float>(Psychometric{.slope = slope}.probability(contrast - threshold)));
    tables_ = std::move(tables);
    refresh();
}

void QuestPlus::set_log_prior(std::span<const double> of_thresholds, std::span<const double> of_slopes) {
    assert(of_thresholds.size() == log_prior_.size());
    assert(of_slopes.empty() || of_slopes.size() == log_prior_of_slopes_.size());
    log_prior_.assign(of_thresholds.begin(), of_thresholds.end());
    if (of_slopes.empty()) std::ranges::fill(log_prior_of_slopes_, 0.0);
    else log_prior_of_slopes_.assign(of_slopes.begin(), of_slopes.end());
    refresh();
}

std::vector<double> QuestPlus::log_evidence() const {
    const std::size_t thresholds = log_prior_.size();
    std::vector<double> evidence;
    for (std::size_t f = 0; f < log_prior_of_slopes_.size(); ++f) {
        const std::span likelihood = std::span(log_likelihood_).subspan(f * thresholds, thresholds);
        double largest = -std::numeric_limits<double>::infinity(), sum = 0;
        for (std::size_t t = 0; t < thresholds; ++t) largest = std::max(largest, likelihood[t] + log_prior_[t]);
        for (std::size_t t = 0; t < thresholds; ++t) sum += std::exp(likelihood[t] + log_prior_[t] - largest);
        evidence.push_back(largest + std::log(sum));
    }
    return evidence;
}

void QuestPlus::update(double log10_contrast, bool is_right) {
    std::size_t i = 0;
    for (const double slope : grid().slope)
        for (const double threshold : grid().log10_threshold) {
            const double right = Psychometric{.slope = slope}.probability(log10_contrast - threshold);
            log_likelihood_[i++] += std::log(is_right ? right : 1 - right);
        }
    refresh();
}

void QuestPlus::set_log_likelihood(std::span<const double> by_threshold) {
    assert(by_threshold.size() == log_prior_.size());
    for (std::size_t i = 0; i < log_likelihood_.size(); ++i) log_likelihood_[i] = by_threshold[i % by_threshold.size()];
    refresh();
}

void QuestPlus::refresh() {
    const std::size_t thresholds = log_prior_.size();
    for (std::size_t i = 0; i < posterior_.size(); ++i)
        posterior_[i] = log_likelihood_[i] + log_prior_[i % thresholds] + log_prior_of_slopes_[i / thresholds];
    const double largest = *std::max_element(posterior_.begin(), posterior_.end());
    double sum = 0;
    for (double& p : posterior_) sum += p = std::exp(p - largest);
    for (double& p : posterior_) p /= sum;
}

Belief QuestPlus::log10_threshold() const {
    const std::vector<double>& values = grid().log10_threshold;
    std::vector<double> marginal(values.size(), 0.0);
    for (std::size_t i = 0; i < posterior_.size(); ++i) marginal[i % values.size()] += posterior_[i];
    Belief belief;
    for (std::size_t t = 0; t < values.size(); ++t) belief.mean += marginal[t] * values[t];
    double variance = 0;
    for (std::size_t t = 0; t < values.size(); ++t)
        variance += marginal[t] * (values[t] - belief.mean) * (values[t] - belief.mean);
    belief.deviation = std::sqrt(variance);
    return belief;
}

std::vector<double> QuestPlus::log10_thresholds() const {
    const std::vector<double>& values = grid().log10_threshold;
    std::vector<double> means;
    for (std::size_t f = 0; f < log_prior_of_slopes_.size(); ++f) {
        double sum = 0, weight = 0;
        for (std::size_t t = 0; t < values.size(); ++t) {
            sum += posterior_[f * values.size() + t] * values[t];
            weight += posterior_[f * values.size() + t];
        }
        means.push_back(weight > 0 ? sum / weight : log10_threshold().mean);
    }
    return means;
}

void QuestPlus::forecast(const FunctionRef<void(const Forecast&)>& f) const {
    const std::vector<double>& thresholds = grid().log10_threshold;
    const std::size_t count = thresholds.size(), slopes = log_prior_of_slopes_.size();
    const std::vector<double> means = log10_thresholds();
    std::vector<double> off_mean; // by combination, weighted
    for (std::size_t i = 0; i < posterior_.size(); ++i)
        off_mean.push_back(posterior_[i] * (thresholds[i % count] - means[i / count]));
    std::vector<double> by_slope(slopes);
    for (std::size_t s = 0; s < grid().log10_contrast.size(); ++s) {
        const float* right = &tables_->right[s * posterior_.size()];
        double pull = 0;
        for (std::size_t slope = 0, i = 0; slope < slopes; ++slope) {
            double sum = 0;
            for (std::size_t t = 0; t < count; ++t, ++i) {
                sum += posterior_[i] * static_cast<double>(right[i]);
                pull += off_mean[i] * static_cast<double>(right[i]);
            }
            by_slope[slope] = sum;
        }
        f({grid().log10_contrast[s], by_slope, pull});
    }
}

} // namespace unseen::calibration
