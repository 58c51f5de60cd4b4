// Display profiles: every key is read with its range, then the whole is validated as any display is.
#include <unseen/calibration/display_profile.h>

#include <array>
#include <cmath>
#include <utility>

#include "json_file.h"

namespace unseen::calibration {
namespace {

using perception::Display;
using perception::TransferFunction;

constexpr Range not_negative{.minimum = 0, .maximum = unbounded};
// Pixels along one side; far above any screen, and safe to square.
constexpr Range pixel_count{.minimum = 1, .maximum = 1e6, .whole = true};

constexpr std::pair<std::string_view, TransferFunction> transfers[] = {{"srgb", TransferFunction::srgb},
                                                                       {"linear", TransferFunction::linear},
                                                                       {"pq", TransferFunction::pq},
                                                                       {"table", TransferFunction::table}};

// From the pitch, or from the diagonal of a screen with square pixels.
double read_pixel_pitch(const JsonObject& object, const Display& display) {
    if (object.has("pixel_pitch_m") && object.has("diagonal_m"))
        object.fail_at("diagonal_m", "and key \"pixel_pitch_m\" say the same: remove one");
    if (object.has("pixel_pitch_m")) return object.number("pixel_pitch_m", positive);
    if (object.has("diagonal_m"))
        return object.number("diagonal_m", positive) / std::hypot(display.width_px, display.height_px);
    object.fail("the size of the screen is missing: give key \"pixel_pitch_m\" or \"diagonal_m\"");
    return 0;
}

void read_transfer(const JsonObject& object, Display& display) {
    if (!object.has("transfer")) return;
    const nlohmann::json& value = object["transfer"];
    if (value.is_number() && value.get<double>() > 0) {
        display.transfer = TransferFunction::gamma;
        display.gamma = value.get<double>();
        return;
    }
    for (const auto& [name, transfer] : transfers) {
        if (value != name) continue;
        display.transfer = transfer;
        return;
    }
    object.fail_at("transfer", "must be \"srgb\", \"linear\", \"pq\", \"table\", or a gamma as a number above 0");
}

// The keys that only some displays have.
void read_table(const JsonObject& object, Display& display) {
    if (display.transfer == TransferFunction::table)
        display.table = object.numbers(object.array("transfer_table"), "transfer_table");
    else if (object.has("transfer_table")) object.fail_at("transfer_table", "needs \"transfer\": \"table\"");
}

void read_lens(const JsonObject& object, Display& display) {
    object.get("field_deg", display.field_deg, {.minimum = 0, .maximum = 359, .minimum_allowed = false});
    if (!object.has("pixels_per_degree_at")) return;
    for (const auto& row : object.rows("pixels_per_degree_at", 2)) display.lens.push_back({row[0], row[1]});
    if (display.lens.empty()) object.fail_at("pixels_per_degree_at", "is empty");
}

} // namespace

Result<Display> read_display(const std::filesystem::path& file) {
    const JsonObject object(file, {"name", "width_px", "height_px", "pixel_pitch_m", "diagonal_m", "viewing_distance_m",
                                   "peak_cdm2", "black_cdm2", "transfer", "ambient_lux", "reflectivity", "source",
                                   "transfer_table", "pixels_per_degree_at", "field_deg"});
    Display display;
    display.name = file.stem().string();
    display.transfer = TransferFunction::srgb;
    std::string source;
    object.get("name", display.name);
    object.get("source", source);
    display.width_px = static_cast<int>(object.number("width_px", pixel_count));
    display.height_px = static_cast<int>(object.number("height_px", pixel_count));
    display.pixel_pitch = perception::Metres(read_pixel_pitch(object, display));
    display.distance = perception::Metres(object.number("viewing_distance_m", positive));
    display.peak = perception::Luminance(object.number("peak_cdm2", positive));
    display.black = perception::Luminance(object.number("black_cdm2", positive));
    if (!(display.black < display.peak))
        object.fail_at("black_cdm2", "must be below peak_cdm2, but is " + number_text(display.black.value()));
    read_transfer(object, display);
    read_table(object, display);
    read_lens(object, display);
    double ambient = display.ambient.value();
    object.get("ambient_lux", ambient, not_negative);
    object.get("reflectivity", display.reflectivity, zero_to_one);
    display.ambient = perception::Lux(ambient);
    if (const auto valid = validate(display); !valid) object.fail(valid.error().message);
    if (!object) return object.error();
    return display;
}

Result<void> write_display(const std::filesystem::path& file, const Display& display) {
    if (auto ok = validate(display); !ok) return ok;
    std::string transfer = number_text(display.gamma);
    for (const auto& [name, function] : transfers)
        if (display.transfer == function) transfer = to_json(name);

    JsonWriter json("    ");
    json.add_text("name", display.name);
    json.add("width_px", display.width_px);
    json.add("height_px", display.height_px);
    json.add("pixel_pitch_m", display.pixel_pitch.value());
    json.add("viewing_distance_m", display.distance.value());
    json.add("peak_cdm2", display.peak.value());
    json.add("black_cdm2", display.black.value());
    json.add("transfer", transfer);
    json.add("ambient_lux", display.ambient.value());
    json.add("reflectivity", display.reflectivity);
    if (display.transfer == TransferFunction::table) json.add("transfer_table", to_json(display.table));
    if (!display.lens.empty()) {
        std::string rows;
        for (const perception::PixelsPerDegreeAt& at : display.lens)
            rows += (rows.empty() ? "[" : ", ") + to_json(std::array{at.angle_deg, at.pixels_per_degree});
        json.add("pixels_per_degree_at", rows + "]");
    }
    if (display.field_deg > 0) json.add("field_deg", display.field_deg);
    return json.write(file);
}

} // namespace unseen::calibration
