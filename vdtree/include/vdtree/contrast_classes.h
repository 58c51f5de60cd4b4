// Which row of a reach table a range of luminances uses: its Michelson contrast on a display in twelfths of an octave, and the
// luminance that eyes are adapted to in sixteenths of the display's range, both rounded up.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

class ContrastClasses {
public:
    // Row 0 is for folds without any contrast; then contrasts from the least one up, within luminances.
    static constexpr int contrasts_per_octave = 12, contrast_octaves = 9;
    static constexpr std::size_t contrast_count = contrasts_per_octave * contrast_octaves + 1;
    static constexpr std::size_t luminance_count = 16;
    static constexpr std::size_t row_count = 1 + contrast_count * luminance_count;

    // cd/m2 = black + span * relative luminance; black not negative, span positive.
    ContrastClasses(double black, double span)
        : black_(black), span_(span), log2_step_(std::log2((black_ + span_) / lowest()) / (luminance_count - 1)) {}

    double in_cdm2(double relative) const { return black_ + span_ * relative; }
    double black() const { return black_; }
    double span() const { return span_; }

    // `adaptation`: relative, too.
    std::uint16_t row(LuminanceRange range, double adaptation) const {
        const double lo = in_cdm2(range.lo), hi = in_cdm2(range.hi);
        const double contrast = (hi - lo) / (hi + lo);
        if (!(contrast > 0)) return 0;
        return row_of(luminance_index(in_cdm2(adaptation)), contrast_index(contrast));
    }
    static std::uint16_t row_of(std::size_t luminance, std::size_t contrast) {
        return static_cast<std::uint16_t>(1 + luminance * contrast_count + contrast);
    }
    static std::size_t contrast_index(double contrast) {
        return index(
            std::ceil(contrast_octaves * contrasts_per_octave + contrasts_per_octave * std::log2(contrast) - edge),
            contrast_count);
    }
    std::size_t luminance_index(double cdm2) const {
        return index(std::ceil(std::log2(std::max(cdm2, lowest()) / lowest()) / log2_step_ - edge), luminance_count);
    }

    // The largest of a class. Of a row but row 0.
    static double contrast(std::size_t row) { return contrast_of_index((row - 1) % contrast_count); }
    double luminance(std::size_t row) const { return luminance_of_index((row - 1) / contrast_count); }
    static double contrast_of_index(std::size_t i) {
        return std::exp2(static_cast<double>(i) / contrasts_per_octave - contrast_octaves) * (1 + 2 * edge);
    }
    double luminance_of_index(std::size_t i) const {
        return lowest() * std::exp2(log2_step_ * static_cast<double>(i)) * (1 + 2 * edge);
    }

private:
    // Values on a class's edge stay in it; far below a class's width.
    static constexpr double edge = 1e-7;
    static std::size_t index(double x, std::size_t count) {
        return static_cast<std::size_t>(std::clamp(x, 0.0, static_cast<double>(count - 1)));
    }
    // Where the display is black: a four-thousandth of its peak, in place of 0.
    double lowest() const { return std::max(black_, (black_ + span_) / 4096); }

    double black_, span_, log2_step_;
};

} // namespace unseen::vdtree
