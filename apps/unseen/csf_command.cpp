// unseen csf: contrast sensitivity for one stimulus, for a table of them, or as a plot.
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <sstream>

#include <unseen/calibration/observer_profile.h>
#include <unseen/perception/csf.h>
#include <unseen/perception/image.h>
#include <unseen/perception/internal/motion.h>
#include <unseen/session/observer.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/number_text.h>

#include "log_log_plot.h"
#include "options.h"
#include "output_files.h"
#include "report.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

using namespace perception;

// What the options, or a row of the CSV file, say about a stimulus.
struct StimulusOptions {
    std::optional<double> frequency, luminance, eccentricity, temporal, area, velocity, distance;
    std::optional<VisualField> field;
};

struct CsfArguments {
    std::string model_name, csv, plot, csf, save, json; // no model: castle
    bool by_table = false;
    bool is_pursued = false; // the velocity is the image's, and the eye follows it
    StimulusOptions stimulus;
};

std::optional<VisualField> field_of(const std::string& name) {
    if (name == "nasal") return VisualField::nasal;
    if (name == "temporal") return VisualField::temporal;
    if (name == "worst") return VisualField::worst;
    return std::nullopt;
}

Stimulus conditions_of(const StimulusOptions& s, bool is_pursued) {
    Stimulus c;
    if (s.temporal) c.temporal = Hertz(*s.temporal);
    if (s.velocity) c.velocity = DegreesPerSecond(*s.velocity);
    if (s.velocity && is_pursued) c.velocity = retinal_velocity_of_target(c.velocity);
    if (s.field) c.field = *s.field;
    if (s.distance) c.distance = Metres(*s.distance);
    return c;
}

// What a table holds constant.
bool same_conditions(const StimulusOptions& a, const StimulusOptions& b) {
    return a.temporal == b.temporal && a.velocity == b.velocity && a.field == b.field && a.distance == b.distance;
}
bool has_conditions(const StimulusOptions& s) { return !same_conditions(s, {}); }

// Sensitivity by a model's closed form, by a model's table under the options' conditions, or by a viewer's table.
class Observer {
public:
    static Result<Observer> create(const CsfArguments& a) {
        Observer observer;
        observer.fixed_ = a.stimulus;
        observer.is_pursued_ = a.is_pursued;
        auto model = csf_model(a.model_name.empty() ? "castle" : a.model_name);
        if (!model) return model.error();
        observer.model_ = *model;
        bool by_table = a.by_table;
        if (!a.csf.empty()) {
            auto choice = session::choose_csf(a.csf);
            if (!choice) return choice.error();
            by_table = choice->model.has_value();
            if (choice->model) observer.model_ = *choice->model;
            if (choice->table && has_conditions(a.stimulus))
                return invalid_argument(
                    "a viewer's table was measured under conditions of its own: leave --temporal, --velocity, "
                    "--field and --distance away.");
            observer.table_ = std::move(choice->table);
        }
        if (by_table) {
            auto table = CsfTable::from_model(observer.model_, conditions_of(a.stimulus, a.is_pursued));
            if (!table) return table.error();
            observer.table_ = std::move(*table);
        }
        return observer;
    }

    const CsfTable& table() const { return *table_; }
    // What of the stimulus lies outside of the table's samples.
    std::string beyond(const StimulusOptions& s) const {
        if (!table_) return {};
        const Luminance luminance(*s.luminance);
        return beyond_reach(*table_, Degrees(s.eccentricity.value_or(0)), luminance, luminance);
    }
    std::string name() const {
        return table_ ? "table: " + table_->samples().source : std::string(perception::name(model_));
    }

    Result<double> operator()(const StimulusOptions& s) const {
        if (!s.frequency) return invalid_argument("--frequency is missing.");
        if (!s.luminance) return invalid_argument("--luminance is missing.");
        if (table_ && (s.area || !same_conditions(s, fixed_)))
            return invalid_argument(
                "a table holds patches of 1.5 cycles radius under the same conditions: leave area, temporal, "
                "velocity, field and distance away.");
        Stimulus stimulus = stimulus_of(conditions_of(s, is_pursued_), CyclesPerDegree(*s.frequency),
                                        Degrees(s.eccentricity.value_or(0)), Luminance(*s.luminance));
        if (s.area) stimulus.area = SquareDegrees(*s.area);
        if (stimulus.temporal.value() > 0 && stimulus.velocity.value() > 0)
            return invalid_argument("no sensitivity: give a temporal frequency or a velocity, not both.");
        const double value = table_ ? table_->sensitivity(stimulus.frequency, stimulus.eccentricity, stimulus.luminance)
                                    : sensitivity(model_, stimulus);
        if (!std::isfinite(value))
            return invalid_argument(
                "no sensitivity: frequency, luminance, area and distance must be above 0, eccentricity, "
                "temporal frequency and velocity 0 or more, and none of them extreme.");
        return value;
    }

private:
    Observer() = default;
    CsfModel model_ = CsfModel::castle;
    StimulusOptions fixed_;
    bool is_pursued_ = false;
    std::optional<CsfTable> table_;
};

// ---- CSV ----------------------------------------------------------------------------------------------------------

std::vector<std::string> split(const std::string& line) {
    std::vector<std::string> cells;
    std::stringstream stream(line);
    for (std::string cell; std::getline(stream, cell, ',');) {
        const std::size_t first = cell.find_first_not_of(" \t"), last = cell.find_last_not_of(" \t");
        cells.push_back(first == std::string::npos ? "" : cell.substr(first, last - first + 1));
    }
    if (line.ends_with(',')) cells.emplace_back();
    return cells;
}

// Puts a cell into the stimulus; columns of other names are none of ours. Empty cells count as missing.
Result<void> read_cell(const std::string& column, const std::string& cell, StimulusOptions& stimulus) {
    if (cell.empty()) return {};
    if (column == "field") {
        stimulus.field = field_of(cell);
        if (!stimulus.field) return invalid_argument("field must be nasal, temporal or worst, not '" + cell + "'.");
        return {};
    }
    std::optional<double>* value = column == "frequency"      ? &stimulus.frequency
                                   : column == "luminance"    ? &stimulus.luminance
                                   : column == "eccentricity" ? &stimulus.eccentricity
                                   : column == "temporal"     ? &stimulus.temporal
                                   : column == "area"         ? &stimulus.area
                                   : column == "velocity"     ? &stimulus.velocity
                                   : column == "distance"     ? &stimulus.distance
                                                              : nullptr;
    if (!value) return {};
    *value = finite_from(cell);
    if (!*value) return invalid_argument(column + " must be a finite number, not '" + cell + "'.");
    return {};
}

// The column of the first control character but tabs, from 1 on; 0: there is none. Rows are printed as they are, and must
// not steer the terminal. Letters of encodings other than UTF-8 are not looked at.
std::size_t control_character(std::string_view line) {
    for (std::size_t i = 0; i < line.size(); ++i) {
        const auto byte = static_cast<unsigned char>(line[i]);
        const auto next = static_cast<unsigned char>(i + 1 < line.size() ? line[i + 1] : 0);
        if ((byte < 0x20 && byte != '\t') || byte == 0x7f || (byte == 0xc2 && next >= 0x80 && next < 0xa0))
            return i + 1;
    }
    return 0;
}

// The rows with `sensitivity` appended, 17 digits so that nothing is lost; comments and empty lines as they are.
Result<std::string> evaluate_csv(std::istream& in, const std::string& name, const CsfArguments& a,
                                 const Observer& observer) {
    std::string out;
    std::vector<std::string> columns;
    std::uint64_t line_number = 0;
    const auto complain = [&](const std::string& what) {
        return Error{ErrorCode::malformed_data, name + ": line " + std::to_string(line_number) + ": " + what};
    };
    for (std::string line; std::getline(in, line);) {
        ++line_number;
        if (line.ends_with('\r')) line.pop_back();
        if (const std::size_t column = control_character(line); column > 0)
            return complain("column " + std::to_string(column) + " is a control character: remove it.");
        if (line.empty() || line.starts_with('#')) {
            out += line + "\n";
            continue;
        }
        const std::vector<std::string> cells = split(line);
        if (columns.empty()) {
            columns = cells;
            for (auto column = columns.begin(); column != columns.end(); ++column)
                if (!column->empty() && std::find(columns.begin(), column, *column) != column)
                    return complain("column " + std::to_string(column - columns.begin() + 1) + ", '" + *column +
                                    "', is there before: remove or rename one of them.");
            out += line + ",sensitivity\n";
            continue;
        }
        if (cells.size() != columns.size())
            return complain(std::to_string(cells.size()) + " cells under " + std::to_string(columns.size()) +
                            " columns.");
        StimulusOptions stimulus = a.stimulus;
        for (std::size_t i = 0; i < cells.size(); ++i)
            if (auto ok = read_cell(columns[i], cells[i], stimulus); !ok) return complain(ok.error().message);
        const auto value = observer(stimulus);
        if (!value) return complain(value.error().message);
        std::array<char, 40> text;
        std::snprintf(text.data(), text.size(), "%.17g", *value);
        out += line + "," + text.data() + "\n";
    }
    if (columns.empty()) return complain("there is no line with the names of the columns.");
    return out;
}

Result<int> run_csv(const CsfArguments& a, const Observer& observer) {
    const std::string name = a.csv == "-" ? "stdin" : a.csv;
    const auto text = read_text_file(a.csv);
    if (!text) return text.error();
    std::istringstream lines(*text);
    const auto table = evaluate_csv(lines, name, a, observer);
    if (!table) return table.error();
    std::fwrite(table->data(), 1, table->size(), stdout);
    return exit_done;
}

// ---- plot ---------------------------------------------------------------------------------------------------------

constexpr std::array<double, 4> plotted_luminances = {0.1, 1, 10, 100}; // cd/m2
constexpr std::array<double, 3> plotted_eccentricities = {0, 10, 30};   // degrees
constexpr std::array<glm::vec3, 4> luminance_colours = {glm::vec3(0.35f, 0.25f, 0.6f), glm::vec3(0.1f, 0.45f, 0.75f),
                                                        glm::vec3(0.1f, 0.6f, 0.3f), glm::vec3(0.85f, 0.45f, 0.05f)};
constexpr glm::vec3 paper{1.0f};
constexpr double lowest_frequency = 1.0 / 16, highest_frequency = 64; // cpd
constexpr int steps_per_octave = 16;

Result<Curve> curve_of(const Observer& observer, StimulusOptions stimulus, glm::vec3 colour) {
    Curve curve;
    curve.colour = colour;
    curve.label = shortest(*stimulus.luminance) + " cd/m2, " + shortest(*stimulus.eccentricity) + " deg";
    const int steps = static_cast<int>(std::log2(highest_frequency / lowest_frequency)) * steps_per_octave;
    for (int i = 0; i <= steps; ++i) {
        stimulus.frequency = lowest_frequency * std::exp2(static_cast<double>(i) / steps_per_octave);
        const auto value = observer(stimulus);
        if (!value) return value.error();
        curve.points.emplace_back(*stimulus.frequency, *value);
    }
    return curve;
}

Result<int> run_plot(const CsfArguments& a, const Observer& observer) {
    LogLogPlot plot;
    plot.title = "Contrast sensitivity (" + observer.name() + ")";
    plot.x_label = "spatial frequency, cycles per degree";
    plot.y_label = "sensitivity, 1 / threshold contrast";
    plot.x_range = {lowest_frequency, highest_frequency};
    plot.y_range = {1, 1000};
    double peak = 0;
    for (std::size_t l = 0; l < plotted_luminances.size(); ++l) {
        if (a.stimulus.luminance && l > 0) break;
        for (std::size_t e = 0; e < plotted_eccentricities.size(); ++e) {
            if (a.stimulus.eccentricity && e > 0) break;
            StimulusOptions stimulus = a.stimulus;
            stimulus.luminance = a.stimulus.luminance.value_or(plotted_luminances[l]);
            stimulus.eccentricity = a.stimulus.eccentricity.value_or(plotted_eccentricities[e]);
            // Paler and dashed with eccentricity.
            const float paleness = 0.3f * static_cast<float>(e);
            auto curve = curve_of(observer, stimulus, luminance_colours[l] + (paper - luminance_colours[l]) * paleness);
            if (!curve) return curve.error();
            curve->dashed = e > 0;
            for (const auto& point : curve->points) peak = std::max(peak, static_cast<double>(point.y));
            plot.curves.push_back(std::move(*curve));
        }
    }
    // Coarse gratings that move are seen far better than any that stand.
    plot.y_range.y = std::max(1000.0, std::pow(10.0, std::ceil(std::log10(peak))));
    if (auto ok = write_plot(a.plot, plot); !ok) return ok.error();
    print_written({a.plot});
    return exit_done;
}

// -------------------------------------------------------------------------------------------------------------------

Result<int> run(const CsfArguments& a) {
    if (const auto ready = check_outputs({a.csf, a.csv}, {a.plot, a.save, a.json}); !ready) return ready.error();
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    const auto observer = Observer::create(a);
    if (!observer) return observer.error();
    if (!a.save.empty()) {
        if (auto ok = calibration::write_csf(a.save, observer->table()); !ok) return ok.error();
        print_written({a.save});
        return exit_done;
    }
    if (!a.csv.empty()) return run_csv(a, *observer);
    if (!a.plot.empty()) return run_plot(a, *observer);
    const auto value = (*observer)(a.stimulus);
    if (!value) return value.error();
    Json json = {{"observer", observer->name()}, {"sensitivity", *value}, {"least_visible_contrast", 1 / *value}};
    const std::string beyond = observer->beyond(a.stimulus);
    if (!beyond.empty()) json["beyond_table"] = beyond;
    if (auto ok = report->prepare(json); !ok) return ok.error();
    if (auto ok = report->publish(); !ok) return ok.error();
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

std::string model_list() {
    std::string list;
    for (const std::string& name : model_names()) list += (list.empty() ? "" : ", ") + name;
    return list;
}

void check(const CsfArguments& a) {
    const int outputs = !a.csv.empty() + !a.plot.empty() + !a.save.empty();
    if (outputs > 1) refuse("--csv, --plot and --save-table exclude each other: give one of them.");
    const bool is_table = a.by_table || !a.csf.empty();
    if (is_table && a.stimulus.area) refuse("--table and --csf hold patches of 1.5 cycles radius: leave --area away.");
    if (!a.save.empty() && !is_table) refuse("--save-table needs --table or --csf.");
    if (a.by_table && !a.csf.empty()) refuse("--table and --csf exclude each other: give one of them.");
    if (!a.model_name.empty() && !a.csf.empty()) refuse("--model and --csf exclude each other: give one of them.");
    if (a.stimulus.temporal && a.stimulus.velocity)
        refuse("--temporal and --velocity exclude each other: give one of them.");
    if (a.is_pursued && !a.stimulus.velocity && a.csv.empty()) refuse("--pursuit needs --velocity.");
    if (!a.plot.empty() && a.stimulus.frequency) refuse("--plot draws all frequencies: leave --frequency away.");
    if (!a.save.empty() && (a.stimulus.frequency || a.stimulus.luminance || a.stimulus.eccentricity))
        refuse("--save-table holds all frequencies, luminances and eccentricities: leave these options away.");
    if (a.stimulus.distance && a.csf.empty() && a.model_name != name(CsfModel::daly))
        refuse("--distance needs --model daly: the others do not depend on it.");
    if (outputs > 0 && !a.json.empty())
        refuse("--json is for one stimulus: leave --csv, --plot and --save-table away.");
    if (outputs > 0) return;
    if (!a.stimulus.frequency) refuse("--frequency is required, or else --csv, --plot or --save-table.");
    if (!a.stimulus.luminance) refuse("--luminance is required, or else --csv, --plot or --save-table.");
}

} // namespace

Command csf_command(CLI::App& app) {
    auto a = std::make_shared<CsfArguments>();
    StimulusOptions* s = &a->stimulus;
    CLI::App* verb =
        app.add_subcommand("csf", "Contrast sensitivity: 1 / the least visible contrast of a grating patch");
    verb->add_option("--model", a->model_name, "Which closed form (default: castle). " + model_list())
        ->type_name("NAME")
        ->check(one_of(model_names()));
    const auto number = [verb](const char* name, std::optional<double>& value, const CLI::Validator& validator,
                               const char* unit, const char* text) {
        verb->add_option_function<double>(
                name, [&value](const double& v) { value = v; }, text)
            ->type_name(unit)
            ->check(validator);
    };
    number("--frequency", s->frequency, positive(), "CPD", "Spatial frequency");
    number("--luminance", s->luminance, positive(), "CDM2", "Adaptation luminance");
    number("--eccentricity", s->eccentricity, not_negative(), "DEG", "From the point of gaze (default: 0)");
    number("--temporal", s->temporal, not_negative(), "HZ", "Temporal frequency (default: 0)");
    number("--velocity", s->velocity, not_negative(), "DEG/S", "How fast the grating moves on the retina (default: 0)");
    number("--distance", s->distance, positive(), "METRES", "Distance of the grating, for --model daly (default: 0.5)");
    number("--area", s->area, positive(), "DEG2", "Area of the patch (default: pi (1.5 / frequency)^2)");
    verb->add_flag("--pursuit", a->is_pursued,
                   "The velocity is the image's, and the eye pursues it: only its lag is left");
    verb->add_option_function<std::string>(
            "--field", [s](const std::string& name) { s->field = field_of(name); },
            "Side of the visual field: nasal, temporal, or the worst of them (default)")
        ->type_name("NAME")
        ->check(one_of({"nasal", "temporal", "worst"}));
    verb->add_option("--csv", a->csv, "Rows of stimuli, columns named like these options; adds 'sensitivity' to stdout")
        ->type_name("FILE|-");
    verb->add_option("--plot", a->plot, "Curves over frequency")
        ->type_name("OUT.png|.svg")
        ->check(ending_in({".png", ".svg"}));
    verb->add_flag("--table", a->by_table, "Through the interpolated table that fold tests use, not the closed form");
    verb->add_option("--csf", a->csf, "Through a model's table, or a viewer's")->type_name("MODEL|FILE");
    verb->add_option("--save-table", a->save, "With --table or --csf: write the table")
        ->type_name("OUT.json")
        ->check(ending_in({".json"}));
    add_json_option(*verb, a->json);
    verb->callback([o = a.get()] { check(*o); });
    verb->footer("Examples:\n  unseen csf --frequency 4 --luminance 100\n"
                 "  unseen csf --frequency 4 --luminance 100 --model barten-1999 --velocity 10 --pursuit\n"
                 "  unseen csf --csv stimuli.csv --model stela > with-sensitivity.csv\n  unseen csf --plot csf.png\n"
                 "  unseen csf --table --save-table standard.json\n"
                 "  unseen csf --table --velocity 5 --save-table moving.json");
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
