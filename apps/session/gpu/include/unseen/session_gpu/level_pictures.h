// Pictures of a scene's objects, each alone at each of its levels of detail, for searches that put them together.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <unseen/render/context.h>
#include <unseen/render/renderer.h>
#include <unseen/session/level_chain.h>
#include <unseen/session/selection.h>
#include <unseen/session/session.h>

namespace unseen::session {

// So many levels of an object of the session, or fewer of small ones: each has half of the triangles of the one before,
// as the source has them. `levels`: 2 to most_levels.
Result<LevelChain> selection_chain(Session& session, std::size_t object, int levels = default_selected_levels);

struct LevelPictureTimes {
    double draw_ms = 0, read_ms = 0; // of all pictures so far; the GPU's work is waited for in reading
    std::uint64_t drawings = 0, triangles = 0;
};

// Move-only. Refers to the session, whose scene must not change; keeps a handle to the context, on whose thread it is
// used. Shadows are not drawn: whose they are changes with the levels of others.
class LevelPictures {
public:
    // Makes the levels of all objects, selection_chain(), and uploads them: some seconds a million triangles.
    static Result<LevelPictures> create(const render::Context& context, Session& session,
                                        int levels = default_selected_levels);
    LevelPictures(LevelPictures&&) noexcept;
    LevelPictures& operator=(LevelPictures&&) noexcept;
    ~LevelPictures();

    // Of the objects in the view's window, with one sample a pixel, in its middle. What all levels leave empty is no
    // entry. Fails as drawing does.
    Result<LayeredPicture> draw(const vdtree::View& view, SelectionQuality quality);

    // A frame of some levels (by object; -1: not drawn), as SceneRenderer draws it, but without shadows.
    Result<render::Frame> draw_frame(const vdtree::View& view, std::span<const int> levels, int samples = 1);

    // What the quality compares: of a pixel's relative luminance.
    float value_of(float luminance, SelectionQuality quality) const;

    const std::vector<std::vector<std::uint32_t>>& triangles() const noexcept; // by object, by level
    const LevelChain& chain(std::size_t object) const noexcept;
    const LevelPictureTimes& times() const noexcept;

private:
    struct Impl;
    explicit LevelPictures(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::session
