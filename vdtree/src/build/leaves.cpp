#include "build/leaves.h"

#include <atomic>
#include <map>
#include <numeric>
#include <tuple>

#include "build/surface.h"
#include <unseen/vdtree/internal/parallel.h>

namespace unseen::vdtree {

PlaceMesh::PlaceMesh(const MeshView& source) : source_(source) {
    const std::vector<Index> coincident = find_coincident(source.positions);
    keep_triangles(coincident);
    number_places(coincident);
    find_materials();
}

void PlaceMesh::keep_triangles(std::span<const Index> coincident) {
    const auto is_degenerate = [&](const Triangle& t) {
        return uses_a_vertex_twice({coincident[t[0]], coincident[t[1]], coincident[t[2]]});
    };
    const auto& all = source_.triangles;
    dropped_ = static_cast<std::uint64_t>(std::ranges::count_if(all, is_degenerate));
    if (dropped_ == 0) return;
    kept_.reserve(all.size() - dropped_);
    for (std::size_t t = 0; t < all.size(); ++t)
        if (!is_degenerate(all[t])) kept_.push_back(static_cast<Index>(t));
}

void PlaceMesh::number_places(std::span<const Index> coincident) {
    const std::size_t vertices = source_.positions.size(), count = source_.triangles.size() - dropped_;
    std::vector<std::uint8_t> used(vertices, 0);
    for (std::size_t t = 0; t < count; ++t)
        for (const Index v : source_corners(static_cast<Index>(t))) {
            is_split_ |= coincident[v] != v;
            used[coincident[v]] = 1;
        }
    const bool all_used = std::ranges::find(used, 0) == used.end();
    if (all_used && dropped_ == 0) { // then nothing coincides, either
        mesh_ = {.positions = source_.positions, .triangles = source_.triangles};
        return;
    }
    std::vector<Index> place(vertices, 0);
    for (std::size_t v = 0; v < vertices; ++v) {
        if (!used[v]) continue;
        place[v] = static_cast<Index>(positions_.size());
        positions_.push_back(source_.positions[v]);
    }
    triangles_.resize(count);
    for (Index t = 0; t < count; ++t)
        for (std::size_t k = 0; k < 3; ++k) triangles_[t][k] = place[coincident[source_corners(t)[k]]];
    mesh_ = {.positions = positions_, .triangles = triangles_};
}

// By name: a file may go back to one. Triangles without a material have one of their own.
void PlaceMesh::find_materials() {
    std::map<std::string_view, Index> numbers;
    std::vector<Index> of_source;
    for (const MeshRange& range : source_.ranges) {
        if (range.kind != MeshRange::Kind::material) continue;
        const Index number = numbers.try_emplace(range.name, static_cast<Index>(numbers.size()) + 1).first->second;
        of_source.resize(source_.triangles.size(), 0);
        std::fill_n(of_source.begin() + static_cast<std::ptrdiff_t>(range.first_triangle), range.triangle_count,
                    number);
    }
    if (of_source.empty()) return;
    triangle_materials_.resize(mesh_.triangles.size());
    for (Index t = 0; t < triangle_materials_.size(); ++t) triangle_materials_[t] = of_source[source_triangle(t)];
    const auto is_other = [&](Index material) { return material != triangle_materials_.front(); };
    if (std::ranges::none_of(triangle_materials_, is_other)) triangle_materials_.clear();
}

CornerNormals PlaceMesh::corner_normals(Signs signs, std::optional<float> crease) const {
    std::vector<glm::vec3> own;
    if (!source_.normals.empty()) {
        own.reserve(3 * mesh_.triangles.size());
        for (Index t = 0; t < mesh_.triangles.size(); ++t)
            for (const Index v : source_corners(t)) own.push_back(source_.normals[v]);
    }
    std::vector<Index> smoothing;
    if (!source_.smoothing.empty())
        for (Index t = 0; t < mesh_.triangles.size(); ++t) smoothing.push_back(source_.smoothing[source_triangle(t)]);
    return find_corner_normals({mesh_.positions, mesh_.triangles, own, smoothing, crease, signs.face, signs.own});
}

void PlaceMesh::find_leaves(Signs signs, std::optional<float> crease) {
    const Index places = static_cast<Index>(mesh_.positions.size());
    CornerNormals found = corner_normals(signs, crease);
    creases_ = found.creases;
    if (is_split_ || !triangle_materials_.empty() || found.has_creases) gather_leaves(found);
    if (sources_.size() > places) return;
    // One leaf a place, which has its number.
    first_leaf_ = {};
    leaf_triangles_ = {};
    places_.resize(places);
    std::iota(places_.begin(), places_.end(), Index{0});
    if (!sources_.empty()) return;
    sources_.resize(places);
    for (Index t = 0; t < mesh_.triangles.size(); ++t)
        for (std::size_t k = 0; k < 3; ++k) sources_[mesh_.triangles[t][k]] = source_corners(t)[k];
    normals_ = std::move(found.normals);
}

namespace {

// Corners by place: as many as there are, each with its number, 3 * triangle + corner.
struct CornersByPlace {
    std::vector<Index> start, corners;

    CornersByPlace(std::span<const Triangle> triangles, Index places)
        : start(places + 1, 0), corners(3 * triangles.size()) {
        for (const Triangle& t : triangles)
            for (const Index place : t) ++start[place + 1];
        std::partial_sum(start.begin(), start.end(), start.begin());
        std::vector<Index> next(start.begin(), start.end() - 1);
        for (Index t = 0; t < triangles.size(); ++t)
            for (Index k = 0; k < 3; ++k) corners[next[triangles[t][k]]++] = 3 * t + k;
    }
    std::span<Index> at(Index place) {
        return std::span(corners).subspan(start[place], start[place + 1] - start[place]);
    }
};

} // namespace

void PlaceMesh::gather_leaves(const CornerNormals& found) {
    const Index places = static_cast<Index>(mesh_.positions.size());
    CornersByPlace by_place(mesh_.triangles, places);
    const auto vertex_of = [&](Index corner) { return source_corners(corner / 3)[corner % 3]; };
    const auto material_of = [&](Index corner) {
        return triangle_materials_.empty() ? 0 : triangle_materials_[corner / 3];
    };
    // Corners with equal keys share a leaf. Further values come last, so that keys which differ by them alone follow each
    // other.
    using Key = std::tuple<Index, Index, float, float, float, float, float, float, Index>;
    constexpr std::size_t last = std::tuple_size_v<Key> - 1;
    const auto differ_by_last_alone = [](Key a, const Key& b) {
        std::get<last>(a) = std::get<last>(b);
        return a == b;
    };
    const auto key_of = [&](Index corner) {
        const Index v = vertex_of(corner);
        const glm::vec2 uv = source_.uvs.empty() ? glm::vec2(0) : source_.uvs[v];
        const glm::vec4 c = source_.colours.empty() ? glm::vec4(0) : source_.colours[v];
        const Index further = source_.further.empty() ? 0 : source_.further[v];
        return Key(material_of(corner), found.number[corner], uv.x, uv.y, c.r, c.g, c.b, c.a, further);
    };
    struct Leaf {
        Index vertex, corner; // the first ones
    };
    // Within its run, each corner gets the number of its leaf at the place.
    std::vector<Index> local(by_place.corners.size()), counts(places + 1, 0);
    std::vector<Leaf> first_corners(by_place.corners.size()); // by place, where its corners are
    std::atomic<bool> needs_further = false;
    constexpr Index grain = 1024;
    parallel_loop_over(tbb::blocked_range<Index>(0, places, grain), [&](const auto& range) {
        std::vector<std::pair<Key, Index>> keys;
        std::vector<std::tuple<Index, Index, Index>> order; // first vertex, first corner, number of the key
        for (Index place = range.begin(); place < range.end(); ++place) {
            const Index start = by_place.start[place];
            keys.clear();
            for (const Index corner : by_place.at(place)) keys.emplace_back(key_of(corner), corner);
            std::ranges::sort(keys);
            order.clear();
            std::vector<Index>& of_corner = local;
            for (std::size_t i = 0; i < keys.size(); ++i) {
                const Index corner = keys[i].second, v = vertex_of(corner);
                if (i == 0 || keys[i].first != keys[i - 1].first) {
                    order.emplace_back(v, corner, static_cast<Index>(order.size()));
                    if (i > 0 && differ_by_last_alone(keys[i].first, keys[i - 1].first)) needs_further = true;
                }
                auto& [vertex, first, number] = order.back();
                if (v < vertex) vertex = v;
                of_corner[start + i] = number;
            }
            std::ranges::sort(order);
            std::vector<Index> rank(order.size());
            for (Index i = 0; i < order.size(); ++i) {
                rank[std::get<2>(order[i])] = i;
                first_corners[start + i] = {std::get<0>(order[i]), std::get<1>(order[i])};
            }
            for (std::size_t i = 0; i < keys.size(); ++i) {
                by_place.corners[start + i] = keys[i].second;
                of_corner[start + i] = rank[of_corner[start + i]];
            }
            counts[place + 1] = static_cast<Index>(order.size());
        }
    });
    std::partial_sum(counts.begin(), counts.end(), counts.begin());
    const Index leaves = counts.back();
    sources_.resize(leaves), normals_.resize(leaves), places_.resize(leaves);
    if (!triangle_materials_.empty()) materials_.resize(leaves);
    if (needs_further) further_.resize(leaves);
    leaf_triangles_.resize(mesh_.triangles.size());
    for (Index place = 0; place < places; ++place) {
        for (Index i = by_place.start[place]; i < by_place.start[place + 1]; ++i) {
            const Index corner = by_place.corners[i];
            leaf_triangles_[corner / 3][corner % 3] = counts[place] + local[i];
        }
        for (Index leaf = counts[place]; leaf < counts[place + 1]; ++leaf) {
            const Leaf& first = first_corners[by_place.start[place] + leaf - counts[place]];
            places_[leaf] = place;
            sources_[leaf] = first.vertex;
            normals_[leaf] = found.normals[found.number[first.corner]];
            if (!materials_.empty()) materials_[leaf] = material_of(first.corner);
            if (!further_.empty()) further_[leaf] = source_.further[first.vertex];
        }
    }
    first_leaf_ = std::move(counts);
}

} // namespace unseen::vdtree
