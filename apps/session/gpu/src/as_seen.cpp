// Decides what a view calls for, draws that, and simplifies by it.
#include <unseen/session_gpu/as_seen.h>

#include <algorithm>
#include <utility>

#include <unseen/perception/internal/motion.h>
#include <unseen/render/internal/depth.h>
#include <unseen/session_gpu/scene_renderer.h>
#include <unseen/vdtree/internal/stopwatch.h>

#include "scene_masks.h"

namespace unseen::session {
namespace {

// Where thresholds rise in a smaller share of all cells and bands than this, a fold test by them keeps about as many
// triangles, and is not made.
constexpr float least_masked_share = 0.02f;

// Why pictures tell nothing about the folds of a simplification; null where they do.
const char* why_pictures_tell_nothing(const Session& session, const Request& request, const Simplification& made) {
    if (request.goal.kind == Goal::Kind::full) return "nothing is folded in the full model";
    if (made.fold_tests.empty()) return "there is no object";
    if (!is_perceptual(made.fold_tests.front())) return "the fold test counts pixels, seen or not";
    if (session.scene().lights &&
        std::ranges::any_of(made.fold_tests, [](FoldTest test) { return test != FoldTest::error; }))
        return "under lights only the fold test error goes by pictures";
    return nullptr;
}

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

PassEffect shadow_effect(SceneRenderer& renderer) {
    const auto facts = renderer.shadows();
    if (!facts) return {"shadows", false, "no light casts a shadow"};
    return {"shadows",     true, std::to_string(facts->lights) + (facts->lights == 1 ? " light casts" : " lights cast"),
            facts->maps,   0,    facts->bytes,
            facts->draw_ms};
}

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
    std::vector<PassEffect> take_effects() { return std::move(effects_); }

private:
    Result<void> find_hidden(const SceneItems& scene, Request& request) {
        if (!options_.folds_hidden) {
            effects_.push_back({"occlusion", false, "it is not asked for"});
            return {};
        }
        const auto start = vdtree::Clock::now();
        const auto depths = render::farthest_depth(context_, scene.items, view_, options_.samples);
        if (!depths) return depths.error();
        auto shown = vdtree::DepthPicture::create(view_, *depths);
        if (!shown) return shown.error();
        request.shown = std::move(*shown);
        constexpr std::uint64_t depth_bytes = 4;
        effects_.push_back({"occlusion", true, "what lies behind what the view shows is folded", options_.samples, 0,
                            depth_bytes * depths->size(), vdtree::ms_since(start)});
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
    std::vector<PassEffect> effects_;
};

} // namespace

Result<Simplification> simplify_as_seen(Session& session, const render::Context& context, const vdtree::View& view,
                                        Request request, const AsSeenOptions& options) {
    if (auto valid = vdtree::validate_perspective(view, "A simplification by what pictures show"); !valid)
        return valid.error();
    request.purpose = Purpose::picture;
    request.shown.reset();
    request.masking.clear();
    auto all = session.simplify(view, request);
    if (!all) return all;
    if (const char* why = why_pictures_tell_nothing(session, request, *all)) {
        for (const char* effect : {"occlusion", "layers", "masking", "shadows"})
            all->passes.push_back({effect, false, why});
        return all;
    }
    Pictures pictures(session, context, view, options);
    if (options.folds_hidden || options.masking != Masking::none)
        if (const auto drawn = pictures.draw(*all, request); !drawn) return drawn.error();
    if (request.shown || !request.masking.empty()) {
        all = session.simplify(view, request);
        if (!all) return all;
    }
    all->passes = pictures.take_effects();
    return all;
}

} // namespace unseen::session
