#include "calibration_window.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <optional>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <unseen/calibration/display_profile.h>
#include <unseen/perception/image.h>
#include <unseen/render/internal/test_pattern.h>

#include "terminal.h"

namespace unseen::app {
namespace {

using calibration::Method;
using calibration::Procedure;
using calibration::Trial;
using render::TestPattern;

constexpr double frame_wait_s = 1.0 / 120; // below a frame of most displays: presenting paces the rest
constexpr double ramp_share = 0.2;         // of an interval, to fade in and out, so that no edge in time is seen
constexpr double key_step = 0.05;          // log10 contrast an arrow key
constexpr double code_step = 1.0 / 255;
constexpr double pixels_of_cross = 9, thickness = 1.5; // half, from the middle

// The window, its keys since the last look, and the drawer of patterns.
class Stage {
public:
    static Result<std::unique_ptr<Stage>> open(const CalibrationWindowOptions& options, const std::string& title) {
        constexpr int exact_pixels = 0;
        auto context = render::Context::window({.width = options.display.width_px,
                                                .height = options.display.height_px,
                                                .title = title,
                                                .full_screen = options.full_screen,
                                                .samples = exact_pixels});
        if (!context) return context.error();
        auto drawer = render::TestPatternDrawer::create(*context, calibration::code_luminances(options.display));
        if (!drawer) return drawer.error();
        return std::unique_ptr<Stage>(new Stage(options, std::move(*context), std::move(*drawer)));
    }
    Stage(const Stage&) = delete;
    Stage& operator=(const Stage&) = delete;

    GLFWwindow* window() const { return context_.glfw_window(); }
    bool is_closed() const { return glfwWindowShouldClose(window()); }
    double seconds() const { return glfwGetTime(); }
    void set_title(const std::string& title) { glfwSetWindowTitle(window(), title.c_str()); }

    // The oldest key that nobody looked at; 0 if there is none.
    int take_key() {
        if (keys_.empty()) return 0;
        const int key = keys_.front();
        keys_.erase(keys_.begin());
        return key;
    }
    void forget_keys() { keys_.clear(); }

    Result<void> show(TestPattern pattern) {
        int width = 0, height = 0;
        glfwGetFramebufferSize(window(), &width, &height);
        if (width > 0 && height > 0) {
            pattern.frame = frame_++;
            place_marks(pattern, width, height);
            if (auto drawn = drawer_.draw_to_window(pattern, width, height); !drawn) return drawn;
            last_ = pattern;
            glfwSwapBuffers(window());
        }
        glfwWaitEventsTimeout(frame_wait_s);
        return {};
    }

    Result<void> save_screenshot() {
        int width = 0, height = 0;
        glfwGetFramebufferSize(window(), &width, &height);
        auto codes = drawer_.draw(last_, width, height); // grey pixels
        if (!codes) return codes.error();
        return perception::write_image(options_.screenshot, {width, height, 1, std::move(*codes)});
    }

    // Where the fixation cross goes, tangent to the right of the screen's centre; dots beneath it count the interval.
    std::optional<double> cross;
    int dots = 0;

private:
    Stage(const CalibrationWindowOptions& options, render::Context context, render::TestPatternDrawer drawer)
        : options_(options), context_(std::move(context)), drawer_(std::move(drawer)) {
        glfwSetWindowUserPointer(window(), this);
        glfwSetKeyCallback(window(), [](GLFWwindow* w, int key, int, int action, int) {
            if (action == GLFW_RELEASE) return;
            if (key == GLFW_KEY_ESCAPE || key == GLFW_KEY_Q) glfwSetWindowShouldClose(w, GLFW_TRUE);
            else static_cast<Stage*>(glfwGetWindowUserPointer(w))->keys_.push_back(key);
        });
        glfwSwapInterval(1);
    }

    void place_marks(TestPattern& pattern, int width, int height) const {
        if (!cross) return;
        const double x = width * 0.5 + *cross / pattern.tangent_per_pixel, y = height * 0.5;
        pattern.marks = {{x - pixels_of_cross, y - thickness, x + pixels_of_cross, y + thickness},
                         {x - thickness, y - pixels_of_cross, x + thickness, y + pixels_of_cross}};
        for (int dot = 0; dot < dots; ++dot) {
            const double left = x + (2 * dot - dots + 0.5) * 2 * thickness, top = y + 2 * pixels_of_cross;
            pattern.marks.push_back({left, top, left + 2 * thickness, top + 2 * thickness});
        }
    }

    const CalibrationWindowOptions& options_;
    render::Context context_;
    render::TestPatternDrawer drawer_;
    std::vector<int> keys_;
    TestPattern last_;
    unsigned frame_ = 0;
};

// Shows one procedure's trials.
class Session {
public:
    Session(Stage& stage, Procedure& procedure, const CalibrationWindowOptions& options)
        : stage_(stage), procedure_(procedure), options_(options) {}

    // One trial, from its first frame to its answer, or to the window's end.
    Result<void> run_trial() {
        trial_ = procedure_.next();
        stage_.set_title("Unseen - calibration, " + std::to_string(trial_.number + 1) + " of " +
                         std::to_string(procedure_.trials()) + ": " + rounded(trial_.grating.frequency_cpd, 3) +
                         " cpd, " + rounded(trial_.grating.eccentricity_deg, 3) + " deg" +
                         (trial_.grating.is_wide() ? ", wide" : ""));
        aim();
        return procedure_.plan().method == Method::two_interval ? two_intervals() : adjustment();
    }

private:
    // The cross in the middle where the patch fits beside it, else as far to the left as need be.
    void aim() {
        const double half = perception::physical_field(options_.display, options_.display.width_px).value() / 2;
        const double reach = 2 * trial_.grating.sigma_deg(); // of the patch
        const double at = std::max(0.0, std::min(trial_.grating.eccentricity_deg, half - reach));
        stage_.cross = std::tan((at - trial_.grating.eccentricity_deg) / perception::degrees_per_radian);
        pattern_.kind = TestPattern::Kind::grating;
        pattern_.tangent_per_pixel = options_.display.pixel_pitch / options_.display.distance;
        pattern_.mean = procedure_.plan().luminance.value();
        pattern_.frequency_cpd = trial_.grating.frequency_cpd;
        pattern_.sigma_deg = trial_.grating.sigma_deg();
        pattern_.phase_deg = trial_.phase_deg;
        pattern_.centre = {std::tan(at / perception::degrees_per_radian), 0};
        pattern_.contrast = 0;
    }

    // 0 to 1 and back over an interval, smooth at both ends.
    double envelope(double share) const {
        const double edge = std::min({share, 1 - share, ramp_share}) / ramp_share;
        return 0.5 - 0.5 * std::cos(std::numbers::pi * std::max(0.0, edge));
    }

    // The first interval, a pause, the second; then the question. The count of dots tells which is on.
    Result<void> two_intervals() {
        const double start = stage_.seconds(), length = options_.interval_s;
        while (!stage_.is_closed()) {
            const double now = stage_.seconds() - start - length; // a pause first
            const bool first = now >= 0 && now < length, second = now >= 2 * length && now < 3 * length;
            const bool is_asking = now >= 3 * length;
            const bool is_on = (first && trial_.interval == 1) || (second && trial_.interval == 2);
            pattern_.contrast = is_on ? trial_.contrast * envelope(std::fmod(now, length) / length) : 0;
            stage_.dots = first ? 1 : second ? 2 : 0;
            if (!is_asking) stage_.forget_keys();
            for (int key = stage_.take_key(); key != 0; key = stage_.take_key()) {
                if (key != GLFW_KEY_1 && key != GLFW_KEY_2 && key != GLFW_KEY_KP_1 && key != GLFW_KEY_KP_2) continue;
                procedure_.choose(key == GLFW_KEY_1 || key == GLFW_KEY_KP_1 ? 1 : 2);
                stage_.forget_keys();
                return {};
            }
            if (auto shown = stage_.show(pattern_); !shown) return shown;
        }
        return {};
    }

    // Fades until a key says that it appeared or vanished; arrows take over from the fading.
    Result<void> adjustment() {
        const double highest = procedure_.plan().highest_contrast;
        double log10_contrast = std::log10(trial_.contrast), last = stage_.seconds();
        bool fades = true;
        stage_.dots = 0;
        stage_.forget_keys();
        while (!stage_.is_closed()) {
            const double now = stage_.seconds();
            if (fades) log10_contrast += (trial_.is_ascending ? 1 : -1) * options_.fade_per_s * (now - last);
            last = now;
            for (int key = stage_.take_key(); key != 0; key = stage_.take_key()) {
                if (key == GLFW_KEY_UP || key == GLFW_KEY_DOWN) {
                    fades = false;
                    log10_contrast += key == GLFW_KEY_UP ? key_step : -key_step;
                } else if (key == GLFW_KEY_SPACE || key == GLFW_KEY_ENTER || key == GLFW_KEY_KP_ENTER ||
                           key == GLFW_KEY_N) {
                    procedure_.set(key == GLFW_KEY_N ? highest : std::pow(10, log10_contrast));
                    stage_.forget_keys();
                    return {};
                }
            }
            log10_contrast = std::clamp(log10_contrast, calibration::lowest_log10_contrast, std::log10(highest));
            pattern_.contrast = std::pow(10, log10_contrast);
            if (auto shown = stage_.show(pattern_); !shown) return shown;
        }
        return {};
    }

    Stage& stage_;
    Procedure& procedure_;
    const CalibrationWindowOptions& options_;
    Trial trial_;
    TestPattern pattern_;
};

} // namespace

Result<void> run_calibration_window(Procedure& procedure, const CalibrationWindowOptions& options,
                                    const std::filesystem::path& state) {
    std::fputs(calibration_window_help, stderr); // stdout may be for --json
    auto stage = Stage::open(options, "Unseen - calibration");
    if (!stage) return stage.error();
    Session session(**stage, procedure, options);
    while (!procedure.is_done() && !(*stage)->is_closed()) {
        if (auto ran = session.run_trial(); !ran) return ran;
        if (state.empty()) continue;
        if (auto saved = procedure.save(state); !saved) return saved;
    }
    return options.screenshot.empty() ? Result<void>() : (*stage)->save_screenshot();
}

Result<std::vector<GammaMatch>> match_gamma(const CalibrationWindowOptions& options) {
    std::fputs(calibration_window_help, stderr); // stdout may be for --json
    auto stage = Stage::open(options, "Unseen - gamma");
    if (!stage) return stage.error();
    constexpr int rows = 4;
    std::vector<GammaMatch> matches;
    TestPattern pattern;
    pattern.kind = TestPattern::Kind::match;
    pattern.rows = rows;
    for (int white = 1; white < rows && !(*stage)->is_closed(); ++white) {
        const double share = static_cast<double>(white) / rows;
        pattern.white_rows = white;
        pattern.code = 0.5;
        (*stage)->set_title("Unseen - gamma, match " + std::to_string(white) + " of " + std::to_string(rows - 1));
        for (bool is_matched = false; !is_matched && !(*stage)->is_closed();) {
            for (int key = (*stage)->take_key(); key != 0 && !is_matched; key = (*stage)->take_key()) {
                if (key == GLFW_KEY_UP) pattern.code += code_step;
                if (key == GLFW_KEY_DOWN) pattern.code -= code_step;
                if (key == GLFW_KEY_PAGE_UP) pattern.code += 10 * code_step;
                if (key == GLFW_KEY_PAGE_DOWN) pattern.code -= 10 * code_step;
                is_matched = key == GLFW_KEY_SPACE || key == GLFW_KEY_ENTER || key == GLFW_KEY_KP_ENTER;
            }
            pattern.code = std::clamp(std::round(pattern.code * 255), 1.0, 254.0) / 255;
            if (is_matched) matches.push_back({share, pattern.code});
            else if (auto shown = (*stage)->show(pattern); !shown) return shown.error();
        }
    }
    if (matches.size() + 1 < rows) matches.clear();
    if (!options.screenshot.empty())
        if (auto saved = (*stage)->save_screenshot(); !saved) return saved.error();
    return matches;
}

} // namespace unseen::app
