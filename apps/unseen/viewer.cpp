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

#include <perception/criterion.h>
#include <perception/image.h>

#include "frame_image.h"
#include "fold_test.h"
#include "simplification.h"
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
    Viewer(Scene& scene, GazePlayer gaze, const ViewerOptions& options, render::Context& context, render::Renderer renderer)
        : scene_(scene), options_(options), window_(context.glfw_window()), renderer_(std::move(renderer)),
          cut_(scene.tree), first_view_(scene.view), what_(options.what), draw_(options.draw), gaze_follows_pointer_(options.gaze_follows_pointer), gaze_(std::move(gaze)) {
        draw_.background = scene.background;
        budget_ = what_.mode == Mode::budget ? what_.triangles : std::max(1U, scene.tree.triangle_count() / 4);
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
        if (auto begun = gaze_.begin(scene_, {}); !begun) return begun;
        if (options_.geomorph_seconds)
            if (auto set = follower_.set_geomorph(scene_, *options_.geomorph_seconds); !set) return set;
        for (int frame = 0; !glfwWindowShouldClose(window_);) {
            follow_window_size();
            if (needs_frame_ && scene_.view.width > 0 && scene_.view.height > 0) {
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
        case '1': choose(Mode::full); break;
        case '2': choose(Mode::imperceptible); break;
        case '3': choose(Mode::budget); break;
        case '4':
            choose(Mode::imperceptible);
            what_.gaze_px = pointer_px_;
            gaze_follows_pointer_ = true;
            break;
        case '+': scale_budget(budget_step); break;
        case '-': scale_budget(1 / budget_step); break;
        case 'w': draw_.wireframe = !draw_.wireframe; break;
        case 'f':
            draw_.shading = draw_.shading == render::Shading::flat ? render::Shading::smooth : render::Shading::flat;
            break;
        case 'r':
            scene_.view = first_view_;
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

    void choose(Mode mode) {
        what_.mode = mode;
        what_.triangles = budget_;
        // Nobody waits for errors to be measured here.
        if (mode == Mode::imperceptible && !is_perceptual(what_.test())) what_.chosen = suitable_test(scene_, what_.chroma, false);
        what_.gaze_px.reset();
        what_.gaze_margin_deg = gaze_.tracker_error_deg();
        gaze_follows_pointer_ = plays_gaze_ = false;
    }

    void scale_budget(double factor) {
        const double wanted = std::round(budget_ * factor);
        budget_ =
            static_cast<std::uint32_t>(std::clamp(wanted, 1.0, static_cast<double>(scene_.tree.triangle_count())));
        choose(Mode::budget);
    }

    void on_button(bool is_down) { is_dragging_ = is_down; }

    void on_pointer(glm::dvec2 at) {
        // GLFW's pointer is in screen coordinates, of which a pixel may have several or a share.
        int width = 0, height = 0;
        glfwGetWindowSize(window_, &width, &height);
        const glm::dvec2 scale(scene_.view.width / std::max(1.0, double(width)),
                               scene_.view.height / std::max(1.0, double(height)));
        const glm::dvec2 moved = at * scale - pointer_px_;
        pointer_px_ = at * scale;
        if (is_dragging_) turn(moved * (turn_per_window / std::max(1, scene_.view.height)));
        if (gaze_follows_pointer_) {
            what_.gaze_px = pointer_px_;
            needs_frame_ = true;
        }
    }

    // Around the target: across about the up vector, up and down about the camera's right.
    void turn(glm::dvec2 radians) {
        vdtree::View& view = scene_.view;
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
        const double radius = std::max(placed_sphere(scene_.tree, scene_.placement).radius, 1e-30);
        const glm::dvec3 from_target = scene_.view.eye - scene_.view.target;
        const double distance = glm::length(from_target);
        const double wanted =
            std::clamp(distance * std::pow(zoom_per_notch, notches), nearest_radii * radius, farthest_radii * radius);
        scene_.view.eye = scene_.view.target + from_target * (wanted / distance);
        needs_frame_ = true;
    }

    void follow_window_size() {
        int width = 0, height = 0;
        glfwGetFramebufferSize(window_, &width, &height);
        if (width == scene_.view.width && height == scene_.view.height) return;
        scene_.view.width = width; // both 0 while the window is minimised
        scene_.view.height = height;
        if (!options_.has_fixed_field && height > 0)
            scene_.view.fov_y_degrees = perception::physical_field(scene_.display, height).value();
        needs_frame_ = true;
    }

    // ---- output ----

    Result<void> draw_frame() {
        needs_frame_ = false;
        const auto start = Clock::now();
        follower_.let_pass(std::chrono::duration<double>(start - std::exchange(last_frame_, start)).count());
        if (plays_gaze_) gaze_.apply(what_, scene_, std::chrono::duration<double>(start - first_frame_).count());
        if (auto lit = light_at(scene_, std::chrono::duration<double>(start - first_frame_).count()); !lit) return lit;
        draw_.lighting = scene_.lighting;
        const auto result = follower_.follow(cut_, scene_, what_);
        if (!result) return result.error();
        const vdtree::Geomorph* const geomorph = follower_.geomorph();
        const auto drawn = geomorph ? renderer_.draw_to_window(*geomorph, scene_.view, draw_, scene_.placement)
                                    : renderer_.draw_to_window(cut_, scene_.view, draw_, scene_.placement);
        if (!drawn) return drawn;
        glfwSwapBuffers(window_);
        // What the time limit has left to do, and what glides, goes on in the next frame.
        needs_frame_ = !result->stats.is_complete || result->gliding > 0 || (plays_gaze_ && gaze_.is_moving()) ||
                       (scene_.rig && scene_.rig->moves());
        show_title(*result, milliseconds_since(start));
        return {};
    }

    std::string mode_name() const {
        switch (what_.mode) {
        case Mode::full: return "full";
        case Mode::budget: return "budget of " + grouped(budget_);
        case Mode::pixels: return rounded(what_.pixels, 3) + " pixels";
        case Mode::imperceptible: break;
        }
        return what_.gaze_px ? "gaze-directed" : "imperceptible";
    }

    void show_title(const Simplification& s, double frame_ms) {
        std::string title = "Unseen - " + mode_name() + ": " + grouped(s.stats.triangles) + " of " +
                            grouped(s.source_triangles) + " triangles, " + rounded(s.adapt_ms, 2) + " ms to adapt, " +
                            rounded(frame_ms, 2) + " ms a frame";
        if (what_.mode != Mode::full)
            title += ", " + name_of(what_.test()) + ", unseen from " + rounded(s.imperceptible_from_m, 2) + (std::isfinite(s.imperceptible_from_m) ? " m" : "");
        if (!s.stats.is_complete) title += ", time is up: to be continued";
        if (s.gliding > 0) title += ", " + grouped(s.gliding) + " vertices glide";
        glfwSetWindowTitle(window_, title.c_str());
    }

    Result<void> save_picture(const std::string& file) {
        // Keys that came since the last frame count.
        if (const auto result = follower_.follow(cut_, scene_, what_); !result) return result.error();
        const vdtree::Geomorph* const geomorph = follower_.geomorph();
        const auto frame = geomorph ? renderer_.draw(*geomorph, scene_.view, draw_, scene_.placement)
                                    : renderer_.draw(cut_, scene_.view, draw_, scene_.placement);
        if (!frame) return frame.error();
        return perception::write_image(file, code_image(*frame, scene_.display));
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

    Scene& scene_;
    const ViewerOptions& options_;
    GLFWwindow* window_;
    render::Renderer renderer_;
    vdtree::Cut cut_;
    Follower follower_;
    vdtree::View first_view_;
    WhatOptions what_;
    render::DrawOptions draw_;
    std::uint32_t budget_ = 1;
    glm::dvec2 pointer_px_ = glm::dvec2(0);
    bool is_dragging_ = false;
    bool gaze_follows_pointer_;
    GazePlayer gaze_;
    bool plays_gaze_ = true; // until a mode is chosen
    Clock::time_point first_frame_ = Clock::now();
    bool needs_frame_ = true;
    Clock::time_point last_frame_ = Clock::now();
    int screenshots_ = 0;
    std::optional<Error> failure_; // of a callback, which cannot return it
};

} // namespace

Result<void> run_viewer(render::Context& window, Scene& scene, GazePlayer gaze, const ViewerOptions& options) {
    auto renderer = render::Renderer::create(window, scene.tree);
    if (!renderer) return renderer.error();
    glfwShowWindow(window.glfw_window());
    return Viewer(scene, std::move(gaze), options, window, std::move(*renderer)).run();
}

} // namespace unseen::app
