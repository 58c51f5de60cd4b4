// Luminances in the pictures are (2 + a n_k) / 4: what measures them takes them for positive.
#include <unseen/perception/internal/lit_folds.h>

#include <cstring>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <unseen/perception/fold_measurement.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/internal/parallel.h>

#include "measure/measure_folds.h"

namespace unseen::perception {

using namespace vdtree;

namespace {

constexpr float offset = 2, scale = 4; // of luminances in the pictures of a n
// Within a ring of the angular radius x, seen from a light, its light is a quadratic of the place but for less than
// this times x^2, as a share: 1/8 of the square of the ring's diameter times the second derivatives of 1 / d^2 and of
// the direction, 6 / d^2 and 1 / d^2, rounded up.
constexpr float falloff_curvature = 4;
constexpr float least_lit = 1e-5f; // what is less lit is dark: below a step of stored luminances

// What is kept with a measurement: its own numbers, and all of measure_folds().
constexpr int revision = 3; // one more where the same settings give other numbers
constexpr auto settings = [] {
    std::array<float, 5 + measurement::settings.size()> all = {revision, offset, scale, LitStages::lights,
                                                               LitStages::brightest};
    std::copy(measurement::settings.begin(), measurement::settings.end(), all.begin() + 5);
    return all;
}();
constexpr std::string_view lit_record_name = "lit_folds", lit_facing_name = "lit_facing",
                           lit_albedo_name = "lit_albedo", lit_texture_name = "lit_texture",
                           lit_stage_of_name = "lit_stage", lit_stages_name = "lit_stages",
                           lit_settings_name = "lit_measurement";

// What a fold changes of a luminance: of FoldRecord.
struct Shades {
    using Component = float;

    float largest = 0, mean = 0;
    float amplitudes[measurement::picture_sizes.size()][measurement::picture_bands] = {};
};
static_assert(sizeof(Shades) == 10 * sizeof(float));

// What light changes at an interior node.
struct LitRecord {
    using Component = float;

    float shift = 0, farthest = 0, mean_distance = 0, extent = 0, border = 0, thickness = 0;
    float gap = 0, sine = 1;
    Shades of_axis[3]; // of a n_k in the pictures' luminances
};
static_assert(sizeof(LitRecord) == 38 * sizeof(float));

constexpr std::pair<float LitRecord::*, float FoldRecord::*> lengths[] = {
    {&LitRecord::shift, &FoldRecord::shift},
    {&LitRecord::farthest, &FoldRecord::farthest},
    {&LitRecord::mean_distance, &FoldRecord::mean_distance},
    {&LitRecord::extent, &FoldRecord::extent},
    {&LitRecord::border, &FoldRecord::border},
    {&LitRecord::thickness, &FoldRecord::thickness}};

bool is_sound(const Shades& shades) {
    bool sound = true;
    const auto look_at = [&](float value) { sound &= value >= 0 && std::isfinite(value); };
    for (const float value : {shades.largest, shades.mean}) look_at(value);
    for (const auto& of_size : shades.amplitudes)
        for (const float amplitude : of_size) look_at(amplitude);
    return sound;
}

bool is_sound(const LitRecord& record) {
    bool sound = record.gap >= 0 && record.sine >= 0 && record.sine <= 1;
    for (const auto& [length, its] : lengths) sound &= record.*length >= 0 && std::isfinite(record.*length);
    for (const Shades& shades : record.of_axis) sound &= is_sound(shades);
    return sound;
}

Shades shades_of(const FoldRecord& record) {
    Shades shades{record.largest_luminance, record.mean_luminance, {}};
    std::memcpy(shades.amplitudes, record.amplitudes, sizeof shades.amplitudes);
    return shades;
}

void include(const FoldRecord& other, LitRecord& record) {
    for (const auto& [length, its] : lengths) record.*length = std::max(record.*length, other.*its);
    record.gap = std::min(record.gap, other.gap), record.sine = std::min(record.sine, other.sine);
}

void include(const FoldFacing& other, FoldFacing& facing) {
    facing.facing |= other.facing;
    facing.is_height_field &= other.is_height_field;
}

// Whether albedo is not the same everywhere.
bool has_albedo(const VertexTree& tree) { return !tree.colours().empty() || has_detail(tree); }

Error refused(const std::string& what) {
    return {ErrorCode::malformed_data, "What the tree's folds change under lights is damaged: " + what +
                                           " Measure it again, or build the tree again from its mesh."};
}

// What one light does at a node.
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

// The least that white has of a light that it faces, anywhere in a sphere.
float least_of(const LightSource& light, const Sphere& sphere) {
    if (light.kind == LightSource::Kind::directional) return static_cast<float>(light.intensity);
    const glm::dvec3 to_sphere = glm::dvec3(sphere.centre) - light.position;
    const double distance = glm::length(to_sphere), radius = static_cast<double>(sphere.radius),
                 ratio = light.distance / (distance + radius);
    const auto least = static_cast<float>(light.intensity * ratio * ratio);
    if (light.kind != LightSource::Kind::spot) return least;
    if (!(distance > radius)) return 0;
    const double angle = std::acos(std::clamp(glm::dot(to_sphere, light.direction) / distance, -1.0, 1.0));
    return least * share_at(light, angle + std::asin(radius / distance));
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

// From the darkest highlight in the ring to the brightest. `glossy`: lights without ambient light.
float spread_of_highlights(const Lighting& glossy, VertexCone cone, const Sphere& ring, glm::dvec3 eye) {
    cone.albedo = {0, 0}; // so that highlights are all that there is
    const LuminanceRange range = lit_range(glossy, cone, ring, eye);
    return range.hi > least_lit ? range.hi - range.lo : 0;
}

Illumination illumination_of(const Lighting& lighting, const VertexTree& tree) {
    Illumination all{static_cast<float>(lighting.ambient), 0, 0};
    const Sphere sphere = tree.bounds()[VertexTree::root()].ring;
    for (const LightSource& light : lighting.lights) {
        const Reach reach = reach_of(light, sphere);
        all.most += reach.most;
        all.least += least_of(light, sphere);
    }
    return all;
}

} // namespace

struct LitFolds::State {
    std::vector<LitRecord> folds; // by interior node, as the others
    std::vector<FoldFacing> facing;
    std::vector<Shades> albedo;        // empty: the same everywhere
    std::vector<FoldTexture> textures; // of textured trees; else empty
    std::vector<std::uint8_t> stage_of;
    LitStages stages;
    std::shared_ptr<const TextureDetail> texture; // null: none
    LightBounds bounds;

    // Finds what is not kept in files.
    Result<void> look_at(const VertexTree& tree) {
        auto its_bounds = LightBounds::measure(tree);
        if (!its_bounds) return its_bounds.error();
        bounds = std::move(*its_bounds), texture = texture_detail_of(tree);
        return {};
    }
};

Result<LitFolds> LitFolds::measure(const VertexTree& tree, int threads, const Progress& progress) {
    if (!knows_lit_texture(tree))
        return unsupported("What folds change of a texture over vertices of several hues is not measured under lights: "
                           "take another fold test, or the tree without its texture.");
    std::vector<Shading> shadings;
    for (int axis = 0; axis < 3; ++axis)
        shadings.push_back([&tree, axis](WedgeId wedge) {
            return (offset + albedo_of(tree, wedge) * glm::vec3(tree.normals()[wedge])[axis]) / scale;
        });
    if (has_albedo(tree)) shadings.push_back([&tree](WedgeId wedge) { return albedo_of(tree, wedge); });
    constexpr float unlit = offset / scale; // what a vertex is in the pictures that no light makes bright
    constexpr float dark[] = {unlit, unlit, unlit, 0};
    auto measured = measure_shadings(tree, shadings, std::span(dark).first(shadings.size()), scale, threads, progress);
    if (!measured) return measured.error();
    auto state = std::make_shared<State>();
    const auto& axes = measured->of;
    LitRecord none;
    none.gap = std::numeric_limits<float>::infinity();
    state->folds.assign(tree.interior_count(), none);
    state->facing = axes[0].facing;
    for (NodeId node = 0; node < tree.interior_count(); ++node)
        for (std::size_t axis = 0; axis < 3; ++axis) {
            include(axes[axis].folds[node], state->folds[node]);
            include(axes[axis].facing[node], state->facing[node]);
            state->folds[node].of_axis[axis] = shades_of(axes[axis].folds[node]);
        }
    if (axes.size() > 3)
        for (const FoldRecord& fold : axes[3].folds) state->albedo.push_back(shades_of(fold));
    state->textures = axes[0].textures;
    state->stage_of = std::move(measured->stage_of);
    state->stages = std::move(measured->stages);
    if (auto ok = state->look_at(tree); !ok) return ok.error();
    return LitFolds(std::move(state));
}

bool has_lit_folds(const VertexTree& tree) { return !tree.attribute<LitRecord>(lit_record_name).empty(); }

std::span<const float> lit_measurement_settings() noexcept { return settings; }

Result<LitFolds> LitFolds::of(const VertexTree& tree) {
    if (!has_lit_folds(tree))
        return invalid_argument("What the tree's folds change under lights has not been measured (LitFolds::measure).");
    if (!std::ranges::equal(tree.attribute<float>(lit_settings_name), settings))
        return unsupported("What the tree's folds change under lights was measured with other "
                           "settings than this program knows: measure it again.");
    const auto folds = tree.attribute<LitRecord>(lit_record_name);
    const auto facing = tree.attribute<FoldFacing>(lit_facing_name);
    const auto albedo = tree.attribute<Shades>(lit_albedo_name);
    const auto textures = tree.attribute<FoldTexture>(lit_texture_name);
    const auto stage_of = tree.attribute<std::uint8_t>(lit_stage_of_name);
    const auto stages = tree.attribute<FoldStage>(lit_stages_name);
    const std::size_t nodes = tree.interior_count(), stage_count = stages.size() / LitStages::ambient_shares.size();
    if (folds.size() != nodes || facing.size() != nodes || stage_of.size() != nodes ||
        stages.size() % LitStages::ambient_shares.size() != 0 || albedo.size() != (has_albedo(tree) ? nodes : 0) ||
        textures.size() != (has_detail(tree) ? nodes : 0))
        return refused("a part of it is missing.");
    for (const FoldStage& stage : stages)
        if (!is_sound(stage)) return refused("a contrast of a stage is negative or not finite.");
    for (std::size_t node = 0; node < nodes; ++node) {
        if (!stages.empty() && stage_of[node] >= stage_count)
            return refused("node " + std::to_string(node) + " folds in a stage that is not there.");
        if (!is_sound(folds[node]) || facing[node].fading > most_fading ||
            !(albedo.empty() || is_sound(albedo[node])) || !(textures.empty() || is_sound(textures[node])))
            return refused("a number of node " + std::to_string(node) + " is negative or not finite.");
    }
    auto state = std::make_shared<State>();
    state->folds.assign(folds.begin(), folds.end());
    state->facing.assign(facing.begin(), facing.end());
    state->albedo.assign(albedo.begin(), albedo.end());
    state->textures.assign(textures.begin(), textures.end());
    state->stage_of.assign(stage_of.begin(), stage_of.end());
    state->stages.by_share.assign(stages.begin(), stages.end());
    if (auto ok = state->look_at(tree); !ok) return ok.error();
    return LitFolds(std::move(state));
}

Result<VertexTree> LitFolds::with_attributes(const VertexTree& tree) const {
    if (state_->folds.size() != tree.interior_count() || state_->albedo.empty() == has_albedo(tree) ||
        state_->textures.empty() == has_detail(tree))
        return invalid_argument("What folds change under lights was measured of another tree.");
    Result<VertexTree> with = tree.share();
    add_attribute(with, lit_settings_name, AttributeDomain::tree, std::vector<float>(settings.begin(), settings.end()));
    add_attribute(with, lit_record_name, AttributeDomain::interior_node, state_->folds);
    add_attribute(with, lit_facing_name, AttributeDomain::interior_node, state_->facing);
    if (!state_->albedo.empty()) add_attribute(with, lit_albedo_name, AttributeDomain::interior_node, state_->albedo);
    if (!state_->textures.empty())
        add_attribute(with, lit_texture_name, AttributeDomain::interior_node, state_->textures);
    add_attribute(with, lit_stage_of_name, AttributeDomain::interior_node, state_->stage_of);
    add_attribute(with, lit_stages_name, AttributeDomain::tree, state_->stages.by_share);
    return with;
}

Result<VertexTree> LitFolds::under(const VertexTree& tree, const Lighting& lighting,
                                   std::optional<glm::dvec3> eye) const {
    if (const auto valid = validate(lighting); !valid) return valid.error();
    const bool has_highlights = lighting.specular > 0;
    if (has_highlights && !eye)
        return unsupported("What folds change of highlights is known for one eye alone, which these follow.");
    if (state_->folds.size() != tree.interior_count())
        return invalid_argument("What folds change under lights was measured of another tree.");
    Lighting matt = lighting, glossy = lighting; // without highlights, and these alone
    matt.specular = 0;
    glossy.ambient = 0;
    const auto lit = tree.shaded(
        [&](WedgeId wedge) {
            return static_cast<float>(lit_luminance(matt, glm::dvec3(tree.positions()[wedge]),
                                                    glm::dvec3(glm::vec3(tree.normals()[wedge])),
                                                    static_cast<double>(albedo_of(tree, wedge)), glm::dvec3(0)));
        },
        true);
    if (!lit) return lit.error();

    std::vector<Lighting> alone; // each light by itself, of white
    for (const LightSource& light : lighting.lights) alone.push_back({.lights = {light}});
    std::vector<FoldRecord> folds(tree.interior_count());
    const auto ambient = static_cast<float>(lighting.ambient);
    parallel_loop(NodeId{0}, tree.interior_count(), [&](NodeId node) {
        const VertexCone& cone = state_->bounds.cones()[node];
        const Sphere ring = tree.bounds()[node].ring;
        // Over all lights that something in the ring faces: a light from l makes l a n of a vertex, so a change of a n
        // by at most v along each axis comes to |l_k| v_k at most.
        glm::vec3 most(0);
        float uneven = 0;
        for (std::size_t i = 0; i < alone.size(); ++i) {
            if (!(lit_range(alone[i], cone, ring, glm::dvec3(0)).hi > least_lit)) continue;
            const Reach reach = reach_of(lighting.lights[i], ring);
            most += reach.most * direction_bound(lighting.lights[i], ring);
            uneven += reach.uneven * cone.albedo.hi;
        }
        const float highlights = has_highlights ? spread_of_highlights(glossy, cone, ring, *eye) : 0;
        const LitRecord& record = state_->folds[node];
        const auto combined = [&](auto&& value) {
            float of_axes = 0;
            for (int k = 0; k < 3; ++k) of_axes += most[k] * value(record.of_axis[k]);
            const float painted = state_->albedo.empty() ? 0 : ambient * value(state_->albedo[node]);
            return painted + scale * of_axes;
        };
        FoldRecord& fold = folds[node];
        for (const auto& [length, its] : lengths) fold.*its = record.*length;
        fold.gap = record.gap, fold.sine = record.sine;
        const auto set = [&](float& to, float value) { to = std::min(1.0f, value); }; // luminances end there
        set(fold.largest_luminance, uneven + highlights + combined([](const Shades& s) { return s.largest; }));
        set(fold.mean_luminance, uneven + highlights + combined([](const Shades& s) { return s.mean; }));
        for (std::size_t size = 0; size < measurement::picture_sizes.size(); ++size)
            for (std::size_t band = 0; band < measurement::picture_bands; ++band)
                set(fold.amplitudes[size][band],
                    highlights / 2 + combined([&](const Shades& s) { return s.amplitudes[size][band]; }));
        float& widest = fold.amplitudes[measurement::picture_sizes.size() - 1][measurement::picture_bands - 1];
        set(widest, widest + uneven);
    });
    MeasuredFolds measured{std::move(folds), state_->facing, state_->textures};
    if (const auto added = add_luminance_bias(*lit, state_->texture.get(), measured); !added) return added.error();
    if (has_highlights) return with_records(*lit, std::move(measured), state_->stage_of, {}); // these know none
    return with_records(*lit, std::move(measured), state_->stage_of,
                        state_->stages.under(illumination_of(lighting, tree)));
}

} // namespace unseen::perception
