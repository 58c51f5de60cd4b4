#include <unseen/session_gpu/picture_judge.h>

#include <future>

namespace unseen::session {

PictureJudge::PictureJudge(const Session& session, const vdtree::View& view, int samples,
                           std::shared_ptr<SceneRenderer> renderer)
    : session_(session.share()), view_(view), samples_(samples), renderer_(std::move(renderer)) {}

render::DrawOptions PictureJudge::drawing() const { return {.samples = samples_, .background = session_.background()}; }

Result<PictureJudge> PictureJudge::create(const render::Context& context, const Session& session,
                                          const vdtree::View& view, int samples) {
    auto renderer = SceneRenderer::create(context, session);
    if (!renderer) return renderer.error();
    return create(std::make_shared<SceneRenderer>(std::move(*renderer)), session, view, samples);
}

Result<PictureJudge> PictureJudge::create(std::shared_ptr<SceneRenderer> renderer, const Session& session,
                                          const vdtree::View& view, int samples) {
    PictureJudge made(session, view, samples, std::move(renderer));
    const auto whole = whole_cuts(session);
    const auto frame = made.renderer_->draw(drawn_cuts(whole), view, made.drawing());
    if (!frame) return frame.error();
    const Observer& observer = session.observer();
    made.full_ = light_image(*frame, observer.display);
    made.full_codes_ = code_image(*frame, observer.display);
    std::optional<glm::dvec2> gaze;
    if (observer.gaze) gaze = observer.gaze->px;
    auto other = std::async(std::launch::async, [&] {
        return perception::Judge::create(made.full_,
                                         perception::second_judge_options(observer.person, observer.display, gaze));
    });
    auto judge = perception::Judge::create(made.full_, judge_options(observer));
    auto second = other.get();
    if (!judge) return judge.error();
    if (!second) return second.error();
    made.judge_ = std::make_unique<perception::Judge>(std::move(*judge));
    made.second_ = std::make_unique<perception::Judge>(std::move(*second));
    return made;
}

Result<PictureVerdict> PictureJudge::judge(std::span<const vdtree::Cut> cuts) {
    const auto frame = renderer_->draw(drawn_cuts(cuts), view_, drawing());
    if (!frame) return frame.error();
    return judge(*frame);
}

Result<PictureVerdict> PictureJudge::judge(const render::Frame& frame) const {
    const perception::Display& display = session_.observer().display;
    const perception::Image light = light_image(frame, display);
    auto other = std::async(std::launch::async, [&] {
        auto judgement = second_->judge(light);
        return std::pair(std::move(judgement), perception::ssim(full_codes_, code_image(frame, display)));
    });
    const auto verdict = judge_->judge(light);
    const auto [second, similarity] = other.get();
    if (!verdict) return verdict.error();
    if (!second) return second.error();
    return PictureVerdict{.visible_pixels = verdict->visible_pixels,
                          .second_visible_pixels = second->visible_pixels,
                          .v = verdict->max_ratio,
                          .second_v = second->max_ratio,
                          .ssim = similarity ? *similarity : std::numeric_limits<double>::quiet_NaN()};
}

} // namespace unseen::session
