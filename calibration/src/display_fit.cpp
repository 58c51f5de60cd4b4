// Fits of a display's transfer function, and photometers' tables.
#include <unseen/calibration/display_profile.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/number_text.h>

#include <charconv>
#include <cmath>
#include <optional>
#include <sstream>
#include <string>

#include "json_file.h"

namespace unseen::calibration {
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
