// Contraction by quadric error of one spatial part of a mesh, and joining such parts: what cluster_quadric() is made
// of.
//
// A mesh's places ("slots") are numbered so that every part is a range of them. contract_part() takes one part's own
// places, those of other parts that share a triangle with them, and these triangles, and contracts pairs of its own
// until few are left. join() puts two neighbouring ranges together: edges between them, on which neither could
// contract, become contractible, and contraction goes on. Both depend on nothing but their arguments, so the parts of a
// mesh may be contracted in any order, by any thread or process; all that they take and give are contiguous arrays of
// plain numbers. Triangles are never cut: a cluster is a set of slots, and parts fit each other without seams.
//
// A place has one or several leaves, the distinct tuples of attributes of the corners there. In each attribute class,
// the leaves that share a value form one component. When two clusters merge, two of their components become one if
// corners of one triangle of the mesh link them, whether the triangle has vanished or not. So both sides of a seam stay
// apart, and what is alike on both does not drift apart. Most clusters have one component of each class, and so has
// every cluster of a mesh without seams: these are kept and judged side by side; only the others have lists.
//
// Lengths are in units of the mesh's extent ("unit box"), weights are areas over the largest area of a place.
#pragma once

#include <compare>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/mesh.h>

#include "build/quadric.h"

namespace unseen::vdtree {

// One part's input. Local slot numbers: own slots are 0 .. own_slots - 1, slot s being number first_slot + s of the
// mesh; then come the ghosts, slots of other parts. Leaves are numbered by slot, in the mesh and locally, so own leaves
// come first, too.
struct PartMesh {
    Index first_slot = 0, own_slots = 0;
    Index first_leaf = 0, own_leaves = 0;
    std::vector<Index> ghost_leaves;   // numbers in the mesh, ascending; those that triangles here use
    std::vector<glm::dvec3> positions; // by local slot
    std::vector<Index> slot_of_leaf;   // by local leaf: local slot, ascending
    AttributeClasses classes;
    // By local leaf, class by class; as long in the unit box as a displacement that matters as much.
    std::vector<float> channel_values;
    std::size_t uv_class = most_classes, normal_class = most_classes; // which classes these are; most_classes: none
    float normal_scale = 1;                                           // length of the values of a unit normal
    std::vector<Index> materials;                                     // by local leaf; empty: there is only one
    std::vector<float> weights;      // by own slot, as ClusterInput has them; empty: 1 for all
    std::vector<Triangle> triangles; // over local leaves: every triangle that touches an own one
    double area_scale = 1;           // from areas in the unit box to weights
};

inline constexpr Index no_merge = 0xffffffffu;

struct LiveCluster {
    Index name;      // a slot in the cluster, under which merges know it
    float deviation; // see Merge
    // Merges, known by the cluster that they joined; or no_merge. `made_by`: the one that made the cluster.
    // `vanishing`: the one at which the last triangles of its connected part go, or, of several parts that were joined
    // across gaps, of the part that is to stay longest.
    Index made_by = no_merge, vanishing = no_merge;
};

// One of several components of a class in a cluster.
struct ClassComponent {
    Index attribute_class;
    std::array<float, most_class_channels> references; // see LiveClusters
    std::array<float, most_block_floats> block;        // see quadric.h
};

// Clusters that are still to be contracted. They lie in spatial order.
struct LiveClusters {
    std::vector<LiveCluster> clusters;
    std::vector<glm::dvec3> places;
    std::vector<float> references; // by cluster and channel: what the quadric's channel values are relative to
    std::vector<float> quadrics;   // as many floats each as AttributeClasses::stride() says, see quadric.h
    // A cluster with several components of a class has all its components here, of every class: first one of each
    // class, then the others. Of its quadric only the base counts.
    struct Several {
        Index first = 0, count = 0; // 0: it has one of each class
    };
    std::vector<Several> several; // by cluster; empty: no cluster has any
    std::vector<ClassComponent> components;

    std::size_t size() const { return clusters.size(); }
    LiveCluster& operator[](std::size_t i) { return clusters[i]; }
    const LiveCluster& operator[](std::size_t i) const { return clusters[i]; }
    bool is_simple(Index cluster) const { return several.empty() || several[cluster].count == 0; }
};

struct Merge {
    Index kept, joined; // names of the two clusters; the new one is known as `kept`
    float error;        // quadric error of the new cluster, weight times unit-box length squared
    float deviation;    // its square root over the weight, unit-box length; at least the parts'
    glm::dvec3 place;
};

// The merges of a contraction, not those of the parts that were joined. Round by round, and in a round by ascending
// error; two merges of one round do not touch the same cluster.
struct MergeRecord {
    std::vector<Merge> merges;
    std::vector<Index> round_ends; // by round: the number of merges up to its end
    // Where two parts of the surface were joined across a gap, the lighter one goes first: what it then strays is the
    // width of the gap. So of many loose parts those that stay are spread out.
    struct Vanishing {
        Index joined;    // the merge, here or in a part that was joined, known by the cluster that it joined
        float deviation; // that the merge has at least; unit-box length
    };
    std::vector<Vanishing> vanishings;
};

struct ClusterPair {
    Index a, b; // live clusters, a < b
    auto operator<=>(const ClusterPair&) const = default;
};

// Components of the clusters of a pair, numbered within their cluster, that are to become one.
struct Link {
    Index a, b;
    auto operator<=>(const Link&) const = default;
};
struct LinkRange {
    Index first = 0, count = 0;
};

// By class: the component of a cluster that a leaf belongs to; no_component where that is closed (see Contraction).
using LeafComponents = std::array<Index, most_classes>;
inline constexpr Index no_component = 0xffffffffu;

// A triangle of the mesh whose corners are in three live clusters, or leaves outside.
struct LiveTriangle {
    static constexpr Index is_outside = Index{1} << 31; // then a number in Contraction::outside; else a cluster
    std::array<Index, 3> corners;
    glm::vec3 normal; // of the mesh's triangle; unit length, or zero
};

// What contracting a part, or joining two, has led to.
struct Contraction {
    Index first_slot = 0, end_slot = 0;
    Index first_leaf = 0, end_leaf = 0;
    AttributeClasses classes;

    MergeRecord record;
    LiveClusters live;
    std::vector<ClusterPair> pairs; // edges between live clusters, by a
    // By pair, where one of its clusters has several components of a class; between others, those of each class are
    // linked. Empty if there are none. A component without links is closed: its best values are eliminated for good and
    // it leaves the list, unless it is the last of its class.
    std::vector<LinkRange> links_of_pairs;
    std::vector<Link> links;
    // Edges that leave the range: from a live cluster to a leaf outside, and, for the other side, which cluster each of
    // our leaves with such an edge is in, by leaf.
    struct OuterEdge {
        Index cluster, far_leaf;
        LeafComponents components;
        auto operator<=>(const OuterEdge&) const = default;
    };
    struct BorderLeaf {
        Index leaf, cluster;
        LeafComponents components;
    };
    std::vector<OuterEdge> outer_edges;
    std::vector<BorderLeaf> border_leaves;
    // The triangles around live clusters, and the leaves outside that they have, by leaf.
    struct OutsideLeaf {
        Index leaf;
        glm::dvec3 place; // the mesh's
    };
    std::vector<LiveTriangle> triangles;
    std::vector<OutsideLeaf> outside;
};

// Called after every round with the number of merges made in it; false stops at once (the result is then of no use).
using RoundCallback = FunctionRef<bool(std::size_t merges)>;

// Contracts until at most `target` clusters are left (at least 1; fewer may remain). Cost: linear in the part for each
// round, and a round contracts a good share of the clusters. Memory: about 520 bytes a slot, more with seams.
Contraction contract_part(const PartMesh& part, Index target, const RoundCallback& after_round);

// Joins neighbouring ranges; left.end_slot == right.first_slot. The merges of both have to be kept elsewhere.
Contraction join(const Contraction& left, const Contraction& right, Index target, const RoundCallback& after_round);

} // namespace unseen::vdtree
