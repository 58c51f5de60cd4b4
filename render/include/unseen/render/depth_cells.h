// What a view shows, coarsely, for vdtree::OcclusionMap: depth of cells of pixels, read back without waiting.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include <unseen/render/draw.h>
#include <unseen/vdtree/occlusion_map.h>

namespace unseen::render {

// One picture is under way at a time. Move-only; keeps a handle to the context. Memory: 32 bytes a
// cell, and 4 a pixel where it draws by itself.
//
//     if (!reader->is_under_way()) reader->begin(items, view);
//     ... // other frames
//     if (auto cells = reader->take(); cells && *cells) ...
class DepthCellReader {
public:
    // Cells of so many by so many pixels, 1 to 64. Fails on sizes as Target::create() does.
    static Result<DepthCellReader> create(const Context& context, int width, int height, int cell_px = 4);
    DepthCellReader(DepthCellReader&&) noexcept;
    DepthCellReader& operator=(DepthCellReader&&) noexcept;
    ~DepthCellReader();

    // Draws depth alone, so often, at N-rooks points of each pixel (1 to 256), and begins to read the cells. What was
    // under way is forgotten. Waits for nothing. Fails as draw() does, and on a view of another window.
    Result<void> begin(std::span<const Item> items, const vdtree::View& view, int samples = 4, std::uint32_t seed = 1);
    // The same of depth that was drawn already: one sample a pixel, and no pass over the surfaces.
    Result<void> begin(const DrawnDepth& depth);
    bool is_under_way() const noexcept;

    // What was begun, once the GPU is through with it; else nothing, or, where `waits`, then. Given once.
    Result<std::optional<vdtree::DepthCells>> take(bool waits = false);

    std::uint64_t byte_size() const noexcept; // on the GPU

private:
    struct Impl;
    explicit DepthCellReader(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::render
