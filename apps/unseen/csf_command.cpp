// unseen csf: contrast sensitivity for one stimulus, and tables of it.
#include <memory>
#include <optional>

#include <unseen/calibration/observer_profile.h>
#include <unseen/perception/csf.h>
#include <unseen/session/observer.h>
#include <unseen/vdtree/internal/errors.h>

#include "options.h"
#include "output_files.h"
#include "report.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

using namespace perception;

// What the options say about a stimulus.
struct StimulusOptions {
    std::optional<double> frequency, luminance, eccentricity, temporal, area, velocity, distance;
    std::optional<VisualField> field;
};

struct CsfArguments {
    std::string model_name, csf, save, json; // no model: castle
    bool by_table = false;
    StimulusOptions stimulus;
};

Stimulus conditions_of(const StimulusOptions& s) {
    Stimulus c;
    if (s.temporal) c.temporal = Hertz(*s.temporal);
    if (s.velocity) c.velocity = DegreesPerSecond(*s.velocity);
    if (s.field) c.field = *s.field;
    if (s.distance) c.distance = Metres(*s.distance);
    return c;
}

// A model's closed form, its table under the options' conditions, or a viewer's table.
struct Observer {
    CsfModel model = CsfModel::castle;
    std::optional<CsfTable> table = {};

    std::string name() const {
        return table ? "table: " + table->samples().source : std::string(perception::name(model));
    }
};

Result<Observer> make_observer(const CsfArguments& a) {
    const auto model = csf_model(a.model_name.empty() ? "castle" : a.model_name);
    if (!model) return model.error();
    Observer observer{*model};
    const StimulusOptions& s = a.stimulus;
    if (!a.csf.empty()) {
        auto choice = session::choose_csf(a.csf);
        if (!choice) return choice.error();
        if (const auto* const chosen = std::get_if<CsfModel>(&*choice)) observer.model = *chosen;
        else if (s.temporal || s.velocity || s.field || s.distance)
            return invalid_argument("a viewer's table was measured under conditions of its own: leave --temporal, "
                                    "--velocity, --field and --distance away.");
        else observer.table = std::get<CsfTable>(std::move(*choice));
    }
    if (observer.table || (!a.by_table && a.csf.empty())) return observer;
    auto table = CsfTable::from_model(observer.model, conditions_of(s));
    if (!table) return table.error();
    observer.table = std::move(*table);
    return observer;
}

Result<double> sensitivity_of(const Observer& observer, const StimulusOptions& s) {
    Stimulus stimulus = stimulus_of(conditions_of(s), CyclesPerDegree(*s.frequency),
                                    Degrees(s.eccentricity.value_or(0)), Luminance(*s.luminance));
    if (s.area) stimulus.area = SquareDegrees(*s.area);
    const double value =
        observer.table ? observer.table->sensitivity(stimulus.frequency, stimulus.eccentricity, stimulus.luminance)
                       : sensitivity(observer.model, stimulus);
    if (std::isfinite(value)) return value;
    return invalid_argument("no sensitivity: frequency, luminance, area and distance must be above 0, eccentricity, "
                            "temporal frequency and velocity 0 or more, and none of them extreme.");
}

Result<int> run(const CsfArguments& a) {
    auto report = open_report({a.csf}, {a.save}, a.json);
    if (!report) return report.error();
    const auto observer = make_observer(a);
    if (!observer) return observer.error();
    if (!a.save.empty()) {
        if (auto ok = calibration::write_csf(a.save, *observer->table); !ok) return ok.error();
        print_written({a.save});
        return exit_done;
    }
    const auto value = sensitivity_of(*observer, a.stimulus);
    if (!value) return value.error();
    Json json = {{"observer", observer->name()}, {"sensitivity", *value}, {"least_visible_contrast", 1 / *value}};
    const Luminance luminance(*a.stimulus.luminance);
    const std::string beyond =
        observer->table
            ? beyond_reach(*observer->table, Degrees(a.stimulus.eccentricity.value_or(0)), luminance, luminance)
            : std::string();
    if (!beyond.empty()) json["beyond_table"] = beyond;
    if (auto ok = report->write(json); !ok) return ok.error();
    if (report->is_on_stdout()) return exit_done;
    print_table({{"sensitivity", rounded(*value, 3)}, {"least visible contrast", rounded(100 / *value, 3) + "%"}});
    if (!beyond.empty()) print_note(beyond + ".");
    print_written({a.json});
    return exit_done;
}

std::vector<std::string> model_names() {
    std::vector<std::string> names;
    for (const CsfModel model : csf_models) names.emplace_back(name(model));
    return names;
}

std::vector<Rule> csf_rules() {
    const std::string patches = "tables hold patches of 1.5 cycles radius";
    return {{"--table", Rule::excludes, {"--csf"}},
            {"--model", Rule::excludes, {"--csf"}},
            {"--temporal", Rule::excludes, {"--velocity"}},
            {"--area", Rule::excludes, {"--table", "--csf"}, patches},
            {"--distance", Rule::needs_one_of, {"--csf", "--model daly"}, "the other models do not depend on it"},
            {"--save-table", Rule::needs_one_of, {"--table", "--csf"}},
            {"--save-table", Rule::excludes, {"--frequency", "--luminance", "--eccentricity"}, "it holds all of them"},
            {"--save-table", Rule::excludes, {"--json"}, "that is for one stimulus"}};
}

} // namespace

Command csf_command(CLI::App& app) {
    auto a = std::make_shared<CsfArguments>();
    StimulusOptions* s = &a->stimulus;
    CLI::App* verb =
        app.add_subcommand("csf", "Contrast sensitivity: 1 / the least visible contrast of a grating patch");
    add_value(*verb, "--model", a->model_name, one_of(model_names()), "NAME",
              "Which closed form (default: castle): " + listed(model_names()));
    add_value(*verb, "--frequency", s->frequency, positive(), "CPD", "Spatial frequency");
    add_value(*verb, "--luminance", s->luminance, positive(), "CDM2", "Adaptation luminance");
    add_value(*verb, "--eccentricity", s->eccentricity, not_negative(), "DEG", "From the point of gaze (default: 0)");
    add_value(*verb, "--temporal", s->temporal, not_negative(), "HZ", "Temporal frequency (default: 0)");
    add_value(*verb, "--velocity", s->velocity, not_negative(), "DEG/S",
              "How fast the grating moves on the retina (default: 0)");
    add_value(*verb, "--distance", s->distance, positive(), "METRES",
              "Distance of the grating, for --model daly (default: 0.5)");
    add_value(*verb, "--area", s->area, positive(), "DEG2", "Area of the patch (default: pi (1.5 / frequency)^2)");
    add_choice<std::optional<VisualField>, VisualField>(
        *verb, "--field", s->field,
        {{"nasal", VisualField::nasal}, {"temporal", VisualField::temporal}, {"worst", VisualField::worst}},
        "Side of the visual field: nasal, temporal, or the worst of them (default)");
    verb->add_flag("--table", a->by_table, "Through the interpolated table that fold tests use, not the closed form");
    verb->add_option("--csf", a->csf, "Through a model's table, or a viewer's")->type_name("MODEL|FILE");
    add_value(*verb, "--save-table", a->save, ending_in({".json"}), "OUT.json",
              "With --table or --csf: write the table");
    add_json_option(*verb, a->json);
    verb->callback([a] {
        if (a->save.empty() && !a->stimulus.frequency) refuse("--frequency is required, or else --save-table.");
        if (a->save.empty() && !a->stimulus.luminance) refuse("--luminance is required, or else --save-table.");
    });
    verb->footer("Examples:\n  unseen csf --frequency 4 --luminance 100\n"
                 "  unseen csf --frequency 4 --luminance 100 --model barten-1999 --velocity 10\n"
                 "  unseen csf --table --save-table standard.json\n"
                 "  unseen csf --table --velocity 5 --save-table moving.json");
    return {verb, [a] { return run(*a); }, csf_rules()};
}

} // namespace unseen::app
