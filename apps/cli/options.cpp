#include "options.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>

#include <unseen/perception/criterion.h>
#include <unseen/perception/motion.h>
#include <unseen/vdtree/internal/number_text.h>

#include "option_names.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr int largest_window_px = 32768; // a side, as vdtree::validate has it

// "a, b or c".
std::string listed(const std::vector<std::string>& names) {
    std::string list;
    for (std::size_t i = 0; i < names.size(); ++i)
        list += (i == 0 ? "" : i + 1 < names.size() ? ", " : " or ") + names[i];
    return list;
}

// A validator that passes numbers which `accepts`, and says `requirement` about others.
template <class Accepts>
CLI::Validator number_that(const std::string& requirement, Accepts accepts) {
    return CLI::Validator(
        [requirement, accepts](std::string& text) {
            const auto value = finite_from(text);
            if (value && accepts(*value)) return std::string();
            return "must be " + requirement + ", not '" + text + "'";
        },
        "");
}

// "1024x768".
std::string parse_size(const std::string& text, int& width, int& height) {
    const std::size_t x = text.find('x');
    const auto side = [](std::string_view digits, int& value) {
        const auto pixels = number_from<int>(digits);
        if (pixels) value = *pixels;
        return pixels && value >= 1 && value <= largest_window_px;
    };
    if (x != std::string::npos && side(std::string_view(text).substr(0, x), width) &&
        side(std::string_view(text).substr(x + 1), height))
        return {};
    return "must be WIDTHxHEIGHT with 1 to " + std::to_string(largest_window_px) + " pixels a side, not '" + text + "'";
}

void check(const ViewOptions& view) {
    const bool by_direction = view.direction || view.fill;
    if (view.eye && by_direction) refuse("--eye and --direction (or --fill) exclude each other: give one of them.");
    if (view.target && !view.eye) refuse("--target needs --eye; without an eye the whole model is framed.");
    if (view.direction && *view.direction == glm::dvec3(0)) refuse("--direction must not be 0 0 0.");
    if (view.light && *view.light == glm::dvec3(0)) refuse("--light must not be 0 0 0.");
    if (view.texture.is_prelit && (view.light || view.ambient || view.fill_light || !view.lights.empty()))
        refuse("--prelit excludes --light, --ambient, --fill-light and --lights, which light the colours.");
    if (!view.lights.empty() && (view.light || view.ambient || view.fill_light))
        refuse("--lights excludes --light, --ambient and --fill-light: say all of it in the file.");
    if (view.is_orthographic && view.fov_degrees) refuse("--fov is of perspective views, and excludes --orthographic.");
    if (view.is_orthographic && view.eye && !view.orthographic_height)
        refuse(
            "--orthographic fit frames the whole model, and excludes --eye: say how many metres the window is high.");
    if (view.orthographic_height && view.fill)
        refuse(
            "--fill and the height of --orthographic exclude each other: say --orthographic fit, or leave out --fill.");
    if (view.up && *view.up == glm::dvec3(0)) refuse("--up must not be 0 0 0.");
    if (view.eye && view.target && *view.eye == *view.target) refuse("--eye and --target are the same point.");
}

} // namespace

void refuse(const std::string& message) { throw CLI::ValidationError(message, CLI::ExitCodes::ValidationError); }

// The parser fills an option with the words that follow, even with the next option: the count says what went wrong.
CLI::Validator finite_numbers(int count) {
    constexpr std::array words = {"no", "a", "two", "three"};
    const std::string wanted =
        std::string(words.at(static_cast<std::size_t>(count))) + (count > 1 ? " finite numbers" : " finite number");
    return CLI::Validator(
        [wanted](std::string& text) {
            return finite_from(text) ? std::string() : "needs " + wanted + ", and '" + text + "' is none";
        },
        "");
}
CLI::Validator positive() {
    return number_that("a finite number above 0", [](double v) { return v > 0; });
}
CLI::Validator not_negative() {
    return number_that("a finite number of 0 or more", [](double v) { return v >= 0; });
}
CLI::Validator within(double low, double high) {
    return number_that("a number from " + shortest(low) + " to " + shortest(high),
                       [low, high](double v) { return v >= low && v <= high; });
}

CLI::Validator whole(double low, double high) {
    return CLI::Validator(
        [low, high](std::string& text) {
            const bool has_digits_only = !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
            const auto value = finite_from(text);
            if (has_digits_only && value && *value >= low && *value <= high) return std::string();
            return "must be a whole number from " + shortest(low) + " to " + shortest(high) + ", not '" + text + "'";
        },
        "");
}

CLI::Option* add_number(CLI::App& verb, const std::string& name, std::optional<double>& value,
                        const CLI::Validator& validator, const std::string& unit, const std::string& text) {
    return verb
        .add_option_function<double>(
            name, [&value](const double& v) { value = v; }, text)
        ->type_name(unit)
        ->check(validator);
}

CLI::Option* add_vector(CLI::App& verb, const std::string& name, std::optional<glm::dvec3>& value,
                        const std::string& text) {
    return verb
        .add_option_function<std::array<double, 3>>(
            name, [&value](const std::array<double, 3>& v) { value = glm::dvec3(v[0], v[1], v[2]); }, text)
        ->type_name("X Y Z")
        ->check(finite_numbers(3));
}

CLI::Validator one_of(std::vector<std::string> names) {
    return CLI::Validator(
        [names = std::move(names)](std::string& text) {
            if (std::find(names.begin(), names.end(), text) != names.end()) return std::string();
            return "must be " + listed(names) + ", not '" + text + "'";
        },
        "");
}

bool has_ending(const std::string& file, const std::string& ending) {
    std::string own = std::filesystem::path(file).extension().string();
    std::transform(own.begin(), own.end(), own.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return own == ending;
}

CLI::Validator ending_in(std::vector<std::string> endings) {
    return CLI::Validator(
        [endings = std::move(endings)](std::string& text) {
            if (std::any_of(endings.begin(), endings.end(),
                            [&](const std::string& ending) { return has_ending(text, ending); }))
                return std::string();
            return "must end in " + listed(endings) + ", not '" + text + "'";
        },
        "");
}

void add_skip_bad_option(CLI::App& verb, bool& skips_bad) {
    verb.add_flag(
        "--skip-bad", skips_bad,
        "Of a mesh: leave out faces that use vertices with NaN or infinite coordinates, or that are not there");
}

void add_texture_options(CLI::App& verb, TextureOptions& o) {
    CLI::Option* file =
        verb.add_option(
                "--texture", o.file,
                "Of a mesh with texture coordinates: the image that lies over it, instead of its materials' images")
            ->type_name("IMAGE");
    verb.add_flag("--no-texture", o.is_left_out, "Look at no images; simplified meshes keep them")->excludes(file);
    verb.add_option_function<std::vector<std::string>>(
            "--drop",
            [&o](const std::vector<std::string>& names) {
                for (const std::string& name : names)
                    (name == "skins"           ? o.drop.skins
                     : name == "morph-targets" ? o.drop.morph_targets
                     : name == "animations"    ? o.drop.animations
                                               : o.drop.extensions) = true;
            },
            "Leave out what glTF files have and simplified meshes cannot: skins, morph-targets, animations, extensions "
            "(that the file requires and nobody here knows); with commas between them")
        ->type_name("NAMES")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->check(one_of({"skins", "morph-targets", "animations", "extensions"}));
    add_skip_bad_option(verb, o.skips_bad);
    verb.add_flag(
        "--no-weld", o.is_unwelded,
        "Of an STL file: each facet keeps its normal and three vertices of its own (default: those at the same "
        "place become one)");
    verb.add_flag("--prelit", o.is_prelit,
                  "Of a mesh: its colours and images have light baked in (default: they are reflectance, and are lit)");
}

void add_geomorph_option(CLI::App& verb, std::optional<double>& seconds) {
    add_number(verb, "--geomorph", seconds, within(0, 60), "SECONDS",
               "Vertices glide for so long where the cut changes, up to 60 s (default: they do not); what folds is "
               "drawn until then");
}

void add_gaze_option(CLI::App& verb, std::optional<glm::dvec2>& gaze_px) {
    verb.add_option_function<std::array<double, 2>>(
            "--gaze", [&gaze_px](const std::array<double, 2>& v) { gaze_px = glm::dvec2(v[0], v[1]); },
            "Where the viewer looks, in pixels from the top left; may lie outside of the window "
            "(default: nowhere known, so everything is seen as sharply as at the fovea)")
        ->type_name("X Y")
        ->check(finite_numbers(2));
}

void add_moving_gaze_options(CLI::App& verb, GazeOptions& o, bool allows_mouse) {
    CLI::App& group = *verb.add_option_group("GAZE", "Where the viewer looks, frame by frame, instead of --gaze");
    std::vector<std::pair<std::string, GazeSource>> sources = {{"simulated", GazeSource::simulated},
                                                               {"head", GazeSource::head}};
    if (allows_mouse) sources.push_back({"mouse", GazeSource::mouse});
    CLI::Option* mode =
        add_choice(group, "--gaze-mode", o.source, std::move(sources),
                   std::string("simulated: fixations and saccades by published statistics; head: no tracker, within 15 "
                               "degrees of the middle") +
                       (allows_mouse ? "; mouse: at the pointer" : ""));
    CLI::Option* trace =
        group
            .add_option("--gaze-trace", o.trace,
                        "A recording: a table with columns such as time_s, x_px and y_px, or as Tobii, "
                        "Pupil Labs and EyeLink name them; blinks hold the last position")
            ->type_name("FILE.csv|FILE.tsv");
    CLI::Option* seed = group
                            .add_option_function<double>(
                                "--seed", [&o](const double& v) { o.seed = static_cast<std::uint64_t>(v); },
                                "Of simulated gazes (default: 1)")
                            ->type_name("N")
                            ->check(whole(0, 9007199254740992.0)); // 2^53, to which doubles count
    group.add_option("--gaze-error", o.tracker.error_deg, "The tracker's error, which widens the fovea (default: 0)")
        ->type_name("DEGREES")
        ->check(within(0, 180));
    CLI::Option* latency = group
                               .add_option_function<double>(
                                   "--gaze-latency", [&o](const double& ms) { o.tracker.latency_s = ms / 1000; },
                                   "From the eye to the picture; widens the fovea by the gaze's speed (default: 0)")
                               ->type_name("MILLISECONDS")
                               ->check(within(0, 10000));
    CLI::Option* suppression =
        group.add_flag("--suppression", o.tracker.suppression, "Keep still during saccades, when nothing is seen");
    group.callback([=, &o] {
        if (*mode && *trace) refuse("--gaze-mode and --gaze-trace exclude each other: give one of them.");
        if (*trace) o.source = GazeSource::trace;
        if (*seed && o.source != GazeSource::simulated) refuse("--seed needs --gaze-mode simulated.");
        const bool is_tracked = o.source == GazeSource::trace || o.source == GazeSource::simulated;
        if ((*latency || *suppression) && !is_tracked)
            refuse("--gaze-latency and --suppression need --gaze-mode simulated or --gaze-trace: only these know how "
                   "the eye moves.");
    });
}

void check_gaze(const WhatOptions& what, const GazeOptions& gaze) {
    if (what.gaze_px && gaze.source != GazeSource::none) refuse("--gaze excludes --gaze-trace and --gaze-mode.");
}

void check_geomorph(const std::optional<double>& seconds, const ViewOptions& view) {
    if (seconds && !view.lights.empty())
        refuse("--geomorph and --lights exclude each other: vertices that glide are not lit.");
}

void add_fold_test_option(CLI::App& verb, std::optional<FoldTest>& chosen, std::span<const FoldTest> tests,
                          const std::string& text) {
    std::vector<std::pair<std::string, FoldTest>> choices;
    for (const FoldTest test : tests) choices.emplace_back(name_of(test), test);
    add_choice(verb, "--fold-test", chosen, std::move(choices), text);
}

void add_json_option(CLI::App& verb, std::string& file) {
    verb.add_option("--json", file, "Report as JSON, to a file or to stdout (-)")->type_name("FILE|-");
}

void add_verbose_option(CLI::App& verb, bool& is_verbose) {
    verb.add_flag("--verbose", is_verbose, "Say more: times, counts, and which effects took part and why");
}

std::uint32_t TriangleCount::of(std::uint64_t all) const {
    constexpr double most = std::numeric_limits<std::uint32_t>::max();
    if (triangles > 0) return triangles;
    return static_cast<std::uint32_t>(std::clamp(std::round(share * static_cast<double>(all)), 1.0, most));
}

bool WhatOptions::needs_measurement() const {
    return request.goal.kind != session::Goal::Kind::pixels && request.goal.kind != session::Goal::Kind::full;
}

session::Request WhatOptions::request_for(std::uint64_t source_triangles) const {
    session::Request complete = request;
    if (budget.is_given()) complete.goal.triangles = budget.of(source_triangles);
    return complete;
}

CLI::Option* add_triangles_option(CLI::App& verb, TriangleCount& count, const std::string& text) {
    // The parser's own conversion of unsigned numbers takes "-1" and wraps it.
    return verb
        .add_option_function<std::string>(
            "--triangles",
            [&count](const std::string& given) {
                if (given.ends_with('%')) {
                    const auto percent = finite_from(std::string_view(given).substr(0, given.size() - 1));
                    if (!percent || !(*percent > 0))
                        refuse("--triangles: a share must be above 0%, such as 50%, not '" + given + "'");
                    count = {.share = *percent / 100};
                    return;
                }
                const auto value = number_from<std::uint64_t>(given);
                if (!value || *value == 0)
                    refuse("--triangles: must be a whole number of 1 or more, or a share such as 50%, not '" + given +
                           "'");
                count = {.triangles = static_cast<std::uint32_t>(
                             std::min<std::uint64_t>(*value, std::numeric_limits<std::uint32_t>::max()))};
            },
            text)
        ->type_name("N|P%");
}

void add_model_option(CLI::App& verb, std::string& model) {
    verb.add_option("TREE", model, "A tree, a mesh, or a scene (glTF)")
        ->required()
        ->type_name("TREE.vdt|MESH|SCENE.glb");
}

void add_as_option(CLI::App& verb, session::LoadAs& as) {
    as = session::LoadAs::automatic;
    add_choice<session::LoadAs, session::LoadAs>(
        verb, "--as", as, {{"scene", session::LoadAs::scene}, {"model", session::LoadAs::model}},
        "Of a glTF file: scene (many objects, each simplified by itself, with the file's camera and lights) or model "
        "(all of it one mesh). Default: a scene where it has cameras, lights, a mesh under several nodes, or marks of "
        "what is background");
}

static void add_surroundings(CLI::App& group, ViewOptions& o) {
    add_vector(group, "--light", o.light, "Direction towards the light (default: 0.4 0.7 0.6)");
    add_number(group, "--ambient", o.ambient, within(0, 1), "A", "Share of light from everywhere, 0..1 (default: 0.2)");
    add_number(group, "--fill-light", o.fill_light, within(0, 1), "F",
               "Share of the light that also comes from the opposite side, 0..1 (default: 0.25)");
    group
        .add_option(
            "--lights", o.lights,
            "Lights instead of these three: directional, point, spot, headlight, ambient, with highlights; with "
            "--path, and in the "
            "viewer, they may move (the keys: docs/getting-started.md, Lights)")
        ->type_name("FILE.json");
    group.add_flag_function(
        "--shadows,!--no-shadows", [&o](std::int64_t count) { o.shadows = count > 0; },
        "All lights of --lights or of a scene but headlights cast shadows, or none does (default: those that say so: "
        "\"shadow\" in --lights, extras.casts_shadow in glTF); at most 4");
    add_number(group, "--background", o.background_cdm2, not_negative(), "CDM2", "Background luminance (default: 20)");
    group.add_option("--unit", o.unit_metres, "Metres a mesh unit (default: 1)")
        ->type_name("METRES")
        ->check(positive());
    add_texture_options(group, o.texture);
    group.add_flag("--no-cache", o.no_cache,
                   "Of a mesh: build and measure its tree anew, and do not keep it (default: see unseen cache)");
}

void add_view_options(CLI::App& verb, ViewOptions& o) {
    CLI::App& group = *verb.add_option_group("VIEW", "Where from (world units are metres; see --unit)");
    add_vector(group, "--eye", o.eye, "The eye");
    add_vector(group, "--target", o.target, "What it looks at (default: the model's centre)");
    add_vector(group, "--up", o.up, "Up in the picture (default: 0 1 0)");
    add_vector(group, "--direction", o.direction, "Instead of --eye: from the model towards the eye (default: 0 0 1)");
    add_number(group, "--fill", o.fill, within(1e-6, 1e6), "F",
               "With --direction: the share of the window's height that the bounding sphere takes (default: 0.9)");
    add_number(group, "--fov", o.fov_degrees, within(1e-3, 179.9), "DEGREES",
               "Vertical field of view (default: that of a scene's camera, else the field that the window fills on the "
               "display)");
    group
        .add_option_function<std::string>(
            "--size",
            [&o](const std::string& text) {
                if (const auto complaint = parse_size(text, o.width, o.height); !complaint.empty())
                    refuse("--size: " + complaint);
            },
            "The window in pixels (default: 1024x1024)")
        ->type_name("WxH");
    add_surroundings(group, o);
    group.callback([&o] { check(o); });
}

void add_orthographic_option(CLI::App& verb, ViewOptions& o) {
    verb.add_option_function<std::string>(
            "--orthographic",
            [&o](const std::string& text) {
                o.is_orthographic = true;
                if (text == "fit") return;
                o.orthographic_height = number_from<double>(text);
                if (!o.orthographic_height || !(*o.orthographic_height > 0) || !std::isfinite(*o.orthographic_height))
                    refuse("--orthographic must be fit or a height above 0, not '" + text + "'");
            },
            "In parallel, not in perspective: the window is so many metres high, or fits the model (see --fill)")
        ->type_name("METRES|fit");
}

void add_surroundings_options(CLI::App& verb, ViewOptions& o) {
    CLI::App& group = *verb.add_option_group("MODEL", "How it is read, and what is around it");
    add_surroundings(group, o);
    group.callback([&o] { check(o); });
}

void add_display_options(CLI::App& verb, DisplayOptions& o) {
    CLI::App& group = *verb.add_option_group("DISPLAY", "On what display (default: 20 inch, 1600x1200, at 0.5 m)");
    group.add_option("--display", o.file, "A display profile")->type_name("FILE.json");
    add_number(group, "--ppd", o.pixels_per_degree, within(0.1, 1e5), "N", "Pixels per degree at the display's centre");
    add_number(group, "--distance", o.distance_m, positive(), "METRES", "From the eye to the screen");
    add_number(group, "--peak", o.peak_cdm2, positive(), "CDM2", "Luminance of white");
    add_number(group, "--black", o.black_cdm2, positive(), "CDM2", "Luminance of black");
    group
        .add_option("--observer", o.observer,
                    "Who looks: median (half of all people see more), default (one in twelve does), strict (one in "
                    "twenty), or the table of a viewer whom unseen calibrate measured")
        ->type_name("NAME|FILE");
    group
        .add_option("--csf", o.csf,
                    "Contrast sensitivity: a model of unseen csf (default: castle) for the observer, or a viewer's "
                    "table")
        ->type_name("MODEL|FILE");
}

void add_what_options(CLI::App& verb, WhatOptions& o) {
    CLI::App& group = *verb.add_option_group("WHAT", "Which simplification (default: --imperceptible)");
    Goal& goal = o.request.goal;
    const auto counted = [](std::int64_t) {}; // the options themselves know whether they were given
    CLI::Option* full = group.add_flag_function("--full", counted, "The input, whole");
    CLI::Option* imperceptible =
        group.add_flag_function("--imperceptible", counted, "Fold what nobody can see on this display");
    CLI::Option* triangles =
        add_triangles_option(group, o.budget, "At most N triangles, or P% of them, as inconspicuous as can be");
    CLI::Option* ratio =
        group
            .add_option_function<double>(
                "--ratio", [&o](const double& share) { o.budget = {.share = share}; }, "The same as a share, 0..1")
            ->type_name("SHARE")
            ->check(number_that("a share above 0 and up to 1, such as 0.5", [](double v) { return v > 0 && v <= 1; }));
    CLI::Option* fill = group.add_flag("--fill-budget", goal.fill,
                                       "With --triangles or --ratio: use all of them, even where it cannot be seen");
    add_number(group, "--milliseconds", o.request.milliseconds, not_negative(), "T",
               "The best cut that T milliseconds are enough for");
    CLI::Option* pixels =
        group.add_option("--pixels", goal.tolerance_px, "Fold what is smaller than E pixels, seen or not")
            ->type_name("E")
            ->check(positive());
    CLI::Option* threshold =
        group
            .add_option("--threshold", o.request.threshold,
                        "With --imperceptible: fold up to this cost: 1 (default) what cannot be seen, 2 what cannot be "
                        "seen from twice the distance")
            ->type_name("X")
            ->check(positive());
    add_fold_test_option(group, o.request.fold_test,
                         std::array{FoldTest::error, FoldTest::luebke_hallen, FoldTest::luebke_hallen_safe,
                                    FoldTest::extent, FoldTest::displacement},
                         "error (perceptual: what folds change in fact; default), luebke-hallen-safe (perceptual: what "
                         "they could change at most, more triangles), luebke-hallen (as published, unsafe: some folds "
                         "can be seen), extent or displacement (in pixels; of --pixels: extent)");
    group.add_flag("--chroma", o.request.chroma,
                   "Keep changes of colour that can be seen, too, not only those of luminance");
    add_gaze_option(group, o.gaze_px);
    add_number(
        group, "--velocity", o.velocity_deg_s, within(0, perception::fastest_velocity.value()), "DEG/S",
        "How fast everything moves on the retina: what is fine blurs, what is coarse is seen better (default: 0)");
    group.callback([=, &o] {
        Goal::Kind& kind = o.request.goal.kind;
        const std::size_t given =
            full->count() + imperceptible->count() + triangles->count() + ratio->count() + pixels->count();
        if (given > 1)
            refuse("--full, --imperceptible, --triangles, --ratio and --pixels exclude each other: give one of them.");
        if (*threshold && (*full || *pixels || o.budget.is_given()))
            refuse("--threshold is of --imperceptible: --full, --triangles and --pixels say themselves how much is "
                   "folded.");
        if (*fill && !o.budget.is_given()) refuse("--fill-budget needs --triangles N or --ratio SHARE.");
        if (o.request.milliseconds && *full) refuse("--milliseconds and --full exclude each other.");
        if (o.masks && (*full || *pixels || (o.request.fold_test && *o.request.fold_test != session::FoldTest::error)))
            refuse(
                "--masking scene needs --fold-test error, and a goal that it decides: nothing else knows what masks. "
                "Leave one of them out.");
        if (*full) kind = Goal::Kind::full;
        if (o.budget.is_given()) kind = Goal::Kind::budget;
        if (*pixels) kind = Goal::Kind::pixels;
        constexpr std::uint64_t of_some_model = 1000;
        if (const auto valid = session::validate(o.request_for(of_some_model)); !valid)
            refuse(with_option_names(valid.error().message));
    });
}

void add_visibility_option(CLI::App& verb, WhatOptions& o) {
    add_choice<Visibility, Visibility>(
        verb, "--visibility", o.visibility, {{"spheres", Visibility::spheres}, {"picture", Visibility::picture}},
        "What counts as hidden: what faces away or lies behind spheres inside solids (spheres; of 'unseen render' the "
        "default), or also all that lies behind what this picture shows (picture)");
}

void add_masking_option(CLI::App& verb, WhatOptions& o, bool adds_layers) {
    add_choice<bool, bool>(
        verb, "--masking", o.masks, {{"none", false}, {"scene", true}},
        "Whether patterns of the scene mask what folds change (scene): bars before a statue, leaves, "
        "and the statue's own; default: none");
    if (!adds_layers) return;
    verb.add_option(
            "--layers", o.layers,
            "With --masking scene: of depth, 1 to 16 (default: 5); objects are masked by what is in other layers")
        ->type_name("N")
        ->check(whole(1, 16));
}

} // namespace unseen::app
