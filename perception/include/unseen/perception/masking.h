// What a scene masks: by how much its patterns raise the thresholds of what folds change, by place and frequency.
//
// Drettakis and others 2007 have one threshold a pixel, of a picture without the objects that ask. That is not safe: one
// frequency's mask would excuse a change at another, and what stands behind an object would mask it. So elevations are
// kept by band, and a place has the least of several pictures: of everything but the objects that ask, and of the scene
// as it is seen.
#pragma once

#include <unseen/perception/criterion.h>
#include <unseen/vdtree/depth_picture.h>

namespace unseen::perception {

// Copies are cheap and share their data; any number of threads may ask at once.
class MaskingPicture {
public:
    // Elevations of one picture, by cells of a grid from its top left: the factor by which thresholds are raised, at
    // least.
    struct Elevations {
        int cell_px = 0; // a side; cells at the right and the bottom may reach beyond the picture
        int columns = 0, rows = 0;
        std::vector<CyclesPerDegree> bands = {}; // nominal frequencies, falling; one: the same at all frequencies
        std::vector<float> elevation = {};       // [(band * rows + row) * columns + column], 1 or more
    };

    // The least of the pictures, which have the same cells and bands. Fails on an invalid view, on no picture or more
    // than 16 bands, where cells do not cover the window, and on elevations that are NaN, infinite or below 1.
    static Result<MaskingPicture> create(const vdtree::View& view, std::span<const Elevations> pictures);

    const vdtree::View& view() const noexcept { return grids_->view; }
    std::span<const CyclesPerDegree> bands() const noexcept { return grids_->bands; }

    // By band: the least where the footprint is, and a pixel around. 1 beside the eye and beside the window.
    void least(const vdtree::Footprint& footprint, std::span<float> elevation) const noexcept;

private:
    struct Grid {
        int columns = 0, rows = 0;
        std::vector<float> least; // of 2 x 2 of the grid before

        float at(std::size_t band, int x, int y) const {
            const auto row = band * static_cast<std::size_t>(rows) + static_cast<std::size_t>(y);
            return least[row * static_cast<std::size_t>(columns) + static_cast<std::size_t>(x)];
        }
    };
    struct Grids {
        vdtree::View view;
        int cell_px = 1;
        std::vector<CyclesPerDegree> bands;
        std::vector<Grid> levels;
    };
    explicit MaskingPicture(std::shared_ptr<const Grids> grids) : grids_(std::move(grids)) {}

    std::shared_ptr<const Grids> grids_;
};

// error_distances() where sensitivity to each frequency is divided by the elevation there: of the two bands around it,
// the least over the node's footprint. For pictures of this view: footprints are of it. A fold is nowhere seen from
// farther than without masking. Where the window has no masker, this is error_distances(). Fails where that does, and
// where the picture is of another window. Cost: that of error_distances() some eight times, and 100 ns a node.
Result<vdtree::DistanceCriterion> masked_error_distances(const vdtree::VertexTree& tree,
                                                         const vdtree::Similarity& placement,
                                                         const MaskingPicture& masking, const vdtree::View& view,
                                                         const FoldTestOptions& options);
// The same under lights that cast shadows, as error_distances() has them.
Result<vdtree::DistanceCriterion> masked_error_distances(std::span<const TreeAsLit> as_lit,
                                                         const vdtree::Similarity& placement,
                                                         const MaskingPicture& masking, const vdtree::View& view,
                                                         const FoldTestOptions& options);

} // namespace unseen::perception
