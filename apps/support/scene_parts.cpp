#include "scene_parts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <glm/geometric.hpp>

namespace unseen::app {
namespace {

using std::numbers::pi;
using vdtree::Index;
using vdtree::Mesh;

constexpr int least_segments = 6;

// Two triangles for each of rows x columns cells; `at` is the vertex in a row and a column.
template <class At>
void add_cells(Mesh& mesh, int rows, int columns, const At& at) {
    for (int r = 0; r < rows; ++r) {
        for (int c = 0; c < columns; ++c) {
            mesh.triangles.push_back({at(r, c), at(r + 1, c), at(r, c + 1)});
            mesh.triangles.push_back({at(r, c + 1), at(r + 1, c), at(r + 1, c + 1)});
        }
    }
}

// From point to point, as thick as they say, open at both ends.
void add_branch(Mesh& mesh, glm::dvec3 from, glm::dvec3 to, double thick, double thin, int sides, int rows) {
    const glm::dvec3 along = glm::normalize(to - from);
    const glm::dvec3 across =
        glm::normalize(glm::cross(along, std::abs(along.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0)));
    const glm::dvec3 third = glm::cross(along, across);
    const auto first = static_cast<Index>(mesh.positions.size());
    for (int r = 0; r <= rows; ++r) {
        const double share = static_cast<double>(r) / rows, radius = thick + (thin - thick) * share;
        for (int c = 0; c < sides; ++c) {
            const double angle = 2 * pi * c / sides;
            mesh.positions.push_back(from + (to - from) * share +
                                     radius * (std::cos(angle) * across - std::sin(angle) * third));
        }
    }
    add_cells(mesh, rows, sides, [&](int r, int c) { return first + static_cast<Index>(r * sides + c % sides); });
}

// Four triangles, folded along the midrib, pointing along `direction`.
void add_leaf(Mesh& mesh, glm::dvec3 at, glm::dvec3 direction, double length, Chance& chance) {
    const glm::dvec3 along = glm::normalize(direction);
    const glm::dvec3 any(chance.next(-1, 1), chance.next(-1, 1), chance.next(-1, 1));
    const glm::dvec3 across = glm::normalize(glm::cross(along, any + glm::dvec3(1e-3, 2e-3, 3e-3)));
    const glm::dvec3 up = glm::cross(across, along);
    const auto first = static_cast<Index>(mesh.positions.size());
    const glm::dvec3 middle = at + along * (0.5 * length);
    mesh.positions.insert(mesh.positions.end(), {at, middle - up * (0.08 * length), at + along * length,
                                                 middle + across * (0.3 * length), middle - across * (0.3 * length)});
    mesh.triangles.push_back({first, first + 1, first + 3});
    mesh.triangles.push_back({first + 1, first + 2, first + 3});
    mesh.triangles.push_back({first, first + 4, first + 1});
    mesh.triangles.push_back({first + 1, first + 4, first + 2});
}

// Points in between, so that there are so many.
std::vector<glm::dvec2> refined(const std::vector<glm::dvec2>& profile, int count) {
    std::vector<double> way = {0};
    for (std::size_t i = 1; i < profile.size(); ++i)
        way.push_back(way.back() + glm::length(profile[i] - profile[i - 1]));
    std::vector<glm::dvec2> points;
    for (int i = 0; i < count; ++i) {
        const double at = way.back() * i / (count - 1);
        const auto above = std::upper_bound(way.begin() + 1, way.end() - 1, at);
        const auto k = static_cast<std::size_t>(above - way.begin());
        const double share = (at - way[k - 1]) / std::max(way[k] - way[k - 1], 1e-30);
        points.push_back(profile[k - 1] + (profile[k] - profile[k - 1]) * std::clamp(share, 0.0, 1.0));
    }
    return points;
}

// How many rows and segments make so many triangles where a turned body is so many times as high as it is around.
struct Fineness {
    int rows, segments;
};
Fineness fineness_for(std::uint64_t triangles, double rows_by_segments) {
    const double quads = static_cast<double>(std::max<std::uint64_t>(triangles, 100)) / 2;
    const int segments = std::max(least_segments, static_cast<int>(std::round(std::sqrt(quads / rows_by_segments))));
    return {std::max(4, static_cast<int>(std::round(quads / segments))), segments};
}

// A tube around a closed curve.
template <class Curve, class Radius>
Mesh tube(int rows, int sides, Curve curve, Radius radius) {
    Mesh mesh;
    for (int r = 0; r < rows; ++r) {
        const double t = 2 * pi * r / rows, step = 1e-4;
        const glm::dvec3 centre = curve(t), along = glm::normalize(curve(t + step) - curve(t - step));
        const glm::dvec3 outward = curve(t + step) + curve(t - step) - 2.0 * centre + glm::dvec3(0, 1e-12, 0);
        const glm::dvec3 across = glm::normalize(outward - along * glm::dot(outward, along));
        const glm::dvec3 third = glm::cross(along, across);
        for (int c = 0; c < sides; ++c) {
            const double angle = 2 * pi * c / sides;
            mesh.positions.push_back(centre + radius(t, angle) * (std::cos(angle) * across + std::sin(angle) * third));
        }
    }
    add_cells(mesh, rows, sides, [&](int r, int c) { return static_cast<Index>((r % rows) * sides + c % sides); });
    return mesh;
}

// A closed surface whose volume came out negative is turned.
Mesh outward(Mesh mesh) {
    double volume = 0;
    for (const vdtree::Triangle& t : mesh.triangles)
        volume += glm::dot(mesh.positions[t[0]], glm::cross(mesh.positions[t[1]], mesh.positions[t[2]]));
    if (volume < 0)
        for (vdtree::Triangle& t : mesh.triangles) std::swap(t[0], t[1]);
    return mesh;
}

} // namespace

double Chance::next(double low, double high) {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15u);
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
    z = (z ^ z >> 27) * 0x94D049BB133111EBu;
    constexpr double steps = 9007199254740992.0; // 2^53
    return low + (high - low) * (static_cast<double>((z ^ z >> 31) >> 11) / steps);
}

vdtree::Mesh box(glm::dvec3 size, double cell) {
    Mesh mesh;
    const glm::dvec3 low(-size.x / 2, 0, -size.z / 2);
    for (int axis = 0; axis < 3; ++axis) {
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        const int across = std::max(1, static_cast<int>(std::ceil(size[u] / cell - 1e-9)));
        const int up = std::max(1, static_cast<int>(std::ceil(size[v] / cell - 1e-9)));
        for (const bool is_high : {false, true}) {
            const auto first = static_cast<Index>(mesh.positions.size());
            glm::vec3 normal(0);
            normal[axis] = is_high ? 1.0f : -1.0f;
            for (int j = 0; j <= up; ++j) {
                for (int i = 0; i <= across; ++i) {
                    glm::dvec3 p = low;
                    p[u] += size[u] * i / across, p[v] += size[v] * j / up;
                    if (is_high) p[axis] += size[axis];
                    mesh.positions.push_back(p);
                    mesh.normals.push_back(normal);
                }
            }
            const auto at = [&](int i, int j) { return first + static_cast<Index>(j * (across + 1) + i); };
            for (int j = 0; j < up; ++j) {
                for (int i = 0; i < across; ++i) {
                    std::array<vdtree::Triangle, 2> two = {
                        {{at(i, j), at(i + 1, j), at(i + 1, j + 1)}, {at(i, j), at(i + 1, j + 1), at(i, j + 1)}}};
                    for (vdtree::Triangle& t : two) {
                        if (!is_high) std::swap(t[0], t[1]);
                        mesh.triangles.push_back(t);
                    }
                }
            }
        }
    }
    return mesh;
}

vdtree::Mesh ground(double side, int cells, double height, std::uint64_t seed) {
    Mesh mesh;
    Chance chance(seed);
    const double a = chance.next(0, 6), b = chance.next(0, 6);
    for (int j = 0; j <= cells; ++j) {
        for (int i = 0; i <= cells; ++i) {
            const double x = side * (static_cast<double>(i) / cells - 0.5),
                         z = side * (static_cast<double>(j) / cells - 0.5);
            mesh.positions.emplace_back(x, height * 0.5 * (std::sin(x * 0.11 + a) + std::sin(z * 0.09 + b)) - height,
                                        z);
        }
    }
    add_cells(mesh, cells, cells, [&](int j, int i) { return static_cast<Index>(j * (cells + 1) + i); });
    return mesh;
}

vdtree::Mesh bumpy_sphere(int rows) {
    Mesh mesh;
    const int columns = 2 * rows;
    for (int i = 0; i <= rows; ++i) {
        for (int j = 0; j < columns; ++j) {
            const double theta = pi * i / rows, phi = 2 * pi * j / columns;
            const double r = 1 + 0.02 * std::sin(20 * theta) * std::cos(14 * phi);
            mesh.positions.push_back(
                r * glm::dvec3(std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi)));
        }
    }
    const auto at = [&](int i, int j) { return static_cast<Index>(i * columns + j % columns); };
    for (int i = 0; i < rows; ++i) { // seen from outside, the other way round than in tubes
        for (int j = 0; j < columns; ++j) {
            mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
            mesh.triangles.push_back({at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)});
        }
    }
    return mesh;
}

vdtree::Mesh lathe(const std::vector<glm::dvec2>& profile, int segments, int flutes, double depth) {
    Mesh mesh;
    std::vector<std::vector<Index>> rows;
    for (const glm::dvec2& point : profile) {
        std::vector<Index>& row = rows.emplace_back();
        if (!(point.x > 0)) { // on the axis: one vertex
            row.assign(static_cast<std::size_t>(segments), static_cast<Index>(mesh.positions.size()));
            mesh.positions.emplace_back(0, point.y, 0);
            continue;
        }
        for (int s = 0; s < segments; ++s) {
            const double angle = 2 * pi * s / segments;
            const double radius = point.x * (1 - depth * (0.5 - 0.5 * std::cos(flutes * angle)));
            row.push_back(static_cast<Index>(mesh.positions.size()));
            mesh.positions.emplace_back(radius * std::sin(angle), point.y, radius * std::cos(angle));
        }
    }
    for (std::size_t r = 0; r + 1 < rows.size(); ++r) {
        for (std::size_t s = 0; s < rows[r].size(); ++s) {
            const std::size_t next = (s + 1) % rows[r].size();
            const Index a = rows[r][s], b = rows[r][next], c = rows[r + 1][s], d = rows[r + 1][next];
            if (a != b) mesh.triangles.push_back({a, b, c});
            if (c != d) mesh.triangles.push_back({b, d, c});
        }
    }
    return mesh;
}

vdtree::Mesh bar(double height, double radius, int segments) {
    std::vector<glm::dvec2> profile = {{0, 0}, {radius, 0}};
    constexpr int pieces = 12; // for light differs along it
    for (int i = 1; i < pieces; ++i) profile.emplace_back(radius, height * i / pieces);
    profile.emplace_back(radius, height), profile.emplace_back(0, height);
    return lathe(profile, segments);
}

vdtree::Mesh sphere(std::uint64_t triangles) {
    // As many segments as twice the rows, so that triangles at the equator are about square.
    const int rows = std::max(4, static_cast<int>(std::lround(std::sqrt(static_cast<double>(triangles) / 4))));
    std::vector<glm::dvec2> profile = {{0, 0}};
    for (int i = 1; i < rows; ++i) {
        const double angle = pi * i / rows;
        profile.emplace_back(0.5 * std::sin(angle), 0.5 - 0.5 * std::cos(angle));
    }
    profile.emplace_back(0, 1);
    return lathe(profile, 2 * rows);
}

vdtree::Mesh urn(std::uint64_t triangles) {
    const Fineness fine = fineness_for(triangles, 1.2);
    std::vector<glm::dvec2> profile;
    constexpr int smooth = 200; // pieces of the curve
    profile.emplace_back(0, 0);
    for (int i = 0; i <= smooth; ++i) {
        const double y = static_cast<double>(i) / smooth;
        const double foot = 0.2 * std::exp(-40 * y * y), belly = 0.32 * std::exp(-14 * (y - 0.55) * (y - 0.55)),
                     lip = 0.16 * std::exp(-160 * (y - 1) * (y - 1)), rings = 0.008 * std::sin(60 * y);
        profile.emplace_back(0.06 + foot + belly + lip + rings, y);
    }
    profile.emplace_back(0, 0.96);
    return lathe(refined(profile, fine.rows), fine.segments, 24, 0.05);
}

vdtree::Mesh column(std::uint64_t triangles) {
    const Fineness fine = fineness_for(triangles, 1.6);
    std::vector<glm::dvec2> profile = {{0, 0}, {0.11, 0}, {0.11, 0.02}, {0.085, 0.04}};
    constexpr int smooth = 40;
    for (int i = 0; i <= smooth; ++i) {
        const double y = static_cast<double>(i) / smooth;
        profile.emplace_back(0.08 - 0.016 * y * y, 0.05 + 0.87 * y);
    }
    profile.insert(profile.end(), {{0.08, 0.94}, {0.105, 0.97}, {0.105, 1}, {0, 1}});
    return lathe(refined(profile, fine.rows), fine.segments, 20, 0.09);
}

vdtree::Mesh knot(std::uint64_t triangles) {
    const Fineness fine = fineness_for(triangles, 12);
    const auto curve = [](double t) {
        const double r = 2 + std::cos(3 * t);
        return glm::dvec3(r * std::cos(2 * t), r * std::sin(2 * t), std::sin(3 * t));
    };
    return set_upright(outward(tube(fine.rows, fine.segments, curve, [](double t, double angle) {
        return 0.42 + 0.03 * std::sin(60 * t + 2 * angle);
    })));
}

vdtree::Mesh ring(std::uint64_t triangles) {
    const Fineness fine = fineness_for(triangles, 3);
    const auto curve = [](double t) { return glm::dvec3(std::cos(t), std::sin(t), 0); };
    return set_upright(outward(tube(fine.rows, fine.segments, curve, [](double t, double angle) {
        return 0.22 * (1 + 0.06 * std::sin(24 * t) * std::cos(3 * angle));
    })));
}

vdtree::Mesh tree(std::uint64_t triangles, std::uint64_t seed) {
    Mesh mesh;
    Chance chance(seed);
    constexpr double height = 5;
    const int sides = triangles > 4000 ? 12 : 6;
    add_branch(mesh, {0, -0.2, 0}, {0, height * 0.8, 0}, 0.16, 0.04, sides, 12);
    const int branches = static_cast<int>(std::clamp<std::uint64_t>(triangles / 250, 8, 60));
    struct Twig {
        glm::dvec3 from, to;
    };
    std::vector<Twig> twigs;
    for (int i = 0; i < branches; ++i) {
        const double share = (i + 0.5) / branches, turn = i * 2.399963 + chance.next(-0.3, 0.3);
        const double length = (1.7 - 1.1 * share) * chance.next(0.8, 1.2);
        const glm::dvec3 from(0, height * (0.28 + 0.5 * share), 0);
        const glm::dvec3 to = from + length * glm::dvec3(std::cos(turn), chance.next(0.25, 0.6), std::sin(turn));
        add_branch(mesh, from, to, 0.045, 0.012, std::max(4, sides / 2), 4);
        twigs.push_back({from, to});
    }
    // Fewer leaves are larger ones.
    const double leaf_m = 0.09 * std::clamp(std::sqrt(12000.0 / static_cast<double>(triangles)), 1.0, 3.0);
    while (mesh.triangles.size() + 4 <= triangles) {
        const Twig& twig = twigs[std::min(twigs.size() - 1,
                                          static_cast<std::size_t>(chance.next(0, static_cast<double>(twigs.size()))))];
        const glm::dvec3 off(chance.next(-1, 1), chance.next(-1, 1), chance.next(-1, 1));
        const glm::dvec3 at = twig.from + (twig.to - twig.from) * chance.next(0.25, 1.1) + off * 0.28;
        add_leaf(mesh, at, twig.to - twig.from + off, leaf_m * chance.next(0.7, 1.3), chance);
    }
    return mesh;
}

vdtree::Mesh set_upright(vdtree::Mesh mesh) {
    glm::dvec3 low(std::numeric_limits<double>::infinity()), high = -low;
    for (const glm::dvec3& p : mesh.positions) low = glm::min(low, p), high = glm::max(high, p);
    const double height = high.y - low.y > 0 ? high.y - low.y : 1;
    const glm::dvec3 foot((low.x + high.x) / 2, low.y, (low.z + high.z) / 2);
    for (glm::dvec3& p : mesh.positions) p = (p - foot) / height;
    mesh.normals.clear();
    return mesh;
}

} // namespace unseen::app
