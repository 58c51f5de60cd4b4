// unseen compare: where a picture differs visibly from a reference.
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include <unseen/perception/image.h>
#include <unseen/perception/judge.h>

#include "colour_bar.h"
#include "on_gpu.h"
#include "output_files.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

using perception::Image;
using perception::ImageFile;
using perception::Judgement;

constexpr const char* gpu = "gpu";

enum class Model { modern, second, rpg99 };

struct CompareArguments {
    DisplayOptions& display;
    std::string reference = {}, test = {}, map = {}, json = {};
    std::string device = "cpu";
    Model model = Model::modern;
    std::optional<glm::dvec2> gaze_px = {};
    std::optional<double> field_degrees = {};
    std::optional<std::uint64_t> fail_above = {};
};

struct Pair {
    ImageFile reference, test;

    bool has_codes() const { return !reference.is_absolute && !test.is_absolute; }
};

Result<Pair> read_pair(const CompareArguments& a) {
    auto reference = perception::read_image(a.reference);
    if (!reference) return reference.error();
    auto test = perception::read_image(a.test);
    if (!test) return test.error();
    const Image& r = reference->image;
    const Image& t = test->image;
    if (r.width != t.width || r.height != t.height) {
        const auto size = [](const Image& i) { return std::to_string(i.width) + "x" + std::to_string(i.height); };
        return Error{ErrorCode::malformed_data, "'" + a.reference + "' is " + size(r) + " pixels large and '" + a.test +
                                                    "' " + size(t) + ": only images of one size can be compared."};
    }
    return Pair{std::move(*reference), std::move(*test)};
}

Result<session::Observer> chosen_observer(const CompareArguments& a) {
    return a.display.observer.empty() ? session::Observer() : session::choose_observer(a.display.observer);
}

Result<perception::JudgeOptions> judge_options(const CompareArguments& a, const perception::Display& display) {
    const auto observer = chosen_observer(a);
    if (!observer) return observer.error();
    if (a.model == Model::second) {
        if (observer->csf)
            return Error{ErrorCode::invalid_argument, "--model second knows no tables of viewers: give --observer "
                                                      "median, default or strict."};
        return perception::second_judge_options(observer->person, display, a.gaze_px);
    }
    perception::JudgeOptions options;
    options.display = display;
    options.gaze_px = a.gaze_px;
    options.gain = observer->csf ? 1 : observer->person.gain; // a viewer is one observer
    options.csf_table = observer->csf;
    if (a.display.csf.empty()) return options;
    if (observer->csf || (!a.display.observer.empty() && !perception::csf_model(a.display.csf)))
        return Error{ErrorCode::invalid_argument,
                     "--observer and --csf exclude each other where one of them is a viewer's table: give that alone."};
    auto chosen = session::choose_csf(a.display.csf);
    if (!chosen) return chosen.error();
    if (const auto* const model = std::get_if<perception::CsfModel>(&*chosen)) {
        options.csf = *model;
    } else {
        options.csf_table =
            std::make_shared<const perception::CsfTable>(std::get<perception::CsfTable>(std::move(*chosen)));
        options.gain = 1;
    }
    return options;
}

// The judges modern and second.
Result<Verdict> judge_by_bands(const CompareArguments& a, const Pair& pair, const perception::Display& display) {
    const auto options = judge_options(a, display);
    if (!options) return options.error();
    if (a.device == gpu)
        return compare_on_gpu(perception::to_luminance(pair.reference, display),
                              perception::to_luminance(pair.test, display), *options);
    auto judgement = perception::judge_modern(perception::to_light(pair.reference, display),
                                              perception::to_light(pair.test, display), *options);
    if (!judgement) return judgement.error();
    return Verdict{std::move(*judgement), {}};
}

Result<Verdict> judge_rpg99(const CompareArguments& a, const Pair& pair, const perception::Display& display) {
    const Image reference = perception::to_luminance(pair.reference, display);
    auto judgement =
        perception::judge_rpg99(reference, perception::to_luminance(pair.test, display),
                                a.field_degrees.value_or(perception::physical_field(display, reference.width).value()));
    if (!judgement) return judgement.error();
    return Verdict{std::move(*judgement), {}};
}

// In any channel, however little.
std::uint64_t different_pixels(const Pair& pair) {
    const Image& r = pair.reference.image;
    const Image& t = pair.test.image;
    const auto pixels = static_cast<std::size_t>(r.width) * static_cast<std::size_t>(r.height);
    const auto differs = [&](std::size_t pixel) {
        const auto of = [&](const Image& image, int channel) {
            const auto count = static_cast<std::size_t>(image.channels);
            return image.values[pixel * count + std::min(static_cast<std::size_t>(channel), count - 1)];
        };
        for (int channel = 0; channel < std::max(r.channels, t.channels); ++channel)
            if (of(r, channel) != of(t, channel)) return true;
        return false;
    };
    std::uint64_t count = 0;
    for (std::size_t pixel = 0; pixel < pixels; ++pixel) count += differs(pixel);
    return count;
}

// Defined for 8-bit code values; NaN for float images and for images smaller than its window.
double ssim_of(const Pair& pair) {
    if (!pair.has_codes()) return std::numeric_limits<double>::quiet_NaN();
    const auto ssim = perception::ssim(pair.reference.image, pair.test.image);
    return ssim ? *ssim : std::numeric_limits<double>::quiet_NaN();
}

std::string observer_of(const CompareArguments& a) {
    const std::string& csf = a.display.csf;
    if (!csf.empty() && !perception::csf_model(csf)) return csf; // a viewer's file
    const auto observer = chosen_observer(a);
    if (!observer || observer->csf) return a.display.observer;
    const perception::Person& person = observer->person;
    const std::string name(person.name);
    if (csf.empty()) return name + " (of measured people, " + rounded(100 * person.share_above, 2) + "% see more)";
    return name + " (" + rounded(person.gain, 3) + " times " + csf + ")";
}

// Whose verdict it is, and under which conditions.
std::string judged_by(const CompareArguments& a, const Verdict& verdict, const perception::Display& display) {
    if (a.model == Model::rpg99) return "by the judge rpg99";
    std::string text = "by the judge " + std::string(a.model == Model::second ? "second" : "modern") +
                       " and the observer " + observer_of(a);
    text += ", seen from " + rounded(display.distance.value(), 3) + " m, ";
    text += a.gaze_px ? "with the gaze at pixel " + shortest(a.gaze_px->x) + " " + shortest(a.gaze_px->y)
                      : std::string("wherever they look");
    if (verdict.judgement.judges_colour) text += "; in luminance and colour";
    return verdict.gpu.empty() ? text : text + "; in luminance alone, on the GPU (" + verdict.gpu + ")";
}

// A difference is seen around the pixels that differ, too: fewer pixels may differ than it is visible at.
void print(const Judgement& judgement, std::uint64_t different, double ssim) {
    const double share = 100.0 * static_cast<double>(judgement.visible_pixels) / static_cast<double>(judgement.pixels);
    print_line("a difference is visible at " + grouped(judgement.visible_pixels) + " of " + grouped(judgement.pixels) +
               " pixels (" + rounded(share, 3) + "%), at most " + rounded(judgement.max_ratio, 3) +
               " times its threshold; " + grouped(different) + (different == 1 ? " pixel differs" : " pixels differ") +
               (std::isnan(ssim) ? "" : "; SSIM " + rounded(ssim, 6)));
}

Result<int> run(const CompareArguments& a) {
    auto report = open_report({a.reference, a.test, a.display.file, a.display.csf}, {a.map}, a.json);
    if (!report) return report.error();
    const auto display = make_display(a.display);
    if (!display) return display.error();
    const auto pair = read_pair(a);
    if (!pair) return pair.error();
    const auto verdict = a.model == Model::rpg99 ? judge_rpg99(a, *pair, *display) : judge_by_bands(a, *pair, *display);
    if (!verdict) return verdict.error();

    const Judgement& judgement = verdict->judgement;
    const double ssim = ssim_of(*pair);
    const std::uint64_t different = different_pixels(*pair);
    const Json json = {{"visible_at", judgement.visible_pixels},
                       {"different_pixels", different},
                       {"visible_pixels", judgement.visible_pixels}, // an older name of visible_at
                       {"pixels", judgement.pixels},
                       {"max_ratio", number_or_null(judgement.max_ratio)},
                       {"ssim", number_or_null(ssim)},
                       {"judges_colour", judgement.judges_colour},
                       {"device", a.device}};
    if (auto ok = report->prepare(json); !ok) return ok.error();
    if (!a.map.empty()) {
        const auto map = with_colour_bar(visibility_map(judgement.visibility), visibility_bar());
        if (!map) return map.error();
        if (auto ok = perception::write_image(a.map, *map); !ok) return ok.error();
    }
    if (auto ok = report->publish(); !ok) return ok.error();
    if (!report->is_on_stdout()) {
        print(judgement, different, ssim);
        print_line(judged_by(a, *verdict, *display));
        print_written({a.map, a.json});
    }
    return a.fail_above && judgement.visible_pixels > *a.fail_above ? exit_failed : exit_done;
}

std::vector<Rule> compare_rules() {
    const std::vector<std::string> rpg99 = {"--model rpg99"};
    return {{"--field", Rule::needs_one_of, rpg99, "the others take the display's"},
            {"--device gpu", Rule::excludes, rpg99, "rpg99 runs on the CPU"},
            {"--gaze", Rule::excludes, rpg99, "rpg99 knows no eccentricity"},
            {"--observer", Rule::excludes, rpg99, "rpg99 knows one observer"},
            {"--csf", Rule::excludes, {"--model rpg99", "--model second"}, "they have a sensitivity of their own"}};
}

} // namespace

Command compare_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<CompareArguments>(CompareArguments{setup.display_options()});
    CLI::App* verb = app.add_subcommand("compare", "Judge where two pictures differ visibly");
    verb->add_option("REF", a->reference, "The reference: PNG (as the display shows it), PFM or EXR (cd/m2)")
        ->required()
        ->type_name("IMAGE");
    verb->add_option("TEST", a->test, "The image to judge")->required()->type_name("IMAGE");
    add_choice<Model, Model>(
        *verb, "--model", a->model, {{"modern", Model::modern}, {"second", Model::second}, {"rpg99", Model::rpg99}},
        "modern (default), second (by another model of sight), or rpg99 (of 1999, blind to fine detail)");
    add_value(*verb, "--field", a->field_degrees, within(1e-3, 179.9), "DEGREES",
              "With rpg99: the image's horizontal field (default: as shown on the display)");
    add_value(*verb, "--device", a->device, one_of({"cpu", gpu}), "NAME",
              "Where the judges modern and second run: cpu (default), or gpu, which agrees within 0.1% and sees "
              "luminance alone");
    add_gaze_option(*verb, a->gaze_px);
    add_value(*verb, "--map", a->map, ending_in({".png"}), "OUT.png",
              "The differences, with a scale below: blue where invisible, yellow to red where visible");
    add_value(*verb, "--fail-above", a->fail_above, not_negative(), "N",
              "Exit status 1 if a difference is visible at more than N pixels");
    add_json_option(*verb, a->json);
    setup.act_in(*verb, Setup::display | Setup::observer | Setup::csf);
    verb->footer("Examples:\n  unseen compare full.pfm simplified.pfm --gaze 1603 512 --fail-above 0\n"
                 "  unseen compare a.png b.png --map map.png --json -\n"
                 "  unseen compare a.pfm b.pfm --model second --observer strict\n"
                 "  unseen compare a.png b.png --model rpg99 --field 45");
    return {verb, [a] { return run(*a); }, compare_rules()};
}

} // namespace unseen::app
