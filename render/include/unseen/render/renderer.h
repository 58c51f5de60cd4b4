// The header to include first. Renderer draws one tree in a few lines; scenes are drawn by the headers below.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <unseen/render/context.h>
#include <unseen/render/draw.h>
#include <unseen/render/gpu_tree.h>
#include <unseen/render/sample_sum.h>
#include <unseen/render/target.h>

namespace unseen::render {

struct DrawOptions {
    Shading shading = Shading::smooth;
    bool wireframe = false;
    int samples = 16; // as in Sampling, and the next two
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
    double draw_ms = 0;           // drawing of all samples and reading back, wall clock
};

// One tree, one cut at a time, one picture: a GpuTree, a GpuCut and a SampleSum. Move-only. Keeps handles to the
// context and to the tree's data.
class Renderer {
public:
    static Result<Renderer> create(const Context& context, const vdtree::VertexTree& tree);
    Renderer(Renderer&&) noexcept;
    Renderer& operator=(Renderer&&) noexcept;
    ~Renderer();

    // Draws off screen and reads back. Fails on an invalid view or lights, or when the GPU has too little memory, or on
    // a GL error.
    Result<Frame> draw(const vdtree::Cut& cut, const vdtree::View& view, const DrawOptions& options = {},
                       const vdtree::Similarity& placement = {});
    Result<Frame> draw(const vdtree::Geomorph& geomorph, const vdtree::View& view, const DrawOptions& options = {},
                       const vdtree::Similarity& placement = {});

    // Draws to the window's framebuffer, one sample a pixel with hardware multisampling if it has any, encoded as sRGB.
    Result<void> draw_to_window(const vdtree::Cut& cut, const vdtree::View& view, const DrawOptions& options = {},
                                const vdtree::Similarity& placement = {});
    Result<void> draw_to_window(const vdtree::Geomorph& geomorph, const vdtree::View& view,
                                const DrawOptions& options = {}, const vdtree::Similarity& placement = {});

    std::uint64_t uploaded_bytes() const noexcept; // by the last draw, as in GpuCut

private:
    struct Impl;
    explicit Renderer(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::render
