// Draws all objects of a session and what surrounds them.
#pragma once

#include <unseen/render/renderer.h>
#include <unseen/render/shadows.h>
#include <unseen/session/session.h>

namespace unseen::session {

// The cut of an object, and the geomorph that is drawn instead, or null.
struct DrawnCut {
    const vdtree::Cut* cut = nullptr;
    const vdtree::Geomorph* geomorph = nullptr;
};
std::vector<DrawnCut> drawn_cuts(std::span<const vdtree::Cut> cuts);
std::vector<DrawnCut> drawn_cuts(const Follower& follower, std::size_t objects);

// The full model, by object.
std::vector<vdtree::Cut> whole_cuts(const Session& session);

struct SceneItems {
    // Objects, then the backdrop. Objects without triangles are left out if there are several objects.
    std::vector<render::Item> items;
    std::vector<std::size_t> objects;   // the object of each of the first items
    render::Shadows* shadows = nullptr; // owned by the renderer, up to date for these items; null if no light casts any
};

// Uploads each tree once, however many objects share it. Draws a scene of one object exactly as render::Renderer does.
// Move-only. Shares the session, whose trees must stay those that it has when the renderer is made: call
// Session::prepare() first.
class SceneRenderer {
public:
    static Result<SceneRenderer> create(const render::Context& context, const Session& session);
    SceneRenderer(SceneRenderer&&) noexcept = default;
    SceneRenderer& operator=(SceneRenderer&&) noexcept = default;

    // `cuts`: by object. The lighting of the options is ignored: the session knows how each object is lit. A view of two
    // eyes gives two pictures side by side, the left eye's on the left.
    Result<render::Frame> draw(std::span<const DrawnCut> cuts, const vdtree::View& view,
                               const render::DrawOptions& options);
    Result<void> draw_to_window(std::span<const DrawnCut> cuts, const vdtree::View& view,
                                const render::DrawOptions& options);

    // What draw() draws, for passes of your own. Valid until the next call. `view`: for lights that go with the camera.
    Result<SceneItems> items(std::span<const DrawnCut> cuts, const vdtree::View& view,
                             const render::DrawOptions& options = {});

    std::uint64_t uploaded_bytes() const noexcept; // of objects, by the last draw
    std::string why_whole() const;                 // see GpuCut::why_whole(), of the first object that has one

    // Facts of the last draw; empty if no light casts shadows. Waits for the GPU.
    std::optional<render::ShadowFacts> shadows() const;

private:
    struct Impl;
    explicit SceneRenderer(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

// A frame's colours as code values for the display.
perception::Image code_image(const render::Frame& frame, const perception::Display& display);
// What the display makes of a frame, in cd/m2: its luminance; and the light that judges see, which is linear RGB unless
// all of the frame is grey.
perception::Image luminance_image(const render::Frame& frame, const perception::Display& display);
perception::Image light_image(const render::Frame& frame, const perception::Display& display);

} // namespace unseen::session
