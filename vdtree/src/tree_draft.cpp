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
    if (draft.ranges.empty()) release(draft.source_triangles);
    TreeGeometry packed;
    const auto take = [](auto& to, auto& from) {
        from.shrink_to_fit();
        to = std::move(from);
    };
    take(packed.parents, draft.parents);
    take(packed.positions, draft.positions);
    take(packed.normals, draft.normals);
    take(packed.colours, draft.colours);
    take(packed.uvs, draft.uvs);
    take(packed.first_leaf, draft.first_leaf);
    take(packed.leaf_end, draft.leaf_end);
    take(packed.subtree_end, draft.subtree_end);
    take(packed.first_triangle, draft.first_triangle);
    take(packed.bounds, draft.bounds);
    take(packed.support_spheres, draft.support_spheres);
    take(packed.mask_at, draft.mask_at);
    take(packed.displacement, draft.displacement);
    take(packed.mask_records, draft.mask_records);
    take(packed.triangles, draft.triangles);
    take(packed.source_triangles, draft.source_triangles);
    take(packed.source_vertices, draft.source_vertices);
    static_cast<GeometryFacts&>(packed) = std::move(draft);
    return packed;
}

} // namespace unseen::vdtree
