// Octree clustering: the vertices' cells in a tree of cubes, without the cubes that do not split anything.
#include <vdtree/builder.h>

#include <algorithm>
#include <array>
#include <numeric>

#include <glm/common.hpp>

namespace unseen::vdtree {

namespace {

class Octree {
public:
    Octree(const ClusterInput& input, const Progress& progress)
        : positions_(input.mesh.positions), progress_(progress), order_(positions_.size()), scratch_(positions_.size()) {
        std::iota(order_.begin(), order_.end(), Index{0});
    }

    Result<Clustering> build() {
        const Index n = static_cast<Index>(order_.size());
        result_.parents.resize(n);
        glm::dvec3 low = positions_[0], high = low;
        for (const glm::dvec3& p : positions_) {
            low = glm::min(low, p);
            high = glm::max(high, p);
        }
        const glm::dvec3 size = high - low;
        const double half = std::max({size.x, size.y, size.z}) / 2;
        const Index root = cluster(0, n, (low + high) * 0.5, half);
        if (cancelled_) return Error{ErrorCode::cancelled, "Building the octree was cancelled."};
        result_.parents[root] = root;
        return std::move(result_);
    }

private:
    // Splits order_[begin, end) by the octants around `centre`; returns the cluster that holds them all. Recursion ends
    // where all points coincide; its depth is bounded by the bits of a double, for the half-width is halved each time.
    Index cluster(Index begin, Index end, glm::dvec3 centre, double half) {
        if (end - begin == 1) return order_[begin];
        if (coincident(begin, end)) return join(std::span(order_).subspan(begin, end - begin));
        std::array<Index, 9> bounds;
        for (;;) {
            bounds = partition(begin, end, centre);
            int occupied = 0, last = 0;
            for (int o = 0; o < 8; ++o) {
                if (bounds[static_cast<std::size_t>(o) + 1] > bounds[static_cast<std::size_t>(o)]) {
                    ++occupied;
                    last = o;
                }
            }
            if (occupied > 1) break;
            const double quarter = half / 2;
            const glm::dvec3 inner = child_centre(centre, quarter, last);
            // The cube has become too small to move its centre: split the points by their own middle from here on.
            if (inner == centre) return split_by_middle(begin, end);
            centre = inner;
            half = quarter;
        }
        std::array<Index, 8> children;
        std::size_t count = 0;
        for (std::size_t o = 0; o < 8; ++o) {
            if (bounds[o + 1] == bounds[o]) continue;
            children[count++] = cluster(bounds[o], bounds[o + 1], child_centre(centre, half / 2, static_cast<int>(o)),
                                        half / 2);
        }
        report(end - begin);
        return join(std::span(children).first(count));
    }

    Index split_by_middle(Index begin, Index end) {
        const auto lexicographic = [&](Index a, Index b) {
            const glm::dvec3 &p = positions_[a], &q = positions_[b];
            if (p.x != q.x) return p.x < q.x;
            if (p.y != q.y) return p.y < q.y;
            return p.z != q.z ? p.z < q.z : a < b;
        };
        std::sort(order_.begin() + begin, order_.begin() + end, lexicographic);
        std::vector<Index> groups;
        for (Index i = begin; i < end;) {
            Index j = i + 1;
            while (j < end && positions_[order_[j]] == positions_[order_[i]]) ++j;
            groups.push_back(j - i == 1 ? order_[i] : join(std::span(order_).subspan(i, j - i)));
            i = j;
        }
        return join(groups);
    }

    bool coincident(Index begin, Index end) const {
        for (Index i = begin + 1; i < end; ++i)
            if (positions_[order_[i]] != positions_[order_[begin]]) return false;
        return true;
    }

    static glm::dvec3 child_centre(glm::dvec3 centre, double quarter, int octant) {
        return centre + quarter * glm::dvec3(octant & 1 ? 1 : -1, octant & 2 ? 1 : -1, octant & 4 ? 1 : -1);
    }

    // Stable counting sort into octants; equal coordinates go to the upper side.
    std::array<Index, 9> partition(Index begin, Index end, glm::dvec3 centre) {
        const auto octant = [&](Index vertex) {
            const glm::dvec3& p = positions_[vertex];
            return static_cast<std::size_t>((p.x >= centre.x ? 1 : 0) | (p.y >= centre.y ? 2 : 0) |
                                            (p.z >= centre.z ? 4 : 0));
        };
        std::array<Index, 9> bounds{};
        for (Index i = begin; i < end; ++i) ++bounds[octant(order_[i]) + 1];
        bounds[0] = begin;
        for (std::size_t o = 0; o < 8; ++o) bounds[o + 1] += bounds[o];
        std::array<Index, 9> next = bounds;
        for (Index i = begin; i < end; ++i) scratch_[next[octant(order_[i])]++] = order_[i];
        std::copy(scratch_.begin() + begin, scratch_.begin() + end, order_.begin() + begin);
        return bounds;
    }

    Index join(std::span<const Index> children) {
        const Index parent = static_cast<Index>(result_.parents.size());
        result_.parents.push_back(parent);
        for (const Index child : children) result_.parents[child] = parent;
        return parent;
    }

    void report(Index points) {
        constexpr Index worth_reporting = 1 << 16; // points in the cell just done
        if (points < worth_reporting || !progress_ || cancelled_) return;
        const double share = static_cast<double>(result_.parents.size()) / (1.5 * static_cast<double>(order_.size()));
        cancelled_ = !progress_(std::min(1.0, share), "clustering");
    }

    std::span<const glm::dvec3> positions_;
    Progress progress_;
    std::vector<Index> order_, scratch_;
    Clustering result_;
    bool cancelled_ = false;
};

} // namespace

Result<Clustering> cluster_octree(const ClusterInput& input, const Progress& progress) {
    return Octree(input, progress).build();
}

} // namespace unseen::vdtree
