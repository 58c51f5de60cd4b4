#include <session/model_file.h>

#include <chrono>
#include <cmath>

#include <perception/fold_measurement.h>
#include <vdtree/baked_light.h>
#include <vdtree/builder.h>
#include <vdtree/conserve_light.h>
#include <vdtree/internal/number_format.h>
#include <vdtree/tree_io.h>

#include "cache_key.h"
#include "loaded_tree.h"
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

Result<vdtree::VertexTree> build(const fs::path& file, const LoadOptions& options) {
    auto read = read_textured_mesh(file, options);
    if (!read) return read.error();
    vdtree::BuildOptions building;
    building.progress = options.messages.progress;
    building.dropped_before = read->dropped_triangles;
    building.prelit = options.prelit;
    auto tree = vdtree::build_tree(read->mesh.view(), building);
    if (!tree) return tree;
    if (const std::string hint = hint_at_baked_light(*tree); !hint.empty() && options.messages.note)
        options.messages.note(file.string() + ": " + hint);
    const bool measures = options.measures && tree->texture().empty() && tree->interior_count() <= most_measured;
    return measures ? measured(*tree, 0, options.messages.progress) : std::move(tree);
}

// Runs `make`, which builds or only measures, keeps its tree, and notes both. `key`: none where it is kept nowhere.
template <class Make>
Result<vdtree::VertexTree> make_and_keep(const TreeCache& cache, const std::optional<std::string>& key,
                                         const fs::path& file, const Messages& messages, bool builds, Make&& make) {
    const auto start = std::chrono::steady_clock::now();
    Result<vdtree::VertexTree> tree = make();
    if (!tree) return tree;
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    std::string what_becomes = "vdtree::write_tree() does it once and for all";
    if (cache.is_on() && key) {
        const auto kept = cache.keep(*key, file, *tree);
        what_becomes = kept ? "kept in " + cache.folder().string() + " for the next time (session::TreeCache)"
                            : "not kept for the next time: " + kept.error().message;
    }
    const bool is_measured = perception::has_fold_measurement(*tree);
    const std::string deed = !builds ? "measured" : is_measured ? "built and measured" : "built";
    if (messages.note)
        messages.note(deed + " the tree of " + file.string() + " in " + rounded(seconds, 2) + " s; " + what_becomes);
    return tree;
}

Result<LoadedTree> load_mesh(const fs::path& file, const LoadOptions& options) {
    const TreeCache cache(options.cache);
    std::optional<std::string> key;
    if (cache.is_on()) key = cache_key(file, options);
    if (key) {
        auto kept = cache.find(*key, options.messages.progress);
        if (!kept) return kept.error();
        if (*kept) return LoadedTree{std::move(**kept), TreeOrigin::cache};
    }
    auto tree = make_and_keep(cache, key, file, options.messages, true, [&]() -> Result<vdtree::VertexTree> {
        auto built = build(file, options);
        if (key && cache_key(file, options) != key) key.reset(); // the files have changed meanwhile
        return built;
    });
    if (!tree) return tree.error();
    return LoadedTree{std::move(*tree), TreeOrigin::built};
}

} // namespace

std::string name_of(TreeOrigin origin) {
    switch (origin) {
    case TreeOrigin::file: return "file";
    case TreeOrigin::built: return "built";
    case TreeOrigin::cache: return "cache";
    case TreeOrigin::given: break;
    }
    return "given";
}

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

Result<LoadedTree> load(const fs::path& file, const LoadOptions& options, bool may_map) {
    if (!vdtree::is_tree_file(file)) return load_mesh(file, options);
    // Smaller trees are read in less time than a picture takes, and checked to the last bit.
    constexpr std::uintmax_t mapped_bytes = std::uintmax_t{256} << 20;
    std::error_code unknown;
    const bool is_large = fs::file_size(file, unknown) >= mapped_bytes && !unknown;
    auto tree =
        as_asked(may_map && is_large ? vdtree::map_tree(file) : vdtree::read_tree(file, options.messages.progress),
                 file, options);
    if (!tree) return tree.error();
    LoadedTree loaded{std::move(*tree), TreeOrigin::file};
    TreeCache cache(options.cache);
    if (!cache.is_on() || is_large || perception::has_fold_measurement(loaded.tree) || !loaded.tree.texture().empty())
        return loaded;
    if (auto key = cache_key(file, options))
        loaded.measurement = std::make_shared<const MeasurementPlace>(
            MeasurementPlace{std::move(cache), std::move(*key), file, loaded.tree.share()});
    return loaded;
}

Result<vdtree::VertexTree> load_tree(const fs::path& file, const LoadOptions& options) {
    auto loaded = load(file, options, false);
    return loaded ? Result<vdtree::VertexTree>(std::move(loaded->tree)) : loaded.error();
}

Result<vdtree::VertexTree> open_tree(const fs::path& file, const LoadOptions& options) {
    auto loaded = load(file, options, true);
    return loaded ? Result<vdtree::VertexTree>(std::move(loaded->tree)) : loaded.error();
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

Result<vdtree::VertexTree> measured(const vdtree::VertexTree& tree, int threads, const Progress& progress) {
    const auto conserved = vdtree::conserve_light(tree);
    if (!conserved) return conserved.error();
    return perception::measure_folds(*conserved, threads, progress);
}

Result<vdtree::VertexTree> measured_once(const vdtree::VertexTree& tree, const MeasurementPlace* place,
                                         const Messages& messages) {
    if (!place) return measured(tree, 0, messages.progress);
    auto kept = place->cache.find(place->key, messages.progress);
    if (!kept) return kept.error();
    if (*kept) return std::move(**kept);
    return make_and_keep(place->cache, place->key, place->file, messages, false,
                         [&] { return measured(tree, 0, messages.progress); });
}

} // namespace unseen::session
