// Fold criteria: which nodes a view may fold. The criteria of Unseen are in distance form: fold if the eye is far enough
// away. That lets a cut follow a moving eye at a cost that goes with what changes.
//
// A node is unfolded while
//     |eye - c| - R < D(node, silhouette, eccentricity) / threshold,
//     D = length * switch_distance[class][eccentricity],
// or while the class's least cost is above the threshold. c and R are its ring's (or support's) sphere. For silhouettes
// D is the larger of that and their own length * switch_distance.
//
// The class says how visible a fold of a given extent is. A node has one class for when its ring faces the eye from one
// side, and another for when it is, or may be, a silhouette. Spheres and lengths nest, and classes grow up the tree. So D
// is at least its children's for equal arguments, and a parent's arguments are never the better ones: a cut made by such
// tests is closed upward. The same numbers bound how far the eye may move before a test can change, so no node is tested
// before its time.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/lighting.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::vdtree {

class LightBounds;

// ---- criteria in distance form

// Which row of the table of switch distances a node uses.
struct FoldClass {
    std::uint16_t interior = 0;   // if the whole ring faces the eye, or faces away
    std::uint16_t silhouette = 0; // if the ring is, or may be, an outline, or has an irregular edge
};

// A linear map from relative luminance to a unit of the criterion's own.
struct AbsoluteScale {
    double offset = 0; // the value of 0; 0 or more
    double span = 1;   // what 1 adds; above 0

    double of(double relative) const { return offset + span * relative; }
};

// Classes for trees under lights that may move: interior ones follow from the range of luminances that the viewpoint's
// lighting gives to a node's vertices, adapted to the brightest of these. Only the library lays out their table's rows.
struct LitClasses {
    std::shared_ptr<const LightBounds> bounds; // of the tree
    AbsoluteScale scale;
    std::uint16_t silhouette = 0; // the class of all outlines
};

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
        std::optional<LitClasses> lit = {};
        std::size_t eccentricity_bins = 1;
        double bin_degrees = 1; // bin b holds b * bin_degrees up to the next; the last one everything beyond
    };
    // Switch distances of folds that are visible from nowhere, and from everywhere.
    static constexpr float never_visible = -1;
    static constexpr float always_visible = std::numeric_limits<float>::max();

    // Fails if sizes do not fit the tree, a class has no row, a length or switch distance is NaN, a length is negative or
    // infinite, or a scale is invalid. A child whose switch distance exceeds its parent's, as in a tree from a damaged
    // file, is safe (it folds with the parent) but costs time: see is_monotone().
    static Result<DistanceCriterion> create(const VertexTree& tree, Parts parts);

    const Parts& parts() const noexcept { return parts_; }
    NodeId interior_count() const noexcept { return interior_count_; } // of the tree that it was made for
    bool uses_silhouettes() const noexcept { return uses_silhouettes_; }
    // Whether no node's switch distance exceeds its parent's. Then a cut watches only its border; else every node above
    // it, too.
    bool is_monotone() const noexcept { return is_monotone_; }
    bool uses_gaze() const noexcept { return parts_.eccentricity_bins > 1; }
    std::uint64_t id() const noexcept { return id_; }                     // identifies these values; copies share it
    std::uint64_t object_id() const noexcept { return object_id_.value; } // identifies this object; copies have another

private:
    struct ObjectId {
        ObjectId() noexcept;
        ObjectId(const ObjectId&) noexcept : ObjectId() {}
        ObjectId& operator=(const ObjectId&) noexcept {
            value = ObjectId().value;
            return *this;
        }
        std::uint64_t value;
    };

    explicit DistanceCriterion(Parts parts);

    Parts parts_;
    NodeId interior_count_ = 0;
    bool uses_silhouettes_ = false, is_monotone_ = false;
    std::uint64_t id_;
    ObjectId object_id_;
};

// A copy of the criterion under which some nodes never fold: not facing away, outside all frusta, or behind occluders.
// `kept`: one bit a node in whole words, lowest first; if a node is kept, its parent must be. With lights, do not use it
// for viewpoints that show nothing at all: there, only outlines keep their nodes. Fails if sizes do not fit the tree.
Result<DistanceCriterion> keeping(const VertexTree& tree, const DistanceCriterion& criterion,
                                  std::span<const std::uint64_t> kept);

// Node extent, as in VDSlib: folds if the support's sphere spans at most this many pixels at the window's centre. Unfolds
// if the eye is inside the sphere.
Result<DistanceCriterion> extent_criterion(const VertexTree& tree, const View& view, double tolerance_pixels);

// Vertex displacement: folds if no supported vertex moves by more than this many pixels, seen from the nearest point of
// the support's sphere. Unfolds if the eye is inside the sphere, except where nothing moves.
Result<DistanceCriterion> displacement_criterion(const VertexTree& tree, const View& view, double tolerance_pixels);

// ---- viewpoints

// A half space: points with normal . x + offset >= 0, in the tree's frame.
struct Plane {
    glm::dvec3 normal = glm::dvec3(0); // unit, pointing inward
    double offset = 0;                 // mesh units
};

// The convex region that a view shows, or the light of a shadow.
struct Frustum {
    std::vector<Plane> planes;
};

// The eye's plane and the window's four sides; no far plane. An orthographic view has the four sides only.
Frustum frustum_of(const VertexTree& tree, const View& view, const Similarity& placement = {});

// The eye that a cut is made for, in the tree's frame (relative to its origin, mesh units).
struct Viewpoint {
    glm::dvec3 eye = glm::dvec3(0);
    // The cut is valid for all eyes within this distance (mesh units) of `eye`: it keeps what any of them needs. For a
    // stereo pair, half of the distance between the eyes, with `eye` in the middle. Costs triangles: everything counts as
    // that much nearer, and as an outline if it may be one from there.
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
// An orthographic view is replaced by eyes 2000 window heights away from the tree's far side, spread over the whole tree.
// So nothing counts as smaller than it is drawn, and nothing counts as facing the eyes unless it does.
Viewpoint viewpoint_of(const VertexTree& tree, const View& view, const Similarity& placement = {},
                       bool window_only = true);
// One viewpoint for both views of a stereo pair: midway between their eyes, with half of their distance as spread. Nodes
// outside both windows fold if `window_only`. One criterion serves both if they share field and window; otherwise make it
// for the one with more pixels per degree. Fails if a view is invalid, only one is orthographic, or their orthographic
// heights differ.
Result<Viewpoint> viewpoint_of_pair(const VertexTree& tree, const View& left, const View& right,
                                    const Similarity& placement = {}, bool window_only = true);

// The eye in the tree's own frame, relative to VertexTree::origin(). For an orthographic view: the eye of viewpoint_of().
glm::dvec3 eye_in_tree(const VertexTree& tree, const View& view, const Similarity& placement);

// Projected size on the line of sight: pixels = angle * height / (2 tan(fov / 2)). For an orthographic view: as seen by the
// eye of viewpoint_of().
double pixels_per_radian(const View& view);

struct InnerSphereOptions {
    int count = 8; // the largest spheres are kept; each costs a nanosecond or less in every test
    int cells =
        96; // of a grid along the tree's longest side, 8 to 512: spheres stay out of cells that the surface touches
};

// Spheres inside a closed surface that nowhere touch it: every line from outside into one crosses the surface first. For
// Viewpoint::occluders, with the eye outside the tree's bounding sphere. Where surfaces intersect themselves, inside is
// where their winding number is not 0. Empty for open surfaces, if VertexTree::check() fails, and if nothing fits in.
// Cost: some 0.1 s, and 50 ns a triangle; up to a dozen bytes for every cell meanwhile.
std::vector<Sphere> inner_spheres(const VertexTree& tree, const InnerSphereOptions& options = {});

// ---- criteria of the caller's own

// For Cut::adjust(): writes the fold cost of each interior node in `nodes`, 0 or more. A node folds if its cost is at most
// 1; NaN unfolds it. Costs must not fall from a node to its parent. Called in batches on the thread that adjusts the cut;
// must not throw. Refers to the caller's object during the call.
using FoldCriterion = FunctionRef<void(const VertexTree&, std::span<const NodeId> nodes, std::span<float> costs)>;

// Costs from here on are infinite: no finite distance hides the fold. They differ so that budgets have an order.
inline constexpr float least_unbounded_cost = 1e30f;
inline bool is_unbounded(float cost) noexcept { return !(cost < least_unbounded_cost); }
inline float unbounded_cost(float order) noexcept { return least_unbounded_cost * (1 + order); }

// For Cut::adjust(): writes for each interior node whether its ring is visible. Nodes that are out fold at no cost. All
// children of a node that is out must be out, and all children of one that is wholly in must be wholly in.
enum class RingVisibility : std::uint8_t { out, partly, wholly_in };
using VisibilityTest =
    Callback<void(const VertexTree&, std::span<const NodeId> nodes, std::span<RingVisibility> visible)>;

} // namespace unseen::vdtree
