// Frames of any items, and the depths that a view shows, for vdtree::DepthPicture.
#pragma once

#include <unseen/render/renderer.h>
#include <unseen/render/sample_sum.h>

namespace unseen::render {

// Draws items and reads the mean of their samples back. `sum`: made for the first frame, and for each of another size.
Result<Frame> draw_frame(std::optional<SampleSum>& sum, const Context& context, std::span<const Item> items,
                         const vdtree::View& view, const Sampling& sampling);

// By pixel of the view's window, row-major from the top left: the farthest depth of its samples along the view's axis, in
// world units; infinite if a sample shows no surface. `samples`: N-rooks points a pixel, 1 to 256. Draws depth alone for
// each sample, off screen, and reads it back: 8 bytes a pixel. Fails like draw().
Result<std::vector<float>> farthest_depth(const Context& context, std::span<const Item> items, const vdtree::View& view,
                                          int samples = 16, std::uint32_t seed = 1);

} // namespace unseen::render
