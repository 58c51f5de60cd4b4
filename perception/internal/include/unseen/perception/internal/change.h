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

#include <unseen/perception/judge.h>

namespace unseen::perception {

// For so long changes add up: what was before is no more in mind. Visible persistence and iconic memory last 0.1 to
// 0.5 s (M. Coltheart, Iconic memory and visible persistence, Perception & Psychophysics 27, 1980); the longest errs
// towards seeing more.
inline constexpr double remembered_s = 0.5;

// V as of a Judgement: a change is visible where not V < 1.
struct ChangeJudgement {
    double visibility = 0; // of both: (lasting^beta + flicker^beta)^(1/beta)
    double lasting = 0;    // the largest V of what is different after it
    double flicker = 0;    // of all the field
};

// Judges changes frame by frame; a glide is so many small steps. The observer's gain counts over elaTCSF, too; where
// options.csf_table is given, which is the observer's own, flicker is seen as much better as the table's peak is above
// castleCSF's.
class ChangeWatch {
public:
    explicit ChangeWatch(JudgeOptions options) : options_(std::move(options)) {}

    // Lets `seconds` go by, then `before` becomes `after`: two pictures of the same view, of one frame and of the next.
    // A moving view is given as it is now in both, so that only what else has changed is judged. Cost: of 1024 x 1024
    // pixels about 0.7 s. Errors: those of the Judge, and a time that is below 0 or not finite.
    Result<ChangeJudgement> next(const Image& before, const Image& after, double seconds);
    // The same for a frame in which nothing changes.
    void pass(double seconds);

    void set_gaze(std::optional<glm::dvec2> gaze_px) { options_.gaze_px = gaze_px; }

private:
    struct Step {
        double age_s = 0;
        std::vector<float> difference, coarse; // cd/m2; and what the flicker of the moment has of it
    };
    double flicker(const Image& before) const;

    JudgeOptions options_;
    std::deque<Step> steps_;
    int width_ = 0, height_ = 0;
};

} // namespace unseen::perception
