// What the objects of a scene have on the GPU, once for all that share a tree.
#pragma once

#include <unordered_map>

#include <unseen/render/renderer.h>
#include <unseen/session/session.h>

namespace unseen::session {

struct UploadedLevels {
    LevelChain chain;
    std::vector<render::GpuCut> cuts; // by level
};

// What it returns shares its data; pointers hold until it is destroyed.
class SharedUploads {
public:
    explicit SharedUploads(const render::Context& context) : context_(context) {}

    Result<render::GpuTree> tree(const vdtree::VertexTree& tree);
    Result<render::GpuCut> whole(const vdtree::VertexTree& tree); // with all triangles

    // `make()` gives the chain, where none is there yet.
    template <class MakeChain>
    Result<const UploadedLevels*> levels(const vdtree::VertexTree& tree, MakeChain&& make) {
        const auto known = levels_.find(&tree.data());
        if (known != levels_.end()) return &known->second;
        Result<LevelChain> chain = make();
        if (!chain) return chain.error();
        return add(tree, std::move(*chain));
    }

private:
    using Key = const vdtree::VertexTree::Data*;
    Result<const UploadedLevels*> add(const vdtree::VertexTree& tree, LevelChain chain);

    render::Context context_;
    std::unordered_map<Key, render::GpuTree> trees_;
    std::unordered_map<Key, render::GpuCut> whole_;
    std::unordered_map<Key, UploadedLevels> levels_;
};

// What surrounds a scene's objects, drawn whole.
class UploadedBackdrop {
public:
    Result<void> load(const Scene& scene, SharedUploads& uploads);
    // Lit as the session says, with the shading and wires of the options.
    Result<std::vector<render::Item>> items(const Session& session, const vdtree::View& view,
                                            const render::DrawOptions& options = {}) const;

private:
    std::vector<render::GpuCut> cuts_;
};

// An object of the session in its place and light.
Result<render::Item> lit_item(const Session& session, std::size_t object, const render::GpuCut& cut,
                              const vdtree::View& view, const render::DrawOptions& options = {});

bool is_in_casting_light(const render::Item& item);

} // namespace unseen::session
