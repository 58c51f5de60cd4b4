// Does with a tree whatever the library can do with one. For trees from files that nobody vouches for: nothing may
// crash, hang or read out of bounds, though the picture may be nonsense.
#pragma once

#include <vector>

#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/geomorph.h>
#include <unseen/vdtree/internal/conserve_light.h>
#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/internal/normal_mask.h>
#include <unseen/vdtree/lighting.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::support {

// Returns whether every mesh that came out was valid, and all that looks at the whole tree agreed on whether it is
// damaged.
inline bool use_everything(const vdtree::VertexTree& tree) {
    using namespace vdtree;
    // First, for nobody has looked at a mapped tree yet.
    const bool is_sound = LightBounds::measure(tree).has_value();
    bool valid = is_sound == tree.check().has_value();
    valid &= is_sound || !verify(tree);
    valid &= is_sound == tree.untextured().has_value();
    valid &= is_sound || !conserve_light(tree);
    for (const Attribute& attribute : tree.attributes()) (void)tree.attribute<std::uint8_t>(attribute.name).size();
    for (const double distance : {0.5, 1.5})
        (void)check_lights(tree,
                           {.lights = {{.kind = LightSource::Kind::point, .position = glm::dvec3(distance, 0.1, 0.2)}}})
            .has_value();
    Cut cut(tree);
    const auto extract = [&] { valid &= validate(extract_mesh(cut).view()).has_value(); };
    cut.unfold_all();
    extract();
    cut.fold_all();
    for (NodeId node = 0; node < tree.node_count(); node += 1 + tree.node_count() / 16) {
        cut.unfold_ancestors(node);
        (void)cut.is_active(node);
        if (!tree.is_place(node)) (void)tree.mask(node);
    }
    extract();
    const View view{.eye = {1, 2, 3}};
    const auto extent = extent_criterion(tree, view, 20), displacement = displacement_criterion(tree, view, 2);
    if (extent)
        (void)cut.follow(*extent, {.eye = eye_in_tree(tree, view, {}), .frusta = {frustum_of(tree, view)}}).has_value();
    extract();
    if (displacement)
        (void)cut
            .follow(*displacement, {.eye = eye_in_tree(tree, view, {})}, {.triangle_budget = tree.triangle_count() / 2})
            .has_value();
    extract();
    const auto bright_ones = [](const VertexTree& of, std::span<const NodeId> nodes, std::span<float> costs) {
        for (std::size_t i = 0; i < nodes.size(); ++i) costs[i] = 4 * of.luminance()[of.first_wedge(nodes[i])];
    };
    cut.adjust(bright_ones);
    extract();
    cut.adjust(bright_ones, tree.triangle_count() / 2);
    extract();
    if (is_sound) (void)conserve_light(tree).has_value(); // not those with a texture
    (void)LightBounds::measure(tree).has_value();
    const auto everything = DistanceCriterion::create(tree, {.switch_distance = {DistanceCriterion::always_visible}});
    valid &= everything.has_value();
    const std::vector<Sphere> occluders = inner_spheres(tree, 2, 8); // quickly made
    for (const glm::dvec3 eye : {glm::dvec3(3, 1, 2), glm::dvec3(1e9, 0, 0)}) {
        (void)cut.follow(*everything, {.eye = eye, .occluders = occluders}).has_value(); // not from within one
        extract();
    }
    for (const auto& criterion : {extent_criterion(tree, view, 20), displacement_criterion(tree, view, 2)})
        if (criterion) (void)cut.follow(*criterion, {.eye = view.eye}).has_value();
    extract();
    if (auto geomorph = Geomorph::create(tree, 1)) {
        (void)geomorph->step(cut, 0).has_value();
        cut.fold_all();
        (void)geomorph->step(cut, 0.5).has_value();
    }
    return valid && is_sound == tree.relit({.direction = {0, 0, 1}}).has_value();
}

} // namespace unseen::support
