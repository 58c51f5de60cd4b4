#include "shared_uploads.h"

#include <unseen/vdtree/cut.h>

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

} // namespace unseen::session
