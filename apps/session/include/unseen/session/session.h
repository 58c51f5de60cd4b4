// session: from a scene, an observer and a request to cuts, as the command `unseen` makes them. Include this first.
//
// A Scene holds objects, lights and a background, from files or made by the program. A Session puts an Observer
// (display, sensitivity, gaze) before the scene and answers any number of requests. A Request says what is wanted, a
// Plan how it would be met and why, and a Simplification holds the cuts. A Follower keeps cuts up to date while the
// view moves.
//
//     auto scene = session::Scene::load("bunny.ply");
//     auto session = session::Session::create(std::move(*scene));
//     auto small = session->simplify({.goal = session::Goal::imperceptible()});
//     meshio::write_mesh("small.ply", small->mesh().view());
//
// It needs no command line and no OpenGL, and prints nothing: Messages receive notes and warnings.
#pragma once

#include <unseen/perception/criterion.h>
#include <unseen/session/follower.h>
#include <unseen/session/gaze_player.h>
#include <unseen/session/level_chain.h>
#include <unseen/session/load.h>
#include <unseen/session/observer.h>
#include <unseen/session/request.h>
#include <unseen/session/scene.h>
#include <unseen/session/selection.h>
#include <unseen/session/simplification.h>

namespace unseen::session {

struct WorldSphere {
    glm::dvec3 centre = glm::dvec3(0);
    double radius = 0;
};
WorldSphere world_sphere(const Object& object); // around its triangles
// Whether a part of it may be in the window. False only if it is outside of one side of the window or behind the eye.
bool is_in_sight(const WorldSphere& sphere, const vdtree::View& view);
bool is_around_eye(const WorldSphere& sphere, const vdtree::View& view); // false for orthographic views

// Everything that the cut of one object is made by, for programs that make cuts themselves.
struct CutRecipe {
    std::shared_ptr<const vdtree::DistanceCriterion> criterion; // the same for views that differ in eye and gaze alone
    vdtree::Viewpoint viewpoint;                                // in the object's frame
    vdtree::FollowOptions options;                              // threshold, budget and time of the request
    // What folds cost by the fold test alone, where the criterion also counts what adds up in the picture; else null.
    std::shared_ptr<const vdtree::DistanceCriterion> fold_test = {};
};

// A scene before an observer. It caches whatever helps the next request: criteria, sensitivity tables, and what is
// derived from a tree alone. The cache never changes an answer, except that measured errors stay
// (Request::may_measure). For one thread at a time.
class Session {
public:
    // Fails if the scene has no objects (unless it was read from a scene file), or if the display is invalid or cannot
    // show the background. `messages` say what takes long.
    static Result<Session> create(Scene scene, Observer observer = {}, Messages messages = {});
    Session(Session&&) noexcept = default;
    Session& operator=(Session&&) noexcept = default;

    // Another handle to the same session, which lives as long as any of its handles.
    Session share() const;

    const Scene& scene() const noexcept;
    // Replaced when its errors are measured. Ends the program if there is no such object.
    const vdtree::VertexTree& tree(std::size_t object = 0) const noexcept;
    const Observer& observer() const noexcept;
    float background() const noexcept; // relative luminance

    // From now on.
    void set_gaze(std::optional<Gaze> gaze); // precondition: finite, the margin 0 or more
    void set_time(double seconds);           // of lights that move; precondition: finite
    // Precondition: 0 to perception::fastest_velocity. When it falls, followers refine at once.
    void set_velocity(perception::DegreesPerSecond velocity);

    std::uint64_t triangle_count() const noexcept; // of all objects; shared trees count once for each object

    // The sphere around all objects; if there are none, around the backdrop, or of radius 0 at the world's origin.
    WorldSphere bounding_sphere() const;
    // A view from `direction` (towards the eye) in which the sphere takes the share `fill` of the window's height. Size
    // and field come from `window`.
    vdtree::View frame(glm::dvec3 direction, double fill, const vdtree::View& window) const;
    // A view through the camera of the scene's file, if it has one. The size comes from `window`.
    std::optional<vdtree::View> camera_view(const vdtree::View& window) const;
    // That view, or one from +Z with 90% filled: 1024 x 1024 pixels, with the field that they fill on the display.
    vdtree::View default_view() const;

    // How a request would be met for an object. All of the following fail on invalid requests and views, on objects
    // that do not exist, on fold tests that cannot handle the scene, and if a light is at a vertex or inside an object.
    Result<Plan> plan(const vdtree::View& view, const Request& request, std::size_t object = 0) const;

    // The plans of all objects. Measures the errors of folds if a plan needs them: some 25 us a node, in parallel. That
    // replaces trees, so call this before using them elsewhere. simplify() and Follower::follow() call it themselves.
    Result<std::vector<Plan>> prepare(const vdtree::View& view, const Request& request);

    // The cuts that meet the request in this view, from scratch. All objects share a budget such that the largest fold
    // cost is minimal. With several objects, budgets can be neither filled nor limited in time. Cost: a microsecond a
    // node test.
    Result<Simplification> simplify(const vdtree::View& view, const Request& request = {});
    Result<Simplification> simplify(const Request& request = {}) { return simplify(default_view(), request); }

    // Fails, too, for the full model, which needs no recipe.
    Result<CutRecipe> recipe(const vdtree::View& view, const Request& request, std::size_t object = 0);

    // The scene's lights in an object's frame, at the session's time and for the view. Empty: the tree has its own
    // light.
    Result<std::optional<vdtree::Lighting>> lighting(const vdtree::View& view, std::size_t object = 0) const;

    // The same for a part of the backdrop.
    Result<std::optional<vdtree::Lighting>> backdrop_lighting(const vdtree::View& view, std::size_t part) const;

    // The luminance that silhouettes can be seen against.
    Result<perception::SceneLuminance> luminance(const vdtree::View& view) const;

private:
    friend class Follower;
    class State;
    explicit Session(std::shared_ptr<State> state) : state_(std::move(state)) {}

    std::shared_ptr<State> state_; // shared by all handles and followers
};

} // namespace unseen::session
