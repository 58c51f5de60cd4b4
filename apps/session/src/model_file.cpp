#include <session/model_file.h>

#include <perception/fold_measurement.h>
#include <vdtree/builder.h>
#include <vdtree/conserve_light.h>
#include <vdtree/tree_io.h>

#include "textures.h"

namespace unseen::session {
namespace {

namespace fs = std::filesystem;

Result<vdtree::VertexTree> with_texture(Result<vdtree::VertexTree> tree, const fs::path& file,
                                        const LoadOptions& options) {
    if (tree && !options.texture.empty())
        return Error{ErrorCode::invalid_argument,
                     file.string() + " is a tree, whose texture is laid when it is built: give load.texture to "
                                     "session::read_textured_mesh()."};
    if (tree && options.without_textures && !tree->texture().empty()) return tree->untextured();
    return tree;
}

} // namespace

Result<meshio::ReadResult> read_textured_mesh(const fs::path& file, const LoadOptions& options,
                                              meshio::ReadOptions reading) {
    reading.images = options.texture.empty() && !options.without_textures;
    reading.drop = options.drop;
    reading.progress = options.messages.progress;
    auto read = meshio::read_mesh(file, reading);
    if (!read) return read;
    if (const auto laid = lay_texture(file, *read, options); !laid) return laid.error();
    if (options.messages.warning)
        for (const std::string& warning : read->warnings) options.messages.warning(file.string() + ": " + warning);
    return read;
}

Result<vdtree::VertexTree> load_tree(const fs::path& file, const LoadOptions& options) {
    if (vdtree::is_tree_file(file))
        return with_texture(vdtree::read_tree(file, options.messages.progress), file, options);
    auto read = read_textured_mesh(file, options);
    if (!read) return read.error();
    if (options.messages.note)
        options.messages.note(file.string() +
                              " is a mesh: its tree is built now; vdtree::write_tree() does it once and for all.");
    vdtree::BuildOptions building;
    building.progress = options.messages.progress;
    building.dropped_before = read->dropped_triangles;
    return vdtree::build_tree(read->mesh.view(), building);
}

Result<vdtree::VertexTree> open_tree(const fs::path& file, const LoadOptions& options) {
    // Smaller trees are read in less time than a picture takes, and checked to the last bit.
    constexpr std::uintmax_t mapped_bytes = std::uintmax_t{256} << 20;
    std::error_code unknown;
    const bool is_large = fs::file_size(file, unknown) >= mapped_bytes && !unknown;
    return is_large && vdtree::is_tree_file(file) ? with_texture(vdtree::map_tree(file), file, options)
                                                  : load_tree(file, options);
}

Result<vdtree::VertexTree> measured(const vdtree::VertexTree& tree, int threads) {
    const auto conserved = vdtree::conserve_light(tree);
    if (!conserved) return conserved.error();
    return perception::measure_folds(*conserved, threads);
}

} // namespace unseen::session
