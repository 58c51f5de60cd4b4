#include "session_options.h"

#include <functional>

#include <unseen/calibration/display_profile.h>

#include "option_names.h"
#include "progress_bar.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr double default_fill = 0.9;

std::optional<perception::Luminance> background_of(const ViewOptions& view) {
    if (!view.background_cdm2) return std::nullopt;
    return perception::Luminance(*view.background_cdm2);
}

// What the options say that does not depend on the model.
struct Surroundings {
    session::Observer observer;
    std::optional<calibration::LightRig> lights;
};

Result<Surroundings> read_surroundings(const ViewOptions& view, const DisplayOptions& display) {
    auto shown_on = make_display(display);
    if (!shown_on) return shown_on.error();
    if (const auto background = session::relative_background(*shown_on, background_of(view)); !background)
        return background.error();
    Surroundings around;
    auto observer = make_observer(display, *shown_on);
    if (!observer) return observer.error();
    around.observer = std::move(*observer);
    if (!view.lights.empty()) {
        auto read = calibration::LightRig::read(view.lights);
        if (!read) return read.error();
        around.lights = std::move(*read);
    }
    return around;
}

Result<session::Session> assemble(session::Scene scene, Surroundings around, const ViewOptions& view) {
    const bool asks_for_light = view.light || view.ambient || view.fill_light;
    if (asks_for_light && scene.is_of_file()) {
        // Objects are turned, and trees are shared: lights in the world in place of the file's.
        auto rig = session::light_rig(view.light, view.ambient, view.fill_light);
        if (!rig) return rig.error();
        scene.lights = std::move(*rig);
    } else if (const auto lit = scene.relight(view.light, view.ambient, view.fill_light); !lit) {
        return lit.error();
    }
    scene.background = background_of(view);
    if (around.lights) scene.lights = std::move(around.lights);
    if (view.shadows && scene.lights) {
        if (const auto set = scene.lights->set_shadows(*view.shadows); !set) return set.error();
    } else if (view.shadows.value_or(false)) {
        return Error{ErrorCode::invalid_argument,
                     "--shadows needs lights that may cast some: give --lights, or a scene that has lights."};
    }
    return session::Session::create(std::move(scene), std::move(around.observer), terminal_messages());
}

// `bar` must outlive what is done with the options.
session::LoadOptions load_options(const TextureOptions& texture, ProgressBar& bar) {
    session::LoadOptions options;
    options.texture = texture.file;
    options.without_textures = texture.is_left_out;
    options.drop = texture.drop;
    options.skip_bad = texture.skips_bad;
    options.weld = !texture.is_unwelded;
    options.prelit = texture.is_prelit;
    options.crease = texture.crease;
    options.protect = texture.protect;
    options.messages = terminal_messages();
    options.messages.progress = std::ref(bar);
    return options;
}

} // namespace

session::Messages terminal_messages() {
    session::Messages messages;
    messages.note = [](const Message& text) { print_note(with_option_names(text)); };
    messages.warning = [](const Message& text) { print_warning(with_option_names(text)); };
    return messages;
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

Result<session::Observer> make_observer(const DisplayOptions& options, const perception::Display& display) {
    session::Observer observer;
    if (!options.observer.empty()) {
        auto chosen = session::choose_observer(options.observer);
        if (!chosen) return chosen.error();
        observer = std::move(*chosen);
    }
    observer.display = display;
    if (options.csf.empty()) return observer;
    const auto chosen = session::choose_csf(options.csf);
    if (!chosen) return chosen.error();
    if (observer.csf || (std::holds_alternative<perception::CsfTable>(*chosen) && !options.observer.empty()))
        return Error{ErrorCode::invalid_argument,
                     "--observer and --csf exclude each other where one of them is a viewer's table: give that alone."};
    auto table = session::read_csf_table(options.csf, display, observer.person);
    if (!table) return table.error();
    observer.csf = std::move(*table);
    return observer;
}

Result<session::Session> open_session(const std::filesystem::path& model, const ViewOptions& view,
                                      const DisplayOptions& display) {
    auto around = read_surroundings(view, display);
    if (!around) return around.error();
    auto scene = load_scene(model, view);
    if (!scene) return scene.error();
    return assemble(std::move(*scene), std::move(*around), view);
}

Result<session::Session> make_session(vdtree::VertexTree tree, const ViewOptions& view, const DisplayOptions& display) {
    auto around = read_surroundings(view, display);
    if (!around) return around.error();
    return assemble(session::Scene::of(std::move(tree), view.unit_metres), std::move(*around), view);
}

vdtree::View make_view(const session::Session& session, const ViewOptions& options) {
    vdtree::View view;
    view.width = options.width;
    view.height = options.height;
    view.fov_y_degrees =
        options.fov_degrees.value_or(perception::physical_field(session.observer().display, options.height).value());
    if (options.is_orthographic) view.orthographic_height = options.orthographic_height.value_or(1);
    const bool has_place = options.eye || options.direction || options.fill || options.is_orthographic;
    if (const auto seen = has_place ? std::nullopt : session.camera_view(view)) {
        view = *seen;
        if (options.fov_degrees) view.fov_y_degrees = *options.fov_degrees;
    } else if (options.eye) {
        view.eye = *options.eye;
        view.target = options.target.value_or(session.bounding_sphere().centre);
    } else {
        view =
            session.frame(options.direction.value_or(glm::dvec3(0, 0, 1)), options.fill.value_or(default_fill), view);
        if (options.orthographic_height) view.orthographic_height = options.orthographic_height;
    }
    if (options.up) view.up = *options.up;
    view.eye_distance = options.eye_distance;
    if (options.eye_distance > 0) view.shift.x = -options.eye_shift;
    return view;
}

std::optional<session::Gaze> fixed_gaze(const WhatOptions& what) {
    if (!what.gaze_px) return std::nullopt;
    return session::Gaze{*what.gaze_px};
}

// ---- models

Result<meshio::ReadResult> read_mesh_file(const std::filesystem::path& file, bool skip_bad) {
    ProgressBar bar("reading " + file.filename().string());
    meshio::ReadOptions options;
    options.progress = std::ref(bar);
    options.drop = {true, true, true, true}; // nothing is made of it
    options.skip_bad = skip_bad;
    auto read = meshio::read_mesh(file, options);
    if (!read) return read;
    const session::Messages messages = terminal_messages();
    for (const Message& warning : read->warnings) messages.warning(file.string() + ": " + warning);
    for (const Message& note : read->notes) messages.note(file.string() + ": " + note);
    return read;
}

Result<meshio::ReadResult> read_textured_mesh(const std::filesystem::path& file, const meshio::ReadOptions& options,
                                              const TextureOptions& texture) {
    ProgressBar bar("reading " + file.filename().string());
    return session::read_textured_mesh(file, load_options(texture, bar), options);
}

Result<vdtree::VertexTree> build_tree_of(meshio::ReadResult&& read, vdtree::BuildOptions options,
                                         const TreeMaker& build) {
    ProgressBar bar("building");
    options.progress = std::ref(bar);
    options.dropped_before = read.dropped_triangles;
    options.prelit |= read.is_unlit;
    return build ? build(read.mesh.view(), options) : vdtree::build_tree(read.mesh.view(), options);
}

Result<vdtree::VertexTree> load_tree(const std::filesystem::path& file) {
    ProgressBar bar(file.filename().string());
    session::LoadOptions options = load_options({}, bar);
    options.measures = false;
    options.cache.is_off = true;
    return session::load_tree(file, options);
}

Result<session::Scene> load_scene(const std::filesystem::path& file, const ViewOptions& view) {
    ProgressBar bar(file.filename().string());
    session::LoadOptions options = load_options(view.texture, bar);
    options.unit_metres = view.unit_metres;
    options.as = view.as;
    options.cache.is_off = view.no_cache;
    options.measures = view.measures;
    options.conserves_light = !view.measures; // so that pictures are the same
    return session::Scene::load(file, options);
}

} // namespace unseen::app
