#include <unseen/vdtree/active_triangles.h>

#include <algorithm>
#include <cassert>

#include "cut/cut_state.h"
#include "tree/unchecked_links.h"

namespace unseen::vdtree {

namespace {

constexpr Index no_slot = ~Index{0}, no_triangle = ~Index{0};

// Taking up one change costs about as much as listing this many triangles anew, and copying what is listed.
constexpr std::size_t triangles_per_change = 20;

} // namespace

ActiveTriangles::ActiveTriangles(const VertexTree& tree) : tree_(tree.share()) {}

bool ActiveTriangles::update(const Cut& of) {
    assert(&of.tree().data() == &tree_.data());
    const CutState& cut = CutState::of(of);
    changed_slots_.clear();
    changed_runs_.clear();
    if (cut.revision() == revision_) return true;
    const bool follows =
        cut.changes_from() == revision_ && cut.changes().size() < cut.triangle_count() / triangles_per_change;
    revision_ = cut.revision();
    if (follows) take_up(cut);
    else list_all(cut);
    return follows;
}

// In the order of the tree, in which neighbours lie together.
void ActiveTriangles::list_all(const CutState& cut) {
    const auto& links = unchecked_links(tree_);
    if (slots_.empty()) slots_.assign(tree_.triangle_count(), no_slot);
    for (const Index triangle : triangles_) slots_[triangle] = no_slot;
    triangles_.clear();
    triangles_.reserve(cut.triangle_count());
    for_each_bit(cut.unfolded(), [&](NodeId node) {
        for (Index t = links.first_triangle[node]; t < links.first_triangle[node + 1]; ++t) {
            slots_[t] = static_cast<Index>(triangles_.size());
            triangles_.push_back(t);
        }
    });
    corners_.resize(triangles_.size());
    constexpr std::size_t ahead = 32; // triangles between a prefetch and its use
    for (std::size_t slot = 0; slot < triangles_.size(); ++slot) {
        if (slot + ahead < triangles_.size()) prefetch(&links.triangles[triangles_[slot + ahead]]);
        corners_[slot] = links.triangles[triangles_[slot]];
    }
    if (!tree_.has_seams()) {
        wedges_ = cut.proxies();
        return;
    }
    seam_wedges_.resize(tree_.leaf_count());
    for (Index leaf = 0; leaf < tree_.leaf_count(); ++leaf)
        seam_wedges_[leaf] = tree_.wedge_at(cut.proxies()[leaf], leaf);
    wedges_ = seam_wedges_;
}

// A node may have changed several times: what counts is how it is now.
void ActiveTriangles::take_up(const CutState& cut) {
    const auto& links = unchecked_links(tree_);
    coming_.clear();
    for (const auto [node, folded] : cut.changes())
        for (Index t = links.first_triangle[node]; t < links.first_triangle[node + 1]; ++t) {
            prefetch(&slots_[t]);
            if (!folded) prefetch(&links.triangles[t]);
        }
    for (const auto [node, folded] : cut.changes()) {
        const bool is_unfolded = cut.is_unfolded_interior(node);
        for (Index t = links.first_triangle[node]; t < links.first_triangle[node + 1]; ++t) {
            if ((slots_[t] != no_slot) == is_unfolded) continue;
            if (is_unfolded) {
                coming_.push_back(t);
                slots_[t] = 0; // so that it does not come twice
            } else {
                holes_.push_back(slots_[t]);
                slots_[t] = no_slot;
            }
        }
        if (!is_unfolded) {
            if (cut.is_active(node)) add_runs(cut, node);
        } else {
            tree_.for_each_child(node, [&](NodeId child) {
                if (cut.is_active(child)) add_runs(cut, child);
            });
        }
    }
    fill_holes();
    for (const LeafRun& run : changed_runs_)
        if (tree_.has_seams()) std::fill_n(seam_wedges_.begin() + run.first, run.count, run.wedge);
}

// With what comes, then with triangles from the end.
void ActiveTriangles::fill_holes() {
    const auto& links = unchecked_links(tree_);
    const auto put = [&](Index slot, Index triangle) {
        triangles_[slot] = triangle;
        slots_[triangle] = slot;
        changed_slots_.push_back(slot);
    };
    std::size_t end = triangles_.size() + coming_.size() - std::min(coming_.size(), holes_.size());
    triangles_.resize(end);
    corners_.resize(end);
    for (Index next = static_cast<Index>(end); const Index triangle : coming_) {
        if (holes_.empty()) put(--next, triangle);
        else put(holes_.back(), triangle), holes_.pop_back();
    }
    if (!holes_.empty()) {
        for (const Index hole : holes_) triangles_[hole] = no_triangle;
        for (const Index hole : holes_) {
            while (end > 0 && triangles_[end - 1] == no_triangle) --end;
            if (hole >= end) continue;
            put(hole, triangles_[--end]);
        }
        while (end > 0 && triangles_[end - 1] == no_triangle) --end;
        triangles_.resize(end);
        corners_.resize(end);
        holes_.clear();
        std::erase_if(changed_slots_, [&](Index slot) { return slot >= end; });
    }
    for (const Index slot : changed_slots_) corners_[slot] = links.triangles[triangles_[slot]];
}

// Of what stands for the leaves under an active node now.
void ActiveTriangles::add_runs(const CutState& cut, NodeId node) {
    const Index first = cut.first_leaf_of(node);
    const bool is_place = tree_.is_place(node);
    const Index count =
        is_place ? tree_.wedge_end(node) - tree_.first_wedge(node) : unchecked_links(tree_).leaf_end[node] - first;
    if (!tree_.has_seams() || tree_.wedge_end(node) - tree_.first_wedge(node) == 1) {
        changed_runs_.push_back({first, count, tree_.first_wedge(node)});
        return;
    }
    for (Index leaf = first; leaf < first + count; ++leaf) {
        const WedgeId wedge = tree_.wedge_at(node, leaf);
        if (leaf > first && changed_runs_.back().wedge == wedge) ++changed_runs_.back().count;
        else changed_runs_.push_back({leaf, 1, wedge});
    }
}

std::uint64_t ActiveTriangles::byte_size() const noexcept {
    return sizeof(Triangle) * corners_.capacity() +
           sizeof(Index) * (triangles_.capacity() + slots_.capacity() + changed_slots_.capacity() + holes_.capacity() +
                            coming_.capacity()) +
           sizeof(WedgeId) * seam_wedges_.capacity() + sizeof(LeafRun) * changed_runs_.capacity();
}

} // namespace unseen::vdtree
