#include "measure/measure_folds.h"

#include <tbb/task_arena.h>

#include <unseen/perception/fold_measurement.h>
#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/fold_sequence.h>

#include "measure/fold_measurer.h"

namespace unseen::perception {

using namespace vdtree;
using namespace measurement;

namespace {

void scale_lengths(FoldRecord& record, float scale) {
    for (float* length : {&record.shift, &record.farthest, &record.mean_distance, &record.extent, &record.gap,
                          &record.border, &record.thickness})
        *length *= scale;
}

// Lengths in the tree's own units again. False if a length is not finite there.
bool scale_back(FoldRecord& record, float scale) {
    if (std::isfinite(record.gap) && !std::isfinite(record.gap / scale)) return false;
    scale_lengths(record, 1 / scale);
    return is_sound(record);
}

// The colour that all vertices have but for their brightness; none where they have several. Black ones have any.
std::optional<glm::vec3> common_tint(const VertexTree& tree) {
    constexpr float alike = 1e-3f; // of channels, over the luminance: far less than a texture's luminance is wrong by
    std::optional<glm::vec3> tint;
    for (const glm::vec4& colour : tree.colours()) {
        const glm::vec3 rgb(colour);
        const auto luminance = static_cast<float>(rec709_luminance(glm::dvec3(rgb)));
        if (!(luminance > 0)) continue;
        const glm::vec3 own = rgb / luminance;
        if (!tint) tint = own;
        for (int k = 0; k < 3; ++k)
            if (!(std::abs(own[k] - (*tint)[k]) <= alike)) return std::nullopt;
    }
    return tint ? *tint : glm::vec3(1);
}

// `texels`: those of the tree, where it has a texture.
std::shared_ptr<const TextureDetail> detail_of(const VertexTree& tree, const std::optional<ShownTexels>& texels) {
    if (!texels) {
        if (!has_detail(tree)) return nullptr;
        // Alone: a thread that waits here must not begin another measurement, which would wait for this.
        static const auto stand_in = tbb::this_task_arena::isolate(
            [] { return std::make_shared<const TextureDetail>(TextureDetail::stand_in(1)); });
        return stand_in;
    }
    const glm::vec3 tint = common_tint(tree).value_or(glm::vec3(1));
    TextureDetail detail(*texels, tint);
    if (texels->are_alike()) detail = TextureDetail::stand_in(detail.at(detail.level_count() - 1, glm::vec2(0)));
    return std::make_shared<const TextureDetail>(std::move(detail));
}

} // namespace

std::shared_ptr<const TextureDetail> texture_detail_of(const VertexTree& tree) {
    if (tree.texture().empty()) return detail_of(tree, std::nullopt);
    return detail_of(tree, ShownTexels(tree));
}

bool has_detail(const VertexTree& tree) {
    const std::span<const glm::vec2> uvs = tree.uvs();
    return !tree.texture().empty() || std::ranges::any_of(uvs, [&](const glm::vec2& uv) { return uv != uvs.front(); });
}

bool knows_lit_texture(const VertexTree& tree) { return tree.texture().empty() || common_tint(tree).has_value(); }

bool has_fold_measurement(const VertexTree& tree) { return !tree.attribute<FoldRecord>(record_name).empty(); }

std::span<const float> measurement_settings() noexcept { return settings; }

namespace {

// The tree in units in which no product of lengths overflows or vanishes. `geometry`: kept for others of the same one.
Result<SoundTree> in_units(const VertexTree& tree, float scale, std::shared_ptr<const TreeGeometry>& geometry) {
    auto sound = SoundTree::of(tree);
    if (!sound || scale == 1) return sound;
    if (!geometry) geometry = scaled_geometry(tree.data().geometry, scale);
    const auto scaled = std::make_shared<VertexTree::Data>(tree.data());
    scaled->geometry = geometry;
    return SoundTree::of(VertexTree(scaled));
}

Error cancelled_error() { return {ErrorCode::cancelled, "Measuring what folds change was cancelled."}; }

// How a coloured tree is drawn.
struct Colours {
    std::vector<glm::vec3> rgb;                                     // by wedge; times the texture
    std::vector<std::shared_ptr<const TextureDetail>> texture = {}; // by primary; none: no texture

    // By primary where there is a texture, else one for all.
    std::vector<TexturedLight> lights() const {
        std::vector<TexturedLight> all;
        for (const auto& primary : texture) all.push_back({primary.get(), 0});
        if (all.empty()) all.emplace_back();
        return all;
    }
};

// Nothing of grey trees. `detail`: of the tree's texture, to which the colours are added.
std::optional<Colours> colours_of(const VertexTree& tree, const std::optional<ShownTexels>& texels,
                                  std::shared_ptr<const TextureDetail>& detail) {
    if (!has_colours(tree)) return std::nullopt;
    Colours of{std::vector<glm::vec3>(tree.wedge_count())};
    const auto colours = tree.colours();
    for (WedgeId wedge = 0; wedge < of.rgb.size(); ++wedge) {
        const float luminance = tree.luminance()[wedge];
        of.rgb[wedge] = colours.empty() ? glm::vec3(luminance) : drawn_colour(colours[wedge], luminance);
    }
    if (!detail) return of;
    if (!texels) {
        of.texture.assign(3, detail);
        return of;
    }
    const bool are_alike = texels->are_alike();
    for (int k = 0; k < 3; ++k)
        of.texture.push_back(std::make_shared<const TextureDetail>(
            are_alike ? TextureDetail::stand_in(texels->colour(0)[k]) : TextureDetail::of_primary(*texels, k)));
    if (!are_alike) {
        TextureDetail with_colours = *detail;
        with_colours.include_colours(of.texture);
        detail = std::make_shared<const TextureDetail>(std::move(with_colours));
    }
    return of;
}

// Measurements of trees that are the same but for their luminances, with what follows from each.
struct Measured {
    std::vector<MeasuredFolds> found;           // by tree
    std::vector<std::vector<FoldError>> errors; // likewise, in the units that were measured in
    std::vector<SoundTree> in_units;            // the trees in these
    std::shared_ptr<const TextureDetail> texture;
    std::vector<TexturedLight> lights; // by tree
    std::optional<Colours> colours;    // of a single tree
};

// What is measured of which trees; `found`: by tree, or by as_luminances() of a tree's colours.
struct Measuring {
    std::span<const SoundTree> trees;
    std::span<const TexturedLight> lights; // by luminance
    const TextureDetail* texture = nullptr;
    const Colours* colours = nullptr;
    std::span<MeasuredFolds> found;
    double up_to; // the share of the whole that this is
};

// False where it was cancelled.
template <std::size_t luminances, bool is_textured, std::size_t deciding = luminances>
bool measure_all(const Measuring& m, MeasuringProgress& progress) {
    constexpr double contacts_done = 0.2; // of it
    progress.begin(contacts_done * m.up_to, static_cast<double>(m.trees.front().triangles().size()));
    std::vector<Contact> contacts = find_contacts(m.trees, m.colours != nullptr, progress);
    progress.begin(m.up_to, m.trees.front().interior_count());
    const auto luminance = [&](std::size_t i, WedgeId wedge) -> float {
        if (!m.colours) return m.trees[i].luminance()[wedge];
        const glm::vec3 rgb = m.colours->rgb[wedge];
        return (is_textured ? rgb : as_luminances(rgb))[static_cast<int>(i)];
    };
    return Measurer<luminances, is_textured, deciding>(m.trees, luminance, m.lights, m.texture, m.found,
                                                       std::move(contacts))
        .run(progress);
}

using MeasureAll = bool (*)(const Measuring&, MeasuringProgress&);
MeasureAll measurer_of(std::size_t trees, bool is_textured, bool has_colours) {
    if (has_colours) return is_textured ? measure_all<3, true, 1> : measure_all<3, false, 1>;
    if (trees == 1) return is_textured ? measure_all<1, true> : measure_all<1, false>;
    if (trees == 3) return measure_all<3, false>;
    return is_textured ? measure_all<4, true> : measure_all<4, false>;
}

// Leaves one measurement of those of a tree's colours, of which the root of the sum of squares counts.
void put_together(std::vector<MeasuredFolds>& found) {
    for (std::size_t node = 0; node < found.front().folds.size(); ++node) {
        FoldRecord& all = found[0].folds[node];
        const auto together = [&](auto&& of) {
            of(all) = glm::length(glm::vec3(of(all), of(found[1].folds[node]), of(found[2].folds[node])));
        };
        together([](FoldRecord& r) -> float& { return r.largest_luminance; });
        together([](FoldRecord& r) -> float& { return r.mean_luminance; });
        for (std::size_t size = 0; size < picture_sizes.size(); ++size)
            for (std::size_t band = 0; band < picture_bands; ++band)
                together([&](FoldRecord& r) -> float& { return r.amplitudes[size][band]; });
    }
    found.resize(1);
}

// Without shifts of the mean. `own`: the tree that they are of, in its own light. `dark`: of textured trees, by tree, what
// their luminance is where the texture is black. `up_to`: the share of the whole that this is.
Result<Measured> measure(const VertexTree& own, std::span<const VertexTree> trees, std::span<const float> dark,
                         int threads, double up_to, MeasuringProgress& progress) {
    const bool is_textured = has_detail(trees.front());
    assert(trees.size() == 1 || trees.size() == 4 || (trees.size() == 3 && !is_textured));
    Measured all;
    const float scale = unit_scale(trees.front().bounding_sphere().radius);
    std::shared_ptr<const TreeGeometry> geometry;
    for (const VertexTree& tree : trees) {
        auto measured = in_units(tree, scale, geometry);
        if (!measured) return measured.error();
        all.in_units.push_back(std::move(*measured));
    }
    const NodeId nodes = trees.front().interior_count();
    const std::optional<ShownTexels> texels = own.texture().empty() ? std::nullopt : std::optional<ShownTexels>(own);
    all.texture = detail_of(own, texels);
    if (trees.size() == 1) all.colours = colours_of(own, texels, all.texture);
    all.found.resize(all.colours ? 3 : trees.size());
    for (MeasuredFolds& found : all.found) {
        found.folds.resize(nodes), found.facing.resize(nodes);
        if (is_textured) found.textures.resize(nodes);
    }
    all.errors.resize(trees.size());
    for (std::size_t i = 0; i < trees.size(); ++i) all.lights.push_back({all.texture.get(), dark[i]});
    const std::vector<TexturedLight> lights = all.colours ? all.colours->lights() : all.lights;
    const Measuring measuring{.trees = all.in_units,
                              .lights = lights,
                              .texture = all.texture.get(),
                              .colours = all.colours ? &*all.colours : nullptr,
                              .found = all.found,
                              .up_to = up_to};
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    bool is_whole = false;
    arena.execute([&] {
        is_whole = measurer_of(trees.size(), is_textured, all.colours.has_value())(measuring, progress);
        if (!is_whole) return;
        if (all.colours) put_together(all.found);
        parallel_loop(std::size_t{0}, trees.size(), [&](std::size_t i) {
            const MeasuredFolds& found = all.found[i];
            all.errors[i] = nested_errors(all.in_units[i], found.folds, found.facing, found.textures, FoldModel());
        });
    });
    if (!is_whole) return cancelled_error();
    for (MeasuredFolds& found : all.found)
        for (NodeId node = 0; node < nodes; ++node)
            if (!scale_back(found.folds[node], scale))
                return unsupported("What folding node " + std::to_string(node) +
                                   " changes is beyond all numbers: the mesh is too large.");
    return all;
}

constexpr double before_stages = 0.8; // of the whole

void copy_bias(std::span<const FoldError> errors, MeasuredFolds& to) {
    for (std::size_t node = 0; node < errors.size(); ++node) {
        to.folds[node].bias = errors[node].bias;
        to.facing[node].fading = errors[node].fading;
    }
}

std::vector<std::uint8_t> stages_of(std::span<const FoldError> errors) {
    std::vector<std::uint8_t> stage_of(errors.size());
    for (std::size_t node = 0; node < errors.size(); ++node) stage_of[node] = errors[node].stage;
    return stage_of;
}

// By stage: whether nothing moves, up to it. Where folds in a plane move its border by the rounding of floats, a sample of
// a picture may come to lie on the other side of it: no contrast that anybody could see, but one that the pictures tell of.
std::vector<std::uint8_t> stages_without_motion(const VertexTree& tree, std::span<const MeasuredFolds> found,
                                                std::span<const FoldError> errors) {
    constexpr float least_motion = 1e-5f;    // share of the radius; 400th of a sample
    constexpr float least_luminance = 1e-5f; // relative; below the steps in which it is stored
    const float length = least_motion * tree.bounding_sphere().radius;
    std::vector<std::uint8_t> still(256, 1);
    for (const MeasuredFolds& of : found)
        for (std::size_t node = 0; node < errors.size(); ++node) {
            const FoldRecord& fold = of.folds[node];
            const bool slides = !of.textures.empty() && !(of.textures[node].slide * fold.extent <= length);
            if (slides || !(fold.farthest <= length && fold.border <= length) ||
                !(fold.largest_luminance <= least_luminance))
                still[errors[node].stage] = 0;
        }
    for (std::size_t stage = 1; stage < still.size(); ++stage) still[stage] &= still[stage - 1];
    return still;
}

// What folds change under light from everywhere, as far as the order goes in which they fold: half as much along each
// axis as a light from there.
std::vector<FoldError> errors_in_any_light(const Measured& measured, float to_light) {
    std::vector<FoldError> errors = measured.errors.front();
    for (std::size_t i = 0; i < measured.errors.size(); ++i) {
        const float factor = i < 3 ? to_light / 2 : 1;
        for (std::size_t node = 0; node < errors.size(); ++node) {
            const FoldError& of = measured.errors[i][node];
            errors[node].mean_distance = std::max(errors[node].mean_distance, of.mean_distance);
            const auto include = [&](float& to, float value) {
                to = i == 0 ? factor * value : std::max(to, factor * value);
            };
            include(errors[node].luminance, of.luminance);
            include(errors[node].wide_luminance, of.wide_luminance);
        }
    }
    return errors;
}

} // namespace

Result<VertexTree> measure_folds(const VertexTree& tree, int threads, const Progress& progress) {
    MeasuringProgress told(progress);
    constexpr float dark = 0;
    auto measured = measure(tree, std::span(&tree, 1), std::span(&dark, 1), threads, before_stages, told);
    if (!measured) return measured.error();
    std::vector<FoldError>& errors = measured->errors.front();
    std::vector<FoldStage> stages;
    tbb::task_arena(threads > 0 ? threads : tbb::task_arena::automatic).execute([&] {
        find_luminance_bias(measured->in_units.front(), measured->lights.front(), measured->found.front().textures,
                            errors);
        copy_bias(errors, measured->found.front());
        const std::optional<Colours>& colours = measured->colours;
        stages =
            find_stages(measured->in_units.front(),
                        colours ? std::span<const glm::vec3>(colours->rgb) : std::span<const glm::vec3>(),
                        colours ? colours->lights() : measured->lights, measured->found.front().textures, errors, told);
    });
    if (told.is_cancelled()) return cancelled_error();
    const auto still = stages_without_motion(tree, measured->found, errors);
    for (std::size_t stage = 0; stage < stages.size(); ++stage)
        if (still[stage]) stages[stage] = {};
    return with_records(tree, std::move(measured->found.front()), stages_of(errors), std::move(stages));
}

Result<MeasuredShadings> measure_shadings(const VertexTree& tree, std::span<const Shading> shadings,
                                          std::span<const float> dark, float to_light, int threads,
                                          const Progress& progress) {
    std::vector<VertexTree> shaded;
    for (const Shading& luminance : shadings) {
        auto as_shaded = tree.shaded(luminance, !tree.texture().empty());
        if (!as_shaded) return as_shaded.error();
        shaded.push_back(std::move(*as_shaded));
    }
    MeasuringProgress told(progress);
    auto measured = measure(tree, shaded, dark, threads, before_stages, told);
    if (!measured) return measured.error();
    std::vector<FoldError> errors = errors_in_any_light(*measured, to_light);
    MeasuredShadings all;
    tbb::task_arena(threads > 0 ? threads : tbb::task_arena::automatic).execute([&] {
        all.stages = find_lit_stages(measured->in_units.front(), {measured->texture.get(), 0},
                                     measured->found.front().textures, errors, told);
    });
    if (told.is_cancelled()) return cancelled_error();
    const auto still = stages_without_motion(tree, measured->found, errors);
    for (std::size_t i = 0; i < all.stages.by_share.size(); ++i)
        if (still[i % all.stages.stage_count()]) all.stages.by_share[i] = {};
    all.stage_of = stages_of(errors);
    all.of = std::move(measured->found);
    return all;
}

Result<void> add_luminance_bias(const VertexTree& tree, const TextureDetail* texture, MeasuredFolds& measured) {
    const float scale = unit_scale(tree.bounding_sphere().radius);
    std::shared_ptr<const TreeGeometry> geometry;
    const auto measured_in = in_units(tree, scale, geometry);
    if (!measured_in) return measured_in.error();
    std::vector<FoldRecord> records = measured.folds;
    for (FoldRecord& record : records) scale_lengths(record, scale);
    auto errors = nested_errors(*measured_in, records, measured.facing, measured.textures, FoldModel());
    find_luminance_bias(*measured_in, {texture, 0}, measured.textures, errors);
    copy_bias(errors, measured);
    return {};
}

Result<VertexTree> with_records(const VertexTree& tree, MeasuredFolds measured, std::vector<std::uint8_t> stage_of,
                                std::vector<FoldStage> stages) {
    Result<VertexTree> with = tree.share();
    add_attribute(with, settings_name, AttributeDomain::tree, std::vector<float>(settings.begin(), settings.end()));
    add_attribute(with, record_name, AttributeDomain::interior_node, std::move(measured.folds));
    add_attribute(with, facing_name, AttributeDomain::interior_node, std::move(measured.facing));
    if (!measured.textures.empty())
        add_attribute(with, texture_name, AttributeDomain::interior_node, std::move(measured.textures));
    add_attribute(with, stage_of_name, AttributeDomain::interior_node, std::move(stage_of));
    add_attribute(with, stages_name, AttributeDomain::tree, std::move(stages));
    return with;
}

} // namespace unseen::perception
