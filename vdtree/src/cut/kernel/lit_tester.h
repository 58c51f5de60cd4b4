// Classes of nodes under lights, and how far the lights may move before these lead to another verdict.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/internal/contrast_classes.h>
#include <unseen/vdtree/internal/light_bounds.h>

#include "cut/kernel/fold_kernel.h"
#include "cut/kernel/lit_kernel.h"
#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

// What a radian of the lights' motion counts as on their clock, in lengths for a radian (twice the distance): slacks by
// lights are then about as long as those of the eye's path, from which the rounding of tests is taken.
inline constexpr double light_weight = 0.25;

// What is known of the lights on the lanes of a batch.
struct LitFindings {
    LitBatch ranges;
    alignas(64) std::int32_t row[kernel_lanes], contrast[kernel_lanes],
        luminance[kernel_lanes];   // and the indices of its classes
    std::uint32_t translucent = 0; // a bit a lane: anything may show there, whatever the light

    // For leave_room(): nodes unfold where their row's switch distance is above `gap`, in lengths; whether those of
    // their own rows do, 1 or 0.
    alignas(64) float gap[kernel_lanes];
    alignas(64) std::int32_t bin[kernel_lanes], is_unfolded[kernel_lanes];
    // Out: the rows on the way to where the verdicts would change, and for how long, on their clock, the lights lead no
    // farther.
    alignas(64) std::int32_t farthest_row[kernel_lanes];
    alignas(64) float slack[kernel_lanes];
};

class LitTester {
public:
    // `switch_distance`: of rows and bins, as the tests that ask have it; growing with contrasts and luminances.
    LitTester(const VertexTree& tree, const LitClasses& classes, std::span<const float> switch_distance,
              std::size_t bins);

    void look_from(const Viewpoint& viewpoint, double length_per_radian) {
        lights_ = KernelLights(tree_, viewpoint.lighting, viewpoint.eye);
        lights_.eye_inexact += static_cast<float>(viewpoint.eye_spread * (1 + 1e-6)); // up, where it is rounded
        length_ = static_cast<float>(light_weight * length_per_radian);
    }
    // Most cones lie in two cache lines.
    void prefetch(NodeId node) const {
        vdtree::prefetch(cones_ + node);
        vdtree::prefetch(reinterpret_cast<const std::byte*>(cones_ + node + 1) - 1);
    }
    std::int32_t silhouette_row() const { return silhouette_row_; }

    void set(std::size_t lane, NodeId node, const Sphere& ring, LitFindings& lit) const {
        lit.ranges.set(lane, cones_[node], radii_ ? Sphere{ring.centre, radii_[node]} : ring);
    }
    void find_rows(LitFindings& lit) const;

    void leave_room(LitFindings& lit) const;

private:
    static constexpr std::int32_t contrast_count = ContrastClasses::contrast_count,
                                  luminance_count = ContrastClasses::level_count;
    static constexpr std::int32_t contrast_guess_count = 16 * ContrastClasses::contrast_octaves + 1,
                                  luminance_guess_count = 64;
    static constexpr float never = 1e30f;
    // Relative luminance: what the kernel's results of two frames, and the contrasts from these, differ by for their
    // rounding; as a share, that of the slack itself.
    static constexpr float estimate_rounding = 4e-6f, slack_rounding = 1e-3f;
    // Guesses by the exponent of a float and its next bits. Switch distances: from 1/4 to 2^14 lengths.
    static constexpr unsigned contrast_shift = 23 - 4, luminance_shift = 23 - 2, distance_shift = 23 - 3;
    static constexpr std::int32_t least_contrast_bits = (127 - ContrastClasses::contrast_octaves) << 23,
                                  least_luminance_bits = 127 << 23, least_distance_bits = (127 - 2) << 23;
    static constexpr std::int32_t distance_guess_count = 16 * 8;

    static std::int32_t row(std::int32_t luminance, std::int32_t contrast) {
        return 1 + luminance * contrast_count + contrast;
    } // as ContrastClasses::class_at() has it
    static std::int32_t bucket(std::int32_t bits, std::int32_t least_bits, unsigned shift, std::int32_t count) {
        return std::min(std::max(bits - least_bits, 0) >> shift, count - 1);
    }
    static float bucket_start(std::int32_t bucket, std::int32_t least_bits, unsigned shift) {
        return bucket == 0 ? 0 : std::bit_cast<float>(least_bits + (bucket << shift));
    }
    void fill_guesses();
    void find_classes(LitFindings& lit) const;
    void find_room(LitFindings& lit) const;
    void find_classes_avx2(LitFindings& lit) const;
    void find_room_avx2(LitFindings& lit) const;

    const VertexTree& tree_;
    const VertexCone* cones_;
    const float* radii_; // of the spheres around the vertices; null: the rings'
    std::span<const float> switch_distance_;
    std::int32_t bins_;
    std::int32_t silhouette_row_;
    float black_; // of the display, in its span
    // The largest of each class, and classes that are not above the first one of a bucket. The last class holds all
    // beyond, too.
    std::array<float, contrast_count> contrasts_;
    std::array<float, luminance_count> luminances_; // with the black; in the span
    std::array<std::int32_t, contrast_guess_count> contrast_guesses_;
    std::array<std::int32_t, luminance_guess_count> luminance_guesses_;
    std::vector<std::int32_t> distance_guesses_; // by luminance, bin and bucket: of the first contrast to unfold
    KernelLights lights_;
    float length_ = 1; // of the lights' clock, for a radian
};

} // namespace unseen::vdtree
