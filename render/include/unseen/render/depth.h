// How far away is what a view shows: for vdtree::DepthPicture.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <unseen/render/draw.h>

namespace unseen::render {

// By pixel of the view's window, row-major from the top left: how far along the view's axis, in world units, the
// farthest surface is that one of the samples shows; infinite where one shows none. `samples`: N-rooks points a pixel,
// 1 to 256. Draws depth alone, off screen, and reads it back: 8 bytes a pixel, and the time of so many draws. Fails as
// draw() does.
Result<std::vector<float>> farthest_depth(const Context& context, std::span<const Item> items, const vdtree::View& view,
                                          int samples = 16, std::uint32_t seed = 1);

} // namespace unseen::render
