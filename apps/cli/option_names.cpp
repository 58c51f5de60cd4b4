#include "option_names.h"

#include <string_view>

namespace unseen::app {
namespace {

struct OptionName {
    std::string_view field, option;
};

// Fields with values come first: "request.fold_test = error" becomes "--fold-test error".
constexpr OptionName option_names[] = {
    {"request.fold_test = ", "--fold-test "},
    {"scene.background = ", "--background "},
    {"observer.csf = ", "--csf "},
    {"request.fold_test", "--fold-test"},
    {"request.chroma", "--chroma"},
    {"request.keeps_shadows", "--shadows"},
    {"request.masking", "--masking scene"},
    {"request.shown", "--visibility picture"},
    {"request.goal.triangles", "--triangles"},
    {"request.goal.pixels", "--pixels"},
    {"request.goal.fill", "--fill-budget"},
    {"request.goal full", "--full"},
    {"request.milliseconds", "--milliseconds"},
    {"request.threshold", "--threshold"},
    {"observer.csf", "--csf"},
    {"observer.velocity", "--velocity"},
    {"observer.person", "--observer"},
    {"scene.lights", "--lights"},
    {"Scene::relight()", "--light, --ambient or --fill-light"},
    {"read.drop = ", "--drop "},
    {"read.skip_bad", "--skip-bad"},
    {"read.weld = false", "--no-weld"},
    {"load.texture", "--texture"},
    {"load.without_textures", "--no-texture"},
    {"load.prelit", "--prelit"},
    {"load.as = ", "--as "},
    {"load.unit_metres", "--unit"},
    {"Follower::set_glide()", "--geomorph"},
    {"session::read_textured_mesh()", "unseen build"},
    {"vdtree::write_tree()", "'unseen build'"},
    {"session::measured()", "unseen build"},
    {"session::measured_under_lights()", "unseen build --lit-fold-errors"},
    {"session::TreeCache", "unseen cache"},
    {"lod.directions", "--directions"},
    {"lod.samples", "--samples"},
    {"lod.fov_y_degrees", "--fov"},
};

} // namespace

std::string with_option_names(std::string text) {
    for (const auto& [field, option] : option_names)
        for (std::size_t at = 0; (at = text.find(field, at)) != std::string::npos; at += option.size())
            text.replace(at, field.size(), option);
    return text;
}

} // namespace unseen::app
