// Midpoint subdivision: numbers the edges, decides which are split, makes their midpoints, then the triangles.
#include "subdivide.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <string>

#include <glm/geometric.hpp>

namespace unseen::app {
namespace {

using vdtree::Index;
using vdtree::Mesh;
using vdtree::Triangle;

constexpr Index not_split = std::numeric_limits<Index>::max();
// Corners of triangles are numbered, too; three to a triangle, and one number stands for "not split".
constexpr std::uint64_t most_triangles = (std::uint64_t{not_split} - 2) / 3;

std::uint64_t mixed(std::uint64_t x) { // the finaliser of SplitMix64 (Steele, Lea and Flood 2014)
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

// Hashes the place alone, so that doubled vertices hash alike. Adding 0 makes one of the two zeros.
std::uint64_t hash_of(const glm::dvec3& p, std::uint64_t seed) {
    for (int axis = 0; axis < 3; ++axis)
        seed = mixed(seed + 0x9e3779b97f4a7c15u + std::bit_cast<std::uint64_t>(p[axis] + 0.0));
    return seed;
}

double length_of(const glm::dvec3& v) { return std::hypot(v.x, v.y, v.z); } // of any size

bool is_finite(const glm::dvec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

bool are_floats(const Mesh& mesh) {
    return std::all_of(mesh.positions.begin(), mesh.positions.end(),
                       [](const glm::dvec3& p) { return glm::dvec3(glm::vec3(p)) == p; });
}

// By vertex: the first one at the same position.
std::vector<Index> first_at_position(const std::vector<glm::dvec3>& positions) {
    std::vector<Index> order(positions.size());
    for (Index v = 0; v < order.size(); ++v) order[v] = v;
    const auto key = [&](Index v) { return std::array{positions[v].x, positions[v].y, positions[v].z}; };
    std::sort(order.begin(), order.end(),
              [&](Index a, Index b) { return positions[a] != positions[b] ? key(a) < key(b) : a < b; });
    std::vector<Index> first(positions.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
        const bool repeats = i > 0 && positions[order[i]] == positions[order[i - 1]];
        first[order[i]] = repeats ? first[order[i - 1]] : order[i];
    }
    return first;
}

// Unit normals weighted by area, alike at doubled vertices; 0 where there is none.
std::vector<glm::vec3> vertex_normals(const Mesh& mesh) {
    const std::vector<Index> first = first_at_position(mesh.positions);
    glm::dvec3 low = mesh.positions.front(), high = low;
    for (const glm::dvec3& p : mesh.positions) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    const glm::dvec3 extent = high - low;
    const double largest = std::max({extent.x, extent.y, extent.z});
    const double unit = largest > 0 ? largest : 1; // so that squares of lengths neither vanish nor overflow
    std::vector<glm::dvec3> sums(mesh.positions.size(), glm::dvec3(0));
    for (const Triangle& t : mesh.triangles) {
        const glm::dvec3 a = mesh.positions[t[0]] / unit;
        const glm::dvec3 normal = glm::cross(mesh.positions[t[1]] / unit - a, mesh.positions[t[2]] / unit - a);
        for (const Index v : t) sums[first[v]] += normal;
    }
    std::vector<glm::vec3> normals(sums.size());
    for (std::size_t v = 0; v < sums.size(); ++v) {
        const double length = glm::length(sums[first[v]]);
        normals[v] = length > 0 ? glm::vec3(sums[first[v]] / length) : glm::vec3(0);
    }
    return normals;
}

// The edges of a mesh: each one's ends, and by corner of a triangle the edge to the next corner.
struct Edges {
    std::vector<std::array<Index, 2>> ends; // the lower number first
    std::vector<Index> of_corner;
};

// Corners are sorted into one bucket for each lower end, and within it by the upper one.
Edges edges_of(const Mesh& mesh) {
    struct Corner {
        Index upper = 0, corner = 0;
    };
    const auto corner_count = static_cast<Index>(mesh.triangles.size() * 3);
    const auto ends_of = [&](Index corner) {
        const Triangle& t = mesh.triangles[corner / 3];
        const auto [low, high] = std::minmax(t[corner % 3], t[(corner + 1) % 3]);
        return std::array<Index, 2>{low, high};
    };
    std::vector<Index> bounds(mesh.positions.size() + 1, 0);
    for (Index c = 0; c < corner_count; ++c) ++bounds[ends_of(c)[0] + 1];
    for (std::size_t v = 1; v < bounds.size(); ++v) bounds[v] += bounds[v - 1];
    std::vector<Corner> corners(corner_count);
    for (Index c = 0; c < corner_count; ++c) { // moves each bucket's begin to its end
        const auto [low, high] = ends_of(c);
        corners[bounds[low]++] = {high, c};
    }
    Edges edges;
    edges.of_corner.resize(corner_count);
    edges.ends.reserve(corner_count / 2);
    for (Index low = 0, begin = 0; low < mesh.positions.size(); begin = bounds[low++]) {
        std::sort(corners.begin() + begin, corners.begin() + bounds[low], [](const Corner& a, const Corner& b) {
            return a.upper != b.upper ? a.upper < b.upper : a.corner < b.corner;
        });
        for (Index i = begin; i < bounds[low]; ++i) {
            if (i == begin || corners[i].upper != corners[i - 1].upper) edges.ends.push_back({low, corners[i].upper});
            edges.of_corner[corners[i].corner] = static_cast<Index>(edges.ends.size() - 1);
        }
    }
    return edges;
}

class Subdivider {
public:
    Subdivider(Mesh mesh, const SubdivideOptions& options)
        : mesh_(std::move(mesh)), options_(options), stays_in_floats_(are_floats(mesh_)),
          normals_(vertex_normals(mesh_)) {
        mesh_.further.clear(); // new vertices have none
        mesh_.normals = {};
    }

    std::uint64_t triangle_count() const { return mesh_.triangles.size(); }
    Mesh take() { return std::move(mesh_); }

    // Splits every edge, or the longest ones as long as there are at most so many triangles.
    Result<void> split(std::uint64_t at_most) {
        Edges edges = edges_of(mesh_);
        const bool all = triangle_count() * 4 <= at_most;
        const std::vector<bool> is_split =
            all ? std::vector<bool>(edges.ends.size(), true) : longest(edges, at_most - triangle_count());
        const auto count = static_cast<std::uint64_t>(std::count(is_split.begin(), is_split.end(), true));
        if (mesh_.positions.size() + count >= not_split)
            return Error{ErrorCode::unsupported,
                         "There would be more vertices than indices can count; subdivide less."};
        const std::vector<Index> midpoints = add_midpoints(edges, is_split, count);
        edges.ends = {};
        split_triangles(edges.of_corner, midpoints);
        return {};
    }

private:
    // A split edge makes one more triangle of each triangle around it. Edges at the same place go together.
    std::vector<bool> longest(const Edges& edges, std::uint64_t more_triangles) const {
        struct Candidate {
            float length = 0;
            std::uint32_t hash = 0;
            Index edge = 0;
        };
        std::vector<Candidate> candidates(edges.ends.size());
        for (Index e = 0; e < candidates.size(); ++e) {
            const auto [a, b] = edges.ends[e];
            const std::uint64_t hash = edge_hash(a, b);
            const auto length = static_cast<float>(length_of(mesh_.positions[a] - mesh_.positions[b]));
            candidates[e] = {length, static_cast<std::uint32_t>(hash), e};
        }
        std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
            if (a.length != b.length) return a.length > b.length;
            return a.hash != b.hash ? a.hash < b.hash : a.edge < b.edge;
        });
        std::vector<Index> around(edges.ends.size(), 0);
        for (const Index e : edges.of_corner) ++around[e];
        std::vector<bool> is_split(edges.ends.size(), false);
        for (std::size_t i = 0; i < candidates.size();) {
            std::size_t end = i;
            std::uint64_t cost = 0;
            for (; end < candidates.size() && candidates[end].length == candidates[i].length &&
                   candidates[end].hash == candidates[i].hash;
                 ++end)
                cost += around[candidates[end].edge];
            if (cost > more_triangles) break;
            more_triangles -= cost;
            for (; i < end; ++i) is_split[candidates[i].edge] = true;
        }
        return is_split;
    }

    std::uint64_t edge_hash(Index a, Index b) const { // of the ends in any order
        return mixed(hash_of(mesh_.positions[a], options_.seed) + hash_of(mesh_.positions[b], options_.seed));
    }

    // Rounded, where that leaves it finite.
    glm::dvec3 stored(const glm::dvec3& p) const {
        const glm::dvec3 rounded = stays_in_floats_ ? glm::dvec3(glm::vec3(p)) : p;
        return is_finite(rounded) ? rounded : p;
    }

    // By edge: its new vertex, or not_split.
    std::vector<Index> add_midpoints(const Edges& edges, const std::vector<bool>& is_split, std::uint64_t count) {
        const std::size_t size = mesh_.positions.size() + count;
        mesh_.positions.reserve(size);
        normals_.reserve(size);
        if (!mesh_.colours.empty()) mesh_.colours.reserve(size);
        if (!mesh_.uvs.empty()) mesh_.uvs.reserve(size);
        std::vector<Index> midpoints(edges.ends.size(), not_split);
        for (std::size_t e = 0; e < midpoints.size(); ++e) {
            if (!is_split[e]) continue;
            midpoints[e] = static_cast<Index>(mesh_.positions.size());
            add_midpoint(edges.ends[e][0], edges.ends[e][1]);
        }
        return midpoints;
    }

    // Every sum is one of two terms, so it is the same from both ends.
    void add_midpoint(Index a, Index b) {
        const glm::dvec3 p = mesh_.positions[a], q = mesh_.positions[b];
        const glm::dvec3 sum = glm::dvec3(normals_[a]) + glm::dvec3(normals_[b]);
        const double length = glm::length(sum);
        const glm::dvec3 normal = length > 0 ? sum / length : glm::dvec3(0);
        constexpr double half_range = 0x1p63;
        const double noise = static_cast<double>(edge_hash(a, b)) / half_range - 1; // -1..1
        // Halved before they are added, which overflows nowhere.
        const glm::dvec3 halfway = p * 0.5 + q * 0.5;
        const glm::dvec3 moved = halfway + normal * (noise * options_.noise * length_of(p - q));
        mesh_.positions.push_back(stored(is_finite(moved) ? moved : halfway));
        normals_.push_back(glm::vec3(normal));
        if (!mesh_.colours.empty()) mesh_.colours.push_back((mesh_.colours[a] + mesh_.colours[b]) * 0.5f);
        if (!mesh_.uvs.empty()) mesh_.uvs.push_back((mesh_.uvs[a] + mesh_.uvs[b]) * 0.5f);
    }

    void split_triangles(const std::vector<Index>& edge_of_corner, const std::vector<Index>& midpoints) {
        std::uint64_t count = triangle_count();
        for (const Index e : edge_of_corner) count += midpoints[e] != not_split ? 1 : 0;
        std::vector<Triangle> parts;
        parts.reserve(count);
        std::vector<std::uint64_t> first_part; // by triangle, and their end; where ranges have to follow
        std::vector<Index> smoothing;
        for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
            if (!mesh_.ranges.empty()) first_part.push_back(parts.size());
            std::array<Index, 3> middles;
            for (std::size_t i = 0; i < 3; ++i) middles[i] = midpoints[edge_of_corner[3 * t + i]];
            append_parts(mesh_.triangles[t], middles, parts);
            if (!mesh_.smoothing.empty()) smoothing.resize(parts.size(), mesh_.smoothing[t]);
        }
        first_part.push_back(parts.size());
        for (vdtree::MeshRange& range : mesh_.ranges) {
            const std::uint64_t end = first_part[range.first_triangle + range.triangle_count];
            range.first_triangle = first_part[range.first_triangle];
            range.triangle_count = end - range.first_triangle;
        }
        mesh_.triangles = std::move(parts);
        mesh_.smoothing = std::move(smoothing);
    }

    // By the edges that are split:
    //        c              c            c
    //       / \            /|\          / \          none: itself; the first case with one, two and three
    //      m2--m1         / | \        m2--m1
    //     / \ / \        /  |  \      /   / \        middles[i] lies between corners i and i + 1
    //    a--m0---b      a---m0--b    a---/---b
    void append_parts(const Triangle& t, const std::array<Index, 3>& middles, std::vector<Triangle>& parts) const {
        const auto split = static_cast<int>(3 - std::count(middles.begin(), middles.end(), not_split));
        if (split == 0) {
            parts.push_back(t);
            return;
        }
        // Turned so that with one split edge it is the first, and with two the last edge is whole.
        std::size_t turn = 0;
        if (split == 1)
            while (middles[turn] == not_split) ++turn;
        if (split == 2)
            while (middles[(turn + 2) % 3] != not_split) ++turn;
        const Index a = t[turn], b = t[(turn + 1) % 3], c = t[(turn + 2) % 3];
        const Index ab = middles[turn], bc = middles[(turn + 1) % 3], ca = middles[(turn + 2) % 3];
        if (split == 1) {
            parts.insert(parts.end(), {Triangle{a, ab, c}, Triangle{ab, b, c}});
        } else if (split == 2) { // the rest is a quadrangle a, ab, bc, c: along its shorter diagonal
            const bool from_a = length_of(mesh_.positions[a] - mesh_.positions[bc]) <=
                                length_of(mesh_.positions[ab] - mesh_.positions[c]);
            parts.push_back({ab, b, bc});
            if (from_a) parts.insert(parts.end(), {Triangle{a, ab, bc}, Triangle{a, bc, c}});
            else parts.insert(parts.end(), {Triangle{a, ab, c}, Triangle{ab, bc, c}});
        } else {
            parts.insert(parts.end(),
                         {Triangle{a, ab, ca}, Triangle{ab, b, bc}, Triangle{ca, bc, c}, Triangle{ab, bc, ca}});
        }
    }

    Mesh mesh_;
    const SubdivideOptions& options_;
    bool stays_in_floats_;
    std::vector<glm::vec3> normals_; // by vertex, also of the new ones
};

// How many triangles there shall be, or an error where that cannot be.
Result<std::uint64_t> wanted_triangles(std::uint64_t before, const SubdivideOptions& options) {
    std::uint64_t wanted = before;
    if (options.triangles) {
        wanted = *options.triangles;
        if (wanted < before)
            return Error{ErrorCode::invalid_argument, "The mesh has " + std::to_string(before) +
                                                          " triangles already, which are more than " +
                                                          std::to_string(wanted) + "; ask for more of them."};
    } else {
        if (options.times < 0 || options.times > most_subdivisions)
            return Error{ErrorCode::invalid_argument, "A mesh can be subdivided 0 to " +
                                                          std::to_string(most_subdivisions) + " times, not " +
                                                          std::to_string(options.times) + "."};
        for (int i = 0; i < options.times; ++i) wanted *= 4; // at most 2^32 * 4^16: fits
    }
    if (wanted > most_triangles)
        return Error{ErrorCode::unsupported, std::to_string(wanted) + " triangles are more than the " +
                                                 std::to_string(most_triangles) +
                                                 " that indices can count; subdivide less."};
    return wanted;
}

} // namespace

Result<Mesh> subdivide(Mesh mesh, const SubdivideOptions& options) {
    if (auto valid = vdtree::validate(mesh.view()); !valid) return valid.error();
    if (!(options.noise >= 0 && options.noise <= 1))
        return Error{ErrorCode::invalid_argument, "The noise must be a share of the edges' length from 0 to 1, not " +
                                                      std::to_string(options.noise) + "."};
    const auto wanted = wanted_triangles(mesh.triangles.size(), options);
    if (!wanted) return wanted.error();
    if (mesh.triangles.empty() || *wanted == mesh.triangles.size()) return mesh;

    Subdivider subdivider(std::move(mesh), options);
    for (std::uint64_t before = 0; subdivider.triangle_count() != before;) {
        const double share = static_cast<double>(subdivider.triangle_count()) / static_cast<double>(*wanted);
        if (options.progress && !options.progress(share, "splitting edges"))
            return Error{ErrorCode::cancelled, "Subdividing was cancelled."};
        before = subdivider.triangle_count();
        if (before == *wanted) break;
        if (auto split = subdivider.split(*wanted); !split) return split.error();
        if (subdivider.triangle_count() < before * 4) break; // was the last round, of a part
    }
    return subdivider.take();
}

} // namespace unseen::app
