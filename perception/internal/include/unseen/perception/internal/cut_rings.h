// What the ring of a folded node can be in any cut, when its neighbours are folded, too.
#pragma once

#include <unseen/perception/internal/chroma.h>
#include <unseen/vdtree/lighting.h>

namespace unseen::vdtree {
class LightBounds;
}

namespace unseen::perception {

// By interior node. Of two nodes the one with the larger support sphere is the larger; of equal ones, the one of the
// lower number.
//
// In every cut, each triangle drawn that is not one of the mesh's own has a largest node among its corners. All of the
// triangle's corners lie within `radius` of the centre of that node's ring sphere, and their luminances within its
// `luminance`: the corners of the mesh's triangles around the node's support, and the proxies of all nodes no larger
// that one of these can have been folded into.
struct CutRings {
    std::vector<vdtree::PackedRange> luminance; // at least the children's
    std::vector<float> radius;                  // mesh units; at least the children's

    // Relative luminance, 0..1: what the fold, with unfolded neighbours, adds to the light of the triangles around or
    // takes from it, besides what their area changes, over the area that belongs to the support: a third of each
    // triangle for each corner. These areas do not overlap, so together nodes change no more than the mean by area. At
    // least as large as the children's.
    std::vector<float> mean_shift;

    // Whether another part of the surface is so near to the ring that a fold may bring the one through the other, and
    // so uncover anything. True where it is of a child. Empty where it is of none.
    std::vector<bool> meets_another;

    // For textured trees; else empty. Each at least the children's. `luminance` above is that of both together,
    // as drawn; what vertices and texture can be in any cut, each for itself:
    std::vector<vdtree::PackedRange> vertices; // what the texture is multiplied with
    std::vector<vdtree::PackedRange> texture;
    // Mesh units: how far apart two points of triangles around the node can be that show the same place of the texture,
    // whatever is folded among those that `luminance` is of. (Points of triangles that are interpolated between
    // vertices near an affine map from the texture to the surface are no farther from it than these: twice the largest
    // distance of all these vertices from the best such map, one a wedge. Where the surface is flat and the texture
    // lies evenly on it that is 0.) Twice `radius` at most.
    std::vector<float> texture_deviation;

    // The same of the colours, as they are drawn; empty where ring_chroma() is, of textured trees, and where they are
    // not asked for.
    std::vector<ChromaRange> chroma;
    std::vector<glm::vec2> mean_chroma_shift; // 0 or more
};

// Under the tree's light, with its texture: mean shifts count what that shows. Cost: some microseconds a triangle, some
// tens with a texture; in parallel. Results do not depend on the threads. Fails where VertexTree::check() does.
// `with_chroma`: bounds the colours, too, where there are any.
Result<CutRings> bound_cut_rings(const vdtree::VertexTree& tree, bool with_chroma = true);

// What lights can make of these rings: the normals and albedos of all vertices that a node's ring can have in any cut,
// in spheres of the rings' radii. `rings`: of the tree. Cost: some microseconds a triangle, in parallel, and 130 bytes
// a node meanwhile.
Result<vdtree::LightBounds> bound_lit_cut_rings(const vdtree::VertexTree& tree, const CutRings& rings);

} // namespace unseen::perception
