// Examines a mesh: first its vertices, then its triangles, then the edges between the places of its vertices.
#include <unseen/meshio/examine.h>

#include "weld.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace unseen::meshio {
namespace {

// Sets that are joined; each has its smallest element as the root.
class DisjointSets {
public:
    explicit DisjointSets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), Element{0}); }

    std::size_t root(std::size_t element) {
        while (parent_[element] != element) {
            parent_[element] = parent_[parent_[element]];
            element = parent_[element];
        }
        return element;
    }
    void join(std::size_t a, std::size_t b) {
        a = root(a);
        b = root(b);
        parent_[std::max(a, b)] = static_cast<Element>(std::min(a, b));
    }

private:
    using Element = std::uint64_t; // corners can be more than 32 bits number
    std::vector<Element> parent_;
};

std::vector<Index> find_first_equal_vertex(const MeshView& mesh) {
    return find_first_same(
        mesh.positions.size(),
        [&](SeededHash& hash, std::size_t v) {
            hash.add(mesh.positions[v]);
            add_bits(hash, mesh.normals, v);
            add_bits(hash, mesh.colours, v);
            add_bits(hash, mesh.uvs, v);
        },
        [&](std::size_t a, std::size_t b) {
            return mesh.positions[a] == mesh.positions[b] && has_same_bits(mesh.normals, a, b) &&
                   has_same_bits(mesh.colours, a, b) && has_same_bits(mesh.uvs, a, b);
        });
}

// Counts used vertices whose first one is another used vertex.
std::uint64_t count_repeated(const std::vector<Index>& first, const std::vector<bool>& is_used) {
    std::vector<bool> is_met(first.size(), false);
    std::uint64_t repeated = 0;
    for (std::size_t v = 0; v < first.size(); ++v) {
        if (!is_used[v]) continue;
        repeated += is_met[first[v]];
        is_met[first[v]] = true;
    }
    return repeated;
}

class Examiner {
public:
    explicit Examiner(const MeshView& mesh)
        : mesh_(mesh), place_(find_first_at_place(mesh.positions)), is_used_(mesh.positions.size(), false) {}

    Examination examine() {
        look_at_vertices();
        look_at_triangles();
        look_at_edges();
        return found_;
    }

private:
    void look_at_vertices() {
        constexpr double infinity = std::numeric_limits<double>::infinity();
        glm::dvec3 low(infinity), high(-infinity);
        for (const Triangle& t : mesh_.triangles)
            for (const Index v : t) is_used_[v] = true;
        for (std::size_t v = 0; v < is_used_.size(); ++v) {
            if (!is_used_[v]) {
                ++found_.unreferenced_vertices;
                continue;
            }
            low = glm::min(low, mesh_.positions[v]);
            high = glm::max(high, mesh_.positions[v]);
        }
        if (!mesh_.triangles.empty()) {
            found_.low = low;
            found_.high = high;
        }
        found_.is_unwelded = meshio::is_unwelded(mesh_);
        found_.coincident_vertices = count_repeated(place_, is_used_);
        if (found_.coincident_vertices > 0)
            found_.duplicate_vertices = count_repeated(find_first_equal_vertex(mesh_), is_used_);
    }

    void look_at_triangles() {
        scale_to_one();
        for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) found_.degenerate_triangles += has_no_area(t);
        std::vector<Triangle> sorted(mesh_.triangles.size());
        for (std::size_t t = 0; t < sorted.size(); ++t) {
            sorted[t] = places(t);
            std::sort(sorted[t].begin(), sorted[t].end());
        }
        const std::vector<Index> first = find_first_same(
            sorted.size(),
            [&](SeededHash& hash, std::size_t t) {
                for (const Index place : sorted[t]) hash.add(place);
            },
            [&](std::size_t a, std::size_t b) { return sorted[a] == sorted[b]; });
        for (std::size_t t = 0; t < first.size(); ++t)
            found_.duplicate_triangles += first[t] != t && !uses_a_vertex_twice(places(t));
    }

    // By a power of two, so that products neither overflow nor vanish.
    void scale_to_one() {
        const glm::dvec3 most = glm::max(glm::abs(found_.low), glm::abs(found_.high));
        const double largest = std::max({most.x, most.y, most.z});
        scale_ = largest > 0 ? std::ldexp(1.0, std::min(1000, -std::ilogb(largest))) : 1.0;
    }

    glm::dvec3 at(Index place) const { return mesh_.positions[place] * scale_; }
    Triangle places(std::size_t t) const {
        const Triangle& v = mesh_.triangles[t];
        return {place_[v[0]], place_[v[1]], place_[v[2]]};
    }

    bool has_no_area(std::size_t t) const {
        constexpr double rounding = 8 * std::numeric_limits<double>::epsilon();
        const Triangle corners = places(t);
        if (uses_a_vertex_twice(corners)) return true;
        const glm::dvec3 ab = at(corners[1]) - at(corners[0]), ac = at(corners[2]) - at(corners[0]);
        return glm::length(glm::cross(ab, ac)) <= rounding * std::max(glm::dot(ab, ab), glm::dot(ac, ac));
    }

    // A triangle's side, filed under the lower of its two places.
    struct Side {
        Index higher;
        bool runs_up;         // from the lower place to the higher one
        std::uint64_t at_low; // its corners there: 3 * triangle + 0..2
        std::uint64_t at_high;
    };

    void look_at_edges() {
        const std::size_t triangles = mesh_.triangles.size();
        DisjointSets parts(triangles), fans(3 * triangles);
        std::vector<bool> is_open(triangles, false); // the component of this triangle
        std::vector<std::pair<Index, Index>> boundary;

        // Sides by their lower place: counted, then laid out.
        std::vector<std::uint64_t> start(mesh_.positions.size() + 1, 0);
        for_each_side([&](Index low, const Side&) { ++start[low]; });
        std::exclusive_scan(start.begin(), start.end(), start.begin(), std::uint64_t{0});
        std::vector<Side> sides(start.back());
        for_each_side([&](Index low, const Side& side) { sides[start[low]++] = side; });

        std::size_t begin = 0;
        for (std::size_t low = 0; low + 1 < start.size(); ++low) { // start[low] is where its sides end by now
            const std::span<Side> of_low(sides.data() + begin, start[low] - begin);
            begin = start[low];
            std::sort(of_low.begin(), of_low.end(), [](const Side& a, const Side& b) {
                return a.higher != b.higher ? a.higher < b.higher : a.at_low < b.at_low;
            });
            for (std::size_t i = 0, end = 0; i < of_low.size(); i = end) {
                while (end < of_low.size() && of_low[end].higher == of_low[i].higher) ++end;
                const std::span<const Side> edge = of_low.subspan(i, end - i);
                if (!count_edge(edge)) is_open[edge.front().at_low / 3] = true;
                if (edge.size() == 1) boundary.emplace_back(static_cast<Index>(low), edge.front().higher);
                for (const Side& side : edge.subspan(1)) {
                    parts.join(edge.front().at_low / 3, side.at_low / 3);
                    fans.join(edge.front().at_low, side.at_low);
                    fans.join(edge.front().at_high, side.at_high);
                }
            }
        }
        count_loops(boundary);
        count_split_vertices(fans);
        count_components(parts, is_open);
    }

    template <class Body>
    void for_each_side(Body&& body) const {
        for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
            const Triangle corners = places(t);
            if (uses_a_vertex_twice(corners)) continue;
            for (std::size_t k = 0; k < 3; ++k) {
                const std::size_t next = (k + 1) % 3;
                const bool runs_up = corners[k] < corners[next];
                const auto from = std::uint64_t{3} * t + k, to = std::uint64_t{3} * t + next;
                if (runs_up) body(corners[k], Side{corners[next], true, from, to});
                else body(corners[next], Side{corners[k], false, to, from});
            }
        }
    }

    // True where it has two triangles in opposite directions.
    bool count_edge(std::span<const Side> edge) {
        const bool is_inconsistent = edge.size() == 2 && edge[0].runs_up == edge[1].runs_up;
        found_.boundary_edges += edge.size() == 1;
        found_.non_manifold_edges += edge.size() > 2;
        found_.inconsistent_edges += is_inconsistent;
        return edge.size() == 2 && !is_inconsistent;
    }

    void count_loops(const std::vector<std::pair<Index, Index>>& boundary) {
        if (boundary.empty()) return;
        DisjointSets loops(mesh_.positions.size());
        for (const auto& [a, b] : boundary) loops.join(a, b);
        std::vector<bool> is_met(mesh_.positions.size(), false);
        for (const auto& [a, b] : boundary) {
            const std::size_t loop = loops.root(a);
            found_.boundary_loops += !is_met[loop];
            is_met[loop] = true;
        }
    }

    void count_split_vertices(DisjointSets& fans) {
        std::vector<bool> has_fan(mesh_.positions.size(), false), is_split(mesh_.positions.size(), false);
        for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
            const Triangle corners = places(t);
            if (uses_a_vertex_twice(corners)) continue;
            for (std::size_t k = 0; k < 3; ++k) {
                if (fans.root(3 * t + k) != 3 * t + k) continue;
                if (has_fan[corners[k]]) is_split[corners[k]] = true;
                has_fan[corners[k]] = true;
            }
        }
        found_.non_manifold_vertices = static_cast<std::uint64_t>(std::count(is_split.begin(), is_split.end(), true));
    }

    void count_components(DisjointSets& parts, std::vector<bool>& is_open) {
        constexpr double rounding = 1e-12; // of the sum of the volumes' sizes
        struct Volume {
            double sum = 0, sizes = 0;
        };
        const std::size_t triangles = mesh_.triangles.size();
        for (std::size_t t = 0; t < triangles; ++t)
            if (is_open[t]) is_open[parts.root(t)] = true;
        std::vector<Volume> volumes(triangles);
        for (std::size_t t = 0; t < triangles; ++t) {
            const Triangle corners = places(t);
            const std::size_t part = parts.root(t);
            if (uses_a_vertex_twice(corners) || is_open[part]) continue;
            const glm::dvec3 origin = at(places(part)[0]); // near by, for the sake of precision
            const double volume =
                glm::dot(at(corners[0]) - origin, glm::cross(at(corners[1]) - origin, at(corners[2]) - origin));
            volumes[part].sum += volume;
            volumes[part].sizes += std::abs(volume);
        }
        for (std::size_t t = 0; t < triangles; ++t) {
            if (parts.root(t) != t || uses_a_vertex_twice(places(t))) continue;
            ++found_.components;
            if (is_open[t]) continue;
            ++found_.closed_components;
            found_.inside_out_components += volumes[t].sum < -rounding * volumes[t].sizes;
        }
    }

    const MeshView& mesh_;
    const std::vector<Index> place_; // the first vertex there
    std::vector<bool> is_used_;
    double scale_ = 1;
    Examination found_;
};

} // namespace

Result<Examination> examine(const MeshView& mesh) {
    if (const Result<void> valid = validate(mesh); !valid) return valid.error();
    if (mesh.triangles.size() > std::numeric_limits<Index>::max())
        return Error{ErrorCode::unsupported, "The mesh has more triangles than 32 bits can number; split it."};
    return Examiner(mesh).examine();
}

bool is_unwelded(const MeshView& mesh) {
    if (mesh.triangles.size() < 2) return false;
    std::vector<bool> is_used(mesh.positions.size(), false);
    for (const Triangle& t : mesh.triangles) {
        for (const Index v : t) {
            if (is_used[v]) return false; // soon, in a mesh that is welded
            is_used[v] = true;
        }
    }
    return count_repeated(find_first_at_place(mesh.positions), is_used) > 0;
}

} // namespace unseen::meshio
