// Fold criteria: which nodes a view may fold. They are in distance form, fold if the eye is far enough away, so that a cut
// can follow a moving eye at a cost that goes with what changes.
//
// A node is unfolded while
//     |eye - c| - R < D(node, silhouette, eccentricity) / threshold,
//     D = length * switch_distance[class][eccentricity],
// or while the class's least cost is above the threshold. c and R are its ring's (or support's) sphere. For silhouettes
// D is the larger of that and their own length * switch_distance.
//
// The class says how visible a fold of a given extent is: one class for when a node's ring faces the eye from one side,
// and another for when it may be a silhouette. Spheres and lengths nest, and classes grow up the tree, so D is at least
// the children's, and cuts made by such tests are closed upward. The same numbers bound how far the eye may move before a
// test can change, so no node is tested before its time.
#pragma once

#include <limits>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/lighting.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::vdtree {

// Which row of the table of switch distances a node uses.
struct FoldClass {
    std::uint16_t interior = 0;   // if the whole ring faces the eye, or faces away
    std::uint16_t silhouette = 0; // if the ring is, or may be, an outline, or has an irregular edge
};

struct LitClasses; // for lights that may move; only the library makes these
struct Viewpoint;

// Copies are cheap and share their values.
class DistanceCriterion {
public:
    enum class Spheres : std::uint8_t { ring, support };

    // Arrays are by interior node unless said otherwise.
    struct Parts {
        Spheres spheres = Spheres::ring;
        std::vector<FoldClass> classes = {};        // empty: class 0 for all nodes, whatever they face
        std::vector<float> lengths = {};            // mesh units, 0 or more; empty: the spheres' radii
        std::vector<float> silhouette_lengths = {}; // the same for silhouettes' classes; empty: `lengths`
        std::vector<NormalSlabs> facing = {};       // directions that make a node a silhouette; empty: the tree's own
        // [class * eccentricity_bins + bin]: from how many lengths away folds are invisible; not growing with the bin.
        std::vector<float> switch_distance = {};
        // Same shape: no fold of this class costs less, however far away. Empty: 0 for all.
        std::vector<float> least_cost = {};
        // Under lights, in place of `classes`; switch distances must grow with contrasts and luminances.
        std::shared_ptr<const LitClasses> lit = {};
        std::size_t eccentricity_bins = 1;
        bool is_weighted = false; // the lengths have been multiplied with VertexTree::fold_weights(), as create() does
        double bin_degrees = 1;   // bin b holds b * bin_degrees up to the next; the last one everything beyond
    };
    // Switch distances of folds that are visible from nowhere, and from everywhere.
    static constexpr float never_visible = -1;
    static constexpr float always_visible = std::numeric_limits<float>::max();

    // Fails if sizes do not fit the tree, a class has no row, a length or switch distance is NaN, a length is negative or
    // infinite, or a scale is invalid. A child whose switch distance exceeds its parent's costs time: see is_monotone().
    static Result<DistanceCriterion> create(const VertexTree& tree, Parts parts);

    const Parts& parts() const noexcept { return values_->parts; }
    NodeId interior_count() const noexcept { return values_->interior_count; } // of the tree that it was made for
    bool uses_silhouettes() const noexcept { return values_->uses_silhouettes; }
    // Whether no node's switch distance exceeds its parent's. Then a cut watches only its border; else every node above
    // it, too.
    bool is_monotone() const noexcept { return values_->is_monotone; }
    bool uses_gaze() const noexcept { return parts().eccentricity_bins > 1; }
    bool is_copy_of(const DistanceCriterion& other) const noexcept { return values_ == other.values_; }

    // How far beyond its sphere a node's triangles may be drawn, by interior node. Flat parts fold wherever the eye is, and
    // their triangles become as long as the part; a fold beside it moves them. So a node is outside a frustum or behind an
    // occluder only if its sphere is, widened by that much. Criteria with lights do not know it.
    struct Reach {
        float longest = 0;                      // mesh units
        std::vector<std::uint8_t> octaves = {}; // 0: nowhere; else longest * 2^(octaves - 63); empty: nowhere for all
    };
    const Reach& reach() const noexcept { return *values_->reach; }

private:
    struct Values {
        Parts parts;
        std::shared_ptr<const Reach> reach;
        NodeId interior_count;
        bool uses_silhouettes, is_monotone;
    };
    explicit DistanceCriterion(std::shared_ptr<const Values> values) : values_(std::move(values)) {}
    static Result<DistanceCriterion> create(const VertexTree& tree, Parts parts, std::shared_ptr<const Reach> reach);
    friend struct ChangedCriterion; // keeps the reach

    std::shared_ptr<const Values> values_;
};

// A copy of the criterion under which some nodes never fold: not facing away, outside all frusta, or behind occluders.
// `kept`: one bit a node in whole words, lowest first; if a node is kept, its parent must be. With lights, only for
// viewpoints that show something. Fails if sizes do not fit the tree.
Result<DistanceCriterion> keeping(const VertexTree& tree, const DistanceCriterion& criterion,
                                  std::span<const std::uint64_t> kept);

// A copy of the criterion for one eye and gaze, under which nodes that cost anything at all cost no less than `costs`, by
// interior node, which must not grow from a node to its children; aside from the gaze they fall as the criterion's own
// do. Fails for criteria with lights, and if sizes do not fit the tree.
Result<DistanceCriterion> costing_at_least(const VertexTree& tree, const DistanceCriterion& criterion,
                                           const Viewpoint& viewpoint, std::span<const float> costs);

// Node extent, as in VDSlib: folds if the support's sphere spans at most this many pixels at the window's centre. Unfolds
// if the eye is inside the sphere.
Result<DistanceCriterion> extent_criterion(const VertexTree& tree, const View& view, double tolerance_pixels);

// Displacement of the surface (VertexTree::displacement()): folds if the surface moves by at most this many pixels, seen
// from the nearest point of the support's sphere: from the original to the cut, and back. Sliding within the surface does
// not count, nor what it does to textures. Unfolds if the eye is inside the sphere.
Result<DistanceCriterion> displacement_criterion(const VertexTree& tree, const View& view, double tolerance_pixels);

// ---- viewpoints

// A half space: points with normal . x + offset >= 0, in the tree's frame.
struct Plane {
    glm::dvec3 normal = glm::dvec3(0); // unit, pointing inward
    double offset = 0;                 // mesh units
};

// The convex region that a view shows, or the light of a shadow: inside of all planes.
using Frustum = std::vector<Plane>;

// The eye's plane and the window's four sides; no far plane. An orthographic view has the four sides only. Of one eye.
Frustum frustum_of(const VertexTree& tree, const View& view, const Similarity& placement = {});

// The eye that a cut is made for, in the tree's frame (relative to its origin, mesh units).
struct Viewpoint {
    glm::dvec3 eye = glm::dvec3(0);
    // The cut is valid for all eyes within this distance (mesh units) of `eye`, such as a stereo pair around it. Costs
    // triangles: everything counts as that much nearer, and as an outline if it may be one from there.
    double eye_spread = 0;
    std::optional<glm::dvec3> gaze = {}; // unit direction from the eye; default: everything counts as foveal
    std::vector<Frustum> frusta = {};    // nodes outside all of them fold; empty: no node is outside
    // Opaque spheres; nodes wholly behind one fold, even inside a frustum. The eye must be outside all of them. See
    // inner_spheres(). Not for criteria with support spheres, which do not contain all that a fold changes.
    std::vector<Sphere> occluders = {};
    Lighting lighting = {}; // used by criteria with lit classes, which need a valid one
};

// The viewpoint of a view; if `window_only`, nodes outside the window fold.
//
// An orthographic view is replaced by eyes 2000 window heights away from the tree's far side, spread over the whole tree:
// nothing counts as smaller than it is drawn, or as facing the eyes unless it does. A view of two eyes becomes what
// viewpoint_of_pair() makes of them.
Viewpoint viewpoint_of(const VertexTree& tree, const View& view, const Similarity& placement = {},
                       bool window_only = true);
// One viewpoint for both views of a stereo pair: midway between their eyes, with half of their distance as spread. Make the
// criterion for the view with more pixels per degree. Fails if a view is invalid, only one is orthographic, or their
// orthographic heights differ.
Result<Viewpoint> viewpoint_of_pair(const VertexTree& tree, const View& left, const View& right,
                                    const Similarity& placement = {}, bool window_only = true);

// The eye in the tree's own frame, relative to VertexTree::origin(). For an orthographic view: the eye of viewpoint_of().
glm::dvec3 eye_in_tree(const VertexTree& tree, const View& view, const Similarity& placement);

// Projected size on the line of sight: pixels = angle * height / (2 tan(fov / 2)). For an orthographic view: as seen by the
// eye of viewpoint_of().
double pixels_per_radian(const View& view);

// The `count` largest spheres inside a closed surface (where its winding number is not 0) that stay out of the cells it
// touches, of a grid of `cells` (8 to 512) along the tree's longest side. For Viewpoint::occluders, with the eye outside
// the tree's bounding sphere; each costs a nanosecond or less in every test. Empty for open surfaces, if
// VertexTree::check() fails, and if nothing fits in. Cost: some 0.1 s, and 50 ns a triangle; up to a dozen bytes a cell.
std::vector<Sphere> inner_spheres(const VertexTree& tree, int count = 8, int cells = 96);

// How many times the surface goes around a point in the tree's frame: the sum of the triangles' solid angles, in turns. 0
// outside of a closed surface, 1 inside, -1 inside of one that is inside out; NaN if VertexTree::check() fails. Cost: some
// 50 ns a triangle.
double winding_number(const VertexTree& tree, glm::dvec3 at);

// ---- criteria of the caller's own

// For Cut::adjust(): writes the fold cost of each interior node in `nodes`, 0 or more. A node folds if its cost is at most
// 1; NaN unfolds it. Costs must not fall from a node to its parent. Called in batches on the calling thread; must not throw.
using FoldCriterion = FunctionRef<void(const VertexTree&, std::span<const NodeId> nodes, std::span<float> costs)>;

// Such costs count as infinite: no finite distance hides the fold. They may differ, so that budgets have an order.
inline bool is_unbounded(float cost) noexcept { return !(cost < 1e30f); }

} // namespace unseen::vdtree
