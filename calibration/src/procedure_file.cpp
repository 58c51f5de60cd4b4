// Interrupted calibrations as JSON files.
#include <bit>
#include <cmath>
#include <string_view>

#include "json_file.h"
#include "procedure_state.h"

namespace unseen::calibration {

using perception::CsfTable;
using perception::Luminance;

namespace {

constexpr std::string_view state_format = "unseen-calibration";
constexpr int small_version = 1, wide_version = 2; // without and with the patches' areas

// Of all numbers of a table, in hexadecimal. As floats, since another machine's logarithms may differ in a double's last
// bits.
std::string hash_of_table(const CsfTable& table) {
    std::string bytes;
    const auto add = [&](std::uint32_t bits) {
        for (int byte = 0; byte < 4; ++byte) bytes += static_cast<char>(bits >> (8 * byte));
    };
    const perception::CsfSamples& s = table.samples();
    for (const std::vector<double>* values :
         {&s.frequency_cpd, &s.eccentricity_deg, &s.luminance_cdm2, &s.sensitivity}) {
        add(static_cast<std::uint32_t>(values->size()));
        for (const double value : *values) add(std::bit_cast<std::uint32_t>(static_cast<float>(value)));
    }
    const std::uint64_t hash = hash_of(bytes);
    std::string text(16, '0');
    for (std::size_t digit = 0; digit < text.size(); ++digit)
        text[digit] = "0123456789abcdef"[(hash >> (60 - 4 * digit)) & 15];
    return text;
}

CalibrationPlan read_plan(const JsonObject& object, int version) {
    CalibrationPlan plan;
    std::string method;
    object.get("method", method);
    if (method == name(Method::adjustment)) plan.method = Method::adjustment;
    else if (method != name(Method::two_interval)) object.fail_at("method", "must be \"2ifc\" or \"adjustment\"");
    plan.seed = static_cast<std::uint64_t>(
        object.number("seed", {.minimum = 0, .maximum = static_cast<double>(exact_integers), .whole = true}));
    plan.trials = static_cast<int>(object.number("trials", {.minimum = 1, .maximum = most_plan_trials, .whole = true}));
    plan.settings =
        static_cast<int>(object.number("settings", {.minimum = 2, .maximum = most_plan_settings, .whole = true}));
    plan.luminance =
        Luminance(object.number("luminance_cdm2", {.minimum = 0, .maximum = brightest_cdm2, .minimum_allowed = false}));
    plan.highest_contrast = object.number("highest_contrast", {.minimum = 0, .maximum = 1, .minimum_allowed = false});
    for (std::vector<double> place : object.rows("places", version == wide_version ? 3 : 2)) {
        place.resize(3, 0.0);
        plan.places.push_back({place[0], place[1], place[2]});
    }
    if (auto valid = validate(plan); !valid) object.fail(valid.error().message);
    return plan;
}

} // namespace

Result<void> Procedure::save(const std::filesystem::path& file) const {
    const CalibrationPlan& plan = state_->plan;
    const int version = summation() ? wide_version : small_version;
    JsonWriter json;
    json.add_text("format", state_format);
    json.add("version", version);
    json.add_text("method", name(plan.method));
    json.add("seed", plan.seed);
    json.add("trials", plan.trials);
    json.add("settings", plan.settings);
    json.add("luminance_cdm2", plan.luminance.value());
    json.add("highest_contrast", plan.highest_contrast);
    std::string places, answers;
    for (const GratingPlace& place : plan.places) {
        std::vector<double> row = {place.frequency_cpd, place.eccentricity_deg};
        if (version == wide_version) row.push_back(place.area_deg2);
        places += (places.empty() ? "" : ", ") + to_json(row);
    }
    json.add("places", "[" + places + "]");
    json.add_text("expected", state_->expected.samples().source);
    json.add_text("expected_hash", hash_of_table(state_->expected));
    for (const Answer& answer : state_->answers)
        answers += (answers.empty() ? "\n[" : ",\n[") + std::to_string(answer.place) + ", " +
                   number_text(answer.log10_contrast) + ", " + (answer.is_right ? "1" : "0") + "]";
    json.add("answers", "[" + answers + "]");
    return json.write(file);
}

Result<Procedure> Procedure::resume(const std::filesystem::path& file, CsfTable expected) {
    const JsonObject object(file, {"format", "version", "method", "seed", "trials", "settings", "luminance_cdm2",
                                   "highest_contrast", "places", "expected", "expected_hash", "answers"});
    std::string format = "missing", begun_with = "another", hash = hash_of_table(expected);
    object.get("format", format);
    if (format != state_format)
        object.fail_at("format", "must be \"unseen-calibration\": this is no interrupted calibration");
    const double version = object.number("version", {.minimum = small_version, .maximum = wide_version, .whole = true});
    object.get("expected", begun_with);
    object.get("expected_hash", hash);
    if (hash != hash_of_table(expected))
        object.fail_at("expected", "is " + to_json(begun_with) + ", but the expected table is " +
                                       to_json(expected.samples().source) +
                                       ": go on with the one that the calibration was begun with");
    CalibrationPlan plan = read_plan(object, static_cast<int>(version));
    if (!object) return object.error();
    auto procedure = create(std::move(plan), std::move(expected));
    if (!procedure) {
        object.fail(procedure.error().message);
        return object.error();
    }
    const auto answers = object.rows("answers", 3);
    if (answers.size() > static_cast<std::size_t>(procedure->trials()))
        object.fail_at("answers", "has more of them than the plan has trials");
    State& state = *procedure->state_;
    for (std::size_t i = 0; i < answers.size() && object; ++i) {
        const auto& row = answers[i];
        const std::string where = in_brackets("answers", i);
        constexpr double least_log10 = -10;
        if (!(row[0] >= 0 && row[0] < static_cast<double>(state.plan.places.size()) && row[0] == std::trunc(row[0])))
            object.fail_at(where, "has no place " + number_text(row[0]));
        else if (!(row[1] >= least_log10 && row[1] <= 0))
            object.fail_at(where, "has a log10 contrast that is not in -10..0");
        else if (row[2] != 0 && row[2] != 1) object.fail_at(where, "must end in 1 (right, seen) or 0 (wrong, unseen)");
        else if (state.plan.method == Method::adjustment && static_cast<std::size_t>(row[0]) != procedure->next().place)
            object.fail_at(where, "is not of the place whose turn it was");
        if (!object) break;
        state.take({static_cast<std::size_t>(row[0]), std::max(row[1], lowest_log10_contrast), row[2] == 1});
        state.combine(); // each time, so that beliefs come out to the last bit as if there had been no break
    }
    if (!object) return object.error();
    return procedure;
}

} // namespace unseen::calibration
