// From a scene and a wish to a cut, with its statistics and the effects that ran.
#pragma once

#include <string>
#include <vector>

#include <vdtree/cut.h>

#include "report.h"
#include "scene.h"

namespace unseen::app {

// Something that may or may not have taken part, and the reason in a sentence.
struct Effect {
    std::string name;
    bool on = false;
    std::string why;
};

struct Simplification {
    vdtree::Index source_triangles = 0;
    std::uint64_t dropped = 0;
    vdtree::AdjustStats stats;
    double adapt_ms = 0;             // making the cut
    double extract_ms = 0;           // its index buffer
    double imperceptible_from_m = 0; // infinite: from nowhere; NaN: the fold test does not know
    std::vector<Effect> effects;
};

// What the picture is for decides what may be left out of it.
enum class Purpose {
    picture, // seen from this view only: what is out of the window is folded
    mesh,    // may be looked at from elsewhere
};

// Adjusts `cut`, which must be of the scene's tree. Cost: about a microsecond for each node test.
Simplification simplify(vdtree::Cut& cut, const Scene& scene, const WhatOptions& what, Purpose purpose);

// The keys that simplify and render report; draw_ms is NaN where nothing was drawn.
Json to_json(const Simplification& simplification, double draw_ms);
void print(const Simplification& simplification, double draw_ms);

} // namespace unseen::app
