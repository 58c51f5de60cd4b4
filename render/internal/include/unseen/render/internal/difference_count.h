// Counts the pixels of an item that differ visibly from a picture: on the GPU by occlusion queries, with results some frames
// later (Drettakis and others 2007, section 5).
#pragma once

#include <unseen/render/draw.h>
#include <unseen/render/internal/visibility_passes.h>

namespace unseen::render {

// Move-only; keeps a handle to the context. Memory: 4 bytes a pixel.
class DifferenceCounts {
public:
    // Fails on sizes as Target::create() does.
    static Result<DifferenceCounts> create(const Context& context, int width, int height);
    DifferenceCounts(DifferenceCounts&&) noexcept = default;
    DifferenceCounts& operator=(DifferenceCounts&&) noexcept = default;

    // Draws the depth of the items that hide each other in counts until the next call. Chooses the near plane of counts.
    Result<void> draw_depth(std::span<const Item> items, const Camera& camera);

    // Begins to count the visible pixels of an item whose depth was drawn, if their luminance differs from the picture's by
    // the threshold or more; NaN differs. Does not wait. The picture's scale applies to the item's luminance, too. Returns
    // the count's number. `thresholds`: just visible steps of luminance, cd/m2, by pixel, in the first channel of a
    // two-dimensional texture of this GL name.
    Result<std::uint64_t> begin(const Item& item, const LuminanceTexture& picture, unsigned thresholds);

    struct Count {
        std::uint64_t name = 0;
        std::uint64_t pixels = 0;
    };
    // The counts that the GPU has finished since the last call, in order. Does not wait.
    Result<std::vector<Count>> take();

private:
    struct Impl;
    explicit DifferenceCounts(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::render
