#include "study_window.h"

#include <algorithm>
#include <cmath>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <unseen/perception/image.h>
#include <unseen/render/internal/overlay.h>
#include <unseen/render/target.h>
#include <unseen/vdtree/internal/errors.h>

#include "screen_text.h"

namespace unseen::app {
namespace {

using calibration::StudyAnswer;
using calibration::StudyChoice;
using calibration::StudyTask;
using calibration::StudyTrial;

constexpr int gap_px = 32;          // between both pictures
constexpr double line_px = 22;      // of text
constexpr int text_px = 80;         // below the pictures
constexpr unsigned char grey = 119; // sRGB code: about a fifth of white's luminance
constexpr double frame_wait_s = 1.0 / 120;

// As an overlay shows it: codes as they are.
Result<std::vector<glm::u8vec4>> codes_of(const std::filesystem::path& file, glm::ivec2& size) {
    const auto read = perception::read_image(file);
    if (!read) return read.error();
    if (read->is_absolute)
        return invalid_argument("'" + file.string() + "' holds luminances: a window shows codes, as PNG has them.");
    const perception::Image& image = read->image;
    size = {image.width, image.height};
    std::vector<glm::u8vec4> pixels;
    pixels.reserve(static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y));
    const auto code = [](float value) {
        return static_cast<unsigned char>(std::lround(std::clamp(value, 0.0f, 1.0f) * 255));
    };
    for (int y = 0; y < size.y; ++y)
        for (int x = 0; x < size.x; ++x)
            pixels.emplace_back(code(image.at(x, y, 0)), code(image.at(x, y, image.channels > 1 ? 1 : 0)),
                                code(image.at(x, y, image.channels > 1 ? 2 : 0)), 255);
    return pixels;
}

class Stage {
public:
    static Result<std::unique_ptr<Stage>> open(glm::ivec2 picture, const StudyWindowOptions& options) {
        constexpr int exact_pixels = 0;
        auto context = render::Context::window({.width = 2 * picture.x + 3 * gap_px,
                                                .height = picture.y + 2 * gap_px + text_px,
                                                .title = "Unseen - study",
                                                .full_screen = options.full_screen,
                                                .samples = exact_pixels});
        if (!context) return context.error();
        return std::unique_ptr<Stage>(new Stage(std::move(*context)));
    }
    Stage(const Stage&) = delete;
    Stage& operator=(const Stage&) = delete;

    bool is_closed() const { return glfwWindowShouldClose(window()); }

    void set_title(const std::string& title) { glfwSetWindowTitle(window(), title.c_str()); }

    // The last key since the last call; 0: none.
    int take_key() { return std::exchange(key_, 0); }

    Result<void> load(const std::filesystem::path& left, const std::filesystem::path& right) {
        glm::ivec2 sizes[2];
        const std::filesystem::path* files[2] = {&left, &right};
        for (int side = 0; side < 2; ++side) {
            const auto pixels = codes_of(*files[side], sizes[side]);
            if (!pixels) return pixels.error();
            if (auto set = pictures_[side].set_image({sizes[side].x, sizes[side].y, *pixels}); !set) return set;
        }
        if (sizes[0] != sizes[1])
            return invalid_argument("'" + left.string() + "' and '" + right.string() + "' differ in size.");
        size_ = sizes[0];
        return {};
    }

    Result<void> show(bool with_pictures, const std::string& text) {
        glm::ivec2 window_px;
        glfwGetFramebufferSize(window(), &window_px.x, &window_px.y);
        if (window_px.x > 0 && window_px.y > 0)
            if (auto drawn = draw(window_px, with_pictures, text); !drawn) return drawn;
        glfwWaitEventsTimeout(frame_wait_s);
        return {};
    }

    // Saves what was drawn last.
    Result<void> save(const std::string& file) {
        glm::ivec2 window_px;
        glfwGetFramebufferSize(window(), &window_px.x, &window_px.y);
        auto target = render::Target::foreign(context_, window_px.x, window_px.y);
        if (!target) return target.error();
        if (auto drawn = draw_to(*target, window_px, true, ""); !drawn) return drawn;
        auto codes = render::read_colour(*target);
        if (!codes) return codes.error();
        return perception::write_image(file, {window_px.x, window_px.y, 3, std::move(*codes)});
    }

private:
    explicit Stage(render::Context context)
        : context_(std::move(context)), ground_(context_),
          label_(context_), pictures_{render::Overlay(context_), render::Overlay(context_)} {
        glfwSetWindowUserPointer(window(), this);
        glfwSetKeyCallback(window(), [](GLFWwindow* w, int key, int, int action, int) {
            if (action != GLFW_PRESS) return;
            if (key == GLFW_KEY_ESCAPE || key == GLFW_KEY_Q) glfwSetWindowShouldClose(w, GLFW_TRUE);
            else static_cast<Stage*>(glfwGetWindowUserPointer(w))->key_ = key;
        });
        glfwSwapInterval(1);
    }

    GLFWwindow* window() const { return context_.glfw_window(); }

    Result<void> draw(glm::ivec2 window_px, bool with_pictures, const std::string& text) {
        auto target = render::Target::foreign(context_, window_px.x, window_px.y);
        if (!target) return target.error();
        if (auto drawn = draw_to(*target, window_px, with_pictures, text); !drawn) return drawn;
        glfwSwapBuffers(window());
        return {};
    }

    Result<void> draw_to(render::Target& target, glm::ivec2 window_px, bool with_pictures, const std::string& text) {
        if (ground_px_ != window_px) {
            const std::vector<glm::u8vec4> pixels(static_cast<std::size_t>(window_px.x) *
                                                      static_cast<std::size_t>(window_px.y),
                                                  glm::u8vec4(grey, grey, grey, 255));
            if (auto set = ground_.set_image({window_px.x, window_px.y, pixels}); !set) return set;
            ground_px_ = window_px;
        }
        if (auto drawn = ground_.draw(target, {0, 0}); !drawn) return drawn;
        if (with_pictures) {
            const glm::ivec2 all(2 * size_.x + gap_px, size_.y);
            if (all.x > window_px.x || all.y > window_px.y)
                return invalid_argument("Two pictures of " + std::to_string(size_.x) + "x" + std::to_string(size_.y) +
                                        " pixels have no room side by side in a window of " +
                                        std::to_string(window_px.x) + "x" + std::to_string(window_px.y) +
                                        ": make the study with a smaller --size.");
            const glm::ivec2 corner((window_px.x - all.x) / 2, std::max(0, (window_px.y - text_px - all.y) / 2));
            for (int side = 0; side < 2; ++side)
                if (auto drawn = pictures_[side].draw(target, corner + glm::ivec2(side * (size_.x + gap_px), 0));
                    !drawn)
                    return drawn;
        }
        if (text.empty()) return {};
        const auto panel =
            text_panel(std::vector<TextLine>{{text}}, line_px, {0.9 * window_px.x, static_cast<double>(text_px)});
        if (!panel) return panel.error();
        if (auto set = label_.set_image({panel->width, panel->height, panel->pixels}); !set) return set;
        return label_.draw(target, {(window_px.x - panel->width) / 2, window_px.y - panel->height - gap_px / 2});
    }

    render::Context context_;
    render::Overlay ground_, label_;
    render::Overlay pictures_[2];
    glm::ivec2 size_{0}, ground_px_{0};
    int key_ = 0;
};

std::optional<StudyChoice> choice_of(int key, StudyTask task) {
    if (task == StudyTask::which) {
        if (key == GLFW_KEY_LEFT) return StudyChoice::left;
        if (key == GLFW_KEY_RIGHT) return StudyChoice::right;
    } else {
        if (key == GLFW_KEY_S) return StudyChoice::same;
        if (key == GLFW_KEY_D) return StudyChoice::different;
    }
    return std::nullopt;
}

std::string question(StudyTask task) {
    return task == StudyTask::which ? "Which one is not the original?  left or right arrow"
                                    : "Are both the same, or do they differ?  s or d";
}

} // namespace

Result<void> run_study_window(const calibration::Study& study, const std::vector<StudyTrial>& trials, std::size_t first,
                              const StudyWindowOptions& options,
                              const std::function<Result<void>(const StudyAnswer&)>& keep) {
    glm::ivec2 size(0);
    if (const auto looked = codes_of(study.pairs.front().original, size); !looked) return looked.error();
    auto opened = Stage::open(size, options);
    if (!opened) return opened.error();
    Stage& stage = **opened;
    std::string before = question(study.task) + ".  Space begins.";
    bool waits = true;
    for (std::size_t i = first; i < trials.size() && !stage.is_closed(); ++i) {
        const StudyTrial& trial = trials[i];
        const calibration::StudyPair& pair = study.pairs[trial.pair];
        const auto& [left, right] =
            trial.is_other_left ? std::pair(pair.other, pair.original) : std::pair(pair.original, pair.other);
        if (auto loaded = stage.load(left, right); !loaded) return loaded;
        stage.set_title("Unseen - study, " + std::to_string(i + 1) + " of " + std::to_string(trials.size()));
        const double began = glfwGetTime();
        while (!stage.is_closed() &&
               (waits ? stage.take_key() != GLFW_KEY_SPACE : glfwGetTime() < began + options.pause_s))
            if (auto shown = stage.show(false, before); !shown) return shown;
        stage.take_key();
        const std::string text =
            (pair.is_training ? "training: " : std::to_string(i + 1) + " of " + std::to_string(trials.size()) + ": ") +
            question(study.task);
        const double shown_at = glfwGetTime();
        std::optional<StudyChoice> choice;
        while (!stage.is_closed() && !choice) {
            const bool is_in_time = !(options.seconds > 0) || glfwGetTime() < shown_at + options.seconds;
            if (auto shown = stage.show(is_in_time, text); !shown) return shown;
            choice = choice_of(stage.take_key(), study.task);
        }
        if (!options.screenshot.empty())
            if (auto saved = stage.save(options.screenshot); !saved) return saved;
        if (!choice) break;
        const StudyAnswer answer{trial, *choice, glfwGetTime() - shown_at};
        if (auto kept = keep(answer); !kept) return kept;
        waits = pair.is_training; // so that what was right can be read
        before = !pair.is_training        ? ""
                 : answer.is_right(study) ? "That was right.  Space goes on."
                                          : "That was wrong.  Space goes on.";
    }
    return {};
}

} // namespace unseen::app
