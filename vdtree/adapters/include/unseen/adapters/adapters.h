// Code that the adapters for other libraries' meshes share: corners with attributes of their own, colours in bytes, errors.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/mesh.h>
#include <unseen/vdtree/result.h>

namespace unseen::adapters {

// The encoding of colours in the other library's mesh. Trees store linear ones.
enum class ColourEncoding : std::uint8_t { srgb, linear };

struct Options {
    ColourEncoding colours = ColourEncoding::srgb; // the encoding of image files and most mesh files
};

// A soup, and the source of each of its elements in the other library's mesh.
template <class VertexHandle, class FaceHandle>
struct Soup {
    vdtree::Mesh mesh;
    std::vector<VertexHandle> vertices; // by vertex of the soup
    std::vector<FaceHandle> faces;      // by triangle
};

// A mesh of the other library, and the source of each of its vertices.
template <class M>
struct Made {
    M mesh;
    std::vector<vdtree::Index> sources; // by vertex: the soup's vertex, or the tree's node
    // Halfedges can only hold a manifold surface. This many triangles did not fit and have vertices of their own, at the
    // same positions. Only triangles that use a vertex twice are left out.
    std::size_t loose_triangles = 0;
};

// One channel, 0..1 both ways.
inline float decoded(float channel, ColourEncoding encoding) {
    return encoding == ColourEncoding::srgb ? srgb_to_linear(channel) : channel;
}
inline float encoded(float channel, ColourEncoding encoding) {
    return encoding == ColourEncoding::srgb ? linear_to_srgb(channel) : channel;
}
// The nearest byte; NaN is 0.
inline std::uint8_t to_byte(float channel) {
    return channel > 0 ? static_cast<std::uint8_t>(std::lround(255 * std::min(channel, 1.0f))) : std::uint8_t{0};
}

// A soup of a mesh whose corners may have attributes of their own. Vertex i of the source is vertex i of the soup;
// corners with other attributes than the vertex's first corner get further vertices at its position.
class CornerSoup {
public:
    struct Corner {
        glm::vec3 normal = glm::vec3(0);
        glm::vec4 colour = glm::vec4(1);
        glm::vec2 uv = glm::vec2(0);
    };

    CornerSoup(bool has_normals, bool has_colours, bool has_uvs)
        : has_normals_(has_normals), has_colours_(has_colours), has_uvs_(has_uvs) {}

    // A vertex of the source. `corner`: attributes of all its corners; unused vertices keep them.
    void add_vertex(glm::dvec3 position, const Corner& corner) {
        sources_.push_back(static_cast<vdtree::Index>(mesh_.positions.size()));
        is_used_.push_back(0);
        append(position, corner);
    }

    // The soup's vertex for a corner at a vertex of the source. Call it after all vertices have been added.
    vdtree::Index corner(vdtree::Index source, const Corner& corner) {
        if (!is_used_[source]) {
            is_used_[source] = 1;
            set(source, corner);
            return source;
        }
        vdtree::Index last = source;
        for (vdtree::Index v = source; v != none; v = next_[v]) {
            if (has(v, corner)) return v;
            last = v;
        }
        const auto made = static_cast<vdtree::Index>(mesh_.positions.size());
        next_[last] = made;
        sources_.push_back(source);
        append(glm::dvec3(mesh_.positions[source]), corner);
        return made;
    }

    void add_triangle(const vdtree::Triangle& t) { mesh_.triangles.push_back(t); }

    // Moves everything into a Soup. `handles`: by vertex of the source.
    template <class S>
    void finish(S& out, const decltype(S::vertices)& handles) {
        out.vertices.reserve(sources_.size());
        for (const vdtree::Index source : sources_) out.vertices.push_back(handles[source]);
        out.mesh = std::move(mesh_);
    }

private:
    static constexpr vdtree::Index none = std::numeric_limits<vdtree::Index>::max();

    void append(glm::dvec3 position, const Corner& corner) {
        mesh_.positions.push_back(position);
        next_.push_back(none);
        if (has_normals_) mesh_.normals.push_back(corner.normal);
        if (has_colours_) mesh_.colours.push_back(corner.colour);
        if (has_uvs_) mesh_.uvs.push_back(corner.uv);
    }
    void set(vdtree::Index v, const Corner& corner) {
        if (has_normals_) mesh_.normals[v] = corner.normal;
        if (has_colours_) mesh_.colours[v] = corner.colour;
        if (has_uvs_) mesh_.uvs[v] = corner.uv;
    }
    bool has(vdtree::Index v, const Corner& corner) const {
        return (!has_normals_ || mesh_.normals[v] == corner.normal) &&
               (!has_colours_ || mesh_.colours[v] == corner.colour) && (!has_uvs_ || mesh_.uvs[v] == corner.uv);
    }

    bool has_normals_, has_colours_, has_uvs_;
    vdtree::Mesh mesh_;
    std::vector<vdtree::Index> sources_, next_; // next_: the next soup vertex of the same source
    std::vector<std::uint8_t> is_used_;         // by vertex of the source
};

inline Error malformed(const std::string& what) { return {ErrorCode::malformed_data, what}; }

// Fails unless the halfedges around a face lead back to the first after three corners.
inline Result<void> check_face(const std::string& face, bool is_closed, std::size_t corners, const char* advice) {
    if (!is_closed) return malformed(face + " is not closed: its halfedges do not lead back to the first.");
    if (corners == 3) return {};
    return Error{ErrorCode::unsupported,
                 face + " has " + std::to_string(corners) + " corners, and trees are of triangles: " + advice};
}

// Adds the triangles of a soup to a mesh whose vertex i is `handle(i)`. `add_face` returns whether the mesh took the face;
// other triangles get vertices of their own by `add_vertex(i)`. Returns their number.
template <class Handle, class AddVertex, class AddFace>
Result<std::size_t> add_triangles(const vdtree::MeshView& soup, const Handle& handle, const AddVertex& add_vertex,
                                  const AddFace& add_face) {
    std::vector<vdtree::Triangle> refused;
    for (const vdtree::Triangle& t : soup.triangles) {
        if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
        if (!add_face(handle(t[0]), handle(t[1]), handle(t[2]))) refused.push_back(t);
    }
    for (const vdtree::Triangle& t : refused) {
        const auto a = add_vertex(t[0]), b = add_vertex(t[1]), c = add_vertex(t[2]);
        if (!add_face(a, b, c)) return malformed("A triangle that stands alone was refused.");
    }
    return refused.size();
}

// The cut as a mesh of the other library, made by `from_mesh(soup)`; its sources become the tree's nodes.
template <class FromMesh>
auto extract_mesh(const vdtree::Cut& cut, const FromMesh& from_mesh) {
    const vdtree::ExtractedMesh extracted = vdtree::extract_with_sources(cut);
    auto made = from_mesh(extracted.mesh.view());
    if (made)
        for (vdtree::Index& source : made->sources) source = extracted.nodes[source];
    return made;
}

} // namespace unseen::adapters
