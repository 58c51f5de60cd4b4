// The mesh is folded node by node, in about the order in which a viewer lets it, and the light that each fold adds or takes is noted.
// Of a patch of surface that faces the eye, light is the sum over its triangles of their luminance times their vector area, times the
// direction to the eye: a sum that holds for every direction, and over which folds add up.
#include "drift.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <glm/geometric.hpp>

namespace unseen::vdtree {

namespace {

constexpr Index none = 0xffffffffu;
constexpr float levels_per_octave = 1;   // of the order in which nodes fold
constexpr int most_levels = 40;
constexpr float flat_share = 0.5f; // of a surface's area that its vector area must come to; else its parts count without cancelling
constexpr float spread = 1;        // standard deviations by which what is folded may differ from all that could be
constexpr float least_contrast = 1e-3f; // relative luminance: below, errors do not order the folds any more
constexpr float darkest = 0.01f; // relative luminance of areas; about a display's black
constexpr float least_side = 0.25f; // of a surface's area, as seen: less is not what the mean is taken of
constexpr int most_fading = 3;

class DriftFinder {
public:
    DriftFinder(const VertexTree& tree, const FoldErrors& errors)
        : tree_(tree), errors_(errors), interior_(tree.interior_count()), positions_(tree.positions()), luminance_(tree.luminance()),
          parents_(tree.parents()), drift_(interior_), surfaces_(interior_), light_(interior_), found_(interior_) {}

    std::vector<Drift> run() {
        order();
        collect_surfaces();
        fold_all();
        const float first = order_[0];
        if (!(first > 0) || !std::isfinite(first)) return std::move(drift_);
        float finest = first;
        for (const float o : order_)
            if (o > 0) finest = std::min(finest, o);
        const int levels = std::min(most_levels, static_cast<int>(std::ceil(levels_per_octave * std::log2(first / finest))));
        nodes_.resize(interior_);
        for (NodeId n = 0; n < interior_; ++n) nodes_[n] = n;
        float below = -1;
        for (int level = levels; level > 0; --level) {
            const float up_to = first * std::exp2(-static_cast<float>(level) / levels_per_octave);
            compare(up_to);
            note(below, up_to);
            std::erase_if(nodes_, [&](NodeId node) { return is_below(node, up_to); });
            below = up_to;
        }
        return std::move(drift_);
    }

    float luminance() const { return surfaces_[VertexTree::root()].luminance(); }

private:
    // Wide nodes fold after narrow ones, and those that go wrong after those that do not.
    void order() {
        order_.resize(interior_);
        for (NodeId node = interior_; node-- > 0;) {
            const float own = changed_radius(tree_, errors_, node) * std::sqrt(errors_.mean_luminance[node] + least_contrast);
            order_[node] = std::max(order_[node], own);
            if (node > 0) order_[parents_[node]] = std::max(order_[parents_[node]], order_[node]);
        }
    }

    glm::vec3 vector_area(const Triangle& t) const {
        return 0.5f * glm::cross(positions_[t[1]] - positions_[t[0]], positions_[t[2]] - positions_[t[0]]);
    }
    float mean_luminance(const Triangle& t) const { return (luminance_[t[0]] + luminance_[t[1]] + luminance_[t[2]]) / 3; }

    // A third of each triangle belongs to each corner.
    void collect_surfaces() {
        for (const Triangle& corners : tree_.triangles()) {
            const Triangle t = {corners[0] + interior_, corners[1] + interior_, corners[2] + interior_};
            for (const NodeId leaf : t) surfaces_[parents_[leaf]].add(vector_area(t) / 3.0f, mean_luminance(t));
        }
        for (NodeId node = interior_; node-- > 1;) surfaces_[parents_[node]].add(surfaces_[node]);
    }

    // Finds what every fold does to the light; sums it up over the subtrees.
    void fold_all() {
        std::vector<NodeId> sequence(interior_);
        for (NodeId n = 0; n < interior_; ++n) sequence[n] = n;
        std::sort(sequence.begin(), sequence.end(), [&](NodeId a, NodeId b) { return order_[a] != order_[b] ? order_[a] < order_[b] : a > b; });
        std::vector<Triangle> corners(tree_.triangles().begin(), tree_.triangles().end());
        std::vector<std::vector<Index>> around(tree_.node_count()); // triangles at the nodes that are shown
        for (Index t = 0; t < corners.size(); ++t)
            for (NodeId& corner : corners[t]) around[corner += interior_].push_back(t);
        for (const NodeId node : sequence) {
            std::vector<Index>& ring = around[node];
            glm::vec3 before(0), after(0);
            tree_.for_each_child(node, [&](NodeId child) {
                for (const Index t : around[child]) {
                    Triangle& at = corners[t];
                    // With the first of its corners that folds.
                    if (at[0] != node && at[1] != node && at[2] != node && are_distinct(at)) before += light_of(at);
                    for (NodeId& corner : at)
                        if (corner == child) corner = node;
                }
                ring.insert(ring.end(), around[child].begin(), around[child].end());
                std::vector<Index>().swap(around[child]);
            });
            std::sort(ring.begin(), ring.end());
            ring.erase(std::unique(ring.begin(), ring.end()), ring.end());
            std::erase_if(ring, [&](Index t) { return !are_distinct(corners[t]); });
            for (const Index t : ring) after += light_of(corners[t]);
            light_[node] = after - before;
        }
        for (NodeId node = interior_; node-- > 1;) light_[parents_[node]] += light_[node];
    }

    static bool are_distinct(const Triangle& t) { return t[0] != t[1] && t[1] != t[2] && t[2] != t[0]; }
    glm::vec3 light_of(const Triangle& t) const { return mean_luminance(t) * vector_area(t); }

    // What the folds up to here make of every node that is not below one of them.
    void compare(float up_to) {
        for (const NodeId node : nodes_) found_[node] = {};
        for (std::size_t i = nodes_.size(); i-- > 0;) {
            const NodeId node = nodes_[i];
            if (is_below(node, up_to)) continue;
            finish(node, order_[node] <= up_to);
            if (node > 0) found_[parents_[node]].take_up(found_[node]);
        }
    }

    // One of the cells, or above them: then its parts have been finished.
    void finish(NodeId node, bool is_cell) {
        const Surface& surface = surfaces_[node];
        Found& own = found_[node];
        if (is_cell) own.light = light_[node], own.variance = glm::dot(own.light, own.light);
        const float size = glm::length(surface.vector_area);
        if (is_cell || size >= flat_share * surface.area) {
            // As luminance towards where it faces.
            const float error = glm::length(own.light);
            own.sides = {};
            own.sides[side_of(surface.vector_area)] = {glm::dot(own.light, surface.vector_area) > 0 ? error : -error, size};
        }
        own.shift = own.seen_shift();
    }

    static std::size_t side_of(const glm::vec3& direction) {
        std::size_t axis = 0;
        for (std::size_t k = 1; k < 3; ++k)
            if (std::abs(direction[static_cast<int>(k)]) > std::abs(direction[static_cast<int>(axis)])) axis = k;
        return 2 * axis + (direction[static_cast<int>(axis)] > 0);
    }

    bool is_below(NodeId node, float up_to) const { return node > 0 && order_[parents_[node]] <= up_to; }

    // The nodes that fold between the last level and this one.
    void note(float below, float up_to) {
        for (const NodeId node : nodes_)
            if (order_[node] > below && order_[node] <= up_to) drift_[node] = drift_of(node, up_to);
    }

    Drift drift_of(NodeId node, float up_to) const {
        const float radius = changed_radius(tree_, errors_, node), whole = surfaces_[VertexTree::root()].luminance();
        if (!(radius > 0)) return {};
        std::array<float, most_fading + 1> amounts{};
        float sum = 0, count = 0;
        for (NodeId up = parents_[node]; up != no_node; up = parents_[up]) {
            const float octaves = std::log2(tree_.support_spheres()[up].radius / radius);
            if (order_[up] <= up_to || !(octaves >= 1)) continue;
            const Found& there = found_[up];
            // As it would be in a surface of the whole's luminance.
            const float shift = there.shift * whole / std::max(surfaces_[up].luminance(), darkest);
            for (int fading = 0; fading <= most_fading; ++fading)
                amounts[static_cast<std::size_t>(fading)] =
                    std::max(amounts[static_cast<std::size_t>(fading)], shift * std::exp2(octaves * static_cast<float>(fading) / 2));
            sum += octaves, count += 1;
        }
        // The fading that exceeds what was found least.
        const float octaves = std::log2(tree_.support_spheres()[VertexTree::root()].radius / radius);
        Drift best;
        best.octaves = static_cast<std::uint8_t>(std::clamp(std::ceil(octaves), 0.0f, 255.0f));
        if (!(amounts[0] > 0)) return best;
        float least = std::numeric_limits<float>::infinity();
        for (int fading = 0; fading <= most_fading; ++fading) {
            const float amount = amounts[static_cast<std::size_t>(fading)];
            const float excess = count * std::log2(amount) - sum * static_cast<float>(fading) / 2;
            if (excess < least) least = excess, best.amount = amount, best.fading = static_cast<std::uint8_t>(fading);
        }
        return best;
    }

    struct Surface {
        glm::vec3 vector_area = glm::vec3(0);
        float area = 0, bright = 0; // area; luminance times area

        void add(const glm::vec3& of_triangle, float its_luminance) {
            const float its_area = glm::length(of_triangle);
            add({of_triangle, its_area, its_luminance * its_area});
        }
        void add(const Surface& part) { vector_area += part.vector_area, area += part.area, bright += part.bright; }
        float luminance() const { return area > 0 ? bright / area : 0; }
    };
    struct Side {
        float light = 0, area = 0; // the sum of errors; both as seen from there
    };
    struct Found {
        std::array<Side, 6> sides; // by the main direction, of parts that are flat: -x, x, -y, y, -z, z
        glm::vec3 light = glm::vec3(0);
        float variance = 0; // of the light
        float shift = 0;           // of the mean luminance, from where it is largest

        void take_up(const Found& part) {
            for (std::size_t i = 0; i < sides.size(); ++i) sides[i].light += part.sides[i].light, sides[i].area += part.sides[i].area;
            light += part.light;
            variance += part.variance;
        }
        // An eye sees three of the sides at once.
        float seen_shift() const {
            float most = 0, all = 0;
            for (const Side& side : sides) all += side.area;
            if (!(all > 0)) return 0;
            for (std::size_t octant = 0; octant < 8; ++octant) {
                Side seen;
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    const Side& side = sides[2 * axis + ((octant >> axis) & 1)];
                    seen.light += side.light, seen.area += side.area;
                }
                const float random = spread * std::sqrt(variance * seen.area / all);
                most = std::max(most, std::max(std::abs(seen.light), random) / std::max(seen.area, least_side * all));
            }
            return most;
        }
    };

    const VertexTree& tree_;
    const FoldErrors& errors_;
    NodeId interior_;
    std::span<const glm::vec3> positions_;
    std::span<const Unorm16> luminance_;
    std::span<const NodeId> parents_;
    std::vector<float> order_;
    std::vector<Drift> drift_;
    std::vector<Surface> surfaces_; // the mesh's
    std::vector<glm::vec3> light_; // luminance times vector area that the folds of the subtree add
    std::vector<Found> found_;
    std::vector<NodeId> nodes_; // not below what has been folded, parents before children
};

} // namespace

void find_drift(const VertexTree& tree, FoldErrors& errors) {
    DriftFinder finder(tree, errors);
    errors.drift = finder.run();
    errors.drift_luminance = finder.luminance();
}

} // namespace unseen::vdtree
