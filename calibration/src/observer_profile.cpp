// Observer profiles: a contrast sensitivity table with one line of text per column over frequency.
#include <calibration/observer_profile.h>

#include <initializer_list>
#include <span>

#include "json_file.h"

namespace unseen::calibration {
namespace {

constexpr std::string_view format_name = "unseen-csf";
constexpr int format_version = 1;

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

Result<void> check_format(const JsonObject& object) {
    std::string format = "missing";
    if (auto ok = object.get("format", format); !ok) return ok;
    if (format != format_name) {
        return object.key_error("format", "must be \"unseen-csf\": this is no sensitivity table");
    }
    const auto version = object.number("version", {.minimum = 1, .maximum = 1e9, .whole = true});
    if (!version) return version.error();
    if (*version == format_version) return {};
    Error error = object.key_error("version", "must be 1, but is " + to_text(*version) + ": a newer program wrote it");
    error.code = ErrorCode::unsupported;
    return error;
}

std::string to_array(std::span<const double> values) {
    std::string text = "[";
    for (const double value : values) text.append(text.size() > 1 ? ", " : "").append(to_text(value));
    return text.append("]");
}

} // namespace

Result<perception::CsfTable> read_csf(const std::filesystem::path& file) {
    const auto object = JsonObject::read(file, {"format", "version", "source", "frequency_cpd", "eccentricity_deg",
                                                "luminance_cdm2", "sensitivity"});
    if (!object) return object.error();
    if (auto ok = check_format(*object); !ok) return ok.error();

    perception::CsfSamples samples;
    if (auto ok = object->get("source", samples.source); !ok) return ok.error();
    for (const auto& [key, axis] : {std::pair{"frequency_cpd", &samples.frequency_cpd},
                                    std::pair{"eccentricity_deg", &samples.eccentricity_deg},
                                    std::pair{"luminance_cdm2", &samples.luminance_cdm2}}) {
        auto values = read_axis(*object, key);
        if (!values) return values.error();
        *axis = *std::move(values);
    }
    if (auto ok = read_sensitivity(*object, samples); !ok) return ok.error();

    auto table = perception::CsfTable::create(std::move(samples));
    if (!table) return object->error(table.error().message);
    return table;
}

Result<void> write_csf(const std::filesystem::path& file, const perception::CsfTable& table) {
    const perception::CsfSamples& samples = table.samples();
    std::string text = "{\n\"format\": " + to_json(format_name) + ",\n\"version\": " + std::to_string(format_version);
    text += ",\n\"source\": " + to_json(samples.source);
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

} // namespace unseen::calibration
