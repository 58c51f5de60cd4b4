// What people were measured to see, and how a model of sensitivity compares.
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

// A table with the columns dataset, frequency_cpd, temporal_hz, eccentricity_deg, luminance_cdm2, area_deg2 and
// sensitivity, separated by commas, in any order and among others; lines after `#` are comments. Errors name `name` and
// the line: a column that is missing, a field that is no number or not above 0 (eccentricity and temporal_hz: below 0).
Result<std::vector<MeasuredSensitivity>> parse_sensitivities(std::string_view text, const std::string& name);
Result<std::vector<MeasuredSensitivity>> read_sensitivities(const std::filesystem::path& file);

// Those that a person (<unseen/perception/person.h>) is held against: still gratings, up to 30 degrees aside and 100 square
// degrees, from 1 to 500 cd/m2.
std::vector<MeasuredSensitivity> within_domain(std::span<const MeasuredSensitivity> all);

// How people compare with a model, in decibels: 20 log10(people / model). Each study counts alike, however many
// sensitivities it has.
struct Comparison {
    std::size_t count = 0;
    double share_above = 0; // of people's sensitivities, above the model's
    double median_db = 0, deviation_db = 0;
};
using Model = FunctionRef<double(const perception::Stimulus&)>;
Comparison compare(std::span<const MeasuredSensitivity> people, const Model& model);

// The gain over the model above which this share of people's sensitivities lies.
double gain_for_share(std::span<const MeasuredSensitivity> people, const Model& model, double share_above);

// Barten's constants that stray least from people: least squares of decibels. Of still gratings, with castleCSF's fall
// with eccentricity and the pupil of a field of barten_fitted_field. By coordinates, from Barten's own constants on, to a
// ten thousandth of each. Cost: some 0.1 s. Precondition: not empty.
perception::BartenConstants fit_barten(std::span<const MeasuredSensitivity> people);

} // namespace unseen::calibration
