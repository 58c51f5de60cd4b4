// The arithmetic of fold tests, in registers of four or eight nodes, with the same bits on every processor: measure.h
// (distances, angles, heights), facing.h (what rings face), decide.h (verdicts), slacks.h (for how long they hold) and
// costs.h. FoldTester is the way to it for everybody else.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <unseen/vdtree/criteria.h>

namespace unseen::vdtree {

inline constexpr std::size_t kernel_lanes = 16;
// Mesh units; replaces 0 where a division or an infinite switch distance would give NaN.
inline constexpr float least_length = 1e-30f;
// Mesh units: an outline of this length, beyond every eye times any switch distance, marks what keeping() keeps: frusta and
// occluders do not fold it.
inline constexpr float kept_length = 1e30f;

// What all nodes are measured from, and by.
struct KernelView {
    float eye_high[3], eye_low[3]; // the eye in two floats each: differences to it stay good near and far
    float spread = 0;              // eyes may lie so far from there: spheres count as so much larger
    float reach = 0;               // the longest; see DistanceCriterion::Reach
    float gaze[3];                 // unit
    bool has_gaze = false;
    // Planes of the frusta, relative to the eye: normal . (p - eye) + offset; those of frustum f are
    // [first_plane[f], first_plane[f + 1]).
    struct Plane {
        float normal[3], offset;
    };
    std::vector<Plane> planes;
    std::vector<std::size_t> first_plane;
    // Spheres that hide what is behind them, relative to the eye, which is outside of all.
    struct Occluder {
        float towards[3], radius;
    };
    std::vector<Occluder> occluders;

    // [row * bins + bin], in lengths; infinite: from everywhere; minus infinity: from nowhere.
    std::span<const float> switch_distance;
    std::int32_t bins = 1;
    float bins_per_radian = 0;
    float inverse_threshold = 1;
    float length_per_turn =
        1; // by which slacks of eccentricity compare with those of distance, for a choice among them

    // Whose facing has to be found out: nodes within their silhouette's distance but not the interior's, and ...
    bool near_ones_too = false; // ... nodes within the interior's, too, or
    bool everybody = false;     // ... all, or
    bool nobody = false;        // ... none

    bool is_inside_out = false; // the surface: the side that is seen is the one that its normals point away from
};

// What tests read, by interior node; null where a criterion has none of it.
struct NodeArrays {
    const NodeBounds* bounds = nullptr;
    const Sphere* support = nullptr; // whose distance counts; null: the ring's
    const FoldClass* classes = nullptr;
    const NormalSlabs* facing = nullptr;                           // null: those of the bounds
    const float *lengths = nullptr, *silhouette_lengths = nullptr; // null: the radii, and the lengths
    const std::uint8_t* reach = nullptr;                           // octaves; null: nowhere
};

// What the costs of folds are looked up in: a criterion's own tables, [row * bins + bin]; the second one may be null.
struct CostTables {
    const float *switch_distance = nullptr, *least_cost = nullptr;
};
// The thresholds at which nodes would just fold, without and with their least costs, and whether they unfold at the
// view's.
struct NodeCosts {
    float *cost, *seen_cost; // by place in a list of nodes
    std::uint64_t* unfolded; // a bit a node
};

// What a test reads of a node, in one cache line.
struct alignas(64) FoldCandidate {
    Sphere sphere; // whose distance counts
    float length = 0, silhouette_length = 0;
    FoldClass rows;
    Sphere ring;                  // whose facing counts
    NormalSlabs slabs;            // of the directions in the ring
    std::uint8_t flags = 0;       // NodeFlags; above these two bits, the reach's octaves
    bool is_unfolded : 1 = false; // for the one who keeps it; tests do not ask
    bool is_waiting : 1 = false;  // likewise: to be unfolded
    NodeId node = no_node;
};
static_assert(sizeof(FoldCandidate) == 64);

// What a test found. It holds while each clock (see Motion in fold_tester.h) has advanced by less than its slack: mesh
// units, 0 or more.
struct Verdict {
    float position_slack = 0;
    float gaze_slack = 0; // radians of eccentricity; negative: none is known; without a gaze: huge
    float facing_slack = 0;
    float plane_slack = 0; // without planes: huge
    float light_slack = 0; // without lights that move: huge
    bool unfolded = false;
};

// Verdicts on up to sixteen candidates.
struct TestBatch {
    alignas(64) float position_slack[kernel_lanes], gaze_slack[kernel_lanes], facing_slack[kernel_lanes];
    alignas(64) float plane_slack[kernel_lanes], light_slack[kernel_lanes];
    std::uint32_t unfolded = 0; // a bit a lane

    Verdict operator[](std::size_t lane) const noexcept {
        return {position_slack[lane], gaze_slack[lane],  facing_slack[lane],
                plane_slack[lane],    light_slack[lane], ((unfolded >> lane) & 1) != 0};
    }
};
// Up to sixteen nodes, and what their verdicts are made of; see Measures and Verdicts in measure.h and decide.h.
struct FoldBatch {
    alignas(64) float radius[kernel_lanes], length[kernel_lanes], silhouette_length[kernel_lanes];
    alignas(64) std::int32_t interior_row[kernel_lanes], silhouette_row[kernel_lanes];
    alignas(64) float distance[kernel_lanes], gap[kernel_lanes], angle[kernel_lanes], eccentricity[kernel_lanes];
    alignas(64) std::int32_t bin[kernel_lanes];
    alignas(64) float interior[kernel_lanes], silhouette[kernel_lanes], height[kernel_lanes], uncovered[kernel_lanes];
    alignas(64) float facing_slack[kernel_lanes]; // without the other slacks' share in it
    // A bit a lane.
    std::uint32_t is_inside = 0, is_near = 0, unfolded = 0, is_silhouette = 0, by_silhouette = 0, is_away = 0;
};

// The functions of the kernel, for the widest registers there are.
struct FoldKernel {
    void (*test)(const KernelView& view, std::span<const FoldCandidate* const> lanes, TestBatch& tested) noexcept;
    // The same in steps, for lights, which do something in between: verdicts, then slacks, or sixteen costs each.
    void (*find_verdicts)(const KernelView& view, std::span<const FoldCandidate* const> lanes,
                          FoldBatch& batch) noexcept;
    void (*find_slacks)(const KernelView& view, const FoldBatch& batch, TestBatch& tested) noexcept;
    void (*find_batch_costs)(const KernelView& view, const CostTables& tables, const FoldBatch& batch, float* cost,
                             float* seen_cost) noexcept;
    // Only whether nodes unfold, as the tests with slacks find it: one bit a node in whole words, the first node's lowest.
    // Cost: some nanoseconds a node where these are neighbours, and memory's latency overlaps where not.
    void (*decide)(const KernelView& view, const NodeArrays& arrays, std::span<const NodeId> nodes,
                   std::uint64_t* unfolded) noexcept;
    void (*decide_range)(const KernelView& view, const NodeArrays& arrays, NodeId first, std::size_t count,
                         std::uint64_t* unfolded) noexcept;
    // Here and in find_batch_costs(), `view` must ask for the facing of everybody.
    void (*find_costs)(const KernelView& view, const NodeArrays& arrays, const CostTables& tables,
                       std::span<const NodeId> nodes, const NodeCosts& costs) noexcept;
    // At least what both costs of a node are, whatever it faces, or, where it would cost more than `no_silhouette_over`
    // as a silhouette, as none.
    void (*find_cost_bounds)(const KernelView& view, const NodeArrays& arrays, const CostTables& tables,
                             std::span<const NodeId> nodes, float no_silhouette_over, float* cost,
                             float* seen_cost) noexcept;
};
extern const FoldKernel fold_kernel;

// Slacks are shortened so that rounding in a later test cannot change a verdict before its time: by less than this
// share of the distance and the radius.
inline constexpr float test_rounding = 2e-5f;
// Radians, the same for eccentricities: a dozen roundings of two angles.
inline constexpr float gaze_rounding = 1e-5f;

} // namespace unseen::vdtree
