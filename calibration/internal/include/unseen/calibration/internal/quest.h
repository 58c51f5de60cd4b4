// QUEST+ (Watson 2017): adaptive measurement of a psychometric function on a grid of its parameters. Stimuli are chosen for
// the threshold alone (King-Smith et al. 1994); slope and lapse rate are nuisance parameters.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/result.h>

namespace unseen::calibration {

// The share of right answers over x = log10 contrast - log10 threshold: QUEST's Weibull function (Watson and Pelli 1983)
//   p(x) = lapse guess + (1 - lapse) (1 - (1 - guess) exp(-10^(slope (x + shift))))
// shifted so that p(0) = at_threshold: the threshold is the contrast with that share of right answers, whatever the slope.
struct Psychometric {
    double slope = 3.5;
    double lapse = 0.01; // share of blind answers
    double guess = 0.5;  // right by chance: one of two intervals
    double at_threshold = 0.82;

    double shift() const; // in log10 contrast
    double probability(double x) const;
};

// Ranges: slope > 0, 0 <= lapse < 1, 0 <= guess < 1, and a threshold that the function reaches. The error names the field.
Result<void> validate(const Psychometric& function);

// Values of the parameters, each strictly ascending and finite; the belief is over all their combinations.
struct QuestGrid {
    std::vector<double> log10_threshold, slope, lapse;
    std::vector<double> log10_contrast; // the stimuli to choose from
    double guess = 0.5, at_threshold = 0.82;
};

// Thresholds 10^-3.5 to 10^0.5 in steps of 0.025, contrasts 10^-3.5 to 1 in steps of 0.05, slope and lapse as by
// default.
QuestGrid standard_grid();

// Copies share the grid's tables. Cost: a function value for each combination of parameters in update(), and two
// multiplications for each combination and stimulus in next().
class QuestPlus {
public:
    // Begins with all combinations equally likely.
    static Result<QuestPlus> create(const QuestGrid& grid);

    const QuestGrid& grid() const noexcept;

    // The prior: log weights, up to a constant, one for each log10_threshold, and one for each pair of slope and lapse,
    // slopes first (empty: all equal). May be replaced at any time; the answers stay.
    void set_log_prior(std::span<const double> of_thresholds, std::span<const double> of_functions = {});
    // The answers' evidence for the pairs of slope and lapse: the log of the likelihood's mean over the prior of the
    // thresholds, up to a constant, in the same order.
    std::vector<double> log_evidence() const;
    void update(double log10_contrast, bool is_right);
    // Replaces all answers by log likelihoods by threshold, up to a constant.
    void set_log_likelihood(std::span<const double> by_threshold);

    // Probability of each combination, thresholds first: [(lapse * slopes + slope) * thresholds + threshold]. Sum 1.
    std::span<const double> posterior() const noexcept { return posterior_; }

    struct Belief {
        double mean = 0, deviation = 0, mode = 0;
    };
    Belief log10_threshold() const;

    // Mean log10 thresholds by pair of slope and lapse, each as if that pair were known.
    std::vector<double> log10_thresholds() const;

    // The expected information of the answer to each stimulus.
    struct Forecast {
        double log10_contrast = 0;
        std::span<const double> right; // probability of each pair of slope and lapse, and of a right answer
        double pull = 0;               // covariance of a right answer and log10_threshold for a known pair
    };
    // Calls f(Forecast) for all stimuli in turn.
    void forecast(const FunctionRef<void(const Forecast&)>& f) const;

    // The stimulus whose answer is expected to leave the least variance of log10_threshold; the first of equals.
    struct Choice {
        double log10_contrast = 0;
        double gain = 0; // by which the expected variance is below that of now; 0 or more
    };
    Choice next() const;

private:
    struct Tables;
    explicit QuestPlus(std::shared_ptr<const Tables> tables);
    void refresh();

    std::shared_ptr<const Tables> tables_;
    std::vector<double> log_prior_; // by threshold
    std::vector<double> log_prior_of_functions_;
    std::vector<double> log_likelihood_; // by combination
    std::vector<double> posterior_;      // by combination
};

} // namespace unseen::calibration
