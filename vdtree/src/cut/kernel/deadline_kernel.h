// The arithmetic of deadlines, many watched slots or blocks of them at once; for CutFront, which keeps them.
//
// A verdict holds while the eye's motion uses up its slack. A deadline is what a clock of that motion may run to
// meanwhile. The *position clock* bounds the change of every node's distance, the *facing clock* is the path of the
// eye. Blocks of sixteen slots have a sphere, whose distance is measured anew in every frame: that tells far better
// what the motion did to the distances of its nodes.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "cut/kernel/fold_kernel.h"

namespace unseen::vdtree {

inline constexpr std::size_t block_slots = 16;
inline constexpr float never_due = std::numeric_limits<float>::infinity();

// Arrays by block are filled up to whole registers with blocks that are never due.
inline constexpr std::size_t whole_registers(std::size_t blocks) { return (blocks + 7) / 8 * 8; }

// By block: a sphere around the centres of its nodes, what the eye's way has made of it, and its earliest deadlines.
struct BlockArrays {
    std::vector<float> x, y, z, radius;
    std::vector<float> distance; // of the sphere's centre from the eye
    std::vector<float> error;    // how much more than `distance` a node's distance may have changed, in all
    std::vector<float> recede, approach, facing; // for distances that grow, or shrink; and for the facing clock

    template <class F>
    void for_each(F&& f) {
        for (auto* values : {&x, &y, &z, &radius, &distance, &error}) f(*values, 0.0f);
        for (auto* values : {&recede, &approach, &facing}) f(*values, never_due);
    }
    void set_sphere(std::size_t block, const glm::vec3& centre, float r, float d) noexcept {
        x[block] = centre.x, y[block] = centre.y, z[block] = centre.z;
        radius[block] = r, distance[block] = d, error[block] = 0;
    }
    void set_earliest(std::size_t block, float receding, float approaching, float turning) noexcept {
        recede[block] = receding, approach[block] = approaching, facing[block] = turning;
    }
    glm::vec3 centre(std::size_t block) const noexcept { return {x[block], y[block], z[block]}; }
    std::uint64_t byte_size() const noexcept { return 9 * sizeof(float) * x.capacity(); }
};

// By block: the angle between the gaze and its sphere's centre, how much more than that may have changed for a node, and its
// earliest deadlines, for angles that grow, or shrink. Radians.
struct GazeArrays {
    std::vector<float> angle, error, outward, inward;

    template <class F>
    void for_each(F&& f) {
        f(angle, 0.0f), f(error, 0.0f), f(outward, never_due), f(inward, never_due);
    }
};
// How the eye and the gaze move, with a turn of the world after which the gaze is what it was before.
struct GazeMotion {
    float from_high[3], from_low[3], to_high[3], to_low[3]; // the eye; see KernelView
    float gaze[3];                                          // after it; unit
    float turn[3][3];                                       // rows
    float turned = 0;                                       // by this angle
};

// The deadlines of a block's slots; of slots that are not used: infinite.
struct alignas(64) SlotDeadlines {
    float position[block_slots];
    float facing[block_slots];
};

// A clock in floats: not later than it is, and not earlier.
struct KernelClock {
    float early = 0, late = std::numeric_limits<float>::min();
};
inline float rounded_up(double clock) { return std::nextafter(static_cast<float>(clock), never_due); }
inline KernelClock kernel_clock(double now) {
    return {now > 0 ? std::nextafter(static_cast<float>(now), 0.0f) : 0.0f, rounded_up(now)};
}

// The deadlines of up to sixteen slots that were tested.
struct DeadlineBatch {
    // For each slot's block, now: the change of distance beyond that of the block's sphere, and the sphere's distance.
    alignas(64) float passed[kernel_lanes], distance[kernel_lanes];
    float facing_clock; // or a little less
    float longest;      // no slack of distances is longer
    float margin;       // for rounding: slacks of unfolded nodes are shortened by this
    alignas(64) float position[kernel_lanes], facing[kernel_lanes]; // out
};
// Rounding of a deadline for distances, as a share of its terms: a dozen roundings of floats when it is set and compared.
inline constexpr float sum_rounding = 4e-6f;
// Times a number: at least a unit in the last place less.
inline constexpr float just_less = 1 - std::numeric_limits<float>::epsilon();

struct DeadlineKernel {
    // The eye goes by `path` to a new place.
    void (*move_blocks)(const float (&eye_high)[3], const float (&eye_low)[3], float path,
                        BlockArrays& blocks) noexcept;
    // The eye and the gaze move. One bit a block: a deadline has come. Returns the largest error.
    float (*turn_blocks)(const GazeMotion& motion, const BlockArrays& spheres, GazeArrays& blocks,
                         std::uint64_t* due) noexcept;
    // Defers deadlines by planes, one a block, that have come although the block is wholly inside a frustum: to when the
    // centre of one of its nodes may be less than `margin` inside: more than the rounding of any node's test, and of this.
    void (*keep_inside)(const KernelView& view, float margin, const KernelClock& clock, const BlockArrays& blocks,
                        float* deadlines) noexcept;
    // Looks at the slots of some blocks: tells those that are due, in order, and sets the blocks' deadlines to the
    // earliest of the others. `due` has room for block_slots a block. Returns how many are due.
    std::size_t (*look_at_blocks)(std::span<const std::uint32_t> which, float position_clock, float facing_clock,
                                  const SlotDeadlines* dues, const std::uint16_t* unfolded, BlockArrays& blocks,
                                  std::uint32_t* due) noexcept;
    void (*find_deadlines)(const TestBatch& tested, DeadlineBatch& dues) noexcept;
    // Makes those of a block's slots that are due by other clocks due at once by the facing clock, and no more by those.
    // Unfolded slots (a bit each) and folded ones have a clock each. Finds the earliest of what is left of either kind.
    // Returns whether any was due.
    bool (*hand_over)(float clock_of_unfolded, float clock_of_folded, std::uint32_t unfolded, float* deadlines,
                      float* facing, float& earliest_unfolded, float& earliest_folded) noexcept;
    // One bit a block: a deadline has come.
    void (*find_due_blocks)(float position_clock, float facing_clock, const BlockArrays& blocks,
                            std::uint64_t* due) noexcept;
};
extern const DeadlineKernel deadline_kernel;

} // namespace unseen::vdtree
