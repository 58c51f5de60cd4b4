#include <unseen/vdtree/internal/fold_sequence.h>

#include <cmath>

namespace unseen::vdtree {

namespace {

template <class T>
Array<T> view_of(const Array<T>& of) {
    return Array<T>(std::span<const T>(of.data(), of.size()));
}

template <class T>
std::vector<T> copy_of(const Array<T>& of) {
    return {of.begin(), of.end()};
}

Sphere scaled(const Sphere& sphere, float scale) { return {sphere.centre * scale, sphere.radius * scale}; }

} // namespace

float unit_scale(float radius) {
    constexpr int ordinary = 10, most = 120; // powers of two; the scale itself must be a float
    if (!(radius > 0) || !std::isfinite(radius)) return 1;
    const int power = std::ilogb(radius);
    return std::abs(power) <= ordinary ? 1 : std::ldexp(1.0f, std::clamp(-power, -most, most));
}

std::shared_ptr<const TreeGeometry> scaled_geometry(const std::shared_ptr<const TreeGeometry>& given, float scale) {
    const TreeGeometry& g = *given;
    std::vector<glm::vec3> positions = copy_of(g.positions);
    for (glm::vec3& p : positions) p *= scale;
    std::vector<Sphere> support = copy_of(g.support_spheres);
    for (Sphere& sphere : support) sphere = scaled(sphere, scale);
    std::vector<NodeBounds> bounds = copy_of(g.bounds);
    for (NodeBounds& of_node : bounds) of_node.ring = scaled(of_node.ring, scale);
    GeometryFacts facts = g;
    facts.bounding_sphere = scaled(g.bounding_sphere, scale);
    GeometryArrays<Array> arrays{{view_of(g.several), view_of(g.extra_wedges), view_of(g.further),
                                  view_of(g.leaf_ranks), view_of(g.wedge_ranks)},
                                 {view_of(g.needing), view_of(g.first_need), view_of(g.needs)},
                                 view_of(g.parents),
                                 std::move(positions),
                                 view_of(g.normals),
                                 view_of(g.colours),
                                 view_of(g.uvs),
                                 view_of(g.first_leaf),
                                 view_of(g.leaf_end),
                                 view_of(g.subtree_end),
                                 view_of(g.first_triangle),
                                 std::move(bounds),
                                 std::move(support),
                                 view_of(g.mask_at),
                                 view_of(g.displacement),
                                 view_of(g.fold_weights),
                                 view_of(g.mask_records),
                                 view_of(g.triangles),
                                 view_of(g.source_triangles),
                                 view_of(g.source_vertices),
                                 {}, // nobody writes the mesh
                                 view_of(g.document),
                                 view_of(g.texture),
                                 view_of(g.texels),
                                 view_of(g.emission),
                                 view_of(g.relief),
                                 view_of(g.blends),
                                 view_of(g.ring_texture)};
    return std::make_shared<TreeGeometry>(TreeGeometry{std::move(arrays), std::move(facts), given});
}

} // namespace unseen::vdtree
