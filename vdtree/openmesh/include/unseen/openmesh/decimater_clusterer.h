// OpenMesh's decimater as a clusterer: its halfedge collapses, with any of its modules, become a tree's merges.
#pragma once

#include <numeric>

#include <glm/common.hpp>

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>

#include <unseen/openmesh/openmesh.h>
#include <unseen/vdtree/builder.h>

namespace unseen::openmesh {

// The mesh to decimate: one vertex for each distinct position, with status and face normals, in double precision, scaled
// to the unit box. So lengths in modules, such as ModQuadric's error, are shares of the largest side.
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

// A module that allows every collapse and reports those that happen.
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

// Calls the caller's progress callback, and ends the decimation if that returns false.
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

// One clustering: the mesh, decimated, and the merges that it leads to.
class DecimaterClustering {
public:
    explicit DecimaterClustering(const vdtree::ClusterInput& input)
        : input_(input), cluster_of_(input.mesh.positions.size()), is_removed_(cluster_of_.size(), 0) {
        out_.parents.resize(cluster_of_.size());
        std::iota(cluster_of_.begin(), cluster_of_.end(), Index{0});
        glm::dvec3 low(std::numeric_limits<double>::infinity()), high = -low;
        for (const glm::dvec3& p : input.mesh.positions) low = glm::min(low, p), high = glm::max(high, p);
        const glm::dvec3 sides = high - low;
        const double side = std::max({sides.x, sides.y, sides.z});
        low_ = low;
        size_ = side > 0 ? side : 1;
        for (const glm::dvec3& position : input.mesh.positions) {
            const glm::dvec3 p = (position - low_) / size_;
            mesh_.add_vertex(ClusterMesh::Point(p.x, p.y, p.z));
        }
    }

    // Fails on triangles that OpenMesh's halfedges cannot hold.
    Result<void> add_faces() {
        std::size_t refused = 0;
        const QuietErrors quiet;
        for (const vdtree::Triangle& t : input_.mesh.triangles) {
            const auto handle = [](Index v) { return ClusterMesh::VertexHandle(static_cast<int>(v)); };
            refused += !mesh_.add_face(handle(t[0]), handle(t[1]), handle(t[2])).is_valid();
        }
        if (refused > 0)
            return Error{ErrorCode::unsupported,
                         "OpenMesh's decimater needs a manifold surface with consistent orientation, and " +
                             std::to_string(refused) + " of " + std::to_string(input_.mesh.triangles.size()) +
                             " triangles do not fit: repair the mesh, or use the clusterer quadric, which takes any."};
        mesh_.update_face_normals();
        return {};
    }

    Result<void> decimate(const FunctionRef<void(ClusterDecimater&)>& add_modules, const Progress& progress) {
        ClusterDecimater decimater(mesh_);
        typename ModRecordT<ClusterMesh>::Handle recorder;
        decimater.add(recorder);
        decimater.module(recorder).on_collapse = [&](int removed, int remaining) {
            const auto from = static_cast<std::size_t>(removed), to = static_cast<std::size_t>(remaining);
            const Index merged = make_cluster(position(to));
            out_.parents[cluster_of_[from]] = out_.parents[cluster_of_[to]] = merged;
            cluster_of_[to] = merged;
            is_removed_[from] = 1;
        };
        add_modules(decimater);
        if (!decimater.initialize())
            return Error{ErrorCode::invalid_argument,
                         "OpenMesh's decimater needs exactly one module that gives priorities, such as ModQuadricT; "
                         "make the others binary (set_binary(true))."};
        ProgressObserver observer(progress, cluster_of_.size());
        decimater.set_observer(&observer);
        decimater.decimate(0);
        if (observer.abort()) return Error{ErrorCode::cancelled, "Clustering was cancelled."};
        return {};
    }

    // Merges the places that are left, by Unseen's own clusterers.
    Result<vdtree::Clustering> finish() {
        std::vector<Index> left;
        for (std::size_t place = 0; place < is_removed_.size(); ++place)
            if (!is_removed_[place]) left.push_back(static_cast<Index>(place));
        if (left.size() > 1) {
            const auto rest = cluster_rest(left);
            if (!rest) return rest.error();
            // Clusters of the rest follow those made so far.
            const auto base = static_cast<Index>(out_.parents.size());
            const auto number = [&](Index c) {
                return c < left.size() ? cluster_of_[left[c]] : base + (c - static_cast<Index>(left.size()));
            };
            for (const glm::dvec3& p : rest->positions.empty() ? means_of(*rest, left) : rest->positions)
                make_cluster(p);
            for (std::size_t c = 0; c + 1 < rest->parents.size(); ++c)
                out_.parents[number(static_cast<Index>(c))] = number(rest->parents[c]);
        }
        out_.parents.back() = static_cast<Index>(out_.parents.size() - 1);
        return std::move(out_);
    }

private:
    using Index = vdtree::Index;

    Index make_cluster(glm::dvec3 position) {
        out_.parents.push_back(0);
        out_.positions.push_back(position);
        return static_cast<Index>(out_.parents.size() - 1);
    }

    const glm::dvec3& position(std::size_t place) const { return input_.mesh.positions[place]; }

    // Merges places that no collapse has removed, by Unseen's own clusterers.
    Result<vdtree::Clustering> cluster_rest(std::span<const Index> left) const {
        vdtree::Mesh rest;
        std::vector<float> luminance;
        std::vector<glm::vec3> normals;
        std::vector<double> areas;
        std::vector<Index> places, number(cluster_of_.size(), 0);
        for (const Index place : left) {
            number[place] = static_cast<Index>(rest.positions.size());
            places.push_back(number[place]);
            rest.positions.push_back(position(place));
            luminance.push_back(input_.luminance[place]);
            normals.push_back(input_.normals[place]);
            areas.push_back(input_.areas[place]);
        }
        for (const auto f : mesh_.all_faces()) {
            if (mesh_.status(f).deleted()) continue;
            vdtree::Triangle& t = rest.triangles.emplace_back();
            std::size_t k = 0;
            for (auto v = mesh_.cfv_iter(f); v.is_valid() && k < 3; ++v)
                t[k++] = number[static_cast<std::size_t>(v->idx())];
        }
        const vdtree::LeafView leaves{rest.triangles, places, luminance, normals, {}, {}};
        const vdtree::ClusterInput input{rest.view(), luminance, normals, areas, leaves};
        return rest.triangles.empty() ? vdtree::cluster_octree(input) : vdtree::cluster_quadric(input);
    }

    // By cluster of the rest that is no place: the mean of the places under it.
    std::vector<glm::dvec3> means_of(const vdtree::Clustering& rest, std::span<const Index> left) const {
        std::vector<glm::dvec3> means;
        std::vector<glm::dvec4> sums(rest.parents.size(), glm::dvec4(0));
        for (std::size_t c = 0; c < rest.parents.size(); ++c) {
            if (c < left.size()) sums[c] = glm::dvec4((position(left[c]) - low_) / size_, 1);
            else means.push_back(low_ + size_ * (glm::dvec3(sums[c]) / sums[c].w));
            if (rest.parents[c] != c) sums[rest.parents[c]] += sums[c];
        }
        return means;
    }

    const vdtree::ClusterInput& input_;
    glm::dvec3 low_;
    double size_ = 1; // of the unit box
    ClusterMesh mesh_;
    vdtree::Clustering out_;
    std::vector<Index> cluster_of_;        // by place: its cluster so far
    std::vector<std::uint8_t> is_removed_; // by place
};

} // namespace detail

// Collapses edges as far as the modules allow, in their order. vdtree::cluster_quadric() merges the rest, such as separate
// parts and the handles of the surface. Until then proxies are vertices of the mesh. One thread; the result depends on
// the mesh and the modules alone.
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
// Fails if the surface, with equal positions united, is not manifold with consistent orientation, as OpenMesh's halfedges
// need. Fails unless exactly one of the modules gives priorities.
template <class AddModules>
requires std::is_invocable_v<AddModules&, ClusterDecimater&> Result<vdtree::Clustering>
cluster_by_decimater(const vdtree::ClusterInput& input, AddModules&& add_modules, const Progress& progress = {}) {
    detail::DecimaterClustering clustering(input);
    if (const auto added = clustering.add_faces(); !added) return added.error();
    if (const auto done = clustering.decimate(add_modules, progress); !done) return done.error();
    return clustering.finish();
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

// The tree of a soup, clustered by quadric error as above, as in `unseen build --clusterer openmesh`. Ignores the options'
// clusterer; there can be no team.
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
