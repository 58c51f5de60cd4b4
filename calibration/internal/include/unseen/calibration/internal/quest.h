// QUEST+ (Watson 2017): adaptive measurement of a psychometric function on a grid of its parameters. Stimuli are chosen for
// the threshold alone (King-Smith et al. 1994); the slope is a nuisance parameter.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <unseen/calibration/procedure.h>
#include <unseen/vdtree/function_ref.h>

namespace unseen::calibration {

// The share of right answers over x = log10 contrast - log10 threshold: QUEST's Weibull function (Watson and Pelli 1983)
//   p(x) = lapse guess + (1 - lapse) (1 - (1 - guess) exp(-10^(slope (x + shift))))
// shifted so that p(0) = at_threshold: the threshold is the contrast with that share of right answers, whatever the slope.
struct Psychometric {
    static constexpr double guess = 0.5; // right by chance: one of two intervals
    static constexpr double at_threshold = 0.82;

    double slope = 3.5;
    double lapse = 0.01; // share of blind answers, below 0.36: with more, the threshold is never reached

    double shift() const; // in log10 contrast
    double probability(double x) const;
};

// Values of the parameters, each strictly ascending; the belief is over all their combinations.
struct QuestGrid {
    std::vector<double> log10_threshold, slope;
    std::vector<double> log10_contrast; // the stimuli to choose from
};

// Thresholds 10^-3.5 to 10^0.5 in steps of 0.025, contrasts 10^-3.5 to 1 in steps of 0.05, the usual slope.
QuestGrid standard_grid();

// Copies share the grid's tables. Cost: a function value for each combination of parameters in update(), and two
// multiplications for each combination and stimulus in forecast().
class QuestPlus {
public:
    // Begins with all combinations equally likely.
    explicit QuestPlus(const QuestGrid& grid);

    const QuestGrid& grid() const noexcept { return tables_->grid; }

    // The prior: log weights, up to a constant, one for each log10_threshold, and one for each slope (empty: all equal).
    // May be replaced at any time; the answers stay.
    void set_log_prior(std::span<const double> of_thresholds, std::span<const double> of_slopes = {});
    // The answers' evidence for the slopes: the log of the likelihood's mean over the prior of the thresholds, up to a
    // constant.
    std::vector<double> log_evidence() const;
    void update(double log10_contrast, bool is_right);
    // Replaces all answers by log likelihoods by threshold, up to a constant.
    void set_log_likelihood(std::span<const double> by_threshold);

    // Probability of each combination: [slope * thresholds + threshold]. Sum 1.
    std::span<const double> posterior() const noexcept { return posterior_; }
    Belief log10_threshold() const;
    // Mean log10 thresholds by slope, each as if that slope were known.
    std::vector<double> log10_thresholds() const;

    // The expected information of the answer to each stimulus.
    struct Forecast {
        double log10_contrast = 0;
        std::span<const double> right; // probability of each slope, and of a right answer
        double pull = 0;               // covariance of a right answer and log10_threshold for a known slope
    };
    // Calls f(Forecast) for all stimuli in turn.
    void forecast(const FunctionRef<void(const Forecast&)>& f) const;

private:
    struct Tables {
        QuestGrid grid;
        std::vector<float> right; // by stimulus and combination: the probability of a right answer
    };
    void refresh();

    std::shared_ptr<const Tables> tables_;
    std::vector<double> log_prior_; // by threshold
    std::vector<double> log_prior_of_slopes_;
    std::vector<double> log_likelihood_; // by combination
    std::vector<double> posterior_;      // by combination
};

} // namespace unseen::calibration
