// What must hold for any tree and any cut, recomputed from the definitions. Each check returns the first fault, or
// nothing.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <vector>

#include <unseen/vdtree/active_triangles.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/internal/normal_mask.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>
#include <unseen/vdtree/vertex_tree.h>

#include "shapes.h"
#include "sound.h"

namespace unseen::support {

using vdtree::ActiveTriangles;
using vdtree::Cut;
using vdtree::Index;
using vdtree::LeafRun;
using vdtree::MeshView;
using vdtree::no_node;
using vdtree::NodeId;
using vdtree::Triangle;
using vdtree::VertexTree;
using vdtree::WedgeId;

template <class T>
bool same_bytes(std::span<const T> a, std::span<const T> b) {
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

// The first array in which two trees differ, bit for bit.
inline std::string difference(const VertexTree& a, const VertexTree& b) {
    if (!same_bytes(support::sound(a).parents(), support::sound(b).parents())) return "parents";
    if (!same_bytes(support::sound(a).first_leaf(), support::sound(b).first_leaf())) return "first_leaf";
    if (!same_bytes(support::sound(a).leaf_end(), support::sound(b).leaf_end())) return "leaf_end";
    if (!same_bytes(support::sound(a).subtree_end(), support::sound(b).subtree_end())) return "subtree_end";
    if (!same_bytes(support::sound(a).first_triangle(), support::sound(b).first_triangle())) return "first_triangle";
    if (!same_bytes(support::sound(a).triangles(), support::sound(b).triangles())) return "triangles";
    if (a.origin() != b.origin()) return "origin";
    const auto differs = [&](auto array) {
        const auto &of_a = *a.data().geometry.*array, &of_b = *b.data().geometry.*array;
        return !std::equal(of_a.begin(), of_a.end(), of_b.begin(), of_b.end());
    };
    using vdtree::TreeGeometry;
    if (differs(&TreeGeometry::extra_wedges)) return "extra_wedges";
    const auto needing = [](const VertexTree& tree) {
        const auto& set = tree.data().geometry->needing;
        return std::span<const vdtree::RankWord>(set.data(), set.size());
    };
    if (!same_bytes(needing(a), needing(b))) return "needing";
    if (differs(&TreeGeometry::first_need)) return "first_need";
    if (differs(&TreeGeometry::needs)) return "needs";
    if (differs(&TreeGeometry::leaf_ranks)) return "leaf_ranks";
    if (differs(&TreeGeometry::wedge_ranks)) return "wedge_ranks";
    for (NodeId node = 0; node <= a.node_count(); ++node)
        if (a.first_wedge(node) != b.first_wedge(node)) return "the wedges of node " + std::to_string(node);
    if (!same_bytes(a.positions(), b.positions())) return "positions";
    if (!same_bytes(a.luminance(), b.luminance())) return "luminance";
    if (!same_bytes(a.normals(), b.normals())) return "normals";
    if (!same_bytes(a.colours(), b.colours())) return "colours";
    if (!same_bytes(a.uvs(), b.uvs())) return "uvs";
    if (!same_bytes(a.support_spheres(), b.support_spheres())) return "support_spheres";
    if (!same_bytes(a.bounds(), b.bounds())) return "bounds";
    for (NodeId node = 0; node < a.interior_count(); ++node)
        if (!(a.mask(node) == b.mask(node))) return "the mask of node " + std::to_string(node);
    if (!same_bytes(a.support_luminance(), b.support_luminance())) return "support_luminance";
    if (!same_bytes(a.ring_luminance(), b.ring_luminance())) return "ring_luminance";
    if (!same_bytes(a.adaptation_luminance(), b.adaptation_luminance())) return "adaptation_luminance";
    if (!same_bytes(a.displacement(), b.displacement())) return "displacement";
    if (!same_bytes(a.source_vertices(), b.source_vertices())) return "source_vertices";
    if (!same_bytes(a.source_triangles(), b.source_triangles())) return "source_triangles";
    const auto same_range = [](const auto& r, const auto& s) {
        return r.name == s.name && r.kind == s.kind && r.first_triangle == s.first_triangle &&
               r.triangle_count == s.triangle_count;
    };
    if (!std::equal(a.ranges().begin(), a.ranges().end(), b.ranges().begin(), b.ranges().end(), same_range))
        return "ranges";
    if (a.dropped_triangles() != b.dropped_triangles()) return "dropped_triangles";
    if (a.closedness() != b.closedness()) return "closedness";
    if (!(a.creases() == b.creases())) return "creases";
    const auto sphere_a = a.bounding_sphere(), sphere_b = b.bounding_sphere();
    if (std::memcmp(&sphere_a, &sphere_b, sizeof sphere_a) != 0) return "bounding_sphere";
    if (a.luminance_range().lo != b.luminance_range().lo || a.luminance_range().hi != b.luminance_range().hi)
        return "luminance_range";
    if (!(a.light() == b.light())) return "light";
    if (a.is_prelit() != b.is_prelit()) return "is_prelit";
    return {};
}

// The leaves under any node, places included.
inline Index first_leaf_of(const VertexTree& tree, NodeId node) {
    if (tree.is_place(node)) return tree.first_wedge(node) - tree.interior_wedge_count();
    return sound(tree).first_leaf()[node];
}
inline Index leaf_end_of(const VertexTree& tree, NodeId node) {
    if (tree.is_place(node)) return tree.wedge_end(node) - tree.interior_wedge_count();
    return sound(tree).leaf_end()[node];
}

// By vertex: the first one with the same position and attributes.
inline std::vector<Index> first_equal_vertices(const MeshView& mesh) {
    std::map<std::vector<double>, Index> first;
    std::vector<Index> equal;
    for (Index v = 0; v < mesh.positions.size(); ++v) {
        std::vector<double> key;
        const auto add = [&](const auto& value) {
            for (int k = 0; k < value.length(); ++k) key.push_back(static_cast<double>(value[k]) + 0.0);
        };
        add(mesh.positions[v]);
        if (!mesh.normals.empty()) add(mesh.normals[v]);
        if (!mesh.uvs.empty()) add(mesh.uvs[v]);
        if (!mesh.colours.empty()) add(mesh.colours[v]);
        equal.push_back(first.try_emplace(key, v).first->second);
    }
    return equal;
}

inline bool has_three_places(const MeshView& mesh, const Triangle& t) {
    const auto &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
    return a != b && b != c && c != a;
}

// Pre-order numbers, contiguous leaves and subtrees, children that tile their parent.
inline std::string fault_in_structure(const VertexTree& tree) {
    const NodeId interior = tree.interior_count();
    if (tree.node_count() != interior + tree.place_count()) return "node_count";
    if (support::sound(tree).parents().size() != tree.node_count()) return "parents has another length";
    if (support::sound(tree).parents()[0] != no_node) return "the root has a parent";
    if (support::sound(tree).first_leaf()[0] != 0 || support::sound(tree).leaf_end()[0] != tree.leaf_count())
        return "the root lacks leaves";
    if (support::sound(tree).subtree_end()[0] != interior) return "the root lacks nodes";
    std::vector<int> children(interior, 0);
    for (NodeId node = 1; node < tree.node_count(); ++node) {
        const NodeId parent = support::sound(tree).parents()[node];
        if (parent >= interior) return "node " + std::to_string(node) + " has no interior parent";
        ++children[parent];
        if (tree.is_place(node)) {
            if (tree.wedge_end(node) <= tree.first_wedge(node)) return "place " + std::to_string(node) + " has no leaf";
            for (Index leaf = first_leaf_of(tree, node); leaf < leaf_end_of(tree, node); ++leaf)
                if (leaf < support::sound(tree).first_leaf()[parent] ||
                    leaf >= support::sound(tree).leaf_end()[parent] || tree.place_of_leaf(leaf) != node)
                    return "leaf " + std::to_string(leaf) + " is outside of its parent's leaves";
            continue;
        }
        if (parent >= node) return "node " + std::to_string(node) + " comes before its parent";
        if (node >= support::sound(tree).subtree_end()[parent] ||
            support::sound(tree).subtree_end()[node] > support::sound(tree).subtree_end()[parent])
            return "node " + std::to_string(node) + " is outside of its parent's subtree";
        if (support::sound(tree).first_leaf()[node] < support::sound(tree).first_leaf()[parent] ||
            support::sound(tree).leaf_end()[node] > support::sound(tree).leaf_end()[parent])
            return "node " + std::to_string(node) + " has leaves outside of its parent's";
    }
    for (NodeId node = 0; node < interior; ++node) {
        if (children[node] < 2) return "node " + std::to_string(node) + " has fewer than two children";
        int visited = 0;
        Index next_leaf = support::sound(tree).first_leaf()[node];
        bool ordered = true;
        tree.for_each_child(node, [&](NodeId child) {
            ++visited;
            ordered &= support::sound(tree).parents()[child] == node;
            ordered &= first_leaf_of(tree, child) == next_leaf;
            next_leaf = leaf_end_of(tree, child);
        });
        if (!ordered || visited != children[node] || next_leaf != support::sound(tree).leaf_end()[node])
            return "the children of node " + std::to_string(node) + " do not tile its leaves";
    }
    if (support::sound(tree).first_triangle().size() != interior + std::size_t{1} ||
        support::sound(tree).first_triangle()[0] != 0 ||
        support::sound(tree).first_triangle()[interior] != tree.triangle_count())
        return "first_triangle";
    return {};
}

// Half a unit in the last place of a float as large as the largest coordinate relative to the origin; the origin is
// chosen such that this is below twice the mesh's extent.
inline double position_tolerance(const MeshView& mesh, glm::dvec3 origin, int axis) {
    double largest = 0;
    for (const glm::dvec3& p : mesh.positions) largest = std::max(largest, std::abs(p[axis] - origin[axis]));
    const float f = static_cast<float>(largest);
    return 0.5 *
           (static_cast<double>(std::nextafter(f, std::numeric_limits<float>::infinity())) - static_cast<double>(f));
}

// That a fully unfolded cut is the input: the same triangles over equal vertices in the same orientation, each once, but
// for those with two corners at one position; and the same positions, exactly where the input is in floats.
inline std::string fault_when_unfolded(const VertexTree& tree, const MeshView& mesh) {
    if (tree.source_vertex_count() != mesh.positions.size()) return "not every vertex is counted";
    const std::vector<Index> equal = first_equal_vertices(mesh);
    for (const Index v : tree.source_vertices())
        if (v >= equal.size()) return "a source vertex is out of range";
    bool floats = true;
    for (const glm::dvec3& p : mesh.positions) floats &= shapes::rounded_to_float(p) == p;
    glm::dvec3 tolerance(0);
    for (int axis = 0; axis < 3 && !floats; ++axis) tolerance[axis] = position_tolerance(mesh, tree.origin(), axis);
    for (Index leaf = 0; leaf < tree.leaf_count(); ++leaf) {
        const glm::dvec3 p = mesh.positions[tree.source_vertices()[leaf]];
        const glm::dvec3 q = tree.origin() + glm::dvec3(tree.positions()[tree.wedge_of_leaf(leaf)]);
        for (int axis = 0; axis < 3; ++axis) {
            // The sum of origin and position is rounded to a double.
            const double rounding = floats ? 0 : std::abs(p[axis]) * std::numeric_limits<double>::epsilon();
            if (!(std::abs(p[axis] - q[axis]) <= tolerance[axis] + rounding))
                return "vertex " + std::to_string(tree.source_vertices()[leaf]) + " has moved";
        }
    }

    Cut cut(tree);
    cut.unfold_all();
    std::uint64_t dropped = 0;
    for (const Triangle& t : mesh.triangles) dropped += !has_three_places(mesh, t);
    if (tree.dropped_triangles() != dropped) return "the dropped triangles are miscounted";
    if (cut.triangle_count() + dropped != mesh.triangles.size()) return "triangles are missing";
    const auto indices = cut.indices();
    if (indices.size() != std::size_t{3} * cut.triangle_count()) return "the index buffer has another length";
    std::vector<Triangle> drawn, expected;
    for (std::size_t i = 0; i < indices.size(); ++i) {
        if (indices[i] < tree.interior_wedge_count()) return "a proxy is left";
        if (i % 3 == 0) drawn.emplace_back();
        drawn.back()[i % 3] = equal[tree.source_vertices()[indices[i] - tree.interior_wedge_count()]];
    }
    if (mesh.ranges.empty() != tree.source_triangles().empty()) return "source_triangles goes with the ranges";
    for (std::size_t t = 0; t < tree.source_triangles().size(); ++t) {
        const Index source = tree.source_triangles()[t];
        if (source >= mesh.triangles.size()) return "a source triangle is out of range";
        const Triangle& given = mesh.triangles[source];
        if (drawn[t] != Triangle{equal[given[0]], equal[given[1]], equal[given[2]]})
            return "triangle " + std::to_string(source) + " has other corners";
    }
    for (const Triangle& t : mesh.triangles)
        if (has_three_places(mesh, t)) expected.push_back({equal[t[0]], equal[t[1]], equal[t[2]]});
    std::sort(drawn.begin(), drawn.end());
    std::sort(expected.begin(), expected.end());
    return drawn == expected ? "" : "other triangles are drawn";
}

// The index buffer's triangles in an order that does not depend on the cut's history.
inline std::vector<Triangle> sorted_triangles(const Cut& cut) {
    const auto indices = cut.indices();
    std::vector<Triangle> triangles;
    for (std::size_t i = 0; i + 2 < indices.size(); i += 3)
        triangles.push_back({indices[i], indices[i + 1], indices[i + 2]});
    std::sort(triangles.begin(), triangles.end());
    return triangles;
}

// What a GPU keeps of a cut: it is told no more than what changed where that is known.
class GpuCopy {
public:
    explicit GpuCopy(const VertexTree& tree) : active_(tree) {}

    // Whether it was brought to the cut by changes alone.
    bool update(const Cut& cut) {
        const bool is_known = active_.update(cut);
        const auto corners = active_.leaves_at_corners();
        const auto wedges = active_.wedges_of_leaves();
        if (!is_known) {
            leaves_.assign(corners.begin(), corners.end());
            wedges_.assign(wedges.begin(), wedges.end());
            return false;
        }
        leaves_.resize(corners.size());
        for (const Index slot : active_.changed_slots()) leaves_.at(slot) = corners[slot];
        for (const LeafRun& run : active_.changed_runs())
            for (Index i = 0; i < run.count; ++i) wedges_.at(run.first + i) = run.wedge;
        written_ += active_.changed_slots().size() + active_.changed_runs().size();
        return true;
    }
    std::uint64_t written() const { return written_; }

    std::vector<Triangle> sorted_triangles() const {
        std::vector<Triangle> drawn;
        for (const Triangle& leaves : leaves_)
            drawn.push_back({wedges_.at(leaves[0]), wedges_.at(leaves[1]), wedges_.at(leaves[2])});
        std::sort(drawn.begin(), drawn.end());
        return drawn;
    }

private:
    ActiveTriangles active_;
    std::vector<Triangle> leaves_;
    std::vector<WedgeId> wedges_;
    std::uint64_t written_ = 0;
};

// The cut's definition: unfolded nodes are closed upward; the active nodes form an antichain that covers every leaf;
// a triangle is drawn iff its corners stand for three different active nodes, by the wedges of these that hold its leaves;
// nothing is missed and nothing drawn twice.
inline std::string fault_in_cut(const Cut& cut) {
    const VertexTree& tree = cut.tree();
    std::vector<NodeId> active_above(tree.node_count(), no_node); // the active node at or above
    for (NodeId node = 0; node < tree.node_count(); ++node) {
        const NodeId parent = support::sound(tree).parents()[node];
        const bool unfolded = cut.is_unfolded(node);
        if (tree.is_place(node) && unfolded) return "a place is unfolded";
        if (unfolded && parent != no_node && !cut.is_unfolded(parent))
            return "node " + std::to_string(node) + " is unfolded under a folded one";
        const NodeId above = parent == no_node ? no_node : active_above[parent];
        active_above[node] = above != no_node ? above : unfolded ? no_node : node;
        if (cut.is_active(node) != (active_above[node] == node))
            return "node " + std::to_string(node) + " is wrongly active or inactive";
    }
    for (Index leaf = 0; leaf < tree.leaf_count(); ++leaf) {
        const NodeId active = active_above[tree.place_of_leaf(leaf)];
        if (active == no_node) return "leaf " + std::to_string(leaf) + " is not covered";
        if (cut.proxy_of_leaf(leaf) != active) return "leaf " + std::to_string(leaf) + " has another proxy";
    }
    std::vector<Triangle> expected;
    for (const Triangle& t : support::sound(tree).triangles()) {
        Triangle now, drawn;
        for (std::size_t k = 0; k < 3; ++k) {
            now[k] = active_above[tree.place_of_leaf(t[k])];
            drawn[k] = tree.wedge_at(now[k], t[k]);
        }
        if (!vdtree::uses_a_vertex_twice(now)) expected.push_back(drawn);
    }
    if (cut.indices().size() != std::size_t{3} * cut.triangle_count()) return "the index buffer has another length";
    std::sort(expected.begin(), expected.end());
    if (sorted_triangles(cut) != expected) return "other triangles are drawn";
    return {};
}

// What is unfolded with all that it needs: by the definition, round by round.
inline std::vector<bool> with_needs(const VertexTree& tree, std::vector<bool> unfolded) {
    const auto& g = *tree.data().geometry;
    if (g.needing.empty()) return unfolded;
    for (bool changed = true; changed;) {
        changed = false;
        Index k = 0;
        for (NodeId node = 0; node < tree.interior_count(); ++node) {
            if (!vdtree::is_in(g.needing, node)) continue;
            for (Index i = g.first_need[k]; i < g.first_need[k + 1] && unfolded[node]; ++i)
                for (NodeId up = g.needs[i] & ~vdtree::joined_need; up != no_node && !unfolded[up]; up = g.parents[up])
                    unfolded[up] = changed = true;
            ++k;
        }
    }
    return unfolded;
}

// By wedge of a textured tree: whether triangles of both orientations in the texture meet at a leaf under it.
inline std::vector<bool> wedges_on_mirrors(const VertexTree& tree) {
    std::vector<int> sides(tree.leaf_count(), 0);
    for (const Triangle& t : sound(tree).triangles()) {
        glm::dvec2 p[3];
        for (std::size_t k = 0; k < 3; ++k) p[k] = glm::dvec2(tree.uvs()[tree.wedge_of_leaf(t[k])]);
        const glm::dvec2 e = p[1] - p[0], f = p[2] - p[0];
        const double area = e.x * f.y - e.y * f.x;
        for (const Index leaf : t) sides[leaf] |= area > 0 ? 1 : area < 0 ? 2 : 0;
    }
    std::vector<bool> found(tree.wedge_count(), false);
    for (Index leaf = 0; leaf < tree.leaf_count(); ++leaf)
        for (NodeId node = tree.place_of_leaf(leaf); node != no_node && sides[leaf] == 3;
             node = sound(tree).parents()[node])
            found[tree.is_place(node) ? tree.wedge_of_leaf(leaf) : tree.wedge_at(node, leaf)] = true;
    return found;
}

// The triangles of a cut that face away from where they faced in the mesh, and those that are mirrored in the texture,
// though none of their corners lies where the texture itself is.
struct TurnedTriangles {
    Index in_space = 0, in_texture = 0;
    bool operator==(const TurnedTriangles&) const = default;
};
template <class IsUnfolded>
TurnedTriangles turned_triangles(const VertexTree& tree, const std::vector<bool>& on_mirror, IsUnfolded&& is_unfolded) {
    std::vector<NodeId> active(tree.node_count(), no_node); // at or above
    for (NodeId node = 0; node < tree.node_count(); ++node) {
        const NodeId parent = sound(tree).parents()[node];
        if (parent != no_node && active[parent] != no_node) active[node] = active[parent];
        else if (tree.is_place(node) || !is_unfolded(node)) active[node] = node;
    }
    TurnedTriangles found;
    for (const Triangle& t : sound(tree).triangles()) {
        Triangle nodes;
        for (std::size_t k = 0; k < 3; ++k) nodes[k] = active[tree.place_of_leaf(t[k])];
        if (vdtree::uses_a_vertex_twice(nodes)) continue;
        glm::dvec3 normals[2];
        double areas[2] = {}, sines[2] = {};
        bool is_mirror = false;
        for (const bool now : {false, true}) {
            vdtree::WedgeId w[3];
            for (std::size_t k = 0; k < 3; ++k) w[k] = now ? tree.wedge_at(nodes[k], t[k]) : tree.wedge_of_leaf(t[k]);
            const auto at = [&](std::size_t k) { return glm::dvec3(tree.positions()[w[k]]); };
            normals[now] = glm::cross(at(1) - at(0), at(2) - at(0));
            if (on_mirror.empty()) continue;
            for (const vdtree::WedgeId corner : w) is_mirror |= now && on_mirror[corner];
            const auto uv = [&](std::size_t k) { return glm::dvec2(tree.uvs()[w[k]]); };
            const glm::dvec2 e = uv(1) - uv(0), f = uv(2) - uv(0);
            areas[now] = e.x * f.y - e.y * f.x;
            sines[now] = std::abs(areas[now]) / std::max(glm::length(e) * glm::length(f), 1e-300);
        }
        found.in_space += glm::dot(normals[0], normals[1]) < 0;
        // Thinner ones have no side to speak of.
        constexpr double least_sine = 1.01e-3;
        found.in_texture += !is_mirror && areas[0] * areas[1] < 0 && std::min(sines[0], sines[1]) > least_sine;
    }
    return found;
}

// Checks a cut that a criterion has made: it unfolds what is wanted and what that needs, and turns no triangle over.
inline std::string fault_in_needs(const Cut& cut) {
    const VertexTree& tree = cut.tree();
    std::vector<bool> wanted(tree.interior_count()), unfolded(tree.interior_count());
    for (NodeId node = 0; node < tree.interior_count(); ++node) {
        wanted[node] = cut.is_wanted(node);
        unfolded[node] = cut.is_unfolded(node);
    }
    if (with_needs(tree, wanted) != unfolded) return "it is not what is wanted and what that needs";
    const auto turned = turned_triangles(tree, tree.uvs().empty() ? std::vector<bool>() : wedges_on_mirrors(tree),
                                         [&](NodeId node) { return cut.is_unfolded(node); });
    if (turned == TurnedTriangles()) return {};
    return std::to_string(turned.in_space) + " triangles are turned over, " + std::to_string(turned.in_texture) +
           " in the texture";
}

} // namespace unseen::support
