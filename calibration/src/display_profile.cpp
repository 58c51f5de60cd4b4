// Display profiles: every key is read with its range, then the whole is validated as any display is.
#include <unseen/calibration/display_profile.h>

#include <cmath>
#include <limits>

#include "json_file.h"

namespace unseen::calibration {
namespace {

using perception::Display;
using perception::TransferFunction;

constexpr double unbounded = std::numeric_limits<double>::max();
constexpr Range positive{.minimum = 0, .maximum = unbounded, .minimum_allowed = false};
constexpr Range not_negative{.minimum = 0, .maximum = unbounded};
constexpr Range share{.minimum = 0, .maximum = 1};
// Pixels along one side; far above any screen, and safe to square.
constexpr Range pixel_count{.minimum = 1, .maximum = 1e6, .whole = true};

// From the pitch, or from the diagonal of a screen with square pixels.
Result<double> read_pixel_pitch(const JsonObject& object, int width_px, int height_px) {
    if (object.has("pixel_pitch_m") && object.has("diagonal_m")) {
        return object.key_error("diagonal_m", "and key \"pixel_pitch_m\" say the same: remove one");
    }
    if (object.has("pixel_pitch_m")) return object.number("pixel_pitch_m", positive);
    if (!object.has("diagonal_m")) {
        return object.error("the size of the screen is missing: give key \"pixel_pitch_m\" or \"diagonal_m\"");
    }
    const Result<double> diagonal = object.number("diagonal_m", positive);
    if (!diagonal) return diagonal.error();
    return *diagonal / std::hypot(width_px, height_px);
}

Result<void> read_transfer(const JsonObject& object, Display& display) {
    double gamma = 0;
    if (const auto as_number = object.get("transfer", gamma, positive); as_number && gamma > 0) {
        display.transfer = TransferFunction::gamma;
        display.gamma = gamma;
        return {};
    }
    std::string text = "srgb";
    if (const auto as_string = object.get("transfer", text); as_string && text == "srgb") {
        display.transfer = TransferFunction::srgb;
        return {};
    }
    for (const auto& [name, transfer] : {std::pair{"linear", TransferFunction::linear},
                                         {"pq", TransferFunction::pq},
                                         {"table", TransferFunction::table}}) {
        if (text != name) continue;
        display.transfer = transfer;
        return {};
    }
    return object.key_error("transfer",
                            "must be \"srgb\", \"linear\", \"pq\", \"table\", or a gamma as a number above 0");
}

// The keys that only some displays have.
Result<void> read_table(const JsonObject& object, Display& display) {
    const bool wanted = display.transfer == TransferFunction::table;
    if (!wanted && object.has("transfer_table"))
        return object.key_error("transfer_table", "needs \"transfer\": \"table\"");
    if (!wanted) return {};
    const auto array = object.array("transfer_table");
    if (!array) return array.error();
    return object.append_numbers(**array, "transfer_table", std::nullopt, display.table);
}

Result<void> read_lens(const JsonObject& object, Display& display) {
    if (auto ok = object.get("field_deg", display.field_deg, {.minimum = 0, .maximum = 359, .minimum_allowed = false});
        !ok)
        return ok;
    if (!object.has("pixels_per_degree_at")) return {};
    const auto rows = object.array("pixels_per_degree_at");
    if (!rows) return rows.error();
    for (const auto& row : **rows) {
        std::vector<double> values;
        const std::string where = "pixels_per_degree_at[" + std::to_string(display.lens.size()) + "]";
        if (auto ok = object.append_numbers(row, where, 2, values); !ok) return ok;
        display.lens.push_back({values[0], values[1]});
    }
    if (display.lens.empty()) return object.key_error("pixels_per_degree_at", "is empty");
    return {};
}

} // namespace

Result<Display> read_display(const std::filesystem::path& file) {
    const auto object =
        JsonObject::read(file, {"name", "width_px", "height_px", "pixel_pitch_m", "diagonal_m", "viewing_distance_m",
                                "peak_cdm2", "black_cdm2", "transfer", "ambient_lux", "reflectivity", "source",
                                "transfer_table", "pixels_per_degree_at", "field_deg"});
    if (!object) return object.error();

    Display display;
    display.name = file.stem().string();
    std::string source;
    if (auto ok = object->get("name", display.name); !ok) return ok.error();
    if (auto ok = object->get("source", source); !ok) return ok.error();

    const auto width = object->number("width_px", pixel_count), height = object->number("height_px", pixel_count);
    if (!width) return width.error();
    if (!height) return height.error();
    display.width_px = static_cast<int>(*width);
    display.height_px = static_cast<int>(*height);

    const auto pitch = read_pixel_pitch(*object, display.width_px, display.height_px);
    if (!pitch) return pitch.error();
    const auto distance = object->number("viewing_distance_m", positive);
    if (!distance) return distance.error();
    const auto peak = object->number("peak_cdm2", positive), black = object->number("black_cdm2", positive);
    if (!peak) return peak.error();
    if (!black) return black.error();
    if (!(*black < *peak)) {
        return object->key_error("black_cdm2", "must be below peak_cdm2, but is " + to_text(*black));
    }
    display.pixel_pitch = perception::Metres(*pitch);
    display.distance = perception::Metres(*distance);
    display.peak = perception::Luminance(*peak);
    display.black = perception::Luminance(*black);

    if (auto ok = read_transfer(*object, display); !ok) return ok.error();
    if (auto ok = read_table(*object, display); !ok) return ok.error();
    if (auto ok = read_lens(*object, display); !ok) return ok.error();
    double ambient = display.ambient.value();
    if (auto ok = object->get("ambient_lux", ambient, not_negative); !ok) return ok.error();
    if (auto ok = object->get("reflectivity", display.reflectivity, share); !ok) return ok.error();
    display.ambient = perception::Lux(ambient);

    if (auto ok = validate(display); !ok) return object->error(ok.error().message);
    return display;
}

Result<void> write_display(const std::filesystem::path& file, const Display& display) {
    if (auto ok = validate(display); !ok) return ok;
    std::string transfer = to_text(display.gamma);
    if (display.transfer == TransferFunction::srgb) transfer = "\"srgb\"";
    if (display.transfer == TransferFunction::linear) transfer = "\"linear\"";
    if (display.transfer == TransferFunction::pq) transfer = "\"pq\"";
    if (display.transfer == TransferFunction::table) transfer = "\"table\"";

    std::string text = "{\n    \"name\": " + to_json(display.name);
    const auto add = [&](const char* key, const std::string& value) {
        text.append(",\n    \"").append(key).append("\": ").append(value);
    };
    add("width_px", std::to_string(display.width_px));
    add("height_px", std::to_string(display.height_px));
    add("pixel_pitch_m", to_text(display.pixel_pitch.value()));
    add("viewing_distance_m", to_text(display.distance.value()));
    add("peak_cdm2", to_text(display.peak.value()));
    add("black_cdm2", to_text(display.black.value()));
    add("transfer", transfer);
    add("ambient_lux", to_text(display.ambient.value()));
    add("reflectivity", to_text(display.reflectivity));
    if (display.transfer == TransferFunction::table) {
        std::string values;
        for (const double value : display.table) values.append(values.empty() ? "[" : ", ").append(to_text(value));
        add("transfer_table", values + "]");
    }
    if (!display.lens.empty()) {
        std::string rows;
        for (const perception::PixelsPerDegreeAt& at : display.lens)
            rows.append(rows.empty() ? "[[" : ", [")
                .append(to_text(at.angle_deg))
                .append(", ")
                .append(to_text(at.pixels_per_degree))
                .append("]");
        add("pixels_per_degree_at", rows + "]");
    }
    if (display.field_deg > 0) add("field_deg", to_text(display.field_deg));
    return write_text(file, text.append("\n}\n"));
}

} // namespace unseen::calibration
