// Measured contrast sensitivities of people, and how models compare with them.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <unseen/perception/csf.h>
#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/result.h>

namespace unseen::calibration {

struct MeasuredSensitivity {
    std::string study;
    perception::Stimulus stimulus; // in the better half of the field: VisualField::worst
    double sensitivity = 0;        // 1 / threshold contrast
};

// A CSV table with the columns dataset, frequency_cpd, temporal_hz, eccentricity_deg, luminance_cdm2, area_deg2 and
// sensitivity, in any order, among others; lines with `#` are comments. Fields must be numbers above 0 (eccentricity and
// temporal_hz: 0 or more). Errors name `name` and the line or the missing column.
Result<std::vector<MeasuredSensitivity>> parse_sensitivities(std::string_view text, const std::string& name);
Result<std::vector<MeasuredSensitivity>> read_sensitivities(const std::filesystem::path& file);

// The measurements that a person (<unseen/perception/csf.h>) is compared with: still gratings, up to 30 degrees of
// eccentricity and 100 square degrees, from 1 to 500 cd/m2.
std::vector<MeasuredSensitivity> within_domain(std::span<const MeasuredSensitivity> all);

// People compared with a model, in decibels: 20 log10(people / model). Every study has the same weight.
struct Comparison {
    std::size_t count = 0;
    double share_above = 0; // of people's sensitivities that exceed the model's
    double median_db = 0, deviation_db = 0;
};
using Model = FunctionRef<double(const perception::Stimulus&)>;
Comparison compare(std::span<const MeasuredSensitivity> people, const Model& model);

// The gain over the model that this share of people's sensitivities exceeds.
double gain_for_share(std::span<const MeasuredSensitivity> people, const Model& model, double share_above);

// Barten's constants that fit people best, in least squares of decibels: for still gratings, with castleCSF's fall with
// eccentricity and the pupil of barten_fitted_field. Searches by coordinates from Barten's own constants, to a ten
// thousandth of each. Cost: some 0.1 s. Precondition: not empty.
perception::BartenConstants fit_barten(std::span<const MeasuredSensitivity> people);

} // namespace unseen::calibration
