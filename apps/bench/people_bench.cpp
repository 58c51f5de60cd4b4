#include "people_bench.h"

#include <algorithm>
#include <functional>
#include <optional>

#include <unseen/calibration/internal/people.h>
#include <unseen/perception/csf.h>

#include "terminal.h"

namespace unseen::app {
namespace {

using calibration::MeasuredSensitivity;
using perception::CsfModel;
using perception::Stimulus;
using People = std::vector<MeasuredSensitivity>;

struct Model {
    std::string name;
    std::function<double(const Stimulus&)> sensitivity;
};

// At the stimulus's true size. Only castleCSF's family has a law of slow flicker; it counts as standing still elsewhere.
Model model(CsfModel which) {
    return {std::string(name(which)), [which](Stimulus s) {
                if (which != CsfModel::castle && which != CsfModel::stela) s.temporal = perception::Hertz(0);
                return perception::sensitivity(which, s);
            }};
}

std::vector<Model> models() {
    const auto castle = model(CsfModel::castle).sensitivity;
    std::vector<Model> all = {{"castle, for patches of 1.5 cycles whatever the size", [castle](Stimulus s) {
                                   s.area = perception::patch_area(s.frequency);
                                   return castle(s);
                               }}};
    for (const perception::Person& person : perception::people)
        all.push_back({"castle times " + rounded(person.gain, 3) + ": observer " + std::string(person.name),
                       [castle, gain = person.gain](const Stimulus& s) { return gain * castle(s); }});
    for (const perception::Person& person : perception::people)
        all.push_back(
            {"barten-fitted times " + rounded(person.barten_gain, 4) + ": second judge, " + std::string(person.name),
             [barten = model(CsfModel::barten_fitted).sensitivity, gain = person.barten_gain](const Stimulus& s) {
                 return gain * barten(s);
             }});
    for (const CsfModel other : {CsfModel::barten_1999, CsfModel::stela, CsfModel::daly}) all.push_back(model(other));
    return all;
}

// A part of the thresholds.
struct Part {
    std::string name;
    std::function<bool(const MeasuredSensitivity&)> holds;
};

void add_ranges(std::vector<Part>& parts, const std::string& unit, const std::vector<double>& bounds,
                double (*value)(const Stimulus&)) {
    for (std::size_t i = 0; i + 1 < bounds.size(); ++i) {
        const double from = bounds[i], to = bounds[i + 1];
        parts.push_back({rounded(from, 3) + " to " + rounded(to, 3) + " " + unit, [=](const MeasuredSensitivity& m) {
                             const double v = value(m.stimulus);
                             return v >= from && v < to;
                         }});
    }
}

std::vector<Part> parts_of(const People& people) {
    std::vector<Part> parts;
    add_ranges(parts, "cpd", {0.1, 0.5, 1, 2, 4, 8, 16, 64}, [](const Stimulus& s) { return s.frequency.value(); });
    add_ranges(parts, "square cycles", {0, 2, 8, 30, 120, 500, 1e5},
               [](const Stimulus& s) { return s.area.value() * s.frequency.value() * s.frequency.value(); });
    add_ranges(parts, "degrees aside", {0, 0.01, 5, 15, 31}, [](const Stimulus& s) { return s.eccentricity.value(); });
    std::vector<std::string> studies;
    for (const MeasuredSensitivity& m : people)
        if (std::find(studies.begin(), studies.end(), m.study) == studies.end()) studies.push_back(m.study);
    for (const std::string& study : studies)
        parts.push_back({study, [study](const MeasuredSensitivity& m) { return m.study == study; }});
    return parts;
}

BenchTable table_of_models(const People& people, Json& rows) {
    BenchTable table{
        "Models and observers against " + std::to_string(people.size()) +
            " sensitivities of people: still gratings, to 30 degrees aside, of up to 100 square degrees, 1 "
            "to 500 cd/m2; each study counts alike",
        {{"model", "people above it", "median, dB", "standard deviation, dB"}}};
    for (const Model& m : models()) {
        const auto c = calibration::compare(people, m.sensitivity);
        table.rows.push_back({m.name, rounded(100 * c.share_above, 3) + "%", with_decimals(c.median_db, 1),
                              with_decimals(c.deviation_db, 1)});
        rows.push_back({{"model", m.name},
                        {"share_above", c.share_above},
                        {"median_db", c.median_db},
                        {"deviation_db", c.deviation_db}});
    }
    return table;
}

BenchTable table_of_residuals(const People& people, Json& rows) {
    const Model castle = model(CsfModel::castle), barten = model(CsfModel::barten_fitted);
    const double gain = perception::default_person.gain;
    BenchTable table{"Residuals: people over the model, median in dB",
                     {{"part", "sensitivities", "castle", "barten-fitted", "above the default observer"}}};
    for (const Part& part : parts_of(people)) {
        People inside;
        for (const MeasuredSensitivity& m : people)
            if (part.holds(m)) inside.push_back(m);
        if (inside.empty()) continue;
        const auto c = calibration::compare(inside, castle.sensitivity),
                   b = calibration::compare(inside, barten.sensitivity);
        const auto usual =
            calibration::compare(inside, [&](const Stimulus& s) { return gain * castle.sensitivity(s); });
        table.rows.push_back({part.name, std::to_string(c.count), with_decimals(c.median_db, 1),
                              with_decimals(b.median_db, 1), rounded(100 * usual.share_above, 2) + "%"});
        rows.push_back({{"part", part.name},
                        {"count", c.count},
                        {"castle_median_db", c.median_db},
                        {"barten_median_db", b.median_db},
                        {"share_above_default", usual.share_above}});
    }
    return table;
}

BenchTable table_of_fits(const People& people, Json& rows) {
    BenchTable table{"Fits", {{"what", "fitted here", "used"}}};
    const auto add = [&](const std::string& what, double here, std::optional<double> used) {
        table.rows.push_back({what, rounded(here, 4), used ? rounded(*used, 4) : ""});
        rows.push_back({{"fit", what}, {"value", here}, {"used", used ? Json(*used) : Json()}});
    };
    const auto castle = model(CsfModel::castle).sensitivity, barten = model(CsfModel::barten_fitted).sensitivity;
    for (const double share : {0.1, 0.05})
        add("gain over castle that " + rounded(100 * share, 2) + "% exceed",
            calibration::gain_for_share(people, castle, share), {});
    const perception::BartenConstants fit = calibration::fit_barten(people), &used = perception::fitted_barten;
    add("Barten's k", fit.signal_to_noise, used.signal_to_noise);
    add("Barten's sigma0, minutes of arc", 60 * fit.line_spread.value(), 60 * used.line_spread.value());
    add("Barten's u0, cpd", fit.inhibition.value(), used.inhibition.value());
    add("Barten's Nmax, cycles", fit.greatest_cycles, used.greatest_cycles);
    for (const perception::Person& person : perception::people)
        add("gain over barten-fitted that " + rounded(100 * person.share_above, 2) + "% exceed",
            calibration::gain_for_share(people, barten, person.share_above), person.barten_gain);
    return table;
}

} // namespace

Result<PeopleBenchResult> bench_people(const std::string& file) {
    const auto all = calibration::read_sensitivities(file);
    if (!all) return all.error();
    const People people = calibration::within_domain(*all);
    if (people.empty())
        return Error{ErrorCode::invalid_argument, file +
                                                      ": no sensitivity is of a still grating to 30 degrees aside, of "
                                                      "up to 100 square degrees, at 1 to 500 cd/m2."};
    PeopleBenchResult result;
    result.tables = {table_of_models(people, result.rows), table_of_residuals(people, result.rows),
                     table_of_fits(people, result.rows)};
    return result;
}

} // namespace unseen::app
