// Callbacks that join the modules: fold criteria and visibility tests of the caller's own, and what draws a cut.
#pragma once

#include <span>

#include <unseen/vdtree/distance_criterion.h>
#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::vdtree {

// A criterion of the caller's own, for Cut::adjust(). (Those of Unseen are all in distance form: DistanceCriterion.)
// Fills the fold cost of each interior node in `nodes`: 0 and more, fold where cost <= 1, NaN unfolds. Costs must not
// fall from a node to its parent. Called in batches on the thread that adjusts the cut; must not throw.
// A parameter: refers to the caller's object for the time of the call.
using FoldCriterion = FunctionRef<void(const VertexTree&, std::span<const NodeId> nodes, std::span<float> costs)>;

// Costs from here on are infinite: no finite change of distance hides the fold. They differ so that budgets have an
// order.
inline constexpr float least_unbounded_cost = 1e30f;
inline bool is_unbounded(float cost) noexcept { return !(cost < least_unbounded_cost); }
inline float unbounded_cost(float order) noexcept { return least_unbounded_cost * (1 + order); }

// Fills, for each interior node, whether its ring can be seen. Nodes that are out are folded at no cost. A child
// of a node that is out must be out, and a child of one that is wholly in must be wholly in.
// Owns a copy of the callable.
enum class Visibility : std::uint8_t { out, partly, wholly_in };
using VisibilityTest = Callback<void(const VertexTree&, std::span<const NodeId> nodes, std::span<Visibility> seen)>;

// The eye in the tree's own frame. Relative to VertexTree::origin(). Of an orthographic view the one that stands for it,
// see viewpoint_of().
glm::dvec3 eye_in_tree(const VertexTree& tree, const View& view, const Similarity& placement);

// Frustum test of the ring spheres against the planes of frustum_of().
class FrustumVisibility {
public:
    FrustumVisibility(const VertexTree& tree, const View& view, const Similarity& placement = {});
    void operator()(const VertexTree& tree, std::span<const NodeId> nodes, std::span<Visibility> seen) const;

private:
    Frustum frustum_;
};

// Projected size on the line of sight, in pixels, of an angle: pixels = angle * height / (2 tan(fov / 2)). Of an
// orthographic view, for the eye that stands for it.
double pixels_per_radian(const View& view);

} // namespace unseen::vdtree
