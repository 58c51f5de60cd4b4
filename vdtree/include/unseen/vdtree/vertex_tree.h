// The vertex tree: a hierarchical clustering of a mesh's vertices, with bounds for every fold.
//
// Nodes. Interior nodes have the numbers 0 .. interior_count() - 1, in depth-first pre-order: a parent comes before its
// children, a subtree is contiguous, and 0 is the root. *Places*, the mesh's distinct positions, follow in depth-first
// order. Folding an interior node moves all places under it to its position.
//
// Wedges. A vertex as it is drawn is a *wedge*: a position with one normal, colour and pair of texture coordinates
// (Hoppe 1996). At a seam or a hard edge a node has several, all at one position, and they fold together. The *leaves* are
// the wedges of the places: the distinct tuples of position, attributes and material that the mesh's corners use. A wedge
// of a node is a connected piece of the leaves under it: two leaves belong to it if corners of one triangle join them. So
// wedges form a forest beside the tree of the nodes, and sides of a seam stay apart however far the node is folded.
// Wedges are numbered node by node; leaf k is wedge interior_wedge_count() + k. A node supports a contiguous range of
// leaves. Where every node has one wedge, wedges and nodes have the same numbers.
//
// Triangles are sorted by the node at which they vanish: the deepest node that supports two of their corners. So the
// triangles that one fold removes are contiguous, and so are those that a folded subtree removes. Corners are leaf
// numbers.
//
// Each interior node has two regions: its *support* (the leaves under it) and its *ring* (all corners of all triangles
// that touch the support). Everything stored about them nests: a parent's sphere contains its children's, and its
// intervals and flags include theirs. So every fold criterion built on them is monotone up the tree.
//
// Positions are floats relative to origin(); lengths are in mesh units. A tree never changes once it is built. Any
// number of cuts and threads may read one tree.
#pragma once

#include <bit>
#include <compare>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/result.h>

namespace unseen::vdtree {

class NodeChecks;

using NodeId = std::uint32_t;
using WedgeId = std::uint32_t;
inline constexpr NodeId no_node = 0xffffffffu;

// ---- values that the tree stores

// A number from 0 to 1 in 16 bits: value / 65535. As luminance, a step is a twentieth of an 8-bit sRGB display's least.
struct Unorm16 {
    static constexpr int largest = 65535;
    std::uint16_t value = 0;

    // Rounds to the nearest step. Values below 0 become 0, values above 1 become 1, and NaN becomes 0.
    static constexpr Unorm16 nearest(double x) noexcept {
        if (!(x > 0)) return {0};
        if (x >= 1) return {largest};
        return {static_cast<std::uint16_t>(x * largest + 0.5)};
    }
    constexpr operator float() const noexcept { return value * (1.0f / largest); } // ascends with value, ends at 1
    friend constexpr auto operator<=>(Unorm16, Unorm16) = default;
};
static_assert(static_cast<float>(Unorm16{Unorm16::largest}) == 1.0f);

// A unit vector or zero in 4 bytes: octahedral coordinates in 1/32767 (Meyer, Suessmuth, Sussner, Stamminger and
// Greiner 2010; Cigolle and others 2014). At most 6.5e-5 from the vector that was packed; the six axes are exact.
struct PackedNormal {
    static constexpr std::int16_t largest = 32767;
    static constexpr std::int16_t none = -32768; // x and y of the zero vector

    std::int16_t x = none, y = none;

    // A direction of any length. Zero and non-finite vectors become zero.
    static PackedNormal nearest(glm::vec3 direction) noexcept;
    operator glm::vec3() const noexcept;
    bool operator==(const PackedNormal&) const = default;
};

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
inline constexpr PackedRange empty_range{{Unorm16::largest}, {0}};
// By values: a minimum of references would be loaded from memory after an unpredictable branch.
inline PackedRange unite(PackedRange a, PackedRange b) noexcept {
    return {{a.lo.value < b.lo.value ? a.lo.value : b.lo.value}, {a.hi.value > b.hi.value ? a.hi.value : b.hi.value}};
}

// Bounds of a set of directions, in 14 bytes: the least and the largest coordinate along seven axes, in 1/127, rounded
// outward. Unions are exact, so nothing is lost up the tree.
struct NormalSlabs {
    static constexpr int axis_count = 7; // x, y, z, then the diagonals (1,1,1), (-1,1,1), (1,-1,1), (1,1,-1)
    std::array<std::int8_t, axis_count> lo{127, 127, 127, 127, 127, 127, 127};
    std::array<std::int8_t, axis_count> hi{-127, -127, -127, -127, -127, -127, -127};

    bool empty() const noexcept { return lo[0] > hi[0]; }
    NormalSlabs& operator|=(const NormalSlabs& other) noexcept {
        for (std::size_t i = 0; i < axis_count; ++i) {
            lo[i] = lo[i] < other.lo[i] ? lo[i] : other.lo[i];
            hi[i] = hi[i] > other.hi[i] ? hi[i] : other.hi[i];
        }
        return *this;
    }
    bool includes(const NormalSlabs& other) const noexcept {
        NormalSlabs both = *this;
        return (both |= other) == *this;
    }
    void insert(glm::dvec3 unit_normal) noexcept;
    static NormalSlabs everything() noexcept {
        NormalSlabs all;
        all.lo.fill(-127);
        all.hi.fill(127);
        return all;
    }
    bool operator==(const NormalSlabs&) const = default;
};

// The cells that a set of directions lies in, one bit each: 8 x 8 cells of equal angle on each of a cube's six faces (Zhang
// and Hoff 1997; Luebke and Hallen 2001, section 3.3).
struct NormalMask {
    std::array<std::uint64_t, 6> faces{};

    void insert(int cell) noexcept { faces[static_cast<unsigned>(cell) >> 6] |= std::uint64_t{1} << (cell & 63); }
    bool contains(int cell) const noexcept { return (faces[static_cast<unsigned>(cell) >> 6] >> (cell & 63)) & 1; }
    bool empty() const noexcept { return (faces[0] | faces[1] | faces[2] | faces[3] | faces[4] | faces[5]) == 0; }
    NormalMask& operator|=(const NormalMask& other) noexcept {
        for (std::size_t i = 0; i < 6; ++i) faces[i] |= other.faces[i];
        return *this;
    }
    bool includes(const NormalMask& other) const noexcept {
        std::uint64_t missing = 0;
        for (std::size_t i = 0; i < 6; ++i) missing |= other.faces[i] & ~faces[i];
        return missing == 0;
    }
    bool operator==(const NormalMask&) const = default;
};

enum NodeFlags : std::uint8_t {
    irregular_ring = 1,   // the ring has a boundary, non-manifold or inconsistently oriented edge
    translucent_ring = 2, // a corner of the ring has an alpha below 1, or texels are not there: what is behind may show
};

// What a fold test reads of an interior node, in one cache line's half.
struct alignas(32) NodeBounds {
    Sphere ring;            // contains the ring, and the proxies of the subtree
    NormalSlabs slabs;      // normals of the ring dilated by one more ring, before and after the fold
    std::uint8_t flags = 0; // NodeFlags
    std::uint8_t spare = 0;
};
static_assert(sizeof(NodeBounds) == 32);

// One directional light, a weaker one from the opposite side, and ambient light, for meshes that are not pre-lit:
// relative luminance = albedo * (ambient + (1 - ambient) * (max(0, n.direction) + fill * max(0, -n.direction))).
struct Light {
    glm::vec3 direction = {0.39800623f, 0.69651091f, 0.59700935f}; // towards the light: (0.4, 0.7, 0.6) normalised
    float ambient = 0.2f;                                          // 0..1
    float fill = 0.25f; // strength of the opposite light relative to the main one, 0..1
    bool operator==(const Light&) const = default;
};

// The albedo of surfaces without colours: 0.8, a light matt grey.
inline constexpr float default_albedo = 0.8f;

// ---- attributes: named values that others keep with a tree, such as measurements

// What an attribute has one value for. Files store these numbers.
enum class AttributeDomain : std::uint32_t {
    tree = 1,          // the whole tree: any number of values
    interior_node = 2, // each interior node
    node = 3,          // each node, leaves included
};

inline constexpr std::size_t longest_attribute_name = 20; // characters
inline constexpr std::size_t most_attributes = 32;        // per tree

// The size of the numbers that a value consists of; all have one size. Hosts of the other byte order swap these in
// files. A struct names the type of its numbers as `Component`.
template <class T>
constexpr std::uint32_t attribute_component_bytes() {
    if constexpr (std::is_arithmetic_v<T>) return sizeof(T);
    else return attribute_component_bytes<typename T::Component>();
}

template <class T>
constexpr bool is_attribute_value() {
    return std::is_trivially_copyable_v<T> && alignof(T) <= 16 && sizeof(T) % attribute_component_bytes<T>() == 0;
}

struct Attribute {
    std::string name; // 1 to 20 printable ASCII characters without spaces
    AttributeDomain domain = AttributeDomain::tree;
    std::uint32_t element_bytes = 1, component_bytes = 1;
    std::size_t count = 0;                  // of values
    std::shared_ptr<const void> owner = {}; // of the bytes
    std::span<const std::byte> bytes = {};  // aligned to 16 bytes at least
};

// ---- the tree

// 32 bits of a set, and how many come before them.
struct RankWord {
    using Component = std::uint32_t;
    std::uint32_t bits = 0, before = 0;
};
// Where processors are not known to count bits, the library's function takes several times as long.
constexpr std::uint32_t count_bits(std::uint32_t bits) noexcept {
    bits -= (bits >> 1) & 0x55555555u;
    bits = (bits & 0x33333333u) + ((bits >> 2) & 0x33333333u);
    return (((bits + (bits >> 4)) & 0x0f0f0f0fu) * 0x01010101u) >> 24;
}
// How many of the first `i` are in a set.
inline Index rank_in(std::span<const RankWord> set, Index i) noexcept {
    const RankWord& word = set[i / 32];
    return word.before + count_bits(word.bits & ((1u << (i % 32)) - 1));
}
inline bool is_in(std::span<const RankWord> set, Index i) noexcept { return set[i / 32].bits >> (i % 32) & 1; }

// How the wedges hang on the nodes. Empty where every node has one wedge, which then has the node's number.
template <template <class> class Storage>
struct WedgeArrays {
    Storage<RankWord> several; // by node, and one more: whether it has more wedges than one
    Storage<Index>
        extra_wedges; // by node with several wedges, one longer: how many there are beyond one, in those before
    Storage<RankWord> further; // by wedge, and one more: whether it is not the first of its node
    // By leaf, and by wedge of an interior node with several: the number of its first leaf in the depth-first order of the
    // forest, in which each wedge holds a run of leaves. Those of a node ascend.
    Storage<Index> leaf_ranks, wedge_ranks;
};
template <class T>
using ConstSpan = std::span<const T>;

// Which nodes need others. While a node is unfolded, what it needs is, too, with all that is above: otherwise a triangle
// could be turned over, as it is drawn between the two. Empty where none can be.
template <template <class> class Storage>
struct NeedArrays {
    Storage<RankWord> needing; // by interior node, and one more: whether it needs others
    Storage<Index> first_need; // by node that does, one longer
    Storage<NodeId> needs;     // node by node; no node is in it more than 2^16 - 1 times
};
// The bit of a need that is a child, which folds and unfolds with its parent.
inline constexpr NodeId joined_need = 1u << 31;

// The same as views, with the links of the nodes that they need.
template <class Numbers>
struct WedgeLinks : WedgeArrays<ConstSpan> {
    Numbers parents;    // by node
    Numbers first_leaf; // by interior node, and so on
    Numbers leaf_end;
    Numbers subtree_end;

    NodeId interior() const noexcept { return static_cast<NodeId>(first_leaf.size()); }
    bool has_seams() const noexcept { return !several.empty(); }
    Index leaves() const noexcept {
        return static_cast<Index>(has_seams() ? leaf_ranks.size() : parents.size() - first_leaf.size());
    }
    WedgeId first_wedge_of(NodeId node) const noexcept {
        return has_seams() ? node + extra_wedges[rank_in(several, node)] : node;
    }
    NodeId node_of_wedge(WedgeId wedge) const noexcept {
        return has_seams() ? wedge - rank_in(further, wedge + 1) : wedge;
    }
    WedgeId wedge_of_leaf(Index leaf) const noexcept { return first_wedge_of(interior()) + leaf; }
    NodeId place_of_leaf(Index leaf) const noexcept { return node_of_wedge(wedge_of_leaf(leaf)); }
    WedgeId wedge_at(NodeId node, Index leaf) const noexcept {
        return has_seams() ? wedge_of_rank(node, [&] { return leaf_ranks[leaf]; }) : node;
    }
    WedgeId wedge_above(NodeId node, WedgeId below) const noexcept {
        return has_seams() ? wedge_of_rank(node, [&] { return rank_of(below); }) : node;
    }

    // The first of the wedge's run.
    Index rank_of(WedgeId wedge) const noexcept {
        const NodeId node = node_of_wedge(wedge);
        if (node >= interior()) return leaf_ranks[wedge - first_wedge_of(interior())];
        if (!is_in(several, node)) return leaf_ranks[first_leaf[node]];
        const Index k = rank_in(several, node);
        return wedge_ranks[k + wedge - node];
    }

private:
    template <class Rank>
    WedgeId wedge_of_rank(NodeId node, Rank&& rank_of_leaf) const noexcept {
        const Index k = rank_in(several, node);
        const WedgeId first = node + extra_wedges[k];
        if (!is_in(several, node)) return first;
        const Index rank = rank_of_leaf(), count = extra_wedges[k + 1] - extra_wedges[k] + 1;
        const auto at = [&](Index i) {
            return node >= interior() ? leaf_ranks[first + i - first_wedge_of(interior())]
                                      : wedge_ranks[k + (first - node) + i];
        };
        // The last one whose run has begun.
        Index begin = 0, end = count;
        while (end - begin > 1) {
            const Index middle = begin + (end - begin) / 2;
            (at(middle) <= rank ? begin : end) = middle;
        }
        return first + begin;
    }
};

class VertexTree {
public:
    VertexTree(VertexTree&&) noexcept;
    VertexTree& operator=(VertexTree&&) noexcept;
    ~VertexTree();

    // A tree has at least three places and one triangle.
    NodeId node_count() const noexcept { return static_cast<NodeId>(links_.parents.size()); }
    NodeId interior_count() const noexcept { return static_cast<NodeId>(links_.first_leaf.size()); }
    NodeId place_count() const noexcept { return node_count() - interior_count(); }
    Index triangle_count() const noexcept { return static_cast<Index>(links_.triangles.size()); }
    bool is_place(NodeId node) const noexcept { return node >= interior_count(); }
    static constexpr NodeId root() noexcept { return 0; }

    // Wedges, the vertices to draw; those of a node are [first_wedge(node), wedge_end(node)).
    WedgeId wedge_count() const noexcept { return interior_wedge_count() + leaf_count(); }
    WedgeId interior_wedge_count() const noexcept { return links_.first_wedge_of(interior_count()); }
    Index leaf_count() const noexcept { return links_.leaves(); }
    bool has_seams() const noexcept { return links_.has_seams(); } // some node has more wedges than one
    WedgeId first_wedge(NodeId node) const noexcept { return links_.first_wedge_of(node); }
    WedgeId wedge_end(NodeId node) const noexcept { return links_.first_wedge_of(node + 1); }
    WedgeId wedge_of_leaf(Index leaf) const noexcept { return links_.wedge_of_leaf(leaf); }
    NodeId place_of_leaf(Index leaf) const noexcept { return links_.place_of_leaf(leaf); }
    NodeId node_of_wedge(WedgeId wedge) const noexcept { return links_.node_of_wedge(wedge); }
    // The wedge of a node above a leaf, or of its place, that holds the leaf. Cost: most nodes have one wedge, few more
    // than eight.
    WedgeId wedge_at(NodeId node, Index leaf) const noexcept { return links_.wedge_at(node, leaf); }
    // The wedge of a node that holds a wedge of a node below.
    WedgeId wedge_above(NodeId node, WedgeId below) const noexcept { return links_.wedge_above(node, below); }
    const glm::vec3& position(NodeId node) const noexcept { return positions()[first_wedge(node)]; }

    // Whether an interior node can be unfolded: its links, triangles, and children's positions and bounds are valid. Always
    // true except for trees from map_tree(), whose nodes are checked when first asked about, from the root down; until
    // then a node's values may be anything. A damaged node must stay folded, and for_each_child() gives it no children.
    // Cost: one bit; the first time, the node's children and triangles.
    bool is_sound(NodeId node) const { return !checks_ || looks_sound(node); }

    // For trees from map_tree(): checks what read_tree() checks, except for the checksums of pages. The error names a
    // damaged node or section. Cost: one parallel pass over the file, once.
    Result<void> check() const;

    // Calls f(child) for each child of an interior node in depth-first order. Cost: the number of children.
    template <class F>
    void for_each_child(NodeId node, F&& f) const;

    // Vertices, by wedge: the input's for leaves, else proxies. Attributes that the mesh did not have are empty.
    glm::dvec3 origin() const noexcept;
    std::span<const glm::vec3> positions() const noexcept;
    std::span<const Unorm16> luminance() const noexcept;    // under light(); never empty
    std::span<const PackedNormal> normals() const noexcept; // unit length or zero; never empty
    std::span<const glm::vec4> colours() const noexcept;    // linear; reflectance, unless is_prelit()
    std::span<const glm::vec2> uvs() const noexcept;

    // The image over the surface, placed by uvs(). It multiplies the vertices' colours and luminance. May be empty.
    TextureView texture() const noexcept;

    // Bounds, by interior node.
    std::span<const NodeBounds> bounds() const noexcept;
    NormalMask mask(NodeId node) const noexcept;                     // of the same normals as the slabs; unpacks it
    std::span<const Sphere> support_spheres() const noexcept;        // leaves and proxies of the subtree
    std::span<const PackedRange> support_luminance() const noexcept; // of all wedges, without the texture
    std::span<const PackedRange> ring_luminance() const noexcept;    // as drawn: with the texture
    std::span<const PackedRange> ring_texture() const noexcept;      // the texture's own luminance; empty without one
    std::span<const Unorm16> adaptation_luminance() const noexcept;  // middle of ring_luminance, saturated up the tree
    // How far the surface moves when the node folds, mesh units: bounds the distance from it to the original surface and
    // back, in cuts without turned triangles (as criteria make them). Vertices that slide in the surface, along its edges
    // or its borders do not count.
    std::span<const float> displacement() const noexcept;

    // Protection, see MeshView::weights and BuildOptions::border_weight. By interior node: what the cost of its fold is
    // multiplied with, at least the children's. One value is the root's, and 1 for all others; empty is 1 for all.
    std::span<const float> fold_weights() const noexcept;
    // Whether the root never folds. The places that never fold are among its children: no cut of a criterion has fewer
    // triangles than vanish there, and at what the root needs.
    bool is_locked() const noexcept { return is_locked_; }
    Index locked_triangles() const noexcept { return locked_triangles_; }

    // The input: by leaf its first vertex, by triangle its number, and its ranges (groups, materials). The last two are
    // empty if the input had no ranges.
    std::span<const Index> source_vertices() const noexcept;
    Index source_vertex_count() const noexcept; // of the input's vertices, those without a triangle included
    std::span<const Index> source_triangles() const noexcept;
    std::span<const MeshRange> ranges() const noexcept;
    std::uint64_t dropped_triangles() const noexcept;     // input triangles with two corners at one position
    std::span<const std::byte> document() const noexcept; // MeshView::document; unchecked if it comes from a file
    Closedness closedness() const noexcept;
    const Creases& creases() const noexcept;         // how the normals of leaves were found
    Sphere bounding_sphere() const noexcept;         // of the triangles' corners
    LuminanceRange luminance_range() const noexcept; // of all that is drawn

    const Light& light() const noexcept;
    bool is_prelit() const noexcept; // luminance comes from the colours and the texture alone

    // The same tree under another light: luminance and its bounds are computed anew, attributes are dropped, all else is
    // shared. Colours and texture of a pre-lit mesh then count as reflectance. Fails if check() fails. Cost: one pass over
    // triangles and nodes.
    Result<VertexTree> relit(const Light& light) const;

    // The same with the caller's own relative luminances of wedges, clamped to 0..1 (NaN: 0), times the texture if
    // `keeps_texture`. The result is pre-lit. The callback is called from several threads.
    Result<VertexTree> shaded(const FunctionRef<float(WedgeId)>& luminance, bool keeps_texture = false) const;

    // The same without the texture, under its own light. Vertices without colours get the default albedo, lit.
    Result<VertexTree> untextured() const;

    // An attribute's values; empty if there is none of that name whose sizes are those of T. Valid as long as some handle
    // has the attribute. Values from files are unchecked, in a SoundTree too: the owner of a name checks each.
    template <class T>
    std::span<const T> attribute(std::string_view name) const noexcept {
        static_assert(is_attribute_value<T>());
        const auto bytes = attribute_bytes(name, sizeof(T), attribute_component_bytes<T>());
        return {reinterpret_cast<const T*>(bytes.data()), bytes.size() / sizeof(T)};
    }
    std::span<const Attribute> attributes() const noexcept;

    // Another handle that has this attribute, replacing one of the same name, and shares all else. relit() and its like
    // drop attributes, which were measured under another light. Files keep them, under unknown names too. Fails if the name
    // is invalid (see Attribute), the number of values does not fit the domain, or the tree has most_attributes already.
    template <class T>
    Result<VertexTree> with_attribute(std::string_view name, AttributeDomain domain, std::vector<T> values) const {
        static_assert(is_attribute_value<T>());
        const auto kept = std::make_shared<const std::vector<T>>(std::move(values));
        return with_attribute({std::string(name), domain, sizeof(T), attribute_component_bytes<T>(), kept->size(), kept,
                               std::as_bytes(std::span(*kept))});
    }

    // Bytes of all arrays. A mapped tree's are resident only where they were used.
    std::uint64_t byte_size() const noexcept;

    // Another handle to the same data, which lives as long as one of them.
    VertexTree share() const { return VertexTree(data_); }

    struct Data; // the arrays, for the builder and the file reader
    explicit VertexTree(std::shared_ptr<const Data> data);
    const Data& data() const noexcept { return *data_; }

private:
    friend class SoundTree;
    friend struct UncheckedLinks; // for code that asks is_sound() node by node
    bool looks_sound(NodeId node) const;
    std::span<const std::byte> attribute_bytes(std::string_view name, std::size_t element,
                                               std::uint32_t component) const noexcept;
    Result<VertexTree> with_attribute(Attribute attribute) const;

    std::shared_ptr<const Data> data_;
    NodeChecks* checks_ = nullptr; // of data_
    bool is_locked_ = false;
    Index locked_triangles_ = 0;
    // Views of data_, kept here because they are read node by node.
    struct Links : WedgeLinks<std::span<const NodeId>>, NeedArrays<ConstSpan> {
        std::span<const Index> first_triangle;
        std::span<const Triangle> triangles;

        bool is_needing(NodeId node) const noexcept { return !needing.empty() && is_in(needing, node); }
        std::span<const NodeId> needs_of(NodeId node) const noexcept {
            const Index k = rank_in(needing, node);
            return needs.subspan(first_need[k], first_need[k + 1] - first_need[k]);
        }

        Index triangles_of(NodeId node) const noexcept { return first_triangle[node + 1] - first_triangle[node]; }
    };
    Links links_;
};

// A handle to a tree that has been checked as a whole, so that no file can lead a walk through it out of bounds.
class SoundTree : public VertexTree {
public:
    // Fails if VertexTree::check() fails, and costs as much: nothing for trees that were built or read.
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

// Checks what the tree promises, except for attributes: spheres, slabs, intervals and displacements (of nodes with up
// to 4096 leaves) contain what they should and nest, and triangles vanish at their nodes. The error names the first offender.
// Cost: leaves times depth.
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
            const NodeId place = links_.place_of_leaf(leaf);
            f(place);
            leaf += wedge_end(place) - first_wedge(place);
        }
    }
}

} // namespace unseen::vdtree
