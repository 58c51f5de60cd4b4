// Studies: orders and sides, files, what answers come to, and an observer who answers as a known probability says.
#include <unseen/calibration/study.h>

#include <unseen/calibration/internal/picture_observer.h>
#include <unseen/perception/judge.h>

#include "temp_folder.h"
#include "testing.h"

namespace unseen::calibration::study_test {

namespace fs = std::filesystem;

Study study_of(StudyTask task, const fs::path& folder, int repeats = 10) {
    Study study{.task = task, .repeats = repeats, .seed = 7, .pixels_per_degree = 34, .pairs = {}};
    study.pairs.push_back({"plain", folder / "a.png", folder / "b.png", true, {}});
    study.pairs.push_back({"near, \"quoted\"", folder / "a.png", folder / "c.png", false, false});
    study.pairs.push_back({"far", folder / "a.png", folder / "d.png", false, true});
    if (task == StudyTask::differ) study.pairs.push_back({"one", folder / "a.png", folder / "a.png", false, {}});
    return study;
}

std::string text_of(const fs::path& file) {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
}

TEST(Study, ShowsTrainingFirstThenEveryPairOnBothSidesInAnOrderOfTheSubject) {
    const Study study = study_of(StudyTask::differ, "/x");
    const auto trials = trials_of(study, "ann");
    ASSERT_EQ(trials.size(), 1u + 3u * 10u);
    EXPECT_EQ(trials.front().pair, 0u);
    std::map<std::size_t, int> shown, left;
    for (std::size_t i = 0; i < trials.size(); ++i) {
        EXPECT_EQ(trials[i].number, static_cast<int>(i));
        ++shown[trials[i].pair], left[trials[i].pair] += trials[i].is_other_left;
    }
    for (std::size_t pair = 1; pair < 4; ++pair) {
        EXPECT_EQ(shown[pair], 10);
        EXPECT_EQ(left[pair], 5);
    }
    const auto order = [](const std::vector<StudyTrial>& of) {
        std::vector<std::size_t> pairs;
        for (const StudyTrial& trial : of) pairs.push_back(trial.pair);
        return pairs;
    };
    EXPECT_EQ(order(trials), order(trials_of(study, "ann")));
    EXPECT_NE(order(trials), order(trials_of(study, "bob")));
    EXPECT_FALSE(std::ranges::is_sorted(order(trials)));
}

TEST(Study, IsTheSameFromItsFile) {
    const support::TempFolder folder;
    const Study study = study_of(StudyTask::differ, folder.path());
    const fs::path file = folder.path() / "study.json";
    ASSERT_TRUE(write_study(file, study));
    EXPECT_THAT(text_of(file), HasSubstr("\"other\": \"c.png\"")); // folders may move
    const auto read = require(read_study(file));
    ASSERT_EQ(read->pairs.size(), study.pairs.size());
    for (std::size_t i = 0; i < study.pairs.size(); ++i) {
        EXPECT_EQ(read->pairs[i].condition, study.pairs[i].condition);
        EXPECT_EQ(read->pairs[i].other, study.pairs[i].other);
        EXPECT_EQ(read->pairs[i].is_training, study.pairs[i].is_training);
        EXPECT_EQ(read->pairs[i].is_predicted_seen, study.pairs[i].is_predicted_seen);
    }
    EXPECT_EQ(read->repeats, 10);
    EXPECT_EQ(read->pixels_per_degree, 34);
}

TEST(Study, RefusesWhatCannotBeShown) {
    Study study = study_of(StudyTask::which, "/x");
    study.pairs.back().other = study.pairs.back().original;
    EXPECT_THAT(validate(study).error().message, HasSubstr("pairs[2]"));
    study = study_of(StudyTask::which, "/x");
    study.repeats = 0;
    EXPECT_THAT(validate(study).error().message, HasSubstr("repeats"));
    study = study_of(StudyTask::which, "/x");
    study.pixels_per_degree = std::nan("");
    EXPECT_THAT(validate(study).error().message, HasSubstr("pixels_per_degree"));
    study = study_of(StudyTask::which, "/x");
    study.pairs.resize(1);
    EXPECT_THAT(validate(study).error().message, HasSubstr("training"));
}

TEST(Study, RefusesFilesThatLeadElsewhere) {
    const support::TempFolder folder;
    const fs::path file = folder.path() / "study.json";
    const auto complaint = [&](const std::string& picture) {
        std::ofstream(file) << R"({"format": "unseen study", "version": 1, "task": "which", "repeats": 2, "seed": 1,
            "pixels_per_degree": 30, "pairs": [{"condition": "x", "original": "a.png", "other": ")"
                            << picture << R"("}]})";
        const auto read = read_study(file);
        return read ? "" : read.error().message;
    };
    EXPECT_EQ(complaint("b.png"), "");
    for (const char* outside : {"../b.png", "/etc/passwd", "x/../../b.png", ""})
        EXPECT_THAT(complaint(outside), HasSubstr("pairs[0].other")) << outside;
}

TEST(StudyAnswers, AreTakenUpWhereTheyWereLeft) {
    const support::TempFolder folder;
    const fs::path file = folder.path() / "ann.csv";
    const Study study = study_of(StudyTask::which, folder.path());
    const auto trials = trials_of(study, "ann");
    std::vector<StudyAnswer> answers;
    for (std::size_t i = 0; i < 7; ++i)
        answers.push_back({trials[i], i % 2 ? StudyChoice::left : StudyChoice::right, 0.5 * static_cast<double>(i)});
    ASSERT_TRUE(write_answers(file, study, "ann", answers));
    const auto read = require(read_answers(file, study, "ann"));
    ASSERT_EQ(read->size(), answers.size());
    for (std::size_t i = 0; i < answers.size(); ++i) {
        EXPECT_EQ((*read)[i].choice, answers[i].choice);
        EXPECT_EQ((*read)[i].trial.pair, answers[i].trial.pair);
        EXPECT_DOUBLE_EQ((*read)[i].seconds, answers[i].seconds);
    }
    EXPECT_THAT(read_answers(file, study, "bob").error().message, HasSubstr("ann.csv:2: the column subject"));
    Study other = study;
    other.seed = 8;
    EXPECT_FALSE(read_answers(file, other, "ann"));
}

TEST(StudyAnswers, RefuseDamagedFiles) {
    const support::TempFolder folder;
    const fs::path file = folder.path() / "answers.csv";
    const std::string header =
        "subject,trial,condition,original,other,training,task,predicted,side,answer,right,seconds\n";
    const auto complaint = [&](const std::string& text) {
        std::ofstream(file) << text;
        const auto read = analyse_answers(std::span(&file, 1));
        return read ? "" : read.error().message;
    };
    EXPECT_EQ(complaint(header + "ann,0,x,a,b,0,which,,left,left,1,1.5\n"), "");
    EXPECT_THAT(complaint(""), HasSubstr("csv:1: the first line"));
    EXPECT_THAT(complaint("a,b\n"), HasSubstr("2 fields"));
    EXPECT_THAT(complaint(header + "ann,0,x,a,b,0,which,,left,same,1,1.5\n"), HasSubstr("csv:2: 'same' is no answer"));
    EXPECT_THAT(complaint(header + "ann,0,x,a,b,0,guess,,left,left,1,1.5\n"), HasSubstr("'guess'"));
    EXPECT_THAT(complaint(header + "ann,0,x,a,b,0,which,,left,left,1,nan\n"), HasSubstr("'nan' are no seconds"));
    EXPECT_THAT(complaint(header + "ann,0,\"x,a,b,0,which\n"), HasSubstr("quotation mark"));
    EXPECT_THAT(complaint(header + "ann,0,x,a,b,0,which,,left,left,1,1.5,more\n"), HasSubstr("more fields"));
}

// By tables of the binomial distribution, and by counting.
TEST(StudyStatistics, AreExact) {
    const Share share{65, 100};
    EXPECT_NEAR(share.low(), 0.5525, 5e-4); // Wilson's interval of 65 in 100
    EXPECT_NEAR(share.high(), 0.7364, 5e-4);
    EXPECT_EQ(Share{}.low(), 0);
    EXPECT_EQ(Share{}.high(), 1);
    EXPECT_EQ((Share{0, 20}.low()), 0);
    EXPECT_EQ((Share{20, 20}.high()), 1);
}

TEST(StudyAnalysis, CountsByConditionAndLeavesTrainingOut) {
    const support::TempFolder folder;
    const fs::path file = folder.path() / "ann.csv";
    const Study study = study_of(StudyTask::differ, folder.path());
    std::vector<StudyAnswer> answers;
    for (const StudyTrial& trial : trials_of(study, "ann")) {
        // Sees the far one always, the near one never, and errs once about the one that is the same.
        const bool seen = study.pairs[trial.pair].condition == "far" || trial.pair == 0 ||
                          (trial.pair == 3 && trial.is_other_left && std::ranges::none_of(answers, [](const auto& a) {
                               return a.trial.pair == 3 && a.trial.is_other_left;
                           }));
        answers.push_back({trial, seen ? StudyChoice::different : StudyChoice::same, 2});
    }
    ASSERT_TRUE(write_answers(file, study, "ann", answers));
    const auto analysis = require(analyse_answers(std::span(&file, 1)));
    ASSERT_EQ(analysis->conditions.size(), 3u);
    for (const ConditionResult& result : analysis->conditions) {
        EXPECT_EQ(result.seen.of, 10u);
        EXPECT_EQ(result.median_s, 2);
        if (result.condition == "far") {
            EXPECT_EQ(result.seen.count, 10u);
            // Ten of ten against one of ten: C(10,10) C(10,1) / C(20,11).
            EXPECT_NEAR(result.chance, 10.0 / 167960, 1e-9);
            EXPECT_EQ(result.agreed->count, 10u);
        } else if (result.condition == "one") {
            EXPECT_EQ(result.seen.count, 1u);
            EXPECT_FALSE(result.agreed);
        } else {
            EXPECT_EQ(result.condition, "near, \"quoted\"");
            EXPECT_EQ(result.seen.count, 0u);
            EXPECT_NEAR(result.chance, 1, 1e-12);
            EXPECT_EQ(result.agreed->count, 10u);
        }
    }
    EXPECT_EQ(analysis->false_alarms->count, 1u);
    EXPECT_EQ(analysis->agreed->of, 20u);
    EXPECT_TRUE(analysis->careless.empty());
    for (StudyAnswer& answer : answers)
        if (answer.trial.pair == 0) answer.choice = StudyChoice::same;
    ASSERT_TRUE(write_answers(file, study, "ann", answers));
    EXPECT_EQ(analyse_answers(std::span(&file, 1))->careless, std::vector<std::string>{"ann"});
}

TEST(StudyAnalysis, SetsStepsOfLevelsBesideThoseOf2007) {
    const support::TempFolder folder;
    Study study = study_of(StudyTask::differ, folder.path());
    const fs::path best = study.pairs.front().original, other = study.pairs.front().other;
    study.pairs = {{level_condition(10, LevelStep::maintain), best, other, false, false},
                   {level_condition(2, LevelStep::increase), best, other, false, true},
                   {level_condition(2, LevelStep::decrease), best, other, false, false},
                   {"level 2, sideways", best, other, false, true}};
    study.repeats = 4;
    std::vector<StudyAnswer> answers;
    int increases = 0;
    for (const StudyTrial& trial : trials_of(study, "ann")) {
        const bool seen = trial.pair == 1 && ++increases <= 3; // three of four
        answers.push_back({trial, seen ? StudyChoice::different : StudyChoice::same, 1});
    }
    const fs::path file = folder.path() / "ann.csv";
    ASSERT_TRUE(write_answers(file, study, "ann", answers));
    const auto analysis = require(analyse_answers(std::span(&file, 1)));
    ASSERT_EQ(analysis->steps.size(), 3u);
    EXPECT_EQ(analysis->steps[0].kept, 2);
    EXPECT_EQ(analysis->steps[0].step, LevelStep::decrease);
    EXPECT_EQ(analysis->steps[0].agreed.count, 4u);
    EXPECT_EQ(analysis->steps[1].step, LevelStep::increase);
    EXPECT_EQ(analysis->steps[1].agreed.count, 3u);
    EXPECT_EQ(analysis->steps[1].agreed.of, 4u);
    EXPECT_EQ(analysis->steps[2].kept, 10);
}

// The paper prints 78.4, 80.6, ... percent: cut off, not rounded.
TEST(StudyAnalysis, HasTheTableOf2007) {
    const std::vector<double> printed = {78.4, 80.6, 32.9, 78.4, 84.0, 76.1, 72.7, 31.8, 80.6, 32.9, 61.3, 71.5};
    const auto steps = steps_of_2007();
    ASSERT_EQ(steps.size(), printed.size());
    for (std::size_t i = 0; i < steps.size(); ++i) {
        EXPECT_EQ(std::floor(1000 * steps[i].agreed.value()) / 10, printed[i]) << i;
        EXPECT_EQ(steps[i].kept, 2 + static_cast<int>(i / 3));
    }
}

// `which`: of a right answer. `differ`: of the answer "different".
double probability(const PictureObserver& observer, StudyTask task, double visibility) {
    const auto below = [](double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); };
    const double d = PictureObserver::threshold_d * std::pow(visibility, observer.exponent);
    const double attentive = task == StudyTask::which ? below(d / std::numbers::sqrt2) : below(d - observer.criterion);
    return (1 - observer.lapse) * attentive + observer.lapse / 2;
}

TEST(PictureObserver, IsRightInThreeOfFourAtThreshold) {
    PictureObserver observer;
    observer.lapse = 0;
    EXPECT_NEAR(probability(observer, StudyTask::which, 0), 0.5, 1e-9);
    EXPECT_NEAR(probability(observer, StudyTask::which, 1), 0.75, 1e-4);
    EXPECT_NEAR(probability(observer, StudyTask::which, 100), 1, 1e-9);
    EXPECT_NEAR(probability(observer, StudyTask::differ, 0), 0.1587, 1e-3);
    observer.lapse = 0.01;
    for (const StudyTask task : {StudyTask::which, StudyTask::differ})
        for (const double visibility : {0.0, 0.7, 1.0, 1.4, 5.0}) {
            constexpr int trials = 20'000;
            int yes = 0;
            for (int i = 0; i < trials; ++i) {
                const StudyTrial trial{i, 0, i % 3 == 0};
                const StudyChoice choice = observer.choose(task, trial, visibility);
                yes += task == StudyTask::differ ? choice == StudyChoice::different
                                                 : (choice == StudyChoice::left) == trial.is_other_left;
            }
            const double expected = probability(observer, task, visibility);
            EXPECT_NEAR(static_cast<double>(yes) / trials, expected, 4 * std::sqrt(0.25 / trials))
                << name(task) << ' ' << visibility;
        }
}

TEST(PictureObserver, SeesByTheSecondJudge) {
    perception::Image original{64, 64, 1, std::vector<float>(64 * 64, 50.0f)}, other = original;
    const PictureObserver observer;
    EXPECT_EQ(*observer.visibility(original, other, {}), 0);
    for (int y = 20; y < 40; ++y)
        for (int x = 20; x < 40; ++x) other.at(x, y) = 60;
    const auto judged = perception::judge_modern(original, other, perception::second_judge_options(observer.person));
    EXPECT_EQ(*observer.visibility(original, other, {}), judged->max_ratio);
    EXPECT_GT(judged->max_ratio, 1);
    other.width = 32;
    EXPECT_FALSE(observer.visibility(original, other, {}));
}

} // namespace unseen::calibration::study_test
