// Classes of nodes under lights, and how far the lights may move before these lead to another verdict.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>

#include <vdtree/distance_criterion.h>

#include "fold_kernel.h"
#include "lit_kernel.h"
#include "prefetch.h"

namespace unseen::vdtree {

// What a radian of the lights' motion counts as on the position clock, in what a radian of the gaze does: lights leave verdicts standing
// for about a dozen degrees, and the eye for a quarter of its distance.
inline constexpr double light_weight = 1.0 / 16;

// What is known of the lights on the lanes of a batch.
struct LitFindings {
    LitBatch ranges;
    std::int32_t row[kernel_lanes];
    std::size_t contrast[kernel_lanes], luminance[kernel_lanes]; // indices of classes
    alignas(64) float slack[kernel_lanes]; // out of leave_room(): of the position clock
};

class LitTester {
public:
    LitTester(const VertexTree& tree, const LitClasses& classes) : tree_(tree), classes_(classes), cones_(classes.bounds->cones().data()) {}

    void look_from(const Viewpoint& viewpoint, double length_per_radian) {
        lights_ = KernelLights(tree_, viewpoint.lighting, viewpoint.eye);
        length_ = light_weight * length_per_radian;
    }
    void prefetch(NodeId node) const { vdtree::prefetch(cones_ + node); }
    std::int32_t silhouette_row() const { return classes_.silhouette; }

    void find_rows(const std::array<NodeId, kernel_lanes>& nodes, const NodeBounds* bounds, LitFindings& lit) const {
        for (std::size_t i = 0; i < kernel_lanes; ++i) lit.ranges.set(i, cones_[nodes[i]], bounds[nodes[i]].ring);
        find_ranges(lights_, lit.ranges);
        for (std::size_t i = 0; i < kernel_lanes; ++i) {
            const double contrast = difference(lit, i) / mean(lit, i);
            lit.contrast[i] = ContrastClasses::contrast_index(std::max(contrast, 1e-9));
            lit.luminance[i] = levels().luminance_index(levels().in_cdm2(static_cast<double>(lit.ranges.hi[i])));
            lit.row[i] = contrast > 0 ? ContrastClasses::row_of(lit.luminance[i], lit.contrast[i]) : 0;
        }
    }

    // The row half-way from a lane's to where its verdict, `is_unfolded`, would change; `unfolds_at(row)` grows with contrasts and
    // luminances. Sets the lane's slack: for so long the lights lead no farther than to that row.
    template <class UnfoldsAt>
    std::int32_t leave_room(std::size_t lane, bool is_unfolded, UnfoldsAt&& unfolds_at, LitFindings& lit) const {
        const std::size_t contrast = lit.contrast[lane];
        std::size_t luminance = lit.luminance[lane];
        // One class of luminance more, or less, where that changes nothing.
        if (is_unfolded && luminance > 0 && unfolds_at(row(luminance - 1, contrast))) --luminance;
        else if (!is_unfolded && luminance + 1 < ContrastClasses::luminance_count && !unfolds_at(row(luminance + 1, contrast))) ++luminance;
        // Of the contrasts that lead to the same verdict, the last; known is that `contrast` does.
        std::size_t same = contrast, other = ContrastClasses::contrast_count;
        if (is_unfolded) {
            std::size_t low = 0; // the first that unfolds is in low..same
            while (low < same) {
                const std::size_t middle = (low + same) / 2;
                if (unfolds_at(row(luminance, middle))) same = middle;
                else low = middle + 1;
            }
        } else {
            while (same + 1 < other) {
                const std::size_t middle = (same + other) / 2;
                if (unfolds_at(row(luminance, middle))) other = middle;
                else same = middle;
            }
        }
        const std::size_t half_way = is_unfolded ? contrast - (contrast - same + 1) / 2 : contrast + (same - contrast + 1) / 2;
        lit.slack[lane] = static_cast<float>(length_ * motion_within(lane, is_unfolded, luminance, half_way, lit));
        return row(luminance, half_way);
    }

private:
    static constexpr double never = 1e30;
    // Relative luminance: what the kernel's results of two frames differ by for its rounding; as a share, that of the slack itself.
    static constexpr double estimate_rounding = 4e-6, slack_rounding = 1e-3;

    const ContrastClasses& levels() const { return classes_.levels; }
    static std::int32_t row(std::size_t luminance, std::size_t contrast) { return ContrastClasses::row_of(luminance, contrast); }
    static double difference(const LitFindings& lit, std::size_t i) {
        return static_cast<double>(lit.ranges.hi[i]) - static_cast<double>(lit.ranges.lo[i]);
    }
    // Twice the mean, with the display's black; relative.
    double mean(const LitFindings& lit, std::size_t i) const {
        return static_cast<double>(lit.ranges.hi[i]) + static_cast<double>(lit.ranges.lo[i]) + 2 * levels().black() / levels().span();
    }

    // How far the lights may move with the contrast at most that of its class (unfolded: more than that of the class below) and
    // the luminance likewise.
    double motion_within(std::size_t i, bool is_unfolded, std::size_t luminance, std::size_t contrast, const LitFindings& lit) const {
        const LitBatch& at = lit.ranges;
        const double jump = at.jump[i], full = at.full_rate[i], fine = at.fine_rate[i], cap = at.cap[i], hi = at.hi[i];
        double limit = 0, left = never;
        if (is_unfolded) {
            if (contrast > 0) limit = ContrastClasses::contrast_of_index(contrast - 1);
            left = difference(lit, i) - jump - limit * (mean(lit, i) + 2 * jump);
        } else if (contrast + 1 < ContrastClasses::contrast_count) {
            limit = ContrastClasses::contrast_of_index(contrast);
            left = limit * (mean(lit, i) - 2 * jump) - difference(lit, i) - jump;
        }
        left -= estimate_rounding;
        if (!(left > 0)) return 0;
        const double fine_rate = fine + limit * full, full_rate = full + limit * full, fine_cap = std::min<double>(at.fine_cap[i], cap);
        double motion = left >= fine_rate * fine_cap ? fine_cap : left / fine_rate;
        if (motion == fine_cap) motion += full_rate > 0 ? (left - fine_rate * fine_cap) / full_rate : never;

        const auto relative = [&](std::size_t edge) { return (levels().luminance_of_index(edge) - levels().black()) / levels().span(); };
        double room = never; // of the brightest luminance
        if (is_unfolded && luminance > 0) room = hi - relative(luminance - 1);
        else if (!is_unfolded && luminance + 1 < ContrastClasses::luminance_count) room = relative(luminance) - hi;
        room -= jump + estimate_rounding;
        if (!(room > 0)) return 0;
        if (full > 0) motion = std::min(motion, room / full);
        return std::min(motion, cap) * (1 - slack_rounding);
    }

    const VertexTree& tree_;
    const LitClasses& classes_;
    const VertexCone* cones_;
    KernelLights lights_;
    double length_ = 1; // of the position clock, for a radian
};

} // namespace unseen::vdtree
