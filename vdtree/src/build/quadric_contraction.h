// Contraction by quadric error of one spatial part of a mesh, and joining such parts: what cluster_quadric() is made
// of.
//
// A mesh's welded vertices ("slots") are numbered so that every part is a range of them. contract_part() takes one
// part's own vertices, those of other parts that share a triangle with them, and these triangles, and contracts pairs
// of its own until few are left. join() puts two neighbouring ranges together: edges between them, on which neither
// could contract, become contractible, and contraction goes on. Both depend on nothing but their arguments, so the
// parts of a mesh may be contracted in any order, by any thread or process; all that they take and give are contiguous
// arrays of plain numbers. Triangles are never cut: a cluster is a set of slots, and parts fit each other without
// seams.
//
// Lengths are in units of the mesh's extent ("unit box"), weights are areas over the largest vertex area.
#pragma once

#include <compare>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/mesh.h>

namespace unseen::vdtree {

// One part's input. Local slot numbers: own slots are 0 .. own_slots - 1, slot s being number first_slot + s of the
// mesh; then come the ghosts, slots of other parts. Local vertices are numbered by slot, so own vertices come first
// too.
struct PartMesh {
    Index first_slot = 0;
    Index own_slots = 0;
    std::vector<Index> ghost_slots;    // numbers in the mesh, ascending
    std::vector<glm::dvec3> positions; // by local slot
    std::vector<Index> slot_of_vertex; // by local vertex: local slot, ascending
    std::size_t channels = 0;          // attribute values per vertex, at most most_channels
    std::vector<float>
        channel_values;              // by local vertex; as long in the unit box as a displacement that matters as much
    std::vector<Triangle> triangles; // over local vertices: every triangle that touches an own vertex
    double area_scale = 1;           // from areas in the unit box to weights
};

inline constexpr Index no_merge = 0xffffffffu;

struct LiveCluster {
    Index name;      // a slot in the cluster, under which merges know it
    float deviation; // see Merge
    // Merges, known by the cluster that they joined; or no_merge. `made_by`: the one that made the cluster. `vanishing`:
    // the one at which the last triangles of its connected part go, or, of several parts that were joined across gaps,
    // of the part that is to stay longest.
    Index made_by = no_merge, vanishing = no_merge;
};

// Clusters that are still to be contracted. They lie in spatial order.
struct LiveClusters {
    std::vector<LiveCluster> clusters;
    std::vector<glm::dvec3> places;
    std::vector<float> references; // by cluster and channel: what the quadric's channel values are relative to
    std::vector<float> quadrics;   // quadric_stride(channels) each, see quadric.h
    std::size_t size() const { return clusters.size(); }
    LiveCluster& operator[](std::size_t i) { return clusters[i]; }
    const LiveCluster& operator[](std::size_t i) const { return clusters[i]; }
};

struct Merge {
    Index kept, joined; // names of the two clusters; the new one is known as `kept`
    float error;        // quadric error of the new cluster, weight times unit-box length squared
    float deviation;    // its square root over the weight, unit-box length; at least the parts'
    glm::dvec3 place;
};

// The merges of a contraction, not those of the parts that were joined. Round by round, and in a round by ascending error;
// two merges of one round do not touch the same cluster.
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

// What contracting a part, or joining two, has led to.
struct Contraction {
    Index first_slot = 0, end_slot = 0;
    std::size_t channels = 0;

    MergeRecord record;
    LiveClusters live;
    std::vector<ClusterPair> pairs; // edges between live clusters, by a
    // Edges that leave the range: from a live cluster to a slot outside, and, for the other side, which cluster each of
    // our slots with such an edge is in, by slot.
    struct OuterEdge {
        Index cluster, far_slot;
    };
    struct BorderSlot {
        Index slot, cluster;
    };
    std::vector<OuterEdge> outer_edges;
    std::vector<BorderSlot> border_slots;
};

// Called after every round with the number of merges made in it; false stops at once (the result is then of no use).
using RoundCallback = FunctionRef<bool(std::size_t merges)>;

// Contracts until at most `target` clusters are left (at least 1; fewer may remain). Cost: linear in the part for each
// round, and a round contracts a good share of the clusters. Memory: about 420 bytes a slot.
Contraction contract_part(const PartMesh& part, Index target, const RoundCallback& after_round);

// Joins neighbouring ranges; left.end_slot == right.first_slot. The merges of both have to be kept elsewhere.
Contraction join(const Contraction& left, const Contraction& right, Index target, const RoundCallback& after_round);

} // namespace unseen::vdtree
