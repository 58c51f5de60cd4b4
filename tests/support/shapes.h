// Meshes made by code: small, known by heart, and as awkward as meshes get.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <unseen/vdtree/mesh.h>

namespace unseen::shapes {

using vdtree::Index;
using vdtree::Mesh;
using vdtree::MeshRange;
using vdtree::Triangle;

// A number from 0 to 1. std::uniform_real_distribution may differ between standard libraries; this does not.
inline double random_unit(std::mt19937_64& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }
inline double random_between(std::mt19937_64& random, double low, double high) {
    return low + (high - low) * random_unit(random);
}
inline glm::dvec3 random_direction(std::mt19937_64& random) {
    const double z = random_between(random, -1, 1), angle = random_between(random, 0, 2 * std::numbers::pi);
    const double r = std::sqrt(std::max(0.0, 1 - z * z));
    return {r * std::cos(angle), r * std::sin(angle), z};
}

// ---- closed surfaces

inline Mesh tetrahedron() {
    Mesh m;
    m.positions = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
    m.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
    return m;
}

// The cube -1..1 with n x n squares a side, welded.
inline Mesh cube(int n = 1) {
    Mesh m;
    std::map<std::array<int, 3>, Index> numbers;
    const auto vertex = [&](const std::array<int, 3>& p) {
        const auto [entry, is_new] = numbers.try_emplace(p, static_cast<Index>(m.positions.size()));
        if (is_new) m.positions.push_back(glm::dvec3(p[0], p[1], p[2]) * (2.0 / n) - 1.0);
        return entry->second;
    };
    for (std::size_t axis = 0; axis < 3; ++axis) {
        for (const bool far : {false, true}) {
            for (int i = 0; i < n; ++i) {
                for (int j = 0; j < n; ++j) {
                    const auto corner = [&](int di, int dj) {
                        std::array<int, 3> p;
                        p[axis] = far ? n : 0;
                        p[(axis + 1) % 3] = i + di;
                        p[(axis + 2) % 3] = j + dj;
                        return vertex(p);
                    };
                    Triangle a = {corner(0, 0), corner(1, 0), corner(1, 1)},
                             b = {corner(0, 0), corner(1, 1), corner(0, 1)};
                    if (!far) std::swap(a[1], a[2]), std::swap(b[1], b[2]);
                    m.triangles.push_back(a);
                    m.triangles.push_back(b);
                }
            }
        }
    }
    return m;
}

// Each level splits every triangle in four: 20 * 4^level triangles on the unit sphere.
inline Mesh icosphere(int level) {
    const double t = std::numbers::phi;
    Mesh m;
    m.positions = {{-1, t, 0},  {1, t, 0},  {-1, -t, 0}, {1, -t, 0}, {0, -1, t},  {0, 1, t},
                   {0, -1, -t}, {0, 1, -t}, {t, 0, -1},  {t, 0, 1},  {-t, 0, -1}, {-t, 0, 1}};
    m.triangles = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                   {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                   {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
    for (glm::dvec3& p : m.positions) p = glm::normalize(p);
    for (; level > 0; --level) {
        std::map<std::pair<Index, Index>, Index> middles;
        const auto middle = [&](Index a, Index b) {
            const auto [entry, is_new] =
                middles.try_emplace({std::min(a, b), std::max(a, b)}, static_cast<Index>(m.positions.size()));
            if (is_new) m.positions.push_back(glm::normalize(m.positions[a] + m.positions[b]));
            return entry->second;
        };
        std::vector<Triangle> finer;
        for (const auto& [a, b, c] : m.triangles) {
            const Index ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
            finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
        }
        m.triangles = std::move(finer);
    }
    return m;
}

// Waves of a few lengths, and noise of `noise` of the radius.
inline Mesh bumpy_sphere(int level, double noise = 0.01, unsigned seed = 1) {
    Mesh m = icosphere(level);
    std::mt19937_64 random(seed);
    for (glm::dvec3& p : m.positions) {
        const double waves = 0.12 * std::sin(5 * p.x + 1) * std::cos(4 * p.y) + 0.05 * std::sin(13 * p.z + 3 * p.x);
        p *= 1 + waves + noise * random_between(random, -1, 1);
    }
    return m;
}

// Spikes of random length on a sphere: bounds of neighbours differ wildly.
inline Mesh spiky_star(int level, unsigned seed = 2) {
    Mesh m = icosphere(level);
    std::mt19937_64 random(seed);
    for (glm::dvec3& p : m.positions)
        if (random_unit(random) < 0.2) p *= random_between(random, 2, 8);
    return m;
}

inline Mesh torus(int around, int across, double major = 2, double minor = 0.7) {
    Mesh m;
    for (int i = 0; i < around; ++i) {
        for (int j = 0; j < across; ++j) {
            const double u = 2 * std::numbers::pi * i / around, v = 2 * std::numbers::pi * j / across;
            const double r = major + minor * std::cos(v);
            m.positions.emplace_back(r * std::cos(u), r * std::sin(u), minor * std::sin(v));
        }
    }
    const auto at = [&](int i, int j) { return static_cast<Index>((i % around) * across + j % across); };
    for (int i = 0; i < around; ++i) {
        for (int j = 0; j < across; ++j) {
            m.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            m.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    }
    return m;
}

// ---- open and awkward surfaces

// Flat in z = 0, so all geometric errors are equal: n x n squares of side 1.
inline Mesh grid(int n) {
    Mesh m;
    for (int i = 0; i <= n; ++i)
        for (int j = 0; j <= n; ++j) m.positions.emplace_back(j, i, 0);
    const auto at = [&](int i, int j) { return static_cast<Index>(i * (n + 1) + j); };
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
            m.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j + 1)});
            m.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i + 1, j)});
        }
    }
    return m;
}

inline Mesh single_triangle() {
    Mesh m;
    m.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    m.triangles = {{0, 1, 2}};
    return m;
}

// One-sided: every edge inside has two faces, but no orientation agrees all the way round.
inline Mesh moebius_strip(int n) {
    Mesh m;
    for (int i = 0; i < n; ++i) {
        const double u = 2 * std::numbers::pi * i / n;
        for (const double side : {-0.3, 0.3}) {
            const double r = 1 + side * std::cos(u / 2);
            m.positions.emplace_back(r * std::cos(u), r * std::sin(u), side * std::sin(u / 2));
        }
    }
    for (int i = 0; i < n; ++i) {
        const bool last = i + 1 == n;
        const auto a = static_cast<Index>(2 * i), b = a + 1;
        const Index c = last ? 1 : a + 2, d = last ? 0 : a + 3; // half a turn where the strip closes
        m.triangles.push_back({a, b, d});
        m.triangles.push_back({a, d, c});
    }
    return m;
}

// `pages` triangles, like a book, on one edge.
inline Mesh non_manifold_fan(int pages) {
    Mesh m;
    m.positions = {{0, 0, -1}, {0, 0, 1}};
    for (int i = 0; i < pages; ++i) {
        const double u = 2 * std::numbers::pi * i / pages;
        m.positions.emplace_back(std::cos(u), std::sin(u), 0.2 * i);
        m.triangles.push_back({0, 1, static_cast<Index>(2 + i)});
    }
    return m;
}

// Triangles between random vertices of the unit cube.
inline Mesh random_soup(int vertices, int triangles, unsigned seed) {
    Mesh m;
    std::mt19937_64 random(seed);
    for (int i = 0; i < vertices; ++i)
        m.positions.emplace_back(random_unit(random), random_unit(random), random_unit(random));
    while (static_cast<int>(m.triangles.size()) < triangles) {
        Triangle t;
        for (Index& v : t) v = static_cast<Index>(random() % static_cast<unsigned>(vertices));
        if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) m.triangles.push_back(t);
    }
    return m;
}

// ---- variations

// Every triangle with three vertices of its own.
inline Mesh unwelded(const Mesh& mesh) {
    Mesh m;
    m.ranges = mesh.ranges;
    for (const Triangle& t : mesh.triangles) {
        const Index first = static_cast<Index>(m.positions.size());
        m.triangles.push_back({first, first + 1, first + 2});
        for (const Index v : t) {
            m.positions.push_back(mesh.positions[v]);
            if (!mesh.normals.empty()) m.normals.push_back(mesh.normals[v]);
            if (!mesh.colours.empty()) m.colours.push_back(mesh.colours[v]);
            if (!mesh.uvs.empty()) m.uvs.push_back(mesh.uvs[v]);
        }
    }
    return m;
}

// Positions p * scale + offset.
inline Mesh placed(Mesh m, double scale, glm::dvec3 offset = glm::dvec3(0)) {
    for (glm::dvec3& p : m.positions) p = p * scale + offset;
    return m;
}

inline Mesh inside_out(Mesh m) {
    for (Triangle& t : m.triangles) std::swap(t[1], t[2]);
    return m;
}

// Both meshes side by side (positions and triangles only).
inline Mesh together(const Mesh& a, const Mesh& b) {
    Mesh m;
    m.positions = a.positions;
    m.positions.insert(m.positions.end(), b.positions.begin(), b.positions.end());
    m.triangles = a.triangles;
    const Index first = static_cast<Index>(a.positions.size());
    for (const Triangle& t : b.triangles) m.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    return m;
}

inline Mesh two_parts() { return together(icosphere(2), placed(cube(3), 0.5, {4, 1, 0})); }

// A double rounded to float and back. By way of memory: GCC 12 leaves the rounding out where it converts two numbers at
// once, as in glm::dvec3(glm::vec3(p)).
inline double rounded_to_float(double x) {
    volatile float rounded = static_cast<float>(x);
    return static_cast<double>(rounded);
}
inline glm::dvec3 rounded_to_float(glm::dvec3 p) {
    return {rounded_to_float(p.x), rounded_to_float(p.y), rounded_to_float(p.z)};
}

// All positions rounded to float, as from a file of floats.
inline Mesh in_floats(Mesh m) {
    for (glm::dvec3& p : m.positions) p = rounded_to_float(p);
    return m;
}

// Normals of random length, colours, UVs and two overlapping kinds of ranges.
inline Mesh with_attributes(Mesh m, unsigned seed = 3) {
    std::mt19937_64 random(seed);
    const auto unit = [&] { return static_cast<float>(random_unit(random)); };
    for (std::size_t v = 0; v < m.positions.size(); ++v) {
        m.normals.push_back(glm::vec3(random_direction(random)) * (0.5f + unit()));
        m.colours.emplace_back(unit(), unit(), unit(), 1.0f);
        m.uvs.emplace_back(unit() * 3 - 1, unit());
    }
    const auto n = m.triangles.size();
    m.ranges = {{"body", MeshRange::Kind::group, 0, n},
                {"red", MeshRange::Kind::material, 0, n / 3},
                {"blue", MeshRange::Kind::material, n / 3, n - n / 3}};
    return m;
}

// Vertices that no triangle uses, in front, between and behind.
inline Mesh with_unreferenced(const Mesh& mesh, Index extra = 3) {
    Mesh m;
    std::mt19937_64 random(4);
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
        if (v == 0 || v == mesh.positions.size() / 2)
            for (Index i = 0; i < extra; ++i) m.positions.push_back(2.0 * random_direction(random));
        m.positions.push_back(mesh.positions[v]);
    }
    for (Index i = 0; i < extra; ++i) m.positions.push_back(2.0 * random_direction(random));
    const Index half = static_cast<Index>(mesh.positions.size() / 2);
    for (Triangle t : mesh.triangles) {
        for (Index& v : t) v += v >= half ? 2 * extra : extra;
        m.triangles.push_back(t);
    }
    return m;
}

// Triangles that use a vertex twice, strewn in.
inline Mesh with_degenerate_triangles(const Mesh& mesh) {
    Mesh m = mesh;
    m.triangles.clear();
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        if (t % 3 == 0) m.triangles.push_back({mesh.triangles[t][0], mesh.triangles[t][1], mesh.triangles[t][0]});
        m.triangles.push_back(mesh.triangles[t]);
    }
    return m;
}

// Two quads that meet in two pairs of coincident vertices; the colours differ across the seam where asked.
//
//   3--2 7--6
//   |  | |  |      1 = 4 and 2 = 7
//   0--1 4--5
inline Mesh seam(bool colours_differ) {
    Mesh m;
    m.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {1, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}};
    m.triangles = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
    for (std::size_t v = 0; v < 8; ++v)
        m.colours.push_back(glm::vec4(glm::vec3(v < 4 || !colours_differ ? 0.25f : 0.75f), 1));
    return m;
}

// `n` triangles whose vertices all lie at one point.
inline Mesh all_coincident(int n) {
    Mesh m;
    m.positions.assign(static_cast<std::size_t>(n) + 2, glm::dvec3(1, 2, 3));
    for (Index t = 0; t < static_cast<Index>(n); ++t) m.triangles.push_back({t, t + 1, t + 2});
    return m;
}

// Triangles of zero area with three different vertices: needles and collinear corners, beside a real one.
inline Mesh with_zero_areas() {
    Mesh m;
    m.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 1, 0}, {0, 1, 0}, {3, 0, 0}};
    m.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {2, 5, 1}, {1, 3, 4}};
    return m;
}

struct Named {
    std::string name;
    Mesh mesh;
};

// All of the above at sizes that brute force can still check.
inline std::vector<Named> all() {
    return {
        {"single_triangle", single_triangle()},
        {"tetrahedron", tetrahedron()},
        {"cube", cube(1)},
        {"cube_of_squares", cube(5)},
        {"icosphere", icosphere(2)},
        {"bumpy_sphere", bumpy_sphere(3)},
        {"spiky_star", spiky_star(2)},
        {"torus", torus(24, 10)},
        {"inside_out", inside_out(torus(12, 8))},
        {"flat_grid", grid(12)},
        {"moebius_strip", moebius_strip(30)},
        {"non_manifold_fan", non_manifold_fan(7)},
        {"random_soup", random_soup(60, 200, 5)},
        {"unwelded_soup", unwelded(random_soup(40, 60, 6))},
        {"unwelded_sphere", unwelded(bumpy_sphere(2))},
        {"two_parts", two_parts()},
        {"seam", seam(false)},
        {"coloured_seam", seam(true)},
        {"zero_areas", with_zero_areas()},
        {"unreferenced", with_unreferenced(icosphere(1))},
        {"one_unreferenced", with_unreferenced(single_triangle(), 1)},
        {"degenerate_triangles", with_degenerate_triangles(cube(2))},
        {"attributes", with_attributes(bumpy_sphere(2))},
        {"unwelded_attributes", unwelded(with_attributes(cube(2)))},
        {"northing", placed(bumpy_sphere(2), 30, {5.0e5, 5.0e6, 120})},
        {"far_negative", placed(bumpy_sphere(1), 1, {-1e4, 1e7, -3})},
        {"tiny", placed(bumpy_sphere(2), 1e-19)},
        {"huge", placed(bumpy_sphere(2), 1e30)},
    };
}

// Rings of so many vertices, each of a radius and a height, with quads between; closed by hubs where asked.
inline Mesh turned(int around, std::initializer_list<glm::dvec2> rings, bool has_hubs) {
    Mesh mesh;
    const auto n = static_cast<Index>(around);
    for (const glm::dvec2& ring : rings)
        for (Index i = 0; i < n; ++i) {
            const double angle = 2 * std::numbers::pi * i / around;
            mesh.positions.push_back({ring.x * std::cos(angle), ring.x * std::sin(angle), ring.y});
        }
    const auto last = static_cast<Index>(rings.size() - 1) * n, low = last + n, high = low + 1;
    for (Index from = 0; from < last; from += n)
        for (Index i = 0; i < n; ++i) {
            const Index j = (i + 1) % n;
            mesh.triangles.push_back({from + i, from + j, from + n + j});
            mesh.triangles.push_back({from + i, from + n + j, from + n + i});
        }
    if (!has_hubs) return mesh;
    mesh.positions.push_back({0, 0, rings.begin()->y});
    mesh.positions.push_back({0, 0, std::prev(rings.end())->y});
    for (Index i = 0; i < n; ++i) {
        const Index j = (i + 1) % n;
        mesh.triangles.push_back({low, j, i});
        mesh.triangles.push_back({high, last + i, last + j});
    }
    return mesh;
}

} // namespace unseen::shapes
