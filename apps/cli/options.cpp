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
#include <unseen/perception/internal/motion.h>
#include <unseen/vdtree/internal/number_text.h>

#include "option_names.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr double largest_seed = 9007199254740992.0; // 2^53, to which doubles count

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

// "--show cost": the option, given with that value. Options of the setup lie in the program, not in the verb.
bool is_given(const CLI::App& verb, const std::string& words) {
    const std::size_t blank = words.find(' ');
    const CLI::Option* option = nullptr;
    for (const CLI::App* app = &verb; app && !option; app = app->get_parent())
        option = app->get_option_no_throw(words.substr(0, blank));
    if (!option || option->empty()) return false;
    if (blank == words.npos) return true;
    const std::string value = words.substr(blank + 1);
    return std::ranges::any_of(option->results(),
                               [&](const std::string& own) { return own == value || own.starts_with(value + "="); });
}

} // namespace

[[noreturn]] static void refuse_both(const std::string& option, const std::string& other, const std::string& why) {
    refuse(option + " and " + other + " exclude each other" + why);
}

void check_rules(const CLI::App& verb, std::span<const Rule> rules) {
    const auto given = [&](const std::string& option) { return is_given(verb, option); };
    for (const Rule& rule : rules) {
        if (!given(rule.option)) continue;
        const std::string why = rule.why.empty() ? "." : ": " + rule.why + ".";
        if (rule.kind == Rule::needs_one_of) {
            if (std::ranges::none_of(rule.others, given)) refuse(rule.option + " needs " + listed(rule.others) + why);
            continue;
        }
        for (const std::string& other : rule.others)
            if (given(other)) refuse_both(rule.option, other, why);
    }
}

std::string listed(const std::vector<std::string>& names) {
    std::string list;
    for (std::size_t i = 0; i < names.size(); ++i)
        list += (i == 0 ? "" : i + 1 < names.size() ? ", " : " or ") + names[i];
    return list;
}

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

void add_geomorph_option(CLI::App& verb, std::optional<double>& seconds, std::vector<Rule>& rules) {
    add_value(verb, "--geomorph", seconds, within(0, 60), "SECONDS",
              "Where the cut changes, vertices glide for this long, up to 60 s (default: they jump)");
    rules.push_back({"--geomorph", Rule::excludes, {"--lights"}, "vertices that glide are not lit"});
}

void add_gaze_option(CLI::App& verb, std::optional<glm::dvec2>& gaze_px) {
    verb.add_option_function<std::array<double, 2>>(
            "--gaze", [&gaze_px](const std::array<double, 2>& v) { gaze_px = glm::dvec2(v[0], v[1]); },
            "Where the viewer looks, in pixels from the top left; may lie outside the window "
            "(default: anywhere, so everything is seen as sharply as at the fovea)")
        ->type_name("X Y")
        ->check(finite_numbers(2));
}

void add_velocity_option(CLI::App& verb, std::optional<double>& degrees_a_second) {
    add_value(
        verb, "--velocity", degrees_a_second, within(0, perception::fastest_velocity.value()), "DEG/S",
        "How fast everything moves on the retina: fine detail blurs, coarse patterns are seen better (default: 0)");
}

void add_samples_option(CLI::App& verb, int& samples, const std::string& defaults) {
    add_value(verb, "--samples", samples, whole(1, 256), "N", "Samples a pixel, 1 to 256 (default: " + defaults + ")");
}

void add_seed_option(CLI::App& verb, std::uint64_t& seed, const std::string& of) {
    verb.add_option_function<double>(
            "--seed", [&seed](const double& v) { seed = static_cast<std::uint64_t>(v); }, of + " (default: 1)")
        ->type_name("N")
        ->check(whole(0, largest_seed));
}

void add_tracker_option(CLI::App& verb, GazeOptions& o, bool moves) {
    const auto take = [&o, moves](const std::string& word) {
        const std::size_t equals = word.find('=');
        const std::string key = word.substr(0, equals);
        const auto value = equals == word.npos ? std::nullopt : finite_from(word.substr(equals + 1));
        const auto is_within = [&](double most) { return value && *value >= 0 && *value <= most; };
        if (key == "error" && is_within(180)) o.tracker.error_deg = *value;
        else if (moves && key == "latency" && is_within(10000)) o.tracker.latency_s = *value / 1000;
        else if (moves && key == "seed" && is_within(largest_seed) && *value == std::floor(*value))
            o.seed = static_cast<std::uint64_t>(*value);
        else if (moves && word == "suppression") o.tracker.suppression = true;
        else
            refuse("--tracker: must be error=DEGREES, up to 180" +
                   std::string(moves ? ", latency=MILLISECONDS, up to 10000, seed=N or suppression" : "") + ", not '" +
                   word + "'");
    };
    verb.add_option_function<std::vector<std::string>>(
            "--tracker", [take](const std::vector<std::string>& words) { std::ranges::for_each(words, take); },
            moves ? "How well the gaze is known, with commas between: error=DEGREES widens the fovea; "
                    "latency=MILLISECONDS, from the eye to the picture, widens it by the gaze's speed; suppression "
                    "keeps still during saccades, when nothing is seen; seed=N, of simulated gazes (default: 1)"
                  : "error=DEGREES: how well the gaze is known, which widens the fovea (default: 0)")
        ->type_name(moves ? "KEY=VALUE,..." : "error=DEGREES")
        ->delimiter(',')
        ->allow_extra_args(false);
}

void add_moving_gaze_options(CLI::App& verb, GazeOptions& o, bool allows_mouse, std::vector<Rule>& rules) {
    CLI::App& group = *verb.add_option_group("GAZE", "Where the viewer looks, frame by frame, in place of --gaze");
    std::vector<std::pair<std::string, GazeSource>> sources = {{"simulated", GazeSource::simulated},
                                                               {"head", GazeSource::head}};
    if (allows_mouse) sources.push_back({"mouse", GazeSource::mouse});
    const auto take = [&o, sources](const std::string& given) {
        o.source = GazeSource::trace;
        for (const auto& [name, source] : sources)
            if (name == given) o.source = source;
        if (o.source != GazeSource::trace) return;
        std::vector<std::string> names;
        for (const auto& known : sources) names.push_back(known.first);
        names.emplace_back("the file of a recording");
        if (given.find_first_of("./") == given.npos)
            refuse("--gaze-mode: must be " + listed(names) + ", not '" + given + "'");
        o.trace = given;
    };
    group
        .add_option_function<std::string>(
            "--gaze-mode", take,
            std::string("simulated: fixations and saccades by published statistics; head: no tracker, within 15 "
                        "degrees of the middle; ") +
                (allows_mouse ? "mouse: at the pointer; " : "") +
                "or a recording: a table with columns such as time_s, x_px and y_px, or as Tobii, Pupil Labs and "
                "EyeLink name them; blinks hold the last position")
        ->type_name("NAME|FILE.csv|FILE.tsv");
    add_tracker_option(group, o, true);
    const std::vector<std::string> still = {"--gaze-mode head", "--gaze-mode mouse"};
    const std::string why = "only simulated and recorded gazes tell how the eye moves";
    rules.push_back({"--gaze", Rule::excludes, {"--gaze-mode"}});
    rules.push_back({"--tracker seed", Rule::needs_one_of, {"--gaze-mode simulated"}});
    for (const std::string option : {"--tracker latency", "--tracker suppression"}) {
        rules.push_back({option, Rule::needs_one_of, {"--gaze-mode"}, why});
        rules.push_back({option, Rule::excludes, still, why});
    }
}

// A name, or the cost up to which folds are made.
void add_quality_option(CLI::App& verb, Goal& goal) {
    std::string names, text = "How much of a difference may be left. ";
    for (const session::QualityFacts& facts : session::qualities()) {
        names += (names.empty() ? "" : ", ") + std::string(facts.name);
        text += std::string(facts.name) + ": " + std::string(facts.summary) + "; ";
    }
    text += "or the cost up to which folds are made, such as 2: what cannot be seen from twice the distance";
    const auto take = [&goal, names](const std::string& given) {
        for (const session::QualityFacts& facts : session::qualities())
            if (facts.name == given) {
                goal = Goal::quality(facts.quality);
                return;
            }
        const auto cost = finite_from(given);
        if (!cost || !(*cost > 0)) refuse("--quality: must be " + names + ", or a cost above 0, not '" + given + "'");
        goal = Goal::up_to(*cost);
    };
    verb.add_option_function<std::string>("--quality", take, text)->type_name("NAME|COST");
}

void add_fold_test_option(CLI::App& verb, std::optional<FoldTest>& chosen, bool only_perceptual) {
    std::vector<std::pair<std::string, FoldTest>> choices;
    std::string text;
    for (const session::FoldTestFacts& facts : session::fold_tests()) {
        if (only_perceptual && !facts.is_perceptual) continue;
        choices.emplace_back(facts.name, facts.test);
        text += (text.empty() ? "" : ", ") + std::string(facts.name) + " (" + std::string(facts.summary) + ")";
    }
    add_choice(verb, "--fold-test", chosen, std::move(choices), text);
}

void add_json_option(CLI::App& verb, std::string& file) {
    verb.add_option("--json", file, "Report as JSON, to a file or to stdout (-)")->type_name("FILE|-");
}

void add_verbose_option(CLI::App& verb, bool& is_verbose) {
    verb.add_flag("--verbose", is_verbose, "Say more: times, counts, and which effects took part and why");
}

// "10,000" -> "10000"; left alone unless the commas stand before groups of three digits.
static std::string without_commas(std::string text) {
    const std::size_t first = text.find(',');
    if (first == std::string::npos || first == 0 || first > 3) return text;
    for (std::size_t at = first; at < text.size(); at += 4) {
        const bool is_group = text[at] == ',' && at + 4 <= text.size() &&
                              text.find_first_not_of("0123456789", at + 1) >= std::min(at + 4, text.size());
        if (!is_group) return text;
    }
    std::erase(text, ',');
    return text;
}

std::optional<TriangleCount> TriangleCount::of(const std::string& text) {
    std::string digits = without_commas(text);
    if (digits.empty()) return std::nullopt;
    const char unit = digits.back();
    const double factor = unit == 'k' ? 1e3 : unit == 'M' ? 1e6 : 1;
    if (unit == '%' || factor > 1) digits.pop_back();
    const auto value = finite_from(digits);
    if (!value || !(*value > 0)) return std::nullopt;
    if (unit == '%') return TriangleCount{.share = *value / 100};
    const double count = *value * factor;
    if (count < 1 || count != std::round(count)) return std::nullopt;
    constexpr double most = std::numeric_limits<std::uint32_t>::max();
    return TriangleCount{.triangles = static_cast<std::uint32_t>(std::min(count, most))};
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
    return verb
        .add_option_function<std::string>(
            "--triangles",
            [&count](const std::string& given) {
                const auto value = TriangleCount::of(given);
                if (!value)
                    refuse(
                        "--triangles: must be a whole number of 1 or more such as 5000, 10k or 1e4, or a share above "
                        "0% such as 50%, not '" +
                        given + "'");
                if (value->share > 1) print_note("--triangles " + given + ": a model has no more than 100%.");
                count = *value;
            },
            text)
        ->type_name("N|P%");
}

// Pictures are what people confuse with models.
void add_model_option(CLI::App& verb, std::string& model, bool takes_scenes) {
    verb.add_option("TREE", model, takes_scenes ? "A tree, a mesh, or a scene (glTF)" : "A tree, or a mesh")
        ->required()
        ->type_name(takes_scenes ? "TREE.vdt|MESH|SCENE.glb" : "TREE.vdt|MESH")
        ->check([](const std::string& file) {
            constexpr std::array pictures = {".png", ".pfm", ".exr", ".jpg", ".jpeg", ".svg"};
            const bool is_picture =
                std::ranges::any_of(pictures, [&](const char* ending) { return has_ending(file, ending); });
            return is_picture ? "'" + file + "' is a picture: give a tree, a mesh or a scene" : std::string();
        });
}

// The fields of a request, so that the session's own sentences about them can be had before a model is read.
static void check_request(const WhatOptions& o) {
    constexpr std::uint64_t of_some_model = 1000;
    if (const auto valid = session::validate(o.request_for(of_some_model)); !valid)
        refuse(with_option_names(valid.error().message));
}

void add_what_options(CLI::App& verb, WhatOptions& o, std::vector<Rule>& rules) {
    CLI::App& group = *verb.add_option_group("WHAT", "Which simplification (default: fold what nobody can see)");
    Goal& goal = o.request.goal;
    group.add_flag_function(
        "--full", [&goal](std::int64_t) { goal.kind = Goal::Kind::full; }, "Fold nothing");
    add_triangles_option(group, o.budget, "At most N triangles, or P% of them, as inconspicuous as possible");
    group.add_flag("--fill-budget", goal.fill, "With --triangles: use all of them, even where it cannot be seen");
    add_quality_option(group, o.request.goal);
    add_value(group, "--milliseconds", o.request.milliseconds, not_negative(), "T",
              "The best cut that T milliseconds are enough for");
    add_value(group, "--pixels", goal.tolerance_px, positive(), "E", "Fold what is smaller than E pixels, seen or not");
    add_fold_test_option(group, o.request.fold_test);
    add_gaze_option(group, o.gaze_px);
    add_velocity_option(group, o.velocity_deg_s);
    // Spellings that came before.
    group.add_flag("--imperceptible")->group("");
    group
        .add_option_function<double>(
            "--ratio", [&o](const double& share) { o.budget = {.share = share}; }, "")
        ->check(number_that("a share above 0 and up to 1, such as 0.5", [](double v) { return v > 0 && v <= 1; }))
        ->group("");
    group.callback([&o] {
        if (o.budget.is_given()) o.request.goal.kind = Goal::Kind::budget;
        if (o.request.goal.tolerance_px > 0) o.request.goal.kind = Goal::Kind::pixels;
        check_request(o);
    });
    const std::string one = "give one of them";
    rules.insert(
        rules.end(),
        {{"--full", Rule::excludes, {"--imperceptible", "--quality", "--triangles", "--ratio", "--pixels"}, one},
         {"--quality", Rule::excludes, {"--imperceptible", "--triangles", "--ratio", "--pixels"}, one},
         {"--full", Rule::excludes, {"--milliseconds", "--fold-test"}, "nothing is folded"},
         {"--imperceptible", Rule::excludes, {"--triangles", "--ratio", "--pixels"}, one},
         {"--triangles", Rule::excludes, {"--ratio", "--pixels"}, one},
         {"--ratio", Rule::excludes, {"--pixels"}, one},
         {"--fill-budget", Rule::needs_one_of, {"--triangles", "--ratio"}}});
}

void add_hiding_option(CLI::App& verb, WhatOptions& o, std::vector<Rule>& rules) {
    rules.push_back({"--order", Rule::needs_one_of, {"--triangles", "--ratio", "--quality"}});
    add_choice<Hiding, Hiding>(
        verb, "--visibility", o.hiding, {{"spheres", Hiding::spheres}, {"picture", Hiding::picture}},
        "What counts as hidden: what faces away or lies behind spheres inside solids (spheres), or "
        "also what lies behind anything in the picture (picture)");
    add_choice<session::Order, session::Order>(
        verb, "--order", o.request.order, {{"sum", session::Order::sum}, {"largest", session::Order::largest}},
        "What --triangles makes least, and in a picture --quality: the error that adds up in the picture, and for "
        "meshes in pictures from all sides (sum, default), or the largest cost of a fold (largest)");
}

void add_check_options(CLI::App& verb, WhatOptions& o, std::vector<Rule>& rules) {
    verb.add_flag(
        "--checked", o.is_checked,
        "As few triangles as pictures show nothing of, or with --quality no more than that: two judges look at "
        "some ten of them, and at views that had no part in it");
    add_value(verb, "--check-cell", o.check_cell, within(0, 10), "DEGREES",
              "With --checked: the eye may go so far around what it looks at, any way (default: 0, this view alone)");
    add_value(verb, "--check-seconds", o.check_seconds, positive(), "T",
              "With --checked: after T seconds the best cut so far is taken (default: 120)");
    for (const char* option : {"--check-cell", "--check-seconds"})
        rules.push_back({option, Rule::needs_one_of, {"--checked"}});
    rules.push_back({"--checked",
                     Rule::excludes,
                     {"--full", "--triangles", "--ratio", "--pixels", "--milliseconds"},
                     "it finds the number of triangles itself"});
    rules.push_back({"--checked",
                     Rule::excludes,
                     {"--fold-test extent", "--fold-test displacement"},
                     "they do not order folds by what is seen of them"});
    rules.push_back({"--checked",
                     Rule::excludes,
                     {"--orthographic", "--eyes", "--visibility spheres"},
                     "it goes by pictures of one eye"});
}

} // namespace unseen::app
