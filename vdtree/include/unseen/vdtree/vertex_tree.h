// The vertex tree: a hierarchical clustering of a mesh's vertices, with bounds for every fold.
//
// Nodes. Interior nodes are numbered 0 .. interior_count()-1 in depth-first pre-order (a parent before its
// children, a subtree contiguous; 0 is the root), leaves follow: node interior_count() + k is leaf k. Leaves are
// the mesh's vertices in depth-first order, so a node supports a contiguous range of leaves. Folding an interior
// node replaces all leaves it supports by its proxy vertex.
//
// Triangles are sorted by the node at which they vanish (the deepest node that supports two of their corners), so
// those that a fold removes are a contiguous range, and so are those that a folded subtree removes. Corners are
// leaf numbers.
//
// Two regions per interior node: its *support* (the leaves under it) and its *ring* (all corners of all triangles
// that touch the support). Everything stored about them nests: a parent's sphere contains its children's, its mask,
// intervals and flags include theirs, so every fold criterion built on them is monotone up the tree.
//
// Positions are floats relative to origin(); lengths are mesh units. Immutable once built; any number of cuts and
// threads may read one tree.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <unseen/vdtree/attribute.h>
#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/normal_mask.h>
#include <unseen/vdtree/packed.h>
#include <unseen/vdtree/result.h>

namespace unseen::vdtree {

class NodeChecks;

using NodeId = std::uint32_t;
inline constexpr NodeId no_node = 0xffffffffu;

struct Sphere {
    glm::vec3 centre = glm::vec3(0); // relative to VertexTree::origin()
    float radius = 0;
    bool operator==(const Sphere&) const = default;
};

// Relative luminance, 0..1, linear, before the display's mapping.
struct LuminanceRange {
    float lo = 0;
    float hi = 0;
    bool operator==(const LuminanceRange&) const = default;
};
struct PackedRange {
    Unorm16 lo, hi;
    operator LuminanceRange() const noexcept { return {lo, hi}; }
    bool operator==(const PackedRange&) const = default;
};

// One directional light, a weaker one from the opposite side, and ambient light, for meshes that are not pre-lit:
// relative luminance = albedo * (ambient + (1 - ambient) * (max(0, n.direction) + fill * max(0, -n.direction))).
struct Light {
    glm::vec3 direction = {0.39800623f, 0.69651091f, 0.59700935f}; // towards the light: (0.4, 0.7, 0.6) normalised
    float ambient = 0.2f;                                          // share of the luminance that needs no light, 0..1
    float fill = 0.25f; // of the light, from the opposite side, 0..1: what the light does not reach keeps its shape
    bool operator==(const Light&) const = default;
};

// The albedo of surfaces without colours: 0.8, a light matt grey.
inline constexpr float default_albedo = 0.8f;

enum NodeFlags : std::uint8_t {
    irregular_ring = 1,   // the ring has a boundary, non-manifold or inconsistently oriented edge
    translucent_ring = 2, // a corner of the ring has an alpha below 1: anything behind may show there
};

// What a fold test reads of an interior node, in one piece.
struct alignas(32) NodeBounds {
    Sphere ring;            // the ring, and the proxies of the subtree
    NormalSlabs slabs;      // of the same directions as the node's mask
    std::uint8_t flags = 0; // NodeFlags
    std::uint8_t spare = 0;
};
static_assert(sizeof(NodeBounds) == 32);

class VertexTree {
public:
    VertexTree(VertexTree&&) noexcept;
    VertexTree& operator=(VertexTree&&) noexcept;
    ~VertexTree();

    // Sizes. A tree has at least three leaves and one triangle.
    NodeId node_count() const noexcept { return static_cast<NodeId>(links_.parents.size()); }
    NodeId interior_count() const noexcept { return static_cast<NodeId>(links_.first_leaf.size()); }
    NodeId leaf_count() const noexcept { return node_count() - interior_count(); }
    Index triangle_count() const noexcept { return static_cast<Index>(links_.triangles.size()); }
    bool is_leaf(NodeId node) const noexcept { return node >= interior_count(); }
    static constexpr NodeId root() noexcept { return 0; }

    // Whether an interior node can be unfolded: its links, its triangles, and the positions and bounds of its children
    // are in order. Always, but for trees from map_tree, whose nodes are looked at when they are first asked about,
    // from the root down; a damaged node must stay folded, and has no children for for_each_child. Values that are read
    // of mapped nodes of which this has not been asked may be anything; how nodes hang together is told by
    // for_each_child and SoundTree only. Cost: one bit; the first time, the children and triangles.
    bool is_sound(NodeId node) const { return !checks_ || looks_sound(node); }
    NodeId first_damaged() const noexcept; // the first node for which is_sound was false, or no_node

    // Of trees from map_tree: looks at all that read_tree looks at, but for the checksums of pages: is_sound for all
    // nodes, and every value's range. The error names a damaged node or section. Cost: the first time one pass over the
    // whole file, in parallel; nothing once it has succeeded, and for other trees.
    Result<void> check() const;

    // Calls f(child) for each child of an interior node in depth-first order. Cost: the number of children.
    template <class F>
    void for_each_child(NodeId node, F&& f) const;

    // Proxy vertices, by node; a leaf's proxy is the input vertex. Attributes the mesh did not have are empty.
    glm::dvec3 origin() const noexcept;
    std::span<const glm::vec3> positions() const noexcept;
    std::span<const Unorm16> luminance() const noexcept;    // under light(); never empty
    std::span<const PackedNormal> normals() const noexcept; // unit length or zero; never empty
    std::span<const glm::vec4> colours() const noexcept;    // linear; reflectance, unless is_prelit()
    std::span<const glm::vec2> uvs() const noexcept;

    // What lies over the surface by uvs(), and is multiplied with the vertices' colours and luminance; empty: none.
    TextureView texture() const noexcept;

    // Bounds, by interior node.
    std::span<const NodeBounds> bounds() const noexcept;
    NormalMask mask(NodeId node) const noexcept;              // facing of the ring dilated by one more ring; unpacks it
    std::span<const Sphere> support_spheres() const noexcept; // leaves and proxies of the subtree
    std::span<const PackedRange> support_luminance() const noexcept; // of vertices, without the texture
    std::span<const PackedRange> ring_luminance() const noexcept;    // as drawn: with the texture
    std::span<const PackedRange> ring_texture() const noexcept; // the texture's own luminance there; empty without one
    std::span<const Unorm16> adaptation_luminance() const noexcept; // middle of ring_luminance, saturated up the tree
    std::span<const float> displacement() const noexcept; // largest distance of a supported leaf from the proxy

    // The mesh. By leaf: the input vertex. The input's ranges (groups, materials), over its triangles, and by triangle
    // its number there; both empty when the input had none.
    std::span<const Index> source_vertices() const noexcept;
    std::span<const Index> source_triangles() const noexcept;
    std::span<const MeshRange> ranges() const noexcept;
    std::uint64_t dropped_triangles() const noexcept; // input triangles that used a vertex twice
    std::span<const std::byte>
    document() const noexcept; // MeshView::document; of read and mapped files it may be anything
    Closedness closedness() const noexcept;
    Sphere bounding_sphere() const noexcept;         // of the triangles' corners
    LuminanceRange luminance_range() const noexcept; // of all that is drawn

    // Luminance and its bounds under another light, without attributes; everything else is shared with this tree. Cost:
    // one pass over the triangles and the nodes. The colours and the texture of a pre-lit mesh then count as
    // reflectance.
    const Light& light() const noexcept;
    bool is_prelit() const noexcept; // luminance is that of the colours and the texture alone
    // Fails where check() does.
    Result<VertexTree> relit(const Light& light) const;

    // The same with luminances of the caller's, of leaves and of proxies, relative, 0..1 (others are clamped, NaN is 0):
    // light that is none of vdtree::Light's. Without the texture, and pre-lit. Called from several threads. Fails and
    // costs as relit().
    // `keeps_texture`: the texture, if there is one, is multiplied with them.
    Result<VertexTree> shaded(const FunctionRef<float(NodeId)>& luminance, bool keeps_texture = false) const;

    // The same tree without its texture, under its light, with luminance and bounds of its vertices alone; everything
    // else is shared, but for attributes, which it has not. Vertices without colours then have the default albedo, lit.
    // Fails where check() does. Cost: as relit().
    Result<VertexTree> untextured() const;

    // Named values that others keep with the tree: see <unseen/vdtree/attribute.h>. Empty where there are none of that name,
    // or of another type's sizes. Valid as long as a handle with the attribute. Of read and mapped files nobody has
    // looked at them, SoundTree neither: the owner of a name checks each value where it uses it, and what has the sizes
    // of T may have been anything.
    template <class T>
    std::span<const T> attribute(std::string_view name) const noexcept {
        static_assert(is_attribute_value<T>());
        const auto bytes = attribute_bytes(name, sizeof(T), attribute_component_bytes<T>());
        return {reinterpret_cast<const T*>(bytes.data()), bytes.size() / sizeof(T)};
    }
    std::vector<AttributeInfo> attributes() const;

    // Another handle that has this attribute, in place of one of the same name, and shares all else. relit(),
    // untextured() and conserve_light() drop all attributes: they were measured under another light. Files keep them,
    // those of names that no program knows, too. Fails on names that are none (AttributeInfo), on a number of values
    // that is not the domain's, and where there are most_attributes already. Cost: none.
    template <class T>
    Result<VertexTree> with_attribute(std::string_view name, AttributeDomain domain, std::vector<T> values) const {
        static_assert(is_attribute_value<T>());
        const auto kept = std::make_shared<const std::vector<T>>(std::move(values));
        return with_attribute(
            Attribute{{std::string(name), domain, sizeof(T), attribute_component_bytes<T>(), kept->size()},
                      kept,
                      std::as_bytes(std::span(*kept))});
    }

    std::uint64_t
    byte_size() const noexcept; // of all arrays; those of a mapped tree are resident only where they were used

    // Another handle to the same data, which lives as long as one of them.
    VertexTree share() const { return VertexTree(data_); }

    struct Data; // the arrays, for the builder and the file reader
    explicit VertexTree(std::shared_ptr<const Data> data);
    const Data& data() const noexcept { return *data_; }

private:
    friend class SoundTree;
    friend struct UncheckedLinks; // for what asks is_sound() node by node
    bool looks_sound(NodeId node) const;
    std::span<const std::byte> attribute_bytes(std::string_view name, std::size_t element,
                                               std::uint32_t component) const noexcept;
    Result<VertexTree> with_attribute(Attribute attribute) const;

    std::shared_ptr<const Data> data_;
    NodeChecks* checks_ = nullptr; // of data_
    // Of data_, too, for these are asked for node by node.
    struct Links {
        std::span<const NodeId> parents, subtree_end;
        std::span<const Index> first_leaf, leaf_end, first_triangle;
        std::span<const Triangle> triangles;
    };
    Links links_;
};

// A tree all of which has been looked at: what walks a whole tree takes one of these, so that no file can lead it out
// of bounds. Another handle to the tree's data.
class SoundTree : public VertexTree {
public:
    // Fails where VertexTree::check() does, and costs as much: nothing for trees that were built or read.
    static Result<SoundTree> of(const VertexTree& tree);

    // By node: the parent (no_node for the root). By interior node: the leaves supported, [first_leaf, leaf_end), the
    // end of its subtree among the interior nodes, and its triangles, [first_triangle[n], first_triangle[n + 1]) (one
    // longer than the nodes). Corners of triangles are leaf numbers, oriented like the input.
    std::span<const NodeId> parents() const noexcept { return links_.parents; }
    std::span<const Index> first_leaf() const noexcept { return links_.first_leaf; }
    std::span<const Index> leaf_end() const noexcept { return links_.leaf_end; }
    std::span<const NodeId> subtree_end() const noexcept { return links_.subtree_end; }
    std::span<const Index> first_triangle() const noexcept { return links_.first_triangle; }
    std::span<const Triangle> triangles() const noexcept { return links_.triangles; }

private:
    explicit SoundTree(VertexTree tree) : VertexTree(std::move(tree)) {}
};

// Checks everything that the tree promises: that spheres, masks, slabs, intervals and displacements contain what they
// should and nest, and that every triangle vanishes where it is said to. Displacements are compared with the first 4096
// leaves of a node; attributes are their owners'. The error names the first offender. Cost: leaves times depth.
Result<void> verify(const VertexTree& tree);

template <class F>
void VertexTree::for_each_child(NodeId node, F&& f) const {
    if (!is_sound(node)) return;
    const auto first = links_.first_leaf, end = links_.leaf_end;
    const auto skip = links_.subtree_end;
    NodeId child = node + 1;
    for (Index leaf = first[node]; leaf < end[node];) {
        if (child < skip[node] && first[child] == leaf) {
            f(child);
            leaf = end[child];
            if (leaf < end[node]) child = skip[child];
        } else {
            f(static_cast<NodeId>(interior_count() + leaf));
            ++leaf;
        }
    }
}

} // namespace unseen::vdtree
