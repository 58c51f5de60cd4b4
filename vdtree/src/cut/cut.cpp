#include <unseen/vdtree/cut.h>

#include <numeric>

#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/vectors.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

#include "cut/budget.h"
#include "cut/cut_state.h"
#include "cut/decide_tree.h"
#include "cut/kernel/fold_tester.h"

namespace unseen::vdtree {

namespace {

// Costs of the caller's own criterion; NaN counts as infinite.
class CallbackCosts final : public CostSource {
public:
    CallbackCosts(const VertexTree& of, const FoldCriterion& criterion) : CostSource(of), criterion_(criterion) {}

    void find_costs(std::span<const NodeId> nodes, const NodeCosts& found) const override {
        // Batches large enough to hide the call, and small enough for the first-level cache.
        constexpr std::size_t batch_size = 1024;
        std::fill_n(found.unfolded, words_for(nodes.size()), 0);
        std::fill_n(found.cost, nodes.size(), 0.0f);
        for (std::size_t begin = 0; begin < nodes.size(); begin += batch_size) {
            const auto batch = nodes.subspan(begin, std::min(batch_size, nodes.size() - begin));
            criterion_(tree, batch, std::span(found.cost + begin, batch.size()));
        }
        tests_ += nodes.size();
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            float& cost = found.cost[i];
            const bool is_finite = cost >= 0 && !(nodes[i] == VertexTree::root() && tree.is_locked());
            cost = is_finite ? cost * weight_of(nodes[i]) : std::numeric_limits<float>::infinity();
            found.unfolded[i / 64] |= std::uint64_t{cost > 1} << (i % 64);
        }
        if (found.seen_cost != found.cost) std::copy_n(found.cost, nodes.size(), found.seen_cost);
    }
    std::uint64_t tests() const { return tests_; }

private:
    float weight_of(NodeId node) const { return node < tree.fold_weights().size() ? tree.fold_weights()[node] : 1; }

    const FoldCriterion& criterion_;
    mutable std::uint64_t tests_ = 0;
};

// Top-down, many nodes at once, so that the callback gets whole batches. Finds the largest cost of what stays folded.
std::vector<std::uint64_t> decide_by_threshold(const CostSource& source, float& max_fold_cost) {
    std::vector<float> costs;
    const auto decide = [&](std::span<const NodeId> nodes, std::uint64_t* unfolded) {
        costs.resize(nodes.size());
        source.find_costs(nodes, {costs.data(), costs.data(), unfolded});
        for (std::size_t i = 0; i < nodes.size(); ++i)
            if (costs[i] <= 1 || !source.tree.is_sound(nodes[i])) max_fold_cost = std::max(max_fold_cost, costs[i]);
    };
    return TreeDecider().run(source.tree, decide, [](std::span<const NodeId>) {});
}

// The cut's triangles in the order of the input, in which groups and materials are runs: input triangle, triangle of
// the tree. (The index buffer's order follows from the history of the cut.)
std::vector<std::pair<Index, Index>> triangles_in_order(const Cut& cut) {
    const VertexTree& tree = cut.tree();
    const auto first = unchecked_links(tree).first_triangle; // of unfolded nodes, which are sound
    std::vector<std::pair<Index, Index>> order;
    order.reserve(cut.triangle_count());
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        if (!cut.is_unfolded(node)) continue;
        for (Index t = first[node]; t < first[node + 1]; ++t) order.emplace_back(tree.source_triangles()[t], t);
    }
    std::sort(order.begin(), order.end());
    return order;
}

// Those ranges of the input, of which something is left.
std::vector<MeshRange> ranges_left(const VertexTree& tree, const std::vector<std::pair<Index, Index>>& order) {
    std::vector<MeshRange> ranges;
    for (const MeshRange& range : tree.ranges()) {
        const auto place = [&](std::uint64_t source) {
            const auto found = std::partition_point(order.begin(), order.end(),
                                                    [&](const auto& entry) { return entry.first < source; });
            return static_cast<std::uint64_t>(found - order.begin());
        };
        MeshRange left = range;
        left.first_triangle = place(range.first_triangle);
        left.triangle_count = place(range.first_triangle + range.triangle_count) - left.first_triangle;
        if (left.triangle_count > 0) ranges.push_back(std::move(left));
    }
    return ranges;
}

// Places that never fold are where the mesh has them, to the last bit.
void put_locked(const VertexTree& tree, std::span<const Index> vertex_of_wedge, std::vector<glm::dvec3>& positions) {
    const auto& locked = tree.data().geometry->locked_positions;
    std::size_t next = 0;
    if (!locked.empty())
        tree.for_each_child(VertexTree::root(), [&](NodeId child) {
            if (!tree.is_place(child) || next == locked.size()) return;
            for (WedgeId w = tree.first_wedge(child); w < tree.wedge_end(child); ++w)
                if (vertex_of_wedge[w] != no_node) positions[vertex_of_wedge[w]] = locked[next];
            ++next;
        });
}

} // namespace

Cut::Cut(const VertexTree& tree)
    : state_(std::make_unique<CutState>(tree)), tree_(&state_->tree()), proxies_(state_->proxies().data()) {}
Cut::Cut(Cut&&) noexcept = default;
Cut& Cut::operator=(Cut&&) noexcept = default;
Cut::~Cut() = default;

bool Cut::is_unfolded(NodeId node) const noexcept { return state_->is_unfolded(node); }
bool Cut::is_wanted(NodeId node) const noexcept {
    if (tree_->is_place(node) || state_->is_changed_by_hand()) return is_unfolded(node);
    return state_->is_wanted(node);
}
bool Cut::is_active(NodeId node) const noexcept { return state_->is_active(node); }
bool Cut::unfold(NodeId node) { return state_->unfold(node); }
bool Cut::fold(NodeId node) { return state_->fold(node); }
bool Cut::unfold_ancestors(NodeId node) { return state_->unfold_ancestors(node); }
bool Cut::fold_subtree(NodeId node) { return state_->fold_subtree(node); }
void Cut::unfold_all() { state_->unfold_all(); }
void Cut::fold_all() { state_->fold_subtree(VertexTree::root()); }

std::span<const FoldChange> Cut::changes() const noexcept { return state_->changes(); }
std::uint64_t Cut::revision() const noexcept { return state_->revision(); }
std::uint64_t Cut::changes_from() const noexcept { return state_->changes_from(); }
std::span<const WedgeId> Cut::indices() const { return state_->indices(); }
Index Cut::triangle_count() const noexcept { return state_->triangle_count(); }
std::uint64_t Cut::byte_size() const noexcept { return state_->byte_size(); }

AdjustStats Cut::adjust(const FoldCriterion& criterion, std::optional<Index> triangle_budget) {
    const CallbackCosts costs(*tree_, criterion);
    AdjustStats stats;
    std::vector<std::uint64_t> unfolded;
    if (triangle_budget) {
        const CostSource* const source = &costs;
        BudgetDecision decision = decide_budget({&source, 1}, {.triangles = *triangle_budget});
        stats.max_fold_cost = decision.max_seen_cost;
        unfolded = std::move(decision.unfolded.front());
    } else {
        unfolded = decide_by_threshold(costs, stats.max_fold_cost);
    }
    stats.node_tests = costs.tests();
    state_->forget_followed();
    state_->change_to(std::move(unfolded), stats);
    return stats;
}

namespace {

// Far enough away that squares of distances still fit floats.
constexpr double farthest_eye = 1e18; // mesh units

Result<void> check(const VertexTree& tree, const Viewpoint& viewpoint, const DistanceCriterion& criterion,
                   const FollowOptions& options = {}) {
    if (criterion.interior_count() != tree.interior_count())
        return invalid_argument("The criterion is for a tree of " + std::to_string(criterion.interior_count()) +
                                " interior nodes, and this one has " + std::to_string(tree.interior_count()) +
                                "; make one for this tree.");
    if (!is_finite(viewpoint.eye)) return invalid_argument("The eye's position is not finite.");
    if (!(glm::length(viewpoint.eye) <= farthest_eye))
        return invalid_argument("The eye is more than 1e18 mesh units away.");
    if (!(viewpoint.eye_spread >= 0 && viewpoint.eye_spread <= farthest_eye))
        return invalid_argument("The spread of the eyes must be 0 or more and at most 1e18 mesh units.");
    constexpr double unit_slack = 1e-3; // directions given with three digits
    if (viewpoint.gaze && !(std::abs(glm::length(*viewpoint.gaze) - 1) <= unit_slack))
        return invalid_argument("The gaze must be a direction of length 1.");
    for (const Frustum& frustum : viewpoint.frusta)
        for (const Plane& plane : frustum)
            if (!(std::abs(glm::length(plane.normal) - 1) <= unit_slack) || !std::isfinite(plane.offset))
                return invalid_argument("A frustum's plane needs a normal of length 1 and a finite offset.");
    if (!viewpoint.occluders.empty() && criterion.parts().spheres != DistanceCriterion::Spheres::ring)
        return invalid_argument("Occluders need a criterion of ring spheres.");
    for (const Sphere& occluder : viewpoint.occluders) {
        const glm::dvec3 centre(occluder.centre);
        if (!is_finite(centre) || !(occluder.radius >= 0) || !std::isfinite(occluder.radius))
            return invalid_argument("An occluder needs a finite centre and a finite radius of 0 or more.");
        if (!(glm::length(centre - viewpoint.eye) > static_cast<double>(occluder.radius) + viewpoint.eye_spread))
            return invalid_argument("The eye is inside an occluder, or one of the eyes within the spread is.");
    }
    if (criterion.parts().lit)
        if (const auto valid = validate(viewpoint.lighting); !valid) return valid;
    constexpr float most_hysteresis = 2;
    if (!(options.threshold > 0) || !std::isfinite(options.threshold))
        return invalid_argument("The threshold must be more than 0 and finite.");
    if (!(options.hysteresis >= 1 && options.hysteresis <= most_hysteresis))
        return invalid_argument("The hysteresis must be from 1 to 2.");
    if (options.milliseconds && !(*options.milliseconds >= 0))
        return invalid_argument("The time limit must be 0 or more milliseconds.");
    return {};
}

} // namespace

Result<AdjustStats> Cut::follow(const DistanceCriterion& criterion, const Viewpoint& viewpoint,
                                const FollowOptions& options) {
    if (const auto valid = check(*tree_, viewpoint, criterion, options); !valid) return valid.error();
    return state_->follow(criterion, viewpoint, options);
}

Result<std::vector<std::uint64_t>> test_every_node(const VertexTree& tree, const DistanceCriterion& criterion,
                                                   const Viewpoint& viewpoint, const FollowOptions& options) {
    if (const auto valid = check(tree, viewpoint, criterion, options); !valid) return valid.error();
    FoldTester tester(tree, criterion, options.cull_back_faces, options.threshold);
    tester.look_from(viewpoint, 1);
    std::vector<std::uint64_t> unfolded(words_for(tree.interior_count()));
    tester.decide_range(0, tree.interior_count(), unfolded.data());
    return unfolded;
}

Result<std::vector<float>> find_every_cost(const VertexTree& tree, const DistanceCriterion& criterion,
                                           const Viewpoint& viewpoint, const FollowOptions& options) {
    if (const auto valid = check(tree, viewpoint, criterion, options); !valid) return valid.error();
    FoldTester tester(tree, criterion, options.cull_back_faces, options.threshold);
    tester.look_from(viewpoint, 1);
    std::vector<NodeId> nodes(tree.interior_count());
    std::iota(nodes.begin(), nodes.end(), NodeId(0));
    std::vector<float> without_least(nodes.size()), costs(nodes.size());
    std::vector<std::uint64_t> unfolded(words_for(nodes.size()));
    tester.find_costs(nodes, {without_least.data(), costs.data(), unfolded.data()});
    return costs;
}

Result<std::vector<AdjustStats>> follow_scene(std::span<const SceneObject> objects, Index triangle_budget) {
    std::vector<std::unique_ptr<FoldTester>> testers;
    std::vector<const CostSource*> tests;
    for (std::size_t i = 0; i < objects.size(); ++i) {
        const SceneObject& object = objects[i];
        if (const auto valid = check(object.cut.tree(), object.viewpoint, object.criterion); !valid)
            return Error{valid.error().code, "Object " + std::to_string(i) + ": " + valid.error().message};
        for (std::size_t other = 0; other < i; ++other)
            if (&objects[other].cut == &object.cut)
                return invalid_argument("Objects " + std::to_string(other) + " and " + std::to_string(i) +
                                        " share one cut; give each its own.");
        testers.push_back(
            std::make_unique<FoldTester>(object.cut.tree(), object.criterion, object.cull_back_faces, 1.0f, false));
        testers.back()->look_from(object.viewpoint, 1);
        tests.push_back(testers.back().get());
    }
    BudgetDecision decision = decide_budget(tests, {.triangles = triangle_budget});
    std::vector<AdjustStats> stats(objects.size());
    for (std::size_t i = 0; i < objects.size(); ++i) {
        CutState& cut = CutState::of(objects[i].cut);
        cut.forget_followed();
        stats[i].node_tests = decision.node_tests;
        stats[i].max_fold_cost = decision.max_seen_cost;
        cut.change_to(std::move(decision.unfolded[i]), stats[i]);
    }
    return stats;
}

ExtractedMesh extract_with_sources(const Cut& cut) {
    const VertexTree& tree = cut.tree();
    ExtractedMesh out;
    Mesh& mesh = out.mesh;
    std::vector<WedgeId> in_order;
    if (!tree.ranges().empty()) {
        const auto order = triangles_in_order(cut);
        mesh.ranges = ranges_left(tree, order);
        out.source_triangles.reserve(order.size());
        in_order.reserve(3 * order.size());
        for (const auto& [source, triangle] : order) {
            out.source_triangles.push_back(source);
            for (const Index leaf : unchecked_links(tree).triangles[triangle])
                in_order.push_back(cut.wedge_of_leaf(leaf));
        }
    }
    const std::span<const WedgeId> indices = tree.ranges().empty() ? cut.indices() : in_order;
    std::vector<Index> vertex_of_wedge(tree.wedge_count(), no_node);
    mesh.triangles.resize(cut.triangle_count());
    for (std::size_t i = 0; i < indices.size(); ++i) {
        Index& vertex = vertex_of_wedge[indices[i]];
        if (vertex == no_node) {
            vertex = static_cast<Index>(out.wedges.size());
            out.wedges.push_back(indices[i]);
        }
        mesh.triangles[i / 3][i % 3] = vertex;
    }
    mesh.positions.reserve(out.wedges.size());
    for (const WedgeId w : out.wedges) mesh.positions.push_back(tree.origin() + glm::dvec3(tree.positions()[w]));
    put_locked(tree, vertex_of_wedge, mesh.positions);
    const auto gather = [&](auto values, auto& to) {
        if (values.empty()) return;
        to.reserve(out.wedges.size());
        for (const WedgeId w : out.wedges) to.push_back(values[w]);
    };
    gather(tree.normals(), mesh.normals);
    gather(tree.colours(), mesh.colours);
    gather(tree.uvs(), mesh.uvs);
    return out;
}

Mesh extract_mesh(const Cut& cut) { return extract_with_sources(cut).mesh; }

} // namespace unseen::vdtree
