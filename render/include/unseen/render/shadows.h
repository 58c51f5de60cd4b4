// Shadows: what the lights of a scene see, as maps of depth, and how much of each light comes where.
//
//     auto shadows = render::Shadows::create(context);
//     shadows->update(items);                                         // before the eye's draws
//     render::draw(items, {.view = view, .shadows = &*shadows}, target);
//
// A directional light, or a spot of up to 60 degrees from its axis, has one map; another spot or a point light has six.
// Maps are fitted to the ball around the scene, not to what the eye sees: their texels stand still in the world when the
// eye moves, and so do the shadows' edges, which are three texels wide. Where no light casts a shadow, nothing is made
// and nothing is drawn.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include <unseen/render/draw.h>

namespace unseen::render {

struct Ball {
    glm::dvec3 centre = glm::dvec3(0); // in the world
    double radius = 0;
};

// Around all vertices that any cut of the items can have.
Ball ball_around(std::span<const Item> items);

struct ShadowOptions {
    int size = 2048; // texels a side of a map, 16 or more
    // What the maps reach over; default: the ball around the casters of each update. Give one where not all items are
    // casters at all times, for the texels lie otherwise when it changes.
    std::optional<Ball> bounds = {};
};

// As of the last update.
struct ShadowFacts {
    int lights = 0, maps = 0;  // that cast shadows; layers
    int size = 0;              // texels a side
    std::uint64_t bytes = 0;   // on the GPU
    std::uint64_t redraws = 0; // of all maps, since they were made; those of single samples do not count
    double draw_ms = 0;        // of the last one, on the GPU
};

// Move-only. Keeps a handle to its context, and to the cuts that it has drawn.
class Shadows {
public:
    // Makes nothing on the GPU. Fails on a size below 16 or above what this GL can draw to.
    static Result<Shadows> create(const Context& context, const ShadowOptions& options = {});
    Shadows(Shadows&&) noexcept;
    Shadows& operator=(Shadows&&) noexcept;
    ~Shadows();

    // Draws the maps where the casters, their cuts or the lights are others than before; else does nothing. The lights
    // are those of the items' lighting, which must be the same in the world for all that are lit. Fails where they are
    // not, where draw() does, and where memory runs out.
    //
    // `receivers`: the items that will be drawn with these shadows until the next update; default: any. The maps are drawn
    // only where the receivers lie, which costs less. Other items would have wrong shadows.
    Result<void> update(std::span<const Item> casters,
                        const std::optional<std::span<const Item>>& receivers = std::nullopt);

    ShadowFacts facts() const;           // waits for the GPU
    ShadowFacts counts() const noexcept; // the same without draw_ms; waits for nothing

    struct Impl; // the library's own
    Impl& impl() const noexcept { return *impl_; }

private:
    explicit Shadows(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::render
