#include "measure/texture_density.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

namespace unseen::perception {

using namespace vdtree;

TextureDensities::TextureDensities(const SoundTree& tree, const TextureDetail& texture)
    : before_triangle_(tree.triangles().size() + 1), subtree_end_(tree.subtree_end()),
      first_triangle_(tree.first_triangle()) {
    const NodeId leaves = tree.interior_count();
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
