// Luminances in the pictures are (2 + a n_k) / 4: what measures them takes them for positive, and divides shifts of the
// mean by them, so they stay away from 0.
#include <perception/lit_folds.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <tbb/parallel_for.h>

#include <perception/fold_measurement.h>
#include <vdtree/internal/spot_share.h>

#include "measure/fold_record.h"
#include "measure/measure_folds.h"

namespace unseen::perception {

using namespace vdtree;

namespace {

constexpr float offset = 2, scale = 4; // of luminances in the pictures of a n
constexpr float brightest = (offset + 1) / scale;
// Within a ring of the angular radius x, seen from a light, its light is a quadratic of the place but for less than this
// times x^2, as a share: 1/8 of the square of the ring's diameter times the second derivatives of 1 / d^2 and of the
// direction, 6 / d^2 and 1 / d^2, rounded up.
constexpr float falloff_curvature = 4;
constexpr float least_lit = 1e-5f;       // what is less lit is dark: below a step of stored luminances
constexpr float least_luminance = 1e-3f; // that shifts of the mean are shares of

using Records = MeasuredFolds;

Result<Records> measure_shaded(const VertexTree& tree, const FunctionRef<float(NodeId)>& luminance, int threads,
                               const Progress& progress) {
    const auto shaded = tree.shaded(luminance);
    if (!shaded) return shaded.error();
    return measure_records(*shaded, threads, progress);
}

// Of one light at a node.
struct Reach {
    float most = 0;   // of white that faces it, in the ring
    float uneven = 0; // by how much that is no plane over the ring
};

// `angle`: from the spot's axis, also beyond 0 and half a turn.
float share_at(const LightSource& spot, double angle) {
    return static_cast<float>(spot_share(spot, std::cos(std::clamp(angle, 0.0, std::numbers::pi))));
}

Reach reach_of(const LightSource& light, const Sphere& ring) {
    if (light.kind == LightSource::Kind::directional) return {static_cast<float>(light.intensity), 0};
    const glm::dvec3 to_ring = glm::dvec3(ring.centre) - light.position;
    const double distance = glm::length(to_ring), radius = static_cast<double>(ring.radius),
                 nearest = distance - radius;
    if (!(nearest > 0)) return {1e9f, 1e9f};
    const double ratio = light.distance / nearest, share = radius / distance;
    Reach reach;
    reach.most = static_cast<float>(std::min(light.intensity * ratio * ratio, 1e9));
    reach.uneven = reach.most * std::min(1.0f, falloff_curvature * static_cast<float>(share * share));
    if (light.kind == LightSource::Kind::spot) {
        const double angle = std::acos(std::clamp(glm::dot(to_ring, light.direction) / distance, -1.0, 1.0)),
                     half = std::asin(std::min(share, 1.0));
        const float high = share_at(light, angle - half), low = share_at(light, angle + half);
        reach.uneven = std::min(reach.most, reach.uneven * high + reach.most * (high - low));
        reach.most *= high;
    }
    return reach;
}

// The largest that each coordinate of the direction to the light is, from anywhere in the ring.
glm::vec3 direction_bound(const LightSource& light, const Sphere& ring) {
    if (light.kind == LightSource::Kind::directional) return glm::abs(glm::vec3(light.direction));
    const glm::dvec3 to_light = light.position - glm::dvec3(ring.centre);
    const double distance = glm::length(to_light), radius = static_cast<double>(ring.radius);
    if (!(distance > radius)) return glm::vec3(1);
    // A unit vector that turns by an angle moves by no more than the angle.
    const glm::dvec3 reached = glm::abs(to_light / distance) + std::asin(radius / distance);
    return glm::vec3(glm::min(reached, glm::dvec3(1)));
}

} // namespace

struct LitFolds::State {
    std::array<Records, 3> by_axis;
    std::vector<FoldRecord> albedo; // empty: the same everywhere
    LightBounds bounds;
};

Result<LitFolds> LitFolds::measure(const VertexTree& tree, int threads, const Progress& progress) {
    const bool is_painted = !tree.colours().empty();
    const std::size_t passes = is_painted ? 4 : 3;
    auto state = std::make_shared<State>();
    for (std::size_t pass = 0; pass < passes; ++pass) {
        const Progress told = [&](double share, const char* stage) {
            return !progress || progress((static_cast<double>(pass) + share) / static_cast<double>(passes), stage);
        };
        const auto luminance = [&](NodeId node) {
            const float albedo = albedo_of(tree, node);
            if (pass == 3) return albedo;
            return (offset + albedo * glm::vec3(tree.normals()[node])[static_cast<int>(pass)]) / scale;
        };
        auto records = measure_shaded(tree, luminance, threads, told);
        if (!records) return records.error();
        if (pass < 3) state->by_axis[pass] = std::move(*records);
        else state->albedo = std::move(records->folds);
    }
    auto bounds = LightBounds::measure(tree);
    if (!bounds) return bounds.error();
    state->bounds = std::move(*bounds);
    return LitFolds(std::move(state));
}

Result<VertexTree> LitFolds::under(const VertexTree& tree, const Lighting& lighting) const {
    if (const auto valid = validate(lighting); !valid) return valid.error();
    if (lighting.specular > 0)
        return Error{ErrorCode::unsupported,
                     "What folds change of highlights is not measured, for these follow the eye."};
    if (state_->by_axis[0].folds.size() != tree.interior_count())
        return Error{ErrorCode::invalid_argument, "What folds change under lights was measured of another tree."};
    const auto lit = tree.shaded([&](NodeId node) {
        return static_cast<float>(lit_luminance(lighting, glm::dvec3(tree.positions()[node]),
                                                glm::dvec3(glm::vec3(tree.normals()[node])),
                                                static_cast<double>(albedo_of(tree, node)), glm::dvec3(0)));
    });
    if (!lit) return lit.error();

    std::vector<Lighting> alone; // each light by itself, of white
    for (const LightSource& light : lighting.lights) alone.push_back({.lights = {light}});
    std::vector<FoldRecord> folds = state_->by_axis[0].folds;
    std::vector<FoldFacing> facing = state_->by_axis[0].facing;
    const auto ambient = static_cast<float>(lighting.ambient);
    tbb::parallel_for(NodeId{0}, tree.interior_count(), [&](NodeId node) {
        const VertexCone& cone = state_->bounds.cones()[node];
        const Sphere ring = tree.bounds()[node].ring;
        // Of all lights that something in the ring faces: a light from l makes l a n of a vertex, so a change of a n by
        // at most v along each axis comes to |l_k| v_k at most.
        glm::vec3 most(0);
        float uneven = 0;
        for (std::size_t i = 0; i < alone.size(); ++i) {
            if (!(lit_range(alone[i], cone, ring, glm::dvec3(0)).hi > least_lit)) continue;
            const Reach reach = reach_of(lighting.lights[i], ring);
            most += reach.most * direction_bound(lighting.lights[i], ring);
            uneven += reach.uneven * cone.albedo.hi;
        }
        const auto combined = [&](auto&& value) {
            float of_axes = 0;
            for (int k = 0; k < 3; ++k)
                of_axes += most[k] * value(state_->by_axis[static_cast<std::size_t>(k)].folds[node]);
            const float painted = state_->albedo.empty() ? 0 : ambient * value(state_->albedo[node]);
            return painted + scale * of_axes;
        };
        FoldRecord& fold = folds[node];
        // Which neighbours are folded with a node depends on their luminances, so these differ a little.
        for (const Records& axis : state_->by_axis) {
            const FoldRecord& other = axis.folds[node];
            for (float FoldRecord::*length : {&FoldRecord::shift, &FoldRecord::farthest, &FoldRecord::mean_distance,
                                              &FoldRecord::extent, &FoldRecord::border})
                fold.*length = std::max(fold.*length, other.*length);
            fold.gap = std::min(fold.gap, other.gap), fold.sine = std::min(fold.sine, other.sine);
        }
        const auto set = [&](float& to, float value) { to = std::min(1.0f, value); }; // luminances end there
        set(fold.largest_luminance, uneven + combined([](const FoldRecord& r) { return r.largest_luminance; }));
        set(fold.mean_luminance, uneven + combined([](const FoldRecord& r) { return r.mean_luminance; }));
        for (std::size_t size = 0; size < measurement::picture_sizes.size(); ++size)
            for (std::size_t band = 0; band < measurement::picture_bands; ++band)
                set(fold.amplitudes[size][band],
                    combined([&](const FoldRecord& r) { return r.amplitudes[size][band]; }));
        float& widest = fold.amplitudes[measurement::picture_sizes.size() - 1][measurement::picture_bands - 1];
        set(widest, widest + uneven);
        const LuminanceRange range = lit->support_luminance()[node];
        const float middle = std::max((range.lo + range.hi) / 2, least_luminance);
        fold.bias = combined([&](const FoldRecord& r) { return brightest * r.bias; }) / middle;
        for (const Records& axis : state_->by_axis) {
            facing[node].fading = std::min(facing[node].fading, axis.facing[node].fading);
            facing[node].facing |= axis.facing[node].facing;
            facing[node].is_height_field &= axis.facing[node].is_height_field;
        }
    });
    return with_records(*lit, {std::move(folds), std::move(facing)});
}

} // namespace unseen::perception
