// The least that the judge's passes take: tables of one band, and even pictures.
#pragma once

#include <cstddef>

#include <unseen/render/context.h>
#include <unseen/render/internal/visibility_passes.h>
#include <unseen/vdtree/internal/judge_tables.h>

#include "testing.h"

namespace unseen::render::testing {

// One band, one pixel's window, S = 8 everywhere: V = sqrt 2 times the difference in thresholds.
inline JudgeTables tables(int width, int height) {
    JudgeTables t;
    t.width = width, t.height = height;
    t.floor_cdm2 = 0.5f;
    t.beta = 2, t.most_thresholds = 1e8f;
    t.kernel = {0.4f, 0.25f, 0.05f};
    t.masking_power = 2.8f, t.masking_knee = 4, t.least_masker = 1e-20f, t.most_masker = 1e10f;
    t.luminance_shift = 19, t.first_luminance = 0;
    t.luminances = 2, t.eccentricities = 1;
    t.eccentricity_step = 2;
    JudgeTables::Band band;
    band.window = {{{0.5f, 0, {1}}, {0.25f, 0, {1}}, {0.25f, 0, {1}}}};
    band.nodes = {{3, 1, 0}, {3, 1, 0}};
    t.bands = {band};
    return t;
}

inline LuminanceImage picture(const Context& context, int width, int height, float cdm2) {
    const std::vector<float> values(static_cast<std::size_t>(width * height), cdm2);
    auto made = LuminanceImage::create(context, width, height, values);
    EXPECT_TRUE(made) << made.error().message;
    return std::move(*made);
}

} // namespace unseen::render::testing
