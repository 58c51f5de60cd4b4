// The mesh as it is clustered: its places, and the leaves that its corners use there.
#pragma once

#include <unseen/vdtree/builder.h>

#include "build/creases.h"

namespace unseen::vdtree {

// Triangles with two corners at one position are left out, and so are vertices that no other triangle uses.
class PlaceMesh {
public:
    // The source must be valid and outlive this. Cost: linear, but for sorting the corners at places with several
    // leaves.
    explicit PlaceMesh(const MeshView& source);

    // ---- over places, which are numbered by their first vertices
    const MeshView& mesh() const { return mesh_; } // positions and triangles alone
    Index source_triangle(Index t) const { return kept_.empty() ? t : kept_[t]; }
    std::uint64_t dropped() const { return dropped_; }

    // ---- leaves, place by place; to be found once it is known which way the surface faces
    void find_leaves(const Surface& surface, std::optional<float> crease = {});
    const Creases& creases() const { return creases_; }

    Index leaf_count() const { return static_cast<Index>(sources_.size()); }
    bool has_seams() const { return !first_leaf_.empty(); }
    Index first_leaf(Index place) const { return has_seams() ? first_leaf_[place] : place; }
    std::span<const Index> sources() const { return sources_; }     // by leaf: the first of its vertices
    std::span<const glm::vec3> normals() const { return normals_; } // unit length or zero
    std::span<const Index> materials() const { return materials_; } // empty: one for all
    // MeshView::further; empty unless leaves at one place differ by it alone.
    std::span<const Index> further() const { return further_; }
    std::span<const Index> places() const { return places_; }
    std::span<const Triangle> triangles() const { return has_seams() ? leaf_triangles_ : mesh_.triangles; }

private:
    void keep_triangles(std::span<const Index> coincident);
    void number_places(std::span<const Index> coincident);
    void find_materials();
    CornerNormals corner_normals(const Surface& surface, std::optional<float> crease) const;
    const Triangle& source_corners(Index t) const { return source_.triangles[source_triangle(t)]; }
    Index source_vertex(Index corner) const { return source_corners(corner / 3)[corner % 3]; }
    Index material_of(Index corner) const { return triangle_materials_.empty() ? 0 : triangle_materials_[corner / 3]; }
    bool number_leaves(const CornerNormals& found, const CornersByPlace& corners);
    void describe_leaves(const CornerNormals& found, const CornersByPlace& corners, bool needs_further);

    const MeshView& source_;
    std::uint64_t dropped_ = 0;
    std::vector<Index> kept_; // source triangles; empty: all
    std::vector<glm::dvec3> positions_;
    std::vector<Triangle> triangles_;
    MeshView mesh_;
    bool is_split_ = false; // several vertices at one place

    std::vector<Index> first_leaf_, sources_, places_, materials_, further_;
    std::vector<Index> triangle_materials_; // empty: one for all
    std::vector<glm::vec3> normals_;
    Creases creases_;
    std::vector<Triangle> leaf_triangles_;
};

} // namespace unseen::vdtree
