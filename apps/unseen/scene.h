// Everything that is settled before a cut is made: the model under its light, the display, and the view.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <calibration/light_rig.h>
#include <perception/csf.h>
#include <perception/display.h>
#include <perception/gaze.h>
#include <vdtree/cut_rings.h>
#include <vdtree/vertex_tree.h>
#include <vdtree/view.h>

#include "options.h"

namespace unseen::app {

struct KeptCriterion; // see fold_test.cpp

// For one thread at a time.
struct Scene {
    vdtree::VertexTree tree; // changed by replace_tree() only, once the scene is made
    vdtree::Similarity placement = {};
    perception::Display display = {};
    std::shared_ptr<const perception::CsfTable> csf = {}; // what --csf names; null: the standard table
    vdtree::View view = {};
    float background = 0;             // relative luminance
    bool is_relit = false;            // the light is not the one that the tree was built for
    bool is_texture_left_out = false; // --no-texture

    // With --lights.
    std::optional<calibration::LightRig> rig = {};
    std::optional<vdtree::Lighting> lighting = {}; // as of the view and the time of light_at()
    std::shared_ptr<const vdtree::LightBounds> light_bounds = {};

    const perception::CsfTable& csf_table() const { return csf ? *csf : perception::CsfTable::standard(); }

    // Made when they are first asked for, and kept.
    // For gazes that are known to a margin only, above 0; null where the margin is so wide that everything may be looked at.
    std::shared_ptr<const perception::CsfTable> csf_table(perception::Degrees margin) const;
    std::span<const vdtree::Sphere> inner_spheres() const; // of vdtree::inner_spheres()
    Result<const vdtree::CutRings*> cut_rings() const; // of vdtree::bound_cut_rings(); the scene's

    // Drops what was kept of the tree before.
    void replace_tree(vdtree::VertexTree other);

    struct Kept {
        std::unique_ptr<perception::WidenedTables> widened_tables = {};
        std::optional<std::vector<vdtree::Sphere>> inner_spheres = {};
        std::optional<vdtree::CutRings> cut_rings = {};
        std::shared_ptr<const KeptCriterion> criterion = {}; // the last that was asked for
    };
    mutable Kept kept = {};
};

// So far to the right of the window's centre, in pixels; it may lie outside of the window.
glm::dvec2 gaze_aside(const perception::Display& display, const vdtree::View& view, double degrees);
inline constexpr double usual_degrees_aside = 29; // well in the periphery

// The display that the options describe; ranges are checked.
Result<perception::Display> make_display(const DisplayOptions& options);

// What --csf says: a model's name, or else the file of a table. A model must be of luminance contrast.
struct CsfChoice {
    std::optional<perception::CsfModel> model;
    std::optional<perception::CsfTable> table; // of the file; where a model is named, none
};
Result<CsfChoice> choose_csf(const std::string& model_or_file);
// Its table, of a model for the display's distance.
Result<perception::CsfTable> csf_table(const std::string& model_or_file, const perception::Display& display);

// Fails on a file that cannot be read, and on options that contradict the model or the display.
Result<Scene> load_scene(const std::filesystem::path& model, const ViewOptions& view, const DisplayOptions& display);
// The same of a tree that is at hand.
Result<Scene> make_scene(vdtree::VertexTree tree, const ViewOptions& view, const DisplayOptions& display);

// Looks at the scene in another way; of the options only those that make a view count.
Result<void> look(Scene& scene, const ViewOptions& options);

// Puts the lights of --lights, if there are any, where they are at a time; to be called when the view has changed, too. Fails where one
// is at a vertex or inside of the model.
Result<void> light_at(Scene& scene, double seconds);

// The model's bounding sphere in the world.
struct PlacedSphere {
    glm::dvec3 centre;
    double radius;
};
PlacedSphere placed_sphere(const vdtree::VertexTree& tree, const vdtree::Similarity& placement);

} // namespace unseen::app
