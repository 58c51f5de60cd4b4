// A cut taken apart into the parts of its source document, each with the attributes that it had there.
#pragma once

#include <glm/mat3x3.hpp>

#include <unseen/meshio/source_document.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/internal/leaf_runs.h>

namespace unseen::meshio {

// A tree's document. It has a channel for normals even where the file states none: cuts are written with those that
// they are drawn with.
Result<SourceDocument> document_of(const vdtree::VertexTree& tree);

// The leaves that each wedge stands for. Fails for a damaged tree, and unless its mesh had that many vertices. The tree
// must outlive the result. Cost: that of SoundTree::of(), and the wedges.
Result<vdtree::LeafRuns> leaves_of_wedges(const vdtree::VertexTree& tree, std::size_t vertices);

// By vertex of the extracted mesh, the node that it stands for: sides of a seam have one. Cost: a search for each.
std::vector<vdtree::NodeId> nodes_of(const vdtree::VertexTree& tree, const vdtree::ExtractedMesh& extracted);

struct RestoredPart {
    std::uint32_t part = 0;
    std::vector<vdtree::Triangle> triangles;  // over the following
    std::vector<vdtree::Index> vertices;      // of the extracted mesh
    std::vector<glm::vec3> positions;         // in the frame of the part's node ...
    bool is_in_world = false;                 // ... or, where that cannot be turned back, in the world's
    std::vector<std::vector<float>> channels; // like those of the document; empty: the part has it not
    std::string uvs;                          // the channel of the texture coordinates that it is drawn by
};

// By part of a document as it was packed: the channel of the texture coordinates that are drawn.
std::vector<std::string> drawn_uvs(const SourceDocument& document);

// Parts of which nothing is left are left out. All have normals. Vertices of the mesh come with the values that they
// had; normals that they had not, and normals and drawn values of proxies, follow from the mesh that was drawn. Other
// values of proxies are fitted to those of the vertices that they stand for and that have the attribute. `uvs`: by
// part, as by drawn_uvs(). Fails where tree and document contradict each other. Cost: the cut's triangles, and the
// tree's leaves.
Result<std::vector<RestoredPart>> restore(const vdtree::Cut& cut, const vdtree::ExtractedMesh& extracted,
                                          const SourceDocument& document, const std::vector<std::string>& uvs);

// How normals go where a matrix takes positions, but for their length. The cofactors are the inverse transpose times
// the determinant, and exist where the inverse does not.
struct NormalMatrix {
    glm::dmat3 matrix = glm::dmat3(1);
    bool is_mirrored = false;
};
NormalMatrix normal_matrix_of(const glm::dmat3& linear);

// The inverse of a matrix from a node to the world, or nothing where it has none.
struct NodeFrame {
    bool has_inverse = false, is_mirrored = false;
    glm::dmat4 from_world = glm::dmat4(1);
    glm::dmat3 normal_from_world = glm::dmat3(1);
};
NodeFrame frame_of(const glm::dmat4& to_world);

} // namespace unseen::meshio
