#include <unseen/session/session.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include <glm/geometric.hpp>

#include <unseen/perception/fold_measurement.h>
#include <unseen/perception/internal/motion.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/number_text.h>

#include "loaded_tree.h"
#include "session_state.h"

namespace unseen::session {
namespace {

constexpr double default_fill = 0.9;
constexpr double point_radius = 1e-3; // world units: what is framed where all vertices coincide

// The smallest sphere around two.
WorldSphere united(const WorldSphere& a, const WorldSphere& b) {
    const glm::dvec3 way = b.centre - a.centre;
    const double distance = glm::length(way);
    if (distance + b.radius <= a.radius) return a;
    if (distance + a.radius <= b.radius) return b;
    const double radius = (distance + a.radius + b.radius) / 2;
    return {a.centre + way * ((radius - a.radius) / distance), radius};
}

// Around the eye. In perspective the planes go through it, and their offsets are 0.
std::vector<vdtree::Plane> window_of(const vdtree::View& view) {
    std::vector<vdtree::Plane> planes;
    std::vector<glm::dvec3> all = vdtree::inward_of_window(view);
    if (view.eye_distance != 0) all = {all[0], all[3], all[4]}; // what both eyes have in common: not the sides
    for (const glm::dvec3& inward : all) {
        const double half_up = view.orthographic_height.value_or(0) / 2,
                     half_right = half_up * view.width / view.height;
        if (view.orthographic_height) planes.push_back({inward, planes.size() < 2 ? half_right : half_up});
        else planes.push_back({glm::normalize(inward), 0});
    }
    return planes;
}

// What is kept is of the tree as it was read.
const MeasurementPlace* place_of(const Object& object) {
    const MeasurementPlace* const place = object.measurement.get();
    return place && &place->tree.data() == &object.tree.data() ? place : nullptr;
}

// As the session's users take it.
Result<std::optional<vdtree::Lighting>> copied(const Result<std::shared_ptr<const vdtree::Lighting>>& lighting) {
    if (!lighting) return lighting.error();
    return *lighting ? std::optional(**lighting) : std::nullopt;
}

Result<void> check_object(const Scene& scene, std::size_t object) {
    if (object < scene.objects.size()) return {};
    return invalid_argument("There is no object " + std::to_string(object) + ": the scene has " +
                            std::to_string(scene.objects.size()) + ", counted from 0.");
}

Plan plan_of(const Sight& sight, const Decision& decision) {
    return {decision.test, std::string(decision.why), decision.measures, effects_of(sight, decision, std::nullopt)};
}

} // namespace

// ---- what is derived from an object alone

WorldSphere world_sphere(const Object& object) {
    const vdtree::Sphere sphere = object.tree.bounding_sphere();
    return {object.placement.to_world(object.tree.origin() + glm::dvec3(sphere.centre)),
            object.placement.scale * sphere.radius};
}

bool is_in_sight(const WorldSphere& sphere, const vdtree::View& view) {
    const std::vector<vdtree::Plane> planes = window_of(view);
    return std::none_of(planes.begin(), planes.end(), [&](const vdtree::Plane& plane) {
        return glm::dot(plane.normal, sphere.centre - view.eye) + plane.offset < -sphere.radius;
    });
}

bool is_around_eye(const WorldSphere& sphere, const vdtree::View& view) {
    return !view.orthographic_height &&
           !(glm::length(view.eye - sphere.centre) > sphere.radius + view.eye_distance / 2);
}

WorldSphere sphere_of_all(const Object& object, ObjectCache& cache) {
    if (!cache.all) {
        const vdtree::VertexTree& tree = object.tree;
        vdtree::Sphere all = tree.bounding_sphere();
        const auto include = [&](const vdtree::Sphere& sphere) {
            all.radius = std::max(all.radius, glm::length(sphere.centre - all.centre) + sphere.radius);
        };
        include(tree.bounds()[vdtree::VertexTree::root()].ring);
        include(tree.support_spheres()[vdtree::VertexTree::root()]);
        cache.all = all;
    }
    return {object.placement.to_world(object.tree.origin() + glm::dvec3(cache.all->centre)),
            object.placement.scale * static_cast<double>(cache.all->radius)};
}

std::span<const vdtree::Sphere> inner_spheres(const Object& object, ObjectCache& cache) {
    if (!cache.inner_spheres) cache.inner_spheres = vdtree::inner_spheres(object.tree);
    return *cache.inner_spheres;
}

Result<std::shared_ptr<const vdtree::LightBounds>> lit_cut_rings(const Object& object, ObjectCache& cache) {
    if (!cache.lit_cut_rings) {
        const auto rings = cut_rings(object, cache);
        if (!rings) return rings.error();
        auto bounded = perception::bound_lit_cut_rings(object.tree, **rings);
        if (!bounded) return bounded.error();
        cache.lit_cut_rings = std::make_shared<const vdtree::LightBounds>(std::move(*bounded));
    }
    return cache.lit_cut_rings;
}

Result<const perception::CutRings*> cut_rings(const Object& object, ObjectCache& cache) {
    if (!cache.cut_rings) {
        auto bounded = perception::bound_cut_rings(object.tree);
        if (!bounded) return bounded.error();
        cache.cut_rings = std::move(*bounded);
    }
    return &*cache.cut_rings;
}

// ---- how objects are seen

Session::State::State(Scene scene_, Observer observer_, Messages messages_, float background_)
    : scene(std::move(scene_)), observer(std::move(observer_)), messages(std::move(messages_)), background(background_),
      caches(scene.objects.size()), tree_count(scene.objects.size(), 1),
      still_lights_(scene.objects.size() + scene.backdrop.size()), lit_stretches_(scene.objects.size()),
      lit_criteria_(scene.objects.size()), shown_criteria_(scene.objects.size()), scene_shadows_{scene, caches} {
    share_caches();
    constexpr std::uint64_t most_lit = 4'000'000; // some 100 bytes, and up to a microsecond, a node of every object
    std::uint64_t nodes = 0;
    for (const Object& object : scene.objects) nodes += object.tree.interior_count();
    is_crowded_ = nodes > most_lit;
}

// Keeps what is there.
void Session::State::share_caches() {
    std::unordered_map<const vdtree::VertexTree::Data*, std::shared_ptr<ObjectCache>> of_tree;
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
        std::shared_ptr<ObjectCache>& cache = of_tree[&scene.objects[i].tree.data()];
        if (!cache) cache = caches[i] ? caches[i] : std::make_shared<ObjectCache>();
        caches[i] = cache;
    }
}

Result<std::shared_ptr<Session::State>> Session::State::create(Scene scene, Observer observer, Messages messages) {
    if (scene.objects.empty() && scene.backdrop.empty() && !scene.is_of_file())
        return invalid_argument("A scene needs an object: load one, or add it to scene.objects.");
    if (const auto valid = perception::validate(observer.display); !valid) return valid.error();
    if (!(observer.velocity.value() >= 0 && observer.velocity <= perception::fastest_velocity))
        return invalid_field(
            "{observer.velocity} must lie in 0 to {} degrees a second, not {}.",
            {number_text(perception::fastest_velocity.value()), number_text(observer.velocity.value())});
    const auto background = relative_background(observer.display, scene.background);
    if (!background) return background.error();
    return std::shared_ptr<State>(new State(std::move(scene), std::move(observer), std::move(messages), *background));
}

using SharedLighting = std::shared_ptr<const vdtree::Lighting>;

Result<SharedLighting> Session::State::lighting(const vdtree::View& view, std::size_t item) {
    if (!scene.lights) return SharedLighting();
    const bool stands_still = scene.lights->stands_still();
    if (stands_still && still_lights_[item]) return still_lights_[item];
    const bool is_object = item < scene.objects.size();
    const Object& lit = is_object ? scene.objects[item] : scene.backdrop[item - scene.objects.size()];
    vdtree::Lighting lighting = scene.lights->at(seconds, lit.tree, view, lit.placement);
    // Walls may have lights within them: rooms are solid on the outside.
    const auto ok = is_object ? vdtree::check_lights(lit.tree, lighting) : vdtree::validate(lighting);
    if (!ok)
        return Error{ok.error().code, scene.lights->file().string() + ": " +
                                          (scene.is_of_file() ? "object '" + lit.name + "': " : std::string()) +
                                          ok.error().message};
    auto shared = std::make_shared<const vdtree::Lighting>(std::move(lighting));
    if (stands_still) still_lights_[item] = shared;
    return SharedLighting(std::move(shared));
}

Session::State::LitStretch* Session::State::stretch_of(const vdtree::View& view, std::size_t object) {
    constexpr std::size_t most_kept = 64; // of an object: a few megabytes for 100,000 nodes each
    if (!scene.lights->moves() || scene.lights->follows_camera()) return nullptr;
    const calibration::LightRig::Stretch stretch = scene.lights->stretch_at(seconds);
    auto& known = lit_stretches_[object];
    if (known.size() >= most_kept && !known.contains(stretch.number)) known.clear();
    LitStretch& own = known[stretch.number];
    if (!own.lightings) {
        std::vector<vdtree::Lighting> lightings;
        for (const double at : {stretch.begin, (stretch.begin + stretch.end) / 2, stretch.end})
            lightings.push_back(
                scene.lights->at(at, scene.objects[object].tree, view, scene.objects[object].placement));
        own.lightings = std::make_shared<const std::vector<vdtree::Lighting>>(std::move(lightings));
    }
    return &own;
}

// Everything that a moved outline may uncover. Behind a single object is the background; behind one of several may be
// another one.
perception::SceneLuminance Session::State::luminance_of(const std::vector<Sight>& sights) const {
    perception::SceneLuminance all{background, background};
    perception::ChromaRange colours = backdrop_colours_.value_or(perception::ChromaRange());
    for (const Sight& sight : sights) {
        const vdtree::VertexTree& tree = sight.object.tree;
        std::optional<perception::ChromaRange>& own_colours = sight.cache.colours;
        if (!own_colours) own_colours = perception::colour_reach(tree);
        colours = perception::unite(colours, *own_colours);
        perception::SceneLuminance own{tree.luminance_range().lo, tree.luminance_range().hi,
                                       vdtree::LuminanceRange{background, background}};
        const auto include_lit = [&](const vdtree::Lighting& lighting) {
            const auto lit =
                perception::lit_scene(tree, *sight.cache.light_bounds, lighting,
                                      vdtree::eye_in_tree(tree, sight.view, sight.object.placement), background);
            own.darkest = std::min(own.darkest, lit.darkest), own.brightest = std::max(own.brightest, lit.brightest);
        };
        if (sight.lighting) own = {background, background};
        if (sight.stretch) std::ranges::for_each(*sight.stretch, include_lit); // the same all along it
        else if (sight.lighting) include_lit(*sight.lighting);
        all.darkest = std::min(all.darkest, own.darkest);
        all.brightest = std::max(all.brightest, own.brightest);
        if (sights.size() == 1 && scene.backdrop.empty()) all.behind = own.behind;
    }
    for (const vdtree::LuminanceRange& range : backdrop_ranges_) {
        all.darkest = std::min(all.darkest, range.lo);
        all.brightest = std::max(all.brightest, range.hi);
    }
    all.colour = perception::as_luminance(colours);
    return all;
}

Result<std::shared_ptr<const perception::CsfTable>> Session::State::sensitivity() {
    auto at_rest = observer.csf ? observer.csf : perception::csf_of(observer.person);
    if (observer.velocity <= perception::least_velocity) return at_rest;
    if (!moving_ || moving_->velocity != observer.velocity || moving_->at_rest != at_rest) {
        auto made = at_rest->moving(observer.velocity);
        if (!made) return Error{made.error().code, Message::of("{observer.velocity}: ") + made.error().message + "."};
        moving_ = Moving{observer.velocity, std::move(at_rest),
                         std::make_shared<const perception::CsfTable>(std::move(*made))};
    }
    return moving_->table;
}

Result<void> Session::State::set_gaze_of(Sight& sight) {
    auto table = sensitivity();
    if (!table) return table.error();
    sight.csf = std::move(*table);
    if (!observer.gaze) return {};
    if (observer.gaze->margin_deg != 0) {
        if (!widened_ || widened_of_ != sight.csf) {
            widened_ = std::make_unique<perception::WidenedTables>(*sight.csf);
            widened_of_ = sight.csf;
        }
        auto around_gaze = widened_->at(perception::Degrees(observer.gaze->margin_deg));
        if (!around_gaze) return {}; // anything may be looked at
        sight.csf = std::move(around_gaze);
    }
    sight.gaze_px = observer.gaze->px;
    return {};
}

// What a light makes of every vertex; once where lights stand still and have no highlights that go with the eye.
Result<void> Session::State::look_at_backdrop(const vdtree::View& view) {
    if (!backdrop_colours_) {
        backdrop_colours_.emplace();
        for (const auto& item : scene.backdrop)
            backdrop_colours_ = perception::unite(*backdrop_colours_, perception::colour_reach(item.tree));
    }
    const bool stays = !scene.lights || scene.lights->stands_still();
    if (stays && backdrop_ranges_.size() == scene.backdrop.size()) return {};
    backdrop_ranges_.clear();
    for (std::size_t i = 0; i < scene.backdrop.size(); ++i) {
        const vdtree::VertexTree& tree = scene.backdrop[i].tree;
        vdtree::LuminanceRange range = tree.luminance_range();
        const auto lit = lighting(view, scene.objects.size() + i);
        if (!lit) return lit.error();
        if (*lit) {
            double brightest = 0;
            for (const vdtree::LightSource& light : (*lit)->lights) brightest += light.intensity;
            // At least the ambient light of the darkest albedo, and no more than white shows.
            range = {0, brightest > 0 ? 1.0f : static_cast<float>((*lit)->ambient)};
        }
        backdrop_ranges_.push_back(range);
    }
    return {};
}

Result<std::vector<Sight>> Session::State::look(const vdtree::View& view, ShadowMemory& memory) {
    if (const auto valid = vdtree::validate(view); !valid) return valid.error();
    window_ = window_of(view);
    memory.of_objects.resize(scene.objects.size());
    std::vector<Sight> sights;
    sights.reserve(scene.objects.size());
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
        auto lit = lighting(view, i);
        if (!lit) return lit.error();
        if ((view.orthographic_height || view.eye_distance != 0) && *lit && vdtree::shadow_lights(**lit) > 0)
            return unsupported("Where shadows are seen is not known of orthographic views, and of those of two eyes: "
                               "switch them off, or look at the scene in perspective with one eye.");
        LitStretch* const stretch = *lit ? stretch_of(view, i) : nullptr;
        if (*lit && !caches[i]->light_bounds) {
            auto bounds = vdtree::LightBounds::measure(scene.objects[i].tree);
            if (!bounds) return bounds.error();
            caches[i]->light_bounds = std::make_shared<const vdtree::LightBounds>(std::move(*bounds));
        }
        sights.push_back({scene.objects[i], i, *caches[i], stretch ? stretch->criterion : lit_criteria_[i],
                          shown_criteria_[i], scene_shadows_, memory, observer, view,
                          scene.lights ? &*scene.lights : nullptr, std::move(*lit),
                          stretch ? stretch->lightings : nullptr, &window_, background, is_crowded_});
        if (const auto set = set_gaze_of(sights.back()); !set) return set.error();
    }
    if (const auto looked = look_at_backdrop(view); !looked) return looked.error();
    const perception::SceneLuminance luminance = luminance_of(sights);
    for (Sight& sight : sights) sight.luminance = luminance;
    return sights;
}

Result<void> Session::State::measure(std::size_t object) {
    constexpr vdtree::NodeId told_from = 20'000; // nodes; about half a second on one core
    Object& of = scene.objects[object];
    const MeasurementPlace* const known = place_of(of);
    const MeasurementPlace* const place = known && known->is_of_tree_file ? known : nullptr;
    if (messages.note && of.tree.interior_count() >= told_from && !place)
        messages.note(Message::of("measuring what folds change ({session::measured()} keeps that in the tree) ..."));
    auto with_errors = measured_once(of.tree, place, messages);
    if (!with_errors) return with_errors.error();
    of.measurement.reset();
    // The same for all objects that have this tree.
    const vdtree::VertexTree before = of.tree.share();
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
        if (&scene.objects[i].tree.data() != &before.data()) continue;
        scene.objects[i].tree = with_errors->share();
        caches[i].reset();
        lit_criteria_[i].reset();
        lit_stretches_[i].clear();
        shown_criteria_[i].reset();
        ++tree_count[i];
    }
    share_caches();
    return {};
}

Result<void> Session::State::measure_under_lights(std::size_t object) {
    constexpr vdtree::NodeId told_from = 6'000; // nodes; about half a second on one core
    const Object& of = scene.objects[object];
    auto folds = measured_under_lights_once(of.tree, place_of(of), messages, of.tree.interior_count() >= told_from);
    if (!folds) return folds.error();
    caches[object]->lit_folds = std::move(*folds);
    return {};
}

Result<Prepared> Session::State::prepare(const vdtree::View& view, const Request& request, ShadowMemory& memory) {
    if (const auto valid = validate(request); !valid) return valid.error();
    auto sights = look(view, memory);
    if (!sights) return sights.error();
    std::vector<Decision> decisions;
    for (std::size_t i = 0; i < sights->size(); ++i) {
        auto decision = decide((*sights)[i], request);
        if (!decision) return decision.error();
        decisions.push_back(std::move(*decision));
    }
    if (std::none_of(decisions.begin(), decisions.end(), [](const Decision& d) { return d.measures; }))
        return Prepared{std::move(*sights), std::move(decisions)};
    const bool is_lit = scene.lights.has_value();
    for (std::size_t i = 0; i < decisions.size(); ++i) {
        if (!decisions[i].measures) continue;
        if (is_lit ? caches[i]->lit_folds.has_value() : perception::has_fold_measurement(scene.objects[i].tree))
            continue; // of another object with this tree
        if (const auto measured = is_lit ? measure_under_lights(i) : measure(i); !measured) return measured.error();
    }
    return prepare(view, request, memory); // of the other trees
}

// ---- the session

Result<Session> Session::create(Scene scene, Observer observer, Messages messages) {
    auto state = State::create(std::move(scene), std::move(observer), std::move(messages));
    if (!state) return state.error();
    return Session(std::move(*state));
}

Session Session::share() const { return Session(state_); }

const Scene& Session::scene() const noexcept { return state_->scene; }
const vdtree::VertexTree& Session::tree(std::size_t object) const noexcept {
    const auto there = check_object(state_->scene, object);
    if (!there) end_without_value(there.error());
    return state_->scene.objects[object].tree;
}
const Observer& Session::observer() const noexcept { return state_->observer; }
float Session::background() const noexcept { return state_->background; }
void Session::set_gaze(std::optional<Gaze> gaze) { state_->observer.gaze = gaze; }
void Session::set_velocity(perception::DegreesPerSecond velocity) { state_->observer.velocity = velocity; }
void Session::set_time(double seconds) { state_->seconds = seconds; }

WorldSphere Session::bounding_sphere() const {
    const Scene& scene = state_->scene;
    const std::vector<Object>& framed = scene.objects.empty() ? scene.backdrop : scene.objects;
    if (framed.empty()) return {};
    WorldSphere all = world_sphere(framed.front());
    for (const Object& object : framed) all = united(all, world_sphere(object));
    return all;
}

std::uint64_t Session::triangle_count() const noexcept {
    std::uint64_t triangles = 0;
    for (const Object& object : state_->scene.objects) triangles += object.tree.triangle_count();
    return triangles;
}

std::optional<vdtree::View> Session::camera_view(const vdtree::View& window) const {
    const auto& camera = state_->scene.camera;
    if (!camera) return std::nullopt;
    const WorldSphere sphere = bounding_sphere();
    // Orbits turn around what lies ahead.
    const double ahead = glm::dot(sphere.centre - camera->eye, camera->forward);
    const double distance = ahead > 0 ? ahead : std::max(sphere.radius, 1.0);
    vdtree::View view = window;
    view.eye = camera->eye;
    view.target = camera->eye + distance * camera->forward;
    view.up = camera->up;
    view.fov_y_degrees = camera->fov_y_degrees;
    return view;
}

vdtree::View Session::frame(glm::dvec3 direction, double fill, const vdtree::View& window) const {
    const WorldSphere sphere = bounding_sphere();
    return vdtree::frame_sphere(sphere.centre, sphere.radius > 0 ? sphere.radius : point_radius, direction, fill,
                                window);
}

vdtree::View Session::default_view() const {
    vdtree::View window;
    window.fov_y_degrees = perception::physical_field(state_->observer.display, window.height).value();
    if (const auto view = camera_view(window)) return *view;
    return frame({0, 0, 1}, default_fill, window);
}

Result<Plan> Session::plan(const vdtree::View& view, const Request& request, std::size_t object) const {
    if (const auto valid = validate(request); !valid) return valid.error();
    if (const auto there = check_object(state_->scene, object); !there) return there.error();
    ShadowMemory none{.has_one_view = true};
    auto sights = state_->look(view, none);
    if (!sights) return sights.error();
    const auto decision = decide((*sights)[object], request);
    if (!decision) return decision.error();
    return plan_of((*sights)[object], *decision);
}

Result<std::vector<Plan>> Session::prepare(const vdtree::View& view, const Request& request) {
    ShadowMemory none;
    auto prepared = state_->prepare(view, request, none);
    if (!prepared) return prepared.error();
    std::vector<Plan> plans;
    for (std::size_t i = 0; i < prepared->sights.size(); ++i)
        plans.push_back(plan_of(prepared->sights[i], prepared->decisions[i]));
    return plans;
}

Result<CutRecipe> Session::recipe(const vdtree::View& view, const Request& request, std::size_t object) {
    if (request.goal.kind == Goal::Kind::full)
        return invalid_field("{request.goal = full} folds nothing, so there is nothing to cut by.");
    if (const auto there = check_object(state_->scene, object); !there) return there.error();
    ShadowMemory none{.has_one_view = true};
    auto prepared = state_->prepare(view, request, none);
    if (!prepared) return prepared.error();
    return make_recipe(prepared->sights[object], prepared->decisions[object]);
}

Result<std::optional<vdtree::Lighting>> Session::lighting(const vdtree::View& view, std::size_t object) const {
    return copied(state_->lighting(view, object));
}

Result<std::optional<vdtree::Lighting>> Session::backdrop_lighting(const vdtree::View& view, std::size_t part) const {
    return copied(state_->lighting(view, state_->scene.objects.size() + part));
}

Result<perception::SceneLuminance> Session::luminance(const vdtree::View& view) const {
    ShadowMemory none;
    auto sights = state_->look(view, none);
    if (!sights) return sights.error();
    if (sights->empty()) return perception::SceneLuminance{state_->background, state_->background};
    return sights->front().luminance;
}

} // namespace unseen::session
