// Judges of image pairs: which pixels show a visible difference. They check the fold test; they are not its model.
#pragma once

#include <memory>
#include <optional>

#include <glm/vec2.hpp>

#include <perception/csf.h>
#include <perception/display.h>
#include <perception/image.h>

namespace unseen::perception {

struct JudgeOptions {
    Display display = {};                           // of headsets: the images are the flat picture, not the panel's
    std::optional<glm::dvec2> gaze_px = {};         // pixels from the top left, may lie outside; none: all foveal
    CsfModel csf = CsfModel::castle;                // an achromatic one, from the display's distance
    std::shared_ptr<const CsfTable> csf_table = {}; // a viewer's own sensitivity in the model's place; null: the model
    double beta = 3.5;                              // Minkowski exponent over the bands; V = 1 is 75% detection
};

struct Judgement {
    Image visibility; // V by pixel: at or above 1 is visible
    std::uint64_t visible_pixels = 0;
    std::uint64_t pixels = 0;
    double max_ratio = 0; // the largest V
};

// The modern map, in double. Both images are luminance in cd/m2 and of one size. A decimated Laplacian pyramid with its
// base band; Weber contrast of the difference against the reference's local luminance; sensitivity by pixel and
// band (luminance, eccentricity, area pi (1.5 / rho)^2); Daly masking from the reference alone; Minkowski sum over the
// bands. A hit in a low band counts its whole block. A NaN or negative luminance is an error, and so are options that
// are none: a display that validate() refuses, a gaze that is not finite, a sensitivity to colour, a beta outside of 1
// to 20. Calibrated: a Gabor patch of 1.5 cycles radius reaches V = 1 within 3 dB of contrast 1 / S at any frequency
// between 0.5 cpd and the display's limit, since a band's contrast is tilted by the slope of S within it (see the
// source). Cost: about 0.4 s and 70 bytes a pixel for 1024 x 1024 pixels on one core.
Result<Judgement> judge_modern(const Image& reference, const Image& test, const JudgeOptions& options);

// The threshold map of judge_modern, cd/m2: the luminance step at the pixel's most sensitive band that is just
// visible there, given the reference's masking.
Result<Image> threshold_map_modern(const Image& reference, const JudgeOptions& options);

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
