// Display profiles as JSON, and fitting them to measurements: by eye, or with a photometer.
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include <unseen/perception/display.h>
#include <unseen/vdtree/result.h>

namespace unseen::calibration {

// Keys carry their units: name, width_px, height_px, pixel_pitch_m or diagonal_m (one of them), viewing_distance_m,
// peak_cdm2, black_cdm2, transfer ("srgb", "linear", "pq", "table", or a gamma as a number), ambient_lux, reflectivity,
// source; transfer_table (with "table": linear light of equidistant codes); for headsets pixels_per_degree_at
// ([[degrees, ppd], ...]) and field_deg. Missing transfer, ambient_lux and reflectivity default to those of Display, a
// missing name to the file's; source tells people where the numbers come from. Unknown and repeated keys, missing sizes
// and bad values are errors that name the file and the key.
Result<perception::Display> read_display(const std::filesystem::path& file);
Result<void> write_display(const std::filesystem::path& file, const perception::Display& display);

// ---- measuring a display

// A code value that looks as bright as an area with the share `white` of white and the rest black.
struct BrightnessMatch {
    double white = 0.5, code = 0.5; // both above 0 and below 1
};

// The gamma for which code^gamma = white fits best, in least squares of the logarithms. Fails without matches, on values out
// of range, and if the gamma would lie outside 0.5..5, which is no gamma.
Result<double> fit_gamma(std::span<const BrightnessMatch> matches);

// A photometer's table: CSV with the header "code,cdm2"; codes 0..255 ascending, first 0 and last 255, luminances
// ascending; 3 rows or more. Empty lines and those that begin with # are skipped. The error names file and line.
struct PhotometerTable {
    std::vector<double> code;      // 0..1
    std::vector<double> luminance; // cd/m2
};
Result<PhotometerTable> read_photometer(const std::filesystem::path& file);

// The display with the table's peak, transfer and black level, from which its own share of ambient light is subtracted.
Result<perception::Display> with_photometer(const perception::Display& display, const PhotometerTable& table);

// cd/m2 of the 256 codes.
std::vector<double> code_luminances(const perception::Display& display);

} // namespace unseen::calibration
