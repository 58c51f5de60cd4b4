#include "build/surface.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numeric>
#include <utility>

#include <glm/geometric.hpp>
#include <tbb/parallel_reduce.h>
#include <tbb/task_arena.h>

#include <unseen/vdtree/internal/parallel.h>

#include "build/parallel_array.h"
#include "tree/unit_vector.h"

namespace unseen::vdtree {

namespace {

constexpr std::size_t grain =
    4096; // vertices or triangles of a task; sums are added up by these, on any number of threads

glm::dvec3 area_vector(const MeshView& mesh, const Triangle& t) {
    const glm::dvec3& a = mesh.positions[t[0]];
    return glm::cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a) * 0.5;
}

bool has_length(glm::vec3 v) {
    const float sum = std::abs(v.x) + std::abs(v.y) + std::abs(v.z);
    return sum > 0 && std::isfinite(sum);
}

// The sum of f(0) .. f(count - 1), the same on any number of threads.
template <class F>
double sum(std::size_t count, F&& f) {
    const TaskOrder order;
    return tbb::parallel_deterministic_reduce(
        tbb::blocked_range<std::size_t>(0, count, grain), 0.0,
        [&](const tbb::blocked_range<std::size_t>& range, double total) {
            const TaskOrder::Task task(order);
            for (std::size_t i = range.begin(); i < range.end(); ++i) total += f(i);
            return total;
        },
        std::plus<double>());
}

double signed_volume(const MeshView& mesh) {
    const glm::dvec3 origin = mesh.positions[mesh.triangles[0][0]];
    return sum(mesh.triangles.size(), [&](std::size_t t) {
        const Triangle& corners = mesh.triangles[t];
        return glm::dot(mesh.positions[corners[0]] - origin, area_vector(mesh, corners)) / 3;
    });
}

// ---- coincident vertices

std::uint64_t hash(glm::dvec3 p) {
    // Adding 0 makes one zero of two.
    const auto bits = [](double x) { return std::bit_cast<std::uint64_t>(x + 0.0); };
    const auto mix = [](std::uint64_t h) {
        h ^= h >> 32;
        h *= 0xd6e8feb86659fd93u;
        return h ^ (h >> 32);
    };
    return mix(bits(p.x) + mix(bits(p.y) + mix(bits(p.z)) * 3) * 5);
}

// A vertex and 32 bits of its position's hash: where these differ, the positions need not be looked at.
struct HashedVertex {
    std::uint32_t hash;
    Index vertex;
};

// Vertices whose hashes begin alike, ascending: finds the first at each position. Positions made to collide would fill
// the table in quadratic time; they are sorted instead.
class CoincidenceFinder {
public:
    CoincidenceFinder(std::span<const glm::dvec3> positions, std::span<Index> first)
        : positions_(positions), first_(first) {}

    void find(std::span<const HashedVertex> vertices) {
        if (!by_table(vertices)) by_sorting(vertices);
    }

private:
    bool by_table(std::span<const HashedVertex> vertices) {
        constexpr std::size_t most_probes = 16; // a vertex, on average
        constexpr Index none = ~Index{0};
        const std::size_t size = std::bit_ceil(vertices.size() * 2 + 1);
        table_.assign(size, {0, none});
        std::size_t probes = 0;
        for (const HashedVertex& v : vertices) {
            std::size_t slot = v.hash & (size - 1);
            while (table_[slot].vertex != none &&
                   !(table_[slot].hash == v.hash && positions_[table_[slot].vertex] == positions_[v.vertex])) {
                slot = (slot + 1) & (size - 1);
                if (++probes > most_probes * vertices.size()) return false;
            }
            if (table_[slot].vertex == none) table_[slot] = v;
            first_[v.vertex] = table_[slot].vertex;
        }
        return true;
    }

    void by_sorting(std::span<const HashedVertex> vertices) {
        std::vector<Index> order;
        for (const HashedVertex& v : vertices) order.push_back(v.vertex);
        std::sort(order.begin(), order.end(), [&](Index a, Index b) {
            const glm::dvec3 &p = positions_[a], &q = positions_[b];
            if (p.x != q.x) return p.x < q.x;
            if (p.y != q.y) return p.y < q.y;
            return p.z != q.z ? p.z < q.z : a < b;
        });
        for (std::size_t i = 0; i < order.size(); ++i) {
            const bool same = i > 0 && positions_[order[i]] == positions_[order[i - 1]];
            first_[order[i]] = same ? first_[order[i - 1]] : order[i];
        }
    }

    std::span<const glm::dvec3> positions_;
    std::span<Index> first_;
    std::vector<HashedVertex> table_;
};

// ---- around each position

// Which vertices stand for corners: themselves where no two coincide, which needs no look.
class Places {
public:
    explicit Places(std::span<const Index> coincident) : coincident_(coincident) {
        for (Index v = 0; v < coincident.size() && !any_; ++v) any_ = coincident[v] != v;
    }
    Index of(Index vertex) const { return any_ ? coincident_[vertex] : vertex; }
    Triangle of(const Triangle& t) const {
        return any_ ? Triangle{coincident_[t[0]], coincident_[t[1]], coincident_[t[2]]} : t;
    }
    // Precondition: the triangle uses no vertex twice.
    bool degenerates(const Triangle& t) const {
        if (!any_) return false;
        const Triangle w = of(t);
        return w[0] == w[1] || w[1] == w[2] || w[2] == w[0];
    }

private:
    std::span<const Index> coincident_;
    bool any_ = false;
};

// The other corners of a triangle at a place: the following and the preceding one.
struct Wedge {
    Index following, preceding;
};

// What is collected at the places: the wedges of the triangles there, and the sum of these triangles' area
// vectors, twice.
struct Wedges {
    std::vector<Index> start; // one longer
    ParallelArray<Wedge> wedges;
    std::vector<glm::dvec3> sums;

    std::span<const Wedge> around(std::size_t place) const {
        return std::span<const Wedge>(wedges).subspan(start[place], start[place + 1] - start[place]);
    }
};

// Triangles that the welding degenerates have neither edges nor an area. Adds to `vertex_areas`, by vertex.
Wedges collect_wedges(const MeshView& mesh, const Places& places, std::span<double> vertex_areas) {
    const std::size_t vertices = vertex_areas.size();
    Wedges out;
    out.start.assign(vertices + 1, 0);
    out.sums.assign(vertices, glm::dvec3(0));
    // Each thread looks at all triangles, for a range of the places: they are soon seen, and collecting is what takes
    // time. All sums are made in the order of the triangles.
    constexpr int most_ranges = 8;
    const auto ranges = static_cast<std::size_t>(std::min(tbb::this_task_arena::max_concurrency(), most_ranges));
    const auto for_each_triangle = [&](auto&& use) {
        parallel_loop(std::size_t{0}, ranges, [&](std::size_t r) {
            const std::size_t begin = vertices * r / ranges, size = vertices * (r + 1) / ranges - begin;
            const auto is_own = [&](std::size_t place) { return place - begin < size; };
            for (const Triangle& corners : mesh.triangles) {
                const Triangle at = places.of(corners);
                if (std::ranges::any_of(at, is_own) && !places.degenerates(corners)) use(is_own, corners, at);
            }
        });
    };
    for_each_triangle([&](const auto& is_own, const Triangle&, const Triangle& at) {
        for (const Index place : at)
            if (is_own(place)) ++out.start[place];
    });
    std::partial_sum(out.start.begin(), out.start.end(), out.start.begin());
    out.wedges = ParallelArray<Wedge>(out.start.back(), Unfilled());
    for_each_triangle([&](const auto& is_own, const Triangle& corners, const Triangle& at) {
        const glm::dvec3& a = mesh.positions[corners[0]];
        const glm::dvec3 vector = glm::cross(mesh.positions[corners[1]] - a, mesh.positions[corners[2]] - a);
        const double sixth = glm::length(vector) / 6; // what each corner has of the triangle's area
        for (std::size_t k = 0; k < 3; ++k) {
            if (!is_own(at[k])) continue;
            out.wedges[--out.start[at[k]]] = {at[(k + 1) % 3], at[(k + 2) % 3]};
            out.sums[at[k]] += vector;
            vertex_areas[corners[k]] += sixth;
        }
    });
    return out;
}

// Looks at the wedges around one place after another.
class Fan {
public:
    // Whether every edge at the place has two triangles that run it in opposite ways: each neighbour follows once and
    // precedes once.
    bool is_regular(Index place, std::span<const Wedge> wedges) {
        const std::uint64_t stamp = std::uint64_t{place} << 32;
        for (const Wedge& wedge : wedges) {
            std::uint64_t& seen = slot(wedge.following);
            if ((seen & stamp_mask) == stamp) return is_regular_by_sorting(wedges); // seen twice, or two in one slot
            seen = stamp | wedge.following;
        }
        for (const Wedge& wedge : wedges) {
            std::uint64_t& seen = slot(wedge.preceding);
            if (seen != (stamp | wedge.preceding)) return false;
            seen = stamp | nobody; // only once
        }
        return true;
    }

private:
    static constexpr unsigned slot_bits = 8; // few neighbours rarely meet in so many
    static constexpr std::uint64_t nobody = ~Index{0}, stamp_mask = ~nobody;

    std::uint64_t& slot(Index v) { return slots_[v * 0x9e3779b1u >> (32 - slot_bits)]; }

    bool is_regular_by_sorting(std::span<const Wedge> wedges) {
        following_.clear();
        preceding_.clear();
        for (const Wedge& wedge : wedges) {
            following_.push_back(wedge.following);
            preceding_.push_back(wedge.preceding);
        }
        std::sort(following_.begin(), following_.end());
        std::sort(preceding_.begin(), preceding_.end());
        return following_ == preceding_ && std::adjacent_find(following_.begin(), following_.end()) == following_.end();
    }

    std::vector<Index> following_, preceding_;
    // Neighbours in the lower halves, stamped with the place that they were seen at; no place has the stamp of the
    // others.
    std::array<std::uint64_t, 1 << slot_bits> slots_ = [] {
        std::array<std::uint64_t, 1 << slot_bits> none;
        none.fill(~std::uint64_t{0});
        return none;
    }();
};

// How well the mesh's own normals agree with its faces: positive where they do.
double agreement_of_own_normals(const MeshView& mesh) {
    if (mesh.normals.empty()) return 0;
    return sum(mesh.triangles.size(), [&](std::size_t t) {
        const glm::dvec3 area = area_vector(mesh, mesh.triangles[t]);
        double agreement = 0;
        for (const Index v : mesh.triangles[t])
            if (has_length(mesh.normals[v])) agreement += glm::dot(area, unit(glm::dvec3(mesh.normals[v])));
        return agreement;
    });
}

Closedness find_closedness(const MeshView& mesh, std::span<const Index> coincident, const Surface& surface) {
    const bool regular = std::find(surface.irregular.begin(), surface.irregular.end(), 1) == surface.irregular.end();
    if (!regular) return Closedness::open;
    const bool has_edges = std::any_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const Triangle& t) {
        const Index a = coincident[t[0]], b = coincident[t[1]], c = coincident[t[2]];
        return a != b && b != c && c != a;
    });
    if (!has_edges) return Closedness::open;
    const double volume = signed_volume(mesh);
    return volume > 0 ? Closedness::closed_outward : volume < 0 ? Closedness::closed_inward : Closedness::open;
}

// By place: regularity and the sum of the faces; by vertex: areas.
Surface survey(const MeshView& mesh, std::span<const Index> coincident) {
    Surface surface;
    surface.irregular.assign(coincident.size(), 0);
    surface.areas.assign(coincident.size(), 0);
    surface.normals.resize(coincident.size());
    const Wedges wedges = collect_wedges(mesh, Places(coincident), surface.areas);
    parallel_loop_over(tbb::blocked_range<std::size_t>(0, coincident.size(), grain), [&](const auto& places) {
        Fan fan;
        for (std::size_t place = places.begin(); place < places.end(); ++place) {
            if (coincident[place] != place) continue;
            surface.irregular[place] = !fan.is_regular(static_cast<Index>(place), wedges.around(place));
            surface.normals[place] = glm::vec3(unit(wedges.sums[place]));
        }
    });
    return surface;
}

} // namespace

std::vector<Index> find_coincident(std::span<const glm::dvec3> positions) {
    // In groups by the upper bits of a hash, which fit the caches and are independent of each other.
    constexpr unsigned group_bits = 6;
    constexpr std::size_t groups = 1u << group_bits;
    std::vector<std::uint64_t> hashes(positions.size());
    const auto group_of = [&](std::size_t v) { return hashes[v] >> (64 - group_bits); };
    const std::size_t chunks = (positions.size() + grain - 1) / grain;
    const auto end_of = [&](std::size_t chunk) { return std::min(positions.size(), (chunk + 1) * grain); };
    std::vector<std::array<Index, groups>> places(chunks); // by chunk and group: how many, then where the next one goes
    parallel_loop(std::size_t{0}, chunks, [&](std::size_t chunk) {
        places[chunk].fill(0);
        for (std::size_t v = chunk * grain; v < end_of(chunk); ++v) {
            hashes[v] = hash(positions[v]);
            ++places[chunk][group_of(v)];
        }
    });
    std::array<Index, groups + 1> start{};
    Index total = 0;
    for (std::size_t g = 0; g < groups; ++g) {
        start[g] = total;
        for (auto& counts : places) total += std::exchange(counts[g], total);
    }
    start[groups] = total;
    std::vector<HashedVertex> grouped(positions.size());
    parallel_loop(std::size_t{0}, chunks, [&](std::size_t chunk) {
        for (std::size_t v = chunk * grain; v < end_of(chunk); ++v)
            grouped[places[chunk][group_of(v)]++] = {static_cast<std::uint32_t>(hashes[v]), static_cast<Index>(v)};
    });
    std::vector<Index> first(positions.size());
    parallel_loop(std::size_t{0}, groups, [&](std::size_t g) {
        CoincidenceFinder(positions, first).find(std::span(grouped).subspan(start[g], start[g + 1] - start[g]));
    });
    return first;
}

Surface analyse_surface(const MeshView& mesh, std::span<const Index> coincident) {
    Surface surface = survey(mesh, coincident);
    // From what is known by place to what is known by vertex.
    const std::size_t vertices = coincident.size();
    surface.closedness = find_closedness(mesh, coincident, surface);
    const bool inward = surface.closedness == Closedness::closed_inward;
    const float face_sign = inward ? -1 : 1;
    const double own_sign = inward && agreement_of_own_normals(mesh) > 0 ? -1 : 1;
    // A vertex is as irregular as the position that it shares. Those that stand for their positions come last, for the
    // others read them.
    const auto spread = [&](bool standing) {
        parallel_loop_over(tbb::blocked_range<std::size_t>(0, vertices, grain), [&](const auto& range) {
            for (std::size_t v = range.begin(); v < range.end(); ++v) {
                const Index place = coincident[v];
                if ((place == v) != standing) continue;
                surface.irregular[v] = surface.irregular[place];
                const bool own = !mesh.normals.empty() && has_length(mesh.normals[v]);
                surface.normals[v] =
                    own ? glm::vec3(own_sign * unit(glm::dvec3(mesh.normals[v]))) : face_sign * surface.normals[place];
            }
        });
    };
    spread(false);
    spread(true);
    return surface;
}

} // namespace unseen::vdtree
