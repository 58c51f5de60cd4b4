// Nodes that are to unfold, but for which there has been no time.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

// The worst first: by cost, ties by node number. Whether a node still waits, its mark in the cut's front says
// (FoldCandidate::is_waiting); entries without it are left over, and are dropped when they come to the top.
class WaitingNodes {
public:
    struct Entry {
        float cost;
        NodeId node;
        bool operator<(const Entry& other) const { return cost != other.cost ? cost < other.cost : node > other.node; }
    };

    bool empty() const noexcept { return heap_.empty(); }
    std::size_t size() const noexcept { return heap_.size(); }
    const Entry& worst() const noexcept { return heap_.front(); }
    void clear() noexcept { heap_.clear(); }
    void push(float cost, NodeId node) {
        heap_.push_back({cost, node});
        std::push_heap(heap_.begin(), heap_.end());
    }
    NodeId pop() {
        std::pop_heap(heap_.begin(), heap_.end());
        const NodeId node = heap_.back().node;
        heap_.pop_back();
        return node;
    }
    template <class StillWaits>
    void drop_idle(StillWaits&& still_waits) {
        std::erase_if(heap_, [&](const Entry& entry) { return !still_waits(entry.node); });
        std::make_heap(heap_.begin(), heap_.end());
    }
    auto begin() const noexcept { return heap_.begin(); } // in no order
    auto end() const noexcept { return heap_.end(); }
    std::uint64_t byte_size() const noexcept { return sizeof(Entry) * heap_.capacity(); }

private:
    std::vector<Entry> heap_;
};

} // namespace unseen::vdtree
