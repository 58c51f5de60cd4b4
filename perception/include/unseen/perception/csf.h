// Contrast sensitivity: S = 1 / threshold contrast of a grating patch, as a formula and as a table.
#pragma once

#include <array>

#include <unseen/perception/units.h>
#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/result.h>

namespace unseen::perception {

// ---- formulas

// Where on the retina, along the horizontal meridian. `worst` is the more sensitive of the two: for a viewer with two
// eyes, or an unknown side.
enum class VisualField { nasal, temporal, worst };

struct Stimulus {
    CyclesPerDegree frequency{4};
    Luminance luminance{100}; // adaptation luminance
    Degrees eccentricity{0};
    Hertz temporal{0};     // counterphase flicker
    SquareDegrees area{1}; // pi sigma^2 of a Gaussian envelope; a square field's, for the older models
    VisualField field = VisualField::worst;
    DegreesPerSecond velocity{0}; // on the retina
    Metres distance{0.5};         // from the eye; only Daly's model depends on it
};

// Sources, and what each model does not know: docs/model.md.
enum class CsfModel {
    castle,           // castleCSF, achromatic branch (Ashraf, Mantiuk, Chapiro, Wuerger 2024): the default
    stela,            // stelaCSF (Mantiuk, Ashraf, Chapiro 2022)
    daly,             // Daly 1993, the Visible Differences Predictor's
    barten_1989,      // Barten 1989, the short form that Ramasubramanian et al. 1999 and PerceptualDiff use
    barten_1999,      // Barten 1999, the physical model in full, both eyes
    barten_fitted,    // the same with constants fitted to people's thresholds, and castle's fall with eccentricity
    barten_2004,      // Barten 2003/04, the short form
    mannos_sakrison,  // Mannos and Sakrison 1974; relative
    rushmeier,        // Rushmeier et al. 1995, a simplification of Daly's; relative
    castle_red_green, // castleCSF's isoluminant branches. Contrast is |L - 2.3112 M| and |50.9875 S - (L + M)| of the
    castle_yellow_violet, // cones' responses, over the luminance L + M
};
inline constexpr auto csf_models = [] { // all, in this order
    std::array<CsfModel, static_cast<std::size_t>(CsfModel::castle_yellow_violet) + 1> all{};
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<CsfModel>(i);
    return all;
}();

std::string_view name(CsfModel model);
Result<CsfModel> csf_model(std::string_view name);
// Whether S is the sensitivity to luminance contrast, which fold tests and judges need.
bool is_achromatic(CsfModel model);

// The relative models give the shape of S over frequency only. Their peak is scaled to this, that of Daly's model.
constexpr double relative_models_peak = 250;

// The closed form, unclamped. Frequency, luminance, area and distance must be above 0; eccentricity, temporal frequency
// and velocity 0 or more, one of the last two 0. Otherwise the result is NaN. Cost: 0.1 to 0.3 us.
// - Eccentricity: castle and stela depend on the field; daly has its own law; the others are multiplied by
//   exp(-0.0461 frequency eccentricity) (Geisler and Perry 1998).
// - Temporal frequency: castle and stela have their own channels; the others take it as a drift of velocity
//   temporal / frequency.
// - Velocity multiplies the static sensitivity of any model by one factor (Laird et al. 2006).
double sensitivity(CsfModel model, const Stimulus& stimulus);

// The patch that fold test and judge assume: 1.5 cycles radius, area pi (1.5 / frequency)^2.
SquareDegrees patch_area(CyclesPerDegree frequency);

// The law of area: a patch of area A is seen sqrt(A / (A + Ac)) times as well as an unlimited one, with this Ac.
// `model`: one of castleCSF's branches of colour has its own; all others get that of luminance.
SquareDegrees castle_summation_area(CyclesPerDegree frequency, CsfModel model = CsfModel::castle);

// What Barten's model leaves open; by default the values that he gives for a usual observer.
struct BartenConstants {
    double signal_to_noise = 3;    // k
    Degrees line_spread{0.5 / 60}; // sigma0: half a minute of arc
    CyclesPerDegree inhibition{7}; // u0
    double greatest_cycles = 15;   // Nmax: the eye sums over no more of a grating
};
// For CsfModel::barten_fitted: least squares of decibels to people's thresholds, with equal weight for each study
// (calibration::fit_barten()).
inline constexpr BartenConstants fitted_barten{4.9936, Degrees(0.4597 / 60), CyclesPerDegree(4.3221), 7.8149};
// At the fovea. `area`: of the pattern. `field`: of all that is lit, which decides on the pupil. All must be above 0.
double barten_sensitivity(const BartenConstants& constants, CyclesPerDegree frequency, Luminance luminance,
                          SquareDegrees area, SquareDegrees field);
SquareDegrees barten_summation_area(const BartenConstants& constants, CyclesPerDegree frequency);
inline constexpr SquareDegrees barten_fitted_field{100}; // that barten_fitted assumes

// How many times as well a patch of `area` is seen as one of patch_area(frequency), A15:
//   R own^t,   R = sqrt(A / (A + Ac) (A15 + Ac) / A15),   t = ln R / ln R(unlimited), and 0 if A is less than A15
// `own`: how many times as well as by castle's law somebody sees an unlimited grating, relative to a patch of A15. NaN
// if the frequency, area or own is not above 0; the area may be infinite.
double summation_gain(CyclesPerDegree frequency, SquareDegrees area, double own = 1);
double summation_share(CyclesPerDegree frequency, SquareDegrees area); // t

// ---- tables

// A patch of patch_area(frequency); the rest is that of `conditions`.
Stimulus stimulus_of(const Stimulus& conditions, CyclesPerDegree frequency, Degrees eccentricity, Luminance luminance);

// Sensitivity over frequency, eccentricity and luminance; linear in between in log S over log frequency, eccentricity
// and log luminance.
struct CsfSamples {
    std::string source;                   // what filled it: model and conditions, or observer and date
    std::vector<double> frequency_cpd;    // two or more, ascending, > 0 and at most 1e4
    std::vector<double> eccentricity_deg; // ascending from 0 to at most 180
    std::vector<double> luminance_cdm2;   // ascending, > 0 and at most 1e10
    std::vector<double> sensitivity;      // > 0 and at most 1e6; [(e * luminances + l) * frequencies + f]
    double summation = 1;                 // for larger patches: `own` of summation_gain(), 0.01 to 100
};

// An observer's table. Copies are cheap and share their data. Threads may look up at the same time. Beyond its samples:
// - at larger eccentricities sensitivity is as at the last one, and in dimmer light as at the lowest luminance. Eyes
//   are less sensitive there, so this is safe;
// - in brighter light it is as at the highest luminance. Eyes may be more sensitive: up to some 100 cd/m2 sensitivity
//   grows with the light, so use a table that reaches as far as the display does;
// - the conservative form sees coarser gratings as well as the best of all finer ones, and finer gratings fall on with
//   the shallowest slope at which any column ends.
class CsfTable {
public:
    CsfTable(const CsfTable&) = default; // and no move: there is no empty table
    CsfTable& operator=(const CsfTable&) = default;

    // Fails if a sample is out of the ranges above, if an axis rises by less than `smallest_spacing`, or if sensitivity
    // grows with eccentricity by more than `noise_db`. The error names the field, the index and the values.
    static Result<CsfTable> create(CsfSamples samples);
    // The standard deviation of the difference of two measurements in different studies, 20 log10: root 2 times 4.4 dB.
    // A table that grows by more has its rows or columns out of order, or a slip. Sensitivities below 1 count as 1,
    // because nothing that can be shown is seen there.
    static constexpr double noise_db = 6.2;
    // Below this luminance only rods see, and the fovea has none, so sensitivity may grow with eccentricity. (CIE
    // 191:2010: where mesopic vision begins.)
    static constexpr Luminance rods_alone_below{0.005};
    // Octaves or degrees. Closer neighbours on an axis are a slip, and the slope between them means nothing in float.
    static constexpr double smallest_spacing = 1e-4;
    static constexpr Degrees highest_eccentricity{180};
    // Samples a model for patches of patch_area(frequency): 1/16 to 64 cpd, 0 to 120 degrees, 1e-3 to 1e4 cd/m2, within
    // 0.5% of the closed form wherever S > 1. Of the conditions, what moves, the field and the distance count. Fails on
    // those outside of the model's domain. Cost: 20 to 400 ms, 1 to 30 MB; daly's is the largest.
    static Result<CsfTable> from_model(CsfModel model, const Stimulus& conditions);
    static CsfTable from_model(CsfModel model); // static gratings, the worst field
    static const CsfTable& standard();          // castle's; made once

    // Sensitivity times a gain, 0.001 to 1000. Fails if sensitivities leave the bounds above.
    Result<CsfTable> scaled(double gain) const;

    // The conservative form for patches that hold half a wave of a frequency. Such a patch also holds lower
    // frequencies, with a contrast that goes with the square of the frequency: the share of their own patches that it
    // fills. So sensitivity is at least that at any lower frequency times the square of their ratio. sensitivity() is
    // not changed. Cost: some milliseconds.
    CsfTable of_half_waves() const;

    // The table for gratings that move over the retina, extended down to 1/16 cpd at the value of its first frequency:
    // coarse gratings are seen better then. Fails on velocities below 0 or above 80 degrees per second, and if
    // sensitivities leave the bounds above. Up to 0.1 degrees per second nothing changes.
    Result<CsfTable> moving(DegreesPerSecond velocity) const;

    // The table for a viewer whose gaze is known to a margin only: S'(e) = S(max(0, e - margin)), up to the 180 degrees
    // that a table can have. Columns that would lie beyond are left out; past the last one that stays, the largest of it
    // and of those holds. Margins below `smallest_spacing` count as it, but for 0. Where the margin is 180 degrees or
    // more, infinite or NaN, everything is seen as it is best seen anywhere. Precondition: not below 0.
    CsfTable widened(Degrees margin) const;

    const CsfSamples& samples() const noexcept;

    // The samples, interpolated.
    double sensitivity(CyclesPerDegree frequency, Degrees eccentricity, Luminance luminance) const;

    // The conservative form, which fold tests use: the largest value at this or any higher frequency, this or any
    // larger eccentricity, and this or any lower luminance. Above the last frequency it falls on with the shallowest
    // final slope of the table's columns; eccentricity and luminance are clamped to their axes.
    double monotone_sensitivity(CyclesPerDegree frequency, Degrees eccentricity, Luminance luminance) const;
    double peak_sensitivity(Degrees eccentricity, Luminance luminance) const;

    // The highest frequency at which a contrast can be seen, the inverse of monotone_sensitivity(): S(rho) contrast =
    // 1. 0 if even the peak cannot be seen. The contrast is 0 or more and may exceed 1. Infinite, so that nothing
    // folds, if an argument is NaN, or contrast or luminance is negative.
    CyclesPerDegree highest_visible_frequency(double contrast, Degrees eccentricity, Luminance luminance) const;

    // The same for batches of equal length, in float: log2 of the frequency in cpd, -infinity where nothing can be
    // seen. No allocation; tens of nanoseconds each.
    void highest_visible_log2_frequency(std::span<const float> contrast, std::span<const float> eccentricity_deg,
                                        std::span<const float> luminance_cdm2, std::span<float> log2_frequency) const;

private:
    struct State;
    explicit CsfTable(std::shared_ptr<const State> state);

    std::shared_ptr<const State> state_; // never changes, so copies share it
};

// Says which part of a request lies outside of a table's samples and how it is treated, for reports: "beyond the
// table's 20 degrees sensitivity is taken as there". Empty if nothing does.
std::string beyond_reach(const CsfTable& table, Degrees farthest, Luminance darkest, Luminance brightest);

// ---- people

// How much more sensitive somebody is than castleCSF, which is right for the median person: 65% of 253 sensitivities from
// eight studies lie above it, the median by 1.2 dB. People differ, and one person differs from study to study, with a
// standard deviation of 4.4 dB. The data are in data/people.
struct Person {
    std::string_view name;
    double gain;        // of sensitivity over castleCSF's
    double share_above; // of measured sensitivities above this person's: of people who might see more
    double barten_gain; // over barten_fitted's sensitivity, with the same share above: see second_judge_options()
    bool operator==(const Person&) const = default;
};

// Each study counts alike. The gratings were still, at up to 30 degrees, of up to 100 square degrees, and of 1 to 500
// cd/m2. Beyond, castleCSF's own formulas and the same shares are used.
inline constexpr Person median_person{"median", 1, 0.649, 0.843};
inline constexpr Person default_person{"default", 2, 0.087, 1.917};
inline constexpr Person strict_person{"strict", 2.7, 0.0487, 2.129};
inline constexpr std::array people = {median_person, default_person, strict_person};

// By name; the error lists them.
Result<Person> person(std::string_view name);

// castleCSF times the gain, for still gratings. The tables of `people` are made once. The gain must be 0.001 to 1000.
std::shared_ptr<const CsfTable> csf_of(const Person& person);

} // namespace unseen::perception
