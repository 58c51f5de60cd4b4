// The arrays of a vertex tree, as the builder fills them and the file stores them. See <vdtree/vertex_tree.h>.
#pragma once

#include <memory>
#include <vector>

#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

// What another light leaves as it is.
struct TreeGeometry {
    // By node: interior nodes, then leaves.
    std::vector<NodeId> parents;
    std::vector<glm::vec3> positions;
    std::vector<PackedNormal> normals;
    std::vector<glm::vec4> colours;
    std::vector<glm::vec2> uvs;

    // By interior node.
    std::vector<Index> first_leaf, leaf_end;
    std::vector<NodeId> subtree_end;
    std::vector<Index> first_triangle; // one longer
    std::vector<NodeBounds> bounds;
    std::vector<Sphere> support_spheres;
    std::vector<std::uint32_t> mask_at; // into mask_records
    std::vector<float> displacement;

    std::vector<std::uint8_t> mask_records; // see mask_pool.h

    // By triangle.
    std::vector<Triangle> triangles;
    std::vector<Index> source_triangles; // empty without ranges

    std::vector<Index> source_vertices; // by leaf
    std::vector<MeshRange> ranges;
    glm::dvec3 origin = glm::dvec3(0);
    Sphere bounding_sphere;
    std::uint64_t dropped_triangles = 0;
    Closedness closedness = Closedness::open;
};

// What depends on the light.
struct TreeLuminance {
    Light light;
    bool prelit = false;
    std::vector<Unorm16> luminance;            // by node
    std::vector<PackedRange> support_range;    // by interior node, and so on
    std::vector<PackedRange> ring_range;
    std::vector<Unorm16> adaptation;
    LuminanceRange range;
};

struct VertexTree::Data {
    std::shared_ptr<const TreeGeometry> geometry;
    TreeLuminance light;
};

// Luminance of every node and the bounds over support and ring, bottom-up. Cost: one pass over triangles and nodes.
TreeLuminance derive_luminance(const TreeGeometry& geometry, const Light& light, bool prelit);

// Relative luminance of one vertex.
float vertex_luminance(glm::vec3 normal, const glm::vec4* colour, const Light& light, bool prelit);

} // namespace unseen::vdtree
