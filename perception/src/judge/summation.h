// Summation over space: how much of what is around a place helps to see it.
//
// castleCSF's law of area says that a patch of area A is seen sqrt(A / (A + Ac)) times as well as an unlimited one.
// This law follows where energies, squares of contrasts in thresholds, are summed with the weight
//   w(r) = Ac / (Ac + pi r^2)^2
// at the distance r: a disc of area A holds A / (A + Ac) of it, and all of the plane holds 1.
#pragma once

#include <unseen/perception/internal/judge_tables.h>

#include "judge/plane.h"

namespace unseen::perception {

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
