// Triangle soups: readers return them, the builder takes them, and cuts are written as them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <unseen/vdtree/result.h>

namespace unseen::vdtree {

using Index = std::uint32_t;
using Triangle = std::array<Index, 3>;
constexpr bool uses_a_vertex_twice(const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; }

// RGB encoded as sRGB, and alpha: what is drawn of it, see TextureView::blends; behind the rest is seen what lies there.
using Texel = std::array<std::uint8_t, 4>;

// What lies beyond the coordinates 0..1: the image again, its border, or the image mirrored at every border.
enum class Wrap : std::uint32_t { repeat, clamp, mirror };

// Rows of texels. Row 0 is at v = 0, and texel (x, y) covers u from x / width to (x + 1) / width, v likewise. Formats whose
// v runs upward (OBJ, PLY) are stored from the bottom row, others (glTF) from the top.
struct TextureView {
    std::uint32_t width = 0, height = 0;
    Wrap wrap_u = Wrap::repeat, wrap_v = Wrap::repeat;
    std::span<const Texel> texels = {};
    bool blends = false; // alpha is the share of light that texels stop; else texels are there from a half on
    // Further maps of the same texels, or empty.
    std::span<const Texel> emission = {}; // RGB, sRGB: light that is added, whatever lights the surface; 1 is white
    // A normal map: x, y and z from -1 to 1 as 0 to 255, along growing u, growing v and the vertices' normals.
    std::span<const Texel> relief = {};

    bool empty() const noexcept { return texels.empty(); }
};

struct Texture {
    std::uint32_t width = 0, height = 0;
    Wrap wrap_u = Wrap::repeat, wrap_v = Wrap::repeat;
    std::vector<Texel> texels;
    bool blends = false;
    std::vector<Texel> emission = {}, relief = {};

    TextureView view() const { return {width, height, wrap_u, wrap_v, texels, blends, emission, relief}; }
};

inline constexpr std::uint32_t largest_texture_side = 16384; // texels; what graphics processors take

// An empty texture is valid. Otherwise sides must be 1 to largest_texture_side, and there must be width x height texels, of
// further maps as many or none.
Result<void> validate(const TextureView& texture);

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
    TextureView texture = {};               // over the whole mesh by its UVs, multiplied with the colours; may be empty
    std::span<const std::byte> document = {}; // the rest of its file, in the reader's own form; trees keep it unread
    // By triangle, or empty: the file does not state any. Decides how computed normals are shared: triangles of one group
    // share at any angle, those of different groups never, and those of group 0 are flat.
    std::span<const Index> smoothing = {};
    // By vertex, or empty: a number that vertices share whose values in the document are equal. Others stay apart, so that
    // cuts can be written with these values.
    std::span<const Index> further = {};
    // By vertex, or empty: what is to be kept more than the rest. A fold counts as if it were so many times as large, from 1
    // (as usual) to largest_fold_weight; or never_folds: the vertex is in every cut, where it was, and triangles with two
    // such corners are. Of vertices at one position the largest weight counts.
    std::span<const float> weights = {};
};
inline constexpr float largest_fold_weight = 1000, never_folds = std::numeric_limits<float>::infinity();
inline bool is_fold_weight(float weight) {
    return (weight >= 1 && weight <= largest_fold_weight) || weight == never_folds;
}

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
    std::vector<Index> smoothing;
    std::vector<Index> further;
    std::vector<float> weights;

    MeshView view() const {
        return {positions,      triangles, normals,   colours, uvs,    ranges,
                texture.view(), document,  smoothing, further, weights};
    }
};

// Checks what every algorithm relies on: finite positions, indices in range, attributes as long as the positions, ranges
// within the triangles, smoothing groups for all triangles or none, a valid texture, and UVs where there is one. The error
// names the first offender.
Result<void> validate(const MeshView& mesh);

// Removes the triangles that use a vertex twice, shrinks the ranges to match, and returns how many went.
// Triangles of zero area with three different vertices stay.
std::uint64_t drop_degenerate_triangles(Mesh& mesh);

// Whether a surface is closed, as measured after welding equal positions.
enum class Closedness : std::uint8_t {
    open,           // a boundary, a non-manifold or an inconsistently oriented edge, or no volume
    closed_outward, // every edge has two faces that run it in opposite ways, and the volume is positive
    closed_inward,  // the same with a negative volume: inside out
};

// How normals were found where the mesh has none of its own: edges of a larger angle are hard.
struct Creases {
    enum class Source : std::uint8_t {
        file,  // the mesh has normals or smoothing groups everywhere
        asked, // the caller chose the angle
        rule,  // the angle follows from the mesh: see BuildOptions::crease
    };
    Source source = Source::file;
    float degrees = 180; // 180: all edges are smooth
    bool operator==(const Creases&) const = default;
};

} // namespace unseen::vdtree
