// What a view hides, also from eyes near it: what a moving eye's last picture says of the next ones.
//
// A depth picture tells what one eye does not see. As the eye moves, gaps open where a near surface ends in front of a far
// one, and what was behind them appears. So gaps count as holes: two neighbouring pixels belong to one surface only where
// no eye within reach sees them more than a part of a pixel apart.
//
// As the eye moves, a surface's image moves by so many pixels at most. A place is hidden from all of these eyes where the
// picture shows one surface for that far around it, without holes and nearer than the place. Any line from such an eye to
// the place begins in front of that surface and ends behind it. So it goes through the surface.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>
#include <unseen/vdtree/view.h>

namespace unseen::vdtree {

// Of a picture's surfaces, by square cell of a grid over its window, row-major from the top left; cells at the right and
// the bottom may reach beyond it. Reciprocals of distances along the view's axis, in 1 / world unit, of all samples: 0 is
// the background.
struct DepthCells {
    int cell_px = 0; // a side
    int columns = 0, rows = 0;
    std::vector<float> least, most; // the farthest surface, and the nearest
    std::vector<float> jump; // the largest difference between two neighbouring pixels, one of which is the cell's
};

// Eyes that a map is for: within `around` of the way from its view's eye along a vector. World units.
struct EyeReach {
    glm::dvec3 along = glm::dvec3(0); // finite
    double around = 0;                // 0 or more, and finite
};

// Copies are cheap and share their data; any number of threads may ask at once.
class OcclusionMap {
public:
    // Fails on an invalid view, where cells do not cover
    // the window, and on reciprocals that are NaN, infinite or negative. Cost: some nanoseconds a cell.
    static Result<OcclusionMap> create(const View& view, DepthCells cells, const EyeReach& reach);

    const View& view() const noexcept;
    const EyeReach& reach() const noexcept;
    // Whether what the map says holds for an eye there, whatever it looks at.
    bool holds_for(glm::dvec3 eye) const noexcept;

    // Whether no eye within reach sees anything of a ball in the world. What is not wholly in the window may be seen.
    bool hides(glm::dvec3 centre, double radius) const noexcept;
    // The same, and whether a part of the ball may be hidden at all: false for those too small for another answer.
    enum class Answer { hidden, seen, partly };
    Answer look_at(glm::dvec3 centre, double radius) const noexcept;

private:
    struct Grids;
    explicit OcclusionMap(std::shared_ptr<const Grids> grids) : grids_(std::move(grids)) {}

    std::shared_ptr<const Grids> grids_;
};

// Which interior nodes' folds no eye within reach sees, a bit a node, the first node's lowest: those whose ring's spheres
// are hidden, and all nodes under them. Null: none. For Viewpoint::hidden. Fails where VertexTree::check() does. Cost: some
// ten nanoseconds for each node that is larger than a cell.
Result<std::shared_ptr<const std::vector<std::uint64_t>>>
find_hidden(const VertexTree& tree, const Similarity& placement, const OcclusionMap& map);

} // namespace unseen::vdtree
