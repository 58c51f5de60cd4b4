// Classes of criteria with lights, by what a range of values comes to: its Michelson contrast in twelfths of an octave,
// and a level in sixteen steps of equal ratio from the least value to the largest. Both are rounded up.
//
// Values are relative, 0..1, as trees store them. A linear map, which the criterion gives, makes them absolute.
#pragma once

#include <cmath>

#include <unseen/vdtree/internal/light_bounds.h>

namespace unseen::vdtree {

// A linear map from relative luminance to a unit of the criterion's own.
struct AbsoluteScale {
    double offset = 0; // the value of 0; 0 or more
    double span = 1;   // what 1 adds; above 0

    double of(double relative) const { return offset + span * relative; }
};

// A criterion's interior classes under lights that may move. They follow from the range of luminances that the
// viewpoint's lighting gives to a node's vertices, adapted to the brightest of these.
struct LitClasses {
    std::shared_ptr<const LightBounds> bounds; // of the tree
    AbsoluteScale scale;
    std::uint16_t silhouette = 0; // the class of all outlines
};

// Values on a class's edge stay in it; far below a class's width.
inline constexpr double class_edge = 1e-7;

class LevelClasses {
public:
    static constexpr std::size_t count = 16;

    // Precondition: the offset is 0 or more, the span above 0.
    explicit LevelClasses(const AbsoluteScale& scale)
        : scale_(scale), log2_step_(std::log2(scale_.of(1) / lowest()) / (count - 1)) {}

    const AbsoluteScale& scale() const { return scale_; }
    // A four-thousandth of the largest, in place of 0.
    double lowest() const { return std::max(scale_.offset, scale_.of(1) / 4096); }
    std::size_t of(double absolute) const {
        const double steps = std::ceil(std::log2(std::max(absolute, lowest()) / lowest()) / log2_step_ - class_edge);
        return static_cast<std::size_t>(std::clamp(steps, 0.0, static_cast<double>(count - 1)));
    }
    double value(std::size_t index) const { // the largest of a class
        return lowest() * std::exp2(log2_step_ * static_cast<double>(index)) * (1 + 2 * class_edge);
    }

private:
    AbsoluteScale scale_;
    double log2_step_;
};

class ContrastClasses {
public:
    // Class 0 is for folds without any contrast; then contrasts from the least one up, within levels.
    static constexpr int contrasts_per_octave = 12, contrast_octaves = 9;
    static constexpr std::size_t contrast_count = contrasts_per_octave * contrast_octaves + 1;
    static constexpr std::size_t level_count = LevelClasses::count;
    static constexpr std::size_t class_count = 1 + contrast_count * level_count;

    explicit ContrastClasses(const AbsoluteScale& scale) : levels_(scale) {}

    // The class of a range at a level; both are relative.
    std::uint16_t class_of(LuminanceRange range, double level) const {
        const double lo = levels_.scale().of(range.lo), hi = levels_.scale().of(range.hi);
        const double contrast = (hi - lo) / (hi + lo);
        if (!(contrast > 0)) return 0;
        return class_at(levels_.of(levels_.scale().of(level)), contrast_index(contrast));
    }
    static std::uint16_t class_at(std::size_t level, std::size_t contrast) {
        return static_cast<std::uint16_t>(1 + level * contrast_count + contrast);
    }
    static std::size_t contrast_index(double contrast) {
        const double steps = std::ceil(contrast_octaves * contrasts_per_octave +
                                       contrasts_per_octave * std::log2(contrast) - class_edge);
        return static_cast<std::size_t>(std::clamp(steps, 0.0, static_cast<double>(contrast_count - 1)));
    }

    // The largest values of a class other than 0; the level is absolute.
    static double contrast(std::size_t number) { return contrast_of_index((number - 1) % contrast_count); }
    double level(std::size_t number) const { return levels_.value((number - 1) / contrast_count); }
    static double contrast_of_index(std::size_t i) {
        return std::exp2(static_cast<double>(i) / contrasts_per_octave - contrast_octaves) * (1 + 2 * class_edge);
    }

private:
    LevelClasses levels_;
};

} // namespace unseen::vdtree
