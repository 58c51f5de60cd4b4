// What the adapters for other libraries' meshes share: attributes of corners, colours in bytes. Included by them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/mesh.h>

namespace unseen::adapters {

// How the other library's mesh has its colours. Trees have them linear.
enum class ColourEncoding : std::uint8_t { srgb, linear };

struct Options {
    ColourEncoding colours = ColourEncoding::srgb; // as image files and most mesh files have them
};

// A soup, and what each of its elements was in the other library's mesh.
template <class VertexHandle, class FaceHandle>
struct Soup {
    vdtree::Mesh mesh;
    std::vector<VertexHandle> vertices; // by vertex of the soup
    std::vector<FaceHandle> faces;      // by triangle
};

// A mesh of the other library, and what each of its vertices was.
template <class M>
struct Made {
    M mesh;
    std::vector<vdtree::Index> sources; // by vertex: the soup's vertex, or the tree's node
    // Where the surface is not manifold, halfedges cannot hold it as it is: so many triangles have got vertices of their
    // own, at the same positions. No triangle is left out but those that use a vertex twice.
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

    // A vertex of the source. `corner`: what all its corners have, and what those that no face uses keep.
    void add_vertex(glm::dvec3 position, const Corner& corner) {
        sources_.push_back(static_cast<vdtree::Index>(mesh_.positions.size()));
        is_used_.push_back(0);
        append(position, corner);
    }

    // The soup's vertex for a corner at a vertex of the source; all of these are there by then.
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

    vdtree::Mesh& mesh() { return mesh_; }
    std::vector<vdtree::Index>& sources() { return sources_; } // by vertex of the soup

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

} // namespace unseen::adapters
