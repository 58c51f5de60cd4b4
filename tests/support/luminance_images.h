// Pictures for judges, in cd/m2.
#pragma once

#include <cstddef>
#include <random>
#include <vector>

#include <unseen/perception/image.h>

#include "shapes.h"

namespace unseen::support {

inline perception::Image flat(int width, int height, float cdm2) {
    return {width, height, 1,
            std::vector<float>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), cdm2)};
}

// Each pixel by itself, up to the contrast from the mean.
inline perception::Image noise(int width, int height, double mean, double contrast, unsigned seed) {
    perception::Image image = flat(width, height, 0);
    std::mt19937_64 random(seed);
    for (float& v : image.values) v = static_cast<float>(mean * (1 + contrast * shapes::random_between(random, -1, 1)));
    return image;
}

} // namespace unseen::support
