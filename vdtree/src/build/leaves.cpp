#include "build/leaves.h"

#include <atomic>
#include <map>
#include <numeric>
#include <tuple>

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

CornerNormals PlaceMesh::corner_normals(const Surface& surface, std::optional<float> crease) const {
    const Index triangles = static_cast<Index>(mesh_.triangles.size());
    std::vector<glm::vec3> own;
    if (!source_.normals.empty()) {
        own.reserve(3 * mesh_.triangles.size());
        for (Index t = 0; t < triangles; ++t)
            for (const Index v : source_corners(t)) own.push_back(source_.normals[v]);
    }
    std::vector<Index> smoothing;
    if (!source_.smoothing.empty())
        for (Index t = 0; t < triangles; ++t) smoothing.push_back(source_.smoothing[source_triangle(t)]);
    const bool turns = surface.closedness == Closedness::closed_inward && own_normals_agree(source_);
    return find_corner_normals(
        {mesh_.positions, mesh_.triangles, surface, own, smoothing, crease, turns ? -1.0f : 1.0f});
}

void PlaceMesh::find_leaves(const Surface& surface, std::optional<float> crease) {
    const Index places = static_cast<Index>(mesh_.positions.size());
    CornerNormals found = corner_normals(surface, crease);
    creases_ = found.creases;
    if (is_split_ || !triangle_materials_.empty() || found.has_creases) {
        const bool needs_further = number_leaves(found, surface.corners);
        describe_leaves(found, surface.corners, needs_further);
        if (leaf_count() > places) return;
        // One leaf a place, which has its number.
        first_leaf_ = {};
        leaf_triangles_ = {};
        return;
    }
    places_.resize(places);
    std::iota(places_.begin(), places_.end(), Index{0});
    sources_.resize(places);
    for (Index t = 0; t < mesh_.triangles.size(); ++t)
        for (std::size_t k = 0; k < 3; ++k) sources_[mesh_.triangles[t][k]] = source_corners(t)[k];
    normals_ = std::move(found.normals);
}

namespace {

// Corners with equal keys share a leaf. Further values come last, so that keys which differ by them alone follow each
// other: material, normal, texture coordinates, colour, further values.
using LeafKey = std::tuple<Index, Index, float, float, float, float, float, float, Index>;

bool differ_by_further_alone(LeafKey a, const LeafKey& b) {
    constexpr std::size_t further = std::tuple_size_v<LeafKey> - 1;
    if (std::get<further>(a) == std::get<further>(b)) return false;
    std::get<further>(a) = std::get<further>(b);
    return a == b;
}

// The leaves at one place after another.
class PlaceLeaves {
public:
    bool needs_further = false;

    // Sorts the corners at a place by key.
    template <class KeyOf>
    void gather(std::span<const Index> corners, KeyOf&& key_of) {
        keys_.clear();
        for (const Index corner : corners) keys_.emplace_back(key_of(corner), corner);
        std::ranges::sort(keys_);
    }

    // Calls use(corner, leaf) for each, leaves in the order of their first vertices, then of their first corners.
    // Returns how many leaves there are.
    template <class VertexOf, class Use>
    Index number(VertexOf&& vertex_of, Use&& use) {
        leaves_.clear();
        for (std::size_t i = 0; i < keys_.size(); ++i) {
            const auto& [key, corner] = keys_[i];
            if (i == 0 || key != keys_[i - 1].first) {
                leaves_.push_back({vertex_of(corner), corner, static_cast<Index>(i)});
                needs_further |= i > 0 && differ_by_further_alone(key, keys_[i - 1].first);
            }
            leaves_.back().vertex = std::min(leaves_.back().vertex, vertex_of(corner));
        }
        std::ranges::sort(leaves_, {}, [](const Leaf& leaf) { return std::pair(leaf.vertex, leaf.corner); });
        for (Index leaf = 0; leaf < leaves_.size(); ++leaf)
            for (std::size_t i = leaves_[leaf].first;
                 i < keys_.size() && keys_[i].first == keys_[leaves_[leaf].first].first; ++i)
                use(keys_[i].second, leaf);
        return static_cast<Index>(leaves_.size());
    }

private:
    struct Leaf {
        Index vertex, corner; // the first ones
        Index first;          // in keys_
    };
    std::vector<std::pair<LeafKey, Index>> keys_;
    std::vector<Leaf> leaves_;
};

} // namespace

// Whether leaves at one place differ by further values alone.
bool PlaceMesh::number_leaves(const CornerNormals& found, const CornersByPlace& corners) {
    const auto key_of = [&](Index corner) {
        const Index v = source_vertex(corner);
        const glm::vec2 uv = source_.uvs.empty() ? glm::vec2(0) : source_.uvs[v];
        const glm::vec4 c = source_.colours.empty() ? glm::vec4(0) : source_.colours[v];
        const Index further = source_.further.empty() ? 0 : source_.further[v];
        return LeafKey(material_of(corner), found.number[corner], uv.x, uv.y, c.r, c.g, c.b, c.a, further);
    };
    const Index places = static_cast<Index>(mesh_.positions.size());
    first_leaf_.assign(places + 1, 0);
    leaf_triangles_.resize(mesh_.triangles.size());
    std::atomic<bool> needs_further = false;
    constexpr Index grain = 1024;
    parallel_loop_over(tbb::blocked_range<Index>(0, places, grain), [&](const auto& range) {
        PlaceLeaves leaves;
        for (Index place = range.begin(); place < range.end(); ++place) {
            const std::span<const Index> here = corners.at(place);
            const auto simple_key = [&](Index corner) {
                return std::tuple(source_vertex(corner), found.number[corner], material_of(corner));
            };
            const auto put = [&](Index corner, Index leaf) { leaf_triangles_[corner / 3][corner % 3] = leaf; };
            if (std::ranges::all_of(here, [&](Index c) { return simple_key(c) == simple_key(here[0]); })) {
                for (const Index corner : here) put(corner, 0);
                first_leaf_[place + 1] = 1;
            } else {
                leaves.gather(here, key_of);
                first_leaf_[place + 1] = leaves.number([&](Index c) { return source_vertex(c); }, put);
            }
        }
        if (leaves.needs_further) needs_further = true;
    });
    std::partial_sum(first_leaf_.begin(), first_leaf_.end(), first_leaf_.begin());
    return needs_further;
}

// `leaf_triangles_` has numbers at the place until then.
void PlaceMesh::describe_leaves(const CornerNormals& found, const CornersByPlace& corners, bool needs_further) {
    const Index places = static_cast<Index>(mesh_.positions.size()), leaves = first_leaf_.back();
    constexpr Index none = ~Index{0};
    sources_.assign(leaves, none), normals_.resize(leaves), places_.resize(leaves);
    if (!triangle_materials_.empty()) materials_.resize(leaves);
    if (needs_further) further_.resize(leaves);
    parallel_loop(Index{0}, places, [&](Index place) {
        for (const Index corner : corners.at(place)) {
            const Index leaf = leaf_triangles_[corner / 3][corner % 3] += first_leaf_[place], v = source_vertex(corner);
            sources_[leaf] = std::min(sources_[leaf], v);
            places_[leaf] = place;
            normals_[leaf] = found.normals[found.number[corner]];
            if (!materials_.empty()) materials_[leaf] = material_of(corner);
            if (!further_.empty()) further_[leaf] = source_.further[v];
        }
    });
}

} // namespace unseen::vdtree
