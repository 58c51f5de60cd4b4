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

struct LevelVariant {
    std::string name;
    session::LevelControlOptions how = {};
};

// The program's own first, and one thing changed in each of the others.
std::vector<LevelVariant> level_variants() {
    const session::LevelControlOptions usual;
    return {{"modern, " + std::to_string(usual.layers) + " layers, whole maps, 32 bits, tested every " +
             std::to_string(usual.frames_a_layer) + " frames"},
            {"rpg99", {.maps = session::MapRecipe::rpg99}},
            {"1 layer", {.layers = 1}},
            {"2 layers", {.layers = 2}},
            {"3 layers", {.layers = 3}},
            {"8 layers", {.layers = 8}},
            {"maps of half the resolution", {.map_block = 2}},
            {"maps of a quarter", {.map_block = 4}},
            {"16 bits", {.half_floats = true}},
            {"tested every frame", {.frames_a_layer = 1}},
            {"tested every 2 frames", {.frames_a_layer = 2}},
            {"tested every 8 frames", {.frames_a_layer = 8}},
            {"by distance", {.method = session::LevelMethod::distance}},
            {"by area", {.method = session::LevelMethod::area}}};
}

} // namespace

Result<AccuracyPoints> level_points(AccuracySubject& subject, const AccuracyBenchOptions& options) {
    constexpr int frames = 12;
    // Each setting is drawn until nothing changes any more, and then walked with: in half of the window.
    vdtree::View first = subject.view;
    first.width = std::max(first.width / 2, 1), first.height = std::max(first.height / 2, 1);
    const vdtree::View last = view_on_walk(first, frames);
    auto judge = session::PictureJudge::create(subject.context, subject.session, last, options.samples);
    if (!judge) return judge.error();
    AccuracyPoints points;
    for (const LevelVariant& variant : level_variants()) {
        auto control = session::LevelControl::create(subject.context, subject.session, first, variant.how);
        if (!control) return control.error();
        if (const auto settled = control->settle(first); !settled) return settled.error();
        double ms = 0; // a frame on the average: not all frames test
        Result<session::LevelFrame> frame = session::LevelFrame();
        std::uint64_t bytes = 0;
        for (int i = 1; i <= frames; ++i) {
            const auto start = BenchClock::now();
            frame = control->draw(view_on_walk(first, i));
            if (!frame) return frame.error();
            if (const auto counted = control->wait(); !counted) return counted.error();
            ms += 1e3 * seconds_since(start) / frames;
            bytes = std::max(bytes, frame->texture_bytes);
        }
        const auto verdict = judge->judge(level_cuts(subject.session, *control, *frame));
        if (!verdict) return verdict.error();
        points.push_back({.name = variant.name,
                          .values = {ms, verdict->v, static_cast<double>(frame->triangles),
                                     static_cast<double>(verdict->visible), static_cast<double>(bytes) / 1e6},
                          .is_default = points.empty()});
    }
    return points;
}

} // namespace unseen::app
