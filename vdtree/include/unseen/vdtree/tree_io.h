// Vertex trees as files: `.vdt`, described in docs/file-format.md.
#pragma once

#include <filesystem>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/result.h>
#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

// Writes to a temporary name in the same folder, then renames.
Result<void> write_tree(const std::filesystem::path& file, const VertexTree& tree, const Progress& progress = {});

// For before long work: fails where write_tree() could not write, and removes the temporaries that processes which are
// no more have left in the folder.
Result<void> prepare_tree_file(const std::filesystem::path& file);

// Reads and checks a whole tree: header, section table, the checksum of every page, and every value's range, so that no
// file can make later use read out of bounds. Errors name file, section and page. A file cut short is an error.
Result<VertexTree> read_tree(const std::filesystem::path& file, const Progress& progress = {});

// Opens a tree without reading it: its arrays are views of the file, which the system reads page by page where a cut
// comes by and shares between processes. Checked at once are the header, the section table, the facts, the ranges and
// the root; a node's links, and the values of its children, when is_sound() is first asked about it, so that a file's
// bytes cannot lead out of bounds either; and everything but the checksums of pages, before what goes through the whole
// tree (VertexTree::check()). Values of which neither has been asked, as the numbers in source_vertices(), may be
// anything, and a wrong value that is possible is found by nobody: use read_tree, or verify(), on files that nobody
// vouches for.
//
// The file must not be written to or cut short in place while it is mapped: reading a page that is gone ends the
// process (SIGBUS). write_tree and other programs that replace a file by renaming do no harm: the old file lives until
// it is unmapped, with the tree and every tree relit from it.
Result<VertexTree> map_tree(const std::filesystem::path& file);

// Whether the file starts like a tree.
bool is_tree_file(const std::filesystem::path& file);

} // namespace unseen::vdtree
