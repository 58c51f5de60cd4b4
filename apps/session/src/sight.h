// One object of a scene as it is seen: what fold tests look at.
#pragma once

#include <unseen/perception/internal/cut_rings.h>
#include <unseen/perception/internal/lit_folds.h>

#include "shadow_reach.h"

namespace unseen::session {

struct KeptCriterion; // see fold_test.h
struct ShownCriteria; // likewise

// What is derived from an object's tree, made when it is first asked for. Dropped when the tree is replaced.
struct ObjectCache {
    std::optional<std::vector<vdtree::Sphere>> inner_spheres = {};
    std::optional<perception::CutRings> cut_rings = {};
    std::optional<vdtree::Sphere> all = {};              // see sphere_of_all()
    std::optional<bool> knows_lit_texture = {};          // see perception::knows_lit_texture()
    std::optional<bool> has_colours = {};                // see perception::has_colours()
    std::optional<perception::ChromaRange> colours = {}; // see perception::colour_reach()
    std::shared_ptr<const vdtree::LightBounds> light_bounds = {}, lit_cut_rings = {};
    std::optional<perception::LitFolds> lit_folds = {};  // measured where the default test asks for it
    std::shared_ptr<const KeptCriterion> criterion = {}; // the last that was asked for
};

// Shadows of all objects of a scene whose lights cast them.
struct SceneShadows {
    const Scene& scene;
    const std::vector<std::shared_ptr<ObjectCache>>& caches;
    std::optional<ShadowReceivers> receivers = {};
    std::optional<LitReceivers> lit = {}; // for the last lights
    // How shadows' edges are seen in views like this one. The same object for the same key, however long ago it was
    // made: objects go by one reach only where their criteria have the same.
    struct EdgesKey {
        vdtree::View lens = {}; // without its place
        double ambient = 0;
        std::optional<double> farthest_gaze_px = {};
        std::shared_ptr<const perception::CsfTable> csf = {};
        bool operator==(const EdgesKey&) const = default;
    };
    struct KnownEdges {
        EdgesKey key;
        std::weak_ptr<const perception::ShadowEdges> edges;
    };
    std::vector<KnownEdges> known_edges = {};                       // that criteria go by
    std::shared_ptr<const perception::ShadowEdges> last_edges = {}; // also where none does any more
};

// What is kept for an object whose lights cast shadows.
struct ShadowState {
    std::shared_ptr<const KeptCriterion> of = {};                    // what all of this is of
    std::shared_ptr<const vdtree::Lighting> lighting = {};           // likewise, where lights stand still
    std::vector<float> shifts = {};                                  // see outline_shifts()
    std::shared_ptr<const ShadowReach> reach = {};                   // for which `kept` is enough,
    double threshold = 0;                                            // with this threshold
    std::vector<std::uint64_t> kept = {};                            // see shadowing_outlines()
    std::shared_ptr<const vdtree::DistanceCriterion> criterion = {}; // that keeps them
};

// What a follower keeps of the views that it has seen, so that shadows do not flicker. A single view begins anew.
struct ShadowMemory {
    bool has_one_view = false; // and no other will follow
    std::vector<ShadowState> of_objects = {};
    std::shared_ptr<const ShadowReach> reach = {}; // of the last views
};

struct Sight {
    const Object& object;
    std::size_t number; // of the object
    ObjectCache& cache;
    std::shared_ptr<const KeptCriterion>& lit_criterion;  // the object's own, of the test by errors under lights
    std::shared_ptr<const ShownCriteria>& shown_criteria; // the object's own, by what pictures show
    SceneShadows& scene_shadows;
    ShadowMemory& memory;
    const Observer& observer;
    const vdtree::View& view;
    const calibration::LightRig* lights;                          // null: the tree's own light
    std::shared_ptr<const vdtree::Lighting> lighting;             // theirs
    std::shared_ptr<const std::vector<vdtree::Lighting>> stretch; // see LitStretch; null where lights stand still
    const std::vector<vdtree::Plane>* window;                     // the frustum's planes around the eye, in the world
    float background;                                             // relative luminance
    bool is_crowded;                                              // too many nodes to look at all of them under lights
    perception::SceneLuminance luminance = {};                    // of the whole scene
    // For the gaze's margin; no gaze where the margin is so wide that everything may be looked at.
    std::shared_ptr<const perception::CsfTable> csf = {};
    std::optional<glm::dvec2> gaze_px = {};
};

inline ShadowState& shadow_of(Sight& sight) { return sight.memory.of_objects[sight.number]; }

// What will be done for a valid request.
struct Decision {
    const Request& request;
    FoldTest test;
    std::string_view why;  // not the default
    bool measures = false; // the tree lacks the errors of its folds
};

// Around all that fold tests look at: vertices, proxies, rings. Larger than that of the triangles.
WorldSphere sphere_of_all(const Object& object, ObjectCache& cache);
std::span<const vdtree::Sphere> inner_spheres(const Object& object, ObjectCache& cache);
// What lights make of the rings of all cuts.
Result<std::shared_ptr<const vdtree::LightBounds>> lit_cut_rings(const Object& object, ObjectCache& cache);
Result<const perception::CutRings*> cut_rings(const Object& object, ObjectCache& cache);

} // namespace unseen::session
