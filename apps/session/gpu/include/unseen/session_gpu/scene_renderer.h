// Draws all objects of a session, and what stands around them.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <unseen/render/renderer.h>
#include <unseen/render/shadows.h>
#include <unseen/session/session.h>

namespace unseen::session {

// A cut an object, and the geomorph that is drawn instead, or null.
struct DrawnCut {
    const vdtree::Cut* cut = nullptr;
    const vdtree::Geomorph* geomorph = nullptr;
};
std::vector<DrawnCut> drawn_cuts(std::span<const vdtree::Cut> cuts);
std::vector<DrawnCut> drawn_cuts(const Follower& follower, std::size_t objects);

// What there is to draw.
struct SceneItems {
    std::vector<render::Item>
        items; // objects, but for those without triangles where there are several, then the backdrop
    std::vector<std::size_t> objects;   // by item, of the first ones: which object it is
    render::Shadows* shadows = nullptr; // the renderer's own, as of these items; null: no light casts any
};

// Trees are on the GPU once, however many objects share them. A scene of one object is drawn as render::Renderer does,
// to the bit. Move-only; refers to the session, whose trees must be those that it has when this is made (see
// Session::prepare()).
class SceneRenderer {
public:
    static Result<SceneRenderer> create(const render::Context& context, const Session& session);
    SceneRenderer(SceneRenderer&&) noexcept;
    SceneRenderer& operator=(SceneRenderer&&) noexcept;
    ~SceneRenderer();

    // `cuts`: by object. Of the options the lighting does not count: the session says how each object is lit.
    Result<render::Frame> draw(std::span<const DrawnCut> cuts, const vdtree::View& view,
                               const render::DrawOptions& options);
    Result<void> draw_to_window(std::span<const DrawnCut> cuts, const vdtree::View& view,
                                const render::DrawOptions& options);

    // For passes of others, until the next call: what draw() draws. `view`: for lights that go with the camera.
    Result<SceneItems> items(std::span<const DrawnCut> cuts, const vdtree::View& view,
                             const render::DrawOptions& options = {});

    std::uint64_t uploaded_bytes() const noexcept; // of objects, by the last draw

    // Of the last draw; nothing where no light casts shadows. Waits for the GPU.
    std::optional<render::ShadowFacts> shadows() const;

private:
    struct Impl;
    explicit SceneRenderer(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::session
