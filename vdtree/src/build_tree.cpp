// From a mesh and a clustering to a vertex tree: order the nodes, find where triangles vanish, bound every fold.
#include <vdtree/builder.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <string>

#include <glm/geometric.hpp>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include "bounding_sphere.h"
#include "surface.h"
#include "tree_draft.h"
#include "unit_vector.h"

namespace unseen::vdtree {

namespace {

// Masks of clusters with more triangles on their border than this are filled: such clusters are a good part of the model,
// mixed from almost everywhere, and counting their normals again at every merge would cost the square of the size.
constexpr std::size_t most_border_triangles = 4096;
// Displacements of clusters with more leaves than this are bounded through their children's for the same reason.
constexpr Index most_measured_leaves = 4096;

// What is known of a set of normals.
struct Directions {
    NormalMask mask;
    NormalSlabs slabs;

    void insert(glm::dvec3 normal) {
        normal = unit(normal);
        const int cell = normal_cell(normal);
        if (cell < 0) return; // a triangle without an area shows nothing
        mask.insert(cell);
        slabs.insert(normal);
    }
    Directions& operator|=(const Directions& other) {
        mask |= other.mask;
        slabs |= other.slabs;
        return *this;
    }
    static Directions everything() {
        Directions all;
        all.mask.faces.fill(~std::uint64_t{0});
        all.slabs = NormalSlabs::everything();
        return all;
    }
};

// What of the whole build is done when clustering begins and ends.
constexpr double clustering_begins = 0.1, clustering_ends = 0.7;

// Positions beyond this, relative to the origin, leave no room for spheres around them in floats.
constexpr double largest_coordinate = std::numeric_limits<float>::max() / 16;

// Tells the caller how far the build is.
class Reporter {
public:
    explicit Reporter(Progress progress) : progress_(progress) {}
    bool cancelled(double share, const char* stage) { return progress_ && !progress_(share, stage); }

private:
    Progress progress_;
};

Error cancelled_error() { return {ErrorCode::cancelled, "Building the tree was cancelled."}; }

// The input less what cannot be built on: triangles that use a vertex twice, and vertices that no triangle uses
// (these come back as leaves of a subtree of their own).
struct CleanMesh {
    Mesh storage; // used where something had to go
    MeshView view;
    std::vector<Index> source_vertices;   // by clean vertex
    std::vector<Index> unreferenced;      // source vertices
    std::vector<Index> source_triangles;  // by clean triangle
    std::uint64_t dropped = 0;
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
        const Triangle& tri = mesh.triangles[t];
        if (tri[0] == tri[1] || tri[1] == tri[2] || tri[2] == tri[0]) {
            ++out.dropped;
            continue;
        }
        out.source_triangles.push_back(static_cast<Index>(t));
        for (const Index v : tri) used[v] = 1;
    }
    std::vector<Index> clean_number(mesh.positions.size(), 0);
    for (std::size_t v = 0; v < used.size(); ++v) {
        clean_number[v] = static_cast<Index>(out.source_vertices.size());
        (used[v] ? out.source_vertices : out.unreferenced).push_back(static_cast<Index>(v));
    }
    if (out.dropped == 0 && out.unreferenced.empty()) {
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

// The origin of the tree's float positions. Float coordinates stay exact: where all coordinates of an axis have one sign
// and the largest is at most twice the smallest, their differences are exact (Sterbenz), else the axis keeps 0.
// Coordinates of double precision then lose at most half a unit in the last place of a float of the extent's size.
glm::dvec3 choose_origin(std::span<const glm::dvec3> positions) {
    glm::dvec3 low = positions[0], high = low, origin(0);
    for (const glm::dvec3& p : positions) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    for (int axis = 0; axis < 3; ++axis) {
        const double a = low[axis], b = high[axis];
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
    const auto invalid = [](const std::string& what) { return Error{ErrorCode::invalid_argument, what}; };
    if (c.parents.size() <= vertices)
        return invalid("The clustering of " + std::to_string(vertices) + " vertices has only " +
                       std::to_string(c.parents.size()) + " clusters; it needs the vertices and a root.");
    if (c.parents.size() >= no_node) return invalid("The clustering has more than 2^32 - 2 clusters.");
    if (!c.positions.empty() && c.positions.size() != c.parents.size() - vertices)
        return invalid("The clustering has " + std::to_string(c.positions.size()) + " proxies for " +
                       std::to_string(c.parents.size() - vertices) + " clusters.");
    const std::size_t root = c.parents.size() - 1;
    for (std::size_t i = 0; i < root; ++i) {
        if (!(c.parents[i] > i && c.parents[i] <= root) || c.parents[i] < vertices)
            return invalid("Cluster " + std::to_string(i) + " has the parent " + std::to_string(c.parents[i]) +
                           "; a parent is a cluster with a higher number.");
    }
    std::vector<std::uint8_t> has_child(c.parents.size(), 0);
    for (std::size_t i = 0; i < root; ++i) has_child[c.parents[i]] = 1;
    for (std::size_t i = vertices; i <= root; ++i)
        if (!has_child[i]) return invalid("Cluster " + std::to_string(i) + " has no children.");
    for (std::size_t i = 0; i < c.positions.size(); ++i)
        if (!fits_floats(c.positions[i]))
            return invalid("The proxy of cluster " + std::to_string(vertices + i) + " is not finite or too far away.");
    return {};
}

Result<void> check(const Light& light) {
    const float length = glm::length(light.direction);
    constexpr float unit_slack = 1e-3f; // directions given with three digits
    if (!(std::abs(length - 1) <= unit_slack) || !(light.ambient >= 0 && light.ambient <= 1))
        return Error{ErrorCode::invalid_argument,
                     "The light needs a direction of length 1 and an ambient share from 0 to 1."};
    return {};
}

// What validate() lets pass, but the tree's floats do not.
Result<void> check_attributes(const MeshView& mesh) {
    const auto invalid = [](const char* what, std::size_t vertex) {
        return Error{ErrorCode::malformed_data, std::string(what) + " of vertex " + std::to_string(vertex) + "."};
    };
    for (std::size_t v = 0; v < mesh.positions.size(); ++v)
        if (!fits_floats(mesh.positions[v])) return invalid("The position is too far away for floats:", v);
    for (std::size_t v = 0; v < mesh.colours.size(); ++v) {
        const glm::vec4 c = mesh.colours[v];
        if (!std::isfinite(c.r) || !std::isfinite(c.g) || !std::isfinite(c.b) || !std::isfinite(c.a))
            return invalid("A value is not finite in the colour", v);
    }
    for (std::size_t v = 0; v < mesh.uvs.size(); ++v)
        if (!std::isfinite(mesh.uvs[v].x) || !std::isfinite(mesh.uvs[v].y))
            return invalid("A value is not finite in the texture coordinates", v);
    return {};
}

// Builds one tree. The clusters keep their creation order ("build order") until assign_nodes() numbers the nodes.
class TreeBuilder {
public:
    TreeBuilder(const MeshView& source, const CleanMesh& mesh, const BuildOptions& options, Reporter& reporter)
        : source_(source), mesh_(mesh.view), clean_(mesh), options_(options), reporter_(reporter) {}

    Result<VertexTree> build(Clusterer clusterer);

private:
    Result<void> prepare(Clusterer clusterer);
    void assign_nodes(const Clustering& clustering);
    void fill_vertices(const Clustering& clustering);
    void fold_in_build_order(const Clustering& clustering);
    void sort_triangles();
    void bound_spheres();
    void bound_displacements();
    void bound_facing();

    // Calls f for each interior child, and for each leaf that is a child itself.
    template <class Child, class Leaf>
    void for_each_child(NodeId node, Child&& on_child, Leaf&& on_leaf) const {
        NodeId child = node + 1;
        for (Index leaf = draft_.first_leaf[node]; leaf < draft_.leaf_end[node];) {
            if (child < draft_.subtree_end[node] && draft_.first_leaf[child] == leaf) {
                on_child(child);
                leaf = draft_.leaf_end[child];
                child = draft_.subtree_end[child];
            } else {
                on_leaf(leaf++);
            }
        }
    }

    NodeId interior() const { return static_cast<NodeId>(draft_.first_leaf.size()); }
    glm::dvec3 position(NodeId node) const { return glm::dvec3(draft_.positions[node]); }

    const MeshView& source_;
    const MeshView& mesh_;
    const CleanMesh& clean_;
    const BuildOptions& options_;
    Reporter& reporter_;

    std::vector<Index> coincident_;
    std::vector<double> areas_;
    std::vector<glm::vec3> normals_;
    SurfaceTopology topology_;
    std::vector<NodeId> node_of_cluster_;        // build order to node
    std::vector<NodeId> vanishing_node_;         // by clean triangle
    std::vector<Directions> folded_normals_;     // by interior node: normals of its border after the fold
    std::vector<Index> ring_start_, ring_items_; // by leaf: the triangles around it
    TreeDraft draft_;
};

Result<VertexTree> TreeBuilder::build(Clusterer clusterer) {
    if (reporter_.cancelled(0.0, "analysing")) return cancelled_error();
    coincident_ = find_coincident(mesh_.positions);
    topology_ = analyse_topology(mesh_, coincident_);
    areas_ = vertex_areas(mesh_);
    normals_ = vertex_normals(mesh_, coincident_, topology_.closedness);

    std::vector<float> luminance(mesh_.positions.size());
    const bool prelit = !mesh_.colours.empty();
    for (std::size_t v = 0; v < luminance.size(); ++v)
        luminance[v] = vertex_luminance(normals_[v], prelit ? &mesh_.colours[v] : nullptr, options_.light, prelit);
    if (reporter_.cancelled(clustering_begins, "clustering")) return cancelled_error();
    Result<Clustering> clustering = clusterer({mesh_, luminance, normals_, areas_, coincident_});
    if (!clustering) return clustering.error();
    if (const auto valid = check(*clustering, mesh_.positions.size()); !valid) return valid.error();

    if (reporter_.cancelled(clustering_ends, "ordering")) return cancelled_error();
    assign_nodes(*clustering);
    fill_vertices(*clustering);
    fold_in_build_order(*clustering);
    sort_triangles();
    if (reporter_.cancelled(0.8, "bounding")) return cancelled_error();
    bound_spheres();
    bound_displacements();
    bound_facing();

    draft_.closedness = topology_.closedness;
    draft_.dropped_triangles = clean_.dropped + options_.dropped_before;
    draft_.ranges.assign(source_.ranges.begin(), source_.ranges.end());
    auto data = std::make_shared<VertexTree::Data>();
    data->geometry = std::make_shared<const TreeGeometry>(pack(std::move(draft_)));
    data->light = derive_luminance(*data->geometry, options_.light, prelit);
    if (reporter_.cancelled(1.0, "done")) return cancelled_error();
    return VertexTree(std::move(data));
}

// Numbers the nodes in depth-first pre-order, passing over clusters with one child. Unreferenced vertices get a subtree of
// their own beside the clustering's root.
void TreeBuilder::assign_nodes(const Clustering& clustering) {
    const Index clusters = static_cast<Index>(clustering.parents.size());
    const Index vertices = static_cast<Index>(mesh_.positions.size());
    const Index lone = static_cast<Index>(clean_.unreferenced.size());

    // Children in build order, as one array with offsets.
    std::vector<Index> start(clusters + 1, 0), children(clusters - 1);
    for (Index c = 0; c + 1 < clusters; ++c) ++start[clustering.parents[c] + 1];
    std::partial_sum(start.begin(), start.end(), start.begin());
    std::vector<Index> next(start.begin(), start.end() - 1);
    for (Index c = 0; c + 1 < clusters; ++c) children[next[clustering.parents[c]]++] = c;

    node_of_cluster_.assign(clusters, no_node);
    std::vector<Index> leaf_order; // clean vertices, then unreferenced ones, in leaf order
    leaf_order.reserve(vertices + lone);
    std::vector<NodeId> leaf_parents;
    leaf_parents.reserve(vertices + lone);
    TreeDraft& g = draft_;
    std::vector<NodeId> interior_parents;
    const auto open_node = [&](NodeId parent) {
        interior_parents.push_back(parent);
        g.first_leaf.push_back(static_cast<Index>(leaf_order.size()));
        g.leaf_end.push_back(0);
        g.subtree_end.push_back(0);
        return static_cast<NodeId>(g.first_leaf.size() - 1);
    };
    const auto close_node = [&](NodeId node) {
        g.leaf_end[node] = static_cast<Index>(leaf_order.size());
        g.subtree_end[node] = static_cast<NodeId>(g.first_leaf.size());
    };

    NodeId top = no_node;
    if (lone > 0) top = open_node(no_node);
    // Depth-first without recursion: a clustering may be as deep as it has vertices.
    struct Visit {
        Index cluster;
        Index child; // next position in `children`
        NodeId node;
    };
    std::vector<Visit> stack;
    const auto enter = [&](Index cluster, NodeId parent) {
        // A cluster with one child is that child. Its parent number stays for the merge simulation.
        if (cluster < vertices) {
            leaf_order.push_back(cluster);
            leaf_parents.push_back(parent);
            return;
        }
        const bool unary = start[cluster + 1] - start[cluster] == 1;
        const NodeId node = unary ? parent : open_node(parent);
        if (!unary) node_of_cluster_[cluster] = node;
        stack.push_back({cluster, start[cluster], node});
    };
    enter(clusters - 1, top);
    while (!stack.empty()) {
        Visit& visit = stack.back();
        if (visit.child == start[visit.cluster + 1]) {
            const bool unary = node_of_cluster_[visit.cluster] == no_node;
            if (!unary) close_node(visit.node);
            stack.pop_back();
            continue;
        }
        const Index child = children[visit.child++];
        enter(child, visit.node);
    }
    if (lone > 0) {
        const NodeId group = lone > 1 ? open_node(top) : top;
        for (Index i = 0; i < lone; ++i) {
            leaf_order.push_back(vertices + i);
            leaf_parents.push_back(group);
        }
        if (group != top) close_node(group);
        close_node(top);
    }

    const NodeId interior_nodes = static_cast<NodeId>(g.first_leaf.size());
    g.parents = std::move(interior_parents);
    g.parents.insert(g.parents.end(), leaf_parents.begin(), leaf_parents.end());
    g.source_vertices.resize(leaf_order.size());
    for (std::size_t leaf = 0; leaf < leaf_order.size(); ++leaf) {
        const Index v = leaf_order[leaf];
        if (v < vertices) node_of_cluster_[v] = interior_nodes + static_cast<NodeId>(leaf);
        g.source_vertices[leaf] = v < vertices ? clean_.source_vertices[v] : clean_.unreferenced[v - vertices];
    }
}

// Positions and attributes of leaves, and of proxies as area-weighted means of their leaves (or the clusterer's position).
void TreeBuilder::fill_vertices(const Clustering& clustering) {
    TreeDraft& g = draft_;
    const NodeId interior_nodes = interior();
    const std::size_t nodes = g.parents.size();
    g.origin = choose_origin(source_.positions);
    g.positions.resize(nodes);
    g.exact_normals.assign(nodes, glm::vec3(0));
    if (!source_.colours.empty()) g.colours.resize(nodes);
    if (!source_.uvs.empty()) g.uvs.resize(nodes);

    struct Sum {
        glm::dvec3 position{0}, normal{0};
        glm::dvec4 colour{0};
        glm::dvec2 uv{0};
        double weight = 0;
    };
    // Every vertex counts a little, so that vertices without an area have a mean too.
    double largest = 0;
    for (const double a : areas_) largest = std::max(largest, a);
    constexpr double least_weight = 1e-6; // share of the largest vertex area
    std::vector<Sum> sums(interior_nodes);
    const auto add = [](Sum& to, const Sum& what) {
        to.position += what.position;
        to.normal += what.normal;
        to.colour += what.colour;
        to.uv += what.uv;
        to.weight += what.weight;
    };
    std::vector<double> weight_of_source(source_.positions.size(), least_weight);
    std::vector<glm::vec3> normal_of_source(source_.positions.size(), glm::vec3(0));
    for (std::size_t v = 0; v < mesh_.positions.size(); ++v) {
        const Index source = clean_.source_vertices[v];
        weight_of_source[source] = (largest > 0 ? areas_[v] / largest : 0) + least_weight;
        normal_of_source[source] = normals_[v];
    }
    for (std::size_t leaf = 0; leaf < g.source_vertices.size(); ++leaf) {
        const NodeId node = interior_nodes + static_cast<NodeId>(leaf);
        const Index v = g.source_vertices[leaf];
        const double w = weight_of_source[v];
        Sum sum;
        const glm::dvec3 relative = source_.positions[v] - g.origin;
        g.positions[node] = glm::vec3(relative);
        g.exact_normals[node] = normal_of_source[v];
        sum.position = w * relative;
        sum.normal = w * glm::dvec3(g.exact_normals[node]);
        if (!g.colours.empty()) sum.colour = w * glm::dvec4(g.colours[node] = source_.colours[v]);
        if (!g.uvs.empty()) sum.uv = w * glm::dvec2(g.uvs[node] = source_.uvs[v]);
        sum.weight = w;
        add(sums[g.parents[node]], sum);
    }
    for (NodeId node = interior_nodes; node-- > 0;) {
        const Sum& sum = sums[node];
        g.positions[node] = glm::vec3(sum.position / sum.weight);
        const double length = glm::length(sum.normal);
        if (length > 0) g.exact_normals[node] = glm::vec3(sum.normal / length);
        if (!g.colours.empty()) g.colours[node] = glm::vec4(sum.colour / sum.weight);
        if (!g.uvs.empty()) g.uvs[node] = glm::vec2(sum.uv / sum.weight);
        if (g.parents[node] != no_node) add(sums[g.parents[node]], sum);
    }
    const Index vertices = static_cast<Index>(mesh_.positions.size());
    for (std::size_t i = 0; i < clustering.positions.size(); ++i) {
        const NodeId node = node_of_cluster_[vertices + i];
        if (node != no_node) g.positions[node] = glm::vec3(clustering.positions[i] - g.origin);
    }
    // Proxies of coincident vertices lie exactly where these are.
    for (NodeId node = interior_nodes; node-- > 0;) {
        const glm::vec3 p = g.positions[interior_nodes + g.first_leaf[node]];
        bool coincident = true;
        for (Index leaf = g.first_leaf[node]; leaf < g.leaf_end[node] && coincident; ++leaf)
            coincident = g.positions[interior_nodes + leaf] == p;
        if (coincident) g.positions[node] = p;
    }
}

// Replays the merges in build order. Finds the node at which each triangle vanishes, and for each node the normals of the
// triangles on its border after the fold, with the other clusters as they stand at that time.
void TreeBuilder::fold_in_build_order(const Clustering& clustering) {
    const Index vertices = static_cast<Index>(mesh_.positions.size());
    const Index clusters = static_cast<Index>(clustering.parents.size());
    const NodeId interior_nodes = interior();
    vanishing_node_.assign(mesh_.triangles.size(), no_node);
    folded_normals_.assign(interior_nodes, {});

    // By live cluster: the live triangles around it. Merged small into large.
    std::vector<std::vector<Index>> around(clusters);
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t)
        for (const Index v : mesh_.triangles[t]) around[v].push_back(static_cast<Index>(t));
    std::vector<Index> cluster_of(mesh_.triangles.size() * 3); // by corner: the live cluster
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t)
        for (std::size_t k = 0; k < 3; ++k) cluster_of[t * 3 + k] = mesh_.triangles[t][k];
    const auto rename = [&](std::span<const Index> triangles, Index from, Index to) {
        for (const Index t : triangles)
            for (std::size_t k = 0; k < 3; ++k)
                if (cluster_of[std::size_t{t} * 3 + k] == from) cluster_of[std::size_t{t} * 3 + k] = to;
    };

    // `identity[c]`: the number under which cluster c's corners are known, its largest descendant's; and back.
    std::vector<Index> identity(clusters), cluster_with(vertices);
    std::iota(identity.begin(), identity.end(), Index{0});
    std::iota(cluster_with.begin(), cluster_with.end(), Index{0});
    std::vector<Index> start(clusters + 1, 0), children(clusters - 1);
    for (Index c = 0; c + 1 < clusters; ++c) ++start[clustering.parents[c] + 1];
    std::partial_sum(start.begin(), start.end(), start.begin());
    std::vector<Index> next(start.begin(), start.end() - 1);
    for (Index c = 0; c + 1 < clusters; ++c) children[next[clustering.parents[c]]++] = c;

    // The node that stands for a cluster; clusters with one child are that child's.
    std::vector<NodeId> node_of(node_of_cluster_);
    std::vector<Index> touched;
    for (Index c = vertices; c < clusters; ++c) {
        const auto kids = std::span(children).subspan(start[c], start[c + 1] - start[c]);
        Index largest = kids[0];
        for (const Index k : kids)
            if (around[k].size() > around[largest].size()) largest = k;
        std::vector<Index> mine = std::move(around[largest]);
        const Index id = identity[c] = identity[largest];
        cluster_with[id] = c;
        if (kids.size() == 1) {
            node_of[c] = node_of[largest];
            around[c] = std::move(mine);
            continue;
        }
        const NodeId node = node_of[c];
        for (const Index k : kids) {
            if (k == largest) continue;
            std::vector<Index> theirs = std::move(around[k]);
            rename(theirs, identity[k], id);
            for (const Index t : theirs) {
                if (vanishing_node_[t] != no_node) continue;
                const Index* corner = &cluster_of[std::size_t{t} * 3];
                if ((corner[0] == id) + (corner[1] == id) + (corner[2] == id) >= 2) {
                    vanishing_node_[t] = node;
                } else {
                    mine.push_back(t);
                }
            }
        }

        Directions& folded = folded_normals_[node];
        if (mine.size() > most_border_triangles) {
            folded = Directions::everything(); // and so is every ancestor's: the list is not looked through again
        } else {
            std::erase_if(mine, [&](Index t) { return vanishing_node_[t] != no_node; });
            for (const Index t : mine) {
                glm::dvec3 p[3];
                for (std::size_t k = 0; k < 3; ++k)
                    p[k] = position(node_of[cluster_with[cluster_of[std::size_t{t} * 3 + k]]]);
                folded.insert(glm::cross(p[1] - p[0], p[2] - p[0]));
            }
        }
        around[c] = std::move(mine);
    }
}

// Sorts the triangles by the node at which they vanish; equal ones keep the input's order.
void TreeBuilder::sort_triangles() {
    TreeDraft& g = draft_;
    const NodeId interior_nodes = interior();
    g.first_triangle.assign(interior_nodes + 1, 0);
    for (const NodeId node : vanishing_node_) ++g.first_triangle[node + 1];
    std::partial_sum(g.first_triangle.begin(), g.first_triangle.end(), g.first_triangle.begin());
    std::vector<Index> next(g.first_triangle.begin(), g.first_triangle.end() - 1);
    g.triangles.resize(mesh_.triangles.size());
    g.source_triangles.resize(mesh_.triangles.size());
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
        const Index place = next[vanishing_node_[t]]++;
        for (std::size_t k = 0; k < 3; ++k)
            g.triangles[place][k] = node_of_cluster_[mesh_.triangles[t][k]] - interior_nodes;
        g.source_triangles[place] = clean_.source_triangles[t];
    }
    // By leaf: the triangles around it.
    const std::size_t leaves = g.source_vertices.size();
    ring_start_.assign(leaves + 1, 0);
    for (const Triangle& t : g.triangles)
        for (const Index leaf : t) ++ring_start_[leaf + 1];
    std::partial_sum(ring_start_.begin(), ring_start_.end(), ring_start_.begin());
    std::vector<Index> slot(ring_start_.begin(), ring_start_.end() - 1);
    ring_items_.resize(g.triangles.size() * 3);
    for (std::size_t t = 0; t < g.triangles.size(); ++t)
        for (const Index leaf : g.triangles[t]) ring_items_[slot[leaf]++] = static_cast<Index>(t);
}

// Spheres bottom-up. Small nodes see the points themselves; every node contains its children's spheres.
void TreeBuilder::bound_spheres() {
    TreeDraft& g = draft_;
    const NodeId interior_nodes = interior();
    g.support_spheres.resize(interior_nodes);
    g.ring_spheres.resize(interior_nodes);
    std::vector<glm::dvec3> support, ring, corners;
    std::vector<DSphere> support_inside, ring_inside;
    const auto add_ring = [&](Index leaf) {
        for (Index i = ring_start_[leaf]; i < ring_start_[leaf + 1]; ++i)
            for (const Index corner : g.triangles[ring_items_[i]]) ring.push_back(position(interior_nodes + corner));
    };
    const auto by_coordinates = [](const glm::dvec3& a, const glm::dvec3& b) {
        return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
    };
    const auto as_double = [](const Sphere& s) { return DSphere{glm::dvec3(s.centre), s.radius}; };
    for (NodeId node = interior_nodes; node-- > 0;) {
        support.clear(), ring.clear(), support_inside.clear(), ring_inside.clear();
        for_each_child(
            node,
            [&](NodeId child) {
                support_inside.push_back(as_double(g.support_spheres[child]));
                ring_inside.push_back(as_double(g.ring_spheres[child]));
            },
            [&](Index leaf) {
                support.push_back(position(interior_nodes + leaf));
                ring.push_back(support.back());
                add_ring(leaf);
            });
        support.push_back(position(node));
        ring.push_back(position(node));
        std::sort(ring.begin(), ring.end(), by_coordinates);
        ring.erase(std::unique(ring.begin(), ring.end()), ring.end());
        g.support_spheres[node] = round_outward(enclosing_sphere(support, support_inside));
        g.ring_spheres[node] = round_outward(enclosing_sphere(ring, ring_inside));
    }
    for (const Triangle& t : g.triangles)
        for (const Index leaf : t) corners.push_back(position(interior_nodes + leaf));
    std::sort(corners.begin(), corners.end(), by_coordinates);
    corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
    g.bounding_sphere = round_outward(smallest_sphere(corners));
}

// The largest distance of a supported leaf from the proxy, and never less than a child's.
void TreeBuilder::bound_displacements() {
    TreeDraft& g = draft_;
    const NodeId interior_nodes = interior();
    g.displacement.resize(interior_nodes);
    for (NodeId node = interior_nodes; node-- > 0;) {
        const glm::dvec3 proxy = position(node);
        const bool measure = g.leaf_end[node] - g.first_leaf[node] <= most_measured_leaves;
        double largest = 0, largest_child = 0;
        const auto reach_leaf = [&](Index leaf) {
            largest = std::max(largest, glm::distance(proxy, position(interior_nodes + leaf)));
        };
        for_each_child(
            node,
            [&](NodeId child) {
                largest_child = std::max(largest_child, static_cast<double>(g.displacement[child]));
                if (measure) {
                    for (Index leaf = g.first_leaf[child]; leaf < g.leaf_end[child]; ++leaf) reach_leaf(leaf);
                    return;
                }
                const Sphere& s = g.support_spheres[child];
                largest = std::max(largest, std::min(glm::distance(proxy, position(child)) + g.displacement[child],
                                                     glm::distance(proxy, glm::dvec3(s.centre)) + s.radius));
            },
            reach_leaf);
        g.displacement[node] = round_outward(DSphere{glm::dvec3(0), std::max(largest, largest_child)}).radius;
    }
}

// Masks and slabs of the ring dilated by one more ring, with the folded normals united in, and flags of irregular rings.
// The dilation runs over welded vertices: an unwelded crease is no end of the surface.
void TreeBuilder::bound_facing() {
    TreeDraft& g = draft_;
    const NodeId interior_nodes = interior();
    const std::size_t leaves = g.source_vertices.size();
    // By leaf: a leaf that stands for its position, and whether an irregular edge ends there. Lone leaves: themselves.
    std::vector<Index> weld(leaves);
    std::iota(weld.begin(), weld.end(), Index{0});
    std::vector<std::uint8_t> irregular(leaves, 0);
    for (std::size_t v = 0; v < mesh_.positions.size(); ++v) {
        const Index leaf = node_of_cluster_[v] - interior_nodes;
        weld[leaf] = node_of_cluster_[coincident_[v]] - interior_nodes;
        irregular[leaf] = topology_.irregular[v];
    }
    std::vector<Directions> around(leaves); // by welded leaf: the normals of the triangles there
    for (const Triangle& t : g.triangles) {
        const glm::dvec3 a = position(interior_nodes + t[0]);
        Directions normal;
        normal.insert(glm::cross(position(interior_nodes + t[1]) - a, position(interior_nodes + t[2]) - a));
        for (const Index leaf : t) around[weld[leaf]] |= normal;
    }
    // What a leaf brings to every node that supports it.
    std::vector<Directions> dilated(leaves);
    std::vector<std::uint8_t> ring_irregular(leaves, 0);
    tbb::parallel_for(std::size_t{0}, leaves, [&](std::size_t leaf) {
        for (Index i = ring_start_[leaf]; i < ring_start_[leaf + 1]; ++i) {
            for (const Index corner : g.triangles[ring_items_[i]]) {
                dilated[leaf] |= around[weld[corner]];
                ring_irregular[leaf] |= irregular[corner];
            }
        }
    });
    g.masks.assign(interior_nodes, {});
    g.slabs.assign(interior_nodes, {});
    g.flags.assign(interior_nodes, 0);
    for (NodeId node = interior_nodes; node-- > 0;) {
        if (g.support_spheres[node].radius == 0) continue; // coincident vertices: nothing moves
        Directions seen = folded_normals_[node];
        const auto add_leaf = [&](Index leaf) {
            seen |= dilated[leaf];
            if (ring_irregular[leaf]) g.flags[node] |= irregular_ring;
        };
        for_each_child(
            node,
            [&](NodeId child) {
                seen |= {g.masks[child], g.slabs[child]};
                g.flags[node] |= g.flags[child];
                if (g.support_spheres[child].radius == 0) // it has no mask of its own
                    for (Index leaf = g.first_leaf[child]; leaf < g.leaf_end[child]; ++leaf) add_leaf(leaf);
            },
            add_leaf);
        g.masks[node] = seen.mask;
        g.slabs[node] = seen.slabs;
    }
}

} // namespace

std::string_view name(ClustererKind kind) { return kind == ClustererKind::quadric ? "quadric" : "octree"; }

Result<VertexTree> build_tree(const MeshView& mesh, Clusterer clusterer, const BuildOptions& options) {
    if (const auto valid = validate(mesh); !valid) return valid.error();
    if (const auto valid = check_attributes(mesh); !valid) return valid.error();
    if (const auto valid = check(options.light); !valid) return valid.error();
    if (options.threads < 0) return Error{ErrorCode::invalid_argument, "The number of threads must be 0 or more."};
    std::optional<tbb::global_control> limit;
    if (options.threads > 0)
        limit.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(options.threads));
    const CleanMesh cleaned = clean(mesh);
    if (cleaned.source_triangles.empty())
        return Error{ErrorCode::malformed_data, "The mesh has no triangle with three different vertices."};
    Reporter reporter(options.progress);
    return TreeBuilder(mesh, cleaned, options, reporter).build(clusterer);
}

Result<VertexTree> build_tree(const MeshView& mesh, const BuildOptions& options) {
    const auto report = [&](double share, const char* stage) {
        return options.progress(clustering_begins + share * (clustering_ends - clustering_begins), stage);
    };
    const Progress progress = options.progress ? Progress(report) : Progress();
    return build_tree(
        mesh,
        [&](const ClusterInput& input) {
            return options.clusterer == ClustererKind::octree ? cluster_octree(input, progress)
                                                              : cluster_quadric(input, progress);
        },
        options);
}

} // namespace unseen::vdtree
