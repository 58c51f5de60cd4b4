// The contrast sensitivity table: filled from a model or from samples, interpolated in log space, made monotone for
// the fold test, and inverted.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <unseen/perception/internal/motion.h>

#include "csf/csf_model.h"
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/number_text.h>

namespace unseen::perception {

namespace {

// Buckets of the constant-time search per sample of an axis: enough for one sample or none per bucket on the usual
// axes, although they are denser near the fovea.
constexpr std::size_t buckets_per_sample = 16;

// Queries of a batch that are answered together.
constexpr std::size_t queries_in_step = 8;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// Sensitivities below this are equally invisible; it keeps their logarithm finite.
constexpr double sensitivity_floor = 1e-300;

constexpr double lowest_frequency_cpd = 1.0 / 16, highest_frequency_cpd = 64;
constexpr double lowest_luminance_cdm2 = 1e-3, highest_luminance_cdm2 = 1e4;
constexpr double highest_eccentricity_deg = 120;

// How densely a model's table samples, for an error of 0.5% where S > 1. Interpolation errs by h^2 / 8 times the
// curvature and by h / 4 times the change of slope at a kink that no sample lies on.
struct Density {
    double per_octave;
    double per_decade;
};
// Log sensitivity over log frequency bends by up to 24 where Barten's optics end visibility; the adaptation laws
// bend by little.
constexpr Density smooth_model{24, 10};
// castle and stela: the sustained channel's plateau ends in a change of slope of 0.43 at 0.6 times its peak frequency.
// That lies below 1.25 cpd and moves with the luminance, by up to 0.26 octaves an octave, up to 300 cd/m2.
constexpr Density below_plateau{32, 16}, above_plateau{20, 12};
constexpr double plateau_cpd = 1.25, plateau_cdm2 = 300;
// castle's transient channel, which flicker needs, moves fast with the luminance just above a kink.
constexpr double transient_per_decade = 72, transient_decades = 0.8;
// daly's frequencies scale with 1 + 0.24 e: steps of this in the logarithm of that.
constexpr double daly_eccentricity_scale = 0.24, daly_log_step = 0.065;

Error bad(std::string message) { return invalid_argument("contrast sensitivity table: " + std::move(message)); }

std::string indexed(std::string_view field, std::initializer_list<std::size_t> indices) {
    std::string text(field);
    for (const std::size_t index : indices) text.append("[").append(std::to_string(index)).append("]");
    return text;
}

std::vector<double> log2_of(std::span<const double> values) {
    std::vector<double> logs(values.size());
    std::ranges::transform(values, logs.begin(), [](double v) { return std::log2(v); });
    return logs;
}

// What no table of an eye has, by orders of magnitude: values beyond are a slip.
constexpr double most_cpd = 1e4, most_degrees = CsfTable::highest_eccentricity.value(), most_cdm2 = 1e10,
                 most_sensitive = 1e6;

// `positions` are the values as interpolation sees them: their logarithms, or themselves.
Result<void> check_axis(std::string_view field, std::span<const double> values, std::span<const double> positions,
                        double highest) {
    for (std::size_t i = 0; i < values.size(); ++i) {
        const std::string place = indexed(field, {i});
        if (!std::isfinite(values[i]) || !std::isfinite(positions[i]))
            return bad(place + " must be a finite number in its range, but is " + number_text(values[i]));
        if (values[i] > highest)
            return bad(place + " must be at most " + number_text(highest) + ", but is " + number_text(values[i]));
        if (i > 0 && !(positions[i] - positions[i - 1] >= CsfTable::smallest_spacing))
            return bad(place + " is " + number_text(values[i]) + " after " + number_text(values[i - 1]) +
                       ": the values must rise from sample to sample, by at least " +
                       number_text(CsfTable::smallest_spacing) +
                       (values.data() == positions.data() ? " degrees" : " octaves"));
    }
    return {};
}

// What grows with eccentricity is no contrast sensitivity: see CsfTable::noise_db. `s` has valid axes and values.
Result<void> check_decline(const CsfSamples& s) {
    // A contrast above 1 that is needed to see anything is not shown by any grating, and nobody can have measured it.
    constexpr double least_measurable = 1;
    const double tolerance = std::pow(10.0, CsfTable::noise_db / 20);
    const std::size_t frequencies = s.frequency_cpd.size(), plane = s.luminance_cdm2.size() * frequencies;
    for (std::size_t i = 0; i < plane; ++i) {
        const std::size_t l = i / frequencies, f = i % frequencies;
        if (s.luminance_cdm2[l] < CsfTable::rods_alone_below.value()) continue;
        std::size_t least = 0;
        for (std::size_t e = 1; e < s.eccentricity_deg.size(); ++e) {
            const double before = s.sensitivity[least * plane + i], here = s.sensitivity[e * plane + i];
            const double growth = std::max(here, least_measurable) / std::max(before, least_measurable);
            if (growth > tolerance) {
                return bad(indexed("sensitivity", {e, l, f}) + " is " + number_text(here) + " (" +
                           number_text(s.eccentricity_deg[e]) + " degrees, " + number_text(s.luminance_cdm2[l]) +
                           " cd/m2, " + number_text(s.frequency_cpd[f]) + " cpd), but nearer to the gaze " +
                           indexed("sensitivity", {least, l, f}) + " is " + number_text(before) + " (" +
                           number_text(s.eccentricity_deg[least]) + " degrees): it grows by " +
                           number_text(std::round(200 * std::log10(growth)) / 10) +
                           " dB with eccentricity, and noise explains " + number_text(CsfTable::noise_db) +
                           " dB at most. Check that rows and columns are in the order of the axes, or measure these "
                           "two again");
            }
            if (here < before) least = e;
        }
    }
    return {};
}

// From `first` to `last` in steps of equal ratio, at least `per_unit` to each factor of `unit`.
void append_ladder(std::vector<double>& values, double first, double last, double unit, double per_unit) {
    const int steps = static_cast<int>(std::ceil(std::log(last / first) / std::log(unit) * per_unit - 1e-9));
    for (int i = 0; i < steps; ++i) values.push_back(first * std::pow(last / first, double(i) / steps));
}

bool has_plateau(CsfModel model) { return model == CsfModel::castle || model == CsfModel::stela; }

std::vector<double> model_frequencies(CsfModel model, const Stimulus& conditions) {
    std::vector<double> cpd;
    if (has_plateau(model)) {
        append_ladder(cpd, lowest_frequency_cpd, plateau_cpd, 2, below_plateau.per_octave);
        append_ladder(cpd, plateau_cpd, highest_frequency_cpd, 2, above_plateau.per_octave);
    } else {
        append_ladder(cpd, lowest_frequency_cpd, highest_frequency_cpd, 2, smooth_model.per_octave);
    }
    cpd.push_back(highest_frequency_cpd);
    // With a sample at each kink, no cell straddles it.
    for (const CyclesPerDegree kink : kinks(model, conditions)) {
        const auto next = std::ranges::upper_bound(cpd, kink.value());
        if (next == cpd.begin() || next == cpd.end()) continue;
        const auto is_apart = [&](double other) {
            return std::abs(std::log2(other / kink.value())) > 2 * CsfTable::smallest_spacing;
        };
        if (is_apart(*next) && is_apart(*(next - 1))) cpd.insert(next, kink.value());
    }
    return cpd;
}

std::vector<double> model_eccentricities(CsfModel model) {
    if (model != CsfModel::daly) {
        // Log sensitivity is linear in eccentricity. The two between keep the slope where 120 degrees underflow.
        return {0, 5, 20, highest_eccentricity_deg};
    }
    const double log_end = std::log1p(daly_eccentricity_scale * highest_eccentricity_deg);
    const int steps = static_cast<int>(std::ceil(log_end / daly_log_step));
    std::vector<double> degrees;
    for (int i = 0; i < steps; ++i) degrees.push_back(std::expm1(log_end * i / steps) / daly_eccentricity_scale);
    degrees.push_back(highest_eccentricity_deg);
    return degrees;
}

std::vector<double> model_luminances(CsfModel model, const Stimulus& conditions) {
    std::vector<double> cdm2;
    if (model == CsfModel::castle && conditions.temporal.value() > 0) {
        const double kink = castle_transient_kink().value(), calm = kink * std::pow(10.0, transient_decades);
        append_ladder(cdm2, lowest_luminance_cdm2, kink, 10, below_plateau.per_decade);
        append_ladder(cdm2, kink, calm, 10, transient_per_decade);
        append_ladder(cdm2, calm, plateau_cdm2, 10, below_plateau.per_decade);
        append_ladder(cdm2, plateau_cdm2, highest_luminance_cdm2, 10, above_plateau.per_decade);
    } else if (has_plateau(model)) {
        append_ladder(cdm2, lowest_luminance_cdm2, plateau_cdm2, 10, below_plateau.per_decade);
        append_ladder(cdm2, plateau_cdm2, highest_luminance_cdm2, 10, above_plateau.per_decade);
    } else if (is_relative(model)) {
        return {lowest_luminance_cdm2, highest_luminance_cdm2};
    } else {
        append_ladder(cdm2, lowest_luminance_cdm2, highest_luminance_cdm2, 10, smooth_model.per_decade);
    }
    cdm2.push_back(highest_luminance_cdm2);
    return cdm2;
}

std::string model_source(CsfModel model, const Stimulus& c) {
    std::string text = std::string(name(model)) + ", closed form; " + number_text(c.temporal.value()) + " Hz, " +
                       number_text(c.velocity.value()) + " degrees/s, area pi (1.5 / frequency)^2";
    if (model == CsfModel::daly) return text + ", from " + number_text(c.distance.value()) + " m";
    if (!is_castle_family(model)) return text;
    switch (c.field) {
    case VisualField::nasal: return text + ", nasal field";
    case VisualField::temporal: return text + ", temporal field";
    case VisualField::worst: break;
    }
    return text + ", worse of nasal and temporal field";
}

double floored(double sensitivity) { return std::max(sensitivity, sensitivity_floor); }

// All models but daly are a product of a foveal part and of one that only depends on frequency and eccentricity.
// `stimulus` makes one of frequency, eccentricity and luminance.
template <class MakeStimulus>
void fill(CsfSamples& samples, CsfModel model, VisualField field, MakeStimulus stimulus) {
    std::vector<double> foveal;
    for (const double cdm2 : samples.luminance_cdm2) {
        for (const double cpd : samples.frequency_cpd) foveal.push_back(sensitivity(model, stimulus(cpd, 0, cdm2)));
    }
    std::vector<double> remaining(samples.frequency_cpd.size());
    for (const double degrees : samples.eccentricity_deg) {
        std::ranges::transform(samples.frequency_cpd, remaining.begin(), [&](double cpd) {
            return std::pow(10.0, -decay_per_degree(model, CyclesPerDegree(cpd), field) * degrees);
        });
        for (std::size_t i = 0; i < foveal.size(); ++i)
            samples.sensitivity.push_back(floored(foveal[i] * remaining[i % remaining.size()]));
    }
}

template <class MakeStimulus>
void fill_daly(CsfSamples& samples, std::vector<double>& eccentric, std::vector<double>& ceiling,
               MakeStimulus stimulus) {
    std::vector<double> motion;
    for (const double cdm2 : samples.luminance_cdm2) {
        for (const double cpd : samples.frequency_cpd) {
            const Stimulus s = stimulus(cpd, 0, cdm2);
            motion.push_back(motion_factor(CsfModel::daly, s));
            ceiling.push_back(floored(daly_ceiling(s) * motion.back()));
        }
    }
    for (const double degrees : samples.eccentricity_deg) {
        std::size_t i = 0;
        for (const double cdm2 : samples.luminance_cdm2) {
            for (const double cpd : samples.frequency_cpd) {
                eccentric.push_back(floored(daly_eccentric(stimulus(cpd, degrees, cdm2)) * motion[i]));
                samples.sensitivity.push_back(std::min(eccentric.back(), ceiling[i++]));
            }
        }
    }
}

// The monotone form puts columns of its own between samples that lie farther apart than these: the peak over frequency is
// not linear in eccentricity even where log sensitivity is, and it bends most near the fovea.
std::vector<double> refined(std::span<const double> degrees) {
    constexpr struct { int from, until, step; } extras[] = {{0, 10, 1}, {12, 20, 2}, {25, 60, 5}, {70, 120, 10}};
    constexpr double clear = 0.1; // degrees between samples and what is put between them
    std::vector<double> all(degrees.begin(), degrees.end());
    for (const auto& [from, until, step] : extras)
        for (int extra = from; extra <= until; extra += step) {
            const bool is_inside = extra > degrees.front() && extra < degrees.back();
            if (is_inside && std::ranges::none_of(degrees, [&](double e) { return std::abs(e - extra) < clear; }))
                all.push_back(extra);
        }
    std::ranges::sort(all);
    return all;
}

// The samples of one axis, with a uniform grid over them that finds the samples around a value in constant time.
struct Axis {
    std::vector<double> positions;         // log2 cpd, degrees, log2 cd/m2
    std::vector<std::uint32_t> first_cell; // of each of the uniform buckets, and the last cell once more
    double buckets_per_unit = 0;
};

// Two neighbouring samples and how far a position, clamped to the axis, lies between them, 0..1.
struct Cell {
    std::size_t first = 0, second = 0;
    double fraction = 0;
};

// The column over frequency at an eccentricity and a luminance, blended from the four around it.
struct Blend {
    std::array<const float*, 4> columns;
    std::array<double, 4> weights; // at least 0, sum 1

    double operator[](std::size_t f) const {
        return (weights[0] * double(columns[0][f]) + weights[1] * double(columns[1][f])) +
               (weights[2] * double(columns[2][f]) + weights[3] * double(columns[3][f]));
    }
};

struct Query {
    Blend column;
    double log2_threshold;
    std::size_t sample; // the last one that reaches the threshold, as far as known
};

// What a model's table knows beyond its samples: log S is the smaller of two smooth surfaces. Interpolated each for
// itself, they keep the kink between them sharp. Empty: the samples are all there is.
struct Branches {
    std::vector<double> sensitivity; // same layout as the samples
    std::vector<double> ceiling;     // [l * frequencies + f], whatever the eccentricity
};

Axis make_axis(std::vector<double> positions) {
    Axis axis;
    if (positions.size() > 1) {
        const std::size_t buckets = buckets_per_sample * positions.size(), last_cell = positions.size() - 2;
        axis.buckets_per_unit = double(buckets) / (positions.back() - positions.front());
        std::size_t cell = 0;
        for (std::size_t b = 0; b <= buckets; ++b) {
            const double start = positions.front() + double(b) / axis.buckets_per_unit;
            while (cell < last_cell && positions[cell + 1] <= start) ++cell;
            axis.first_cell.push_back(static_cast<std::uint32_t>(cell));
        }
        axis.first_cell.push_back(static_cast<std::uint32_t>(last_cell));
    }
    axis.positions = std::move(positions);
    return axis;
}

// The cell whose samples enclose a position within the axis: the last one that does not start above it.
std::size_t find_cell(const Axis& axis, double position) {
    const auto bucket = static_cast<std::size_t>((position - axis.positions.front()) * axis.buckets_per_unit);
    // One bucket more on either side: a position on a bucket's edge may be rounded into the neighbour.
    std::size_t cell = axis.first_cell[bucket > 0 ? bucket - 1 : 0];
    std::size_t last = axis.first_cell[std::min(bucket + 2, axis.first_cell.size() - 1)];
    while (cell < last) {
        const std::size_t middle = (cell + last + 1) / 2;
        if (axis.positions[middle] <= position) {
            cell = middle;
        } else {
            last = middle - 1;
        }
    }
    return cell;
}

Cell locate(const Axis& axis, double position) {
    if (axis.positions.size() < 2) return {};
    const double inside = std::clamp(position, axis.positions.front(), axis.positions.back());
    const std::size_t cell = find_cell(axis, inside);
    const double start = axis.positions[cell], length = axis.positions[cell + 1] - start;
    return {cell, cell + 1, (inside - start) / length};
}

// Written so that NaN is not valid.
bool is_valid(double contrast, double eccentricity_deg, double luminance_cdm2) {
    return contrast >= 0 && luminance_cdm2 >= 0 && !std::isnan(eccentricity_deg);
}

} // namespace

struct CsfTable::State {
    static Result<CsfTable> make_table(CsfSamples samples, Branches branches);

    Blend blend(double eccentricity_deg, double log2_luminance) const;
    template <std::size_t Count>
    void bisect(std::array<Query, Count>& queries) const;
    double log2_crossing(const Query& query) const;
    const std::vector<double>& surface() const;
    void prepare_monotone();
    void prepare_extrapolation();

    CsfSamples samples;
    Branches branches;
    Axis frequency, eccentricity, luminance;
    Axis monotone_eccentricity;       // the samples' eccentricities, and more of them where they lie far apart
    std::vector<float> log2_monotone; // [(e * luminances + l) * frequencies + f] over these
    double last_slope = 0; // octaves of sensitivity per octave of frequency above the last; negative, or 0: none falls
};

CsfTable::CsfTable(std::shared_ptr<const State> state) : state_(std::move(state)) {}

Result<CsfTable> CsfTable::create(CsfSamples samples) {
    auto table = State::make_table(std::move(samples), {});
    if (!table) return table;
    if (auto ok = check_decline(table->samples()); !ok) return ok.error();
    return table;
}

Result<CsfTable> CsfTable::State::make_table(CsfSamples samples, Branches branches) {
    const CsfSamples& s = samples;
    if (s.frequency_cpd.size() < 2) return bad("frequency_cpd needs two samples or more");
    if (s.eccentricity_deg.empty()) return bad("eccentricity_deg is empty");
    if (s.luminance_cdm2.empty()) return bad("luminance_cdm2 is empty");

    // The logarithm of a value that is not above 0 is not finite, which the check finds.
    std::vector<double> log2_frequency = log2_of(s.frequency_cpd), log2_luminance = log2_of(s.luminance_cdm2);
    if (auto ok = check_axis("frequency_cpd", s.frequency_cpd, log2_frequency, most_cpd); !ok) return ok.error();
    if (auto ok = check_axis("eccentricity_deg", s.eccentricity_deg, s.eccentricity_deg, most_degrees); !ok)
        return ok.error();
    if (auto ok = check_axis("luminance_cdm2", s.luminance_cdm2, log2_luminance, most_cdm2); !ok) return ok.error();
    constexpr double least_summation = 0.01, most_summation = 100; // far beyond how people differ
    if (!(s.summation >= least_summation && s.summation <= most_summation))
        return bad("summation must be from 0.01 to 100, but is " + number_text(s.summation));
    if (s.eccentricity_deg.front() != 0)
        return bad("eccentricity_deg[0] must be 0 (the fovea), but is " + number_text(s.eccentricity_deg.front()));

    const std::size_t columns = s.eccentricity_deg.size() * s.luminance_cdm2.size();
    const std::size_t frequencies = s.frequency_cpd.size();
    if (s.sensitivity.size() / frequencies != columns || s.sensitivity.size() % frequencies != 0)
        return bad("sensitivity has " + std::to_string(s.sensitivity.size()) + " values, but the axes ask for " +
                   std::to_string(s.eccentricity_deg.size()) + " x " + std::to_string(s.luminance_cdm2.size()) + " x " +
                   std::to_string(frequencies));
    for (std::size_t i = 0; i < s.sensitivity.size(); ++i) {
        if (!(s.sensitivity[i] > 0 && s.sensitivity[i] <= most_sensitive)) {
            const std::size_t column = i / frequencies, luminances = s.luminance_cdm2.size();
            return bad(indexed("sensitivity", {column / luminances, column % luminances, i % frequencies}) +
                       " must be above 0 and at most 1e6, but is " + number_text(s.sensitivity[i]));
        }
    }

    const auto table = std::make_shared<State>();
    table->frequency = make_axis(std::move(log2_frequency));
    table->eccentricity = make_axis(samples.eccentricity_deg);
    table->monotone_eccentricity = make_axis(refined(samples.eccentricity_deg));
    table->luminance = make_axis(std::move(log2_luminance));
    table->samples = std::move(samples);
    table->branches = std::move(branches);
    table->prepare_monotone();
    table->prepare_extrapolation();
    return CsfTable(table);
}

Result<CsfTable> CsfTable::from_model(CsfModel model, const Stimulus& conditions) {
    const auto stimulus = [&](double cpd, double degrees, double cdm2) {
        return stimulus_of(conditions, CyclesPerDegree(cpd), Degrees(degrees), Luminance(cdm2));
    };
    if (std::isnan(perception::sensitivity(model, stimulus(1, 0, 1))))
        return bad("temporal frequency and velocity must be finite and 0 or more, one of them 0, and the distance "
                   "above 0 m, but they are " +
                   number_text(conditions.temporal.value()) + " Hz, " + number_text(conditions.velocity.value()) +
                   " degrees/s and " + number_text(conditions.distance.value()) + " m");
    CsfSamples samples;
    samples.source = model_source(model, conditions);
    samples.frequency_cpd = model_frequencies(model, conditions);
    samples.eccentricity_deg = model_eccentricities(model);
    samples.luminance_cdm2 = model_luminances(model, conditions);

    Branches branches;
    if (model == CsfModel::daly) {
        fill_daly(samples, branches.sensitivity, branches.ceiling, stimulus);
    } else {
        fill(samples, model, conditions.field, stimulus);
    }
    return State::make_table(std::move(samples), std::move(branches));
}

CsfTable CsfTable::from_model(CsfModel model) {
    Result<CsfTable> table = from_model(model, {});
    assert(table && "a model's samples are valid");
    return *std::move(table);
}

Result<CsfTable> CsfTable::scaled(double gain) const {
    if (!(gain >= 1e-3 && gain <= 1e3)) return bad("the gain must be from 0.001 to 1000");
    CsfSamples samples = state_->samples;
    if (gain != 1) samples.source = number_text(gain) + " x " + samples.source;
    Branches branches = state_->branches;
    for (auto* values : {&samples.sensitivity, &branches.sensitivity, &branches.ceiling})
        for (double& s : *values) s *= gain;
    return State::make_table(std::move(samples), std::move(branches));
}

CsfTable CsfTable::of_half_waves() const {
    constexpr double steepest = -2; // octaves of sensitivity an octave: the share of a patch's area
    const auto table = std::make_shared<State>(*state_);
    const std::vector<double>& positions = table->frequency.positions;
    // A maximum over the same steps everywhere grows with what it is taken of, so the form stays monotone.
    for (std::size_t i = 1; i < table->log2_monotone.size(); ++i) {
        const std::size_t f = i % positions.size();
        if (f == 0) continue;
        const double fallen = table->log2_monotone[i - 1] + steepest * (positions[f] - positions[f - 1]);
        table->log2_monotone[i] = std::max(table->log2_monotone[i], static_cast<float>(fallen));
    }
    if (table->last_slope < 0) table->last_slope = std::max(table->last_slope, steepest);
    return CsfTable(table);
}

namespace {

// With samples between those that lie farther apart than moving tables may have, and down to the lowest frequency.
CsfSamples densely_sampled(const CsfTable& table) {
    constexpr double per_octave = smooth_model.per_octave;
    constexpr double wide_enough = 1.0 / 16; // octaves: models' tables stay as they are
    CsfSamples samples = table.samples();
    const std::vector<double> given = samples.frequency_cpd;
    std::vector<double> cpd;
    if (given.front() > lowest_frequency_cpd * std::exp2(wide_enough))
        append_ladder(cpd, lowest_frequency_cpd, given.front(), 2, per_octave);
    for (std::size_t f = 0; f + 1 < given.size(); ++f) {
        if (given[f + 1] > given[f] * std::exp2(wide_enough)) append_ladder(cpd, given[f], given[f + 1], 2, per_octave);
        else cpd.push_back(given[f]);
    }
    cpd.push_back(given.back());
    if (cpd == given) return samples;
    samples.frequency_cpd = std::move(cpd);
    samples.sensitivity.clear();
    for (const double degrees : samples.eccentricity_deg)
        for (const double cdm2 : samples.luminance_cdm2)
            for (const double frequency : samples.frequency_cpd)
                samples.sensitivity.push_back(
                    table.sensitivity(CyclesPerDegree(frequency), Degrees(degrees), Luminance(cdm2)));
    return samples;
}

} // namespace

Result<CsfTable> CsfTable::moving(DegreesPerSecond velocity) const {
    if (!(velocity.value() >= 0 && velocity <= fastest_velocity))
        return bad("the velocity on the retina must lie in 0 to " + number_text(fastest_velocity.value()) +
                   " degrees/s, but is " + number_text(velocity.value()));
    if (velocity <= least_velocity) return *this;
    Branches branches = state_->branches; // of a model's table, which is dense
    CsfSamples samples = branches.sensitivity.empty() ? densely_sampled(*this) : state_->samples;
    samples.source += "; moving at " + number_text(velocity.value()) + " degrees/s";
    std::vector<double> factors;
    for (const double cpd : samples.frequency_cpd) factors.push_back(velocity_factor(CyclesPerDegree(cpd), velocity));
    for (auto* values : {&samples.sensitivity, &branches.sensitivity, &branches.ceiling})
        for (std::size_t i = 0; i < values->size(); ++i)
            (*values)[i] = floored((*values)[i] * factors[i % factors.size()]);
    return State::make_table(std::move(samples), std::move(branches));
}

CsfTable CsfTable::widened(Degrees margin) const {
    assert(!(margin.value() < 0));
    if (margin.value() == 0) return *this;
    const CsfSamples& samples = state_->samples;
    const auto plane = static_cast<std::ptrdiff_t>(samples.luminance_cdm2.size() * samples.frequency_cpd.size());
    const double shift = std::max(margin.value(), smallest_spacing); // NaN stays
    CsfSamples wide{samples.source, samples.frequency_cpd, {0.0}, samples.luminance_cdm2, {}, samples.summation};
    wide.sensitivity.assign(samples.sensitivity.begin(), samples.sensitivity.begin() + plane);
    for (auto column = samples.sensitivity.begin(); const double e : samples.eccentricity_deg) {
        const double degrees = e + shift;
        // The sum's rounding can bring columns too near to each other.
        if (degrees <= highest_eccentricity.value() && degrees - wide.eccentricity_deg.back() >= smallest_spacing) {
            wide.eccentricity_deg.push_back(degrees);
            wide.sensitivity.insert(wide.sensitivity.end(), column, column + plane);
        } else {
            std::transform(column, column + plane, wide.sensitivity.end() - plane, wide.sensitivity.end() - plane,
                           [](double left_out, double last) { return std::max(left_out, last); });
        }
        column += plane;
    }
    auto made = State::make_table(std::move(wide), {}); // of a growing table, too
    assert(made); // the columns of a table, at eccentricities that a table can have
    return std::move(*made);
}

const CsfTable& CsfTable::standard() {
    static const CsfTable table = from_model(CsfModel::castle);
    return table;
}

Blend CsfTable::State::blend(double eccentricity_deg, double log2_luminance) const {
    const Cell e = locate(monotone_eccentricity, eccentricity_deg), l = locate(luminance, log2_luminance);
    const std::size_t frequencies = frequency.positions.size(), luminances = luminance.positions.size();
    const auto column = [&](std::size_t ei, std::size_t li) {
        return log2_monotone.data() + (ei * luminances + li) * frequencies;
    };
    return {{column(e.first, l.first), column(e.first, l.second), //
             column(e.second, l.first), column(e.second, l.second)},
            {(1 - e.fraction) * (1 - l.fraction), (1 - e.fraction) * l.fraction, e.fraction * (1 - l.fraction),
             e.fraction * l.fraction}};
}

// What interpolation works on.
const std::vector<double>& CsfTable::State::surface() const {
    return branches.sensitivity.empty() ? samples.sensitivity : branches.sensitivity;
}

// Running maxima along the three axes in turn. Each is the largest value over a set that only shrinks along the axes
// before it, so it leaves what they have reached. A ceiling is left out, which can only make the maxima larger.
void CsfTable::State::prepare_monotone() {
    const std::size_t frequencies = frequency.positions.size();
    const std::size_t plane = frequencies * luminance.positions.size();
    const std::vector<double> logs = log2_of(surface());
    log2_monotone.reserve(plane * monotone_eccentricity.positions.size());
    for (const double degrees : monotone_eccentricity.positions) {
        const Cell e = locate(eccentricity, degrees);
        const double *low = logs.data() + e.first * plane, *high = logs.data() + e.second * plane;
        for (std::size_t i = 0; i < plane; ++i)
            log2_monotone.push_back(static_cast<float>(std::lerp(low[i], high[i], e.fraction)));
    }
    std::vector<float>& v = log2_monotone;
    for (std::size_t row = 0; row < v.size(); row += frequencies)
        for (std::size_t f = frequencies - 1; f-- > 0;) v[row + f] = std::max(v[row + f], v[row + f + 1]);
    for (std::size_t i = v.size() - plane; i-- > 0;) v[i] = std::max(v[i], v[i + plane]);
    for (std::size_t first = 0; first < v.size(); first += plane)
        for (std::size_t i = first + frequencies; i < first + plane; ++i) v[i] = std::max(v[i], v[i - frequencies]);
}

// One slope for the whole table: a slope per column could make a frequency rise with eccentricity. The shallowest is
// the safe one.
void CsfTable::State::prepare_extrapolation() {
    const std::size_t frequencies = frequency.positions.size();
    double shallowest = -std::numeric_limits<double>::infinity();
    for (std::size_t start = 0; start < log2_monotone.size(); start += frequencies) {
        const float* column = log2_monotone.data() + start;
        std::size_t f = frequencies - 1;
        while (f > 0 && !(column[f - 1] > column[f])) --f;
        if (f == 0) continue;
        const double octaves = frequency.positions[f] - frequency.positions[f - 1];
        shallowest = std::max(shallowest, (double(column[f]) - double(column[f - 1])) / octaves);
    }
    last_slope = std::isfinite(shallowest) ? shallowest : 0;
}

const CsfSamples& CsfTable::samples() const noexcept { return state_->samples; }

std::string beyond_reach(const CsfTable& table, Degrees farthest, Luminance darkest, Luminance brightest) {
    const CsfSamples& samples = table.samples();
    const double last_degrees = samples.eccentricity_deg.back(), lowest_cdm2 = samples.luminance_cdm2.front(),
                 highest_cdm2 = samples.luminance_cdm2.back();
    std::string text;
    const auto add = [&](bool is_inside, const char* beyond, double end, const char* unit, const char* and_so) {
        if (is_inside) return; // NaN is not
        text += (text.empty() ? "" : "; ") + std::string(beyond) + " the table's " + number_text(end) + " " + unit +
                " sensitivity is taken as there" + and_so;
    };
    add(farthest.value() <= last_degrees, "beyond", last_degrees, "degrees", "");
    add(darkest.value() >= lowest_cdm2, "below", lowest_cdm2, "cd/m2", "");
    add(brightest.value() <= highest_cdm2, "above", highest_cdm2, "cd/m2", ", though eyes may see more");
    return text;
}

double CsfTable::sensitivity(CyclesPerDegree frequency, Degrees eccentricity, Luminance luminance) const {
    const double log2_cpd = std::log2(frequency.value()), log2_cdm2 = std::log2(luminance.value());
    if (std::isnan(log2_cpd) || std::isnan(log2_cdm2) || std::isnan(eccentricity.value())) return nan;
    const Cell f = locate(state_->frequency, log2_cpd), e = locate(state_->eccentricity, eccentricity.value());
    const Cell l = locate(state_->luminance, log2_cdm2);
    const std::size_t frequencies = state_->frequency.positions.size(), luminances = state_->luminance.positions.size();
    const auto along_frequency = [&](const std::vector<double>& values, std::size_t ei, std::size_t li) {
        const double* column = values.data() + (ei * luminances + li) * frequencies;
        return std::lerp(std::log2(column[f.first]), std::log2(column[f.second]), f.fraction);
    };
    const auto along_luminance = [&](const std::vector<double>& values, std::size_t ei) {
        return std::lerp(along_frequency(values, ei, l.first), along_frequency(values, ei, l.second), l.fraction);
    };
    const double log2_s = std::lerp(along_luminance(state_->surface(), e.first),
                                    along_luminance(state_->surface(), e.second), e.fraction);
    if (state_->branches.ceiling.empty()) return std::exp2(log2_s);
    return std::exp2(std::min(log2_s, along_luminance(state_->branches.ceiling, 0)));
}

double CsfTable::monotone_sensitivity(CyclesPerDegree frequency, Degrees eccentricity, Luminance luminance) const {
    const double log2_cpd = std::log2(frequency.value()), log2_cdm2 = std::log2(luminance.value());
    if (std::isnan(log2_cpd) || std::isnan(log2_cdm2) || std::isnan(eccentricity.value())) return nan;
    const Blend column = state_->blend(eccentricity.value(), log2_cdm2);
    const double beyond = log2_cpd - state_->frequency.positions.back();
    if (beyond > 0 && state_->last_slope < 0)
        return std::exp2(column[state_->frequency.positions.size() - 1] + state_->last_slope * beyond);
    const Cell f = locate(state_->frequency, log2_cpd);
    return std::exp2(std::lerp(column[f.first], column[f.second], f.fraction));
}

double CsfTable::peak_sensitivity(Degrees eccentricity, Luminance luminance) const {
    return monotone_sensitivity(CyclesPerDegree(0), eccentricity, luminance);
}

// Bisection for the last sample that still reaches each query's threshold, all queries in step: the loads of one hide
// behind those of the others, and no branch depends on the data.
template <std::size_t Count>
void CsfTable::State::bisect(std::array<Query, Count>& queries) const {
    for (std::size_t count = frequency.positions.size(); count > 1;) {
        const std::size_t half = count / 2;
        for (Query& q : queries) q.sample += q.column[q.sample + half] >= q.log2_threshold ? half : 0;
        count -= half;
    }
}

double CsfTable::State::log2_crossing(const Query& q) const {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    const double value = q.column[q.sample], position = frequency.positions[q.sample];
    if (!(value >= q.log2_threshold)) return -infinity; // only at the first sample: not even the peak
    const double excess = value - q.log2_threshold;
    if (q.sample + 1 == frequency.positions.size()) {
        if (excess == 0) return position;
        return last_slope < 0 ? position - excess / last_slope : infinity;
    }
    // On a plateau, where only rounding tells two samples apart, its highest frequency.
    const double drop = value - q.column[q.sample + 1];
    const double share = drop > excess ? excess / drop : 1;
    return position + share * (frequency.positions[q.sample + 1] - position);
}

CyclesPerDegree CsfTable::highest_visible_frequency(double contrast, Degrees eccentricity, Luminance luminance) const {
    if (!is_valid(contrast, eccentricity.value(), luminance.value()))
        return CyclesPerDegree(std::numeric_limits<double>::infinity());
    std::array<Query, 1> query{
        {{state_->blend(eccentricity.value(), std::log2(luminance.value())), -std::log2(contrast), 0}}};
    state_->bisect(query);
    return CyclesPerDegree(std::exp2(state_->log2_crossing(query[0])));
}

void CsfTable::highest_visible_log2_frequency(std::span<const float> contrast, std::span<const float> eccentricity_deg,
                                              std::span<const float> luminance_cdm2,
                                              std::span<float> log2_frequency) const {
    assert(contrast.size() == eccentricity_deg.size() && contrast.size() == luminance_cdm2.size() &&
           contrast.size() == log2_frequency.size());
    const State& state = *state_;
    std::array<Query, queries_in_step> queries;
    for (std::size_t begin = 0; begin < log2_frequency.size(); begin += queries_in_step) {
        const std::size_t count = std::min(queries_in_step, log2_frequency.size() - begin);
        for (std::size_t j = 0; j < queries_in_step; ++j) {
            // A short last block repeats its last query.
            const std::size_t i = begin + std::min(j, count - 1);
            const double c = contrast[i], e = eccentricity_deg[i], l = luminance_cdm2[i];
            queries[j] = is_valid(c, e, l) ? Query{state.blend(e, std::log2(l)), -std::log2(c), 0}
                                           : Query{state.blend(0, 0), 0, 0};
        }
        state.bisect(queries);
        for (std::size_t i = begin; i < begin + count; ++i)
            log2_frequency[i] = is_valid(contrast[i], eccentricity_deg[i], luminance_cdm2[i])
                                    ? static_cast<float>(state.log2_crossing(queries[i - begin]))
                                    : std::numeric_limits<float>::infinity();
    }
}

} // namespace unseen::perception
