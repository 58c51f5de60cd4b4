// Observer profiles: a contrast sensitivity table with one line of text per column over frequency.
#include <unseen/calibration/observer_profile.h>

#include <array>
#include <span>
#include <utility>

#include "json_file.h"

namespace unseen::calibration {
namespace {

constexpr std::string_view format_name = "unseen-csf";
constexpr int table_version = 1, measured_version = 2, summation_version = 3;

// [eccentricity][luminance][frequency], every array as long as its axis.
void read_sensitivity(const JsonObject& object, perception::CsfSamples& samples) {
    const std::size_t luminances = samples.luminance_cdm2.size();
    const auto has_length = [&](const nlohmann::json& array, const std::string& name, std::size_t length,
                                const char* axis) {
        if (array.is_array() && array.size() == length) return true;
        object.fail_at(name, "must be an array of " + std::to_string(length) + ", one for each of " + axis);
        return false;
    };
    const nlohmann::json& planes = object.array("sensitivity");
    if (!has_length(planes, "sensitivity", samples.eccentricity_deg.size(), "eccentricity_deg")) return;
    for (std::size_t e = 0; e < planes.size(); ++e) {
        const std::string plane = in_brackets("sensitivity", e);
        if (!has_length(planes[e], plane, luminances, "luminance_cdm2")) return;
        for (std::size_t l = 0; l < luminances && object; ++l) {
            const auto column = object.numbers(planes[e][l], in_brackets(plane, l), samples.frequency_cpd.size());
            samples.sensitivity.insert(samples.sensitivity.end(), column.begin(), column.end());
        }
    }
}

int read_version(const JsonObject& object) {
    std::string format = "missing";
    object.get("format", format);
    if (format != format_name) object.fail_at("format", "must be \"unseen-csf\": this is no sensitivity table");
    const double version = object.number("version", {.minimum = 1, .maximum = 1e9, .whole = true});
    if (version > summation_version)
        object.fail("key \"version\" must be 1 to 3, but is " + number_text(version) + ": a newer program wrote it",
                    ErrorCode::unsupported);
    return static_cast<int>(version);
}

constexpr std::pair<const char*, std::string ObserverProfile::*> texts[] = {
    {"observer", &ObserverProfile::observer},
    {"date", &ObserverProfile::date},
    {"method", &ObserverProfile::method},
    {"display", &ObserverProfile::display},
    {"conditions", &ObserverProfile::conditions}};

// Rows of "measured", or of "measured_wide", which have an area.
void read_measurements(const JsonObject& object, const char* key, bool is_wide, std::vector<Measurement>& measured) {
    std::size_t count = 0;
    for (std::vector<double> v : object.rows(key, is_wide ? 7 : 6)) {
        const std::string where = in_brackets(key, count++);
        double area = 0;
        if (is_wide) {
            area = v[2];
            v.erase(v.begin() + 2);
            if (!(area > 0)) object.fail_at(where, "must have an area above 0 as its third number");
        }
        constexpr double most_answers = 1e6;
        if (!(v[0] > 0 && v[1] >= 0))
            object.fail_at(where, "must begin with a frequency above 0 and an eccentricity of 0 or more");
        if (!(v[3] > 0 && v[3] <= v[2] && v[2] <= v[4]))
            object.fail_at(where, "must have a sensitivity above 0 that lies in its interval");
        if (!(v[5] >= 0 && v[5] <= most_answers)) object.fail_at(where, "must end in how many answers there were");
        if (!object) return;
        measured.push_back({{v[0], v[1], area}, v[2], v[3], v[4], static_cast<int>(v[5])});
    }
}

Summation read_summation(const JsonObject& object) {
    const std::vector<double> v = object.numbers(object.array("summation"), "summation", 3);
    constexpr double least = 1e-2, most = 1e2; // as CsfSamples has it
    if (!(v[0] >= least && v[0] <= most))
        object.fail_at("summation", "must begin with a factor from 0.01 to 100, which 1 is by castle's law");
    if (!(v[1] > 0 && v[1] <= v[0] && v[0] <= v[2]))
        object.fail_at("summation", "must be a factor, and the interval in which it lies");
    return {v[0], v[1], v[2]};
}

void read_circumstances(const JsonObject& object, int version, ObserverProfile& profile) {
    for (const auto& [key, text] : texts) object.get(key, profile.*text);
    profile.measured_at_cdm2 =
        object.number("measured_at_cdm2", {.minimum = 0, .maximum = 1e6, .minimum_allowed = false});
    read_measurements(object, "measured", false, profile.measured);
    if (version >= summation_version) read_measurements(object, "measured_wide", true, profile.measured);
}

void add_summation(JsonWriter& json, const Summation& summation) {
    json.add("summation", to_json(std::array{summation.own, summation.low, summation.high}));
}

} // namespace

Result<ObserverProfile> read_observer(const std::filesystem::path& file) {
    const JsonObject object(file, {"format", "version", "source", "frequency_cpd", "eccentricity_deg", "luminance_cdm2",
                                   "sensitivity", "observer", "date", "method", "display", "conditions",
                                   "measured_at_cdm2", "measured", "measured_wide", "summation"});
    const int version = read_version(object);
    for (const char* key : {"observer", "date", "method", "display", "conditions", "measured_at_cdm2", "measured"})
        if (version < measured_version && object.has(key))
            object.fail_at(key, "is unknown in version 1: remove it, or give version 2");
    for (const char* key : {"measured_wide", "summation"})
        if (version < summation_version && object.has(key))
            object.fail_at(key, "is unknown before version 3: remove it, or give version 3");

    perception::CsfSamples samples;
    object.get("source", samples.source);
    for (const auto& [key, axis] : {std::pair{"frequency_cpd", &samples.frequency_cpd},
                                    {"eccentricity_deg", &samples.eccentricity_deg},
                                    {"luminance_cdm2", &samples.luminance_cdm2}}) {
        *axis = object.numbers(object.array(key), key);
        if (axis->empty()) object.fail_at(key, "is empty");
    }
    read_sensitivity(object, samples);
    ObserverProfile profile;
    if (version >= summation_version) profile.summation = read_summation(object);
    if (!object) return object.error();
    samples.summation = profile.summation.own;
    auto table = perception::CsfTable::create(std::move(samples));
    if (!table) object.fail(table.error().message);
    else profile.table = std::move(*table);
    const bool is_table_alone = version >= summation_version && !object.has("measured"); // of write_csf()
    if (version >= measured_version && !is_table_alone) read_circumstances(object, version, profile);
    if (!object) return object.error();
    return profile;
}

Result<perception::CsfTable> read_csf(const std::filesystem::path& file) {
    auto profile = read_observer(file);
    if (!profile) return profile.error();
    return std::move(profile->table);
}

namespace {

JsonWriter begin(int version) {
    JsonWriter json;
    json.add_text("format", format_name);
    json.add("version", version);
    return json;
}

Result<void> write(const std::filesystem::path& file, const perception::CsfTable& table, JsonWriter json) {
    const perception::CsfSamples& samples = table.samples();
    json.add_text("source", samples.source);
    json.add("frequency_cpd", to_json(samples.frequency_cpd));
    json.add("eccentricity_deg", to_json(samples.eccentricity_deg));
    json.add("luminance_cdm2", to_json(samples.luminance_cdm2));
    const std::size_t frequencies = samples.frequency_cpd.size(), luminances = samples.luminance_cdm2.size();
    std::string text = "[";
    for (std::size_t column = 0; column * frequencies < samples.sensitivity.size(); ++column) {
        if (column % luminances == 0) text += column > 0 ? "],\n[" : "\n[";
        text += (column % luminances > 0 ? ",\n" : "\n") +
                to_json(std::span(samples.sensitivity).subspan(column * frequencies, frequencies));
    }
    json.add("sensitivity", text + "]]");
    return json.write(file);
}

} // namespace

Result<void> write_csf(const std::filesystem::path& file, const perception::CsfTable& table) {
    const double own = table.samples().summation;
    if (own == 1) return write(file, table, begin(table_version));
    JsonWriter json = begin(summation_version);
    add_summation(json, {own, own, own});
    return write(file, table, std::move(json));
}

Result<void> write_observer(const std::filesystem::path& file, const ObserverProfile& profile) {
    JsonWriter json = begin(profile.has_summation() ? summation_version : measured_version);
    for (const auto& [key, text] : texts) json.add_text(key, profile.*text);
    const auto add_rows = [&](const char* key, bool is_wide) {
        std::string lines;
        for (const Measurement& m : profile.measured) {
            if (m.place.is_wide() != is_wide) continue;
            std::vector<double> row = {m.place.frequency_cpd, m.place.eccentricity_deg};
            if (is_wide) row.push_back(m.place.area_deg2);
            row.insert(row.end(), {m.sensitivity, m.low, m.high, static_cast<double>(m.answers)});
            lines += (lines.empty() ? "\n" : ",\n") + to_json(row);
        }
        json.add(key, "[" + lines + "]");
    };
    json.add("measured_at_cdm2", profile.measured_at_cdm2);
    add_rows("measured", false);
    if (profile.has_summation()) {
        add_rows("measured_wide", true);
        add_summation(json, profile.summation);
    }
    return write(file, profile.table, std::move(json));
}

} // namespace unseen::calibration
