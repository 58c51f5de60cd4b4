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

#include <string>
#include <type_traits>
#include <utility>
#include <vector>

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

    Soup<M> out;
    adapters::CornerSoup soup(vertex_normals || corner_normals, has_colours, vertex_uvs || corner_uvs);
    std::vector<adapters::CornerSoup::Corner> corners; // by vertex of the soup
    constexpr vdtree::Index deleted = static_cast<vdtree::Index>(-1);
    std::vector<vdtree::Index> numbers(mesh.n_vertices(), deleted); // by vertex handle
    std::vector<typename M::VertexHandle> kept;
    for (std::size_t i = 0; i < mesh.n_vertices(); ++i) {
        const typename M::VertexHandle v(static_cast<int>(i));
        if (vertex_is_deleted(v)) continue;
        adapters::CornerSoup::Corner corner;
        if (vertex_normals) corner.normal = detail::vec3_of(mesh.normal(v));
        if (has_colours) corner.colour = detail::colour_of(mesh.color(v), options.colours);
        if (vertex_uvs) corner.uv = {mesh.texcoord2D(v)[0], mesh.texcoord2D(v)[1]};
        numbers[i] = static_cast<vdtree::Index>(kept.size());
        const auto p = mesh.point(v);
        soup.add_vertex(glm::dvec3(p[0], p[1], p[2]), corner);
        corners.push_back(corner);
        kept.push_back(v);
    }
    for (std::size_t i = 0; i < mesh.n_faces(); ++i) {
        const typename M::FaceHandle f(static_cast<int>(i));
        if (face_is_deleted(f)) continue;
        const std::string face = "Face " + std::to_string(i);
        const auto first = mesh.halfedge_handle(f);
        if (!first.is_valid())
            return adapters::malformed(face + " has no halfedge: it was made without vertices; delete it.");
        vdtree::Triangle triangle{};
        std::size_t count = 0;
        auto h = first;
        do {
            const auto v = mesh.to_vertex_handle(h);
            if (!v.is_valid() || static_cast<std::size_t>(v.idx()) >= numbers.size() ||
                numbers[static_cast<std::size_t>(v.idx())] == deleted)
                return adapters::malformed(face + " uses vertex " + std::to_string(v.idx()) +
                                           ", which is deleted or not there; delete the face, too.");
            if (count < 3) {
                const vdtree::Index number = numbers[static_cast<std::size_t>(v.idx())];
                adapters::CornerSoup::Corner corner = corners[number];
                if (corner_normals) corner.normal = detail::vec3_of(mesh.normal(h));
                if (corner_uvs) corner.uv = {mesh.texcoord2D(h)[0], mesh.texcoord2D(h)[1]};
                triangle[count] = soup.corner(number, corner);
            }
            ++count;
            h = mesh.next_halfedge_handle(h);
        } while (h.is_valid() && h != first && count <= mesh.n_halfedges());
        if (const auto valid = adapters::check_face(face, h == first, count, "call triangulate() first."); !valid)
            return valid.error();
        soup.add_triangle(triangle);
        out.faces.push_back(f);
    }
    soup.finish(out, kept);
    return out;
}

// Normals, colours and texture coordinates become vertex properties if the soup has them. Coincident vertices stay apart.
// Fails if vdtree::validate() fails. Meanwhile OpenMesh prints no errors, in other threads neither.
template <class M>
Result<Made<M>> from_mesh(const vdtree::MeshView& soup, const Options& options = {}) {
    if (const auto valid = vdtree::validate(soup); !valid) return valid.error();
    Made<M> out;
    M& mesh = out.mesh;
    mesh.reserve(soup.positions.size(), soup.positions.size() + soup.triangles.size(), soup.triangles.size());
    if (!soup.normals.empty()) mesh.request_vertex_normals();
    if (!soup.colours.empty()) mesh.request_vertex_colors();
    if (!soup.uvs.empty()) mesh.request_vertex_texcoords2D();
    using Coordinate = typename OpenMesh::vector_traits<typename M::Point>::value_type;
    using NormalCoordinate = typename OpenMesh::vector_traits<typename M::Normal>::value_type;
    using TexCoordinate = typename OpenMesh::vector_traits<typename M::TexCoord2D>::value_type;
    const auto add_vertex = [&](vdtree::Index source) {
        const glm::dvec3 p = soup.positions[source];
        const auto v = mesh.add_vertex(typename M::Point(static_cast<Coordinate>(p.x), static_cast<Coordinate>(p.y),
                                                         static_cast<Coordinate>(p.z)));
        if (!soup.normals.empty()) {
            const glm::vec3 n = soup.normals[source];
            mesh.set_normal(v,
                            typename M::Normal(static_cast<NormalCoordinate>(n.x), static_cast<NormalCoordinate>(n.y),
                                               static_cast<NormalCoordinate>(n.z)));
        }
        if (!soup.colours.empty())
            mesh.set_color(v, detail::openmesh_colour<typename M::Color>(soup.colours[source], options.colours));
        if (!soup.uvs.empty())
            mesh.set_texcoord2D(v, typename M::TexCoord2D(static_cast<TexCoordinate>(soup.uvs[source].x),
                                                          static_cast<TexCoordinate>(soup.uvs[source].y)));
        out.sources.push_back(source);
        return v;
    };
    for (std::size_t v = 0; v < soup.positions.size(); ++v) add_vertex(static_cast<vdtree::Index>(v));
    const detail::QuietErrors quiet;
    const auto handle = [](vdtree::Index v) { return typename M::VertexHandle(static_cast<int>(v)); };
    const auto add_face = [&](auto a, auto b, auto c) { return mesh.add_face(a, b, c).is_valid(); };
    const auto loose = adapters::add_triangles(soup, handle, add_vertex, add_face);
    if (!loose) return loose.error();
    out.loose_triangles = *loose;
    return out;
}

// The tree of a mesh. Its source_vertices() are the numbers of the handles, if nothing is deleted and attributes are by
// vertex. Otherwise call to_mesh(), which returns the sources, and vdtree::build_tree().
template <class M>
Result<vdtree::VertexTree> build_tree(const M& mesh, const vdtree::BuildOptions& build = {},
                                      const Options& options = {}) {
    const auto soup = to_mesh(mesh, options);
    if (!soup) return soup.error();
    return vdtree::build_tree(soup->mesh.view(), build);
}

// The cut as a mesh; `sources` are the tree's nodes.
template <class M>
Result<Made<M>> extract_mesh(const vdtree::Cut& cut, const Options& options = {}) {
    return adapters::extract_mesh(cut, [&](const vdtree::MeshView& soup) { return from_mesh<M>(soup, options); });
}

} // namespace unseen::openmesh

// At the end, as it uses the declarations above.
#include <unseen/openmesh/decimater_clusterer.h>
