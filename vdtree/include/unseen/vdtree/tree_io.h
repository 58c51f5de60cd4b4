// Vertex trees as files: `.vdt`, described in docs/file-format.md.
#pragma once

#include <filesystem>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

// Writes to a temporary name in the same folder, then renames.
Result<void> write_tree(const std::filesystem::path& file, const VertexTree& tree, const Progress& progress = {});

// Call this before long work: it fails if write_tree() could not write, and removes temporary files that ended processes
// have left in the folder.
Result<void> prepare_tree_file(const std::filesystem::path& file);

// Reads and checks a whole tree: header, section table, the checksum of every page, and the range of every value, so that
// no file can cause reads out of bounds. Errors name file, section and page.
Result<VertexTree> read_tree(const std::filesystem::path& file, const Progress& progress = {});

// Opens a tree without reading it: its arrays are views of the file, which the system reads page by page as cuts use them,
// and shares between processes. Header, section table, facts, ranges and root are checked at once; a node's links and its
// children's values when is_sound() is first asked about it; everything except the checksums of pages by
// VertexTree::check(), which algorithms that walk a whole tree call. So no file can cause reads out of bounds, but a wrong
// value within its range goes unnoticed: for files of unknown origin use read_tree(), or verify().
//
// Do not write to the file or truncate it in place while it is mapped: reading a missing page ends the process (SIGBUS).
// Replacing it by renaming, as write_tree() does, is harmless.
Result<VertexTree> map_tree(const std::filesystem::path& file);

// Whether the file starts like a tree.
bool is_tree_file(const std::filesystem::path& file);

} // namespace unseen::vdtree
