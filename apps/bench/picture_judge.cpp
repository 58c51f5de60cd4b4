#include "picture_judge.h"

#include <limits>
#include <utility>

#include <unseen/session_gpu/frame_image.h>

namespace unseen::app {

std::vector<vdtree::Cut> whole_cuts(const session::Session& session) {
    std::vector<vdtree::Cut> whole;
    for (std::size_t i = 0; i < session.scene().objects.size(); ++i) whole.emplace_back(session.tree(i)).unfold_all();
    return whole;
}

PictureJudge::PictureJudge(const session::Session& session, const vdtree::View& view, int samples,
                           session::SceneRenderer renderer)
    : session_(&session), view_(view), samples_(samples),
      renderer_(std::make_unique<session::SceneRenderer>(std::move(renderer))) {}

render::DrawOptions PictureJudge::drawing() const {
    render::DrawOptions drawing;
    drawing.samples = samples_;
    drawing.background = session_->background();
    return drawing;
}

Result<PictureJudge> PictureJudge::create(const render::Context& context, const session::Session& session,
                                          const vdtree::View& view, int samples) {
    auto renderer = session::SceneRenderer::create(context, session);
    if (!renderer) return renderer.error();
    PictureJudge made(session, view, samples, std::move(*renderer));
    const auto whole = whole_cuts(session);
    const auto frame = made.renderer_->draw(session::drawn_cuts(whole), view, made.drawing());
    if (!frame) return frame.error();
    const session::Observer& observer = session.observer();
    made.full_ = session::luminance_image(*frame, observer.display);
    made.full_codes_ = session::code_image(*frame, observer.display);
    std::optional<glm::dvec2> gaze;
    if (observer.gaze) gaze = observer.gaze->px;
    auto judge = perception::Judge::create(made.full_, session::judge_options(observer));
    auto second = perception::Judge::create(made.full_,
                                            perception::second_judge_options(observer.person, observer.display, gaze));
    if (!judge) return judge.error();
    if (!second) return second.error();
    made.judge_ = std::make_unique<perception::Judge>(std::move(*judge));
    made.second_ = std::make_unique<perception::Judge>(std::move(*second));
    return made;
}

Result<PictureVerdict> PictureJudge::judge(std::span<const vdtree::Cut> cuts) {
    const auto frame = renderer_->draw(session::drawn_cuts(cuts), view_, drawing());
    if (!frame) return frame.error();
    return judge(*frame);
}

Result<PictureVerdict> PictureJudge::judge(const render::Frame& frame) const {
    const perception::Display& display = session_->observer().display;
    const perception::Image luminance = session::luminance_image(frame, display);
    const auto verdict = judge_->judge(luminance), second = second_->judge(luminance);
    if (!verdict) return verdict.error();
    if (!second) return second.error();
    const auto similarity = perception::ssim(full_codes_, session::code_image(frame, display));
    return PictureVerdict{.visible = verdict->visible_pixels,
                          .second_visible = second->visible_pixels,
                          .v = verdict->max_ratio,
                          .second_v = second->max_ratio,
                          .ssim = similarity ? *similarity : std::numeric_limits<double>::quiet_NaN()};
}

} // namespace unseen::app
