// Pictures of a scene in layers of depth, and combinations of all layers but one, on the GPU alone. For judging a layer's
// objects by what the other layers mask (Drettakis and others 2007).
//
//     auto passes = render::LayerPasses::create(context, view.width, view.height);
//     const auto split = render::split_into_layers(centres, view);
//     passes->draw(objects, background, {.view = view}, *split);
//     for (int i = 0; i < passes->combination_count(); ++i)
//         passes->combine(i); // then passes->combination() shows all layers but i
#pragma once

#include <unseen/render/draw.h>

namespace unseen::render {

constexpr int most_layers = 16;
constexpr int default_layers = 5;

// Which layer each object is in.
struct LayerSplit {
    std::vector<int> layer_of = {};   // by object: from 0, the nearest, to count - 1; all 0 without layers
    int count = 0;                    // layers that hold objects; 0: all objects are in one layer, and nothing is split
    std::vector<double> borders = {}; // between neighbours, world units along the view's axis; count - 1, ascending
};

// Divides objects by their centres along the view's axis. Borders stand at equal factors of distance between the nearest
// and the farthest centre in front of the eye; empty layers are left out, so there may be fewer than `layers`, 1 to
// most_layers. Objects behind the eye are in the first layer. Fails on another number of layers, an invalid view, and a
// centre that is not finite.
Result<LayerSplit> split_into_layers(std::span<const glm::dvec3> centres, const vdtree::View& view,
                                     int layers = default_layers);

// Work since the last draw() began, and memory.
struct LayerCounts {
    int surface_passes = 0;     // of items: a layer's, the background's, the whole scene's, or a mask's
    int mask_passes = 0;        // of these, masks of shadows
    int full_screen_passes = 0; // combinations and composites
    int textures = 0;
    std::uint64_t texture_bytes = 0;
};

// Move-only. Keeps a handle to its context. Nothing is read back, and nothing waits for the GPU.
//
// Memory, in bytes a pixel: 20 for each of `most` layers and for the background, made when a picture is first split, 20
// for the composite and 16 for the combination; 20 for the mask of shadows, made when a combination first has one.
class LayerPasses {
public:
    // For at most so many layers. Fails on other numbers than 1 to most_layers, on sizes as Target::create() does, and
    // when memory runs out.
    static Result<LayerPasses> create(const Context& context, int width, int height, int most = default_layers);
    LayerPasses(LayerPasses&&) noexcept = default;
    LayerPasses& operator=(LayerPasses&&) noexcept = default;

    // Draws each layer and the background separately, and composes them by depth. Without layers, draws everything at once.
    // `split`: of these objects. `clear`: linear RGB and luminance of empty pixels. Fails like draw() of
    // <unseen/render/draw.h>, on a split of other objects, and on more layers than create() was told of.
    Result<void> draw(std::span<const Item> objects, std::span<const Item> background, const Camera& camera,
                      const LayerSplit& split, const glm::vec4& clear = glm::vec4(default_background));

    // The number of layers in the last draw(); 1 if there were objects but no layers; 0 without objects.
    int combination_count() const noexcept;
    // Draws all layers but one, 0 to combination_count() - 1; without layers, the background.
    // `cast_by_others`: the shadows without those of the layer's own objects, or null. They multiply what is behind the
    // layer's visible surfaces by the share of light that they leave these: a shadow masks what it falls on, and no object
    // masks itself. Costs one more pass over the layer's objects.
    Result<void> combine(int left_out, const Shadows* cast_by_others = nullptr);

    const Target& composite() const noexcept;   // the picture of all layers
    const Target& combination() const noexcept; // of the last combine()
    const Target* mask() const noexcept; // of the last combine(): the share, in all channels; null without shadows
    double near_plane() const noexcept;  // of the last draw(), for passes that share its depths

    LayerCounts counts() const noexcept;

private:
    struct Impl;
    explicit LayerPasses(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::render
