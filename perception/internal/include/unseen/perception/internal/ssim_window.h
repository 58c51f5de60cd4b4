// The parts of structural similarity (Wang, Bovik, Sheikh, Simoncelli 2004) as scikit-image computes it with Gaussian
// weights, for programs that count it over a part of a picture. For whole pictures take ssim() of judge.h.
#pragma once

#include <array>

namespace unseen::perception::ssim_window {

constexpr int radius = 5; // int(3.5 sigma + 0.5) pixels
constexpr int size = 2 * radius + 1;
constexpr double sigma = 1.5;          // pixels
constexpr double data_range = 255;     // 8-bit codes
constexpr double k1 = 0.01, k2 = 0.03; // eq. 7, 9: keep quotients of dark and of flat windows finite

// Along one axis; they sum to 1.
const std::array<double, size>& weights();

// Sums over a window of code values 0..255 of two pictures, their squares and their product, with its weights.
struct Moments {
    double x = 0, y = 0, xx = 0, yy = 0, xy = 0;
    void add(double weight, const Moments& m) noexcept {
        x += weight * m.x;
        y += weight * m.y;
        xx += weight * m.xx;
        yy += weight * m.yy;
        xy += weight * m.xy;
    }
};

// The similarity in one window (eq. 13), -1 to 1, with biased covariance.
inline double similarity(const Moments& m) noexcept {
    constexpr double c1 = (k1 * data_range) * (k1 * data_range);
    constexpr double c2 = (k2 * data_range) * (k2 * data_range);
    const double variance_x = m.xx - m.x * m.x, variance_y = m.yy - m.y * m.y;
    const double covariance = m.xy - m.x * m.y;
    return ((2 * m.x * m.y + c1) * (2 * covariance + c2)) /
           ((m.x * m.x + m.y * m.y + c1) * (variance_x + variance_y + c2));
}

} // namespace unseen::perception::ssim_window
