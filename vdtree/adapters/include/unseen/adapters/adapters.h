// Code that the adapters for other libraries' meshes share: corners with attributes of their own, colours in bytes, errors.
#pragma once

#include <algorithm>

#include <unseen/vdtree/builder.h>
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
    std::vector<vdtree::Index> sources; // by vertex: the soup's vertex, or the tree's wedge
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

inline Error malformed(const std::string& what) { return {ErrorCode::malformed_data, what}; }

inline Error not_closed(const std::string& face) {
    return malformed(face + " is not closed: its halfedges do not lead back to the first.");
}

// Makes a soup of a halfedge mesh whose corners may have attributes of their own. Vertex i of the mesh is vertex i of the
// soup; corners with other attributes than the vertex's first corner get further vertices at its position.
template <class VertexHandle, class FaceHandle>
class SoupMaker {
public:
    struct Corner {
        glm::vec3 normal = glm::vec3(0);
        glm::vec4 colour = glm::vec4(1);
        glm::vec2 uv = glm::vec2(0);
        bool operator==(const Corner&) const = default;
    };

    SoupMaker(bool has_normals, bool has_colours, bool has_uvs)
        : has_normals_(has_normals), has_colours_(has_colours), has_uvs_(has_uvs) {}

    // A vertex of the mesh. `corner`: attributes of all its corners; unused vertices keep them.
    void add_vertex(VertexHandle handle, glm::dvec3 position, const Corner& corner) {
        is_used_.push_back(0);
        append(handle, position, corner);
    }

    // The triangle of a face, by its first halfedge. `source_of(h)`: the number of the mesh's vertex that a halfedge leads
    // to, or why there is none. `set_own(h, corner)` sets the attributes that corners have of their own. Call it after
    // all vertices have been added.
    template <class Halfedge, class Next, class SourceOf, class SetOwn>
    Result<void> add_face(FaceHandle handle, const std::string& face, Halfedge first, std::size_t most_corners,
                          const Next& next, const SourceOf& source_of, const SetOwn& set_own, const char* advice) {
        vdtree::Triangle triangle{};
        std::size_t count = 0;
        Halfedge h = first;
        do {
            const Result<vdtree::Index> source = source_of(h);
            if (!source) return source.error();
            Corner corner = attributes(*source);
            set_own(h, corner);
            if (count < 3) triangle[count] = vertex_with(*source, corner);
            ++count;
            h = next(h);
        } while (h != first && count <= most_corners);
        if (h != first) return not_closed(face);
        if (count != 3)
            return Error{ErrorCode::unsupported,
                         face + " has " + std::to_string(count) + " corners, and trees are of triangles: " + advice};
        soup_.mesh.triangles.push_back(triangle);
        soup_.faces.push_back(handle);
        return {};
    }

    Soup<VertexHandle, FaceHandle> finish() { return std::move(soup_); }

private:
    static constexpr vdtree::Index none = std::numeric_limits<vdtree::Index>::max();

    Corner attributes(vdtree::Index v) const {
        Corner corner;
        if (has_normals_) corner.normal = soup_.mesh.normals[v];
        if (has_colours_) corner.colour = soup_.mesh.colours[v];
        if (has_uvs_) corner.uv = soup_.mesh.uvs[v];
        return corner;
    }

    vdtree::Index vertex_with(vdtree::Index source, const Corner& corner) {
        if (!is_used_[source]) {
            is_used_[source] = 1;
            if (has_normals_) soup_.mesh.normals[source] = corner.normal;
            if (has_colours_) soup_.mesh.colours[source] = corner.colour;
            if (has_uvs_) soup_.mesh.uvs[source] = corner.uv;
            return source;
        }
        vdtree::Index last = source;
        for (vdtree::Index v = source; v != none; v = next_[v]) {
            if (attributes(v) == corner) return v;
            last = v;
        }
        next_[last] = static_cast<vdtree::Index>(soup_.vertices.size());
        append(soup_.vertices[source], glm::dvec3(soup_.mesh.positions[source]), corner);
        return next_[last];
    }

    void append(VertexHandle handle, glm::dvec3 position, const Corner& corner) {
        soup_.vertices.push_back(handle);
        soup_.mesh.positions.push_back(position);
        next_.push_back(none);
        if (has_normals_) soup_.mesh.normals.push_back(corner.normal);
        if (has_colours_) soup_.mesh.colours.push_back(corner.colour);
        if (has_uvs_) soup_.mesh.uvs.push_back(corner.uv);
    }

    bool has_normals_, has_colours_, has_uvs_;
    Soup<VertexHandle, FaceHandle> soup_;
    std::vector<vdtree::Index> next_;   // by vertex of the soup: the next one of the same source
    std::vector<std::uint8_t> is_used_; // by vertex of the mesh
};

// Fills a mesh with a soup: `add_vertex(i)` adds the soup's vertex i, and `add_face` returns whether the mesh took the
// face; other triangles get vertices of their own.
template <class M, class AddVertex, class AddFace>
Result<Made<M>> filled(Made<M>&& out, const vdtree::MeshView& soup, const AddVertex& add_vertex,
                       const AddFace& add_face) {
    const auto add = [&](vdtree::Index source) {
        out.sources.push_back(source);
        return add_vertex(out.mesh, source);
    };
    std::vector<decltype(add(0))> handles;
    for (std::size_t v = 0; v < soup.positions.size(); ++v) handles.push_back(add(static_cast<vdtree::Index>(v)));
    std::vector<vdtree::Triangle> refused;
    for (const vdtree::Triangle& t : soup.triangles) {
        if (vdtree::uses_a_vertex_twice(t)) continue;
        if (!add_face(out.mesh, handles[t[0]], handles[t[1]], handles[t[2]])) refused.push_back(t);
    }
    for (const vdtree::Triangle& t : refused) {
        const auto a = add(t[0]), b = add(t[1]), c = add(t[2]);
        if (!add_face(out.mesh, a, b, c)) return malformed("A triangle that stands alone was refused.");
    }
    out.loose_triangles = refused.size();
    return std::move(out);
}

// The tree of a soup, or why there is no soup.
template <class S>
Result<vdtree::VertexTree> build_tree(const Result<S>& soup, const vdtree::BuildOptions& build) {
    if (!soup) return soup.error();
    return vdtree::build_tree(soup->mesh.view(), build);
}

// The cut as a mesh of the other library, made by `from_mesh(soup)`; its sources become the tree's wedges.
template <class FromMesh>
auto extract_mesh(const vdtree::Cut& cut, const FromMesh& from_mesh) {
    const vdtree::ExtractedMesh extracted = vdtree::extract_with_sources(cut);
    auto made = from_mesh(extracted.mesh.view());
    if (made)
        for (vdtree::Index& source : made->sources) source = extracted.wedges[source];
    return made;
}

} // namespace unseen::adapters
