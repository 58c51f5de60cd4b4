// The arrays of a vertex tree, as the builder fills them and the file stores them. See <unseen/vdtree/vertex_tree.h>.
#pragma once

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

template <class T>
using Vector = std::vector<T>;

// A finished array of a tree: its own memory, or a view of a mapped file, which must outlive it.
template <class T>
class Array {
public:
    using value_type = T;

    Array() = default;
    Array(std::vector<T>&& values) : owned_(std::move(values)), view_(owned_) {}
    explicit Array(std::span<const T> view) : view_(view) {}
    Array(Array&& other) noexcept : owned_(std::move(other.owned_)), view_(std::exchange(other.view_, {})) {}
    Array& operator=(Array&& other) noexcept {
        owned_ = std::move(other.owned_);
        view_ = std::exchange(other.view_, {});
        return *this;
    }

    const T& operator[](std::size_t i) const noexcept { return view_[i]; }
    const T* data() const noexcept { return view_.data(); }
    std::size_t size() const noexcept { return view_.size(); }
    bool empty() const noexcept { return view_.empty(); }
    auto begin() const noexcept { return view_.begin(); }
    auto end() const noexcept { return view_.end(); }

    // What is allocated, or what is mapped.
    std::size_t bytes() const noexcept { return owned_.empty() ? view_.size_bytes() : owned_.capacity() * sizeof(T); }

private:
    std::vector<T> owned_;
    std::span<const T> view_;
};

struct TextureFacts {
    std::uint32_t width, height;
    Wrap wrap_u, wrap_v;
};
static_assert(sizeof(TextureFacts) == 16);

// `Storage`: Vector while they are filled, Array when they are done.
template <template <class> class Storage>
struct GeometryArrays : WedgeArrays<Storage>, NeedArrays<Storage> {
    Storage<NodeId> parents; // by node: interior nodes, then places

    // By wedge.
    Storage<glm::vec3> positions;
    Storage<PackedNormal> normals;
    Storage<glm::vec4> colours;
    Storage<glm::vec2> uvs;

    // By interior node.
    Storage<Index> first_leaf, leaf_end;
    Storage<NodeId> subtree_end;
    Storage<Index> first_triangle; // one longer
    Storage<NodeBounds> bounds;
    Storage<Sphere> support_spheres;
    Storage<std::uint32_t> mask_at; // into mask_records
    Storage<float> displacement;
    // What is multiplied with what folds cost, nested; only the root's may be infinite: it never folds. Empty: 1 for all;
    // one: the root's, and 1 for the others.
    Storage<float> fold_weights;

    Storage<std::uint8_t> mask_records; // see mask_pool.h

    // By triangle.
    Storage<Triangle> triangles;
    Storage<Index> source_triangles; // empty without ranges

    Storage<Index> source_vertices; // by leaf
    // The mesh's, of the places among the root's children, in their order, if the root never folds and floats round some.
    Storage<glm::dvec3> locked_positions;
    Storage<std::byte> document; // MeshView::document

    // Textured trees only.
    Storage<TextureFacts> texture; // one
    Storage<Texel> texels;
    Storage<Texel> emission, relief;   // as many, or none
    Storage<std::byte> blends;         // one if TextureView::blends, or none
    Storage<PackedRange> ring_texture; // by interior node
};

struct GeometryFacts {
    std::vector<MeshRange> ranges;
    glm::dvec3 origin = glm::dvec3(0);
    Sphere bounding_sphere;
    std::uint64_t dropped_triangles = 0;
    Index source_vertex_count = 0;
    Closedness closedness = Closedness::open;
    Creases creases;
};

// What another light leaves as it is.
struct TreeGeometry : GeometryArrays<Array>, GeometryFacts {
    std::shared_ptr<const void> mapping; // the memory that arrays view

    // Empty without a texture.
    TextureView texture_view() const {
        if (texture.empty()) return {};
        return {texture[0].width, texture[0].height, texture[0].wrap_u, texture[0].wrap_v,
                texels,           !blends.empty(),   emission,          relief};
    }
    // As a texture by itself; there must be one.
    TextureView emission_view() const {
        TextureView view = texture_view();
        view.texels = emission;
        return view;
    }
};

template <template <class> class Storage>
struct LuminanceArrays {
    Storage<Unorm16> luminance;         // by wedge
    Storage<PackedRange> support_range; // by interior node, and so on
    Storage<PackedRange> ring_range;
    Storage<Unorm16> adaptation;
};

// What depends on the light.
struct TreeLuminance : LuminanceArrays<Array> {
    Light light;
    bool prelit = false;
    bool textured = false; // by the geometry's texture, if it has one
    LuminanceRange range;
};

// Which nodes of a mapped file have been looked at. For any number of threads.
class NodeChecks;

struct VertexTree::Data {
    std::shared_ptr<const TreeGeometry> geometry;
    std::shared_ptr<const TreeLuminance> light;
    std::shared_ptr<NodeChecks> checks; // of mapped files, over these two; none: everything has been checked, or built
    std::vector<Attribute> attributes;
};

// Why an attribute cannot belong to a tree with this many nodes, as a sentence; empty if it can.
std::string fault_in_attribute(const Attribute& attribute, std::size_t interior_count, std::size_t node_count);

// In memory of its own, whatever the given arrays view.
TreeLuminance copy_of(const TreeLuminance& light);

class TreeParts;

// Luminance of every wedge and the bounds over support and ring, bottom-up. `parts`: of this tree, with its triangles.
// `given`: luminances in the light's place, of proxies, too; null: none.
// Cost: one pass over triangles and nodes; parallel.
TreeLuminance derive_luminance(const TreeGeometry& geometry, const TreeParts& parts, const Light& light, bool prelit,
                               bool textured, const FunctionRef<float(WedgeId)>* given);

// Relative luminance of one vertex; a texture's is to be multiplied with it.
float vertex_luminance(glm::vec3 normal, const glm::vec4* colour, const Light& light, bool prelit,
                       bool textured = false);

} // namespace unseen::vdtree
