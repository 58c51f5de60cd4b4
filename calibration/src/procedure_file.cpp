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

// FNV-1a over all numbers of a table, in hexadecimal. As floats, since another machine's logarithms may differ in a
// double's last bits.
std::string hash_of(const CsfTable& table) {
    std::uint64_t hash = 0xcbf29ce484222325u;
    const auto add = [&](std::uint32_t bits) {
        for (int byte = 0; byte < 4; ++byte) hash = (hash ^ ((bits >> (8 * byte)) & 0xff)) * 0x100000001b3u;
    };
    const perception::CsfSamples& s = table.samples();
    for (const std::vector<double>* values :
         {&s.frequency_cpd, &s.eccentricity_deg, &s.luminance_cdm2, &s.sensitivity}) {
        add(static_cast<std::uint32_t>(values->size()));
        for (const double value : *values) add(std::bit_cast<std::uint32_t>(static_cast<float>(value)));
    }
    std::string text(16, '0');
    for (std::size_t digit = 0; digit < text.size(); ++digit)
        text[digit] = "0123456789abcdef"[(hash >> (60 - 4 * digit)) & 15];
    return text;
}

Result<std::vector<std::vector<double>>> read_rows(const JsonObject& object, const char* key, std::size_t width) {
    const auto array = object.array(key);
    if (!array) return array.error();
    std::vector<std::vector<double>> rows;
    for (const auto& row : **array) {
        std::vector<double> values;
        if (auto ok = object.append_numbers(row, in_brackets(key, rows.size()), width, values); !ok) return ok.error();
        rows.push_back(std::move(values));
    }
    return rows;
}

Result<Method> read_method(const JsonObject& object) {
    std::string text;
    if (auto ok = object.get("method", text); !ok) return ok.error();
    for (const Method method : {Method::two_interval, Method::adjustment})
        if (text == name(method)) return method;
    return object.key_error("method", "must be \"2ifc\" or \"adjustment\"");
}

Result<CalibrationPlan> read_plan(const JsonObject& object, int version) {
    CalibrationPlan plan;
    const auto method = read_method(object);
    if (!method) return method.error();
    plan.method = *method;
    const auto seed =
        object.number("seed", {.minimum = 0, .maximum = static_cast<double>(exact_integers), .whole = true});
    const auto trials = object.number("trials", {.minimum = 1, .maximum = most_plan_trials, .whole = true});
    const auto settings = object.number("settings", {.minimum = 2, .maximum = most_plan_settings, .whole = true});
    const auto luminance =
        object.number("luminance_cdm2", {.minimum = 0, .maximum = brightest_cdm2, .minimum_allowed = false});
    const auto contrast = object.number("highest_contrast", {.minimum = 0, .maximum = 1, .minimum_allowed = false});
    for (const auto* number : {&seed, &trials, &settings, &luminance, &contrast})
        if (!*number) return number->error();
    plan.seed = static_cast<std::uint64_t>(*seed);
    plan.trials = static_cast<int>(*trials);
    plan.settings = static_cast<int>(*settings);
    plan.luminance = Luminance(*luminance);
    plan.highest_contrast = *contrast;
    const auto places = read_rows(object, "places", version == wide_version ? 3 : 2);
    if (!places) return places.error();
    for (const auto& place : *places)
        plan.places.push_back({place[0], place[1], version == wide_version ? place[2] : 0});
    if (auto valid = validate(plan); !valid) return object.error(valid.error().message);
    return plan;
}

} // namespace

Result<void> Procedure::save(const std::filesystem::path& file) const {
    const CalibrationPlan& plan = state_->plan;
    const std::vector<Answer>& answers = state_->answers;
    const CsfTable& expected = state_->expected;
    const int version = summation() ? wide_version : small_version;
    std::string text = "{\n\"format\": " + to_json(state_format) + ",\n\"version\": " + std::to_string(version) +
                       ",\n\"method\": " + to_json(name(plan.method));
    text += ",\n\"seed\": " + std::to_string(plan.seed) + ",\n\"trials\": " + std::to_string(plan.trials) +
            ",\n\"settings\": " + std::to_string(plan.settings);
    text += ",\n\"luminance_cdm2\": " + to_text(plan.luminance.value()) +
            ",\n\"highest_contrast\": " + to_text(plan.highest_contrast) + ",\n\"places\": [";
    for (std::size_t i = 0; i < plan.places.size(); ++i)
        text += (i > 0 ? ", [" : "[") + to_text(plan.places[i].frequency_cpd) + ", " +
                to_text(plan.places[i].eccentricity_deg) +
                (version == wide_version ? ", " + to_text(plan.places[i].area_deg2) : "") + "]";
    text += "],\n\"expected\": " + to_json(expected.samples().source) +
            ",\n\"expected_hash\": " + to_json(hash_of(expected));
    text += ",\n\"answers\": [";
    for (std::size_t i = 0; i < answers.size(); ++i)
        text += (i > 0 ? ",\n[" : "\n[") + std::to_string(answers[i].place) + ", " +
                to_text(answers[i].log10_contrast) + ", " + (answers[i].is_right ? "1" : "0") + "]";
    return write_text(file, text + "]\n}\n");
}

Result<Procedure> Procedure::resume(const std::filesystem::path& file, CsfTable expected) {
    const auto object =
        JsonObject::read(file, {"format", "version", "method", "seed", "trials", "settings", "luminance_cdm2",
                                "highest_contrast", "places", "expected", "expected_hash", "answers"});
    if (!object) return object.error();
    std::string format = "missing";
    if (auto ok = object->get("format", format); !ok) return ok.error();
    if (format != state_format)
        return object->key_error("format", "must be \"unseen-calibration\": this is no interrupted calibration");
    const auto version = object->number("version", {.minimum = small_version, .maximum = wide_version, .whole = true});
    if (!version) return version.error();
    std::string begun_with = "another", hash = hash_of(expected);
    if (auto ok = object->get("expected", begun_with); !ok) return ok.error();
    if (auto ok = object->get("expected_hash", hash); !ok) return ok.error();
    if (hash != hash_of(expected))
        return object->key_error("expected", "is " + to_json(begun_with) + ", but the expected table is " +
                                                 to_json(expected.samples().source) +
                                                 ": go on with the one that the calibration was begun with");
    auto plan = read_plan(*object, static_cast<int>(*version));
    if (!plan) return plan.error();
    auto procedure = create(std::move(*plan), std::move(expected));
    if (!procedure) return object->error(procedure.error().message);

    const auto answers = read_rows(*object, "answers", 3);
    if (!answers) return answers.error();
    if (answers->size() > static_cast<std::size_t>(procedure->trials()))
        return object->key_error("answers", "has more of them than the plan has trials");
    for (std::size_t i = 0; i < answers->size(); ++i) {
        const auto& row = (*answers)[i];
        const std::string where = in_brackets("answers", i);
        const double places = static_cast<double>(procedure->state_->plan.places.size());
        if (!(row[0] >= 0 && row[0] < places && row[0] == std::trunc(row[0])))
            return object->key_error(where, "has no place " + to_text(row[0]));
        constexpr double least_log10 = -10;
        if (!(row[1] >= least_log10 && row[1] <= 0))
            return object->key_error(where, "has a log10 contrast that is not in -10..0");
        if (row[2] != 0 && row[2] != 1)
            return object->key_error(where, "must end in 1 (right, seen) or 0 (wrong, unseen)");
        if (procedure->state_->plan.method == Method::adjustment) {
            const std::size_t due = procedure->next().place;
            if (static_cast<std::size_t>(row[0]) != due)
                return object->key_error(where, "is not of the place whose turn it was");
        }
        procedure->state_->take(
            {static_cast<std::size_t>(row[0]), std::max(row[1], lowest_log10_contrast), row[2] == 1});
        procedure->state_
            ->combine(); // each time, so that beliefs come out to the last bit as if there had been no break
    }
    return procedure;
}

} // namespace unseen::calibration
