// What a fold can be taken for at the worst, in classes, and the rows of the table that the classes in use get.
#pragma once

#include <limits>
#include <unordered_map>

#include <unseen/perception/internal/chroma.h>

#include "fold/luminance_classes.h"

namespace unseen::perception {

// Michelson's: the finer classes where few other things tell rows apart.
inline constexpr ClassSeries coarse_contrasts{12, -9, 9}, fine_contrasts{48, -9, 9};
inline constexpr ClassSeries shifts{3, -13, 14}; // of the mean over the middle of the range
// Contrasts of colour, in both directions.
inline constexpr ClassSeries chroma_contrasts{3, -13, 18};
inline constexpr ClassSeries chroma_shifts{1, -13, 18};
// Michelson contrasts of textures, and by how much of a fold's extent they move.
inline constexpr ClassSeries texture_contrasts{4, -9, 9};
inline constexpr ClassSeries texture_motions{1, -16, 16};

struct Level {
    std::size_t contrast = 0, luminance = 0, shift = 0;  // classes
    std::array<std::size_t, 2> chroma{}, chroma_shift{}; // red-green and yellow-violet
    std::size_t texture = 0, texture_motion = 0;         // both, or neither

    bool is_nothing() const { return contrast == 0 && chroma[0] == 0 && chroma[1] == 0 && texture == 0; }
    std::size_t grey_number() const {
        return (shift * LuminanceClasses::count + luminance) * fine_contrasts.count() + contrast;
    }
    std::uint64_t number() const {
        std::uint64_t number = texture * texture_motions.count() + texture_motion;
        for (std::size_t i = 0; i < 2; ++i)
            number = (number * chroma_shifts.count() + chroma_shift[i]) * chroma_contrasts.count() + chroma[i];
        return number * grey_count + grey_number();
    }
    static constexpr std::size_t grey_count = shifts.count() * LuminanceClasses::count * fine_contrasts.count();
};

// What a node's ring may show, before it is put into classes.
struct RingLooks {
    vdtree::LuminanceRange range;
    double adaptation = 0; // relative luminance
    double shift = 0;      // contrast, and so on
    glm::dvec2 chroma = glm::dvec2(0), chroma_shift = glm::dvec2(0);
    double texture = 0, texture_motion = 0; // contrast; share of the fold's extent
    double least_contrast = 0;              // the range counts as one of this contrast at least
};

// What rings look like on a display, in classes.
class Classes {
public:
    Classes(const Display& display, const ClassSeries& contrasts) : luminances_(display), contrasts_(contrasts) {}

    const ClassSeries& contrasts() const { return contrasts_; }

    Level level(const RingLooks& looks) const {
        const bool moves_texture = looks.texture > 0 && looks.texture_motion > 0;
        return {contrasts_.of(std::max(contrast(looks.range), looks.least_contrast)),
                luminances_.of(luminances_.in_cdm2(looks.adaptation)),
                shifts.of(looks.shift),
                {chroma_contrasts.of(looks.chroma.x), chroma_contrasts.of(looks.chroma.y)},
                {chroma_shifts.of(looks.chroma_shift.x), chroma_shifts.of(looks.chroma_shift.y)},
                moves_texture ? texture_contrasts.of(looks.texture) : 0,
                moves_texture ? texture_motions.of(looks.texture_motion) : 0};
    }
    // What the contrasts of vertices and texture come to together, rounded up like each of them.
    double sum_of_contrasts(const RingLooks& looks) const {
        const Level rounded = level(looks);
        if (rounded.texture == 0) return 0;
        return std::min(1.0, contrasts_.value(rounded.contrast) + texture_contrasts.value(rounded.texture));
    }
    // Michelson's.
    double contrast(vdtree::LuminanceRange range) const {
        const double lo = luminances_.in_cdm2(range.lo), hi = luminances_.in_cdm2(range.hi);
        return (hi - lo) / (hi + lo);
    }
    double luminance(std::size_t luminance_class) const { return luminances_.value(luminance_class); }

    // The contrast of a difference in relative luminance against the middle of a range.
    double contrast(double difference, vdtree::LuminanceRange range) const {
        const double middle = (luminances_.in_cdm2(range.lo) + luminances_.in_cdm2(range.hi)) / 2;
        return luminances_.difference_in_cdm2(difference) / std::max(middle, luminances_.lowest());
    }
    // The contrasts of differences in both directions of colour.
    glm::dvec2 chroma_contrast(glm::dvec2 difference, vdtree::LuminanceRange range) const {
        // What a damaged file holds may be no number, or negative: it can always be seen.
        const auto in = [&](double d) { return d >= 0 ? contrast(d, range) : std::numeric_limits<double>::infinity(); };
        return {in(difference.x), in(difference.y)};
    }

private:
    LuminanceClasses luminances_;
    ClassSeries contrasts_;
};

// Gives the classes in use their rows of the table, row 0 to what changes nothing. Where they are too many for the
// rows' numbers, all classes are rounded up to fewer: then begin again with coarser rows.
class Rows {
public:
    // `is_grey`: of contrasts and shifts of luminance alone.
    Rows(bool is_grey, const ClassSeries& contrasts, std::size_t coarseness)
        : is_grey_(is_grey), contrast_count_(contrasts.count()), coarseness_(coarseness) {
        if (is_grey) grey_rows_.assign(Level::grey_count, 0);
    }

    std::uint16_t of(const Level& fine) {
        if (fine.is_nothing()) return 0;
        const Level level = coarser(fine);
        std::uint16_t& row = is_grey_ ? grey_rows_[level.grey_number()] : rows_[level.number()];
        if (row == 0 && !is_full()) {
            levels_.push_back(level);
            row = static_cast<std::uint16_t>(levels_.size());
        }
        return row;
    }
    bool is_full() const { return levels_.size() == 0xffff; }
    const std::vector<Level>& levels() const { return levels_; } // of row 1 and so on

private:
    Level coarser(Level level) const {
        const auto round = [&](std::size_t& index, std::size_t count) {
            index = std::min((index + coarseness_ - 1) / coarseness_ * coarseness_, count - 1);
        };
        round(level.contrast, contrast_count_);
        round(level.shift, shifts.count());
        for (std::size_t i = 0; i < 2; ++i) {
            round(level.chroma[i], chroma_contrasts.count());
            round(level.chroma_shift[i], chroma_shifts.count());
        }
        round(level.texture, texture_contrasts.count());
        return level;
    }

    bool is_grey_;
    std::size_t contrast_count_, coarseness_;
    std::vector<std::uint16_t> grey_rows_;
    std::unordered_map<std::uint64_t, std::uint16_t> rows_;
    std::vector<Level> levels_;
};

} // namespace unseen::perception
