// Judges of image pairs: which pixels show a visible difference. They check the fold test; they are not its model.
#pragma once

#include <memory>
#include <optional>

#include <glm/vec2.hpp>

#include <unseen/perception/csf.h>
#include <unseen/perception/display.h>
#include <unseen/perception/image.h>
#include <unseen/perception/person.h>

namespace unseen::perception {

struct JudgeOptions {
    Display display = {};                           // of headsets: the images are the flat picture, not the panel's
    std::optional<glm::dvec2> gaze_px = {};         // pixels from the top left, may lie outside; none: all foveal
    CsfModel csf = CsfModel::castle;                // an achromatic one, from the display's distance
    std::shared_ptr<const CsfTable> csf_table = {}; // a viewer's own sensitivity in the model's place; null: the model
    double gain = default_person.gain;              // of the observer's sensitivity, 0.001 to 1000; with a table: 1
    double beta = 3.5;                              // Minkowski exponent over the bands; V = 1 is 75% detection
};

struct Judgement {
    Image visibility; // V by pixel: at or above 1 is visible
    std::uint64_t visible_pixels = 0;
    std::uint64_t pixels = 0;
    double max_ratio = 0; // the largest V
};

// The modern judge. Images are luminance in cd/m2. A decimated Laplacian pyramid with its base band; Weber contrast of
// the difference against the reference's local luminance; sensitivity by pixel and band (luminance, eccentricity); Daly
// masking from the reference alone; Minkowski sum over the bands. Of each band energy, the square of contrasts in
// thresholds, is summed over a window whose form is castleCSF's law of area: a patch of area A is seen
// sqrt(A / (A + Ac)) times as well as an unlimited one, and many small differences beside each other better than one.
//
// Calibrated: a Gabor patch of any area reaches V = 1 within 3 dB of contrast 1 / S, between 0.5 cpd and the display's
// limit, S with the gain. V of a pixel tells of what is around it, up to a degree and more at low frequencies. Barten's
// models have a law of area of their own.
class Judge {
public:
    // Prepares the reference: some 50 ns and 15 bytes a pixel. A NaN, infinite or negative luminance is an error, and
    // so are options that are none: a display that validate() refuses, a gaze that is not finite, a sensitivity to
    // colour, a gain outside of its range, a beta outside of 1 to 8.
    static Result<Judge> create(Image reference, const JudgeOptions& options);

    // Of a picture of the reference's size. Cost: some 40 ns a pixel. Errors: a NaN, infinite or negative luminance, and
    // another size. Any number of threads may judge at once.
    Result<Judgement> judge(const Image& test) const;

private:
    struct State;
    explicit Judge(std::shared_ptr<const State> state);
    std::shared_ptr<const State> state_; // never changes
};

// The same at once, of one pair.
Result<Judgement> judge_modern(const Image& reference, const Image& test, const JudgeOptions& options);

// The judge's threshold map, cd/m2: how large a step of luminance must be to be just visible at the pixel as a patch of
// patch_area(), in the band that is most sensitive there, given the reference's masking.
Result<Image> threshold_map_modern(const Image& reference, const JudgeOptions& options);

// What makes of the judge the second one, another model of the same observer: CsfModel::barten_fitted, of the eye's
// physics, in place of castleCSF, with Barten's law of area; squares over the bands in place of powers of 3.5. It is
// held against the same people: Person::barten_gain.
JudgeOptions second_judge_options(const Person& person, const Display& display = {},
                                  const std::optional<glm::dvec2>& gaze_px = {});

// Ramasubramanian, Pattanaik and Greenberg 1999 as Yee's PerceptualDiff computes it, kept for comparison; almost blind
// to high-frequency changes: not a gate.
// `field_degrees` is the horizontal field of the image: physical_field(display, width).
// `masked_by_both`: elevation and adaptation from the larger/mean of both images, as that program does; else from the
// reference alone.
struct Rpg99Options {
    double field_degrees = 45;
    bool masked_by_both = true;
};
struct Rpg99Map {
    Image adaptation; // cd/m2
    Image elevation;  // F, 1..10
    Image threshold;  // cd/m2
};
Result<Rpg99Map> rpg99_map(const Image& reference, const Image& test, const Rpg99Options& options);
Result<Judgement> judge_rpg99(const Image& reference, const Image& test, const Rpg99Options& options);

// Luminance as PerceptualDiff computes it from code values 0..1: gamma 2.2, AdobeRGB weights, black 0.
Image perceptualdiff_luminance(const Image& codes, double peak_cdm2);

// Wang et al. 2004 on Rec. 601 luma of 8-bit codes: Gaussian window of sigma 1.5, 11 x 11, K1 = 0.01, K2 = 0.03, biased
// covariance, mean over the image without the window's margin. Images are code values 0..1.
Result<double> ssim(const Image& reference_codes, const Image& test_codes);

} // namespace unseen::perception
