// Which triangles each leaf is a corner of.
#pragma once

#include <span>
#include <vector>

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::perception {

class LeafTriangles {
public:
    explicit LeafTriangles(const vdtree::SoundTree& tree)
        : first_(std::size_t{tree.leaf_count()} + 1, 0), triangles_(tree.triangles().size() * 3) {
        const std::span<const vdtree::Triangle> triangles = tree.triangles();
        for (const vdtree::Triangle& t : triangles)
            for (const vdtree::Index leaf : t) ++first_[leaf + 1];
        for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
        std::vector<vdtree::Index> next(first_.begin(), first_.end() - 1);
        for (vdtree::Index t = 0; t < triangles.size(); ++t)
            for (const vdtree::Index leaf : triangles[t]) triangles_[next[leaf]++] = t;
    }

    std::span<const vdtree::Index> around(vdtree::Index leaf) const {
        return std::span(triangles_).subspan(first_[leaf], first_[leaf + 1] - first_[leaf]);
    }

private:
    std::vector<vdtree::Index> first_, triangles_;
};

} // namespace unseen::perception
