#include "level_flight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <unseen/perception/image.h>
#include <unseen/render/target.h>
#include <unseen/session/selection_follower.h>
#include <unseen/session_gpu/frame_image.h>

#include "camera_path.h"
#include "colour_bar.h"
#include "interruption.h"
#include "numbered_pictures.h"
#include "output_files.h"
#include "progress_bar.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using perception::Image;
using session::LevelControl;
using session::LevelDecision;
using session::LevelFrame;
using session::LevelMethod;
using session::LevelTest;
using session::LevelTimes;
using session::SelectionFollower;

constexpr int gap = 4; // pixels between panels

const char* name_of(LevelMethod method) {
    return method == LevelMethod::distance ? "distance"
           : method == LevelMethod::area   ? "area"
           : method == LevelMethod::given  ? "selection"
                                           : "perceptual";
}

const char* name_of(LevelDecision decision) {
    return decision == LevelDecision::better ? "better" : decision == LevelDecision::worse ? "worse" : "keep";
}

// ---- pictures ---------------------------------------------------------------------------------------------------------

Result<render::Frame> frame_of(const render::Target& target) {
    const auto pixels = render::read_pixels(target);
    if (!pixels) return pixels.error();
    render::Frame frame;
    frame.width = target.width();
    frame.height = target.height();
    for (const glm::vec4& pixel : *pixels) {
        frame.luminance.push_back(pixel.a);
        frame.colour.insert(frame.colour.end(), {pixel.r, pixel.g, pixel.b});
    }
    return frame;
}

Image beside_each_other(const std::vector<Image>& panels) {
    Image all{-gap, 0, 3, {}};
    for (const Image& panel : panels) {
        all.width += panel.width + gap;
        all.height = std::max(all.height, panel.height);
    }
    all.values.assign(3 * static_cast<std::size_t>(all.width) * static_cast<std::size_t>(all.height), 0.5F);
    int left = 0;
    for (const Image& panel : panels) {
        const auto row = 3 * static_cast<std::size_t>(panel.width);
        for (int y = 0; y < panel.height; ++y)
            std::copy_n(panel.values.begin() + static_cast<std::ptrdiff_t>(row * static_cast<std::size_t>(y)), row,
                        all.values.begin() +
                            3 * (static_cast<std::ptrdiff_t>(y) * all.width + static_cast<std::ptrdiff_t>(left)));
        left += panel.width + gap;
    }
    return all;
}

// From black by blue and green to yellow.
glm::vec3 colour_of_threshold(double share) {
    constexpr std::array<glm::vec3, 4> colours = {glm::vec3(0.05F, 0.02F, 0.2F), glm::vec3(0.15F, 0.35F, 0.65F),
                                                  glm::vec3(0.2F, 0.7F, 0.45F), glm::vec3(1.0F, 0.95F, 0.2F)};
    const double at = std::clamp(share, 0.0, 1.0) * (colours.size() - 1);
    const auto cell = std::min(static_cast<std::size_t>(at), colours.size() - 2);
    return glm::mix(colours[cell], colours[cell + 1], static_cast<float>(at - static_cast<double>(cell)));
}

constexpr double least_threshold = 1.0 / 16, largest_threshold = 16; // cd/m2: the ends of the colours

Result<Image> picture_of_thresholds(LevelControl& control, int layer) {
    const auto thresholds = control.thresholds(layer);
    if (!thresholds) return thresholds.error();
    const double octaves = std::log2(largest_threshold / least_threshold);
    Image map{control.map_width(), control.map_height(), 3, {}};
    for (const float threshold : *thresholds) {
        const glm::vec3 c = colour_of_threshold(std::log2(static_cast<double>(threshold) / least_threshold) / octaves);
        map.values.insert(map.values.end(), {c.r, c.g, c.b});
    }
    ColourBar bar;
    bar.colour_at = colour_of_threshold;
    for (double at = least_threshold; at <= largest_threshold; at *= 4)
        bar.ticks.push_back({std::log2(at / least_threshold) / octaves, shortest(at)});
    bar.unit = "cd/m2 unseen";
    return with_colour_bar(map, bar);
}

// The best level is green, the worst one red.
glm::vec3 colour_of_level(double share) {
    constexpr glm::vec3 best(0.15F, 0.8F, 0.25F), middle(1.0F, 0.85F, 0.2F), worst(0.9F, 0.1F, 0.1F);
    const auto at = static_cast<float>(std::clamp(share, 0.0, 1.0));
    return at < 0.5F ? glm::mix(best, middle, 2 * at) : glm::mix(middle, worst, 2 * at - 1);
}

Result<Image> picture_of_levels(LevelControl& control, const Image& picture, int levels) {
    const auto by_pixel = control.read_levels();
    if (!by_pixel) return by_pixel.error();
    Image map = picture;
    const double last = std::max(levels - 1, 1);
    for (std::size_t i = 0; i < by_pixel->size(); ++i) {
        const float grey = (map.values[3 * i] + map.values[3 * i + 1] + map.values[3 * i + 2]) / 3;
        const int level = (*by_pixel)[i];
        const glm::vec3 c = level < 0 ? glm::vec3(grey) : colour_of_level(level / last) * (0.3F + 0.7F * grey);
        for (std::size_t channel = 0; channel < 3; ++channel)
            map.values[3 * i + channel] = c[static_cast<int>(channel)];
    }
    ColourBar bar;
    bar.colour_at = colour_of_level;
    for (int level = 0; level < levels; ++level) bar.ticks.push_back({level / last, std::to_string(level)});
    bar.unit = "level; 0 is the full mesh";
    return with_colour_bar(map, bar);
}

Result<Image> picture_of(LevelControl& control, const perception::Display& display,
                         const std::optional<LevelPicture>& show, int levels) {
    const auto coded = [&](const render::Target& target) -> Result<Image> {
        const auto frame = frame_of(target);
        if (!frame) return frame.error();
        return session::code_image(*frame, display);
    };
    if (!show) return coded(control.picture());
    if (*show == LevelPicture::levels) {
        const auto picture = coded(control.picture());
        if (!picture) return picture;
        return picture_of_levels(control, *picture, levels);
    }
    const render::LayerPasses& layers = control.layers();
    std::vector<Image> panels;
    const auto add = [&](Result<Image> panel) -> Result<void> {
        if (!panel) return panel.error();
        panels.push_back(std::move(*panel));
        return {};
    };
    for (int i = 0; i < layers.combination_count(); ++i) {
        if (*show == LevelPicture::maps) {
            if (auto added = add(picture_of_thresholds(control, i)); !added) return added.error();
            continue;
        }
        if (auto combined = control.combine(i); !combined) return combined.error();
        // Of a picture that is not split: all there is, and the background.
        const render::Target* own = layers.layer(i) ? layers.layer(i) : &layers.composite();
        if (*show == LevelPicture::layers && i == 0 && layers.background())
            if (auto added = add(coded(*layers.background())); !added) return added.error();
        if (auto added = add(coded(*show == LevelPicture::layers ? *own : layers.combination())); !added)
            return added.error();
    }
    if (panels.empty()) return coded(control.picture()); // no object is in sight
    return beside_each_other(panels);
}

// ---- what frames came to ----------------------------------------------------------------------------------------------

struct Records {
    std::vector<LevelFrame> frames;
    std::uint64_t settling_frames = 0; // before the first

    // What has become known of frames that may be long gone; of those before the first nothing is kept.
    void learn(const LevelFrame& known) {
        for (const LevelTest& test : known.tests)
            if (LevelFrame* frame = numbered(test.frame)) frame->tests.push_back(test);
        for (const LevelTimes& times : known.times)
            if (LevelFrame* frame = numbered(times.frame)) frame->times.push_back(times);
    }
    void add(LevelFrame frame) {
        const LevelFrame known = frame;
        frame.tests.clear();
        frame.times.clear();
        frames.push_back(std::move(frame));
        learn(known);
    }

private:
    LevelFrame* numbered(std::uint64_t number) {
        if (frames.empty() || number < frames.front().number || number > frames.back().number) return nullptr;
        return &frames[static_cast<std::size_t>(number - frames.front().number)];
    }
};

Json to_json(const LevelTimes& times) {
    return {{"layers", times.layers_ms},
            {"combinations", times.combinations_ms},
            {"maps", times.maps_ms},
            {"depth", times.depth_ms},
            {"control", times.control_ms}};
}

std::vector<std::uint64_t> histogram(const std::vector<int>& levels, int count) {
    std::vector<std::uint64_t> objects(static_cast<std::size_t>(count), 0);
    for (const int level : levels)
        if (level >= 0) ++objects[static_cast<std::size_t>(level)];
    return objects;
}

struct Totals {
    std::vector<std::uint64_t> drawn, control; // renderings by level
    std::uint64_t all_drawn = 0, all_control = 0, triangles = 0;
    LevelTimes mean;
    bool has_times = false;

    Totals(const Records& records, int levels)
        : drawn(static_cast<std::size_t>(levels), 0), control(static_cast<std::size_t>(levels), 0) {
        double timed = 0;
        for (const LevelFrame& frame : records.frames) {
            triangles += frame.triangles;
            const auto of_frame = histogram(frame.levels, levels), tested = histogram(frame.tested_with, levels);
            for (std::size_t level = 0; level < drawn.size(); ++level) {
                drawn[level] += of_frame[level], all_drawn += of_frame[level];
                control[level] += tested[level], all_control += tested[level];
            }
            for (const LevelTimes& t : frame.times) {
                ++timed;
                mean.layers_ms += t.layers_ms, mean.combinations_ms += t.combinations_ms, mean.maps_ms += t.maps_ms;
                mean.depth_ms += t.depth_ms, mean.control_ms += t.control_ms;
            }
        }
        has_times = timed > 0;
        for (double* ms : {&mean.layers_ms, &mean.combinations_ms, &mean.maps_ms, &mean.depth_ms, &mean.control_ms})
            *ms /= std::max(timed, 1.0);
    }
};

Json to_json(const session::Session& session, const LevelControl& control, const LevelFlightOptions& options,
             const Records& records, int levels) {
    Json json;
    json["method"] = name_of(options.control.method);
    if (options.control.method == LevelMethod::perceptual) {
        json["maps"] = options.control.maps == session::MapRecipe::modern ? "modern" : "rpg99";
        json["layers"] = options.control.layers;
    } else if (options.control.method == LevelMethod::given) {
        json["selection"] = options.selection;
    } else {
        json["bias"] = options.control.bias;
    }
    json["source_triangles"] = session.triangle_count();
    json["settling_frames"] = records.settling_frames;
    json["is_settled"] = control.is_settled();
    json["objects"] = Json::array();
    for (std::size_t i = 0; i < session.scene().objects.size(); ++i) {
        const session::LevelChain& chain = control.chain(i);
        Json triangles = Json::array();
        for (int level = 0; level < chain.size(); ++level) triangles.push_back(chain.triangles(level));
        json["objects"].push_back({{"name", session.scene().objects[i].name}, {"level_triangles", triangles}});
    }
    json["frames"] = Json::array();
    for (const LevelFrame& frame : records.frames) {
        Json tests = Json::array();
        for (const LevelTest& test : frame.tests)
            tests.push_back({{"object", test.object},
                             {"level", test.level},
                             {"compared_with", test.compared_with},
                             {"p_pass", test.pixels},
                             {"decision", name_of(test.decision)}});
        Json row = {{"triangles", frame.triangles},
                    {"levels", frame.levels},
                    {"objects_by_level", histogram(frame.levels, levels)},
                    {"changed", frame.changed},
                    {"layers", frame.layers},
                    {"surface_passes", frame.surface_passes},
                    {"full_screen_passes", frame.full_screen_passes},
                    {"masked_layers", frame.masked_layers},
                    {"shadow_maps", frame.shadow_maps},
                    {"shadow_passes", frame.shadow_passes},
                    {"texture_bytes", frame.texture_bytes},
                    {"tests", std::move(tests)}};
        row["ms"] = frame.times.empty() ? Json() : to_json(frame.times.front());
        json["frames"].push_back(std::move(row));
    }
    const Totals totals(records, levels);
    json["totals"] = {{"triangles", totals.triangles},
                      {"renderings_by_level", totals.drawn},
                      {"control_renderings_by_level", totals.control},
                      {"renderings", totals.all_drawn},
                      {"control_renderings", totals.all_control}};
    json["totals"]["mean_ms"] = totals.has_times ? to_json(totals.mean) : Json();
    return json;
}

void print_summary(const LevelFlightOptions& options, const Records& records, const session::Session& session,
                   int levels) {
    const Totals totals(records, levels);
    const auto frames = static_cast<std::uint64_t>(records.frames.size());
    print_line(grouped(frames) + (frames == 1 ? " frame, " : " frames, on average ") +
               grouped(totals.triangles / frames) + " of " + grouped(session.triangle_count()) +
               " triangles, by method " + name_of(options.control.method));
    if (records.settling_frames > 0)
        print_line("levels were found in " + grouped(records.settling_frames) +
                   (records.settling_frames == 1 ? " frame" : " frames") + " of the first view");
    std::vector<std::vector<std::string>> rows = {{"level"}, {"drawn"}, {"for control"}};
    for (std::size_t level = 0; level < totals.drawn.size(); ++level) {
        rows[0].push_back(std::to_string(level));
        rows[1].push_back(grouped(totals.drawn[level]));
        rows[2].push_back(grouped(totals.control[level]));
    }
    rows[0].push_back("all"), rows[1].push_back(grouped(totals.all_drawn)),
        rows[2].push_back(grouped(totals.all_control));
    if (options.control.method != LevelMethod::perceptual) rows.pop_back();
    print_table(rows);
    if (!options.is_verbose || !totals.has_times) return;
    print_table({{"on average, ms", ""},
                 {"layers", rounded(totals.mean.layers_ms, 4)},
                 {"combinations", rounded(totals.mean.combinations_ms, 4)},
                 {"maps of thresholds", rounded(totals.mean.maps_ms, 4)},
                 {"depth", rounded(totals.mean.depth_ms, 4)},
                 {"control of levels", rounded(totals.mean.control_ms, 4)}});
}

// Of the file of selected levels, for the levels that are drawn.
Result<SelectionFollower> follower_of(session::Selections selections, const session::Session& session,
                                      const LevelControl& control, const LevelFlightOptions& options) {
    std::vector<std::vector<std::uint32_t>> triangles;
    for (std::size_t i = 0; i < session.scene().objects.size(); ++i) {
        auto& counts = triangles.emplace_back();
        for (int level = 0; level < control.chain(i).size(); ++level)
            counts.push_back(control.chain(i).triangles(level));
    }
    const bool has_budget = options.what.budget.is_given();
    auto follower = SelectionFollower::create(
        std::move(selections), session.scene(), triangles,
        {.budget = has_budget ? std::uint64_t{options.what.budget.of(session.triangle_count())} : 0});
    if (!follower) return Error{follower.error().code, "'" + options.selection + "': " + follower.error().message};
    return follower;
}

} // namespace

Result<void> draw_levels(const std::string& model, const ViewOptions& view_options, const DisplayOptions& display,
                         const LevelFlightOptions& options) {
    std::vector<std::string> inputs = inputs_of(model, view_options, display);
    inputs.push_back(options.selection);
    inputs.push_back(options.path);
    if (const auto ready = check_outputs(inputs, {options.json, options.out}); !ready) return ready;
    std::optional<CameraPath> path;
    if (!options.path.empty()) {
        auto read = CameraPath::read(options.path, view_options.up.value_or(vdtree::View().up));
        if (!read) return read.error();
        path = std::move(*read);
    }
    auto report = JsonReport::open(options.json);
    if (!report) return report.error();
    const auto context = render::Context::headless();
    if (!context) return context.error();
    auto session = open_session(model, view_options, display);
    if (!session) return session.error();
    session->set_velocity(options.what.velocity());
    vdtree::View view = make_view(*session, view_options);
    if (options.what.gaze_px) session->set_gaze(session::Gaze{*options.what.gaze_px});
    session::Request request = options.what.request_for(session->triangle_count());
    session::LevelControlOptions control_options = options.control;
    std::optional<session::Selections> selections;
    if (control_options.method == LevelMethod::given) {
        auto read = session::read_selections(options.selection);
        if (!read) return read.error();
        selections = std::move(*read);
        control_options.chain.levels = selections->levels;
    }
    auto control = LevelControl::create(*context, *session, view, control_options, request);
    if (!control) return control.error();
    int levels = 1;
    for (std::size_t i = 0; i < session->scene().objects.size(); ++i)
        levels = std::max(levels, control->chain(i).size());
    const perception::Display& shown_on = session->observer().display;

    Records records;
    Pictures pictures(options.out);
    std::vector<CameraPose> poses;
    if (path) poses = path->poses_from(view);
    const auto aim = [&](const CameraPose& pose) {
        view.eye = pose.eye;
        view.target = pose.target;
        view.up = pose.up;
        if (pose.gaze_px) session->set_gaze(session::Gaze{*pose.gaze_px});
    };
    std::optional<SelectionFollower> follower;
    if (selections) {
        auto made = follower_of(std::move(*selections), *session, *control, options);
        if (!made) return made.error();
        follower = std::move(*made);
    }
    std::size_t over_budget = 0;
    const auto select = [&]() -> Result<void> {
        if (!follower) return {};
        const auto chosen = follower->choose(view);
        if (!chosen) return chosen.error();
        control->set_levels(chosen->levels);
        over_budget += !chosen->holds;
        return {};
    };
    if (!poses.empty()) aim(poses.front());
    if (auto selected = select(); !selected) return selected;
    auto settled = control->settle(view);
    if (!settled) return settled.error();
    records.settling_frames = settled->number + 1;
    if (poses.empty()) {
        records.add(*settled);
    } else {
        ProgressBar bar("flying");
        const Interruptible until_interrupted;
        for (std::size_t i = 0; i < poses.size() && !until_interrupted.is_interrupted(); ++i) {
            bar(static_cast<double>(i) / static_cast<double>(poses.size()), "frames");
            aim(poses[i]);
            session->set_time(static_cast<double>(i) / options.frames_a_second);
            if (auto selected = select(); !selected) return selected;
            auto frame = control->draw(view);
            if (!frame) return Error{frame.error().code, "Frame " + std::to_string(i) + ": " + frame.error().message};
            records.add(std::move(*frame));
            // So that a flight is the same whatever the machine: counts are one frame late.
            const auto known = control->wait();
            if (!known) return known.error();
            records.learn(*known);
            if (!pictures.are_wanted()) continue;
            const auto picture = picture_of(*control, shown_on, options.show, levels);
            if (!picture) return picture.error();
            if (auto written = pictures.write_next(*picture); !written) return written;
        }
        if (records.frames.empty()) return {}; // interrupted
    }
    if (auto ok = report->prepare(to_json(*session, *control, options, records, levels)); !ok) return ok.error();
    if (poses.empty() && !options.out.empty()) {
        const bool is_for_people = has_ending(options.out, ".png");
        Result<Image> picture = Image{};
        if (is_for_people) {
            picture = picture_of(*control, shown_on, options.show, levels);
        } else {
            const auto frame = frame_of(control->picture());
            if (!frame) return frame.error();
            picture = session::luminance_image(*frame, shown_on);
        }
        if (!picture) return picture.error();
        if (auto ok = perception::write_image(options.out, *picture); !ok) return ok;
    }
    if (auto ok = report->publish(); !ok) return ok;
    pictures.keep();
    if (report->is_on_stdout()) return {};
    if (records.frames.size() < poses.size())
        print_note("interrupted after " + grouped(records.frames.size()) + " of " + grouped(poses.size()) + " frames.");
    print_summary(options, records, *session, levels);
    if (over_budget > 0)
        print_note("in " + grouped(over_budget) +
                   " frames even the coarsest levels have more triangles than the budget.");
    if (poses.empty()) print_written({options.out, options.json});
    else print_written({options.json});
    if (!poses.empty() && !options.out.empty())
        print_line("wrote " + grouped(records.frames.size()) + " pictures, " + options.out);
    return {};
}

} // namespace unseen::app
