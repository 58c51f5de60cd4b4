#include "build/order_nodes.h"

#include <limits>
#include <numeric>

#include <tbb/task_arena.h>

#include <unseen/vdtree/internal/parallel.h>

#include "build/parallel_array.h"
#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

namespace {

// What becomes of a cluster: counted on the way up, turned into places on the way down.
struct ClusterPlace {
    Index children = 0;
    Index leaves = 0;      // under it; then the end of those not yet given to its children
    NodeId nodes = 0;      // in its subtree; then the end of those not yet given
    NodeId node = no_node; // its own, or that of the cluster that it is the only child of
};

// Parents lie anywhere in memory: prefetch them this many clusters ahead.
constexpr Index ahead = 16;

} // namespace

Ancestors::Ancestors(const TreeShape& shape) : shape_(shape), jump_(shape.interior()) {
    // The jump from a node is as long as two jumps from its parent where these are equally long, else it leads to the
    // parent.
    std::vector<Index> depth(shape.interior(), 0);
    for (NodeId node = 0; node < shape.interior(); ++node) {
        const NodeId up = shape.parents[node];
        if (up == no_node) {
            jump_[node] = no_node;
            continue;
        }
        depth[node] = depth[up] + 1;
        const NodeId once = jump_[up], twice = once == no_node ? no_node : jump_[once];
        const bool equal = twice != no_node && depth[up] - depth[once] == depth[once] - depth[twice];
        jump_[node] = equal ? twice : up;
    }
}

namespace {

class NodeOrderer {
public:
    NodeOrderer(const Clustering& clustering, Index vertices)
        : parents_(clustering.parents), vertices_(vertices), root_(static_cast<Index>(parents_.size()) - 1),
          places_(parents_.size() - vertices) {}

    NodeOrder run() {
        count_up();
        make_room();
        number_down();
        return std::move(order_);
    }

private:
    ClusterPlace& place(Index cluster) { return places_[cluster - vertices_]; }
    void expect(Index cluster) { prefetch(&place(parents_[cluster])); }

    // Children have lower numbers than their parents.
    void count_up() {
        for (Index v = 0; v < vertices_; ++v) {
            expect(std::min(v + ahead, root_));
            ClusterPlace& up = place(parents_[v]);
            ++up.children;
            ++up.leaves;
        }
        for (Index c = vertices_; c <= root_; ++c) {
            expect(std::min(c + ahead, root_));
            ClusterPlace& here = place(c);
            if (here.children > 1) ++here.nodes;
            if (c == root_) break;
            ClusterPlace& up = place(parents_[c]);
            ++up.children;
            up.leaves += here.leaves;
            up.nodes += here.nodes;
        }
    }

    void make_room() {
        interior_ = place(root_).nodes;
        TreeShape& shape = order_.shape;
        shape.parents.resize(std::size_t{interior_} + vertices_);
        shape.first_leaf.resize(interior_);
        shape.leaf_end.resize(interior_);
        shape.subtree_end.resize(interior_);
        shape.made.resize(interior_);
        order_.leaf_of_vertex.resize(vertices_);
        order_.node_of_cluster.assign(places_.size(), no_node);
    }

    void open(NodeId node, NodeId parent, Index first_leaf, Index leaf_end, NodeId subtree_end, Index made) {
        TreeShape& shape = order_.shape;
        shape.parents[node] = parent;
        shape.first_leaf[node] = first_leaf;
        shape.leaf_end[node] = leaf_end;
        shape.subtree_end[node] = subtree_end;
        shape.made[node] = made;
    }
    void put_leaf(Index vertex, Index leaf, NodeId parent) {
        order_.leaf_of_vertex[vertex] = leaf;
        order_.shape.parents[order_.shape.place_of_leaf(leaf)] = parent;
    }

    // The last child takes the last leaves and nodes of its parent.
    void number_down() {
        for (Index c = root_; c >= vertices_; --c) {
            expect(c - std::min(c, ahead));
            ClusterPlace& here = place(c);
            const NodeId parent = c == root_ ? no_node : place(parents_[c]).node;
            Index leaf_end = vertices_;
            NodeId node_end = interior_;
            if (c != root_) {
                ClusterPlace& up = place(parents_[c]);
                leaf_end = up.leaves;
                node_end = up.nodes;
                up.leaves -= here.leaves;
                up.nodes -= here.nodes;
            }
            here.node = parent;
            if (here.children > 1) {
                here.node = order_.node_of_cluster[c - vertices_] = node_end - here.nodes;
                open(here.node, parent, leaf_end - here.leaves, leaf_end, node_end, c);
            }
            here.leaves = leaf_end;
            here.nodes = node_end;
        }
        for (Index v = vertices_; v-- > 0;) {
            expect(v - std::min(v, ahead));
            ClusterPlace& up = place(parents_[v]);
            put_leaf(v, --up.leaves, up.node);
        }
    }

    std::span<const Index> parents_; // by cluster
    Index vertices_, root_;
    std::vector<ClusterPlace> places_; // by cluster that is no vertex
    NodeId interior_ = 0;              // how many nodes
    NodeOrder order_;
};

} // namespace

NodeOrder order_nodes(const Clustering& clustering, Index vertices) { return NodeOrderer(clustering, vertices).run(); }

TriangleOrder order_triangles(std::span<const Triangle> triangles, const NodeOrder& nodes, const Ancestors& ancestors) {
    const TreeShape& shape = nodes.shape;
    TriangleOrder order;
    ParallelArray<NodeId> vanishing(triangles.size(), Unfilled());
    parallel_loop(std::size_t{0}, triangles.size(), [&](std::size_t i) {
        const Triangle& t = triangles[i];
        const Index a = nodes.leaf_of_vertex[t[0]], b = nodes.leaf_of_vertex[t[1]], c = nodes.leaf_of_vertex[t[2]];
        const Index low = std::min({a, b, c}), high = std::max({a, b, c});
        // The middle one of three leaves merges first with another.
        vanishing[i] = ancestors.lowest(shape.parents[shape.place_of_leaf(a ^ b ^ c ^ low ^ high)], [&](NodeId node) {
            return shape.first_leaf[node] <= low || high < shape.leaf_end[node];
        });
    });
    order.first_triangle.assign(shape.interior() + 1, 0);
    // Each thread looks at all triangles, for a range of the nodes: looking is cheap.
    constexpr int most_ranges = 8;
    const auto ranges = static_cast<std::size_t>(std::min(tbb::this_task_arena::max_concurrency(), most_ranges));
    const auto for_each_of_range = [&](auto&& f) {
        parallel_loop(std::size_t{0}, ranges, [&](std::size_t r) {
            const std::size_t begin = shape.interior() * r / ranges, size = shape.interior() * (r + 1) / ranges - begin;
            for (std::size_t t = triangles.size(); t-- > 0;)
                if (vanishing[t] - begin < size) f(t, order.first_triangle[vanishing[t] + 1]);
        });
    };
    for_each_of_range([](std::size_t, Index& count) { ++count; });
    std::partial_sum(order.first_triangle.begin(), order.first_triangle.end(), order.first_triangle.begin());
    order.triangles.resize(triangles.size());
    order.sources.resize(triangles.size());
    // Each node's triangles are counted down from its end, the last triangle first.
    for_each_of_range([&](std::size_t t, Index& end) {
        const Index at = --end;
        for (std::size_t k = 0; k < 3; ++k) order.triangles[at][k] = nodes.leaf_of_vertex[triangles[t][k]];
        order.sources[at] = static_cast<Index>(t);
    });
    // What was the end of a node is its beginning now, one place too high.
    std::move(order.first_triangle.begin() + 1, order.first_triangle.end(), order.first_triangle.begin());
    order.first_triangle.back() = static_cast<Index>(triangles.size());
    return order;
}

} // namespace unseen::vdtree
