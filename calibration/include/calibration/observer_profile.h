// Observer profiles as JSON: a contrast sensitivity table, from a model or measured on a viewer.
#pragma once

#include <filesystem>

#include <perception/csf.h>
#include <vdtree/result.h>

namespace unseen::calibration {

// {"format": "unseen-csf", "version": 1, "source": ..., "frequency_cpd": [...], "eccentricity_deg": [...],
//  "luminance_cdm2": [...], "sensitivity": [eccentricity][luminance][frequency]}
// A table that is not strictly ascending on its axes, has holes, or has non-positive or non-finite values is an error
// that names the file and the place.
Result<perception::CsfTable> read_csf(const std::filesystem::path& file);
Result<void> write_csf(const std::filesystem::path& file, const perception::CsfTable& table);

} // namespace unseen::calibration
