#include "surface.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include <glm/geometric.hpp>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include "unit_vector.h"

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
    return tbb::parallel_deterministic_reduce(
        tbb::blocked_range<std::size_t>(0, count, grain), 0.0,
        [&](const tbb::blocked_range<std::size_t>& range, double total) {
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

// The vertices whose hash begins alike, ascending: finds the first at each position. Positions made to collide would fill the
// table in quadratic time; they are sorted instead.
class CoincidenceFinder {
public:
    CoincidenceFinder(std::span<const glm::dvec3> positions, std::span<Index> first)
        : positions_(positions), first_(first) {}

    void find(std::span<const Index> vertices) {
        if (!by_table(vertices)) by_sorting(vertices);
    }

private:
    bool by_table(std::span<const Index> vertices) {
        constexpr std::size_t most_probes = 16; // a vertex, on average
        constexpr Index none = ~Index{0};
        const std::size_t size = std::bit_ceil(vertices.size() * 2 + 1);
        table_.assign(size, none);
        std::size_t probes = 0;
        for (const Index v : vertices) {
            std::size_t slot = hash(positions_[v]) & (size - 1);
            while (table_[slot] != none && positions_[table_[slot]] != positions_[v]) {
                slot = (slot + 1) & (size - 1);
                if (++probes > most_probes * vertices.size()) return false;
            }
            if (table_[slot] == none) table_[slot] = v;
            first_[v] = table_[slot];
        }
        return true;
    }

    void by_sorting(std::span<const Index> vertices) {
        std::vector<Index> order(vertices.begin(), vertices.end());
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
    std::vector<Index> table_;
};

// ---- around each position

// By vertex that stands for its position: the triangles there, ascending.
struct Incidence {
    std::vector<Index> start, triangles;
    std::span<const Index> around(std::size_t v) const {
        return std::span(triangles).subspan(start[v], start[v + 1] - start[v]);
    }
};

Incidence find_incidence(const MeshView& mesh, std::span<const Index> coincident) {
    Incidence incidence;
    incidence.start.assign(mesh.positions.size() + 1, 0);
    for (const Triangle& t : mesh.triangles)
        for (const Index v : t) ++incidence.start[coincident[v]];
    std::partial_sum(incidence.start.begin(), incidence.start.end(), incidence.start.begin());
    incidence.triangles.resize(mesh.triangles.size() * 3);
    for (std::size_t t = mesh.triangles.size(); t-- > 0;)
        for (const Index v : mesh.triangles[t])
            incidence.triangles[--incidence.start[coincident[v]]] = static_cast<Index>(t);
    return incidence;
}

// Whether every edge at the vertices around which `out` follow and `in` precede has two triangles that run it in opposite ways:
// each neighbour follows once and precedes once.
bool is_regular(std::vector<Index>& out, std::vector<Index>& in) {
    constexpr std::size_t few = 16;
    if (out.size() > few) {
        std::sort(out.begin(), out.end());
        std::sort(in.begin(), in.end());
        return out == in && std::adjacent_find(out.begin(), out.end()) == out.end();
    }
    for (std::size_t i = 0; i < out.size(); ++i) {
        int followed = 0, preceded = 0;
        for (std::size_t k = 0; k < out.size(); ++k) {
            followed += out[k] == out[i];
            preceded += in[k] == out[i];
        }
        if (followed != 1 || preceded != 1) return false;
    }
    return true;
}

// Looks at one position after another.
class SurfaceWorker {
public:
    SurfaceWorker(const MeshView& mesh, std::span<const Index> coincident, const Incidence& incidence, Surface& surface)
        : mesh_(mesh), coincident_(coincident), incidence_(incidence), surface_(surface) {}

    void operator()(std::size_t v) {
        following_.clear(), preceding_.clear();
        const glm::dvec3 here = mesh_.positions[v];
        glm::dvec3 sum(0);
        for (const Index t : incidence_.around(v)) {
            const Triangle& corners = mesh_.triangles[t];
            const Triangle w = {coincident_[corners[0]], coincident_[corners[1]], coincident_[corners[2]]};
            if (w[0] == w[1] || w[1] == w[2] || w[2] == w[0]) continue; // it has neither edges nor an area
            const std::size_t k = w[0] == v ? 0 : w[1] == v ? 1 : 2;
            following_.push_back(w[(k + 1) % 3]);
            preceding_.push_back(w[(k + 2) % 3]);
            const glm::dvec3 area =
                glm::cross(mesh_.positions[corners[(k + 1) % 3]] - here, mesh_.positions[corners[(k + 2) % 3]] - here);
            sum += area;
            surface_.areas[corners[k]] += glm::length(area) / 6;
        }
        surface_.irregular[v] = !is_regular(following_, preceding_);
        surface_.normals[v] = glm::vec3(unit(sum));
    }

private:
    const MeshView& mesh_;
    std::span<const Index> coincident_;
    const Incidence& incidence_;
    Surface& surface_;
    std::vector<Index> following_, preceding_;
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

} // namespace

std::vector<Index> find_coincident(std::span<const glm::dvec3> positions) {
    // In groups by the upper bits of a hash, which fit the caches and are independent of each other.
    constexpr unsigned group_bits = 6;
    constexpr std::size_t groups = 1u << group_bits;
    const auto group_of = [&](std::size_t v) { return hash(positions[v]) >> (64 - group_bits); };
    const std::size_t chunks = (positions.size() + grain - 1) / grain;
    const auto end_of = [&](std::size_t chunk) { return std::min(positions.size(), (chunk + 1) * grain); };
    std::vector<std::array<Index, groups>> places(chunks); // by chunk and group: how many, then where the next one goes
    tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t chunk) {
        places[chunk].fill(0);
        for (std::size_t v = chunk * grain; v < end_of(chunk); ++v) ++places[chunk][group_of(v)];
    });
    std::array<Index, groups + 1> start{};
    Index total = 0;
    for (std::size_t g = 0; g < groups; ++g) {
        start[g] = total;
        for (auto& counts : places) total += std::exchange(counts[g], total);
    }
    start[groups] = total;
    std::vector<Index> grouped(positions.size()), first(positions.size());
    tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t chunk) {
        for (std::size_t v = chunk * grain; v < end_of(chunk); ++v)
            grouped[places[chunk][group_of(v)]++] = static_cast<Index>(v);
    });
    tbb::parallel_for(std::size_t{0}, groups, [&](std::size_t g) {
        CoincidenceFinder(positions, first).find(std::span(grouped).subspan(start[g], start[g + 1] - start[g]));
    });
    return first;
}

Surface analyse_surface(const MeshView& mesh, std::span<const Index> coincident) {
    const std::size_t vertices = mesh.positions.size();
    Surface surface;
    surface.irregular.assign(vertices, 0);
    surface.areas.assign(vertices, 0);
    surface.normals.resize(vertices);
    {
        const Incidence incidence = find_incidence(mesh, coincident);
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, vertices, grain), [&](const auto& range) {
            SurfaceWorker worker(mesh, coincident, incidence, surface);
            for (std::size_t v = range.begin(); v < range.end(); ++v)
                if (coincident[v] == v) worker(v);
        });
    }
    surface.closedness = find_closedness(mesh, coincident, surface);
    const bool inward = surface.closedness == Closedness::closed_inward;
    const float face_sign = inward ? -1 : 1;
    const double own_sign = inward && agreement_of_own_normals(mesh) > 0 ? -1 : 1;
    // A vertex is as irregular as the position that it shares. Those that stand for their positions come before the others.
    for (std::size_t v = vertices; v-- > 0;) {
        const Index place = coincident[v];
        surface.irregular[v] = surface.irregular[place];
        const bool own = !mesh.normals.empty() && has_length(mesh.normals[v]);
        surface.normals[v] =
            own ? glm::vec3(own_sign * unit(glm::dvec3(mesh.normals[v]))) : face_sign * surface.normals[place];
    }
    return surface;
}

} // namespace unseen::vdtree
