// Classes of nodes under lights, and how far the lights may move before these lead to another verdict.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

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
    std::uint32_t translucent = 0;         // a bit a lane: anything may show there, whatever the light
    alignas(64) float slack[kernel_lanes]; // out of leave_room(): of the facing clock
};

class LitTester {
public:
    // `reach`: of rows and bins, as the tests that ask have it; growing with contrasts and luminances.
    LitTester(const VertexTree& tree, const LitClasses& classes, std::span<const float> reach, std::size_t bins);

    void look_from(const Viewpoint& viewpoint, double length_per_radian) {
        lights_ = KernelLights(tree_, viewpoint.lighting, viewpoint.eye);
        length_ = static_cast<float>(light_weight * length_per_radian);
    }
    void prefetch(NodeId node) const { vdtree::prefetch(cones_ + node); }
    std::int32_t silhouette_row() const { return silhouette_row_; }

    void set(std::size_t lane, NodeId node, const Sphere& ring, LitFindings& lit) const { lit.ranges.set(lane, cones_[node], ring); }
    void find_rows(LitFindings& lit) const;

    // The row on the way from a lane's to where its verdict would change; nodes unfold where their row's reach is above `gap`, in
    // lengths, and this one does so far: `is_unfolded`. Sets the lane's slack: for so long the lights lead no farther than to that row.
    std::int32_t leave_room(std::size_t lane, bool is_unfolded, float gap, std::size_t bin, LitFindings& lit) const;

private:
    static constexpr float never = 1e30f;
    // Relative luminance: what the kernel's results of two frames, and the contrasts from these, differ by for their rounding; as a share,
    // that of the slack itself.
    static constexpr float estimate_rounding = 4e-6f, slack_rounding = 1e-3f;
    // Guesses by the exponent of a float and its next bits. Reaches: from 1/4 to 2^14 lengths.
    static constexpr unsigned contrast_shift = 23 - 4, luminance_shift = 23 - 2, reach_shift = 23 - 3;
    static constexpr std::uint32_t least_contrast_bits = (127u - ContrastClasses::contrast_octaves) << 23, least_reach_bits = (127u - 2) << 23;
    static constexpr std::size_t reach_guesses = 16 * 8;

    static std::int32_t row(std::size_t luminance, std::size_t contrast) { return ContrastClasses::row_of(luminance, contrast); }
    static std::size_t bucket(float x, std::uint32_t least_bits, unsigned shift, std::size_t count) {
        const auto bits = std::bit_cast<std::uint32_t>(x);
        return x > 0 && bits > least_bits ? std::min<std::size_t>((bits - least_bits) >> shift, count - 1) : 0;
    }
    static float bucket_start(std::size_t bucket, std::uint32_t least_bits, unsigned shift) {
        return bucket == 0 ? 0 : std::bit_cast<float>(least_bits + (static_cast<std::uint32_t>(bucket) << shift));
    }
    // The classes as ContrastClasses has them, by their edges: a guess, and a step or two from there.
    std::size_t contrast_index(float contrast) const {
        std::size_t i = contrast_guesses_[bucket(contrast, least_contrast_bits, contrast_shift, contrast_guesses_.size())];
        while (i + 1 < contrasts_.size() && contrasts_[i] < contrast) ++i;
        return i;
    }
    std::size_t luminance_index(float relative) const {
        std::size_t i = luminance_guesses_[bucket((relative + black_) / luminances_[0], 127u << 23, luminance_shift, luminance_guesses_.size())];
        while (i + 1 < luminances_.size() && luminances_[i] < relative + black_) ++i;
        return i;
    }
    bool unfolds_at(std::size_t luminance, std::size_t contrast, float gap, std::size_t bin) const {
        return gap < reach_[static_cast<std::size_t>(row(luminance, contrast)) * bins_ + bin];
    }
    std::size_t first_to_unfold(std::size_t luminance, float gap, std::size_t bin) const {
        std::size_t i = reach_guesses_[(luminance * bins_ + bin) * reach_guesses + bucket(gap, least_reach_bits, reach_shift, reach_guesses)];
        while (i < contrasts_.size() && !unfolds_at(luminance, i, gap, bin)) ++i;
        return i;
    }
    // Of the way to the limit, in classes: most of it; the rest is for the eye.
    static std::size_t lights_share(std::size_t classes) { return classes - classes / 8; }
    float motion_within(std::size_t lane, bool is_unfolded, std::size_t luminance, std::size_t contrast, const LitFindings& lit) const;

    const VertexTree& tree_;
    const VertexCone* cones_;
    std::span<const float> reach_;
    std::size_t bins_;
    std::int32_t silhouette_row_;
    float black_; // of the display, in its span
    // The largest of each class, and classes that are not above the first one of a bucket.
    std::array<float, ContrastClasses::contrast_count> contrasts_;
    std::array<float, ContrastClasses::luminance_count> luminances_; // with the black; in the span
    std::array<std::uint8_t, 16 * ContrastClasses::contrast_octaves + 1> contrast_guesses_;
    std::array<std::uint8_t, 64> luminance_guesses_;
    std::vector<std::uint8_t> reach_guesses_; // by luminance, bin and bucket
    KernelLights lights_;
    float length_ = 1; // of the facing clock, for a radian
};

} // namespace unseen::vdtree
