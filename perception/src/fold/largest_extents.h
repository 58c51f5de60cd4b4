// From how far folds go unseen: the largest extents of which a row of a table shows nothing.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "fold/fold_screen.h"

namespace unseen::perception {

// In degrees on the screen; infinite where the row shows nothing at any extent. Smaller is what comes first: bins in
// ascending eccentricity. `Visibility`: of a grating, by its frequency in cpd and its eccentricity in degrees; 1 is
// just visible. It must not grow with either.
template <class Visibility>
class LargestExtents {
public:
    // Extents around the spheres are larger than these, from whose nearest points eccentricity is counted: they reach
    // nearer to the gaze, by half of their width at most.
    LargestExtents(Visibility visibility, const Screen& screen, bool is_around_spheres)
        : visibility_(visibility), is_around_spheres_(is_around_spheres),
          step_(step_of(screen.pixel_deg / smallest_of_a_pixel)) {}

    double at(double eccentricity_deg) {
        // Of a fixed series of extents, so that more contrast never makes them larger.
        if (step_ == last_step || is_unseen(last_step, eccentricity_deg)) {
            step_ = last_step;
            return std::numeric_limits<double>::infinity();
        }
        int above = step_ + 1;
        for (int stride = 1; above < last_step && is_unseen(above, eccentricity_deg); stride *= 2) {
            step_ = above;
            above = std::min(above + stride, last_step);
        }
        while (above - step_ > 1) {
            const int middle = step_ + (above - step_) / 2;
            (is_unseen(middle, eccentricity_deg) ? step_ : above) = middle;
        }
        return extent(step_);
    }

private:
    static constexpr double steps_per_octave = 128;
    static constexpr int last_step = 9 * 128;           // 512 degrees: all that is seen
    static constexpr double smallest_of_a_pixel = 1024; // far below what any fold costs 1 at

    static double extent(int step) { return std::exp2(step / steps_per_octave); }
    static int step_of(double extent_deg) {
        return static_cast<int>(std::floor(steps_per_octave * std::log2(extent_deg)));
    }
    bool is_unseen(int step, double eccentricity_deg) const {
        const double nearest =
            is_around_spheres_ ? std::max(0.0, eccentricity_deg - extent(step) / 2) : eccentricity_deg;
        return visibility_(1 / (2 * extent(step)), nearest) <= 1;
    }

    Visibility visibility_;
    bool is_around_spheres_;
    int step_; // not seen, or smaller than anything that matters
};

// The distance, in lengths, from which an extent is no larger than this on the screen.
inline float switch_distance_of(double extent_deg, const Screen& screen, bool is_around_spheres) {
    if (std::isinf(extent_deg)) return 0; // only from inside
    const double half = extent_deg / screen.largest_magnification / degrees_per_radian / 2;
    const double in_lengths = half < std::numbers::pi / 2 ? 1 / std::sin(half) : 1; // from the centre
    return static_cast<float>((is_around_spheres ? in_lengths : in_lengths - 1) * (1 + distance_rounding));
}

} // namespace unseen::perception
