// What plans and procedures share.
#pragma once

#include <cstdint>

#include <unseen/calibration/procedure.h>

namespace unseen::calibration {

inline constexpr int most_plan_places = 1000, most_plan_trials = 100'000, most_plan_settings = 1000;
inline constexpr double widest_eccentricity_deg = 90;
inline constexpr double brightest_cdm2 = 1e6;
inline constexpr std::uint64_t exact_integers = std::uint64_t{1} << 53; // what JSON keeps

// The log10 sensitivity that a table predicts for a patch.
double log10_expected(const perception::CsfTable& table, const GratingPlace& place, perception::Luminance luminance);

} // namespace unseen::calibration
