#include "model_file.h"

#include <functional>

#include "progress_bar.h"
#include "terminal.h"

namespace unseen::app {

Result<meshio::ReadResult> read_mesh_file(const std::filesystem::path& file, const meshio::ReadOptions& options) {
    ProgressBar bar("reading " + file.filename().string());
    meshio::ReadOptions shown = options;
    shown.progress = std::ref(bar);
    auto read = meshio::read_mesh(file, shown);
    if (!read) return read;
    for (const std::string& warning : read->warnings) print_warning(file.string() + ": " + warning);
    return read;
}

Result<vdtree::VertexTree> build_tree_of(meshio::ReadResult&& read, vdtree::BuildOptions options) {
    ProgressBar bar("building");
    options.progress = std::ref(bar);
    options.dropped_before = read.dropped_triangles;
    return vdtree::build_tree(read.mesh.view(), options);
}

Result<meshio::ReadResult> read_textured_mesh(const std::filesystem::path& file, const meshio::ReadOptions& options, const TextureOptions& texture) {
    meshio::ReadOptions reading = options;
    reading.materials = texture.file.empty() && !texture.is_left_out;
    auto read = read_mesh_file(file, reading);
    if (!read) return read;
    if (const auto laid = lay_texture(file, *read, texture); !laid) return laid.error();
    return read;
}

namespace {

// As the options have it.
Result<vdtree::VertexTree> with_texture(Result<vdtree::VertexTree> tree, const std::filesystem::path& file, const TextureOptions& texture) {
    if (tree && !texture.file.empty())
        return Error{ErrorCode::invalid_argument, file.string() + " is a tree, whose texture is laid when it is built: give --texture to unseen build."};
    if (tree && texture.is_left_out && !tree->texture().empty()) return tree->untextured();
    return tree;
}

} // namespace

Result<vdtree::VertexTree> load_tree(const std::filesystem::path& file, const TextureOptions& texture) {
    if (vdtree::is_tree_file(file)) {
        ProgressBar bar("reading " + file.filename().string());
        return with_texture(vdtree::read_tree(file, std::ref(bar)), file, texture);
    }
    auto read = read_textured_mesh(file, {}, texture);
    if (!read) return read.error();
    print_note(file.string() + " is a mesh: its tree is built now; 'unseen build' does it once and for all.");
    return build_tree_of(std::move(*read), {});
}

Result<vdtree::VertexTree> open_tree(const std::filesystem::path& file, const TextureOptions& texture) {
    // Smaller trees are read in less time than a picture takes, and checked to the last bit.
    constexpr std::uintmax_t mapped_bytes = std::uintmax_t{256} << 20;
    std::error_code unknown;
    const bool is_large = std::filesystem::file_size(file, unknown) >= mapped_bytes && !unknown;
    return is_large && vdtree::is_tree_file(file) ? with_texture(vdtree::map_tree(file), file, texture) : load_tree(file, texture);
}

} // namespace unseen::app
