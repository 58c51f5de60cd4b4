// A pyramid (pyramid_kernel.h) of pictures with nothing around them: coarser levels reach beyond the finer ones, so
// that what a small picture comes to over a large area is told, too.
#pragma once

#include <cstddef>
#include <vector>

namespace unseen::perception {

struct Raster {
    std::size_t side = 0;
    std::vector<float> values; // by row

    Raster() = default;
    explicit Raster(std::size_t n) : side(n), values(n * n) {}
    float* row(std::size_t y) { return values.data() + y * side; }
    const float* row(std::size_t y) const { return values.data() + y * side; }
};

// A sample of the next level lies on every second one of this, from two steps outside on.
inline constexpr std::size_t steps_outside = 2;
inline std::size_t place_in_next(std::size_t at) { return at / 2 + steps_outside; }

// Smoothed, at half the resolution.
Raster reduce(const Raster& plane);
// Back to the resolution of a level with so many samples a side.
Raster expand(const Raster& next, std::size_t side);

// The frequency that a level's band (the level less its next one, expanded) is named after, in cycles a sample of the
// first level; and by how much the band changes the amplitude of a grating of that frequency.
double nominal_frequency(std::size_t level);
double band_gain(std::size_t level);

} // namespace unseen::perception
