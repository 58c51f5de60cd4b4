// Keeps a cut at what a distance criterion asks for while the viewpoint moves: what a frame does.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <vector>

#include <unseen/vdtree/cut.h>

#include "cut/cut_settler.h"
#include "cut/cut_state.h"
#include "cut/decide_tree.h"
#include "cut/kernel/fold_tester.h"

namespace unseen::vdtree {

// A view that stands still costs nothing. After a small step the clocks go on, and what is due is settled (CutSettler);
// within a budget, with the threshold moved until the triangles fit. After a jump, or under another criterion, the cut
// is decided anew from the root; what to watch from there on is left to the first frame that needs it, for there may be
// another jump.
class CutFollower {
public:
    explicit CutFollower(const VertexTree& tree) : tree_(tree), settler_(tree) {}

    // Brings the cut to what the criterion and the options ask for.
    AdjustStats follow(CutState& cut, const DistanceCriterion& criterion, const Viewpoint& viewpoint,
                       const FollowOptions& options);
    // The cut was changed by others.
    void forget() noexcept { is_tracking_ = false; }
    std::uint64_t byte_size() const noexcept;

private:
    // The request, and what is made of it.
    bool is_same_request(const DistanceCriterion& criterion, const FollowOptions& options) const;
    void prepare(const DistanceCriterion& criterion, const FollowOptions& options);
    void make_tester(const DistanceCriterion& criterion);
    CutSettler::Rules rules();
    float keeping_factor() const;
    // Where the eye is.
    Motion with_lights(Motion motion, const Viewpoint& viewpoint, bool is_same);
    void start_at(const Viewpoint& viewpoint);
    void move_to(const Viewpoint& viewpoint, const Motion& motion);
    void look_from(const Viewpoint& viewpoint);
    // By a threshold.
    void follow_threshold(CutState& cut, const Viewpoint& viewpoint, const Motion& motion);
    void step(CutState& cut, const Motion& motion);
    void settle_due(CutState& cut);
    void settle_in_time(CutState& cut);
    void start_over(CutState& cut);
    std::vector<std::uint64_t> decide_all();
    void start_in_time(CutState& cut);
    bool is_out_of_time() const;
    bool is_out_of_deciding_time() const;
    // By a budget.
    void follow_budget(CutState& cut, const Viewpoint& viewpoint, const Motion& motion);
    void keep_within_budget(CutState& cut);
    void change_threshold(CutState& cut, float factor);
    void start_with_budget(CutState& cut);
    std::vector<std::uint64_t> decide_with_budget();

    const VertexTree& tree_;
    CutSettler settler_;
    // The request.
    std::uint64_t criterion_ = 0; // id()
    std::uint64_t tested_ = 0;    // the criterion object that the tester refers to
    FollowOptions options_;
    std::optional<FoldTester> tester_;
    float threshold_ = 1;            // with hysteresis it follows the budget
    bool watches_ancestors_ = false; // the criterion is not monotone
    // The last call.
    bool is_tracking_ = false;
    bool was_complete_ = true;
    float max_fold_cost_ = 0;
    Viewpoint viewpoint_;
    double length_per_radian_ = 1; // what turns of the gaze count as on the position clock
    // This call.
    std::chrono::steady_clock::time_point begin_;
    std::optional<std::chrono::steady_clock::time_point> time_limit_;
    AdjustStats stats_;
    TreeDecider decider_; // scratch
};

} // namespace unseen::vdtree
