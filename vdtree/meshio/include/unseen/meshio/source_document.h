// Everything that a mesh file says besides triangles: nodes, materials, textures, images, the attributes of vertices
// before materials were applied, and further values of vertices. It travels with the mesh and its tree as bytes
// (MeshView::document), so that a cut can be written with all of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include <glm/mat2x2.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include <unseen/vdtree/result.h>

namespace unseen::meshio {

// ---- further values of vertices: scalars of a simulation, labels, numbers

// The numbers are those in files.
enum class ValueType : std::uint32_t {
    int8 = 1,
    uint8 = 2,
    int16 = 3,
    uint16 = 4,
    int32 = 5,
    uint32 = 6,
    int64 = 7,
    uint64 = 8,
    float32 = 9,
    float64 = 10
};

constexpr std::size_t byte_size(ValueType type) {
    constexpr std::size_t sizes[] = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
    return sizes[static_cast<std::size_t>(type) - 1];
}
const char* name_of(ValueType type); // "int8", "float32", ...
bool is_integer(ValueType type);

struct VertexArray {
    // What the array is for. The mesh holds the values of all roles but `value`; here only their name is kept.
    enum class Role : std::uint32_t { value = 0, normals = 1, colours = 2, uvs = 3 };

    std::string name;
    ValueType type = ValueType::float32;
    std::uint32_t components = 1; // at least 1
    Role role = Role::value;
    std::vector<std::byte> values = {}; // by vertex its components, in the host's byte order

    std::size_t tuple_bytes() const { return byte_size(type) * components; }
    std::size_t size() const { return values.size() / tuple_bytes(); } // vertices
    // Preconditions: vertex < size(), component < components. 64-bit integers are rounded.
    double number(std::size_t vertex, std::uint32_t component = 0) const;
};

// The finite values of one component; low > high if there are none.
struct ValueRange {
    double low = 0, high = 0;
    std::uint64_t not_finite = 0; // number of NaN and infinite values
};
ValueRange range_of(const VertexArray& array, std::uint32_t component);

// ---- documents

// An affine map of texture coordinates: linear * uv + offset.
struct UvMap {
    glm::dmat2 linear = glm::dmat2(1);
    glm::dvec2 offset = glm::dvec2(0);

    glm::dvec2 operator()(glm::dvec2 uv) const { return linear * uv + offset; }
    bool operator==(const UvMap&) const = default;
};

struct SourceDocument {
    enum class Format : std::uint32_t {
        gltf = 1,
        obj = 2,
        table = 3 // PLY and VTP: `arrays`, and nothing else
    };

    // A file that lies in the mesh file or beside it: the images of glTF, in their order; the images and material
    // libraries that an OBJ names.
    struct File {
        enum class Use : std::uint32_t { image = 0, library = 1 };
        Use use = Use::image;
        std::string uri = {};                               // relative to the mesh file; empty: lies in it
        std::shared_ptr<const std::string> bytes = nullptr; // null: it was not found
    };

    // Triangles that belong together: one primitive of a glTF node, or one object, group and material of an OBJ file.
    struct Part {
        std::int32_t node = -1, mesh = -1, primitive = -1;  // glTF; -1: not set
        std::string object = {}, group = {}, material = {}; // OBJ; empty: not set
        glm::dmat4 to_world = glm::dmat4(1);
        std::uint32_t channels = 0; // bit i: its vertices have channel i
        UvMap drawn_uv = {}; // from its texture coordinates (in glTF the set of the colour texture) to the mesh's
        glm::vec4 colour = glm::vec4(1); // the mesh's colours are COLOR_0 times this
    };

    struct Run {
        std::uint64_t first_triangle = 0; // of the mesh; up to the next run's
        std::uint32_t part = 0;
    };

    // An attribute as in the file, in the frame of its node, by vertex of the mesh; 0 if the vertex's part lacks it.
    struct Channel {
        std::string name; // as in glTF: NORMAL, TEXCOORD_0, COLOR_0, ...
        std::uint32_t components = 0;
        std::vector<float> values;
    };

    Format format = Format::gltf;
    std::string json = {}; // glTF: the document without geometry
    std::vector<File> files = {};
    std::vector<Part> parts = {};
    std::vector<Run> runs = {}; // ascending, from triangle 0 on
    std::vector<Channel> channels = {};
    std::vector<std::uint32_t> vertex_parts = {}; // by vertex of the mesh: a part that uses it
    std::vector<VertexArray> arrays = {};         // all as long as the mesh has vertices; names are unique
};

// MeshView::further: by vertex of the mesh, the first with the same values and attributes in the document. Empty if the
// document has no values. The vertices' parts must be known. Cost: one pass over the values.
std::vector<std::uint32_t> further_values(const SourceDocument& document);

// As bytes that unpack() takes; docs/file-format.md describes them.
std::vector<std::byte> pack(const SourceDocument& document);

// Takes any bytes. Fails if they are not what pack() writes, contradict themselves, or hold matrices that are not
// finite. Allocates no more than the bytes hold.
Result<SourceDocument> unpack(std::span<const std::byte> bytes);

} // namespace unseen::meshio
