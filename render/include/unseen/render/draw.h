// Draws items into a target.
#pragma once

#include <optional>
#include <span>

#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include <unseen/render/gpu_tree.h>
#include <unseen/render/target.h>
#include <unseen/vdtree/lighting.h>
#include <unseen/vdtree/view.h>

namespace unseen::render {

class Shadows; // see shadows.h

constexpr float default_background = 0.19597990f; // relative luminance; 20 cd/m2 on the default display

enum class Shading {
    smooth, // luminance by vertex, linearly interpolated (lit or pre-lit, as the tree's luminance is)
    flat,   // one luminance a triangle: the mean of its corners
};

// One object of a scene.
struct Item {
    GpuCut cut;
    vdtree::Similarity placement = {};
    Shading shading = Shading::smooth;
    bool wireframe = false; // the triangles' edges over the shaded surface, hidden lines removed
    // In the tree's frame; none: the luminance of vertices is the tree's. Not for cuts with vertices that glide.
    std::optional<vdtree::Lighting> lighting = {};
    // For fading from one cut to another: each pixel of a pattern of 4x4 has a value of its own in 0..1, and only those
    // from x to below y are drawn. Items with {0, a} and {a, 1} share the pixels. Depth alone is drawn everywhere.
    glm::vec2 stipple = {0, 1};
};

// A part of a camera's window, and where in the target its top left comes to lie. So a target of any size holds many
// small pictures side by side, which come back together.
struct Tile {
    PixelBox part;
    int left = 0, top = 0; // pixels of the target
};

struct Camera {
    vdtree::View view;                  // its window is as large as the target, unless a tile is drawn
    glm::dvec2 point = glm::dvec2(0.5); // of each pixel, from its top left, that is drawn
    // Distance, world units; none: just before the items. One for draws that share depth; of perspective views alone.
    std::optional<double> near_plane = {};
    // Of the lights that cast some, as of their last update; null: none are drawn. They outlive the draw.
    const Shadows* shadows = nullptr;
    // The attachment that how much of each casting light comes to a pixel is drawn to, in the same pass: 0 to 1, the
    // first light in r, and so on; 1 of what is not lit, of lights that there are not, and where no item is. It is of
    // ColourFormat::shares8 or in floats, and not the attachment of the colours. None: it is not drawn.
    std::optional<int> shadow_mask = {};
    // Nothing but this is drawn and cleared: of the library's own targets, without a mask of shadows.
    std::optional<Tile> tile = {};
};

// What a draw begins with.
struct Clear {
    std::optional<glm::vec4> colour = glm::vec4(default_background); // linear RGB, luminance; none: kept
    bool depth = true;
};

// Draws the items in their order, in perspective or in parallel; what is nearer hides what is farther, across items.
// Items share the target's context. Programs are compiled when they are first needed. `attachment`: the colour that is
// drawn to, others are kept; without any, only depth is drawn. Fails on an invalid view, placement or light, and on a GL
// error.
Result<void> draw(std::span<const Item> items, const Camera& camera, Target& target, const Clear& clear = {},
                  int attachment = 0);

// The part of the view's window that items can show in, with a margin for rounding; of no width or height: none. All of
// it where a part of an item may lie behind the eye.
Result<PixelBox> pixels_of(std::span<const Item> items, const vdtree::View& view);

// The near plane that draw() chooses. It cuts off nothing but what is nearer to the eye than 1e-4 of the size of an
// item around the eye. Of perspective views alone: orthographic ones show what is behind the eye, too.
Result<double> near_plane(std::span<const Item> items, const vdtree::View& view);

} // namespace unseen::render
