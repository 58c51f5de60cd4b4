// Classes of nodes under lights, and how far the lights may move before these lead to another verdict.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <memory>

#include <vdtree/distance_criterion.h>

#include "fold_kernel.h"
#include "lit_kernel.h"
#include "prefetch.h"

namespace unseen::vdtree {

// What a radian of the lights' motion counts as on the facing clock, in lengths for a radian (twice the distance): lights leave most
// verdicts standing for a dozen degrees or more, and the eye for a tenth of its distance.
inline constexpr double light_weight = 0.25;

// What is known of the lights on the lanes of a batch.
struct LitFindings {
    LitBatch ranges;
    std::int32_t row[kernel_lanes];
    std::size_t contrast[kernel_lanes], luminance[kernel_lanes]; // indices of classes
    alignas(64) float slack[kernel_lanes]; // out of leave_room(): of the facing clock
};

class LitTester {
public:
    LitTester(const VertexTree& tree, const LitClasses& classes);

    void look_from(const Viewpoint& viewpoint, double length_per_radian) {
        lights_ = KernelLights(tree_, viewpoint.lighting, viewpoint.eye);
        length_ = light_weight * length_per_radian;
    }
    void prefetch(NodeId node) const { vdtree::prefetch(cones_ + node); }
    std::int32_t silhouette_row() const { return classes_.silhouette; }

    void set(std::size_t lane, NodeId node, const Sphere& ring, LitFindings& lit) const { lit.ranges.set(lane, cones_[node], ring); }
    void find_rows(LitFindings& lit) const {
        find_ranges(lights_, lit.ranges);
        for (std::size_t i = 0; i < kernel_lanes; ++i) {
            const double contrast = difference(lit, i) / mean(lit, i);
            lit.contrast[i] = contrast_index(contrast);
            lit.luminance[i] = luminance_index(static_cast<double>(lit.ranges.hi[i]));
            lit.row[i] = row(lit.luminance[i], lit.contrast[i]);
        }
    }

    // The row on the way from a lane's to where its verdict, `is_unfolded`, would change; `unfolds_at(row)` grows with contrasts and
    // luminances. Sets the lane's slack: for so long the lights lead no farther than to that row.
    template <class UnfoldsAt>
    std::int32_t leave_room(std::size_t lane, bool is_unfolded, UnfoldsAt&& unfolds_at, LitFindings& lit) const {
        const std::size_t contrast = lit.contrast[lane];
        // Any class of luminance where that changes nothing, else the next one or the same.
        std::size_t luminance = is_unfolded ? 0 : ContrastClasses::luminance_count - 1;
        if (unfolds_at(row(luminance, contrast)) != is_unfolded) {
            const std::size_t own = lit.luminance[lane], next = is_unfolded ? own - 1 : own + 1;
            luminance = unfolds_at(row(next, contrast)) == is_unfolded ? next : own;
        }
        // Of the contrasts that lead to the same verdict, the last; known is that `contrast` does. Without branches: they would be guessed
        // wrong half of the time.
        std::size_t folded = is_unfolded ? 0 : contrast; // as many contrasts fold, at least
        for (std::size_t length = is_unfolded ? contrast : ContrastClasses::contrast_count - contrast; length > 0;) {
            const std::size_t half = (length + 1) / 2;
            folded += unfolds_at(row(luminance, folded + half - 1)) ? 0 : half;
            length -= half;
        }
        const std::size_t same = is_unfolded ? folded : folded - 1;
        const std::size_t there = is_unfolded ? contrast - lights_share(contrast - same) : contrast + lights_share(same - contrast);
        lit.slack[lane] = static_cast<float>(length_ * motion_within(lane, is_unfolded, luminance, there, lit));
        return row(luminance, there);
    }

private:
    static constexpr double never = 1e30;
    static constexpr unsigned guess_shift = 23 - 4; // guesses: sixteen an octave
    // Relative luminance: what the kernel's results of two frames differ by for its rounding; as a share, that of the slack itself.
    static constexpr double estimate_rounding = 4e-6, slack_rounding = 1e-3;

    const ContrastClasses& levels() const { return classes_.levels; }
    // Of the way to the limit, in classes: most of it.
    static std::size_t lights_share(std::size_t classes) { return classes - classes / 4; }
    // The classes as ContrastClasses has them, by their edges: a guess by the exponent, and a step or two from there.
    std::size_t contrast_index(double contrast) const {
        const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(contrast));
        constexpr std::uint32_t least_bits = (127u - ContrastClasses::contrast_octaves) << 23;
        std::size_t i = bits <= least_bits || !(contrast > 0) ? 0 : guesses_[std::min<std::size_t>((bits - least_bits) >> guess_shift, guesses_.size() - 1)];
        while (i + 1 < contrasts_.size() && contrasts_[i] < contrast) ++i;
        return i;
    }
    std::size_t luminance_index(double relative) const {
        std::size_t i = 0;
        while (i + 1 < luminances_.size() && luminances_[i] < relative) ++i;
        return i;
    }
    static std::int32_t row(std::size_t luminance, std::size_t contrast) { return ContrastClasses::row_of(luminance, contrast); }
    static double difference(const LitFindings& lit, std::size_t i) {
        return static_cast<double>(lit.ranges.hi[i]) - static_cast<double>(lit.ranges.lo[i]);
    }
    // Twice the mean, with the display's black; relative.
    double mean(const LitFindings& lit, std::size_t i) const {
        return static_cast<double>(lit.ranges.hi[i]) + static_cast<double>(lit.ranges.lo[i]) + twice_black_;
    }

    // How far the lights may move with the contrast at most that of its class (unfolded: more than that of the class below) and
    // the luminance likewise.
    double motion_within(std::size_t i, bool is_unfolded, std::size_t luminance, std::size_t contrast, const LitFindings& lit) const {
        const LitBatch& at = lit.ranges;
        const double jump = at.jump[i], full = at.full_rate[i], fine = at.fine_rate[i], cap = at.cap[i], hi = at.hi[i];
        double limit = 0, left = never;
        if (is_unfolded) {
            if (contrast > 0) limit = contrasts_[contrast - 1];
            left = difference(lit, i) - jump - limit * (mean(lit, i) + 2 * jump);
        } else if (contrast + 1 < ContrastClasses::contrast_count) {
            limit = contrasts_[contrast];
            left = limit * (mean(lit, i) - 2 * jump) - difference(lit, i) - jump;
        }
        left -= estimate_rounding;
        if (!(left > 0)) return 0;
        const double fine_rate = fine + limit * static_cast<double>(at.fine_sum_rate[i]), full_rate = full + limit * full, fine_cap = std::min<double>(at.fine_cap[i], cap);
        double motion = left >= fine_rate * fine_cap ? fine_cap : left / fine_rate;
        if (motion == fine_cap) motion += full_rate > 0 ? (left - fine_rate * fine_cap) / full_rate : never;

        double room = never; // of the brightest luminance
        if (is_unfolded && luminance > 0) room = hi - luminances_[luminance - 1];
        else if (!is_unfolded && luminance + 1 < ContrastClasses::luminance_count) room = luminances_[luminance] - hi;
        room -= jump + estimate_rounding;
        if (!(room > 0)) return 0;
        const double rise = at.rise_rate[i];
        if (rise > 0) motion = std::min(motion, room / rise);
        return std::min(motion, cap) * (1 - slack_rounding);
    }

    const VertexTree& tree_;
    const LitClasses& classes_;
    // The largest of each class, relative.
    std::array<double, ContrastClasses::contrast_count> contrasts_;
    std::array<double, ContrastClasses::luminance_count> luminances_;
    std::array<std::uint8_t, 16 * ContrastClasses::contrast_octaves + 1> guesses_; // by exponent and four bits: a class, not above
    const VertexCone* cones_;
    KernelLights lights_;
    double twice_black_;
    double length_ = 1; // of the facing clock, for a radian
};

inline LitTester::LitTester(const VertexTree& tree, const LitClasses& classes)
    : tree_(tree), classes_(classes), cones_(classes.bounds->cones().data()),
      twice_black_(2 * classes.levels.black() / classes.levels.span()) {
    for (std::size_t i = 0; i < contrasts_.size(); ++i) contrasts_[i] = ContrastClasses::contrast_of_index(i);
    for (std::size_t i = 0; i < luminances_.size(); ++i)
        luminances_[i] = (levels().luminance_of_index(i) - levels().black()) / levels().span();
    std::size_t at = 0;
    for (std::size_t i = 0; i < guesses_.size(); ++i) {
        const float least = std::bit_cast<float>(((127u - ContrastClasses::contrast_octaves) << 23) + (static_cast<std::uint32_t>(i) << guess_shift));
        while (at + 1 < contrasts_.size() && contrasts_[at] < static_cast<double>(least) * (1 - 1e-6)) ++at;
        guesses_[i] = static_cast<std::uint8_t>(at);
    }
}

} // namespace unseen::vdtree
