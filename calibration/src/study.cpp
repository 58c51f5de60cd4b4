#include <unseen/calibration/study.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <unseen/vdtree/internal/csv.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/number_format.h>
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

std::optional<StudyTask> task_named(std::string_view text) {
    for (const StudyTask task : {StudyTask::which, StudyTask::differ})
        if (name(task) == text) return task;
    return std::nullopt;
}

std::optional<StudyChoice> choice_named(std::string_view text) {
    for (const StudyChoice choice : {StudyChoice::left, StudyChoice::right, StudyChoice::same, StudyChoice::different})
        if (name(choice) == text) return choice;
    return std::nullopt;
}

bool belongs_to(StudyChoice choice, StudyTask task) {
    return (choice == StudyChoice::left || choice == StudyChoice::right) == (task == StudyTask::which);
}

bool is_of_one_picture(const StudyPair& pair) { return pair.original == pair.other; }

// FNV-1a, the same on every machine.
std::uint64_t hash_of(std::string_view text) {
    std::uint64_t hash = 0xcbf29ce484222325u;
    for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
    return hash;
}

} // namespace

std::string_view name(StudyTask task) { return task == StudyTask::which ? "which" : "differ"; }

std::string_view name(StudyChoice choice) {
    constexpr std::array<std::string_view, 4> names = {"left", "right", "same", "different"};
    return names[static_cast<std::size_t>(choice)];
}

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
    const fs::path folder = file.parent_path();
    std::string text = "{\n\"format\": " + to_json(study_format) + ",\n\"version\": " + std::to_string(version) +
                       ",\n\"task\": " + to_json(name(study.task)) +
                       ",\n\"repeats\": " + std::to_string(study.repeats) +
                       ",\n\"seed\": " + std::to_string(study.seed) +
                       ",\n\"pixels_per_degree\": " + to_text(study.pixels_per_degree) + ",\n\"pairs\": [";
    for (std::size_t i = 0; i < study.pairs.size(); ++i) {
        const StudyPair& pair = study.pairs[i];
        const auto path = [&](const fs::path& picture) {
            return to_json(picture.lexically_proximate(folder).generic_string());
        };
        text += std::string(i > 0 ? "," : "") + "\n{\"condition\": " + to_json(pair.condition) +
                ", \"original\": " + path(pair.original) + ", \"other\": " + path(pair.other) +
                ", \"training\": " + (pair.is_training ? "true" : "false");
        if (pair.is_predicted_seen)
            text += std::string(", \"predicted_seen\": ") + (*pair.is_predicted_seen ? "true" : "false");
        text += "}";
    }
    return write_text(file, text + "\n]\n}\n");
}

Result<Study> read_study(const fs::path& file) {
    auto object =
        JsonObject::read(file, {"format", "version", "task", "repeats", "seed", "pixels_per_degree", "pairs"});
    if (!object) return object.error();
    std::string format, task;
    if (auto ok = object->get("format", format); !ok) return ok.error();
    if (format != study_format) return object->key_error("format", "must be \"unseen study\".");
    const auto of_version = object->number("version", {1, 1e6, true, true});
    if (!of_version) return of_version.error();
    if (*of_version != version)
        return object->key_error("version", "is " + to_text(*of_version) + ", which this program does not know.");
    Study study;
    if (auto ok = object->get("task", task); !ok) return ok.error();
    const auto known = task_named(task);
    if (!known) return object->key_error("task", "must be \"which\" or \"differ\".");
    study.task = *known;
    const auto repeats = object->number("repeats", {1, 1000, true, true});
    if (!repeats) return repeats.error();
    study.repeats = static_cast<int>(*repeats);
    const auto seed = object->number("seed", {0, largest_seed, true, true});
    if (!seed) return seed.error();
    study.seed = static_cast<std::uint64_t>(*seed);
    const auto ppd = object->number("pixels_per_degree", {0, 1e6, false, false});
    if (!ppd) return ppd.error();
    study.pixels_per_degree = *ppd;
    const auto pairs = object->array("pairs");
    if (!pairs) return pairs.error();
    if ((*pairs)->size() > most_pairs) return object->key_error("pairs", "has more than 10,000 pairs.");
    for (std::size_t i = 0; i < (*pairs)->size(); ++i) {
        auto child = object->child((**pairs)[i], "pairs[" + std::to_string(i) + "]",
                                   {"condition", "original", "other", "training", "predicted_seen"});
        if (!child) return child.error();
        StudyPair pair;
        if (auto ok = child->get("condition", pair.condition); !ok) return ok.error();
        for (const auto& [key, to] : {std::pair("original", &pair.original), std::pair("other", &pair.other)}) {
            std::string path;
            if (auto ok = child->get(key, path); !ok) return ok.error();
            const fs::path relative = fs::path(path).lexically_normal();
            if (path.empty() || relative.is_absolute() || *relative.begin() == "..")
                return child->key_error(key, "must name a picture in the study's folder.");
            *to = file.parent_path() / relative;
        }
        if (auto ok = child->get("training", pair.is_training); !ok) return ok.error();
        if (child->has("predicted_seen")) {
            bool seen = false;
            if (auto ok = child->get("predicted_seen", seen); !ok) return ok.error();
            pair.is_predicted_seen = seen;
        }
        study.pairs.push_back(std::move(pair));
    }
    if (const auto valid = validate(study); !valid) return object->error(valid.error().message);
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

bool StudyAnswer::says_seen(const Study& study) const {
    if (study.task == StudyTask::differ) return choice == StudyChoice::different;
    return (choice == StudyChoice::left) == trial.is_other_left;
}

bool StudyAnswer::is_right(const Study& study) const {
    if (study.task == StudyTask::which) return says_seen(study);
    return says_seen(study) != is_of_one_picture(study.pairs[trial.pair]);
}

// ---- discrete levels

namespace {

constexpr std::array<LevelStep, 3> all_steps = {LevelStep::decrease, LevelStep::maintain, LevelStep::increase};

// What level_condition() says, read back.
std::optional<std::pair<int, LevelStep>> level_step_of(std::string_view condition) {
    constexpr std::string_view begin = "level ";
    const std::size_t comma = condition.find(", ");
    if (!condition.starts_with(begin) || comma == condition.npos) return std::nullopt;
    const auto kept = number_from<int>(condition.substr(begin.size(), comma - begin.size()));
    for (const LevelStep step : all_steps)
        if (kept && condition == level_condition(*kept, step)) return std::pair(*kept, step);
    return std::nullopt;
}

} // namespace

std::string_view name(LevelStep step) {
    constexpr std::array<std::string_view, 3> names = {"decrease", "maintain", "increase"};
    return names[static_cast<std::size_t>(step)];
}

std::string level_condition(int kept, LevelStep step) {
    return "level " + std::to_string(kept) + ", " + std::string(name(step));
}

std::span<const StepResult> steps_of_2007() {
    using enum LevelStep;
    // The printed percentages are these counts of 88, cut off behind the first decimal.
    static constexpr std::array<StepResult, 12> table = {{{2, decrease, {69, 88}},
                                                          {2, maintain, {71, 88}},
                                                          {2, increase, {29, 88}},
                                                          {3, decrease, {69, 88}},
                                                          {3, maintain, {74, 88}},
                                                          {3, increase, {67, 88}},
                                                          {4, decrease, {64, 88}},
                                                          {4, maintain, {28, 88}},
                                                          {4, increase, {71, 88}},
                                                          {5, decrease, {29, 88}},
                                                          {5, maintain, {54, 88}},
                                                          {5, increase, {63, 88}}}};
    return table;
}

// ---- the answers' file

namespace {

constexpr std::array<std::string_view, 12> columns = {"subject", "trial",    "condition", "original",
                                                      "other",   "training", "task",      "predicted",
                                                      "side",    "answer",   "right",     "seconds"};
enum Column {
    subject_,
    trial_,
    condition_,
    original_,
    other_,
    training_,
    task_,
    predicted_,
    side_,
    answer_,
    right_,
    seconds_
};
using Line = std::array<std::string, columns.size()>;

std::string joined(const Line& line) {
    std::string text;
    for (std::size_t i = 0; i < line.size(); ++i) text += (i > 0 ? "," : "") + csv_field(line[i]);
    return text + "\n";
}

Line header() {
    Line line;
    std::copy(columns.begin(), columns.end(), line.begin());
    return line;
}

// What an answer's line says, but for what was answered.
Line line_of(const Study& study, std::string_view subject, const StudyTrial& trial) {
    const StudyPair& pair = study.pairs[trial.pair];
    Line line;
    line[subject_] = subject;
    line[trial_] = std::to_string(trial.number);
    line[condition_] = pair.condition;
    line[original_] = pair.original.filename().string();
    line[other_] = pair.other.filename().string();
    line[training_] = pair.is_training ? "1" : "0";
    line[task_] = name(study.task);
    line[predicted_] = pair.is_predicted_seen ? (*pair.is_predicted_seen ? "seen" : "unseen") : "";
    line[side_] = trial.is_other_left ? "left" : "right";
    return line;
}

struct Numbered {
    int number; // in the file, from 1
    Line line;
};

// Reads a table with the columns of write_answers().
Result<std::vector<Numbered>> read_lines(const fs::path& file) {
    const auto text = read_text_file(file);
    if (!text) return text.error();
    const auto records = parse_csv(*text, file.string(), columns.size());
    if (!records) return records.error();
    const auto wrong = [&](int number, const std::string& what) {
        return Error{ErrorCode::malformed_data, file.string() + ":" + std::to_string(number) + ": " + what};
    };
    std::vector<Numbered> lines;
    for (const CsvRecord& record : *records) {
        if (record.fields.size() < columns.size())
            return wrong(record.line, "there are " + std::to_string(record.fields.size()) + " fields in place of " +
                                          std::to_string(columns.size()) + ": these are no answers of a study.");
        std::ranges::copy(record.fields, lines.emplace_back(Numbered{record.line, {}}).line.begin());
    }
    if (lines.empty() || lines.front().line != header())
        return wrong(1, "the first line must name the columns " +
                            joined(header()).substr(0, joined(header()).size() - 1) + ".");
    lines.erase(lines.begin());
    return lines;
}

Error wrong_line(const fs::path& file, const Numbered& numbered, const std::string& what) {
    return {ErrorCode::malformed_data, file.string() + ":" + std::to_string(numbered.number) + ": " + what};
}

// A line's own fields, whatever study it is of.
struct Said {
    StudyTask task;
    StudyChoice choice;
    double seconds;
};
Result<Said> said(const fs::path& file, const Numbered& numbered) {
    const Line& line = numbered.line;
    const auto task = task_named(line[task_]);
    if (!task) return wrong_line(file, numbered, "the task is '" + line[task_] + "', and none that is known.");
    const auto choice = choice_named(line[answer_]);
    if (!choice || !belongs_to(*choice, *task))
        return wrong_line(file, numbered, "'" + line[answer_] + "' is no answer to the task " + line[task_] + ".");
    const auto seconds = finite_from(line[seconds_]);
    if (!seconds || !(*seconds >= 0)) return wrong_line(file, numbered, "'" + line[seconds_] + "' are no seconds.");
    return Said{*task, *choice, *seconds};
}

} // namespace

Result<void> write_answers(const fs::path& file, const Study& study, std::string_view subject,
                           std::span<const StudyAnswer> answers) {
    std::string text = joined(header());
    for (const StudyAnswer& answer : answers) {
        Line line = line_of(study, subject, answer.trial);
        line[answer_] = name(answer.choice);
        line[right_] = answer.is_right(study) ? "1" : "0";
        line[seconds_] = to_text(std::round(answer.seconds * 1000) / 1000);
        text += joined(line);
    }
    return write_text(file, text);
}

Result<std::vector<StudyAnswer>> read_answers(const fs::path& file, const Study& study, std::string_view subject) {
    const auto lines = read_lines(file);
    if (!lines) return lines.error();
    const std::vector<StudyTrial> trials = trials_of(study, subject);
    std::vector<StudyAnswer> answers;
    for (const Numbered& numbered : *lines) {
        if (answers.size() == trials.size()) return wrong_line(file, numbered, "the study has no more trials.");
        const StudyTrial& trial = trials[answers.size()];
        const auto heard = said(file, numbered);
        if (!heard) return heard.error();
        Line expected = line_of(study, subject, trial);
        for (const Column own : {answer_, right_, seconds_}) expected[own] = numbered.line[own];
        for (std::size_t i = 0; i < columns.size(); ++i)
            if (expected[i] != numbered.line[i])
                return wrong_line(file, numbered,
                                  "the column " + std::string(columns[i]) + " is '" + numbered.line[i] +
                                      "' where this study has '" + expected[i] +
                                      "' for this subject: these answers are of another one.");
        answers.push_back({trial, heard->choice, heard->seconds});
    }
    return answers;
}

// ---- analysis

namespace {

constexpr double normal_95 = 1.959964; // standard deviations
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

double chance_of_so_many(const Share& share) {
    double sum = 0;
    for (std::uint64_t k = share.count; k <= share.of; ++k)
        sum += std::exp(log_choose(share.of, k) - static_cast<double>(share.of) * std::log(2));
    return std::min(sum, 1.0);
}

Result<StudyAnalysis> analyse_answers(std::span<const fs::path> files) {
    StudyAnalysis all;
    std::vector<Tally> tallies;
    std::map<std::string, Share> training; // right answers by subject
    Share false_alarms, agreed;
    for (const fs::path& file : files) {
        const auto lines = read_lines(file);
        if (!lines) return lines.error();
        for (const Numbered& numbered : *lines) {
            const Line& line = numbered.line;
            const auto heard = said(file, numbered);
            if (!heard) return heard.error();
            if (std::ranges::find(all.subjects, line[subject_]) == all.subjects.end())
                all.subjects.push_back(line[subject_]);
            const bool is_same = line[original_] == line[other_];
            const bool seen = heard->task == StudyTask::differ ? heard->choice == StudyChoice::different
                                                               : name(heard->choice) == line[side_];
            const bool right = heard->task == StudyTask::which ? seen : seen != is_same;
            if (line[training_] == "1") {
                add(training[line[subject_]], right);
                continue;
            }
            auto tally = std::ranges::find_if(tallies, [&](const Tally& t) {
                return t.result.condition == line[condition_] && t.result.task == heard->task;
            });
            if (tally == tallies.end()) {
                tallies.emplace_back();
                tally = std::prev(tallies.end());
                tally->result.condition = line[condition_], tally->result.task = heard->task;
                tally->is_of_one_picture = is_same;
            }
            add(tally->result.seen, seen);
            tally->seconds.push_back(heard->seconds);
            if (heard->task == StudyTask::differ && is_same) add(false_alarms, seen);
            if (line[predicted_].empty() || heard->task == StudyTask::which) tally->is_predicted = false;
            else
                add(tally->agreed, seen == (line[predicted_] == "seen")),
                    add(agreed, seen == (line[predicted_] == "seen"));
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
