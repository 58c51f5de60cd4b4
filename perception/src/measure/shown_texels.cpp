#include "measure/shown_texels.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/texture_pyramid.h>
#include <unseen/vdtree/internal/tree_parts.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::perception {

using namespace vdtree;

namespace {

// Looks at all triangles together, over texels. Where triangles show texels more often, they are looked at as much less
// densely, but each this often.
constexpr double looks_a_texel = 16, least_looks = 16;
// A vertex that no light reaches shows no relief, and its luminance divides nothing.
constexpr float least_light = 0.01f;

struct Corner {
    glm::vec3 place, normal;
    glm::vec2 texel; // texture coordinates, in texels
    float shade;
};

// Directions on a triangle along which u and v grow, the longer of which is a unit.
struct Frame {
    glm::vec3 of_u = glm::vec3(0), of_v = glm::vec3(0);

    explicit Frame(const std::array<Corner, 3>& c) {
        const glm::vec3 b = c[1].place - c[0].place, a = c[2].place - c[0].place, across = glm::cross(b, a);
        const glm::vec2 q = c[1].texel - c[0].texel, p = c[2].texel - c[0].texel;
        const glm::vec3 over_b = glm::cross(a, across), over_a = glm::cross(across, b);
        const glm::vec3 u = over_b * q.x + over_a * p.x, v = over_b * q.y + over_a * p.y;
        const float size = std::sqrt(std::max(glm::dot(u, u), glm::dot(v, v)));
        if (size > 0 && std::isfinite(size)) of_u = u / size, of_v = v / size;
    }
    glm::vec3 tilted(glm::vec3 normal, glm::vec3 map) const {
        const glm::vec3 sum = of_u * map.x + of_v * map.y + normal * map.z;
        const float length = glm::length(sum);
        return length > 0 ? sum / length : normal;
    }
};

// What triangles show of a texel, added up, and likewise of 2 x 2 of a level before.
struct Sum {
    float brightening = 0, shade = 0, count = 0;
    Sum& operator+=(const Sum& other) {
        brightening += other.brightening, shade += other.shade, count += other.count;
        return *this;
    }
};
struct Sums {
    std::uint32_t width, height;
    std::vector<Sum> of;
    Sum& at(std::uint32_t x, std::uint32_t y) { return of[std::size_t{y} * width + x]; }
    const Sum& at(std::uint32_t x, std::uint32_t y) const { return of[std::size_t{y} * width + x]; }
};

Sums halved(const Sums& fine) {
    Sums coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}};
    coarse.of.resize(std::size_t{coarse.width} * coarse.height);
    for (std::uint32_t y = 0; y < fine.height; ++y)
        for (std::uint32_t x = 0; x < fine.width; ++x) coarse.at(x / 2, y / 2) += fine.at(x, y);
    return coarse;
}

// The box around a triangle, in texels.
struct Box {
    glm::dvec2 low, size;

    explicit Box(const std::array<Corner, 3>& c) {
        const glm::dvec2 p(c[0].texel), q(c[1].texel), r(c[2].texel);
        low = glm::floor(glm::min(glm::min(p, q), r));
        size = glm::floor(glm::max(glm::max(p, q), r)) - low + 1.0;
    }
    bool is_sound() const {                  // NaN is not
        constexpr double farthest = 1 << 23; // texels; beyond, floats cannot tell them apart
        return std::abs(low.x) < farthest && std::abs(low.y) < farthest && size.x < farthest && size.y < farthest;
    }
    double texels() const { return size.x * size.y; }
};

// Calls look(texel's column, row, weights of the corners) for the middles of texels in a triangle, about `most` of its box's,
// and for its own.
template <class Look>
void for_each_texel(const std::array<Corner, 3>& c, const Box& box, double most, Look&& look) {
    const glm::dvec2 a(c[0].texel), b = glm::dvec2(c[1].texel) - a, d = glm::dvec2(c[2].texel) - a;
    const auto texel = [](double at) { return static_cast<std::int64_t>(std::floor(at)); };
    const glm::dvec2 middle = a + (b + d) / 3.0;
    look(texel(middle.x), texel(middle.y), glm::vec3(1.0f / 3));
    const double area = b.x * d.y - b.y * d.x;
    if (area == 0) return;
    const glm::dvec2 low = box.low, size = box.size, high = low + size - 1.0;
    const double rows = std::clamp(std::sqrt(most * size.y / size.x), 1.0, size.y),
                 columns = std::clamp(most / rows, 1.0, size.x);
    const auto step_x = static_cast<std::int64_t>(std::ceil(size.x / columns)),
               step_y = static_cast<std::int64_t>(std::ceil(size.y / rows));
    for (std::int64_t y = texel(low.y); y <= texel(high.y); y += step_y)
        for (std::int64_t x = texel(low.x); x <= texel(high.x); x += step_x) {
            const glm::dvec2 at = glm::dvec2(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5) - a;
            const double v = (at.x * d.y - at.y * d.x) / area, w = (b.x * at.y - b.y * at.x) / area, u = 1 - v - w;
            if (u >= 0 && v >= 0 && w >= 0) look(x, y, glm::vec3(u, v, w));
        }
}

} // namespace

ShownTexels::ShownTexels(const VertexTree& tree) : texture_(tree.texture()) {
    const bool has_relief = !texture_.relief.empty() && !tree.is_prelit();
    if (has_relief || !texture_.emission.empty()) look_at_triangles(tree, has_relief);
}

void ShownTexels::look_at_triangles(const VertexTree& tree, bool has_relief) {
    std::vector<Sums> levels = {{texture_.width, texture_.height, {}}};
    levels[0].of.resize(texture_.texels.size());
    const glm::vec2 size(static_cast<float>(texture_.width), static_cast<float>(texture_.height));
    const TreeGeometry& g = *tree.data().geometry;
    const WedgeId first = links_of(g).wedge_of_leaf(0);
    const auto corners_of = [&](const Triangle& t) {
        std::array<Corner, 3> corners;
        for (std::size_t k = 0; k < 3; ++k) {
            const WedgeId wedge = first + t[k];
            corners[k] = {tree.positions()[wedge], tree.normals()[wedge], tree.uvs()[wedge] * size,
                          tree.luminance()[wedge]};
        }
        return corners;
    };
    const auto light_on = [&](glm::vec3 normal) {
        return vertex_luminance(normal, nullptr, tree.light(), false, true);
    };
    const auto all = static_cast<double>(texture_.texels.size());
    double shown = 0; // texels, by all triangles
    for (const Triangle& t : g.triangles)
        if (const Box box(corners_of(t)); box.is_sound()) shown += std::min(box.texels(), all);
    const double share = std::min(1.0, looks_a_texel * all / std::max(shown, 1.0));
    for (const Triangle& t : g.triangles) {
        const std::array<Corner, 3> corners = corners_of(t);
        const Box box(corners);
        if (!box.is_sound()) continue;
        const double looks = std::max(share * std::min(box.texels(), all), least_looks);
        const Frame frame(corners);
        for_each_texel(corners, box, looks, [&](std::int64_t x, std::int64_t y, glm::vec3 weights) {
            const auto column = static_cast<std::uint32_t>(wrapped_texel(x, texture_.width, texture_.wrap_u)),
                       row = static_cast<std::uint32_t>(wrapped_texel(y, texture_.height, texture_.wrap_v));
            Sum here{1, 0, 1};
            glm::vec3 normal(0);
            for (int k = 0; k < 3; ++k) {
                const Corner& corner = corners[static_cast<std::size_t>(k)];
                normal += weights[k] * corner.normal, here.shade += weights[k] * corner.shade;
            }
            const float length = glm::length(normal);
            if (has_relief && length > 0) {
                normal /= length;
                const glm::vec3 map = relief_normal(texture_.relief[std::size_t{row} * texture_.width + column]);
                here.brightening = light_on(frame.tilted(normal, map)) / std::max(light_on(normal), least_light);
            }
            levels[0].at(column, row) += here;
        });
    }
    while (levels.back().width > 1 || levels.back().height > 1) levels.push_back(halved(levels.back()));
    places_.resize(texture_.texels.size());
    parallel_loop(std::uint32_t{0}, texture_.height, [&](std::uint32_t y) {
        for (std::uint32_t x = 0; x < texture_.width; ++x) {
            // Filters reach beyond what triangles show: there, as around it.
            std::size_t level = 0;
            while (level + 1 < levels.size() && !(levels[level].at(x >> level, y >> level).count > 0)) ++level;
            const Sum& sum = levels[level].at(x >> level, y >> level);
            if (sum.count > 0)
                places_[std::size_t{y} * texture_.width + x] = {sum.brightening / sum.count, sum.shade / sum.count};
        }
    });
}

bool ShownTexels::are_alike() const {
    const auto is_of_one = [](std::span<const Texel> map) {
        return std::ranges::all_of(map, [&](const Texel& texel) { return texel == map.front(); });
    };
    return is_of_one(texture_.texels) && is_of_one(texture_.emission) && is_of_one(texture_.relief);
}

glm::vec3 ShownTexels::colour(std::size_t texel) const {
    glm::vec3 colour(linear_colour(texture_.texels[texel]));
    if (places_.empty()) return colour;
    colour *= places_[texel].brightening;
    if (!texture_.emission.empty())
        colour += glm::vec3(linear_colour(texture_.emission[texel])) / std::max(places_[texel].shade, least_light);
    return colour;
}

double ShownTexels::luminance(std::size_t texel) const {
    if (places_.empty()) return linear_luminance(texture_.texels[texel]);
    return rec709_luminance(glm::dvec3(colour(texel)));
}

} // namespace unseen::perception
