#include "judged_model.h"

#include <cmath>

#include <unseen/session_gpu/gpu_judge.h>
#include <unseen/session_gpu/scene_renderer.h>

namespace unseen::app {
namespace {

FoldTest test_of(const WhatOptions& what) { return what.request.fold_test.value_or(FoldTest::error); }
bool needs_errors(FoldTest test) { return test == FoldTest::error; }

} // namespace

Result<JudgedModel> JudgedModel::create(const render::Context& context, std::string name, vdtree::VertexTree tree,
                                        int window_px, perception::CsfModel second, JudgeDevice device) {
    JudgedModel model;
    model.context_ = context;
    model.name_ = std::move(name);
    model.second_ = second;
    model.device_ = device;
    auto stand = model.make_stand(std::move(tree));
    if (!stand) return stand.error();
    model.plain_ = std::move(*stand);
    ViewOptions first;
    first.width = first.height = window_px;
    model.view_ = make_view(*model.plain_.session, first);
    return model;
}

Result<session::Session> JudgedModel::make_session(vdtree::VertexTree tree) const {
    session::Scene scene = session::Scene::of(std::move(tree));
    scene.background = background_;
    session::Observer observer;
    observer.display = display_;
    return session::Session::create(std::move(scene), std::move(observer));
}

Result<void> JudgedModel::put(const perception::Display& display, std::optional<perception::Luminance> background) {
    const auto is_same = [](const perception::Display& a, const perception::Display& b) { // of flat ones
        return a.pixel_pitch == b.pixel_pitch && a.distance == b.distance && a.peak == b.peak && a.black == b.black;
    };
    if (is_same(display, display_) && background == background_) return {};
    display_ = display;
    background_ = background;
    full_.reset();
    for (Stand* const stand : {&plain_, &measured_}) {
        if (!stand->session) continue;
        auto made = make_stand(stand->session->tree().share());
        if (!made) return made.error();
        *stand = std::move(*made);
    }
    return {};
}

Result<JudgedModel::Stand> JudgedModel::make_stand(vdtree::VertexTree tree) {
    auto session = make_session(std::move(tree));
    if (!session) return session.error();
    auto renderer = render::Renderer::create(*context_, session->tree());
    if (!renderer) return renderer.error();
    return Stand{std::make_unique<session::Session>(std::move(*session)),
                 std::make_unique<render::Renderer>(std::move(*renderer))};
}

Result<JudgedModel::Stand*> JudgedModel::stand(FoldTest test) {
    if (!needs_errors(test)) return &plain_;
    if (!measured_.session) {
        auto tree = session::measured(plain_.session->tree());
        if (!tree) return tree.error();
        auto made = make_stand(std::move(*tree));
        if (!made) return made.error();
        measured_ = std::move(*made);
    }
    return &measured_;
}

Result<session::Session*> JudgedModel::session(FoldTest test) {
    const auto stood = stand(test);
    if (!stood) return stood.error();
    return (*stood)->session.get();
}

Result<void> JudgedModel::look(ViewOptions options) {
    options.width = view_.width;
    options.height = view_.height;
    const vdtree::View before = view_;
    view_ = make_view(*plain_.session, options);
    if (view_ != before) full_.reset();
    return vdtree::validate(view_);
}

Result<session::Simplification> JudgedModel::simplify(Stand& stand, const WhatOptions& what) {
    session::Request request = what.request;
    request.purpose = session::Purpose::picture;
    stand.session->set_gaze(fixed_gaze(what));
    return stand.session->simplify(view_, request);
}

Result<JudgedModel::Picture> JudgedModel::draw(Stand& stand, const WhatOptions& what) {
    const auto simplified = simplify(stand, what);
    if (!simplified) return simplified.error();
    return draw(stand, simplified->cuts.front());
}

Result<JudgedModel::Picture> JudgedModel::draw(Stand& stand, const vdtree::Cut& cut) {
    render::DrawOptions options;
    options.samples = samples_to_judge;
    options.background = stand.session->background();
    const auto frame = stand.renderer->draw(cut, view_, options);
    if (!frame) return frame.error();
    return Picture{cut.triangle_count(), session::luminance_image(*frame, stand.session->observer().display)};
}

Result<JudgedModel::Picture> JudgedModel::draw(const WhatOptions& what) {
    const auto stood = stand(what.request.goal.kind == Goal::Kind::full ? FoldTest::luebke_hallen : test_of(what));
    if (!stood) return stood.error();
    return draw(**stood, what);
}

Result<const perception::Image*> JudgedModel::full() {
    if (!full_) {
        WhatOptions what;
        what.request.goal = Goal::full();
        auto drawn = draw(plain_, what);
        if (!drawn) return drawn.error();
        full_ = std::move(drawn->luminance);
    }
    return &*full_;
}

Result<perception::Judgement> JudgedModel::judge(const Picture& picture, const std::optional<glm::dvec2>& gaze_px,
                                                 Judge judge) {
    const auto reference = full();
    if (!reference) return reference.error();
    const perception::Display& display = plain_.session->observer().display;
    perception::JudgeOptions options{.display = display, .gaze_px = gaze_px};
    if (judge == Judge::second) {
        options = perception::second_judge_options(perception::default_person, display, gaze_px);
        if (second_ != usual_second) options.csf = second_, options.gain = perception::default_person.gain;
    }
    if (device_ == JudgeDevice::cpu) return perception::judge_modern(**reference, picture.luminance, options);
    auto on_gpu = session::GpuJudge::create(*context_, **reference, options);
    if (!on_gpu) return on_gpu.error();
    return on_gpu->judge(picture.luminance);
}

Result<perception::Judgement> JudgedModel::judge(const WhatOptions& what, Judge by) {
    const auto picture = draw(what);
    if (!picture) return picture.error();
    return judge(*picture, what.gaze_px, by);
}

Result<perception::Judgement> JudgedModel::judge(const vdtree::Cut& cut, const std::optional<glm::dvec2>& gaze_px) {
    const auto stood = stand(FoldTest::error);
    if (!stood) return stood.error();
    const auto picture = draw(**stood, cut);
    if (!picture) return picture.error();
    return judge(*picture, gaze_px, Judge::modern);
}

Result<Verdicts> JudgedModel::judge(const WhatOptions& what) {
    const auto picture = draw(what);
    if (!picture) return picture.error();
    Verdicts verdicts;
    verdicts.triangles = picture->triangles;
    for (std::size_t i = 0; i < judges.size(); ++i) {
        const auto judged = judge(*picture, what.gaze_px, judges[i]);
        if (!judged) return judged.error();
        verdicts.visible_pixels[i] = judged->visible_pixels;
        verdicts.largest[i] = judged->max_ratio;
    }
    return verdicts;
}

Result<vdtree::Index> JudgedModel::count(const WhatOptions& what) {
    const auto stood = stand(test_of(what));
    if (!stood) return stood.error();
    const auto simplified = simplify(**stood, what);
    if (!simplified) return simplified.error();
    return simplified->stats.triangles;
}

} // namespace unseen::app
