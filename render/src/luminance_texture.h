// What passes over pictures share: what a picture may be, and reading back.
#pragma once

#include <string>
#include <vector>

#include <glm/vec2.hpp>

#include <unseen/render/internal/visibility_passes.h>

namespace unseen::render {

std::string size_text(int width, int height);
Error judge_error(const std::string& message);

// In its context.
Result<void> check_size(int width, int height);
Result<void> check_texture(const LuminanceTexture& texture);

// As pixels in memory lie, whatever others have set.
void reset_pixel_stores();
// Reads the first channel. Waits for the GPU.
std::vector<float> read_floats(unsigned texture, glm::ivec2 size);

} // namespace unseen::render
