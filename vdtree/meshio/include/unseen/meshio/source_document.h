// What a mesh file says beyond its triangles: nodes, materials, textures, images, what its vertices had before
// materials were laid over them, and values that they have besides. It goes with the mesh and its tree as bytes
// (MeshView::document), so that a cut can be written with all of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <glm/mat2x2.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include <unseen/meshio/vertex_array.h>
#include <unseen/vdtree/result.h>

namespace unseen::meshio {

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
        table = 3 // of PLY and VTK: `arrays`, and nothing else
    };

    // What lies in the mesh file, or beside it: of glTF its images, in their order; of OBJ the images and libraries
    // that it names.
    struct File {
        enum class Use : std::uint32_t { image = 0, library = 1 };
        Use use = Use::image;
        std::string uri = {};                               // relative to the mesh file; empty: lies in it
        std::shared_ptr<const std::string> bytes = nullptr; // null: not at hand
    };

    // Triangles that belong together: of one primitive of a glTF node, or of one object, group and material of an OBJ
    // file.
    struct Part {
        std::int32_t node = -1, mesh = -1, primitive = -1;  // of glTF; -1: none
        std::string object = {}, group = {}, material = {}; // of OBJ; empty: none
        glm::dmat4 to_world = glm::dmat4(1);
        std::uint32_t channels = 0; // bit i: its vertices have channel i
        UvMap drawn_uv = {};        // from its texture coordinates to the mesh's own; of glTF, those of the set that
                                    // the colour texture of its material lies by
        glm::vec4 colour = glm::vec4(1); // what COLOR_0 was multiplied with for the mesh's own colours
    };

    struct Run {
        std::uint64_t first_triangle = 0; // of the mesh; up to the next run's
        std::uint32_t part = 0;
    };

    // An attribute as the file has it, in the frame of its node, by vertex of the mesh; 0 for vertices whose part has
    // it not.
    struct Channel {
        std::string name; // as in glTF: NORMAL, TEXCOORD_0, COLOR_0, ...
        std::uint32_t components = 0;
        std::vector<float> values;
    };

    Format format = Format::gltf;
    std::string json = {}; // of glTF: the document without geometry
    std::vector<File> files = {};
    std::vector<Part> parts = {};
    std::vector<Run> runs = {}; // ascending, from triangle 0 on
    std::vector<Channel> channels = {};
    std::vector<std::uint32_t> vertex_parts = {}; // by vertex of the mesh: a part that uses it
    std::vector<VertexArray> arrays = {};         // all as long as the mesh has vertices; names are unique

    // The part of a triangle of the mesh. Precondition: there are runs.
    std::uint32_t part_of(std::uint64_t triangle) const;
};

// As bytes that unpack() takes; docs/file-format.md describes them.
std::vector<std::byte> pack(const SourceDocument& document);

// Of any bytes: fails where they are not what pack() writes, contradict themselves, or have matrices that are not
// finite. Nothing is allocated that the bytes do not hold.
Result<SourceDocument> unpack(std::span<const std::byte> bytes);

} // namespace unseen::meshio
