#include "scene.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include <calibration/display_profile.h>
#include <calibration/observer_profile.h>
#include <vdtree/occluders.h>

#include "model_file.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr double default_fill = 0.9;
constexpr double default_background_cdm2 = 20;
constexpr double point_radius = 1e-3; // world units: what is framed where all vertices coincide

Error invalid(const std::string& what) { return {ErrorCode::invalid_argument, what}; }

// By default 20 cd/m2, or the nearest that the display can show; what was asked for must be possible.
Result<float> relative_background(const perception::Display& display, std::optional<double> asked_cdm2) {
    const double wanted_cdm2 = asked_cdm2.value_or(default_background_cdm2);
    const double relative = perception::to_relative(display, perception::Luminance(wanted_cdm2));
    // Asking for the black or white that the display reports must work in spite of rounding.
    constexpr double rounding = 1e-9;
    if (asked_cdm2 && !(relative >= -rounding && relative <= 1 + rounding)) {
        return invalid("--background " + shortest(wanted_cdm2) + " cd/m2 is not between the display's black (" +
                       shortest(perception::black_level(display).value()) + ") and white (" +
                       shortest(perception::to_luminance(display, 1).value()) + ").");
    }
    return static_cast<float>(std::clamp(relative, 0.0, 1.0));
}

// Scaled first, so that neither tiny nor huge directions under- or overflow when squared.
glm::vec3 unit_vector(glm::dvec3 v) {
    const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
    return glm::vec3(glm::normalize(v / largest));
}

Result<void> light(Scene& scene, const ViewOptions& options) {
    if (!options.light && !options.ambient) return {};
    vdtree::Light light = scene.tree.light();
    if (options.light) light.direction = unit_vector(*options.light);
    if (options.ambient) light.ambient = static_cast<float>(*options.ambient);
    if (light == scene.tree.light() && !scene.tree.is_prelit()) return {};
    auto relit = scene.tree.relit(light);
    if (!relit) return relit.error();
    scene.replace_tree(std::move(*relit));
    scene.is_relit = true;
    return {};
}

vdtree::View make_view(const Scene& scene, const ViewOptions& options) {
    vdtree::View view;
    view.width = options.width;
    view.height = options.height;
    view.fov_y_degrees =
        options.fov_degrees.value_or(perception::physical_field(scene.display, options.height).value());
    const PlacedSphere sphere = placed_sphere(scene.tree, scene.placement);
    if (options.eye) {
        view.eye = *options.eye;
        view.target = options.target.value_or(sphere.centre);
    } else {
        view = vdtree::frame_sphere(sphere.centre, sphere.radius > 0 ? sphere.radius : point_radius,
                                    options.direction.value_or(glm::dvec3(0, 0, 1)),
                                    options.fill.value_or(default_fill), view);
    }
    if (options.up) view.up = *options.up;
    return view;
}

Result<void> set_up_lights(Scene& scene, std::optional<calibration::LightRig> rig) {
    if (!rig) return {};
    scene.rig = std::move(rig);
    auto bounds = vdtree::LightBounds::measure(scene.tree);
    if (!bounds) return bounds.error();
    scene.light_bounds = std::make_shared<vdtree::LightBounds>(std::move(*bounds));
    return light_at(scene, 0);
}

} // namespace

Result<void> light_at(Scene& scene, double seconds) {
    if (!scene.rig) return {};
    vdtree::Lighting lighting = scene.rig->at(seconds, scene.tree, scene.view, scene.placement);
    if (auto ok = vdtree::check_lights(scene.tree, lighting); !ok)
        return Error{ok.error().code, scene.rig->file().string() + ": " + ok.error().message};
    scene.lighting = std::move(lighting);
    return {};
}

Result<perception::Display> make_display(const DisplayOptions& options) {
    perception::Display display;
    if (!options.file.empty()) {
        auto read = calibration::read_display(options.file);
        if (!read) return read.error();
        display = *read;
    }
    // The distance first: pixels per degree hold at a distance.
    if (options.distance_m) display.distance = perception::Metres(*options.distance_m);
    if (options.pixels_per_degree)
        perception::set_pixels_per_degree(display, perception::PixelsPerDegree(*options.pixels_per_degree));
    if (options.peak_cdm2) display.peak = perception::Luminance(*options.peak_cdm2);
    if (options.black_cdm2) display.black = perception::Luminance(*options.black_cdm2);
    if (auto valid = perception::validate(display); !valid) return valid.error();
    return display;
}

glm::dvec2 gaze_aside(const perception::Display& display, const vdtree::View& view, double degrees) {
    const double tangent = std::tan(perception::to_radians(perception::Degrees(degrees)).value());
    return {view.width * 0.5 + tangent * (display.distance / display.pixel_pitch), view.height * 0.5};
}

Result<CsfChoice> choose_csf(const std::string& model_or_file) {
    const auto model = perception::csf_model(model_or_file);
    if (model) {
        if (perception::is_achromatic(*model)) return CsfChoice{*model, {}};
        return invalid("--csf " + model_or_file + " is sensitivity to colour, not to luminance contrast.");
    }
    std::error_code unknown;
    if (!std::filesystem::exists(model_or_file, unknown))
        return invalid("--csf: there is no such file, and " + model.error().message + ".");
    auto table = calibration::read_csf(model_or_file);
    if (!table) return table.error();
    return CsfChoice{{}, std::move(*table)};
}

Result<perception::CsfTable> csf_table(const std::string& model_or_file, const perception::Display& display) {
    auto choice = choose_csf(model_or_file);
    if (!choice) return choice.error();
    return choice->model ? perception::CsfTable::from_model(*choice->model, {.distance = display.distance}) : *std::move(choice->table);
}

std::shared_ptr<const perception::CsfTable> Scene::csf_table(perception::Degrees margin) const {
    if (!kept.widened_tables) kept.widened_tables = std::make_unique<perception::WidenedTables>(csf_table());
    return kept.widened_tables->at(margin);
}

std::span<const vdtree::Sphere> Scene::inner_spheres() const {
    if (!kept.inner_spheres) kept.inner_spheres = vdtree::inner_spheres(tree);
    return *kept.inner_spheres;
}

Result<const vdtree::CutRings*> Scene::cut_rings() const {
    if (!kept.cut_rings) {
        auto rings = vdtree::bound_cut_rings(tree);
        if (!rings) return rings.error();
        kept.cut_rings = std::move(*rings);
    }
    return &*kept.cut_rings;
}

void Scene::replace_tree(vdtree::VertexTree other) {
    tree = std::move(other);
    kept.inner_spheres.reset();
    kept.cut_rings.reset();
    kept.criterion.reset();
}

PlacedSphere placed_sphere(const vdtree::VertexTree& tree, const vdtree::Similarity& placement) {
    const vdtree::Sphere sphere = tree.bounding_sphere();
    return {placement.to_world(tree.origin() + glm::dvec3(sphere.centre)), placement.scale * sphere.radius};
}

namespace {

// What the options say that does not depend on the model.
struct Surroundings {
    perception::Display display;
    float background = 0;
    std::shared_ptr<const perception::CsfTable> csf;
    std::optional<calibration::LightRig> rig;
};

Result<Surroundings> read_surroundings(const ViewOptions& view, const DisplayOptions& display) {
    auto shown_on = make_display(display);
    if (!shown_on) return shown_on.error();
    const auto background = relative_background(*shown_on, view.background_cdm2);
    if (!background) return background.error();
    Surroundings around{*shown_on, *background, {}, {}};
    if (!display.csf.empty()) {
        auto table = csf_table(display.csf, *shown_on);
        if (!table) return table.error();
        around.csf = std::make_shared<const perception::CsfTable>(std::move(*table));
    }
    if (!view.lights.empty()) {
        auto read = calibration::LightRig::read(view.lights);
        if (!read) return read.error();
        around.rig = std::move(*read);
    }
    return around;
}

Result<Scene> assemble(vdtree::VertexTree tree, Surroundings around, const ViewOptions& view) {
    Scene scene{std::move(tree)};
    scene.display = around.display;
    scene.csf = std::move(around.csf);
    scene.background = around.background;
    scene.is_texture_left_out = view.texture.is_left_out;
    scene.placement.scale = view.unit_metres;
    if (const auto lit = light(scene, view); !lit) return lit.error();
    if (const auto seen = look(scene, view); !seen) return seen.error();
    if (auto lit = set_up_lights(scene, std::move(around.rig)); !lit) return lit.error();
    return scene;
}

} // namespace

Result<void> look(Scene& scene, const ViewOptions& options) {
    scene.view = make_view(scene, options);
    return vdtree::validate(scene.view);
}

Result<Scene> make_scene(vdtree::VertexTree tree, const ViewOptions& view, const DisplayOptions& display) {
    auto around = read_surroundings(view, display);
    if (!around) return around.error();
    return assemble(std::move(tree), std::move(*around), view);
}

Result<Scene> load_scene(const std::filesystem::path& model, const ViewOptions& view, const DisplayOptions& display) {
    // What is quickly read and checked comes first.
    auto around = read_surroundings(view, display);
    if (!around) return around.error();
    auto tree = open_tree(model, view.texture);
    if (!tree) return tree.error();
    return assemble(std::move(*tree), std::move(*around), view);
}

} // namespace unseen::app
