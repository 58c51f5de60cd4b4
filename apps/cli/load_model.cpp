#include "load_model.h"

#include <functional>

#include "progress_bar.h"
#include "session_options.h"
#include "terminal.h"

namespace unseen::app {
namespace {

// `bar` must outlive what is done with the options.
session::LoadOptions load_options(const TextureOptions& texture, ProgressBar& bar) {
    session::LoadOptions options;
    options.texture = texture.file;
    options.without_textures = texture.is_left_out;
    options.drop = texture.drop;
    options.skip_bad = texture.skips_bad;
    options.weld = !texture.is_unwelded;
    options.prelit = texture.is_prelit;
    options.messages = terminal_messages();
    options.messages.progress = std::ref(bar);
    return options;
}

} // namespace

Result<meshio::ReadResult> read_mesh_file(const std::filesystem::path& file, bool skip_bad) {
    ProgressBar bar("reading " + file.filename().string());
    meshio::ReadOptions options;
    options.progress = std::ref(bar);
    options.drop = {true, true, true, true}; // nothing is made of it
    options.skip_bad = skip_bad;
    auto read = meshio::read_mesh(file, options);
    if (!read) return read;
    const session::Messages messages = terminal_messages();
    for (const Message& warning : read->warnings) messages.warning(file.string() + ": " + warning);
    for (const Message& note : read->notes) messages.note(file.string() + ": " + note);
    return read;
}

Result<meshio::ReadResult> read_textured_mesh(const std::filesystem::path& file, const meshio::ReadOptions& options,
                                              const TextureOptions& texture) {
    ProgressBar bar("reading " + file.filename().string());
    return session::read_textured_mesh(file, load_options(texture, bar), options);
}

Result<vdtree::VertexTree> build_tree_of(meshio::ReadResult&& read, vdtree::BuildOptions options,
                                         const TreeMaker& build) {
    ProgressBar bar("building");
    options.progress = std::ref(bar);
    options.dropped_before = read.dropped_triangles;
    return build ? build(read.mesh.view(), options) : vdtree::build_tree(read.mesh.view(), options);
}

Result<vdtree::VertexTree> load_tree(const std::filesystem::path& file) {
    ProgressBar bar(file.filename().string());
    session::LoadOptions options = load_options({}, bar);
    options.measures = false;
    options.cache.is_off = true;
    return session::load_tree(file, options);
}

Result<session::Scene> load_scene(const std::filesystem::path& file, const ViewOptions& view) {
    ProgressBar bar(file.filename().string());
    session::LoadOptions options = load_options(view.texture, bar);
    options.unit_metres = view.unit_metres;
    options.as = view.as;
    options.cache.is_off = view.no_cache;
    options.measures = view.measures;
    options.conserves_light = !view.measures; // so that pictures are the same
    return session::Scene::load(file, options);
}

} // namespace unseen::app
