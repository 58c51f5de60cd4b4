// What judges know of an observer, as numbers: perception makes the tables, and render's passes judge by them on the GPU.
// perception's judges on the CPU are the reference.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include <glm/vec3.hpp>

namespace unseen {

// Where the gaze is on the flat screen, for an eye in front of the window's centre.
struct GazeOnScreen {
    glm::vec3 direction = {0, 0, 1}; // of length 1: right, down, forward
    double tangent_per_pixel = 0;

    // Along one axis of a window of `size` pixels; the centre of the first is at 0.5. The direction to pixel (x, y) is
    // (tangent(x + 0.5, width), tangent(y + 0.5, height), 1), and its eccentricity the angle to `direction`.
    double tangent(double px, int size) const { return (px - 0.5 * size) * tangent_per_pixel; }
};

// How the judge sees pictures of one size whose luminances lie in one range. Its steps, for each band but the base:
//
//   next = reduced picture,  L = max(expanded next, floor_cdm2),  C = (picture - expanded next) / L
//
// and the same of the base with L = picture and C = 0. Smoothing, h*, is by (1 2 1)/4 along both axes. Of a sample at
// (x, y), the eccentricity is that of pixel (x << level, y << level). The reference makes, with S, own, smoothed of the
// band's nodes,
//
//   T = masking of |own C + smoothed h*C| S of_patch,   threshold = L T / (S of_patch),
//
// and of differences D, split likewise but not divided, |own D + smoothed h*D| S / (L T) are contrasts in thresholds,
// at most `most_thresholds`. Twice their squares, summed by the window, to the power of beta / 2, are added up over the
// bands, each sample for the pixels it is nearest to; the sum to the power of 1 / beta is V. A picture's threshold is
// the least of its bands'.
struct JudgeTables {
    // At a luminance and an eccentricity; in between all three are linear over these.
    struct Node {
        float log2_s = 0; // of S, to unlimited gratings of the band's nominal frequency
        float own = 1, smoothed = 0;
    };
    // Sums energies with the weights of a Gaussian, on a plane that was halved this many times and is then enlarged.
    struct Gaussian {
        double weight = 0;
        int halvings = 0;
        std::vector<float> kernel; // from the middle on, along one axis; at most 12 values
    };
    struct Band { // level 0 first, the base last
        float of_patch = 1;
        std::array<Gaussian, 3> window; // the law of area; from the widest on
        std::vector<Node> nodes;        // [e * luminances + l]
    };

    int width = 0, height = 0;
    float floor_cdm2 = 0;
    float beta = 0, most_thresholds = 0;
    // The pyramid: taps of its kernel, by distance in samples.
    std::array<float, 3> kernel = {};
    // Masking: (1 + m^power)^(1 / knee), m from least_masker to most_masker.
    float masking_power = 0, masking_knee = 0, least_masker = 0, most_masker = 0;
    // Node l is where a float's bits, shifted right by luminance_shift, are first_luminance + l; what they lose is the
    // share of the way to the next one. Node e is at first_eccentricity + e eccentricity_step degrees. What lies beyond
    // the nodes counts as their end.
    int luminance_shift = 0, first_luminance = 0;
    int luminances = 0, eccentricities = 0; // at least 2 and 1; eccentricities are 1 without a gaze
    float first_eccentricity = 0, eccentricity_step = 0;
    std::optional<GazeOnScreen> gaze = {}; // without one nothing depends on eccentricity
    std::vector<Band> bands;
};

// What rpg99_map() of a picture and itself knows of an observer. Its steps:
//
//   a_0 = picture,  a_i+1 = a_i blurred by the kernel along both axes,
//   c_i = |a_i - a_i+1| / max(a_i+2, floor),  A = max(a_adaptation_level, floor),
//   elevation = sum c_i frequency_factor_i m(c_i csf_i(A)) / max(sum c_i, floor), within 1..largest_elevation,
//   m(x) = (1 + (masking_scale (masking_gain x)^masking_power)^4)^(1/4),  threshold = elevation tvi(A).
//
// What lies before a picture is its mirror image about the first pixel, what follows it that about the last one's edge.
struct Rpg99Tables {
    static constexpr int band_count = 6, level_count = 8; // c_0.., a_0..

    std::array<float, 3> kernel = {}; // by distance in pixels
    std::array<float, band_count> frequency_factor = {};
    int adaptation_level = 0; // 0..level_count - 1
    float floor = 0, largest_elevation = 0;
    float masking_scale = 0, masking_gain = 0, masking_power = 0;
    // Node l is at the luminance 2^(first_log2 + l / nodes_an_octave) cd/m2; in between logarithms are linear.
    float first_log2 = 0;
    int nodes_an_octave = 0, luminances = 0;
    std::vector<float> log2_tvi; // by node
    std::vector<float> log2_csf; // [band * luminances + node]
};

} // namespace unseen
