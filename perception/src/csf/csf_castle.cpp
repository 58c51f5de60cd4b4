// castleCSF and stelaCSF. The achromatic branch of the one and the other are one set of equations with two sets of
// constants; the chromatic branches are the same without the transient channel.
//
// castleCSF: M. Ashraf, R. K. Mantiuk, A. Chapiro, S. Wuerger, "castleCSF - A contrast sensitivity function of color,
// area, spatiotemporal frequency, luminance and eccentricity", Journal of Vision 24(4), 2024.
// stelaCSF: R. K. Mantiuk, M. Ashraf, A. Chapiro, "stelaCSF - A unified model of contrast sensitivity as the function
// of spatio-temporal frequency, eccentricity, luminance and area", ACM Transactions on Graphics 41(4), 2022.

#include <algorithm>
#include <cmath>
#include <limits>

#include "csf/csf_model.h"

namespace unseen::perception {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// lum(L) = p1 (1 + p2/L)^-p3: rises with luminance and saturates.
struct SaturatingLaw {
    double p1, p2, p3;
};
// The fall of the sustained peak at high luminance: 1 - (1 + p4/L)^-p5.
struct GlareLaw {
    double p4, p5;
};
// lum(L) = scale L^exponent.
struct PowerLaw {
    double exponent, scale;
};
// The log-parabola over frequency with a plateau on its low side, and the spatial summation over area.
struct BandShape {
    double log2_bandwidth; // the parabola's width is 2^this
    double truncation;     // below the peak the parabola falls by no more than this share
    double area0, frequency0;
};
struct Decay {
    double k0, k1; // log10 sensitivity lost per degree: k0 + k1 frequency
};

struct ModelConstants {
    SaturatingLaw sustained_peak;
    GlareLaw sustained_glare;
    SaturatingLaw sustained_frequency;
    BandShape sustained;
    double sustained_temporal_scale;
    PowerLaw transient_peak;
    double transient_frequency;
    BandShape transient;
    double transient_temporal_scale;
    double omega0_at_1_cdm2, omega0_per_decade; // Hz
    Decay temporal_field, nasal_field;
};

// Fitted constants as published with the models' programs (gfxdisp/castleCSF, class CSF_stelaCSF_lum_peak).
constexpr ModelConstants castle_constants{
    .sustained_peak = {56.4947, 7.54726, 0.144532},
    .sustained_glare = {5.58341e-7, 9.66862e9},
    .sustained_frequency = {1.78119, 91.5718, 0.256682},
    .sustained = {0.000213047, 0.100207, 157.103, 0.702338},
    .sustained_temporal_scale = 10.5795,
    .transient_peak = {0.193434, 2748.09},
    .transient_frequency = 0.000316696,
    .transient = {2.6761, 0.000241177, 3.81611, 3.01389},
    .transient_temporal_scale = 0.0844836,
    .omega0_at_1_cdm2 = 4.7036,
    .omega0_per_decade = 2.41482,
    .temporal_field = {0.0239853, 0.0189038},
    .nasal_field = {0.0400662, 0.00813619},
};

// gfxdisp/stelaCSF, class CSF_stelaCSF.
constexpr ModelConstants stela_constants{
    .sustained_peak = {68.9501, 59.5023, 0.164274},
    .sustained_glare = {7.54866e-7, 7.77268e9},
    .sustained_frequency = {1.62144, 36.6565, 0.255823},
    .sustained = {0.000219263, 0.103686, 270, 0.65},
    .sustained_temporal_scale = 5.79336,
    .transient_peak = {0.500846, 57.3469},
    .transient_frequency = 0.0267489,
    .transient = {1.75147, 0.000273289, 270, 0.65},
    .transient_temporal_scale = 0.12314,
    .omega0_at_1_cdm2 = 5,
    .omega0_per_decade = 0,
    .temporal_field = {0.0296662, 0.0190062},
    .nasal_field = {0.0113638, 0.0193858},
};

// Hz. castle's omega0 is negative below 0.0113 cd/m2, where a power of it is no number; 0 would switch the transient
// channel fully on for static stimuli and triple the sensitivity. At this floor the values are those of the published
// program, except for its spike at 0.0113 cd/m2.
constexpr double omega0_floor_hz = 0.5;
// Exponents of temporal frequency in the two channels, common to both models.
constexpr double sustained_temporal_exponent = 1.3314;
constexpr double transient_temporal_exponent = 0.1898;

const ModelConstants& constants(CsfModel model) {
    return model == CsfModel::stela ? stela_constants : castle_constants;
}

double evaluate(const SaturatingLaw& law, double luminance) {
    return law.p1 * std::exp(-law.p3 * std::log1p(law.p2 / luminance));
}
// p4/L is below the spacing of doubles around 1 for bright stimuli: never written as 1 - (1 + x)^-p5.
double evaluate(const GlareLaw& law, double luminance) { return -std::expm1(-law.p5 * std::log1p(law.p4 / luminance)); }

double summation_area(const BandShape& shape, double freq_cpd) {
    const double relative = freq_cpd / shape.frequency0;
    return shape.area0 / (1 + relative * relative);
}

// Smax P(rho) rho sqrt(Ac / (1 + Ac / A)) without Smax.
double channel(const BandShape& shape, double freq_cpd, double peak_cpd, double area_deg2) {
    const double octaves10 = std::log10(freq_cpd / peak_cpd);
    double parabola = std::pow(10.0, -octaves10 * octaves10 / std::exp2(shape.log2_bandwidth));
    if (freq_cpd < peak_cpd) parabola = std::max(parabola, 1 - shape.truncation);
    const double area0 = summation_area(shape, freq_cpd);
    return parabola * freq_cpd * std::sqrt(area0 / (1 + area0 / area_deg2));
}

double foveal_sensitivity(const ModelConstants& k, double freq_cpd, double lum, double omega_hz, double area_deg2) {
    const double sustained_response =
        std::exp(-std::pow(omega_hz, sustained_temporal_exponent) / k.sustained_temporal_scale);
    const double omega0 = std::max(k.omega0_at_1_cdm2 + k.omega0_per_decade * std::log10(lum), omega0_floor_hz);
    const double distance =
        std::pow(omega_hz, transient_temporal_exponent) - std::pow(omega0, transient_temporal_exponent);
    const double transient_response = std::exp(-distance * distance / k.transient_temporal_scale);

    const double sustained_max = evaluate(k.sustained_peak, lum) * evaluate(k.sustained_glare, lum);
    const double sustained_cpd = evaluate(k.sustained_frequency, lum);
    const double transient_max = k.transient_peak.scale * std::pow(lum, k.transient_peak.exponent);
    return sustained_response * sustained_max * channel(k.sustained, freq_cpd, sustained_cpd, area_deg2) +
           transient_response * transient_max * channel(k.transient, freq_cpd, k.transient_frequency, area_deg2);
}

// ---- the chromatic branches -----------------------------------------------------------------------------------------

struct ChromaticConstants {
    double temporal_scale, temporal_exponent;
    SaturatingLaw peak;
    double frequency; // cpd; sensitivity is low-pass: flat below
    double log2_bandwidth;
    double area0, frequency0;
    Decay temporal_field, nasal_field;
};

// gfxdisp/castleCSF, class CSF_castleCSF_chrom; exponents below 1e-60, which the fit left behind, are 0.
constexpr ChromaticConstants red_green_constants{
    .temporal_scale = 16.4325,
    .temporal_exponent = 1.15591,
    .peak = {681.434, 38.0038, 0.480386},
    .frequency = 0.0178364,
    .log2_bandwidth = 2.42104,
    .area0 = 2816.44,
    .frequency0 = 0.0711058,
    .temporal_field = {0.0591402, 0},
    .nasal_field = {2.89615e-5, 0.18108},
};
constexpr ChromaticConstants yellow_violet_constants{
    .temporal_scale = 7.15012,
    .temporal_exponent = 0.969123,
    .peak = {166.683, 62.8974, 0.41193},
    .frequency = 0.00425753,
    .log2_bandwidth = 2.68197,
    .area0 = 2.82789e7,
    .frequency0 = 6.35093e-4,
    .temporal_field = {0.00356865, 0.00806631},
    .nasal_field = {0, 0.0110662},
};

bool is_chromatic(CsfModel model) {
    return model == CsfModel::castle_red_green || model == CsfModel::castle_yellow_violet;
}
const ChromaticConstants& chromatic_constants(CsfModel model) {
    return model == CsfModel::castle_red_green ? red_green_constants : yellow_violet_constants;
}

// Below its frequency the branch is flat, which is the band shape cut off at its very top.
BandShape shape_of(const ChromaticConstants& k) { return {k.log2_bandwidth, 0, k.area0, k.frequency0}; }

double foveal_sensitivity(const ChromaticConstants& k, double freq_cpd, double lum, double omega_hz, double area_deg2) {
    const double response = std::exp(-std::pow(omega_hz, k.temporal_exponent) / k.temporal_scale);
    return response * evaluate(k.peak, lum) * channel(shape_of(k), freq_cpd, k.frequency, area_deg2);
}

// The two decays of a model.
struct Decays {
    Decay temporal, nasal;
};
Decays decays(CsfModel model) {
    if (is_chromatic(model)) return {chromatic_constants(model).temporal_field, chromatic_constants(model).nasal_field};
    return {constants(model).temporal_field, constants(model).nasal_field};
}

} // namespace

bool is_castle_family(CsfModel model) {
    return model == CsfModel::castle || model == CsfModel::stela || is_chromatic(model);
}

SquareDegrees castle_summation_area(CyclesPerDegree frequency, CsfModel model) {
    const BandShape shape = is_chromatic(model) ? shape_of(chromatic_constants(model)) : castle_constants.sustained;
    return SquareDegrees(summation_area(shape, frequency.value()));
}

double castle_family_at_fovea(CsfModel model, const Stimulus& s) {
    const double cpd = s.frequency.value(), cdm2 = s.luminance.value(), hz = s.temporal.value();
    if (is_chromatic(model)) return foveal_sensitivity(chromatic_constants(model), cpd, cdm2, hz, s.area.value());
    return foveal_sensitivity(constants(model), cpd, cdm2, hz, s.area.value());
}

double castle_family_decay(CsfModel model, CyclesPerDegree frequency, VisualField field) {
    const Decays k = decays(model);
    const double temporal = k.temporal.k0 + k.temporal.k1 * frequency.value();
    const double nasal = k.nasal.k0 + k.nasal.k1 * frequency.value();
    switch (field) {
    case VisualField::temporal: return temporal;
    case VisualField::nasal: return nasal;
    case VisualField::worst: break;
    }
    return std::min(temporal, nasal);
}

CyclesPerDegree equal_decay_frequency(CsfModel model) {
    const Decays k = decays(model);
    return CyclesPerDegree((k.temporal.k0 - k.nasal.k0) / (k.nasal.k1 - k.temporal.k1));
}

Luminance castle_transient_kink() {
    const ModelConstants& k = castle_constants;
    return Luminance(std::pow(10.0, (omega0_floor_hz - k.omega0_at_1_cdm2) / k.omega0_per_decade));
}

} // namespace unseen::perception
