// Fold criteria in distance form: fold where the eye is far enough away. What a cut needs to follow a moving eye at a
// cost that goes with what changes.
//
// A node is unfolded while
//     |eye - c| - R < D(node, silhouette, eccentricity) / threshold,
//     D = length * switch_distance[class][eccentricity],
// or while the class's least cost is above the threshold. c and R are its ring's (or support's) sphere. For silhouettes
// D is the larger of that and their own length * switch_distance.
//
// The class says how visible a fold of a given extent is. A node has one for when its ring faces the eye from one side,
// and another for when it is, or may be, a silhouette. Spheres and lengths nest and classes grow up the tree. So D is
// at least its children's for equal arguments, and a parent's arguments are never the better ones: a cut made by such
// tests is closed upward. How far the eye may move before a test can change follows from the same numbers, so no node
// is tested before its time.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include <unseen/vdtree/lighting.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::vdtree {

// Which row of the table of switch distances a node uses.
struct FoldClass {
    std::uint16_t interior = 0;   // all of the ring faces the eye, or faces away
    std::uint16_t silhouette = 0; // the ring is, or may be, an outline, also where it has an irregular edge
};

// What relative luminances come to, in a unit of the criterion's own.
struct AbsoluteScale {
    double offset = 0; // of 0; 0 or more
    double span = 1;   // what 1 adds; above 0

    double of(double relative) const { return offset + span * relative; }
};

// Where lights that may move light the tree, classes follow from what they make of a node, as of the viewpoint's
// lighting: interior ones by the range of its vertices' luminances, adapted to the brightest of these. Their table's
// rows are laid out by the library, whose own modules make such criteria.
struct LitClasses {
    std::shared_ptr<const LightBounds> bounds; // of the tree
    AbsoluteScale scale;
    std::uint16_t silhouette = 0; // the class of all outlines
};

class DistanceCriterion {
public:
    enum class Spheres : std::uint8_t { ring, support };

    struct Parts {
        Spheres spheres = Spheres::ring;
        // By interior node; empty: class 0 for all, whatever they face.
        std::vector<FoldClass> classes = {};
        // By interior node, mesh units, 0 or more; empty: the spheres' radii.
        std::vector<float> lengths = {};
        // Likewise, for the silhouettes' classes; empty: lengths.
        std::vector<float> silhouette_lengths = {};
        // By interior node: the directions that make it a silhouette; empty: the tree's.
        std::vector<NormalSlabs> facing = {};
        // [class * eccentricity_bins + bin]: from how many lengths away folds go unseen; not growing with the bin.
        std::vector<float> switch_distance = {};
        // Of the same shape: no fold of this class costs less, from however far, for drawn it is at least a pixel.
        // Empty: 0 for all.
        std::vector<float> least_cost = {};
        // With lights, in place of `classes`; switch distances are to grow with contrasts and luminances.
        std::optional<LitClasses> lit = {};
        std::size_t eccentricity_bins = 1;
        double bin_degrees = 1; // bin b holds b * bin_degrees up to the next; the last one everything beyond
    };
    // Switch distances of folds that can be seen from nowhere, and from everywhere.
    static constexpr float never_visible = -1;
    static constexpr float always_visible = std::numeric_limits<float>::max();

    // Fails where sizes do not fit the tree, a class has no row, a length or switch distance is NaN, a length is
    // negative or infinite, or a scale is none. A child whose switch distance exceeds its parent's, as in a tree from a
    // damaged file, is safe (it is folded with the parent) but costs time: see is_monotone().
    static Result<DistanceCriterion> create(const VertexTree& tree, Parts parts);

    const Parts& parts() const noexcept { return parts_; }
    NodeId interior_count() const noexcept { return interior_count_; } // of the tree that it was made for
    bool uses_silhouettes() const noexcept { return uses_silhouettes_; }
    // Whether no node's switch distance exceeds its parent's. Then a cut needs to watch only its border; else every
    // node above it, too.
    bool is_monotone() const noexcept { return is_monotone_; }
    bool uses_gaze() const noexcept { return parts_.eccentricity_bins > 1; }
    std::uint64_t id() const noexcept { return id_; } // of these values; a copy shares it
    // Of this object: a copy has another one, wherever it lies.
    std::uint64_t object_id() const noexcept { return object_id_.value; }

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

// The criterion with nodes that never fold: not where they face away, nor out of all frusta, nor behind occluders. A bit
// each, of whole words, lowest first; a parent of one should be one.
// The cut of a criterion with lights must not be one of a viewpoint that shows nothing at all: there, only outlines keep
// their nodes. Fails where sizes are not the tree's. Cost: a copy of the criterion.
Result<DistanceCriterion> keeping(const VertexTree& tree, const DistanceCriterion& criterion,
                                  std::span<const std::uint64_t> kept);

// A half space: points with normal . x + offset >= 0, in the tree's frame.
struct Plane {
    glm::dvec3 normal = glm::dvec3(0); // unit, pointing inward
    double offset = 0;                 // mesh units
};

// The convex region that a view, or the light of a shadow, shows.
struct Frustum {
    std::vector<Plane> planes;
};

// The eye's plane and the window's four sides; no far plane. Of an orthographic view: the four sides.
Frustum frustum_of(const VertexTree& tree, const View& view, const Similarity& placement = {});

// Where a cut is looked at from, in the tree's frame (relative to its origin, mesh units).
struct Viewpoint {
    glm::dvec3 eye = glm::dvec3(0);
    // The cut does for all eyes within this distance (mesh units) of `eye`: what one of them needs stays. Half of the
    // distance between two eyes, `eye` being in their middle. Costs triangles: everything counts as so much nearer, and
    // as an outline where it might be one from there.
    double eye_spread = 0;
    std::optional<glm::dvec3> gaze = {}; // unit direction from the eye; none: everything counts as looked at
    std::vector<Frustum> frusta = {};    // nodes outside all of them fold; none: everything counts as seen
    // Nodes wholly behind one of these fold, also where a frustum shows them: spheres that nothing can be seen through
    // from the eye, as those of inner_spheres(). The eye is outside of all. Not for criteria of support spheres, which
    // do not contain all that a fold changes.
    std::vector<Sphere> occluders = {};
    Lighting lighting = {}; // for criteria with lit classes; a valid one there
};

// Where a cut for the view is looked at from; with the view's frustum if `window_only`: what lies outside folds.
//
// An orthographic view is taken as that of eyes 2000 windows' heights away from the tree's far side, with a spread that
// covers the whole tree. So nothing counts as smaller than it is drawn, and nothing as facing the eyes that does not.
Viewpoint viewpoint_of(const VertexTree& tree, const View& view, const Similarity& placement = {},
                       bool window_only = true);
// One for the two views of a stereo pair: from between their eyes, with half of their distance for a spread, and what is
// outside of both windows folds. One criterion does for both if they share field and window; else make it for the one of
// more pixels to a degree. Fails where a view is not valid, or one is orthographic and the other is not, or of another
// height.
Result<Viewpoint> viewpoint_of_pair(const VertexTree& tree, const View& left, const View& right,
                                    const Similarity& placement = {}, bool window_only = true);

// Node extent, VDSlib's own measure: the support's sphere is seen under an angle of so many pixels at the window's
// centre at most. Unfolds where the eye is inside.
Result<DistanceCriterion> extent_criterion(const VertexTree& tree, const View& view, double tolerance_pixels);

// Vertex displacement: the largest movement of a supported vertex, seen from the nearest point of the support's sphere,
// is of so many pixels at most. Unfolds where the eye is inside, but never where nothing moves.
Result<DistanceCriterion> displacement_criterion(const VertexTree& tree, const View& view, double tolerance_pixels);

} // namespace unseen::vdtree
