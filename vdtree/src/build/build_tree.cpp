// From a mesh and a clustering to a vertex tree: order the nodes, find where triangles vanish, bound every fold.
#include <unseen/vdtree/builder.h>

#include <optional>

#include <glm/geometric.hpp>
#include <tbb/global_control.h>

#include "build/bound_displacements.h"
#include "build/bound_facing.h"
#include "build/bound_spheres.h"
#include "build/leaves.h"
#include "build/needs.h"
#include "build/order_nodes.h"
#include "build/parallel_array.h"
#include "build/place_proxies.h"
#include "build/protection.h"
#include "build/spatial_order.h"
#include "build/surface.h"
#include "build/wedges.h"
#include "tree/mask_pool.h"
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/normal_mask.h>
#include <unseen/vdtree/internal/number_format.h>
#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/team.h>
#include <unseen/vdtree/internal/texture_bounds.h>
#include <unseen/vdtree/internal/texture_pyramid.h>
#include <unseen/vdtree/internal/vectors.h>
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

template <class T>
std::vector<T> select(std::span<const T> values, std::span<const Index> which) {
    std::vector<T> out;
    if (values.empty()) return out;
    out.reserve(which.size());
    for (const Index i : which) out.push_back(values[i]);
    return out;
}

Error cancelled_error() { return {ErrorCode::cancelled, "Building the tree was cancelled."}; }

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
        if (const auto begun = begin(); !begun) return begun.error();
        if (is_cancelled(0.0, "analysing")) return cancelled_error();
        analyse();
        if (is_cancelled(clustering_begins, "clustering")) return cancelled_error();
        {
            const Result<Clustering> clustering = cluster(clusterer);
            if (!clustering) return clustering.error();
            if (options_.team) limit_threads(options_.threads_alone);
            if (is_cancelled(clustering_ends, "ordering")) return cancelled_error();
            order(*clustering);
        }
        if (is_cancelled(0.8, "bounding")) return cancelled_error();
        const Ancestors ancestors(nodes_.shape);
        bound(ancestors);
        find_vertices(ancestors);
        take_links();
        if (places_->has_seams()) { // else leaves are places
            parts_.emplace(links_of(*g_));
            parts_->assign_triangles(g_->first_triangle, g_->triangles);
        }
        if (is_textured()) lay_texture();
        mark_translucent();
        find_what_nodes_need();

        g_->closedness = surface_.closedness;
        g_->creases = places_->creases();
        g_->dropped_triangles = places_->dropped() + options_.dropped_before;
        g_->source_vertex_count = static_cast<Index>(source_.positions.size());
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
        if (const auto begun = begin(); !begun) return begun.error();
        analyse();
        const auto helped =
            with_cluster_input([&](const ClusterInput& input) { return cluster_quadric(input, {}, options_.team); });
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

    Result<void> begin() {
        if (const auto valid = check_buildable(source_, options_); !valid) return valid.error();
        limit_threads(options_.threads);
        places_.emplace(source_);
        if (places_->mesh().triangles.empty())
            return Error{ErrorCode::malformed_data,
                         "The mesh has no triangle with corners at three different positions."};
        return {};
    }

    void analyse() {
        prelit_ = options_.prelit && (!source_.colours.empty() || is_textured());
        surface_ = analyse_surface(places_->mesh());
        places_->find_leaves(surface_, options_.crease);
        weights_ = place_weights(*places_, source_, surface_.corners, options_.border_weight);
        surface_.corners = {};
        surface_.faces = {};
        uvs_ = select(source_.uvs, places_->sources());
        colours_ = select(source_.colours, places_->sources());
    }

    // What clusterers see. By place, normals and luminances are the means of the leaves there.
    Result<Clustering> with_cluster_input(const Clusterer& clusterer) const {
        const std::size_t places = places_->mesh().positions.size();
        constexpr std::ptrdiff_t fewest = 2; // places that may fold
        if (!weights_.empty() && std::ranges::count_if(weights_, may_fold) < fewest)
            return Clustering{std::vector<Index>(places + 1, static_cast<Index>(places)), {}};
        std::vector<float> leaf_luminance(places_->leaf_count()), luminance(places);
        parallel_loop(std::size_t{0}, leaf_luminance.size(), [&](std::size_t leaf) {
            leaf_luminance[leaf] =
                vertex_luminance(places_->normals()[leaf], colours_.empty() ? nullptr : &colours_[leaf], options_.light,
                                 prelit_, is_textured());
        });
        std::vector<glm::vec3> normals(places);
        parallel_loop(Index{0}, static_cast<Index>(places), [&](Index place) {
            const Index begin = places_->first_leaf(place), end = places_->first_leaf(place + 1);
            if (end - begin == 1) {
                luminance[place] = leaf_luminance[begin];
                normals[place] = places_->normals()[begin];
                return;
            }
            glm::dvec3 normal(0);
            double sum = 0;
            for (Index leaf = begin; leaf < end; ++leaf) {
                sum += static_cast<double>(leaf_luminance[leaf]);
                normal += glm::dvec3(places_->normals()[leaf]);
            }
            luminance[place] = static_cast<float>(sum / (end - begin));
            normals[place] = glm::vec3(unit(normal));
        });
        const LeafView leaves{
            places_->triangles(), places_->places(),       leaf_luminance, places_->normals(), colours_, uvs_,
            places_->materials(), !source_.normals.empty()};
        return clusterer(ClusterInput{places_->mesh(), luminance, normals, surface_.areas, leaves, weights_});
    }

    Result<Clustering> cluster(const Clusterer& clusterer) const {
        Result<Clustering> clustering = with_cluster_input(clusterer);
        if (clustering)
            if (const auto valid = check(*clustering, places_->mesh().positions.size()); !valid) return valid.error();
        if (clustering && !std::ranges::all_of(weights_, may_fold)) return with_locked_apart(*clustering, weights_);
        return clustering;
    }

    // Numbers the places, places the proxies.
    void order(const Clustering& clustering) {
        const MeshView& mesh = places_->mesh();
        nodes_ = order_nodes(clustering, static_cast<Index>(mesh.positions.size()));
        parts_.emplace(links_of(nodes_.shape));
        g_->origin = choose_origin(source_.positions);
        positions_ =
            place_proxies(nodes_.shape, *parts_, {mesh.positions, surface_.areas, nodes_.leaf_of_vertex, g_->origin},
                          {clustering.positions, nodes_.node_of_cluster});
        g_->fold_weights = fold_weights(nodes_, weights_);
        g_->locked_positions = locked_positions(nodes_, weights_, mesh.positions, g_->origin);
        release(weights_);
        release(surface_.areas); // bounding is what takes most memory
        release(surface_.normals);
        release(nodes_.node_of_cluster);
    }

    // Bounds of what folds do to the surface, which know places only.
    void bound(const Ancestors& ancestors) {
        const TreeShape& shape = nodes_.shape;
        order_ = order_triangles(places_->mesh().triangles, nodes_, ancestors);
        TreeParts& parts = *parts_;
        parts.assign_triangles(order_.first_triangle, order_.triangles);
        std::vector<std::uint8_t> irregular(shape.leaves());
        parallel_loop(std::size_t{0}, irregular.size(),
                      [&](std::size_t v) { irregular[nodes_.leaf_of_vertex[v]] = surface_.irregular[v]; });
        release(surface_.irregular);
        const LeafRings rings = find_rings(order_.triangles, irregular, parts);
        const BoundInput input{shape, parts, rings, positions_};

        NodeSpheres spheres = bound_spheres(input);
        g_->bounding_sphere = bound_corners(input);
        g_->displacement = bound_displacements(input, order_.triangles, irregular, spheres.support);
        const ParallelArray<Directions> facing =
            bound_facing(input, order_.triangles, irregular, spheres.support, ancestors);
        g_->support_spheres = std::move(spheres.support);
        bounds_.resize(shape.interior());
        parallel_loop(NodeId{0}, shape.interior(), [&](NodeId node) {
            const int irregular_flag = facing[node].marked() ? irregular_ring : 0;
            bounds_[node] = {spheres.ring[node], facing[node].slabs(), static_cast<std::uint8_t>(irregular_flag), 0};
        });
        PooledMasks masks = pool_masks(facing, shape.parents);
        g_->mask_at = std::move(masks.at);
        g_->mask_records = std::move(masks.records);
    }

    // The wedges of the nodes; from here on corners are leaves.
    void find_vertices(const Ancestors& ancestors) {
        const Index places = nodes_.shape.leaves(), leaves = places_->leaf_count();
        // Leaves in the order of the tree's places.
        std::vector<Index> place_at(places), first_leaf, given(leaves), number(leaves);
        parallel_loop(Index{0}, places, [&](Index v) { place_at[nodes_.leaf_of_vertex[v]] = v; });
        release(nodes_.leaf_of_vertex);
        Index next = 0;
        for (Index place = 0; place < places; ++place) {
            if (places_->has_seams()) first_leaf.push_back(next);
            for (Index leaf = places_->first_leaf(place_at[place]); leaf < places_->first_leaf(place_at[place] + 1);
                 ++leaf) {
                given[next] = leaf;
                number[leaf] = next++;
            }
        }
        if (places_->has_seams()) first_leaf.push_back(next);
        std::vector<Triangle> triangles(order_.triangles.size());
        parallel_loop(std::size_t{0}, triangles.size(), [&](std::size_t t) {
            for (std::size_t k = 0; k < 3; ++k) triangles[t][k] = number[places_->triangles()[order_.sources[t]][k]];
        });
        release(order_.triangles);
        const std::vector<glm::vec3> normals = select(places_->normals(), given);
        uvs_ = select(std::span<const glm::vec2>(uvs_), given);
        colours_ = select(std::span<const glm::vec4>(colours_), given);
        const std::vector<Index> materials = select(places_->materials(), given);
        const std::vector<Index> further = select(places_->further(), given);
        NodeWedges wedges = find_wedges(
            nodes_.shape, *parts_, positions_,
            {first_leaf, triangles, order_.first_triangle, normals, uvs_, colours_, materials, further}, ancestors);
        if (!wedges.leaf_numbers.empty())
            for (Triangle& t : triangles)
                for (Index& leaf : t) leaf = wedges.leaf_numbers[leaf];
        std::vector<Index> sources(leaves);
        for (Index leaf = 0; leaf < leaves; ++leaf)
            sources[wedges.leaf_numbers.empty() ? leaf : wedges.leaf_numbers[leaf]] = places_->sources()[given[leaf]];
        g_->source_vertices = std::move(sources);
        g_->triangles = std::move(triangles);
        g_->positions = std::move(wedges.positions);
        g_->normals = std::move(wedges.normals);
        g_->uvs = std::move(wedges.uvs);
        g_->colours = std::move(wedges.colours);
        count_leaves(first_leaf);
        g_->several = std::move(wedges.links.several);
        g_->extra_wedges = std::move(wedges.links.extra_wedges);
        g_->further = std::move(wedges.links.further);
        g_->leaf_ranks = std::move(wedges.links.leaf_ranks);
        g_->wedge_ranks = std::move(wedges.links.wedge_ranks);
    }

    // Up to here nodes have supported ranges of places.
    void count_leaves(std::span<const Index> first_leaf) {
        if (first_leaf.empty()) return;
        for (Index& leaf : nodes_.shape.first_leaf) leaf = first_leaf[leaf];
        for (Index& leaf : nodes_.shape.leaf_end) leaf = first_leaf[leaf];
    }

    void take_links() {
        TreeShape& shape = nodes_.shape;
        g_->parents = std::move(shape.parents);
        g_->first_leaf = std::move(shape.first_leaf);
        g_->leaf_end = std::move(shape.leaf_end);
        g_->subtree_end = std::move(shape.subtree_end);
        g_->first_triangle = std::move(order_.first_triangle);
        if (source_.ranges.empty()) return;
        for (Index& t : order_.sources) t = places_->source_triangle(t);
        g_->source_triangles = std::move(order_.sources);
    }

    bool is_textured() const { return !source_.texture.empty(); }

    void lay_texture() {
        const TextureView& texture = source_.texture;
        g_->texture = std::vector<TextureFacts>{{texture.width, texture.height, texture.wrap_u, texture.wrap_v}};
        const auto copy = [](std::span<const Texel> texels) {
            return std::vector<Texel>(texels.begin(), texels.end());
        };
        g_->texels = copy(texture.texels), g_->emission = copy(texture.emission), g_->relief = copy(texture.relief);
        if (texture.blends) g_->blends = std::vector<std::byte>(1);
        g_->ring_texture = bound_ring_texture(*g_, *parts_);
    }

    void find_what_nodes_need() {
        NeedArrays<Vector> needs = find_needs(*g_);
        g_->needing = std::move(needs.needing);
        g_->first_need = std::move(needs.first_need);
        g_->needs = std::move(needs.needs);
    }

    // Nodes with a corner of the ring that has an alpha below 1, or with texels in it that are not there.
    void mark_translucent() {
        const TreeLinks links = links_of(*g_);
        const CutOuts cut_outs(source_.texture);
        const auto has_alpha = [&](Index leaf) { return !(g_->colours[links.wedge_of_leaf(leaf)].a >= 1); };
        const auto shows_through = [&](const Triangle& t) {
            if (!g_->colours.empty() && std::ranges::any_of(t, has_alpha)) return true;
            if (cut_outs.is_empty()) return false;
            UvBox box;
            for (const Index leaf : t) box.include(g_->uvs[links.wedge_of_leaf(leaf)]);
            return cut_outs.any(box);
        };
        const auto mark = [&](NodeId node) {
            bounds_[node].flags = static_cast<std::uint8_t>(bounds_[node].flags | translucent_ring);
        };
        bool any = false;
        for (const Triangle& t : g_->triangles) {
            if (!shows_through(t)) continue;
            for (const Index leaf : t) mark(links.parents[links.place_of_leaf(leaf)]);
            any = true;
        }
        for (NodeId node = any ? links.interior() : 0; node-- > 1;)
            if (bounds_[node].flags & translucent_ring) mark(links.parents[node]);
        g_->bounds = std::move(bounds_);
    }

    const MeshView& source_;
    const BuildOptions& options_;
    std::optional<tbb::global_control> limit_;
    std::optional<PlaceMesh> places_;

    bool prelit_ = false;
    Surface surface_;
    std::vector<float> weights_; // by place; empty: 1 for all
    std::vector<glm::vec2> uvs_; // by leaf, as the next
    std::vector<glm::vec4> colours_;
    NodeOrder nodes_;
    TriangleOrder order_;
    std::vector<glm::vec3> positions_; // by node
    std::vector<NodeBounds> bounds_;
    std::optional<TreeParts> parts_;
    std::shared_ptr<TreeGeometry> g_ = std::make_shared<TreeGeometry>();
};

} // namespace

std::string_view name(ClustererKind kind) { return kind == ClustererKind::quadric ? "quadric" : "octree"; }

Result<void> check_buildable(const MeshView& mesh, const BuildOptions& options) {
    if (const auto valid = validate(mesh); !valid) return valid.error();
    if (const auto valid = check_attributes(mesh); !valid) return valid.error();
    if (const auto valid = check(options.light); !valid) return valid.error();
    if (const auto valid = check_crease(options.crease); !valid) return valid.error();
    if (!is_fold_weight(options.border_weight))
        return invalid_argument("The weight of borders must be from 1 to 1000, or infinite: they never fold.");
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
