#include <unseen/calibration/procedure.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>

#include <unseen/calibration/internal/quest.h>
#include <unseen/calibration/internal/sensitivity_field.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/random.h>

#include "calibration_plan.h"
#include "json_file.h"

namespace unseen::calibration {
namespace {

using perception::CsfTable;
using perception::CyclesPerDegree;
using perception::Luminance;

constexpr int most_sweeps = 8; // over all places until the beliefs keep still: more than enough
constexpr double still = 5e-4; // log10 units, a fiftieth of a grid step

// What observers' psychometric functions are taken to be one of; 3.5 and a lapse rate of 0.01 are QUEST's own. A choice
// of lapse rates was tried: it costs more certainty than it gains with careless observers.
constexpr double possible_slopes[] = {1.8, 2.5, 3.5, 5};

// Settings scatter at least so much (log10 units): a few that happen to agree do not make a place certain.
constexpr double least_scatter = 0.04;
// Thresholds are looked for up to so far above the highest that is expected (log10 units), where the standard grid ends
// below it: a place of which nothing is seen keeps what is believed of it, in place of the grid's end.
constexpr double room_above_expected = 0.5, farthest_log10_threshold = 12;

// The chance of seeing nothing at the highest contrast, however far below it the threshold is believed to be.
constexpr double least_chance = 1e-6;

} // namespace

struct Procedure::State {
    State(CalibrationPlan plan, perception::CsfTable expected, QuestPlus blank);

    void take(const Answer& answer); // combine() must follow
    void combine();
    Trial next_adjustment(Trial trial) const;

    // Beliefs about the places that decide the next trial.
    struct Prospect {
        // By place: the chance that the display can show its threshold; others need not be known well.
        std::vector<double> visible;
        // By place and slope: its log10 threshold under that slope, relative to the believed one.
        std::vector<double> shifts;
    };
    Prospect look_ahead() const;
    static double gain_of(const QuestPlus::Forecast& answer, const std::vector<double>& pulled,
                          const Prospect& prospect);

    CalibrationPlan plan;
    perception::CsfTable expected;
    std::vector<Answer> answers;
    SensitivityField field;
    std::vector<QuestPlus> quests; // by place, with the beliefs about the others as prior
    std::vector<int> asked;        // answers by place

private:
    void weigh_settings();
};

double PlaceEstimate::at(double deviations) const {
    return std::pow(10, log10_sensitivity.mean + deviations * log10_sensitivity.deviation);
}

Result<void> check(const Summation& measured, const CalibrationPlan& plan) {
    double lowest_cpd = std::numeric_limits<double>::infinity();
    for (const GratingPlace& place : plan.places)
        if (place.is_wide()) lowest_cpd = std::min(lowest_cpd, place.frequency_cpd);
    if (std::isinf(lowest_cpd)) return {};
    // By the law, a wide patch is seen worse than a small one where an unlimited grating is.
    const perception::SquareDegrees unlimited(std::numeric_limits<double>::infinity());
    const double worse_below = 1 / perception::summation_gain(CyclesPerDegree(lowest_cpd), unlimited);
    if (measured.high >= worse_below) return {};
    const auto text = [](double value) { return number_text(std::round(100 * value) / 100); };
    return invalid_argument("Wide patches were seen worse than small ones of the same bars: " + text(measured.own) +
                            " times as well as by the law of area (95%: " + text(measured.low) + " to " +
                            text(measured.high) + "), where below " + text(worse_below) + " is worse at " +
                            number_text(lowest_cpd) +
                            " cpd. No eye does so: some of the patch was hidden, or the answers were careless. Measure "
                            "again, or without wide patches.");
}

Procedure::State::State(CalibrationPlan plan_, CsfTable expected_, QuestPlus blank)
    : plan(std::move(plan_)), expected(std::move(expected_)), field(plan.places, expected, plan.luminance),
      quests(plan.places.size(), std::move(blank)), asked(plan.places.size(), 0) {
    combine();
}

Procedure::Procedure(std::unique_ptr<State> state) : state_(std::move(state)) {}
Procedure::Procedure(Procedure&&) noexcept = default;
Procedure& Procedure::operator=(Procedure&&) noexcept = default;
Procedure::~Procedure() = default;

const CalibrationPlan& Procedure::plan() const noexcept { return state_->plan; }
const std::vector<Answer>& Procedure::answers() const noexcept { return state_->answers; }

Result<Procedure> Procedure::create(CalibrationPlan plan, CsfTable expected) {
    if (auto valid = validate(plan); !valid) return valid.error();
    QuestGrid grid = standard_grid();
    if (plan.method == Method::two_interval) grid.slope.assign(std::begin(possible_slopes), std::end(possible_slopes));
    double highest_threshold = 0;
    for (std::size_t i = 0; i < plan.places.size(); ++i) {
        const double threshold = -log10_expected(expected, plan.places[i], plan.luminance);
        if (!(threshold >= lowest_log10_contrast))
            return invalid_argument(in_brackets("places", i) + ": a sensitivity of " +
                                    number_text(std::pow(10, -threshold)) + " is expected, but none above " +
                                    number_text(std::round(std::pow(10, -lowest_log10_contrast))) +
                                    " can be measured.");
        highest_threshold = std::max(highest_threshold, std::min(threshold, farthest_log10_threshold));
    }
    std::vector<double>& thresholds = grid.log10_threshold;
    const double step = thresholds[1] - thresholds[0];
    while (thresholds.back() < highest_threshold + room_above_expected)
        thresholds.push_back(thresholds.front() + step * static_cast<double>(thresholds.size()));
    const double highest = std::log10(plan.highest_contrast);
    std::erase_if(grid.log10_contrast, [&](double c) { return c > highest; });
    if (grid.log10_contrast.empty())
        return invalid_argument("The display's highest contrast, " + number_text(plan.highest_contrast) +
                                ", shows nothing that could be measured.");
    if (grid.log10_contrast.back() < highest) grid.log10_contrast.push_back(highest);
    return Procedure(std::make_unique<State>(std::move(plan), std::move(expected), QuestPlus(grid)));
}

int Procedure::trials() const noexcept {
    return state_->plan.method == Method::two_interval
               ? state_->plan.trials
               : state_->plan.settings * static_cast<int>(state_->plan.places.size());
}

Trial Procedure::next() const {
    assert(!is_done());
    Trial trial;
    trial.number = static_cast<int>(state_->answers.size());
    Random random = random_for(state_->plan.seed, static_cast<std::uint64_t>(trial.number));
    trial.phase_deg = 360 * random.uniform();
    trial.interval = random.uniform() < 0.5 ? 1 : 2;
    if (state_->plan.method == Method::adjustment) return state_->next_adjustment(trial);
    // Now and then the place that was asked least, so that no place rests on what the others say about it; of those
    // that may be visible.
    constexpr int round = 4;
    constexpr double hardly_visible = 0.02; // chance
    const State::Prospect prospect = state_->look_ahead();
    std::size_t least_asked = 0;
    const auto rank = [&](std::size_t i) { return std::pair(prospect.visible[i] < hardly_visible, state_->asked[i]); };
    for (std::size_t i = 1; i < state_->quests.size(); ++i)
        if (rank(i) < rank(least_asked)) least_asked = i;
    const bool is_for_all = trial.number % round == round - 1;
    double most = -1;
    for (std::size_t i = 0; i < state_->quests.size(); ++i) {
        if (is_for_all && i != least_asked) continue;
        const std::vector<double> pulled = state_->field.pulled_by(i);
        state_->quests[i].forecast([&](const QuestPlus::Forecast& answer) {
            const double gain = State::gain_of(answer, pulled, prospect);
            if (!(gain > most)) return;
            most = gain;
            trial.place = i;
            trial.contrast = std::min(std::pow(10, answer.log10_contrast), state_->plan.highest_contrast);
        });
    }
    trial.grating = state_->plan.places[trial.place];
    return trial;
}

Procedure::State::Prospect Procedure::State::look_ahead() const {
    Prospect prospect;
    for (std::size_t i = 0; i < quests.size(); ++i) {
        const Belief belief = field.belief(i);
        const double above = (belief.mean + std::log10(plan.highest_contrast)) / belief.deviation;
        prospect.visible.push_back(std::erfc(-above / std::numbers::sqrt2) / 2);
        const double mean = quests[i].log10_threshold().mean;
        for (const double of_function : quests[i].log10_thresholds()) prospect.shifts.push_back(of_function - mean);
    }
    return prospect;
}

// The variance of a threshold is expected to become smaller by the square of its covariance with the answer over the
// answer's variance. Places vary together by what they say about each other, and by the slope that they have in common.
double Procedure::State::gain_of(const QuestPlus::Forecast& answer, const std::vector<double>& pulled,
                                 const Prospect& prospect) {
    const std::size_t functions = answer.right.size();
    const double right = std::accumulate(answer.right.begin(), answer.right.end(), 0.0);
    if (!(right > 0 && right < 1)) return 0;
    double sum = 0;
    for (std::size_t place = 0; place < pulled.size(); ++place) {
        double covariance = pulled[place] * answer.pull;
        for (std::size_t f = 0; f < functions; ++f)
            covariance += answer.right[f] * prospect.shifts[place * functions + f];
        sum += prospect.visible[place] * covariance * covariance;
    }
    return sum / (right * (1 - right));
}

// Rounds over all places, each in an order of its own; a place is approached from below and from above in turn.
Trial Procedure::State::next_adjustment(Trial trial) const {
    const std::size_t count = plan.places.size();
    const std::size_t round = answers.size() / count, turn = answers.size() % count;
    std::vector<std::size_t> order(count);
    std::iota(order.begin(), order.end(), std::size_t{0});
    Random random = random_for(~plan.seed, round);
    for (std::size_t i = count; i > 1; --i)
        std::swap(order[i - 1], order[static_cast<std::size_t>(random.uniform() * static_cast<double>(i))]);
    trial.place = order[turn];
    trial.grating = plan.places[trial.place];
    trial.is_ascending = (round + trial.place) % 2 == 0;
    // Far enough away to be on the other side for sure, and not always equally far, which could be learned.
    constexpr double nearest = 0.5, spread = 0.4; // log10 units
    const double away = nearest + spread * random_for(plan.seed, answers.size()).uniform();
    const double believed = -field.belief(trial.place).mean;
    const double start = std::pow(10, believed + (trial.is_ascending ? -away : away));
    trial.contrast = std::min(start, plan.highest_contrast);
    return trial;
}

void Procedure::choose(int interval) {
    assert(state_->plan.method == Method::two_interval);
    const Trial trial = next();
    state_->take({trial.place, std::log10(trial.contrast), interval == trial.interval});
    state_->combine();
}

void Procedure::set(double contrast) {
    assert(state_->plan.method == Method::adjustment && contrast > 0);
    const double log10_contrast = std::log10(std::min(contrast, state_->plan.highest_contrast));
    state_->take(
        {next().place, std::max(log10_contrast, lowest_log10_contrast), contrast < state_->plan.highest_contrast});
    state_->combine();
}

void Procedure::State::take(const Answer& answer) {
    answers.push_back(answer);
    ++asked[answer.place];
    if (plan.method == Method::two_interval) quests[answer.place].update(answer.log10_contrast, answer.is_right);
}

// Each place's answers against what the others say about it, in turn, until nothing changes any more.
void Procedure::State::combine() {
    if (plan.method == Method::adjustment) weigh_settings();
    const std::vector<double>& thresholds = quests.front().grid().log10_threshold;
    // A grid does not tell thresholds apart that lie within a step of each other: they are spread as evenly over it.
    const double least_deviation = (thresholds[1] - thresholds[0]) / std::sqrt(12.0);
    std::vector<double> prior(thresholds.size());
    // Slope and lapse rate belong to the observer, not to the place: the answers of all places are evidence for them.
    std::vector<std::vector<double>> evidence;
    for (const QuestPlus& quest : quests) evidence.push_back(quest.log_evidence());
    std::vector<double> functions(evidence.front().size());
    const auto believe_others = [&](std::size_t i) {
        const Belief others = field.without_own(i);
        for (std::size_t t = 0; t < thresholds.size(); ++t) {
            const double z = (-thresholds[t] - others.mean) / others.deviation;
            prior[t] = -z * z / 2;
        }
        std::fill(functions.begin(), functions.end(), 0.0);
        for (std::size_t j = 0; j < evidence.size(); ++j)
            for (std::size_t f = 0; f < functions.size() && j != i; ++f) functions[f] += evidence[j][f];
        quests[i].set_log_prior(prior, functions);
        evidence[i] = quests[i].log_evidence();
    };
    for (int sweep = 0; sweep < most_sweeps; ++sweep) {
        double change = 0;
        for (std::size_t i = 0; i < quests.size(); ++i) {
            if (asked[i] == 0) continue;
            const double before = field.belief(i).mean;
            believe_others(i);
            const Belief belief = quests[i].log10_threshold();
            field.set_own(i, {-belief.mean, std::max(belief.deviation, least_deviation)});
            change = std::max(change, std::abs(field.belief(i).mean - before));
        }
        if (change < still) break;
    }
    for (std::size_t i = 0; i < quests.size(); ++i) believe_others(i);
}

// The scatter that all places have in common makes likelihoods of the settings. The first round is practice.
void Procedure::State::weigh_settings() {
    const std::size_t count = plan.places.size();
    std::vector<std::vector<double>> settings(count); // the seen ones
    std::vector<int> unseen(count, 0);
    for (std::size_t i = count; i < answers.size(); ++i) {
        if (answers[i].is_right) settings[answers[i].place].push_back(answers[i].log10_contrast);
        else ++unseen[answers[i].place];
    }
    double squares = 0;
    std::size_t freedom = 0;
    for (const std::vector<double>& of_place : settings) {
        if (of_place.empty()) continue;
        const double mean =
            std::accumulate(of_place.begin(), of_place.end(), 0.0) / static_cast<double>(of_place.size());
        for (const double s : of_place) squares += (s - mean) * (s - mean);
        freedom += of_place.size() - 1;
    }
    constexpr double usual_scatter = 0.15; // until it is known
    const double scatter =
        freedom < count ? usual_scatter : std::max(least_scatter, std::sqrt(squares / static_cast<double>(freedom)));
    const double highest = std::log10(plan.highest_contrast);
    const std::vector<double>& thresholds = quests.front().grid().log10_threshold;
    std::vector<double> likelihood(thresholds.size());
    for (std::size_t p = 0; p < count; ++p) {
        for (std::size_t t = 0; t < thresholds.size(); ++t) {
            likelihood[t] =
                unseen[p] *
                std::log(std::erfc((highest - thresholds[t]) / (scatter * std::numbers::sqrt2)) + least_chance);
            for (const double s : settings[p]) {
                const double z = (s - thresholds[t]) / scatter;
                likelihood[t] -= z * z / 2;
            }
        }
        quests[p].set_log_likelihood(likelihood);
    }
}

std::vector<PlaceEstimate> Procedure::estimates() const {
    std::vector<PlaceEstimate> result;
    for (std::size_t i = 0; i < state_->plan.places.size(); ++i)
        result.push_back(
            {state_->plan.places[i], state_->asked[i], state_->field.belief(i), state_->field.local_deviation(i)});
    return result;
}

std::optional<Summation> Procedure::summation() const {
    if (std::ranges::none_of(state_->plan.places, &GratingPlace::is_wide)) return std::nullopt;
    const auto [mean, deviation] = state_->field.log10_summation();
    return Summation{std::pow(10, mean), std::pow(10, mean - normal_95 * deviation),
                     std::pow(10, mean + normal_95 * deviation)};
}

Result<CsfTable> Procedure::table(std::string source) const {
    perception::CsfSamples samples;
    samples.source = std::move(source);
    for (int i = -16; i <= 24; ++i) samples.frequency_cpd.push_back(std::exp2(i / 4.0)); // quarter octaves, 1/16 to 64
    samples.eccentricity_deg = {0, 1, 2, 3, 4, 5, 6, 8, 10, 12.5, 15, 17.5, 20, 25, 30, 40, 50, 60, 80, 100, 120};
    for (int i = -12; i <= 16; ++i)
        samples.luminance_cdm2.push_back(std::pow(10, i / 4.0)); // quarter decades, 1e-3 to 1e4

    GratingPlace least{1e300, 1e300}, most{0, 0}; // of the measured
    for (const GratingPlace& p : state_->plan.places) {
        least = {std::min(least.frequency_cpd, p.frequency_cpd), std::min(least.eccentricity_deg, p.eccentricity_deg)};
        most = {std::max(most.frequency_cpd, p.frequency_cpd), std::max(most.eccentricity_deg, p.eccentricity_deg)};
    }
    std::vector<double> deviations; // by eccentricity and frequency
    for (const double e : samples.eccentricity_deg)
        for (const double f : samples.frequency_cpd)
            deviations.push_back(state_->field
                                     .deviation({std::clamp(f, least.frequency_cpd, most.frequency_cpd),
                                                 std::clamp(e, least.eccentricity_deg, most.eccentricity_deg)})
                                     .mean);
    const std::size_t frequencies = samples.frequency_cpd.size();
    for (std::size_t e = 0; e < samples.eccentricity_deg.size(); ++e)
        for (const double luminance : samples.luminance_cdm2)
            for (std::size_t f = 0; f < frequencies; ++f) {
                const GratingPlace place{samples.frequency_cpd[f], samples.eccentricity_deg[e]};
                constexpr double least_log10 = -30; // sensitivities of castleCSF at 64 cpd far aside, kept above 0
                const double value =
                    log10_expected(state_->expected, place, Luminance(luminance)) + deviations[e * frequencies + f];
                samples.sensitivity.push_back(std::pow(10, std::max(value, least_log10)));
            }
    if (const auto summed = summation()) samples.summation = summed->own;
    return CsfTable::create(std::move(samples));
}

// ---- interrupted calibrations, as files

namespace {

constexpr std::string_view state_format = "unseen-calibration";
constexpr int small_version = 1, wide_version = 2; // without and with the patches' areas

// A hash of all numbers of a table, in hexadecimal. They count as floats, since another machine's logarithms may differ
// in a double's last bits.
std::string hash_of_table(const CsfTable& table) {
    std::string bytes;
    const auto add = [&](std::uint32_t bits) {
        for (int byte = 0; byte < 4; ++byte) bytes += static_cast<char>(bits >> (8 * byte));
    };
    const perception::CsfSamples& s = table.samples();
    for (const std::vector<double>* values :
         {&s.frequency_cpd, &s.eccentricity_deg, &s.luminance_cdm2, &s.sensitivity}) {
        add(static_cast<std::uint32_t>(values->size()));
        for (const double value : *values) add(std::bit_cast<std::uint32_t>(static_cast<float>(value)));
    }
    const std::uint64_t hash = hash_of(bytes);
    std::string text(16, '0');
    for (std::size_t digit = 0; digit < text.size(); ++digit)
        text[digit] = "0123456789abcdef"[(hash >> (60 - 4 * digit)) & 15];
    return text;
}

CalibrationPlan read_plan(const JsonObject& object, int version) {
    CalibrationPlan plan;
    std::string method;
    object.get("method", method);
    if (method == name(Method::adjustment)) plan.method = Method::adjustment;
    else if (method != name(Method::two_interval)) object.fail_at("method", "must be \"2ifc\" or \"adjustment\"");
    plan.seed = static_cast<std::uint64_t>(
        object.number("seed", {.minimum = 0, .maximum = static_cast<double>(exact_integers), .whole = true}));
    plan.trials = static_cast<int>(object.number("trials", {.minimum = 1, .maximum = most_plan_trials, .whole = true}));
    plan.settings =
        static_cast<int>(object.number("settings", {.minimum = 2, .maximum = most_plan_settings, .whole = true}));
    plan.luminance =
        Luminance(object.number("luminance_cdm2", {.minimum = 0, .maximum = brightest_cdm2, .minimum_allowed = false}));
    plan.highest_contrast = object.number("highest_contrast", {.minimum = 0, .maximum = 1, .minimum_allowed = false});
    for (std::vector<double> place : object.rows("places", version == wide_version ? 3 : 2)) {
        place.resize(3, 0.0);
        plan.places.push_back({place[0], place[1], place[2]});
    }
    if (auto valid = validate(plan); !valid) object.fail(valid.error().message);
    return plan;
}

} // namespace

Result<void> Procedure::save(const std::filesystem::path& file) const {
    const CalibrationPlan& plan = state_->plan;
    const int version = summation() ? wide_version : small_version;
    JsonWriter json;
    json.add_text("format", state_format);
    json.add("version", version);
    json.add_text("method", name(plan.method));
    json.add("seed", plan.seed);
    json.add("trials", plan.trials);
    json.add("settings", plan.settings);
    json.add("luminance_cdm2", plan.luminance.value());
    json.add("highest_contrast", plan.highest_contrast);
    std::string places, answers;
    for (const GratingPlace& place : plan.places) {
        std::vector<double> row = {place.frequency_cpd, place.eccentricity_deg};
        if (version == wide_version) row.push_back(place.area_deg2);
        places += (places.empty() ? "" : ", ") + to_json(row);
    }
    json.add("places", "[" + places + "]");
    json.add_text("expected", state_->expected.samples().source);
    json.add_text("expected_hash", hash_of_table(state_->expected));
    for (const Answer& answer : state_->answers)
        answers += (answers.empty() ? "\n[" : ",\n[") + std::to_string(answer.place) + ", " +
                   number_text(answer.log10_contrast) + ", " + (answer.is_right ? "1" : "0") + "]";
    json.add("answers", "[" + answers + "]");
    return json.write(file);
}

Result<Procedure> Procedure::resume(const std::filesystem::path& file, CsfTable expected) {
    const JsonObject object(file, {"format", "version", "method", "seed", "trials", "settings", "luminance_cdm2",
                                   "highest_contrast", "places", "expected", "expected_hash", "answers"});
    std::string format = "missing", begun_with = "another", hash = hash_of_table(expected);
    object.get("format", format);
    if (format != state_format)
        object.fail_at("format", "must be \"unseen-calibration\": this is no interrupted calibration");
    const double version = object.number("version", {.minimum = small_version, .maximum = wide_version, .whole = true});
    object.get("expected", begun_with);
    object.get("expected_hash", hash);
    if (hash != hash_of_table(expected))
        object.fail_at("expected", "is " + to_json(begun_with) + ", but the expected table is " +
                                       to_json(expected.samples().source) +
                                       ": go on with the one that the calibration was begun with");
    CalibrationPlan plan = read_plan(object, static_cast<int>(version));
    if (!object) return object.error();
    auto procedure = create(std::move(plan), std::move(expected));
    if (!procedure) {
        object.fail(procedure.error().message);
        return object.error();
    }
    const auto answers = object.rows("answers", 3);
    if (answers.size() > static_cast<std::size_t>(procedure->trials()))
        object.fail_at("answers", "has more of them than the plan has trials");
    State& state = *procedure->state_;
    for (std::size_t i = 0; i < answers.size() && object; ++i) {
        const auto& row = answers[i];
        const std::string where = in_brackets("answers", i);
        constexpr double least_log10 = -10;
        if (!(row[0] >= 0 && row[0] < static_cast<double>(state.plan.places.size()) && row[0] == std::trunc(row[0])))
            object.fail_at(where, "has no place " + number_text(row[0]));
        else if (!(row[1] >= least_log10 && row[1] <= 0))
            object.fail_at(where, "has a log10 contrast that is not in -10..0");
        else if (row[2] != 0 && row[2] != 1) object.fail_at(where, "must end in 1 (right, seen) or 0 (wrong, unseen)");
        else if (state.plan.method == Method::adjustment && static_cast<std::size_t>(row[0]) != procedure->next().place)
            object.fail_at(where, "is not of the place whose turn it was");
        if (!object) break;
        state.take({static_cast<std::size_t>(row[0]), std::max(row[1], lowest_log10_contrast), row[2] == 1});
        state.combine(); // each time, so that beliefs come out to the last bit as if there had been no break
    }
    if (!object) return object.error();
    return procedure;
}

} // namespace unseen::calibration
