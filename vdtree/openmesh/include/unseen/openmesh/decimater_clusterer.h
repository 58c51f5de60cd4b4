// OpenMesh's decimater as a clusterer: its halfedge collapses, with any of its modules, become a tree's merges.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <glm/common.hpp>

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>

#include <unseen/openmesh/convert.h>
#include <unseen/vdtree/builder.h>

namespace unseen::openmesh {

// What is decimated: a vertex a place (coincident vertices are one), with status and face normals, in double precision,
// scaled to the unit box: the lengths of modules, such as ModQuadric's error, are shares of the mesh's largest side.
struct ClusterTraits : OpenMesh::DefaultTraits {
    using Point = OpenMesh::Vec3d;
    using Normal = OpenMesh::Vec3d;
    VertexAttributes(OpenMesh::Attributes::Status);
    FaceAttributes(OpenMesh::Attributes::Status | OpenMesh::Attributes::Normal);
    EdgeAttributes(OpenMesh::Attributes::Status);
    HalfedgeAttributes(OpenMesh::Attributes::Status | OpenMesh::Attributes::PrevHalfedge);
};
using ClusterMesh = OpenMesh::TriMesh_ArrayKernelT<ClusterTraits>;
using ClusterDecimater = OpenMesh::Decimater::DecimaterT<ClusterMesh>;

namespace detail {

// Writes a hierarchy down as merges happen.
class MergeRecord {
public:
    explicit MergeRecord(std::size_t vertices) : parents_(vertices, 0) {}

    vdtree::Index make_cluster(glm::dvec3 position) {
        parents_.push_back(0);
        positions_.push_back(position);
        return static_cast<vdtree::Index>(parents_.size() - 1);
    }
    void set_parent(vdtree::Index cluster, vdtree::Index parent) { parents_[cluster] = parent; }
    std::size_t size() const { return parents_.size(); }

    vdtree::Clustering finish() {
        parents_.back() = static_cast<vdtree::Index>(parents_.size() - 1);
        return {std::move(parents_), std::move(positions_)};
    }

private:
    std::vector<vdtree::Index> parents_;
    std::vector<glm::dvec3> positions_;
};

// A module that allows every collapse and is told of those that happen.
template <class M>
class ModRecordT : public OpenMesh::Decimater::ModBaseT<M> {
public:
    DECIMATING_MODULE(ModRecordT, M, Record);

    explicit ModRecordT(M& mesh) : Base(mesh, true) {}

    Callback<void(int removed, int remaining)> on_collapse; // numbers of vertices

    void postprocess_collapse(const CollapseInfo& collapse) override {
        if (on_collapse) on_collapse(collapse.v0.idx(), collapse.v1.idx());
    }
};

// Tells the caller's progress callback, and ends the decimation where it says so.
class ProgressObserver : public OpenMesh::Decimater::Observer {
public:
    ProgressObserver(const Progress& progress, std::size_t vertices)
        : Observer(std::max<std::size_t>(1, vertices / 100)), progress_(progress), vertices_(vertices) {}

    void notify(std::size_t step) override {
        const double share = std::min(1.0, static_cast<double>(step) / static_cast<double>(vertices_));
        if (progress_ && !progress_(share, "clustering")) cancelled_ = true;
    }
    bool abort() const override { return cancelled_; }

private:
    const Progress& progress_;
    std::size_t vertices_;
    bool cancelled_ = false;
};

// The vertices that no collapse has removed, merged by Unseen's own clusterers.
inline Result<vdtree::Clustering> cluster_rest(const vdtree::ClusterInput& input, const ClusterMesh& mesh,
                                               std::span<const vdtree::Index> vertex_of_place,
                                               std::span<const vdtree::Index> places) {
    vdtree::Mesh rest;
    std::vector<float> luminance;
    std::vector<glm::vec3> normals;
    std::vector<double> areas;
    std::vector<vdtree::Index> coincident, number(vertex_of_place.size(), 0);
    for (const vdtree::Index place : places) {
        const vdtree::Index v = vertex_of_place[place];
        number[place] = static_cast<vdtree::Index>(rest.positions.size());
        coincident.push_back(number[place]);
        rest.positions.push_back(input.mesh.positions[v]);
        if (!input.mesh.colours.empty()) rest.colours.push_back(input.mesh.colours[v]);
        if (!input.mesh.uvs.empty()) rest.uvs.push_back(input.mesh.uvs[v]);
        luminance.push_back(input.luminance[v]);
        normals.push_back(input.normals[v]);
        areas.push_back(input.areas[v]);
    }
    for (std::size_t i = 0; i < mesh.n_faces(); ++i) {
        const ClusterMesh::FaceHandle f(static_cast<int>(i));
        if (mesh.status(f).deleted()) continue;
        vdtree::Triangle t{};
        std::size_t k = 0;
        for (auto v = mesh.cfv_iter(f); v.is_valid() && k < 3; ++v) t[k++] = number[static_cast<std::size_t>(v->idx())];
        rest.triangles.push_back(t);
    }
    const vdtree::ClusterInput input_of_rest{rest.view(), luminance, normals, areas, coincident};
    return rest.triangles.empty() ? vdtree::cluster_octree(input_of_rest) : vdtree::cluster_quadric(input_of_rest);
}

} // namespace detail

// Collapses as far as the modules let it, in their order; what is left then, such as the parts of a mesh and the handles
// of its surface, is merged by vdtree::cluster_quadric(). Proxies are vertices of the mesh up to there. One thread; the
// result depends on the mesh and the modules alone.
//
//     const auto clusterer = [](const vdtree::ClusterInput& input) {
//         return openmesh::cluster_by_decimater(input, [](openmesh::ClusterDecimater& decimater) {
//             OpenMesh::Decimater::ModQuadricT<openmesh::ClusterMesh>::Handle quadric;
//             decimater.add(quadric);
//             decimater.module(quadric).unset_max_err();
//         });
//     };
//     const auto tree = vdtree::build_tree(mesh.view(), clusterer);
//
// Fails where the surface is not manifold, with consistently oriented neighbours, once equal positions are one vertex:
// OpenMesh's halfedges cannot hold it. Fails where not exactly one of the modules gives priorities.
template <class AddModules>
requires std::is_invocable_v<AddModules&, ClusterDecimater&> Result<vdtree::Clustering>
cluster_by_decimater(const vdtree::ClusterInput& input, AddModules&& add_modules, const Progress& progress = {}) {
    using vdtree::Index;
    const std::size_t vertices = input.mesh.positions.size();
    glm::dvec3 low(std::numeric_limits<double>::infinity()), high = -low;
    for (const glm::dvec3& p : input.mesh.positions) low = glm::min(low, p), high = glm::max(high, p);
    const glm::dvec3 sides = high - low;
    const double side = std::max({sides.x, sides.y, sides.z});
    const double size = side > 0 ? side : 1;

    ClusterMesh mesh;
    std::vector<Index> place_of(vertices), vertex_of_place, vertices_there;
    for (std::size_t v = 0; v < vertices; ++v) {
        if (input.coincident[v] != v) {
            place_of[v] = place_of[input.coincident[v]];
            ++vertices_there[place_of[v]];
            continue;
        }
        place_of[v] = static_cast<Index>(vertex_of_place.size());
        vertex_of_place.push_back(static_cast<Index>(v));
        vertices_there.push_back(1);
        const glm::dvec3 p = (input.mesh.positions[v] - low) / size;
        mesh.add_vertex(ClusterMesh::Point(p.x, p.y, p.z));
    }
    std::size_t refused = 0;
    {
        const detail::QuietErrors quiet;
        for (const vdtree::Triangle& t : input.mesh.triangles) {
            const auto handle = [&](Index v) { return ClusterMesh::VertexHandle(static_cast<int>(place_of[v])); };
            const auto a = handle(t[0]), b = handle(t[1]), c = handle(t[2]);
            if (a == b || b == c || c == a) continue;
            refused += !mesh.add_face(a, b, c).is_valid();
        }
    }
    if (refused > 0)
        return Error{ErrorCode::unsupported,
                     "OpenMesh's decimater needs a manifold surface with consistent orientation, and " +
                         std::to_string(refused) + " of " + std::to_string(input.mesh.triangles.size()) +
                         " triangles do not fit: repair the mesh, or take the clusterer quadric, which takes any."};
    mesh.update_face_normals();

    // Coincident vertices merge first.
    detail::MergeRecord record(vertices);
    std::vector<Index> cluster_of(vertex_of_place.size()); // by place
    for (std::size_t place = 0; place < vertex_of_place.size(); ++place)
        cluster_of[place] = vertices_there[place] == 1
                                ? vertex_of_place[place]
                                : record.make_cluster(input.mesh.positions[vertex_of_place[place]]);
    for (std::size_t v = 0; v < vertices; ++v)
        if (vertices_there[place_of[v]] > 1) record.set_parent(static_cast<Index>(v), cluster_of[place_of[v]]);

    std::vector<std::uint8_t> is_removed(vertex_of_place.size(), 0);
    {
        ClusterDecimater decimater(mesh);
        typename detail::ModRecordT<ClusterMesh>::Handle recorder;
        decimater.add(recorder);
        decimater.module(recorder).on_collapse = [&](int removed, int remaining) {
            const auto from = static_cast<std::size_t>(removed), to = static_cast<std::size_t>(remaining);
            const Index merged = record.make_cluster(input.mesh.positions[vertex_of_place[to]]);
            record.set_parent(cluster_of[from], merged);
            record.set_parent(cluster_of[to], merged);
            cluster_of[to] = merged;
            is_removed[from] = 1;
        };
        add_modules(decimater);
        if (!decimater.initialize())
            return Error{ErrorCode::invalid_argument,
                         "OpenMesh's decimater needs exactly one module that gives priorities, such as ModQuadricT; "
                         "make the others binary (set_binary(true))."};
        detail::ProgressObserver observer(progress, vertex_of_place.size());
        decimater.set_observer(&observer);
        decimater.decimate(0);
        if (observer.abort()) return Error{ErrorCode::cancelled, "Clustering was cancelled."};
    }

    std::vector<Index> left;
    for (std::size_t place = 0; place < is_removed.size(); ++place)
        if (!is_removed[place]) left.push_back(static_cast<Index>(place));
    if (left.size() == 1) {
        if (record.size() == vertices) { // one vertex alone: it still needs a root
            const Index root = record.make_cluster(input.mesh.positions[vertex_of_place[left[0]]]);
            record.set_parent(cluster_of[left[0]], root);
        }
        return record.finish();
    }
    const auto rest = detail::cluster_rest(input, mesh, vertex_of_place, left);
    if (!rest) return rest.error();
    // Clusters of the rest follow those made so far. Without positions of their own, they are at the mean of what they
    // stand for.
    const auto base = static_cast<Index>(record.size());
    const auto number = [&](Index c) {
        return c < left.size() ? cluster_of[left[c]] : base + (c - static_cast<Index>(left.size()));
    };
    std::vector<glm::dvec3> positions = rest->positions;
    if (positions.empty()) {
        std::vector<glm::dvec4> sums(rest->parents.size(), glm::dvec4(0));
        for (std::size_t c = 0; c < rest->parents.size(); ++c) {
            if (c < left.size()) sums[c] = glm::dvec4((input.mesh.positions[vertex_of_place[left[c]]] - low) / size, 1);
            else positions.push_back(low + size * (glm::dvec3(sums[c]) / sums[c].w));
            if (rest->parents[c] != c) sums[rest->parents[c]] += sums[c];
        }
    }
    for (const glm::dvec3& p : positions) record.make_cluster(p);
    for (std::size_t c = 0; c + 1 < rest->parents.size(); ++c)
        record.set_parent(number(static_cast<Index>(c)), number(rest->parents[c]));
    return record.finish();
}

// By quadric error alone: OpenMesh's usual decimation (Garland and Heckbert 1997, without boundary terms).
inline Result<vdtree::Clustering> cluster_by_decimater(const vdtree::ClusterInput& input,
                                                       const Progress& progress = {}) {
    return cluster_by_decimater(
        input,
        [](ClusterDecimater& decimater) {
            OpenMesh::Decimater::ModQuadricT<ClusterMesh>::Handle quadric;
            decimater.add(quadric);
            decimater.module(quadric).unset_max_err();
        },
        progress);
}

// The tree of a soup, clustered by that; what `unseen build --clusterer openmesh` does. Of the options, the clusterer
// does not count, and there can be no team.
inline Result<vdtree::VertexTree> build_tree_by_decimater(const vdtree::MeshView& mesh,
                                                          const vdtree::BuildOptions& options = {}) {
    constexpr double begins = 0.1, ends = 0.7; // of the whole build, as vdtree::build_tree() tells it
    const Progress progress = [&](double share, const char* stage) {
        return !options.progress || options.progress(begins + share * (ends - begins), stage);
    };
    return vdtree::build_tree(
        mesh, [&](const vdtree::ClusterInput& input) { return cluster_by_decimater(input, progress); }, options);
}

} // namespace unseen::openmesh
