// Builds vertex trees: a clusterer decides which vertices merge, everything else is derived from the mesh.
#pragma once

#include <string_view>
#include <vector>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

// A hierarchy over n vertices: clusters 0 .. n-1 are the vertices themselves, the others are numbered in the order
// in which they were made, so a cluster's parent has a higher number. The last cluster is the root.
struct Clustering {
    std::vector<Index> parents;        // by cluster; the root's own number stands for "none"
    std::vector<glm::dvec3> positions; // by cluster from n on: the proxy's position; empty: the area-weighted mean
    // By cluster from n on: how far the surface that the proxy stands for strays from it, in mesh units, luminance and
    // attributes counted in; at least as much as the children's. Simplifying by this keeps the most shape for the
    // triangles. Empty: not known.
    std::vector<float> deviations = {};
};

struct BuildOptions;
class Team; // see team.h

// What a clusterer is given, for the time of its call: the mesh, and per-vertex luminance (relative, 0..1), unit
// normals and area weights.
struct ClusterInput {
    MeshView mesh;
    std::span<const float> luminance;
    std::span<const glm::vec3> normals;
    std::span<const double> areas; // a third of the area of the triangles around, mesh units squared; 0: unreferenced
    std::span<const Index> coincident; // by vertex: the first vertex at the same position
};

// A user's own clustering. Called once, on the calling thread. Every vertex must reach the root; clusters with one
// child are removed; clusters may have any number of children.
using Clusterer = FunctionRef<Result<Clustering>(const ClusterInput&)>;

// Octree over the bounding cube, subdivided until a cell holds one position; any soup; fast. Depth follows the data,
// not a path code: cells that do not split their points are passed over, and coincident vertices share a node.
// Parallel; the result does not depend on the threads. Memory: 32 bytes a vertex.
Result<Clustering> cluster_octree(const ClusterInput& input, const Progress& progress = {});

// Contraction of vertex pairs in the order of their quadric error over position, luminance and the mesh's own
// attributes (Garland and Heckbert 1997, 1998; Hoppe 1999), with boundary and seam terms and optimal proxies; pairs are
// the edges, and, for parts that no edge connects, near neighbours. The vertices are parted by space, and the parts
// contracted in parallel and then joined; the result depends on the mesh alone. Fills deviations. Memory: about 100
// bytes a triangle. With a team, of which this must be member 0, the others contract their share of the parts.
Result<Clustering> cluster_quadric(const ClusterInput& input, const Progress& progress = {}, Team* team = nullptr);

enum class ClustererKind { quadric, octree };
std::string_view name(ClustererKind kind);

struct BuildOptions {
    ClustererKind clusterer = ClustererKind::quadric;
    Light light = {};
    // What colours and textures are. False: reflectance, which is multiplied with `light`. True: light that is baked
    // in; they are drawn as they are. Without either, the default albedo is lit.
    bool prelit = false;
    int threads = 0;                  // 0: as many as there are cores. The tree does not depend on it.
    std::uint64_t dropped_before = 0; // triangles that a reader has dropped; counted with the tree's
    Progress progress = {};
    // Other processes that help to analyse the mesh and to cluster it, by help_build_tree() with the same mesh and
    // options; this is member 0. The team is the caller's and must outlive the calls that get it. Only where
    // `clusterer` is quadric is there work for them. The tree does not depend on it. Do not cancel then: the others
    // would wait for ever.
    Team* team = nullptr;
    int threads_alone = 0; // like `threads`, for what comes after the clustering, when the team's others have gone
};

// Drops triangles that use a vertex twice (counted in the tree); fails where none is left, on non-finite positions and
// on indices out of range. Memory: about 220 bytes a triangle while building.
Result<VertexTree> build_tree(const MeshView& mesh, const BuildOptions& options = {});
// Fails with a team, too, for there is nothing to help a clustering of one's own with.
Result<VertexTree> build_tree(const MeshView& mesh, const Clusterer& clusterer, const BuildOptions& options = {});

// Whether build_tree() would take these, without building anything.
Result<void> check_buildable(const MeshView& mesh, const BuildOptions& options = {});

// The share of a team's other members in build_tree(); returns when theirs is done. Fails like build_tree() on bad
// input.
Result<void> help_build_tree(const MeshView& mesh, const BuildOptions& options);

} // namespace unseen::vdtree
