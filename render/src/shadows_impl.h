// What shadows hold, and what the surface's shader wants to know of them.
#pragma once

#include <unseen/render/shadows.h>

#include "gpu_tree_impl.h"

namespace unseen::render {

// In the world.
struct CastingLight {
    vdtree::LightSource::Kind kind = vdtree::LightSource::Kind::directional;
    glm::dvec3 direction = glm::dvec3(0, 0, 1); // as of vdtree::LightSource
    glm::dvec3 position = glm::dvec3(0);
    double outer_cosine = 0;
    bool operator==(const CastingLight&) const = default;
};

// The item's lights that cast shadows, in their order.
std::vector<CastingLight> casting_lights(const Item& item);

// For an item's draw: see surface.frag.
struct ShadowUniforms {
    std::vector<glm::mat4> layers;
    std::vector<glm::vec4> lights, kinds; // by light
    glm::mat4 world_from_unit = glm::mat4(1);
};

struct Shadows::Impl {
    Impl(const Context& context_, const std::optional<Ball>& bounds_, int size_)
        : context(context_), bounds(bounds_), size(size_), guard(context_) {}

    // What was drawn, which need not be drawn again.
    struct Caster {
        GpuCut cut;
        std::uint64_t changes = 0, glides = 0;
        vdtree::Similarity placement;
        bool is_same(const Caster& other) const;
    };
    // A part of a map, in coordinates from -1 to 1.
    struct Window {
        glm::dvec2 low = glm::dvec2(-1), high = glm::dvec2(1);
        bool is_empty() const { return !(low.x < high.x && low.y < high.y); }
        bool holds(const Window& other) const;
    };
    struct Layer {
        glm::dmat4 clip_from_ball = glm::dmat4(1); // places relative to the ball's centre
        Window window = {};                        // what is drawn of it
    };
    using Receivers = std::optional<std::span<const Item>>; // none: anything

    Result<void> update(std::span<const Item> casters, const Receivers& receivers);
    // Draws the maps of the last update's casters with their texels shifted by 0..1 texels; 0.5 as in update(). Needs a
    // current context.
    Result<void> shift_texels(glm::dvec2 by);
    Result<void> reserve(std::size_t layers);
    void aim();
    Window window_of(const Layer& layer, const Receivers& receivers) const;
    struct DepthPrograms {
        const Program* whole = nullptr;
        const Program* cut_out = nullptr; // null: nothing that is drawn has cut-outs
    };
    Result<DepthPrograms> programs() const;
    void draw(const DepthPrograms& programs);
    void draw_layer(const DepthPrograms& programs, std::size_t layer);

    // Fails where the item has other lights that cast shadows than these are of.
    Result<void> check(const Item& item) const;
    ShadowUniforms uniforms_of(const Item& item) const;
    void bind() const;

    Context context;            // first, and so gone last
    std::optional<Ball> bounds; // as in create()
    int size;                   // texels a side of a map
    Ball ball;
    double reach = 1; // its radius, or 1 where that is 0
    std::vector<CastingLight> lights;
    std::vector<int> first_layers; // by light
    std::vector<Layer> layers;
    std::vector<Caster> drawn;
    Texture2dArray maps;
    std::size_t map_count = 0; // layers of the texture
    FramebufferObject framebuffer;
    Timestamp begun, ended;
    std::uint64_t redraws = 0;
    glm::dvec2 shift = glm::dvec2(0); // of the maps' windows, in their coordinates
    ContextGuard guard;
};

} // namespace unseen::render
