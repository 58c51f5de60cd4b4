#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>

#include <unseen/calibration/internal/people.h>
#include <unseen/perception/csf.h>
#include <unseen/perception/internal/chroma.h>
#include <unseen/perception/judge.h>

#include "bench_tools.h"
#include "benches.h"
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

BenchTable table_of_models(const People& people) {
    BenchTable table{
        "Models and observers against " + std::to_string(people.size()) +
            " sensitivities of people: still gratings, to 30 degrees aside, of up to 100 square degrees, 1 "
            "to 500 cd/m2; each study counts alike",
        {{"model", "model"},
         {"people above it", "share_above"},
         {"median, dB", "median_db"},
         {"standard deviation, dB", "deviation_db"}}};
    for (const Model& m : models()) {
        const auto c = calibration::compare(people, m.sensitivity);
        table.rows.push_back({m.name, percent(c.share_above, 3), fixed(c.median_db, 1), fixed(c.deviation_db, 1)});
    }
    return table;
}

BenchTable table_of_residuals(const People& people) {
    const Model castle = model(CsfModel::castle), barten = model(CsfModel::barten_fitted);
    const double gain = perception::default_person.gain;
    BenchTable table{"Residuals: people over the model, median in dB",
                     {{"part", "part"},
                      {"sensitivities", "count"},
                      {"castle", "castle_median_db"},
                      {"barten-fitted", "barten_median_db"},
                      {"above the default observer", "share_above_default"}}};
    for (const Part& part : parts_of(people)) {
        People inside;
        std::ranges::copy_if(people, std::back_inserter(inside), part.holds);
        if (inside.empty()) continue;
        const auto c = calibration::compare(inside, castle.sensitivity),
                   b = calibration::compare(inside, barten.sensitivity),
                   usual = calibration::compare(inside, [&](const Stimulus&s) { return gain * castle.sensitivity(s); });
        table.rows.push_back({part.name,
                              {std::to_string(c.count), c.count},
                              fixed(c.median_db, 1),
                              fixed(b.median_db, 1),
                              percent(usual.share_above, 2)});
    }
    return table;
}

BenchTable table_of_fits(const People& people) {
    BenchTable table{"Fits", {{"what", "fit"}, {"fitted here", "value"}, {"used", "used"}}};
    const auto add = [&](const std::string& what, double here, std::optional<double> used) {
        table.rows.push_back({what, number(here, 4), used ? number(*used, 4) : Cell("", Json())});
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

// ---- colour

struct Gabor {
    double freq_cpd, cdm2, contrast;
    int direction; // 0: luminance, 1: red-green, 2: yellow-violet
};
constexpr double radius_cycles = 1.5; // of the envelope's standard deviation, as of patch_area()

perception::Image draw(const Gabor& g, int side, double ppd) {
    perception::Image image{side, side, 3, {}};
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x) {
            const double right = (x - side / 2) / ppd, down = (y - side / 2) / ppd, sigma = radius_cycles / g.freq_cpd;
            const double change = g.cdm2 * g.contrast * std::cos(2 * std::numbers::pi * g.freq_cpd * right) *
                                  std::exp(-(right * right + down * down) / (2 * sigma * sigma));
            glm::dvec3 by(0);
            by[g.direction] = change;
            const glm::dvec3 rgb = perception::rgb_of(g.cdm2 + by[0], {by[1], by[2]});
            for (int k = 0; k < 3; ++k) image.values.push_back(static_cast<float>(rgb[k]));
        }
    return image;
}

// What the judges of the median person make of gratings at the threshold that castleCSF has for them.
BenchTable table_of_channels() {
    BenchTable table{
        "V of gratings at castleCSF's thresholds, by the judges for the median person: 0.5 to 8 cpd, 5 to 100 "
        "cd/m2, 0 and 10 degrees aside",
        {{"direction", "direction"},
         {"judge", "judge"},
         {"gratings", "count"},
         {"median V", "median"},
         {"least", "least"},
         {"largest", "largest"},
         {"within 3 dB", "share_within_3_db"}}};
    constexpr CsfModel branches[] = {CsfModel::castle, CsfModel::castle_red_green, CsfModel::castle_yellow_violet};
    constexpr const char* names[] = {"luminance", "red-green, of one luminance", "yellow-violet, of one luminance"};
    const perception::Display display;
    const double ppd = perception::pixels_per_degree(display).value();
    for (int direction = 0; direction < 3; ++direction)
        for (const bool is_second : {false, true}) {
            std::vector<double> all;
            for (const double freq : {0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.5, 8.0})
                for (const double cdm2 : {5.0, 20.0, 100.0})
                    for (const double aside : {0.0, 10.0}) {
                        const int side = std::max(256, static_cast<int>(5 * radius_cycles / freq * ppd) / 2 * 2);
                        Stimulus s;
                        s.frequency = perception::CyclesPerDegree(freq);
                        s.luminance = perception::Luminance(cdm2);
                        s.eccentricity = perception::Degrees(aside);
                        s.area = perception::patch_area(s.frequency);
                        const double contrast = 1 / perception::sensitivity(branches[direction], s);
                        constexpr double most[] = {1, 0.1, 0.8}; // that colours of a display have
                        if (contrast > most[direction]) continue;
                        std::optional<glm::dvec2> gaze;
                        if (aside > 0)
                            gaze = glm::dvec2(side / 2 + std::tan(aside * std::numbers::pi / 180) *
                                                             display.distance.value() / display.pixel_pitch.value(),
                                              side / 2);
                        const perception::JudgeOptions options =
                            is_second ? perception::second_judge_options(perception::median_person, display, gaze)
                                      : perception::JudgeOptions{.display = display,
                                                                 .gaze_px = gaze,
                                                                 .gain = perception::median_person.gain};
                        all.push_back(require(perception::judge_modern(
                                                  draw({freq, cdm2, 0, direction}, side, ppd),
                                                  draw({freq, cdm2, contrast, direction}, side, ppd), options))
                                          .max_ratio);
                    }
            std::ranges::sort(all);
            const double three_decibels = std::pow(10.0, 3.0 / 20);
            const auto within =
                std::ranges::count_if(all, [&](double v) { return v > 1 / three_decibels && v < three_decibels; });
            table.rows.push_back({std::string(names[direction]),
                                  std::string(is_second ? "second" : "modern"),
                                  {std::to_string(all.size()), all.size()},
                                  number(all[all.size() / 2], 3),
                                  number(all.front(), 3),
                                  number(all.back(), 3),
                                  percent(static_cast<double>(within) / static_cast<double>(all.size()), 3)});
        }
    return table;
}

} // namespace

BenchReport bench_people(const PeopleOptions& options) {
    if (options.channels) return {{table_of_channels()}};
    const std::string file = options.inputs.empty() ? find_in_checkout("data/people/achromatic_thresholds.csv").string()
                                                    : options.inputs.front();
    const People people = calibration::within_domain(require(calibration::read_sensitivities(file)));
    if (people.empty())
        throw BenchFailure{{ErrorCode::invalid_argument,
                            file + ": no sensitivity is of a still grating to 30 degrees aside, of up to 100 square "
                                   "degrees, at 1 to 500 cd/m2."}};
    return {{table_of_models(people), table_of_residuals(people), table_of_fits(people)}};
}

} // namespace unseen::app
