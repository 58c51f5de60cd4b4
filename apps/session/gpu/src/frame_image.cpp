#include <unseen/session_gpu/frame_image.h>

#include <algorithm>

namespace unseen::session {

perception::Image code_image(const render::Frame& frame, const perception::Display& display) {
    perception::Image image{frame.width, frame.height, 3, {}};
    image.values.reserve(frame.colour.size());
    for (const float linear : frame.colour) {
        const double code = perception::encode(display, static_cast<double>(linear));
        image.values.push_back(static_cast<float>(std::clamp(code, 0.0, 1.0)));
    }
    return image;
}

perception::Image luminance_image(const render::Frame& frame, const perception::Display& display) {
    perception::Image image{frame.width, frame.height, 1, {}};
    image.values.reserve(frame.luminance.size());
    for (const float relative : frame.luminance)
        image.values.push_back(
            static_cast<float>(perception::to_luminance(display, static_cast<double>(relative)).value()));
    return image;
}

} // namespace unseen::session
