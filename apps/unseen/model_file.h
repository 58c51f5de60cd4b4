// Models as the verbs take them: a tree, or a mesh of which a tree is built on the fly.
#pragma once

#include <filesystem>

#include <vdtree/builder.h>
#include <meshio/mesh_io.h>
#include <vdtree/tree_io.h>

#include "textures.h"

namespace unseen::app {

// A mesh as its reader returns it, with its warnings printed.
Result<meshio::ReadResult> read_mesh_file(const std::filesystem::path& file, const meshio::ReadOptions& options = {});

// The tree of a mesh. Triangles that its reader dropped count as the tree's dropped ones.
Result<vdtree::VertexTree> build_tree_of(meshio::ReadResult&& read, vdtree::BuildOptions options);

// A mesh with its texture.
Result<meshio::ReadResult> read_textured_mesh(const std::filesystem::path& file, const meshio::ReadOptions& options, const TextureOptions& texture);

// A tree file, or a mesh file with a note that its tree is built now. A tree has its texture, and takes no other.
Result<vdtree::VertexTree> load_tree(const std::filesystem::path& file, const TextureOptions& texture = {});
// The same, but tree files of 256 MiB and more are mapped: only what is used is read, and checked.
Result<vdtree::VertexTree> open_tree(const std::filesystem::path& file, const TextureOptions& texture = {});

} // namespace unseen::app
