// Changes over time: whether one sees that a picture changes, although the pictures before and after may each pass.
//
// Two things are seen of a change:
// - What *lasts*: the picture after it differs from the one before. That is what the Judge tells.
// - The *flicker* of the moment. Coarse changes are seen best while they happen: below 1 cpd people see gratings that
//   flicker at 4 to 10 Hz some 10 dB better than those that stand still. elaTCSF [1] knows that, by its formula for the
//   eye's response to luminance over time; space comes in by a low-pass and by summation over all of the field.
//
// [1] Y. Cai, A. Bozorgian, M. Ashraf, R. Wanat, R. K. Mantiuk: elaTCSF: A Temporal Contrast Sensitivity Function for
// Flicker Detection and Modeling Variable Refresh Rate Flicker. SIGGRAPH Asia 2024.
#pragma once

#include <deque>
#include <vector>

#include <unseen/perception/judge.h>

namespace unseen::perception {

// ---- flicker ------------------------------------------------------------------------------------------------------

// elaTCSF's sensitivity at a point. Contrast c flickering at one frequency is just seen where
//   integral over the field of (c S)^3.80022 dA = 6.52801 square degrees.
// Luminances count as at least 0.1 cd/m2, below which nothing was measured. NaN where the frequency is below 0, the
// eccentricity not in 0 to 180 degrees, or the luminance not above 0.
double flicker_sensitivity(Hertz frequency, Degrees eccentricity, Luminance luminance);
// Of a uniform disc about that eccentricity; NaN, too, where its radius is not above 0.
double disc_flicker_sensitivity(Hertz frequency, Degrees eccentricity, Luminance luminance, Degrees radius);

// How large the response to a change becomes that takes so many seconds (a ramp; 0: a step), as a share of that to
// flicker of the same contrast at its best frequency: 0.753 for a step, and 0.23 for one without end. The filter is
// elaTCSF's; aside its time runs faster, as flicker is seen up to higher frequencies there. NaN as above, and for times
// below 0.
double ramp_response(double seconds, Degrees eccentricity, Luminance luminance);

// What share of a grating's contrast the flicker of the moment has: 1 up to 0.43 cpd, then castleCSF's transient
// channel over its largest value, within 0.02.
double flicker_share(CyclesPerDegree frequency);

// ---- changes ------------------------------------------------------------------------------------------------------

// A change that takes longer counts as the share of it that happens within this time: what was before is no more in
// mind. Visible persistence and iconic memory last 0.1 to 0.5 s (M. Coltheart, Iconic memory and visible persistence,
// Perception & Psychophysics 27, 1980); the longest errs towards seeing more.
inline constexpr double remembered_s = 0.5;

// V as of a Judgement: a change is visible where not V < 1.
struct ChangeJudgement {
    double visibility = 0; // of both: (lasting^beta + flicker^beta)^(1/beta)
    double lasting = 0;    // the largest V of what is different after it
    double flicker = 0;    // of all the field
};

// The observer's gain counts over elaTCSF, too; where options.csf_table is given, which is the observer's own, flicker
// is seen as much better as the table's peak is above castleCSF's. Cost: of 1024 x 1024 pixels about 0.7 s. Errors:
// those of the Judge, and a time that is below 0 or not finite.
//
// The change from one picture to another of the same view, in so many seconds: a pop in none, a geomorph in its own
// time.
Result<ChangeJudgement> judge_change(const Image& before, const Image& after, double seconds,
                                     const JudgeOptions& options);

// Frame by frame: what changes of the last `remembered_s` add up to. A glide is so many small steps.
class ChangeWatch {
public:
    explicit ChangeWatch(JudgeOptions options) : options_(std::move(options)) {}

    // Lets `seconds` go by, then `before` becomes `after`: two pictures of the same view, of one frame and of the next.
    // A moving view is given as it is now in both, so that only what else has changed is judged.
    Result<ChangeJudgement> next(const Image& before, const Image& after, double seconds);
    // The same for a frame in which nothing changes.
    void pass(double seconds);

    void set_gaze(std::optional<glm::dvec2> gaze_px) { options_.gaze_px = gaze_px; }

private:
    struct Step {
        double age_s = 0;
        std::vector<float> difference, coarse; // cd/m2; and what the flicker of the moment has of it
    };
    JudgeOptions options_;
    std::deque<Step> steps_;
    int width_ = 0, height_ = 0;
};

} // namespace unseen::perception
