#include <unseen/calibration/study.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <unseen/calibration/procedure.h>
#include <unseen/vdtree/internal/csv.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/number_text.h>
#include <unseen/vdtree/internal/random.h>

#include "json_file.h"

namespace unseen::calibration {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t most_pairs = 10'000, most_trials = 100'000;
constexpr double largest_seed = 9007199254740992.0; // 2^53, to which JSON counts
constexpr std::string_view study_format = "unseen study";
constexpr int version = 1;

constexpr std::array<std::string_view, 2> task_names = {"which", "differ"};
constexpr std::array<std::string_view, 4> choice_names = {"left", "right", "same", "different"};
constexpr std::array<std::string_view, 3> step_names = {"decrease", "maintain", "increase"};

template <class Enum, std::size_t size>
std::optional<Enum> named(const std::array<std::string_view, size>& names, std::string_view text) {
    const auto found = std::ranges::find(names, text);
    if (found == names.end()) return std::nullopt;
    return static_cast<Enum>(found - names.begin());
}

bool belongs_to(StudyChoice choice, StudyTask task) {
    return (choice == StudyChoice::left || choice == StudyChoice::right) == (task == StudyTask::which);
}

// Whether a choice names the other picture, or says that the pictures differ; and whether that is right.
bool says_seen(StudyChoice choice, bool is_other_left) {
    if (choice == StudyChoice::same || choice == StudyChoice::different) return choice == StudyChoice::different;
    return (choice == StudyChoice::left) == is_other_left;
}
bool is_right(StudyTask task, bool is_seen, bool is_of_one_picture) {
    return task == StudyTask::which ? is_seen : is_seen != is_of_one_picture;
}

bool is_of_one_picture(const StudyPair& pair) { return pair.original == pair.other; }

} // namespace

std::string_view name(StudyTask task) { return task_names[static_cast<std::size_t>(task)]; }
std::string_view name(StudyChoice choice) { return choice_names[static_cast<std::size_t>(choice)]; }
std::string_view name(LevelStep step) { return step_names[static_cast<std::size_t>(step)]; }

Result<void> validate(const Study& study) {
    if (study.repeats < 1 || study.repeats > 1000) return invalid_argument("study: repeats must be from 1 to 1000.");
    if (static_cast<double>(study.seed) > largest_seed) return invalid_argument("study: seed must be at most 2^53.");
    if (!(study.pixels_per_degree > 0 && std::isfinite(study.pixels_per_degree)))
        return invalid_argument("study: pixels_per_degree must be above 0.");
    if (study.pairs.size() > most_pairs) return invalid_argument("study: there are more than 10,000 pairs.");
    std::size_t counted = 0;
    for (std::size_t i = 0; i < study.pairs.size(); ++i) {
        const StudyPair& pair = study.pairs[i];
        const std::string place = "study: pairs[" + std::to_string(i) + "]: ";
        if (pair.condition.empty()) return invalid_argument(place + "condition is empty.");
        if (pair.original.empty() || pair.other.empty())
            return invalid_argument(place + "original and other must name pictures.");
        if (study.task == StudyTask::which && is_of_one_picture(pair))
            return invalid_argument(place + "both pictures are the same file; a pair needs two.");
        counted += !pair.is_training;
    }
    if (counted == 0) return invalid_argument("study: all pairs are for training; add one that counts.");
    if (counted * static_cast<std::size_t>(study.repeats) > most_trials)
        return invalid_argument("study: there are more than 100,000 trials.");
    return {};
}

// ---- the study's file

Result<void> write_study(const fs::path& file, const Study& study) {
    if (const auto valid = validate(study); !valid) return valid;
    JsonWriter json;
    json.add_text("format", study_format);
    json.add("version", version);
    json.add_text("task", name(study.task));
    json.add("repeats", study.repeats);
    json.add("seed", study.seed);
    json.add("pixels_per_degree", study.pixels_per_degree);
    std::string pairs;
    for (const StudyPair& pair : study.pairs) {
        const auto path = [&](const fs::path& picture) {
            return to_json(picture.lexically_proximate(file.parent_path()).generic_string());
        };
        const auto truth = [](bool value) { return value ? "true" : "false"; };
        pairs += (pairs.empty() ? "\n" : ",\n") + ("{\"condition\": " + to_json(pair.condition)) +
                 ", \"original\": " + path(pair.original) + ", \"other\": " + path(pair.other) +
                 ", \"training\": " + truth(pair.is_training);
        if (pair.is_predicted_seen) pairs += std::string(", \"predicted_seen\": ") + truth(*pair.is_predicted_seen);
        pairs += "}";
    }
    json.add("pairs", "[" + pairs + "\n]");
    return json.write(file);
}

Result<Study> read_study(const fs::path& file) {
    const JsonObject object(file, {"format", "version", "task", "repeats", "seed", "pixels_per_degree", "pairs"});
    Study study;
    std::string format, task;
    object.get("format", format);
    if (format != study_format) object.fail_at("format", "must be \"unseen study\".");
    const double of_version = object.number("version", {.minimum = 1, .maximum = 1e6, .whole = true});
    if (of_version != version)
        object.fail_at("version", "is " + number_text(of_version) + ", which this program does not know.");
    object.get("task", task);
    const auto known = named<StudyTask>(task_names, task);
    if (!known) object.fail_at("task", "must be \"which\" or \"differ\".");
    study.task = known.value_or(StudyTask::which);
    study.repeats = static_cast<int>(object.number("repeats", {.minimum = 1, .maximum = 1000, .whole = true}));
    study.seed =
        static_cast<std::uint64_t>(object.number("seed", {.minimum = 0, .maximum = largest_seed, .whole = true}));
    study.pixels_per_degree =
        object.number("pixels_per_degree", {.minimum = 0, .maximum = 1e6, .minimum_allowed = false});
    const nlohmann::json& pairs = object.array("pairs");
    if (pairs.size() > most_pairs) object.fail_at("pairs", "has more than 10,000 pairs.");
    for (std::size_t i = 0; i < pairs.size() && object; ++i) {
        const JsonObject child = object.child(pairs[i], in_brackets("pairs", i),
                                              {"condition", "original", "other", "training", "predicted_seen"});
        StudyPair& pair = study.pairs.emplace_back();
        child.get("condition", pair.condition);
        for (const auto& [key, to] : {std::pair("original", &pair.original), std::pair("other", &pair.other)}) {
            std::string path;
            child.get(key, path);
            const fs::path relative = fs::path(path).lexically_normal();
            if (path.empty() || relative.is_absolute() || *relative.begin() == "..")
                child.fail_at(key, "must name a picture in the study's folder.");
            *to = file.parent_path() / relative;
        }
        child.get("training", pair.is_training);
        bool is_seen = false;
        child.get("predicted_seen", is_seen);
        if (child.has("predicted_seen")) pair.is_predicted_seen = is_seen;
    }
    if (const auto valid = validate(study); !valid) object.fail(valid.error().message);
    if (!object) return object.error();
    return study;
}

// ---- trials

std::vector<StudyTrial> trials_of(const Study& study, std::string_view subject) {
    Random random = random_for(study.seed, hash_of(subject));
    std::vector<StudyTrial> trials;
    for (std::size_t pair = 0; pair < study.pairs.size(); ++pair)
        if (study.pairs[pair].is_training) trials.push_back({0, pair, random.uniform() < 0.5});
    const std::size_t training = trials.size();
    for (std::size_t pair = 0; pair < study.pairs.size(); ++pair) {
        if (study.pairs[pair].is_training) continue;
        const bool begins_left = random.uniform() < 0.5;
        for (int repeat = 0; repeat < study.repeats; ++repeat)
            trials.push_back({0, pair, (repeat % 2 == 0) == begins_left});
    }
    for (std::size_t i = trials.size() - 1; i > training; --i) // Fisher and Yates
        std::swap(
            trials[i],
            trials[training + static_cast<std::size_t>(random.uniform() * static_cast<double>(i - training + 1))]);
    for (std::size_t i = 0; i < trials.size(); ++i) trials[i].number = static_cast<int>(i);
    return trials;
}

bool StudyAnswer::is_right(const Study& study) const {
    return calibration::is_right(study.task, says_seen(choice, trial.is_other_left),
                                 is_of_one_picture(study.pairs[trial.pair]));
}

// ---- discrete levels

std::string level_condition(int kept, LevelStep step) {
    return "level " + std::to_string(kept) + ", " + std::string(name(step));
}

namespace {

// What level_condition() says, read back.
std::optional<std::pair<int, LevelStep>> level_step_of(std::string_view condition) {
    constexpr std::string_view begin = "level ", between = ", ";
    const std::size_t comma = condition.find(between);
    if (!condition.starts_with(begin) || comma == condition.npos) return std::nullopt;
    const auto kept = number_from<int>(condition.substr(begin.size(), comma - begin.size()));
    const auto step = named<LevelStep>(step_names, condition.substr(comma + between.size()));
    if (!kept || !step || condition != level_condition(*kept, *step)) return std::nullopt;
    return std::pair(*kept, *step);
}

} // namespace

std::span<const StepResult> steps_of_2007() {
    // The printed percentages are these counts of 88, cut off behind the first decimal.
    static const std::vector<StepResult> table = [] {
        std::vector<StepResult> steps;
        for (const std::uint64_t agreed : {69, 71, 29, 69, 74, 67, 64, 28, 71, 29, 54, 63})
            steps.push_back(
                {2 + static_cast<int>(steps.size() / 3), static_cast<LevelStep>(steps.size() % 3), {agreed, 88}});
        return steps;
    }();
    return table;
}

// ---- the answers' file

namespace {

constexpr std::array<std::string_view, 12> columns = {"subject", "trial",    "condition", "original",
                                                      "other",   "training", "task",      "predicted",
                                                      "side",    "answer",   "right",     "seconds"};
enum { subject_, trial_, condition_, original_, other_, training_, task_, expected_, side_, answer_, right_, seconds_ };
using Line = std::vector<std::string>;

const Line& header() {
    static const Line line(columns.begin(), columns.end());
    return line;
}

std::string joined(const Line& line) {
    std::string text;
    for (std::size_t i = 0; i < line.size(); ++i) text += (i > 0 ? "," : "") + csv_field(line[i]);
    return text;
}

// What an answer's line says, but for what was answered.
Line line_of(const Study& study, std::string_view subject, const StudyTrial& trial) {
    const StudyPair& pair = study.pairs[trial.pair];
    Line line(columns.size());
    line[subject_] = subject;
    line[trial_] = std::to_string(trial.number);
    line[condition_] = pair.condition;
    line[original_] = pair.original.filename().string();
    line[other_] = pair.other.filename().string();
    line[training_] = pair.is_training ? "1" : "0";
    line[task_] = name(study.task);
    if (pair.is_predicted_seen) line[expected_] = *pair.is_predicted_seen ? "seen" : "unseen";
    line[side_] = trial.is_other_left ? "left" : "right";
    return line;
}

Error wrong_line(const fs::path& file, int number, const std::string& what) {
    return {ErrorCode::malformed_data, file.string() + ":" + std::to_string(number) + ": " + what};
}

// A line of write_answers(), and what it says whatever study it is of.
struct AnswerLine {
    int number; // in the file, from 1
    Line fields;
    StudyTask task;
    StudyChoice choice;
    double seconds;
};

Result<std::vector<AnswerLine>> read_lines(const fs::path& file) {
    const auto text = read_text_file(file);
    if (!text) return text.error();
    auto records = parse_csv(*text, file.string(), columns.size());
    if (!records) return records.error();
    std::vector<AnswerLine> lines;
    for (auto& [number, fields] : *records) {
        if (fields.size() < columns.size())
            return wrong_line(file, number,
                              "there are " + std::to_string(fields.size()) + " fields in place of " +
                                  std::to_string(columns.size()) + ": these are no answers of a study.");
        lines.push_back({number, std::move(fields), {}, {}, 0});
    }
    if (lines.empty() || lines.front().fields != header())
        return wrong_line(file, 1, "the first line must name the columns " + joined(header()) + ".");
    lines.erase(lines.begin());
    return lines;
}

Result<void> take_answer(const fs::path& file, AnswerLine& line) {
    const auto wrong = [&](const std::string& what) { return wrong_line(file, line.number, what); };
    const auto task = named<StudyTask>(task_names, line.fields[task_]);
    if (!task) return wrong("the task is '" + line.fields[task_] + "', and none that is known.");
    const auto choice = named<StudyChoice>(choice_names, line.fields[answer_]);
    if (!choice || !belongs_to(*choice, *task))
        return wrong("'" + line.fields[answer_] + "' is no answer to the task " + line.fields[task_] + ".");
    const auto seconds = finite_from(line.fields[seconds_]);
    if (!seconds || !(*seconds >= 0)) return wrong("'" + line.fields[seconds_] + "' are no seconds.");
    line.task = *task, line.choice = *choice, line.seconds = *seconds;
    return {};
}

} // namespace

Result<void> write_answers(const fs::path& file, const Study& study, std::string_view subject,
                           std::span<const StudyAnswer> answers) {
    std::string text = joined(header()) + "\n";
    for (const StudyAnswer& answer : answers) {
        Line line = line_of(study, subject, answer.trial);
        line[answer_] = name(answer.choice);
        line[right_] = answer.is_right(study) ? "1" : "0";
        line[seconds_] = number_text(std::round(answer.seconds * 1000) / 1000);
        text += joined(line) + "\n";
    }
    return write_text(file, text);
}

Result<std::vector<StudyAnswer>> read_answers(const fs::path& file, const Study& study, std::string_view subject) {
    auto lines = read_lines(file);
    if (!lines) return lines.error();
    const std::vector<StudyTrial> trials = trials_of(study, subject);
    std::vector<StudyAnswer> answers;
    for (AnswerLine& line : *lines) {
        if (answers.size() == trials.size()) return wrong_line(file, line.number, "the study has no more trials.");
        const StudyTrial& trial = trials[answers.size()];
        if (const auto taken = take_answer(file, line); !taken) return taken.error();
        Line expected = line_of(study, subject, trial);
        for (const auto own : {answer_, right_, seconds_}) expected[own] = line.fields[own];
        for (std::size_t i = 0; i < columns.size(); ++i)
            if (expected[i] != line.fields[i])
                return wrong_line(file, line.number,
                                  "the column " + std::string(columns[i]) + " is '" + line.fields[i] +
                                      "' where this study has '" + expected[i] +
                                      "' for this subject: these answers are of another one.");
        answers.push_back({trial, line.choice, line.seconds});
    }
    return answers;
}

// ---- analysis

namespace {

constexpr double careless_share = 1.0 / 3;

// Wilson 1927.
double wilson(const Share& share, double sign) {
    if (share.of == 0) return sign < 0 ? 0 : 1;
    const auto n = static_cast<double>(share.of);
    const double p = share.value(), z2 = normal_95 * normal_95;
    const double root = normal_95 * std::sqrt(p * (1 - p) / n + z2 / (4 * n * n));
    return std::clamp((p + z2 / (2 * n) + sign * root) / (1 + z2 / n), 0.0, 1.0);
}

double log_choose(std::uint64_t n, std::uint64_t k) {
    const auto log_factorial = [](std::uint64_t of) { return std::lgamma(static_cast<double>(of) + 1); };
    return log_factorial(n) - log_factorial(k) - log_factorial(n - k);
}

// Fisher's exact test: the probability of at least this many of the first, if both were of one kind.
double fisher(const Share& first, const Share& second) {
    const std::uint64_t all = first.of + second.of, marked = first.count + second.count;
    double sum = 0;
    for (std::uint64_t k = first.count; k <= std::min(first.of, marked); ++k) {
        if (marked - k > second.of) continue;
        sum += std::exp(log_choose(first.of, k) + log_choose(second.of, marked - k) - log_choose(all, marked));
    }
    return std::min(sum, 1.0);
}

// The probability of at least `count` heads in `of` tosses: exact, by the binomial distribution.
double chance_of_so_many(const Share& share) {
    double sum = 0;
    for (std::uint64_t k = share.count; k <= share.of; ++k)
        sum += std::exp(log_choose(share.of, k) - static_cast<double>(share.of) * std::log(2));
    return std::min(sum, 1.0);
}

struct Tally {
    ConditionResult result;
    bool is_of_one_picture = false, is_predicted = true;
    Share agreed;
    std::vector<double> seconds;
};

double median(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, middle);
    return *middle;
}

void add(Share& share, bool counts) { share.count += counts, ++share.of; }

} // namespace

double Share::low() const { return wilson(*this, -1); }
double Share::high() const { return wilson(*this, 1); }

Result<StudyAnalysis> analyse_answers(std::span<const fs::path> files) {
    StudyAnalysis all;
    std::vector<Tally> tallies;
    std::map<std::string, Share> training; // right answers by subject
    Share false_alarms, agreed;
    for (const fs::path& file : files) {
        auto lines = read_lines(file);
        if (!lines) return lines.error();
        for (AnswerLine& line : *lines) {
            if (const auto taken = take_answer(file, line); !taken) return taken.error();
            const Line& fields = line.fields;
            if (std::ranges::find(all.subjects, fields[subject_]) == all.subjects.end())
                all.subjects.push_back(fields[subject_]);
            const bool is_same = fields[original_] == fields[other_];
            const bool is_seen = says_seen(line.choice, fields[side_] == "left");
            if (fields[training_] == "1") {
                add(training[fields[subject_]], is_right(line.task, is_seen, is_same));
                continue;
            }
            auto tally = std::ranges::find_if(tallies, [&](const Tally& t) {
                return t.result.condition == fields[condition_] && t.result.task == line.task;
            });
            if (tally == tallies.end()) {
                tally = tallies.emplace(tally);
                tally->result.condition = fields[condition_], tally->result.task = line.task;
                tally->is_of_one_picture = is_same;
            }
            add(tally->result.seen, is_seen);
            tally->seconds.push_back(line.seconds);
            if (line.task == StudyTask::differ && is_same) add(false_alarms, is_seen);
            if (fields[expected_].empty() || line.task == StudyTask::which) {
                tally->is_predicted = false;
            } else {
                const bool agrees = is_seen == (fields[expected_] == "seen");
                add(tally->agreed, agrees);
                add(agreed, agrees);
            }
        }
    }
    for (Tally& tally : tallies) {
        ConditionResult& result = tally.result;
        result.median_s = median(tally.seconds);
        if (result.task == StudyTask::which) result.chance = chance_of_so_many(result.seen);
        else if (!tally.is_of_one_picture && false_alarms.of > 0) result.chance = fisher(result.seen, false_alarms);
        if (tally.is_predicted) {
            result.agreed = tally.agreed;
            if (const auto step = level_step_of(result.condition))
                all.steps.push_back({step->first, step->second, tally.agreed});
        }
        all.conditions.push_back(std::move(result));
    }
    std::ranges::sort(all.conditions, {}, &ConditionResult::condition);
    std::ranges::sort(all.steps, {}, [](const StepResult& r) { return std::pair(r.kept, r.step); });
    for (const auto& [subject, right] : training)
        if (1 - right.value() > careless_share) all.careless.push_back(subject);
    if (false_alarms.of > 0) all.false_alarms = false_alarms;
    if (agreed.of > 0) all.agreed = agreed;
    return all;
}

} // namespace unseen::calibration
