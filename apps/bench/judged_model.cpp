#include "judged_model.h"

#include <algorithm>

#include "bench_tools.h"

namespace unseen::app {
namespace {

session::Session session_like(const session::Session& own, const vdtree::Mesh& simple) {
    session::Scene scene;
    scene.objects.push_back(session::Object{tree_like(own.tree(), simple), own.scene().objects[0].placement});
    scene.background = own.scene().background;
    return require(session::Session::create(std::move(scene), own.observer()));
}

} // namespace

DrawnPeer::DrawnPeer(const render::Context& context, const session::Session& own, const vdtree::Mesh& simple)
    : session(session_like(own, simple)), renderer(require(session::SceneRenderer::create(context, session))) {}

session::PictureVerdict CarefulJudge::judge(session::SceneRenderer& renderer, std::span<const vdtree::Cut> cuts) {
    session::PictureVerdict verdict;
    for (const int samples : {samples_to_judge, 4 * samples_to_judge}) {
        auto judge = judges_.find(samples);
        if (judge == judges_.end()) {
            auto made = require(session::PictureJudge::create(renderer_, session_, view_, samples));
            judge = judges_.emplace(samples, std::move(made)).first;
        }
        const render::DrawOptions drawing = judge->second.drawing();
        verdict = require(judge->second.judge(require(renderer.draw(session::drawn_cuts(cuts), view_, drawing))));
        if (verdict.shows_nothing() || std::max(verdict.v, verdict.second_v) >= 2) break;
    }
    return verdict;
}

JudgedModel::JudgedModel(const render::Context& context, std::string name, vdtree::VertexTree tree, int window_px)
    : context_(context), name_(std::move(name)), window_px_(window_px), plain_(make_stand(std::move(tree))) {}

JudgedModel::Stand JudgedModel::make_stand(vdtree::VertexTree tree) const {
    session::Scene scene = session::Scene::of(std::move(tree));
    scene.background = look_.background;
    session::Observer observer;
    observer.display = look_.display;
    Stand stand{
        std::make_unique<session::Session>(require(session::Session::create(std::move(scene), std::move(observer)))),
        {}};
    stand.renderer =
        std::make_shared<session::SceneRenderer>(require(session::SceneRenderer::create(context_, *stand.session)));
    return stand;
}

JudgedModel::Stand& JudgedModel::stand(FoldTest test) {
    if (test != FoldTest::error) return plain_;
    if (!measured_.session) measured_ = make_stand(require(session::measured(plain_.session->tree())));
    return measured_;
}

void JudgedModel::look(const Look& look) {
    const perception::Display &a = look.display, &b = look_.display;
    const bool is_same_screen = a.pixel_pitch == b.pixel_pitch && a.distance == b.distance && a.peak == b.peak &&
                                a.black == b.black && look.background == look_.background;
    look_ = look;
    look_.view.width = look_.view.height = window_px_;
    for (Stand* const stand : {&plain_, &measured_})
        if (stand->session && !is_same_screen) *stand = make_stand(stand->session->tree().share());
    view_ = make_view(*plain_.session, look_.view);
    require(vdtree::validate(view_));
    judge_.reset();
}

session::Simplification JudgedModel::simplify(Stand& stand, session::Request request) {
    request.purpose = session::Purpose::picture;
    stand.session->set_gaze(look_.gaze_px ? std::optional(session::Gaze{*look_.gaze_px}) : std::nullopt);
    return require(stand.session->simplify(view_, request));
}

vdtree::Index JudgedModel::count(const session::Request& request) {
    return simplify(stand(request.fold_test.value_or(FoldTest::error)), request).stats.triangles;
}

Seen JudgedModel::judge(const session::Request& request) {
    Stand& by = stand(request.fold_test.value_or(FoldTest::error));
    return judge(by, simplify(by, request).cuts);
}

Seen JudgedModel::judge(const vdtree::Cut& cut) { return judge(stand(FoldTest::error), {&cut, 1}); }

Seen JudgedModel::judge(Stand& stand, std::span<const vdtree::Cut> cuts) {
    if (!judge_) {
        plain_.session->set_gaze(look_.gaze_px ? std::optional(session::Gaze{*look_.gaze_px}) : std::nullopt);
        judge_.emplace(plain_.renderer, *plain_.session, view_);
    }
    return {cuts.front().triangle_count(), judge_->judge(*stand.renderer, cuts)};
}

} // namespace unseen::app
