// The options that several verbs share, and what they say.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <unseen/meshio/mesh_file.h>
#include <unseen/perception/units.h>
#include <unseen/session/gaze_player.h>
#include <unseen/session/load.h>
#include <unseen/session/request.h>

namespace unseen::app {

// Which options of a verb go together: a table for each verb, checked after the parse. Options are named as people give
// them: "--show", or with a value, "--show cost"; "--tracker error" stands for "--tracker error=0.5", too.
struct Rule {
    enum Kind { needs_one_of, excludes };
    std::string option;
    Kind kind;
    std::vector<std::string> others;
    std::string why = {}; // a clause, where the sentence without it would not be understood
};
// Ends the parse with a sentence where a rule is broken.
void check_rules(const CLI::App& verb, std::span<const Rule> rules);

using session::FoldTest;
using session::Goal;
using session::name_of;

struct TextureOptions {
    std::string file;                         // instead of the materials'
    bool is_left_out = false;                 // --no-texture
    meshio::LeftOut drop;                     // of glTF files
    bool skips_bad = false;                   // --skip-bad
    bool is_unwelded = false;                 // --no-weld
    bool is_prelit = false;                   // --prelit, of colours as well
    std::optional<float> crease;              // --crease, degrees
    std::vector<session::Protection> protect; // --protect and --lock-borders
};

// What is not given follows from the model and the display, see session/session.h.
struct ViewOptions {
    std::string setup;                         // the file that these options were read from
    std::optional<glm::dvec3> eye, target, up; // world units
    std::optional<glm::dvec3> direction;       // from the model towards the eye
    std::optional<double> fill;                // share of the window's height
    std::optional<double> fov_degrees;         // vertical
    double eye_distance = 0;                   // world units; 0: one eye
    double eye_shift = 0;                      // of the windows, outward, in halves of a window
    bool is_orthographic = false;
    std::optional<double> orthographic_height; // world units; not given: as --fill says
    int width = 1024, height = 1024;           // pixels
    std::optional<glm::dvec3> light;           // towards it
    std::optional<double> ambient;             // 0..1
    std::optional<double> fill_light;          // 0..1
    std::string lights;                        // a file of lights instead
    std::optional<bool> shadows;               // all lights cast some, or none; default: as the lights themselves say
    std::optional<double> background_cdm2;
    double unit_metres = 1; // world units a mesh unit
    TextureOptions texture;
    bool no_cache = false;                       // trees are neither kept nor taken from what was kept
    bool measures = true;                        // what folds change, when a tree is built
    session::LoadAs as = session::LoadAs::model; // what glTF files become
};

struct DisplayOptions {
    std::string file;
    std::optional<double> pixels_per_degree, distance_m, peak_cdm2, black_cdm2;
    std::string observer; // a person's name or a file's
    std::string csf;      // a model's name or a file's
};

// A number of triangles, or a share of the model's.
struct TriangleCount {
    // "5000", "10k", "1e4", "10,000" or "50%".
    static std::optional<TriangleCount> of(const std::string& text);

    std::uint32_t triangles = 0; // 0: by the share
    double share = 0;            // 0.5: half of them

    bool is_given() const { return triangles > 0 || share > 0; }
    // For a model with `all` triangles; at least one.
    std::uint32_t of(std::uint64_t all) const;
};

// What counts as hidden: what lies behind spheres inside solids, or also what lies behind anything in the picture.
enum class Hiding { spheres, picture };

struct WhatOptions {
    session::Request request; // of budgets, without the number of triangles
    TriangleCount budget;

    // Whether a test may go by what folds change; tolerances in pixels do not.
    bool needs_measurement() const;
    // For a model with that many triangles.
    session::Request request_for(std::uint64_t source_triangles) const;
    std::optional<glm::dvec2> gaze_px;
    std::optional<double> velocity_deg_s; // of everything, on the retina
    Hiding hiding = Hiding::spheres;
    bool is_checked = false; // by pictures; with
    double check_cell = 0;   // degrees
    double check_seconds = 120;
    perception::DegreesPerSecond velocity() const { return perception::DegreesPerSecond(velocity_deg_s.value_or(0)); }
};

// Where gazes come from; a fixed one is WhatOptions::gaze_px.
using session::GazeOptions;
using session::GazeSource;

// Each adds options to a verb; setup.h has those of the whole program. The structs must outlive the parser. Impossible
// values end the parse with an error that names the option.
// The model, for verbs that look at one. `takes_scenes`: only for the help.
void add_model_option(CLI::App& verb, std::string& model, bool takes_scenes = true);
// The group WHAT. `rules`: what excludes what, for check_rules().
void add_what_options(CLI::App& verb, WhatOptions& options, std::vector<Rule>& rules);
void add_hiding_option(CLI::App& verb, WhatOptions& options, std::vector<Rule>& rules);
// A quality by name, or the cost up to which folds are made: session::Goal::cost.
void add_quality_option(CLI::App& verb, Goal& goal);
void add_check_options(CLI::App& verb, WhatOptions& options, std::vector<Rule>& rules);
// Gazes that move, beside WHAT, for verbs with frames in time. `allows_mouse`: the verb has a window.
void add_moving_gaze_options(CLI::App& verb, GazeOptions& options, bool allows_mouse, std::vector<Rule>& rules);
// How well the gaze is known. `moves`: so that it may be late, too.
void add_tracker_option(CLI::App& verb, GazeOptions& options, bool moves);
void add_geomorph_option(CLI::App& verb, std::optional<double>& seconds, std::vector<Rule>& rules);
void add_gaze_option(CLI::App& verb, std::optional<glm::dvec2>& gaze_px);
void add_velocity_option(CLI::App& verb, std::optional<double>& degrees_a_second);
// The default for pictures that are judged.
inline constexpr int samples_to_judge = 64;
void add_samples_option(CLI::App& verb, int& samples, const std::string& defaults);
void add_seed_option(CLI::App& verb, std::uint64_t& seed, const std::string& of);
void add_fold_test_option(CLI::App& verb, std::optional<FoldTest>& chosen, bool only_perceptual = false);
void add_json_option(CLI::App& verb, std::string& file);
void add_verbose_option(CLI::App& verb, bool& is_verbose);
// As TriangleCount::of() takes it.
CLI::Option* add_triangles_option(CLI::App& verb, TriangleCount& count, const std::string& text);

// "a, b or c".
std::string listed(const std::vector<std::string>& names);

// Validators. All of them refuse NaN and infinities.
CLI::Validator finite_numbers(int count); // for an option that takes `count` of them
CLI::Validator positive();
CLI::Validator not_negative();
CLI::Validator within(double low, double high);
CLI::Validator whole(double low, double high); // a whole number
CLI::Validator one_of(std::vector<std::string> names);
// Upper case is fine in the name; `ending` is in lower case, with the point.
bool has_ending(const std::string& file, const std::string& ending);
// The file name ends in one of these (lower case, with the point); upper case is fine in the name.
CLI::Validator ending_in(std::vector<std::string> endings);

// An option that takes one of these names and puts the value of the same place into `target`, which is left as it is
// where the option is not given. What Value is, Target can be set to.
template <class Target, class Value>
CLI::Option* add_choice(CLI::App& verb, const std::string& option, Target& target,
                        std::vector<std::pair<std::string, Value>> choices, const std::string& text) {
    std::vector<std::string> names;
    for (const auto& [name, value] : choices) names.push_back(name);
    const auto take = [&target, choices = std::move(choices)](const std::string& given) {
        for (const auto& [name, value] : choices)
            if (name == given) target = value;
    };
    return verb.add_option_function<std::string>(option, take, text)
        ->type_name("NAME")
        ->check(one_of(std::move(names)));
}

// An option that takes a value of this kind, or values.
template <class Value>
CLI::Option* add_value(CLI::App& verb, const std::string& name, Value& value, const CLI::Validator& validator,
                       const std::string& unit, const std::string& text) {
    return verb.add_option(name, value, text)->type_name(unit)->check(validator);
}
template <class Value>
CLI::Option* add_value(CLI::App& verb, const std::string& name, std::optional<Value>& value,
                       const CLI::Validator& validator, const std::string& unit, const std::string& text) {
    const auto take = [&value](const Value& given) { value = given; };
    return verb.add_option_function<Value>(name, take, text)->type_name(unit)->check(validator);
}

// An option that takes three numbers.
CLI::Option* add_vector(CLI::App& verb, const std::string& name, std::optional<glm::dvec3>& value,
                        const std::string& text);

// Ends the parse: exit status 2.
[[noreturn]] void refuse(const std::string& message);

} // namespace unseen::app
