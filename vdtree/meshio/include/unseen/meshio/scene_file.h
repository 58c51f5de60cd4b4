// glTF files as scenes: meshes that nodes place in the world, with cameras and lights. read_mesh() makes one mesh of
// all nodes; here every mesh is read once, in its own frame, however many nodes show it.
//
// A node is background where its name is "background", or begins so and goes on with anything but a letter, or where
// its extras say {"unseen": {"background": true}}; so is all below it. The document's own extras may say how lights
// come out: {"unseen": {"exposure": E, "ambient": A}}, see SceneContents.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>

#include <unseen/meshio/mesh_io.h>
#include <unseen/meshio/source_document.h>
#include <unseen/vdtree/cut.h>

namespace unseen::meshio {

// A mesh under a node.
struct SceneNode {
    std::string name;       // for people: the node's or the mesh's, or "node 3"
    std::int32_t node = -1; // of the document; -1: it has no nodes, and shows its meshes
    std::int32_t mesh = 0;
    glm::dmat4 to_world = glm::dmat4(1); // affine and finite; may be singular
    bool is_background = false;
};

// KHR_lights_punctual; colours count by their luminance, and ranges do not count. The extras of a light, or of its node,
// may say {"casts_shadow": true}.
struct SceneLight {
    enum class Kind : std::uint8_t { directional, point, spot };
    Kind kind = Kind::directional;
    std::string name;
    double intensity = 1;                        // lux of directional lights, else candela; 0 or more, finite
    glm::dvec3 position = glm::dvec3(0);         // in the world
    glm::dvec3 direction = glm::dvec3(0, 0, 1);  // unit; where it shines
    double inner_radians = 0, outer_radians = 0; // of a spot: half angles, inner < outer <= pi / 2
    bool casts_shadow = false;
};

// Perspective.
struct SceneCamera {
    std::string name;
    glm::dvec3 eye = glm::dvec3(0), forward = glm::dvec3(0, 0, -1), up = glm::dvec3(0, 1, 0); // unit, in the world
    double fov_y_degrees = 30;                                                                // in (0, 180)
};

// What a scene is written again with: the document without geometry, and its images.
struct SceneSource {
    std::string json;
    std::vector<SourceDocument::File> files;
};

struct SceneContents {
    std::vector<SceneNode> nodes; // with a mesh, of the scene that is shown
    std::vector<SceneLight> lights;
    std::optional<SceneCamera> camera; // the first
    // From lux to relative luminance of white; above 0. None: whoever lights the scene chooses.
    std::optional<double> exposure;
    std::optional<double> ambient; // relative luminance of white without lights, 0..1
    // Cameras, lights, a mark of what is background, or a mesh under several nodes: more than one model.
    bool is_scene = false;
    std::uint64_t file_bytes = 0; // with its buffers
    SceneSource source;
    std::vector<Message> warnings, notes; // one sentence each
};

class SceneFile {
public:
    // Fails on other formats than glTF, and on what read_mesh() refuses of documents. Nothing of meshes is read yet.
    static Result<SceneFile> read(const std::filesystem::path& file, const ReadOptions& options = {});
    // Of bytes in memory; `folder`: where its buffers lie.
    static Result<SceneFile> from_bytes(std::string bytes, const std::filesystem::path& name,
                                        const ReadOptions& options = {}, const std::filesystem::path& folder = {});
    SceneFile(SceneFile&&) noexcept;
    SceneFile& operator=(SceneFile&&) noexcept;
    ~SceneFile();

    const SceneContents& contents() const noexcept;

    // A mesh in its own frame, or stretched, with a document of its own; nothing where it has no triangles, such as
    // one of lines. Of all meshes together no more is read than of one file. Precondition: there is such a mesh.
    // Not thread-safe. Cost: the mesh.
    Result<std::optional<ReadResult>> mesh(std::size_t mesh, const glm::dmat3& stretch = glm::dmat3(1));

private:
    struct Impl;
    explicit SceneFile(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

// Whether a file looks like glTF, by its first bytes or its ending.
bool is_gltf_file(const std::filesystem::path& file);

// A cut of what a node shows. The tree is of SceneFile::mesh(), whatever its stretch.
struct SceneCut {
    std::int32_t node = -1, mesh = 0;
    const vdtree::Cut* cut = nullptr;
};

// Writes a scene as glTF with the cuts in place of the meshes: each node has a mesh of its own, but for whole ones,
// which are shared as before; nodes, transforms, names, materials, cameras and lights stay. Nodes whose cut has no
// triangles lose their mesh. Images as by write_cut(). Returns what could not be kept, one sentence each.
Result<std::vector<Message>> write_scene(const std::filesystem::path& file, const SceneSource& source,
                                         std::span<const SceneCut> cuts);

} // namespace unseen::meshio
