// From a mesh and a clustering to a vertex tree: order the nodes, find where triangles vanish, bound every fold.
#include <unseen/vdtree/builder.h>

#include <atomic>
#include <optional>

#include <glm/geometric.hpp>
#include <tbb/global_control.h>

#include "build/bound_facing.h"
#include "build/bound_spheres.h"
#include "build/order_nodes.h"
#include "build/parallel_array.h"
#include "build/place_proxies.h"
#include "build/spatial_order.h"
#include "build/surface.h"
#include "tree/mask_pool.h"
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/normal_mask.h>
#include <unseen/vdtree/internal/number_format.h>
#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/team.h>
#include <unseen/vdtree/internal/texture_bounds.h>
#include <unseen/vdtree/internal/texture_fit.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::vdtree {

namespace {

// What of the whole build is done when clustering begins and ends.
constexpr double clustering_begins = 0.1, clustering_ends = 0.7;

// Positions beyond this, relative to the origin, leave no room for spheres around them in floats.
constexpr double largest_coordinate = std::numeric_limits<float>::max() / 16;

// The smallest size of a mesh, in mesh units: floats end at 1.4e-45 and would place smaller meshes too coarsely.
constexpr double smallest_size = 1e-36;

// Places that doubles tell apart along the mesh, at least: fewer, far away from the origin, leave no surface.
constexpr double fewest_places = 256;

// Gives memory back that is not needed any more.
template <class T>
void release(std::vector<T>& values) {
    std::vector<T>().swap(values);
}

Error cancelled_error() { return {ErrorCode::cancelled, "Building the tree was cancelled."}; }

// The input less what cannot be built on: triangles that use a vertex twice, and vertices that no triangle uses
// (these come back as leaves of a subtree of their own).
struct CleanMesh {
    Mesh storage;                        // used where something had to go, like the next
    std::vector<Index> source_vertices;  // by clean vertex
    std::vector<Index> source_triangles; // by clean triangle
    std::vector<Index> unreferenced;     // source vertices
    MeshView view;
    std::uint64_t dropped = 0;

    Index source_vertex(Index v) const { return source_vertices.empty() ? v : source_vertices[v]; }
    Index source_triangle(Index t) const { return source_triangles.empty() ? t : source_triangles[t]; }
};

template <class T>
std::vector<T> select(std::span<const T> values, std::span<const Index> which) {
    std::vector<T> out;
    if (values.empty()) return out;
    out.reserve(which.size());
    for (const Index i : which) out.push_back(values[i]);
    return out;
}

CleanMesh clean(const MeshView& mesh) {
    CleanMesh out;
    std::vector<std::uint8_t> used(mesh.positions.size(), 0);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        if (uses_a_vertex_twice(mesh.triangles[t])) continue;
        out.source_triangles.push_back(static_cast<Index>(t));
        for (const Index v : mesh.triangles[t]) used[v] = 1;
    }
    out.dropped = mesh.triangles.size() - out.source_triangles.size();
    std::vector<Index> clean_number(mesh.positions.size(), 0);
    for (std::size_t v = 0; v < used.size(); ++v) {
        clean_number[v] = static_cast<Index>(out.source_vertices.size());
        (used[v] ? out.source_vertices : out.unreferenced).push_back(static_cast<Index>(v));
    }
    if (out.dropped == 0 && out.unreferenced.empty()) {
        out = {};
        out.view = mesh;
        return out;
    }
    Mesh& m = out.storage;
    m.positions = select(mesh.positions, out.source_vertices);
    m.normals = select(mesh.normals, out.source_vertices);
    m.colours = select(mesh.colours, out.source_vertices);
    m.uvs = select(mesh.uvs, out.source_vertices);
    for (const Index t : out.source_triangles) {
        Triangle tri = mesh.triangles[t];
        for (Index& v : tri) v = clean_number[v];
        m.triangles.push_back(tri);
    }
    out.view = m.view();
    return out;
}

// The origin of the tree's float positions. Float coordinates stay exact: where all coordinates of an axis have one
// sign and the largest is at most twice the smallest, their differences are exact (Sterbenz), else the axis keeps 0.
// Coordinates of double precision then lose at most half a unit in the last place of a float of the extent's size.
glm::dvec3 choose_origin(std::span<const glm::dvec3> positions) {
    const Box box = box_around(positions);
    glm::dvec3 origin(0);
    for (int axis = 0; axis < 3; ++axis) {
        const double a = box.low[axis], b = box.high[axis];
        if (a > 0 && b <= 2 * a) origin[axis] = static_cast<double>(static_cast<float>(a));
        if (b < 0 && a >= 2 * b) origin[axis] = static_cast<double>(static_cast<float>(b));
    }
    return origin;
}

bool fits_floats(glm::dvec3 p) {
    return std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) <= largest_coordinate &&
           std::isfinite(p.x + p.y + p.z);
}

Result<void> check(const Clustering& c, std::size_t vertices) {
    if (c.parents.size() <= vertices)
        return invalid_argument("The clustering of " + std::to_string(vertices) + " vertices has only " +
                                std::to_string(c.parents.size()) + " clusters; it needs the vertices and a root.");
    if (c.parents.size() >= no_node) return invalid_argument("The clustering has more than 2^32 - 2 clusters.");
    if (!c.positions.empty() && c.positions.size() != c.parents.size() - vertices)
        return invalid_argument("The clustering has " + std::to_string(c.positions.size()) + " proxies for " +
                                std::to_string(c.parents.size() - vertices) + " clusters.");
    const std::size_t root = c.parents.size() - 1;
    if (c.parents[root] != root)
        return invalid_argument("The last cluster, " + std::to_string(root) + ", is the root and has the parent " +
                                std::to_string(c.parents[root]) + "; the root's is its own number.");
    for (std::size_t i = 0; i < root; ++i) {
        if (!(c.parents[i] > i && c.parents[i] <= root) || c.parents[i] < vertices)
            return invalid_argument("Cluster " + std::to_string(i) + " has the parent " + std::to_string(c.parents[i]) +
                                    "; a parent is a cluster with a higher number.");
    }
    std::vector<std::uint8_t> has_child(c.parents.size(), 0);
    for (std::size_t i = 0; i < root; ++i) has_child[c.parents[i]] = 1;
    for (std::size_t i = vertices; i <= root; ++i)
        if (!has_child[i]) return invalid_argument("Cluster " + std::to_string(i) + " has no children.");
    for (std::size_t i = 0; i < c.positions.size(); ++i)
        if (!fits_floats(c.positions[i]))
            return invalid_argument("The proxy of cluster " + std::to_string(vertices + i) +
                                    " is not finite or too far away.");
    return {};
}

Result<void> check(const Light& light) {
    const float length = glm::length(light.direction);
    constexpr float unit_slack = 1e-3f; // directions given with three digits
    if (!(std::abs(length - 1) <= unit_slack) || !(light.ambient >= 0 && light.ambient <= 1) ||
        !(light.fill >= 0 && light.fill <= 1))
        return invalid_argument(
            "The light needs a direction of length 1, and shares of ambient and fill light from 0 to 1.");
    return {};
}

// What is too small for floats, and what lies so far away that doubles have rounded it to a few places. Meshes in one
// point are as they are meant to be.
Result<void> check_size(std::span<const glm::dvec3> positions) {
    if (positions.empty()) return {};
    const Box box = box_around(positions);
    const double size = box.extent();
    if (size == 0) return {};
    const auto text = [](double value) { return rounded(value, 3); };
    if (size < smallest_size)
        return invalid_argument("The mesh is " + text(size) + " units large, and at least " + text(smallest_size) +
                                " are needed: scale it up, or write it in a smaller unit.");
    for (int axis = 0; axis < 3; ++axis) {
        const double farthest = std::max(std::abs(box.low[axis]), std::abs(box.high[axis]));
        const double step = std::nextafter(farthest, std::numeric_limits<double>::infinity()) - farthest;
        const double places = box.size()[axis] > 0 ? fewest_places : 1; // flat walls are as exact there as anywhere
        if (step * places > size)
            return invalid_argument(
                "The mesh is " + text(size) + " units large and lies " + text(farthest) +
                " from the origin, where coordinates are " + text(step) +
                " apart, so that its shape is lost: move it nearer to the origin where it is made.");
    }
    return {};
}

// What validate() lets pass, but the tree's floats do not.
Result<void> check_attributes(const MeshView& mesh) {
    const auto invalid = [](const char* what, std::size_t vertex) {
        return Error{ErrorCode::malformed_data, std::string(what) + " of vertex " + std::to_string(vertex) + "."};
    };
    for (std::size_t v = 0; v < mesh.positions.size(); ++v)
        if (!fits_floats(mesh.positions[v])) return invalid("The position is too far away for floats:", v);
    if (const auto sized = check_size(mesh.positions); !sized) return sized;
    for (std::size_t v = 0; v < mesh.colours.size(); ++v) {
        const glm::vec4 c = mesh.colours[v];
        if (!std::isfinite(c.r) || !std::isfinite(c.g) || !std::isfinite(c.b) || !std::isfinite(c.a))
            return invalid("A value is not finite in the colour", v);
    }
    for (std::size_t v = 0; v < mesh.uvs.size(); ++v)
        if (!std::isfinite(mesh.uvs[v].x) || !std::isfinite(mesh.uvs[v].y))
            return invalid("A value is not finite in the texture coordinates", v);
    if (mesh.texture.empty()) return {};
    for (std::size_t v = 0; v < mesh.colours.size(); ++v) // what textures are multiplied with
        for (int k = 0; k < 3; ++k)
            if (!(mesh.colours[v][k] >= 0 && mesh.colours[v][k] <= 1))
                return invalid("A mesh with a texture needs colours from 0 to 1; correct that", v);
    return {};
}

// Moves what was measured to the tree's arrays.
class TreeBuilder {
public:
    TreeBuilder(const MeshView& source, const BuildOptions& options) : source_(source), options_(options) {}

    Result<VertexTree> build(const Clusterer& clusterer) {
        if (const auto cleaned = clean_up(); !cleaned) return cleaned.error();
        if (is_cancelled(0.0, "analysing")) return cancelled_error();
        analyse();
        if (is_cancelled(clustering_begins, "clustering")) return cancelled_error();
        {
            const Result<Clustering> clustering = cluster(clusterer);
            if (!clustering) return clustering.error();
            if (options_.team) limit_threads(options_.threads_alone);
            if (is_cancelled(clustering_ends, "ordering")) return cancelled_error();
            order(*clustering);
            place_vertices(*clustering);
            release(surface_.areas); // bounding is what takes most memory
            release(surface_.normals);
        }
        if (is_cancelled(0.8, "bounding")) return cancelled_error();
        bound();
        if (is_textured()) lay_texture();

        g_->closedness = surface_.closedness;
        g_->dropped_triangles = clean_.dropped + options_.dropped_before;
        g_->ranges.assign(source_.ranges.begin(), source_.ranges.end());
        g_->document = std::vector<std::byte>(source_.document.begin(), source_.document.end());
        auto data = std::make_shared<VertexTree::Data>();
        data->light = std::make_shared<TreeLuminance>(
            derive_luminance(*g_, *parts_, options_.light, prelit_, is_textured(), nullptr));
        data->geometry = std::move(g_);
        if (is_cancelled(1.0, "done")) return cancelled_error();
        return VertexTree(std::move(data));
    }

    Result<void> help() {
        if (const auto cleaned = clean_up(); !cleaned) return cleaned.error();
        analyse();
        const std::vector<float> luminance = find_luminance();
        const auto helped =
            cluster_quadric({mesh_, luminance, surface_.normals, surface_.areas, coincident_}, {}, options_.team);
        return helped ? Result<void>() : helped.error();
    }

private:
    bool is_cancelled(double share, const char* stage) const {
        return options_.progress && !options_.progress(share, stage);
    }

    // 0: no limit. Until the tree is built.
    void limit_threads(int threads) {
        limit_.reset();
        if (threads > 0)
            limit_.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
    }

    Result<void> clean_up() {
        if (const auto valid = check_buildable(source_, options_); !valid) return valid.error();
        limit_threads(options_.threads);
        clean_ = clean(source_);
        if (mesh_.triangles.empty())
            return Error{ErrorCode::malformed_data, "The mesh has no triangle with three different vertices."};
        return {};
    }

    void analyse() {
        prelit_ = options_.prelit && (!mesh_.colours.empty() || is_textured());
        coincident_ = find_coincident(mesh_.positions);
        surface_ = analyse_surface(mesh_, coincident_);
    }

    std::vector<float> find_luminance() const {
        std::vector<float> luminance(mesh_.positions.size());
        parallel_loop(std::size_t{0}, luminance.size(), [&](std::size_t v) {
            luminance[v] = vertex_luminance(surface_.normals[v], mesh_.colours.empty() ? nullptr : &mesh_.colours[v],
                                            options_.light, prelit_, is_textured());
        });
        return luminance;
    }

    Result<Clustering> cluster(const Clusterer& clusterer) {
        const std::vector<float> luminance = find_luminance();
        Result<Clustering> clustering = clusterer({mesh_, luminance, surface_.normals, surface_.areas, coincident_});
        if (clustering)
            if (const auto valid = check(*clustering, mesh_.positions.size()); !valid) return valid.error();
        return clustering;
    }

    void order(const Clustering& clustering) {
        const Index vertices = static_cast<Index>(mesh_.positions.size());
        nodes_ = order_nodes(clustering, vertices, static_cast<Index>(clean_.unreferenced.size()));
        std::vector<Index> source_vertices(nodes_.leaf_of_vertex.size());
        parallel_loop(Index{0}, static_cast<Index>(source_vertices.size()), [&](Index v) {
            source_vertices[nodes_.leaf_of_vertex[v]] =
                v < vertices ? clean_.source_vertex(v) : clean_.unreferenced[v - vertices];
        });
        g_->source_vertices = std::move(source_vertices);
        parts_.emplace(links_of(nodes_.shape));
    }

    void place_vertices(const Clustering& clustering) {
        const Index vertices = static_cast<Index>(mesh_.positions.size());
        g_->origin = choose_origin(source_.positions);
        // By leaf: weights, and normals of the leaves.
        ParallelArray<double> weights(nodes_.shape.leaves());
        ParallelArray<glm::vec3> normals(nodes_.shape.leaves());
        parallel_loop(Index{0}, vertices, [&](Index v) {
            weights[nodes_.leaf_of_vertex[v]] = surface_.areas[v];
            normals[nodes_.leaf_of_vertex[v]] = surface_.normals[v];
        });
        ProxyVertices proxies =
            place_proxies(nodes_.shape, *parts_, {source_, g_->source_vertices, weights, normals, g_->origin},
                          {clustering.positions, nodes_.node_of_cluster});
        g_->positions = std::move(proxies.positions);
        g_->normals = std::move(proxies.normals);
        g_->colours = std::move(proxies.colours);
        g_->uvs = std::move(proxies.uvs);
    }

    void bound() {
        TreeShape& shape = nodes_.shape;
        const Ancestors ancestors(shape);
        TriangleOrder triangles = order_triangles(mesh_.triangles, nodes_, ancestors);
        if (!source_.ranges.empty()) {
            for (Index& t : triangles.sources) t = clean_.source_triangle(t);
            g_->source_triangles = std::move(triangles.sources);
        }
        release(triangles.sources);
        const LeafPlaces places = find_places();
        release(coincident_);
        release(surface_.irregular);
        release(nodes_.leaf_of_vertex);
        release(nodes_.node_of_cluster);
        TreeParts& parts = *parts_;
        parts.assign_triangles(triangles.first_triangle, triangles.triangles);
        const LeafRings rings = find_rings(triangles.triangles, places, parts);
        const BoundInput input{shape, parts, rings, g_->positions};

        NodeSpheres spheres = bound_spheres(input);
        g_->bounding_sphere = bound_corners(input);
        g_->displacement = bound_displacements(input, spheres.support);
        const ParallelArray<Directions> facing =
            bound_facing(input, triangles.triangles, places, spheres.support, ancestors);
        g_->support_spheres = std::move(spheres.support);
        const std::vector<std::uint8_t> is_translucent = find_translucent(triangles.triangles);
        std::vector<NodeBounds> bounds(shape.interior());
        parallel_loop(NodeId{0}, shape.interior(), [&](NodeId node) {
            const int irregular = facing[node].marked() ? irregular_ring : 0;
            const int translucent = is_translucent.empty() || !is_translucent[node] ? 0 : translucent_ring;
            bounds[node] = {spheres.ring[node], facing[node].slabs(),
                            static_cast<std::uint8_t>(irregular | translucent), 0};
        });
        PooledMasks masks = pool_masks(facing, shape.parents);
        g_->bounds = std::move(bounds);
        g_->mask_at = std::move(masks.at);
        g_->mask_records = std::move(masks.records);
        g_->parents = std::move(shape.parents);
        g_->first_leaf = std::move(shape.first_leaf);
        g_->leaf_end = std::move(shape.leaf_end);
        g_->subtree_end = std::move(shape.subtree_end);
        g_->first_triangle = std::move(triangles.first_triangle);
        g_->triangles = std::move(triangles.triangles);
    }

    LeafPlaces find_places() const {
        const std::size_t leaves = nodes_.shape.leaves();
        LeafPlaces places;
        places.weld.resize(leaves);
        std::iota(places.weld.begin(), places.weld.end(), Index{0});
        places.irregular.assign(leaves, 0);
        places.alone.assign(leaves, 1);
        parallel_loop(std::size_t{0}, mesh_.positions.size(), [&](std::size_t v) {
            const Index leaf = nodes_.leaf_of_vertex[v], place = nodes_.leaf_of_vertex[coincident_[v]];
            places.weld[leaf] = place;
            places.irregular[leaf] = surface_.irregular[v];
            if (leaf == place) return;
            places.alone[leaf] = 0;
            std::atomic_ref(places.alone[place]).store(0, std::memory_order_relaxed);
        });
        return places;
    }

    bool is_textured() const { return !source_.texture.empty(); }

    void lay_texture() {
        const TextureView& texture = source_.texture;
        g_->texture = std::vector<TextureFacts>{{texture.width, texture.height, texture.wrap_u, texture.wrap_v}};
        g_->texels = std::vector<Texel>(texture.texels.begin(), texture.texels.end());
        std::vector<glm::vec2> uvs = TextureFits(*g_, *parts_).fitted_uvs(bound_footprints(*g_, *parts_));
        g_->uvs = std::move(uvs);
        g_->ring_texture = bound_ring_texture(*g_, *parts_);
    }

    // By interior node: whether a corner of its ring has an alpha below 1. Empty where none has.
    std::vector<std::uint8_t> find_translucent(std::span<const Triangle> triangles) const {
        const TreeShape& shape = nodes_.shape;
        const auto shows_through = [&](Index leaf) { return !(g_->colours[shape.node_of_leaf(leaf)].a >= 1); };
        const Index leaves = g_->colours.empty() ? 0 : shape.leaves();
        bool any = false;
        for (Index leaf = 0; leaf < leaves && !any; ++leaf) any = shows_through(leaf);
        if (!any) return {};
        std::vector<std::uint8_t> translucent(shape.interior(), 0);
        for (const Triangle& t : triangles)
            if (std::any_of(t.begin(), t.end(), shows_through))
                for (const Index leaf : t) translucent[shape.parents[shape.node_of_leaf(leaf)]] = 1;
        for (NodeId node = shape.interior(); node-- > 1;) translucent[shape.parents[node]] |= translucent[node];
        return translucent;
    }

    const MeshView& source_;
    const BuildOptions& options_;
    std::optional<tbb::global_control> limit_;
    CleanMesh clean_;
    const MeshView& mesh_ = clean_.view;

    bool prelit_ = false;
    std::vector<Index> coincident_;
    Surface surface_;
    NodeOrder nodes_;
    std::optional<TreeParts> parts_;
    std::shared_ptr<TreeGeometry> g_ = std::make_shared<TreeGeometry>();
};

} // namespace

std::string_view name(ClustererKind kind) { return kind == ClustererKind::quadric ? "quadric" : "octree"; }

Result<void> check_buildable(const MeshView& mesh, const BuildOptions& options) {
    if (const auto valid = validate(mesh); !valid) return valid.error();
    if (const auto valid = check_attributes(mesh); !valid) return valid.error();
    if (const auto valid = check(options.light); !valid) return valid.error();
    if (options.threads < 0 || options.threads_alone < 0)
        return invalid_argument("The number of threads must be 0 or more.");
    return {};
}

Result<VertexTree> build_tree(const MeshView& mesh, const Clusterer& clusterer, const BuildOptions& options) {
    if (options.team)
        return invalid_argument(
            "A team helps with quadric clustering only: leave it out where the clustering is your own.");
    return TreeBuilder(mesh, options).build(clusterer);
}

Result<void> help_build_tree(const MeshView& mesh, const BuildOptions& options) {
    if (!options.team || options.team->rank() < 1)
        return invalid_argument("Only members of a team other than its first help to build a tree.");
    if (options.clusterer != ClustererKind::quadric) return check_buildable(mesh, options);
    return TreeBuilder(mesh, options).help();
}

Result<VertexTree> build_tree(const MeshView& mesh, const BuildOptions& options) {
    const auto report = [&](double share, const char* stage) {
        return options.progress(clustering_begins + share * (clustering_ends - clustering_begins), stage);
    };
    const Progress progress = options.progress ? Progress(report) : Progress();
    return TreeBuilder(mesh, options).build([&](const ClusterInput& input) {
        return options.clusterer == ClustererKind::octree ? cluster_octree(input, progress)
                                                          : cluster_quadric(input, progress, options.team);
    });
}

} // namespace unseen::vdtree
