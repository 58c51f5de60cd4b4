// By how much thresholds are raised at each frequency.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

namespace unseen::perception {

class BandElevation {
public:
    BandElevation() = default; // of nothing that masks
    // Nominal frequencies, falling, and elevations, 1 or more.
    BandElevation(std::vector<double> cpd, std::vector<double> elevation)
        : cpd_(std::move(cpd)), elevation_(std::move(elevation)) {}

    // The least of the two bands around.
    double at(double cpd) const {
        if (cpd_.empty()) return 1;
        std::size_t below = 0;
        while (below < cpd_.size() && cpd_[below] > cpd) ++below;
        const double under = elevation_[std::min(below, cpd_.size() - 1)];
        return below > 0 ? std::min(elevation_[below - 1], under) : under;
    }

private:
    std::vector<double> cpd_, elevation_;
};

} // namespace unseen::perception
