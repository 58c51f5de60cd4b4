// glTF files as scenes: meshes that nodes place in the world, cameras and lights. read_mesh() joins all nodes to one
// mesh; a SceneFile reads each mesh once, in its own frame, however many nodes show it. Also written: scenes, and
// levels of detail.
//
// A node is background if its name is "background", or "background" followed by anything but a letter, or if its
// extras say {"unseen": {"background": true}}; so are all nodes below it. The document's extras may set the
// brightness of lights: {"unseen": {"exposure": E, "ambient": A}}, see SceneContents.
#pragma once

#include <glm/mat3x3.hpp>

#include <unseen/meshio/mesh_file.h>
#include <unseen/meshio/source_document.h>
#include <unseen/vdtree/cut.h>

namespace unseen::meshio {

// A mesh under a node.
struct SceneNode {
    std::string name;       // for people: the node's or the mesh's, or "node 3"
    std::int32_t node = -1; // its number in the document; -1: the document has no nodes and shows all meshes
    std::int32_t mesh = 0;
    glm::dmat4 to_world = glm::dmat4(1); // affine and finite; may be singular
    bool is_background = false;
};

// KHR_lights_punctual. Colours count by their luminance; ranges are ignored. The extras of a light or of its node may
// say {"casts_shadow": true}.
struct SceneLight {
    enum class Kind : std::uint8_t { directional, point, spot };
    Kind kind = Kind::directional;
    std::string name;
    double intensity = 1;                        // lux of directional lights, else candela; 0 or more, finite
    glm::dvec3 position = glm::dvec3(0);         // in the world
    glm::dvec3 direction = glm::dvec3(0, 0, 1);  // unit; where it shines
    double inner_radians = 0, outer_radians = 0; // half angles of a spot, inner < outer <= pi / 2
    bool casts_shadow = false;
};

// Perspective.
struct SceneCamera {
    std::string name;
    glm::dvec3 eye = glm::dvec3(0), forward = glm::dvec3(0, 0, -1), up = glm::dvec3(0, 1, 0); // unit, in the world
    double fov_y_degrees = 30;                                                                // in (0, 180)
};

// The document without geometry, and its images: what write_scene() starts from.
struct SceneSource {
    std::string json;
    std::vector<SourceDocument::File> files;
};

struct SceneContents {
    std::vector<SceneNode> nodes; // nodes with a mesh, in the scene that is shown
    std::vector<SceneLight> lights;
    std::optional<SceneCamera> camera; // the first
    // From lux to relative luminance of white; above 0. Not set: whoever lights the scene chooses.
    std::optional<double> exposure;
    std::optional<double> ambient; // relative luminance of white without lights, 0..1
    // Whether this is more than one model: it has cameras, lights, a background, or a mesh under several nodes.
    bool is_scene = false;
    std::uint64_t file_bytes = 0; // with its buffers
    SceneSource source;
    std::vector<Message> warnings, notes; // one sentence each
};

class SceneFile {
public:
    // Reads the document, but no mesh yet. Fails if the file is not glTF, or if read_mesh() would refuse its
    // document.
    static Result<SceneFile> read(const std::filesystem::path& file, const ReadOptions& options = {});
    // The same from bytes in memory. `folder`: where buffers and images lie.
    static Result<SceneFile> from_bytes(std::string bytes, const std::filesystem::path& name,
                                        const ReadOptions& options = {}, const std::filesystem::path& folder = {});
    SceneFile(SceneFile&&) noexcept;
    SceneFile& operator=(SceneFile&&) noexcept;
    ~SceneFile();

    const SceneContents& contents() const noexcept;

    // A mesh in its own frame, or stretched, with a document of its own; nothing if it has no triangles, only lines.
    // Precondition: there is such a mesh. Not thread-safe. Cost: the mesh.
    Result<std::optional<ReadResult>> mesh(std::size_t mesh, const glm::dmat3& stretch = glm::dmat3(1));

private:
    struct Impl;
    explicit SceneFile(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

// Whether a file's name ends like glTF.
bool is_gltf_file(const std::filesystem::path& file);

// ---- writing

// Smaller files, by extensions that readers must know; this library's does.
struct GltfOptions {
    // KHR_mesh_quantization: positions on a grid of 65,535 steps along the mesh's longest side; normals, colours and
    // texture coordinates within 0..1 in 16 bits. Half to two thirds of the bytes.
    bool quantize = false;
    // EXT_meshopt_compression of vertices and indices, in an order that suits graphics cards. Fails if the build
    // lacks the library meshoptimizer.
    bool meshopt = false;
};

bool has_meshoptimizer() noexcept; // whether this build has the library

// The cut that a node shows, or its levels of detail. Trees were built from SceneFile::mesh(), with any stretch.
struct LevelCuts {
    std::int32_t node = -1, mesh = 0;     // as in SceneNode
    std::vector<const vdtree::Cut*> cuts; // finest first; not empty
    std::vector<double> coverages;        // by cut: shares of the screen's area, 0..1, descending
};

struct LevelsWritten {
    std::vector<Message> notes;       // what could not be kept, one sentence each
    std::vector<std::uint64_t> bytes; // geometry by level; shared geometry counts for the first level that has it
};

// Writes a scene as glTF with the cuts in place of the meshes. Nodes, transforms, names, materials, cameras and
// lights stay; images as in write_cut(). Nodes share a mesh if their cuts are the same. A node whose first cut has no
// triangles loses its mesh.
// Levels are written by the extension MSFT_lod: the node with the finest mesh names the nodes with the others, and its
// extras (MSFT_screencoverage) say down to which share of the screen each is shown. Readers that do not know the
// extension show the finest. Each further level has a node with the transform of the first, in no scene. A node that is
// more than a mesh gets a child for its levels. Fails if a level but the first has no triangles.
Result<LevelsWritten> write_scene(const std::filesystem::path& file, const SceneSource& source,
                                  std::span<const LevelCuts> nodes, const GltfOptions& options = {});

// Writes the levels of a whole model, like write_cut() to glTF: the first has a root above its nodes, each other one
// a root above nodes in the world's frame. `levels.node` and `levels.mesh` are ignored.
Result<LevelsWritten> write_model_levels(const std::filesystem::path& file, const LevelCuts& levels,
                                         const GltfOptions& options = {});

} // namespace unseen::meshio
