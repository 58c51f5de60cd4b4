#include "hard_mesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <glm/geometric.hpp>

namespace unseen::app {
namespace {

using vdtree::Index;
using vdtree::Mesh;

// A net of (rows + 1) x (columns + 1) places; `place` maps 0..1 x 0..1 to space, and the last column is welded to the
// first where the net is round.
template <class Place>
Mesh net(int rows, int columns, bool is_round, const Place& place) {
    Mesh mesh;
    const int across = is_round ? columns : columns + 1;
    for (int i = 0; i <= rows; ++i)
        for (int j = 0; j < across; ++j) mesh.positions.push_back(place(double(i) / rows, double(j) / columns));
    const auto at = [&](int i, int j) { return static_cast<Index>(i * across + j % across); };
    for (int i = 0; i < rows; ++i) {
        for (int j = 0; j < columns; ++j) {
            mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
            mesh.triangles.push_back({at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)});
        }
    }
    return mesh;
}

glm::dvec3 on_ball(double down, double around, double radius = 1) {
    const double theta = std::numbers::pi * down, phi = 2 * std::numbers::pi * around;
    return radius * glm::dvec3(std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi));
}

// Welded at the poles, so that it is closed.
Mesh ball(int rows, int columns, double bumps) {
    Mesh mesh = net(rows, columns, true, [&](double down, double around) {
        const double r = 1 + bumps * std::sin(20 * std::numbers::pi * down) * std::cos(28 * std::numbers::pi * around);
        return on_ball(down, around, r);
    });
    const auto last = static_cast<Index>(rows * columns);
    for (vdtree::Triangle& triangle : mesh.triangles)
        for (Index& corner : triangle) {
            if (corner < static_cast<Index>(columns)) corner = 0;
            if (corner >= last) corner = last;
        }
    vdtree::drop_degenerate_triangles(mesh);
    return mesh;
}

template <class Grey>
Mesh painted(Mesh mesh, Grey&& grey) {
    for (const glm::dvec3& p : mesh.positions) {
        const auto g = static_cast<float>(grey(p));
        mesh.colours.push_back({g, g, g, 1});
    }
    return mesh;
}

void append(Mesh& mesh, const Mesh& more) {
    const auto first = static_cast<Index>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), more.positions.begin(), more.positions.end());
    for (const auto& t : more.triangles) mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

// Closed sheets, a five-hundredth as thick as they are wide and slightly bent, one behind the other at twice their
// thickness.
Mesh plates(int count, int side) {
    constexpr double thickness = 0.004;
    Mesh mesh;
    for (int plate = 0; plate < count; ++plate) {
        const double z0 = 2 * thickness * plate;
        // A flattened tube: once around is front and back.
        append(mesh, net(side, 2 * side, true, [&](double down, double around) {
                   const double x = around < 0.5 ? 4 * around - 1 : 3 - 4 * around, y = 2 * down - 1;
                   const double edge = std::min({1.0, 20 * (1 - std::abs(x)), 20 * (1 - std::abs(y))});
                   const double half = 0.5 * thickness * std::sqrt(std::max(edge, 0.0));
                   return glm::dvec3(x, y,
                                     z0 + 0.05 * std::sin(3 * x) * std::cos(2 * y) + (around < 0.5 ? half : -half));
               }));
    }
    return mesh;
}

// The clustering by cells, with each proxy at the darkest vertex below it.
Result<vdtree::Clustering> cluster_to_darkest(const vdtree::ClusterInput& input) {
    auto clustering = vdtree::cluster_octree(input);
    if (!clustering) return clustering;
    const std::size_t vertices = input.luminance.size(), clusters = clustering->parents.size();
    std::vector<Index> darkest(clusters);
    for (std::size_t c = 0; c < clusters; ++c) darkest[c] = c < vertices ? static_cast<Index>(c) : Index(-1);
    for (std::size_t c = 0; c + 1 < clusters; ++c) { // children have lower numbers
        Index& of_parent = darkest[clustering->parents[c]];
        if (of_parent == Index(-1) || input.luminance[darkest[c]] < input.luminance[of_parent]) of_parent = darkest[c];
    }
    clustering->positions.clear();
    for (std::size_t c = vertices; c < clusters; ++c) clustering->positions.push_back(input.mesh.positions[darkest[c]]);
    return clustering;
}

} // namespace

std::vector<HardMesh> hard_meshes(int triangles) {
    const int rows = std::max(16, static_cast<int>(std::sqrt(triangles / 4.0))); // of 2 rows * rows * 2
    std::mt19937_64 random(1);
    const auto noise = [&](glm::dvec3) { return 0.5 + 0.04 * (static_cast<double>(random() >> 11) * 0x1p-53 - 0.5); };
    const auto checks = [](glm::dvec3 p) {
        return std::sin(20 * p.x) * std::sin(20 * p.y) * std::sin(20 * p.z + 1) > 0 ? 0.8 : 0.2;
    };
    Mesh inside_out = ball(rows, 2 * rows, 0.02);
    for (auto& t : inside_out.triangles) std::swap(t[1], t[2]);
    const int around = rows * rows / 10; // fifty times as long as wide, about
    std::vector<HardMesh> hard;
    hard.push_back({"noise", painted(ball(rows, 2 * rows, 0), noise), true});
    hard.push_back({"checkerboard", painted(ball(rows, 2 * rows, 0), checks)});
    hard.push_back({"thin plates", plates(3, static_cast<int>(std::sqrt(triangles / 12.0)))});
    hard.push_back({"long rings", ball(20, std::max(around, 64), 0.01)});
    hard.push_back({"inside out", std::move(inside_out)});
    hard.push_back({"open", net(rows, 2 * rows, false, [](double down, double across) {
                        const double x = 4 * across - 2, y = 2 * down - 1;
                        return glm::dvec3(x, y, 0.1 * std::sin(6 * x) * std::cos(7 * y));
                    })});
    return hard;
}

Result<vdtree::VertexTree> build_hard_tree(const HardMesh& hard) {
    if (!hard.proxies_at_darkest) return vdtree::build_tree(hard.mesh.view());
    const auto cluster = [](const vdtree::ClusterInput& input) { return cluster_to_darkest(input); };
    return vdtree::build_tree(hard.mesh.view(), cluster);
}

} // namespace unseen::app
