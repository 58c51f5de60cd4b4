// Studies of whether people tell a picture from its original: double-stimulus trials after ITU-R BT.500, of pairs side by
// side at random sides. Knows neither windows nor keys, as Procedure does not.
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
    which, // which of both is not the original? Who sees nothing is right in half of the trials
    differ // do both differ? Pairs of the original with itself tell how often somebody says so who sees nothing
};
std::string_view name(StudyTask task); // "which", "differ"

// What the subject said. Of `which`: the side of what is not the original.
enum class StudyChoice { left, right, same, different };
std::string_view name(StudyChoice choice);

// Paths are as a program opens them: read_study() puts the study's folder before those of its file.
struct StudyPair {
    std::string condition; // what pairs are counted by
    std::filesystem::path original, other;
    bool is_training = false;              // shown first, and not counted
    std::optional<bool> is_predicted_seen; // what a model says: whether a difference can be seen
};

struct Study {
    StudyTask task = StudyTask::which;
    int repeats = 2;              // of every pair that counts, 1 to 1000
    std::uint64_t seed = 1;       // of orders and sides, at most 2^53
    double pixels_per_degree = 0; // of the display that the pictures were made for, at its centre
    std::vector<StudyPair> pairs; // 1 to 10,000, of 100,000 trials at most
};

// In ranges, with at least one pair that counts, and where pairs differ, of `which` none of a picture with itself. The
// error names the field.
Result<void> validate(const Study& study);

// A JSON file, "study.json" of the study's folder. Writing makes paths relative to the file's folder; reading refuses
// those that lead out of it. Errors name the file and the key.
Result<void> write_study(const std::filesystem::path& file, const Study& study);
Result<Study> read_study(const std::filesystem::path& file);

struct StudyTrial {
    int number = 0; // from 0
    std::size_t pair = 0;
    bool is_other_left = false;
};

// Training in the study's order, then all repeats of all pairs that count, shuffled. Each pair has its other picture on
// the left in half of its repeats, to one. Another subject sees another order; the same one always the same.
std::vector<StudyTrial> trials_of(const Study& study, std::string_view subject);

struct StudyAnswer {
    StudyTrial trial;
    StudyChoice choice = StudyChoice::left;
    double seconds = 0; // from showing to answering

    // Of `which`: whether it is the other picture. Of `differ`: whether it says that pictures differ that are not one.
    bool is_right(const Study& study) const;
    bool says_seen(const Study& study) const; // `which`: as is_right()
};

// A subject's answers, a line each: subject, trial, condition, original, other, training, task, predicted, side, answer,
// right, seconds. What write_answers() has written of a study and a subject, read_answers() takes up: the error names
// the line that is of another study, order or subject.
Result<void> write_answers(const std::filesystem::path& file, const Study& study, std::string_view subject,
                           std::span<const StudyAnswer> answers);
Result<std::vector<StudyAnswer>> read_answers(const std::filesystem::path& file, const Study& study,
                                              std::string_view subject);

// ---- discrete levels of detail
//
// What Drettakis and others (2007) ask about an object whose level of detail a program chooses: whether people see what
// the program says that they see, Table 2.

enum class LevelStep {
    decrease, // the level before the one that is kept against the best one: it was coarsened, so nobody should see it
    maintain, // the one that is kept against the one before: nobody should see a difference
    increase  // the next coarser one against the best one: it was refined, so the difference should show
};
std::string_view name(LevelStep step); // "decrease", ...

// The condition that such pairs are counted by: "level 2, maintain". `kept`: the level that is kept, 0 the best one.
std::string level_condition(int kept, LevelStep step);

// ---- what answers say

// A share of so many, with its interval of 95% confidence (Wilson 1927).
struct Share {
    std::uint64_t count = 0, of = 0;
    double value() const { return of > 0 ? static_cast<double>(count) / static_cast<double>(of) : 0; }
    double low() const;
    double high() const;
};
// How likely so many or more are where each is as likely as not: exact, of the binomial distribution.
double chance_of_so_many(const Share& share);

struct ConditionResult {
    std::string condition;
    StudyTask task = StudyTask::which;
    Share seen;        // which: right answers; differ: "different"
    double chance = 1; // which: chance_of_so_many(); differ: that of as many under the false alarms, Fisher's test
    std::optional<Share> agreed; // with what was predicted: differ alone, where all of the condition's pairs have it
    double median_s = 0;
};

// Of pairs whose condition level_condition() names: how many answers agree with what the program decided.
struct StepResult {
    int kept = 0;
    LevelStep step = LevelStep::decrease;
    Share agreed;
};

struct StudyAnalysis {
    std::vector<ConditionResult> conditions; // sorted by name
    std::vector<std::string> subjects;
    std::vector<std::string> careless; // subjects who were wrong in more than a third of the training
    std::optional<Share> false_alarms; // differ: of pairs of one picture
    std::optional<Share> agreed;       // over all conditions
    std::vector<StepResult> steps;     // ascending by level, then by step
};

// The answers of eleven people, Table 3 of Drettakis and others (2007): 88 of each, in the order of StudyAnalysis::steps.
// Their level 1 is level 0 here.
std::span<const StepResult> steps_of_2007();

// Of files that write_answers() has written; training does not count. Errors name the file and the line.
Result<StudyAnalysis> analyse_answers(std::span<const std::filesystem::path> files);

} // namespace unseen::calibration
