// What took part in making a cut and what did not, with reasons.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <vdtree/cut.h>
#include <vdtree/geomorph.h>

#include "fold_test.h"
#include "report.h"

namespace unseen::app {

// Something that may or may not have taken part, and the reason in a sentence.
struct Effect {
    std::string name;
    bool on = false;
    std::string why;
};

// What the cut itself says about them.
struct CutFacts {
    double imperceptible_from_m = 0;
    bool is_complete = true;                   // no time limit ended it
    std::optional<double> threshold = {};      // above which no fold costs, where that alone decided
    std::optional<std::size_t> occluders = {}; // how many the viewpoint had; none: the cut was made by asking about each node
};

std::vector<Effect> effects_of(const Scene& scene, const WhatOptions& what, Purpose purpose, const CutFacts& facts);
Effect geomorph_effect(const vdtree::Geomorph* geomorph, const vdtree::Cut& cut); // null: there is none

Json to_json(std::span<const Effect> effects);
void print(std::span<const Effect> effects);

} // namespace unseen::app
