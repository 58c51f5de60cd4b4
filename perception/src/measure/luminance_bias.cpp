// The mesh is folded node by node, in about the order in which a viewer lets it, and the light that each fold adds or
// takes is noted. Of a patch of surface that faces the eye, light is the sum over its triangles of their luminance
// times their vector area, times the direction to the eye: a sum that holds for every direction, and over which folds
// add up.
#include "measure/measure_folds.h"

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/fold_sequence.h>

namespace unseen::perception {

using namespace vdtree;

namespace {

using namespace measurement;

class BiasFinder {
public:
    BiasFinder(const SoundTree& tree, const TexturedLight& light, std::span<const FoldTexture> textures,
               std::span<FoldError> errors)
        : tree_(tree), of_texture_(light), textures_(textures), errors_(errors), interior_(tree.interior_count()),
          luminance_(tree.luminance()), parents_(tree.parents()), mesh_(tree), surfaces_(interior_), light_(interior_),
          found_(interior_) {}

    void run() {
        order();
        collect_surfaces();
        fold_all();
        const float first = order_[0];
        if (!(first > 0) || !std::isfinite(first)) return;
        float finest = first;
        for (const float o : order_)
            if (o > 0) finest = std::min(finest, o);
        const int levels =
            std::min(most_levels, static_cast<int>(std::ceil(levels_per_octave * std::log2(first / finest))));
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
    }

private:
    // Wide nodes fold after narrow ones, and those that go wrong after those that do not.
    void order() {
        order_.resize(interior_);
        for (NodeId node = interior_; node-- > 0;) {
            const float own =
                changed_radius(tree_, errors_, node) * std::sqrt(errors_[node].wide_luminance + least_contrast);
            order_[node] = std::max(order_[node], own);
            if (node > 0) order_[parents_[node]] = std::max(order_[parents_[node]], order_[node]);
        }
    }

    using Wedges = std::array<WedgeId, 3>;
    float mean_luminance(const Wedges& t) const {
        if (of_texture_.texture)
            return of_texture_.mean({luminance_[t[0]], luminance_[t[1]], luminance_[t[2]]},
                                    {tree_.uvs()[t[0]], tree_.uvs()[t[1]], tree_.uvs()[t[2]]});
        return mean_of_vertices(t);
    }
    float mean_of_vertices(const Wedges& t) const {
        return (luminance_[t[0]] + luminance_[t[1]] + luminance_[t[2]]) / 3;
    }

    // A third of each triangle belongs to each corner.
    void collect_surfaces() {
        for (Index t = 0; t < tree_.triangle_count(); ++t) {
            Surface third;
            third.add(mesh_.vector_area(t) / 3.0f, mean_luminance(mesh_.wedges(t)));
            for (const NodeId place : mesh_.corners(t)) surfaces_[parents_[place]].add(third);
        }
        for (NodeId node = interior_; node-- > 1;) surfaces_[parents_[node]].add(surfaces_[node]);
    }

    // Finds what every fold does to the light; sums it up over the subtrees.
    void fold_all() {
        std::vector<NodeId> sequence(interior_);
        for (NodeId n = 0; n < interior_; ++n) sequence[n] = n;
        std::sort(sequence.begin(), sequence.end(),
                  [&](NodeId a, NodeId b) { return order_[a] != order_[b] ? order_[a] < order_[b] : a > b; });
        mesh_.fold_all(sequence, [&](NodeId node) {
            glm::vec3 light(0), of_vertices(0);
            float area = 0;
            mean_texture_ = textures_.empty() ? 1.0f : textures_[node].mean;
            mesh_.fold(node, [&](Index t) {
                light -= light_of(t);
                of_vertices -= light_of_vertices(t);
            });
            for (const Index t : mesh_.ring(node)) {
                light += light_of(t);
                of_vertices += light_of_vertices(t);
                area += glm::length(mesh_.vector_area(t));
            }
            light_[node] = textures_.empty() ? light : of_vertices + from_slide(node, light - of_vertices, area);
        });
        for (NodeId node = interior_; node-- > 1;) light_[parents_[node]] += light_[node];
    }

    glm::vec3 light_of(Index triangle) const {
        return mean_luminance(mesh_.wedges(triangle)) * mesh_.vector_area(triangle);
    }

    // ---- with a texture

    // With the texture's mean all over it.
    glm::vec3 light_of_vertices(Index triangle) const {
        if (textures_.empty()) return glm::vec3(0);
        const float vertices = mean_of_vertices(mesh_.wedges(triangle));
        return of_texture_.with_texture(vertices, mean_texture_) * mesh_.vector_area(triangle);
    }
    // No more light comes and goes with a texture than lies where it slides to; what is measured of it above that is
    // what means over parts of triangles are wrong by.
    glm::vec3 from_slide(NodeId node, const glm::vec3& measured, float area) const {
        constexpr float perimeter = 2; // of a disc, over its area, in radii
        const LuminanceRange drawn = tree_.ring_luminance()[node];
        const float most = std::min(1.0f, perimeter * textures_[node].slide) * drawn.hi * area,
                    length = glm::length(measured);
        return length > most ? measured * (most / length) : measured;
    }

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
            own.sides[side_of(surface.vector_area)] = {glm::dot(own.light, surface.vector_area) > 0 ? error : -error,
                                                       size};
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
            if (order_[node] > below && order_[node] <= up_to) find(node, up_to);
    }

    void find(NodeId node, float up_to) {
        const float radius = changed_radius(tree_, errors_, node);
        if (!(radius > 0)) return;
        std::array<float, most_fading + 1> amounts{};
        float sum = 0, count = 0;
        int left = most_ancestors;
        for (NodeId up = parents_[node]; up != no_node && left > 0; up = parents_[up], --left) {
            const float octaves = std::log2(tree_.support_spheres()[up].radius / radius);
            if (order_[up] <= up_to || !(octaves >= 1)) continue;
            const float shift = found_[up].shift / std::max(surfaces_[up].luminance(), darkest);
            for (std::size_t fading = 0; fading <= most_fading; ++fading)
                amounts[fading] =
                    std::max(amounts[fading], shift * std::exp2(octaves * static_cast<float>(fading) / 2));
            sum += octaves, count += 1;
        }
        if (!(amounts[0] > 0)) return;
        // The fading that exceeds what was found least.
        float least = std::numeric_limits<float>::infinity();
        for (std::size_t fading = 0; fading <= most_fading; ++fading) {
            const float excess = count * std::log2(amounts[fading]) - sum * static_cast<float>(fading) / 2;
            if (excess < least)
                least = excess, errors_[node].bias = amounts[fading],
                errors_[node].fading = static_cast<std::uint8_t>(fading);
        }
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
        float shift = 0;    // of the mean luminance, from where it is largest

        void take_up(const Found& part) {
            for (std::size_t i = 0; i < sides.size(); ++i)
                sides[i].light += part.sides[i].light, sides[i].area += part.sides[i].area;
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

    const SoundTree& tree_;
    TexturedLight of_texture_;
    std::span<const FoldTexture> textures_;
    std::span<FoldError> errors_;
    NodeId interior_;
    std::span<const Unorm16> luminance_; // by wedge
    float mean_texture_ = 1;
    std::span<const NodeId> parents_;
    FoldSequence mesh_;
    std::vector<float> order_;
    std::vector<Surface> surfaces_; // the mesh's
    std::vector<glm::vec3> light_;  // luminance times vector area that the folds of the subtree add
    std::vector<Found> found_;
    std::vector<NodeId> nodes_; // not below what has been folded, parents before children
};

} // namespace

void find_luminance_bias(const SoundTree& tree, const TexturedLight& light, std::span<const FoldTexture> textures,
                         std::span<FoldError> errors) {
    BiasFinder(tree, light, textures, errors).run();
}

} // namespace unseen::perception
