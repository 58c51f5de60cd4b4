// What there is to see: objects, their background, and the lights.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <calibration/light_rig.h>
#include <perception/units.h>
#include <session/model_file.h>
#include <vdtree/vertex_tree.h>
#include <vdtree/view.h>

namespace unseen::session {

struct MeasurementPlace; // the library's own

struct Object {
    vdtree::VertexTree tree;
    vdtree::Similarity placement = {}; // to the world, in metres
    std::string name = {};             // for messages
    // What was done to the tree since it was built, for the reasons that a plan gives.
    bool texture_left_out = false, is_relit = false;
    TreeOrigin origin = TreeOrigin::given;
    std::shared_ptr<const MeasurementPlace> measurement = {}; // where that of a tree file's tree is kept; null: nowhere
};

// A value, made once and then given to a Session. Error messages and reasons call these fields scene.lights and so on.
struct Scene {
    std::vector<Object> objects = {};
    std::optional<perception::Luminance> background = {}; // default: 20 cd/m2, or the nearest that the display can show
    std::optional<calibration::LightRig> lights = {};     // in place of the trees' own light; they may move

    // A scene of one object: a tree file or a mesh file with its textures (see open_tree()), placed at the world's
    // origin.
    static Result<Scene> load(const std::filesystem::path& file, const LoadOptions& options = {});
    static Scene of(vdtree::VertexTree tree, double unit_metres = 1);

    // Lights all objects anew, as vdtree::Light says; what is not given stays. What was pre-lit is lit, too. `towards`:
    // the direction of the light, not 0; `ambient` and `fill`: 0..1. Fails where they are not, and on trees that cannot
    // be lit anew. Cost: a pass over the trees.
    Result<void> relight(std::optional<glm::dvec3> towards, std::optional<double> ambient,
                         std::optional<double> fill = {});
};

} // namespace unseen::session
