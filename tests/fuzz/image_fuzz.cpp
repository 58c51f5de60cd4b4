// Fuzz target for the readers of images, PNG, PFM and EXR, and of textures, which may be JPEG, too: any bytes must give an
// error, or an image whose values are numbers and as many as it says. tests/README.md tells how to build and run it.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include <string_view>

#include <unseen/perception/image.h>

#include "texture_image.h"

namespace {

void read_texture(std::string_view bytes) {
    const auto texture = unseen::session::decode_texture(bytes, "fuzz", true);
    if (texture ? texture->texels.empty() || !unseen::vdtree::validate(texture->view())
                : texture.error().message.empty())
        std::abort();
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    read_texture({reinterpret_cast<const char*>(data), size});
    const auto read = unseen::perception::decode_image(std::vector<unsigned char>(data, data + size), "fuzz");
    if (!read) {
        if (read.error().message.empty()) std::abort();
        return 0;
    }
    const unseen::perception::Image& image = read->image;
    const std::size_t values = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height) *
                               static_cast<std::size_t>(image.channels);
    if (image.width < 1 || image.height < 1 || values != image.values.size()) std::abort();
    for (const float value : image.values)
        if (!std::isfinite(value)) std::abort();
    for (const float value : unseen::perception::to_luminance(*read, {}).values)
        if (std::isnan(value)) std::abort();
    return 0;
}
