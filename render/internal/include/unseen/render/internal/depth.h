// The depths that a view shows, for vdtree::DepthPicture.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <unseen/render/draw.h>

namespace unseen::render {

// By pixel of the view's window, row-major from the top left: the farthest depth of its samples along the view's axis, in
// world units; infinite if a sample shows no surface. `samples`: N-rooks points a pixel, 1 to 256. Draws depth alone for
// each sample, off screen, and reads it back: 8 bytes a pixel. Fails like draw().
Result<std::vector<float>> farthest_depth(const Context& context, std::span<const Item> items, const vdtree::View& view,
                                          int samples = 16, std::uint32_t seed = 1);

} // namespace unseen::render
