// Mesh files as triangle soups of any topology.
//
// Read: PLY (ASCII, both endians, face lists and triangle strips), OBJ, OFF, STL (ASCII and binary), glTF 2.0 (.gltf,
// .glb) and VTK's polygons (.vtp: ASCII, base64, raw, also with zlib; legacy .vtk: ASCII, binary), told apart by their
// content where it is unambiguous, else by the file name's ending.
// Write: PLY, OBJ, glTF (.gltf, .glb), VTK (.vtp, .vtk), by ending.
//
// Nothing in a file is believed: every count is checked against the bytes that are there before memory is
// allocated for it, so memory stays proportional to the file; what VTK files compress may become 100 times the file, or
// 1 GiB. Errors name file, and line, byte or index.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <unseen/meshio/source_document.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/result.h>

namespace unseen::meshio {

enum class ColourEncoding { srgb, linear };

// What glTF files may have that no cut can keep.
struct LeftOut {
    bool skins = false, morph_targets = false, animations = false;
    bool extensions = false; // that the file requires and nobody here knows
};

struct ReadOptions {
    // How 8-bit and float colours of PLY, OBJ, OFF and VTK are encoded; glTF defines its own (linear).
    ColourEncoding colours = ColourEncoding::srgb;
    Progress progress = {};
    bool images = true;    // say where those of materials are; else materials have colours only
    LeftOut drop = {};     // files with other such things are refused; messages call this field read.drop
    bool skip_bad = false; // leave out what BadParts counts; else it is an error. Messages: read.skip_bad
    bool weld = true;      // vertices of STL files at equal places become one; else each facet keeps three. read.weld
};

// What no mesh can have.
struct BadParts {
    std::uint64_t vertices = 0;           // with a NaN or infinite coordinate, used or not
    std::uint64_t faces = 0;              // with corners that are not there or, in STL, such coordinates
    std::uint64_t left_out = 0;           // faces of both kinds: all that use any of those vertices, and `faces`
    std::string first_vertex, first_face; // where, and what is wrong; empty where there is none

    bool any() const { return vertices > 0 || faces > 0; }
};

// What a file says of the surface of a range of triangles. Images are named, or are there as they were in the file:
// nothing here decodes them.
struct Material {
    std::string name;                 // of the MeshRange; different for all materials of a file
    glm::vec4 colour = glm::vec4(1);  // linear RGB, 0..1, that vertex colours and texture are multiplied with; alpha
    std::filesystem::path image = {}; // beside the mesh file, or below; empty: none
    std::shared_ptr<const std::string> image_bytes =
        {}; // the image file itself, where the mesh file holds it; shared by all materials that have it; or null
    vdtree::Wrap wrap_u = vdtree::Wrap::repeat, wrap_v = vdtree::Wrap::repeat;
    UvMap uv_map = {}; // from the vertices' texture coordinates to the image's

    bool has_image() const { return !image.empty() || image_bytes; }
};

struct ReadResult {
    vdtree::Mesh mesh;
    std::uint64_t source_faces = 0;       // faces of the file before triangulation
    std::uint64_t dropped_triangles = 0;  // triangles that used a vertex twice
    std::vector<Message> warnings;        // repairs that were made, one sentence each
    std::vector<Material> materials = {}; // of OBJ and glTF
    // Of glTF, and of OBJ with objects or materials; without vertex_parts. Of PLY and VTK with values of vertices.
    std::optional<SourceDocument> document = {};
    bool uvs_from_top = false; // v grows downward in images (glTF), not upward (OBJ, PLY)
    std::optional<std::uint64_t> bad_uv =
        {};                          // the first vertex whose texture coordinates were not finite, and set to 0
    std::vector<Message> notes = {}; // what is no repair and good to know, one sentence each
    BadParts bad = {};               // what was left out
};

// Polygons are triangulated (ear clipping in the plane of the polygon, so concave ones keep their area),
// triangle strips unrolled with their orientation, glTF node transforms applied. Coincident vertices stay apart, but
// for those of STL (ReadOptions::weld), whose facet normals go with them.
// Fails on a mesh without triangles, and on vertex normals in use that are not finite; those of length 0 are told in
// the warnings.
Result<ReadResult> read_mesh(const std::filesystem::path& file, const ReadOptions& options = {});

// Writes to a temporary name in the same folder, then renames; an existing file is replaced only by a whole one.
// PLY: binary little-endian, float positions where they are exact and double otherwise; normals, colours (sRGB
// 8 bit), UVs where present. OBJ: text with as many digits as needed to read the same values again.
// glTF: one primitive for each material range; of OUT.gltf the data lie in OUT.bin. VTK: .vtp with raw data behind the
// XML, .vtk in binary, version 3.0; positions, normals, colours and UVs as in PLY.
// Progress is told, and can cancel, while a PLY is written.
Result<void> write_mesh(const std::filesystem::path& file, const vdtree::MeshView& mesh, const Progress& progress = {});

// Writes a cut with all that the file of its mesh said (SourceDocument): nodes, names, materials, textures, texture
// coordinates and colours as they were there. Images and libraries that lay beside that file are written beside this
// one, under the same names; fails where one is there with other contents. Returns what the format cannot keep, one
// sentence each. Trees without a document are written like extract_mesh(). Fails on damaged documents, too.
// Values of vertices (VertexArray), to PLY and VTK: vertices of the input keep theirs. Those of proxies are the mean of
// the finite values of the vertices that they stand for, component by component; of integers, and where none is finite,
// the value of the nearest of these vertices. Memory: the values of the input, and those of the cut.
Result<std::vector<Message>> write_cut(const std::filesystem::path& file, const vdtree::Cut& cut);

} // namespace unseen::meshio
