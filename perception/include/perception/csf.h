// Contrast sensitivity: S = 1 / threshold contrast of a grating patch, as a formula and as a table.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <perception/units.h>
#include <vdtree/function_ref.h>
#include <vdtree/result.h>

namespace unseen::perception {

// Where on the retina, along the horizontal meridian. `worst` takes the more sensitive of the two: a viewer with two
// eyes, or an unknown side.
enum class VisualField { nasal, temporal, worst };

struct Stimulus {
    CyclesPerDegree frequency{4};
    Luminance luminance{100};      // adaptation luminance
    Degrees eccentricity{0};
    Hertz temporal{0};
    SquareDegrees area{1};         // pi sigma^2 of a Gaussian envelope
    VisualField field = VisualField::worst;
};

enum class CsfModel {
    castle,  // castleCSF, achromatic branch (Ashraf, Mantiuk, Chapiro, Wuerger 2024): the default
    stela,   // stelaCSF (Mantiuk, Ashraf, Chapiro 2022)
};
std::string_view name(CsfModel model);
Result<CsfModel> csf_model(std::string_view name);

// The closed form, unclamped. Domain: frequency > 0, luminance > 0, area > 0, eccentricity >= 0; outside of it NaN.
// Cost: about 0.2 us.
double sensitivity(CsfModel model, const Stimulus& stimulus);

// The set-up of the fold test and of the judge: a static patch of 1.5 cycles radius, area pi (1.5 / frequency)^2.
SquareDegrees patch_area(CyclesPerDegree frequency);

// Sensitivity over frequency x eccentricity x luminance, interpolated linearly in log S over log frequency,
// eccentricity and log luminance; outside of the axes clamped to their ends.
struct CsfSamples {
    std::string source;                    // what filled it: model and conditions, or observer and date
    std::vector<double> frequency_cpd;     // strictly ascending, > 0
    std::vector<double> eccentricity_deg;  // strictly ascending, from 0 on
    std::vector<double> luminance_cdm2;    // strictly ascending, > 0
    std::vector<double> sensitivity;       // > 0; [(e * luminances + l) * frequencies + f]
};

class CsfTable {
public:
    // Checks the samples; the error names the field and the index. Then prepares the conservative form below.
    static Result<CsfTable> create(CsfSamples samples);
    // Filled from a model at 0 Hz, patch_area(frequency), the worst field: 1/16 to 64 cpd, 0 to 120 degrees,
    // 1e-3 to 1e4 cd/m2, within 1% of the closed form wherever S > 1.
    static CsfTable from_model(CsfModel model);
    // The default table, built once.
    static const CsfTable& standard();

    const CsfSamples& samples() const noexcept { return samples_; }

    // The samples, interpolated.
    double sensitivity(CyclesPerDegree frequency, Degrees eccentricity, Luminance luminance) const;

    // The conservative form that fold tests use: non-increasing in frequency (the largest value at this or any
    // higher frequency, so also clamped below the peak), non-increasing in eccentricity and non-decreasing in luminance (likewise).
    double monotone_sensitivity(CyclesPerDegree frequency, Degrees eccentricity, Luminance luminance) const;
    double peak_sensitivity(Degrees eccentricity, Luminance luminance) const;

    // The highest frequency at which `contrast` can be seen: S(rho) contrast = 1 on the falling branch. 0 where even the peak
    // cannot be seen; the table's last frequency times the extrapolated slope where more can. Inverse of monotone_sensitivity.
    CyclesPerDegree highest_visible_frequency(double contrast, Degrees eccentricity, Luminance luminance) const;

    // The same in batches of equal length; log2 of the frequency in cpd, -infinity where nothing can be seen.
    void highest_visible_log2_frequency(std::span<const float> contrast, std::span<const float> eccentricity_deg,
                                        std::span<const float> luminance_cdm2, std::span<float> log2_frequency) const;

private:
    CsfSamples samples_;
    std::vector<float> log2_monotone_; // same layout as samples_.sensitivity
    std::vector<double> log2_frequency_, log2_luminance_;
};

} // namespace unseen::perception
