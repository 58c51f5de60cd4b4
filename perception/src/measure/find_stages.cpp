#include "measure/find_stages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <tbb/enumerable_thread_specific.h>

#include "measure/lit_stages.h"
#include "measure/luminance_bias.h"
#include "measure/pyramid.h"
#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/simd.h>
#include <unseen/vdtree/lighting.h>

namespace unseen::perception {

using namespace vdtree;

namespace {

using namespace measurement;
constexpr std::size_t side = stage_side;
constexpr std::size_t samples = side * cell_samples;
constexpr float margin = stage_margin;
constexpr float nothing = -std::numeric_limits<float>::infinity(); // is at a sample

// From where a picture is taken: the mesh's sphere fills it, but for the margin. Lengths are in samples.
struct Camera {
    std::size_t number;
    glm::vec3 centre, right, up, towards;
    float samples_per_length;

    // To the right, up, and towards the eye.
    Float4 place(const glm::vec3& p) const {
        const glm::vec3 q = (p - centre) * samples_per_length;
        return q.x * along(0) + q.y * along(1) + q.z * along(2) + Float4{samples / 2.0f, samples / 2.0f, 0, 0};
    }

private:
    Float4 along(int axis) const { return Float4{right[axis], up[axis], towards[axis], 0}; }
};

// Directions of a Fibonacci spiral over the sphere.
Camera camera(const Sphere& sphere, std::size_t number) {
    constexpr float golden_angle = 2.39996323f;
    const float z = 1 - static_cast<float>(2 * number + 1) / direction_count, s = std::sqrt(1 - z * z);
    const float angle = golden_angle * static_cast<float>(number);
    Camera c;
    c.number = number;
    c.centre = sphere.centre;
    c.towards = {s * std::cos(angle), s * std::sin(angle), z};
    c.right =
        glm::normalize(glm::cross(std::abs(c.towards.y) < 0.9f ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0), c.towards));
    c.up = glm::cross(c.towards, c.right);
    c.samples_per_length = samples / (2 * margin * sphere.radius);
    return c;
}

// Before an unlit background: the light that comes from each cell, and the share of it that the mesh covers.
struct Picture {
    Raster light{side}, cover{side};

    void subtract(const Picture& other) {
        for (std::size_t i = 0; i < light.values.size(); ++i) {
            light.values[i] -= other.light.values[i];
            cover.values[i] -= other.cover.values[i];
        }
    }
};

// The nearest surface at each sample, and the light that comes from it: under several lights, or one.
constexpr std::size_t most_lights = LitStages::lights + 1;
struct Surfaces {
    std::vector<float> height; // towards the eye; none: nothing is there
    std::array<std::vector<float>, most_lights> light;

    void clear(std::size_t lights) {
        height.assign(samples * samples, nothing);
        for (std::size_t i = 0; i < lights; ++i) light[i].assign(samples * samples, 0.0f);
    }
};

// A triangle over samples.
template <std::size_t lights>
struct Shown {
    Float4 a, b, c;                             // samples: to the right, up, towards the eye
    std::array<float, lights> of_a, of_b, of_c; // relative luminances
    glm::vec2 v_by, w_by;                       // how the shares of b and c grow, by sample
    std::size_t first, end;                     // rows
};

// Its texture, of texels no wider than the samples are apart: the cells' means smooth them.
struct ShownTexture {
    const TexturedLight& light;
    std::size_t level;
    glm::vec2 of_a, by_b, by_c; // texture coordinates: of a, and how they grow with the shares of b and c

    template <std::size_t lights>
    ShownTexture(const Shown<lights>& t, const TexturedLight& texture, const std::array<glm::vec2, 3>& uv)
        : light(texture), of_a(uv[0]), by_b(uv[1] - uv[0]), by_c(uv[2] - uv[0]) {
        const glm::vec2 size = texture.texture->size(), along_x = (by_b * t.v_by.x + by_c * t.w_by.x) * size,
                        along_y = (by_b * t.v_by.y + by_c * t.w_by.y) * size;
        const std::size_t first_wider = texture.texture->level_of(
            std::max({std::abs(along_x.x), std::abs(along_x.y), std::abs(along_y.x), std::abs(along_y.y)}));
        level = first_wider > 0 ? first_wider - 1 : 0;
    }
    UNSEEN_INLINE float at(float v, float w) const { return light.texture->nearest(level, of_a + v * by_b + w * by_c); }
};

// How many samples of a row, or rows, lie before a place: the rounding of floats that every processor has.
UNSEEN_INLINE std::size_t count_before(float place) {
    if (!(place > 0)) return 0;
    if (place >= samples) return samples;
    const int whole = static_cast<int>(place);
    return static_cast<std::size_t>(whole + (static_cast<float>(whole) < place));
}
// Of a row's samples: edges that run up meet them one after the other, not all of a column at once.
UNSEEN_INLINE float offset_of_row(std::size_t row) {
    constexpr float golden_ratio = 0.618034f;
    const float all = golden_ratio * static_cast<float>(row);
    return all - static_cast<float>(static_cast<int>(all));
}

// Samples of a row are looked at by registers, `Floats`, whether they lie in the triangle or not; a texture only where it
// is seen.
template <class Floats, std::size_t lights>
UNSEEN_INLINE void draw_rows(const Shown<lights>& t, const ShownTexture* texture, Surfaces& surfaces) {
    constexpr std::size_t width = sizeof(Floats) / sizeof(float);
    static_assert(samples % width == 0);
    Floats lane;
    for (std::size_t i = 0; i < width; ++i) lane[i] = static_cast<float>(i);
    const float left = std::min({t.a[0], t.b[0], t.c[0]}), right = std::max({t.a[0], t.b[0], t.c[0]});
    for (std::size_t y = t.first; y < t.end; ++y) {
        // Of a corner's weight, as it grows along the row: where it is no longer, or not yet, negative.
        const float offset = offset_of_row(y), py = static_cast<float>(y) + 0.5f - t.a[1];
        float low = left - t.a[0], high = right - t.a[0];
        for (const auto& [at_start, by] : {std::pair(py * t.v_by.y, t.v_by.x), std::pair(py * t.w_by.y, t.w_by.x),
                                           std::pair(1 - py * (t.v_by.y + t.w_by.y), -t.v_by.x - t.w_by.x)}) {
            if (by > 0) low = std::max(low, -at_start / by);
            else if (by < 0) high = std::min(high, -at_start / by);
            else if (at_start < 0) high = low;
        }
        const std::size_t x0 = count_before(low + t.a[0] - offset), x1 = count_before(high + t.a[0] - offset);
        const auto from = static_cast<float>(x0), to = static_cast<float>(x1);
        for (std::size_t begin = x0 / width * width; begin < x1; begin += width) {
            const std::size_t first = y * samples + begin;
            float* const height = surfaces.height.data() + first;
            const Floats x = lane + static_cast<float>(begin), px = x + offset - t.a[0];
            const Floats v = px * t.v_by.x + py * t.v_by.y, w = px * t.w_by.x + py * t.w_by.y, u = 1 - v - w;
            const Floats h = u * t.a[2] + v * t.b[2] + w * t.c[2];
            Floats old_height;
            std::memcpy(&old_height, height, sizeof(Floats));
            const auto is_seen = (x >= from) & (x < to) & (h > old_height);
            Floats its_texture{};
            if (texture)
                for (std::size_t i = 0; i < width; ++i)
                    if (is_seen[i]) its_texture[i] = texture->at(v[i], w[i]);
            const Floats new_height = is_seen ? h : old_height;
            std::memcpy(height, &new_height, sizeof(Floats));
            for (std::size_t k = 0; k < lights; ++k) {
                float* const light = surfaces.light[k].data() + first;
                const Floats own = u * t.of_a[k] + v * t.of_b[k] + w * t.of_c[k],
                             l = texture ? texture->light.with_texture(own, its_texture) : own;
                Floats old_light;
                std::memcpy(&old_light, light, sizeof(Floats));
                const Floats new_light = is_seen ? l : old_light;
                std::memcpy(light, &new_light, sizeof(Floats));
            }
        }
    }
}
template <std::size_t lights>
void draw_plain(const Shown<lights>& t, const ShownTexture* texture, Surfaces& surfaces) {
    draw_rows<Float4>(t, texture, surfaces);
}
#if defined(UNSEEN_EIGHT_WIDE)
template <std::size_t lights>
UNSEEN_AVX2 void draw_avx2(const Shown<lights>& t, const ShownTexture* texture, Surfaces& surfaces) {
    draw_rows<Float8>(t, texture, surfaces);
}
#else
template <std::size_t lights>
constexpr auto draw_avx2 = draw_plain<lights>;
#endif

class Painter {
public:
    // The surfaces' memory is used again.
    Painter(const VertexTree& tree, const TexturedLight& light, const Camera& camera, Surfaces& surfaces)
        : light_(light), camera_(camera), positions_(tree.positions()), uvs_(tree.uvs()),
          closedness_(tree.closedness()), surfaces_(surfaces) {}

    // Triangles over nodes, which are as bright under each light as `luminance` says.
    template <std::size_t lights, class Luminance>
    std::array<Picture, lights> draw(std::span<const Triangle> triangles, const Luminance& luminance) {
        static_assert(lights <= most_lights);
        surfaces_.clear(lights);
        for (const Triangle& t : triangles) draw_one<lights>(t, luminance);
        return cells<lights>();
    }

private:
    // The means of the samples, four cells at a time.
    template <std::size_t lights>
    std::array<Picture, lights> cells() const {
        static_assert(cell_samples == 4 && side % 4 == 0);
        constexpr float share = 1.0f / (cell_samples * cell_samples);
        std::array<Picture, lights> pictures;
        for (std::size_t cell = 0; cell < side * side; cell += 4) {
            const std::size_t first = cell / side * cell_samples * samples + cell % side * cell_samples;
            const auto mean = [&](const std::vector<float>& plane, const auto& of_sample, Raster& to) {
                Float4 sum{};
                for (std::size_t y = 0; y < cell_samples; ++y) {
                    Float4 columns[cell_samples];
                    load_columns(
                        [&](std::size_t lane) { return plane.data() + first + y * samples + lane * cell_samples; },
                        columns);
                    for (const Float4& column : columns) sum += of_sample(column);
                }
                sum *= share;
                std::memcpy(to.values.data() + cell, &sum, sizeof sum);
            };
            mean(
                surfaces_.height,
                [](Float4 height) {
                    return height > nothing ? Float4{1, 1, 1, 1} : Float4{};
                },
                pictures[0].cover);
            for (std::size_t k = 0; k < lights; ++k)
                mean(
                    surfaces_.light[k], [](Float4 light) { return light; }, pictures[k].light);
        }
        for (std::size_t k = 1; k < lights; ++k) pictures[k].cover = pictures[0].cover;
        return pictures;
    }

    template <std::size_t lights, class Luminance>
    void draw_one(const Triangle& corners, const Luminance& luminance) {
        Shown<lights> t;
        t.a = camera_.place(positions_[corners[0]]);
        t.b = camera_.place(positions_[corners[1]]);
        t.c = camera_.place(positions_[corners[2]]);
        const Float4 ab = t.b - t.a, ac = t.c - t.a;
        const float area = ab[0] * ac[1] - ab[1] * ac[0];
        if ((closedness_ == Closedness::closed_outward && area < 0) ||
            (closedness_ == Closedness::closed_inward && area > 0)) // as renderers do
            return;
        t.first = count_before(std::min({t.a[1], t.b[1], t.c[1]}) - 0.5f);
        t.end = count_before(std::max({t.a[1], t.b[1], t.c[1]}) - 0.5f);
        if (t.first >= t.end) return; // many, of fine meshes
        const float inverse = 1 / area;
        if (!std::isfinite(inverse)) return;
        t.v_by = inverse * glm::vec2(ac[1], -ac[0]);
        t.w_by = inverse * glm::vec2(-ab[1], ab[0]);
        t.of_a = luminance(corners[0]), t.of_b = luminance(corners[1]), t.of_c = luminance(corners[2]);
        std::optional<ShownTexture> texture;
        if (light_.texture)
            texture.emplace(t, light_, std::array{uvs_[corners[0]], uvs_[corners[1]], uvs_[corners[2]]});
        (has_avx2() ? draw_avx2<lights> : draw_plain<lights>)(t, texture ? &*texture : nullptr, surfaces_);
    }

    const TexturedLight& light_;
    const Camera& camera_;
    std::span<const glm::vec3> positions_;
    std::span<const glm::vec2> uvs_;
    Closedness closedness_;
    Surfaces& surfaces_;
};

// A picture in bands of frequency.
class Bands {
public:
    struct Band {
        Raster light, cover;           // less the means
        Raster mean_light, mean_cover; // over wider areas
    };

    explicit Bands(const Picture& picture) {
        Raster light = picture.light, cover = picture.cover;
        for (Band& band : bands_) {
            band.light = std::move(light), band.cover = std::move(cover);
            light = split(band.light, band.mean_light);
            cover = split(band.cover, band.mean_cover);
        }
    }
    const Band& operator[](std::size_t band) const { return bands_[band]; }

    // Of a picture whose light is so many times that of this picture, and of the other one, of the same surfaces.
    void set_to_sum(const Bands& picture, float share, const Bands& other, float other_share) {
        const auto sum = [&](const Raster& a, const Raster& b, Raster& to) {
            to.side = a.side;
            to.values.resize(a.values.size());
            for (std::size_t i = 0; i < a.values.size(); ++i)
                to.values[i] = share * a.values[i] + other_share * b.values[i];
        };
        for (std::size_t b = 0; b < FoldStage::band_count; ++b) {
            sum(picture[b].light, other[b].light, bands_[b].light);
            sum(picture[b].mean_light, other[b].mean_light, bands_[b].mean_light);
            bands_[b].cover = picture[b].cover, bands_[b].mean_cover = picture[b].mean_cover;
        }
    }
    Bands() = default;

private:
    // Takes the mean away; returns the next level.
    static Raster split(Raster& plane, Raster& mean) {
        Raster next = reduce(plane);
        mean = expand(next, plane.side);
        for (std::size_t i = 0; i < plane.values.size(); ++i) plane.values[i] -= mean.values[i];
        return next;
    }

    std::array<Band, FoldStage::band_count> bands_;
};

// Of a grating's amplitude, in cycles a cell: cells show the mean over their area.
double share_in_cells(double frequency) {
    return std::sin(std::numbers::pi * frequency) / (std::numbers::pi * frequency);
}

// Relative luminances.
struct Surround {
    float brightest = 1;            // that is behind the mesh
    float black = FoldStage::black; // added to what luminances are divided by
};

// The largest contrasts of a band. `Floats`: a register's, each lane with places of its own.
template <class Floats>
UNSEEN_INLINE void find_contrasts(const Bands::Band& mesh, const Bands::Band& difference, float inverse_gain,
                                  std::size_t band, const Surround& around, FoldStage& stage) {
    constexpr auto& masks = FoldStage::masks;
    constexpr std::size_t backgrounds = FoldStage::backgrounds.size(), width = sizeof(Floats) / sizeof(float);
    const auto magnitude = [](const Floats& v) UNSEEN_INLINE_LAMBDA { return v < 0 ? -v : v; };
    Floats most[backgrounds][masks.size()] = {};
    const std::size_t count = difference.light.values.size();
    for (std::size_t first = 0; first < count; first += width) {
        const auto load = [&](const Raster& from) UNSEEN_INLINE_LAMBDA {
            Floats to{};
            if (first + width <= count) std::memcpy(&to, from.values.data() + first, sizeof to);
            else std::memcpy(&to, from.values.data() + first, (count - first) * sizeof(float));
            return to;
        };
        const Floats light = load(difference.light), cover = load(difference.cover);
        bool differs = false;
        for (std::size_t i = 0; i < width; ++i) differs |= (light[i] != 0) | (cover[i] != 0);
        if (!differs) continue;
        const Floats own_light = load(mesh.light), own_cover = load(mesh.cover), mean_light = load(mesh.mean_light),
                     mean_cover = load(mesh.mean_cover);
        for (std::size_t k = 0; k < backgrounds; ++k) {
            const float background = around.brightest * FoldStage::backgrounds[k];
            const Floats lit = mean_light + background * (1 - mean_cover), mean = lit < 0 ? Floats{} : lit;
            const Floats to_contrast = inverse_gain / (mean + around.black);
            const Floats mask = magnitude(own_light - background * own_cover) * to_contrast;
            const Floats contrast = magnitude(light - background * cover) * to_contrast;
            for (std::size_t row = 0; row < masks.size(); ++row) {
                Floats here = contrast;
                if (row > 0) here = mask >= masks[row] ? here : Floats{};
                if (row + 1 < masks.size()) here = mask >= masks[row + 1] ? Floats{} : here;
                most[k][row] = most[k][row] < here ? here : most[k][row];
            }
        }
    }
    for (std::size_t k = 0; k < backgrounds; ++k)
        for (std::size_t row = 0; row < masks.size(); ++row)
            for (std::size_t i = 0; i < width; ++i)
                stage.contrast[k][band][row] = std::max(stage.contrast[k][band][row], most[k][row][i]);
}
void find_contrasts_plain(const Bands::Band& mesh, const Bands::Band& difference, float inverse_gain, std::size_t band,
                          const Surround& around, FoldStage& stage) {
    find_contrasts<Float4>(mesh, difference, inverse_gain, band, around, stage);
}
#if defined(UNSEEN_EIGHT_WIDE)
UNSEEN_AVX2 void find_contrasts_avx2(const Bands::Band& mesh, const Bands::Band& difference, float inverse_gain,
                                     std::size_t band, const Surround& around, FoldStage& stage) {
    find_contrasts<Float8>(mesh, difference, inverse_gain, band, around, stage);
}
#else
constexpr auto find_contrasts_avx2 = find_contrasts_plain;
#endif

// Adds the contrasts of a difference of pictures: the larger ones stay.
void add_contrasts(const Bands& mesh, const Bands& difference, const Surround& around, FoldStage& stage) {
    for (std::size_t b = 0; b < FoldStage::band_count; ++b)
        (has_avx2() ? find_contrasts_avx2 : find_contrasts_plain)(
            mesh[b], difference[b], 1 / static_cast<float>(band_gain(b) * share_in_cells(nominal_frequency(b))), b,
            around, stage);
}

// What is looked at of a mesh, and of each of its stages, from one direction: pictures under the tree's own light.
class OwnLight {
public:
    static constexpr std::size_t table_count = 1;

    explicit OwnLight(const VertexTree& tree) : luminance_(tree.luminance()) {}

    struct Seen {
        Picture picture;
        Bands bands;
    };
    Seen look(Painter& painter, std::span<const Triangle> triangles, const Camera&) const {
        Seen seen{draw(painter, triangles), {}};
        seen.bands = Bands(seen.picture);
        return seen;
    }
    // `tables`: one of each kind.
    void compare(const Seen& mesh, Painter& painter, std::span<const Triangle> folded, const Camera&,
                 std::span<FoldStage> tables) const {
        Picture difference = draw(painter, folded);
        difference.subtract(mesh.picture);
        add_contrasts(mesh.bands, Bands(difference), {}, tables.front());
    }

private:
    Picture draw(Painter& painter, std::span<const Triangle> triangles) const {
        return std::move(
            painter.draw<1>(triangles, [&](NodeId node) { return std::array<float, 1>{luminance_[node]}; })[0]);
    }

    std::span<const Unorm16> luminance_;
};

// The same under single lights from all around, with the shares of ambient light of LitStages: a table for each.
class SingleLights {
public:
    static constexpr std::size_t table_count = LitStages::ambient_shares.size();

    explicit SingleLights(const VertexTree& tree)
        : normals_(tree.node_count()), has_albedo_(!tree.colours().empty() || !tree.texture().empty()) {
        for (NodeId node = 0; node < tree.node_count(); ++node)
            normals_[node] = {glm::vec3(tree.normals()[node]), albedo_of(tree, node)};
    }

    struct Seen {
        Picture painted;
        std::array<Picture, LitStages::lights> lit; // by lights of unit illuminance
        Bands of_painted;
        std::array<Bands, LitStages::lights> of_lit;
    };
    Seen look(Painter& painter, std::span<const Triangle> triangles, const Camera& camera) const {
        Seen seen;
        draw(painter, triangles, camera, seen);
        seen.of_painted = Bands(seen.painted);
        for (std::size_t i = 0; i < seen.lit.size(); ++i) seen.of_lit[i] = Bands(seen.lit[i]);
        return seen;
    }
    void compare(const Seen& mesh, Painter& painter, std::span<const Triangle> folded, const Camera& camera,
                 std::span<FoldStage> tables) const {
        Seen difference;
        draw(painter, folded, camera, difference);
        difference.painted.subtract(mesh.painted);
        difference.of_painted = Bands(difference.painted);
        const Surround around{LitStages::brightest, LitStages::black};
        add_contrasts(mesh.of_painted, difference.of_painted, around, tables.back());
        Bands lit_mesh, lit_difference; // with some ambient light
        for (std::size_t i = 0; i < difference.lit.size(); ++i) {
            difference.lit[i].subtract(mesh.lit[i]);
            const Bands of_lit(difference.lit[i]);
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

    void draw(Painter& painter, std::span<const Triangle> triangles, const Camera& camera, Seen& seen) const {
        constexpr float golden_angle = 2.39996323f;
        std::array<glm::vec3, LitStages::lights> towards;
        for (std::size_t i = 0; i < towards.size(); ++i) {
            const float around = golden_angle * static_cast<float>(camera.number * towards.size() + i);
            towards[i] = std::cos(from_view[i]) * camera.towards +
                         std::sin(from_view[i]) * (std::cos(around) * camera.right + std::sin(around) * camera.up);
        }
        const auto draw_lit = [&]<std::size_t pictures>() { // the last one painted, if there is one more
            auto drawn = painter.draw<pictures>(triangles, [&](NodeId node) {
                const glm::vec4& vertex = normals_[node];
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

    std::vector<glm::vec4> normals_; // and the albedo
    bool has_albedo_;
};

template <class Light>
class StageFinder {
public:
    StageFinder(const SoundTree& tree, const TexturedLight& texture, std::span<const FoldTexture> textures,
                std::span<FoldError> errors, MeasuringProgress& progress)
        : tree_(tree), light_(tree), texture_(texture), textures_(textures), errors_(errors), progress_(progress),
          interior_(tree.interior_count()), parents_(tree.parents()),
          triangles_(tree.triangles().begin(), tree.triangles().end()) {
        for (Triangle& t : triangles_)
            for (NodeId& corner : t) corner += interior_;
        for (std::size_t i = 0; i < direction_count; ++i) cameras_.push_back(camera(tree.bounding_sphere(), i));
    }

    // By table and stage.
    std::vector<FoldStage> run() {
        const std::size_t count = order();
        // Each stage leaves about so many triangles of the one before.
        const double fewer = std::exp2(-1 / stages_per_halving);
        progress_.begin(1, direction_count * (1 - std::pow(fewer, count + 1)) / (1 - fewer));
        std::vector<typename Light::Seen> mesh(direction_count);
        for_each_direction(
            [&](std::size_t i, Painter& painter) { mesh[i] = light_.look(painter, triangles_, cameras_[i]); });
        std::vector<FoldStage> stages(Light::table_count * count);
        for (std::size_t stage = 0; stage < count; ++stage) {
            if (progress_.is_cancelled()) return {};
            fold(stage);
            dearness_ *= fewer;
            std::vector<std::array<FoldStage, Light::table_count>> found(direction_count);
            for_each_direction([&](std::size_t i, Painter& painter) {
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
    // not show: those of any node that has been folded count. Whoever looks at contrasts finer than the first band takes
    // twice its contrast for each octave, up to three.
    void add_detail(std::span<FoldStage> stages) const {
        constexpr float most_octaves = 3;
        const float cell = 2 * margin * tree_.bounding_sphere().radius / static_cast<float>(side);
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
            for (NodeId& corner : t)
                if (goes_on(corner)) corner = folded_[parents_[corner]];
        std::erase_if(triangles_, [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
    }

    template <class F>
    void for_each_direction(F&& f) {
        parallel_loop(std::size_t{0}, direction_count, [&](std::size_t i) {
            if (progress_.is_cancelled()) return;
            Painter painter(tree_, texture_, cameras_[i], surfaces_.local());
            f(i, painter);
            progress_.add(dearness_);
        });
    }

    const SoundTree& tree_;
    Light light_;
    TexturedLight texture_;
    std::span<const FoldTexture> textures_;
    std::span<FoldError> errors_;
    MeasuringProgress& progress_;
    double dearness_ = 1; // of a picture, of the first ones'
    NodeId interior_;
    std::span<const NodeId> parents_;
    std::vector<Triangle> triangles_; // as folded, over nodes
    std::vector<NodeId> folded_;      // by interior node: where it has gone
    std::vector<Camera> cameras_;
    tbb::enumerable_thread_specific<Surfaces> surfaces_;
};

bool has_stages(const VertexTree& tree) {
    const float radius = tree.bounding_sphere().radius;
    const bool is_translucent = tree.bounds()[VertexTree::root()].flags & translucent_ring;
    return !is_translucent && radius > 0 && std::isfinite(side / (2 * radius));
}

} // namespace

double FoldStage::frequency(std::size_t band) { return nominal_frequency(band) * side / static_cast<double>(margin); }

std::vector<FoldStage> find_stages(const SoundTree& tree, const TexturedLight& light,
                                   std::span<const FoldTexture> textures, std::span<FoldError> errors,
                                   MeasuringProgress& progress) {
    if (!has_stages(tree)) return {};
    return StageFinder<OwnLight>(tree, light, textures, errors, progress).run();
}

LitStages find_lit_stages(const SoundTree& tree, const TexturedLight& texture, std::span<const FoldTexture> textures,
                          std::span<FoldError> errors, MeasuringProgress& progress) {
    if (!has_stages(tree)) return {};
    return {StageFinder<SingleLights>(tree, texture, textures, errors, progress).run()};
}

} // namespace unseen::perception
