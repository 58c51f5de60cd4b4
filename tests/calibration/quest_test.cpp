// QUEST+: the psychometric function and posteriors against reference figures, and the choice of stimuli against its
// definition.
#include <unseen/calibration/internal/quest.h>

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace unseen::calibration::quest_test {
namespace {

using testing::HasSubstr;

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

TEST(Psychometric, RefusesWhatIsNone) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const Psychometric bad[] = {
        {.slope = 0},          {.slope = nan},          {.lapse = 1},         {.lapse = nan}, {.guess = -0.1},
        {.at_threshold = 0.5}, {.at_threshold = 0.999}, {.at_threshold = nan}};
    for (const Psychometric& f : bad) EXPECT_FALSE(validate(f)) << f.slope << f.lapse << f.guess << f.at_threshold;
    EXPECT_TRUE(validate(Psychometric()));
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
    auto quest = QuestPlus::create(grid);
    ASSERT_TRUE(quest) << quest.error().message;
    quest->set_log_prior(prior);
    struct Row {
        double contrast;
        bool is_right;
        double mean, deviation, mode;
    };
    const Row rows[] = {
        {-1, true, -1.2469275, 0.913353054, -1.18},       {-1.2, true, -1.46704839, 0.850136725, -1.36},
        {-1.5, false, -0.781722084, 0.65568675, -1.26},   {-1.3, true, -0.909132036, 0.63681189, -1.32},
        {-1.4, true, -1.01841223, 0.615875876, -1.37},    {-1.6, false, -0.932582993, 0.602396681, -1.35},
        {-1.45, true, -1.01468251, 0.576894024, -1.38},   {-1.5, true, -1.08535286, 0.549662993, -1.41},
        {-1.55, false, -0.998869746, 0.575249714, -1.37}, {-1.5, true, -1.06348899, 0.549910952, -1.4},
        {-1.52, false, -0.972329696, 0.578733191, -1.36}, {-1.48, true, -1.03741959, 0.553571819, -1.38}};
    for (const Row& row : rows) {
        quest->update(row.contrast + (reference_shift - Psychometric().shift()), row.is_right);
        const QuestPlus::Belief belief = quest->log10_threshold();
        EXPECT_NEAR(belief.mean, row.mean, 1e-8) << row.contrast;
        EXPECT_NEAR(belief.deviation, row.deviation, 1e-8) << row.contrast;
        EXPECT_NEAR(belief.mode, row.mode, 1e-9) << row.contrast;
    }
}

// The definition: for both answers the posterior's variance, weighted by how likely they are.
TEST(QuestPlus, TheNextStimulusLeavesTheLeastExpectedVariance) {
    QuestGrid grid;
    for (int i = 0; i <= 40; ++i) grid.log10_threshold.push_back(-3 + 0.05 * i);
    grid.slope = {2, 3.5, 5};
    grid.lapse = {0.01, 0.04};
    for (int i = 0; i <= 20; ++i) grid.log10_contrast.push_back(-3 + 0.1 * i);
    auto quest = QuestPlus::create(grid);
    ASSERT_TRUE(quest);
    const auto variance = [](const QuestPlus& q) {
        return q.log10_threshold().deviation * q.log10_threshold().deviation;
    };
    const std::pair<double, bool> answers[] = {{-1.5, true}, {-2, true},    {-2.5, false},
                                               {-2.2, true}, {-2.4, false}, {-1.9, true}};
    for (const auto& [contrast, is_right] : answers) {
        const auto choice = quest->next();
        const double now = variance(*quest);
        double least = std::numeric_limits<double>::infinity(), of_choice = 0;
        for (const double stimulus : grid.log10_contrast) {
            double right = 0;
            std::size_t i = 0;
            for (const double lapse : grid.lapse)
                for (const double slope : grid.slope)
                    for (const double threshold : grid.log10_threshold)
                        right += quest->posterior()[i++] *
                                 Psychometric{slope, lapse, 0.5, 0.82}.probability(stimulus - threshold);
            double expected = 0;
            for (const bool answer : {true, false}) {
                QuestPlus after = *quest;
                after.update(stimulus, answer);
                expected += (answer ? right : 1 - right) * variance(after);
            }
            least = std::min(least, expected);
            if (stimulus == choice.log10_contrast) of_choice = expected;
        }
        EXPECT_NEAR(of_choice, least, 1e-6);
        EXPECT_NEAR(now - choice.gain, of_choice, 1e-6);
        quest->update(contrast, is_right);
    }
}

TEST(QuestPlus, RefusesGridsThatAreNone) {
    const auto error_of = [](auto change) {
        QuestGrid grid = standard_grid();
        change(grid);
        const auto made = QuestPlus::create(grid);
        return made ? "none" : made.error().message;
    };
    EXPECT_THAT(error_of([](QuestGrid& g) { g.slope.clear(); }), HasSubstr("slope has no values"));
    EXPECT_THAT(error_of([](QuestGrid& g) { g.log10_threshold[3] = g.log10_threshold[2]; }),
                HasSubstr("log10_threshold[3]"));
    EXPECT_THAT(error_of([](QuestGrid& g) { g.log10_contrast[0] = std::nan(""); }), HasSubstr("log10_contrast[0]"));
    EXPECT_THAT(error_of([](QuestGrid& g) { g.lapse = {1}; }), HasSubstr("lapse"));
    EXPECT_THAT(error_of([](QuestGrid& g) { g.at_threshold = 0.4; }), HasSubstr("threshold"));
}

} // namespace
} // namespace unseen::calibration::quest_test
