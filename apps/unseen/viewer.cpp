#include "viewer.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <utility>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include <perception/image.h>

#include "frame_image.h"
#include "session_options.h"
#include "terminal.h"

namespace unseen::app {

const char* const viewer_help =
    R"(Mouse: drag to turn the model, wheel to come nearer; in mode 4 you look at the pointer
  1  full model          2  imperceptible       3  budget       4  gaze-directed
  +  a larger budget     -  a smaller one
  w  wireframe           f  flat or smooth      r  the first view again
  s  screenshot          h  this help           q, Esc  quit
)";

namespace {

using Clock = std::chrono::steady_clock;

constexpr double turn_per_window = 3.2;                      // radians for a drag across the window's height
constexpr double zoom_per_notch = 0.9;                       // of the distance
constexpr double nearest_radii = 1e-3, farthest_radii = 1e4; // distance to the target, in radii of the model
constexpr double steepest_cosine = 0.999; // between line of sight and up: beyond, the picture would tumble
constexpr double budget_step = 1.25;
constexpr double idle_seconds = 0.25; // a look at the window's state even without events

double milliseconds_since(Clock::time_point start) {
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

class Viewer {
public:
    Viewer(session::Session& session, session::GazePlayer gaze, const ViewerOptions& options, render::Context& context,
           render::Renderer renderer)
        : session_(session), options_(options), window_(context.glfw_window()), renderer_(std::move(renderer)),
          follower_(session), view_(options.first_view),
          request_(options.what.request_for(session.tree().triangle_count())), gaze_px_(options.what.gaze_px),
          draw_(options.draw), gaze_follows_pointer_(options.gaze_follows_pointer), gaze_(std::move(gaze)) {
        request_.purpose = session::Purpose::picture;
        request_.may_measure = false; // nobody waits for that here
        draw_.background = session.background();
        const Goal& goal = request_.goal;
        budget_ = goal.kind == Goal::Kind::budget ? goal.triangles : std::max(1U, session.tree().triangle_count() / 4);
        glfwSetWindowUserPointer(window_, this);
        glfwSetCharCallback(window_, [](GLFWwindow* w, unsigned c) { of(w).on_character(c); });
        glfwSetKeyCallback(window_, [](GLFWwindow* w, int key, int, int action, int) {
            if (key == GLFW_KEY_ESCAPE && action == GLFW_PRESS) glfwSetWindowShouldClose(w, GLFW_TRUE);
        });
        glfwSetMouseButtonCallback(window_, [](GLFWwindow* w, int button, int action, int) {
            if (button == GLFW_MOUSE_BUTTON_LEFT) of(w).on_button(action == GLFW_PRESS);
        });
        glfwSetCursorPosCallback(window_, [](GLFWwindow* w, double x, double y) { of(w).on_pointer({x, y}); });
        glfwSetScrollCallback(window_, [](GLFWwindow* w, double, double notches) { of(w).on_wheel(notches); });
        glfwSetFramebufferSizeCallback(window_, [](GLFWwindow* w, int, int) { of(w).needs_frame_ = true; });
        glfwSetWindowRefreshCallback(window_, [](GLFWwindow* w) { of(w).needs_frame_ = true; });
    }
    Viewer(const Viewer&) = delete;
    Viewer& operator=(const Viewer&) = delete;

    Result<void> run() {
        if (auto begun = gaze_.begin(display(), view_, std::nullopt, terminal_messages()); !begun) return begun;
        if (options_.geomorph_seconds)
            if (auto set = follower_.set_glide(*options_.geomorph_seconds); !set) return set;
        for (int frame = 0; !glfwWindowShouldClose(window_);) {
            follow_window_size();
            if (needs_frame_ && view_.width > 0 && view_.height > 0) {
                if (auto drawn = draw_frame(); !drawn) return drawn;
                ++frame;
            }
            if (options_.frames > 0) {
                if (frame >= options_.frames) break;
                needs_frame_ = true;
                glfwPollEvents();
            } else if (needs_frame_) {
                glfwPollEvents();
            } else {
                glfwWaitEventsTimeout(idle_seconds);
            }
            if (failure_) return *failure_;
        }
        return options_.screenshot.empty() ? Result<void>() : save_picture(options_.screenshot);
    }

private:
    static Viewer& of(GLFWwindow* window) { return *static_cast<Viewer*>(glfwGetWindowUserPointer(window)); }

    // ---- input ----

    void on_character(unsigned character) {
        needs_frame_ = true;
        switch (character) {
        case '1': choose(Goal::full()); break;
        case '2': choose(Goal::imperceptible()); break;
        case '3': choose(Goal::budget(budget_)); break;
        case '4':
            choose(Goal::imperceptible());
            gaze_px_ = pointer_px_;
            gaze_follows_pointer_ = true;
            break;
        case '+': scale_budget(budget_step); break;
        case '-': scale_budget(1 / budget_step); break;
        case 'w': draw_.wireframe = !draw_.wireframe; break;
        case 'f':
            draw_.shading = draw_.shading == render::Shading::flat ? render::Shading::smooth : render::Shading::flat;
            break;
        case 'r':
            view_ = options_.first_view;
            follow_window_size();
            break;
        case 's': take_screenshot(); break;
        case 'h':
            std::fputs(viewer_help, stdout);
            std::fflush(stdout);
            break;
        case 'q': glfwSetWindowShouldClose(window_, GLFW_TRUE); break;
        default: break;
        }
    }

    void choose(Goal goal) {
        request_.goal = goal;
        request_.goal.fill = goal.kind == Goal::Kind::budget && options_.what.request.goal.fill;
        // The full model has no time limit; the others get theirs back.
        request_.milliseconds = goal.kind == Goal::Kind::full ? std::nullopt : options_.what.request.milliseconds;
        // What was asked for may not do for this goal, or would have to be measured.
        if (!session_.plan(view_, request_)) request_.fold_test.reset();
        gaze_px_.reset();
        gaze_follows_pointer_ = plays_gaze_ = false;
    }

    void scale_budget(double factor) {
        const double wanted = std::round(budget_ * factor);
        budget_ =
            static_cast<std::uint32_t>(std::clamp(wanted, 1.0, static_cast<double>(session_.tree().triangle_count())));
        choose(Goal::budget(budget_));
    }

    void on_button(bool is_down) { is_dragging_ = is_down; }

    void on_pointer(glm::dvec2 at) {
        // GLFW's pointer is in screen coordinates, of which a pixel may have several or a share.
        int width = 0, height = 0;
        glfwGetWindowSize(window_, &width, &height);
        const glm::dvec2 scale(view_.width / std::max(1.0, double(width)),
                               view_.height / std::max(1.0, double(height)));
        const glm::dvec2 moved = at * scale - pointer_px_;
        pointer_px_ = at * scale;
        if (is_dragging_) turn(moved * (turn_per_window / std::max(1, view_.height)));
        if (gaze_follows_pointer_) {
            gaze_px_ = pointer_px_;
            needs_frame_ = true;
        }
    }

    // Around the target: across about the up vector, up and down about the camera's right.
    void turn(glm::dvec2 radians) {
        vdtree::View& view = view_;
        const vdtree::CameraFrame frame = vdtree::camera_frame(view);
        const glm::dvec3 up = glm::normalize(view.up);
        const glm::dquat across = glm::angleAxis(-radians.x, up), over = glm::angleAxis(-radians.y, frame.right);
        const glm::dvec3 from_target = view.eye - view.target;
        glm::dvec3 turned = across * (over * from_target);
        if (std::abs(glm::dot(glm::normalize(turned), up)) > steepest_cosine) turned = across * from_target;
        view.eye = view.target + turned;
        needs_frame_ = true;
    }

    void on_wheel(double notches) {
        const double radius = std::max(session_.bounding_sphere().radius, 1e-30);
        const glm::dvec3 from_target = view_.eye - view_.target;
        const double distance = glm::length(from_target);
        const double wanted =
            std::clamp(distance * std::pow(zoom_per_notch, notches), nearest_radii * radius, farthest_radii * radius);
        view_.eye = view_.target + from_target * (wanted / distance);
        needs_frame_ = true;
    }

    void follow_window_size() {
        int width = 0, height = 0;
        glfwGetFramebufferSize(window_, &width, &height);
        if (width == view_.width && height == view_.height) return;
        view_.width = width; // both 0 while the window is minimised
        view_.height = height;
        if (!options_.has_fixed_field && height > 0)
            view_.fov_y_degrees = perception::physical_field(display(), height).value();
        needs_frame_ = true;
    }

    // ---- output ----

    Result<void> draw_frame() {
        needs_frame_ = false;
        const auto start = Clock::now();
        follower_.let_pass(std::chrono::duration<double>(start - std::exchange(last_frame_, start)).count());
        const double now_s = std::chrono::duration<double>(start - first_frame_).count();
        take_gaze(now_s);
        session_.set_time(now_s);
        auto lighting = session_.lighting(view_);
        if (!lighting) return lighting.error();
        draw_.lighting = std::move(*lighting);
        const auto result = follower_.follow(view_, request_);
        if (!result) return result.error();
        const vdtree::Geomorph* const geomorph = follower_.geomorph();
        const auto drawn = geomorph ? renderer_.draw_to_window(*geomorph, view_, draw_, placement())
                                    : renderer_.draw_to_window(follower_.cut(), view_, draw_, placement());
        if (!drawn) return drawn;
        glfwSwapBuffers(window_);
        // What the time limit has left to do, and what glides, goes on in the next frame.
        needs_frame_ = !result->stats.is_complete || result->gliding > 0 || (plays_gaze_ && gaze_.is_moving()) ||
                       (session_.scene().lights && session_.scene().lights->moves());
        show_title(*result, milliseconds_since(start));
        return {};
    }

    std::string mode_name() const {
        switch (request_.goal.kind) {
        case Goal::Kind::full: return "full";
        case Goal::Kind::budget: return "budget of " + grouped(budget_);
        case Goal::Kind::pixels: return rounded(request_.goal.tolerance_px, 3) + " pixels";
        case Goal::Kind::imperceptible: break;
        }
        return session_.observer().gaze ? "gaze-directed" : "imperceptible";
    }

    void show_title(const session::Report& s, double frame_ms) {
        std::string title = "Unseen - " + mode_name() + ": " + grouped(s.stats.triangles) + " of " +
                            grouped(s.source_triangles) + " triangles, " + rounded(s.adapt_ms, 2) + " ms to adapt, " +
                            rounded(frame_ms, 2) + " ms a frame";
        if (request_.goal.kind != Goal::Kind::full)
            title += ", " + name_of(s.fold_tests.front()) + ", unseen from " + rounded(s.imperceptible_from_m, 2) +
                     (std::isfinite(s.imperceptible_from_m) ? " m" : "");
        if (!s.stats.is_complete) title += ", time is up: to be continued";
        if (s.gliding > 0) title += ", " + grouped(s.gliding) + " vertices glide";
        glfwSetWindowTitle(window_, title.c_str());
    }

    void take_gaze(double now_s) {
        session_.set_gaze(plays_gaze_ ? gaze_.at(now_s, view_, gaze_px_) : gaze_.around(gaze_px_));
    }

    Result<void> save_picture(const std::string& file) {
        // Keys that came since the last frame count.
        take_gaze(std::chrono::duration<double>(last_frame_ - first_frame_).count());
        if (const auto result = follower_.follow(view_, request_); !result) return result.error();
        const vdtree::Geomorph* const geomorph = follower_.geomorph();
        const auto frame = geomorph ? renderer_.draw(*geomorph, view_, draw_, placement())
                                    : renderer_.draw(follower_.cut(), view_, draw_, placement());
        if (!frame) return frame.error();
        return perception::write_image(file, code_image(*frame, display()));
    }

    void take_screenshot() {
        std::array<char, 64> stamp;
        const std::time_t now = std::time(nullptr);
        std::tm local{};
        localtime_r(&now, &local);
        std::strftime(stamp.data(), stamp.size(), "unseen-%Y%m%d-%H%M%S", &local);
        const std::string file = std::string(stamp.data()) + "-" + std::to_string(++screenshots_) + ".png";
        if (auto saved = save_picture(file); !saved) failure_ = saved.error();
        else print_note("wrote '" + file + "'.");
    }

    const perception::Display& display() const { return session_.observer().display; }
    const vdtree::Similarity& placement() const { return session_.scene().objects.front().placement; }

    session::Session& session_;
    const ViewerOptions& options_;
    GLFWwindow* window_;
    render::Renderer renderer_;
    session::Follower follower_;
    vdtree::View view_;
    session::Request request_;
    std::optional<glm::dvec2> gaze_px_; // the pointer's, or one that was asked for
    render::DrawOptions draw_;
    std::uint32_t budget_ = 1;
    glm::dvec2 pointer_px_ = glm::dvec2(0);
    bool is_dragging_ = false;
    bool gaze_follows_pointer_;
    session::GazePlayer gaze_;
    bool plays_gaze_ = true; // until a mode is chosen
    Clock::time_point first_frame_ = Clock::now();
    bool needs_frame_ = true;
    Clock::time_point last_frame_ = Clock::now();
    int screenshots_ = 0;
    std::optional<Error> failure_; // of a callback, which cannot return it
};

} // namespace

Result<void> run_viewer(render::Context& window, session::Session& session, session::GazePlayer gaze,
                        const ViewerOptions& options) {
    session::Request request = options.what.request_for(session.tree().triangle_count());
    request.purpose = session::Purpose::picture;
    if (const auto ready = session.prepare(options.first_view, request); !ready) return ready.error();
    auto renderer = render::Renderer::create(window, session.tree());
    if (!renderer) return renderer.error();
    glfwShowWindow(window.glfw_window());
    return Viewer(session, std::move(gaze), options, window, std::move(*renderer)).run();
}

} // namespace unseen::app
