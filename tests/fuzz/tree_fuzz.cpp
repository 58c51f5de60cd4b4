// Fuzz target for the reader of tree files: any bytes must give an error, or a tree with which
// everything can be done or which says that it is damaged.
// tests/README.md tells how to build and run it.
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <vector>

#include <unseen/vdtree/tree_io.h>

#include "kept_arrays.h"
#include "memory_file.h"
#include "restore.h"
#include "target.h"
#include "tree_file.h"
#include "tree_use.h"

namespace {

// What a mesh's file said beyond triangles, as far as it goes without writing files.
void restore_document(const unseen::vdtree::VertexTree& tree) {
    const auto document = unseen::meshio::document_of(tree);
    if (!document) return;
    unseen::vdtree::Cut cut(tree);
    cut.unfold_all();
    const auto extracted = extract_with_sources(cut);
    const std::vector<std::string> uvs(document->parts.size(), "TEXCOORD_0");
    (void)unseen::meshio::nodes_of(tree, extracted);
    (void)unseen::meshio::restore(cut, extracted, *document, uvs).has_value();
    (void)unseen::meshio::arrays_of_cut(cut, extracted, document->arrays).has_value();
}

bool read_and_use(const std::string& bytes) {
    static unseen::fuzz::MemoryFile file;
    file.hold(bytes);
    bool is_accepted = true;
    for (const bool mapped : {false, true}) {
        const auto tree = mapped ? unseen::vdtree::map_tree(file.path()) : unseen::vdtree::read_tree(file.path());
        if (tree) restore_document(*tree);
        if (tree ? !unseen::support::use_everything(*tree) : tree.error().message.empty()) std::abort();
        is_accepted = is_accepted && tree.has_value();
    }
    return is_accepted;
}

} // namespace

bool unseen::fuzz::accepts(std::string_view input) {
    std::string bytes(input);
    bool is_accepted = read_and_use(bytes);
    // Most changes end at a checksum. Once more with those of header and table made right ...
    unseen::support::TreeFile::seal(bytes);
    is_accepted = read_and_use(bytes) && is_accepted;
    // ... and with all of them, so that changed values come through to the checks behind.
    try {
        is_accepted = read_and_use(unseen::support::TreeFile::parse(bytes).bytes()) && is_accepted;
    } catch (const std::out_of_range&) {
        // The sections do not lie in the file.
    }
    return is_accepted;
}
