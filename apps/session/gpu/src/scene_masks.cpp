#include "scene_masks.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <unseen/perception/internal/judge_tables.h>
#include <unseen/render/internal/visibility_passes.h>
#include <unseen/render/sample_sum.h>
#include <unseen/session_gpu/gpu_judge.h>

namespace unseen::session {
namespace {

// People differ in how much they see of a masker, too, and models of sight do. Changes are looked for by the observer,
// and maskers count as for somebody who sees half as much: of the default observer, as for the median person.
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

    Result<perception::MaskingPicture::Elevations> of(std::span<const render::Item> items, render::Shadows* shadows) {
        sampling_.shadows = shadows;
        if (auto drawn = sum_.draw(items, view_, sampling_); !drawn) return drawn.error();
        drawings_ += sampling_.samples;
        render::LuminanceTexture picture = sum_.mean_luminance();
        picture.scale *= static_cast<float>(white_ - black_);
        picture.offset = static_cast<float>(black_ + static_cast<double>(picture.offset) * (white_ - black_));
        if (!passes_) {
            auto made = render::VisibilityPasses::create(context_, tables_, picture);
            if (!made) return made.error();
            passes_ = std::move(*made);
        } else if (auto set = passes_->set_reference(picture); !set) {
            return set.error();
        }
        if (auto mapped = passes_->map_elevations(); !mapped) return mapped.error();
        auto grid = passes_->read_elevations();
        if (!grid) return grid.error();
        perception::MaskingPicture::Elevations elevations{
            grid->cell_px, grid->columns, grid->rows, {}, std::move(grid->elevation)};
        for (const JudgeTables::Band& band : tables_.bands) elevations.bands.emplace_back(band.nominal_cpd);
        return elevations;
    }

    int drawings() const { return drawings_; }
    int full_screen_passes() const { return passes_ ? passes_->full_screen_passes() : 0; }
    std::uint64_t texture_bytes() const {
        constexpr std::uint64_t of_sum = 36; // bytes a pixel: SampleSum
        const std::uint64_t pixels = static_cast<std::uint64_t>(view_.width) * static_cast<std::uint64_t>(view_.height);
        return of_sum * pixels + (passes_ ? passes_->texture_bytes() : 0);
    }

private:
    Masks(const render::Context& context, const vdtree::View& view, const render::Sampling& sampling,
          JudgeTables tables, render::SampleSum sum, double black, double white)
        : context_(context), view_(view), sampling_(sampling), tables_(std::move(tables)), sum_(std::move(sum)),
          black_(black), white_(white) {}

    const render::Context& context_;
    const vdtree::View& view_;
    render::Sampling sampling_;
    JudgeTables tables_;
    render::SampleSum sum_;
    std::optional<render::VisibilityPasses> passes_ = {};
    double black_, white_; // cd/m2
    int drawings_ = 0;
};

// Of cells in all bands, those whose thresholds rise by a quarter or more: less does nearly nothing.
float share_raised(const perception::MaskingPicture::Elevations& a, const perception::MaskingPicture::Elevations& b) {
    constexpr float raised = 1.25f;
    std::size_t count = 0;
    for (std::size_t i = 0; i < a.elevation.size(); ++i) count += std::min(a.elevation[i], b.elevation[i]) >= raised;
    return static_cast<float>(count) / static_cast<float>(std::max<std::size_t>(a.elevation.size(), 1));
}

} // namespace

Result<render::LayerSplit> split_objects(const Session& session, const vdtree::View& view, int layers) {
    std::vector<glm::dvec3> centres;
    for (const Object& object : session.scene().objects) centres.push_back(world_sphere(object).centre);
    return render::split_into_layers(centres, view, layers);
}

Result<SceneMasks> find_masks(const Session& session, const render::Context& context, const SceneItems& scene,
                              const vdtree::View& view, const render::LayerSplit& split, int samples) {
    auto masks = Masks::create(session, context, view, samples);
    if (!masks) return masks.error();
    const auto whole = masks->of(scene.items, scene.shadows);
    if (!whole) return whole.error();
    SceneMasks found;
    std::vector<perception::MaskingPicture> by_layer;
    for (int layer = 0; layer < std::max(split.count, 1); ++layer) {
        auto rest = masks->of(without_layer(scene, split.layer_of, layer), scene.shadows);
        if (!rest) return rest.error();
        found.largest_share = std::max(found.largest_share, share_raised(*whole, *rest));
        const perception::MaskingPicture::Elevations both[] = {*whole, std::move(*rest)};
        auto masking = perception::MaskingPicture::create(view, both);
        if (!masking) return masking.error();
        by_layer.push_back(std::move(*masking));
    }
    for (const int layer : split.layer_of) found.of_objects.push_back(by_layer[static_cast<std::size_t>(layer)]);
    found.surface_passes = masks->drawings();
    found.full_screen_passes = masks->full_screen_passes();
    found.texture_bytes = masks->texture_bytes();
    return found;
}

} // namespace unseen::session
