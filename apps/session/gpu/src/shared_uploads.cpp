#include "shared_uploads.h"

#include <unseen/vdtree/internal/light_bounds.h>

namespace unseen::session {

Result<render::GpuTree> SharedUploads::tree(const vdtree::VertexTree& tree) {
    const auto known = trees_.find(&tree.data());
    if (known != trees_.end()) return known->second;
    auto made = render::GpuTree::create(context_, tree);
    if (made) trees_.emplace(&tree.data(), *made);
    return made;
}

Result<render::GpuCut> SharedUploads::whole(const vdtree::VertexTree& of) {
    const auto known = whole_.find(&of.data());
    if (known != whole_.end()) return known->second;
    const auto uploaded = tree(of);
    if (!uploaded) return uploaded.error();
    vdtree::Cut all(of);
    all.unfold_all();
    render::GpuCut cut(*uploaded);
    if (auto followed = cut.follow(all); !followed) return followed.error();
    return whole_.emplace(&of.data(), cut).first->second;
}

Result<const UploadedLevels*> SharedUploads::add(const vdtree::VertexTree& of, LevelChain chain) {
    const auto uploaded = tree(of);
    if (!uploaded) return uploaded.error();
    UploadedLevels levels{std::move(chain), {}};
    for (int level = 0; level < levels.chain.size(); ++level) {
        render::GpuCut& cut = levels.cuts.emplace_back(*uploaded);
        if (auto followed = cut.follow(levels.chain.cut(level)); !followed) return followed.error();
    }
    return &levels_.insert_or_assign(&of.data(), std::move(levels)).first->second;
}

Result<void> UploadedBackdrop::load(const Scene& scene, SharedUploads& uploads) {
    for (const Object& part : scene.backdrop) {
        auto whole = uploads.whole(part.tree);
        if (!whole) return whole.error();
        cuts_.push_back(std::move(*whole));
    }
    return {};
}

Result<std::vector<render::Item>> UploadedBackdrop::items(const Session& session, const vdtree::View& view,
                                                          const render::DrawOptions& options) const {
    std::vector<render::Item> items;
    for (std::size_t i = 0; i < cuts_.size(); ++i) {
        auto lighting = session.backdrop_lighting(view, i);
        if (!lighting) return lighting.error();
        items.push_back({cuts_[i], session.scene().backdrop[i].placement, options.shading, options.wireframe,
                         std::move(*lighting)});
    }
    return items;
}

Result<render::Item> lit_item(const Session& session, std::size_t object, const render::GpuCut& cut,
                              const vdtree::View& view, const render::DrawOptions& options) {
    auto lighting = session.lighting(view, object);
    if (!lighting) return lighting.error();
    return render::Item{cut, session.scene().objects[object].placement, options.shading, options.wireframe,
                        std::move(*lighting)};
}

bool is_in_casting_light(const render::Item& item) {
    return item.lighting && vdtree::shadow_lights(*item.lighting) > 0;
}

} // namespace unseen::session
