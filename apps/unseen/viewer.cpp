#include "viewer.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <ctime>
#include <future>
#include <limits>
#include <tuple>
#include <utility>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/trigonometric.hpp>

#include <unseen/perception/image.h>
#include <unseen/session_gpu/scene_renderer.h>
#include <unseen/vdtree/internal/stopwatch.h>

#include "session_options.h"
#include "terminal.h"
#include "viewer_overlay.h"
#include "viewer_text.h"

namespace unseen::app {

namespace {

using vdtree::Clock;

constexpr double turn_per_window = 3.2;                      // radians for a drag across the window's height
constexpr double zoom_per_notch = 0.9;                       // of the distance
constexpr double nearest_radii = 1e-3, farthest_radii = 1e4; // distance to the target, in radii of the model
constexpr double steepest_cosine = 0.999; // between line of sight and up: beyond, the picture would tumble
constexpr double budget_step = 1.25;
constexpr double idle_seconds = 0.25;                 // a look at the window's state even without events
constexpr double text_line_px = 18;                   // where the screen's scale is 1 ...
constexpr double lines_of_window = 56;                // ... and never less than this share of the window's height
constexpr std::chrono::milliseconds times_shown{250}; // numbers that change faster cannot be read
constexpr std::chrono::seconds message_shown{6};
// Pictures of a moving view that come later than this are replaced by coarse ones, until it has rested so long.
constexpr double latest_ms = 50;
constexpr double rest_seconds = 0.15;
constexpr double first_draft = 30'000, least_draft = 2'000, most_draft = 1e6; // triangles
// Larger models begin with a coarse picture: what others need takes a second for some 700,000 triangles.
constexpr std::uint64_t soon_made = 200'000;
constexpr double most_margin_deg = 89; // beyond, a gaze may be anywhere on the screen, and its ring is none

std::uint32_t budget_of(std::uint64_t triangles) {
    return static_cast<std::uint32_t>(
        std::clamp<std::uint64_t>(triangles, 1, std::numeric_limits<std::uint32_t>::max()));
}

// The mean of the last frames, taken anew a few times a second.
class FrameTimes {
public:
    void add(double frame_ms, double adapt_ms) {
        frame_sum_ += frame_ms;
        adapt_sum_ += adapt_ms;
        ++frames_;
        const auto now = Clock::now();
        if (frame_ms_ && now - taken_ < times_shown) return;
        frame_ms_ = std::exchange(frame_sum_, 0) / frames_;
        adapt_ms_ = std::exchange(adapt_sum_, 0) / std::exchange(frames_, 0);
        taken_ = now;
    }
    std::optional<double> frame_ms() const { return frame_ms_; }
    std::optional<double> adapt_ms() const { return adapt_ms_; }

private:
    double frame_sum_ = 0, adapt_sum_ = 0;
    int frames_ = 0;
    Clock::time_point taken_;
    std::optional<double> frame_ms_, adapt_ms_;
};

// Cuts that are soon made, of as many triangles as are soon drawn: by the sizes of triangles, which needs nothing that has
// to be made for an observer first.
class Draft {
public:
    explicit Draft(session::Session session) : session_(std::move(session)), follower_(session_) {}

    Result<session::Report> follow(const vdtree::View& view) {
        session::Request request{.goal = Goal::budget(static_cast<vdtree::Index>(triangles_))};
        request.fold_test = session::FoldTest::extent;
        request.purpose = session::Purpose::flight;
        request.may_measure = request.reasons = false;
        return follower_.follow(view, request);
    }
    // So many triangles the next time that a frame takes about as long as it may.
    void took(double frame_ms) {
        constexpr double fastest = 2; // change from frame to frame
        triangles_ = std::clamp(triangles_ * std::clamp(0.7 * latest_ms / frame_ms, 1 / fastest, fastest), least_draft,
                                most_draft);
    }
    session::Session& session() { return session_; }
    const session::Session& session() const { return session_; }
    const session::Follower& follower() const { return follower_; }

private:
    session::Session session_;
    session::Follower follower_;
    double triangles_ = first_draft;
};

class Viewer {
public:
    Viewer(session::Session& session, Draft draft, session::GazePlayer gaze, const ViewerOptions& options,
           render::Context& context, session::SceneRenderer renderer)
        : session_(session), draft_(std::move(draft)), options_(options), context_(context),
          window_(context.glfw_window()), renderer_(std::move(renderer)), overlay_(context), follower_(session),
          view_(options.first_view), request_(options.what.request_for(session.triangle_count())),
          gaze_px_(options.what.gaze_px), draw_(options.draw),
          gaze_follows_pointer_(options.gaze_source == session::GazeSource::mouse), gaze_(std::move(gaze)) {
        request_.purpose = session::Purpose::flight;
        request_.may_measure = false; // nobody waits for that here
        request_.reasons = false;
        draw_.background = session.background();
        const Goal& goal = request_.goal;
        budget_ = goal.kind == Goal::Kind::budget ? goal.triangles : budget_of(session.triangle_count() / 4);
        listen();
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
                frame += !is_draft_;
            }
            if (options_.frames > 0) {
                if (frame >= options_.frames) break;
                needs_frame_ = true;
                glfwPollEvents();
            } else if (needs_frame_) {
                glfwPollEvents();
            } else {
                glfwWaitEventsTimeout(is_draft_ ? rest_seconds : idle_seconds);
                needs_frame_ |= is_draft_ && !is_making();
            }
            if (!message_.empty() && Clock::now() > message_end_) say({});
        }
        glfwHideWindow(window_);
        if (const std::string why = renderer_.why_whole(); !why.empty())
            print_note("whole index buffers were uploaded: " + why);
        return options_.screenshot.empty() ? Result<void>() : save_picture(options_.screenshot);
    }

private:
    static Viewer& of(GLFWwindow* window) { return *static_cast<Viewer*>(glfwGetWindowUserPointer(window)); }

    // ---- input ----

    void listen() {
        glfwSetWindowUserPointer(window_, this);
        glfwSetCharCallback(window_, [](GLFWwindow* w, unsigned c) { of(w).on_character(c); });
        glfwSetKeyCallback(window_, [](GLFWwindow* w, int key, int, int action, int) {
            if (key == GLFW_KEY_ESCAPE && action == GLFW_PRESS) glfwSetWindowShouldClose(w, GLFW_TRUE);
        });
        glfwSetMouseButtonCallback(window_, [](GLFWwindow* w, int button, int action, int modifiers) {
            of(w).on_button(button, action == GLFW_PRESS, (modifiers & GLFW_MOD_SHIFT) != 0);
        });
        glfwSetCursorPosCallback(window_, [](GLFWwindow* w, double x, double y) { of(w).on_pointer({x, y}); });
        glfwSetScrollCallback(window_, [](GLFWwindow* w, double, double notches) { of(w).on_wheel(notches); });
        glfwSetFramebufferSizeCallback(window_, [](GLFWwindow* w, int, int) { of(w).needs_frame_ = true; });
        glfwSetWindowRefreshCallback(window_, [](GLFWwindow* w) { of(w).needs_frame_ = true; });
        glm::dvec2 at(0);
        glfwGetCursorPos(window_, &at.x, &at.y);
        pointer_px_ = at * pixels_per_unit();
    }

    void on_character(unsigned character) {
        needs_frame_ = true;
        switch (character) {
        case '1': choose(Goal::full()); break;
        case '2': choose(Goal::imperceptible()); break;
        case '3': choose(Goal::budget(budget_)); break;
        case '4':
            choose(Goal::imperceptible());
            if (view_.orthographic_height) switch_projection(); // where there is no gaze
            gaze_px_ = pointer_px_;
            gaze_follows_pointer_ = true;
            break;
        case '=': // where + is on the same key
        case '+': scale_budget(budget_step); break;
        case '-': scale_budget(1 / budget_step); break;
        case 'o': switch_projection(); break;
        case 'w': draw_.wireframe = !draw_.wireframe; break;
        case 'f':
            draw_.shading = draw_.shading == render::Shading::flat ? render::Shading::smooth : render::Shading::flat;
            break;
        case 'r':
            view_ = options_.first_view;
            follow_window_size();
            break;
        case 's': {
            const std::string file = screenshot_name();
            tell_of(save_picture(file), file);
            break;
        }
        case 'S': saves_window_ = true; break;
        case 'i': shows_overlay_ = !shows_overlay_; break;
        case 'h':
            shows_keys_ = !(shows_keys_ && shows_overlay_);
            shows_overlay_ = true;
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
        drop_unfit_test();
        gaze_px_.reset();
        gaze_follows_pointer_ = plays_gaze_ = false;
    }
    // What was asked for may not do for this goal, or would have to be measured.
    void drop_unfit_test() {
        if (!session().scene().objects.empty() && !session().plan(view_, request_)) request_.fold_test.reset();
    }

    void scale_budget(double factor) {
        const double wanted = std::round(budget_ * factor);
        budget_ = static_cast<std::uint32_t>(
            std::clamp(wanted, 1.0, static_cast<double>(budget_of(session().triangle_count()))));
        choose(Goal::budget(budget_));
    }

    void on_button(int button, bool is_down, bool is_shifted) {
        if (is_down) {
            drag_ = button == GLFW_MOUSE_BUTTON_LEFT && !is_shifted ? Drag::turn : Drag::move;
            drag_button_ = button;
        } else if (button == drag_button_) {
            drag_ = Drag::nothing;
        }
    }

    // GLFW's pointer is in screen coordinates, of which a pixel may have several or a share.
    glm::dvec2 pixels_per_unit() const {
        int width = 0, height = 0;
        glfwGetWindowSize(window_, &width, &height);
        return {view_.width / std::max(1.0, double(width)), view_.height / std::max(1.0, double(height))};
    }

    void on_pointer(glm::dvec2 at) {
        const glm::dvec2 px = at * pixels_per_unit(), moved = px - pointer_px_;
        pointer_px_ = px;
        if (drag_ == Drag::turn) turn(moved * (turn_per_window / std::max(1, view_.height)));
        if (drag_ == Drag::move) move(moved);
        if (gaze_follows_pointer_) {
            gaze_px_ = pointer_px_;
            needs_frame_ = true;
        }
    }

    // What is as far as the target stays under the pointer.
    void move(glm::dvec2 px) {
        const vdtree::CameraFrame frame = vdtree::camera_frame(view_);
        const glm::dvec3 shift =
            (px.y * frame.up - px.x * frame.right) * (distance() * height_per_distance() / std::max(1, view_.height));
        view_.eye += shift;
        view_.target += shift;
        note_move();
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
        note_move();
    }

    void on_wheel(double notches) {
        const double radius = std::max(session().bounding_sphere().radius, 1e-30);
        const double wanted =
            std::clamp(distance() * std::pow(zoom_per_notch, notches), nearest_radii * radius, farthest_radii * radius);
        if (view_.orthographic_height) view_.orthographic_height = wanted * height_per_distance();
        else view_.eye = view_.target + glm::normalize(view_.eye - view_.target) * wanted;
        note_move();
    }

    void note_move() {
        last_move_ = Clock::now();
        needs_frame_ = true;
    }

    // How much of the world the window's height shows in perspective, of what is that far.
    double height_per_distance() const { return 2 * std::tan(glm::radians(view_.fov_y_degrees) / 2); }

    // From the eye to the target; in a parallel view the distance at which perspective shows the target in the same size.
    double distance() const {
        return view_.orthographic_height ? *view_.orthographic_height / height_per_distance()
                                         : glm::length(view_.eye - view_.target);
    }

    // Between perspective and parallel, where what is as far as the target keeps its size.
    void switch_projection() {
        vdtree::View view = view_;
        const std::optional<session::Gaze> gaze = session().observer().gaze;
        if (view.orthographic_height) {
            view.eye = view.target + glm::normalize(view.eye - view.target) * distance();
            view.orthographic_height.reset();
        } else {
            view.orthographic_height = distance() * height_per_distance();
            session().set_gaze(std::nullopt); // there is none in parallel views
        }
        if (const auto ready = session().prepare(view, request_); !ready) {
            session().set_gaze(gaze);
            return say("The view stays as it is: " + ready.error().message, true);
        }
        view_ = view;
        if (!view.orthographic_height) return;
        gaze_px_.reset();
        gaze_follows_pointer_ = plays_gaze_ = false;
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
        if (making_.valid() && !is_making())
            if (auto made = finish_making(); !made) return made;
        const auto start = Clock::now();
        const double passed_s = std::chrono::duration<double>(start - std::exchange(last_frame_, start)).count();
        if (!making_.valid()) follower_.let_pass(passed_s);
        const double now_s = std::chrono::duration<double>(start - first_frame_).count();
        take_gaze(now_s);
        for (session::Session* each : {&draft_.session(), &session()}) each->set_time(now_s);
        const bool is_moving = vdtree::seconds_since(last_move_) < rest_seconds;
        is_draft_ = is_to_be_made() || (is_moving && whole_ms_ > latest_ms);
        auto result = is_draft_ ? draft_.follow(view_) : follower_.follow(view_, request_);
        if (!result) return result.error();
        const auto drawn = renderer_.draw_to_window(cuts(), view_, draw_);
        if (!drawn) return drawn;
        if (auto done = context_.finish(); !done) return done;
        // The first frame compiles and uploads: its time says nothing of those that follow.
        const double frame_ms = vdtree::ms_since(start);
        if (has_drawn_) times_.add(frame_ms, result->adapt_ms);
        if (is_draft_ && has_drawn_) draft_.took(frame_ms);
        if (!is_draft_) whole_ms_ = frame_ms;
        if (auto shown = show(state_of(*result)); !shown) return shown;
        // What the time limit has left to do, and what glides, goes on in the next frame.
        if (!has_drawn_ || !result->stats.is_complete || result->gliding > 0 || (plays_gaze_ && gaze_.is_moving()) ||
            (session().scene().lights && session().scene().lights->moves()))
            needs_frame_ = true;
        has_drawn_ = true;
        if (is_to_be_made() && !making_.valid()) begin_making();
        return {};
    }

    // What decides the fold test's distances, which take long to make for large models.
    using Making = std::tuple<Goal::Kind, double, double, std::optional<session::FoldTest>, bool, glm::ivec2, double,
                              std::optional<double>>;
    Making making() const {
        const Goal& goal = request_.goal;
        return {goal.kind,
                goal.summed_cost,
                goal.tolerance_px,
                request_.fold_test,
                gaze_px_ || (plays_gaze_ && options_.gaze_source != session::GazeSource::none),
                {view_.width, view_.height},
                view_.fov_y_degrees,
                view_.orthographic_height};
    }
    bool is_to_be_made() const {
        if (making_.valid()) return true;
        return session_.triangle_count() > soon_made && request_.goal.kind != Goal::Kind::full && made_ != making();
    }
    // Makes it, while drafts are shown: until it is finished the session and the follower are another thread's.
    void begin_making() {
        making_of_ = making();
        making_ = std::async(std::launch::async, [this, view = view_, request = request_]() -> Result<void> {
            const auto made = follower_.follow(view, request);
            return made ? Result<void>() : made.error();
        });
    }
    bool is_making() const {
        return making_.valid() && making_.wait_for(std::chrono::seconds(0)) != std::future_status::ready;
    }
    Result<void> finish_making() {
        const auto made = making_.get();
        made_ = making_of_;
        if (!made) return made;
        drop_unfit_test(); // for keys that came in between
        return {};
    }

    ViewerState state_of(const session::Report& report) const {
        ViewerState state{.model = options_.model,
                          .is_draft = is_draft_,
                          .goal = request_.goal,
                          .report = report,
                          .display = display(),
                          .window_px = {view_.width, view_.height},
                          .orthographic_height = view_.orthographic_height};
        if (request_.goal.kind != Goal::Kind::full && !report.fold_tests.empty() &&
            session::is_perceptual(report.fold_tests.front()))
            state.gaze = session().observer().gaze;
        state.gaze_source = gaze_follows_pointer_ ? session::GazeSource::mouse
                            : plays_gaze_         ? options_.gaze_source
                                                  : session::GazeSource::none;
        state.limit_ms = request_.milliseconds;
        state.frame_ms = times_.frame_ms();
        state.adapt_ms = times_.adapt_ms();
        return state;
    }

    // What lies over the picture, and the frame as a whole.
    Result<void> show(const ViewerState& state) {
        auto window = render::Target::foreign(context_, view_.width, view_.height);
        if (!window) return window.error();
        if (auto drawn = overlay_.draw(*window, content_for(state)); !drawn) return drawn;
        if (std::exchange(saves_window_, false)) {
            const std::string file = screenshot_name();
            tell_of(save_window(*window, file), file);
        }
        glfwSwapBuffers(window_);
        if (const std::string title = viewer_title(state); title != title_) {
            title_ = title;
            glfwSetWindowTitle(window_, title_.c_str());
        }
        return {};
    }

    OverlayContent content_for(const ViewerState& state) const {
        float scale = 1;
        glfwGetWindowContentScale(window_, &scale, nullptr);
        OverlayContent content;
        content.line_px = std::max(text_line_px * static_cast<double>(scale), view_.height / lines_of_window);
        if (shows_overlay_ || is_failure_) content.message = message_;
        if (!shows_overlay_) return content;
        content.status = viewer_lines(state);
        if (shows_keys_) content.keys = viewer_keys();
        if (!state.gaze) return content;
        const auto ring = [&](double degrees) {
            return session::gaze_circle(display(), view_, state.gaze->px, degrees);
        };
        const double margin = state.gaze->margin_deg;
        if (state.gaze_source != session::GazeSource::head)
            content.rings.push_back({ring(session::fovea_degrees), false});
        if (margin > 0 && margin < most_margin_deg) content.rings.push_back({ring(margin), true});
        return content;
    }

    // Over the picture, for a while; nothing: no more.
    void say(std::string message, bool is_failure = false) {
        message_ = std::move(message);
        is_failure_ = is_failure;
        message_end_ = Clock::now() + message_shown;
        needs_frame_ = true;
    }

    void take_gaze(double now_s) {
        session().set_gaze(plays_gaze_ ? gaze_.at(now_s, view_, gaze_px_) : gaze_.around(gaze_px_));
    }

    Result<void> save_picture(const std::string& file) {
        if (making_.valid())
            if (auto made = finish_making(); !made) return made;
        // Keys that came since the last frame count.
        take_gaze(std::chrono::duration<double>(last_frame_ - first_frame_).count());
        if (const auto result = follower_.follow(view_, request_); !result) return result.error();
        const auto frame = renderer_.draw(cuts(), view_, draw_);
        if (!frame) return frame.error();
        return perception::write_image(file, session::code_image(*frame, display()));
    }

    // With text and rings, as the window shows it.
    static Result<void> save_window(const render::Target& window, const std::string& file) {
        auto codes = render::read_colour(window);
        if (!codes) return codes.error();
        return perception::write_image(file, {window.width(), window.height(), 3, std::move(*codes)});
    }

    std::string screenshot_name() {
        std::array<char, 64> stamp;
        const std::time_t now = std::time(nullptr);
        std::tm local{};
        localtime_r(&now, &local);
        std::strftime(stamp.data(), stamp.size(), "unseen-%Y%m%d-%H%M%S", &local);
        return std::string(stamp.data()) + "-" + std::to_string(++screenshots_) + ".png";
    }

    void tell_of(const Result<void>& saved, const std::string& file) {
        if (saved) {
            print_note("wrote '" + file + "'.");
            say("Wrote " + file);
        } else {
            print_error(saved.error().message);
            say("No screenshot: " + saved.error().message, true);
        }
    }

    const perception::Display& display() const { return session().observer().display; }
    std::vector<session::DrawnCut> cuts() const {
        return session::drawn_cuts(is_draft_ ? draft_.follower() : follower_, session().scene().objects.size());
    }
    // What may be used while another thread makes what the first picture needs.
    session::Session& session() { return making_.valid() ? draft_.session() : session_; }
    const session::Session& session() const { return making_.valid() ? draft_.session() : session_; }

    session::Session& session_;
    Draft draft_;
    const ViewerOptions& options_;
    const render::Context& context_;
    GLFWwindow* window_;
    session::SceneRenderer renderer_;
    ViewerOverlay overlay_;
    session::Follower follower_;
    vdtree::View view_;
    session::Request request_;
    std::optional<glm::dvec2> gaze_px_; // the pointer's, or one that was asked for
    render::DrawOptions draw_;
    std::uint32_t budget_ = 1;
    glm::dvec2 pointer_px_ = glm::dvec2(0);
    enum class Drag { nothing, turn, move } drag_ = Drag::nothing;
    int drag_button_ = 0;
    bool gaze_follows_pointer_;
    session::GazePlayer gaze_;
    bool plays_gaze_ = true; // until a mode is chosen
    Clock::time_point first_frame_ = Clock::now();
    bool needs_frame_ = true;
    Clock::time_point last_frame_ = Clock::now();
    bool has_drawn_ = false, is_draft_ = false;
    std::optional<Making> made_;
    Making making_of_;
    double whole_ms_ = 0; // of the last frame that was no draft
    Clock::time_point last_move_;
    FrameTimes times_;
    bool shows_overlay_ = true, shows_keys_ = false;
    std::string message_;     // over the picture, until the time
    bool is_failure_ = false; // which is said even where text is hidden
    Clock::time_point message_end_;
    std::string title_;
    bool saves_window_ = false; // of the next frame
    int screenshots_ = 0;
    std::future<Result<void>> making_; // what needs the session and the follower; waited for before these go
};

} // namespace

Result<void> run_viewer(render::Context& window, session::Session& session, session::GazePlayer gaze,
                        const ViewerOptions& options) {
    session::Request request = options.what.request_for(session.triangle_count());
    request.purpose = session::Purpose::flight;
    const bool lights_move = session.scene().lights && session.scene().lights->moves();
    request.may_measure = request.fold_test || !lights_move; // else the viewer takes a test that needs none
    if (const auto ready = session.prepare(options.first_view, request); !ready) return ready.error();
    auto drafts = session::Session::create(session.scene().share(), session.observer());
    if (!drafts) return drafts.error();
    auto renderer = session::SceneRenderer::create(window, *drafts);
    if (!renderer) return renderer.error();
    glfwShowWindow(window.glfw_window());
    if (options.frames == 0) print_note("press h in the window to see its keys.");
    return Viewer(session, Draft(std::move(*drafts)), std::move(gaze), options, window, std::move(*renderer)).run();
}

} // namespace unseen::app
