#include <session/model_file.h>

#include <cmath>

#include <perception/fold_measurement.h>
#include <vdtree/baked_light.h>
#include <vdtree/builder.h>
#include <vdtree/conserve_light.h>
#include <vdtree/internal/number_format.h>
#include <vdtree/tree_io.h>

#include "textures.h"

namespace unseen::session {
namespace {

namespace fs = std::filesystem;

// What of the options is of trees.
Result<vdtree::VertexTree> as_asked(Result<vdtree::VertexTree> tree, const fs::path& file, const LoadOptions& options) {
    if (tree && !options.texture.empty())
        return Error{ErrorCode::invalid_argument,
                     file.string() + " is a tree, whose texture is laid when it is built: give load.texture to "
                                     "session::read_textured_mesh()."};
    if (tree && options.prelit)
        return Error{ErrorCode::invalid_argument, file.string() + " is a tree: whether its colours are pre-lit was "
                                                                  "decided when it was built. Give load.prelit with "
                                                                  "the mesh."};
    if (tree && options.without_textures && !tree->texture().empty()) return tree->untextured();
    return tree;
}

} // namespace

Result<meshio::ReadResult> read_textured_mesh(const fs::path& file, const LoadOptions& options,
                                              meshio::ReadOptions reading) {
    reading.images = options.texture.empty() && !options.without_textures;
    reading.drop = options.drop;
    reading.skip_bad = options.skip_bad;
    reading.weld = options.weld;
    reading.progress = options.messages.progress;
    auto read = meshio::read_mesh(file, reading);
    if (!read) return read;
    if (const auto laid = lay_texture(file, *read, options); !laid) return laid.error();
    if (options.messages.warning)
        for (const std::string& warning : read->warnings) options.messages.warning(file.string() + ": " + warning);
    if (options.messages.note)
        for (const std::string& note : read->notes) options.messages.note(file.string() + ": " + note);
    return read;
}

Result<vdtree::VertexTree> load_tree(const fs::path& file, const LoadOptions& options) {
    if (vdtree::is_tree_file(file)) return as_asked(vdtree::read_tree(file, options.messages.progress), file, options);
    auto read = read_textured_mesh(file, options);
    if (!read) return read.error();
    if (options.messages.note)
        options.messages.note(file.string() +
                              " is a mesh: its tree is built now; vdtree::write_tree() does it once and for all.");
    vdtree::BuildOptions building;
    building.progress = options.messages.progress;
    building.dropped_before = read->dropped_triangles;
    building.prelit = options.prelit;
    auto tree = vdtree::build_tree(read->mesh.view(), building);
    if (!tree || !options.messages.note) return tree;
    if (const std::string hint = hint_at_baked_light(*tree); !hint.empty())
        options.messages.note(file.string() + ": " + hint);
    return tree;
}

Result<vdtree::VertexTree> open_tree(const fs::path& file, const LoadOptions& options) {
    // Smaller trees are read in less time than a picture takes, and checked to the last bit.
    constexpr std::uintmax_t mapped_bytes = std::uintmax_t{256} << 20;
    std::error_code unknown;
    const bool is_large = fs::file_size(file, unknown) >= mapped_bytes && !unknown;
    return is_large && vdtree::is_tree_file(file) ? as_asked(vdtree::map_tree(file), file, options)
                                                  : load_tree(file, options);
}

std::string hint_at_baked_light(const vdtree::VertexTree& tree) {
    if (tree.is_prelit()) return {};
    const auto baked = vdtree::find_baked_light(tree);
    if (!baked || !(baked->explained > vdtree::telling_share)) return {};
    const auto hundredths = [](double value) { return shortest(std::round(100 * value) / 100 + 0.0); }; // no -0
    const glm::dvec3 from(baked->direction);
    return "the colours look as if light were baked in (a light from " + hundredths(from.x) + " " + hundredths(from.y) +
           " " + hundredths(from.z) + " explains " + shortest(std::round(100 * baked->explained)) +
           "% of their variation); if so, use load.prelit.";
}

Result<vdtree::VertexTree> measured(const vdtree::VertexTree& tree, int threads) {
    const auto conserved = vdtree::conserve_light(tree);
    if (!conserved) return conserved.error();
    return perception::measure_folds(*conserved, threads);
}

} // namespace unseen::session
