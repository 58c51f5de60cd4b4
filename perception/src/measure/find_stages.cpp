#include "measure/measure_folds.h"

#include <numeric>

#include <glm/geometric.hpp>
#include <tbb/enumerable_thread_specific.h>

#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/internal/parallel.h>

#include "measure/stage_picture.h"

namespace unseen::perception {

using namespace vdtree;

namespace {

using namespace measurement;

// What is looked at of a mesh, and of each of its stages, from one direction: pictures under the tree's own light.
class OwnLight {
public:
    static constexpr std::size_t table_count = 1;

    explicit OwnLight(const VertexTree& tree) : luminance_(tree.luminance()) {}

    struct Seen {
        StagePicture picture;
        StageBands bands;
    };
    Seen look(StagePainter& painter, std::span<const Triangle> triangles, const StageCamera&) const {
        Seen seen{draw(painter, triangles), {}};
        seen.bands = StageBands(seen.picture);
        return seen;
    }
    // `tables`: one of each kind.
    void compare(const Seen& mesh, StagePainter& painter, std::span<const Triangle> folded, const StageCamera&,
                 std::span<FoldStage> tables) const {
        StagePicture difference = draw(painter, folded);
        difference.subtract(mesh.picture);
        add_contrasts(mesh.bands, StageBands(difference), {}, tables.front());
    }

private:
    StagePicture draw(StagePainter& painter, std::span<const Triangle> triangles) const {
        return std::move(
            painter.draw<1>(triangles, [&](WedgeId wedge) { return std::array<float, 1>{luminance_[wedge]}; })[0]);
    }

    std::span<const Unorm16> luminance_;
};

// The same in colour: a table for the luminance, and one for each direction of chroma.
class OwnColours {
public:
    static constexpr std::size_t table_count = 3;

    explicit OwnColours(std::span<const glm::vec3> rgb) : rgb_(rgb) {}

    struct Seen {
        std::array<StagePicture, table_count> pictures; // as_luminances()
        StageBands bands;                               // of the luminance
    };
    Seen look(StagePainter& painter, std::span<const Triangle> triangles, const StageCamera&) const {
        Seen seen{draw(painter, triangles), {}};
        seen.bands = StageBands(seen.pictures[0]);
        return seen;
    }
    void compare(const Seen& mesh, StagePainter& painter, std::span<const Triangle> folded, const StageCamera&,
                 std::span<FoldStage> tables) const {
        auto differences = draw(painter, folded);
        for (std::size_t k = 0; k < table_count; ++k) {
            differences[k].subtract(mesh.pictures[k]);
            add_contrasts(mesh.bands, StageBands(differences[k]), {}, tables[k]);
        }
    }

    // What the tables come to: contrasts of chroma count as such of luminance, unmasked.
    static FoldStage together(std::span<const FoldStage> tables) {
        FoldStage all = tables[0];
        for (std::size_t k = 0; k < FoldStage::backgrounds.size(); ++k)
            for (std::size_t band = 0; band < FoldStage::band_count; ++band) {
                const auto most = [&](const FoldStage& chroma) {
                    return *std::ranges::max_element(chroma.contrast[k][band]);
                };
                float& contrast = all.contrast[k][band][0];
                contrast = glm::length(glm::vec3(contrast, most(tables[1]), most(tables[2])));
            }
        return all;
    }

private:
    std::array<StagePicture, table_count> draw(StagePainter& painter, std::span<const Triangle> triangles) const {
        auto pictures = painter.draw<table_count>(triangles, [&](WedgeId wedge) {
            const glm::vec3& rgb = rgb_[wedge];
            return std::array{rgb.r, rgb.g, rgb.b};
        });
        for (std::size_t i = 0; i < pictures[0].light.values.size(); ++i) {
            const auto light = [&](std::size_t k) -> float& { return pictures[k].light.values[i]; };
            const glm::vec3 seen = as_luminances(glm::vec3(light(0), light(1), light(2)));
            for (int k = 0; k < 3; ++k) light(static_cast<std::size_t>(k)) = seen[k];
        }
        for (std::size_t k = 1; k < table_count; ++k) // what is behind has no chroma
            std::ranges::fill(pictures[k].cover.values, 0.0f);
        return pictures;
    }

    std::span<const glm::vec3> rgb_; // by wedge, as drawn
};

// The same under single lights from all around, with the shares of ambient light of LitStages: a table for each.
class SingleLights {
public:
    static constexpr std::size_t table_count = LitStages::ambient_shares.size();

    SingleLights(const VertexTree& tree, bool is_textured)
        : normals_(tree.wedge_count()), has_albedo_(!tree.colours().empty() || is_textured) {
        for (WedgeId wedge = 0; wedge < tree.wedge_count(); ++wedge)
            normals_[wedge] = {glm::vec3(tree.normals()[wedge]), albedo_of(tree, wedge)};
    }

    struct Seen {
        StagePicture painted;
        std::array<StagePicture, LitStages::lights> lit; // by lights of unit illuminance
        StageBands of_painted;
        std::array<StageBands, LitStages::lights> of_lit;
    };
    Seen look(StagePainter& painter, std::span<const Triangle> triangles, const StageCamera& camera) const {
        Seen seen;
        draw(painter, triangles, camera, seen);
        seen.of_painted = StageBands(seen.painted);
        for (std::size_t i = 0; i < seen.lit.size(); ++i) seen.of_lit[i] = StageBands(seen.lit[i]);
        return seen;
    }
    void compare(const Seen& mesh, StagePainter& painter, std::span<const Triangle> folded, const StageCamera& camera,
                 std::span<FoldStage> tables) const {
        Seen difference;
        draw(painter, folded, camera, difference);
        difference.painted.subtract(mesh.painted);
        difference.of_painted = StageBands(difference.painted);
        const StageSurround around{LitStages::brightest, LitStages::black};
        add_contrasts(mesh.of_painted, difference.of_painted, around, tables.back());
        StageBands lit_mesh, lit_difference; // with some ambient light
        for (std::size_t i = 0; i < difference.lit.size(); ++i) {
            difference.lit[i].subtract(mesh.lit[i]);
            const StageBands of_lit(difference.lit[i]);
            for (std::size_t table = 0; table + 1 < table_count; ++table) {
                const float ambient = LitStages::ambient_shares[table];
                lit_mesh.set_to_sum(mesh.of_lit[i], 1 - ambient, mesh.of_painted, ambient);
                lit_difference.set_to_sum(of_lit, 1 - ambient, difference.of_painted, ambient);
                add_contrasts(lit_mesh, lit_difference, around, tables[table]);
            }
        }
    }

private:
    // From before the mesh, from aside and from behind: around the direction of view by so many radians.
    static constexpr std::array<float, LitStages::lights> from_view = {0.7f, 1.4f, 2.2f};

    void draw(StagePainter& painter, std::span<const Triangle> triangles, const StageCamera& camera, Seen& seen) const {
        constexpr float golden_angle = 2.39996323f;
        std::array<glm::vec3, LitStages::lights> towards;
        for (std::size_t i = 0; i < towards.size(); ++i) {
            const float around = golden_angle * static_cast<float>(camera.number * towards.size() + i);
            towards[i] = std::cos(from_view[i]) * camera.towards +
                         std::sin(from_view[i]) * (std::cos(around) * camera.right + std::sin(around) * camera.up);
        }
        const auto draw_lit = [&]<std::size_t pictures>() { // the last one painted, if there is one more
            auto drawn = painter.draw<pictures>(triangles, [&](WedgeId wedge) {
                const glm::vec4& vertex = normals_[wedge];
                std::array<float, pictures> luminance;
                luminance.back() = vertex.w;
                for (std::size_t i = 0; i < towards.size(); ++i)
                    luminance[i] = std::max(0.0f, glm::dot(glm::vec3(vertex), towards[i])) * vertex.w;
                return luminance;
            });
            std::move(drawn.begin(), drawn.begin() + LitStages::lights, seen.lit.begin());
            return drawn;
        };
        if (has_albedo_) {
            seen.painted = std::move(draw_lit.template operator()<LitStages::lights + 1>().back());
        } else {
            draw_lit.template operator()<LitStages::lights>();
            seen.painted = seen.lit.front();
            for (std::size_t i = 0; i < seen.painted.light.values.size(); ++i)
                seen.painted.light.values[i] = normals_.front().w * seen.painted.cover.values[i];
        }
    }

    std::vector<glm::vec4> normals_; // by wedge, and the albedo
    bool has_albedo_;
};

template <class Light>
class StageFinder {
public:
    StageFinder(const SoundTree& tree, Light light, std::span<const TexturedLight> of_lights,
                std::span<const FoldTexture> textures, std::span<FoldError> errors, MeasuringProgress& progress)
        : tree_(tree), light_(std::move(light)), of_lights_(of_lights), textures_(textures), errors_(errors),
          progress_(progress), interior_(tree.interior_count()), parents_(tree.parents()),
          triangles_(tree.triangles().begin(), tree.triangles().end()) {
        for (Triangle& t : triangles_)
            for (WedgeId& corner : t) corner = tree.wedge_of_leaf(corner);
        for (std::size_t i = 0; i < direction_count; ++i) cameras_.push_back(stage_camera(tree.bounding_sphere(), i));
    }

    // By table and stage.
    std::vector<FoldStage> run() {
        const std::size_t count = order();
        // Each stage leaves about so many triangles of the one before.
        const double fewer = std::exp2(-1 / stages_per_halving);
        progress_.begin(1, direction_count * (1 - std::pow(fewer, count + 1)) / (1 - fewer));
        std::vector<typename Light::Seen> mesh(direction_count);
        for_each_direction(
            [&](std::size_t i, StagePainter& painter) { mesh[i] = light_.look(painter, triangles_, cameras_[i]); });
        std::vector<FoldStage> stages(Light::table_count * count);
        for (std::size_t stage = 0; stage < count; ++stage) {
            if (progress_.is_cancelled()) return {};
            fold(stage);
            dearness_ *= fewer;
            std::vector<std::array<FoldStage, Light::table_count>> found(direction_count);
            for_each_direction([&](std::size_t i, StagePainter& painter) {
                light_.compare(mesh[i], painter, triangles_, cameras_[i], found[i]);
            });
            for (const auto& tables : found)
                for (std::size_t table = 0; table < tables.size(); ++table)
                    include(tables[table], stages[table * count + stage]);
        }
        if (!textures_.empty())
            for (std::size_t first = 0; first < stages.size(); first += count)
                add_detail(std::span(stages).subspan(first, count));
        return stages;
    }

private:
    // Gives every node its stage; returns how many there are.
    std::size_t order() {
        std::vector<float> light(interior_); // that the fold changes, as the side of a square of it
        for (NodeId node = interior_; node-- > 0;) {
            const FoldError& e = errors_[node];
            const float own =
                outline_contrast * e.mean_distance + changed_radius(tree_, errors_, node) * e.wide_luminance;
            light[node] = std::max(light[node], own);
            if (node > 0) light[parents_[node]] = std::max(light[parents_[node]], light[node]);
        }
        std::vector<NodeId> sequence(interior_);
        std::iota(sequence.begin(), sequence.end(), NodeId{0});
        std::sort(sequence.begin(), sequence.end(),
                  [&](NodeId a, NodeId b) { return light[a] != light[b] ? light[a] < light[b] : a > b; });
        double left = first_share * interior_;
        std::uint8_t stage = 0;
        for (NodeId folded = 0; folded < interior_; ++folded) {
            while (left >= fewest_left && interior_ - folded <= left)
                left /= std::exp2(1 / stages_per_halving), ++stage;
            errors_[sequence[folded]].stage = stage;
        }
        return std::size_t{stage} + 1;
    }

    // With a texture, patterns finer than the pictures' cells may change as no outline does, which the cells' means do
    // not show: those of any node that has been folded count. Whoever looks at contrasts finer than the first band
    // takes twice its contrast for each octave, up to three.
    void add_detail(std::span<FoldStage> stages) const {
        constexpr float most_octaves = 3;
        const float cell = 2 * stage_margin * tree_.bounding_sphere().radius / static_cast<float>(stage_side);
        const float first_wave = cell / static_cast<float>(nominal_frequency(0));
        std::vector<float> most(stages.size(), 0.0f); // contrasts of the first band
        for (NodeId node = 0; node < interior_; ++node) {
            const float width = changed_radius(tree_, errors_, node);
            const auto note = [&](float contrast, float wave) {
                if (!(wave < first_wave)) return;
                const float octaves = std::min(std::floor(std::log2(first_wave / wave)), most_octaves);
                float& to = most[errors_[node].stage];
                to = std::max(to, contrast * std::exp2(-octaves));
            };
            const LuminanceRange drawn = tree_.ring_luminance()[node];
            note(errors_[node].luminance / ((drawn.lo + drawn.hi) / 2 + FoldStage::black), width);
            for (std::size_t k = 0; k < texture_octaves; ++k)
                note(textures_[node].contrast[k], width * std::exp2(-static_cast<float>(k)));
        }
        for (std::size_t stage = 0; stage < stages.size(); ++stage) {
            if (stage > 0) most[stage] = std::max(most[stage], most[stage - 1]);
            for (auto& by_band : stages[stage].contrast) by_band[0][0] = std::max(by_band[0][0], most[stage]);
        }
    }

    void fold(std::size_t stage) {
        const auto goes_on = [&](NodeId node) {
            return parents_[node] != no_node && errors_[parents_[node]].stage <= stage;
        };
        folded_.resize(interior_);
        for (NodeId node = 0; node < interior_; ++node) folded_[node] = goes_on(node) ? folded_[parents_[node]] : node;
        for (Triangle& t : triangles_)
            for (WedgeId& corner : t)
                if (const NodeId node = tree_.node_of_wedge(corner); goes_on(node))
                    corner = tree_.wedge_above(folded_[parents_[node]], corner);
        // Two corners of one triangle in one node are one wedge.
        std::erase_if(triangles_, uses_a_vertex_twice);
    }

    template <class F>
    void for_each_direction(F&& f) {
        parallel_loop(std::size_t{0}, direction_count, [&](std::size_t i) {
            if (progress_.is_cancelled()) return;
            StagePainter painter(tree_, of_lights_, cameras_[i], surfaces_.local());
            f(i, painter);
            progress_.add(dearness_);
        });
    }

    const SoundTree& tree_;
    Light light_;
    std::span<const TexturedLight> of_lights_; // of all lights, or of each
    std::span<const FoldTexture> textures_;
    std::span<FoldError> errors_;
    MeasuringProgress& progress_;
    double dearness_ = 1; // of a picture, of the first ones'
    NodeId interior_;
    std::span<const NodeId> parents_;
    std::vector<Triangle> triangles_; // as folded, over wedges
    std::vector<NodeId> folded_;      // by interior node: where it has gone
    std::vector<StageCamera> cameras_;
    tbb::enumerable_thread_specific<StageSurfaces> surfaces_;
};

bool has_stages(const VertexTree& tree) {
    const float radius = tree.bounding_sphere().radius;
    const bool is_translucent = tree.bounds()[VertexTree::root()].flags & translucent_ring;
    return !is_translucent && radius > 0 && std::isfinite(stage_side / (2 * radius));
}

} // namespace

double FoldStage::frequency(std::size_t band) {
    return nominal_frequency(band) * stage_side / static_cast<double>(stage_margin);
}

std::vector<FoldStage> find_stages(const SoundTree& tree, std::span<const glm::vec3> rgb,
                                   std::span<const TexturedLight> lights, std::span<const FoldTexture> textures,
                                   std::span<FoldError> errors, MeasuringProgress& progress) {
    if (!has_stages(tree)) return {};
    if (rgb.empty()) return StageFinder(tree, OwnLight(tree), lights, textures, errors, progress).run();
    const std::vector<FoldStage> tables = StageFinder(tree, OwnColours(rgb), lights, textures, errors, progress).run();
    const std::size_t count = tables.size() / OwnColours::table_count;
    std::vector<FoldStage> stages;
    for (std::size_t stage = 0; stage < count; ++stage)
        stages.push_back(
            OwnColours::together(std::array{tables[stage], tables[count + stage], tables[2 * count + stage]}));
    return stages;
}

LitStages find_lit_stages(const SoundTree& tree, const TexturedLight& texture, std::span<const FoldTexture> textures,
                          std::span<FoldError> errors, MeasuringProgress& progress) {
    if (!has_stages(tree)) return {};
    return {StageFinder(tree, SingleLights(tree, texture.texture != nullptr), std::span(&texture, 1), textures, errors,
                        progress)
                .run()};
}

} // namespace unseen::perception
