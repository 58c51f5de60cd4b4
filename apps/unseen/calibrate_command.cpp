// unseen calibrate: measures a viewer, or a simulated one, and a display.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <memory>
#include <optional>

#include <unseen/calibration/display_profile.h>
#include <unseen/calibration/internal/simulated_observer.h>
#include <unseen/calibration/observer_profile.h>
#include <unseen/calibration/procedure.h>
#include <unseen/vdtree/internal/errors.h>

#include "calibration_window.h"
#include "options.h"
#include "output_files.h"
#include "progress_bar.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

using calibration::CalibrationPlan;
using calibration::GratingPlace;
using calibration::Method;
using calibration::PlaceEstimate;
using calibration::Procedure;
using calibration::SimulatedObserver;

struct CalibrateArguments {
    DisplayOptions& display;
    std::string out = {}, json = {}, simulate = {}, state = {}, photometer = {}, observer = {}, conditions = {},
                date = {};
    bool gamma = false;
    // The plan. Defaults are CalibrationPlan's, or those of the calibration that is resumed.
    std::optional<Method> method = {};
    std::optional<double> seed = {}, trials = {}, settings = {}, luminance = {};
    std::vector<double> frequencies = {}, eccentricities = {};
    std::optional<bool> wide = {}; // patches among the places; default: where the places are not named
    CalibrationWindowOptions window = {};
};

std::string today() {
    std::array<char, 32> text;
    const std::time_t now = std::time(nullptr);
    std::tm local{};
    localtime_r(&now, &local);
    std::strftime(text.data(), text.size(), "%Y-%m-%d", &local);
    return text.data();
}

// Those that --frequencies and --eccentricities name; none where they are not given.
std::vector<GratingPlace> places_named(const CalibrateArguments& a) {
    std::vector<GratingPlace> places;
    for (const double e : a.eccentricities)
        for (const double f : a.frequencies) places.push_back({f, e});
    return places;
}

Result<CalibrationPlan> make_plan(const CalibrateArguments& a, const perception::Display& display,
                                  const perception::CsfTable& expected) {
    std::optional<perception::Luminance> luminance;
    if (a.luminance) {
        const double black = perception::black_level(display).value(),
                     white = perception::to_luminance(display, 1).value();
        if (!(*a.luminance > black && *a.luminance < white))
            return invalid_argument("--luminance " + shortest(*a.luminance) +
                                    " cd/m2 is not between the display's black (" + shortest(black) + ") and white (" +
                                    shortest(white) + ").");
        luminance = perception::Luminance(*a.luminance);
    }
    CalibrationPlan plan = calibration::plan_for(display, expected, luminance);
    if (a.method) plan.method = *a.method;
    if (a.seed) plan.seed = static_cast<std::uint64_t>(*a.seed);
    if (a.settings) plan.settings = static_cast<int>(*a.settings);
    if (std::vector<GratingPlace> named = places_named(a); !named.empty() || a.wide) {
        std::erase_if(plan.places, std::mem_fn(&GratingPlace::is_wide));
        if (!named.empty()) plan.places = std::move(named);
        plan.trials = CalibrationPlan().trials;
        if (a.wide.value_or(false)) {
            for (const GratingPlace& place : calibration::wide_places(plan, display, expected)) {
                plan.places.push_back(place);
                plan.trials += calibration::trials_of_wide_place;
            }
            if (!plan.places.empty() && !plan.places.back().is_wide())
                return invalid_argument("No wide patch fits the display '" + display.name +
                                        "' at these frequencies and eccentricities: leave --wide away, or add lower "
                                        "--frequencies.");
        }
    }
    if (a.trials) plan.trials = static_cast<int>(*a.trials);
    if (plan.places.empty())
        return invalid_argument("No grating fits the display '" + display.name +
                                "': give --frequencies and --eccentricities.");
    if (auto valid = calibration::validate(plan); !valid) return valid.error();
    return plan;
}

// A calibration goes on as it was begun: what is given must say the same.
Result<void> check_resumed(const CalibrateArguments& a, const CalibrationPlan& plan) {
    std::string differing;
    const auto add = [&](const std::string& option, const std::string& begun_with) {
        differing +=
            (differing.empty() ? "" : ", ") + option + (begun_with.empty() ? "" : " (it was " + begun_with + ")");
    };
    const auto compare = [&](const char* option, const std::optional<double>& given, double begun_with) {
        if (given && *given != begun_with) add(option, shortest(begun_with));
    };
    if (a.method && *a.method != plan.method) add("--method", std::string(calibration::name(plan.method)));
    compare("--trials", a.trials, plan.trials);
    compare("--settings", a.settings, plan.settings);
    compare("--seed", a.seed, static_cast<double>(plan.seed));
    compare("--luminance", a.luminance, plan.luminance.value());
    std::vector<GratingPlace> small = plan.places;
    std::erase_if(small, std::mem_fn(&GratingPlace::is_wide));
    const std::vector<GratingPlace> named = places_named(a);
    if (!named.empty() && !std::is_permutation(named.begin(), named.end(), small.begin(), small.end()))
        add("--frequencies and --eccentricities", "");
    if (a.wide && *a.wide != (small.size() < plan.places.size())) add(*a.wide ? "--wide" : "--no-wide", "");
    if (differing.empty()) return {};
    return invalid_argument("'" + a.state + "' was not begun so: leave away " + differing +
                            ", or begin anew with another file.");
}

// What a person is shown must be what the plan says, also where the plan comes from a file.
Result<void> check_display(const CalibrationPlan& plan, const perception::Display& display) {
    const double black = perception::black_level(display).value(), white = perception::to_luminance(display, 1).value();
    const double mean = plan.luminance.value(), amplitude = mean * plan.highest_contrast;
    constexpr double rounding = 1e-9;
    if (!(mean - amplitude >= black - rounding * white && mean + amplitude <= white * (1 + rounding)))
        return invalid_argument("The display '" + display.name + "' cannot show contrasts up to " +
                                rounded(plan.highest_contrast, 3) + " around " + rounded(mean, 4) +
                                " cd/m2: use the one that the calibration was begun on.");
    for (const calibration::GratingPlace& place : plan.places)
        if (!calibration::fits(display, place))
            return invalid_argument("The display '" + display.name + "' has no room for a grating of " +
                                    shortest(place.frequency_cpd) + " cpd at " + shortest(place.eccentricity_deg) +
                                    " degrees" +
                                    (place.is_wide() ? " over " + shortest(place.area_deg2) + " deg2" : "") +
                                    ": choose other --frequencies and --eccentricities.");
    return {};
}

// ---- what comes out -----------------------------------------------------------------------------------------------

double decibels(double ratio) { return 20 * std::log10(ratio); }

// Whether there is a threshold at all within the display's contrasts.
bool is_visible(double sensitivity, const CalibrationPlan& plan) { return sensitivity * plan.highest_contrast >= 1; }

// Root mean square error over the places that the observer can see; NaN where there are none.
double rms_db(const Procedure& procedure, const SimulatedObserver& observer) {
    double squares = 0, count = 0;
    for (const PlaceEstimate& e : procedure.estimates()) {
        const double truth = observer.sensitivity(e.place, procedure.plan().luminance);
        if (!is_visible(truth, procedure.plan())) continue;
        squares += std::pow(decibels(e.sensitivity() / truth), 2);
        ++count;
    }
    return std::sqrt(squares / count);
}

// How far the places stray from the fitted shape, root mean square in dB.
double misfit_db(const Procedure& procedure) {
    double squares = 0;
    const auto estimates = procedure.estimates();
    for (const PlaceEstimate& e : estimates) squares += std::pow(20 * e.local.mean, 2);
    return std::sqrt(squares / static_cast<double>(estimates.size()));
}

Json to_json(const Procedure& procedure, const SimulatedObserver* truth) {
    const CalibrationPlan& plan = procedure.plan();
    Json measured = Json::array();
    for (const PlaceEstimate& e : procedure.estimates()) {
        Json row = {
            {"frequency_cpd", e.place.frequency_cpd},
            {"eccentricity_deg", e.place.eccentricity_deg},
            {"sensitivity", e.sensitivity()},
            {"low", e.low()},
            {"high", e.high()},
            {"answers", e.answers},
            {"area_deg2", e.place.is_wide()
                              ? e.place.area_deg2
                              : perception::patch_area(perception::CyclesPerDegree(e.place.frequency_cpd)).value()},
            {"off_shape_db", 20 * e.local.mean}};
        if (truth) {
            const double value = truth->sensitivity(e.place, plan.luminance);
            row["true_sensitivity"] = value;
            row["error_db"] = decibels(e.sensitivity() / value);
        }
        measured.push_back(row);
    }
    Json json = {{"method", calibration::name(plan.method)}, {"seed", plan.seed},
                 {"answers", procedure.answers().size()},    {"done", procedure.is_done()},
                 {"luminance_cdm2", plan.luminance.value()}, {"highest_contrast", plan.highest_contrast},
                 {"misfit_db", misfit_db(procedure)},        {"measured", measured}};
    if (const auto summation = procedure.summation()) {
        json["summation"] = {{"own", summation->own}, {"low", summation->low}, {"high", summation->high}};
        if (truth) json["summation"]["true"] = truth->summation;
    }
    if (truth) json["rms_error_db"] = number_or_null(rms_db(procedure, *truth));
    return json;
}

void print(const Procedure& procedure, const SimulatedObserver* truth) {
    std::vector<std::vector<std::string>> rows = {
        {"eccentricity", "frequency", "patch", "sensitivity", "95% from", "to", "answers", "off shape"}};
    if (truth) rows.front().insert(rows.front().end(), {"true", "error"});
    for (const PlaceEstimate& e : procedure.estimates()) {
        rows.push_back({rounded(e.place.eccentricity_deg, 3) + " deg", rounded(e.place.frequency_cpd, 3) + " cpd",
                        e.place.is_wide() ? rounded(e.place.area_deg2, 3) + " deg2" : "1.5 cycles",
                        rounded(e.sensitivity(), 3), rounded(e.low(), 3), rounded(e.high(), 3),
                        std::to_string(e.answers), rounded(20 * e.local.mean, 2) + " dB"});
        if (!truth) continue;
        const double value = truth->sensitivity(e.place, procedure.plan().luminance);
        rows.back().push_back(rounded(value, 3));
        rows.back().push_back(
            is_visible(value, procedure.plan()) ? rounded(decibels(e.sensitivity() / value), 2) + " dB" : "unseen");
    }
    print_table(rows);
    std::printf("%zu answers at %s cd/m2, contrasts up to %s; off the fitted shape by %s dB (rms)\n",
                procedure.answers().size(), rounded(procedure.plan().luminance.value(), 4).c_str(),
                rounded(procedure.plan().highest_contrast, 3).c_str(), rounded(misfit_db(procedure), 2).c_str());
    if (const auto summation = procedure.summation())
        std::printf(
            "wide patches: unlimited ones are seen %s times as well as castleCSF's law of area says (95%%: %s to "
            "%s)%s\n",
            rounded(summation->own, 3).c_str(), rounded(summation->low, 3).c_str(), rounded(summation->high, 3).c_str(),
            truth ? ("; the truth is " + rounded(truth->summation, 3)).c_str() : "");
    if (!truth) return;
    if (const double error_db = rms_db(procedure, *truth); std::isnan(error_db))
        std::printf("this observer can see none of it: no error to tell\n");
    else std::printf("error %s dB (rms over what can be seen)\n", rounded(error_db, 3).c_str());
}

Result<calibration::ObserverProfile> profile_of(const Procedure& procedure, const CalibrateArguments& a,
                                                const perception::Display& display) {
    calibration::ObserverProfile profile;
    profile.observer = !a.observer.empty() ? a.observer : a.simulate.empty() ? "unnamed" : "simulated: " + a.simulate;
    profile.date = a.date.empty() ? today() : a.date;
    profile.method = std::string(calibration::name(procedure.plan().method)) + ", " +
                     std::to_string(procedure.answers().size()) + " answers, seed " +
                     std::to_string(procedure.plan().seed);
    profile.display = display.name;
    profile.conditions = a.conditions;
    profile.measured_at_cdm2 = procedure.plan().luminance.value();
    for (const PlaceEstimate& e : procedure.estimates())
        profile.measured.push_back({e.place, e.sensitivity(), e.low(), e.high(), e.answers});
    profile.summation = procedure.summation().value_or(calibration::Summation());
    auto table = procedure.table(profile.observer + ", " + profile.date + ", " + profile.method);
    if (!table) return table.error();
    profile.table = std::move(*table);
    return profile;
}

// ---- ways to answer -----------------------------------------------------------------------------------------------

void simulate(Procedure& procedure, const SimulatedObserver& observer) {
    ProgressBar bar("calibrating");
    while (!procedure.is_done()) {
        bar(static_cast<double>(procedure.answers().size()) / procedure.trials(), "answers");
        const calibration::Trial trial = procedure.next();
        if (procedure.plan().method == Method::adjustment) procedure.set(observer.set(trial, procedure.plan()));
        else procedure.choose(observer.choose(trial, procedure.plan().luminance));
    }
}

Result<perception::CsfTable> expected_table(const CalibrateArguments& a, const perception::Display& display) {
    if (a.display.csf.empty()) return perception::CsfTable::standard();
    const auto table = session::read_csf_table(a.display.csf, display, perception::median_person);
    if (!table) return table.error();
    return **table;
}

Result<Procedure> begin_or_resume(const CalibrateArguments& a, const perception::Display& display) {
    auto expected = expected_table(a, display);
    if (!expected) return expected.error();
    if (!a.state.empty() && std::filesystem::exists(a.state)) {
        auto procedure = Procedure::resume(a.state, std::move(*expected));
        if (!procedure) return procedure;
        if (auto same = check_resumed(a, procedure->plan()); !same) return same.error();
        return procedure;
    }
    auto plan = make_plan(a, display, *expected);
    if (!plan) return plan.error();
    return Procedure::create(std::move(*plan), std::move(*expected));
}

Result<int> calibrate_observer(CalibrateArguments& a, const perception::Display& display) {
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    auto procedure = begin_or_resume(a, display);
    if (!procedure) return procedure.error();
    std::optional<SimulatedObserver> observer;
    if (!a.simulate.empty()) {
        auto made = calibration::simulated_observer(a.simulate, procedure->plan().seed);
        if (!made) return made.error();
        if (auto ok = calibration::check_measurable(*made, procedure->plan()); !ok) return ok.error();
        observer = std::move(*made);
    }
    if (observer) {
        simulate(*procedure, *observer);
        if (!a.state.empty())
            if (auto saved = procedure->save(a.state); !saved) return saved.error();
    } else {
        if (auto shown = check_display(procedure->plan(), display); !shown) return shown.error();
        a.window.display = display;
        if (auto shown = run_calibration_window(*procedure, a.window, a.state); !shown) return shown.error();
        if (!procedure->is_done()) {
            print_note(std::to_string(procedure->answers().size()) + " of " + std::to_string(procedure->trials()) +
                       " answers were given" +
                       (a.state.empty() ? "; with --resume FILE they would have been kept."
                                        : "; go on with --resume '" + a.state + "'."));
            return a.out.empty() && a.json.empty() ? exit_done : exit_failed; // nothing is written
        }
    }
    if (const auto summation = procedure->summation())
        if (auto ok = calibration::check(*summation, procedure->plan()); !ok) return ok.error();
    const SimulatedObserver* truth = observer ? &*observer : nullptr;
    if (auto ok = report->prepare(to_json(*procedure, truth)); !ok) return ok.error();
    if (!a.out.empty()) {
        auto profile = profile_of(*procedure, a, display);
        if (!profile) return profile.error();
        if (auto ok = calibration::write_observer(a.out, *profile); !ok) return ok.error();
    }
    if (auto ok = report->publish(); !ok) return ok.error();
    if (report->is_on_stdout()) return exit_done;
    print(*procedure, truth);
    print_written({a.out, a.json, a.state});
    return exit_done;
}

Result<int> write_measured_display(const CalibrateArguments& a, const perception::Display& display) {
    if (!a.out.empty()) {
        if (auto ok = calibration::write_display(a.out, display); !ok) return ok.error();
    }
    print_written({a.out});
    return exit_done;
}

Result<int> calibrate_gamma(CalibrateArguments& a, perception::Display display) {
    a.window.display = display;
    const auto matches = match_gamma(a.window);
    if (!matches) return matches.error();
    std::vector<calibration::BrightnessMatch> fitted;
    for (const GammaMatch& m : *matches) fitted.push_back({m.share, m.code});
    if (fitted.empty()) return invalid_argument("The window was closed before anything was matched.");
    const auto gamma = calibration::fit_gamma(fitted);
    if (!gamma) return gamma.error();
    for (const GammaMatch& m : *matches)
        std::printf("%s of white looks like code %d (a gamma of %s)\n", rounded(m.share, 3).c_str(),
                    static_cast<int>(std::lround(m.code * 255)),
                    rounded(std::log(m.share) / std::log(m.code), 3).c_str());
    std::printf("gamma %s\n", rounded(*gamma, 4).c_str());
    display.transfer = perception::TransferFunction::gamma;
    display.gamma = *gamma;
    return write_measured_display(a, display);
}

Result<int> calibrate_by_photometer(const CalibrateArguments& a, const perception::Display& display) {
    const auto table = calibration::read_photometer(a.photometer);
    if (!table) return table.error();
    const auto measured = calibration::with_photometer(display, *table);
    if (!measured) return Error{measured.error().code, a.photometer + ": " + measured.error().message};
    std::printf("peak %s cd/m2, black %s cd/m2, %zu codes measured\n", rounded(measured->peak.value(), 4).c_str(),
                rounded(measured->black.value(), 4).c_str(), table->code.size());
    return write_measured_display(a, *measured);
}

Result<int> run(CalibrateArguments& a) {
    // Before anybody has answered anything.
    const std::string simulated = a.simulate.substr(0, a.simulate.find(':')); // a model, or a file
    if (const auto ready = check_outputs({a.display.file, a.display.csf, a.photometer, simulated},
                                         {a.out, a.json, a.state, a.window.screenshot});
        !ready)
        return ready.error();
    const auto display = make_display(a.display);
    if (!display) return display.error();
    if (!a.photometer.empty()) return calibrate_by_photometer(a, *display);
    if (a.gamma) return calibrate_gamma(a, *display);
    return calibrate_observer(a, *display);
}

void check(const CalibrateArguments& a) {
    const int modes = a.gamma + !a.photometer.empty() + !a.simulate.empty();
    if (modes > 1) refuse("--simulate, --gamma and --photometer exclude each other: give one of them.");
    if (a.frequencies.empty() != a.eccentricities.empty())
        refuse("--frequencies and --eccentricities belong together: give both.");
    if (!a.photometer.empty() && a.out.empty()) refuse("--photometer needs -o DISPLAY.json for what was measured.");
    const bool is_of_display = a.gamma || !a.photometer.empty();
    if (is_of_display && !a.json.empty()) refuse("--json reports observers: leave it out.");
    const bool has_plan =
        a.method || a.seed || a.trials || a.settings || a.luminance || !a.frequencies.empty() || a.wide;
    if (is_of_display && (has_plan || !a.state.empty()))
        refuse("--method, --seed, --trials, --settings, --luminance, --frequencies, --eccentricities, --wide and "
               "--resume concern observers, not displays: leave them out.");
    if (a.trials && a.method == Method::adjustment)
        refuse("--trials belongs to --method 2ifc: with adjustment, give --settings.");
    const bool may_be_adjustment = a.method ? *a.method == Method::adjustment : !a.state.empty(); // of a file, its own
    if (a.settings && !may_be_adjustment) refuse("--settings needs --method adjustment.");
}

void add_plan_options(CLI::App& verb, CalibrateArguments& a) {
    add_choice<std::optional<Method>, Method>(
        verb, "--method", a.method, {{"2ifc", Method::two_interval}, {"adjustment", Method::adjustment}},
        "2ifc (default): in which of two intervals was a grating? adjustment: gratings fade in and out");
    add_value(verb, "--trials", a.trials, whole(1, 1e5), "N",
              "Trials of 2ifc (default: 200, and 10 for each wide patch)");
    add_value(verb, "--settings", a.settings, whole(2, 1000), "N",
              "Settings of adjustment at each place; the first does not count (default: 7)");
    constexpr double most_seed = 9007199254740992.0; // 2^53, which JSON keeps
    add_value(verb, "--seed", a.seed, whole(0, most_seed), "N",
              "For the order of trials, and for simulated observers (default: 1)");
    verb.add_option("--simulate", a.simulate,
                    "Without a person: a CSF model or a profile, with gain=, frequency=, eccentricity=, "
                    "summation=, slope=, lapse=, scatter=, delay=")
        ->type_name("NAME|FILE.json[:key=value,...]");
    verb.add_option("--resume", a.state,
                    "Keep all answers in this file, and resume those that are there, by the plan that is there")
        ->type_name("STATE.json");
    add_value(verb, "--frequencies", a.frequencies, positive(), "CPD",
              "To measure at (default: octaves that fit the display)");
    add_value(verb, "--eccentricities", a.eccentricities, not_negative(), "DEG",
              "To measure at (default: 0, 5, 10, 20 as far as they fit)");
    // Not by its address: the parser takes an optional<bool> for a count and begins with 0.
    verb.add_flag_function(
        "--wide,!--no-wide", [&a](std::int64_t count) { a.wide = count > 0; },
        "Measure wide patches, too, or not (default: unless places are named)");
    add_value(verb, "--luminance", a.luminance, positive(), "CDM2",
              "Mean of the gratings (default: midway from black to white)");
}

void add_display_measures(CLI::App& verb, CalibrateArguments& a) {
    verb.add_flag("--gamma", a.gamma, "Measure the display's gamma by matching patches");
    verb.add_option("--photometer", a.photometer, "Take the display's luminances from a table, header code,cdm2")
        ->type_name("FILE.csv");
    verb.add_flag("--full-screen", a.window.full_screen, "Not in a window");
    add_value(verb, "--interval", a.window.interval_s, within(0.01, 60), "S",
              "Seconds of a grating, and of the pause between two (default: 0.5)");
    add_value(verb, "--fade", a.window.fade_per_s, within(0.001, 100), "D",
              "With adjustment: decades of contrast a second (default: 0.25)");
    add_value(verb, "--screenshot", a.window.screenshot, ending_in({".png"}), "OUT.png",
              "Write a picture of what is shown at the end");
}

} // namespace

Command calibrate_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<CalibrateArguments>(CalibrateArguments{setup.display_options()});
    CLI::App* verb =
        app.add_subcommand("calibrate", "Measure a viewer's contrast sensitivity, for --csf; or a display");
    add_value(*verb, "-o,--output", a->out, ending_in({".json"}), "OUT.json",
              "The observer's profile; with --gamma or --photometer the display's");
    add_plan_options(*verb, *a);
    verb->add_option("--observer", a->observer, "Who it is, for the profile")->type_name("NAME");
    verb->add_option("--conditions", a->conditions, "Room, light, glasses, for the profile")->type_name("TEXT");
    verb->add_option("--date", a->date, "For the profile (default: today)")->type_name("TEXT");
    add_json_option(*verb, a->json);
    add_display_measures(*verb, *a);
    setup.act_in(*verb, Setup::display | Setup::csf);
    verb->callback([o = a.get()] { check(*o); });
    verb->footer(
        std::string(calibration_window_help) +
        "\nExamples:\n  unseen calibrate --display mine.json --observer anna --resume anna-state.json -o anna.json\n"
        "  unseen calibrate --simulate castle:gain=0.7 --seed 3 -o observer.json\n"
        "  unseen calibrate --gamma --display mine.json -o mine-measured.json\n"
        "  unseen render bunny.vdt --csf anna.json -o bunny.png");
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
