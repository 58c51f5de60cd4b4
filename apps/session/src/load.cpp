#include <unseen/session/load.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include <unseen/perception/fold_measurement.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/internal/baked_light.h>
#include <unseen/vdtree/internal/conserve_light.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/number_format.h>
#include <unseen/vdtree/internal/stopwatch.h>
#include <unseen/vdtree/tree_io.h>

#include "loaded_tree.h"
#include "textures.h"

namespace unseen::session {
namespace {

namespace fs = std::filesystem;

// What of the options is of trees.
Result<vdtree::VertexTree> as_asked(Result<vdtree::VertexTree> tree, const fs::path& file, const LoadOptions& options) {
    if (tree && !options.texture.empty())
        return invalid_field("{} is a tree, whose texture is laid when it is built: give {load.texture} to "
                             "{session::read_textured_mesh()}.",
                             {file.string()});
    if (tree && options.prelit)
        return invalid_field("{} is a tree: whether its colours are pre-lit was decided when it was built. Give "
                             "{load.prelit} with the mesh.",
                             {file.string()});
    if (tree && options.crease)
        return invalid_field("{} is a tree: which of its edges are hard was decided when it was built. Give "
                             "{load.crease} with the mesh.",
                             {file.string()});
    if (tree && !options.protect.empty())
        return invalid_field("{} is a tree: what of it is protected was decided when it was built. Give {load.protect} "
                             "with the mesh.",
                             {file.string()});
    if (tree && options.without_textures && !tree->texture().empty()) return tree->untextured();
    return tree;
}

constexpr char name_begins = '\1', name_ends = '\2';

// A message as text that remembers which of its parts are names.
std::string with_marks(const Message& message) {
    std::string text = message;
    const auto names = message.names();
    for (std::size_t i = names.size(); i-- > 0;) {
        text.insert(names[i].begin + names[i].size, 1, name_ends);
        text.insert(names[i].begin, 1, name_begins);
    }
    return text;
}

Message without_marks(std::string_view text) {
    Message message;
    while (!text.empty()) {
        const std::size_t begin = std::min(text.find(name_begins), text.size());
        const std::size_t end = std::min(text.find(name_ends, begin), text.size());
        message = message + std::string(text.substr(0, begin));
        if (begin < end)
            message = message + Message::of("{" + std::string(text.substr(begin + 1, end - begin - 1)) + "}");
        text.remove_prefix(std::min(end + 1, text.size()));
    }
    return message;
}

// What the reader of a tree's mesh warned of, a line each: an attribute of trees, so that whoever looks at one hears it.
constexpr const char* reading_warnings = "reading_warnings";

Result<vdtree::VertexTree> build(const fs::path& file, const LoadOptions& options) {
    auto read = read_textured_mesh(file, options);
    if (!read) return read.error();
    vdtree::BuildOptions building;
    building.progress = options.messages.progress;
    building.dropped_before = read->dropped_triangles;
    building.prelit = options.prelit || read->is_unlit;
    building.crease = options.crease;
    building.border_weight = border_weight(options.protect);
    auto tree = vdtree::build_tree(read->mesh.view(), building);
    if (!tree) return Error{tree.error().code, file.string() + ": " + tree.error().message};
    if (const Message hint = hint_at_baked_light(*tree); !hint.empty() && options.messages.note)
        options.messages.note(file.string() + ": " + hint);
    tree = measured_as_asked(std::move(*tree), options, options.messages.progress);
    if (!tree || read->warnings.empty()) return tree;
    std::vector<std::uint8_t> text;
    for (const Message& warning : read->warnings) {
        const std::string line = with_marks(warning) + "\n";
        text.insert(text.end(), line.begin(), line.end());
    }
    return tree->with_attribute(reading_warnings, vdtree::AttributeDomain::tree, std::move(text));
}

// Says again what reading the mesh of a tree from the cache said.
void warn_again(const vdtree::VertexTree& tree, const fs::path& file, const Messages& messages) {
    if (!messages.warning) return;
    const auto bytes = tree.attribute<std::uint8_t>(reading_warnings);
    std::istringstream lines(std::string(bytes.begin(), bytes.end()));
    for (std::string line; std::getline(lines, line);) messages.warning(file.string() + ": " + without_marks(line));
}

// Ends the names of files in the cache.
constexpr std::string_view under_lights = "+lights";

// Whoever can write to the cache can put another tree there.
bool is_same_tree(const vdtree::VertexTree& a, const vdtree::VertexTree& b) {
    return a.interior_count() == b.interior_count() && std::ranges::equal(a.positions(), b.positions());
}

// Runs `make`, which builds or only measures, keeps its tree, and notes both. `key`: none where it is kept nowhere.
// `deed`: what it has done, of the tree.
template <class Make, class Deed>
Result<vdtree::VertexTree> make_and_keep(const TreeCache& cache, const std::optional<std::string>& key,
                                         const fs::path& file, const Messages& messages, Make&& make, Deed&& deed) {
    const auto start = vdtree::Clock::now();
    Result<vdtree::VertexTree> tree = make();
    if (!tree) return tree;
    const double seconds = vdtree::seconds_since(start);
    Message what_becomes = Message::of("{vdtree::write_tree()} does it once and for all");
    if (cache.is_on() && key) {
        const auto kept = cache.keep(*key, file, *tree);
        what_becomes = kept ? kept_in(cache) : "not kept for the next time: " + kept.error().message;
    }
    if (messages.note) messages.note(deed(*tree) + " in " + rounded(seconds, 2) + " s; " + what_becomes);
    return tree;
}

Result<LoadedTree> load_mesh(const fs::path& file, const LoadOptions& options) {
    const TreeCache cache(options.cache);
    std::optional<std::string> key;
    if (cache.is_on()) key = cache_key(file, options);
    if (const auto sound = cache.check(); !sound && options.messages.warning)
        options.messages.warning(sound.error().message);
    const auto with_place = [&](vdtree::VertexTree tree, TreeOrigin origin) {
        LoadedTree loaded{std::move(tree), origin};
        if (key) loaded.measurement = place_of_mesh(cache, *key, file, loaded.tree);
        return loaded;
    };
    if (key) {
        auto kept = cache.find(*key, options.messages.progress);
        if (!kept) return kept.error();
        if (*kept) {
            warn_again(**kept, file, options.messages);
            return with_place(std::move(**kept), TreeOrigin::cache);
        }
    }
    auto tree = make_and_keep(
        cache, key, file, options.messages,
        [&]() -> Result<vdtree::VertexTree> {
            auto built = build(file, options);
            if (key && cache_key(file, options) != key) key.reset(); // the files have changed meanwhile
            return built;
        },
        [&](const vdtree::VertexTree& built) {
            return (perception::has_fold_measurement(built) ? "built and measured the tree of "
                                                            : "built the tree of ") +
                   file.string();
        });
    if (!tree) return tree.error();
    return with_place(std::move(*tree), TreeOrigin::built);
}

} // namespace

Message kept_in(const TreeCache& cache) {
    return Message::of("kept in {} for the next time ({session::TreeCache})", {cache.folder().string()});
}

Result<vdtree::VertexTree> measured_as_asked(vdtree::VertexTree tree, const LoadOptions& options,
                                             const Progress& progress) {
    if (tree.interior_count() > most_measured) return tree;
    if (options.measures) return measured(tree, 0, progress);
    return options.conserves_light && tree.texture().empty() ? vdtree::conserve_light(tree) : std::move(tree);
}

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
    reading = reading_options(options, std::move(reading));
    reading.progress = options.messages.progress;
    auto read = meshio::read_mesh(file, reading);
    if (!read) return read;
    if (const auto laid = lay_texture(file, *read, options); !laid) return laid.error();
    if (const auto found = protect(*read, options.protect); !found)
        return Error{found.error().code, file.string() + ": " + found.error().message};
    tell(options.messages.warning, file, read->warnings);
    tell(options.messages.note, file, read->notes);
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
    warn_again(*tree, file, options.messages);
    LoadedTree loaded{std::move(*tree), TreeOrigin::file};
    TreeCache cache(options.cache);
    const bool has_all = perception::has_fold_measurement(loaded.tree) && perception::has_lit_folds(loaded.tree);
    if (!cache.is_on() || is_large || has_all) return loaded;
    if (auto key = cache_key(file, options))
        loaded.measurement = std::make_shared<const MeasurementPlace>(
            MeasurementPlace{std::move(cache), std::move(*key), file, loaded.tree.share()});
    return loaded;
}

Result<vdtree::VertexTree> load_tree(const fs::path& file, const LoadOptions& options) {
    auto loaded = load(file, options, false);
    return loaded ? Result<vdtree::VertexTree>(std::move(loaded->tree)) : loaded.error();
}

Message hint_at_baked_light(const vdtree::VertexTree& tree) {
    if (tree.is_prelit()) return {};
    const auto baked = vdtree::find_baked_light(tree);
    if (!baked || !(baked->explained > vdtree::telling_share)) return {};
    const auto hundredths = [](double value) { return shortest(std::round(100 * value) / 100 + 0.0); }; // no -0
    const glm::dvec3 from(baked->direction);
    return "the colours look as if light were baked in (a light from " + hundredths(from.x) + " " + hundredths(from.y) +
           " " + hundredths(from.z) + " explains " + shortest(std::round(100 * baked->explained)) +
           "% of their variation); if so, use " + Message::of("{load.prelit}.");
}

Result<vdtree::VertexTree> measured(const vdtree::VertexTree& tree, int threads, const Progress& progress) {
    if (!tree.texture().empty())
        return perception::measure_folds(tree, threads, progress); // its light is the texture's
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
    return make_and_keep(
        place->cache, place->key, place->file, messages,
        [&]() -> Result<vdtree::VertexTree> {
            auto with_folds = measured(tree, 0, messages.progress);
            const auto warnings = tree.attribute<std::uint8_t>(reading_warnings);
            if (!with_folds || warnings.empty()) return with_folds;
            return with_folds->with_attribute(reading_warnings, vdtree::AttributeDomain::tree,
                                              std::vector(warnings.begin(), warnings.end()));
        },
        [&](const vdtree::VertexTree&) { return "measured the tree of " + place->file.string(); });
}

std::shared_ptr<const MeasurementPlace> place_of_mesh(const TreeCache& cache, const std::string& key,
                                                      const fs::path& file, const vdtree::VertexTree& tree) {
    if (!cache.is_on()) return nullptr;
    return std::make_shared<const MeasurementPlace>(MeasurementPlace{cache, key, file, tree.share(), false});
}

Result<vdtree::VertexTree> measured_under_lights(const vdtree::VertexTree& tree, int threads,
                                                 const Progress& progress) {
    const auto folds = perception::LitFolds::measure(tree, threads, progress);
    return folds ? folds->with_attributes(tree) : folds.error();
}

Result<perception::LitFolds> measured_under_lights_once(const vdtree::VertexTree& tree, const MeasurementPlace* place,
                                                        const Messages& messages, bool takes_long) {
    // What is damaged, or of another version, is measured again.
    if (perception::has_lit_folds(tree))
        if (auto own = perception::LitFolds::of(tree)) return own;
    const std::string key = place ? lights_key(place->key) : std::string();
    if (place) {
        const auto kept = place->cache.find(key, messages.progress);
        if (!kept) return kept.error();
        if (*kept && is_same_tree(**kept, tree))
            if (auto folds = perception::LitFolds::of(**kept)) return folds;
    }
    if (messages.note && takes_long)
        messages.note(
            "measuring what folds change under lights" +
            (place ? Message() : Message::of(" ({session::measured_under_lights()} keeps that in the tree)")) + " ...");
    if (!place) return perception::LitFolds::measure(tree, 0, messages.progress);
    const auto with_folds = make_and_keep(
        place->cache, key, place->file.string() + std::string(under_lights), messages,
        [&] { return measured_under_lights(tree, 0, messages.progress); },
        [&](const vdtree::VertexTree&) {
            return "measured what the folds of " + place->file.string() + " change under lights";
        });
    if (!with_folds) return with_folds.error();
    return perception::LitFolds::of(*with_folds);
}

} // namespace unseen::session
