// Triangle soups: what the readers return, what the builder takes and what a cut is written as.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <unseen/vdtree/result.h>
#include <unseen/vdtree/texture.h>

namespace unseen::vdtree {

using Index = std::uint32_t;
using Triangle = std::array<Index, 3>;

// A run of triangles that the file held together: an OBJ group or material, a glTF primitive.
struct MeshRange {
    enum class Kind : std::uint8_t { group, material, primitive };
    std::string name;
    Kind kind = Kind::group;
    std::uint64_t first_triangle = 0;
    std::uint64_t triangle_count = 0;
};

// A view of a triangle soup of any topology. Lengths are in mesh units. Attributes are per vertex and
// either empty or as long as `positions`.
struct MeshView {
    std::span<const glm::dvec3> positions;
    std::span<const Triangle> triangles;
    std::span<const glm::vec3> normals = {}; // any length; zero or non-finite: computed from the faces
    std::span<const glm::vec4> colours = {}; // linear RGB and alpha, 0..1
    std::span<const glm::vec2> uvs = {};
    std::span<const MeshRange> ranges = {}; // ordered by first_triangle; may overlap between kinds
    TextureView texture = {};               // over the whole mesh by its UVs, multiplied with the colours; empty: none
    std::span<const std::byte> document = {}; // what else its file said, for who wrote it here; trees keep it unread
};

// A triangle soup that owns its arrays.
struct Mesh {
    std::vector<glm::dvec3> positions;
    std::vector<Triangle> triangles;
    std::vector<glm::vec3> normals;
    std::vector<glm::vec4> colours;
    std::vector<glm::vec2> uvs;
    std::vector<MeshRange> ranges;
    Texture texture;
    std::vector<std::byte> document;

    MeshView view() const { return {positions, triangles, normals, colours, uvs, ranges, texture.view(), document}; }
};

// Checks what every algorithm relies on: finite positions, indices in range, attributes as long as the
// positions, ranges within the triangles, a texture of as many texels as it says, with UVs. The error names the first
// offender.
Result<void> validate(const MeshView& mesh);

// Removes the triangles that use a vertex twice, shrinks the ranges to match, and returns how many went.
// Triangles of zero area with three different vertices stay.
std::uint64_t drop_degenerate_triangles(Mesh& mesh);

// What the surface is, found out and not assumed, after welding equal positions. Cost: a sort of the edges.
enum class Closedness : std::uint8_t {
    open,           // a boundary, a non-manifold or an inconsistently oriented edge, or no volume
    closed_outward, // every edge has two faces that run it in opposite ways, and the volume is positive
    closed_inward,  // the same with a negative volume: inside out
};

} // namespace unseen::vdtree
