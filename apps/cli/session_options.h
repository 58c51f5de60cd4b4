// From the options of a verb to what the session library takes.
#pragma once

#include <filesystem>

#include <unseen/meshio/mesh_file.h>
#include <unseen/session/session.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/tree_io.h>

#include "options.h"

namespace unseen::app {

// Notes and warnings to the terminal, with the names of options.
session::Messages terminal_messages();

// The display that the options describe; ranges are checked.
Result<perception::Display> make_display(const DisplayOptions& options);
// Who looks at that display, without a gaze.
Result<session::Observer> make_observer(const DisplayOptions& options, const perception::Display& display);

// Fails on a file that cannot be read, and on options that contradict the model or the display. What is quickly read is
// read first.
Result<session::Session> open_session(const std::filesystem::path& model, const ViewOptions& view,
                                      const DisplayOptions& display);
// The same of a tree that is at hand.
Result<session::Session> make_session(vdtree::VertexTree tree, const ViewOptions& view, const DisplayOptions& display);

// What is not given is as the session frames its scene.
vdtree::View make_view(const session::Session& session, const ViewOptions& options);

// The gaze of --gaze, for verbs without another one.
std::optional<session::Gaze> fixed_gaze(const WhatOptions& what);

// ---- models, with progress bars, notes and warnings on the terminal

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
