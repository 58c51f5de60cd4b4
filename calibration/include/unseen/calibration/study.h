// Studies of whether people can tell a picture from its original: double-stimulus trials after ITU-R BT.500, with pairs side
// by side in random order. The caller shows the pictures and asks.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <unseen/vdtree/result.h>

namespace unseen::calibration {

enum class StudyTask {
    which, // which picture is not the original? Guessing is right in half of the trials
    differ // do the pictures differ? Pairs of the original with itself measure false alarms
};
std::string_view name(StudyTask task); // "which", "differ"

// The subject's answer. For `which`: the side of the picture that is not the original.
enum class StudyChoice { left, right, same, different };
std::string_view name(StudyChoice choice);

// Paths are as a program opens them: read_study() prepends the study's folder.
struct StudyPair {
    std::string condition; // results are counted by condition
    std::filesystem::path original, other;
    bool is_training = false;              // shown first, and not counted
    std::optional<bool> is_predicted_seen; // a model's prediction: whether a difference is visible
};

struct Study {
    StudyTask task = StudyTask::which;
    int repeats = 2;              // of every pair except training, 1 to 1000
    std::uint64_t seed = 1;       // of orders and sides, at most 2^53
    double pixels_per_degree = 0; // of the display that the pictures were made for, at its centre
    std::vector<StudyPair> pairs; // 1 to 10,000, of 100,000 trials at most
};

// Fields must be in range, with at least one pair that is not training. `which` allows no pair of a picture with itself. The
// error names the field.
Result<void> validate(const Study& study);

// A JSON file, "study.json" in the study's folder. Writing makes paths relative to that folder; reading refuses paths that
// leave it. Errors name the file and the key.
Result<void> write_study(const std::filesystem::path& file, const Study& study);
Result<Study> read_study(const std::filesystem::path& file);

struct StudyTrial {
    int number = 0; // from 0
    std::size_t pair = 0;
    bool is_other_left = false;
};

// Training in the study's order, then all repeats of all other pairs, shuffled. Each pair has its other picture on the left
// in half of its repeats. The order depends on the subject and the study alone.
std::vector<StudyTrial> trials_of(const Study& study, std::string_view subject);

struct StudyAnswer {
    StudyTrial trial;
    StudyChoice choice = StudyChoice::left;
    double seconds = 0; // from showing the pictures to the answer

    // `which`: whether it names the other picture. `differ`: whether it is right about the pictures differing.
    bool is_right(const Study& study) const;
};

// A subject's answers as CSV, one a line: subject, trial, condition, original, other, training, task, predicted, side,
// answer, right, seconds. read_answers() continues a file of the same study and subject; the error names a line of another
// study, order or subject.
Result<void> write_answers(const std::filesystem::path& file, const Study& study, std::string_view subject,
                           std::span<const StudyAnswer> answers);
Result<std::vector<StudyAnswer>> read_answers(const std::filesystem::path& file, const Study& study,
                                              std::string_view subject);

// ---- discrete levels of detail
//
// The question of Drettakis and others (2007), Table 2, about an object whose level of detail a program chooses: do people
// see the differences that the program predicts?

enum class LevelStep {
    decrease, // the level before the kept one, against the best one: it was coarsened, so it should be invisible
    maintain, // the kept level against the one before: the difference should be invisible
    increase  // the next coarser level against the best one: it was refined, so the difference should be visible
};
std::string_view name(LevelStep step); // "decrease", ...

// The condition of such pairs: "level 2, maintain". `kept`: the kept level, 0 for the best one.
std::string level_condition(int kept, LevelStep step);

// ---- analysis

// A share, with its 95% confidence interval (Wilson 1927).
struct Share {
    std::uint64_t count = 0, of = 0;
    double value() const { return of > 0 ? static_cast<double>(count) / static_cast<double>(of) : 0; }
    double low() const;
    double high() const;
};

struct ConditionResult {
    std::string condition;
    StudyTask task = StudyTask::which;
    Share seen;                  // which: right answers; differ: "different"
    double chance = 1;           // which: of so many by tossing a coin; differ: against the false alarms, Fisher's test
    std::optional<Share> agreed; // with the prediction; differ only, if all of the condition's pairs have one
    double median_s = 0;
};

// Pairs whose condition level_condition() names: how many answers agree with the program's decision.
struct StepResult {
    int kept = 0;
    LevelStep step = LevelStep::decrease;
    Share agreed;
};

struct StudyAnalysis {
    std::vector<ConditionResult> conditions; // sorted by name
    std::vector<std::string> subjects;
    std::vector<std::string> careless; // subjects with more than a third of the training wrong
    std::optional<Share> false_alarms; // differ: for pairs of one picture
    std::optional<Share> agreed;       // over all conditions
    std::vector<StepResult> steps;     // ascending by level, then by step
};

// The answers of eleven people in Table 3 of Drettakis and others (2007): 88 for each step, in the order of
// StudyAnalysis::steps. Their level 1 is level 0 here.
std::span<const StepResult> steps_of_2007();

// Analyses files of write_answers(); training does not count. Errors name the file and the line.
Result<StudyAnalysis> analyse_answers(std::span<const std::filesystem::path> files);

} // namespace unseen::calibration
