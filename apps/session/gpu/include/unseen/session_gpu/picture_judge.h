// Judges pictures of a view against the picture of the full model: by both judges on the CPU, and by SSIM.
#pragma once

#include <unseen/session_gpu/scene_renderer.h>

namespace unseen::session {

struct PictureVerdict {
    std::uint64_t visible_pixels = 0, second_visible_pixels = 0; // by the judge and by second_judge_options()
    double v = 0, second_v = 0;                                  // the largest difference, in thresholds
    double ssim = 1;                                             // of code values; NaN: the window is too small for it

    bool shows_nothing() const { return visible_pixels == 0 && second_visible_pixels == 0 && v < 1 && second_v < 1; }
};

// Shares the session. Move-only.
class PictureJudge {
public:
    // Draws the full model with `samples` a pixel. The judges see as the session's observer does, with its gaze.
    static Result<PictureJudge> create(const render::Context& context, const Session& session, const vdtree::View& view,
                                       int samples);
    // With a renderer of that session, which several judges may share.
    static Result<PictureJudge> create(std::shared_ptr<SceneRenderer> renderer, const Session& session,
                                       const vdtree::View& view, int samples);

    // Cuts or frames of the same view and window. Both judges work at the same time.
    Result<PictureVerdict> judge(std::span<const vdtree::Cut> cuts);
    Result<PictureVerdict> judge(const render::Frame& frame) const;

    const perception::Image& full() const { return full_; }             // see light_image()
    const perception::Image& full_codes() const { return full_codes_; } // code values
    SceneRenderer& renderer() { return *renderer_; }
    render::DrawOptions drawing() const; // what judged pictures are drawn with

private:
    PictureJudge(const Session& session, const vdtree::View& view, int samples,
                 std::shared_ptr<SceneRenderer> renderer);

    Session session_;
    vdtree::View view_;
    int samples_;
    std::shared_ptr<SceneRenderer> renderer_;
    perception::Image full_ = {}, full_codes_ = {};
    std::unique_ptr<perception::Judge> judge_ = {}, second_ = {};
};

} // namespace unseen::session
