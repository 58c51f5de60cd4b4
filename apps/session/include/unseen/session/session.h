// session: from a scene, an observer and a request to cuts, as the command `unseen` makes them. The header to include
// first.
//
// A Scene is objects, lights and a background, from files or made. A Session puts an Observer (display, sensitivity,
// gaze) before it, and is asked again and again: a Request says what is wanted, a Plan how it would be met and why, a
// Simplification has the cuts. A Follower keeps cuts at what a moving view asks for.
//
//     auto scene = session::Scene::load("bunny.ply");
//     auto session = session::Session::create(std::move(*scene));
//     auto small = session->simplify({.goal = session::Goal::imperceptible()});
//     meshio::write_mesh("small.ply", small->mesh().view());
//
// No command line, no OpenGL, and nothing is printed: Messages are told what takes long.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <unseen/perception/criterion.h>
#include <unseen/perception/cut_rings.h>
#include <unseen/session/follower.h>
#include <unseen/session/gaze_player.h>
#include <unseen/session/level_chain.h>
#include <unseen/session/messages.h>
#include <unseen/session/model_file.h>
#include <unseen/session/observer.h>
#include <unseen/session/plan.h>
#include <unseen/session/request.h>
#include <unseen/session/scene.h>
#include <unseen/session/selection.h>
#include <unseen/session/selection_follower.h>
#include <unseen/session/selection_search.h>
#include <unseen/session/simplification.h>
#include <unseen/session/tree_cache.h>
#include <unseen/vdtree/criteria.h>

namespace unseen::session {

// A sphere in the world.
struct WorldSphere {
    glm::dvec3 centre = glm::dvec3(0);
    double radius = 0;
};
WorldSphere world_sphere(const Object& object); // around its triangles
// Whether any of it may be in the window: only of spheres outside of one of its sides, or behind the eye, false.
bool is_in_sight(const WorldSphere& sphere, const vdtree::View& view);
bool is_around_eye(const WorldSphere& sphere, const vdtree::View& view); // never of an orthographic view

// What Session makes the cut of one object by, for programs that make cuts themselves.
struct CutRecipe {
    std::shared_ptr<const vdtree::DistanceCriterion> criterion; // one for views that differ in eye and gaze alone
    vdtree::Viewpoint viewpoint;                                // in the object's frame
    vdtree::FollowOptions options;                              // threshold, budget and time of the request
};

// A scene before an observer, with what can be kept from one request to the next. For one thread at a time. Kept are
// criteria, sensitivity tables for unsure gazes, and what is derived from a tree alone: spheres that hide, rings of all
// cuts, bounds under lights.
class Session {
public:
    // Fails on a scene without objects that is not of a file, a background that the display does not show, and a display that is none.
    // `messages` are told what takes long.
    static Result<Session> create(Scene scene, Observer observer = {}, Messages messages = {});
    Session(Session&&) noexcept;
    Session& operator=(Session&&) noexcept;
    ~Session();

    const Scene& scene() const noexcept;
    const vdtree::VertexTree& tree(std::size_t object = 0) const noexcept; // another one once its errors are measured
    const Observer& observer() const noexcept;
    float background() const noexcept; // relative luminance

    // From now on.
    void set_gaze(std::optional<Gaze> gaze); // precondition: finite, the margin 0 or more
    void set_time(double seconds);           // of lights that move; precondition: finite
    // Precondition: 0 to perception::fastest_velocity. Followers refine at once what stands still again.
    void set_velocity(perception::DegreesPerSecond velocity);

    std::uint64_t triangle_count() const noexcept; // of all objects' trees, shared ones counted for each

    // The sphere around all objects; without any, around the backdrop, or of no size at the world's origin.
    WorldSphere bounding_sphere() const;
    // From `direction` (towards the eye), with the sphere taking the share `fill` of the window's height; size and
    // field of the window.
    vdtree::View frame(glm::dvec3 direction, double fill, const vdtree::View& window) const;
    // Through the camera of the scene's file, if it has one; size of the window. The field is the camera's.
    std::optional<vdtree::View> camera_view(const vdtree::View& window) const;
    // That, or from +Z with 90% filled: 1024 x 1024 pixels, and the field that they fill on the display.
    vdtree::View default_view() const;

    // How a request would be met for an object. All of the following fail where the request is not valid or asks for a
    // fold test that does not know the scene, on views that are none, and where a light is at a vertex or inside of an
    // object.
    Result<Plan> plan(const vdtree::View& view, const Request& request, std::size_t object = 0) const;

    // The same for all objects, and measures the errors of folds where the plan wants them: some 50 us a node, in
    // parallel. Trees change then, so call this before making anything else of them; simplify() and Follower::follow()
    // do so by themselves.
    Result<std::vector<Plan>> prepare(const vdtree::View& view, const Request& request);

    // The cuts that meet the request, from scratch: those of this view, whatever was looked at before. A budget is shared
    // by all objects, so that the largest fold cost is the least; other goals go object by object, before the luminance
    // of all of them. With several objects, budgets can be neither filled nor limited in time. Cost: a microsecond for
    // each node test.
    Result<Simplification> simplify(const vdtree::View& view, const Request& request = {});
    Result<Simplification> simplify(const Request& request = {}) { return simplify(default_view(), request); }

    // Fails, too, for the full model, which needs none.
    Result<CutRecipe> recipe(const vdtree::View& view, const Request& request, std::size_t object = 0);

    // Where the scene's lights are, in an object's frame, at the time and for the view; none: the tree's own light.
    Result<std::optional<vdtree::Lighting>> lighting(const vdtree::View& view, std::size_t object = 0) const;

    // The same of a part of the scene's backdrop.
    Result<std::optional<vdtree::Lighting>> backdrop_lighting(const vdtree::View& view, std::size_t part) const;

    // What silhouettes can be seen against.
    Result<perception::SceneLuminance> luminance(const vdtree::View& view) const;
    // Spheres inside a solid, and rings of all cuts, without their colours. Made when they are first asked for; they
    // refer to the session.
    std::span<const vdtree::Sphere> inner_spheres(std::size_t object = 0) const;
    Result<const perception::CutRings*> cut_rings(std::size_t object = 0) const;

private:
    friend class Follower;
    class State;
    explicit Session(std::shared_ptr<State> state);

    std::shared_ptr<State> state_; // shared with the session's followers
};

} // namespace unseen::session
