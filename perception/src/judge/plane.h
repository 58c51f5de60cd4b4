// A grid of numbers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

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

} // namespace unseen::perception
