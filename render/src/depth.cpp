// Reversed depth is near / distance, so the farthest is the least.
#include <unseen/render/internal/depth.h>

#include <algorithm>
#include <limits>

#include <unseen/render/sample_sum.h>

#include "sample_count.h"

namespace unseen::render {

Result<std::vector<float>> farthest_depth(const Context& context, std::span<const Item> items, const vdtree::View& view,
                                          int samples, std::uint32_t seed) {
    if (const auto valid = check_samples(samples); !valid) return valid.error();
    if (const auto valid = vdtree::validate_perspective(view, "A picture of depth"); !valid) return valid.error();
    auto target = Target::create(context, view.width, view.height, {.colours = {}, .label = "farthest depth"});
    if (!target) return target.error();
    const auto nearest = near_plane(items, view);
    if (!nearest) return nearest.error();
    std::vector<float> least;
    for (const glm::dvec2 point : n_rooks(samples, seed)) {
        if (auto drawn = draw(items, {view, point, *nearest}, *target, {.colour = std::nullopt}); !drawn)
            return drawn.error();
        auto depth = read_depth(*target);
        if (!depth) return depth.error();
        if (least.empty()) least = std::move(*depth);
        else
            for (std::size_t i = 0; i < least.size(); ++i) least[i] = std::min(least[i], (*depth)[i]);
    }
    const auto near_distance = static_cast<float>(*nearest);
    for (float& depth : least) depth = depth > 0 ? near_distance / depth : std::numeric_limits<float>::infinity();
    return least;
}

} // namespace unseen::render
