// Contrasts and luminances in classes, rounded up, so that few rows of a table do for all nodes. (Under moving lights
// the kernels have classes of their own, vdtree::ContrastClasses.)
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <unseen/perception/display.h>

namespace unseen::perception {

// A series of classes: none, then values in equal steps of their logarithm from 2^least on. Values are rounded up, and
// what is no number is the largest.
struct ClassSeries {
    int per_octave, least_octave, octaves;

    constexpr std::size_t count() const { return static_cast<std::size_t>(per_octave * octaves) + 2; }
    std::size_t of(double value) const {
        if (value <= 0) return 0;
        const double steps = std::ceil(per_octave * (std::log2(value) - least_octave) - edge);
        const double last = static_cast<double>(count() - 1);
        return steps + 1 <= last ? static_cast<std::size_t>(std::max(steps + 1, 1.0)) : count() - 1;
    }
    double value(std::size_t index) const {
        if (index == 0) return 0;
        return std::exp2(static_cast<double>(index - 1) / per_octave + least_octave) * (1 + 2 * edge);
    }
    // Values on a class's edge stay in it; far below a class's width.
    static constexpr double edge = 1e-7;
};

// A display's luminances, from its black to its white in equal steps of their logarithm.
class LuminanceClasses {
public:
    static constexpr std::size_t count = 16;

    explicit LuminanceClasses(const Display& display)
        : black_(black_level(display).value()), span_(to_luminance(display, 1).value() - black_),
          log2_step_(std::log2((black_ + span_) / lowest()) / (count - 1)) {}

    double in_cdm2(double relative) const { return black_ + span_ * relative; }
    double difference_in_cdm2(double relative) const { return span_ * relative; }
    // Where the display is black: a four-thousandth of its peak, in place of 0.
    double lowest() const { return std::max(black_, (black_ + span_) / 4096); }

    std::size_t of(double cdm2) const {
        const double steps = std::ceil(std::log2(std::max(cdm2, lowest()) / lowest()) / log2_step_ - ClassSeries::edge);
        return static_cast<std::size_t>(std::clamp(steps, 0.0, static_cast<double>(count - 1)));
    }
    // The largest of a class, in cd/m2.
    double value(std::size_t index) const {
        return lowest() * std::exp2(log2_step_ * static_cast<double>(index)) * (1 + 2 * ClassSeries::edge);
    }

private:
    double black_, span_, log2_step_;
};

} // namespace unseen::perception
