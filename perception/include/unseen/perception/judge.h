// Judges of image pairs: which pixels show a visible difference. They check the fold test.
#pragma once

#include <optional>

#include <glm/vec2.hpp>

#include <unseen/perception/csf.h>
#include <unseen/perception/image.h>

namespace unseen::perception {

struct JudgeOptions {
    Display display = {};                           // for headsets, the images are the flat picture, not the panel's
    std::optional<glm::dvec2> gaze_px = {};         // pixels from the top left, may lie outside; default: all foveal
    CsfModel csf = CsfModel::castle;                // must be achromatic; at the display's distance
    std::shared_ptr<const CsfTable> csf_table = {}; // a viewer's own, used instead of the model
    double gain = default_person.gain;              // of sensitivity, 0.001 to 1000; ignored with a table
    std::optional<double> colour_gain = {}; // of castleCSF's branches of colour; default: gain, or with a table 2
    double beta = 3.5;                      // Minkowski exponent over the bands; V = 1 is 75% detection
};

struct Judgement {
    Image visibility; // V by pixel: visible at 1 and above
    std::uint64_t visible_pixels = 0;
    std::uint64_t pixels = 0;
    double max_ratio = 0;       // the largest V
    bool judges_colour = false; // colours differ somewhere: the channels of colour were judged, too
};

// The modern judge. Images are luminance in cd/m2, or linear RGB (Rec. 709) of which white (L, L, L) is L cd/m2. Its steps:
// - a decimated Laplacian pyramid with its base band;
// - Weber contrast of the difference against the reference's local luminance;
// - sensitivity by pixel and band, from luminance and eccentricity; Daly masking by the reference alone;
// - in each band, energy (squares of contrasts in thresholds) is summed over a window whose shape follows the law of
//   area of the CSF: many small differences side by side are seen better than one;
// - where colours differ, the same in the directions red-green and yellow-violet (opponent contrasts over the
//   luminance, castleCSF's branches of colour, masking by the reference in the same direction); energies are added;
// - a Minkowski sum over the bands.
//
// A Gabor patch of any area reaches V = 1 within 3 dB of contrast 1 / (gain S), between 0.5 cpd and the display's
// limit. V of a pixel depends on its surroundings, up to a degree and more at low frequencies.
class Judge {
public:
    // Prepares the reference: some 50 ns and 15 bytes a pixel, and twice that again for the first picture of other colours.
    // Fails on NaN, infinite or negative luminance, and on invalid options: a display that validate() refuses, a gaze that is not finite, a chromatic CSF, a gain outside of
    // its range, a beta outside of 1 to 8.
    static Result<Judge> create(Image reference, const JudgeOptions& options);

    // Judges a picture of the reference's size, grey or coloured. Cost: some 40 ns a pixel, three times that where colours
    // differ. Fails on another size, and on NaN, infinite or negative luminance. Threads may judge at the same time.
    Result<Judgement> judge(const Image& test) const;

private:
    struct State;
    explicit Judge(std::shared_ptr<const State> state);
    std::shared_ptr<const State> state_; // shows no change
};

// create() and judge() in one call.
Result<Judgement> judge_modern(const Image& reference, const Image& test, const JudgeOptions& options);

// The step of luminance, cd/m2, that is just visible at each pixel as a patch of patch_area(), in the most sensitive
// band there, with the reference's masking.
Result<Image> threshold_map_modern(const Image& reference, const JudgeOptions& options);

// The second judge: CsfModel::barten_fitted, a model of the eye's physics with a law of area of its own, instead of
// castleCSF, and squares over the bands instead of powers of 3.5. Its gain is Person::barten_gain.
JudgeOptions second_judge_options(const Person& person, const Display& display = {},
                                  const std::optional<glm::dvec2>& gaze_px = {});

// Ramasubramanian, Pattanaik and Greenberg 1999 as Yee's PerceptualDiff computes it, for comparison. It is almost blind
// to high-frequency changes, so it proves nothing.
// `field_degrees`: the horizontal field of the image, physical_field(display, width). Elevation is the larger and
// adaptation the mean of both images'.
struct Rpg99Map {
    Image adaptation; // cd/m2
    Image elevation;  // F, 1..10
    Image threshold;  // cd/m2
};
Result<Rpg99Map> rpg99_map(const Image& reference, const Image& test, double field_degrees);
Result<Judgement> judge_rpg99(const Image& reference, const Image& test, double field_degrees);

// Wang et al. 2004 on Rec. 601 luma of 8-bit codes: Gaussian window of sigma 1.5, 11 x 11, K1 = 0.01, K2 = 0.03, biased
// covariance, mean over the image without the window's margin. Images are code values 0..1.
Result<double> ssim(const Image& reference_codes, const Image& test_codes);

} // namespace unseen::perception
