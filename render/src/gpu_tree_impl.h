// What trees and cuts hold on the GPU.
#pragma once

#include <glm/common.hpp>

#include <unseen/render/draw.h>

#include "camera.h"
#include "context_impl.h"
#include "gpu_indices.h"
#include "surface_texture.h"
#include "vertex_mover.h"

namespace unseen::render {

// A box around vertices in the unit frame; empty at first.
struct Box {
    glm::vec3 low = glm::vec3(std::numeric_limits<float>::infinity()), high = -low;
    void include(glm::vec3 p) { low = glm::min(low, p), high = glm::max(high, p); }
    std::array<glm::dvec3, 8> corners() const {
        std::array<glm::dvec3, 8> all;
        for (std::size_t i = 0; i < 8; ++i)
            all[i] = glm::vec3(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z);
        return all;
    }
};

// Vertices that are drawn elsewhere than where they belong.
struct Glides {
    std::vector<VertexMove> moves;
    std::uint64_t version = 0; // of the tree's, another one for all moves; 0: none
};

struct GpuTree::Impl {
    Impl(const Context& context_, const vdtree::VertexTree& tree_);

    Result<void> upload();
    Result<void> need_mover();
    Result<void> need_lit_vertices();
    Vertex vertex(std::size_t i) const;

    // Puts the vertices where a cut wants them: a cut is drawn right after. Returns the bytes that were uploaded.
    std::uint64_t put(const Glides& glides);

    Context context; // first, and so gone last
    vdtree::VertexTree tree;
    UnitFrame frame;
    Buffer vertices;
    VertexArray arrays;                                                    // each draw puts its cut's index buffer in
    Box box;                                                               // around all vertices
    glm::vec4 lowest_shade = glm::vec4(std::numeric_limits<float>::max()); // of all vertices
    glm::vec4 highest_shade = glm::vec4(std::numeric_limits<float>::lowest());
    glm::vec4 highest_hue = glm::vec4(1);  // of all vertices: the shade over its luminance
    std::optional<SurfaceTexture> texture; // made where the tree has one
    std::optional<Buffer> lit_vertices;    // made when lights are first drawn with
    std::optional<VertexMover> mover;      // made when a vertex is first moved
    std::vector<std::uint32_t> moved;      // that are not where they belong, ascending
    std::uint64_t shown_version = 0;       // of the glides that the vertices have
    std::uint64_t last_version = 0;
    ContextGuard guard;
};

struct GpuCut::Impl {
    explicit Impl(const GpuTree& tree_)
        : tree(tree_), indices(tree.context().impl().programs, tree.context().impl().makes_indices),
          box(tree.impl().box), guard(tree.context()) {}

    Result<void> follow(const vdtree::Cut& cut, std::span<const vdtree::MovedVertex> moved);

    GpuTree tree; // first, and so gone last
    GpuIndices indices;
    Glides glides;
    Box box; // around all vertices, and around wherever they were moved
    std::uint64_t uploaded_bytes = 0;
    ContextGuard guard;
};

} // namespace unseen::render
