// Image files as textures.
#pragma once

#include <filesystem>
#include <string_view>

#include <unseen/vdtree/mesh.h>

namespace unseen::session {

// PNG (8 or 16 bits), JPEG, or PFM and EXR whose values are relative light from 0 to 1. `from_top`: whether row 0 of
// the texture is the image's first. Alpha is that of PNG, and else 255. At most vdtree::largest_texture_side texels a
// side. Errors name the file, and the byte, row or pixel.
Result<vdtree::Texture> read_texture(const std::filesystem::path& file, bool from_top);

// The same of a file's bytes; `name` is for messages.
Result<vdtree::Texture> decode_texture(std::string_view bytes, const std::filesystem::path& name, bool from_top);

} // namespace unseen::session
