#include "measure/pyramid.h"

#include <numbers>

#include "pyramid_kernel.h"

namespace unseen::perception {
namespace {

constexpr auto tap0 = static_cast<float>(kernel_middle), tap1 = static_cast<float>(kernel_near),
               tap2 = static_cast<float>(kernel_far);

// Calls f(i, c) for the samples i of the next level and their places c here, in [-4, side + 3].
template <class F>
void for_each_next(std::size_t side, F&& f) {
    for (std::size_t i = 0; i < place_in_next(side) + steps_outside; ++i)
        f(i, 2 * (static_cast<std::ptrdiff_t>(i) - static_cast<std::ptrdiff_t>(steps_outside)));
}

} // namespace

Raster reduce(const Raster& plane) {
    const std::size_t side = plane.side, next_side = place_in_next(side) + steps_outside;
    const auto is_inside = [&](std::ptrdiff_t at) { return at >= 0 && at < static_cast<std::ptrdiff_t>(side); };
    std::vector<float> narrow(side * next_side); // half as wide, as high
    for (std::size_t y = 0; y < side; ++y) {
        const float* const in = plane.row(y);
        float* const out = narrow.data() + y * next_side;
        const auto at = [&](std::ptrdiff_t x) { return is_inside(x) ? in[x] : 0.0f; };
        for_each_next(side, [&](std::size_t i, std::ptrdiff_t c) {
            out[i] = tap0 * at(c) + tap1 * (at(c - 1) + at(c + 1)) + tap2 * (at(c - 2) + at(c + 2));
        });
    }
    const std::vector<float> nothing(next_side);
    const auto row = [&](std::ptrdiff_t y) {
        return is_inside(y) ? narrow.data() + static_cast<std::size_t>(y) * next_side : nothing.data();
    };
    Raster next(next_side);
    for_each_next(side, [&](std::size_t i, std::ptrdiff_t c) {
        const float *a = row(c - 2), *b = row(c - 1), *middle = row(c), *d = row(c + 1), *e = row(c + 2);
        float* const out = next.row(i);
        for (std::size_t x = 0; x < next_side; ++x)
            out[x] = tap0 * middle[x] + tap1 * (b[x] + d[x]) + tap2 * (a[x] + e[x]);
    });
    return next;
}

Raster expand(const Raster& next, std::size_t side) {
    std::vector<float> low(next.side * side); // as wide, half as high
    for (std::size_t y = 0; y < next.side; ++y) {
        const float* const in = next.row(y);
        float* const out = low.data() + y * side;
        for (std::size_t x = 0; x < side; ++x) {
            const std::size_t k = place_in_next(x);
            out[x] = 2 * (x % 2 == 1 ? tap1 * (in[k] + in[k + 1]) : tap0 * in[k] + tap2 * (in[k - 1] + in[k + 1]));
        }
    }
    Raster plane(side);
    for (std::size_t y = 0; y < side; ++y) {
        const float *above = low.data() + (place_in_next(y) - 1) * side, *at = above + side, *below = at + side;
        float* const out = plane.row(y);
        for (std::size_t x = 0; x < side; ++x)
            out[x] = 2 * (y % 2 == 1 ? tap1 * (at[x] + below[x]) : tap0 * at[x] + tap2 * (above[x] + below[x]));
    }
    return plane;
}

double nominal_frequency(std::size_t level) {
    return level == 0 ? 0.5 : second_band_ratio / 2 * std::exp2(1 - static_cast<double>(level));
}

double band_gain(std::size_t level) {
    double omega = 2 * std::numbers::pi * nominal_frequency(level), gain = 1;
    for (std::size_t i = 0; i < level; ++i, omega *= 2) gain *= std::abs(kernel_response(omega));
    const double back = kernel_response(omega);
    return gain * (1 - back * back);
}

} // namespace unseen::perception
