// The oracle of the fold tests: models whole and simplified, drawn with many samples and compared by a judge that knows
// nothing of trees, under one model of contrast sensitivity and another.
#pragma once

#include <unseen/perception/criterion.h>
#include <unseen/perception/display.h>
#include <unseen/perception/judge.h>
#include <unseen/render/renderer.h>

#include "testing.h"

namespace unseen::oracle {

constexpr float background = 0.2f; // relative luminance

struct Look {
    vdtree::View view;
    perception::FoldTestOptions options; // what a fold test is told
};

struct Looks {
    int window_px = 320; // a side
    int count = 6;
    double far_fill = 0.15;  // of the window's height, where the model is far
    double to_the_front = 0; // how far the directions lean towards +z
};

// From all around, near and every third time far, looked at and every second time aside.
inline std::vector<Look> looks_at(const vdtree::VertexTree& tree, const Looks& wanted = {}) {
    const perception::Display display;
    const vdtree::Sphere sphere = tree.bounding_sphere();
    const vdtree::LuminanceRange range = tree.luminance_range();
    std::vector<Look> looks(static_cast<std::size_t>(wanted.count));
    for (int i = 0; i < wanted.count; ++i) {
        auto& [view, options] = looks[static_cast<std::size_t>(i)];
        view.width = view.height = wanted.window_px;
        view.fov_y_degrees = perception::physical_field(display, wanted.window_px).value();
        const glm::dvec3 direction(std::sin(1.7 * i), std::cos(2.9 * i), wanted.to_the_front + std::cos(1.1 * i));
        view = vdtree::frame_sphere(tree.origin() + glm::dvec3(sphere.centre), sphere.radius, direction,
                                    i % 3 == 2 ? wanted.far_fill : 0.85, view);
        options.display = display;
        options.scene = {std::min(range.lo, background), std::max(range.hi, background)};
        if (i % 2) options.gaze_px = glm::dvec2(wanted.window_px * 0.5 + 1100, wanted.window_px * 0.5);
    }
    return looks;
}

inline std::string words(const Look& look) {
    const glm::dvec3 eye = look.view.eye;
    return std::to_string(eye.x) + " " + std::to_string(eye.y) + " " + std::to_string(eye.z) +
           (look.options.gaze_px ? ", aside" : "");
}

// Luminance in cd/m2 of the usual display.
inline perception::Image draw(render::Renderer& renderer, const vdtree::Cut& cut, const vdtree::View& view,
                              int samples = 64, const std::optional<vdtree::Lighting>& lighting = {}) {
    render::DrawOptions options;
    options.samples = samples;
    options.background = background;
    options.lighting = lighting;
    const auto frame = require(renderer.draw(cut, view, options));
    perception::Image image{frame->width, frame->height, 1, frame->luminance};
    for (float& value : image.values)
        value = static_cast<float>(perception::to_luminance({}, static_cast<double>(value)).value());
    return image;
}

constexpr perception::CsfModel judges[] = {perception::CsfModel::castle, perception::CsfModel::stela};

inline perception::Judgement judge(const perception::Image& whole, const perception::Image& simplified,
                                   const Look& look, perception::CsfModel judge) {
    auto judged = perception::judge_modern(whole, simplified,
                                           {.display = look.options.display,
                                            .gaze_px = look.options.gaze_px,
                                            .csf = judge,
                                            .gain = perception::default_person.gain}); // as of the fold tests' tables
    if (!judged) throw std::runtime_error(judged.error().message);
    return std::move(*judged);
}

} // namespace unseen::oracle
