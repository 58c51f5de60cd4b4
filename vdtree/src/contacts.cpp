#include "contacts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include <glm/geometric.hpp>
#include <tbb/parallel_for.h>

namespace unseen::vdtree {

namespace {

using Corners = std::array<glm::vec3, 3>;

constexpr float near_share = 0.25f; // of a triangle's size: no triangles of a smooth surface come so near but neighbours
constexpr float infinity = std::numeric_limits<float>::infinity();

float unit(float part, float whole) { return whole > 0 ? std::clamp(part / whole, 0.0f, 1.0f) : 0.0f; }

float distance_to_triangle(const glm::vec3& p, const Corners& t) {
    const glm::vec3 n = glm::cross(t[1] - t[0], t[2] - t[0]);
    const float squared = glm::dot(n, n);
    bool is_over = squared > 0;
    float least = infinity;
    for (std::size_t k = 0; k < 3; ++k) {
        const glm::vec3 a = t[k], ab = t[(k + 1) % 3] - a, ap = p - a;
        is_over = is_over && glm::dot(glm::cross(ab, ap), n) >= 0;
        least = std::min(least, glm::length(ap - unit(glm::dot(ap, ab), glm::dot(ab, ab)) * ab));
    }
    return is_over ? std::abs(glm::dot(p - t[0], n)) / std::sqrt(squared) : least;
}

float distance_of_edges(const glm::vec3& a, const glm::vec3& u, const glm::vec3& b, const glm::vec3& v) { // a + [0,1] u, b + [0,1] v
    const glm::vec3 w = a - b;
    const float uu = glm::dot(u, u), uv = glm::dot(u, v), vv = glm::dot(v, v), uw = glm::dot(u, w), vw = glm::dot(v, w);
    const float determinant = uu * vv - uv * uv;
    float s = determinant > 0 ? std::clamp((uv * vw - vv * uw) / determinant, 0.0f, 1.0f) : 0.0f;
    const float t = unit(s * uv + vw, vv);
    s = unit(t * uv - uw, uu);
    return glm::length(w + s * u - t * v);
}

bool passes_through(const glm::vec3& a, const glm::vec3& b, const Corners& t) {
    const glm::vec3 n = glm::cross(t[1] - t[0], t[2] - t[0]);
    const float over_a = glm::dot(a - t[0], n), over_b = glm::dot(b - t[0], n);
    if (!(over_a * over_b < 0)) return false;
    const glm::vec3 at = a + (over_a / (over_a - over_b)) * (b - a);
    for (std::size_t k = 0; k < 3; ++k)
        if (!(glm::dot(glm::cross(t[(k + 1) % 3] - t[k], at - t[k]), n) >= 0)) return false;
    return true;
}

float distance_between(const Corners& a, const Corners& b) {
    float least = infinity;
    for (std::size_t i = 0; i < 3; ++i) {
        if (passes_through(a[i], a[(i + 1) % 3], b) || passes_through(b[i], b[(i + 1) % 3], a)) return 0;
        least = std::min({least, distance_to_triangle(a[i], b), distance_to_triangle(b[i], a)});
        for (std::size_t k = 0; k < 3; ++k) least = std::min(least, distance_of_edges(a[i], a[(i + 1) % 3] - a[i], b[k], b[(k + 1) % 3] - b[k]));
    }
    return least;
}

class ContactFinder {
public:
    explicit ContactFinder(const VertexTree& tree)
        : tree_(tree), triangles_(tree.triangles()), positions_(tree.positions().subspan(tree.interior_count())), bounds_(tree.bounds()),
          first_triangle_(tree.first_triangle()) {
        first_of_leaf_.assign(std::size_t{tree.leaf_count()} + 1, 0);
        for (const Triangle& t : triangles_)
            for (const Index leaf : t) ++first_of_leaf_[leaf + 1];
        for (std::size_t i = 1; i < first_of_leaf_.size(); ++i) first_of_leaf_[i] += first_of_leaf_[i - 1];
        of_leaf_.resize(triangles_.size() * 3);
        std::vector<Index> next(first_of_leaf_.begin(), first_of_leaf_.end() - 1);
        for (Index t = 0; t < triangles_.size(); ++t)
            for (const Index leaf : triangles_[t]) of_leaf_[next[leaf]++] = t;
    }

    std::vector<float> run() {
        std::vector<float> gaps(triangles_.size(), infinity);
        constexpr Index piece = 1024;
        tbb::parallel_for(Index{0}, static_cast<Index>((triangles_.size() + piece - 1) / piece), [&](Index i) {
            Scratch scratch;
            for (Index t = i * piece; t < std::min<std::size_t>(triangles_.size(), std::size_t{i + 1} * piece); ++t) gaps[t] = find(t, scratch);
        });
        return gaps;
    }

private:
    struct Scratch {
        std::vector<Index> neighbours; // leaves of neighbouring triangles, ascending
        std::vector<NodeId> waiting;
    };

    Corners corners(Index triangle) const {
        const Triangle& t = triangles_[triangle];
        return {positions_[t[0]], positions_[t[1]], positions_[t[2]]};
    }

    void collect_neighbours(Index triangle, std::vector<Index>& leaves) const {
        leaves.clear();
        for (const Index leaf : triangles_[triangle])
            for (Index i = first_of_leaf_[leaf]; i < first_of_leaf_[leaf + 1]; ++i)
                leaves.insert(leaves.end(), triangles_[of_leaf_[i]].begin(), triangles_[of_leaf_[i]].end());
        std::sort(leaves.begin(), leaves.end());
        leaves.erase(std::unique(leaves.begin(), leaves.end()), leaves.end());
    }

    float find(Index triangle, Scratch& scratch) const {
        const Corners own = corners(triangle);
        const glm::vec3 centre = (own[0] + own[1] + own[2]) / 3.0f;
        const float radius = std::max({glm::length(own[0] - centre), glm::length(own[1] - centre), glm::length(own[2] - centre)});
        float least = near_share * radius;
        if (!(least > 0)) return infinity;
        const auto may_be_nearer = [&](const glm::vec3& c, float r) { return glm::length(c - centre) - r - radius < least; };
        bool has_neighbours = false;
        bool is_found = false;
        scratch.waiting.assign(1, VertexTree::root());
        while (!scratch.waiting.empty()) {
            const NodeId node = scratch.waiting.back();
            scratch.waiting.pop_back();
            const Sphere& ring = bounds_[node].ring; // contains all triangles that touch the support
            if (!may_be_nearer(ring.centre, ring.radius)) continue;
            for (Index other = first_triangle_[node]; other < first_triangle_[node + 1]; ++other) {
                const Corners its = corners(other);
                const glm::vec3 middle = (its[0] + its[1] + its[2]) / 3.0f;
                const float reach = std::max({glm::length(its[0] - middle), glm::length(its[1] - middle), glm::length(its[2] - middle)});
                if (other == triangle || !may_be_nearer(middle, reach)) continue;
                if (!has_neighbours) collect_neighbours(triangle, scratch.neighbours), has_neighbours = true;
                const Triangle& t = triangles_[other];
                const bool is_neighbour = std::any_of(t.begin(), t.end(), [&](Index leaf) {
                    return std::binary_search(scratch.neighbours.begin(), scratch.neighbours.end(), leaf);
                });
                if (is_neighbour) continue;
                const float gap = distance_between(own, its);
                if (gap < least) least = gap, is_found = true;
            }
            tree_.for_each_child(node, [&](NodeId child) {
                if (!tree_.is_leaf(child)) scratch.waiting.push_back(child);
            });
        }
        return is_found ? least : infinity;
    }

    const VertexTree& tree_;
    std::span<const Triangle> triangles_;
    std::span<const glm::vec3> positions_; // of leaves
    std::span<const NodeBounds> bounds_;
    std::span<const Index> first_triangle_;
    std::vector<Index> first_of_leaf_, of_leaf_;
};

} // namespace

std::vector<float> find_contacts(const VertexTree& tree) { return ContactFinder(tree).run(); }

} // namespace unseen::vdtree
