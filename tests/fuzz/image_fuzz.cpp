// Fuzz target for the readers of images, PNG, PFM and EXR, and of textures, which may be JPEG, too: any bytes must give an
// error, or an image whose values are numbers and as many as it says. tests/README.md tells how to build and run it.
#include <cmath>
#include <cstdlib>
#include <string_view>
#include <vector>

#include <unseen/perception/image.h>

#include "target.h"
#include "texture_image.h"

namespace {

bool is_texture(std::string_view bytes) {
    const auto texture = unseen::session::decode_texture(bytes, "fuzz", true);
    if (texture ? texture->texels.empty() || !unseen::vdtree::validate(texture->view())
                : texture.error().message.empty())
        std::abort();
    return texture.has_value();
}

} // namespace

bool unseen::fuzz::accepts(std::string_view bytes) {
    const bool is_accepted = is_texture(bytes);
    const auto read = unseen::perception::decode_image(bytes, "fuzz");
    if (!read) {
        if (read.error().message.empty()) std::abort();
        return is_accepted && !unseen::perception::is_image(bytes); // JPEG
    }
    const unseen::perception::Image& image = read->image;
    const std::size_t values = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height) *
                               static_cast<std::size_t>(image.channels);
    if (image.width < 1 || image.height < 1 || values != image.values.size()) std::abort();
    for (const float value : image.values)
        if (!std::isfinite(value)) std::abort();
    for (const float value : unseen::perception::to_luminance(*read, {}).values)
        if (std::isnan(value)) std::abort();
    return is_accepted;
}
