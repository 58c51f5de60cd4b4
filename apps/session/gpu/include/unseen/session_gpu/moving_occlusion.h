// Folds what a moving view hides, by pictures of depth of the frames before.
#pragma once

#include <cstddef>
#include <memory>

#include <unseen/render/context.h>
#include <unseen/session/hidden_nodes.h>
#include <unseen/session/simplification.h>
#include <unseen/session_gpu/scene_renderer.h>

namespace unseen::session {

struct MovingOcclusionOptions {
    // Where it saves time: it is tried now and then, and goes on where frames get shorter by that. What cuts are then
    // depends on the machine's speed.
    enum class Use { always, where_it_saves_time };
    Use use = Use::always;
    // For pictures begun with the last frame, so that cuts do not depend on the machine's speed. Else they come some
    // frames late, and what they hide is found on a thread of its own.
    bool waits = true;
    int samples = 1; // of each pixel, where depth is drawn for this; what all of them miss may be hidden. 1 to 256
    int cell_px = 4; // depths are kept in cells of so many by so many pixels, 1 to 64
    int frames = 2;  // a picture serves so many, as fast as the eye went last. 1 or more
};

// One picture serves eyes within a reach of it, and the next one is due when half of that is used up, or the view has
// turned. So a view that stands still has no more of them. Refers to the session and the context; move-only.
//
//     request.hidden = *occlusion->begin_frame(view);
//     follower.follow(view, request);
//     renderer.draw(cuts, view, ...);
//     occlusion->end_frame(*renderer.drawn_depth(), view, frame_ms);
class MovingOcclusion {
public:
    // Fails where options are out of their ranges.
    static Result<MovingOcclusion> create(const render::Context& context, const Session& session,
                                          const MovingOcclusionOptions& options = {});
    MovingOcclusion(MovingOcclusion&&) noexcept;
    MovingOcclusion& operator=(MovingOcclusion&&) noexcept;
    ~MovingOcclusion();

    // What is known to be hidden from the frame's eye; null: nothing is. Trees must be those of Session::prepare() by now.
    Result<std::shared_ptr<const HiddenNodes>> begin_frame(const vdtree::View& view);

    // What the frame showed, and how long all of it took, from begin_frame() on. Begins a picture where one is due: of the
    // depth that the frame's own draw has left, or of one that it draws.
    Result<void> end_frame(const render::DrawnDepth& shown, const vdtree::View& view, double frame_ms);
    Result<void> end_frame(const SceneItems& shown, const vdtree::View& view, double frame_ms);

    struct Facts {
        bool is_on = false; // as of the last frame
        std::size_t frames = 0, frames_on = 0, pictures = 0, tries = 0;
        std::size_t drawings = 0;           // of depth, where no frame had left any
        double milliseconds = 0;            // of wall-clock time for all pictures, and what they hide
        double with_ms = 0, without_ms = 0; // the median frame's as last tried; NaN: not known
        std::size_t objects = 0;            // of which something is hidden, by the last picture
        std::uint64_t bytes = 0;            // on the GPU
    };
    Facts facts() const;
    PassEffect effect() const; // the same in a sentence; costs are of a frame, on the average

private:
    struct Impl;
    explicit MovingOcclusion(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::session
