#include "measure/texture_detail.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/parallel.h>

#include "measure/fold_record.h"

namespace unseen::perception {

using namespace vdtree;

namespace {

constexpr std::uint32_t tile_side = 4; // texels
constexpr std::int64_t most_tiles = 8; // a side that a box is looked up in
// Beyond, a coordinate in float has no texel of its own any more.
constexpr double farthest_coordinate = 1 << 23; // texels

std::uint32_t tiles_of(std::uint32_t texels) { return (texels + tile_side - 1) / tile_side; }

} // namespace

TextureDetail::TextureDetail(const ShownTexels& texels, glm::vec3 tint) {
    const glm::dvec3 of_tint(tint);
    const double own = rec709_luminance(of_tint);
    set_levels(texels.texture(), [&](std::size_t i) {
        return own > 0 ? rec709_luminance(of_tint * glm::dvec3(texels.colour(i))) / own : texels.luminance(i);
    });
    for (std::size_t level = 0; level < levels_.size(); ++level) find_contrasts(level);
}

TextureDetail TextureDetail::of_primary(const ShownTexels& texels, int primary) {
    TextureDetail detail;
    detail.set_levels(texels.texture(), [&](std::size_t i) { return texels.colour(i)[primary]; });
    return detail;
}

template <class Value>
void TextureDetail::set_levels(const TextureView& size, Value&& value) {
    width_ = size.width, height_ = size.height, wrap_u_ = size.wrap_u, wrap_v_ = size.wrap_v;
    Level base{width_, height_, std::vector<float>(std::size_t{width_} * height_), {}};
    parallel_loop(std::size_t{0}, std::size_t{height_}, [&](std::size_t y) {
        for (std::size_t i = y * width_; i < (y + 1) * width_; ++i) base.means[i] = static_cast<float>(value(i));
    });
    levels_.push_back(std::move(base));
    while (levels_.back().width > 1 || levels_.back().height > 1) {
        const Level& fine = levels_.back();
        Level coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}, {}};
        coarse.means.resize(std::size_t{coarse.width} * coarse.height);
        parallel_loop(std::uint32_t{0}, coarse.height, [&](std::uint32_t y) {
            for (std::uint32_t x = 0; x < coarse.width; ++x) {
                float sum = 0, count = 0;
                for (std::uint32_t fy = 2 * y; fy < std::min(2 * y + 2, fine.height); ++fy)
                    for (std::uint32_t fx = 2 * x; fx < std::min(2 * x + 2, fine.width); ++fx)
                        sum += fine.means[std::size_t{fy} * fine.width + fx], count += 1;
                coarse.means[std::size_t{y} * coarse.width + x] = sum / count;
            }
        });
        levels_.push_back(std::move(coarse));
    }
}

void TextureDetail::include_colours(std::span<const std::shared_ptr<const TextureDetail>> primaries) {
    for (std::size_t level = 0; level < levels_.size(); ++level) {
        levels_[level].tiles.clear();
        find_contrasts(level, primaries);
    }
}

TextureDetail TextureDetail::stand_in(float mean) {
    using namespace measurement;
    static_assert((stand_in_side & (stand_in_side - 1)) == 0);
    TextureDetail noise;
    noise.width_ = noise.height_ = stand_in_side;
    for (std::uint32_t side = stand_in_side; side > 0; side /= 2)
        noise.levels_.push_back({side, side, std::vector<float>(std::size_t{side} * side, mean), {}});
    // From each level to the next finer one: of a texel's four, two are brighter and two are darker.
    for (std::size_t number = std::min(stand_in_octaves, noise.levels_.size() - 1); number-- > 0;) {
        Level& level = noise.levels_[number];
        const std::uint32_t side = level.width;
        parallel_loop(std::uint32_t{0}, side, [&](std::uint32_t y) {
            for (std::uint32_t x = 0; x < side; ++x) {
                constexpr std::array<unsigned, 6> halves = {0b0011, 0b0101, 0b0110, 0b1001, 0b1010, 0b1100};
                std::uint64_t random = ((number << 24) + (y / 2)) << 24 | (x / 2);
                random = (random + 1) * 0x9e3779b97f4a7c15u; // SplitMix64 (Steele, Lea and Flood 2014)
                random = (random ^ (random >> 30)) * 0xbf58476d1ce4e5b9u;
                random = (random ^ (random >> 27)) * 0x94d049bb133111ebu;
                const bool is_bright = (halves[(random >> 32) % 6] >> (y % 2 * 2 + x % 2)) & 1;
                const float low = noise.bilinear(noise.levels_[number + 1], (x + 0.5) / side, (y + 0.5) / side);
                level.means[std::size_t{y} * side + x] = low * (1 + (is_bright ? usual_contrast : -usual_contrast));
            }
        });
    }
    for (std::size_t level = 0; level < noise.levels_.size(); ++level) noise.find_contrasts(level);
    return noise;
}

void TextureDetail::find_contrasts(std::size_t number,
                                   std::span<const std::shared_ptr<const TextureDetail>> primaries) {
    Level& level = levels_[number];
    const Level* const next = number + 1 < levels_.size() ? &levels_[number + 1] : nullptr;
    Tiles tiles{tiles_of(level.width), tiles_of(level.height), {}};
    tiles.largest.resize(std::size_t{tiles.width} * tiles.height, 0.0f);
    parallel_loop(std::uint32_t{0}, tiles.height, [&](std::uint32_t row) {
        for (std::uint32_t y = row * tile_side; y < std::min((row + 1) * tile_side, level.height); ++y)
            for (std::uint32_t x = 0; x < level.width; ++x) {
                if (!next) continue; // one texel: nothing varies
                const float low = bilinear(*next, (x + 0.5) / level.width, (y + 0.5) / level.height);
                const std::size_t texel = std::size_t{y} * level.width + x;
                float detail = std::abs(level.means[texel] - low);
                if (!primaries.empty()) {
                    glm::vec3 by;
                    for (int k = 0; k < 3; ++k) {
                        const auto& levels = primaries[static_cast<std::size_t>(k)]->levels_;
                        by[k] = levels[number].means[texel] -
                                bilinear(levels[number + 1], (x + 0.5) / level.width, (y + 0.5) / level.height);
                    }
                    const glm::vec3 seen = as_luminances(by);
                    detail = glm::length(glm::vec3(detail, seen.y, seen.z));
                }
                float& largest = tiles.largest[std::size_t{row} * tiles.width + x / tile_side];
                largest = std::max(largest, detail / (low + FoldStage::black));
            }
    });
    level.tiles.push_back(std::move(tiles));
    while (level.tiles.back().width > 1 || level.tiles.back().height > 1) {
        const Tiles& fine = level.tiles.back();
        Tiles coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}};
        coarse.largest.resize(std::size_t{coarse.width} * coarse.height, 0.0f);
        for (std::uint32_t y = 0; y < fine.height; ++y)
            for (std::uint32_t x = 0; x < fine.width; ++x) {
                float& largest = coarse.largest[std::size_t{y / 2} * coarse.width + x / 2];
                largest = std::max(largest, fine.largest[std::size_t{y} * fine.width + x]);
            }
        level.tiles.push_back(std::move(coarse));
    }
}

float TextureDetail::bilinear(const Level& level, double u, double v) const {
    const double x = u * level.width - 0.5, y = v * level.height - 0.5;
    if (!(std::abs(x) < farthest_coordinate) || !(std::abs(y) < farthest_coordinate)) return levels_.back().means[0];
    const double fx = std::floor(x), fy = std::floor(y);
    const auto i = static_cast<std::int64_t>(fx), j = static_cast<std::int64_t>(fy);
    const auto s = static_cast<float>(x - fx), t = static_cast<float>(y - fy);
    const std::int64_t left = wrapped_texel(i, level.width, wrap_u_),
                       right = wrapped_texel(i + 1, level.width, wrap_u_);
    const float *const low = level.means.data() + wrapped_texel(j, level.height, wrap_v_) * level.width,
                       *const high = level.means.data() + wrapped_texel(j + 1, level.height, wrap_v_) * level.width;
    return (1 - t) * ((1 - s) * low[left] + s * low[right]) + t * ((1 - s) * high[left] + s * high[right]);
}

float TextureDetail::at(std::size_t level, glm::vec2 uv) const {
    return bilinear(levels_[std::min(level, levels_.size() - 1)], static_cast<double>(uv.x), static_cast<double>(uv.y));
}

float TextureDetail::nearest_outside(const Level& level, float x, float y) const {
    constexpr auto farthest = static_cast<float>(farthest_coordinate);
    if (!(std::abs(x) < farthest) || !(std::abs(y) < farthest)) return levels_.back().means[0];
    const auto column = wrapped_texel(static_cast<std::int64_t>(std::floor(x)), level.width, wrap_u_),
               row = wrapped_texel(static_cast<std::int64_t>(std::floor(y)), level.height, wrap_v_);
    return level.means[static_cast<std::size_t>(row * level.width + column)];
}

std::size_t TextureDetail::level_of(float texels) const {
    std::size_t level = 0;
    while (level + 1 < levels_.size() && std::exp2(static_cast<float>(level)) < texels) ++level;
    return level;
}

std::size_t TextureDetail::runs_of(float lo, float hi, std::uint32_t size, Wrap wrap, Run (&runs)[2]) {
    const std::int64_t n = size;
    const double first = static_cast<double>(lo) * size - 1, last = static_cast<double>(hi) * size + 1;
    runs[0] = {0, n - 1};
    if (!(first > -farthest_coordinate) || !(last < farthest_coordinate) || !(last - first < size)) return 1;
    const auto begin = static_cast<std::int64_t>(std::floor(first)), end = static_cast<std::int64_t>(std::floor(last));
    const std::int64_t a = wrapped_texel(begin, n, wrap), b = wrapped_texel(end, n, wrap);
    const bool is_one = wrap == Wrap::clamp || (begin - wrapped_texel(begin, n, Wrap::repeat)) / n ==
                                                   (end - wrapped_texel(end, n, Wrap::repeat)) / n;
    if (is_one) {
        runs[0] = {std::min(a, b), std::max(a, b)};
        return 1;
    }
    if (wrap == Wrap::mirror) return 1; // about a border: all of it
    runs[0] = {a, n - 1}, runs[1] = {0, b};
    return 2;
}

float TextureDetail::contrast(std::size_t number, const UvBox& box) const {
    const Level& level = levels_[std::min(number, levels_.size() - 1)];
    if (box.is_empty()) return level.tiles.back().largest[0];
    Run columns[2], rows[2];
    const std::size_t column_runs = runs_of(box.lo.x, box.hi.x, level.width, wrap_u_, columns),
                      row_runs = runs_of(box.lo.y, box.hi.y, level.height, wrap_v_, rows);
    float largest = 0;
    for (std::size_t r = 0; r < row_runs; ++r)
        for (std::size_t c = 0; c < column_runs; ++c) {
            const Run x{columns[c].first / tile_side, columns[c].last / tile_side},
                y{rows[r].first / tile_side, rows[r].last / tile_side};
            std::size_t k = 0;
            while (std::max((x.last >> k) - (x.first >> k), (y.last >> k) - (y.first >> k)) >= most_tiles) ++k;
            const Tiles& tiles = level.tiles[k];
            for (std::int64_t j = y.first >> k; j <= y.last >> k; ++j)
                for (std::int64_t i = x.first >> k; i <= x.last >> k; ++i)
                    largest = std::max(
                        largest,
                        tiles.largest[static_cast<std::size_t>(j) * tiles.width + static_cast<std::size_t>(i)]);
        }
    return largest;
}

namespace {

// A triangle's side is cut into equal parts of about so many texels, in whose middles the texture's mean is looked up.
// With coarser ones, what the means are wrong by looks like light that folds add; more than so many cost more than they
// tell.
constexpr float texels_of_part = 1;
constexpr int fewest_parts = 3, most_parts = 32;

} // namespace

float TexturedLight::mean(const std::array<float, 3>& luminance, const std::array<glm::vec2, 3>& uv) const {
    const glm::vec2 low = glm::min(glm::min(uv[0], uv[1]), uv[2]), high = glm::max(glm::max(uv[0], uv[1]), uv[2]),
                    texels = (high - low) * texture->size();
    const float side = std::max(texels.x, texels.y);
    const int parts = static_cast<int>(
        std::clamp(std::ceil(side / texels_of_part), static_cast<float>(fewest_parts), static_cast<float>(most_parts)));
    const auto count = static_cast<float>(parts);
    const std::size_t level = texture->level_of(side / count);
    float sum = 0;
    const auto add = [&](float second, float third) { // weights
        const float first = count - second - third;
        const glm::vec2 at = (first * uv[0] + second * uv[1] + third * uv[2]) / count;
        const float own = (first * luminance[0] + second * luminance[1] + third * luminance[2]) / count;
        sum += with_texture(own, texture->at(level, at));
    };
    for (int i = 0; i < parts; ++i)
        for (int k = 0; i + k < parts; ++k) {
            add(static_cast<float>(i) + 1.0f / 3, static_cast<float>(k) + 1.0f / 3);
            if (i + k + 1 < parts) add(static_cast<float>(i) + 2.0f / 3, static_cast<float>(k) + 2.0f / 3);
        }
    return sum / (count * count);
}

TextureDensities::TextureDensities(const SoundTree& tree, const TextureDetail& texture)
    : before_triangle_(tree.triangles().size() + 1), subtree_end_(tree.subtree_end()),
      first_triangle_(tree.first_triangle()) {
    const WedgeId leaves = tree.interior_wedge_count();
    const TexturedLight white{&texture};
    const glm::dvec2 size(texture.size());
    for (std::size_t i = 0; i < tree.triangles().size(); ++i) {
        const Triangle& t = tree.triangles()[i];
        const auto place = [&](std::size_t k) { return glm::dvec3(tree.positions()[leaves + t[k]]); };
        const auto texel = [&](std::size_t k) { return glm::dvec2(tree.uvs()[leaves + t[k]]) * size; };
        const glm::dvec3 b = place(1) - place(0), c = place(2) - place(0);
        const glm::dvec2 p = texel(1) - texel(0), q = texel(2) - texel(0);
        // The squares of the densities are the eigenvalues of the texels' metric in that of the surface.
        const double bb = glm::dot(b, b), bc = glm::dot(b, c), cc = glm::dot(c, c), surface = bb * cc - bc * bc;
        const double pp = glm::dot(p, p), pq = glm::dot(p, q), qq = glm::dot(q, q);
        const double half_trace = (cc * pp - 2 * bc * pq + bb * qq) / surface / 2,
                     determinant = (pp * qq - pq * pq) / surface;
        const double root = std::sqrt(std::max(half_trace * half_trace - determinant, 0.0));
        Sum sum = before_triangle_[i];
        if (surface > 0 && std::isfinite(half_trace) && std::isfinite(determinant)) {
            const double area = std::sqrt(surface) / 2;
            const auto uv = [&](std::size_t k) { return tree.uvs()[leaves + t[k]]; };
            const auto light = static_cast<double>(white.mean({1, 1, 1}, {uv(0), uv(1), uv(2)}));
            sum += {area, area * std::max(half_trace - root, 0.0), area * (half_trace + root), area * light};
        }
        before_triangle_[i + 1] = sum;
    }
}

TextureDensities::Sum TextureDensities::between(Index first, Index end) const {
    const Sum &from = before_triangle_[first], &to = before_triangle_[end];
    return {to.area - from.area, to.least - from.least, to.most - from.most, to.light - from.light};
}

TextureDensity TextureDensities::of(NodeId node, std::span<const Index> around) const {
    const Index first = first_triangle_[node], end = first_triangle_[subtree_end_[node]];
    Sum sum = between(first, end);
    for (const Index t : around)
        if (t < first || t >= end) sum += between(t, t + 1);
    if (!(sum.area > 0)) return {};
    const auto mean = [&](double of) { return static_cast<float>(std::max(of / sum.area, 0.0)); };
    return {std::sqrt(mean(sum.least)), std::sqrt(mean(sum.most)), std::min(mean(sum.light), 1.0f)};
}

} // namespace unseen::perception
