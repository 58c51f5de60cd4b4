// Draws cuts of a vertex tree: linear colour and luminance in float, antialiased by N-rooks samples.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <render/context.h>
#include <vdtree/cut.h>
#include <vdtree/geomorph.h>
#include <vdtree/lighting.h>
#include <vdtree/view.h>

namespace unseen::render {

enum class Shading {
    smooth, // luminance by vertex, linearly interpolated (lit or pre-lit, as the tree's luminance is)
    flat,   // one luminance a triangle: the mean of its corners
};

struct DrawOptions {
    Shading shading = Shading::smooth;
    bool wireframe = false;               // the triangles' edges over the shaded surface, hidden lines removed
    int samples = 16;                     // N-rooks samples a pixel, 1..256
    std::uint32_t seed = 1;               // of the sample pattern: equal for images that are compared
    float background = 0.19597990f;       // relative luminance; 20 cd/m2 on the default display
    // Lights the vertices, in the tree's frame; none: their luminance is the tree's. Not with geomorphs. What it needs on the GPU, 8
    // bytes a vertex, is made when it is first given.
    std::optional<vdtree::Lighting> lighting = {};
};

// A drawn frame. Row-major from the top left.
struct Frame {
    int width = 0;
    int height = 0;
    std::vector<float> luminance;  // relative, linear, 0..1, background included
    std::vector<float> colour;     // linear RGB, three values a pixel
    double draw_ms = 0;            // drawing of all samples and reading back, wall clock
};

// Keeps the tree's vertices on the GPU, and its texture if it has one: filtered trilinearly in linear light, and multiplied
// with the colours. Keeps handles of its own to the context and to the tree's data: the objects given may go first.
class Renderer {
public:
    static Result<Renderer> create(Context& context, const vdtree::VertexTree& tree);
    Renderer(Renderer&&) noexcept;
    Renderer& operator=(Renderer&&) noexcept;
    ~Renderer();

    // Draws off screen and reads back. Fails on an invalid view or lights, or when the GPU has too little memory, or on a GL
    // error.
    Result<Frame> draw(const vdtree::Cut& cut, const vdtree::View& view, const DrawOptions& options = {},
                       const vdtree::Similarity& placement = {});

    // Draws to the window's framebuffer, one sample a pixel with hardware multisampling if it has any, encoded as sRGB.
    Result<void> draw_to_window(const vdtree::Cut& cut, const vdtree::View& view, const DrawOptions& options = {},
                                const vdtree::Similarity& placement = {});

    // The same for what a geomorph draws: its drawn cut, with the vertices that glide where they are. What that needs on the GPU is made
    // when a vertex is first moved; before, and for cuts, nothing is.
    Result<Frame> draw(const vdtree::Geomorph& geomorph, const vdtree::View& view, const DrawOptions& options = {},
                       const vdtree::Similarity& placement = {});
    Result<void> draw_to_window(const vdtree::Geomorph& geomorph, const vdtree::View& view, const DrawOptions& options = {},
                                const vdtree::Similarity& placement = {});

    // By the last draw. Of the cut's triangles: nothing where the cut is as it was, 8 bytes a changed corner where the cut
    // knows what changed since then, else 12 bytes a triangle. Of vertices: 32 bytes for each that glides, or did in the draw before.
    std::uint64_t uploaded_bytes() const noexcept;

private:
    struct Impl;
    using Moved = std::span<const vdtree::MovedVertex>;
    Result<Frame> draw(const vdtree::Cut& cut, Moved moved, const vdtree::View& view, const DrawOptions& options,
                       const vdtree::Similarity& placement);
    Result<void> draw_to_window(const vdtree::Cut& cut, Moved moved, const vdtree::View& view, const DrawOptions& options,
                                const vdtree::Similarity& placement);
    explicit Renderer(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

// The N-rooks pattern: n points in the unit square, one in each of n rows and of n columns.
std::vector<glm::dvec2> n_rooks(int n, std::uint32_t seed);

} // namespace unseen::render
