// Names of files are looked for in the text of a mesh, without a parser. One that only seems to be named makes a tree
// be built once more, or an output be refused; so every name that might be meant counts.
#include "loaded_tree.h"

#include <algorithm>
#include <bit>
#include <set>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <unseen/perception/fold_measurement.h>
#include <unseen/vdtree/internal/input_file.h>
#include <unseen/vdtree/internal/names.h>
#include <unseen/vdtree/internal/number_text.h>

#include "textures.h"

namespace unseen::session {
namespace {

namespace fs = std::filesystem;

// One more where the same file gives another tree or other warnings, or trees are written in another way.
constexpr std::uint32_t revision = 7;
// More is no mesh that anybody has made.
constexpr std::size_t most_words = 64, most_names = 4096;

class Hash {
public:
    Hash() { XXH3_128bits_reset(&state_); }

    void add(std::string_view bytes) {
        const std::uint64_t size = bytes.size(); // so that it is clear where one ends
        XXH3_128bits_update(&state_, &size, sizeof size);
        XXH3_128bits_update(&state_, bytes.data(), bytes.size());
    }
    std::string digits() const {
        const XXH128_hash_t hash = XXH3_128bits_digest(&state_);
        char text[33];
        std::snprintf(text, sizeof text, "%016llx%016llx", static_cast<unsigned long long>(hash.high64),
                      static_cast<unsigned long long>(hash.low64));
        return text;
    }

private:
    XXH3_state_t state_;
};

// A crease angle is never negative, so -1 stands for none stated.
std::uint32_t bits_of(const std::optional<float>& crease) {
    return std::bit_cast<std::uint32_t>(crease.value_or(-1.0f));
}

// Names that a text may mean, relative to its file. Nothing where that is not clear.
using Names = std::optional<std::set<std::string>>;

void add(Names& names, std::string_view name) {
    if (!names || name.empty()) return;
    std::string slashes(name);
    std::replace(slashes.begin(), slashes.end(), '\\', '/');
    names->insert(fs::path(slashes).lexically_normal().string());
    if (names->size() > most_names) names.reset();
}

// The words after each `keyword`, and every end of their line, as names may have blanks in them.
void add_after(std::string_view keyword, std::string_view text, Names& names) {
    constexpr std::string_view blanks = " \t\r\n";
    for (std::size_t at = 0; names && (at = text.find(keyword, at)) != text.npos;) {
        at += keyword.size();
        std::size_t end = text.find('\n', at);
        // A line may go on in the next one.
        while (end != text.npos && (text[end - 1] == '\\' || (text[end - 1] == '\r' && text[end - 2] == '\\')))
            end = text.find('\n', end + 1);
        std::string line(text.substr(at, end == text.npos ? end : end - at));
        line.erase(std::min(line.find_last_not_of(blanks) + 1, line.size()));
        int words = 0;
        for (std::size_t word = line.find_first_not_of(blanks); names && word < line.size(); ++words) {
            const std::size_t after = std::min(line.find_first_of(blanks, word), line.size());
            add(names, std::string_view(line).substr(word));
            add(names, std::string_view(line).substr(word, after - word));
            word = line.find_first_not_of(blanks, after);
        }
        if (words > static_cast<int>(most_words)) names.reset();
    }
}

// The text of a JSON string; nothing if it has other escapes than of slashes, as exporters write them.
std::optional<std::string> unescaped(std::string_view text) {
    std::string plain;
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] == '\\' && (++i == text.size() || (text[i] != '/' && text[i] != '\\'))) return std::nullopt;
        plain += text[i];
    }
    return plain;
}

// The uris of a glTF document, whether it stands alone or in a .glb file.
void add_uris(std::string_view text, Names& names) {
    constexpr std::string_view key = "\"uri\"";
    for (std::size_t at = 0; names && (at = text.find(key, at)) != text.npos;) {
        at += key.size();
        const std::size_t begin = text.find('"', at);
        if (begin == text.npos || begin + 1 >= text.size()) return;
        const std::size_t end = text.find('"', begin + 1);
        if (end == text.npos) return;
        const std::string_view uri = text.substr(begin + 1, end - begin - 1);
        at = end;
        if (uri.starts_with("data:")) continue;
        if (const auto plain = unescaped(uri)) add(names, decode_percent(*plain));
        else names.reset();
    }
}

// The files that a name may mean. Readers look at nothing else than what lies beside the mesh or below, or in the folder
// of LoadOptions::texture.
std::vector<std::string> read_named(const fs::path& mesh, const fs::path& name, const fs::path& search) {
    const auto is_within = [](const fs::path& path) {
        return path.is_relative() && std::find(path.begin(), path.end(), "..") == path.end();
    };
    std::set<fs::path> places;
    if (is_within(name)) places.insert(mesh.parent_path() / name);
    if (!search.empty()) {
        const fs::path root = fs::absolute(search).lexically_normal();
        for (const fs::path& place : {mesh.parent_path() / name, search / name, search / name.filename()})
            if (is_within(fs::absolute(place).lexically_normal().lexically_relative(root))) places.insert(place);
    }
    std::vector<std::string> files;
    for (const fs::path& place : places)
        if (auto bytes = read_regular_file(place)) files.push_back(std::move(*bytes));
    return files;
}

// All that a mesh's text names, relative to its folder: libraries, buffers, images.
Names names_in(const fs::path& file, std::string_view mesh, const fs::path& search = {}) {
    Names names = std::set<std::string>();
    add_after("mtllib", mesh, names);
    add_uris(mesh, names);
    if (!names) return names;
    const std::set<std::string> of_mesh = *names;
    for (const std::string& name : of_mesh) {
        Names images = std::set<std::string>();
        for (const std::string& library : read_named(file, name, search))
            if (library.find("newmtl") != library.npos)
                for (const char* keyword : {"map_", "bump", "disp", "decal", "norm", "refl"})
                    add_after(keyword, library, images);
        if (!images) return images;
        for (const std::string& image : *images) { // beside the library, or beside the mesh
            add(names, image);
            add(names, (fs::path(name).parent_path() / image).string());
        }
    }
    return names;
}

} // namespace

std::string mesh_cache_key(const vdtree::Mesh& mesh, const vdtree::BuildOptions& building, bool measures,
                           bool conserves_light) {
    Hash hash;
    const auto add_all = [&](const auto& values) {
        hash.add({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0])});
    };
    add_all(std::as_bytes(perception::measurement_settings()));
    const std::uint64_t numbers[] = {revision,
                                     std::endian::native == std::endian::little,
                                     building.prelit,
                                     bits_of(building.crease),
                                     bits_of(building.border_weight),
                                     measures,
                                     conserves_light,
                                     building.dropped_before,
                                     static_cast<std::uint64_t>(mesh.texture.width),
                                     static_cast<std::uint64_t>(mesh.texture.height),
                                     static_cast<std::uint64_t>(mesh.texture.wrap_u),
                                     static_cast<std::uint64_t>(mesh.texture.wrap_v),
                                     mesh.texture.blends};
    hash.add("a mesh alone");
    hash.add({reinterpret_cast<const char*>(numbers), sizeof numbers});
    add_all(mesh.positions), add_all(mesh.triangles), add_all(mesh.normals), add_all(mesh.colours), add_all(mesh.uvs);
    add_all(mesh.texture.texels), add_all(mesh.texture.emission), add_all(mesh.texture.relief);
    add_all(mesh.document), add_all(mesh.smoothing), add_all(mesh.further);
    add_all(mesh.weights);
    for (const vdtree::MeshRange& range : mesh.ranges) {
        const std::uint64_t place[] = {static_cast<std::uint64_t>(range.kind), range.first_triangle,
                                       range.triangle_count};
        hash.add(range.name);
        hash.add({reinterpret_cast<const char*>(place), sizeof place});
    }
    return hash.digits();
}

std::string lights_key(const std::string& key) {
    const auto settings = std::as_bytes(perception::lit_measurement_settings());
    Hash hash;
    hash.add("under lights");
    hash.add(key);
    hash.add({reinterpret_cast<const char*>(settings.data()), settings.size()});
    return hash.digits();
}

std::optional<std::string> cache_key(const fs::path& file, const LoadOptions& options) {
    Hash hash;
    const auto settings = std::as_bytes(perception::measurement_settings());
    hash.add({reinterpret_cast<const char*>(settings.data()), settings.size()});
    const std::uint32_t numbers[] = {revision,
                                     std::endian::native == std::endian::little,
                                     options.measures,
                                     options.conserves_light,
                                     options.without_textures,
                                     options.prelit,
                                     bits_of(options.crease),
                                     options.drop.skins,
                                     options.drop.morph_targets,
                                     options.drop.animations,
                                     options.drop.extensions,
                                     options.skip_bad,
                                     options.weld};
    hash.add({reinterpret_cast<const char*>(numbers), sizeof numbers});
    hash.add(file.extension().string());
    for (const Protection& protection : options.protect) {
        hash.add(std::to_string(static_cast<int>(protection.kind)) + " " + number_text(protection.weight));
        hash.add(protection.name);
        if (protection.kind != Protection::Kind::vertices) continue;
        const auto weights = read_regular_file(protection.name);
        if (!weights) return std::nullopt;
        hash.add(*weights);
    }

    const auto mesh = read_regular_file(file);
    if (!mesh) return std::nullopt;
    hash.add(*mesh);
    const fs::path search = names_folder(options) ? options.texture : fs::path();
    const Names names = names_in(file, *mesh, search);
    if (!names) return std::nullopt;
    for (const std::string& name : *names)
        for (const std::string& bytes : read_named(file, name, search)) hash.add(name), hash.add(bytes);
    if (!options.texture.empty() && search.empty()) {
        const auto texture = read_regular_file(options.texture);
        if (!texture) return std::nullopt;
        hash.add("texture"), hash.add(*texture);
    }
    return hash.digits();
}

std::vector<fs::path> files_named_by(const fs::path& mesh) {
    for (const char* ending : {".ply", ".stl", ".off", ".vtp"}) // large, and they name no files
        if (mesh.extension() == ending) return {};
    const auto bytes = read_regular_file(mesh);
    if (!bytes) return {};
    const Names names = names_in(mesh, *bytes);
    std::vector<fs::path> files;
    if (names)
        for (const std::string& name : *names) files.push_back(mesh.parent_path() / name);
    else // it may be any file there
        for (std::error_code failure;
             const auto& entry : fs::directory_iterator(fs::absolute(mesh).parent_path(), failure))
            files.push_back(entry.path());
    return files;
}

} // namespace unseen::session
