// Which triangles touch: at places, or without sharing one.
#pragma once

#include <limits>

#include <unseen/vdtree/vertex_tree.h>

#include "measure/measuring_progress.h"

namespace unseen::perception {

// A contact of triangles with others near them, over or under them and not beside them in one sheet. Neighbours, and
// neighbours of neighbours, count only back to back, as the sides of a thin sheet, and apart from the corners that they
// share. Triangles that face and look alike do not count: it makes no difference which of them is seen. Near means nearer
// than a quarter of the circle around the first triangle, or amid very many, as slivers are, than less.
struct Contact {
    // Mesh units: the least distance, or how far was looked if that is less; 0 where they intersect; infinite where none
    // is near.
    float gap = std::numeric_limits<float>::infinity();
    float sine = 1; // of the least angle between the planes of such triangles

    bool is_any() const { return gap < std::numeric_limits<float>::infinity(); }
    void include(const Contact& other) { gap = std::min(gap, other.gap), sine = std::min(sine, other.sine); }
};

// By interior node: of all triangles that touch its support, or the supports below. In parallel; some microseconds a
// triangle.
// `trees`: one at least, the same but for their luminances; what looks alike does so in all of them. With colours nothing
// counts as alike.
// Adds the triangles to what is done; where that says to stop, the answer is of no use.
std::vector<Contact> find_contacts(std::span<const vdtree::SoundTree> trees, bool has_colours,
                                   MeasuringProgress& progress);

// The mesh over places: these have the numbers of their nodes less interior_count().
class PlaceTriangles {
public:
    // The tree must stay where it is. Cost: one pass over the triangles.
    explicit PlaceTriangles(const vdtree::SoundTree& tree)
        : corners_(tree.triangles()), first_(std::size_t{tree.place_count()} + 1, 0),
          triangles_(tree.triangles().size() * 3) {
        if (tree.has_seams()) {
            own_corners_.assign(corners_.begin(), corners_.end());
            for (vdtree::Triangle& t : own_corners_)
                for (vdtree::Index& corner : t) corner = tree.place_of_leaf(corner) - tree.interior_count();
            corners_ = own_corners_;
        }
        for (const vdtree::Triangle& t : corners_)
            for (const vdtree::Index place : t) ++first_[place + 1];
        for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
        std::vector<vdtree::Index> next(first_.begin(), first_.end() - 1);
        for (vdtree::Index t = 0; t < corners_.size(); ++t)
            for (const vdtree::Index place : corners_[t]) triangles_[next[place]++] = t;
    }
    PlaceTriangles(PlaceTriangles&&) = default; // moved vectors keep their memory

    const vdtree::Triangle& corners(vdtree::Index triangle) const { return corners_[triangle]; }
    std::span<const vdtree::Index> around(vdtree::Index place) const {
        return std::span(triangles_).subspan(first_[place], first_[place + 1] - first_[place]);
    }

private:
    std::vector<vdtree::Triangle> own_corners_; // of trees with seams
    std::span<const vdtree::Triangle> corners_;
    std::vector<vdtree::Index> first_, triangles_;
};

} // namespace unseen::perception
