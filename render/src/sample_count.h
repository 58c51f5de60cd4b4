// How many samples a pixel there may be.
#pragma once

#include <string>

#include <unseen/vdtree/result.h>

namespace unseen::render {

inline constexpr int most_samples = 256; // beyond, a sum's rounding in float would outgrow what a sample adds to it

inline Result<void> check_samples(int samples) {
    if (samples >= 1 && samples <= most_samples) return {};
    return Error{ErrorCode::invalid_argument, "The samples a pixel must be from 1 to " + std::to_string(most_samples) +
                                                  ", not " + std::to_string(samples) + "."};
}

} // namespace unseen::render
