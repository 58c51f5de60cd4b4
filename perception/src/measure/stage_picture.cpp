#include "measure/stage_picture.h"

#include <bit>
#include <limits>
#include <numbers>

#include <glm/geometric.hpp>

#include "measure/registers.h"

namespace unseen::perception {

using namespace vdtree;

namespace {

using namespace measurement;
constexpr std::size_t samples = stage_samples;
constexpr float nothing = -std::numeric_limits<float>::infinity(); // is at a sample
// Pictures in which so many surfaces lie behind each other on average are drawn with covers from there on.
constexpr std::size_t most_layers = 4;
// Where two faces lie in one place, as the sides of leaves do once they are folded, renderers show the one that faces the
// eye. The other lies behind by this: more than rounding makes of heights, less than a thousandth of a cell.
constexpr float behind = 1e-3f; // samples
constexpr std::uint64_t every_tile = (std::uint64_t{1} << StageCovers::per_side) - 1;

// A footprint and its luminances.
template <std::size_t lights>
struct Shown : StageFootprint {
    std::array<float, lights> of_a, of_b, of_c; // relative luminances
    std::size_t number;                         // of the triangle
    const StageCovers* covers;                  // null: all of it is drawn
};

// The texture of a footprint. Texels are no wider than the samples are apart: the cells' means smooth them.
struct ShownTexture {
    std::span<const TexturedLight> lights; // one for all, or one for each
    std::size_t level;
    glm::vec2 of_a, by_b, by_c; // texture coordinates: of a, and how they grow with the shares of b and c

    ShownTexture(const StageFootprint& t, std::span<const TexturedLight> textures, const std::array<glm::vec2, 3>& uv)
        : lights(textures), of_a(uv[0]), by_b(uv[1] - uv[0]), by_c(uv[2] - uv[0]) {
        const TextureDetail& texture = *textures.front().texture;
        const glm::vec2 size = texture.size(), along_x = (by_b * t.v_by.x + by_c * t.w_by.x) * size,
                        along_y = (by_b * t.v_by.y + by_c * t.w_by.y) * size;
        const std::size_t first_wider = texture.level_of(
            std::max({std::abs(along_x.x), std::abs(along_x.y), std::abs(along_y.x), std::abs(along_y.y)}));
        level = first_wider > 0 ? first_wider - 1 : 0;
    }
    UNSEEN_INLINE float at(std::size_t light, float v, float w) const {
        return lights[light].texture->nearest(level, of_a + v * by_b + w * by_c);
    }
};

template <class Floats>
using Ints = std::conditional_t<sizeof(Floats) == sizeof(Float4), Int4, Int8>;

template <class Floats>
UNSEEN_INLINE Floats lanes() {
    Floats lane;
    for (std::size_t i = 0; i < width_of<Floats>; ++i) lane[i] = static_cast<float>(i);
    return lane;
}

// How many samples of a row, or rows, lie before a place: the rounding of floats that every processor has.
template <class Floats>
UNSEEN_INLINE Ints<Floats> counts_before(const Floats& place) {
    const Floats all = Floats{} + samples, from = place > 0 ? place : Floats{}, in = from < all ? from : all;
    const auto whole = __builtin_convertvector(in, Ints<Floats>);
    return whole - (__builtin_convertvector(whole, Floats) < in); // true is -1
}
std::size_t count_before(float place) {
    return static_cast<std::size_t>(counts_before(Float4{place, place, place, place})[0]);
}

// A register of consecutive rows of a triangle.
template <class Floats>
struct Rows {
    Floats offset; // of a row's samples: edges that run up meet them one after the other, not all of a column at once
    Floats y;      // from corner a
    Ints<Floats> first, end; // samples in the triangle

    UNSEEN_INLINE Rows(const StageFootprint& t, std::size_t first_row) {
        constexpr float golden_ratio = 0.618034f;
        const Floats row = lanes<Floats>() + static_cast<float>(first_row), all = golden_ratio * row;
        offset = all - __builtin_convertvector(__builtin_convertvector(all, Ints<Floats>), Floats);
        y = row + 0.5f - t.a[1];
        // Each corner's weight grows along the row: the triangle is where none is negative.
        const float left = std::min({t.a[0], t.b[0], t.c[0]}), right = std::max({t.a[0], t.b[0], t.c[0]});
        Floats low = Floats{} + (left - t.a[0]), high = Floats{} + (right - t.a[0]);
        const auto cut_by = [&](const Floats& at_start, float by) UNSEEN_INLINE_LAMBDA {
            const Floats zero = -at_start / by;
            if (by > 0) low = low < zero ? zero : low;
            else if (by < 0) high = zero < high ? zero : high;
            else high = at_start < 0 ? low : high;
        };
        cut_by(y * t.v_by.y, t.v_by.x);
        cut_by(y * t.w_by.y, t.w_by.x);
        cut_by(1 - y * (t.v_by.y + t.w_by.y), -t.v_by.x - t.w_by.x);
        first = counts_before(low + t.a[0] - offset), end = counts_before(high + t.a[0] - offset);
    }
};

// The samples from x0 to x1 of row y are looked at by registers, `Floats`, whether they lie in the triangle or not; a
// texture only where it is seen. `offset`, `py`: of Rows.
template <class Floats, std::size_t lights>
UNSEEN_INLINE void draw_row(const Shown<lights>& t, const ShownTexture* texture, std::size_t y, float offset, float py,
                            std::size_t x0, std::size_t x1, StageSurfaces& surfaces) {
    constexpr std::size_t width = width_of<Floats>;
    const auto from = static_cast<float>(x0), to = static_cast<float>(x1);
    for (std::size_t begin = x0 / width * width; begin < x1; begin += width) {
        const std::size_t first = y * samples + begin;
        float* const height = surfaces.height.data() + first;
        const Floats x = lanes<Floats>() + static_cast<float>(begin), px = x + offset - t.a[0];
        const Floats v = px * t.v_by.x + py * t.v_by.y, w = px * t.w_by.x + py * t.w_by.y, u = 1 - v - w;
        const Floats h = u * t.a[2] + v * t.b[2] + w * t.c[2];
        const Floats old_height = floats_at<Floats>(height);
        const auto is_seen = (x >= from) & (x < to) & (h > old_height);
        Floats its_texture{};
        store<Floats>(is_seen ? h : old_height, height);
        for (std::size_t k = 0; k < lights; ++k) {
            float* const light = surfaces.light[k].data() + first;
            const std::size_t of = texture && texture->lights.size() > 1 ? k : 0;
            if (texture && k == of)
                for (std::size_t i = 0; i < width; ++i)
                    if (is_seen[i]) its_texture[i] = texture->at(of, v[i], w[i]);
            const Floats own = u * t.of_a[k] + v * t.of_b[k] + w * t.of_c[k],
                         l = texture ? texture->lights[of].with_texture(own, its_texture) : own;
            store<Floats>(is_seen ? l : floats_at<Floats>(light), light);
        }
    }
}

template <class Floats, std::size_t lights>
UNSEEN_INLINE void draw_rows(const Shown<lights>& t, const ShownTexture* texture, StageSurfaces& surfaces) {
    constexpr std::size_t width = width_of<Floats>;
    static_assert(samples % width == 0 && StageCovers::per_side < 64);
    constexpr std::size_t tile = StageCovers::tile;
    std::uint64_t seen = every_tile;
    for (std::size_t first = t.first, end = 0; first < t.end; first = end) {
        end = std::min(first + width, t.end);
        if (t.covers) { // rows of one row of tiles
            const std::size_t end_of_tiles = first / tile * tile + tile;
            seen = t.covers->seen(t, t.number, first / tile);
            end = std::min(seen == 0 ? t.end : end, end_of_tiles);
            if (seen == 0) continue;
        }
        const Rows<Floats> rows(t, first);
        const auto has_samples = rows.first < rows.end; // slivers have none in most rows
        bool has_any = false;
        for (std::size_t i = 0; i < width; ++i) has_any |= has_samples[i] != 0;
        if (!has_any) continue;
        for (std::size_t i = 0; i < end - first; ++i) {
            if (!has_samples[i]) continue;
            for (std::uint64_t left = seen; left != 0;) { // neighbouring tiles together
                const auto from = static_cast<std::size_t>(std::countr_zero(left)),
                           to = from + static_cast<std::size_t>(std::countr_one(left >> from));
                left &= ~std::uint64_t{0} << to;
                const std::size_t x0 = std::max(static_cast<std::size_t>(rows.first[i]), from * tile),
                                  x1 = std::min(static_cast<std::size_t>(rows.end[i]), to * tile);
                if (x0 >= x1) continue;
                surfaces.drawn += x1 - x0;
                draw_row<Floats>(t, texture, first + i, rows.offset[i], rows.y[i], x0, x1, surfaces);
            }
        }
    }
}
// A triangle's plane at the corners of a tile.
struct AtCorners {
    Float4 u, v, w;

    AtCorners(const StageFootprint& t, std::size_t column, std::size_t row) {
        constexpr auto tile = static_cast<float>(StageCovers::tile);
        const Float4 x = (static_cast<float>(column) + Float4{0, 1, 0, 1}) * tile - t.a[0],
                     y = (static_cast<float>(row) + Float4{0, 0, 1, 1}) * tile - t.a[1];
        v = x * t.v_by.x + y * t.v_by.y, w = x * t.w_by.x + y * t.w_by.y, u = 1 - v - w;
    }
    Float4 heights(const StageFootprint& t) const { return u * t.a[2] + v * t.b[2] + w * t.c[2]; }
};

bool all_of(const Int4& mask) { return (mask[0] & mask[1] & mask[2] & mask[3]) != 0; }

struct Columns { // of tiles
    std::size_t first, end;
};
Columns columns_of(const StageFootprint& t) {
    constexpr std::size_t tile = StageCovers::tile;
    return {count_before(std::min({t.a[0], t.b[0], t.c[0]}) - 1) / tile,
            (count_before(std::max({t.a[0], t.b[0], t.c[0]})) + tile - 1) / tile};
}

} // namespace

// ---- where pictures are taken from

Float4 StageCamera::place(const glm::vec3& p) const {
    const auto along = [&](int axis) { return Float4{right[axis], up[axis], towards[axis], 0}; };
    const glm::vec3 q = (p - centre) * samples_per_length;
    return q.x * along(0) + q.y * along(1) + q.z * along(2) + Float4{samples / 2.0f, samples / 2.0f, 0, 0};
}

StageCamera stage_camera(const Sphere& sphere, std::size_t number) {
    constexpr float golden_angle = 2.39996323f;
    const float z = 1 - static_cast<float>(2 * number + 1) / direction_count, s = std::sqrt(1 - z * z);
    const float angle = golden_angle * static_cast<float>(number);
    StageCamera c;
    c.number = number;
    c.centre = sphere.centre;
    c.towards = {s * std::cos(angle), s * std::sin(angle), z};
    c.right =
        glm::normalize(glm::cross(std::abs(c.towards.y) < 0.9f ? glm::vec3(0, 1, 0) : glm::vec3(1, 0, 0), c.towards));
    c.up = glm::cross(c.towards, c.right);
    c.samples_per_length = samples / (2 * stage_margin * sphere.radius);
    return c;
}

// ---- what hides triangles

StageCovers::StageCovers()
    : covers_(per_side * per_side, {Float4{nothing, nothing, nothing, nothing}, static_cast<std::size_t>(-1)}) {}

void StageCovers::add(const StageFootprint& t, std::size_t number) {
    constexpr float inside = 1e-3f; // of each corner's weight: beyond what rounding makes of the rows' ends
    const Columns columns = columns_of(t);
    for (std::size_t row = (t.first + tile - 1) / tile; row < t.end / tile; ++row) {
        for (std::size_t column = columns.first; column < columns.end; ++column) {
            const AtCorners at(t, column, row);
            if (!all_of((at.u >= inside) & (at.v >= inside) & (at.w >= inside))) continue;
            Cover& cover = covers_[row * per_side + column];
            const Float4 height = at.heights(t), nearer = height - cover.height;
            if (nearer[0] + nearer[1] + nearer[2] + nearer[3] > 0) cover = {height, number};
        }
    }
}

std::uint64_t StageCovers::seen(const StageFootprint& t, std::size_t number, std::size_t row) const {
    const Columns columns = columns_of(t);
    std::uint64_t seen = 0;
    for (std::size_t column = columns.first; column < columns.end; ++column) {
        const Cover& cover = covers_[row * per_side + column];
        const bool is_hidden = cover.number != number && all_of(AtCorners(t, column, row).heights(t) <= cover.height);
        seen |= static_cast<std::uint64_t>(!is_hidden) << column;
    }
    return seen;
}

bool StageCovers::repeats(const StageFootprint& t) {
    if (t.end - t.first < tile) return false;
    const Float4 corners[] = {t.a, t.b, t.c};
    return !places_.emplace(reinterpret_cast<const char*>(corners), sizeof corners).second;
}

// ---- pictures

void StagePicture::subtract(const StagePicture& other) {
    for (std::size_t i = 0; i < light.values.size(); ++i) {
        light.values[i] -= other.light.values[i];
        cover.values[i] -= other.cover.values[i];
    }
}

void StageSurfaces::clear(std::size_t lights) {
    height.assign(samples * samples, nothing);
    for (std::size_t i = 0; i < lights; ++i) light[i].assign(samples * samples, 0.0f);
    drawn = 0;
}

StagePainter::StagePainter(const VertexTree& tree, std::span<const TexturedLight> textures, const StageCamera& camera,
                           StageSurfaces& surfaces)
    : textures_(textures), camera_(camera), positions_(tree.positions()), uvs_(tree.uvs()),
      closedness_(tree.closedness()), surfaces_(surfaces) {}

template <std::size_t lights>
std::array<StagePicture, lights> StagePainter::draw(std::span<const Triangle> triangles,
                                                    const FunctionRef<std::array<float, lights>(WedgeId)>& luminance) {
    if (triangles.empty()) return {}; // as of the last stage
    surfaces_.clear(lights);
    // Most triangles of a fine mesh lie between two rows of samples: these are passed over by their corners alone.
    const bool knows_rows = triangles.size() > positions_.size() / 4;
    if (knows_rows) find_rows_before();
    const auto& before = surfaces_.rows_before;
    std::optional<StageCovers> covers;
    for (std::size_t number = 0; number < triangles.size(); ++number) {
        const Triangle& corners = triangles[number];
        if (knows_rows && before[corners[0]] == before[corners[1]] && before[corners[0]] == before[corners[2]])
            continue;
        const auto place = footprint(corners);
        if (!place || (covers && covers->repeats(*place))) continue;
        const Shown<lights> t{*place, luminance(corners[0]),      luminance(corners[1]), luminance(corners[2]),
                              number, covers ? &*covers : nullptr};
        std::optional<ShownTexture> texture;
        if (textures_.front().texture)
            texture.emplace(t, textures_, std::array{uvs_[corners[0]], uvs_[corners[1]], uvs_[corners[2]]});
        on_widest([&]<class Floats>()
                      UNSEEN_INLINE_LAMBDA { draw_rows<Floats>(t, texture ? &*texture : nullptr, surfaces_); });
        if (covers || surfaces_.drawn <= most_layers * samples * samples) continue;
        covers.emplace();
        for (std::size_t later = number + 1; later < triangles.size(); ++later)
            if (const auto its = footprint(triangles[later])) covers->add(*its, later);
    }
    return cells<lights>();
}

// As footprint() finds the rows of a triangle, bit for bit.
void StagePainter::find_rows_before() {
    surfaces_.rows_before.resize(positions_.size());
    constexpr std::size_t at_once = width_of<Float4>;
    for (std::size_t first = 0; first < positions_.size(); first += at_once) {
        const std::size_t count = std::min(at_once, positions_.size() - first);
        Float4 up{};
        for (int axis = 0; axis < 3; ++axis) {
            Float4 along;
            for (std::size_t i = 0; i < at_once; ++i) along[i] = positions_[first + std::min(i, count - 1)][axis];
            const Float4 q = (along - camera_.centre[axis]) * camera_.samples_per_length * camera_.up[axis];
            up = axis == 0 ? q : up + q;
        }
        const Int4 rows = counts_before(up + samples / 2.0f - 0.5f);
        for (std::size_t i = 0; i < count; ++i) surfaces_.rows_before[first + i] = static_cast<std::uint16_t>(rows[i]);
    }
}

// None for what is not seen.
std::optional<StageFootprint> StagePainter::footprint(const Triangle& corners) const {
    StageFootprint t;
    t.a = camera_.place(positions_[corners[0]]);
    t.b = camera_.place(positions_[corners[1]]);
    t.c = camera_.place(positions_[corners[2]]);
    const Float4 ab = t.b - t.a, ac = t.c - t.a;
    const float area = ab[0] * ac[1] - ab[1] * ac[0];
    if ((closedness_ == Closedness::closed_outward && area < 0) ||
        (closedness_ == Closedness::closed_inward && area > 0)) // as renderers do
        return std::nullopt;
    t.first = count_before(std::min({t.a[1], t.b[1], t.c[1]}) - 0.5f);
    t.end = count_before(std::max({t.a[1], t.b[1], t.c[1]}) - 0.5f);
    if (t.first >= t.end) return std::nullopt; // many, of fine meshes
    const float inverse = 1 / area;
    if (!std::isfinite(inverse)) return std::nullopt;
    if (closedness_ == Closedness::open && area < 0)
        for (Float4* const corner : {&t.a, &t.b, &t.c}) (*corner)[2] -= behind;
    t.v_by = inverse * glm::vec2(ac[1], -ac[0]);
    t.w_by = inverse * glm::vec2(-ab[1], ab[0]);
    return t;
}

// The means of the samples, four cells at a time.
template <std::size_t lights>
std::array<StagePicture, lights> StagePainter::cells() const {
    static_assert(cell_samples == 4 && stage_side % 4 == 0);
    constexpr float share = 1.0f / (cell_samples * cell_samples);
    std::array<StagePicture, lights> pictures;
    for (std::size_t cell = 0; cell < stage_side * stage_side; cell += 4) {
        const std::size_t first = cell / stage_side * cell_samples * samples + cell % stage_side * cell_samples;
        const auto mean = [&](const std::vector<float>& plane, const auto& of_sample, Raster& to) {
            Float4 sum{};
            for (std::size_t y = 0; y < cell_samples; ++y) {
                Float4 columns[cell_samples];
                load_columns([&](std::size_t lane) { return plane.data() + first + y * samples + lane * cell_samples; },
                             columns);
                for (const Float4& column : columns) sum += of_sample(column);
            }
            sum *= share;
            store(sum, to.values.data() + cell);
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

template std::array<StagePicture, 1> StagePainter::draw(std::span<const Triangle>,
                                                        const FunctionRef<std::array<float, 1>(WedgeId)>&);
template std::array<StagePicture, 3> StagePainter::draw(std::span<const Triangle>,
                                                        const FunctionRef<std::array<float, 3>(WedgeId)>&);
template std::array<StagePicture, 4> StagePainter::draw(std::span<const Triangle>,
                                                        const FunctionRef<std::array<float, 4>(WedgeId)>&);

namespace {

// The share of a grating's amplitude that is left in cells, which show the mean over their area; cycles a cell.
double share_in_cells(double frequency) {
    return std::sin(std::numbers::pi * frequency) / (std::numbers::pi * frequency);
}

// The largest contrasts of a band. `Floats`: a register's, each lane with places of its own.
template <class Floats>
UNSEEN_INLINE void find_contrasts(const StageBands::Band& mesh, const StageBands::Band& difference, std::size_t band,
                                  const StageSurround& around, FoldStage& stage) {
    constexpr auto& masks = FoldStage::masks;
    constexpr std::size_t backgrounds = FoldStage::backgrounds.size(), width = width_of<Floats>;
    const auto magnitude = [](const Floats& v) UNSEEN_INLINE_LAMBDA { return v < 0 ? -v : v; };
    const float inverse_gain = 1 / static_cast<float>(band_gain(band) * share_in_cells(nominal_frequency(band)));
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
} // namespace

StageBands::StageBands(const StagePicture& picture) {
    Raster light = picture.light, cover = picture.cover;
    for (Band& band : bands_) {
        band.light = std::move(light), band.cover = std::move(cover);
        light = split(band.light, band.mean_light);
        cover = split(band.cover, band.mean_cover);
    }
}

Raster StageBands::split(Raster& plane, Raster& mean) {
    Raster next = reduce(plane);
    mean = expand(next, plane.side);
    for (std::size_t i = 0; i < plane.values.size(); ++i) plane.values[i] -= mean.values[i];
    return next;
}

void StageBands::set_to_sum(const StageBands& picture, float share, const StageBands& other, float other_share) {
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

void add_contrasts(const StageBands& mesh, const StageBands& difference, const StageSurround& around,
                   FoldStage& stage) {
    for (std::size_t b = 0; b < FoldStage::band_count; ++b)
        on_widest([&]<class Floats>()
                      UNSEEN_INLINE_LAMBDA { find_contrasts<Floats>(mesh[b], difference[b], b, around, stage); });
}

} // namespace unseen::perception
