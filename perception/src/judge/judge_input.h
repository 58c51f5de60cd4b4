// What every judge demands of its images.
#pragma once

#include <algorithm>
#include <cmath>

#include <unseen/perception/image.h>
#include <unseen/vdtree/colour.h>

namespace unseen::perception {

inline Error judge_argument_error(const std::string& judge, const std::string& message) {
    return {ErrorCode::invalid_argument, judge + ": " + message};
}

// One channel or three, at least one pixel, finite values; luminances of 0 or more, colours that have such a luminance.
// `which` is the image's name in the message.
inline Result<void> check_light(const std::string& judge, const Image& image, const std::string& which) {
    const auto width = static_cast<std::size_t>(std::max(image.width, 0));
    const auto pixels = width * static_cast<std::size_t>(std::max(image.height, 0));
    const auto channels = static_cast<std::size_t>(image.channels == 3 ? 3 : 1);
    if (pixels == 0 || (image.channels != 1 && image.channels != 3) || image.values.size() != channels * pixels)
        return judge_argument_error(judge,
                                    "the " + which +
                                        " is no picture of one channel (luminance) or three (linear RGB), of one "
                                        "pixel or more");
    for (std::size_t i = 0; i < pixels; ++i) {
        const float* const at = image.values.data() + channels * i;
        bool is_finite = true;
        for (std::size_t k = 0; k < channels; ++k) is_finite &= std::isfinite(at[k]);
        const float luminance = channels == 3 ? rec709_luminance(glm::vec3(at[0], at[1], at[2])) : at[0];
        if (luminance >= 0 && is_finite && std::isfinite(luminance)) continue;
        return judge_argument_error(judge, "luminance of the " + which + " at pixel (" + std::to_string(i % width) +
                                               ", " + std::to_string(i / width) + ") is negative or not finite");
    }
    return {};
}

inline Result<void> check_same_size(const std::string& judge, const Image& reference, const Image& test) {
    if (reference.width == test.width && reference.height == test.height) return {};
    return judge_argument_error(judge, "the images differ in size: reference " + std::to_string(reference.width) + "x" +
                                           std::to_string(reference.height) + ", test " + std::to_string(test.width) +
                                           "x" + std::to_string(test.height));
}

inline Result<void> check_light_pair(const std::string& judge, const Image& reference, const Image& test) {
    if (auto ok = check_light(judge, reference, "reference"); !ok) return ok;
    if (auto ok = check_light(judge, test, "test"); !ok) return ok;
    return check_same_size(judge, reference, test);
}

// The same of luminance alone.
inline Result<void> check_luminance(const std::string& judge, const Image& image, const std::string& which) {
    if (image.channels == 1) return check_light(judge, image, which);
    return judge_argument_error(judge, "the " + which + " is not a luminance image (one channel, one pixel or more)");
}
inline Result<void> check_luminance_pair(const std::string& judge, const Image& reference, const Image& test) {
    if (auto ok = check_luminance(judge, reference, "reference"); !ok) return ok;
    if (auto ok = check_luminance(judge, test, "test"); !ok) return ok;
    return check_same_size(judge, reference, test);
}

} // namespace unseen::perception
