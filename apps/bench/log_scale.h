// Logarithmic axes of plots.
#pragma once

#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

namespace unseen::app {

// A logarithmic axis with room for 0 at its beginning.
struct LogScale {
    double least = 1, most = 10, from = 0, to = 1; // values above 0, and pixels
    bool has_zero = false;

    LogScale(const std::vector<double>& values, double from_, double to_) : from(from_), to(to_) {
        std::vector<double> positive;
        std::ranges::copy_if(values, std::back_inserter(positive), [](double v) { return v > 0; });
        has_zero = positive.size() < values.size();
        if (positive.empty()) return;
        least = std::pow(10, std::floor(std::log10(std::ranges::min(positive)) * 2) / 2);
        most = std::pow(10, std::ceil(std::log10(std::ranges::max(positive)) * 2) / 2);
        if (!(most > least)) most = 10 * least;
    }
    double at(double value) const {
        constexpr double of_zero = 0.08; // share of the axis
        const double begin = has_zero ? from + of_zero * (to - from) : from;
        if (!(value > 0)) return from + (has_zero ? of_zero / 4 * (to - from) : 0);
        return begin + (to - begin) * std::log(value / least) / std::log(most / least);
    }
    std::vector<double> ticks() const {
        std::vector<double> all;
        for (double decade = std::pow(10, std::ceil(std::log10(least) - 1e-9)); decade <= most * (1 + 1e-9);
             decade *= 10)
            all.push_back(decade);
        return all;
    }
};

} // namespace unseen::app
