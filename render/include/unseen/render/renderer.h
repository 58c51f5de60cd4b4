// Renderer draws one tree in a few lines. For scenes, use draw() and SampleSum.
#pragma once

#include <unseen/render/draw.h>

namespace unseen::render {

struct DrawOptions {
    Shading shading = Shading::smooth;
    bool wireframe = false;
    int samples = 16; // the next three as in Sampling
    std::uint32_t seed = 1;
    float background = default_background;
    std::optional<vdtree::Lighting> lighting = {}; // as in Item
};

// A drawn frame. Row-major from the top left.
struct Frame {
    int width = 0;
    int height = 0;
    std::vector<float> luminance; // relative, linear, 0..1, background included
    std::vector<float> colour;    // linear RGB, three values a pixel
    double draw_ms = 0;           // wall-clock time of drawing all samples and reading back
};

// One tree, one cut at a time, one picture: a GpuTree, a GpuCut and a SampleSum. Move-only. Keeps handles to the
// context and to the tree's data.
class Renderer {
public:
    static Result<Renderer> create(const Context& context, const vdtree::VertexTree& tree);
    Renderer(Renderer&&) noexcept = default;
    Renderer& operator=(Renderer&&) noexcept = default;

    // Draws off screen and reads back. Fails on an invalid view or lights, if graphics memory runs out, and on a GL error.
    Result<Frame> draw(const vdtree::Cut& cut, const vdtree::View& view, const DrawOptions& options = {},
                       const vdtree::Similarity& placement = {});
    Result<Frame> draw(const vdtree::Geomorph& geomorph, const vdtree::View& view, const DrawOptions& options = {},
                       const vdtree::Similarity& placement = {});

    // Draws to the window's framebuffer, encoded as sRGB, with the hardware's multisampling if it has any.
    Result<void> draw_to_window(const vdtree::Cut& cut, const vdtree::View& view, const DrawOptions& options = {},
                                const vdtree::Similarity& placement = {});
    Result<void> draw_to_window(const vdtree::Geomorph& geomorph, const vdtree::View& view,
                                const DrawOptions& options = {}, const vdtree::Similarity& placement = {});

    std::uint64_t uploaded_bytes() const noexcept; // by the last draw, as in GpuCut

private:
    struct Impl;
    explicit Renderer(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::render
