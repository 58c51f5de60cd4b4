// Trees and cuts on the GPU, and drawing them into a target.
#pragma once

#include <cstdint>
#include <string>

#include <glm/vec2.hpp>

#include <unseen/render/target.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/geomorph.h>
#include <unseen/vdtree/lighting.h>
#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::render {

class Shadows;

// The vertices of a tree on the GPU, 28 bytes each, and its texture, filtered trilinearly in linear light and multiplied
// with the colours. Any number of cuts share it. The first draw with lights adds 8 bytes a vertex. Keeps handles to the
// context and to the tree's data. Copies are handles to the same object.
class GpuTree {
public:
    // Fails if graphics memory runs out, and on textures beyond this GL's limits.
    static Result<GpuTree> create(const Context& context, const vdtree::VertexTree& tree);

    const vdtree::VertexTree& tree() const noexcept;
    const Context& context() const noexcept;

    struct Impl; // the library's own
    Impl& impl() const noexcept { return *impl_; }

private:
    explicit GpuTree(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

// The triangles of a cut on the GPU: 12 bytes each, and as much again and 4 bytes a leaf of the tree once the cut is
// followed. They change only in follow(). Copies are handles to the same object.
class GpuCut {
public:
    explicit GpuCut(const GpuTree& tree); // without triangles; keeps a handle to the tree

    // Takes over the cut's triangles. Uploads nothing if the cut has not changed. If a few folds and unfolds are all that
    // has changed since the last follow(), some 50 bytes each are uploaded, and the GPU makes the index buffer. Otherwise,
    // and in software, all of the cut's indices are. Fails on the cut of another tree, and if memory runs out; then there
    // are no triangles.
    Result<void> follow(const vdtree::Cut& cut);

    // The drawn cut of a geomorph, with its gliding vertices in place: 32 bytes for each of them, and for each that glided
    // before. Other cuts of the tree are not affected, but if such cuts take turns, every turn uploads the vertices. Fails
    // on textured trees, whose texture would not glide.
    Result<void> follow(const vdtree::Geomorph& geomorph);

    const GpuTree& tree() const noexcept;
    std::uint64_t uploaded_bytes() const noexcept; // by the last follow() and by draws since
    // Why even few changes upload all indices, as where graphics memory is short; empty: they do not.
    const std::string& why_whole() const noexcept;

    struct Impl; // the library's own
    Impl& impl() const noexcept { return *impl_; }

private:
    std::shared_ptr<Impl> impl_;
};

constexpr float default_background = 0.19597990f; // relative luminance; 20 cd/m2 on the default display

enum class Shading {
    smooth, // the vertices' luminance, interpolated linearly
    flat,   // one luminance a triangle: the mean of its corners
};

// One object of a scene.
struct Item {
    GpuCut cut;
    vdtree::Similarity placement = {};
    Shading shading = Shading::smooth;
    bool wireframe = false; // the triangles' edges over the shaded surface, hidden lines removed
    // In the tree's frame; default: the tree's own luminances. Not for cuts with gliding vertices.
    std::optional<vdtree::Lighting> lighting = {};
    // For fading from one cut to another: only pixels from x up to, but not including, y are drawn, where each pixel of a
    // 4x4 pattern has its own value in 0..1. Items with {0, a} and {a, 1} share the pixels. Depth-only passes ignore it.
    glm::vec2 stipple = {0, 1};
};

// A part of a camera's window, and the place of its top left in the target. So one target holds many small pictures side
// by side, which are read back together.
struct Tile {
    PixelBox part;
    int left = 0, top = 0; // pixels of the target
};

struct Camera {
    vdtree::View view;                  // its window has the target's size, unless a tile is drawn
    glm::dvec2 point = glm::dvec2(0.5); // the sample's place in each pixel, from its top left
    // Distance in world units; default: just before the items. Set it for draws that share depth. Perspective views only.
    std::optional<double> near_plane = {};
    const Shadows* shadows = nullptr; // as of their last update; must outlive the draw; null: no shadows
    // An attachment for the shadow mask, drawn in the same pass: the share of each shadow-casting light that reaches the
    // pixel, 0 to 1, first light in r. 1 for unlit items, missing lights, and the background. Its format is
    // ColourFormat::shares8 or floats, and it is not the colours' attachment. Default: no mask.
    std::optional<int> shadow_mask = {};
    // Draws and clears this tile only. For the library's own targets, without a shadow mask.
    std::optional<Tile> tile = {};
};

struct Clear {
    std::optional<glm::vec4> colour = glm::vec4(default_background); // linear RGB, luminance; nullopt: not cleared
    bool depth = true;
};

// Draws the items in order; nearer surfaces hide farther ones, across items. Items share the target's context. Programs
// are compiled when first needed. `attachment`: the colour attachment to draw to; without any, only depth is drawn. Fails
// on an invalid view, placement or light, and on a GL error.
Result<void> draw(std::span<const Item> items, const Camera& camera, Target& target, const Clear& clear = {},
                  int attachment = 0);

// The part of the view's window that items can appear in, with a margin for rounding; it may be empty. The whole window if
// an item may reach behind the eye.
Result<PixelBox> pixels_of(std::span<const Item> items, const vdtree::View& view);

// The near plane that draw() chooses. It clips nothing farther from the eye than 1e-4 of the size of an item around the
// eye. Perspective views only: orthographic ones show what is behind the eye, too.
Result<double> near_plane(std::span<const Item> items, const vdtree::View& view);

} // namespace unseen::render
