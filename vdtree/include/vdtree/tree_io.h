// Vertex trees as files: `.vdt`, described in docs/file-format.md.
#pragma once

#include <filesystem>

#include <vdtree/function_ref.h>
#include <vdtree/result.h>
#include <vdtree/vertex_tree.h>

namespace unseen::vdtree {

// Writes to a temporary name in the same folder, then renames.
Result<void> write_tree(const std::filesystem::path& file, const VertexTree& tree, const Progress& progress = {});

// Reads and checks a whole tree: header, section table, the checksum of every page, and every value's range, so that no
// file can make later use read out of bounds. Errors name file, section and page. A file cut short is an error.
Result<VertexTree> read_tree(const std::filesystem::path& file, const Progress& progress = {});

// Whether the file starts like a tree.
bool is_tree_file(const std::filesystem::path& file);

} // namespace unseen::vdtree
