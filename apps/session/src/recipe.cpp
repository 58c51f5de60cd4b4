// What a cut is made by: a criterion, a viewpoint and options.
#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/node_bits.h>

#include "shadow_outlines.h"

namespace unseen::session {
namespace {

bool is_wholly_in_window(const Sight& sight) {
    const vdtree::Sphere sphere = sight.object.tree.bounding_sphere();
    return std::ranges::all_of(vdtree::eyes_of(sight.view), [&](const vdtree::View& eye) {
        return std::ranges::all_of(vdtree::frustum_of(sight.object.tree, eye, sight.object.placement),
                                   [&](const vdtree::Plane& plane) {
                                       return glm::dot(plane.normal, glm::dvec3(sphere.centre)) + plane.offset >
                                              static_cast<double>(sphere.radius);
                                   });
    });
}

vdtree::Viewpoint viewpoint_of(Sight& sight, const Decision& decision) {
    // Where all is seen, a turning window must not cost anything.
    const bool window_only =
        decision.request.purpose != Purpose::mesh && !may_cast_anything(sight, decision) && !is_wholly_in_window(sight);
    vdtree::Viewpoint viewpoint = perception::viewpoint_of(sight.object.tree, sight.view, test_options(sight),
                                                           sight.object.placement, window_only);
    if (sight.lighting && decision.test != FoldTest::error) viewpoint.lighting = *sight.lighting;
    if (folds_hidden(sight, decision)) {
        const auto spheres = inner_spheres(sight.object, sight.cache);
        // An orthographic view that shows a small part stands for eyes so near that they may lie among the spheres.
        std::copy_if(spheres.begin(), spheres.end(), std::back_inserter(viewpoint.occluders), [&](const auto& sphere) {
            return glm::length(glm::dvec3(sphere.centre) - viewpoint.eye) >
                   static_cast<double>(sphere.radius) + viewpoint.eye_spread;
        });
    }
    return viewpoint;
}

vdtree::FollowOptions follow_options(const Sight& sight, const Decision& decision) {
    const Request& request = decision.request;
    vdtree::FollowOptions options;
    options.threshold = static_cast<float>(request.goal.cost);
    options.milliseconds = request.milliseconds;
    options.cull_back_faces = folds_back_faces(sight, decision);
    if (request.goal.kind == Goal::Kind::budget) {
        options.triangle_budget = request.goal.triangles;
        options.fill_budget = request.goal.fill;
        options.hysteresis = request.hysteresis;
    }
    return options;
}

} // namespace

perception::FoldTestOptions test_options(const Sight& sight) {
    perception::FoldTestOptions options;
    options.display = sight.observer.display;
    options.scene = sight.luminance;
    options.csf = sight.csf;
    options.gaze_px = sight.gaze_px;
    return options;
}

bool casts_shadows(const Sight& sight) { return sight.lighting && vdtree::shadow_lights(*sight.lighting) > 0; }

bool may_cast_anything(const Sight& sight, const Decision& decision) {
    return casts_shadows(sight) && !(is_perceptual(decision) && decision.request.keeps_shadows);
}

bool is_perceptual(const Decision& decision) {
    return decision.request.goal.kind != Goal::Kind::full && is_perceptual(decision.test);
}

bool is_translucent(const Sight& sight) {
    return sight.object.tree.bounds()[vdtree::VertexTree::root()].flags & vdtree::translucent_ring;
}

bool may_fold_back_faces(const Sight& sight) {
    const WorldSphere sphere = world_sphere(sight.object);
    return !is_translucent(sight) && sight.object.tree.closedness() != vdtree::Closedness::open &&
           !is_around_eye(sphere, sight.view);
}

bool folds_back_faces(const Sight& sight, const Decision& decision) {
    const Request& request = decision.request;
    const bool is_worth_it = request.purpose == Purpose::picture ||
                             (request.purpose == Purpose::flight && request.goal.kind == Goal::Kind::budget);
    return is_worth_it && may_fold_back_faces(sight);
}

bool is_out_of_sight(Sight& sight, const Decision& decision) {
    if (decision.request.purpose == Purpose::mesh || may_cast_anything(sight, decision)) return false;
    const WorldSphere sphere = sphere_of_all(sight.object, sight.cache);
    const glm::dvec3 away = sphere.centre - sight.view.eye;
    // Far more than planes and spheres in single floats are off by.
    const double margin = 1e-3 * sphere.radius + 1e-5 * glm::length(away);
    const bool is_out = std::any_of(sight.window->begin(), sight.window->end(), [&](const vdtree::Plane& plane) {
        return glm::dot(plane.normal, away) + plane.offset < -(sphere.radius + margin);
    });
    if (!is_out || !casts_shadows(sight)) return is_out;
    const Key key = key_of(sight, decision);
    const std::shared_ptr<const KeptCriterion>& last = last_criterion(sight, key);
    const WorldSphere cast{sphere.centre, cast_radii * sphere.radius};
    return last && last->key == key && last->edges &&
           std::isinf(reach_of(sight, decision, last->edges)->unseen_shift(cast));
}

// Extent and displacement look at supports, which do not contain all that a fold changes.
bool folds_hidden(const Sight& sight, const Decision& decision) {
    return decision.request.purpose == Purpose::picture && is_perceptual(decision) &&
           !may_cast_anything(sight, decision) && may_fold_back_faces(sight);
}

bool knows_shown(const Sight& sight, const Decision& decision) {
    return !decision.request.shown.empty() && is_perceptual(decision) && !is_translucent(sight);
}

// The pictures of a mesh with a budget only tell how much each side shows.
bool folds_unseen(const Sight& sight, const Decision& decision) {
    const Request& request = decision.request;
    return knows_shown(sight, decision) &&
           !(request.purpose == Purpose::mesh && request.goal.kind == Goal::Kind::budget);
}

const char* why_not_summed(const Sight& sight, const Decision& decision) {
    if (decision.request.order != Order::sum) return "it is not asked for";
    if (!goes_by_sum(decision.request) && decision.request.goal.kind == Goal::Kind::quality)
        return "what nobody sees does not add up";
    if (decision.test != FoldTest::error) return "only the fold test error measures what adds up";
    if (!knows_shown(sight, decision)) return "what a picture shows of each part is not known";
    return nullptr;
}

namespace {

using SharedCriterion = std::shared_ptr<const vdtree::DistanceCriterion>;

SharedCriterion share(vdtree::DistanceCriterion made) {
    return std::make_shared<const vdtree::DistanceCriterion>(std::move(made));
}

// Pixels of a view that a world unit of the object takes, about.
double pixels_of(const Sight& sight, const vdtree::View& view) {
    const WorldSphere sphere = world_sphere(sight.object);
    return vdtree::pixels_per_radian(view) / std::max(glm::length(view.eye - sphere.centre), sphere.radius);
}

// What all pictures show of an object in the mean, in pixels of the request's view.
Result<vdtree::ShownParts> find_shown(const Sight& sight, const Decision& decision, bool only_front) {
    const auto& pictures = decision.request.shown;
    const vdtree::NodeId nodes = sight.object.tree.interior_count();
    vdtree::ShownParts all{std::vector<float>(nodes), std::vector<float>(nodes)};
    for (const vdtree::DepthPicture& picture : pictures) {
        const auto shown = vdtree::find_shown(sight.object.tree, sight.object.placement, picture, only_front);
        if (!shown) return shown;
        const double ratio =
            picture.view() == sight.view ? 1 : pixels_of(sight, sight.view) / pixels_of(sight, picture.view());
        const auto count = static_cast<double>(pictures.size());
        all.add(*shown, static_cast<float>(ratio * ratio / count), static_cast<float>(ratio / count));
    }
    return all;
}

// The criterion without what is hidden in all pictures.
Result<vdtree::DistanceCriterion> fold_hidden(const Sight& sight, const Decision& decision,
                                              const vdtree::DistanceCriterion& own) {
    const vdtree::VertexTree& tree = sight.object.tree;
    std::vector<std::uint64_t> hidden(vdtree::words_for(tree.interior_count()), ~std::uint64_t{0});
    for (const vdtree::DepthPicture& picture : decision.request.shown) {
        const auto here = vdtree::find_hidden(tree, sight.object.placement, picture);
        if (!here) return here.error();
        std::ranges::transform(hidden, *here, hidden.begin(), std::bit_and());
    }
    return vdtree::folding_hidden(tree, own, hidden);
}

// The criterion with costs by what adds up.
Result<vdtree::DistanceCriterion> add_up(Sight& sight, const Decision& decision, const vdtree::DistanceCriterion& own,
                                         const CutRecipe& recipe) {
    const vdtree::VertexTree& tree = sight.object.tree;
    const auto shown = find_shown(sight, decision, recipe.options.cull_back_faces);
    if (!shown) return shown.error();
    std::optional<vdtree::VertexTree> lit;
    if (sight.lighting) {
        auto under = sight.cache.lit_folds->under(tree, *sight.lighting,
                                                  vdtree::eye_in_tree(tree, sight.view, sight.object.placement));
        if (!under) return under.error();
        lit = under->share();
    }
    const auto costs =
        perception::summed_costs(lit ? *lit : tree, *shown, sight.view, sight.object.placement, test_options(sight));
    if (!costs) return costs.error();
    return vdtree::costing_at_least(tree, own, recipe.viewpoint, *costs);
}

// What pictures show takes as long to find as many cuts: kept for the next one that asks for other costs.
Result<void> fold_by_what_is_shown(Sight& sight, const Decision& decision,
                                   const std::shared_ptr<const KeptCriterion>& own, CutRecipe& recipe) {
    std::shared_ptr<const ShownCriteria>& last = sight.shown_criteria;
    const bool is_summed = !why_not_summed(sight, decision);
    const bool is_known = last && last->of == own && last->pictures == decision.request.shown &&
                          last->view == sight.view && last->culls == recipe.options.cull_back_faces &&
                          last->folds_hidden == folds_unseen(sight, decision) && (last->summed || !is_summed);
    if (!is_known) {
        ShownCriteria made{own, decision.request.shown, sight.view, recipe.options.cull_back_faces};
        made.folds_hidden = folds_unseen(sight, decision);
        auto fold_test = made.folds_hidden ? fold_hidden(sight, decision, own->criterion) : own->criterion;
        if (!fold_test) return fold_test.error();
        made.fold_test = share(std::move(*fold_test));
        if (is_summed) {
            auto summed = add_up(sight, decision, *made.fold_test, recipe);
            if (!summed) return summed.error();
            made.summed = share(std::move(*summed));
        }
        last = std::make_shared<const ShownCriteria>(std::move(made));
    }
    recipe.criterion = last->fold_test;
    if (!is_summed) return {};
    if (decision.request.goal.kind == Goal::Kind::quality)
        recipe.options.threshold = static_cast<float>(decision.request.goal.summed_cost);
    recipe.fold_test = std::exchange(recipe.criterion, last->summed);
    return {};
}

} // namespace

Result<CutRecipe> make_recipe(Sight& sight, const Decision& decision) {
    const Key key = key_of(sight, decision);
    std::shared_ptr<const KeptCriterion>& kept = last_criterion(sight, key);
    if (!kept || !(kept->key == key)) {
        auto made = make_criterion(sight, key);
        if (!made) return made.error();
        auto edges = edges_of(sight, decision, key);
        if (!edges) return edges.error();
        kept = std::make_shared<const KeptCriterion>(KeptCriterion{key, std::move(*made), std::move(*edges)});
    }
    CutRecipe recipe{{kept, &kept->criterion}, viewpoint_of(sight, decision), follow_options(sight, decision)};
    if (!knows_shown(sight, decision)) {
        if (!kept->edges || !decision.request.keeps_shadows) return recipe;
        auto with_outlines = keep_outlines(sight, decision, kept);
        if (!with_outlines) return with_outlines.error();
        recipe.criterion = std::move(*with_outlines);
        return recipe;
    }
    if (const auto made = fold_by_what_is_shown(sight, decision, kept, recipe); !made) return made.error();
    if (kept->edges && decision.request.keeps_shadows) { // what is hidden may cast shadows that are not
        find_shadowing_outlines(sight, decision, kept);
        shadow_of(sight).criterion.reset();
        for (SharedCriterion* const criterion : {&recipe.criterion, &recipe.fold_test}) {
            if (!*criterion) continue;
            auto with_outlines = vdtree::keeping(sight.object.tree, **criterion, shadow_of(sight).kept);
            if (!with_outlines) return with_outlines.error();
            *criterion = std::make_shared<const vdtree::DistanceCriterion>(std::move(*with_outlines));
        }
    }
    return recipe;
}

} // namespace unseen::session
