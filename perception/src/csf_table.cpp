// The contrast sensitivity table: filled from a model or from samples, interpolated in log space, made monotone for
// the fold test, and inverted.
#include <algorithm>
#include <array>
#include <cassert>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <limits>

#include <perception/csf.h>

#include "csf_model.h"

namespace unseen::perception {

namespace {

// Neighbouring samples closer than this (octaves, or degrees) are no measurement but a slip, and would make the slope
// between them meaningless in float.
constexpr double smallest_spacing = 1e-4;
// Buckets of the constant-time search per sample of an axis: enough for one sample or none per bucket on the usual
// axes, although they are denser near the fovea.
constexpr std::size_t buckets_per_sample = 16;

// Queries of a batch that are answered together.
constexpr std::size_t queries_in_step = 8;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// Sensitivities below this are equally invisible; it keeps their logarithm finite.
constexpr double sensitivity_floor = 1e-300;

constexpr double lowest_frequency_cpd = 1.0 / 16, highest_frequency_cpd = 64;
// With the interpolation error growing as the step squared, 16 per octave keep it below 0.5% at the model's kinks.
constexpr int samples_per_octave = 16;
constexpr double lowest_luminance_cdm2 = 1e-3;
constexpr int luminance_decades = 7, samples_per_decade = 8;

std::string number(double value) {
    std::array<char, 32> text;
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
    return std::string(text.data(), end);
}

Error bad(std::string message) {
    return Error{ErrorCode::invalid_argument, "contrast sensitivity table: " + std::move(message)};
}

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

// `positions` are the values as interpolation sees them: their logarithms, or themselves.
Result<void> check_axis(std::string_view field, std::span<const double> values, std::span<const double> positions) {
    for (std::size_t i = 0; i < values.size(); ++i) {
        const std::string place = indexed(field, {i});
        if (!std::isfinite(values[i]) || !std::isfinite(positions[i])) {
            return bad(place + " must be a finite number in its range, but is " + number(values[i]));
        }
        if (i > 0 && !(positions[i] - positions[i - 1] >= smallest_spacing)) {
            return bad(place + " is " + number(values[i]) + " after " + number(values[i - 1]) +
                       ": the values must rise from sample to sample, by at least " + number(smallest_spacing) +
                       (values.data() == positions.data() ? " degrees" : " octaves"));
        }
    }
    return {};
}

// The frequencies of a model's table, with a sample at the kink, so that no cell straddles it.
std::vector<double> model_frequencies(double kink_cpd) {
    const auto steps_to = [&](double cpd) { return std::log2(cpd / kink_cpd) * samples_per_octave; };
    const int first = static_cast<int>(std::ceil(steps_to(lowest_frequency_cpd)));
    const int last = static_cast<int>(std::floor(steps_to(highest_frequency_cpd)));
    std::vector<double> cpd{lowest_frequency_cpd};
    for (int step = first; step <= last; ++step) {
        const double frequency = kink_cpd * std::exp2(double(step) / samples_per_octave);
        const bool too_close = frequency < 1.01 * lowest_frequency_cpd || frequency > 0.99 * highest_frequency_cpd;
        if (!too_close) cpd.push_back(frequency);
    }
    cpd.push_back(highest_frequency_cpd);
    return cpd;
}

// The logarithm of a model's sensitivity is linear in eccentricity, but its peak over frequency is not, and that bends
// most near the fovea.
std::vector<double> model_eccentricities() {
    std::vector<double> degrees;
    const auto append = [&](int until, int step) {
        for (int e = degrees.empty() ? 0 : static_cast<int>(degrees.back()) + step; e <= until; e += step) {
            degrees.push_back(e);
        }
    };
    append(10, 1);
    append(20, 2);
    append(60, 5);
    append(120, 10);
    return degrees;
}

std::vector<double> model_luminances() {
    std::vector<double> cdm2;
    for (int i = 0; i <= luminance_decades * samples_per_decade; ++i) {
        cdm2.push_back(lowest_luminance_cdm2 * std::pow(10.0, double(i) / samples_per_decade));
    }
    return cdm2;
}

std::string model_source(CsfModel model) {
    return std::string(name(model)) +
           ", closed form; 0 Hz, area pi (1.5 / frequency)^2, worse of nasal and temporal field";
}

// Written so that NaN is not valid.
bool is_valid(double contrast, double eccentricity_deg, double luminance_cdm2) {
    return contrast >= 0 && luminance_cdm2 >= 0 && !std::isnan(eccentricity_deg);
}

} // namespace

Result<CsfTable> CsfTable::create(CsfSamples samples) {
    const CsfSamples& s = samples;
    if (s.frequency_cpd.size() < 2) return bad("frequency_cpd needs two samples or more");
    if (s.eccentricity_deg.empty()) return bad("eccentricity_deg is empty");
    if (s.luminance_cdm2.empty()) return bad("luminance_cdm2 is empty");

    // The logarithm of a value that is not above 0 is not finite, which the check finds.
    std::vector<double> log2_frequency = log2_of(s.frequency_cpd), log2_luminance = log2_of(s.luminance_cdm2);
    if (auto ok = check_axis("frequency_cpd", s.frequency_cpd, log2_frequency); !ok) return ok.error();
    if (auto ok = check_axis("eccentricity_deg", s.eccentricity_deg, s.eccentricity_deg); !ok) return ok.error();
    if (auto ok = check_axis("luminance_cdm2", s.luminance_cdm2, log2_luminance); !ok) return ok.error();
    if (s.eccentricity_deg.front() != 0) {
        return bad("eccentricity_deg[0] must be 0 (the fovea), but is " + number(s.eccentricity_deg.front()));
    }

    const std::size_t columns = s.eccentricity_deg.size() * s.luminance_cdm2.size();
    const std::size_t frequencies = s.frequency_cpd.size();
    if (s.sensitivity.size() / frequencies != columns || s.sensitivity.size() % frequencies != 0) {
        return bad("sensitivity has " + std::to_string(s.sensitivity.size()) + " values, but the axes ask for " +
                   std::to_string(s.eccentricity_deg.size()) + " x " + std::to_string(s.luminance_cdm2.size()) + " x " +
                   std::to_string(frequencies));
    }
    for (std::size_t i = 0; i < s.sensitivity.size(); ++i) {
        if (!(s.sensitivity[i] > 0 && std::isfinite(s.sensitivity[i]))) {
            const std::size_t column = i / frequencies, luminances = s.luminance_cdm2.size();
            return bad(indexed("sensitivity", {column / luminances, column % luminances, i % frequencies}) +
                       " must be finite and above 0, but is " + number(s.sensitivity[i]));
        }
    }

    CsfTable table;
    table.frequency_ = make_axis(std::move(log2_frequency));
    table.eccentricity_ = make_axis(samples.eccentricity_deg);
    table.luminance_ = make_axis(std::move(log2_luminance));
    table.samples_ = std::move(samples);
    table.prepare_monotone();
    table.prepare_extrapolation();
    return table;
}

CsfTable CsfTable::from_model(CsfModel model) {
    CsfSamples samples;
    samples.source = model_source(model);
    samples.frequency_cpd = model_frequencies(equal_decay_frequency(model).value());
    samples.eccentricity_deg = model_eccentricities();
    samples.luminance_cdm2 = model_luminances();

    // The model is a product of a foveal part and of one that only depends on frequency and eccentricity.
    std::vector<double> foveal, log10_loss;
    for (const double cdm2 : samples.luminance_cdm2) {
        for (const double cpd : samples.frequency_cpd) {
            foveal.push_back(perception::sensitivity(model, {.frequency = CyclesPerDegree(cpd),
                                                             .luminance = Luminance(cdm2),
                                                             .area = patch_area(CyclesPerDegree(cpd))}));
        }
    }
    for (const double cpd : samples.frequency_cpd) {
        log10_loss.push_back(decay_per_degree(model, CyclesPerDegree(cpd), VisualField::worst));
    }
    samples.sensitivity.reserve(samples.eccentricity_deg.size() * foveal.size());
    std::vector<double> remaining(log10_loss.size());
    for (const double degrees : samples.eccentricity_deg) {
        std::ranges::transform(log10_loss, remaining.begin(),
                               [&](double loss) { return std::pow(10.0, -loss * degrees); });
        for (std::size_t i = 0; i < foveal.size(); ++i) {
            samples.sensitivity.push_back(std::max(foveal[i] * remaining[i % remaining.size()], sensitivity_floor));
        }
    }
    Result<CsfTable> table = create(std::move(samples));
    assert(table && "a model's samples are valid");
    return *std::move(table);
}

const CsfTable& CsfTable::standard() {
    static const CsfTable table = from_model(CsfModel::castle);
    return table;
}

CsfTable::Axis CsfTable::make_axis(std::vector<double> positions) {
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
std::size_t CsfTable::find_cell(const Axis& axis, double position) {
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

CsfTable::Cell CsfTable::locate(const Axis& axis, double position) {
    if (axis.positions.size() < 2) return {};
    const double inside = std::clamp(position, axis.positions.front(), axis.positions.back());
    const std::size_t cell = find_cell(axis, inside);
    const double start = axis.positions[cell], length = axis.positions[cell + 1] - start;
    return {cell, cell + 1, (inside - start) / length};
}

CsfTable::Blend CsfTable::blend(double eccentricity_deg, double log2_luminance) const {
    const Cell e = locate(eccentricity_, eccentricity_deg), l = locate(luminance_, log2_luminance);
    const std::size_t frequencies = frequency_.positions.size(), luminances = luminance_.positions.size();
    const auto column = [&](std::size_t ei, std::size_t li) {
        return log2_monotone_.data() + (ei * luminances + li) * frequencies;
    };
    return {{column(e.first, l.first), column(e.first, l.second), //
             column(e.second, l.first), column(e.second, l.second)},
            {(1 - e.fraction) * (1 - l.fraction), (1 - e.fraction) * l.fraction, e.fraction * (1 - l.fraction),
             e.fraction * l.fraction}};
}

// Running maxima along the three axes in turn. Each is the largest value over a set that only shrinks along the axes
// before it, so it leaves what they have reached.
void CsfTable::prepare_monotone() {
    const std::size_t frequencies = frequency_.positions.size();
    const std::size_t plane = frequencies * luminance_.positions.size();
    log2_monotone_.resize(samples_.sensitivity.size());
    std::ranges::transform(samples_.sensitivity, log2_monotone_.begin(),
                           [](double s) { return static_cast<float>(std::log2(s)); });
    std::vector<float>& v = log2_monotone_;
    for (std::size_t i = v.size() - 1; i-- > 0;) {
        if ((i + 1) % frequencies != 0) v[i] = std::max(v[i], v[i + 1]);
    }
    for (std::size_t i = v.size() - plane; i-- > 0;) v[i] = std::max(v[i], v[i + plane]);
    for (std::size_t i = frequencies; i < v.size(); ++i) {
        if (i % plane >= frequencies) v[i] = std::max(v[i], v[i - frequencies]);
    }
}

// One slope for the whole table: a slope per column could make a frequency rise with eccentricity. The shallowest is
// the safe one.
void CsfTable::prepare_extrapolation() {
    const std::size_t frequencies = frequency_.positions.size();
    double shallowest = -std::numeric_limits<double>::infinity();
    for (std::size_t start = 0; start < log2_monotone_.size(); start += frequencies) {
        const float* column = log2_monotone_.data() + start;
        std::size_t f = frequencies - 1;
        while (f > 0 && !(column[f - 1] > column[f])) --f;
        if (f == 0) continue;
        const double octaves = frequency_.positions[f] - frequency_.positions[f - 1];
        shallowest = std::max(shallowest, (double(column[f]) - double(column[f - 1])) / octaves);
    }
    last_slope_ = std::isfinite(shallowest) ? shallowest : 0;
}

double CsfTable::sensitivity(CyclesPerDegree frequency, Degrees eccentricity, Luminance luminance) const {
    const double log2_cpd = std::log2(frequency.value()), log2_cdm2 = std::log2(luminance.value());
    if (std::isnan(log2_cpd) || std::isnan(log2_cdm2) || std::isnan(eccentricity.value())) return nan;
    const Cell f = locate(frequency_, log2_cpd), e = locate(eccentricity_, eccentricity.value());
    const Cell l = locate(luminance_, log2_cdm2);
    const std::size_t frequencies = frequency_.positions.size(), luminances = luminance_.positions.size();
    const auto along_frequency = [&](std::size_t ei, std::size_t li) {
        const double* column = samples_.sensitivity.data() + (ei * luminances + li) * frequencies;
        return std::lerp(std::log2(column[f.first]), std::log2(column[f.second]), f.fraction);
    };
    const auto along_luminance = [&](std::size_t ei) {
        return std::lerp(along_frequency(ei, l.first), along_frequency(ei, l.second), l.fraction);
    };
    return std::exp2(std::lerp(along_luminance(e.first), along_luminance(e.second), e.fraction));
}

double CsfTable::monotone_sensitivity(CyclesPerDegree frequency, Degrees eccentricity, Luminance luminance) const {
    const double log2_cpd = std::log2(frequency.value()), log2_cdm2 = std::log2(luminance.value());
    if (std::isnan(log2_cpd) || std::isnan(log2_cdm2) || std::isnan(eccentricity.value())) return nan;
    const Blend column = blend(eccentricity.value(), log2_cdm2);
    const double beyond = log2_cpd - frequency_.positions.back();
    if (beyond > 0 && last_slope_ < 0) {
        return std::exp2(column[frequency_.positions.size() - 1] + last_slope_ * beyond);
    }
    const Cell f = locate(frequency_, log2_cpd);
    return std::exp2(std::lerp(column[f.first], column[f.second], f.fraction));
}

double CsfTable::peak_sensitivity(Degrees eccentricity, Luminance luminance) const {
    return monotone_sensitivity(CyclesPerDegree(0), eccentricity, luminance);
}

// Bisection for the last sample that still reaches each query's threshold, all queries in step: the loads of one hide
// behind those of the others, and no branch depends on the data.
template <std::size_t Count>
void CsfTable::bisect(std::array<Query, Count>& queries) const {
    for (std::size_t count = frequency_.positions.size(); count > 1;) {
        const std::size_t half = count / 2;
        for (Query& q : queries) q.sample += q.column[q.sample + half] >= q.log2_threshold ? half : 0;
        count -= half;
    }
}

double CsfTable::log2_crossing(const Query& q) const {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    const double value = q.column[q.sample], position = frequency_.positions[q.sample];
    if (!(value >= q.log2_threshold)) return -infinity; // only at the first sample: not even the peak
    const double excess = value - q.log2_threshold;
    if (q.sample + 1 == frequency_.positions.size()) {
        if (excess == 0) return position;
        return last_slope_ < 0 ? position - excess / last_slope_ : infinity;
    }
    // On a plateau, where only rounding tells two samples apart, its highest frequency.
    const double drop = value - q.column[q.sample + 1];
    const double share = drop > excess ? excess / drop : 1;
    return position + share * (frequency_.positions[q.sample + 1] - position);
}

CyclesPerDegree CsfTable::highest_visible_frequency(double contrast, Degrees eccentricity, Luminance luminance) const {
    if (!is_valid(contrast, eccentricity.value(), luminance.value())) {
        return CyclesPerDegree(std::numeric_limits<double>::infinity());
    }
    std::array<Query, 1> query{{{blend(eccentricity.value(), std::log2(luminance.value())), -std::log2(contrast), 0}}};
    bisect(query);
    return CyclesPerDegree(std::exp2(log2_crossing(query[0])));
}

void CsfTable::highest_visible_log2_frequency(std::span<const float> contrast, std::span<const float> eccentricity_deg,
                                              std::span<const float> luminance_cdm2,
                                              std::span<float> log2_frequency) const {
    assert(contrast.size() == eccentricity_deg.size() && contrast.size() == luminance_cdm2.size() &&
           contrast.size() == log2_frequency.size());
    std::array<Query, queries_in_step> queries;
    for (std::size_t begin = 0; begin < log2_frequency.size(); begin += queries_in_step) {
        const std::size_t count = std::min(queries_in_step, log2_frequency.size() - begin);
        for (std::size_t j = 0; j < queries_in_step; ++j) {
            // A short last block repeats its last query.
            const std::size_t i = begin + std::min(j, count - 1);
            const double c = contrast[i], e = eccentricity_deg[i], l = luminance_cdm2[i];
            queries[j] = is_valid(c, e, l) ? Query{blend(e, std::log2(l)), -std::log2(c), 0} : Query{blend(0, 0), 0, 0};
        }
        bisect(queries);
        for (std::size_t i = begin; i < begin + count; ++i) {
            log2_frequency[i] = is_valid(contrast[i], eccentricity_deg[i], luminance_cdm2[i])
                                    ? static_cast<float>(log2_crossing(queries[i - begin]))
                                    : std::numeric_limits<float>::infinity();
        }
    }
}

} // namespace unseen::perception
