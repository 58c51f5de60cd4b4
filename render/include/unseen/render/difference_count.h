// How many pixels of an item would look visibly different from a picture: counted on the GPU by occlusion queries, and
// known some frames later (Drettakis and others 2007, section 5).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <unseen/render/draw.h>
#include <unseen/render/visibility.h>

namespace unseen::render {

// A step of luminance that is just visible, cd/m2, in the first channel of a texture of two dimensions: by pixel, or by
// blocks of so many by so many, the last ones cut off.
struct ThresholdTexture {
    unsigned id = 0; // GL name; stays its owner's
    int block = 1;
};

// Move-only; keeps a handle to the context. Memory: 4 bytes a pixel.
class DifferenceCounts {
public:
    // Fails on sizes as Target::create() does.
    static Result<DifferenceCounts> create(const Context& context, int width, int height);
    DifferenceCounts(DifferenceCounts&&) noexcept;
    DifferenceCounts& operator=(DifferenceCounts&&) noexcept;
    ~DifferenceCounts();

    // What counts until the next call hide each other. The near plane that it chooses is that of counts, too.
    Result<void> draw_depth(std::span<const Item> items, const Camera& camera);

    // Begins to count the pixels of an item, one of those whose depth was drawn, that nothing hides and whose luminance
    // differs from the picture's by the threshold there or more. What is no number differs. Waits for nothing. The
    // picture's scale is that of the item's luminance, too. Returns a number that names the count.
    Result<std::uint64_t> begin(const Item& item, const LuminanceTexture& picture, const ThresholdTexture& thresholds);

    struct Count {
        std::uint64_t name = 0;
        std::uint64_t pixels = 0;
    };
    // The counts that the GPU has finished since the last call, in order. Does not wait for those that it has not.
    Result<std::vector<Count>> take();

    int open_counts() const noexcept; // begun, and not taken

private:
    struct Impl;
    explicit DifferenceCounts(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::render
