// Pictures of a scene in layers of depth: what all but one of them show together, on the GPU alone. For judging what a
// layer's objects may leave out where the others mask it (Drettakis and others 2007).
//
//     auto passes = render::LayerPasses::create(context, view.width, view.height);
//     const auto split = render::split_into_layers(centres, view);
//     passes->draw(objects, background, {.view = view}, *split);
//     for (int i = 0; i < passes->combination_count(); ++i)
//         passes->combine(i); // then passes->combination() is what all layers but i show
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include <unseen/render/draw.h>
#include <unseen/render/target.h>
#include <unseen/vdtree/view.h>

namespace unseen::render {

constexpr int most_layers = 16;
constexpr int default_layers = 5;

// Which layer each object is in.
struct LayerSplit {
    std::vector<int> layer_of = {};   // by object: from 0, the nearest, to count - 1; all 0 where there are no layers
    int count = 0;                    // of layers that hold objects; 0: all objects are in one, and nothing is split
    std::vector<double> borders = {}; // between neighbours, world units along the view's axis; count - 1, ascending
};

// Parts objects by where their centres are along the view's axis. Planes stand at equal factors of distance between
// the nearest and the farthest centre before the eye; layers that would hold nothing are left out, so there may be
// fewer than `layers`, 1 to most_layers. What is behind the eye is in the first. Fails on another number of layers, on
// an invalid view, and on a centre that is not finite.
Result<LayerSplit> split_into_layers(std::span<const glm::dvec3> centres, const vdtree::View& view,
                                     int layers = default_layers);

struct LayerOptions {
    int most = default_layers;                   // layers; 1 to most_layers
    ColourFormat format = ColourFormat::rgba32f; // of pictures; or rgba16f
    int block = 1;                               // a combination's pixel is the mean of so many by so many, 1 to 16
};

// What was done since the last draw() began, and what is kept.
struct LayerCounts {
    int surface_passes = 0;     // of items: a layer's, the background's, the whole scene's, or a mask's
    int mask_passes = 0;        // of these, masks of shadows
    int full_screen_passes = 0; // combinations and composites
    int textures = 0;
    std::uint64_t texture_bytes = 0;
};

// Move-only. Keeps a handle to its context. Nothing is read back, and nothing waits for the GPU.
//
// Memory, in bytes a pixel, with 32-bit floats (16-bit ones): 20 (12) for each of `most` layers and for the background,
// made when a picture is first split, 20 (12) for the composite and 16 (8) for the combination; 20 (12) for the mask of
// shadows, made when a combination first has one.
class LayerPasses {
public:
    // Fails on options out of range, on sizes as Target::create() does, and when memory runs out.
    static Result<LayerPasses> create(const Context& context, int width, int height, const LayerOptions& options = {});
    LayerPasses(LayerPasses&&) noexcept;
    LayerPasses& operator=(LayerPasses&&) noexcept;
    ~LayerPasses();

    // Draws each layer, the background apart, and puts all together by their depths. Where the split has no layers, all
    // is drawn at once. `split`: of these objects. `clear`: linear RGB and luminance where nothing is. Fails as draw()
    // of <unseen/render/draw.h> does, on a split of other objects, and on one into more layers than the options say.
    Result<void> draw(std::span<const Item> objects, std::span<const Item> background, const Camera& camera,
                      const LayerSplit& split, const glm::vec4& clear = glm::vec4(default_background));

    // Of the last draw(): the layers, or 1 where there are objects and no layers, or 0.
    int combination_count() const noexcept;
    // What all but one layer show: of objects that are in no layers the background. 0 to combination_count() - 1.
    // `cast_by_others`: the shadows without those of the layer's own objects, or null. Where the picture shows the
    // layer's surfaces, what is behind them is multiplied by the share of their light that these shadows leave them: a
    // shadow masks what it falls on, and no object masks itself. One more pass over the layer's objects, in which the
    // layer's colours cannot be drawn: they have all shadows.
    Result<void> combine(int left_out, const Shadows* cast_by_others = nullptr);

    const Target& composite() const noexcept;   // all layers: the picture
    const Target& combination() const noexcept; // of the last combine()
    const Target* mask() const noexcept;        // of the last combine(): the share, in all channels; null: it had none
    double near_plane() const noexcept;         // of the last draw(), for passes that share its depths

    // Of the last draw() into layers; null where there was none.
    const Target* layer(int number) const noexcept;
    const Target* background() const noexcept;
    // Two-dimensional arrays: slice 0 is the background, 1 + i is layer i. 0 where there is none.
    unsigned colour_array() const noexcept;
    unsigned depth_array() const noexcept;

    LayerCounts counts() const noexcept;

private:
    struct Impl;
    explicit LayerPasses(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::render
