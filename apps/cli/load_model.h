// Models as the verbs take them, with progress bars, notes and warnings on the terminal.
#pragma once

#include <filesystem>

#include <unseen/meshio/mesh_file.h>
#include <unseen/session/scene.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/tree_io.h>

#include "options.h"

namespace unseen::app {

// A mesh as its reader returns it.
Result<meshio::ReadResult> read_mesh_file(const std::filesystem::path& file, bool skip_bad = false);

// A mesh with its texture.
Result<meshio::ReadResult> read_textured_mesh(const std::filesystem::path& file, const meshio::ReadOptions& options,
                                              const TextureOptions& texture);

// The tree of a mesh. Triangles that its reader dropped count as the tree's dropped ones. `build` makes it, where that
// is not vdtree::build_tree().
using TreeMaker = Callback<Result<vdtree::VertexTree>(const vdtree::MeshView&, const vdtree::BuildOptions&)>;
Result<vdtree::VertexTree> build_tree_of(meshio::ReadResult&& read, vdtree::BuildOptions options,
                                         const TreeMaker& build = {});

// A tree file, or the tree of a mesh file as build_tree() makes it, built now and kept nowhere.
Result<vdtree::VertexTree> load_tree(const std::filesystem::path& file);

// What verbs look at: trees of mesh files are measured, and kept for the next time.
Result<session::Scene> load_scene(const std::filesystem::path& file, const ViewOptions& view);

} // namespace unseen::app
