// Small meshes and views of known truth for the renderer's tests.
#pragma once

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/view.h>

#include "testing.h"

namespace unseen::render::testing {

using vdtree::Index;
using vdtree::Mesh;

inline glm::vec4 grey(float luminance) { return glm::vec4(glm::vec3(luminance), 1); }

// Corners counter-clockwise as seen from the front.
inline void add_quad(Mesh& mesh, const std::array<glm::dvec3, 4>& corners, const std::array<glm::vec4, 4>& colours) {
    const Index first = static_cast<Index>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), corners.begin(), corners.end());
    mesh.colours.insert(mesh.colours.end(), colours.begin(), colours.end());
    mesh.triangles.push_back({first, first + 1, first + 2});
    mesh.triangles.push_back({first, first + 2, first + 3});
}

//   3 --- 2      the rectangle from `lo` to `hi` at depth z, facing +z
//   |   / |
//   0 --- 1
inline void add_rectangle(Mesh& mesh, glm::dvec2 lo, glm::dvec2 hi, double z, glm::vec4 colour) {
    add_quad(
        mesh,
        {glm::dvec3(lo.x, lo.y, z), glm::dvec3(hi.x, lo.y, z), glm::dvec3(hi.x, hi.y, z), glm::dvec3(lo.x, hi.y, z)},
        {colour, colour, colour, colour});
}

inline Mesh rectangle(glm::dvec2 lo, glm::dvec2 hi, double z, glm::vec4 colour) {
    Mesh mesh;
    add_rectangle(mesh, lo, hi, z, colour);
    return mesh;
}

inline Mesh triangle(glm::dvec3 a, glm::dvec3 b, glm::dvec3 c, float at_a, float at_b, float at_c) {
    Mesh mesh;
    mesh.positions = {a, b, c};
    mesh.triangles = {{0, 1, 2}};
    mesh.colours = {grey(at_a), grey(at_b), grey(at_c)};
    return mesh;
}

// The closed cube [-1, 1]^3, each face in a luminance of its own, 0.2 to 0.7, of n x n rectangles; `outward`: oriented to
// the outside.
inline Mesh cube(bool outward = true, int n = 1) {
    Mesh mesh;
    for (int axis = 0; axis < 3; ++axis)
        for (double side : {-1.0, 1.0}) {
            const glm::vec4 colour = grey(0.2f + 0.1f * static_cast<float>(2 * axis + (side > 0 ? 1 : 0)));
            for (int cell = 0; cell < n * n; ++cell) {
                const glm::dvec2 low(cell % n, cell / n);
                std::array<glm::dvec2, 4> square = {low, low + glm::dvec2(1, 0), low + 1.0, low + glm::dvec2(0, 1)};
                if ((side < 0) == outward) std::swap(square[1], square[3]);
                std::array<glm::dvec3, 4> corners;
                for (std::size_t i = 0; i < 4; ++i) {
                    corners[i][axis] = side;
                    corners[i][(axis + 1) % 3] = 2 * square[i].x / n - 1;
                    corners[i][(axis + 2) % 3] = 2 * square[i].y / n - 1;
                }
                add_quad(mesh, corners, {colour, colour, colour, colour});
            }
        }
    return mesh;
}

// A bumpy sphere of about 2 n^2 triangles around the origin, radius 0.8 to 1, with luminance that varies smoothly.
inline Mesh bumpy_sphere(Index n) {
    const double pi = std::acos(-1.0);
    Mesh mesh;
    for (Index row = 0; row <= n; ++row)
        for (Index column = 0; column < n; ++column) {
            const double polar = pi * row / n, around = 2 * pi * column / n;
            const double radius = 0.9 + 0.1 * std::sin(5 * polar) * std::cos(4 * around);
            mesh.positions.push_back(radius * glm::dvec3(std::sin(polar) * std::cos(around), std::cos(polar),
                                                         std::sin(polar) * std::sin(around)));
            mesh.colours.push_back(grey(static_cast<float>(0.5 + 0.4 * std::sin(3 * polar) * std::sin(2 * around))));
        }
    for (Index row = 0; row < n; ++row)
        for (Index column = 0; column < n; ++column) {
            const Index a = row * n + column, b = row * n + (column + 1) % n, c = a + n, d = b + n;
            mesh.triangles.push_back({a, b, c});
            mesh.triangles.push_back({b, d, c});
        }
    return mesh;
}

inline Mesh transformed(Mesh mesh, const std::function<glm::dvec3(glm::dvec3)>& f) {
    for (glm::dvec3& p : mesh.positions) p = f(p);
    return mesh;
}

// A tree and its full cut. The cut points at the tree, so a scene stays where it is made.
struct Scene {
    explicit Scene(const Mesh& mesh) : tree(build(mesh)), cut(tree) { cut.unfold_all(); }
    Scene(const Scene&) = delete;

    vdtree::VertexTree tree;
    vdtree::Cut cut;

private:
    static vdtree::VertexTree build(const Mesh& mesh) {
        vdtree::BuildOptions options;
        options.clusterer = vdtree::ClustererKind::octree;
        options.prelit = true; // colours are what is drawn
        return std::move(*require(vdtree::build_tree(mesh.view(), options)));
    }
};

// Looks along -z from (0, 0, 1) at a window whose plane z = 0 spans y from -1 to 1: pixel (column, row) of n x n is the
// square from (-1 + 2 column / n, 1 - 2 row / n) on, to the right and down.
inline vdtree::View frontal_view(int width, int height) {
    vdtree::View view;
    view.fov_y_degrees = 90;
    view.width = width;
    view.height = height;
    return view;
}

} // namespace unseen::render::testing
