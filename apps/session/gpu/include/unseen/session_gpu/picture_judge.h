// Judges pictures of a session's view against the full model's: by both judges on the CPU, and SSIM.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <unseen/perception/judge.h>
#include <unseen/session/session.h>
#include <unseen/session_gpu/scene_renderer.h>

namespace unseen::session {

struct PictureVerdict {
    std::uint64_t visible = 0, second_visible = 0; // pixels, by the judge and by second_judge_options()
    double v = 0, second_v = 0;                    // the largest difference, in thresholds
    double ssim = 1;                               // of code values; NaN: the window is too small for it

    bool shows_nothing() const { return visible == 0 && second_visible == 0 && v < 1 && second_v < 1; }
};

// Refers to the session. Move-only.
class PictureJudge {
public:
    // Draws the full model, with so many samples a pixel. The judges are of the session's observer and gaze.
    static Result<PictureJudge> create(const render::Context& context, const Session& session, const vdtree::View& view,
                                       int samples);
    // By a renderer of that session, which several may share: its trees are uploaded once for all views.
    static Result<PictureJudge> create(std::shared_ptr<SceneRenderer> renderer, const Session& session,
                                       const vdtree::View& view, int samples);

    // Others' cuts or frames of the same view and window. The judges work side by side.
    Result<PictureVerdict> judge(std::span<const vdtree::Cut> cuts);
    Result<PictureVerdict> judge(const render::Frame& frame) const;

    const perception::Image& full() const { return full_; } // luminance, cd/m2
    SceneRenderer& renderer() { return *renderer_; }
    render::DrawOptions drawing() const; // what judged pictures are drawn with

private:
    PictureJudge(const Session& session, const vdtree::View& view, int samples,
                 std::shared_ptr<SceneRenderer> renderer);

    const Session* session_;
    vdtree::View view_;
    int samples_;
    std::shared_ptr<SceneRenderer> renderer_;
    perception::Image full_ = {}, full_codes_ = {};
    std::unique_ptr<perception::Judge> judge_ = {}, second_ = {};
};

std::vector<vdtree::Cut> whole_cuts(const Session& session); // the full model, by object

} // namespace unseen::session
