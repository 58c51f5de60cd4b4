#include "surface.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include <glm/geometric.hpp>
#include <tbb/parallel_sort.h>

#include "unit_vector.h"

namespace unseen::vdtree {

namespace {

glm::dvec3 area_vector(const MeshView& mesh, const Triangle& t) {
    const glm::dvec3& a = mesh.positions[t[0]];
    return glm::cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a) * 0.5;
}

bool has_length(glm::vec3 v) {
    const float sum = std::abs(v.x) + std::abs(v.y) + std::abs(v.z);
    return sum > 0 && std::isfinite(sum);
}

// A directed edge between welded vertices, sortable so that all uses of one undirected edge are neighbours.
struct EdgeUse {
    Index low, high;
    bool forward; // from low to high
    bool operator<(const EdgeUse& o) const { return std::tie(low, high, forward) < std::tie(o.low, o.high, o.forward); }
};

std::vector<EdgeUse> edge_uses(const MeshView& mesh, std::span<const Index> coincident) {
    std::vector<EdgeUse> uses;
    uses.reserve(mesh.triangles.size() * 3);
    for (const Triangle& t : mesh.triangles) {
        const Triangle w = {coincident[t[0]], coincident[t[1]], coincident[t[2]]};
        if (w[0] == w[1] || w[1] == w[2] || w[2] == w[0]) continue;
        for (std::size_t k = 0; k < 3; ++k) {
            const Index from = w[k], to = w[(k + 1) % 3];
            uses.push_back({std::min(from, to), std::max(from, to), from < to});
        }
    }
    tbb::parallel_sort(uses.begin(), uses.end());
    return uses;
}

double signed_volume(const MeshView& mesh) {
    const glm::dvec3 origin = mesh.positions[mesh.triangles[0][0]];
    double volume = 0;
    for (const Triangle& t : mesh.triangles)
        volume += glm::dot(mesh.positions[t[0]] - origin, area_vector(mesh, t)) / 3;
    return volume;
}

} // namespace

std::vector<Index> find_coincident(std::span<const glm::dvec3> positions) {
    std::vector<Index> order(positions.size()), first(positions.size());
    std::iota(order.begin(), order.end(), Index{0});
    std::iota(first.begin(), first.end(), Index{0});
    tbb::parallel_sort(order.begin(), order.end(), [&](Index a, Index b) {
        const glm::dvec3 &p = positions[a], &q = positions[b];
        if (p.x != q.x) return p.x < q.x;
        if (p.y != q.y) return p.y < q.y;
        return p.z != q.z ? p.z < q.z : a < b;
    });
    for (std::size_t i = 1; i < order.size(); ++i)
        if (positions[order[i]] == positions[order[i - 1]]) first[order[i]] = first[order[i - 1]];
    return first;
}

SurfaceTopology analyse_topology(const MeshView& mesh, std::span<const Index> coincident) {
    SurfaceTopology topology;
    topology.irregular.assign(mesh.positions.size(), 0);
    const std::vector<EdgeUse> uses = edge_uses(mesh, coincident);
    bool regular = true;
    for (std::size_t i = 0; i < uses.size();) {
        std::size_t j = i + 1;
        while (j < uses.size() && uses[j].low == uses[i].low && uses[j].high == uses[i].high) ++j;
        const bool is_regular = j - i == 2 && uses[i].forward != uses[i + 1].forward;
        if (!is_regular) {
            topology.irregular[uses[i].low] = topology.irregular[uses[i].high] = 1;
            regular = false;
        }
        i = j;
    }
    // A vertex is as irregular as the position that it shares.
    for (std::size_t v = 0; v < coincident.size(); ++v) topology.irregular[v] = topology.irregular[coincident[v]];
    if (regular && !uses.empty()) {
        const double volume = signed_volume(mesh);
        if (volume > 0) topology.closedness = Closedness::closed_outward;
        if (volume < 0) topology.closedness = Closedness::closed_inward;
    }
    return topology;
}

std::vector<double> vertex_areas(const MeshView& mesh) {
    std::vector<double> areas(mesh.positions.size(), 0);
    for (const Triangle& t : mesh.triangles) {
        const double share = glm::length(area_vector(mesh, t)) / 3;
        for (const Index v : t) areas[v] += share;
    }
    return areas;
}

std::vector<glm::vec3> vertex_normals(const MeshView& mesh, std::span<const Index> coincident, Closedness closedness) {
    std::vector<glm::dvec3> sums(mesh.positions.size(), glm::dvec3(0));
    double agreement = 0; // of the mesh's own normals with its faces
    for (const Triangle& t : mesh.triangles) {
        const glm::dvec3 area = area_vector(mesh, t);
        for (const Index v : t) {
            sums[coincident[v]] += area;
            if (!mesh.normals.empty() && has_length(mesh.normals[v]))
                agreement += glm::dot(area, unit(glm::dvec3(mesh.normals[v])));
        }
    }
    const bool inward = closedness == Closedness::closed_inward;
    const double face_sign = inward ? -1 : 1;
    const double own_sign = inward && agreement > 0 ? -1 : 1;
    std::vector<glm::vec3> normals(mesh.positions.size());
    for (std::size_t v = 0; v < normals.size(); ++v) {
        const bool own = !mesh.normals.empty() && has_length(mesh.normals[v]);
        normals[v] = glm::vec3(own ? own_sign * unit(glm::dvec3(mesh.normals[v])) : face_sign * unit(sums[coincident[v]]));
    }
    return normals;
}

} // namespace unseen::vdtree
