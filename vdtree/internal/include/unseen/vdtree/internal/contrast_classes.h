// Classes of criteria with lights, by what a range of values comes to: its Michelson contrast in twelfths of an octave,
// and a level in sixteen steps of equal ratio from the least value to the largest. Both are rounded up.
//
// Values are relative, 0..1, as trees store them. A linear map, which the criterion gives, makes them absolute.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <unseen/vdtree/criteria.h>

namespace unseen::vdtree {

class ContrastClasses {
public:
    // Class 0 is for folds without any contrast; then contrasts from the least one up, within levels.
    static constexpr int contrasts_per_octave = 12, contrast_octaves = 9;
    static constexpr std::size_t contrast_count = contrasts_per_octave * contrast_octaves + 1;
    static constexpr std::size_t level_count = 16;
    static constexpr std::size_t class_count = 1 + contrast_count * level_count;

    // Precondition: the offset is 0 or more, the span above 0.
    explicit ContrastClasses(const AbsoluteScale& scale)
        : scale_(scale), log2_step_(std::log2(scale_.of(1) / lowest()) / (level_count - 1)) {}

    // The class of a range at a level; both are relative.
    std::uint16_t class_of(LuminanceRange range, double level) const {
        const double lo = scale_.of(range.lo), hi = scale_.of(range.hi);
        const double contrast = (hi - lo) / (hi + lo);
        if (!(contrast > 0)) return 0;
        return class_at(level_index(scale_.of(level)), contrast_index(contrast));
    }
    static std::uint16_t class_at(std::size_t level, std::size_t contrast) {
        return static_cast<std::uint16_t>(1 + level * contrast_count + contrast);
    }
    static std::size_t contrast_index(double contrast) {
        return index(
            std::ceil(contrast_octaves * contrasts_per_octave + contrasts_per_octave * std::log2(contrast) - edge),
            contrast_count);
    }
    std::size_t level_index(double absolute) const {
        return index(std::ceil(std::log2(std::max(absolute, lowest()) / lowest()) / log2_step_ - edge), level_count);
    }

    // The largest values of a class, but of class 0; the level is absolute.
    static double contrast(std::size_t number) { return contrast_of_index((number - 1) % contrast_count); }
    double level(std::size_t number) const { return level_of_index((number - 1) / contrast_count); }
    static double contrast_of_index(std::size_t i) {
        return std::exp2(static_cast<double>(i) / contrasts_per_octave - contrast_octaves) * (1 + 2 * edge);
    }
    double level_of_index(std::size_t i) const {
        return lowest() * std::exp2(log2_step_ * static_cast<double>(i)) * (1 + 2 * edge);
    }

private:
    // Values on a class's edge stay in it; far below a class's width.
    static constexpr double edge = 1e-7;
    static std::size_t index(double x, std::size_t count) {
        return static_cast<std::size_t>(std::clamp(x, 0.0, static_cast<double>(count - 1)));
    }
    // A four-thousandth of the largest, in place of 0.
    double lowest() const { return std::max(scale_.offset, scale_.of(1) / 4096); }

    AbsoluteScale scale_;
    double log2_step_;
};

} // namespace unseen::vdtree
