// The procedure: trials from beliefs, beliefs from answers.
#include <unseen/calibration/procedure.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>

#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/random.h>

#include "json_file.h"

namespace unseen::calibration {
namespace {

using perception::CsfTable;
using perception::CyclesPerDegree;
using perception::Degrees;
using perception::Luminance;

constexpr int most_places = 1000, most_trials = 100'000, most_settings = 1000;
constexpr double widest_eccentricity_deg = 90;
constexpr double brightest_cdm2 = 1e6;
constexpr std::uint64_t exact_integers = std::uint64_t{1} << 53; // what JSON keeps
constexpr double two_sided_95 = 1.959964;                        // standard deviations

// Sweeps over all places until the beliefs keep still; more than enough, as each answer changes little.
constexpr int most_sweeps = 8;
constexpr double still = 5e-4; // log10 units, a fiftieth of a grid step

// What observers' psychometric functions are taken to be one of; 3.5 and a lapse rate of 0.01 are QUEST's own. A choice
// of lapse rates was tried: it costs more certainty than it gains with careless observers.
constexpr double possible_slopes[] = {1.8, 2.5, 3.5, 5};
constexpr double usual_lapse = 0.01;

// Settings scatter at least so much (log10 units): a few that happen to agree do not make a place certain.
constexpr double least_scatter = 0.04;
// Thresholds are looked for up to so far above the highest that is expected (log10 units), where the standard grid ends
// below it: a place of which nothing is seen keeps what is believed of it, in place of the grid's end.
constexpr double room_above_expected = 0.5, farthest_log10_threshold = 12;

// Of seeing nothing at the highest contrast, however far below it the threshold is believed to be.
constexpr double least_chance = 1e-6;

std::string in_brackets(const char* name, std::size_t i) {
    return std::string(name).append("[").append(std::to_string(i)).append("]");
}

// How far a patch reaches: two standard deviations of its envelope.
double patch_radius_deg(const GratingPlace& place) { return 2 * place.sigma_deg(); }

constexpr double cross_deg = 1; // what the fixation cross takes

// Between a fixation cross near one edge of the screen and a patch near the other.
double farthest_eccentricity_deg(const perception::Display& display, double radius_deg) {
    return perception::physical_field(display, display.width_px).value() - radius_deg - cross_deg;
}

double log10_expected(const CsfTable& table, const GratingPlace& place, Luminance luminance) {
    return std::log10(
        table.sensitivity(CyclesPerDegree(place.frequency_cpd), Degrees(place.eccentricity_deg), luminance) *
        summation_gain(place));
}

// Whether a threshold can be measured: well below the highest contrast.
bool is_measurable(const CalibrationPlan& plan, const CsfTable& expected, const GratingPlace& place) {
    constexpr double visible_share = 3;
    return std::pow(10, log10_expected(expected, place, plan.luminance)) * plan.highest_contrast >= visible_share;
}

} // namespace

bool fits(const perception::Display& display, const GratingPlace& place) {
    const double height = perception::physical_field(display, display.height_px).value();
    const double radius = patch_radius_deg(place);
    return 2 * radius <= height && place.eccentricity_deg <= farthest_eccentricity_deg(display, radius);
}

std::vector<GratingPlace> wide_places(const CalibrationPlan& plan, const perception::Display& display,
                                      const CsfTable& expected) {
    constexpr std::size_t coarsest = 2;         // frequencies
    constexpr double least_improvement = 1.189; // 1.5 dB, or the patch says nothing about summation
    std::vector<double> frequencies, eccentricities;
    for (const GratingPlace& place : plan.places) {
        if (place.is_wide()) continue;
        frequencies.push_back(place.frequency_cpd);
        eccentricities.push_back(place.eccentricity_deg);
    }
    for (std::vector<double>* values : {&frequencies, &eccentricities}) {
        std::sort(values->begin(), values->end());
        values->erase(std::unique(values->begin(), values->end()), values->end());
    }
    frequencies.resize(std::min(frequencies.size(), coarsest));
    // The display's smaller side, in circles of two standard deviations.
    const double side = std::min(perception::physical_field(display, display.width_px).value(),
                                 perception::physical_field(display, display.height_px).value());
    const double area = std::min(most_wide_deg2, std::numbers::pi * side * side / 16 * (1 - 1e-9)); // rounding
    std::vector<GratingPlace> wide;
    const auto is_useful = [&](const GratingPlace& place) {
        return area >= least_wide_deg2 && summation_gain(place) >= least_improvement && fits(display, place) &&
               is_measurable(plan, expected, place);
    };
    for (const double frequency : frequencies) {
        const auto nearest = std::find_if(eccentricities.begin(), eccentricities.end(), [&](double e) {
            return is_useful({frequency, e, area});
        });
        if (nearest == eccentricities.end()) continue;
        wide.push_back({frequency, *nearest, area});
        const auto farthest = std::find_if(eccentricities.rbegin(), eccentricities.rend(), [&](double e) {
            return is_useful({frequency, e, area});
        });
        if (*farthest != *nearest) wide.push_back({frequency, *farthest, area});
    }
    return wide;
}

std::string_view name(Method method) { return method == Method::two_interval ? "2ifc" : "adjustment"; }

CalibrationPlan plan_for(const perception::Display& display, const CsfTable& expected,
                         std::optional<Luminance> luminance) {
    CalibrationPlan plan;
    const double black = perception::black_level(display).value(), white = perception::to_luminance(display, 1).value();
    plan.luminance = luminance.value_or(Luminance((black + white) / 2));
    const double mean = plan.luminance.value();
    plan.highest_contrast = luminance ? std::min(mean - black, white - mean) / mean : (white - black) / (white + black);
    const double finest = perception::coarsest_pixels_per_degree(display).value() / pixels_per_cycle;
    std::vector<double> frequencies;
    for (double f = 0.5; f <= std::min(16.0, finest); f *= 2) frequencies.push_back(f);
    if (frequencies.empty()) frequencies.push_back(finest);
    constexpr double visibly_finer = 1.4; // half an octave
    if (finest < 16 && finest > visibly_finer * frequencies.back()) frequencies.push_back(finest);
    for (const double eccentricity : {0.0, 5.0, 10.0, 20.0})
        for (const double frequency : frequencies) {
            const GratingPlace place{frequency, eccentricity};
            if (fits(display, place) && is_measurable(plan, expected, place)) plan.places.push_back(place);
        }
    for (const GratingPlace& place : wide_places(plan, display, expected)) {
        plan.places.push_back(place);
        plan.trials += trials_of_wide_place;
    }
    return plan;
}

Result<void> validate(const CalibrationPlan& plan) {
    if (plan.places.empty() || plan.places.size() > most_places)
        return invalid_argument("A calibration needs 1 to " + std::to_string(most_places) + " places, not " +
                                std::to_string(plan.places.size()) + ".");
    for (std::size_t i = 0; i < plan.places.size(); ++i) {
        const auto& [frequency, eccentricity, area] = plan.places[i];
        const std::string where = in_brackets("places", i);
        constexpr double coarsest_cpd = 1.0 / 16, finest_cpd = 64; // of the tables
        if (!(frequency >= coarsest_cpd && frequency <= finest_cpd))
            return invalid_argument(where + ": the frequency must lie in 1/16 to 64 cpd, not " + to_text(frequency) +
                                    ".");
        if (!(eccentricity >= 0 && eccentricity <= widest_eccentricity_deg))
            return invalid_argument(where + ": the eccentricity must lie in 0 to 90 degrees, not " +
                                    to_text(eccentricity) + ".");
        constexpr double largest_deg2 = 1e4; // a quarter of the sphere
        if (!(area >= 0 && area <= largest_deg2))
            return invalid_argument(where + ": the area must lie in 0 to 10,000 square degrees, not " + to_text(area) +
                                    ".");
        if (std::find(plan.places.begin(), plan.places.begin() + static_cast<std::ptrdiff_t>(i), plan.places[i]) !=
            plan.places.begin() + static_cast<std::ptrdiff_t>(i))
            return invalid_argument(where + " is there twice.");
    }
    if (std::all_of(plan.places.begin(), plan.places.end(), std::mem_fn(&GratingPlace::is_wide)))
        return invalid_argument("All places are of wide patches: add one of 1.5 cycles radius.");
    if (plan.trials < 1 || plan.trials > most_trials)
        return invalid_argument("There must be 1 to 100,000 trials, not " + std::to_string(plan.trials) + ".");
    if (plan.settings < 2 || plan.settings > most_settings)
        return invalid_argument("There must be 2 to 1000 settings a place, not " + std::to_string(plan.settings) + ".");
    if (!(plan.luminance.value() > 0 && plan.luminance.value() <= brightest_cdm2))
        return invalid_argument("The luminance must be above 0 and at most 1e6 cd/m2, not " +
                                to_text(plan.luminance.value()) + ".");
    if (plan.seed > exact_integers)
        return invalid_argument("The seed must be at most 2^53, not " + std::to_string(plan.seed) + ".");
    if (!(plan.highest_contrast > 0 && plan.highest_contrast <= 1))
        return invalid_argument("The highest contrast must lie in 0..1, not " + to_text(plan.highest_contrast) + ".");
    return {};
}

double PlaceEstimate::sensitivity() const { return std::pow(10, log10_sensitivity.mean); }
double PlaceEstimate::low() const {
    return std::pow(10, log10_sensitivity.mean - two_sided_95 * log10_sensitivity.deviation);
}
double PlaceEstimate::high() const {
    return std::pow(10, log10_sensitivity.mean + two_sided_95 * log10_sensitivity.deviation);
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
    const auto text = [](double value) { return to_text(std::round(100 * value) / 100); };
    return invalid_argument("Wide patches were seen worse than small ones of the same bars: " + text(measured.own) +
                            " times as well as by the law of area (95%: " + text(measured.low) + " to " +
                            text(measured.high) + "), where below " + text(worse_below) + " is worse at " +
                            to_text(lowest_cpd) +
                            " cpd. No eye does so: some of the patch was hidden, or the answers were careless. Measure "
                            "again, or without wide patches.");
}

Procedure::Procedure(CalibrationPlan plan, CsfTable expected, QuestPlus blank)
    : plan_(std::move(plan)), expected_(std::move(expected)), field_(plan_.places, expected_, plan_.luminance),
      quests_(plan_.places.size(), std::move(blank)), asked_(plan_.places.size(), 0) {
    combine();
}

Result<Procedure> Procedure::create(CalibrationPlan plan, CsfTable expected) {
    if (auto valid = validate(plan); !valid) return valid.error();
    QuestGrid grid = standard_grid();
    if (plan.method == Method::two_interval) {
        grid.slope.assign(std::begin(possible_slopes), std::end(possible_slopes));
        grid.lapse = {usual_lapse};
    }
    double highest_threshold = 0;
    for (std::size_t i = 0; i < plan.places.size(); ++i) {
        const double threshold = -log10_expected(expected, plan.places[i], plan.luminance);
        if (!(threshold >= lowest_log10_contrast))
            return invalid_argument(in_brackets("places", i) + ": a sensitivity of " +
                                    to_text(std::pow(10, -threshold)) + " is expected, but none above " +
                                    to_text(std::round(std::pow(10, -lowest_log10_contrast))) + " can be measured.");
        highest_threshold = std::max(highest_threshold, std::min(threshold, farthest_log10_threshold));
    }
    std::vector<double>& thresholds = grid.log10_threshold;
    const double step = thresholds[1] - thresholds[0];
    while (thresholds.back() < highest_threshold + room_above_expected)
        thresholds.push_back(thresholds.front() + step * static_cast<double>(thresholds.size()));
    const double highest = std::log10(plan.highest_contrast);
    std::erase_if(grid.log10_contrast, [&](double c) { return c > highest; });
    if (grid.log10_contrast.empty())
        return invalid_argument("The display's highest contrast, " + to_text(plan.highest_contrast) +
                                ", shows nothing that could be measured.");
    if (grid.log10_contrast.back() < highest) grid.log10_contrast.push_back(highest);
    auto blank = QuestPlus::create(grid);
    if (!blank) return blank.error();
    return Procedure(std::move(plan), std::move(expected), std::move(*blank));
}

int Procedure::trials() const noexcept {
    return plan_.method == Method::two_interval ? plan_.trials : plan_.settings * static_cast<int>(plan_.places.size());
}

Trial Procedure::next() const {
    assert(!is_done());
    Trial trial;
    trial.number = static_cast<int>(answers_.size());
    Random random = random_for(plan_.seed, static_cast<std::uint64_t>(trial.number));
    trial.phase_deg = 360 * random.uniform();
    trial.interval = random.uniform() < 0.5 ? 1 : 2;
    if (plan_.method == Method::adjustment) return next_adjustment(trial);
    // Now and then the place that was asked least, so that no place rests on what the others say about it; of those
    // that may be visible.
    constexpr int round = 4;
    constexpr double hardly_visible = 0.02; // chance
    const Prospect prospect = look_ahead();
    std::size_t least_asked = 0;
    const auto rank = [&](std::size_t i) { return std::pair(prospect.visible[i] < hardly_visible, asked_[i]); };
    for (std::size_t i = 1; i < quests_.size(); ++i)
        if (rank(i) < rank(least_asked)) least_asked = i;
    const bool is_for_all = trial.number % round == round - 1;
    double most = -1;
    for (std::size_t i = 0; i < quests_.size(); ++i) {
        if (is_for_all && i != least_asked) continue;
        const std::vector<double> pulled = field_.pulled_by(i);
        quests_[i].forecast([&](const QuestPlus::Forecast& answer) {
            const double gain = gain_of(answer, pulled, prospect);
            if (!(gain > most)) return;
            most = gain;
            trial.place = i;
            trial.contrast = std::min(std::pow(10, answer.log10_contrast), plan_.highest_contrast);
        });
    }
    trial.grating = plan_.places[trial.place];
    return trial;
}

Procedure::Prospect Procedure::look_ahead() const {
    Prospect prospect;
    for (std::size_t i = 0; i < quests_.size(); ++i) {
        const SensitivityField::Belief belief = field_.belief(i);
        const double above = (belief.mean + std::log10(plan_.highest_contrast)) / belief.deviation;
        prospect.visible.push_back(std::erfc(-above / std::numbers::sqrt2) / 2);
        const double mean = quests_[i].log10_threshold().mean;
        for (const double of_function : quests_[i].log10_thresholds()) prospect.shifts.push_back(of_function - mean);
    }
    return prospect;
}

// The variance of a threshold is expected to become smaller by the square of its covariance with the answer over the
// answer's variance. Places vary together by what they say about each other, and by the slope that they have in common.
double Procedure::gain_of(const QuestPlus::Forecast& answer, const std::vector<double>& pulled,
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
Trial Procedure::next_adjustment(Trial trial) const {
    const std::size_t count = plan_.places.size();
    const std::size_t round = answers_.size() / count, turn = answers_.size() % count;
    std::vector<std::size_t> order(count);
    std::iota(order.begin(), order.end(), std::size_t{0});
    Random random = random_for(~plan_.seed, round);
    for (std::size_t i = count; i > 1; --i)
        std::swap(order[i - 1], order[static_cast<std::size_t>(random.uniform() * static_cast<double>(i))]);
    trial.place = order[turn];
    trial.grating = plan_.places[trial.place];
    trial.is_ascending = (round + trial.place) % 2 == 0;
    // Far enough away to be on the other side for sure, and not always equally far, which could be learned.
    constexpr double nearest = 0.5, spread = 0.4; // log10 units
    const double away = nearest + spread * random_for(plan_.seed, answers_.size()).uniform();
    const double expected = -field_.belief(trial.place).mean;
    const double start = std::pow(10, expected + (trial.is_ascending ? -away : away));
    trial.contrast = std::min(start, plan_.highest_contrast);
    return trial;
}

void Procedure::choose(int interval) {
    assert(plan_.method == Method::two_interval);
    const Trial trial = next();
    take({trial.place, std::log10(trial.contrast), interval == trial.interval});
    combine();
}

void Procedure::set(double contrast) {
    assert(plan_.method == Method::adjustment && contrast > 0);
    const double log10_contrast = std::log10(std::min(contrast, plan_.highest_contrast));
    take({next().place, std::max(log10_contrast, lowest_log10_contrast), contrast < plan_.highest_contrast});
    combine();
}

void Procedure::take(const Answer& answer) {
    answers_.push_back(answer);
    ++asked_[answer.place];
    if (plan_.method == Method::two_interval) quests_[answer.place].update(answer.log10_contrast, answer.is_right);
}

// Each place's answers against what the others say about it, in turn, until nothing changes any more.
void Procedure::combine() {
    if (plan_.method == Method::adjustment) weigh_settings();
    const std::vector<double>& thresholds = quests_.front().grid().log10_threshold;
    // A grid does not tell thresholds apart that lie within a step of each other: they are spread as evenly over it.
    const double least_deviation = (thresholds[1] - thresholds[0]) / std::sqrt(12.0);
    std::vector<double> prior(thresholds.size());
    // Of the slope and the lapse rate, which are the observer's and not the place's: what the answers of all places
    // say.
    std::vector<std::vector<double>> evidence;
    for (const QuestPlus& quest : quests_) evidence.push_back(quest.log_evidence());
    std::vector<double> functions(evidence.front().size());
    const auto believe_others = [&](std::size_t i) {
        const SensitivityField::Belief others = field_.without_own(i);
        for (std::size_t t = 0; t < thresholds.size(); ++t) {
            const double z = (-thresholds[t] - others.mean) / others.deviation;
            prior[t] = -z * z / 2;
        }
        std::fill(functions.begin(), functions.end(), 0.0);
        for (std::size_t j = 0; j < evidence.size(); ++j)
            for (std::size_t f = 0; f < functions.size() && j != i; ++f) functions[f] += evidence[j][f];
        quests_[i].set_log_prior(prior, functions);
        evidence[i] = quests_[i].log_evidence();
    };
    for (int sweep = 0; sweep < most_sweeps; ++sweep) {
        double change = 0;
        for (std::size_t i = 0; i < quests_.size(); ++i) {
            if (asked_[i] == 0) continue;
            const double before = field_.belief(i).mean;
            believe_others(i);
            const QuestPlus::Belief belief = quests_[i].log10_threshold();
            field_.set_own(i, {-belief.mean, std::max(belief.deviation, least_deviation)});
            change = std::max(change, std::abs(field_.belief(i).mean - before));
        }
        if (change < still) break;
    }
    for (std::size_t i = 0; i < quests_.size(); ++i) believe_others(i);
}

// The scatter that all places have in common makes likelihoods of the settings. The first round is practice.
void Procedure::weigh_settings() {
    const std::size_t count = plan_.places.size();
    std::vector<std::vector<double>> settings(count); // the seen ones
    std::vector<int> unseen(count, 0);
    for (std::size_t i = count; i < answers_.size(); ++i) {
        if (answers_[i].is_right) settings[answers_[i].place].push_back(answers_[i].log10_contrast);
        else ++unseen[answers_[i].place];
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
    const double highest = std::log10(plan_.highest_contrast);
    const std::vector<double>& thresholds = quests_.front().grid().log10_threshold;
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
        quests_[p].set_log_likelihood(likelihood);
    }
}

std::vector<PlaceEstimate> Procedure::estimates() const {
    std::vector<PlaceEstimate> result(plan_.places.size());
    for (std::size_t i = 0; i < result.size(); ++i) {
        result[i].place = plan_.places[i];
        result[i].log10_sensitivity = field_.belief(i);
        result[i].local = field_.local_deviation(i);
        result[i].answers = asked_[i];
    }
    return result;
}

std::optional<Summation> Procedure::summation() const {
    if (std::none_of(plan_.places.begin(), plan_.places.end(), std::mem_fn(&GratingPlace::is_wide)))
        return std::nullopt;
    const auto [mean, deviation] = field_.log10_summation();
    return Summation{std::pow(10, mean), std::pow(10, mean - two_sided_95 * deviation),
                     std::pow(10, mean + two_sided_95 * deviation)};
}

Result<CsfTable> Procedure::table(std::string source) const {
    perception::CsfSamples samples;
    samples.source = std::move(source);
    for (int i = -16; i <= 24; ++i) samples.frequency_cpd.push_back(std::exp2(i / 4.0)); // quarter octaves, 1/16 to 64
    samples.eccentricity_deg = {0, 1, 2, 3, 4, 5, 6, 8, 10, 12.5, 15, 17.5, 20, 25, 30, 40, 50, 60, 80, 100, 120};
    for (int i = -12; i <= 16; ++i)
        samples.luminance_cdm2.push_back(std::pow(10, i / 4.0)); // quarter decades, 1e-3 to 1e4

    GratingPlace least{1e300, 1e300}, most{0, 0}; // of the measured
    for (const GratingPlace& p : plan_.places) {
        least = {std::min(least.frequency_cpd, p.frequency_cpd), std::min(least.eccentricity_deg, p.eccentricity_deg)};
        most = {std::max(most.frequency_cpd, p.frequency_cpd), std::max(most.eccentricity_deg, p.eccentricity_deg)};
    }
    std::vector<double> deviations; // by eccentricity and frequency
    for (const double e : samples.eccentricity_deg)
        for (const double f : samples.frequency_cpd)
            deviations.push_back(field_
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
                    log10_expected(expected_, place, Luminance(luminance)) + deviations[e * frequencies + f];
                samples.sensitivity.push_back(std::pow(10, std::max(value, least_log10)));
            }
    if (const auto summed = summation()) samples.summation = summed->own;
    return CsfTable::create(std::move(samples));
}

// ---- state --------------------------------------------------------------------------------------------------------

namespace {

constexpr std::string_view state_format = "unseen-calibration";
constexpr int small_version = 1, wide_version = 2; // without and with the patches' areas

// FNV-1a over all numbers of a table, in hexadecimal. As floats, since another machine's logarithms may differ in a
// double's last bits.
std::string hash_of(const CsfTable& table) {
    std::uint64_t hash = 0xcbf29ce484222325u;
    const auto add = [&](std::uint32_t bits) {
        for (int byte = 0; byte < 4; ++byte) hash = (hash ^ ((bits >> (8 * byte)) & 0xff)) * 0x100000001b3u;
    };
    const perception::CsfSamples& s = table.samples();
    for (const std::vector<double>* values :
         {&s.frequency_cpd, &s.eccentricity_deg, &s.luminance_cdm2, &s.sensitivity}) {
        add(static_cast<std::uint32_t>(values->size()));
        for (const double value : *values) add(std::bit_cast<std::uint32_t>(static_cast<float>(value)));
    }
    std::string text(16, '0');
    for (std::size_t digit = 0; digit < text.size(); ++digit)
        text[digit] = "0123456789abcdef"[(hash >> (60 - 4 * digit)) & 15];
    return text;
}

Result<std::vector<std::vector<double>>> read_rows(const JsonObject& object, const char* key, std::size_t width) {
    const auto array = object.array(key);
    if (!array) return array.error();
    std::vector<std::vector<double>> rows;
    for (const auto& row : **array) {
        std::vector<double> values;
        if (auto ok = object.append_numbers(row, in_brackets(key, rows.size()), width, values); !ok) return ok.error();
        rows.push_back(std::move(values));
    }
    return rows;
}

Result<Method> read_method(const JsonObject& object) {
    std::string text;
    if (auto ok = object.get("method", text); !ok) return ok.error();
    for (const Method method : {Method::two_interval, Method::adjustment})
        if (text == name(method)) return method;
    return object.key_error("method", "must be \"2ifc\" or \"adjustment\"");
}

Result<CalibrationPlan> read_plan(const JsonObject& object, int version) {
    CalibrationPlan plan;
    const auto method = read_method(object);
    if (!method) return method.error();
    plan.method = *method;
    const auto seed =
        object.number("seed", {.minimum = 0, .maximum = static_cast<double>(exact_integers), .whole = true});
    const auto trials = object.number("trials", {.minimum = 1, .maximum = most_trials, .whole = true});
    const auto settings = object.number("settings", {.minimum = 2, .maximum = most_settings, .whole = true});
    const auto luminance =
        object.number("luminance_cdm2", {.minimum = 0, .maximum = brightest_cdm2, .minimum_allowed = false});
    const auto contrast = object.number("highest_contrast", {.minimum = 0, .maximum = 1, .minimum_allowed = false});
    for (const auto* number : {&seed, &trials, &settings, &luminance, &contrast})
        if (!*number) return number->error();
    plan.seed = static_cast<std::uint64_t>(*seed);
    plan.trials = static_cast<int>(*trials);
    plan.settings = static_cast<int>(*settings);
    plan.luminance = Luminance(*luminance);
    plan.highest_contrast = *contrast;
    const auto places = read_rows(object, "places", version == wide_version ? 3 : 2);
    if (!places) return places.error();
    for (const auto& place : *places)
        plan.places.push_back({place[0], place[1], version == wide_version ? place[2] : 0});
    if (auto valid = validate(plan); !valid) return object.error(valid.error().message);
    return plan;
}

} // namespace

Result<void> Procedure::save(const std::filesystem::path& file) const {
    const int version = summation() ? wide_version : small_version;
    std::string text = "{\n\"format\": " + to_json(state_format) + ",\n\"version\": " + std::to_string(version) +
                       ",\n\"method\": " + to_json(name(plan_.method));
    text += ",\n\"seed\": " + std::to_string(plan_.seed) + ",\n\"trials\": " + std::to_string(plan_.trials) +
            ",\n\"settings\": " + std::to_string(plan_.settings);
    text += ",\n\"luminance_cdm2\": " + to_text(plan_.luminance.value()) +
            ",\n\"highest_contrast\": " + to_text(plan_.highest_contrast) + ",\n\"places\": [";
    for (std::size_t i = 0; i < plan_.places.size(); ++i)
        text += (i > 0 ? ", [" : "[") + to_text(plan_.places[i].frequency_cpd) + ", " +
                to_text(plan_.places[i].eccentricity_deg) +
                (version == wide_version ? ", " + to_text(plan_.places[i].area_deg2) : "") + "]";
    text += "],\n\"expected\": " + to_json(expected_.samples().source) +
            ",\n\"expected_hash\": " + to_json(hash_of(expected_));
    text += ",\n\"answers\": [";
    for (std::size_t i = 0; i < answers_.size(); ++i)
        text += (i > 0 ? ",\n[" : "\n[") + std::to_string(answers_[i].place) + ", " +
                to_text(answers_[i].log10_contrast) + ", " + (answers_[i].is_right ? "1" : "0") + "]";
    return write_text(file, text + "]\n}\n");
}

Result<Procedure> Procedure::resume(const std::filesystem::path& file, CsfTable expected) {
    const auto object =
        JsonObject::read(file, {"format", "version", "method", "seed", "trials", "settings", "luminance_cdm2",
                                "highest_contrast", "places", "expected", "expected_hash", "answers"});
    if (!object) return object.error();
    std::string format = "missing";
    if (auto ok = object->get("format", format); !ok) return ok.error();
    if (format != state_format)
        return object->key_error("format", "must be \"unseen-calibration\": this is no interrupted calibration");
    const auto version = object->number("version", {.minimum = small_version, .maximum = wide_version, .whole = true});
    if (!version) return version.error();
    std::string begun_with = "another", hash = hash_of(expected);
    if (auto ok = object->get("expected", begun_with); !ok) return ok.error();
    if (auto ok = object->get("expected_hash", hash); !ok) return ok.error();
    if (hash != hash_of(expected))
        return object->key_error("expected", "is " + to_json(begun_with) + ", but the expected table is " +
                                                 to_json(expected.samples().source) +
                                                 ": go on with the one that the calibration was begun with");
    auto plan = read_plan(*object, static_cast<int>(*version));
    if (!plan) return plan.error();
    auto procedure = create(std::move(*plan), std::move(expected));
    if (!procedure) return object->error(procedure.error().message);

    const auto answers = read_rows(*object, "answers", 3);
    if (!answers) return answers.error();
    if (answers->size() > static_cast<std::size_t>(procedure->trials()))
        return object->key_error("answers", "has more of them than the plan has trials");
    for (std::size_t i = 0; i < answers->size(); ++i) {
        const auto& row = (*answers)[i];
        const std::string where = in_brackets("answers", i);
        const double places = static_cast<double>(procedure->plan_.places.size());
        if (!(row[0] >= 0 && row[0] < places && row[0] == std::trunc(row[0])))
            return object->key_error(where, "has no place " + to_text(row[0]));
        constexpr double least_log10 = -10;
        if (!(row[1] >= least_log10 && row[1] <= 0))
            return object->key_error(where, "has a log10 contrast that is not in -10..0");
        if (row[2] != 0 && row[2] != 1)
            return object->key_error(where, "must end in 1 (right, seen) or 0 (wrong, unseen)");
        if (procedure->plan_.method == Method::adjustment) {
            const std::size_t due = procedure->next().place;
            if (static_cast<std::size_t>(row[0]) != due)
                return object->key_error(where, "is not of the place whose turn it was");
        }
        procedure->take({static_cast<std::size_t>(row[0]), std::max(row[1], lowest_log10_contrast), row[2] == 1});
        procedure->combine(); // each time, so that beliefs come out to the last bit as if there had been no break
    }
    return procedure;
}

} // namespace unseen::calibration
