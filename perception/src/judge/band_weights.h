// What the judge knows of the bands of a Laplacian pyramid: how they answer to gratings, how well an eye sees them by
// luminance and eccentricity, and which eccentricity is where in a picture.
//
// - A band's gain is below 1 (and below the gain for other frequencies). Contrasts are divided by the band's response
//   to a grating of its nominal frequency, which follows from the kernel.
// - Bands are an octave and more wide, and S changes within one: at 10 degrees it halves between 5.5 and 8 cpd. One
//   number per band is then wrong by up to 5 dB between the nominal frequencies. So each band's contrast C passes a
//   3 x 3 binomial filter h and counts as own C + smoothed (h*C): tilted along the slope of S.
// - A grating is in two bands or three. `own` and `smoothed` are fitted so that what the bands' answers pool to is S,
//   each band bringing the share that it would bring of a flat S. They follow from the kernel, the exponent of the
//   pooling and the CSF, by luminance and eccentricity.
#pragma once

#include "judge/summation.h"

namespace unseen::perception {

struct Range {
    float low = 0, high = 0;
};

// Nothing without a gaze.
std::optional<GazeOnScreen> gaze_on_screen(int width, int height, const JudgeOptions& options);
// The angles between the gaze and each pixel's centre, in degrees, both on the flat screen, for an eye in front of the
// window's centre. Empty without a gaze.
Plane eccentricities(int width, int height, const JudgeOptions& options);
Range eccentricity_range(int width, int height, const JudgeOptions& options); // of the same, which nobody keeps

// What the weights of all bands depend on.
struct BandConditions {
    CsfModel model = CsfModel::castle;
    std::shared_ptr<const CsfTable> table; // in the model's place; or null
    Metres distance{0.5};                  // of the screen
    double ppd = 0;
    double beta = 0;
    double gain = 1;    // of the model's sensitivity, or the table's
    Range luminance;    // of the reference, cd/m2
    Range eccentricity; // of its pixels, degrees
    int base_level = 0;
};
BandConditions conditions_for(const Plane& luminance, const JudgeOptions& options, const Plane& eccentricities);
BandConditions conditions_for(int width, int height, Range luminance, Range eccentricity, const JudgeOptions& options);
// What the screen cannot show cannot be a reference luminance either.
double contrast_floor(const Display& display);
Result<void> check(const JudgeOptions& options);

// The area at which patches of a frequency are seen half as well, in power, as unlimited gratings; square degrees.
double summation_area(const BandConditions& c, double freq_cpd);
double summation_area_in_samples(const BandConditions& c, int level); // of a level, at its nominal frequency

// The limit of one band's contrasts: far beyond all that is visible, and its power is still a float.
float most_thresholds(double beta);

// To unlimited gratings.
double sensitivity_of(const BandConditions& c, double freq_cpd, double luminance, double eccentricity);

double nominal_frequency(double ppd, int level); // cpd
int base_level(int width, int height, double ppd);

// Weights of samples in a row.
struct BandWeights {
    std::vector<float> sensitivity;   // to unlimited gratings of the nominal frequency
    std::vector<float> own, smoothed; // how contrasts count, in units of what the nominal frequency's should be
};

// The weights of one band over luminance and eccentricity, for the ranges that the images need.
class BandTable {
public:
    BandTable(const BandConditions& c, int level);

    // By luminance, then by eccentricity. Cells of luminances are told by a float's bits.
    using Node = JudgeTables::Node;
    static constexpr double eccentricity_step = 2; // degrees
    static constexpr int cell_bits = 4;            // cells of an octave of luminance: 2^4
    static constexpr int fraction_bits = 23 - cell_bits;

    double of_patch() const { return of_patch_; } // sensitivity to a patch, over that to unlimited gratings
    int first_cell() const { return first_cell_; }
    float first_eccentricity() const { return first_eccentricity_; }
    std::size_t luminances() const { return luminances_; }
    std::size_t eccentricities() const { return eccentricities_; }
    const std::vector<Node>& nodes() const { return nodes_; }

    // Weighs samples with these luminances in cd/m2 and eccentricities in degrees; no eccentricities if there is no
    // gaze. What is beyond the conditions' ranges counts as their end.
    void weigh(std::span<const float> luminance, std::span<const float> eccentricity, BandWeights& weights) const;

private:
    int first_cell_ = 0; // of luminances, see luminance_cell()
    std::size_t luminances_ = 0, eccentricities_ = 0;
    float first_eccentricity_ = 0;
    double of_patch_ = 1;
    std::vector<Node> nodes_; // by eccentricity
};

// The nearest sample of a level for every pixel along one axis: a sample stands for the block around it.
std::vector<std::size_t> nearest_samples(int pixels, int level, int samples);

// Merges a band's values into the full resolution, each into its whole block.
template <class Plane, class Merge>
void spread(const Plane& band, int level, Plane& full, Merge merge) {
    const auto columns = nearest_samples(full.width, level, band.width);
    const auto rows = nearest_samples(full.height, level, band.height);
    for (int y = 0; y < full.height; ++y) {
        const auto* const from = band.row(static_cast<int>(rows[static_cast<std::size_t>(y)]));
        auto* const to = full.row(y);
        for (std::size_t x = 0; x < columns.size(); ++x) merge(to[x], from[columns[x]]);
    }
}

} // namespace unseen::perception
