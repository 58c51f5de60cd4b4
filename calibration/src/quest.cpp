// QUEST+: a posterior on a grid, and what stimuli's answers are expected to tell of the threshold.
#include <unseen/calibration/internal/quest.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <string>

#include <unseen/vdtree/internal/errors.h>

#include "json_file.h"

namespace unseen::calibration {
namespace {

Result<void> check_axis(const std::vector<double>& axis, const std::string& name) {
    if (axis.empty()) return invalid_argument("QUEST+: " + name + " has no values.");
    for (std::size_t i = 0; i < axis.size(); ++i)
        if (!std::isfinite(axis[i]) || (i > 0 && !(axis[i] > axis[i - 1])))
            return invalid_argument("QUEST+: " + name + "[" + std::to_string(i) + "] is " + to_text(axis[i]) +
                                    ": the values must be finite and ascend.");
    return {};
}

} // namespace

double Psychometric::shift() const {
    const double still_unseen = (1 - (at_threshold - lapse * guess) / (1 - lapse)) / (1 - guess);
    return std::log10(-std::log(still_unseen)) / slope;
}

double Psychometric::probability(double x) const {
    const double unseen = std::exp(-std::pow(10.0, slope * (x + shift())));
    return lapse * guess + (1 - lapse) * (1 - (1 - guess) * unseen);
}

Result<void> validate(const Psychometric& f) {
    if (!(f.slope > 0 && std::isfinite(f.slope)))
        return invalid_argument("The slope must be above 0, not " + to_text(f.slope) + ".");
    if (!(f.lapse >= 0 && f.lapse < 1))
        return invalid_argument("The lapse rate must lie in 0..1, not " + to_text(f.lapse) + ".");
    if (!(f.guess >= 0 && f.guess < 1))
        return invalid_argument("The guess rate must lie in 0..1, not " + to_text(f.guess) + ".");
    if (!std::isfinite(f.shift()))
        return invalid_argument("The threshold cannot be at " + to_text(f.at_threshold) +
                                " right answers: with a guess rate of " + to_text(f.guess) + " and a lapse rate of " +
                                to_text(f.lapse) + " they never are so many or so few.");
    return {};
}

QuestGrid standard_grid() {
    QuestGrid grid;
    for (int i = 0; i <= 160; ++i) grid.log10_threshold.push_back(-3.5 + 0.025 * i);
    for (int i = 0; i <= 70; ++i) grid.log10_contrast.push_back(-3.5 + 0.05 * i);
    grid.slope = {Psychometric().slope};
    grid.lapse = {Psychometric().lapse};
    return grid;
}

struct QuestPlus::Tables {
    QuestGrid grid;
    std::vector<Psychometric> functions; // by lapse and slope
    std::vector<float> right;            // by stimulus and combination: the probability of a right answer

    std::size_t combinations() const { return functions.size() * grid.log10_threshold.size(); }
};

QuestPlus::QuestPlus(std::shared_ptr<const Tables> tables)
    : tables_(std::move(tables)), log_prior_(tables_->grid.log10_threshold.size(), 0.0),
      log_prior_of_functions_(tables_->functions.size(), 0.0), log_likelihood_(tables_->combinations(), 0.0),
      posterior_(tables_->combinations()) {
    refresh();
}

Result<QuestPlus> QuestPlus::create(const QuestGrid& grid) {
    for (const auto& [axis, name] : {std::pair{&grid.log10_threshold, "log10_threshold"},
                                     {&grid.slope, "slope"},
                                     {&grid.lapse, "lapse"},
                                     {&grid.log10_contrast, "log10_contrast"}})
        if (auto ok = check_axis(*axis, name); !ok) return ok.error();
    auto tables = std::make_shared<Tables>();
    tables->grid = grid;
    for (const double lapse : grid.lapse)
        for (const double slope : grid.slope) {
            tables->functions.push_back({slope, lapse, grid.guess, grid.at_threshold});
            if (auto ok = validate(tables->functions.back()); !ok) return ok.error();
        }
    tables->right.reserve(grid.log10_contrast.size() * tables->combinations());
    for (const double contrast : grid.log10_contrast)
        for (const Psychometric& function : tables->functions)
            for (const double threshold : grid.log10_threshold)
                tables->right.push_back(static_cast<float>(function.probability(contrast - threshold)));
    return QuestPlus(std::move(tables));
}

const QuestGrid& QuestPlus::grid() const noexcept { return tables_->grid; }

void QuestPlus::set_log_prior(std::span<const double> of_thresholds, std::span<const double> of_functions) {
    assert(of_thresholds.size() == log_prior_.size());
    assert(of_functions.empty() || of_functions.size() == log_prior_of_functions_.size());
    log_prior_.assign(of_thresholds.begin(), of_thresholds.end());
    if (of_functions.empty()) log_prior_of_functions_.assign(log_prior_of_functions_.size(), 0.0);
    else log_prior_of_functions_.assign(of_functions.begin(), of_functions.end());
    refresh();
}

std::vector<double> QuestPlus::log_evidence() const {
    const std::size_t thresholds = log_prior_.size();
    std::vector<double> evidence;
    for (std::size_t f = 0; f < tables_->functions.size(); ++f) {
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
    for (const Psychometric& function : tables_->functions)
        for (const double threshold : tables_->grid.log10_threshold) {
            const double right = function.probability(log10_contrast - threshold);
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
        posterior_[i] = log_likelihood_[i] + log_prior_[i % thresholds] + log_prior_of_functions_[i / thresholds];
    const double largest = *std::max_element(posterior_.begin(), posterior_.end());
    double sum = 0;
    for (double& p : posterior_) sum += p = std::exp(p - largest);
    for (double& p : posterior_) p /= sum;
}

QuestPlus::Belief QuestPlus::log10_threshold() const {
    const std::vector<double>& values = tables_->grid.log10_threshold;
    std::vector<double> marginal(values.size(), 0.0);
    for (std::size_t i = 0; i < posterior_.size(); ++i) marginal[i % values.size()] += posterior_[i];
    Belief belief;
    for (std::size_t t = 0; t < values.size(); ++t) belief.mean += marginal[t] * values[t];
    double variance = 0;
    for (std::size_t t = 0; t < values.size(); ++t)
        variance += marginal[t] * (values[t] - belief.mean) * (values[t] - belief.mean);
    belief.deviation = std::sqrt(variance);
    belief.mode =
        values[static_cast<std::size_t>(std::max_element(marginal.begin(), marginal.end()) - marginal.begin())];
    return belief;
}

std::vector<double> QuestPlus::log10_thresholds() const {
    const std::vector<double>& values = tables_->grid.log10_threshold;
    std::vector<double> means;
    for (std::size_t f = 0; f < tables_->functions.size(); ++f) {
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
    const std::vector<double>& thresholds = tables_->grid.log10_threshold;
    const std::size_t count = thresholds.size(), functions = tables_->functions.size();
    const std::vector<double> means = log10_thresholds();
    std::vector<double> off_mean; // by combination, weighted
    for (std::size_t i = 0; i < posterior_.size(); ++i)
        off_mean.push_back(posterior_[i] * (thresholds[i % count] - means[i / count]));
    std::vector<double> by_function(functions);
    for (std::size_t s = 0; s < tables_->grid.log10_contrast.size(); ++s) {
        const float* right = &tables_->right[s * posterior_.size()];
        double pull = 0;
        for (std::size_t function = 0, i = 0; function < functions; ++function) {
            double sum = 0;
            for (std::size_t t = 0; t < count; ++t, ++i) {
                sum += posterior_[i] * static_cast<double>(right[i]);
                pull += off_mean[i] * static_cast<double>(right[i]);
            }
            by_function[function] = sum;
        }
        f({tables_->grid.log10_contrast[s], by_function, pull});
    }
}

// The variance that is expected after an answer is that of now, less that of the means after either answer.
QuestPlus::Choice QuestPlus::next() const {
    const double mean = log10_threshold().mean;
    const std::vector<double> means = log10_thresholds();
    Choice best;
    best.gain = -1;
    forecast([&](const Forecast& answer) {
        double right = 0, covariance = answer.pull;
        for (std::size_t f = 0; f < means.size(); ++f) {
            right += answer.right[f];
            covariance += answer.right[f] * (means[f] - mean);
        }
        const double gain = right > 0 && right < 1 ? covariance * covariance / (right * (1 - right)) : 0;
        if (gain > best.gain) best = {answer.log10_contrast, gain};
    });
    return best;
}

} // namespace unseen::calibration
