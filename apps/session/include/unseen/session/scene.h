// A scene: objects, their background, and the lights.
#pragma once

#include <unseen/calibration/light_rig.h>
#include <unseen/meshio/scene_file.h>
#include <unseen/perception/units.h>
#include <unseen/session/load.h>

namespace unseen::session {

struct MeasurementPlace; // the library's own

struct Object {
    vdtree::VertexTree tree;
    vdtree::Similarity placement = {};               // to the world, in metres
    std::string name = {};                           // for messages
    bool texture_left_out = false, is_relit = false; // since the tree was built; plans mention it
    TreeOrigin origin = TreeOrigin::given;
    std::shared_ptr<const MeasurementPlace> measurement = {}; // where its measurements are cached; null: nowhere
    std::int32_t node = -1, mesh = -1;                        // of Scene::source; -1: not set
};

// A value that a Session takes. Error messages and reasons call these fields scene.lights and so on.
struct Scene {
    std::vector<Object> objects = {};
    std::optional<perception::Luminance> background = {}; // default: 20 cd/m2, or the nearest that the display can show
    std::optional<calibration::LightRig> lights = {};     // replace the trees' own light; they may move
    // Walls, ground and the like: drawn whole, lit like the objects, and visible behind their outlines. They are never
    // folded, and their triangles do not count.
    std::vector<Object> backdrop = {};
    std::optional<meshio::SceneCamera> camera = {}; // of the file, world units
    // For writing a scene file again (write_scene()). A scene with a source may have no objects. Null: not read from a
    // scene file.
    std::shared_ptr<const meshio::SceneSource> source = {};

    // A scene of one object: a tree file or a mesh file with its textures (see load_tree()), placed at the world's
    // origin.
    //
    // A glTF file becomes a scene of many objects if load.as says so. Each mesh is built once; all nodes that show it
    // share the tree. A transform that is not a similarity is split into a rotation and a stretch or mirror image. The
    // mesh is stretched before its tree is built; nodes with the same stretch share that tree. Singular transforms are
    // errors. The file's lights are scaled such that white which faces all of them at the objects' middle has the
    // relative luminance 1 with the ambient light, unless the file gives an exposure (SceneContents::exposure). A scene
    // without lights gets those of vdtree::Light if any object is turned, because a tree's own light would turn with
    // it.
    static Result<Scene> load(const std::filesystem::path& file, const LoadOptions& options = {});
    static Scene of(vdtree::VertexTree tree, double unit_metres = 1);

    Scene share() const; // another scene of the same trees, which live as long as one of them

    bool is_of_file() const noexcept { return source != nullptr; } // of a scene file, not a model

    // Relights all objects as vdtree::Light describes, pre-lit ones, too; parameters that are not set stay. `towards`:
    // the direction to the light, not 0; `ambient` and `fill`: 0..1. Fails on other values and on trees that cannot be
    // relit. Cost: a pass over the trees.
    Result<void> relight(std::optional<glm::dvec3> towards, std::optional<double> ambient,
                         std::optional<double> fill = {});
};

// The light of vdtree::Light in the world, with these parameters if set: for scenes with turned objects. Fails where
// Scene::relight() does.
Result<calibration::LightRig> light_rig(std::optional<glm::dvec3> towards = {}, std::optional<double> ambient = {},
                                        std::optional<double> fill = {});

} // namespace unseen::session
