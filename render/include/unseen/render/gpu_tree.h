// Trees and cuts on the GPU. Both are handles: copies are the same tree or cut, which is freed with the last of them.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>

#include <unseen/render/context.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/geomorph.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::render {

// The vertices of a tree, 28 bytes each, and its texture if it has one: filtered trilinearly in linear light, and
// multiplied with the colours. Any number of cuts share it. What lights need, 8 bytes a vertex, is made when it is
// first drawn with lights. Keeps handles to the context and to the tree's data.
class GpuTree {
public:
    // Fails where the graphics memory does not suffice, and on textures that this GL does not take.
    static Result<GpuTree> create(const Context& context, const vdtree::VertexTree& tree);

    const vdtree::VertexTree& tree() const noexcept;
    const Context& context() const noexcept;

    struct Impl; // the library's own
    Impl& impl() const noexcept { return *impl_; }

private:
    explicit GpuTree(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
    std::shared_ptr<Impl> impl_;
};

// The triangles of a cut, 12 bytes each. They stay as they are, whatever becomes of the cut, until follow() is called.
class GpuCut {
public:
    explicit GpuCut(const GpuTree& tree); // has no triangles, and nothing on the GPU; keeps a handle to the tree

    // Becomes what the cut is now. Uploads nothing where the cut is as it was, 8 bytes a changed corner where the cut
    // knows what changed since it was last followed, else the whole. Fails on the cut of another tree, and where memory
    // does not suffice; then there are no triangles.
    Result<void> follow(const vdtree::Cut& cut);

    // The drawn cut of a geomorph, with the vertices that glide where they are: 32 bytes for each, and for each that
    // did before. Other cuts of the tree are drawn without them. Where such cuts take turns, the vertices are uploaded
    // at each turn. Fails on textured trees: their texture would not glide.
    Result<void> follow(const vdtree::Geomorph& geomorph);

    const GpuTree& tree() const noexcept;
    std::uint64_t uploaded_bytes() const noexcept; // by the last follow() and by draws since

    struct Impl; // the library's own
    Impl& impl() const noexcept { return *impl_; }

private:
    std::shared_ptr<Impl> impl_;
};

} // namespace unseen::render
