// What every judge demands of its images.
#pragma once

#include <algorithm>
#include <cmath>

#include <unseen/perception/image.h>

namespace unseen::perception {

inline Error judge_argument_error(const std::string& judge, const std::string& message) {
    return {ErrorCode::invalid_argument, judge + ": " + message};
}

// One channel, at least one pixel, finite values of 0 or more. `which` is the image's name in the message.
inline Result<void> check_luminance(const std::string& judge, const Image& image, const std::string& which) {
    const auto width = static_cast<std::size_t>(std::max(image.width, 0));
    const auto pixels = width * static_cast<std::size_t>(std::max(image.height, 0));
    if (pixels == 0 || image.channels != 1 || image.values.size() != pixels)
        return judge_argument_error(judge,
                                    "the " + which + " is not a luminance image (one channel, one pixel or more)");
    for (std::size_t i = 0; i < pixels; ++i) {
        if (image.values[i] >= 0 && std::isfinite(image.values[i])) continue;
        return judge_argument_error(judge, "luminance of the " + which + " at pixel (" + std::to_string(i % width) +
                                               ", " + std::to_string(i / width) + ") is negative or not finite");
    }
    return {};
}

inline Result<void> check_luminance_pair(const std::string& judge, const Image& reference, const Image& test) {
    if (auto ok = check_luminance(judge, reference, "reference"); !ok) return ok;
    if (auto ok = check_luminance(judge, test, "test"); !ok) return ok;
    if (reference.width == test.width && reference.height == test.height) return {};
    return judge_argument_error(judge, "the images differ in size: reference " + std::to_string(reference.width) + "x" +
                                           std::to_string(reference.height) + ", test " + std::to_string(test.width) +
                                           "x" + std::to_string(test.height));
}

} // namespace unseen::perception
