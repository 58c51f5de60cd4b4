// Display profiles: every key is read with its range, then the whole is validated as any display is. And what measures
// displays: fits of the transfer function, and photometers' tables.
#include <unseen/calibration/display_profile.h>

#include <array>
#include <cmath>
#include <optional>
#include <sstream>
#include <utility>

#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/input_file.h>

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
        for (const perception::Display::PixelsPerDegreeAt& at : display.lens)
            rows += (rows.empty() ? "[" : ", ") + to_json(std::array{at.angle_deg, at.pixels_per_degree});
        json.add("pixels_per_degree_at", rows + "]");
    }
    if (display.field_deg > 0) json.add("field_deg", display.field_deg);
    return json.write(file);
}

// ---- measuring a display

namespace {

constexpr double least_gamma = 0.5, largest_gamma = 5;
constexpr std::size_t most_rows = 100'000;

// What is wrong with a further row, or nothing.
std::string append_row(PhotometerTable& table, std::string_view line) {
    const std::size_t comma = line.find(',');
    const auto code = finite_from(trimmed(line.substr(0, comma)));
    const auto luminance = comma == line.npos ? std::nullopt : finite_from(trimmed(line.substr(comma + 1)));
    if (!code || !luminance) return "must be a code and a luminance in cd/m2, such as 128,43.5";
    if (!(*code >= 0 && *code <= 255)) return "the code must lie in 0..255, not " + number_text(*code);
    if (!(*luminance >= 0)) return "the luminance must be 0 cd/m2 or more, not " + number_text(*luminance);
    if (table.code.empty() && *code != 0) return "the first code must be 0, not " + number_text(*code);
    if (!table.code.empty() && !(*code / 255 > table.code.back())) return "the codes must ascend";
    if (!table.code.empty() && !(*luminance > table.luminance.back())) return "the luminances must ascend";
    table.code.push_back(*code / 255);
    table.luminance.push_back(*luminance);
    return {};
}

} // namespace

Result<double> fit_gamma(std::span<const BrightnessMatch> matches) {
    double upper = 0, lower = 0;
    for (const BrightnessMatch& m : matches) {
        if (!(m.white > 0 && m.white < 1 && m.code > 0 && m.code < 1))
            return invalid_argument("A brightness match must lie between black and white, not be code " +
                                    number_text(m.code) + " for " + number_text(m.white) + " of white.");
        upper += std::log(m.white) * std::log(m.code);
        lower += std::log(m.code) * std::log(m.code);
    }
    if (!(lower > 0)) return invalid_argument("There are no brightness matches to fit a gamma to.");
    const double gamma = upper / lower;
    if (!(gamma >= least_gamma && gamma <= largest_gamma))
        return invalid_argument("The matches give a gamma of " + number_text(gamma) +
                                ", which no display has (0.5 to 5): match again.");
    return gamma;
}

Result<PhotometerTable> read_photometer(const std::filesystem::path& file) {
    const auto whole = read_text_file(file);
    if (!whole) return whole.error();
    std::istringstream stream(*whole);
    PhotometerTable table;
    bool has_header = false;
    std::size_t number = 0;
    const auto complain = [&](const std::string& what) {
        return Error{ErrorCode::malformed_data, file.string() + ": line " + std::to_string(number) + ": " + what + "."};
    };
    for (std::string line; std::getline(stream, line);) {
        if (++number > most_rows) return complain("there are too many lines");
        const std::string_view text = trimmed(line);
        if (text.empty() || text.starts_with('#')) continue;
        if (!has_header) {
            if (text != "code,cdm2") return complain("the first line must be \"code,cdm2\"");
            has_header = true;
            continue;
        }
        if (const std::string problem = append_row(table, text); !problem.empty()) return complain(problem);
    }
    constexpr std::size_t least_rows = 3;
    if (table.code.size() < least_rows)
        return Error{ErrorCode::malformed_data, file.string() + ": there are fewer than 3 rows of measurements."};
    if (table.code.back() != 1) return complain("the last code must be 255");
    return table;
}

Result<perception::Display> with_photometer(const perception::Display& display, const PhotometerTable& table) {
    perception::Display measured = display;
    // The photometer saw the ambient light, too.
    const perception::Luminance ambient = perception::black_level(display) - display.black;
    measured.black = perception::Luminance(table.luminance.front()) - ambient;
    measured.peak = perception::Luminance(table.luminance.back()) - ambient;
    measured.transfer = perception::TransferFunction::table;
    measured.table.clear();
    const double black = table.luminance.front(), span = table.luminance.back() - black;
    constexpr int steps = 255;
    std::size_t row = 1;
    for (int i = 0; i <= steps; ++i) {
        const double code = static_cast<double>(i) / steps;
        while (table.code[row] < code) ++row;
        const double t = (code - table.code[row - 1]) / (table.code[row] - table.code[row - 1]);
        const double luminance = table.luminance[row - 1] + t * (table.luminance[row] - table.luminance[row - 1]);
        measured.table.push_back((luminance - black) / span);
    }
    measured.table.back() = 1; // whatever the rounding
    if (auto valid = perception::validate(measured); !valid) return valid.error();
    return measured;
}

std::vector<double> code_luminances(const perception::Display& display) {
    std::vector<double> result;
    for (int code = 0; code < 256; ++code)
        result.push_back(perception::to_luminance(display, perception::decode(display, code / 255.0)).value());
    return result;
}

} // namespace unseen::calibration
