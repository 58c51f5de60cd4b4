// Pseudo-random numbers that are the same with every compiler and standard library, for runs that must repeat.
// Distributions are made here: those of <random> differ between libraries.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace unseen {

class Random {
public:
    explicit Random(std::uint64_t seed) : state_(seed) {}

    // SplitMix64 (Steele, Lea and Flood 2014).
    std::uint64_t bits() {
        state_ += 0x9e3779b97f4a7c15u;
        std::uint64_t z = state_;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return z ^ (z >> 31);
    }

    // In [0, 1), a multiple of 2^-53.
    double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }

    // Mean 0, standard deviation 1 (Box and Muller 1958).
    double normal() {
        const double radius = std::sqrt(-2 * std::log(1 - uniform()));
        return radius * std::cos(2 * std::numbers::pi * uniform());
    }

    // Gamma distribution of a whole shape of 1 or more: a sum of exponentials.
    double gamma(int shape, double scale) {
        double sum = 0;
        for (int i = 0; i < shape; ++i) sum -= std::log(1 - uniform());
        return sum * scale;
    }

private:
    std::uint64_t state_;
};

// A generator of its own for the `index`-th item of a run, so that a run can be taken up anywhere.
inline Random random_for(std::uint64_t seed, std::uint64_t index) {
    return Random(Random(seed ^ Random(index).bits()).bits());
}

} // namespace unseen
