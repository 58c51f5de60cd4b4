// Shadow maps of a scene's lights.
//
//     auto shadows = render::Shadows::create(context);
//     shadows->update(items);                                         // before the eye's draws
//     render::draw(items, {.view = view, .shadows = &*shadows}, target);
//
// A directional light, or a spot of up to 60 degrees from its axis, has one map; wider spots and point lights have six. Maps
// are fitted to the ball around the scene, not to the eye's view: their texels stand still in the world when the eye
// moves, and so do the shadows' edges, which are three texels wide. Without shadow-casting lights this costs nothing.
#pragma once

#include <unseen/render/draw.h>

namespace unseen::render {

struct Ball {
    glm::dvec3 centre = glm::dvec3(0); // in the world
    double radius = 0;
};

// Around all vertices that any cut of the items can have.
Ball ball_around(std::span<const Item> items);

// State after the last update.
struct ShadowFacts {
    int lights = 0; // that cast shadows
    int maps = 0;
    int size = 0;              // texels a side
    std::uint64_t bytes = 0;   // on the GPU
    std::uint64_t redraws = 0; // of all maps since they were made, except those for single samples
    double draw_ms = 0;        // GPU time of the last one
};

// Move-only. Keeps a handle to its context, and to the cuts that it has drawn.
class Shadows {
public:
    // Makes nothing on the GPU. `bounds`: the ball that the maps cover; default: around the casters of each update. Set
    // it if not all items are casters at all times, because the texels shift when the ball changes. `size`: texels a side
    // of a map. Fails on a size below 16 or above what this GL can draw to.
    static Result<Shadows> create(const Context& context, const std::optional<Ball>& bounds = {}, int size = 2048);
    Shadows(Shadows&&) noexcept = default;
    Shadows& operator=(Shadows&&) noexcept = default;

    // Redraws the maps if the casters, their cuts or the lights have changed. The lights are those of the items' lighting,
    // which must be the same in the world for all lit items. Fails if they are not, like draw(), and if memory runs out.
    //
    // `receivers`: the only items that will be drawn with these shadows until the next update; default: any. The maps cover
    // only the receivers, which costs less; other items would have wrong shadows.
    Result<void> update(std::span<const Item> casters,
                        const std::optional<std::span<const Item>>& receivers = std::nullopt);

    ShadowFacts facts() const;           // waits for the GPU
    ShadowFacts counts() const noexcept; // the same without draw_ms; waits for nothing

    struct Impl; // the library's own
    Impl& impl() const noexcept { return *impl_; }

private:
    explicit Shadows(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::render
