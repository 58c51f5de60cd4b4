#include "setup.h"

#include <algorithm>
#include <filesystem>

#include <nlohmann/json.hpp>

#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/number_text.h>

#include "terminal.h"

namespace unseen::app {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr int largest_window_px = 32768; // a side, as vdtree::validate has it
// The group of options that few need: fields of the file, which the command line takes without a word about them.
constexpr const char* in_file_alone = "In FILE.json alone";

bool is_field(const CLI::Option& option) { return option.get_group() == in_file_alone; }
bool is_shown(const CLI::Option& option) { return !option.get_group().empty() && !is_field(option); }

// "1024x768", or "512" for a square.
std::string parse_size(const std::string& text, int& width, int& height) {
    const std::size_t x = text.find('x');
    const auto side = [](std::string_view digits, int& value) {
        const auto pixels = number_from<int>(digits);
        if (pixels) value = *pixels;
        return pixels && value >= 1 && value <= largest_window_px;
    };
    if (side(std::string_view(text).substr(0, x), width) &&
        side(x == text.npos ? text : std::string_view(text).substr(x + 1), height))
        return {};
    return "must be WIDTHxHEIGHT with 1 to " + std::to_string(largest_window_px) + " pixels a side, not '" + text + "'";
}

void check(const ViewOptions& view) {
    if (view.direction && *view.direction == glm::dvec3(0)) refuse("--direction must not be 0 0 0.");
    if (view.light && *view.light == glm::dvec3(0)) refuse("--light must not be 0 0 0.");
    if (view.up && *view.up == glm::dvec3(0)) refuse("--up must not be 0 0 0.");
    if (view.eye && view.target && *view.eye == *view.target) refuse("--eye and --target are the same point.");
    if (view.is_orthographic && view.eye && !view.orthographic_height)
        refuse(
            "--orthographic fit frames the whole model, and excludes --eye: say how many metres the window is high.");
    if (view.orthographic_height && view.fill)
        refuse(
            "--fill and the height of --orthographic exclude each other: say --orthographic fit, or leave out --fill.");
}

const std::vector<Rule>& rules() {
    static const std::vector<Rule> all = {
        {"--eye", Rule::excludes, {"--direction", "--fill"}, "give one of them"},
        {"--target", Rule::needs_one_of, {"--eye"}, "without an eye the whole model is framed"},
        {"--fov", Rule::excludes, {"--orthographic"}, "a parallel view has no field of view"},
        {"--eyes", Rule::excludes, {"--orthographic"}, "a parallel view has no two eyes"},
        {"--prelit", Rule::excludes, {"--light", "--ambient", "--fill-light", "--lights"}, "these light the colours"},
        {"--lights", Rule::excludes, {"--light", "--ambient", "--fill-light"}, "say all of it in the file"},
        {"--texture", Rule::excludes, {"--no-texture"}},
    };
    return all;
}

// "borders", "material=NAME" or a file, each with ":WEIGHT" behind it or not.
session::Protection protection_of(const std::string& text) {
    session::Protection protection;
    const std::size_t colon = text.rfind(':');
    const auto weight =
        colon == text.npos ? std::nullopt : number_from<float>(std::string_view(text).substr(colon + 1));
    if (weight) protection.weight = *weight;
    if (!vdtree::is_fold_weight(protection.weight))
        refuse("--protect: the weight of '" + text + "' must be from 1 to 1000; without one nothing of it folds.");
    const std::string what = weight ? text.substr(0, colon) : text;
    constexpr std::string_view of_material = "material=";
    if (what == "borders") return protection;
    const bool is_material = what.starts_with(of_material);
    protection.kind = is_material ? session::Protection::Kind::material : session::Protection::Kind::vertices;
    protection.name = is_material ? what.substr(of_material.size()) : what;
    return protection;
}

// What the parser takes for a value of the file: one word for each number of an array.
std::vector<std::string> words_of(const Json& value) {
    std::vector<std::string> words;
    if (value.is_array())
        for (const Json& element : value)
            for (const std::string& word : words_of(element)) words.push_back(word);
    else if (value.is_string()) words.push_back(value.get<std::string>());
    else if (value.is_boolean() || value.is_number()) words.push_back(value.dump());
    return words;
}

} // namespace

Setup::Setup(CLI::App& program) : program_(program) {
    // First, for the parser works in this order: what is given on the command line counts, not what the file says.
    program
        .add_option_function<std::string>(
            "--setup", [this](const std::string& file) { read_file(file); },
            "A file of these options: JSON, the keys are their names without dashes")
        ->type_name("FILE.json")
        ->group("");
    add_view();
    add_display();
    add_light();
    add_files();
}

CLI::App& Setup::add_section(const std::string& name, const std::string& about) {
    CLI::App* const group = program_.add_option_group(name, about);
    group->group("");
    sections_.push_back({group, name});
    return *group;
}

void Setup::mark(CLI::App& section, unsigned part) {
    for (CLI::Option* option : section.get_options())
        if (option != section.get_help_ptr() &&
            std::ranges::none_of(options_, [&](const auto& known) { return known.first == option; }))
            options_.push_back({option, part});
}

void Setup::add_view() {
    ViewOptions& o = view_;
    CLI::App& group = add_section("view", "Where from; world units are metres (see --unit)");
    add_vector(group, "--eye", o.eye, "The eye");
    add_vector(group, "--target", o.target, "What it looks at (default: the model's centre)");
    add_vector(group, "--up", o.up, "Up in the picture (default: 0 1 0)");
    add_vector(group, "--direction", o.direction, "In place of --eye: from the model towards the eye (default: 0 0 1)");
    add_value(group, "--fill", o.fill, within(1e-6, 1e6), "F",
              "With --direction: the share of the window's height that the bounding sphere takes (default: 0.9)");
    add_value(group, "--fov", o.fov_degrees, within(1e-3, 179.9), "DEGREES",
              "Vertical field of view (default: that of the scene's camera, or what the window fills on the display)");
    group
        .add_option_function<std::string>(
            "--size",
            [&o](const std::string& text) {
                if (const auto complaint = parse_size(text, o.width, o.height); !complaint.empty())
                    refuse("--size: " + complaint);
            },
            "The window in pixels (default: 1024x1024)")
        ->type_name("WxH|N");
    mark(group, view);
    group
        .add_option_function<std::string>(
            "--orthographic",
            [&o](const std::string& text) {
                o.is_orthographic = true;
                if (text == "fit") return;
                o.orthographic_height = number_from<double>(text);
                if (!o.orthographic_height || !(*o.orthographic_height > 0) || !std::isfinite(*o.orthographic_height))
                    refuse("--orthographic must be fit or a height above 0, not '" + text + "'");
            },
            "A parallel view: the window is METRES high, or fits the model (see --fill)")
        ->type_name("METRES|fit");
    mark(group, parallel);
    group
        .add_option_function<std::string>(
            "--eyes",
            [&o](const std::string& text) {
                const std::size_t comma = text.find(',');
                const auto distance = number_from<double>(std::string_view(text).substr(0, comma));
                const std::optional<double> shift =
                    comma == text.npos ? 0.0 : number_from<double>(std::string_view(text).substr(comma + 1));
                if (!distance || !(*distance > 0) || !std::isfinite(*distance) || !shift || !(std::abs(*shift) < 1))
                    refuse("--eyes: must be METRES or METRES,SHIFT: above 0, and between -1 and 1, not '" + text +
                           "'.");
                o.eye_distance = *distance;
                o.eye_shift = *shift;
            },
            "For both eyes at once, so far apart, which look the same way; SHIFT: by how many halves of a window each "
            "eye's is shifted outward, as in a headset (default: 0). Pictures are side by side")
        ->type_name("METRES[,SHIFT]");
    mark(group, two_eyes);
}

void Setup::add_display() {
    DisplayOptions& o = display_;
    CLI::App& group = add_section("display", "On what display, for whom (default: 20 inch, 1600x1200, at 0.5 m)");
    group.add_option("--display", o.file, "A display profile")->type_name("FILE.json");
    add_value(group, "--ppd", o.pixels_per_degree, within(0.1, 1e5), "N", "Pixels per degree at the display's centre");
    add_value(group, "--distance", o.distance_m, positive(), "METRES", "From the eye to the screen");
    add_value(group, "--peak", o.peak_cdm2, positive(), "CDM2", "Luminance of white");
    add_value(group, "--black", o.black_cdm2, positive(), "CDM2", "Luminance of black")->group(in_file_alone);
    mark(group, display);
    group
        .add_option("--observer", o.observer,
                    "Who looks: median (half of all people see more), default (one in twelve does), strict (one in "
                    "twenty), or the table of a viewer whom 'unseen calibrate' measured")
        ->type_name("NAME|FILE");
    mark(group, observer);
    group
        .add_option("--csf", o.csf,
                    "Contrast sensitivity: a model of 'unseen csf' (default: castle) for the observer, or a viewer's "
                    "table")
        ->type_name("MODEL|FILE");
    mark(group, csf);
}

void Setup::add_light() {
    ViewOptions& o = view_;
    CLI::App& group = add_section("light", "What is around the model");
    add_vector(group, "--light", o.light, "Direction towards the light (default: 0.4 0.7 0.6)");
    add_value(group, "--ambient", o.ambient, within(0, 1), "A", "Share of light from everywhere, 0..1 (default: 0.2)")
        ->group(in_file_alone);
    add_value(group, "--fill-light", o.fill_light, within(0, 1), "F",
              "Share of the light that also comes from the opposite side, 0..1 (default: 0.25)")
        ->group(in_file_alone);
    group
        .add_option("--lights", o.lights,
                    "Lights in place of --light, ambient and fill-light: directional, point, spot, headlight, ambient, "
                    "with highlights; in "
                    "'unseen fly' and 'unseen view' they may move")
        ->type_name("FILE.json");
    group.add_flag_function(
        "--shadows,!--no-shadows", [&o](std::int64_t count) { o.shadows = count > 0; },
        "All lights but headlights cast shadows, or none does (default: those that say so: \"shadow\" in --lights, "
        "extras.casts_shadow in glTF); at most 4");
    add_value(group, "--background", o.background_cdm2, not_negative(), "CDM2", "Background luminance (default: 20)");
    add_value(group, "--unit", o.unit_metres, positive(), "METRES", "Metres a mesh unit (default: 1)");
    mark(group, light);
}

void Setup::add_files() {
    TextureOptions& o = view_.texture;
    CLI::App& group = add_section("files", "How mesh files are read");
    group
        .add_option_function<std::string>(
            "--texture",
            [&o](const std::string& name) {
                if (name == "none") o.is_left_out = true;
                else o.file = name;
            },
            "The image that lies over a mesh with texture coordinates, in place of its materials' images; a folder in "
            "which these are looked for, too; or none: ignore images, which simplified meshes keep")
        ->type_name("IMAGE|FOLDER|none");
    group.add_flag("--no-texture", o.is_left_out)->group(""); // --texture none
    group
        .add_option_function<std::vector<std::string>>(
            "--drop",
            [&o](const std::vector<std::string>& names) {
                for (const std::string& name : names)
                    (name == "skins"           ? o.drop.skins
                     : name == "morph-targets" ? o.drop.morph_targets
                     : name == "animations"    ? o.drop.animations
                                               : o.drop.extensions) = true;
            },
            "Leave out what glTF files have and simplified meshes cannot: skins, morph-targets, animations, extensions "
            "(required by the file and unknown here); with commas between them")
        ->type_name("NAMES")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->check(one_of({"skins", "morph-targets", "animations", "extensions"}));
    group
        .add_flag("--no-weld", o.is_unwelded,
                  "In STL files each facet keeps its normal and three vertices of its own (default: those at the same "
                  "place become one)")
        ->group(in_file_alone);
    group
        .add_option_function<std::string>(
            "--crease",
            [&o](const std::string& text) {
                o.crease = text == "smooth" ? 180.0f : number_from<float>(text);
                if (!o.crease || !(*o.crease >= 0 && *o.crease <= 180))
                    refuse("--crease must be smooth or an angle from 0 to 180 degrees, not '" + text + "'");
            },
            "Where a mesh has neither normals nor smoothing groups, edges at a larger angle are hard (default: 30, or "
            "60 "
            "where that would facet an organic form)")
        ->type_name("DEGREES|smooth")
        ->group(in_file_alone);
    group
        .add_option_function<std::vector<std::string>>(
            "--protect",
            [&o](const std::vector<std::string>& all) {
                for (const std::string& text : all) o.protect.push_back(protection_of(text));
            },
            "What to keep more than the rest; may be repeated: 'borders' (--lock-borders), so that parts of a mesh "
            "which share a border fit each other however they are simplified; the triangles of a material; or the "
            "vertices of a text file with a number a line for each vertex of the mesh, from 0 (as usual) to 1. With a "
            "weight, 1 to 1000, folds there count as so many times as large; without one there are none")
        ->type_name("borders|material=NAME|FILE[:WEIGHT]")
        ->allow_extra_args(false);
    group.add_flag_function("--lock-borders", [&o](std::int64_t) { o.protect.emplace_back(); })->group("");
    group.add_flag("--prelit", o.is_prelit,
                   "Colours and images have light baked in (default: they are reflectance, and are lit)");
    mark(group, files);
    group
        .add_flag("--skip-bad", o.skips_bad,
                  "Leave out faces with vertices that are missing, or have NaN or infinite coordinates")
        ->group(in_file_alone);
    mark(group, skip_bad);
    group.add_flag("--no-cache", view_.no_cache,
                   "Build and measure the mesh's tree anew, and do not keep it (default: see 'unseen cache')");
    mark(group, cache);
    add_choice<session::LoadAs, session::LoadAs>(
        group, "--as", view_.as, {{"scene", session::LoadAs::scene}, {"model", session::LoadAs::model}},
        "A glTF file is read as a scene (many objects, each simplified by itself, with the file's camera and lights) "
        "or as one model (default: a scene if it has cameras, lights, a mesh under several nodes, or marks of what is "
        "background)");
    mark(group, scenes);
}

void Setup::act_in(CLI::App& verb, unsigned parts) {
    verbs_[&verb] = parts;
    for (CLI::App* app = &verb; app != &program_; app = app->get_parent()) app->fallthrough();
}

unsigned Setup::parts_of(const CLI::App& verb) const {
    const auto found = verbs_.find(&verb);
    return found == verbs_.end() ? 0 : found->second;
}

std::vector<std::string> Setup::names_in(unsigned parts) const {
    std::vector<std::string> names;
    if (parts != 0) names.push_back("--setup");
    for (const auto& [option, part] : options_)
        if ((part & parts) && is_shown(*option)) names.push_back(option->get_name());
    return names;
}

std::string Setup::summary_of(const CLI::App& verb) const {
    if (parts_of(verb) == 0) return {};
    std::string text = "Setup, on the command line or in --setup FILE.json; 'unseen help setup' explains it:\n";
    const auto add_line = [&](const std::string& name, const auto& belongs, std::size_t dashes) {
        std::string names;
        for (const auto& [option, part] : options_)
            if ((part & parts_of(verb)) && belongs(*option)) names += " " + option->get_name().substr(dashes);
        if (!names.empty()) text += "  " + name + ":" + std::string(9 - name.size(), ' ') + names + "\n";
    };
    for (const Section& section : sections_)
        add_line(
            section.name,
            [&](const CLI::Option& option) {
                return is_shown(option) && section.group->get_option_no_throw(option.get_name()) == &option;
            },
            0);
    add_line("in file", is_field, 2);
    return text;
}

// The name without dashes. (CLI11 tells none of an option that no help shows.)
std::string key_of(const CLI::Option& option) { return option.get_lnames().front(); }

std::string Setup::help() const {
    std::string text =
        "The setup: from where one looks, on what display, under what light, and how files are read. The verbs share\n"
        "these options; the help of each verb names those that act in it.\n\n"
        "--setup FILE.json reads them from a file: JSON, the keys are the names without dashes. Options on the "
        "command\n"
        "line count more. A verb takes from the file what acts in it. Files named in it are looked for in its folder\n"
        "first.\n\n"
        "  {\"display\": \"lab.json\", \"observer\": \"strict\", \"light\": [1, 0, 0], \"shadows\": false, \"size\": "
        "\"512x512\"}\n";
    const CLI::Formatter formatter;
    for (const Section& section : sections_) {
        const std::string options = formatter.make_expanded(section.group);
        text += "\n" + section.name + options.substr(options.find('\n')); // whose first line names no group
    }
    return text;
}

void Setup::check(const CLI::App& verb) {
    const auto is_given = [](const CLI::Option* option) { return !option->empty(); };
    for (const auto& [option, part] : options_)
        if (is_given(option) && !(part & parts_of(verb)))
            refuse("--" + key_of(*option) + " does not act in 'unseen " + verb.get_name() + "': leave it out.");
    if (is_given(program_.get_option("--setup")) && parts_of(verb) == 0)
        refuse("--setup does not act in 'unseen " + verb.get_name() + "': leave it out.");
    if (program_.get_option("--as")->empty() && (parts_of(verb) & scenes)) view_.as = session::LoadAs::automatic;
    check_rules(verb, rules());
    app::check(view_);
}

void Setup::read_file(const std::string& file) {
    view_.setup = file;
    const auto text = read_text_file(file);
    if (!text) refuse(text.error().message);
    const Json json = Json::parse(*text, nullptr, false);
    if (!json.is_object()) refuse("'" + file + "' is no JSON object of options, such as {\"size\": \"512x512\"}.");
    const CLI::App* verb = &program_;
    while (!verb->get_subcommands().empty()) verb = verb->get_subcommands().front();
    const auto refuse_key = [&](const std::string& key) {
        std::vector<std::string> keys;
        for (const auto& known : options_) keys.push_back(key_of(*known.first));
        const std::string near = suggestion(key, keys);
        refuse("'" + file + "': there is no option '" + key + "' of the setup" + (near.empty() ? "." : near));
    };
    const auto refuse_value = [&](const std::string& key) {
        refuse("'" + file + "', " + key + ": must be a number, a text, true, false, or an array.");
    };
    for (const auto& [key, value] : json.items()) {
        const auto own = std::ranges::find(options_, key, [](const auto& known) { return key_of(*known.first); });
        if (own == options_.end()) refuse_key(key);
        const auto& [option, part] = *own;
        if (!(part & parts_of(*verb)) || !option->empty()) continue;
        const std::vector<std::string> words = words_of(value);
        if (words.empty()) refuse_value(key);
        take(file, key, *option, words);
    }
}

void Setup::take(const std::string& file, const std::string& key, CLI::Option& option,
                 const std::vector<std::string>& words) {
    try {
        for (const std::string& word : words) {
            const fs::path beside = fs::path(file).parent_path() / word;
            const bool names_file = option.get_type_name().find("FILE") != std::string::npos ||
                                    option.get_type_name().find("IMAGE") != std::string::npos;
            std::error_code none;
            option.add_result(names_file && fs::is_regular_file(beside, none) ? beside.string() : word);
        }
        option.run_callback();
    } catch (const CLI::Error& error) {
        refuse("'" + file + "', " + key + ": " + error.what());
    }
}

} // namespace unseen::app
