// How far an object's outlines, as the lights see them, may move before its shadows show it.
#pragma once

#include <cstdint>
#include <vector>

#include <perception/shadow_edges.h>
#include <vdtree/distance_criterion.h>
#include <vdtree/lighting.h>
#include <vdtree/vertex_tree.h>

namespace unseen::session {

struct FrameBall {
    glm::dvec3 centre = glm::dvec3(0);
    double radius = 0;
};

// Everything in one frame, that of the object's tree. Of each light that casts shadows: the object's shadow lies in its
// ball swept along the light to the end of the scene, the object's own ball included. No eye is nearer to a shadow's
// edge than to that. Shadows of lights with a place grow with the distance from them, and pale with its square. Half of
// what may move is left to what shadows fall on. Infinite: no light casts any; 0: the eye is where the shadow may be.
double unseen_shift(const vdtree::Lighting& lighting, const perception::ShadowEdges& edges, const FrameBall& object,
                    const FrameBall& scene, glm::dvec3 eye);

// By interior node: by how much folding it may move an outline that a light sees, mesh units, no less than its
// children. `moved`: by how much folds move outlines; `facing`: the directions that nodes have in any cut. `lighting`:
// null: lights that may come from anywhere.
std::vector<float> outline_shifts(const vdtree::VertexTree& tree, std::span<const float> moved,
                                  std::span<const vdtree::NormalSlabs> facing, const vdtree::Lighting* lighting);

// Rounded down to a step, or what it was `before` where that still holds and is no less than a third of it: so that
// little is made anew while the eye moves.
double steady_limit(double limit, double before);

// A bit a node: those whose outlines move farther.
std::vector<std::uint64_t> beyond(std::span<const float> shifts, double limit);

} // namespace unseen::session
