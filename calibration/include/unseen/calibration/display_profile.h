// Display profiles as JSON: the measured facts about a screen that the perceptual model needs.
#pragma once

#include <filesystem>

#include <unseen/perception/display.h>
#include <unseen/vdtree/result.h>

namespace unseen::calibration {

// Keys carry their units: name, width_px, height_px, pixel_pitch_m or diagonal_m (one of them), viewing_distance_m,
// peak_cdm2, black_cdm2, transfer ("srgb", "linear", "pq", "table", or a gamma as a number), ambient_lux, reflectivity,
// source; transfer_table (with "table": linear light of equidistant codes); of headsets pixels_per_degree_at
// ([[degrees, ppd], ...]) and field_deg. Missing optional keys (transfer, ambient_lux, reflectivity) take the defaults
// of Display, a missing name that of the file; source says for people where the numbers come from. Unknown and repeated
// keys, missing sizes and bad values are errors that name the file and the key.
Result<perception::Display> read_display(const std::filesystem::path& file);
Result<void> write_display(const std::filesystem::path& file, const perception::Display& display);

} // namespace unseen::calibration
