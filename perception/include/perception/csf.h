// Contrast sensitivity: S = 1 / threshold contrast of a grating patch, as a formula and as a table.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
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

    // The conservative form that fold tests use: non-increasing in frequency (the largest value at this or any higher
    // frequency, so also clamped below the peak), non-increasing in eccentricity and non-decreasing in luminance
    // (likewise). Above the last frequency it goes on falling with the shallowest of the slopes with which the table's
    // columns last fall; eccentricity and luminance are clamped to their axes.
    double monotone_sensitivity(CyclesPerDegree frequency, Degrees eccentricity, Luminance luminance) const;
    double peak_sensitivity(Degrees eccentricity, Luminance luminance) const;

    // The highest frequency at which `contrast` can be seen: S(rho) contrast = 1 on the falling branch, the inverse
    // of monotone_sensitivity; on a plateau its highest frequency. 0 where even the peak cannot be seen. `contrast` is
    // 0 or more and may exceed 1. Infinite where an argument is NaN, or contrast or luminance is negative: never folds.
    CyclesPerDegree highest_visible_frequency(double contrast, Degrees eccentricity, Luminance luminance) const;

    // The same in batches of equal length, in float; log2 of the frequency in cpd, -infinity where nothing can be seen.
    // No allocation; tens of nanoseconds each.
    void highest_visible_log2_frequency(std::span<const float> contrast, std::span<const float> eccentricity_deg,
                                        std::span<const float> luminance_cdm2, std::span<float> log2_frequency) const;

private:
    // The samples of one axis, with a uniform grid over them that finds the samples around a value in constant time.
    struct Axis {
        std::vector<double> positions;           // log2 cpd, degrees, log2 cd/m2
        std::vector<std::uint32_t> first_cell;   // of each of the uniform buckets, and the last cell once more
        double buckets_per_unit = 0;
    };
    // Two neighbouring samples and how far a position, clamped to the axis, lies between them, 0..1.
    struct Cell {
        std::size_t first = 0, second = 0;
        double fraction = 0;
    };
    // The column over frequency at an eccentricity and a luminance, blended from the four around it.
    struct Blend {
        std::array<const float*, 4> columns;
        std::array<double, 4> weights; // at least 0, sum 1

        double operator[](std::size_t f) const {
            return (weights[0] * double(columns[0][f]) + weights[1] * double(columns[1][f])) +
                   (weights[2] * double(columns[2][f]) + weights[3] * double(columns[3][f]));
        }
    };
    struct Query {
        Blend column;
        double log2_threshold;
        std::size_t sample; // the last one that reaches the threshold, as far as known
    };

    CsfTable() = default;
    static Axis make_axis(std::vector<double> positions);
    static std::size_t find_cell(const Axis& axis, double position);
    static Cell locate(const Axis& axis, double position);
    Blend blend(double eccentricity_deg, double log2_luminance) const;
    template <std::size_t Count>
    void bisect(std::array<Query, Count>& queries) const;
    double log2_crossing(const Query& query) const;
    void prepare_monotone();
    void prepare_extrapolation();

    CsfSamples samples_;
    std::vector<float> log2_monotone_; // same layout as samples_.sensitivity
    Axis frequency_, eccentricity_, luminance_;
    double last_slope_ = 0; // octaves of sensitivity per octave of frequency above the last; negative, or 0: none falls
};

} // namespace unseen::perception
