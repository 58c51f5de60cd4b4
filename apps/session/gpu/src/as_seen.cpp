// One drawing for the depths, and one for each picture that masks: of the scene, and of it without each layer's objects.
#include <session_gpu/as_seen.h>

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include <perception/judge_tables.h>
#include <render/depth.h>
#include <render/layers.h>
#include <render/sample_sum.h>
#include <session_gpu/gpu_judge.h>
#include <session_gpu/scene_renderer.h>

namespace unseen::session {
namespace {

// People differ in how much they see of a masker, too, and models of sight do. Changes are looked for by the observer, and
// maskers count as for somebody who sees half as much: of the default observer, as for the median person.
constexpr double maskers_gain = 0.5;

// All but one layer's objects.
std::vector<render::Item> without_layer(const SceneItems& scene, const std::vector<int>& layer_of, int layer) {
    std::vector<render::Item> rest;
    for (std::size_t i = 0; i < scene.items.size(); ++i)
        if (i >= scene.objects.size() || layer_of[scene.objects[i]] != layer) rest.push_back(scene.items[i]);
    return rest;
}

// What pictures of a view mask, for this observer.
class Masks {
public:
    static Result<Masks> create(const Session& session, const render::Context& context, const vdtree::View& view,
                                int samples) {
        const perception::Display& display = session.observer().display;
        const double black = perception::to_luminance(display, 0).value(),
                     white = perception::to_luminance(display, 1).value();
        perception::JudgeOptions judging = judge_options(session.observer());
        judging.gain *= maskers_gain;
        auto tables = perception::judge_tables(view.width, view.height, static_cast<float>(black),
                                               static_cast<float>(white), judging);
        if (!tables) return tables.error();
        auto sum = render::SampleSum::create(context, view.width, view.height);
        if (!sum) return sum.error();
        return Masks(context, view, {.samples = samples, .background = session.background()}, std::move(*tables),
                     std::move(*sum), black, white);
    }

    // Shadows are those of the whole scene, whatever is drawn.
    Result<perception::Elevations> of(std::span<const render::Item> items, render::Shadows* shadows) {
        sampling_.shadows = shadows;
        if (auto drawn = sum_.draw(items, view_, sampling_); !drawn) return drawn.error();
        render::LuminanceTexture picture = sum_.mean_luminance();
        picture.scale *= static_cast<float>(white_ - black_);
        picture.offset = static_cast<float>(black_ + static_cast<double>(picture.offset) * (white_ - black_));
        if (!passes_) {
            auto made = render::VisibilityPasses::create(context_, visibility_tables(tables_), picture);
            if (!made) return made.error();
            passes_ = std::move(*made);
        } else if (auto set = passes_->set_reference(picture); !set) {
            return set.error();
        }
        if (auto mapped = passes_->map_elevations(); !mapped) return mapped.error();
        auto grid = passes_->read_elevations();
        if (!grid) return grid.error();
        perception::Elevations elevations{grid->cell_px, grid->columns, grid->rows, {}, std::move(grid->elevation)};
        for (const perception::JudgeTables::Band& band : tables_.bands) elevations.bands.push_back(band.nominal);
        return elevations;
    }

private:
    Masks(const render::Context& context, const vdtree::View& view, const render::Sampling& sampling,
          perception::JudgeTables tables, render::SampleSum sum, double black, double white)
        : context_(context), view_(view), sampling_(sampling), tables_(std::move(tables)), sum_(std::move(sum)),
          black_(black), white_(white) {}

    const render::Context& context_;
    const vdtree::View& view_;
    render::Sampling sampling_;
    perception::JudgeTables tables_;
    render::SampleSum sum_;
    std::optional<render::VisibilityPasses> passes_ = {};
    double black_, white_; // cd/m2
};

Result<render::LayerSplit> layers_of(const Session& session, const vdtree::View& view, int layers) {
    std::vector<glm::dvec3> centres;
    for (std::size_t i = 0; i < session.scene().objects.size(); ++i) {
        const vdtree::VertexTree& tree = session.tree(i);
        centres.push_back(
            session.scene().objects[i].placement.to_world(tree.origin() + glm::dvec3(tree.bounding_sphere().centre)));
    }
    return render::split_into_layers(centres, view, layers);
}

// By object. What one layer masks is the same for all its objects.
Result<std::vector<perception::MaskingPicture>> masking_of(const Session& session, const render::Context& context,
                                                           const SceneItems& drawn, const vdtree::View& view,
                                                           const AsSeenOptions& options) {
    const auto split = layers_of(session, view, options.layers);
    if (!split) return split.error();
    auto masks = Masks::create(session, context, view, options.samples);
    if (!masks) return masks.error();
    auto whole = masks->of(drawn.items, drawn.shadows);
    if (!whole) return whole.error();
    std::vector<perception::MaskingPicture> by_layer;
    for (int layer = 0; layer < std::max(split->count, 1); ++layer) {
        auto rest = masks->of(without_layer(drawn, split->layer_of, layer), drawn.shadows);
        if (!rest) return rest.error();
        const perception::Elevations both[] = {*whole, std::move(*rest)};
        auto masking = perception::MaskingPicture::create(view, both);
        if (!masking) return masking.error();
        by_layer.push_back(std::move(*masking));
    }
    std::vector<perception::MaskingPicture> of_objects;
    for (const int layer : split->layer_of) of_objects.push_back(by_layer[static_cast<std::size_t>(layer)]);
    return of_objects;
}

} // namespace

Result<Simplification> simplify_as_seen(Session& session, const render::Context& context, const vdtree::View& view,
                                        Request request, const AsSeenOptions& options) {
    request.purpose = Purpose::picture;
    request.shown.reset();
    request.masking.clear();
    auto all = session.simplify(view, request);
    if (!all) return all;
    const bool can_tell = request.goal.kind != Goal::Kind::full && !all->fold_tests.empty() &&
                          is_perceptual(all->fold_tests.front()) &&
                          (!session.scene().lights ||
                           std::ranges::all_of(all->fold_tests, [](FoldTest test) { return test == FoldTest::error; }));
    if (!can_tell || (!options.folds_hidden && options.masking == Masking::none)) return all;
    auto renderer = SceneRenderer::create(context, session);
    if (!renderer) return renderer.error();
    const auto drawn = renderer->items(drawn_cuts(all->cuts), view);
    if (!drawn) return drawn.error();
    if (options.folds_hidden) {
        const auto depths = render::farthest_depth(context, drawn->items, view, options.samples);
        if (!depths) return depths.error();
        auto shown = vdtree::DepthPicture::create(view, *depths);
        if (!shown) return shown.error();
        request.shown = std::move(*shown);
    }
    if (options.masking == Masking::scene) {
        auto masking = masking_of(session, context, *drawn, view, options);
        if (!masking) return masking.error();
        request.masking = std::move(*masking);
    }
    return session.simplify(view, request);
}

} // namespace unseen::session
