// Observer profiles as JSON: a contrast sensitivity table from a model, or measured on a viewer.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <unseen/calibration/procedure.h>
#include <unseen/perception/csf.h>
#include <unseen/vdtree/result.h>

namespace unseen::calibration {

// {"format": "unseen-csf", "version": 1, "source": ..., "frequency_cpd": [...], "eccentricity_deg": [...],
//  "luminance_cdm2": [...], "sensitivity": [eccentricity][luminance][frequency]}
// Axes must be strictly ascending, and values positive, finite and complete; errors name the file and the place. A
// measured profile (below) is checked as a whole, but only its table is used.
Result<perception::CsfTable> read_csf(const std::filesystem::path& file);
Result<void> write_csf(const std::filesystem::path& file, const perception::CsfTable& table);

// One measured place, with its 95% interval.
struct Measurement {
    GratingPlace place;
    double sensitivity = 0, low = 0, high = 0;
    int answers = 0;
};

// A measured table, and who was measured, when and how. In JSON, version 2 adds the keys "observer", "date", "method",
// "display", "conditions" (strings), "measured_at_cdm2" (a number), and "measured": [[frequency_cpd, eccentricity_deg,
// sensitivity, low, high, answers], ...]. Version 3, for wide patches, adds "summation": [own, low, high] and
// "measured_wide": [[frequency_cpd, eccentricity_deg, area_deg2, sensitivity, low, high, answers], ...].
struct ObserverProfile {
    perception::CsfTable table = perception::CsfTable::standard();
    std::string observer, date, method, display, conditions;
    double measured_at_cdm2 = 0;
    std::vector<Measurement> measured; // the wide ones last
    // How the viewer sums over area. If not measured, `own` is 1: castle's law. The table stores it too
    // (CsfSamples::summation), for fold tests and judges.
    Summation summation;
    bool has_summation() const { return !(summation == Summation()); } // whether it was measured
};

// Files of version 1 are profiles without measurements; those of version 2 have no wide patches.
Result<ObserverProfile> read_observer(const std::filesystem::path& file);
Result<void> write_observer(const std::filesystem::path& file, const ObserverProfile& profile);

} // namespace unseen::calibration
