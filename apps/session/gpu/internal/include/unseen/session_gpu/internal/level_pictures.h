// Pictures of a scene's objects at discrete levels of detail.
#pragma once

#include <unseen/render/renderer.h>
#include <unseen/session/internal/selection_search.h>
#include <unseen/session/session.h>

namespace unseen::session {

// Levels of an object of the session, each with half of the triangles of the one before, as in the paper. Small objects
// have fewer. `levels`: 2 to most_levels.
Result<LevelChain> selection_chain(Session& session, std::size_t object, int levels = default_selected_levels);

// Move-only. Shares the session and the context, on whose thread it is used. Shadows are not drawn: whose they are
// changes with the levels of others.
class LevelPictures {
public:
    struct Times {
        double draw_ms = 0, read_ms = 0; // of all pictures so far; reading waits for the GPU
        std::uint64_t drawings = 0, triangles = 0;
    };

    // Makes the levels of all objects with selection_chain() and uploads them: some seconds a million triangles.
    static Result<LevelPictures> create(const render::Context& context, Session& session,
                                        int levels = default_selected_levels);
    LevelPictures(LevelPictures&&) noexcept = default;
    LevelPictures& operator=(LevelPictures&&) noexcept = default;

    // The objects in the view's window, with one sample in the middle of each pixel. Objects that no level shows are
    // left out. Fails where drawing does.
    Result<LayeredPicture> draw(const vdtree::View& view, SelectionQuality quality);

    // A frame of these levels (by object; -1: not drawn), as SceneRenderer draws it but without shadows.
    Result<render::Frame> draw_frame(const vdtree::View& view, std::span<const int> levels, int samples = 1);

    // The value that the quality compares, from a pixel's relative luminance.
    float value_of(float luminance, SelectionQuality quality) const;

    const std::vector<std::vector<std::uint32_t>>& triangles() const noexcept; // by object, by level
    const LevelChain& chain(std::size_t object) const noexcept;
    const Times& times() const noexcept;

private:
    struct Impl;
    explicit LevelPictures(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::session
