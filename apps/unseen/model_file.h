// Models as the verbs take them: a tree, or a mesh of which a tree is built on the fly.
#pragma once

#include <filesystem>

#include <vdtree/builder.h>
#include <vdtree/mesh_io.h>
#include <vdtree/tree_io.h>

namespace unseen::app {

// A mesh as its reader returns it, with its warnings printed.
Result<vdtree::ReadResult> read_mesh_file(const std::filesystem::path& file, const vdtree::ReadOptions& options = {});

// The tree of a mesh. Triangles that its reader dropped count as the tree's dropped ones.
Result<vdtree::VertexTree> build_tree_of(vdtree::ReadResult&& read, vdtree::BuildOptions options);

// A tree file, or a mesh file with a note that its tree is built now.
Result<vdtree::VertexTree> load_tree(const std::filesystem::path& file);
// The same, but tree files of 256 MiB and more are mapped: only what is used is read, and checked.
Result<vdtree::VertexTree> open_tree(const std::filesystem::path& file);

} // namespace unseen::app
