#include <unseen/session/observer.h>

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include <unseen/calibration/observer_profile.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/number_format.h>
#include <unseen/vdtree/internal/number_text.h>

namespace unseen::session {
namespace {

constexpr double default_background_cdm2 = 20;
constexpr double least_depth = 1e-3; // of a direction of length 1, to lie on the screen: 89.94 degrees from its centre

} // namespace

std::string describe(const Observer& observer) {
    if (observer.csf) {
        const std::string& source = observer.csf->samples().source;
        return "the observer of " + source.substr(0, source.find(',')); // then come the conditions
    }
    const perception::Person& person = observer.person;
    return "the " + std::string(person.name) + " observer (castleCSF x " + shortest(person.gain) +
           ": of measured people, " + rounded(100 * person.share_above, 2) + "% see more)";
}

perception::JudgeOptions judge_options(const Observer& observer) {
    perception::JudgeOptions options{.display = observer.display};
    options.csf_table = observer.csf;
    options.gain = observer.csf ? 1 : observer.person.gain;
    if (observer.gaze) options.gaze_px = observer.gaze->px;
    return options;
}

namespace {

// What comes of no name known: the table in a file of that name.
Result<perception::CsfTable> read_table(const std::string& file, const Message& field, const std::string& unknown) {
    std::error_code failed;
    if (!std::filesystem::exists(file, failed))
        return invalid_argument(field + ": there is no such file, and " + unknown);
    return calibration::read_csf(file);
}

} // namespace

Result<Observer> choose_observer(const std::string& name_or_file) {
    Observer observer;
    const auto person = perception::person(name_or_file);
    if (person) {
        observer.person = *person;
        return observer;
    }
    auto table = read_table(name_or_file, Message::of("{observer.person}"), person.error().message);
    if (!table) return table.error();
    observer.csf = std::make_shared<const perception::CsfTable>(std::move(*table));
    return observer;
}

Result<std::variant<perception::CsfModel, perception::CsfTable>> choose_csf(const std::string& model_or_file) {
    using Choice = std::variant<perception::CsfModel, perception::CsfTable>;
    const auto model = perception::csf_model(model_or_file);
    if (model && !perception::is_achromatic(*model))
        return invalid_field("{observer.csf = }{} is sensitivity to colour, not to luminance contrast.",
                             {model_or_file});
    if (model) return Choice(*model);
    auto table = read_table(model_or_file, Message::of("{observer.csf}"), model.error().message + ".");
    return table ? Result<Choice>(std::move(*table)) : table.error();
}

Result<std::shared_ptr<const perception::CsfTable>>
read_csf_table(const std::string& model_or_file, const perception::Display& display, const perception::Person& person) {
    auto choice = choose_csf(model_or_file);
    if (!choice) return choice.error();
    const auto* const model = std::get_if<perception::CsfModel>(&*choice);
    auto table = model ? perception::CsfTable::from_model(*model, {.distance = display.distance})
                       : Result<perception::CsfTable>(std::get<perception::CsfTable>(std::move(*choice)));
    if (table && model) table = table->scaled(person.gain);
    if (!table) return table.error();
    return std::make_shared<const perception::CsfTable>(std::move(*table));
}

Result<float> relative_background(const perception::Display& display, std::optional<perception::Luminance> asked) {
    const perception::Luminance wanted = asked.value_or(perception::Luminance(default_background_cdm2));
    const double relative = perception::to_relative(display, wanted);
    // Asking for the black or white that the display reports must work in spite of rounding.
    constexpr double rounding = 1e-9;
    if (asked && !(relative >= -rounding && relative <= 1 + rounding)) {
        return invalid_field("{scene.background = }{} cd/m2 is not between the display's black ({}) and white ({}).",
                             {number_text(wanted.value()), number_text(perception::black_level(display).value()),
                              number_text(perception::to_luminance(display, 1).value())});
    }
    return static_cast<float>(std::clamp(relative, 0.0, 1.0));
}

glm::dvec2 gaze_aside(const perception::Display& display, const vdtree::View& view, double degrees) {
    const double tangent = std::tan(perception::to_radians(perception::Degrees(degrees)).value());
    return vdtree::axis_px(view) + glm::dvec2(tangent * (display.distance / display.pixel_pitch), 0);
}

std::vector<glm::dvec2> gaze_circle(const perception::Display& display, const vdtree::View& view, glm::dvec2 gaze_px,
                                    double degrees, int count) {
    const double distance_px = display.distance / display.pixel_pitch;
    const glm::dvec2 centre = vdtree::axis_px(view);
    const glm::dvec3 gaze = glm::normalize(glm::dvec3(gaze_px - centre, distance_px)); // right, down, into the screen
    const glm::dvec3 right = glm::normalize(glm::cross(glm::dvec3(0, 1, 0), gaze)), down = glm::cross(gaze, right);
    const double radius = perception::to_radians(perception::Degrees(degrees)).value();
    std::vector<glm::dvec2> circle;
    for (int i = 0; i < count; ++i) {
        const double turn = 2 * std::numbers::pi * i / count;
        const glm::dvec3 at =
            std::cos(radius) * gaze + std::sin(radius) * (std::cos(turn) * right + std::sin(turn) * down);
        circle.push_back(centre + glm::dvec2(at) * (distance_px / std::max(at.z, least_depth)));
    }
    return circle;
}

} // namespace unseen::session
