// cgal: trees from CGAL surface meshes, and cuts back into them.
//
// Headers alone, under Unseen's licence; CGAL is linked by who includes them. Its package Surface_mesh is under the GPL,
// version 3 or later, or a commercial licence: a program that uses these headers is bound by one of the two.
//
//     CGAL::Surface_mesh<Kernel::Point_3> mesh; // and read it
//     const auto tree = cgal::build_tree(mesh);
//     vdtree::Cut cut(*tree); // and follow a view, see <unseen/vdtree/vdtree.h>
//     const auto small = cgal::extract_mesh<CGAL::Surface_mesh<Kernel::Point_3>>(cut);
//
// Vertex properties go both ways under the names of CGAL's readers: "v:normal" (a vector of the kernel), "v:color"
// (CGAL::IO::Color) and "v:texcoord" (a point in two dimensions). Without "v:texcoord", texture coordinates by halfedge
// ("h:uv") are read, and vertices are split at seams.
#pragma once

#include <CGAL/IO/Color.h>
#include <CGAL/Kernel_traits.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/number_utils.h>

#include <unseen/adapters/adapters.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>

namespace unseen::cgal {

using adapters::ColourEncoding;
using adapters::Options;

template <class M>
using Soup = adapters::Soup<typename M::Vertex_index, typename M::Face_index>;
using adapters::Made;

namespace detail {

template <class M>
struct Types {
    using Point = typename M::Point;
    using Kernel = typename CGAL::Kernel_traits<Point>::Kernel;
    using Vector = typename Kernel::Vector_3;
    using TexturePoint = typename Kernel::Point_2;
};

// A property map, and whether it exists; CGAL 6 returns an optional, CGAL 5 a pair.
template <class Key, class Value, class M>
auto find_property(const M& mesh, const char* name) {
    auto found = mesh.template property_map<Key, Value>(name);
    if constexpr (requires { found.second; }) return std::pair(found.first, found.second);
    else return found ? std::pair(*found, true) : std::pair(typename decltype(found)::value_type(), false);
}

template <class Vector>
glm::vec3 vec3_of(const Vector& v) {
    return {static_cast<float>(CGAL::to_double(v.x())), static_cast<float>(CGAL::to_double(v.y())),
            static_cast<float>(CGAL::to_double(v.z()))};
}
template <class Point>
glm::vec2 uv_of(const Point& p) {
    return {static_cast<float>(CGAL::to_double(p.x())), static_cast<float>(CGAL::to_double(p.y()))};
}

inline glm::vec4 colour_of(const CGAL::IO::Color& colour, ColourEncoding encoding) {
    const auto channel = [](std::uint8_t byte) { return static_cast<float>(byte) / 255.0f; };
    return {adapters::decoded(channel(colour.red()), encoding), adapters::decoded(channel(colour.green()), encoding),
            adapters::decoded(channel(colour.blue()), encoding), channel(colour.alpha())};
}
inline CGAL::IO::Color cgal_colour(const glm::vec4& linear, ColourEncoding encoding) {
    const auto byte = [&](float channel) { return adapters::to_byte(adapters::encoded(channel, encoding)); };
    return {byte(linear.r), byte(linear.g), byte(linear.b), adapters::to_byte(linear.a)};
}

} // namespace detail

// Vertices and faces in their order, without removed ones: garbage need not be collected before. Coordinates of exact
// kernels are rounded to the nearest double. Fails if a face is not a triangle, or has a null or removed halfedge or
// vertex.
template <class Point>
Result<Soup<CGAL::Surface_mesh<Point>>> to_mesh(const CGAL::Surface_mesh<Point>& mesh, const Options& options = {}) {
    using M = CGAL::Surface_mesh<Point>;
    using Vertex = typename M::Vertex_index;
    using Halfedge = typename M::Halfedge_index;
    using T = detail::Types<M>;
    const auto normals = detail::find_property<Vertex, typename T::Vector>(mesh, "v:normal");
    const auto colours = detail::find_property<Vertex, CGAL::IO::Color>(mesh, "v:color");
    const auto uvs = detail::find_property<Vertex, typename T::TexturePoint>(mesh, "v:texcoord");
    const auto corner_uvs = detail::find_property<Halfedge, typename T::TexturePoint>(mesh, "h:uv");
    const bool splits = !uvs.second && corner_uvs.second;

    using Maker = adapters::SoupMaker<Vertex, typename M::Face_index>;
    using Corner = typename Maker::Corner;
    Maker soup(normals.second, colours.second, uvs.second || corner_uvs.second);
    std::vector<vdtree::Index> numbers(mesh.num_vertices(), 0); // by vertex; removed ones are not asked for
    vdtree::Index kept = 0;
    for (const Vertex v : mesh.vertices()) {
        Corner corner;
        if (normals.second) corner.normal = detail::vec3_of(normals.first[v]);
        if (colours.second) corner.colour = detail::colour_of(colours.first[v], options.colours);
        if (uvs.second) corner.uv = detail::uv_of(uvs.first[v]);
        numbers[v.idx()] = kept++;
        const auto& p = mesh.point(v);
        soup.add_vertex(v, {CGAL::to_double(p.x()), CGAL::to_double(p.y()), CGAL::to_double(p.z())}, corner);
    }
    const auto is_there = [&](auto handle) {
        return handle.is_valid() && mesh.has_valid_index(handle) && !mesh.is_removed(handle);
    };
    for (const auto f : mesh.faces()) {
        const std::string face = "Face " + std::to_string(static_cast<std::size_t>(f));
        const auto next = [&](Halfedge h) { return mesh.next(h); };
        const auto source_of = [&](Halfedge h) -> Result<vdtree::Index> {
            if (!is_there(h))
                return adapters::malformed(face + " has a halfedge that is null or removed; remove the face.");
            if (!is_there(mesh.target(h)))
                return adapters::malformed(face + " has a vertex that is null or removed; remove the face.");
            return numbers[mesh.target(h).idx()];
        };
        const auto set_own = [&](Halfedge h, Corner& corner) {
            if (splits) corner.uv = detail::uv_of(corner_uvs.first[h]);
        };
        constexpr const char* advice =
            "triangulate the faces first (CGAL::Polygon_mesh_processing::triangulate_faces).";
        if (const auto added =
                soup.add_face(f, face, mesh.halfedge(f), mesh.num_halfedges(), next, source_of, set_own, advice);
            !added)
            return added.error();
    }
    return soup.finish();
}

// Normals, colours and texture coordinates become the properties named above if the soup has them. Coincident vertices
// stay apart. Fails if vdtree::validate() fails.
template <class M>
Result<Made<M>> from_mesh(const vdtree::MeshView& soup, const Options& options = {}) {
    using Vertex = typename M::Vertex_index;
    using T = detail::Types<M>;
    if (const auto valid = vdtree::validate(soup); !valid) return valid.error();
    Made<M> out;
    const auto count = [](std::size_t n) { return static_cast<typename M::size_type>(n); };
    out.mesh.reserve(count(soup.positions.size()), count(soup.positions.size() + soup.triangles.size()),
                     count(soup.triangles.size()));
    typename M::template Property_map<Vertex, typename T::Vector> normals;
    typename M::template Property_map<Vertex, CGAL::IO::Color> colours;
    typename M::template Property_map<Vertex, typename T::TexturePoint> uvs;
    const auto add_property = [&]<class Value>(typename M::template Property_map<Vertex, Value>& map,
                                               const char* name) {
        map = out.mesh.template add_property_map<Vertex, Value>(name).first;
    };
    if (!soup.normals.empty()) add_property(normals, "v:normal");
    if (!soup.colours.empty()) add_property(colours, "v:color");
    if (!soup.uvs.empty()) add_property(uvs, "v:texcoord");
    const auto add_vertex = [&](M& mesh, vdtree::Index source) {
        const glm::dvec3 p = soup.positions[source];
        const Vertex v = mesh.add_vertex(typename T::Point(p.x, p.y, p.z));
        if (!soup.normals.empty()) {
            const glm::dvec3 n(soup.normals[source]);
            normals[v] = typename T::Vector(n.x, n.y, n.z);
        }
        if (!soup.colours.empty()) colours[v] = detail::cgal_colour(soup.colours[source], options.colours);
        if (!soup.uvs.empty()) uvs[v] = typename T::TexturePoint(soup.uvs[source].x, soup.uvs[source].y);
        return v;
    };
    const auto add_face = [](M& mesh, Vertex a, Vertex b, Vertex c) {
        return mesh.add_face(a, b, c) != M::null_face();
    };
    return adapters::filled(std::move(out), soup, add_vertex, add_face);
}

// The tree of a mesh. Its source_vertices() are the numbers of the handles, if nothing is removed and there is no "h:uv".
// Otherwise call to_mesh(), which returns the sources, and vdtree::build_tree().
template <class Point>
Result<vdtree::VertexTree> build_tree(const CGAL::Surface_mesh<Point>& mesh, const vdtree::BuildOptions& build = {},
                                      const Options& options = {}) {
    return adapters::build_tree(to_mesh(mesh, options), build);
}

// The cut as a mesh; `sources` are the tree's wedges.
template <class M>
Result<Made<M>> extract_mesh(const vdtree::Cut& cut, const Options& options = {}) {
    return adapters::extract_mesh(cut, [&](const vdtree::MeshView& soup) { return from_mesh<M>(soup, options); });
}

} // namespace unseen::cgal
