#include "measure/fold_picture.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/geometric.hpp>

#include "measure/pyramid.h"
#include "pyramid_kernel.h"

namespace unseen::perception {
namespace {

constexpr float nothing = -std::numeric_limits<float>::infinity(); // seen in a cell

// Of the pyramid, of which no cell is left out; by distance in steps.
constexpr std::array<float, 3> kernel = {static_cast<float>(kernel_middle), static_cast<float>(kernel_near),
                                         static_cast<float>(kernel_far)};
constexpr std::size_t longest_step = std::size_t{1} << (FoldPicture::bands - 1),
                      margin = (kernel.size() - 1) * longest_step;

// Outside of the picture all is 0.
#if defined(__x86_64__) && defined(__GNUC__)
[[gnu::target_clones("avx2", "default")]]
#endif
void smooth(const float* in, std::size_t step, float* out) {
    constexpr std::size_t side = FoldPicture::side, padded = side + 2 * margin;
    float rows[padded * side] = {}; // with a margin above and below
    for (std::size_t y = 0; y < side; ++y) {
        float line[padded] = {};
        std::copy_n(in + y * side, side, line + margin);
        const float* const at = line + margin;
        float* const row = rows + (y + margin) * side;
        for (std::size_t x = 0; x < side; ++x)
            row[x] = kernel[0] * at[x] + kernel[1] * (*(at + x - step) + at[x + step]) +
                     kernel[2] * (*(at + x - 2 * step) + at[x + 2 * step]);
    }
    for (std::size_t y = 0; y < side; ++y) {
        const float* const at = rows + (y + margin) * side;
        const float *const above = at - step * side, *const below = at + step * side,
                           *const far_above = above - step * side, *const far_below = below + step * side;
        for (std::size_t x = 0; x < side; ++x)
            out[y * side + x] =
                kernel[0] * at[x] + kernel[1] * (above[x] + below[x]) + kernel[2] * (far_above[x] + far_below[x]);
    }
}

} // namespace

void FoldPicture::look(glm::vec3 centre, glm::vec3 normal, float half_width) {
    centre_ = centre;
    normal_ = normal;
    const glm::vec3 axis = std::abs(normal.x) < 0.6f ? glm::vec3(1, 0, 0) : glm::vec3(0, 1, 0);
    right_ = glm::normalize(glm::cross(axis, normal));
    up_ = glm::cross(normal, right_);
    cell_ = 2 * half_width / static_cast<float>(side);
    has_front_ = has_back_ = false;
    for (const Layer layer : {Layer::mesh, Layer::folded}) clear(layer);
}

void FoldPicture::clear(Layer layer) { pictures_[static_cast<std::size_t>(layer)].height.fill(nothing); }

void FoldPicture::draw(Layer layer, const LitPoint& a, const LitPoint& b, const LitPoint& c) {
    constexpr float half = static_cast<float>(side) / 2;
    struct Corner {
        float x, y, height, luminance; // cells, mesh units, relative
    };
    const auto seen = [&](const LitPoint& p) {
        const glm::vec3 d = p.position - centre_;
        return Corner{glm::dot(d, right_) / cell_ + half, glm::dot(d, up_) / cell_ + half, glm::dot(d, normal_),
                      p.luminance};
    };
    const Corner p = seen(a), q = seen(b), r = seen(c);
    const float area = (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
    if (!(std::abs(area) > 0)) return;
    (area > 0 ? has_front_ : has_back_) = true;
    // The cells whose middles lie between.
    const auto first = [](float low) {
        return static_cast<std::size_t>(std::ceil(std::clamp(low - 0.5f, 0.0f, static_cast<float>(side))));
    };
    const std::size_t x0 = first(std::min({p.x, q.x, r.x})), x1 = first(std::max({p.x, q.x, r.x}));
    const std::size_t y0 = first(std::min({p.y, q.y, r.y})), y1 = first(std::max({p.y, q.y, r.y}));
    // The shares of q and r grow linearly over the picture.
    const float inverse = 1 / area;
    const float vx = (r.y - p.y) * inverse, vy = -(r.x - p.x) * inverse, wx = -(q.y - p.y) * inverse,
                wy = (q.x - p.x) * inverse;
    Picture& picture = pictures_[static_cast<std::size_t>(layer)];
    for (std::size_t y = y0; y < y1; ++y) {
        const float dy = static_cast<float>(y) + 0.5f - p.y;
        for (std::size_t x = x0; x < x1; ++x) {
            const float dx = static_cast<float>(x) + 0.5f - p.x;
            const float v = dx * vx + dy * vy, w = dx * wx + dy * wy;
            if (!(v >= 0 && w >= 0 && v + w <= 1)) continue;
            const std::size_t cell = y * side + x;
            const float height = p.height + v * (q.height - p.height) + w * (r.height - p.height);
            if (!(height > picture.height[cell])) continue;
            picture.height[cell] = height;
            picture.luminance[cell] = p.luminance + v * (q.luminance - p.luminance) + w * (r.luminance - p.luminance);
        }
    }
}

bool FoldPicture::is_seen(std::size_t cell) const {
    return pictures_[0].height[cell] > nothing && pictures_[1].height[cell] > nothing;
}

float FoldPicture::wavelength(std::size_t band) const { return cell_ / static_cast<float>(nominal_frequency(band)); }

std::array<float, FoldPicture::bands> FoldPicture::amplitudes() const {
    static const std::array<float, bands> gains = [] {
        std::array<float, bands> all;
        for (std::size_t band = 0; band < bands; ++band) all[band] = static_cast<float>(band_gain(band));
        return all;
    }();
    Cells low, lower, back;
    for (std::size_t i = 0; i < low.size(); ++i)
        low[i] = is_seen(i) ? pictures_[1].luminance[i] - pictures_[0].luminance[i] : 0;
    std::array<float, bands> largest{};
    for (std::size_t band = 0; band < bands; ++band) {
        const std::size_t step = std::size_t{1} << band;
        smooth(low.data(), step, lower.data());
        smooth(lower.data(), step, back.data());
        float most = 0;
        for (std::size_t i = 0; i < low.size(); ++i) most = std::max(most, std::abs(low[i] - back[i]));
        largest[band] = most / gains[band];
        low = lower;
    }
    return largest;
}

float FoldPicture::shift() const {
    Cells shift, seen, mean_shift, mean_seen;
    for (std::size_t i = 0; i < shift.size(); ++i) {
        seen[i] = is_seen(i) ? 1 : 0;
        shift[i] = is_seen(i) ? pictures_[1].height[i] - pictures_[0].height[i] : 0;
    }
    smooth(shift.data(), 1, mean_shift.data());
    smooth(seen.data(), 1, mean_seen.data());
    float most = 0;
    for (std::size_t i = 0; i < shift.size(); ++i)
        if (mean_seen[i] > 0.5f) most = std::max(most, std::abs(mean_shift[i] / mean_seen[i]));
    return most;
}

} // namespace unseen::perception
