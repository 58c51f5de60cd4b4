// Contrast sensitivity: S = 1 / threshold contrast of a grating patch, as a formula and as a table.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/vec3.hpp>

#include <unseen/perception/units.h>
#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/result.h>

namespace unseen::perception {

// Where on the retina, along the horizontal meridian. `worst` takes the more sensitive of the two: a viewer with two
// eyes, or an unknown side.
enum class VisualField { nasal, temporal, worst };

struct Stimulus {
    CyclesPerDegree frequency{4};
    Luminance luminance{100}; // adaptation luminance
    Degrees eccentricity{0};
    Hertz temporal{0};     // counterphase flicker
    SquareDegrees area{1}; // pi sigma^2 of a Gaussian envelope; a square field's, for the older models
    VisualField field = VisualField::worst;
    DegreesPerSecond velocity{0}; // on the retina: see motion.h for how to get it from motion in the world
    Metres distance{0.5};         // from the eye; only Daly's model depends on it
};

// The formulas, their sources, and what each model does not know: docs/model.md.
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
    castle_red_green, // castleCSF's isoluminant branches: contrast is that of opponent_contrast() below
    castle_yellow_violet,
};
inline constexpr std::array csf_models = {CsfModel::castle,
                                          CsfModel::stela,
                                          CsfModel::daly,
                                          CsfModel::barten_1989,
                                          CsfModel::barten_1999,
                                          CsfModel::barten_fitted,
                                          CsfModel::barten_2004,
                                          CsfModel::mannos_sakrison,
                                          CsfModel::rushmeier,
                                          CsfModel::castle_red_green,
                                          CsfModel::castle_yellow_violet};

std::string_view name(CsfModel model);
Result<CsfModel> csf_model(std::string_view name);
// Whether S is that of luminance contrast, which is what fold tests and judges ask for.
bool is_achromatic(CsfModel model);

// The relative models give the shape of S over frequency only. They are scaled to this at their peaks, the peak
// sensitivity of Daly's model, of which Rushmeier's is a simplification.
constexpr double relative_models_peak = 250;

// The closed form, unclamped. Domain: frequency, luminance, area and distance > 0; eccentricity, temporal frequency
// and velocity >= 0, and one of the last two is 0; outside of it NaN. Cost: 0.1 to 0.3 us.
// - Eccentricity: castle and stela by field; daly by its own law; the others lose the factor that Geisler and Perry
//   1998 found, exp(-0.0461 frequency eccentricity), on either side of the field.
// - Temporal frequency: castle and stela by their own channels; the others as a drift of velocity temporal / frequency.
// - Velocity multiplies any model's static sensitivity by velocity_factor() of motion.h.
double sensitivity(CsfModel model, const Stimulus& stimulus);

// Contrast in castleCSF's three directions: luminance, red-green, yellow-violet.
struct OpponentContrast {
    double luminance = 0, red_green = 0, yellow_violet = 0; // at least 0
};
// Of a change `delta` on a `background`, both in the cones' responses L, M, S (CIE 2006, 2 degrees, scaled so that
// L + M is the luminance). NaN where the background's luminance is not above 0.
OpponentContrast opponent_contrast(const glm::dvec3& background_lms, const glm::dvec3& delta_lms);
// How far above threshold a coloured grating is: sqrt(sum over the directions of (contrast S)^2); 1 is just visible.
double castle_visibility(const OpponentContrast& contrast, const Stimulus& stimulus);

// The set-up of the fold test and of the judge: a patch of 1.5 cycles radius, area pi (1.5 / frequency)^2.
SquareDegrees patch_area(CyclesPerDegree frequency);

// The law of area: patches of area A are seen sqrt(A / (A + Ac)) times as well as unlimited ones, with this Ac.
SquareDegrees castle_summation_area(CyclesPerDegree frequency);

// What Barten leaves to be chosen by observer; by default what he takes for the usual one.
struct BartenConstants {
    double signal_to_noise = 3;    // k
    Degrees line_spread{0.5 / 60}; // sigma0: half a minute of arc
    CyclesPerDegree inhibition{7}; // u0
    double greatest_cycles = 15;   // Nmax: over more of a grating the eye does not sum
};
// Of CsfModel::barten_fitted: by least squares of decibels to people's thresholds, each study counting alike
// (calibration::fit_barten()).
inline constexpr BartenConstants fitted_barten{4.9936, Degrees(0.4597 / 60), CyclesPerDegree(4.3221), 7.8149};
// At the fovea; `area` of the pattern, `field` of all that is lit, which decides on the pupil. Preconditions: above 0.
double barten_sensitivity(const BartenConstants& constants, CyclesPerDegree frequency, Luminance luminance,
                          SquareDegrees area, SquareDegrees field);
SquareDegrees barten_summation_area(const BartenConstants& constants, CyclesPerDegree frequency);
inline constexpr SquareDegrees barten_fitted_field{100}; // of barten_fitted: the screen's business, and no patch's

// How many times as well a patch of `area` is seen as one of patch_area(frequency), A15:
//   R own^t,   R = sqrt(A / (A + Ac) (A15 + Ac) / A15),   t = ln R / ln R(unlimited), and 0 for smaller patches than A15
// with castle's law for `own` = 1. People sum more or less than that: `own` says how many times as well as by castle's
// law somebody sees an unlimited grating, of whom it is known how well they see patches of A15 (calibration's
// ObserverProfile::summation). NaN where frequency, area or own are not above 0; the area may be infinite.
double summation_gain(CyclesPerDegree frequency, SquareDegrees area, double own = 1);
double summation_share(CyclesPerDegree frequency, SquareDegrees area); // t

// What a table holds constant; as in Stimulus.
struct CsfConditions {
    Hertz temporal{0};
    DegreesPerSecond velocity{0};
    VisualField field = VisualField::worst;
    Metres distance{0.5};
};
Stimulus stimulus_of(const CsfConditions& conditions, CyclesPerDegree frequency, Degrees eccentricity,
                     Luminance luminance); // of patch_area(frequency)

// Sensitivity over frequency x eccentricity x luminance, interpolated linearly in log S over log frequency,
// eccentricity and log luminance; outside of the axes clamped to their ends: see CsfReach.
struct CsfSamples {
    std::string source;                   // what filled it: model and conditions, or observer and date
    std::vector<double> frequency_cpd;    // two or more, ascending, > 0 and at most 1e4
    std::vector<double> eccentricity_deg; // ascending from 0 to at most 180
    std::vector<double> luminance_cdm2;   // ascending, > 0 and at most 1e10
    std::vector<double> sensitivity;      // > 0 and at most 1e6; [(e * luminances + l) * frequencies + f]
    double summation = 1;                 // of larger patches: `own` of summation_gain(), 0.01 to 100
};

// Where a table has samples. Beyond them it goes on by these rules; the third is of the conservative form alone:
// - farther aside sensitivity is as at the last eccentricity, and in dimmer light as at the lowest luminance. Both take
//   the eye for better than it is, for it sees less there;
// - in brighter light it is as at the highest luminance. Eyes may see more there: up to some 100 cd/m2 sensitivity
//   grows with the light, so give a table that reaches as far as the display does;
// - coarser gratings are seen as well as the best of all that are finer, and finer ones fall on with the shallowest slope
//   at which any column ends.
struct CsfReach {
    CyclesPerDegree coarsest, finest;
    Degrees eccentricity;
    Luminance darkest, brightest;
};

// Copies are cheap and share their data; any number of threads may look up at once.
class CsfTable {
public:
    CsfTable(const CsfTable&) = default; // and no move: there is no empty table
    CsfTable& operator=(const CsfTable&) = default;

    // Checks the samples: the ranges above, that each axis rises by `smallest_spacing` at least from sample to sample,
    // and that sensitivity does not grow with eccentricity by more than `noise_db`. The error names the field and the
    // index, with the values. Then prepares the conservative form below.
    static Result<CsfTable> create(CsfSamples samples);
    // What measured sensitivities may grow by from any eccentricity to a larger one, in decibels (20 log10): a table that
    // grows by more has its rows or columns out of order, or a slip. It is the standard deviation of the difference of
    // two measurements by different studies, each of which strays by 4.4 dB (person.h): root 2 times that. Thresholds by
    // `unseen calibrate` stray by 2.3 dB at the worst, so two of them differ by so much in one case of twenty.
    // Sensitivities below 1 count as 1, for nothing that can be shown is seen there.
    static constexpr double noise_db = 6.2;
    // Below this luminance only rods see, of which the fovea has none: there sensitivity may grow. (CIE 191:2010: where
    // mesopic vision begins.)
    static constexpr Luminance rods_alone_below{0.005};
    // Of neighbours on an axis, in octaves or degrees: closer ones are no measurement but a slip, and would make the
    // slope between them meaningless in float.
    static constexpr double smallest_spacing = 1e-4;
    static constexpr Degrees highest_eccentricity{180};
    // Filled from a model under fixed conditions, for patches of patch_area(frequency): 1/16 to 64 cpd, 0 to 120 deg,
    // 1e-3 to 1e4 cd/m2, within 0.5% of the closed form wherever S > 1. An error where the conditions are outside of
    // the model's domain. Cost: 20 to 400 ms, 1 to 30 MB; daly's is the largest.
    static Result<CsfTable> from_model(CsfModel model, const CsfConditions& conditions);
    static CsfTable from_model(CsfModel model); // static gratings, the worst field
    // The default table, built once: castle's.
    static const CsfTable& standard();

    // Of someone who sees so many times as well, 0.001 to 1000 (person.h). Fails where sensitivities leave the bounds
    // above.
    Result<CsfTable> scaled(double gain) const;

    // The same eye's conservative form for patches that hold half a wave of a frequency, one across. Such a patch has
    // lower frequencies in it, too, of a contrast that goes with the share that it fills of their own patches: the
    // square of the frequency. So sensitivity at a frequency is no less than that at any lower one times the square of
    // their ratio: it falls by no more than two octaves an octave. Where sensitivity falls fast, far from the gaze,
    // this is much more than at the patch's own frequency. sensitivity() stays the samples'. Cost: some milliseconds.
    CsfTable of_half_waves() const;

    // Of what moves over the retina at this velocity: S times velocity_factor() of motion.h, as from_model() has it under
    // CsfConditions::velocity. Coarse gratings are seen better then, so a table that begins at a higher frequency goes on
    // down to 1/16 cpd as at its first one, and columns are sampled densely, for the factor bends. Fails where the
    // velocity is not within 0 to fastest_velocity, or sensitivities leave the bounds above. The same up to
    // least_velocity.
    Result<CsfTable> moving(DegreesPerSecond velocity) const;

    const CsfSamples& samples() const noexcept;
    CsfReach reach() const noexcept;

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
    friend CsfTable widened(const CsfTable& table, Degrees margin);
    // Of another table's columns, which need not be measured again: all checks of create() but that of growth.
    static Result<CsfTable> derived(CsfSamples samples);

    struct State;
    explicit CsfTable(std::shared_ptr<const State> state);

    std::shared_ptr<const State> state_; // the samples and what look-ups need; never changes, so copies share it
};

// What of a request lies outside of a table's samples, and how it is taken, for reports; empty where nothing does.
// "beyond the table's 20 degrees sensitivity is taken as there".
std::string beyond_reach(const CsfTable& table, Degrees farthest, Luminance darkest, Luminance brightest);

} // namespace unseen::perception
