// Who looks: on which display, how well, and where.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <glm/vec2.hpp>

#include <unseen/perception/csf.h>
#include <unseen/perception/display.h>
#include <unseen/perception/judge.h>
#include <unseen/perception/person.h>
#include <unseen/vdtree/view.h>

namespace unseen::session {

struct Gaze {
    glm::dvec2 px = glm::dvec2(0); // in the window, from the top left; may lie outside
    double margin_deg = 0;         // the true gaze may be so far from it; 0 or more
};

// Error messages and reasons call these fields observer.gaze and so on.
struct Observer {
    perception::Display display = {};
    perception::Person person = perception::default_person; // how well they see; castleCSF times a gain
    // This very viewer's contrast sensitivity, in the person's place; null: the person's.
    std::shared_ptr<const perception::CsfTable> csf = {};
    std::optional<Gaze> gaze = {}; // none: everything counts as looked at
    // How fast everything moves over the retina, 0 to perception::fastest_velocity. Fine things blur, coarse ones are
    // seen better. What the eye follows hardly moves there: give what is left of it (perception/motion.h).
    perception::DegreesPerSecond velocity{0};
};

// Whose eyes, in words: "the default observer (castleCSF x 2: of measured people, 8.7% see more)".
std::string describe(const Observer& observer);

// How judges of pictures take this observer; of a gaze its place alone.
perception::JudgeOptions judge_options(const Observer& observer);

// A person by name (perception/person.h), or the file of a viewer's table.
struct ObserverChoice {
    perception::Person person = perception::default_person;
    std::shared_ptr<const perception::CsfTable> csf = {}; // of the file; else null
};
Result<ObserverChoice> choose_observer(const std::string& name_or_file);

// Contrast sensitivity by name: that of a model (see perception::csf_model()), or else the file of a table. A model
// must be of luminance contrast.
struct CsfChoice {
    std::optional<perception::CsfModel> model = {};
    std::optional<perception::CsfTable> table = {}; // of the file; where a model is named, none
};
Result<CsfChoice> choose_csf(const std::string& model_or_file);

// Its table: of a model, for the display's distance and times the person's gain.
Result<std::shared_ptr<const perception::CsfTable>>
read_csf_table(const std::string& model_or_file, const perception::Display& display, const perception::Person& person);

// The background in relative luminance: what is asked for must be possible on the display, within its black and white.
// See Scene::background for the default.
Result<float> relative_background(const perception::Display& display, std::optional<perception::Luminance> asked);

// The pixel so far to the right of the window's centre; it may lie outside of the window.
glm::dvec2 gaze_aside(const perception::Display& display, const vdtree::View& view, double degrees);
inline constexpr double usual_degrees_aside = 29; // well in the periphery

// The pixels so far from a gaze for who looks from the display's distance: a circle on the retina, on the flat screen
// an ellipse around about the gaze. `count` of them in order. What would lie beside or behind the viewer is put far
// outside. Preconditions: finite, above 0 degrees and below 180, at least one.
std::vector<glm::dvec2> gaze_circle(const perception::Display& display, const vdtree::View& view, glm::dvec2 gaze_px,
                                    double degrees, int count = 72);
inline constexpr double fovea_degrees = 1; // from its middle to its rim, about: where people see best

} // namespace unseen::session
