// The wedges of all nodes, and what they look like.
//
// Two leaves under a node are of one wedge if corners of one triangle join them; a triangle that has vanished joins its
// corners, too. Within each class of attributes (normals, texture coordinates, colours) wedges that had a value in
// common at some place go on sharing it, so that a hard edge stays continuous in the texture, and a seam in the normal.
// The value of a class at a proxy is that of a quadric (Garland and Heckbert 1998; Hoppe 1999): the weighted mean of
// the linear functions that the class has on its triangles, where the proxy is.
#pragma once

#include <unseen/vdtree/internal/tree_parts.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::vdtree {

// The mesh in the order of the tree: places, and the leaves there place by place.
struct LeafMesh {
    std::span<const Index> first_leaf;     // by place, one longer; empty: a leaf a place
    std::span<const Triangle> triangles;   // over leaves, in the order in which they vanish
    std::span<const Index> first_triangle; // by interior node, one longer
    // By leaf.
    std::span<const glm::vec3> normals; // unit length or zero
    std::span<const glm::vec2> uvs;     // empty if the mesh has none; likewise the next
    std::span<const glm::vec4> colours;
    std::span<const Index> materials;
    std::span<const Index> further = {}; // numbers of values that are not drawn
};

// By wedge.
struct NodeWedges {
    WedgeArrays<Vector> links; // empty where every node has one wedge
    std::vector<glm::vec3> positions;
    std::vector<PackedNormal> normals;
    std::vector<glm::vec2> uvs;
    std::vector<glm::vec4> colours;
    std::vector<Index> leaf_numbers; // by leaf as given: its number in the tree; empty: the same
};

// `shape` and `parts`: over places. `positions`: by node. Cost: linear but for places of very many leaves; parallel.
NodeWedges find_wedges(const TreeShape& shape, const TreeParts& parts, std::span<const glm::vec3> positions,
                       const LeafMesh& mesh, const Ancestors& ancestors);

} // namespace unseen::vdtree
