// The parts of the perception benchmark that draw nothing: contrast sensitivities against published figures, and
// calibration against simulated observers.
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <random>
#include <string_view>
#include <utility>

#include <unseen/calibration/internal/simulated_observer.h>
#include <unseen/calibration/procedure.h>
#include <unseen/perception/csf.h>
#include <unseen/perception/display.h>
#include <unseen/vdtree/internal/csv.h>
#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/number_text.h>

#include "bench_tools.h"
#include "perception_bench.h"
#include "progress_bar.h"
#include "terminal.h"

namespace unseen::app {
namespace {

namespace fs = std::filesystem;
using perception::CsfModel;
using perception::CsfTable;
using perception::CyclesPerDegree;
using perception::Degrees;
using perception::Luminance;
using perception::Stimulus;

// ---- reference figures

// A number as it is printed: the true one is within half a unit of its last digit.
struct Printed {
    double value = 0, half_unit = 0;
};

std::optional<Printed> printed(std::string_view text) {
    const auto value = finite_from(text);
    if (!value) return std::nullopt;
    Printed number{.value = *value};
    const std::size_t point = text.find('.'), exponent = text.find_first_of("eE");
    const double decimals = point == text.npos ? 0 : static_cast<double>(std::min(exponent, text.size()) - point - 1);
    const int scale = exponent == text.npos ? 0 : number_from<int>(text.substr(exponent + 1)).value_or(0);
    number.half_unit = 0.5 * std::pow(10, scale - decimals);
    return number;
}

// Columns by name; lines that begin with '#' are remarks.
struct Reference {
    struct Row {
        std::size_t line = 0; // of the file, from 1
        std::vector<std::string> cells;
    };
    fs::path file;
    std::vector<std::string> columns;
    std::vector<Row> rows;

    Result<Printed> number(const Row& row, std::size_t column) const {
        if (const auto value = printed(row.cells[column])) return *value;
        return Error{ErrorCode::malformed_data, file.string() + ": line " + std::to_string(row.line) + ": '" +
                                                    row.cells[column] + "' in column '" + columns[column] +
                                                    "' is no number."};
    }
    std::optional<std::size_t> column(std::initializer_list<const char*> names) const {
        for (std::size_t i = 0; i < columns.size(); ++i)
            for (const char* name : names)
                if (columns[i] == name) return i;
        return std::nullopt;
    }
};

std::optional<Reference> read_reference(const fs::path& file) {
    const auto text = read_text_file(file);
    if (!text) return std::nullopt;
    constexpr std::size_t most_fields = 1000;
    const auto records = parse_csv(*text, file.string(), most_fields);
    if (!records) return std::nullopt;
    Reference reference;
    reference.file = file;
    for (const CsvRecord& record : *records) {
        if (record.fields[0].starts_with('#')) continue;
        if (reference.columns.empty()) reference.columns = record.fields;
        else if (record.fields.size() == reference.columns.size())
            reference.rows.push_back({static_cast<std::size_t>(record.line), record.fields});
    }
    return reference;
}

std::optional<Reference> find_reference(const std::string& folder, std::initializer_list<const char*> names) {
    const fs::path where = folder.empty() ? find_in_checkout("tests/data") : fs::path(folder);
    if (where.empty()) return std::nullopt;
    for (const char* name : names)
        if (auto reference = read_reference(where / name)) return reference;
    return std::nullopt;
}

struct Deviation {
    double largest = 0;
    std::size_t values = 0;

    // Relative, beyond what printing has taken from the reference.
    void add(double value, const Printed& reference, double scale = 1) {
        const double off =
            std::max(0.0, std::abs(value * scale - reference.value) - reference.half_unit) / std::abs(reference.value);
        ++values;
        if (!(off <= largest)) largest = off; // NaN, too
    }
};

struct Compared {
    CsfModel model;
    std::initializer_list<const char*> columns;
    double scale = 1; // of the reference's values in those of `sensitivity`
    bool knows_eccentricity = true;
};

// The greatest values of the published relative curves, to which the models are scaled.
constexpr double mannos_sakrison_peak = 0.98087787655726166, rushmeier_peak = 1.8830747958791485;

// The stimulus of a row, whose columns are told by number.
struct StimulusColumns {
    std::size_t frequency, luminance, area, eccentricity;
    std::optional<std::size_t> temporal, field;
};

Result<Stimulus> stimulus_of(const Reference& reference, const Reference::Row& row, const StimulusColumns& columns) {
    double frequency = 0, luminance = 0, area = 0, eccentricity = 0, temporal = 0, field = 0;
    for (const auto& [column, value] : {std::pair(std::optional(columns.frequency), &frequency),
                                        {columns.luminance, &luminance},
                                        {columns.area, &area},
                                        {columns.eccentricity, &eccentricity},
                                        {columns.temporal, &temporal},
                                        {columns.field, &field}}) {
        if (!column) continue;
        const auto number = reference.number(row, *column);
        if (!number) return number.error();
        *value = number->value;
    }
    Stimulus s;
    s.frequency = CyclesPerDegree(frequency);
    s.luminance = Luminance(luminance);
    s.area = perception::SquareDegrees(area);
    s.eccentricity = Degrees(eccentricity);
    s.temporal = perception::Hertz(temporal);
    if (columns.field) s.field = field == 0 ? perception::VisualField::temporal : perception::VisualField::nasal;
    return s;
}

Result<void> compare(const Reference& reference, std::initializer_list<Compared> models, const Target& target,
                     std::vector<BenchRow>& rows) {
    const auto frequency = reference.column({"frequency", "s_frequency"}), luminance = reference.column({"luminance"}),
               area = reference.column({"area"}), eccentricity = reference.column({"eccentricity"}),
               temporal = reference.column({"temporal", "t_frequency"}),
               field = reference.column({"field", "vis_field"});
    for (const Compared& compared : models) {
        const auto column = reference.column(compared.columns);
        const std::string name = "deviation of " + std::string(perception::name(compared.model));
        if (!column || !frequency || !luminance || !area || !eccentricity) {
            rows.push_back(
                {name, "1e-9", "'" + reference.file.string() + "' has no such column", {}, target, false, 3});
            continue;
        }
        Deviation deviation;
        for (const Reference::Row& row : reference.rows) {
            auto s = stimulus_of(reference, row, {*frequency, *luminance, *area, *eccentricity, temporal, field});
            if (!s) return s.error();
            if (!compared.knows_eccentricity) s->eccentricity = Degrees(0);
            const auto value = reference.number(row, *column);
            if (!value) return value.error();
            deviation.add(perception::sensitivity(compared.model, *s), *value, compared.scale);
        }
        rows.push_back({name, "1e-9",
                        std::to_string(deviation.values) + " values of " + reference.file.filename().string() +
                            ", beyond the rounding of their last digit",
                        deviation.largest * 1e9, target, false, 3});
    }
    return {};
}

// ---- tables

// In random places where S is above 1, half of them within 25 degrees, where most is visible.
double largest_table_error(CsfModel model, int places) {
    const CsfTable table = CsfTable::from_model(model);
    std::mt19937_64 random(1);
    const auto uniform = [&](double low, double high) {
        return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
    };
    double largest = 0;
    for (int i = 0; i < places; ++i) {
        const CyclesPerDegree frequency(std::exp2(uniform(-4, 6)));
        const Degrees eccentricity(uniform(0, 1) < 0.5 ? uniform(0, 25) : uniform(0, 120));
        const Luminance luminance(std::pow(10, uniform(-3, 4)));
        const double s =
            perception::sensitivity(model, perception::stimulus_of({}, frequency, eccentricity, luminance));
        if (!(s > 1)) continue;
        const double off = std::abs(table.sensitivity(frequency, eccentricity, luminance) / s - 1);
        if (!(off <= largest)) largest = off;
    }
    return largest;
}

// ---- observers

// The last four are of other shapes than the castleCSF that is expected of everybody.
constexpr const char* observers[] = {"castle",
                                     "castle:gain=0.7",
                                     "castle:gain=1.6,frequency=1.3,eccentricity=0.7",
                                     "castle:gain=0.35,frequency=0.75,eccentricity=1.5",
                                     "stela",
                                     "stela:gain=0.5,frequency=1.2",
                                     "castle:slope=2,lapse=0.03",
                                     "castle:slope=5,lapse=0",
                                     "barten-1999:gain=0.5,frequency=0.8",
                                     "barten-2004",
                                     "daly:gain=0.6",
                                     "daly:frequency=1.3,slope=3"};

// Root mean square over the places that the observer can see.
double error_db(const calibration::Procedure& procedure, const calibration::SimulatedObserver& observer) {
    double squares = 0, count = 0;
    for (const calibration::PlaceEstimate& e : procedure.estimates()) {
        const double truth = observer.sensitivity(e.place, procedure.plan().luminance);
        if (!(truth * procedure.plan().highest_contrast >= 1)) continue;
        squares += std::pow(20 * std::log10(e.sensitivity() / truth), 2);
        ++count;
    }
    return std::sqrt(squares / count);
}

struct ObserverErrors {
    std::string observer;
    double mean = 0, worst = 0;
};

BenchRow observer_row(const std::string& name, const std::vector<ObserverErrors>& errors, bool of_worst_run,
                      const Target& target) {
    BenchRow row{name, "dB", "", 0, target, false, 2};
    for (const ObserverErrors& e : errors) {
        row.value = std::max(*row.value, of_worst_run ? e.worst : e.mean);
        row.note += (row.note.empty() ? "" : "; ") + e.observer + " " + rounded(of_worst_run ? e.worst : e.mean, 3);
    }
    return row;
}

} // namespace

Result<std::vector<BenchRow>> bench_csf(const SensitivityBenchOptions& options) {
    std::vector<BenchRow> rows;
    const auto target = [&](std::string_view figure) { return options.targets.of("perception", figure); };
    const Target castle = target("deviation of castle and stela, 1e-9"),
                 classical = target("deviation of the classical models, 1e-9");
    const char* const none = "no reference figures: run it in the checkout, or name their folder by --reference";
    if (const auto reference = find_reference(options.reference, {"csf_golden.csv", "csf_castle_stela_grid.csv"})) {
        const auto compared = compare(
            *reference, {{CsfModel::castle, {"castle", "S_castle_ach"}}, {CsfModel::stela, {"stela", "S_stela"}}},
            castle, rows);
        if (!compared) return compared.error();
    } else rows.push_back({"deviation of castle and stela", "1e-9", none, {}, castle, false, 3});
    const double scale = 1 / perception::relative_models_peak;
    if (const auto reference =
            find_reference(options.reference, {"csf_classical_golden.csv", "csf_classical_grid.csv"})) {
        const auto compared =
            compare(*reference,
                    {{CsfModel::daly, {"daly", "daly93"}},
                     {CsfModel::barten_1989, {"barten_1989", "barten89_pdiff"}, 1, false},
                     {CsfModel::barten_1999, {"barten_1999", "barten99"}, 1, false},
                     {CsfModel::barten_2004, {"barten_2004", "barten04"}, 1, false},
                     {CsfModel::mannos_sakrison, {"mannos_sakrison"}, scale * mannos_sakrison_peak, false},
                     {CsfModel::rushmeier, {"rushmeier"}, scale * rushmeier_peak, false}},
                    classical, rows);
        if (!compared) return compared.error();
    } else rows.push_back({"deviation of the classical models", "1e-9", none, {}, classical, false, 3});

    BenchRow tables{"error of the tables",
                    "%",
                    "the largest of all models in random places where S > 1: ",
                    0,
                    target("error of the tables, %"),
                    false,
                    2};
    ProgressBar bar("tables");
    std::size_t done = 0;
    for (const CsfModel model : perception::csf_models) {
        bar(static_cast<double>(done) / perception::csf_models.size(), std::string(perception::name(model)).c_str());
        const double error = 100 * largest_table_error(model, options.quick ? 2'000 : 30'000);
        tables.note += (done++ ? ", " : "") + std::string(perception::name(model)) + " " + rounded(error, 2);
        if (!(error <= *tables.value)) tables.value = error;
    }
    rows.push_back(std::move(tables));
    return rows;
}

Result<std::vector<BenchRow>> bench_observers(const SensitivityBenchOptions& options) {
    const int runs = options.quick ? 1 : 24;
    constexpr int few = 200, many = 400;
    const perception::Display display;
    std::vector<ObserverErrors> at_few, at_many;
    ProgressBar bar("calibrating");
    for (const char* description : observers) {
        ObserverErrors of_few{description, 0, 0}, of_many{description, 0, 0};
        for (int run = 1; run <= runs; ++run) {
            calibration::CalibrationPlan plan = calibration::plan_for(display, CsfTable::standard());
            std::erase_if(plan.places, [](const calibration::GratingPlace& p) { return p.is_wide(); });
            plan.trials = many;
            plan.seed = static_cast<std::uint64_t>(run);
            auto procedure = calibration::Procedure::create(plan, CsfTable::standard());
            if (!procedure) return procedure.error();
            const auto observer = calibration::simulated_observer(description, 100 + static_cast<std::uint64_t>(run));
            if (!observer) return observer.error();
            const auto note = [&](ObserverErrors& errors) {
                const double db = error_db(*procedure, *observer);
                errors.mean += db / runs;
                if (!(db <= errors.worst)) errors.worst = db;
            };
            while (!procedure->is_done()) {
                bar((static_cast<double>(at_many.size()) + static_cast<double>(run - 1) / runs) / std::size(observers),
                    description);
                if (procedure->answers().size() == few) note(of_few);
                procedure->choose(observer->choose(procedure->next(), plan.luminance));
            }
            note(of_many);
        }
        at_few.push_back(std::move(of_few));
        at_many.push_back(std::move(of_many));
    }
    const std::string of_runs =
        ", mean of " + std::to_string(runs) + (runs > 1 ? " runs" : " run") + ", the worst observer";
    const Target after_many = options.targets.of("perception", "calibration in 400 trials, dB"),
                 after_few = options.targets.of("perception", "calibration in 200 trials, dB");
    return std::vector<BenchRow>{observer_row("calibration in 400 trials" + of_runs, at_many, false, after_many),
                                 observer_row("calibration in 400 trials, the worst run", at_many, true, after_many),
                                 observer_row("calibration in 200 trials" + of_runs, at_few, false, after_few),
                                 observer_row("calibration in 200 trials, the worst run", at_few, true, after_few)};
}

} // namespace unseen::app
