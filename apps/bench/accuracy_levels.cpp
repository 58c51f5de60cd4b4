// Discrete levels of detail by masking: one setting at a time.
#include "accuracy_axes.h"

#include <algorithm>

#include <glm/geometric.hpp>

#include <unseen/session_gpu/level_control.h>
#include <unseen/session_gpu/picture_judge.h>

#include "bench_tools.h"
#include "level_cuts.h"
#include "terminal.h"

namespace unseen::app {
namespace {

// Towards the target at walking speed, at 60 frames a second. Frame 0 is the first view.
vdtree::View view_on_walk(const vdtree::View& first, int frame) {
    const glm::dvec3 way = frame * (1.5 / 60) * glm::normalize(first.target - first.eye);
    vdtree::View view = first;
    view.eye += way;
    view.target += way;
    return view;
}

} // namespace

Result<AccuracyPoints> level_points(AccuracySubject& subject, const AccuracyBenchOptions& options) {
    using session::LevelControlOptions;
    constexpr int frames = 12;
    // Each setting is drawn until nothing changes any more, and then walked with: in half of the window.
    vdtree::View first = subject.view;
    first.width = std::max(first.width / 2, 1), first.height = std::max(first.height / 2, 1);
    const vdtree::View last = view_on_walk(first, frames);
    auto judge = session::PictureJudge::create(subject.context, subject.session, last, options.samples);
    if (!judge) return judge.error();
    AccuracyPoints points;
    const auto add = [&](const std::string& name, const LevelControlOptions& how, bool is_default) -> Result<void> {
        auto control = session::LevelControl::create(subject.context, subject.session, first, how);
        if (!control) return control.error();
        if (const auto settled = control->settle(first); !settled) return settled.error();
        std::vector<double> times;
        Result<session::LevelFrame> frame = session::LevelFrame();
        std::uint64_t bytes = 0;
        for (int i = 1; i <= frames; ++i) {
            const auto start = BenchClock::now();
            frame = control->draw(view_on_walk(first, i));
            if (!frame) return frame.error();
            if (const auto counted = control->wait(); !counted) return counted.error();
            times.push_back(1e3 * seconds_since(start));
            bytes = std::max(bytes, frame->texture_bytes);
        }
        const auto verdict = judge->judge(level_cuts(subject.session, *control, *frame));
        if (!verdict) return verdict.error();
        double sum = 0; // a frame on the average: not all frames test
        for (const double ms : times) sum += ms / frames;
        points.push_back({.name = name,
                          .values = {sum, verdict->v, static_cast<double>(frame->triangles),
                                     static_cast<double>(verdict->visible), static_cast<double>(bytes) / 1e6},
                          .is_default = is_default});
        return {};
    };
    const LevelControlOptions usual;
    const std::string every = "tested every " + std::to_string(usual.frames_a_layer) + " frames";
    if (auto ok =
            add("modern, " + std::to_string(usual.layers) + " layers, whole maps, 32 bits, " + every, usual, true);
        !ok)
        return ok.error();
    const auto vary = [&](const std::string& name, auto&& change) {
        LevelControlOptions how;
        change(how);
        return add(name, how, false);
    };
    if (auto ok = vary("rpg99", [](LevelControlOptions& o) { o.maps = session::MapRecipe::rpg99; }); !ok)
        return ok.error();
    for (const int layers : {1, 2, 3, 8})
        if (auto ok = vary(std::to_string(layers) + (layers == 1 ? " layer" : " layers"),
                           [&](LevelControlOptions& o) { o.layers = layers; });
            !ok)
            return ok.error();
    for (const int block : {2, 4})
        if (auto ok = vary(block == 2 ? "maps of half the resolution" : "maps of a quarter",
                           [&](LevelControlOptions& o) { o.map_block = block; });
            !ok)
            return ok.error();
    if (auto ok = vary("16 bits", [](LevelControlOptions& o) { o.half_floats = true; }); !ok) return ok.error();
    for (const int every_frames : {1, 2, 8})
        if (auto ok = vary(every_frames == 1 ? "tested every frame"
                                             : "tested every " + std::to_string(every_frames) + " frames",
                           [&](LevelControlOptions& o) { o.frames_a_layer = every_frames; });
            !ok)
            return ok.error();
    if (auto ok = vary("by distance", [](LevelControlOptions& o) { o.method = session::LevelMethod::distance; }); !ok)
        return ok.error();
    if (auto ok = vary("by area", [](LevelControlOptions& o) { o.method = session::LevelMethod::area; }); !ok)
        return ok.error();
    return points;
}

} // namespace unseen::app
