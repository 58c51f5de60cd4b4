// openmesh: trees from OpenMesh meshes, and cuts back into them. Headers alone; link OpenMesh (BSD, three clauses) yourself.
// The decimater as a clusterer: <unseen/openmesh/decimater_clusterer.h>, which is included at the end.
//
//     OpenMesh::IO::read_mesh(mesh, "bunny.ply");
//     const auto tree = openmesh::build_tree(mesh);
//     vdtree::Cut cut(*tree); // and follow a view, see <unseen/vdtree/vdtree.h>
//     const auto small = openmesh::extract_mesh<MyMesh>(cut);
//
// Any mesh of OpenMesh's array kernel: TriMesh_ArrayKernelT, or PolyMesh_ArrayKernelT with triangles only. If a mesh has an
// attribute both by vertex and by corner (halfedge), the vertex's is used. If only corners have it, such as texture
// coordinates at seams, vertices are split.
#pragma once

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

#include <unseen/adapters/adapters.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>

namespace unseen::openmesh {

using adapters::ColourEncoding;
using adapters::Options;

template <class M>
using Soup = adapters::Soup<typename M::VertexHandle, typename M::FaceHandle>;
using adapters::Made;

namespace detail {

// Silences OpenMesh, which writes to stderr whenever it refuses a face; the result reports that.
class QuietErrors {
public:
    QuietErrors() : was_enabled_(omerr().is_enabled()) { omerr().disable(); }
    ~QuietErrors() {
        if (was_enabled_) omerr().enable();
    }
    QuietErrors(const QuietErrors&) = delete;
    QuietErrors& operator=(const QuietErrors&) = delete;

private:
    bool was_enabled_;
};

template <class V>
glm::vec3 vec3_of(const V& v) {
    return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

template <class V, class Vector>
V vector_of(const Vector& v) {
    V out;
    for (std::size_t k = 0; k < OpenMesh::vector_traits<V>::size_; ++k)
        out[k] = static_cast<typename OpenMesh::vector_traits<V>::value_type>(v[static_cast<int>(k)]);
    return out;
}

// OpenMesh's colours have three or four channels of bytes, or of floating-point numbers from 0 to 1.
template <class Colour>
glm::vec4 colour_of(const Colour& colour, ColourEncoding encoding) {
    using Channel = typename OpenMesh::vector_traits<Colour>::value_type;
    constexpr std::size_t channels = OpenMesh::vector_traits<Colour>::size_;
    static_assert(channels == 3 || channels == 4, "Colours have three or four channels.");
    constexpr float white = std::is_floating_point_v<Channel> ? 1.0f : 255.0f;
    glm::vec4 out(1);
    for (std::size_t k = 0; k < channels; ++k) {
        const float share = static_cast<float>(colour[k]) / white;
        out[static_cast<int>(k)] = k < 3 ? adapters::decoded(share, encoding) : share;
    }
    return out;
}

template <class Colour>
Colour openmesh_colour(const glm::vec4& linear, ColourEncoding encoding) {
    using Channel = typename OpenMesh::vector_traits<Colour>::value_type;
    Colour out;
    for (std::size_t k = 0; k < OpenMesh::vector_traits<Colour>::size_; ++k) {
        const float channel = linear[static_cast<int>(k)];
        const float share = k < 3 ? adapters::encoded(channel, encoding) : channel;
        if constexpr (std::is_floating_point_v<Channel>) out[k] = static_cast<Channel>(share);
        else out[k] = static_cast<Channel>(adapters::to_byte(share));
    }
    return out;
}

} // namespace detail

// Vertices and faces in their order, without deleted ones: garbage need not be collected before. Fails if a face is not a
// triangle, has no halfedge, or uses a deleted vertex.
template <class M>
Result<Soup<M>> to_mesh(const M& mesh, const Options& options = {}) {
    const auto vertex_is_deleted = [&](auto v) { return mesh.has_vertex_status() && mesh.status(v).deleted(); };
    const auto face_is_deleted = [&](auto f) { return mesh.has_face_status() && mesh.status(f).deleted(); };
    const bool vertex_normals = mesh.has_vertex_normals(), vertex_uvs = mesh.has_vertex_texcoords2D();
    const bool corner_normals = !vertex_normals && mesh.has_halfedge_normals();
    const bool corner_uvs = !vertex_uvs && mesh.has_halfedge_texcoords2D();
    const bool has_colours = mesh.has_vertex_colors();

    using Maker = adapters::SoupMaker<typename M::VertexHandle, typename M::FaceHandle>;
    using Corner = typename Maker::Corner;
    Maker soup(vertex_normals || corner_normals, has_colours, vertex_uvs || corner_uvs);
    constexpr vdtree::Index deleted = static_cast<vdtree::Index>(-1);
    std::vector<vdtree::Index> numbers(mesh.n_vertices(), deleted); // by vertex handle
    vdtree::Index kept = 0;
    for (std::size_t i = 0; i < mesh.n_vertices(); ++i) {
        const typename M::VertexHandle v(static_cast<int>(i));
        if (vertex_is_deleted(v)) continue;
        Corner corner;
        if (vertex_normals) corner.normal = detail::vec3_of(mesh.normal(v));
        if (has_colours) corner.colour = detail::colour_of(mesh.color(v), options.colours);
        if (vertex_uvs) corner.uv = {mesh.texcoord2D(v)[0], mesh.texcoord2D(v)[1]};
        numbers[i] = kept++;
        const auto p = mesh.point(v);
        soup.add_vertex(v, glm::dvec3(p[0], p[1], p[2]), corner);
    }
    for (std::size_t i = 0; i < mesh.n_faces(); ++i) {
        const typename M::FaceHandle f(static_cast<int>(i));
        if (face_is_deleted(f)) continue;
        const std::string face = "Face " + std::to_string(i);
        const auto first = mesh.halfedge_handle(f);
        if (!first.is_valid())
            return adapters::malformed(face + " has no halfedge: it was made without vertices; delete it.");
        const auto next = [&](auto h) { return mesh.next_halfedge_handle(h); };
        const auto source_of = [&](auto h) -> Result<vdtree::Index> {
            if (!h.is_valid()) return adapters::not_closed(face);
            const auto v = mesh.to_vertex_handle(h);
            if (v.is_valid() && static_cast<std::size_t>(v.idx()) < numbers.size() &&
                numbers[static_cast<std::size_t>(v.idx())] != deleted)
                return numbers[static_cast<std::size_t>(v.idx())];
            return adapters::malformed(face + " uses vertex " + std::to_string(v.idx()) +
                                       ", which is deleted or not there; delete the face, too.");
        };
        const auto set_own = [&](auto h, Corner& corner) {
            if (corner_normals) corner.normal = detail::vec3_of(mesh.normal(h));
            if (corner_uvs) corner.uv = {mesh.texcoord2D(h)[0], mesh.texcoord2D(h)[1]};
        };
        if (const auto added = soup.add_face(f, face, first, mesh.n_halfedges(), next, source_of, set_own,
                                             "call triangulate() first.");
            !added)
            return added.error();
    }
    return soup.finish();
}

// Normals, colours and texture coordinates become vertex properties if the soup has them. Coincident vertices stay apart.
// Fails if vdtree::validate() fails. Meanwhile OpenMesh prints no errors, in other threads neither.
template <class M>
Result<Made<M>> from_mesh(const vdtree::MeshView& soup, const Options& options = {}) {
    if (const auto valid = vdtree::validate(soup); !valid) return valid.error();
    Made<M> out;
    out.mesh.reserve(soup.positions.size(), soup.positions.size() + soup.triangles.size(), soup.triangles.size());
    if (!soup.normals.empty()) out.mesh.request_vertex_normals();
    if (!soup.colours.empty()) out.mesh.request_vertex_colors();
    if (!soup.uvs.empty()) out.mesh.request_vertex_texcoords2D();
    const auto add_vertex = [&](M& mesh, vdtree::Index source) {
        const auto v = mesh.add_vertex(detail::vector_of<typename M::Point>(soup.positions[source]));
        if (!soup.normals.empty()) mesh.set_normal(v, detail::vector_of<typename M::Normal>(soup.normals[source]));
        if (!soup.colours.empty())
            mesh.set_color(v, detail::openmesh_colour<typename M::Color>(soup.colours[source], options.colours));
        if (!soup.uvs.empty()) mesh.set_texcoord2D(v, detail::vector_of<typename M::TexCoord2D>(soup.uvs[source]));
        return v;
    };
    const auto add_face = [](M& mesh, auto a, auto b, auto c) { return mesh.add_face(a, b, c).is_valid(); };
    const detail::QuietErrors quiet;
    return adapters::filled(std::move(out), soup, add_vertex, add_face);
}

// The tree of a mesh. Its source_vertices() are the numbers of the handles, if nothing is deleted and attributes are by
// vertex. Otherwise call to_mesh(), which returns the sources, and vdtree::build_tree().
template <class M>
Result<vdtree::VertexTree> build_tree(const M& mesh, const vdtree::BuildOptions& build = {},
                                      const Options& options = {}) {
    return adapters::build_tree(to_mesh(mesh, options), build);
}

// The cut as a mesh; `sources` are the tree's wedges.
template <class M>
Result<Made<M>> extract_mesh(const vdtree::Cut& cut, const Options& options = {}) {
    return adapters::extract_mesh(cut, [&](const vdtree::MeshView& soup) { return from_mesh<M>(soup, options); });
}

} // namespace unseen::openmesh

// At the end, as it uses the declarations above.
#include <unseen/openmesh/decimater_clusterer.h>
