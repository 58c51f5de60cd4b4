#include <unseen/calibration/internal/people.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <unseen/vdtree/internal/csv.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/number_text.h>

namespace unseen::calibration {
namespace {

using perception::Stimulus;

enum Column { dataset, frequency, temporal, eccentricity, luminance, area, sensitivity, column_count };
constexpr std::array<std::string_view, column_count> column_names = {
    "dataset", "frequency_cpd", "temporal_hz", "eccentricity_deg", "luminance_cdm2", "area_deg2", "sensitivity"};

// The weight of each sensitivity: all studies count alike.
std::vector<double> weights_of(std::span<const MeasuredSensitivity> people) {
    std::map<std::string_view, int> counts;
    for (const MeasuredSensitivity& m : people) ++counts[m.study];
    std::vector<double> weights;
    for (const MeasuredSensitivity& m : people)
        weights.push_back(1.0 / counts[m.study] / static_cast<double>(counts.size()));
    return weights;
}

// Descending decibels over the model, with their weights.
struct Weighted {
    double decibels, weight;
};
std::vector<Weighted> compared(std::span<const MeasuredSensitivity> people, const Model& model) {
    const std::vector<double> weights = weights_of(people);
    std::vector<Weighted> all;
    for (std::size_t i = 0; i < people.size(); ++i)
        all.push_back({20 * std::log10(people[i].sensitivity / model(people[i].stimulus)), weights[i]});
    std::sort(all.begin(), all.end(), [](const Weighted& a, const Weighted& b) { return a.decibels > b.decibels; });
    return all;
}

// The decibels above which the share lies.
double quantile(std::span<const Weighted> all, double share_above) {
    double above = 0;
    for (const auto& [decibels, weight] : all)
        if ((above += weight) >= share_above) return decibels;
    return all.empty() ? 0 : all.back().decibels;
}

} // namespace

Result<std::vector<MeasuredSensitivity>> parse_sensitivities(std::string_view text, const std::string& name) {
    std::vector<MeasuredSensitivity> all;
    std::array<std::size_t, column_count> columns{};
    bool has_header = false;
    constexpr std::size_t most_fields = 1000;
    const auto records = parse_csv(text, name, most_fields);
    if (!records) return records.error();
    for (const auto& [number, fields] : *records) {
        if (fields.front().starts_with('#')) continue;
        const std::string where = name + ":" + std::to_string(number) + ": ";
        if (!has_header) {
            for (std::size_t c = 0; c < column_count; ++c) {
                const auto found = std::find(fields.begin(), fields.end(), column_names[c]);
                if (found == fields.end())
                    return invalid_argument(where + "there is no column " + std::string(column_names[c]) + ".");
                if (std::find(found + 1, fields.end(), column_names[c]) != fields.end())
                    return invalid_argument(where + "the column " + std::string(column_names[c]) +
                                            " is there twice: remove or rename one of them.");
                columns[c] = static_cast<std::size_t>(found - fields.begin());
            }
            has_header = true;
            continue;
        }
        std::array<double, column_count> values{};
        for (std::size_t c = dataset; c < column_count; ++c) {
            if (columns[c] >= fields.size())
                return invalid_argument(where + "there are only " + std::to_string(fields.size()) + " fields.");
            if (c == dataset) continue;
            const std::string_view field = trimmed(fields[columns[c]]);
            const auto value = finite_from(field);
            const bool may_be_zero = c == temporal || c == eccentricity;
            if (!value || !(may_be_zero ? *value >= 0 : *value > 0))
                return invalid_argument(where + std::string(column_names[c]) + " must be a number " +
                                        (may_be_zero ? "of 0 or more" : "above 0") + ", but is '" + std::string(field) +
                                        "'.");
            values[c] = *value;
        }
        Stimulus stimulus;
        stimulus.frequency = perception::CyclesPerDegree(values[frequency]);
        stimulus.temporal = perception::Hertz(values[temporal]);
        stimulus.eccentricity = perception::Degrees(values[eccentricity]);
        stimulus.luminance = perception::Luminance(values[luminance]);
        stimulus.area = perception::SquareDegrees(values[area]);
        stimulus.field = perception::VisualField::worst;
        all.push_back({fields[columns[dataset]], stimulus, values[sensitivity]});
    }
    if (!has_header) return invalid_argument(name + ": there is no line with the columns' names.");
    return all;
}

Result<std::vector<MeasuredSensitivity>> read_sensitivities(const std::filesystem::path& file) {
    const auto text = read_text_file(file);
    if (!text) return text.error();
    return parse_sensitivities(*text, file.string());
}

std::vector<MeasuredSensitivity> within_domain(std::span<const MeasuredSensitivity> all) {
    std::vector<MeasuredSensitivity> inside;
    std::copy_if(all.begin(), all.end(), std::back_inserter(inside), [](const MeasuredSensitivity& m) {
        const Stimulus& s = m.stimulus;
        return s.eccentricity.value() <= 30 && s.area.value() <= 100 && s.luminance.value() >= 1 &&
               s.luminance.value() <= 500 && s.temporal.value() <= 1; // slower than 1 Hz counts as still
    });
    return inside;
}

Comparison compare(std::span<const MeasuredSensitivity> people, const Model& model) {
    const std::vector<Weighted> all = compared(people, model);
    Comparison c;
    c.count = all.size();
    if (all.empty()) return c;
    c.median_db = quantile(all, 0.5);
    double mean = 0, squares = 0;
    for (const auto& [decibels, weight] : all) {
        if (decibels > 0) c.share_above += weight;
        mean += weight * decibels;
    }
    for (const auto& [decibels, weight] : all) squares += weight * (decibels - mean) * (decibels - mean);
    c.deviation_db = std::sqrt(squares);
    return c;
}

double gain_for_share(std::span<const MeasuredSensitivity> people, const Model& model, double share_above) {
    return std::pow(10.0, quantile(compared(people, model), share_above) / 20);
}

namespace {

// What the fit goes by of one threshold.
struct AtFovea {
    Stimulus stimulus;
    double decibels = 0; // of the sensitivity, had it been measured at the fovea
    double weight = 0;
};

std::vector<AtFovea> at_fovea(std::span<const MeasuredSensitivity> people) {
    constexpr auto castle = perception::CsfModel::castle;
    const std::vector<double> weights = weights_of(people);
    std::vector<AtFovea> all;
    for (std::size_t i = 0; i < people.size(); ++i) {
        Stimulus still = people[i].stimulus;
        still.temporal = perception::Hertz(0);
        Stimulus foveal = still;
        foveal.eccentricity = perception::Degrees(0);
        const double fall = perception::sensitivity(castle, still) / perception::sensitivity(castle, foveal);
        all.push_back({foveal, 20 * std::log10(people[i].sensitivity / fall), weights[i]});
    }
    return all;
}

double squares_of(std::span<const AtFovea> all, const perception::BartenConstants& constants) {
    double sum = 0;
    for (const AtFovea& one : all) {
        const Stimulus& s = one.stimulus;
        const double error =
            one.decibels - 20 * std::log10(perception::barten_sensitivity(constants, s.frequency, s.luminance, s.area,
                                                                          perception::barten_fitted_field));
        sum += one.weight * error * error;
    }
    return sum;
}

} // namespace

perception::BartenConstants fit_barten(std::span<const MeasuredSensitivity> people) {
    constexpr double first_step = 0.3, last_step = 1e-4, shorter = 0.6; // of a constant's logarithm
    const std::vector<AtFovea> all = at_fovea(people);
    std::array<double, 4> log_factor{}, step;
    step.fill(first_step);
    const auto constants = [&](const std::array<double, 4>& logs) {
        perception::BartenConstants c;
        c.signal_to_noise *= std::exp(logs[0]);
        c.line_spread = perception::Degrees(c.line_spread.value() * std::exp(logs[1]));
        c.inhibition = perception::CyclesPerDegree(c.inhibition.value() * std::exp(logs[2]));
        c.greatest_cycles *= std::exp(logs[3]);
        return c;
    };
    double best = squares_of(all, constants(log_factor));
    while (*std::max_element(step.begin(), step.end()) > last_step) {
        for (std::size_t i = 0; i < step.size(); ++i) {
            bool is_better = false;
            for (const double move : {step[i], -step[i]}) {
                std::array<double, 4> tried = log_factor;
                tried[i] += move;
                const double squares = squares_of(all, constants(tried));
                if (!(squares < best)) continue;
                best = squares, log_factor = tried, is_better = true;
                break;
            }
            if (!is_better) step[i] *= shorter;
        }
    }
    return constants(log_factor);
}

} // namespace unseen::calibration
