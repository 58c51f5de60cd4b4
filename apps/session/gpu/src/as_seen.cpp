// Decides what a view calls for, draws that, and simplifies by it.
#include <unseen/session_gpu/as_seen.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/geometric.hpp>

#include <unseen/perception/internal/judge_tables.h>
#include <unseen/perception/internal/motion.h>
#include <unseen/perception/masking.h>
#include <unseen/render/internal/frame.h>
#include <unseen/render/internal/layers.h>
#include <unseen/render/internal/visibility_passes.h>
#include <unseen/session_gpu/scene_renderer.h>
#include <unseen/vdtree/internal/stopwatch.h>

#include "shown_depths.h"

namespace unseen::session {
namespace {

// Pictures from all around: fine enough for what nodes of a tenth of a per cent of the area show.
constexpr int sides = 14, side_px = 768, side_samples = 4;
constexpr double side_fill = 0.9;

// On a spiral from pole to pole, evenly.
glm::dvec3 direction_of(int side) {
    const double turn = std::numbers::pi * (3 - std::sqrt(5)) * side, z = 1 - (2 * side + 1.0) / sides;
    const double across = std::sqrt(1 - z * z);
    return {across * std::cos(turn), z, across * std::sin(turn)};
}

// Where thresholds rise in a smaller share of all cells and bands than this, a fold test by them keeps about as many
// triangles, and is not made.
constexpr float least_masked_share = 0.02f;

const char* why_nothing_masks(const Session& session, const Simplification& made, const AsSeenOptions& options) {
    if (options.masking == Masking::none) return "it is not asked for";
    if (std::ranges::none_of(made.fold_tests, [](FoldTest test) { return test == FoldTest::error; }))
        return "only the fold test error knows it";
    const Observer& observer = session.observer();
    if (observer.gaze && observer.gaze->margin_deg > 0) return "the gaze is not known for sure";
    if (observer.velocity > perception::least_velocity) return "what moves over the retina masks otherwise";
    if (session.scene().objects.size() == 1 && session.scene().backdrop.empty())
        return "there is one object, and nothing around it";
    return nullptr;
}

Effect shadow_effect(SceneRenderer& renderer) {
    const auto facts = renderer.shadows();
    if (!facts) return {"shadows", false, "no light casts a shadow"};
    return {"shadows",     true, std::to_string(facts->lights) + (facts->lights == 1 ? " light casts" : " lights cast"),
            facts->maps,   0,    facts->bytes,
            facts->draw_ms};
}

// ---- what the pictures of a view mask

struct SceneMasks {
    std::vector<perception::MaskingPicture> of_objects; // what one layer masks is the same for all its objects
    // Of all cells and bands of a layer's picture, in how many thresholds rise by a quarter or more.
    float largest_share = 0;
    int surface_passes = 0, full_screen_passes = 0;
    std::uint64_t texture_bytes = 0;
};

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
struct Masks {
    const render::Context& context_;
    const vdtree::View& view_;
    double black_, white_; // cd/m2
    render::Sampling sampling_;
    JudgeTables tables_;
    render::SampleSum sum_;
    std::optional<render::VisibilityPasses> passes_ = {};
    int drawings_ = 0;

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
        return Masks{context,
                     view,
                     black,
                     white,
                     {.samples = samples, .background = session.background()},
                     std::move(*tables),
                     std::move(*sum)};
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

    int full_screen_passes() const { return passes_ ? passes_->full_screen_passes() : 0; }
    std::uint64_t texture_bytes() const {
        constexpr std::uint64_t of_sum = 36; // bytes a pixel: SampleSum
        const std::uint64_t pixels = static_cast<std::uint64_t>(view_.width) * static_cast<std::uint64_t>(view_.height);
        return of_sum * pixels + (passes_ ? passes_->texture_bytes() : 0);
    }
};

// The share of cells in all bands whose thresholds rise by a quarter or more: less does nearly nothing.
float share_raised(const perception::MaskingPicture::Elevations& a, const perception::MaskingPicture::Elevations& b) {
    constexpr float raised = 1.25f;
    std::size_t count = 0;
    for (std::size_t i = 0; i < a.elevation.size(); ++i) count += std::min(a.elevation[i], b.elevation[i]) >= raised;
    return static_cast<float>(count) / static_cast<float>(std::max<std::size_t>(a.elevation.size(), 1));
}

// Objects by the depth of their centres. No layers: all are in one.
Result<render::LayerSplit> split_objects(const Session& session, const vdtree::View& view, int layers) {
    std::vector<glm::dvec3> centres;
    for (const Object& object : session.scene().objects) centres.push_back(world_sphere(object).centre);
    return render::split_into_layers(centres, view, layers);
}

// Draws the scene, and it without each layer's objects, and maps what each picture masks; waits for the GPU after each.
// Shadows are those of the whole scene, whatever is drawn.
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
    found.surface_passes = masks->drawings_;
    found.full_screen_passes = masks->full_screen_passes();
    found.texture_bytes = masks->texture_bytes();
    return found;
}

// ---- what a simplification is to go by

// What pictures of one simplification say, for the next one.
class Pictures {
public:
    Pictures(Session& session, const render::Context& context, const vdtree::View& view, const AsSeenOptions& options)
        : session_(session), context_(context), view_(view), options_(options) {}

    // Fills in what the request is to go by.
    Result<void> draw(const Simplification& made, Request& request) {
        auto renderer = SceneRenderer::create(context_, session_);
        if (!renderer) return renderer.error();
        const auto scene = renderer->items(drawn_cuts(made.cuts), view_);
        if (!scene) return scene.error();
        if (auto found = find_hidden(*scene, request); !found) return found;
        if (auto found = find_masked(made, *scene, request); !found) return found;
        effects_.push_back(shadow_effect(*renderer));
        return {};
    }
    std::vector<Effect> take_effects() { return std::move(effects_); }

private:
    Result<void> find_hidden(const SceneItems& scene, Request& request) {
        if (!options_.folds_hidden) {
            effects_.push_back({"occlusion", false, "it is not asked for"});
            return {};
        }
        const auto start = vdtree::Clock::now();
        auto shown = draw_depths(context_, scene, view_, options_.samples);
        if (!shown) return shown.error();
        request.shown.push_back(std::move(*shown));
        constexpr std::uint64_t depth_bytes = 4;
        effects_.push_back(
            {"occlusion", true, "what lies behind what the view shows is folded", options_.samples, 0,
             depth_bytes * static_cast<std::uint64_t>(view_.width) * static_cast<std::uint64_t>(view_.height),
             vdtree::ms_since(start)});
        return {};
    }

    Result<void> find_masked(const Simplification& made, const SceneItems& scene, Request& request) {
        if (const char* why = why_nothing_masks(session_, made, options_)) {
            effects_.push_back({"layers", false, "nothing is masked"});
            effects_.push_back({"masking", false, why});
            return {};
        }
        const auto start = vdtree::Clock::now();
        const auto split = split_objects(session_, view_, options_.layers);
        if (!split) return split.error();
        const bool has_layers = split->count > 1;
        auto masks = find_masks(session_, context_, scene, view_, *split, options_.samples);
        if (!masks) return masks.error();
        const bool is_worth_it = masks->largest_share >= least_masked_share;
        if (is_worth_it) request.masking = std::move(masks->of_objects);
        effects_.push_back({"layers", has_layers,
                            has_layers ? "objects are in " + std::to_string(split->count) + " layers of depth"
                                       : "all objects are in one layer"});
        // The maps are what was drawn to find out, also where they turn out to be of no use.
        effects_.push_back({"masking", is_worth_it,
                            is_worth_it ? "the scene raises thresholds of what folds change"
                                        : "the scene masks too little to be worth another fold test",
                            masks->surface_passes, masks->full_screen_passes, masks->texture_bytes,
                            vdtree::ms_since(start)});
        return {};
    }

    Session& session_;
    const render::Context& context_;
    const vdtree::View& view_;
    const AsSeenOptions& options_;
    std::vector<Effect> effects_;
};

} // namespace

const char* why_pictures_tell_nothing(const Session& session, const Request& request, const Simplification& made) {
    if (request.goal.kind == Goal::Kind::full) return "nothing is folded in the full model";
    if (made.fold_tests.empty()) return "there is no object";
    if (!is_perceptual(made.fold_tests.front())) return "the fold test counts pixels, seen or not";
    if (session.scene().lights &&
        std::ranges::any_of(made.fold_tests, [](FoldTest test) { return test != FoldTest::error; }))
        return "under lights only the fold test error goes by pictures";
    return nullptr;
}

Result<vdtree::DepthPicture> draw_depths(const render::Context& context, const SceneItems& scene,
                                         const vdtree::View& view, int samples) {
    const auto depths = render::farthest_depth(context, scene.items, view, samples);
    if (!depths) return depths.error();
    return vdtree::DepthPicture::create(view, *depths);
}

Result<Simplification> simplify_as_seen(Session& session, const render::Context& context, const vdtree::View& view,
                                        Request request, const AsSeenOptions& options) {
    if (auto valid = vdtree::validate_perspective(view, "A simplification by what pictures show"); !valid)
        return valid.error();
    request.purpose = Purpose::picture;
    request.shown.clear();
    request.masking.clear();
    // What a budget leaves may be far off the mesh, and then its picture does not tell what of the mesh is shown.
    Request first = request;
    if (goes_by_sum(request) && options.folds_hidden) first.goal = Goal::imperceptible();
    auto all = session.simplify(view, first);
    if (!all) return all;
    if (const char* why = why_pictures_tell_nothing(session, request, *all)) {
        for (const char* effect : {"occlusion", "layers", "masking", "shadows"})
            all->passes.push_back({effect, false, why});
        return all;
    }
    Pictures pictures(session, context, view, options);
    if (options.folds_hidden || options.masking != Masking::none)
        if (const auto drawn = pictures.draw(*all, request); !drawn) return drawn.error();
    if (!request.shown.empty() || !request.masking.empty()) {
        all = session.simplify(view, request);
        if (!all) return all;
    }
    all->passes = pictures.take_effects();
    return all;
}

Result<Simplification> simplify_from_all_sides(Session& session, const render::Context& context,
                                               const vdtree::View& view, Request request) {
    request.purpose = Purpose::mesh;
    request.shown.clear();
    const WorldSphere all = session.bounding_sphere();
    const bool is_outside = !view.orthographic_height && glm::length(view.eye - all.centre) > all.radius;
    const bool has_budget = request.goal.kind == Goal::Kind::budget;
    if (!has_budget || !goes_by_sum(request) || !is_outside) return session.simplify(view, request);
    if (auto prepared = session.prepare(view, request); !prepared) return prepared.error();
    auto renderer = SceneRenderer::create(context, session);
    if (!renderer) return renderer.error();
    const std::vector<vdtree::Cut> whole = whole_cuts(session);
    vdtree::View window;
    window.width = window.height = side_px;
    for (int side = 0; side < sides; ++side) {
        const vdtree::View seen = session.frame(direction_of(side), side_fill, window);
        const auto scene = renderer->items(drawn_cuts(whole), seen);
        if (!scene) return scene.error();
        auto shown = draw_depths(context, *scene, seen, side_samples);
        if (!shown) return shown.error();
        request.shown.push_back(std::move(*shown));
    }
    return session.simplify(view, request);
}

} // namespace unseen::session
