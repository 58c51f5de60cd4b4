#include <unseen/session/level_chain.h>

#include <algorithm>
#include <cmath>

#include <unseen/session/session.h>
#include <unseen/vdtree/internal/contrast_classes.h>
#include <unseen/vdtree/internal/errors.h>

namespace unseen::session {
namespace {

// What is seen from everywhere still has an order: the larger, the more visible.
constexpr double everywhere = 1e30; // mesh units

Result<void> check(const LevelChainOptions& options) {
    if (options.levels < 1 || options.levels > most_levels)
        return invalid_argument("A chain has 1 to " + std::to_string(most_levels) + " levels, not " +
                                std::to_string(options.levels) + ".");
    if (!(options.most_share > 0 && options.most_share <= 1 && options.least_share >= 0 &&
          options.least_share <= options.most_share))
        return invalid_argument(
            "The shares of a chain's triangles must lie between 0 and 1, the least below the largest.");
    return {};
}

// From how far a fold of each node is seen at most, from any side.
std::vector<float> distances_of(const vdtree::VertexTree& tree, const vdtree::DistanceCriterion& criterion) {
    const vdtree::DistanceCriterion::Parts& parts = criterion.parts();
    const auto seen = [&](std::size_t fold_class, float length) {
        const float lengths = parts.switch_distance[fold_class * parts.eccentricity_bins]; // where one looks
        if (lengths >= vdtree::DistanceCriterion::always_visible) return everywhere * (1 + static_cast<double>(length));
        return std::max(0.0, static_cast<double>(length) * static_cast<double>(lengths));
    };
    std::vector<float> distances;
    for (std::size_t i = 0; i < criterion.interior_count(); ++i) {
        const float length = parts.lengths.empty() ? tree.support_spheres()[i].radius : parts.lengths[i];
        const float outline = parts.silhouette_lengths.empty() ? length : parts.silhouette_lengths[i];
        double distance = 0;
        if (parts.lit) {
            distance = seen(parts.lit->silhouette, outline);
        } else {
            const vdtree::FoldClass both = parts.classes.empty() ? vdtree::FoldClass{} : parts.classes[i];
            distance = std::max(seen(both.interior, length), seen(both.silhouette, outline));
        }
        constexpr auto largest = static_cast<double>(std::numeric_limits<float>::max());
        distances.push_back(static_cast<float>(std::min(distance, largest)));
    }
    return distances;
}

} // namespace

LevelChain::LevelChain(const vdtree::VertexTree& tree, std::vector<float> seen_from)
    : tree_(std::make_shared<const vdtree::VertexTree>(tree.share())),
      seen_from_(std::make_shared<const std::vector<float>>(std::move(seen_from))) {}

Result<LevelChain> LevelChain::prepare(const vdtree::VertexTree& tree, const vdtree::DistanceCriterion& criterion,
                                       const LevelChainOptions& options) {
    if (auto valid = check(options); !valid) return valid.error();
    if (criterion.interior_count() != tree.interior_count())
        return invalid_argument("The criterion was made for a tree of " + std::to_string(criterion.interior_count()) +
                                " interior nodes, and the tree has " + std::to_string(tree.interior_count()) + ".");
    LevelChain chain(tree, distances_of(tree, criterion));
    chain.levels_.push_back({tree.triangle_count(), 0});
    return chain;
}

vdtree::Cut LevelChain::cut_at(double distance) const {
    vdtree::Cut cut(*tree_);
    const auto& seen_from = *seen_from_;
    cut.adjust([&](const vdtree::VertexTree&, std::span<const vdtree::NodeId> nodes, std::span<float> costs) {
        for (std::size_t i = 0; i < nodes.size(); ++i)
            costs[i] = static_cast<double>(seen_from[nodes[i]]) > distance ? 2.F : 0.F;
    });
    return cut;
}

double LevelChain::distance_of(vdtree::Index triangles) const {
    vdtree::Cut cut(*tree_);
    const auto& seen_from = *seen_from_;
    const auto stats = cut.adjust(
        [&](const vdtree::VertexTree&, std::span<const vdtree::NodeId> nodes, std::span<float> costs) {
            for (std::size_t i = 0; i < nodes.size(); ++i) costs[i] = seen_from[nodes[i]];
        },
        triangles);
    return static_cast<double>(stats.max_fold_cost);
}

void LevelChain::add(double distance) {
    const vdtree::Index triangles = cut_at(distance).triangle_count();
    // The first one may be seen from nowhere: folds within a plane.
    const bool is_farther = distance > levels_.back().distance || (levels_.size() == 1 && distance == 0);
    if (triangles > 0 && triangles < levels_.back().triangles && is_farther) levels_.push_back({triangles, distance});
}

Result<LevelChain> LevelChain::create(const vdtree::VertexTree& tree, const vdtree::DistanceCriterion& criterion,
                                      const LevelChainOptions& options) {
    auto chain = prepare(tree, criterion, options);
    if (!chain || options.levels == 1) return chain;
    const auto budget = [&](double share) {
        return std::max({options.least_triangles, vdtree::Index(1),
                         static_cast<vdtree::Index>(std::ceil(share * static_cast<double>(tree.triangle_count())))});
    };
    const double nearest = chain->distance_of(budget(options.most_share)),
                 farthest = chain->distance_of(budget(options.least_share));
    const bool has_factor = nearest > 0 && farthest > nearest && farthest < everywhere;
    // What is seen from nowhere, or from everywhere, tells no factor: then triangles do.
    if (!has_factor) return by_triangles(tree, criterion, options);
    const int steps = options.levels - 2;
    for (int i = 0; i < std::max(steps, 1); ++i)
        chain->add(nearest * std::pow(farthest / nearest, i / std::max<double>(steps, 1)));
    if (steps > 0) chain->add(farthest);
    return chain;
}

Result<LevelChain> LevelChain::by_triangles(const vdtree::VertexTree& tree, const vdtree::DistanceCriterion& criterion,
                                            const LevelChainOptions& options) {
    auto chain = prepare(tree, criterion, options);
    if (!chain) return chain;
    const auto all = static_cast<double>(tree.triangle_count());
    const double last = std::max(options.least_share * all, static_cast<double>(std::max(options.least_triangles, 1U)));
    const double first = std::max(options.most_share * all, last);
    const int steps = options.levels - 2;
    for (int i = 0; i <= steps; ++i) {
        const double share = steps == 0 ? 0 : static_cast<double>(i) / steps;
        chain->add(chain->distance_of(static_cast<vdtree::Index>(std::ceil(first * std::pow(last / first, share)))));
    }
    return chain;
}

double LevelChain::unseen_from(int level) const noexcept {
    const double distance = levels_[static_cast<std::size_t>(level)].distance;
    return distance < everywhere ? distance : std::numeric_limits<double>::infinity();
}

vdtree::Cut LevelChain::cut(int level) const {
    if (level > 0) return cut_at(levels_[static_cast<std::size_t>(level)].distance);
    vdtree::Cut cut(*tree_);
    cut.unfold_all();
    return cut;
}

Result<LevelChain> level_chain(Session& session, const vdtree::View& view, Request request, std::size_t object,
                               const LevelChainOptions& options) {
    request.goal = Goal::imperceptible();
    request.keeps_shadows = false; // levels are for eyes at any distance, and the lights' distances are others
    const auto recipe = session.recipe(view, request, object);
    if (!recipe) return recipe.error();
    return LevelChain::create(session.tree(object), *recipe->criterion, options);
}

} // namespace unseen::session
