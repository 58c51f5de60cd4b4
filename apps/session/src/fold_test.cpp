#include <unseen/perception/fold_measurement.h>

#include "fold_test.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <unseen/perception/motion.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/light_bounds.h>

#include <glm/geometric.hpp>

#include "loaded_tree.h"
#include "shadow_limit.h"

namespace unseen::session {
namespace {

perception::FoldTestOptions test_options(const Sight& sight, const Request& request) {
    perception::FoldTestOptions options;
    options.display = sight.observer.display;
    options.scene = sight.luminance;
    options.csf = sight.csf;
    options.chroma = request.chroma;
    options.gaze_px = sight.gaze_px;
    return options;
}

// ---- which test

bool knows_texture(const Sight& sight) {
    std::optional<bool>& known = sight.cache.knows_texture;
    if (!known) known = perception::knows_texture(sight.object.tree);
    return *known;
}

struct Choice {
    FoldTest test = FoldTest::error;
    std::string_view why = {};
};

// Of the tests by luminance one that knows the scene, and colours where they count.
Choice suitable_test(const Sight& sight, bool chroma, bool may_measure) {
    const vdtree::VertexTree& tree = sight.object.tree;
    if (sight.lighting && !sight.lights->stands_still())
        return {FoldTest::luebke_hallen_safe, "the test error does not know lights that move"};
    if (sight.lighting && sight.lighting->specular > 0)
        return {FoldTest::luebke_hallen_safe, "the test error does not know highlights"};
    if (chroma) return {FoldTest::luebke_hallen_safe, "the test error does not know colours"};
    if (!knows_texture(sight))
        return {FoldTest::luebke_hallen_safe, "the test error does not know textures over vertices of several hues"};
    if (sight.lighting && sight.is_crowded)
        return {FoldTest::luebke_hallen_safe, "the test error would look at millions of nodes under these lights"};
    if (sight.lighting && sight.cache.lit_folds) return {};
    if ((!sight.lighting && perception::has_fold_measurement(tree)) ||
        (may_measure && tree.interior_count() <= most_measured))
        return {};
    return {FoldTest::luebke_hallen_safe,
            "the tree does not hold the errors of its folds, and measuring them takes long"};
}

// Whether a test knows what it would have to look at.
Result<void> check_knowledge(const Sight& sight, FoldTest test, bool chroma, bool shown) {
    if (!is_perceptual(test)) return {};
    if (sight.lighting && test == FoldTest::error && (!sight.lights->stands_still() || sight.lighting->specular > 0))
        return invalid_field(
            "{request.fold_test = }{} knows only lights of {scene.lights} that stand still and make no "
            "highlights: use {request.fold_test = }luebke-hallen-safe.",
            {name_of(test)});
    if (sight.lighting && shown && test != FoldTest::error)
        return invalid_field("{request.shown} and {scene.lights} go together with {request.fold_test = }error alone.");
    if (sight.lighting && chroma)
        return invalid_field("{request.chroma} and {scene.lights} exclude each other: ranges of colour are those of "
                             "the tree's own light.");
    if (sight.object.tree.texture().empty()) return {};
    if (chroma)
        return invalid_field(
            "{request.chroma} does not look at the colours of textures: leave it out, or add {load.without_textures}.");
    if (test == FoldTest::error && !knows_texture(sight))
        return invalid_field("{request.fold_test = }error does not measure textures over vertices of several hues: use "
                             "{request.fold_test = }luebke-hallen-safe, or add {load.without_textures}.");
    return {};
}

// ---- what it looks at

bool is_wholly_in_window(const Sight& sight) {
    const vdtree::Sphere sphere = sight.object.tree.bounding_sphere();
    const vdtree::Frustum frustum = vdtree::frustum_of(sight.object.tree, sight.view, sight.object.placement);
    return std::all_of(frustum.planes.begin(), frustum.planes.end(), [&](const vdtree::Plane& plane) {
        return glm::dot(plane.normal, glm::dvec3(sphere.centre)) + plane.offset > static_cast<double>(sphere.radius);
    });
}

// What a criterion depends on, besides what a scene never changes.
struct Key {
    FoldTest test = FoldTest::error;
    double pixels = 0; // of the others than perceptual tests; and of these alone:
    std::optional<double> farthest_gaze_px = {};
    perception::SceneLuminance scene = {0, 0};
    std::shared_ptr<const vdtree::Lighting> still_lights = {}; // of the test by errors
    bool is_lit = false, chroma = false;
    std::shared_ptr<const perception::CsfTable> csf = {}; // kept, so that no other table comes to its address
    vdtree::View lens = {};
    bool operator==(const Key&) const = default;
};

// The view without its place, which only viewpoints depend on; so do they on the height of an orthographic one.
vdtree::View lens_of(vdtree::View view) {
    const vdtree::View nowhere;
    view.eye = nowhere.eye, view.target = nowhere.target, view.up = nowhere.up;
    if (view.orthographic_height) view.orthographic_height = 1;
    return view;
}

// A gaze off the window reaches into larger magnifications: one criterion must do for all gazes up to there, so they
// are rounded up to whole windows.
double farthest_gaze_px(const vdtree::View& view, glm::dvec2 gaze_px) {
    const double side = std::max(view.width, view.height);
    return std::ceil(std::max(glm::length(gaze_px - vdtree::axis_px(view)) / side, 1.0)) * side;
}

// A budget goes by the order of the costs alone, for which any tolerance will do.
double tolerance_px(const Goal& goal) { return goal.kind == Goal::Kind::pixels ? goal.tolerance_px : 1; }

Key key_of(const Sight& sight, const Decision& decision) {
    Key key;
    key.test = decision.test;
    key.lens = lens_of(sight.view);
    if (!is_perceptual(decision.test)) {
        key.pixels = tolerance_px(decision.request.goal);
        return key;
    }
    key.scene = sight.luminance;
    key.is_lit = sight.lighting != nullptr;
    if (decision.test == FoldTest::error) key.still_lights = sight.lighting;
    key.chroma = decision.request.chroma;
    key.csf = sight.csf;
    if (sight.gaze_px) key.farthest_gaze_px = farthest_gaze_px(sight.view, *sight.gaze_px);
    return key;
}

// What is left of the lights for each set of those that shadows may be of; not where nothing is.
std::vector<vdtree::Lighting> without_hidden(const vdtree::Lighting& lighting) {
    std::vector<vdtree::Lighting> all;
    const std::size_t casting = vdtree::shadow_lights(lighting);
    for (unsigned hidden = 1; hidden < 1u << casting; ++hidden) {
        vdtree::Lighting left = lighting;
        left.lights.clear();
        unsigned number = 0;
        for (const vdtree::LightSource& light : lighting.lights)
            if (!light.casts_shadow || (hidden >> number++ & 1) == 0) left.lights.push_back(light);
        if (vdtree::validate(left)) all.push_back(std::move(left));
    }
    return all;
}

Result<vdtree::DistanceCriterion> make_criterion(const Sight& sight, const Decision& decision, const Key& key) {
    const vdtree::VertexTree& tree = sight.object.tree;
    const vdtree::View& view = sight.view;
    if (decision.test == FoldTest::extent) return vdtree::extent_criterion(tree, view, key.pixels);
    if (decision.test == FoldTest::displacement) return vdtree::displacement_criterion(tree, view, key.pixels);
    perception::FoldTestOptions options = test_options(sight, decision.request);
    if (key.farthest_gaze_px) options.gaze_px = vdtree::axis_px(view) + glm::dvec2(*key.farthest_gaze_px, 0);
    if (sight.lighting && decision.test == FoldTest::luebke_hallen)
        return perception::lit_distances(tree, sight.cache.light_bounds, view, options);
    if (decision.test == FoldTest::luebke_hallen) return perception::luebke_hallen_distances(tree, view, options);
    if (decision.test == FoldTest::luebke_hallen_safe) {
        const auto rings = cut_rings(sight.object, sight.cache, decision.request.chroma);
        if (!rings) return rings.error();
        if (!sight.lighting) return perception::luebke_hallen_safe_distances(tree, **rings, view, options);
        auto bounds = lit_cut_rings(sight.object, sight.cache);
        if (!bounds) return bounds.error();
        return perception::lit_safe_distances(tree, **rings, std::move(*bounds), view, options);
    }
    const auto by_errors = [&](const vdtree::VertexTree& of) {
        return decision.masking
                   ? perception::masked_error_distances(of, sight.object.placement, *decision.masking, view, options)
                   : perception::error_distances(of, view, options);
    };
    if (!sight.lighting) return by_errors(tree);
    const auto lit = sight.cache.lit_folds->under(tree, *sight.lighting);
    if (!lit) return lit.error();
    if (!casts_shadows(sight)) return by_errors(*lit);
    std::vector<perception::TreeAsLit> all;
    all.push_back({lit->share(), *sight.lighting});
    for (vdtree::Lighting& left : without_hidden(*sight.lighting)) {
        const auto darker = sight.cache.lit_folds->under(tree, left);
        if (!darker) return darker.error();
        all.push_back({darker->share(), std::move(left)});
    }
    return decision.masking
               ? perception::masked_error_distances(all, sight.object.placement, *decision.masking, view, options)
               : perception::error_distances(all, view, options);
}

// Of all objects that are looked at alike.
Result<std::shared_ptr<const perception::ShadowEdges>> edges_of(const Sight& sight, const Decision& decision,
                                                                const Key& key) {
    if (!casts_shadows(sight) || !is_perceptual(decision.test)) return std::shared_ptr<const perception::ShadowEdges>();
    // A highlight may be all there is on what is otherwise black.
    const double ambient = sight.lighting->specular > 0 ? 0 : sight.lighting->ambient;
    const SceneShadows::EdgesKey edges_key{key.lens, ambient, key.farthest_gaze_px, key.csf};
    SceneShadows& all = sight.scene_shadows;
    std::erase_if(all.known_edges, [](const auto& known) { return known.edges.expired(); });
    const auto found = std::ranges::find(all.known_edges, edges_key, &SceneShadows::KnownEdges::key);
    if (found != all.known_edges.end()) return all.last_edges = found->edges.lock();
    perception::FoldTestOptions options = test_options(sight, decision.request);
    if (key.farthest_gaze_px) options.gaze_px = vdtree::axis_px(sight.view) + glm::dvec2(*key.farthest_gaze_px, 0);
    auto made = perception::ShadowEdges::create(sight.view, options, ambient);
    if (!made) return made.error();
    all.last_edges = std::make_shared<const perception::ShadowEdges>(std::move(*made));
    all.known_edges.push_back({edges_key, all.last_edges});
    return all.last_edges;
}

vdtree::Lighting in_world(vdtree::Lighting lighting, const Object& object) {
    const vdtree::Similarity& placement = object.placement;
    for (vdtree::LightSource& light : lighting.lights) {
        light.direction = glm::normalize(placement.rotation * light.direction);
        light.position = placement.to_world(object.tree.origin() + light.position);
        light.distance *= placement.scale;
    }
    return lighting;
}

std::vector<Standing> all_standing(const SceneShadows& all) {
    std::vector<Standing> standing;
    for (std::size_t i = 0; i < all.scene.objects.size(); ++i) {
        const Object& object = all.scene.objects[i];
        Standing one{&object, all.caches[i]->light_bounds.get()};
        const bool shows_through = object.tree.bounds()[vdtree::VertexTree::root()].flags & vdtree::translucent_ring;
        one.hides_back_faces = !shows_through && object.tree.closedness() != vdtree::Closedness::open;
        standing.push_back(one);
    }
    for (const Object& object : all.scene.backdrop) standing.push_back({&object});
    return standing;
}

// Of lights that move: everywhere. To look at them anew in each frame takes longer than it spares.
LitReceivers lit_by(const ShadowReceivers& receivers, vdtree::Lighting lighting, bool stands_still) {
    LitReceivers lit{std::move(lighting), {}};
    for (const vdtree::LightSource& light : lit.lighting.lights)
        if (light.casts_shadow)
            lit.of_lights.push_back(stands_still ? receivers.find_lit(light)
                                                 : std::vector<bool>(receivers.balls().size(), true));
    return lit;
}

// Where shadows count for a cut. Kept for views from nearby.
std::shared_ptr<const ShadowReach> reach_of(const Sight& sight, const Decision& decision,
                                            const std::shared_ptr<const perception::ShadowEdges>& edges) {
    SceneShadows& all = sight.scene_shadows;
    std::shared_ptr<const ShadowReach>& reach = sight.memory.reach;
    const vdtree::Lighting lighting = in_world(*sight.lighting, sight.object);
    std::span<const vdtree::Plane> window;
    if (decision.request.purpose == Purpose::picture) window = *sight.window;
    if (reach && reach->holds_for(lighting, edges.get(), sight.view.eye, window)) return reach;
    if (!all.receivers) all.receivers.emplace(all_standing(all));
    if (!all.lit || !is_alike(all.lit->lighting, lighting))
        all.lit = lit_by(*all.receivers, lighting, sight.lights->stands_still());
    const bool moves = reach && !reach->is_of(sight.view.eye, window); // the first view may be the only one
    reach = std::make_shared<const ShadowReach>(*all.receivers, *all.lit, edges, sight.view.eye, window, moves);
    return reach;
}

vdtree::Viewpoint viewpoint_of(const Sight& sight, const Decision& decision) {
    // Where all is seen, a turning window must not cost anything.
    const bool window_only = decision.request.purpose == Purpose::picture && !may_cast_anything(sight, decision) &&
                             !is_wholly_in_window(sight);
    vdtree::Viewpoint viewpoint = perception::viewpoint_of(
        sight.object.tree, sight.view, test_options(sight, decision.request), sight.object.placement, window_only);
    if (sight.lighting && decision.test != FoldTest::error) viewpoint.lighting = *sight.lighting;
    if (folds_hidden(sight, decision)) {
        const auto spheres = inner_spheres(sight.object, sight.cache);
        // An orthographic view that shows a small part stands for eyes so near that they may lie among the spheres.
        std::copy_if(spheres.begin(), spheres.end(), std::back_inserter(viewpoint.occluders), [&](const auto& sphere) {
            return glm::length(glm::dvec3(sphere.centre) - viewpoint.eye) >
                   static_cast<double>(sphere.radius) + viewpoint.eye_spread;
        });
    }
    return viewpoint;
}

vdtree::FollowOptions follow_options(const Sight& sight, const Request& request) {
    vdtree::FollowOptions options;
    options.threshold = static_cast<float>(request.threshold);
    options.milliseconds = request.milliseconds;
    options.cull_back_faces = request.purpose == Purpose::picture && culls_back_faces(sight);
    if (request.goal.kind == Goal::Kind::budget) {
        options.triangle_budget = request.goal.triangles;
        options.fill_budget = request.goal.fill;
        options.hysteresis = request.hysteresis;
    }
    return options;
}

} // namespace

struct KeptCriterion {
    Key key;
    vdtree::DistanceCriterion criterion;
    std::shared_ptr<const perception::ShadowEdges> edges; // where lights cast shadows; else null
};

bool casts_shadows(const Sight& sight) { return sight.lighting && vdtree::shadow_lights(*sight.lighting) > 0; }

bool may_cast_anything(const Sight& sight, const Decision& decision) {
    return casts_shadows(sight) && !(is_perceptual(decision) && decision.request.keeps_shadows);
}

namespace {

// Objects with one tree share all but what their own lights make of it.
std::shared_ptr<const KeptCriterion>& criterion_of(const Sight& sight, const Key& key) {
    return key.still_lights ? sight.lit_criterion : sight.cache.criterion;
}

// Of what may move unseen: so much is left to a moving eye before a criterion is made anew.
constexpr double share_left_to_motion = 0.7;
// More nodes than this share beyond those that have to be are not kept.
constexpr double most_kept_too_many = 0.25;

// Outlines whose shadows would move visibly, as of now in the sight's state. Whether they are others than before.
bool find_shadowing_outlines(const Sight& sight, const Decision& decision,
                             const std::shared_ptr<const KeptCriterion>& base) {
    const vdtree::VertexTree& tree = sight.object.tree;
    const vdtree::DistanceCriterion::Parts& parts = base->criterion.parts();
    const bool is_measured = base->key.test == FoldTest::error; // what folds move, and where they face in any cut
    const auto still = is_measured ? sight.lighting : nullptr;
    const double threshold = decision.request.threshold;
    ShadowState& state = shadow_of(sight);
    const bool is_new = state.of != base || state.lighting != still || state.threshold != threshold;
    if (is_new) {
        state = {base, still, {}, nullptr, threshold, {}, nullptr};
        state.shifts = is_measured ? outline_shifts(tree, parts.silhouette_lengths, parts.facing, still.get())
                                   : outline_shifts(tree, tree.displacement(), {}, nullptr);
    }
    const auto reach = reach_of(sight, decision, base->edges);
    const bool is_first = !state.reach;
    if (state.reach == reach) return false;
    state.reach = reach;
    if (!is_first) {
        const auto needed = shadowing_outlines(sight.object, state.shifts, *reach, threshold);
        const auto most = static_cast<std::size_t>((1 + most_kept_too_many) * static_cast<double>(count(needed)));
        if (contains(state.kept, needed) && count(state.kept) <= most) return false;
    }
    const double share = reach->moves() ? share_left_to_motion : 1;
    auto kept = shadowing_outlines(sight.object, state.shifts, *reach, share * threshold);
    const bool is_other = is_first || kept != state.kept;
    state.kept = std::move(kept);
    return is_other;
}

// The criterion, and outlines kept whose shadows would move visibly.
Result<std::shared_ptr<const vdtree::DistanceCriterion>>
keep_outlines(const Sight& sight, const Decision& decision, const std::shared_ptr<const KeptCriterion>& base) {
    ShadowState& state = shadow_of(sight);
    if (!find_shadowing_outlines(sight, decision, base) && state.criterion) return state.criterion;
    if (count(state.kept) == 0) {
        state.criterion = {base, &base->criterion};
        return state.criterion;
    }
    auto kept = vdtree::keeping(sight.object.tree, base->criterion, state.kept);
    if (!kept) return kept.error();
    state.criterion = std::make_shared<const vdtree::DistanceCriterion>(std::move(*kept));
    return state.criterion;
}

} // namespace

Result<Decision> decide(const Sight& sight, const Request& request, std::size_t object) {
    if (request.shown && request.shown->view() != sight.view)
        return invalid_field("{request.shown} is of another view.");
    if (!request.masking.empty() && object >= request.masking.size())
        return invalid_field("{request.masking} has fewer pictures than the scene has objects.");
    if (!request.masking.empty() && request.masking[object].view() != sight.view)
        return invalid_field("{request.masking} is of another view.");
    const bool folds = request.goal.kind != Goal::Kind::full;
    const bool has_errors =
        sight.lighting ? sight.cache.lit_folds.has_value() : perception::has_fold_measurement(sight.object.tree);
    Choice choice = suitable_test(sight, request.chroma, folds && request.may_measure);
    if (!folds) return Decision{request, choice.test, choice.why};
    if (request.goal.kind == Goal::Kind::pixels) choice = {FoldTest::extent};
    if (request.fold_test) choice = {*request.fold_test};
    if (const auto known = check_knowledge(sight, choice.test, request.chroma, request.shown.has_value()); !known)
        return known.error();
    const bool measures = choice.test == FoldTest::error && !has_errors;
    if (measures && !request.may_measure)
        return invalid_field(
            "{request.fold_test = }error goes by errors that the tree does not hold: allow {request.may_measure}, or "
            "call {session::measured()}.");
    const bool is_masked = !request.masking.empty() && choice.test == FoldTest::error && !why_unmasked(sight);
    return Decision{request, choice.test, choice.why, measures, is_masked ? &request.masking[object] : nullptr};
}

const char* why_unmasked(const Sight& sight) {
    if (sight.observer.gaze && sight.observer.gaze->margin_deg > 0) return "the gaze is not known for sure";
    if (sight.observer.velocity > perception::least_velocity) return "what moves over the retina masks otherwise";
    if (is_translucent(sight)) return "what is behind the object may show through it";
    return nullptr;
}

bool is_perceptual(const Decision& decision) {
    return decision.request.goal.kind != Goal::Kind::full && is_perceptual(decision.test);
}

bool is_translucent(const Sight& sight) {
    return sight.object.tree.bounds()[vdtree::VertexTree::root()].flags & vdtree::translucent_ring;
}

bool culls_back_faces(const Sight& sight) {
    const WorldSphere sphere = world_sphere(sight.object);
    return !is_translucent(sight) && sight.object.tree.closedness() != vdtree::Closedness::open &&
           !is_around_eye(sphere, sight.view);
}

bool is_out_of_sight(const Sight& sight, const Decision& decision) {
    if (decision.request.purpose != Purpose::picture || may_cast_anything(sight, decision)) return false;
    const WorldSphere sphere = sphere_of_all(sight.object, sight.cache);
    const glm::dvec3 away = sphere.centre - sight.view.eye;
    // Far more than planes and spheres in single floats are off by.
    const double margin = 1e-3 * sphere.radius + 1e-5 * glm::length(away);
    const bool is_out = std::any_of(sight.window->begin(), sight.window->end(), [&](const vdtree::Plane& plane) {
        return glm::dot(plane.normal, away) + plane.offset < -(sphere.radius + margin);
    });
    if (!is_out || !casts_shadows(sight)) return is_out;
    const std::shared_ptr<const KeptCriterion>& last = criterion_of(sight, key_of(sight, decision));
    const WorldSphere cast{sphere.centre, cast_radii * sphere.radius};
    return last && last->key == key_of(sight, decision) && last->edges &&
           std::isinf(reach_of(sight, decision, last->edges)->unseen_shift(cast));
}

// Extent and displacement look at supports, which do not contain all that a fold changes.
bool folds_hidden(const Sight& sight, const Decision& decision) {
    return decision.request.purpose == Purpose::picture && is_perceptual(decision) &&
           !may_cast_anything(sight, decision) && culls_back_faces(sight);
}

bool folds_unseen(const Sight& sight, const Decision& decision) {
    return decision.request.shown && is_perceptual(decision) && !is_translucent(sight);
}

Result<CutRecipe> make_recipe(const Sight& sight, const Decision& decision) {
    const Key key = key_of(sight, decision);
    // What a view masks is of that view alone.
    std::shared_ptr<const KeptCriterion>& last = criterion_of(sight, key);
    std::shared_ptr<const KeptCriterion> masked;
    if (decision.masking || !last || !(last->key == key)) {
        auto made = make_criterion(sight, decision, key);
        if (!made) return made.error();
        auto edges = edges_of(sight, decision, key);
        if (!edges) return edges.error();
        (decision.masking ? masked : last) =
            std::make_shared<const KeptCriterion>(KeptCriterion{key, std::move(*made), std::move(*edges)});
    }
    const auto& kept = decision.masking ? masked : last;
    CutRecipe recipe{{kept, &kept->criterion}, viewpoint_of(sight, decision), follow_options(sight, decision.request)};
    if (!folds_unseen(sight, decision)) {
        if (!kept->edges || !decision.request.keeps_shadows) return recipe;
        auto with_outlines = keep_outlines(sight, decision, kept);
        if (!with_outlines) return with_outlines.error();
        recipe.criterion = std::move(*with_outlines);
        return recipe;
    }
    const auto hidden = vdtree::find_hidden(sight.object.tree, sight.object.placement, *decision.request.shown);
    if (!hidden) return hidden.error();
    auto without = vdtree::folding_hidden(sight.object.tree, kept->criterion, *hidden);
    if (!without) return without.error();
    if (kept->edges && decision.request.keeps_shadows) { // what is hidden may cast shadows that are not
        find_shadowing_outlines(sight, decision, kept);
        shadow_of(sight).criterion.reset();
        without = vdtree::keeping(sight.object.tree, *without, shadow_of(sight).kept);
        if (!without) return without.error();
    }
    recipe.criterion = std::make_shared<const vdtree::DistanceCriterion>(std::move(*without));
    return recipe;
}

} // namespace unseen::session
