// Whether the changes of a flight's cut can be seen: what differs from frame to frame but is no motion of the camera.
#pragma once

#include <optional>

#include <unseen/perception/image.h>
#include <unseen/perception/internal/change.h>
#include <unseen/render/renderer.h>
#include <unseen/session/follower.h>
#include <unseen/session/session.h>

namespace unseen::app {

// What is seen of one frame's change, and of its picture.
struct FrameChange {
    perception::ChangeJudgement change;
    double picture = 0; // the largest V against the full model
};

// Judges frame by frame. The view moves, so the pictures of two frames differ anyway; what the cut's change did is the
// difference of two pictures of the same view, of the last frame's cut and of this one's.
//
// A flight also folds what nobody sees: outside of the window, on the far side, hidden. That comes into sight finer than
// it was, and nobody saw it as it was. So the pictures are those of a second cut, which follows by the same request but
// folds nothing for being out of sight. (Not under a budget, which would make another cut of it.) And an outline may
// turn into view for which the last cut was never meant: of each pixel's difference only as much counts as the two
// frames' own errors, against the full model, can make up, the last one's within the motion of the picture.
class FlightChanges {
public:
    // `glide_s`: how long the flight's vertices glide.
    static Result<FlightChanges> create(const session::Session& session, const render::Context& context,
                                        std::optional<double> glide_s);

    // To be called in each frame, once the session has its gaze and time: before the flight's cut follows, and after it
    // has been drawn.
    Result<void> before(const session::Follower& flight, const session::Request& request, const vdtree::View& view,
                        const render::DrawOptions& options);
    Result<FrameChange> after(const session::Follower& flight, const session::Request& request,
                              const vdtree::View& view, const render::DrawOptions& options, const render::Frame& frame,
                              double frame_s);

private:
    struct Renderers {
        render::Renderer full, cut;
    };
    FlightChanges(const session::Session& session, Renderers renderers);
    double picture_pixels(const vdtree::View& from, const vdtree::View& to) const;
    Result<perception::Image> draw_cut(const session::Follower& follower, const vdtree::View& view,
                                       const render::DrawOptions& options);

    const session::Session& session_;
    Renderers renderers_;
    vdtree::Cut full_cut_;
    session::Follower follower_; // of the second cut
    perception::ChangeWatch watch_;
    std::optional<perception::Image> last_cut_; // in the new view
    std::vector<float> last_error_;             // cd/m2: of the last frame's picture against the full model
    vdtree::View last_view_;
};

} // namespace unseen::app
