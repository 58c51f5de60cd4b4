#include <vdtree/fold_errors.h>

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/geometric.hpp>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace unseen::vdtree {

namespace {

constexpr Index none = 0xffffffffu;
constexpr std::size_t witness_count = 4; // of a node, for its parent: the worst in distance, the worst in luminance
constexpr Index spread_count = 4;        // leaves compared besides, at equal steps through the support
constexpr std::size_t border_count = 12; // leaves compared that touch neighbours, likewise
constexpr Index leaves_of_part = 4096;   // of a subtree that one task measures

struct Point {
    glm::vec3 position;
    float luminance;
};

struct Difference {
    float distance, luminance;
};

// The point of triangle abc nearest to p, as weights of b and c; after Ericson, Real-Time Collision Detection, 5.1.5.
glm::vec2 nearest_weights(glm::vec3 p, glm::vec3 a, glm::vec3 b, glm::vec3 c) {
    const glm::vec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
    const float d1 = glm::dot(ab, ap), d2 = glm::dot(ac, ap);
    if (d1 <= 0 && d2 <= 0) return {0, 0};
    const float d3 = glm::dot(ab, bp), d4 = glm::dot(ac, bp);
    if (d3 >= 0 && d4 <= d3) return {1, 0};
    const float d5 = glm::dot(ab, cp), d6 = glm::dot(ac, cp);
    if (d6 >= 0 && d5 <= d6) return {0, 1};
    const float vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return {d1 - d3 > 0 ? d1 / (d1 - d3) : 0, 0};
    const float vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return {0, d2 - d6 > 0 ? d2 / (d2 - d6) : 0};
    const float va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        const float along = (d4 - d3) + (d5 - d6);
        const float w = along > 0 ? (d4 - d3) / along : 0;
        return {1 - w, w};
    }
    const float sum = va + vb + vc;
    return sum > 0 ? glm::vec2(vb / sum, vc / sum) : glm::vec2(0);
}

class Measurer {
public:
    Measurer(const VertexTree& tree, FoldErrors& errors)
        : tree_(tree), errors_(errors), first_leaf_(tree.first_leaf()), leaf_end_(tree.leaf_end()), parents_(tree.parents()),
          first_triangle_(tree.first_triangle()), triangles_(tree.triangles()), support_(tree.support_spheres()),
          interior_(tree.interior_count()), crossing_(interior_), witnesses_(interior_) {
        find_triangles_of_leaves();
    }

    void run() {
        std::vector<NodeId> parts, above;
        for (NodeId node = 0; node < interior_;) {
            const bool is_part = leaf_end_[node] - first_leaf_[node] <= leaves_of_part;
            (is_part ? parts : above).push_back(node);
            node = is_part ? tree_.subtree_end()[node] : node + 1;
        }
        tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t i) {
            Scratch scratch;
            for (NodeId node = tree_.subtree_end()[parts[i]]; node-- > parts[i];) measure(node, scratch);
        });
        Scratch scratch;
        for (std::size_t i = above.size(); i-- > 0;) measure(above[i], scratch);
    }

private:
    struct Ring {
        Point corner[3];
    };
    struct Sample {
        Point point;
        Index leaf; // none for points that are no leaves
        Difference error;
    };
    struct Child {
        Index first_leaf;
        NodeId node;
    };
    struct Scratch {
        std::vector<Ring> ring, before; // with neighbours folded
        std::vector<Ring> fine;         // with neighbours unfolded
        std::vector<Index> border;      // leaves of the support that touch others
        std::vector<Sample> samples;
        std::vector<Child> children;
    };
    using Witnesses = std::array<Index, witness_count>;

    void find_triangles_of_leaves() {
        first_of_leaf_.assign(std::size_t{tree_.leaf_count()} + 1, 0);
        for (const Triangle& t : triangles_)
            for (const Index leaf : t) ++first_of_leaf_[leaf + 1];
        for (std::size_t i = 1; i < first_of_leaf_.size(); ++i) first_of_leaf_[i] += first_of_leaf_[i - 1];
        of_leaf_.resize(triangles_.size() * 3);
        std::vector<Index> next(first_of_leaf_.begin(), first_of_leaf_.end() - 1);
        for (Index t = 0; t < triangles_.size(); ++t)
            for (const Index leaf : triangles_[t]) of_leaf_[next[leaf]++] = t;
    }

    Point point(NodeId node) const { return {tree_.positions()[node], tree_.luminance()[node]}; }
    Point leaf_point(Index leaf) const { return point(interior_ + leaf); }

    // Triangles with a corner in the support that the children, folded, leave.
    std::vector<Index> crossing(NodeId node) {
        std::vector<Index> all;
        tree_.for_each_child(node, [&](NodeId child) {
            if (tree_.is_leaf(child)) {
                const Index leaf = child - interior_;
                all.insert(all.end(), of_leaf_.begin() + first_of_leaf_[leaf], of_leaf_.begin() + first_of_leaf_[leaf + 1]);
                return;
            }
            for (const Index t : crossing_[child])
                if (t < first_triangle_[child] || t >= first_triangle_[child + 1]) all.push_back(t);
            std::vector<Index>().swap(crossing_[child]);
        });
        std::sort(all.begin(), all.end());
        all.erase(std::unique(all.begin(), all.end()), all.end());
        return all;
    }

    bool is_larger(NodeId a, NodeId b) const { // ancestors are larger than their descendants
        return support_[a].radius != support_[b].radius ? support_[a].radius > support_[b].radius : a < b;
    }

    // What stands for a leaf outside the node while nodes up to its size are folded.
    NodeId stand_in(Index leaf, NodeId node) const {
        NodeId at = interior_ + leaf;
        for (NodeId up = parents_[at]; up != no_node && is_larger(node, up); up = parents_[at]) at = up;
        return at;
    }

    void measure(NodeId node, Scratch& scratch) {
        crossing_[node] = crossing(node);
        const Index begin = first_leaf_[node], end = leaf_end_[node];
        const Point proxy = point(node);
        const auto is_inside = [&](Index leaf) { return leaf - begin < end - begin; };
        scratch.ring.clear();
        scratch.before.clear();
        scratch.fine.clear();
        scratch.border.clear();
        scratch.samples.clear();
        scratch.children.clear();
        tree_.for_each_child(node, [&](NodeId child) {
            scratch.children.push_back({tree_.is_leaf(child) ? child - interior_ : first_leaf_[child], child});
        });
        const auto child_of = [&](Index leaf) {
            const auto after = std::upper_bound(scratch.children.begin(), scratch.children.end(), leaf,
                                                [](Index l, const Child& child) { return l < child.first_leaf; });
            return std::prev(after)->node;
        };
        NormalSlabs facing;
        double area_before = 0, luminance_before = 0, area_after = 0, luminance_after = 0;
        for (const Index t : crossing_[node]) {
            Ring whole, before, fine, coarse;
            std::array<NodeId, 3> shown, shown_before;
            for (std::size_t k = 0; k < 3; ++k) {
                const Index leaf = triangles_[t][k];
                whole.corner[k] = leaf_point(leaf);
                shown[k] = is_inside(leaf) ? node : stand_in(leaf, node);
                shown_before[k] = is_inside(leaf) ? child_of(leaf) : shown[k];
                if (is_inside(leaf)) scratch.border.push_back(leaf);
                fine.corner[k] = is_inside(leaf) ? proxy : whole.corner[k];
                coarse.corner[k] = point(shown[k]);
                before.corner[k] = point(shown_before[k]);
            }
            insert_normal(whole, facing);
            add_area(whole, area_before, luminance_before);
            if (are_distinct(shown_before)) {
                scratch.before.push_back(before);
                insert_normal(before, facing);
            }
            if (t >= first_triangle_[node] && t < first_triangle_[node + 1]) {
                scratch.samples.push_back({centre_of(whole), none, {}});
                continue;
            }
            add_area(fine, area_after, luminance_after);
            insert_normal(fine, facing);
            scratch.fine.push_back(fine);
            if (!are_distinct(shown)) continue;
            scratch.ring.push_back(coarse);
            insert_normal(coarse, facing);
        }
        if (scratch.ring.empty()) scratch.ring.push_back({{proxy, proxy, proxy}});
        add_samples(node, scratch);

        float distance = 0, luminance = 0, mean = 0;
        if (area_before > 0 && area_after > 0)
            mean = static_cast<float>(std::abs(luminance_after / area_after - luminance_before / area_before));
        for (Sample& sample : scratch.samples) {
            sample.error = compare(sample.point, scratch.ring);
            if (!scratch.fine.empty()) {
                const Difference fine_error = compare(sample.point, scratch.fine);
                sample.error.distance = std::max(sample.error.distance, fine_error.distance);
                sample.error.luminance = std::max(sample.error.luminance, fine_error.luminance);
            }
            distance = std::max(distance, sample.error.distance);
            luminance = std::max(luminance, sample.error.luminance);
        }
        choose_witnesses(node, scratch.samples);
        const auto compare_back = [&](const Point& p) {
            const Difference error = compare(p, scratch.before);
            distance = std::max(distance, error.distance);
            luminance = std::max(luminance, error.luminance);
        };
        if (!scratch.before.empty()) {
            compare_back(proxy);
            for (const Ring& t : scratch.ring) compare_back(centre_of(t));
        }
        tree_.for_each_child(node, [&](NodeId child) {
            if (tree_.is_leaf(child)) return;
            distance = std::max(distance, errors_.distance[child]);
            luminance = std::max(luminance, errors_.luminance[child]);
            mean = std::max(mean, errors_.mean[child]);
            facing |= errors_.facing[child];
        });
        errors_.facing[node] = facing;
        errors_.distance[node] = distance;
        errors_.luminance[node] = luminance;
        errors_.mean[node] = mean;
    }

    static bool are_distinct(const std::array<NodeId, 3>& nodes) {
        return nodes[0] != nodes[1] && nodes[1] != nodes[2] && nodes[2] != nodes[0];
    }

    static Point centre_of(const Ring& t) {
        return {(t.corner[0].position + t.corner[1].position + t.corner[2].position) / 3.0f,
                (t.corner[0].luminance + t.corner[1].luminance + t.corner[2].luminance) / 3.0f};
    }

    static void insert_normal(const Ring& t, NormalSlabs& facing) {
        const glm::dvec3 a(t.corner[0].position);
        const glm::dvec3 normal = glm::cross(glm::dvec3(t.corner[1].position) - a, glm::dvec3(t.corner[2].position) - a);
        const double length = glm::length(normal);
        if (length > 0) facing.insert(normal / length);
    }

    static void add_area(const Ring& t, double& area, double& luminance) {
        const glm::vec3 a = t.corner[0].position;
        const double own = 0.5 * static_cast<double>(glm::length(glm::cross(t.corner[1].position - a, t.corner[2].position - a)));
        area += own;
        luminance += own * static_cast<double>(t.corner[0].luminance + t.corner[1].luminance + t.corner[2].luminance) / 3;
    }

    // The vector is sorted and thinned out.
    static void keep_some(std::vector<Index>& leaves, std::size_t most) {
        std::sort(leaves.begin(), leaves.end());
        leaves.erase(std::unique(leaves.begin(), leaves.end()), leaves.end());
        if (leaves.size() <= most) return;
        for (std::size_t i = 0; i < most; ++i) leaves[i] = leaves[i * leaves.size() / most];
        leaves.resize(most);
    }

    void add_samples(NodeId node, Scratch& scratch) const {
        const auto add_leaf = [&](Index leaf) { scratch.samples.push_back({leaf_point(leaf), leaf, {}}); };
        tree_.for_each_child(node, [&](NodeId child) {
            if (tree_.is_leaf(child)) {
                add_leaf(child - interior_);
                return;
            }
            scratch.samples.push_back({point(child), none, {}});
            for (const Index leaf : witnesses_[child])
                if (leaf != none) add_leaf(leaf);
        });
        keep_some(scratch.border, border_count);
        for (const Index leaf : scratch.border) add_leaf(leaf);
        const Index leaves = leaf_end_[node] - first_leaf_[node];
        for (Index i = 0; i < std::min(spread_count, leaves); ++i)
            add_leaf(first_leaf_[node] + static_cast<Index>((std::uint64_t{leaves} * (2 * i + 1)) / (2 * spread_count)));
    }

    static Difference compare(const Point& p, std::span<const Ring> ring) {
        Difference nearest{std::numeric_limits<float>::max(), 0};
        for (const Ring& t : ring) {
            const auto& [a, b, c] = t.corner;
            const glm::vec2 w = nearest_weights(p.position, a.position, b.position, c.position);
            const glm::vec3 there = a.position + w.x * (b.position - a.position) + w.y * (c.position - a.position);
            const float squared = glm::dot(p.position - there, p.position - there);
            if (!(squared < nearest.distance)) continue;
            const float luminance = a.luminance + w.x * (b.luminance - a.luminance) + w.y * (c.luminance - a.luminance);
            nearest = {squared, std::abs(p.luminance - luminance)};
        }
        nearest.distance = std::sqrt(nearest.distance);
        return nearest;
    }

    void choose_witnesses(NodeId node, std::span<Sample> samples) {
        Witnesses& worst = witnesses_[node];
        worst.fill(none);
        const auto take = [&](std::size_t first, auto error) {
            for (std::size_t k = first; k < first + witness_count / 2; ++k) {
                const Sample* best = nullptr;
                for (const Sample& s : samples)
                    if (s.leaf != none && std::find(worst.begin(), worst.end(), s.leaf) == worst.end() && (!best || error(s) > error(*best)))
                        best = &s;
                if (best) worst[k] = best->leaf;
            }
        };
        take(0, [](const Sample& s) { return s.error.distance; });
        take(witness_count / 2, [](const Sample& s) { return s.error.luminance; });
    }

    const VertexTree& tree_;
    FoldErrors& errors_;
    std::span<const Index> first_leaf_, leaf_end_;
    std::span<const NodeId> parents_;
    std::span<const Index> first_triangle_;
    std::span<const Triangle> triangles_;
    std::span<const Sphere> support_;
    NodeId interior_;
    std::vector<Index> first_of_leaf_, of_leaf_;
    std::vector<std::vector<Index>> crossing_; // of nodes whose parent has not been measured yet
    std::vector<Witnesses> witnesses_;
};

} // namespace

FoldErrors measure_fold_errors(const VertexTree& tree, int threads) {
    FoldErrors errors;
    for (auto* values : {&errors.distance, &errors.luminance, &errors.mean}) values->resize(tree.interior_count());
    errors.facing.resize(tree.interior_count());
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    arena.execute([&] { Measurer(tree, errors).run(); });
    return errors;
}

} // namespace unseen::vdtree
