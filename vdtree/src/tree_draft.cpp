#include "tree_draft.h"

#include <utility>

#include "mask_pool.h"

namespace unseen::vdtree {

namespace {

template <class T>
void release(std::vector<T>& v) {
    std::vector<T>().swap(v);
}

void pack_masks(TreeDraft& draft) {
    MaskPool pool;
    draft.mask_at.resize(draft.masks.size());
    for (std::size_t node = 0; node < draft.masks.size(); ++node) {
        const std::uint32_t at = pool.add(draft.masks[node]);
        // A parent, which has a lower number, includes its children: a full pool still gives true masks that nest.
        draft.mask_at[node] = at != MaskPool::no_record ? at : draft.mask_at[draft.parents[node]];
    }
    release(draft.masks);
    draft.mask_records = pool.take();
}

void pack_bounds(TreeDraft& draft) {
    draft.bounds.resize(draft.ring_spheres.size());
    for (std::size_t node = 0; node < draft.bounds.size(); ++node)
        draft.bounds[node] = {draft.ring_spheres[node], draft.slabs[node], draft.flags[node], 0};
    release(draft.ring_spheres);
    release(draft.slabs);
    release(draft.flags);
}

void pack_normals(TreeDraft& draft) {
    draft.normals.reserve(draft.exact_normals.size());
    for (const glm::vec3& normal : draft.exact_normals) draft.normals.push_back(PackedNormal::nearest(normal));
    release(draft.exact_normals);
}

} // namespace

TreeGeometry pack(TreeDraft&& draft) {
    pack_masks(draft);
    pack_bounds(draft);
    pack_normals(draft);
    draft.first_leaf.shrink_to_fit(), draft.leaf_end.shrink_to_fit(), draft.subtree_end.shrink_to_fit();
    draft.parents.shrink_to_fit();
    if (draft.ranges.empty()) release(draft.source_triangles);
    return std::move(static_cast<TreeGeometry&>(draft));
}

} // namespace unseen::vdtree
