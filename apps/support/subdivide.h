// Larger meshes from smaller ones, for trying out and measuring what size does.
#pragma once

#include <cstdint>
#include <optional>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/mesh.h>

namespace unseen::app {

struct SubdivideOptions {
    int times = 0; // every triangle becomes four, so many times
    std::optional<std::uint64_t> triangles =
        {};                       // instead: as often as it takes to come near to, and not above, so many
    double noise = default_noise; // largest displacement of a new vertex, as a share of its edge's length
    std::uint64_t seed = 1;
    Progress progress = {};

    static constexpr double default_noise = 0.02;
};

// The largest --times: from there on a single triangle outgrows every index.
inline constexpr int most_subdivisions = 16;

// Splits edges at their midpoints, each edge once for all triangles around it, and moves the new vertices along the
// surface's normal by hashed noise. Vertices at one position stay at one position, so that no crack opens, not even
// where vertices are doubled; a mesh in float positions stays in floats. Colours, UVs and ranges are kept, normals
// (which the noise changes) left out. For a count of triangles between two rounds, the longest edges alone are split in
// the last one. Deterministic. Memory: the result, and about 80 bytes for each triangle before the last round. Fails on
// an invalid mesh, on a count below the mesh's own, where indices run out, and when cancelled.
Result<vdtree::Mesh> subdivide(vdtree::Mesh mesh, const SubdivideOptions& options);

} // namespace unseen::app
