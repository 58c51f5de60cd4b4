// Builds vertex trees: a clusterer decides which vertices merge, everything else is derived from the mesh.
#pragma once

#include <optional>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

// A hierarchy over the n vertices of ClusterInput::mesh: clusters 0 .. n-1 are the vertices themselves, the others are
// numbered in the order in which they were made, so a cluster's parent has a higher number. The last cluster is the
// root.
struct Clustering {
    std::vector<Index> parents;        // by cluster; the root is its own parent
    std::vector<glm::dvec3> positions; // by cluster from n on: the proxy's position; empty: area-weighted means
    // By cluster from n on: how far the surface strays from its proxy, in mesh units, including luminance and
    // attributes; at least the children's. Simplifying by this keeps the most shape for the triangles. May be empty.
    std::vector<float> deviations = {};
};

struct BuildOptions;
class Team; // several processes that build one tree together; for the command

// What the corners of the triangles use: distinct tuples of position, normal, texture coordinates, colour and material.
// Arrays are by leaf. Without seams and hard edges leaves are the vertices of ClusterInput::mesh.
struct LeafView {
    std::span<const Triangle> triangles;   // over leaves, in the order of ClusterInput::mesh.triangles
    std::span<const Index> places;         // the vertex of ClusterInput::mesh
    std::span<const float> luminance;      // relative, 0..1
    std::span<const glm::vec3> normals;    // unit length or zero
    std::span<const glm::vec4> colours;    // empty if the mesh has none
    std::span<const glm::vec2> uvs;        // likewise
    std::span<const Index> materials = {}; // a number for each; empty if there is one for all
    bool has_own_normals = false;          // from the mesh, rather than from its faces
};

// A clusterer's input, valid during the call. The vertices of `mesh` are the distinct positions that triangles use, and
// its triangles have three different ones each; it has no attributes. The other arrays are by vertex of it.
struct ClusterInput {
    MeshView mesh;
    std::span<const float> luminance;   // relative, 0..1
    std::span<const glm::vec3> normals; // unit length or zero
    std::span<const double> areas;      // a third of the area of the triangles around it, mesh units squared
    LeafView leaves;
    // Factors of what folds cost, see MeshView::weights; empty: 1 for all. What becomes of vertices that never fold
    // does not matter, for they are taken out of their clusters.
    std::span<const float> weights = {};
};

// A clusterer of the caller's own. Called once, on the calling thread. Every vertex must reach the root. Clusters may
// have any number of children; those with one child are removed.
using Clusterer = FunctionRef<Result<Clustering>(const ClusterInput&)>;

// Fast clustering by an octree over the bounding cube, subdivided until a cell holds one position. Cells that do not
// split their points are skipped, so any depth works. Parallel. Memory: 32 bytes a vertex.
Result<Clustering> cluster_octree(const ClusterInput& input, const Progress& progress = {});

// Contracts pairs of places in the order of their quadric error over position, normals, texture coordinates and colours
// with luminance (Garland and Heckbert 1997, 1998; Hoppe 1999), with boundary and seam terms and optimal proxies. Pairs
// are the edges, and near neighbours where no edge connects two parts. Space is divided into blocks that are contracted
// in parallel and then joined; the blocks depend on the mesh alone. Fills deviations. Memory: about 100 bytes a
// triangle. With a team, whose members all call this with the same input, each contracts its share of the blocks, and
// member 0 gets the result, the others an empty one.
Result<Clustering> cluster_quadric(const ClusterInput& input, const Progress& progress = {}, Team* team = nullptr);

enum class ClustererKind { quadric, octree };
std::string_view name(ClustererKind kind);

struct BuildOptions {
    ClustererKind clusterer = ClustererKind::quadric;
    Light light = {};
    // Whether light is baked into the colours and the texture, so that they are drawn unlit. Otherwise they are
    // reflectance and `light` lights them. Meshes without either have the default albedo, lit.
    bool prelit = false;
    // Where the mesh states neither normals nor smoothing groups, edges between faces at a larger angle are hard, from
    // 0 (all) to 180 degrees (none). Not given: 30, or 60 if the mesh looks organic, which 30 would facet: if it has
    // more than 2.5 times as many edges above 30 degrees as above 60. Then no edge is hard if those above 60 degrees
    // are at places with less than 0.5% of the area, as noise of scans is.
    std::optional<float> crease = {};
    // Like MeshView::weights, for the ends of edges that one triangle has; seams are no such edges. If borders never fold,
    // meshes that share one still fit each other however each is simplified: positions there stay the mesh's, in double
    // precision.
    float border_weight = 1;
    int threads = 0;                  // 0: one for each core. The tree does not depend on it.
    std::uint64_t dropped_before = 0; // triangles that a reader dropped; added to the tree's count
    Progress progress = {};
    // Other processes that help to cluster the mesh, with the clusterer `quadric` only: each calls help_build_tree()
    // with the same mesh and options, and this process is member 0. The team must outlive the call. The tree does not
    // depend on it. Do not cancel then: the others would wait for ever.
    Team* team = nullptr;
    int threads_alone = 0; // like `threads`, for the work after the clustering, when the other members are done
};

// Drops triangles with two corners at one position and counts them in the tree, and leaves out vertices that no
// triangle uses. Fails if no triangle is left, on non-finite positions, and on indices out of range. Memory: about 220
// bytes a triangle while building.
Result<VertexTree> build_tree(const MeshView& mesh, const BuildOptions& options = {});
// Fails with a team, which could not help the caller's own clusterer.
Result<VertexTree> build_tree(const MeshView& mesh, const Clusterer& clusterer, const BuildOptions& options = {});

// Fails if build_tree() would reject its arguments, without building anything.
Result<void> check_buildable(const MeshView& mesh, const BuildOptions& options = {});

// The work of a team's other members in build_tree(). Fails like build_tree() on bad input.
Result<void> help_build_tree(const MeshView& mesh, const BuildOptions& options);

} // namespace unseen::vdtree
