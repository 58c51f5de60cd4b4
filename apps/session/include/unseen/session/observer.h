// The person who looks: on which display, how well, and where.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <glm/vec2.hpp>

#include <unseen/perception/csf.h>
#include <unseen/perception/display.h>
#include <unseen/perception/judge.h>
#include <unseen/vdtree/view.h>

namespace unseen::session {

struct Gaze {
    glm::dvec2 px = glm::dvec2(0); // in the window, from the top left; may lie outside
    double margin_deg = 0;         // the true gaze may be this far from it; 0 or more
};

// Error messages and reasons call these fields observer.gaze and so on.
struct Observer {
    perception::Display display = {};
    perception::Person person = perception::default_person; // how well they see: castleCSF times a gain
    // The contrast sensitivity of one measured viewer, instead of the person's. Null: not set.
    std::shared_ptr<const perception::CsfTable> csf = {};
    std::optional<Gaze> gaze = {}; // not set: the viewer may look anywhere, so everything counts as foveal
    // How fast everything moves over the retina, 0 to perception::fastest_velocity. Fine detail blurs, coarse detail is
    // seen better. The image of what the eye pursues hardly moves: give its retinal slip.
    perception::DegreesPerSecond velocity{0};
};

// In words: "the default observer (castleCSF x 2: of measured people, 8.7% see more)".
std::string describe(const Observer& observer);

// The options of the judges of pictures for this observer. The gaze's margin is ignored.
perception::JudgeOptions judge_options(const Observer& observer);

// With a person by name (perception/csf.h), or the table of a viewer from a file; all else as by default.
Result<Observer> choose_observer(const std::string& name_or_file);

// Contrast sensitivity: a model by name (see perception::csf_model()), or a table from a file. Models must be of
// luminance contrast.
Result<std::variant<perception::CsfModel, perception::CsfTable>> choose_csf(const std::string& model_or_file);

// The table of that choice. The table of a model is for the display's distance and multiplied by the person's gain.
Result<std::shared_ptr<const perception::CsfTable>>
read_csf_table(const std::string& model_or_file, const perception::Display& display, const perception::Person& person);

// The background in relative luminance. Fails if it is not between the display's black and white. See Scene::background
// for the default.
Result<float> relative_background(const perception::Display& display, std::optional<perception::Luminance> asked);

// The pixel at this angle to the right of the window's centre. It may lie outside of the window.
glm::dvec2 gaze_aside(const perception::Display& display, const vdtree::View& view, double degrees);
inline constexpr double usual_degrees_aside = 29; // well in the periphery

// `count` pixels at this angle from a gaze, seen from the display's distance, in order. They form a circle on the
// retina and about an ellipse on the flat screen. Points beside or behind the viewer are put far outside.
// Preconditions: finite, above 0 degrees and below 180, at least one.
std::vector<glm::dvec2> gaze_circle(const perception::Display& display, const vdtree::View& view, glm::dvec2 gaze_px,
                                    double degrees, int count = 72);
inline constexpr double fovea_degrees = 1; // about the radius of the fovea, where people see best

} // namespace unseen::session
