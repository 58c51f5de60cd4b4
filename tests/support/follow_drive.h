// Follows viewpoints of all kinds, good and bad, over a small tree, as bytes from anywhere say: whatever comes, a cut
// is what its definition asks for, and a bad call is refused and changes nothing.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>

#include "follow_tools.h"
#include "shapes.h"
#include "sound.h"
#include "tree_checks.h"

namespace unseen::support {

// Numbers out of bytes; zeros when they are used up.
class ByteSource {
public:
    explicit ByteSource(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

    bool empty() const { return bytes_.empty(); }
    unsigned byte() {
        if (bytes_.empty()) return 0;
        const unsigned value = bytes_[0];
        bytes_ = bytes_.subspan(1);
        return value;
    }
    unsigned below(unsigned end) { return byte() % end; }
    bool one_in(unsigned n) { return byte() % n == n - 1; } // not where there are no bytes
    double share() { return (byte() * 256 + byte()) / 65535.0; }
    double between(double low, double high) { return low + (high - low) * share(); }
    glm::dvec3 direction() {
        const glm::dvec3 d(between(-1, 1), between(-1, 1), between(-1, 1));
        return glm::length(d) > 1e-3 ? glm::normalize(d) : glm::dvec3(0, 0, 1);
    }

private:
    std::span<const std::uint8_t> bytes_;
};

class FollowDrive {
public:
    explicit FollowDrive(std::span<const std::uint8_t> bytes) : in_(bytes) {}

    // The first fault, or nothing.
    std::string run() {
        const ClustererKind clusterer = in_.below(2) ? ClustererKind::octree : ClustererKind::quadric;
        const float border_weights[] = {1, 4, never_folds};
        auto tree = build_tree(make_mesh().view(),
                               {.clusterer = clusterer, .border_weight = border_weights[in_.below(3)], .threads = 1});
        if (!tree) return "no tree: " + tree.error().message;
        tree_.emplace(std::move(*tree));
        cut_.emplace(*tree_);
        GpuCopy copy(*tree_);
        change_criterion();
        for (int step = 0; step < most_steps && !in_.empty(); ++step) {
            std::string fault = take_step();
            if (fault.empty()) fault = fault_in_cut(*cut_);
            if (fault.empty() && tree_->is_locked() && !cut_->is_unfolded(VertexTree::root())) fault = "a lock broke";
            if (fault.empty() && in_.below(2) && triangles_of(cut_->indices()) != gathered(*cut_))
                fault = "the index buffer is not the cut's";
            if (fault.empty() && in_.below(4)) { // now and then it misses one
                copy.update(*cut_);
                if (copy.sorted_triangles() != sorted_triangles(*cut_)) fault = "a copy on the GPU is not the cut's";
            }
            if (!fault.empty()) return "step " + std::to_string(step) + ": " + fault;
        }
        return {};
    }

private:
    static constexpr int most_steps = 60;

    Mesh make_mesh() {
        const unsigned size = in_.below(12), seed = in_.byte();
        switch (in_.below(8)) {
        case 0: return shapes::tetrahedron();
        case 1: return shapes::random_soup(static_cast<int>(4 + size), static_cast<int>(4 + 2 * size), seed);
        case 2: return shapes::inside_out(shapes::bumpy_sphere(1, 0.1, seed));
        case 3: return shapes::grid(static_cast<int>(1 + size / 2));
        case 4: return shapes::cube(static_cast<int>(1 + size / 4)); // with hard edges
        case 5: return shapes::non_manifold_fan(static_cast<int>(3 + size));
        case 6: return shapes::placed(shapes::torus(3 + static_cast<int>(size), 4), 1e-3, {100, -2, 0.5});
        default: return shapes::bumpy_sphere(2, 0.05, seed);
        }
    }

    // Silhouettes, eccentricities, least costs, rows and lengths at random; now and then one that does not grow up the
    // tree.
    void change_criterion() {
        const VertexTree& tree = *tree_;
        const std::size_t rows = 2 + in_.below(6);
        const bool is_wild = in_.one_in(4) && may_be_wild;
        DistanceCriterion::Parts parts;
        if (in_.below(2)) parts.spheres = DistanceCriterion::Spheres::support;
        parts.eccentricity_bins = in_.below(2) ? 1 : 8;
        parts.bin_degrees = in_.between(0.5, 20);
        std::vector<float> row_distances;
        for (std::size_t row = 0; row < rows; ++row)
            row_distances.push_back(static_cast<float>(static_cast<double>(row) * in_.between(0.2, 6)));
        std::sort(row_distances.begin(), row_distances.end());
        if (in_.below(2)) row_distances.front() = DistanceCriterion::never_visible;
        if (in_.one_in(4)) row_distances.back() = DistanceCriterion::always_visible;
        for (const float switch_distance : row_distances)
            for (std::size_t bin = 0; bin < parts.eccentricity_bins; ++bin)
                parts.switch_distance.push_back(switch_distance > 0 &&
                                                        switch_distance < DistanceCriterion::always_visible
                                                    ? switch_distance / static_cast<float>(1 + bin)
                                                    : switch_distance);
        if (in_.below(3) == 0)
            parts.least_cost.assign(parts.switch_distance.size(), static_cast<float>(in_.between(0, 2)));
        if (in_.below(4)) parts.classes = random_classes(rows, is_wild);
        if (in_.below(3) == 0) parts.lengths = random_lengths(is_wild);
        if (!parts.classes.empty() && in_.below(3) == 0) parts.silhouette_lengths = random_lengths(is_wild);
        auto made = DistanceCriterion::create(tree, std::move(parts));
        if (made) criterion_.emplace(std::move(*made)); // its place stays, its values change
        else refused_ = made.error().message;
    }

    std::vector<FoldClass> random_classes(std::size_t rows, bool is_wild) {
        std::vector<FoldClass> classes(tree_->interior_count());
        for (NodeId node = tree_->interior_count(); node-- > 0;) {
            FoldClass& own = classes[node];
            own.interior = std::max(own.interior, static_cast<std::uint16_t>(in_.below(static_cast<unsigned>(rows))));
            own.silhouette = std::max(
                {own.silhouette, own.interior, static_cast<std::uint16_t>(in_.below(static_cast<unsigned>(rows)))});
            if (node == 0 || is_wild) continue;
            FoldClass& parent = classes[support::sound(*tree_).parents()[node]];
            parent.interior = std::max(parent.interior, own.interior);
            parent.silhouette = std::max(parent.silhouette, own.silhouette);
        }
        return classes;
    }

    std::vector<float> random_lengths(bool is_wild) {
        std::vector<float> lengths(tree_->interior_count());
        for (NodeId node = tree_->interior_count(); node-- > 0;) {
            lengths[node] =
                std::max(lengths[node], static_cast<float>(in_.share() * tree_->bounds()[node].ring.radius));
            if (node == 0 || is_wild) continue;
            float& parent = lengths[support::sound(*tree_).parents()[node]];
            parent = std::max(parent, lengths[node]);
        }
        return lengths;
    }

    std::string take_step() {
        if (!refused_.empty()) return "a criterion was refused: " + refused_;
        switch (in_.below(16)) {
        case 0: change_criterion(); return {};
        case 1: cut_->unfold_all(); return {};
        case 2: cut_->fold_all(); return {};
        case 3: cut_->fold_subtree(in_.below(tree_->interior_count())); return {};
        case 4: cut_->unfold_ancestors(in_.below(tree_->node_count())); return {};
        case 5: cut_->adjust(SteadyCosts(in_.byte()), {}); return {};
        case 6: return follow_bad();
        case 7:
        case 8: return follow_within_a_budget();
        case 9: return follow_in_time();
        case 10: criterion_.emplace(DistanceCriterion(*criterion_)); return {}; // the same values elsewhere
        default: return follow();
        }
    }

    // Some costs that have nothing to do with any view.
    struct SteadyCosts {
        explicit SteadyCosts(unsigned seed) : seed_(seed) {}
        void operator()(const VertexTree&, std::span<const NodeId> nodes, std::span<float> costs) const {
            for (std::size_t i = 0; i < nodes.size(); ++i)
                costs[i] = static_cast<float>((nodes[i] * 7 + seed_) % 5) * 0.5f;
        }
        unsigned seed_;
    };

    Viewpoint next_viewpoint() {
        const Sphere sphere = tree_->bounding_sphere();
        const double radius = std::max(1e-6, static_cast<double>(sphere.radius));
        switch (in_.below(8)) {
        case 0:
            viewpoint_.eye = glm::dvec3(sphere.centre) + radius * std::pow(10.0, in_.between(-2, 6)) * in_.direction();
            break;
        case 1:
            viewpoint_.eye = glm::dvec3(tree_->position(in_.below(tree_->node_count())));
            break; // where a vertex is
        case 2: viewpoint_.eye = {1e18 * in_.share() * 0.5, 0, 0}; break;
        case 3: break; // stands still
        default: viewpoint_.eye += radius * std::pow(10.0, in_.between(-4, 0)) * in_.direction(); break;
        }
        if (glm::length(viewpoint_.eye) > 9e17) viewpoint_.eye = glm::dvec3(0);
        if (in_.one_in(12)) viewpoint_.eye_spread = in_.one_in(2) ? 0 : radius * std::pow(10.0, in_.between(-4, 1));
        if (in_.below(4) == 0) viewpoint_.gaze = in_.direction();
        if (in_.one_in(8)) viewpoint_.gaze = {};
        if (viewpoint_.gaze && in_.below(3) == 0) // a little
            viewpoint_.gaze = glm::normalize(*viewpoint_.gaze + std::pow(10.0, in_.between(-5, -1)) * in_.direction());
        if (in_.below(6) == 0) {
            viewpoint_.frusta.assign(in_.below(3), {});
            for (Frustum& frustum : viewpoint_.frusta)
                for (unsigned planes = in_.below(4); planes > 0; --planes)
                    frustum.push_back({in_.direction(), radius * in_.between(-2, 3)});
        }
        if (in_.below(2) == 0) {
            const double step = std::pow(10.0, in_.between(-4, 0));
            for (Frustum& frustum : viewpoint_.frusta)
                for (Plane& plane : frustum) {
                    if (const glm::dvec3 turned = plane.normal + step * in_.direction(); glm::length(turned) > 0.1)
                        plane.normal = glm::normalize(turned);
                    plane.offset += step * radius * in_.between(-1, 1);
                }
        }
        if (in_.below(6) == 0) {
            viewpoint_.occluders.clear();
            for (unsigned count = in_.below(4); count > 0; --count)
                viewpoint_.occluders.push_back({sphere.centre + glm::vec3(radius * in_.share() * in_.direction()),
                                                static_cast<float>(radius * in_.share())});
        }
        // An occluder that the eye is in, or one at all with other spheres, is no good viewpoint.
        if (criterion_->parts().spheres != DistanceCriterion::Spheres::ring) viewpoint_.occluders.clear();
        std::erase_if(viewpoint_.occluders, [&](const Sphere& s) {
            return !(glm::distance(glm::dvec3(s.centre), viewpoint_.eye) >
                     static_cast<double>(s.radius) + viewpoint_.eye_spread);
        });
        return viewpoint_;
    }

    FollowOptions next_options() {
        FollowOptions options;
        if (in_.below(3) == 0) options.threshold = static_cast<float>(in_.between(0.1, 4));
        options.cull_back_faces = in_.below(3) == 0;
        return options;
    }

    std::string follow() {
        const Viewpoint viewpoint = next_viewpoint();
        const FollowOptions options = next_options();
        if (const auto stats = cut_->follow(*criterion_, viewpoint, options); !stats)
            return "refused: " + stats.error().message;
        if (state_of(*cut_) != from_scratch(*tree_, *criterion_, viewpoint, options))
            return "the cut is not the one from scratch";
        return {};
    }

    std::string follow_within_a_budget() {
        const Viewpoint viewpoint = next_viewpoint();
        FollowOptions options = next_options();
        options.triangle_budget = in_.below(3)   ? in_.below(static_cast<unsigned>(tree_->triangle_count()) + 3)
                                  : in_.below(2) ? 0
                                                 : ~Index{0};
        options.fill_budget = in_.below(2);
        if (in_.below(3) == 0) options.hysteresis = static_cast<float>(in_.between(1, 2));
        const auto stats = cut_->follow(*criterion_, viewpoint, options);
        if (!stats) return "refused: " + stats.error().message;
        if (stats->triangles > std::max(*options.triangle_budget, tree_->locked_triangles()) ||
            stats->triangles != cut_->triangle_count())
            return "the budget was exceeded";
        if (options.hysteresis > 1) return {};
        Cut fresh(*tree_);
        if (!fresh.follow(*criterion_, viewpoint, options) || state_of(fresh) != state_of(*cut_))
            return "within a budget, the cut depends on the one before";
        return {};
    }

    // In time limits of any length, until nothing is left to do.
    std::string follow_in_time() {
        const Viewpoint viewpoint = next_viewpoint();
        FollowOptions options = next_options();
        options.milliseconds = in_.below(2) ? 0.0 : in_.between(0, 0.2);
        if (in_.one_in(8)) options.milliseconds = std::numeric_limits<double>::infinity();
        constexpr int most_calls = 1000;
        for (int calls = 0; calls < most_calls; ++calls) {
            const auto stats = cut_->follow(*criterion_, viewpoint, options);
            if (!stats) return "refused: " + stats.error().message;
            if (const std::string fault = fault_in_cut(*cut_); !fault.empty())
                return "between two time limits: " + fault;
            if (!stats->is_complete) {
                options.milliseconds = 1.0;
                continue;
            }
            if (state_of(*cut_) != from_scratch(*tree_, *criterion_, viewpoint, options))
                return "when its time is over, the cut is not the one from scratch";
            return {};
        }
        return "never done";
    }

    // One number that cannot be: refused, and nothing is changed.
    std::string follow_bad() {
        constexpr double nan = std::numeric_limits<double>::quiet_NaN(),
                         infinity = std::numeric_limits<double>::infinity();
        const double bad = in_.below(3) == 0 ? nan : in_.below(2) ? infinity : -infinity;
        Viewpoint viewpoint = viewpoint_;
        FollowOptions options;
        switch (in_.below(12)) {
        case 8: viewpoint.occluders = {{glm::vec3(9, 9, 9), static_cast<float>(bad)}}; break;
        case 9:
            viewpoint.occluders = {
                {glm::vec3(viewpoint.eye), static_cast<float>(1 + 0.01 * glm::length(viewpoint.eye))}};
            break;
        case 0: viewpoint.eye[static_cast<int>(in_.below(3))] = bad; break;
        case 1: viewpoint.eye = {0, 3e18, 0}; break;
        case 2: viewpoint.gaze = glm::dvec3(bad, 0, 0); break;
        case 3: viewpoint.gaze = glm::dvec3(0); break;
        case 4: viewpoint.frusta = {{Plane{{0, 0, 1}, bad}}}; break;
        case 5: viewpoint.frusta = {{Plane{{0, 0, 0}, 1}}}; break;
        case 6: options.threshold = in_.below(2) ? static_cast<float>(bad) : -0.0f; break;
        case 7: options.hysteresis = in_.below(2) ? static_cast<float>(bad) : 0.5f; break;
        case 10: viewpoint.eye_spread = in_.below(2) ? bad : -1.0; break;
        default: options.milliseconds = in_.below(2) ? nan : -1.0; break;
        }
        const std::vector<bool> before = state_of(*cut_);
        if (cut_->follow(*criterion_, viewpoint, options)) return "a bad call was taken";
        if (state_of(*cut_) != before) return "a refused call has changed the cut";
        return {};
    }

#ifdef NDEBUG
    static constexpr bool may_be_wild = true;
#else
    static constexpr bool may_be_wild = false; // an assertion tells
#endif

    ByteSource in_;
    std::optional<VertexTree> tree_;
    std::optional<Cut> cut_;
    std::optional<DistanceCriterion> criterion_;
    std::string refused_; // why there is no other criterion
    Viewpoint viewpoint_{.eye = {3, 0, 0}};
};

} // namespace unseen::support
