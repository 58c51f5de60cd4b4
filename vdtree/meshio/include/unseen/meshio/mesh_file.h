// Mesh files as triangle soups of any topology; <unseen/meshio/meshio.h> has the table of formats. A file's content
// decides its format if it is unambiguous, else the ending of its name. Writers go by the ending.
//
// What does not decide the shape (images, materials, normals, texture coordinates) is a warning if it is missing or
// unknown, and the rest is read. What decides the shape is an error that names file and line, byte or index, and says
// what to do. Every count is checked against the bytes that are there before memory is allocated for it, so memory
// stays proportional to the file; compressed VTP may become 100 times the file, or 1 GiB.
#pragma once

#include <filesystem>
#include <set>

#include <unseen/meshio/source_document.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/result.h>

namespace unseen::meshio {

enum class ColourEncoding { srgb, linear };

// What glTF files may have and no cut can keep.
struct LeftOut {
    bool skins = false, morph_targets = false, animations = false;
    bool extensions = false; // unknown extensions that the file requires
};

struct ReadOptions {
    // How the colours of PLY, OBJ, OFF and VTP are encoded; those of glTF are linear.
    ColourEncoding colours = ColourEncoding::srgb;
    Progress progress = {};
    bool images = true;    // give materials their images; else they have colours only
    LeftOut drop = {};     // what to leave out; a file that has something else of it is refused. In messages: read.drop
    bool skip_bad = false; // leave out the faces that BadParts counts; else they are an error. read.skip_bad
    bool weld = true;      // join STL's vertices at equal places; else each facet keeps three. read.weld
    // A further folder for images and material libraries, which are looked for beside the file that names them,
    // beside the mesh, and then here, also by their bare names. Nothing outside of these folders is read.
    // read.search_folder
    std::filesystem::path search_folder = {};
};

// Vertices and faces without a shape.
struct BadParts {
    std::uint64_t vertices = 0;           // vertices with a NaN or infinite coordinate, used or not
    std::uint64_t faces = 0;              // faces with corners that are not there (STL: with such coordinates)
    std::uint64_t left_out = 0;           // `faces`, and the faces that use one of `vertices`
    std::string first_vertex, first_face; // where, and what is wrong; empty if there are none

    bool any() const { return vertices > 0 || faces > 0; }
};

// The surface of a range of triangles. Images are bytes as in their files: nothing here decodes them.
struct Material {
    std::string name;                 // that of the MeshRange; unique in a file
    glm::vec4 colour = glm::vec4(1);  // linear RGBA, 0..1; multiplies vertex colours and texture
    std::filesystem::path image = {}; // its name; empty: there is no image, or it lies in the mesh file
    // The image file itself; materials share it. Null: there is no image, or it was not found.
    std::shared_ptr<const std::string> image_bytes = {};
    vdtree::Wrap wrap_u = vdtree::Wrap::repeat, wrap_v = vdtree::Wrap::repeat;
    UvMap uv_map = {}; // from the vertices' texture coordinates to those of the image
    // Texels of the image whose alpha is less are not there; none: alpha does not count, unless it blends. Above 1: none of
    // them is.
    std::optional<float> alpha_cutoff = {};
    bool blends = false;   // alpha, times the image's, is the share of light that it stops; without a cut-off
    bool is_unlit = false; // KHR_materials_unlit: it looks as it is, whatever the light
    // Further image files that lie as the image does, or null.
    std::shared_ptr<const std::string> normal_map = {}, emission_map = {};
    std::shared_ptr<const std::string> opacity_map = {}; // OBJ's map_d: alpha, or luminance where all alpha is 1
    float normal_scale = 1;                              // of x and y of the normal map
    glm::vec3 emission =
        glm::vec3(0); // linear RGB of light that it sends out, times the map's; 1 is the display's white
    // What else the file says of how it looks, which nothing here draws or judges: "metalness", "bump maps", ...
    std::set<std::string> undrawn = {};

    bool has_image() const { return image_bytes != nullptr; }
    bool shines() const { return emission != glm::vec3(0); }
    bool is_glass() const { return blends && colour.a < 1; } // seen through all over
    bool has_maps() const { return has_image() || normal_map || opacity_map || shines() || is_glass(); }
};

struct ReadResult {
    vdtree::Mesh mesh;
    std::uint64_t source_vertices = 0;    // vertices of the file: the mesh's first ones, in its order
    std::uint64_t source_faces = 0;       // faces of the file before triangulation
    std::uint64_t dropped_triangles = 0;  // triangles that used a vertex twice
    std::vector<Message> warnings;        // what was lost or repaired, one sentence each
    std::vector<Material> materials = {}; // OBJ and glTF
    // From glTF, OBJ with objects or materials (without vertex_parts), and PLY and VTP with values of vertices.
    std::optional<SourceDocument> document = {};
    bool is_unlit = false;           // all triangles have such materials: build with BuildOptions::prelit
    bool uvs_from_top = false;       // v grows downward in images (glTF), not upward (OBJ, PLY)
    std::vector<Message> notes = {}; // what is good to know, one sentence each
    BadParts bad = {};               // what was left out
};

// Reads a mesh. Polygons are triangulated by ear clipping in their plane, so concave ones keep their area; triangle
// strips are unrolled; glTF's node transforms are applied. Coincident vertices stay apart, except those of STL
// (ReadOptions::weld). Fails on a mesh without triangles.
Result<ReadResult> read_mesh(const std::filesystem::path& file, const ReadOptions& options = {});

// Writes to a temporary name in the same folder, then renames, so a file is replaced only by a whole one. PLY, STL
// and VTP are binary and little-endian. PLY and VTP have float positions if these are exact, else double; normals;
// colours in sRGB, 8 bits; texture coordinates. OBJ and OFF have as many digits as are needed to read the same values
// again. OUT.gltf has its data in OUT.bin. `progress` is called, and can cancel, while a PLY is written.
std::vector<std::string> written_endings(); // ".ply", ".obj", ...
Result<void> write_mesh(const std::filesystem::path& file, const vdtree::MeshView& mesh, const Progress& progress = {});

// Writes a cut with everything that the file of its mesh said (SourceDocument): nodes, names, materials, textures,
// texture coordinates and colours. Images and libraries that lay beside that file are written beside this one under
// the same names; fails if one is there with other contents. Returns what the format cannot keep, one sentence each.
// A tree without a document is written like extract_mesh(). Fails on damaged documents.
// PLY and VTP also get the values of vertices (VertexArray). A vertex of the input keeps its values. A proxy gets the
// mean of the finite values of the vertices that it stands for, component by component; for integers, and if no value
// is finite, the value of the nearest of them. Memory: the values of the input and of the cut.
Result<std::vector<Message>> write_cut(const std::filesystem::path& file, const vdtree::Cut& cut);

} // namespace unseen::meshio
