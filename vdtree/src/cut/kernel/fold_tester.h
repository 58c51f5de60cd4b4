// Tests nodes against a distance criterion from one viewpoint: whether they unfold, and how far the eye may move before
// that can change.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/vertex_tree.h>

#include "cut/budget.h"
#include "cut/kernel/deadline_kernel.h"
#include "cut/kernel/fold_kernel.h"
#include "cut/kernel/lit_tester.h"

namespace unseen::vdtree {

// How much a move from one viewpoint to another advances the clocks.
struct Motion {
    double position = 0; // bounds the change of every node's distance; rotations of the gaze count as lengths
    double facing = 0;   // the path of the eye
    double planes = 0;   // bounds the change of the height of any node's centre over any plane of the frusta
    double light = 0;    // of the lights, in lengths; see light_weight
};

// The same, for angles between a gaze and what the tree holds.
GazeMotion gaze_motion(const VertexTree& tree, const Viewpoint& from, const Viewpoint& to);

class FoldTester final : public CostSource {
public:
    // Nodes unfold where their seen cost exceeds `threshold`; without `least_costs`, where their cost does. Cost: a
    // copy of the criterion's table.
    FoldTester(const VertexTree& tree, const DistanceCriterion& criterion, bool cull_back_faces, float threshold,
               bool least_costs = true);

    const DistanceCriterion& criterion() const noexcept { return criterion_; }
    // Only without least costs.
    void set_threshold(float threshold) noexcept {
        view_.inverse_threshold = costs_view_.inverse_threshold = 1 / threshold;
    }

    // `length_per_radian` is what turns of lights count as on their clock, and about what turns of the gaze are worth; any
    // positive value will do, and it must be the same for verdicts and motions.
    void look_from(const Viewpoint& viewpoint, double length_per_radian);

    // From the current viewpoint.
    const KernelView& view() const noexcept { return view_; }
    bool uses_gaze() const noexcept { return view_.has_gaze; }
    bool has_planes() const noexcept { return !view_.planes.empty(); }

    FoldCandidate candidate(NodeId node) const;
    // Where lights stand still, rows are found once for a candidate, and tests are those without lights. Else it does
    // nothing, for each test finds them anew.
    void find_still_rows(std::span<FoldCandidate> candidates) const;
    void prefetch(NodeId node) const; // what candidate(node) will read

    // Tests those of the candidates that `which` names from place `first` on, up to sixteen, and fetches some after
    // them ahead.
    void test(std::span<const FoldCandidate> candidates, std::span<const std::uint32_t> which, std::size_t first,
              TestBatch& tested) const;
    // One verdict for each candidate. Cost: some ten nanoseconds each.
    void test(std::span<const FoldCandidate> candidates, std::span<Verdict> verdicts) const;
    // Only whether they unfold, one bit each; the same verdicts.
    void decide(std::span<const NodeId> nodes, std::uint64_t* unfolded) const;
    void decide_range(NodeId first, std::size_t count, std::uint64_t* unfolded) const;
    void decide_at(float threshold, std::span<const NodeId> nodes, std::uint64_t* unfolded) const override;
    // The thresholds at which nodes would just fold, without and with their least costs (see NodeCosts), and whether
    // they unfold. What nodes face is always found out, also where the verdict does not depend on it.
    void find_costs(std::span<const NodeId> nodes, const NodeCosts& costs) const override;
    // Bounds: without a look at what faces the eye, at a third of the price. Not with lights.
    bool has_bounds() const noexcept override { return !lit_; }
    void find_cost_bounds(std::span<const NodeId> nodes, const float* folded_at, float* cost,
                          float* seen_cost) const override;
    // Whether verdicts are to say how far the lights may move, as by default, or hold for these lights alone. Candidates
    // from before do not count from then on.
    void let_lights_move(bool do_move) noexcept { do_lights_move_ = do_move; }
    bool has_moving_lights() const noexcept { return lit_ && do_lights_move_; }
    bool is_monotone() const noexcept override { return criterion_.is_monotone(); }
    // But for the lights: from one viewpoint to another with as many frusta of as many planes; infinite where these
    // differ.
    static Motion motion(const VertexTree& tree, const Viewpoint& from, const Viewpoint& to, double length_per_radian);

private:
    using Lanes = std::span<const FoldCandidate* const>; // of one batch, at most sixteen

    template <class F>
    void for_each_batch(const KernelView& view, std::span<const NodeId> nodes, F&& f) const;
    void test(Lanes lanes, TestBatch& tested) const;
    void find_lit_verdicts(const KernelView& view, Lanes lanes, LitFindings& lit, FoldBatch& batch) const;
    void find_lit_rows(Lanes lanes, LitFindings& lit) const;
    FoldClass lit_rows(const LitFindings& lit, std::size_t lane) const;
    void leave_room_for_lights(LitFindings& lit, FoldBatch& batch) const;
    CostTables cost_tables() const;

    const DistanceCriterion criterion_;
    NodeArrays arrays_; // of the tree and the criterion
    // The criterion's; infinite if the fold is visible from everywhere.
    std::vector<float> switch_distance_;
    KernelView view_, costs_view_;
    std::optional<LitTester> lit_; // where lights give the classes
    bool do_lights_move_ = true;
};

} // namespace unseen::vdtree
