// What a display does with code values, from matches by eye or from a photometer.
#pragma once

#include <filesystem>
#include <span>
#include <utility>
#include <vector>

#include <unseen/perception/display.h>
#include <unseen/vdtree/result.h>

namespace unseen::calibration {

// A code value that looks as bright as an area of which the share `white` is white and the rest black.
struct BrightnessMatch {
    double white = 0.5, code = 0.5; // both above 0 and below 1
};

// The gamma for which code^gamma = white fits best, in least squares of the logarithms. Fails on other values, on none,
// and where the gamma would lie outside of 0.5..5: something else than a gamma was measured.
Result<double> fit_gamma(std::span<const BrightnessMatch> matches);

// A photometer's table: CSV with the header "code,cdm2"; codes 0..255 ascending, first 0 and last 255, luminances
// ascending; 3 rows or more. Empty lines and those that begin with # are skipped. The error names file and line.
struct PhotometerTable {
    std::vector<double> code;      // 0..1
    std::vector<double> luminance; // cd/m2
};
Result<PhotometerTable> read_photometer(const std::filesystem::path& file);

// The display with the table's peak, black level (less the ambient light's share that the display already has) and
// transfer.
Result<perception::Display> with_photometer(const perception::Display& display, const PhotometerTable& table);

// cd/m2 of the 256 codes.
std::vector<double> code_luminances(const perception::Display& display);

} // namespace unseen::calibration
