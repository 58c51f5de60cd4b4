// QUEST+: the psychometric function and posteriors against reference figures, and the forecasts against their
// definition.
#include <unseen/calibration/internal/quest.h>

#include "testing.h"

namespace unseen::calibration::quest_test {

// The shift taken out again: the reference tabulates p(x) with its threshold where 10^(slope x) is 1.
double unshifted(double x) {
    const Psychometric f;
    return f.probability(x - f.shift());
}

// The reference finds its shift by linear interpolation of a table in steps of 0.01, which is off by 4e-6.
constexpr double reference_shift = 0.00484354347;

TEST(Psychometric, FollowsTheReference) {
    struct Row {
        double x, p;
    };
    const Row rows[] = {{-1, 0.500156508},   {-0.7, 0.501753214}, {-0.5, 0.508724679}, {-0.3, 0.542208086},
                        {-0.2, 0.589536227}, {-0.1, 0.678325583}, {0, 0.812899677},    {0.1, 0.942235605},
                        {0.2, 0.99170408},   {0.5, 0.995}};
    for (const Row& row : rows) EXPECT_NEAR(unshifted(row.x), row.p, 1e-9) << row.x;
    EXPECT_NEAR(Psychometric().shift(), reference_shift, 5e-6);
}

TEST(Psychometric, TheThresholdIsWhereItSaysForEverySlope) {
    for (const double slope : {1.0, 2.0, 3.5, 8.0})
        EXPECT_NEAR((Psychometric{.slope = slope}.probability(0)), 0.82, 1e-12) << slope;
}

// A normal prior of mean -1 and standard deviation 1 on a grid of 0.01 within 2.5 of it, and twelve answers.
TEST(QuestPlus, PosteriorsFollowTheReferenceTrace) {
    QuestGrid grid = standard_grid();
    grid.log10_threshold.clear();
    std::vector<double> prior;
    for (int i = -250; i <= 250; ++i) {
        grid.log10_threshold.push_back(-1 + 0.01 * i);
        prior.push_back(-(0.01 * i) * (0.01 * i) / 2);
    }
    QuestPlus quest(grid);
    quest.set_log_prior(prior);
    struct Row {
        double contrast;
        bool is_right;
        double mean, deviation;
    };
    const Row rows[] = {{-1, true, -1.2469275, 0.913353054},       {-1.2, true, -1.46704839, 0.850136725},
                        {-1.5, false, -0.781722084, 0.65568675},   {-1.3, true, -0.909132036, 0.63681189},
                        {-1.4, true, -1.01841223, 0.615875876},    {-1.6, false, -0.932582993, 0.602396681},
                        {-1.45, true, -1.01468251, 0.576894024},   {-1.5, true, -1.08535286, 0.549662993},
                        {-1.55, false, -0.998869746, 0.575249714}, {-1.5, true, -1.06348899, 0.549910952},
                        {-1.52, false, -0.972329696, 0.578733191}, {-1.48, true, -1.03741959, 0.553571819}};
    for (const Row& row : rows) {
        quest.update(row.contrast + (reference_shift - Psychometric().shift()), row.is_right);
        const Belief belief = quest.log10_threshold();
        EXPECT_NEAR(belief.mean, row.mean, 1e-8) << row.contrast;
        EXPECT_NEAR(belief.deviation, row.deviation, 1e-8) << row.contrast;
    }
}

// A forecast tells by how much the variance is expected to shrink; the definition: for both answers the posterior's
// variance, weighted by how likely they are.
TEST(QuestPlus, ForecastsTheExpectedVariance) {
    QuestGrid grid;
    for (int i = 0; i <= 40; ++i) grid.log10_threshold.push_back(-3 + 0.05 * i);
    grid.slope = {2, 3.5, 5};
    for (int i = 0; i <= 20; ++i) grid.log10_contrast.push_back(-3 + 0.1 * i);
    QuestPlus quest(grid);
    const auto variance = [](const QuestPlus& q) {
        return q.log10_threshold().deviation * q.log10_threshold().deviation;
    };
    const std::pair<double, bool> answers[] = {{-1.5, true}, {-2, true},    {-2.5, false},
                                               {-2.2, true}, {-2.4, false}, {-1.9, true}};
    for (const auto& [contrast, is_right] : answers) {
        const std::vector<double> means = quest.log10_thresholds();
        quest.forecast([&](const QuestPlus::Forecast& answer) {
            double right = 0, covariance = answer.pull, defined_right = 0, expected = 0;
            for (std::size_t f = 0; f < means.size(); ++f) {
                right += answer.right[f];
                covariance += answer.right[f] * (means[f] - quest.log10_threshold().mean);
            }
            std::size_t i = 0;
            for (const double slope : grid.slope)
                for (const double threshold : grid.log10_threshold)
                    defined_right += quest.posterior()[i++] *
                                     Psychometric{.slope = slope}.probability(answer.log10_contrast - threshold);
            EXPECT_NEAR(right, defined_right, 1e-6);
            for (const bool is_seen : {true, false}) {
                QuestPlus after = quest;
                after.update(answer.log10_contrast, is_seen);
                expected += (is_seen ? right : 1 - right) * variance(after);
            }
            EXPECT_NEAR(variance(quest) - covariance * covariance / (right * (1 - right)), expected, 1e-6);
        });
        quest.update(contrast, is_right);
    }
}

} // namespace unseen::calibration::quest_test
