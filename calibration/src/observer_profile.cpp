// Observer profiles: a contrast sensitivity table with one line of text per column over frequency.
#include <unseen/calibration/observer_profile.h>

#include <initializer_list>
#include <span>

#include "json_file.h"

namespace unseen::calibration {
namespace {

constexpr std::string_view format_name = "unseen-csf";
constexpr int table_version = 1, measured_version = 2, summation_version = 3;

Result<std::vector<double>> read_axis(const JsonObject& object, const char* key) {
    const auto array = object.array(key);
    if (!array) return array.error();
    if ((*array)->empty()) return object.key_error(key, "is empty");
    std::vector<double> values;
    if (auto ok = object.append_numbers(**array, key, std::nullopt, values); !ok) return ok.error();
    return values;
}

std::string place(std::initializer_list<std::size_t> indices) {
    std::string text = "sensitivity";
    for (const std::size_t i : indices) text.append("[").append(std::to_string(i)).append("]");
    return text;
}

// [eccentricity][luminance][frequency], every array as long as its axis.
Result<void> read_sensitivity(const JsonObject& object, perception::CsfSamples& samples) {
    const auto planes = object.array("sensitivity");
    if (!planes) return planes.error();
    const std::size_t eccentricities = samples.eccentricity_deg.size(), luminances = samples.luminance_cdm2.size();
    const auto check_length = [&](const nlohmann::json& array, const std::string& name, std::size_t length,
                                  const char* axis) -> Result<void> {
        if (array.is_array() && array.size() == length) return {};
        return object.key_error(name, "must be an array of " + std::to_string(length) + ", one for each of " + axis);
    };
    if (auto ok = check_length(**planes, place({}), eccentricities, "eccentricity_deg"); !ok) return ok;
    for (std::size_t e = 0; e < eccentricities; ++e) {
        const nlohmann::json& columns = (**planes)[e];
        if (auto ok = check_length(columns, place({e}), luminances, "luminance_cdm2"); !ok) return ok;
        for (std::size_t l = 0; l < luminances; ++l) {
            const std::size_t frequencies = samples.frequency_cpd.size();
            auto ok = object.append_numbers(columns[l], place({e, l}), frequencies, samples.sensitivity);
            if (!ok) return ok;
        }
    }
    return {};
}

Result<int> read_version(const JsonObject& object) {
    std::string format = "missing";
    if (auto ok = object.get("format", format); !ok) return ok.error();
    if (format != format_name) {
        return object.key_error("format", "must be \"unseen-csf\": this is no sensitivity table");
    }
    const auto version = object.number("version", {.minimum = 1, .maximum = 1e9, .whole = true});
    if (!version) return version.error();
    if (*version <= summation_version) return static_cast<int>(*version);
    Error error =
        object.key_error("version", "must be 1 to 3, but is " + to_text(*version) + ": a newer program wrote it");
    error.code = ErrorCode::unsupported;
    return error;
}

constexpr const char* text_keys[] = {"observer", "date", "method", "display", "conditions"};
constexpr std::string ObserverProfile::*texts[] = {&ObserverProfile::observer, &ObserverProfile::date,
                                                   &ObserverProfile::method, &ObserverProfile::display,
                                                   &ObserverProfile::conditions};

// Rows of "measured", or of "measured_wide", which have an area.
Result<void> read_measurements(const JsonObject& object, const char* key, bool is_wide,
                               std::vector<Measurement>& measured) {
    const auto rows = object.array(key);
    if (!rows) return rows.error();
    std::size_t count = 0;
    for (const auto& row : **rows) {
        const std::string where = std::string(key).append("[").append(std::to_string(count++)).append("]");
        std::vector<double> v;
        if (auto ok = object.append_numbers(row, where, is_wide ? 7 : 6, v); !ok) return ok.error();
        double area = 0;
        if (is_wide) {
            area = v[2];
            v.erase(v.begin() + 2);
            if (!(area > 0)) return object.key_error(where, "must have an area above 0 as its third number");
        }
        const bool is_place = v[0] > 0 && v[1] >= 0;
        const bool is_interval = v[3] > 0 && v[3] <= v[2] && v[2] <= v[4];
        constexpr double most_answers = 1e6;
        if (!is_place)
            return object.key_error(where, "must begin with a frequency above 0 and an eccentricity of 0 or more");
        if (!is_interval) return object.key_error(where, "must have a sensitivity above 0 that lies in its interval");
        if (!(v[5] >= 0 && v[5] <= most_answers))
            return object.key_error(where, "must end in how many answers there were");
        measured.push_back({{v[0], v[1], area}, v[2], v[3], v[4], static_cast<int>(v[5])});
    }
    return {};
}

Result<void> read_summation(const JsonObject& object, Summation& summation) {
    const auto array = object.array("summation");
    if (!array) return array.error();
    std::vector<double> v;
    if (auto ok = object.append_numbers(**array, "summation", 3, v); !ok) return ok;
    constexpr double least = 1e-2, most = 1e2; // as CsfSamples has it
    if (!(v[0] >= least && v[0] <= most))
        return object.key_error("summation", "must begin with a factor from 0.01 to 100, which 1 is by castle's law");
    if (!(v[1] > 0 && v[1] <= v[0] && v[0] <= v[2]))
        return object.key_error("summation", "must be a factor, and the interval in which it lies");
    summation = {v[0], v[1], v[2]};
    return {};
}

Result<void> read_circumstances(const JsonObject& object, int version, ObserverProfile& profile) {
    for (std::size_t i = 0; i < std::size(text_keys); ++i)
        if (auto ok = object.get(text_keys[i], profile.*texts[i]); !ok) return ok;
    const Range positive{.minimum = 0, .maximum = 1e6, .minimum_allowed = false};
    const auto luminance = object.number("measured_at_cdm2", positive);
    if (!luminance) return luminance.error();
    profile.measured_at_cdm2 = *luminance;
    if (auto ok = read_measurements(object, "measured", false, profile.measured); !ok) return ok;
    if (version < summation_version) return {};
    return read_measurements(object, "measured_wide", true, profile.measured);
}

std::string to_array(std::span<const double> values) {
    std::string text = "[";
    for (const double value : values) text.append(text.size() > 1 ? ", " : "").append(to_text(value));
    return text.append("]");
}

std::string summation_key(const Summation& summation) {
    const double values[] = {summation.own, summation.low, summation.high};
    return ",\n\"summation\": " + to_array(values);
}

} // namespace

Result<ObserverProfile> read_observer(const std::filesystem::path& file) {
    const auto object =
        JsonObject::read(file, {"format", "version", "source", "frequency_cpd", "eccentricity_deg", "luminance_cdm2",
                                "sensitivity", "observer", "date", "method", "display", "conditions",
                                "measured_at_cdm2", "measured", "measured_wide", "summation"});
    if (!object) return object.error();
    const auto version = read_version(*object);
    if (!version) return version.error();
    for (const char* key : {"observer", "date", "method", "display", "conditions", "measured_at_cdm2", "measured"})
        if (*version < measured_version && object->has(key))
            return object->key_error(key, "is unknown in version 1: remove it, or give version 2");
    for (const char* key : {"measured_wide", "summation"})
        if (*version < summation_version && object->has(key))
            return object->key_error(key, "is unknown before version 3: remove it, or give version 3");

    perception::CsfSamples samples;
    if (auto ok = object->get("source", samples.source); !ok) return ok.error();
    for (const auto& [key, axis] :
         {std::pair{"frequency_cpd", &samples.frequency_cpd}, std::pair{"eccentricity_deg", &samples.eccentricity_deg},
          std::pair{"luminance_cdm2", &samples.luminance_cdm2}}) {
        auto values = read_axis(*object, key);
        if (!values) return values.error();
        *axis = *std::move(values);
    }
    if (auto ok = read_sensitivity(*object, samples); !ok) return ok.error();

    ObserverProfile profile;
    if (*version >= summation_version)
        if (auto ok = read_summation(*object, profile.summation); !ok) return ok.error();
    samples.summation = profile.summation.own;
    auto table = perception::CsfTable::create(std::move(samples));
    if (!table) return object->error(table.error().message);
    profile.table = std::move(*table);
    const bool is_table_alone = *version >= summation_version && !object->has("measured"); // of write_csf()
    if (*version >= measured_version && !is_table_alone)
        if (auto ok = read_circumstances(*object, *version, profile); !ok) return ok.error();
    return profile;
}

Result<perception::CsfTable> read_csf(const std::filesystem::path& file) {
    auto profile = read_observer(file);
    if (!profile) return profile.error();
    return std::move(profile->table);
}

namespace {

// `circumstances`: further keys, each with a comma before it.
Result<void> write(const std::filesystem::path& file, const perception::CsfTable& table, int version,
                   const std::string& circumstances) {
    const perception::CsfSamples& samples = table.samples();
    std::string text = "{\n\"format\": " + to_json(format_name) + ",\n\"version\": " + std::to_string(version);
    text += circumstances + ",\n\"source\": " + to_json(samples.source);
    text += ",\n\"frequency_cpd\": " + to_array(samples.frequency_cpd);
    text += ",\n\"eccentricity_deg\": " + to_array(samples.eccentricity_deg);
    text += ",\n\"luminance_cdm2\": " + to_array(samples.luminance_cdm2);

    const std::size_t frequencies = samples.frequency_cpd.size(), luminances = samples.luminance_cdm2.size();
    text += ",\n\"sensitivity\": [";
    for (std::size_t e = 0; e < samples.eccentricity_deg.size(); ++e) {
        text += e > 0 ? ",\n[" : "\n[";
        for (std::size_t l = 0; l < luminances; ++l) {
            const double* column = samples.sensitivity.data() + (e * luminances + l) * frequencies;
            text += (l > 0 ? ",\n" : "\n") + to_array({column, frequencies});
        }
        text += "]";
    }
    return write_text(file, text + "]\n}\n");
}

} // namespace

Result<void> write_csf(const std::filesystem::path& file, const perception::CsfTable& table) {
    const double own = table.samples().summation;
    if (own == 1) return write(file, table, table_version, {});
    return write(file, table, summation_version, summation_key({own, own, own}));
}

Result<void> write_observer(const std::filesystem::path& file, const ObserverProfile& profile) {
    std::string text;
    for (std::size_t i = 0; i < std::size(text_keys); ++i)
        text += ",\n\"" + std::string(text_keys[i]) + "\": " + to_json(profile.*texts[i]);
    const auto rows = [&](const char* key, bool is_wide) {
        std::string lines;
        for (const Measurement& m : profile.measured) {
            if (m.place.is_wide() != is_wide) continue;
            std::vector<double> row = {m.place.frequency_cpd, m.place.eccentricity_deg};
            if (is_wide) row.push_back(m.place.area_deg2);
            row.insert(row.end(), {m.sensitivity, m.low, m.high, static_cast<double>(m.answers)});
            lines += (lines.empty() ? "\n" : ",\n") + to_array(row);
        }
        return ",\n\"" + std::string(key) + "\": [" + lines + "]";
    };
    text += ",\n\"measured_at_cdm2\": " + to_text(profile.measured_at_cdm2) + rows("measured", false);
    if (!profile.has_summation()) return write(file, profile.table, measured_version, text);
    text += rows("measured_wide", true) + summation_key(profile.summation);
    return write(file, profile.table, summation_version, text);
}

} // namespace unseen::calibration
