// What a tree is kept under.
#pragma once

#include <optional>
#include <string>

#include <unseen/session/load.h>

namespace unseen::session {

// A hash of all that the tree of a file depends on: the bytes of the file and of those it refers to (libraries of
// materials, images, buffers), the options, and how trees are built and measured. Nothing for what is no regular file,
// and where it is not sure what the file refers to. Cost: reading the files once.
std::optional<std::string> cache_key(const std::filesystem::path& file, const LoadOptions& options);

// Of the tree of a mesh that was read, with its texture and document.
std::string mesh_cache_key(const vdtree::Mesh& mesh, std::uint64_t dropped_triangles, bool prelit, bool measures,
                           bool conserves_light);

// Of what a tree's folds change under lights, whichever these are. `key`: the tree's.
std::string lights_key(const std::string& key);

} // namespace unseen::session
