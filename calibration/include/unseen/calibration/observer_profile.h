// Observer profiles as JSON: a contrast sensitivity table, from a model or measured on a viewer.
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
// A table that is not strictly ascending on its axes, has holes, or has non-positive or non-finite values is an error
// that names the file and the place. Of a measured profile (below) only the table is taken, but all of it is checked.
Result<perception::CsfTable> read_csf(const std::filesystem::path& file);
Result<void> write_csf(const std::filesystem::path& file, const perception::CsfTable& table);

// One measured place. The interval is that of 95% confidence.
struct Measurement {
    GratingPlace place;
    double sensitivity = 0, low = 0, high = 0;
    int answers = 0;
};

// What was measured, on whom, when and how, beside the table that came of it. As JSON version 2, with the further keys
// "observer", "date", "method", "display", "conditions" (strings), "measured_at_cdm2" (a number), and "measured":
// [[frequency_cpd, eccentricity_deg, sensitivity, low, high, answers], ...]. Where wide patches were measured, version 3,
// with "summation": [own, low, high] and "measured_wide": [[frequency_cpd, eccentricity_deg, area_deg2, sensitivity, low,
// high, answers], ...].
struct ObserverProfile {
    perception::CsfTable table = perception::CsfTable::standard();
    std::string observer, date, method, display, conditions;
    double measured_at_cdm2 = 0;
    std::vector<Measurement> measured; // the wide ones last
    // How the viewer sums over area. `own` is 1 where that was not measured: castle's law. The table has it, too
    // (CsfSamples::summation), so that fold tests and judges go by it.
    Summation summation;
    bool has_summation() const { return !(summation == Summation()); } // was measured
};

// Files of version 1 are profiles without measurements, those of version 2 without wide patches.
Result<ObserverProfile> read_observer(const std::filesystem::path& file);
Result<void> write_observer(const std::filesystem::path& file, const ObserverProfile& profile);

} // namespace unseen::calibration
