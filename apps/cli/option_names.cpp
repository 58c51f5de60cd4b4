#include "option_names.h"

#include <algorithm>
#include <string_view>

namespace unseen::app {
namespace {

struct OptionName {
    std::string_view field, option;
};

// "request.fold_test = " stands before a value: "request.fold_test = error" becomes "--fold-test error".
constexpr OptionName option_names[] = {
    {"request.fold_test = ", "--fold-test "},
    {"scene.background = ", "--background "},
    {"observer.csf = ", "--csf "},
    {"request.fold_test", "--fold-test"},
    {"request.keeps_shadows", "--shadows"},
    {"request.shown", "--visibility picture"},
    {"request.goal.triangles", "--triangles"},
    {"request.goal.pixels", "--pixels"},
    {"request.goal.fill", "--fill-budget"},
    {"request.goal = full", "--full"},
    {"request.milliseconds", "--milliseconds"},
    {"request.goal.cost", "--quality"},
    {"check.cell_degrees", "--check-cell"},
    {"check.seconds", "--check-seconds"},
    {"check", "--checked"},
    {"observer.csf", "--csf"},
    {"observer.velocity", "--velocity"},
    {"observer.person", "--observer"},
    {"request.may_measure", "--fold-test error"},
    {"scene.lights", "--lights"},
    {"Scene::relight()", "--light, --ambient or --fill-light"},
    {"read.drop = ", "--drop "},
    {"read.search_folder = ", "--texture "},
    {"read.skip_bad", "--skip-bad"},
    {"read.weld = false", "--no-weld"},
    {"load.texture", "--texture"},
    {"load.without_textures", "--texture none"},
    {"load.prelit", "--prelit"},
    {"load.crease", "--crease"},
    {"load.protect", "--protect"},
    {"load.as = ", "--as "},
    {"load.unit_metres", "--unit"},
    {"Follower::set_glide()", "--geomorph"},
    {"session::read_textured_mesh()", "unseen build"},
    {"vdtree::write_tree()", "'unseen build'"},
    {"perception::measure_folds()", "'unseen build'"},
    {"session::measured()", "unseen build"},
    {"session::measured_under_lights()", "unseen build --lit-fold-errors"},
    {"session::TreeCache", "unseen cache"},
    {"lod.cost", "--quality"},
    {"lod.directions", "--directions"},
    {"lod.samples", "--samples"},
    {"lod.fov_y_degrees", "--fov"},
};

} // namespace

std::string with_option_names(const Message& message) {
    std::string text = message;
    const auto names = message.names();
    for (std::size_t i = names.size(); i-- > 0;) { // from behind, so that the places stay
        const std::string_view name = std::string_view(message).substr(names[i].begin, names[i].size);
        const auto* known = std::ranges::find(option_names, name, &OptionName::field);
        if (known != std::end(option_names)) text.replace(names[i].begin, names[i].size, known->option);
    }
    return text;
}

} // namespace unseen::app
