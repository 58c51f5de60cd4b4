// Summation over space: how much of what is around a place helps to see it.
//
// castleCSF's law of area says that a patch of area A is seen sqrt(A / (A + Ac)) times as well as an unlimited one.
// This law follows where energies, squares of contrasts in thresholds, are summed with the weight
//   w(r) = Ac / (Ac + pi r^2)^2
// at the distance r: a disc of area A holds A / (A + Ac) of it, and all of the plane holds 1.
#pragma once

#include <algorithm>
#include <cstddef>

#include <unseen/perception/internal/judge_tables.h>

namespace unseen::perception {

// Values by row; of the judge, contrasts and energies.
struct Plane {
    int width = 0, height = 0;
    std::vector<float> values;

    Plane() = default;
    Plane(int w, int h) : width(w), height(h), values(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}
    float* row(int y) { return values.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width); }
    const float* row(int y) const {
        return values.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
    }
};

// Mirrored about the outermost pixels; an image narrower than the kernel repeats its last one.
inline int mirrored(int i, int n) {
    if (i < 0) i = -i;
    if (i >= n) i = 2 * (n - 1) - i;
    return std::clamp(i, 0, n - 1);
}

// The window w as a sum of Gaussians: w(r) is the integral of t e^-t e^(-t pi r^2 / Ac) over t > 0, of which three
// points are taken (Gauss and Laguerre). Of discs of up to twice Ac it holds what w does within 9%, at its middle
// exactly.
class SummationWindow {
public:
    // Ac in samples; above 0.
    explicit SummationWindow(double area);

    // The weighted sums around each place. Outside of the plane there is nothing. Cost: some 30 operations a sample.
    Plane sums(const Plane& energy) const;

    using Gaussian = JudgeTables::Gaussian;
    const std::array<Gaussian, 3>& gaussians() const { return gaussians_; } // from the widest on

private:
    std::array<Gaussian, 3> gaussians_;
};

} // namespace unseen::perception
