// Meshes that scenes are made of. Metres; what stands does so on y = 0.
#pragma once

#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <unseen/vdtree/mesh.h>

namespace unseen::app {

// Numbers that are the same everywhere (SplitMix64).
class Chance {
public:
    explicit Chance(std::uint64_t seed) : state_(seed) {}
    double next(double low, double high);

private:
    std::uint64_t state_;
};

// Around the origin's vertical, on y = 0; each side a grid of cells, for light differs over it.
vdtree::Mesh box(glm::dvec3 size, double cell);
// A horizontal square around the origin, with hills so high, facing up.
vdtree::Mesh ground(double side, int cells, double height, std::uint64_t seed);

// A profile (radius, height), from the bottom up, turned about the vertical. Closed where it begins and ends on the
// axis. With `flutes` grooves of such a depth, as a share of the radius.
vdtree::Mesh lathe(const std::vector<glm::dvec2>& profile, int segments, int flutes = 0, double depth = 0);
vdtree::Mesh bar(double height, double radius, int segments);

// A closed sphere with bumps around the origin, radius about 1: 4 * rows * rows triangles (at the poles without area).
vdtree::Mesh bumpy_sphere(int rows);

// Meshes of about this many triangles, closed, a metre high.
vdtree::Mesh urn(std::uint64_t triangles);
vdtree::Mesh sphere(std::uint64_t triangles);
vdtree::Mesh knot(std::uint64_t triangles); // a knotted tube with ribs
vdtree::Mesh column(std::uint64_t triangles);
vdtree::Mesh ring(std::uint64_t triangles);
// A trunk with branches, and leaves of four triangles; about five metres high, not closed.
vdtree::Mesh tree(std::uint64_t triangles, std::uint64_t seed);

// Moved and scaled so that it stands on y = 0, its middle at x = z = 0, and is a metre high. Normals are left out.
vdtree::Mesh set_upright(vdtree::Mesh mesh);

} // namespace unseen::app
