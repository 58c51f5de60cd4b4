#include "hard_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include <glm/exponential.hpp>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>

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

// Both with colours, or neither.
void append(Mesh& mesh, const Mesh& more) {
    const auto first = static_cast<Index>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), more.positions.begin(), more.positions.end());
    mesh.colours.insert(mesh.colours.end(), more.colours.begin(), more.colours.end());
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

// A sum of plane waves of random directions and phases, of so many radians a unit of length; of about unit deviation.
class Waves {
public:
    Waves(std::mt19937_64& random, double lowest, double highest) {
        const auto uniform = [&](double low, double high) {
            return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
        };
        for (glm::dvec4& wave : waves_) {
            const glm::dvec3 direction(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
            wave = glm::dvec4(glm::normalize(direction) * uniform(lowest, highest), uniform(0, 2 * std::numbers::pi));
        }
    }
    double operator()(glm::dvec3 p) const {
        double sum = 0;
        for (const glm::dvec4& wave : waves_) sum += std::sin(glm::dot(glm::dvec3(wave), p) + wave.w);
        return sum / std::sqrt(static_cast<double>(waves_.size()) / 2);
    }

private:
    std::array<glm::dvec4, 12> waves_;
};

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

// A square net from -1 to 1, waved along both sides.
Mesh waved_sheet(int side, double height, double waves) {
    return net(side, side, false, [=](double down, double across) {
        const double x = 2 * across - 1, y = 2 * down - 1, k = waves * std::numbers::pi;
        return glm::dvec3(x, y, height * std::sin(k * x) * std::sin(k * y));
    });
}

// The same triangles in a random order, and the vertices in the order in which they are first used.
Mesh shuffled(const Mesh& mesh, unsigned seed) {
    constexpr Index unused = ~Index{0};
    std::mt19937_64 random(seed);
    std::vector<vdtree::Triangle> triangles = mesh.triangles;
    for (std::size_t i = triangles.size(); i-- > 1;) std::swap(triangles[i], triangles[random() % (i + 1)]);
    Mesh out;
    std::vector<Index> number(mesh.positions.size(), unused);
    for (vdtree::Triangle& triangle : triangles) {
        for (Index& corner : triangle) {
            Index& to = number[corner];
            if (to == unused) {
                to = static_cast<Index>(out.positions.size());
                out.positions.push_back(mesh.positions[corner]);
                if (!mesh.colours.empty()) out.colours.push_back(mesh.colours[corner]);
            }
            corner = to;
        }
        out.triangles.push_back(triangle);
    }
    return out;
}

// As STL files have it: three vertices a facet.
Mesh unwelded(const Mesh& mesh) {
    Mesh out;
    for (const vdtree::Triangle& triangle : mesh.triangles) {
        const auto first = static_cast<Index>(out.positions.size());
        for (const Index corner : triangle) out.positions.push_back(mesh.positions[corner]);
        out.triangles.push_back({first, first + 1, first + 2});
    }
    return out;
}

// A net without the triangles whose middles `is_hole` says lie in one.
template <class IsHole>
Mesh without(Mesh mesh, const IsHole& is_hole) {
    std::erase_if(mesh.triangles, [&](const vdtree::Triangle& t) {
        return is_hole((mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3.0);
    });
    return mesh;
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

std::vector<HardMesh> tuning_meshes(int triangles) {
    const int rows = std::max(16, static_cast<int>(std::sqrt(triangles / 4.0)));
    std::mt19937_64 random(2);
    const auto noise = [&] { return 2 * static_cast<double>(random() >> 11) * 0x1p-53 - 1; };
    const Waves lumps(random, 1.5, 4), bumps(random, 8, 20), spots(random, 3, 9);
    const auto moved = [](Mesh mesh, const auto& place) {
        for (glm::dvec3& p : mesh.positions) p = place(p);
        return mesh;
    };
    const Mesh sphere = ball(rows, 2 * rows, 0), half = ball(rows * 2 / 3, rows * 4 / 3, 0);
    const Mesh blob = moved(sphere, [&](glm::dvec3 p) { return p * (1 + 0.2 * lumps(p)); });
    const auto lens = [&](double slope, double grey) {
        return painted(moved(half, [=](glm::dvec3 p) { return glm::dvec3(p.x, p.y, 0.04 * p.z + slope * p.x); }),
                       [=](glm::dvec3) { return grey; });
    };
    const auto box = [&](glm::dvec3 middle, double size) {
        return moved(half, [=](glm::dvec3 p) {
            const glm::dvec3 q = glm::pow(glm::abs(p), glm::dvec3(8));
            return middle + size * p / std::pow(q.x + q.y + q.z, 1.0 / 8);
        });
    };
    const auto spotted = [&](glm::dvec3 p) { return 0.5 + 0.3 * std::tanh(4 * spots(p)); };
    Mesh lenses = lens(0, 0.7), boxes = box({0, 0, 0}, 0.7);
    append(lenses, lens(0.1, 0.4));
    append(boxes, box({0.8, 0.3, 0.2}, 0.4));
    const auto column = [](double down, double around) {
        const double r = 0.4 + 0.03 * std::cos(24 * std::numbers::pi * around);
        const double turn = 2 * std::numbers::pi * (around + 0.1 * down);
        return glm::dvec3(r * std::cos(turn), 2 * down - 1, r * std::sin(turn));
    };
    std::vector<HardMesh> meshes;
    meshes.push_back(
        {"rough blob", moved(blob, [&](glm::dvec3 p) { return p * (1 + 0.01 * bumps(p) + 0.001 * noise()); })});
    meshes.push_back({"painted blob", painted(blob, spotted)});
    meshes.push_back({"terrain", net(rows, 2 * rows, false, [&](double down, double across) {
                          const glm::dvec3 p(4 * across - 2, 2 * down - 1, 0);
                          return p + glm::dvec3(0, 0, 0.15 * lumps(p) + 0.01 * bumps(p));
                      })});
    meshes.push_back({"lenses", std::move(lenses)});
    meshes.push_back({"column", net(8, triangles / 16, true, column)}); // of long triangles
    meshes.push_back({"boxes", std::move(boxes)});
    // Regular patterns, whose errors are alike everywhere.
    meshes.push_back({"waves", waved_sheet(2 * rows, 0.0015, 14)});
    meshes.push_back({"dimples", moved(sphere, [](glm::dvec3 p) {
                          const double turn = std::atan2(p.z, p.x), tilt = std::asin(std::clamp(p.y, -1.0, 1.0));
                          return p * (1 + 0.0015 * std::cos(tilt) * std::sin(36 * turn) * std::sin(36 * tilt));
                      })});
    return meshes;
}

std::vector<HardMesh> open_sheets(int triangles) {
    const int side = std::max(24, static_cast<int>(std::sqrt(triangles / 2.0))), half = side / 2;
    // Two rectangles that meet along the y axis.
    const auto plate = [&](double sign) {
        return net(side, half, false, [=](double down, double across) {
            const double x = (sign > 0 ? across : across - 1);
            return glm::dvec3(x, 2 * down - 1, 0.4 * std::abs(x));
        });
    };
    const Mesh crease = net(side, 2 * half, false, [](double down, double across) {
        const double x = 2 * across - 1;
        return glm::dvec3(x, 2 * down - 1, 0.4 * std::abs(x));
    });
    Mesh halves = plate(-1);
    append(halves, plate(1));
    // Around the middle, out to a border of many lengths.
    const Mesh jagged = net(half, 4 * half, true, [](double down, double around) {
        const double turn = 2 * std::numbers::pi * around;
        const double out = 1 + 0.15 * std::sin(7 * turn) + 0.05 * std::sin(23 * turn + 1) + 0.02 * std::sin(61 * turn);
        const double r = (0.05 + 0.95 * down) * out;
        return glm::dvec3(r * std::cos(turn), r * std::sin(turn), 0.02 * std::sin(3 * turn) * down);
    });
    const auto is_hole = [](glm::dvec3 p) {
        const double x = p.x * 4 - std::floor(p.x * 4) - 0.5, y = p.y * 4 - std::floor(p.y * 4) - 0.5;
        return x * x + y * y < 0.05;
    };
    const Mesh spiral = net(4 * half, half / 2, false, [](double down, double across) {
        const double turn = 6 * std::numbers::pi * down, r = 0.3 + 0.7 * down;
        return glm::dvec3(r * std::cos(turn), 0.6 * across - 0.3, r * std::sin(turn));
    });
    std::vector<HardMesh> sheets;
    for (const double waves : {3.0, 10.0, 20.0}) {
        const auto name = std::to_string(static_cast<int>(waves)) + " waves";
        sheets.push_back({"low " + name, waved_sheet(side, 0.001, waves)});
        sheets.push_back({"high " + name, waved_sheet(side, 0.02, waves)});
    }
    sheets.push_back({"shuffled waves", shuffled(waved_sheet(side, 0.001, 20), 5)});
    sheets.push_back({"plate", waved_sheet(side, 0, 1)});
    sheets.push_back({"crease", crease});
    sheets.push_back({"crease in halves", std::move(halves)});
    sheets.push_back({"crease of facets", unwelded(crease)});
    sheets.push_back({"jagged", jagged});
    sheets.push_back({"holes", without(waved_sheet(side, 0.01, 2), is_hole)});
    sheets.push_back({"spiral", spiral});
    return sheets;
}

HardMesh waved_square(int triangles, double height, double waves) {
    return {"waved square", waved_sheet(std::max(24, static_cast<int>(std::sqrt(triangles / 2.0))), height, waves)};
}

Result<vdtree::VertexTree> build_hard_tree(const HardMesh& hard) {
    const vdtree::BuildOptions options{.prelit = true}; // colours are what is drawn
    if (!hard.proxies_at_darkest) return vdtree::build_tree(hard.mesh.view(), options);
    const auto cluster = [](const vdtree::ClusterInput& input) { return cluster_to_darkest(input); };
    return vdtree::build_tree(hard.mesh.view(), cluster, options);
}

} // namespace unseen::app
