// The arithmetic of fold tests, many nodes at once: where their spheres are, seen from the eye, how far the eye is from where their rings
// would face it otherwise, and what follows from both; and of what tells when to test again.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include <vdtree/distance_criterion.h>
#include <vdtree/normal_mask.h>
#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

inline constexpr std::size_t kernel_lanes = 16;
inline constexpr float least_length = 1e-30f; // mesh units; stands for 0 where a division or an infinite reach would make no number of it

// What all nodes are measured from, and by.
struct KernelView {
    float eye_high[3], eye_low[3]; // the eye in two floats each: differences to it stay good near and far
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

    std::span<const float> reach; // [row * bins + bin], in lengths; infinite: from everywhere; minus infinity: from nowhere
    std::int32_t bins = 1;
    float bins_per_radian = 0;
    float inverse_threshold = 1;
    float turn_per_length = 0;    // radians that the gaze may turn while the position clock advances by 1

    // Whose facing has to be found out: nodes within their silhouette's distance but not the interior's, and ...
    bool near_ones_too = false;   // ... nodes within the interior's, too, or
    bool everybody = false;       // ... all, or
    bool nobody = false;          // ... none

    bool is_inside_out = false;   // the surface: the side that is seen is the one that its normals point away from
};

// What tests read, by interior node; null where a criterion has none of it.
struct NodeArrays {
    const NodeBounds* bounds = nullptr;
    const Sphere* support = nullptr;      // whose distance counts; null: the ring's
    const FoldClass* classes = nullptr;
    const NormalSlabs* facing = nullptr;  // null: those of the bounds
    const float *lengths = nullptr, *silhouette_lengths = nullptr; // null: the radii, and the lengths
};

// Only whether nodes unfold, bit for bit as the tests with slacks below find it: one bit a node, the first node's lowest, of as many
// whole words as that takes. Cost: some nanoseconds a node where these are neighbours, and memory's latency overlaps where not.
void decide(const KernelView& view, const NodeArrays& arrays, std::span<const NodeId> nodes, std::uint64_t* unfolded) noexcept;
void decide_range(const KernelView& view, const NodeArrays& arrays, NodeId first, std::size_t count, std::uint64_t* unfolded) noexcept;

// What the costs of folds are looked up in: a criterion's own tables, [row * bins + bin]; the second one may be null.
struct CostTables {
    const float *reach = nullptr, *least_cost = nullptr;
};
// The thresholds at which nodes would just fold, without and with their least costs, and whether they unfold at the view's. `view` must
// ask for the facing of everybody.
struct NodeCosts {
    float *cost, *seen_cost;  // by place in `nodes`
    std::uint64_t* unfolded;  // like decide()'s
};
void find_costs(const KernelView& view, const NodeArrays& arrays, const CostTables& tables, std::span<const NodeId> nodes,
                const NodeCosts& costs) noexcept;
// At least what both costs of a node are, whatever it faces, or, where it would cost more than `no_outline_over` as an outline, as none.
void find_cost_bounds(const KernelView& view, const NodeArrays& arrays, const CostTables& tables, std::span<const NodeId> nodes,
                      float no_outline_over, float* cost, float* seen_cost) noexcept;

// What a test reads of a node, in one cache line.
struct alignas(64) FoldCandidate {
    Sphere sphere;           // whose distance counts
    float length = 0, silhouette_length = 0;
    FoldClass rows;
    Sphere ring;             // whose facing counts
    NormalSlabs slabs;       // of the directions in the ring
    std::uint8_t flags = 0;  // NodeFlags
    bool is_unfolded : 1 = false; // for the one who keeps it; tests do not ask
    bool is_waiting : 1 = false;  // likewise: to be unfolded
    NodeId node = no_node;
};
static_assert(sizeof(FoldCandidate) == 64);

// Verdicts on up to sixteen candidates, with their slacks (see Verdict in fold_tester.h); a bit a lane.
struct TestBatch {
    alignas(64) float position_slack[kernel_lanes], facing_slack[kernel_lanes];
    alignas(64) float plane_slack[kernel_lanes]; // without planes: huge
    alignas(64) float light_slack[kernel_lanes]; // where there are lights
    std::uint32_t unfolded = 0;
};
// Without lights.
void test(const KernelView& view, std::span<const FoldCandidate* const> lanes, TestBatch& tested) noexcept;

// The same in stages, for those that do something in between.
//
// Sixteen nodes.
struct FoldBatch {
    alignas(64) float centre[3][kernel_lanes];
    alignas(64) float radius[kernel_lanes];
    alignas(64) float length[kernel_lanes], silhouette_length[kernel_lanes];
    alignas(64) std::int32_t interior_row[kernel_lanes], silhouette_row[kernel_lanes];

    // Out, by measure():
    alignas(64) float to_eye[3][kernel_lanes]; // from the centre
    alignas(64) float distance[kernel_lanes];  // of the centre
    alignas(64) float gap[kernel_lanes];       // of the sphere: distance - radius
    alignas(64) float eccentricity[kernel_lanes]; // radians, of the sphere's nearest point; 0 from inside, and without gaze
    alignas(64) std::int32_t bin[kernel_lanes];
    alignas(64) float height[kernel_lanes];    // of the sphere's top over the lowest plane of the best frustum
    alignas(64) float uncovered[kernel_lanes]; // how far it stands out from behind the best occluder; negative, like heights:
                                               // out of sight
    alignas(64) float interior[kernel_lanes], silhouette[kernel_lanes]; // the distances within which the node unfolds
    // A bit a lane: in sight; within the interior's distance; facing has to be found out.
    std::uint32_t is_inside = 0, is_near = 0, is_asked = 0;
};
void measure(const KernelView& view, FoldBatch& batch) noexcept;

// How far the position clock may advance with nodes still within, or beyond, the larger distance of two rows.
struct SlackBatch {
    alignas(64) std::int32_t row[kernel_lanes], silhouette_row[kernel_lanes];
    alignas(64) std::int32_t bin[kernel_lanes];
    alignas(64) float inward[kernel_lanes]; // 1: the node is within the distance, -1: beyond
    alignas(64) float gap[kernel_lanes], eccentricity[kernel_lanes], length[kernel_lanes], silhouette_length[kernel_lanes];
    alignas(64) float slack[kernel_lanes];  // out; may be a little negative
};
void find_slacks(const KernelView& view, SlackBatch& batch) noexcept;

// What is known of the lanes of a batch when all is found out; a bit a lane.
struct Findings {
    std::uint32_t unfolded = 0, silhouettes = 0;
    std::uint32_t away = 0;                         // facing away; folded whatever the distance
    alignas(64) float facing_slack[kernel_lanes];   // by facing alone
    alignas(64) float position_slack[kernel_lanes]; // with a gaze, from find_slacks(); else out
    alignas(64) float plane_slack[kernel_lanes];    // out
};
// Slacks are shortened so that rounding in a later test cannot change a verdict before its time: by less than this share of the
// distance and the radius.
inline constexpr float test_rounding = 2e-5f;
// Brings the slacks of all lanes to what they are in all, 0 or more.
void finish_slacks(const KernelView& view, const FoldBatch& batch, Findings& findings) noexcept;

// Sixteen rings: their slabs, the vectors from the centres of their spheres to the eye, and the spheres' radii.
struct FacingBatch {
    alignas(64) std::int8_t slabs[kernel_lanes][16]; // by lane: lo of the seven axes, then hi; the last two are not used
    alignas(64) float to_eye[3][kernel_lanes];
    alignas(64) float radius[kernel_lanes];

    void set(std::size_t lane, const NormalSlabs& of, float x, float y, float z, float r) noexcept {
        static_assert(sizeof(NormalSlabs) == 14);
        std::memcpy(slabs[lane], &of, sizeof of);
        to_eye[0][lane] = x, to_eye[1][lane] = y, to_eye[2][lane] = z;
        radius[lane] = r;
    }
};

// By how much (mesh units) the eye could move, in any direction, while everything in the slabs still faces it (front), or
// still faces away (back), from every point of the sphere. Not positive: not everything does; then it is minus the path after
// which everything might.
//
// Conservative: a positive gap is a proof. The slabs are relaxed to parallelepipeds P, any one of which may prove it:
// min over x in P of x . (eye - centre) > radius * reach, where `reach` bounds the length of every vector in P. A node without a proof has no
// ancestor with one: an ancestor's P contains the node's, so its reach is no less, and moving the centre by the difference of the radii
// changes x . (eye - centre) by at most reach times that.
struct FacingGaps {
    alignas(64) float front[kernel_lanes];
    alignas(64) float back[kernel_lanes];
};
void facing_gaps(const FacingBatch& batch, FacingGaps& gaps) noexcept;

// Spheres around the centres of some nodes each, and what the eye's way has made of them.
struct BlockSpheres {
    std::vector<float> x, y, z, radius;
    std::vector<float> distance; // of the sphere's centre from the eye
    std::vector<float> error;    // how much more than `distance` a node's distance may have changed, in all

    void push_back() {
        for (auto* values : {&x, &y, &z, &radius, &distance, &error}) values->push_back(0);
    }
    void clear() noexcept {
        for (auto* values : {&x, &y, &z, &radius, &distance, &error}) values->clear();
    }
    void reserve(std::size_t blocks) {
        for (auto* values : {&x, &y, &z, &radius, &distance, &error}) values->reserve(blocks);
    }
    void set(std::size_t block, const glm::vec3& centre, float r, float d) noexcept {
        x[block] = centre.x, y[block] = centre.y, z[block] = centre.z;
        radius[block] = r, distance[block] = d, error[block] = 0;
    }
    glm::vec3 centre(std::size_t block) const noexcept { return {x[block], y[block], z[block]}; }
    std::uint64_t byte_size() const noexcept { return 6 * sizeof(float) * x.capacity(); }
};
// The eye goes by `path` to a new place.
void move_blocks(const float (&eye_high)[3], const float (&eye_low)[3], float path, BlockSpheres& spheres) noexcept;

inline float rounded_down(double clock) { return clock > 0 ? std::nextafter(static_cast<float>(clock), 0.0f) : 0.0f; }
inline float rounded_up(double clock) {
    return std::nextafter(static_cast<float>(clock), std::numeric_limits<float>::infinity());
}
// A clock in floats: not later than it is, and not earlier.
struct KernelClock {
    float early = 0, late = std::numeric_limits<float>::min();
};
inline KernelClock kernel_clock(double now) { return {rounded_down(now), rounded_up(now)}; }
// Defers deadlines by planes, one a block, that have come although the block is wholly inside a frustum: to when the centre
// of one of its nodes may be less than `hair` inside. `hair`: more than the rounding of any node's test, and of this.
void keep_inside(const KernelView& view, float hair, const KernelClock& clock, const BlockSpheres& spheres,
                 float* deadlines) noexcept;

// When distances that grow, or shrink, and the facing clock may change something.
struct BlockDeadlines {
    std::vector<float> recede, approach, facing;

    void push_back(float value) {
        for (auto* values : {&recede, &approach, &facing}) values->push_back(value);
    }
    void clear() noexcept {
        for (auto* values : {&recede, &approach, &facing}) values->clear();
    }
    void reserve(std::size_t blocks) {
        for (auto* values : {&recede, &approach, &facing}) values->reserve(blocks);
    }
    void set(std::size_t block, float receding, float approaching, float turning) noexcept {
        recede[block] = receding, approach[block] = approaching, facing[block] = turning;
    }
    std::uint64_t byte_size() const noexcept { return 3 * sizeof(float) * recede.capacity(); }
};
// The deadlines of a block's slots; of slots that are not used: infinite.
inline constexpr std::size_t block_slots = 16;
struct alignas(64) BlockDues {
    float position[block_slots];
    float facing[block_slots];
};
// Looks at the slots of some blocks: tells those that are due, in order, and sets the blocks' deadlines to the earliest of the others.
// `due` has room for block_slots a block. Returns how many are due.
std::size_t look_at_blocks(std::span<const std::uint32_t> which, float position_clock, float facing_clock, const BlockDues* dues,
                           const std::uint16_t* unfolded, const BlockSpheres& spheres, BlockDeadlines& deadlines, std::uint32_t* due) noexcept;

// The deadlines of up to sixteen slots that were tested.
struct DueBatch {
    // Of their blocks, now: what their distances have changed by beyond the sphere's, and that one's distance.
    alignas(64) float passed[kernel_lanes], distance[kernel_lanes];
    float facing_clock;  // or a little less
    float longest;       // no slack of distances is longer
    float hair;          // slacks of unfolded nodes are shortened by this
    alignas(64) float position[kernel_lanes], facing[kernel_lanes]; // out
};
// Of what a deadline for distances is summed from: a dozen roundings of floats, when it is set and when it is compared.
inline constexpr float sum_rounding = 4e-6f;
inline constexpr float just_less = 1 - std::numeric_limits<float>::epsilon(); // times a number: at least a unit in the last place less
void find_dues(const TestBatch& tested, DueBatch& dues) noexcept;

// One bit a block: a deadline has come.
void find_due(float position_clock, float facing_clock, const BlockSpheres& spheres, const BlockDeadlines& deadlines,
              std::uint64_t* due) noexcept;

} // namespace unseen::vdtree
