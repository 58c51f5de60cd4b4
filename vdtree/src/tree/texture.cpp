// Pyramids of the least, the largest and the mean luminance of textures.

#include <algorithm>
#include <numbers>

#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/texture_pyramid.h>

namespace unseen::vdtree {

namespace {

const std::array<double, 256>& linear_of_code() {
    static const std::array<double, 256> table = [] {
        std::array<double, 256> t{};
        for (int code = 0; code < 256; ++code) t[static_cast<std::size_t>(code)] = srgb_to_linear(code / 255.0);
        return t;
    }();
    return table;
}

// Filters on graphics processors place their samples to 1/256 of a texel, and keep light in half floats.
constexpr double placing_slack = 1.0 / 64;    // texels
constexpr double float_slack = 4e-7;          // of a coordinate: a few roundings of its float on the way to the texel
constexpr double decoding_slack = 1.0 / 4096; // of a luminance, and of 1/16 at least
// Ranges are looked up in boxes of up to this many cells a side, which exceed the asked box by less than a seventh.
constexpr std::int64_t most_cells = 16;
// Beyond this, floats cannot tell texels apart.
constexpr double farthest_coordinate = 1 << 23; // texels

PackedRange decoded_range(double y) {
    constexpr double largest = Unorm16::largest;
    const double slack = decoding_slack * std::max(y, 1.0 / 16);
    const auto packed = [&](double units) {
        return Unorm16{static_cast<std::uint16_t>(std::clamp(units, 0.0, largest))};
    };
    return {packed(std::floor((y - slack) * largest)), packed(std::ceil((y + slack) * largest))};
}

} // namespace

Result<void> validate(const TextureView& texture) {
    if (texture.texels.empty() && texture.width == 0 && texture.height == 0) return {};
    const auto invalid = [](const std::string& what) { return Error{ErrorCode::malformed_data, what}; };
    const std::string size = std::to_string(texture.width) + " x " + std::to_string(texture.height);
    if (texture.width == 0 || texture.height == 0)
        return invalid("The texture of " + size + " texels is empty; give another one.");
    if (texture.width > largest_texture_side || texture.height > largest_texture_side)
        return invalid("The texture has " + size + " texels, and at most " + std::to_string(largest_texture_side) +
                       " a side can be drawn; scale it down.");
    if (texture.texels.size() != std::size_t{texture.width} * texture.height)
        return invalid("The texture of " + size + " texels holds " + std::to_string(texture.texels.size()) +
                       "; give as many as it says.");
    for (const auto further : {texture.emission, texture.relief})
        if (!further.empty() && further.size() != texture.texels.size())
            return invalid("A map over the texture of " + size + " texels holds " + std::to_string(further.size()) +
                           "; give as many, or none.");
    for (const Wrap wrap : {texture.wrap_u, texture.wrap_v})
        if (wrap != Wrap::repeat && wrap != Wrap::clamp && wrap != Wrap::mirror)
            return invalid("The texture repeats in a way that is not known.");
    return {};
}

std::int64_t wrapped_texel(std::int64_t i, std::int64_t size, Wrap wrap) noexcept {
    if (i >= 0 && i < size) return i; // most; divisions take long
    if (wrap == Wrap::clamp) return i < 0 ? 0 : size - 1;
    const std::int64_t period = wrap == Wrap::mirror ? 2 * size : size, rest = i % period;
    const std::int64_t within = rest < 0 ? rest + period : rest;
    return within < size ? within : period - 1 - within; // mirrored
}

glm::vec4 linear_colour(Texel texel) noexcept {
    const auto& linear = linear_of_code();
    return {static_cast<float>(linear[texel[0]]), static_cast<float>(linear[texel[1]]),
            static_cast<float>(linear[texel[2]]), static_cast<float>(texel[3]) / 255.0f};
}

double linear_luminance(Texel texel) noexcept {
    const auto& linear = linear_of_code();
    return rec709_luminance(glm::dvec3(linear[texel[0]], linear[texel[1]], linear[texel[2]]));
}

bool has_cut_outs(const TextureView& texture) noexcept {
    return std::ranges::any_of(texture.texels, [&](Texel texel) { return coverage(texture, texel) < 1; });
}

glm::vec3 relief_normal(Texel texel) noexcept {
    const auto axis = [](std::uint8_t code) { return std::max((static_cast<float>(code) - 128) / 127, -1.0f); };
    return {axis(texel[0]), axis(texel[1]), axis(texel[2])};
}

CutOuts::CutOuts(const TextureView& texture) : width_(texture.width), height_(texture.height) {
    if (!has_cut_outs(texture)) return;
    const std::size_t columns = std::size_t{width_} + 1;
    sums_.assign(columns * (std::size_t{height_} + 1), 0);
    for (std::size_t y = 0; y < height_; ++y) {
        std::uint32_t of_row = 0;
        for (std::size_t x = 0; x < width_; ++x) {
            of_row += coverage(texture, texture.texels[y * width_ + x]) < 1;
            sums_[(y + 1) * columns + x + 1] = sums_[y * columns + x + 1] + of_row;
        }
    }
}

bool CutOuts::any(const UvBox& box) const {
    if (is_empty() || box.is_empty()) return false;
    if (!(box.lo.x >= 0 && box.lo.y >= 0 && box.hi.x <= 1 && box.hi.y <= 1)) return true;
    const auto cells = [](float lo, float hi, std::uint32_t size) { // with the texels beside them
        const double first = std::floor(static_cast<double>(lo) * size - 1),
                     end = std::ceil(static_cast<double>(hi) * size + 1);
        return std::pair(static_cast<std::size_t>(std::max(first, 0.0)),
                         static_cast<std::size_t>(std::min<double>(end, size)));
    };
    const auto [left, right] = cells(box.lo.x, box.hi.x, width_);
    const auto [top, bottom] = cells(box.lo.y, box.hi.y, height_);
    const std::size_t columns = std::size_t{width_} + 1;
    return sums_[bottom * columns + right] - sums_[top * columns + right] - sums_[bottom * columns + left] +
               sums_[top * columns + left] !=
           0;
}

TexturePyramid::TexturePyramid(const TextureView& texture)
    : width_(texture.width), height_(texture.height), wrap_u_(texture.wrap_u), wrap_v_(texture.wrap_v) {
    Level base{width_, height_, {}, {}};
    base.ranges.resize(texture.texels.size());
    base.means.resize(texture.texels.size());
    parallel_loop(std::size_t{0}, std::size_t{height_}, [&](std::size_t y) {
        for (std::size_t i = y * width_; i < (y + 1) * width_; ++i) {
            const double luminance = linear_luminance(texture.texels[i]);
            base.ranges[i] = decoded_range(luminance);
            base.means[i] = static_cast<float>(luminance);
        }
    });
    levels_.push_back(std::move(base));
    while (levels_.back().width > 1 || levels_.back().height > 1) {
        const Level& fine = levels_.back();
        Level coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}, {}};
        coarse.ranges.resize(std::size_t{coarse.width} * coarse.height);
        coarse.means.resize(coarse.ranges.size());
        parallel_loop(std::uint32_t{0}, coarse.height, [&](std::uint32_t y) {
            for (std::uint32_t x = 0; x < coarse.width; ++x) {
                PackedRange range = empty_range;
                double sum = 0;
                int count = 0;
                for (std::uint32_t fy = 2 * y; fy < std::min(2 * y + 2, fine.height); ++fy) {
                    for (std::uint32_t fx = 2 * x; fx < std::min(2 * x + 2, fine.width); ++fx) {
                        const std::size_t i = std::size_t{fy} * fine.width + fx;
                        range = unite(range, fine.ranges[i]);
                        sum += static_cast<double>(fine.means[i]);
                        ++count;
                    }
                }
                const std::size_t i = std::size_t{y} * coarse.width + x;
                coarse.ranges[i] = range;
                coarse.means[i] = static_cast<float>(sum / count);
            }
        });
        levels_.push_back(std::move(coarse));
    }
}

// The texels between which filtering interpolates.
TexturePyramid::Cells TexturePyramid::texels_of(double lo, double hi, std::uint32_t size, Wrap wrap) {
    const std::int64_t n = size;
    const double first = lo * size, last = hi * size;
    const double slack = placing_slack + float_slack * std::max(std::abs(first), std::abs(last));
    if (!(std::abs(first) < farthest_coordinate) || !(std::abs(last) < farthest_coordinate)) return {0, n - 1, -1};
    const auto begin = static_cast<std::int64_t>(std::floor(first - 0.5 - slack)),
               end = static_cast<std::int64_t>(std::floor(last + 0.5 + slack));
    const std::int64_t first_texel = wrapped_texel(begin, n, wrap), last_texel = wrapped_texel(end, n, wrap);
    if (wrap == Wrap::clamp) return {first_texel, last_texel, -1};
    if (wrap == Wrap::mirror) { // what lies on both sides of a border is one run up to it
        const std::int64_t copy = (begin - wrapped_texel(begin, n, Wrap::repeat)) / n,
                           last_copy = (end - wrapped_texel(end, n, Wrap::repeat)) / n;
        const bool has_both_borders = last_copy - copy > 1, has_one = last_copy - copy == 1;
        const bool has_first = has_both_borders || (has_one && last_copy % 2 == 0),
                   has_last = has_both_borders || (has_one && last_copy % 2 != 0);
        return {has_first ? 0 : std::min(first_texel, last_texel), has_last ? n - 1 : std::max(first_texel, last_texel),
                -1};
    }
    if (end - begin + 1 >= n) return {0, n - 1, -1};
    const std::int64_t wrapped_end = first_texel + (end - begin);
    return wrapped_end < n ? Cells{first_texel, wrapped_end, -1} : Cells{first_texel, n - 1, wrapped_end - n};
}

PackedRange TexturePyramid::range(const UvBox& box) const {
    if (box.is_empty()) return levels_.back().ranges[0];
    const Cells u = texels_of(static_cast<double>(box.lo.x), static_cast<double>(box.hi.x), width_, wrap_u_);
    const Cells v = texels_of(static_cast<double>(box.lo.y), static_cast<double>(box.hi.y), height_, wrap_v_);
    const auto look = [&](std::int64_t x0, std::int64_t x1, std::int64_t y0, std::int64_t y1) {
        std::size_t k = 0;
        while (std::max((x1 >> k) - (x0 >> k), (y1 >> k) - (y0 >> k)) >= most_cells) ++k;
        const Level& level = levels_[k];
        PackedRange range = empty_range;
        for (std::int64_t y = y0 >> k; y <= y1 >> k; ++y)
            for (std::int64_t x = x0 >> k; x <= x1 >> k; ++x)
                range =
                    unite(range, level.ranges[static_cast<std::size_t>(y) * level.width + static_cast<std::size_t>(x)]);
        return range;
    };
    PackedRange range = look(u.first, u.last, v.first, v.last);
    if (u.second_last >= 0) range = unite(range, look(0, u.second_last, v.first, v.last));
    if (v.second_last >= 0) range = unite(range, look(u.first, u.last, 0, v.second_last));
    if (u.second_last >= 0 && v.second_last >= 0) range = unite(range, look(0, u.second_last, 0, v.second_last));
    return range;
}

float TexturePyramid::texel_mean(const Level& level, std::int64_t x, std::int64_t y) const {
    const auto column = static_cast<std::size_t>(wrapped_texel(x, level.width, wrap_u_)),
               row = static_cast<std::size_t>(wrapped_texel(y, level.height, wrap_v_));
    return level.means[row * level.width + column];
}

double TexturePyramid::bilinear_mean(const Level& level, glm::dvec2 uv) const {
    const double x = uv.x * level.width - 0.5, y = uv.y * level.height - 0.5;
    if (!(std::abs(x) < farthest_coordinate) || !(std::abs(y) < farthest_coordinate))
        return static_cast<double>(levels_.back().means[0]);
    const double fx = std::floor(x), fy = std::floor(y);
    const auto i = static_cast<std::int64_t>(fx), j = static_cast<std::int64_t>(fy);
    const double s = x - fx, t = y - fy;
    const auto at = [&](std::int64_t a, std::int64_t b) { return static_cast<double>(texel_mean(level, a, b)); };
    return (1 - t) * ((1 - s) * at(i, j) + s * at(i + 1, j)) + t * ((1 - s) * at(i, j + 1) + s * at(i + 1, j + 1));
}

double TexturePyramid::mean(glm::dvec2 uv, double width) const {
    const double texels = width * std::max(width_, height_);
    const int nearest = texels > 1 ? std::ilogb(texels * std::numbers::sqrt2) : 0;
    return bilinear_mean(levels_[std::min(static_cast<std::size_t>(nearest), levels_.size() - 1)], uv);
}

} // namespace unseen::vdtree
