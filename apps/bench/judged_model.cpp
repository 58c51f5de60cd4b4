#include "judged_model.h"

#include <cmath>

#include "frame_image.h"

namespace unseen::app {
namespace {

constexpr int samples_to_judge = 64; // a pixel; with fewer, samples that jump at outlines can be seen

bool is_same(const vdtree::View& a, const vdtree::View& b) {
    return a.eye == b.eye && a.target == b.target && a.up == b.up && a.fov_y_degrees == b.fov_y_degrees && a.width == b.width && a.height == b.height;
}

bool needs_errors(FoldTest test) { return test == FoldTest::error; }

} // namespace

Result<JudgedModel> JudgedModel::create(render::Context& context, std::string name, vdtree::VertexTree tree, int window_px,
                                        perception::CsfModel second) {
    JudgedModel model;
    model.context_ = context.share();
    model.name_ = std::move(name);
    model.second_ = second;
    model.view_.width = model.view_.height = window_px;
    auto scene = make_scene(std::move(tree), model.view_, {});
    if (!scene) return scene.error();
    auto stand = model.make_stand(std::move(*scene));
    if (!stand) return stand.error();
    model.plain_ = std::move(*stand);
    return model;
}

Result<JudgedModel::Stand> JudgedModel::make_stand(Scene scene) {
    Stand stand{std::make_unique<Scene>(std::move(scene)), nullptr};
    auto renderer = render::Renderer::create(*context_, stand.scene->tree);
    if (!renderer) return renderer.error();
    stand.renderer = std::make_unique<render::Renderer>(std::move(*renderer));
    return stand;
}

Result<JudgedModel::Stand*> JudgedModel::stand(FoldTest test) {
    if (!needs_errors(test)) return &plain_;
    if (!measured_.scene) {
        auto tree = measured(plain_.scene->tree);
        if (!tree) return tree.error();
        auto scene = make_scene(std::move(*tree), view_, {});
        if (!scene) return scene.error();
        scene->view = plain_.scene->view;
        auto made = make_stand(std::move(*scene));
        if (!made) return made.error();
        measured_ = std::move(*made);
    }
    return &measured_;
}

Result<const Scene*> JudgedModel::scene(FoldTest test) {
    const auto stood = stand(test);
    if (!stood) return stood.error();
    return (*stood)->scene.get();
}

Result<void> JudgedModel::look(ViewOptions view) {
    view.width = view_.width;
    view.height = view_.height;
    view_ = view;
    const vdtree::View before = plain_.scene->view;
    for (Stand* stand : {&plain_, &measured_})
        if (stand->scene)
            if (auto looked = app::look(*stand->scene, view_); !looked) return looked;
    if (!is_same(plain_.scene->view, before)) full_.reset();
    return {};
}

Result<JudgedModel::Picture> JudgedModel::draw(Stand& stand, const WhatOptions& what, bool wireframe) {
    vdtree::Cut cut(stand.scene->tree);
    const auto simplified = simplify(cut, *stand.scene, what, Purpose::picture);
    if (!simplified) return simplified.error();
    render::DrawOptions options;
    options.samples = samples_to_judge;
    options.background = stand.scene->background;
    options.wireframe = wireframe;
    const auto frame = stand.renderer->draw(cut, stand.scene->view, options, stand.scene->placement);
    if (!frame) return frame.error();
    return Picture{cut.triangle_count(), luminance_image(*frame, stand.scene->display), code_image(*frame, stand.scene->display)};
}

Result<JudgedModel::Picture> JudgedModel::draw(const WhatOptions& what, bool wireframe) {
    const auto stood = stand(what.mode == Mode::full ? FoldTest::luebke_hallen : what.test());
    if (!stood) return stood.error();
    return draw(**stood, what, wireframe);
}

Result<const perception::Image*> JudgedModel::full() {
    if (!full_) {
        WhatOptions what;
        what.mode = Mode::full;
        auto drawn = draw(plain_, what, false);
        if (!drawn) return drawn.error();
        full_ = std::move(drawn->luminance);
    }
    return &*full_;
}

Result<perception::Judgement> JudgedModel::judge(const Picture& picture, const WhatOptions& what, Judge judge) {
    const auto reference = full();
    if (!reference) return reference.error();
    perception::JudgeOptions options;
    options.display = plain_.scene->display;
    options.gaze_px = what.gaze_px;
    if (judge == Judge::second) {
        options.csf = second_;
        options.beta = 2;
    }
    return perception::judge_modern(**reference, picture.luminance, options);
}

Result<perception::Judgement> JudgedModel::judge(const WhatOptions& what, Judge by) {
    const auto picture = draw(what);
    if (!picture) return picture.error();
    return judge(*picture, what, by);
}

Result<Verdicts> JudgedModel::judge(const WhatOptions& what) {
    const auto picture = draw(what);
    if (!picture) return picture.error();
    Verdicts verdicts;
    verdicts.triangles = picture->triangles;
    for (std::size_t i = 0; i < judges.size(); ++i) {
        const auto judged = judge(*picture, what, judges[i]);
        if (!judged) return judged.error();
        verdicts.visible_pixels[i] = judged->visible_pixels;
        verdicts.largest[i] = judged->max_ratio;
    }
    return verdicts;
}

Result<vdtree::Index> JudgedModel::count(const WhatOptions& what) {
    const auto stood = stand(what.test());
    if (!stood) return stood.error();
    vdtree::Cut cut((*stood)->scene->tree);
    const auto simplified = simplify(cut, *(*stood)->scene, what, Purpose::picture);
    if (!simplified) return simplified.error();
    return cut.triangle_count();
}

} // namespace unseen::app
