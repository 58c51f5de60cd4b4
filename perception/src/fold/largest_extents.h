// From how far folds go unseen: the largest extents of which a row of a table shows nothing, and the lengths of folds in
// all cuts.
#pragma once

#include <limits>

#include <unseen/perception/internal/cut_rings.h>

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

// The extents, by bins so many degrees apart, of what has this contrast and luminance alone and is no larger than its
// sphere, all at once. Infinite where not even the peak is seen.
inline void find_grey_extents(double contrast, double luminance_cdm2, const CsfTable& csf, double bin_degrees,
                              std::span<double> extents) {
    std::array<float, 2 * bin_count> contrasts, eccentricity, luminance, log2_frequency;
    const auto used = [&](auto& all) { return std::span(all).first(extents.size()); };
    for (std::size_t bin = 0; bin < extents.size(); ++bin)
        eccentricity[bin] = static_cast<float>(static_cast<double>(bin) * bin_degrees);
    contrasts.fill(static_cast<float>(contrast));
    luminance.fill(static_cast<float>(luminance_cdm2));
    csf.highest_visible_log2_frequency(used(contrasts), used(eccentricity), used(luminance), used(log2_frequency));
    for (std::size_t bin = 0; bin < extents.size(); ++bin)
        extents[bin] = 1 / (2 * std::exp2(static_cast<double>(log2_frequency[bin])));
}

// The distance, in lengths, from which an extent is no larger than this on the screen.
inline float switch_distance_of(double extent_deg, const Screen& screen, bool is_around_spheres) {
    if (std::isinf(extent_deg)) return 0; // only from inside
    const double half = extent_deg / screen.largest_magnification / degrees_per_radian / 2;
    const double in_lengths = half < std::numbers::pi / 2 ? 1 / std::sin(half) : 1; // from the centre
    return static_cast<float>((is_around_spheres ? in_lengths : in_lengths - 1) * (1 + distance_rounding));
}

inline constexpr float length_rounding = 1e-6f; // covers that of a mean of two floats

// Fills a row of a table by its extents. `visibility`: by bin, of what shows from whatever distance.
template <class Visibility>
void set_row(vdtree::DistanceCriterion::Parts& parts, std::size_t row, std::span<const double> extents,
             const Screen& screen, const Visibility& visibility) {
    const std::size_t bins = parts.eccentricity_bins;
    float *const switch_distance = &parts.switch_distance[row * bins], *const least_cost =
                                                                           &parts.least_cost[row * bins];
    for (std::size_t bin = 0; bin < bins; ++bin) {
        switch_distance[bin] = switch_distance_of(extents[bin], screen, !parts.lengths.empty());
        // No fold is drawn smaller than a pixel.
        least_cost[bin] = static_cast<float>(std::max(screen.pixel_deg / extents[bin], visibility(bin)));
        // The table's own rounding must not make anything grow with the eccentricity.
        if (bin == 0) continue;
        switch_distance[bin] = std::min(switch_distance[bin], switch_distance[bin - 1]);
        least_cost[bin] = std::min(least_cost[bin], least_cost[bin - 1]);
    }
}

// Half the extents of folds, mesh units: the change is largest within the support and fades to nothing at the ring's
// border. No less than the children's.
inline std::vector<float> safe_lengths(const vdtree::SoundTree& tree, const CutRings& rings) {
    std::vector<float> lengths(tree.interior_count(), 0.0f);
    for (vdtree::NodeId node = tree.interior_count(); node-- > 0;) {
        const float around = 0.5f * (tree.support_spheres()[node].radius + rings.radius[node]) * (1 + length_rounding);
        lengths[node] = std::max({lengths[node], tree.bounds()[node].ring.radius, around});
        if (node > 0) lengths[tree.parents()[node]] = std::max(lengths[tree.parents()[node]], lengths[node]);
    }
    return lengths;
}

// The directions that make nodes outlines; empty: the tree's. Where another part is near, any.
inline std::vector<vdtree::NormalSlabs> safe_facing(const vdtree::VertexTree& tree, const CutRings& rings) {
    std::vector<vdtree::NormalSlabs> facing;
    if (!rings.meets_another.empty())
        for (vdtree::NodeId node = 0; node < tree.interior_count(); ++node)
            facing.push_back(rings.meets_another[node] ? vdtree::NormalSlabs::everything() : tree.bounds()[node].slabs);
    return facing;
}

} // namespace unseen::perception
