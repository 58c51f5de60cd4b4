// What judges know of the bands of a Laplacian pyramid: how they answer to gratings, how well an eye sees them by
// luminance and eccentricity, and which eccentricity is where in a picture.
//
// - A band's gain is below 1 (and below the gain for other frequencies). Contrasts are divided by the band's response to
//   a grating of its nominal frequency, which follows from the kernel.
// - Bands are an octave and more wide, and S changes within one: at 10 degrees it halves between 5.5 and 8 cpd. One
//   number per band is then wrong by up to 5 dB between the nominal frequencies. So each band's contrast passes a
//   3 x 3 binomial filter h and counts as C + t (h*C - h(rho_k) C): unchanged at its nominal frequency and tilted
//   beside it. The tilt t follows from the CSF alone, by luminance and eccentricity.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <perception/csf.h>
#include <perception/image.h>
#include <perception/judge.h>
#include <vdtree/result.h>

namespace unseen::perception {

struct Range {
    double low = 0, high = 0;
};

// The angle between gaze point and pixel, both on the flat screen, for an eye in front of the window's centre.
class Eccentricity {
public:
    Eccentricity(const Image& window, const JudgeOptions& options);
    double largest() const { return largest_; }
    // Degrees, at the centre of the pixel of these indices.
    double at_pixel(double x, double y) const { return has_gaze_ ? angle(direction(x + 0.5, y + 0.5)) : 0; }

private:
    glm::dvec3 direction(double x, double y) const { return {x - centre_.x, y - centre_.y, distance_px_}; }
    double angle(const glm::dvec3& d) const;

    glm::dvec2 centre_;
    double distance_px_ = 1;
    bool has_gaze_ = false;
    glm::dvec3 gaze_{0, 0, 1};
    double largest_ = 0;
};

// What the weights of all bands depend on.
struct BandConditions {
    CsfModel model = CsfModel::castle;
    std::shared_ptr<const CsfTable> table; // in the model's place; or null
    Metres distance{0.5};                  // of the screen
    double ppd = 0;
    double beta = 0;
    double gain = 1; // of the model's sensitivity, or the table's
    Range log10_luminance;
    double largest_eccentricity = 0; // degrees
};
BandConditions conditions_for(const Image& reference, const JudgeOptions& options, const Eccentricity& eccentricity);
// What the screen cannot show cannot be a reference luminance either.
double contrast_floor(const Display& display);
Result<void> check(const JudgeOptions& options);

// The area at which patches of a frequency are seen half as well, in power, as unlimited gratings; square degrees.
double summation_area(const BandConditions& c, double freq_cpd);

// To unlimited gratings.
double sensitivity_of(const BandConditions& c, double freq_cpd, double luminance, double eccentricity);

double nominal_frequency(double ppd, int level); // cpd
int base_level(const Image& image, double ppd);

struct BandWeight {
    double sensitivity = 0; // to unlimited gratings
    double tilt = 0;
};

// S and tilt of one band over log luminance and eccentricity, for the ranges that the images need.
class BandTable {
public:
    BandTable(const BandConditions& c, int level, bool is_base);

    double gain() const { return gain_; }
    double smooth_at_nominal() const { return smooth_at_nominal_; }
    double of_patch() const { return of_patch_; } // sensitivity to a patch, over that to unlimited gratings

    BandWeight at(double log10_luminance, double eccentricity) const;

private:
    struct Node {
        double log_s = 0, tilt = 0;
    };
    struct Cell {
        std::size_t low = 0, high = 0;
        double share = 0;
    };
    static Cell cell(double position, int count);
    static Node mix(const Node& a, const Node& b, double t);
    Node node(const BandConditions& c, double luminance, double eccentricity) const;
    double fit_tilt(const BandConditions& c, double luminance, double eccentricity, double nominal_s) const;

    double origin_ = 0;
    int level_ = 0;
    bool is_base_ = false;
    double gain_ = 1, smooth_at_nominal_ = 0, of_patch_ = 1;
    int luminances_ = 0, eccentricities_ = 0;
    std::vector<Node> nodes_;
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
