// What a fold shows, in classes: patches, and strips where it is an outline.
#pragma once

#include <algorithm>
#include <cstddef>

#include <unseen/perception/display.h>

#include "fold/luminance_classes.h"

namespace unseen::perception {

// Differences over a mean luminance, in classes up to 2^8: beyond any display's peak over its black.
inline constexpr int pattern_contrasts_per_octave = 8;
inline constexpr ClassSeries pattern_contrasts{pattern_contrasts_per_octave, -10, 18};
inline constexpr int pattern_contrast_count = static_cast<int>(pattern_contrasts.count()) - 1; // without no_contrast
inline constexpr int no_contrast = -1;
inline constexpr int pattern_luminance_count = static_cast<int>(LuminanceClasses::count);

// Luminances and contrasts on a display, and their classes.
class PatternLevels {
public:
    explicit PatternLevels(const Display& display) : luminances_(display) {}

    double in_cdm2(double relative) const { return luminances_.in_cdm2(relative); }
    double difference_in_cdm2(double relative) const { return luminances_.difference_in_cdm2(relative); }

    // For a contrast and a luminance in cd/m2.
    int contrast_level(double difference, double base) const {
        return static_cast<int>(pattern_contrasts.of(difference / std::max(base, luminances_.lowest()))) - 1;
    }
    int luminance_level(double base) const { return static_cast<int>(luminances_.of(base)); }
    static double contrast(int level) { return pattern_contrasts.value(static_cast<std::size_t>(level + 1)); }
    double luminance(int level) const { return luminances_.value(static_cast<std::size_t>(level)); }

private:
    LuminanceClasses luminances_;
};

// How a strip shifts along its length; what is later is seen better.
enum class Course {
    to_and_fro, // an outline of a surface
    as_made,    // an open border, which may be as regular as holes in a grid
    one_way     // of a part that vanishes
};

// What a node's fold shows, as far as that decides from where it can be seen: levels of contrast at widths relative to
// the node's.
struct Pattern {
    int luminance = 0;
    int typical = no_contrast;    // over the whole width
    int largest = no_contrast;    // in a small part of it
    int bias = no_contrast;       // of what many such nodes shift together
    int fading = 0, quarters = 0; // of octaves, from the node's width to the mesh's
    bool is_strip = false;
    Course course = Course::to_and_fro; // of strips

    auto operator<=>(const Pattern&) const = default;
    bool is_nothing() const { return largest == no_contrast && bias == no_contrast; }
};

// At least as visible as both.
inline Pattern above(const Pattern& a, const Pattern& b) {
    if (a.is_nothing()) return b;
    if (b.is_nothing()) return a;
    Pattern all{std::max(a.luminance, b.luminance),
                std::max(a.typical, b.typical),
                std::max(a.largest, b.largest),
                std::max(a.bias, b.bias),
                0,
                std::max(a.quarters, b.quarters),
                a.is_strip,
                std::max(a.course, b.course)};
    all.fading = a.bias == no_contrast ? b.fading : b.bias == no_contrast ? a.fading : std::min(a.fading, b.fading);
    return all;
}

// Few patterns are to stand for many: rounded up, onto one grid, so that what is above two of them is there, too.
// `coarseness`: of the grid, 1 or a power of two.
inline Pattern rounded(Pattern p, int coarseness) {
    constexpr int coarsest_fading = 32; // on coarser grids bias does not fade at all, which is above any that does
    const int typical_step = coarseness * pattern_contrasts_per_octave / 8,
              spike_step = coarseness * pattern_contrasts_per_octave / 4;
    const int bias_step = coarseness * pattern_contrasts_per_octave / 8;
    const auto up = [](int value, int step) {
        return std::min((value + step - 1) / step * step, pattern_contrast_count - 1);
    };
    if (p.typical != no_contrast) {
        p.typical = up(p.typical, typical_step);
        p.largest = p.largest > p.typical ? up(p.largest, spike_step) : p.typical;
    }
    if (p.bias != no_contrast) {
        p.bias = up(p.bias, bias_step);
        if (coarseness > coarsest_fading) p.fading = 0;
    } else {
        p.fading = p.quarters = 0;
    }
    return p;
}

} // namespace unseen::perception
