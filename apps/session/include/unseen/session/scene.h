// What there is to see: objects, their background, and the lights.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <unseen/calibration/light_rig.h>
#include <unseen/meshio/scene_file.h>
#include <unseen/perception/units.h>
#include <unseen/session/model_file.h>
#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::session {

struct MeasurementPlace; // the library's own

struct Object {
    vdtree::VertexTree tree;
    vdtree::Similarity placement = {}; // to the world, in metres
    std::string name = {};             // for messages
    // What was done to the tree since it was built, for the reasons that a plan gives.
    bool texture_left_out = false, is_relit = false;
    TreeOrigin origin = TreeOrigin::given;
    std::shared_ptr<const MeasurementPlace> measurement = {}; // where what is measured of it is kept; null: nowhere
    std::int32_t node = -1, mesh = -1;                        // of Scene::source; -1: none
};

// A value, made once and then given to a Session. Error messages and reasons call these fields scene.lights and so on.
struct Scene {
    std::vector<Object> objects = {};
    std::optional<perception::Luminance> background = {}; // default: 20 cd/m2, or the nearest that the display can show
    std::optional<calibration::LightRig> lights = {};     // in place of the trees' own light; they may move
    // Walls, ground and such: drawn whole, lit like the objects, and seen behind their outlines. Nothing of it is
    // folded or counts as triangles of the scene.
    std::vector<Object> backdrop = {};
    std::optional<meshio::SceneCamera> camera = {}; // where the file looks from, world units
    // Of a scene's file: what it is written again with (write_scene()). Such a scene may be without objects. Null: not
    // of such a file.
    std::shared_ptr<const meshio::SceneSource> source = {};

    // A scene of one object: a tree file or a mesh file with its textures (see open_tree()), placed at the world's
    // origin.
    //
    // As load.as says, a glTF file may become a scene of many. Every mesh is built once, and all nodes that show it
    // share the tree. Transforms that are no similarities are parted into a rotation and a stretch or mirror image,
    // which the mesh gets before its tree is built; nodes with the same stretch share. Nodes without an inverse are
    // errors. Lights of the file come out so that white which faces all of them at the objects' middle has the
    // relative luminance 1 with the ambient light, unless the file says how (SceneContents::exposure). A scene without
    // lights has those of vdtree::Light where anything is turned, for the trees' own light would turn with it.
    static Result<Scene> load(const std::filesystem::path& file, const LoadOptions& options = {});
    static Scene of(vdtree::VertexTree tree, double unit_metres = 1);

    bool is_of_file() const noexcept { return source != nullptr; } // a scene's, not a model's

    // Lights all objects anew, as vdtree::Light says; what is not given stays. What was pre-lit is lit, too. `towards`:
    // the direction of the light, not 0; `ambient` and `fill`: 0..1. Fails where they are not, and on trees that cannot
    // be lit anew. Cost: a pass over the trees.
    Result<void> relight(std::optional<glm::dvec3> towards, std::optional<double> ambient,
                         std::optional<double> fill = {});
};

// The light of vdtree::Light in the world, with what is given instead: for scenes whose objects are turned. Fails where
// Scene::relight() does.
Result<calibration::LightRig> light_rig(std::optional<glm::dvec3> towards = {}, std::optional<double> ambient = {},
                                        std::optional<double> fill = {});

} // namespace unseen::session
