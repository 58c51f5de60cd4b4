// Contrasts and luminances in classes, rounded up, so that few rows of a table serve all nodes.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <unseen/perception/display.h>
#include <unseen/vdtree/internal/contrast_classes.h>

namespace unseen::perception {

// A series of classes: one for 0, then values in equal steps of their logarithm from 2^least_octave on. Values are
// rounded up; NaN is in the largest class.
struct ClassSeries {
    int per_octave, least_octave, octaves;

    constexpr std::size_t count() const { return static_cast<std::size_t>(per_octave * octaves) + 2; }
    std::size_t of(double value) const {
        if (value <= 0) return 0;
        const double steps = std::ceil(per_octave * (std::log2(value) - least_octave) - vdtree::class_edge);
        const double last = static_cast<double>(count() - 1);
        return steps + 1 <= last ? static_cast<std::size_t>(std::max(steps + 1, 1.0)) : count() - 1;
    }
    double value(std::size_t index) const {
        if (index == 0) return 0;
        return std::exp2(static_cast<double>(index - 1) / per_octave + least_octave) * (1 + 2 * vdtree::class_edge);
    }
};

// A display's luminances.
class LuminanceClasses : public vdtree::LevelClasses {
public:
    explicit LuminanceClasses(const Display& display) : LevelClasses(scale_of(display)) {}

    double in_cdm2(double relative) const { return scale().of(relative); }
    double difference_in_cdm2(double relative) const { return scale().span * relative; }

private:
    static vdtree::AbsoluteScale scale_of(const Display& display) {
        const double black = black_level(display).value();
        return {black, to_luminance(display, 1).value() - black};
    }
};

} // namespace unseen::perception
