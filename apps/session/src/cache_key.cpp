// Names of files are looked for in the text, without a parser: one that is found and does not matter only makes a tree
// be built once more, so every name that might be meant counts.
#include "cache_key.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <set>
#include <span>
#include <string_view>
#include <vector>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <unseen/perception/fold_measurement.h>
#include <unseen/perception/lit_folds.h>

namespace unseen::session {
namespace {

namespace fs = std::filesystem;

// One more where the same file gives another tree, or trees are written in another way.
constexpr std::uint32_t revision = 2;
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

std::optional<std::string> bytes_of(const fs::path& file) {
    std::error_code failure;
    if (!fs::is_regular_file(file, failure)) return std::nullopt;
    const std::uintmax_t size = fs::file_size(file, failure);
    if (failure) return std::nullopt;
    std::string bytes(size, '\0');
    std::ifstream in(file, std::ios::binary);
    if (!in.read(bytes.data(), static_cast<std::streamsize>(size))) return std::nullopt;
    return bytes;
}

// Names that a text may mean, relative to its file. Nothing where that is not clear.
using Names = std::optional<std::set<std::string>>;

void add(Names& names, std::string_view name) {
    if (!names || name.empty()) return;
    std::string slashes(name);
    std::replace(slashes.begin(), slashes.end(), '\\', '/');
    names->insert(std::move(slashes));
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

std::string decode_percent(std::string_view uri) {
    std::string name;
    for (std::size_t i = 0; i < uri.size(); ++i) {
        unsigned code = 0;
        const char* const digits = uri.data() + i + 1;
        const bool is_code =
            uri[i] == '%' && i + 2 < uri.size() && std::from_chars(digits, digits + 2, code, 16).ptr == digits + 2;
        name += is_code ? static_cast<char>(code) : uri[i];
        if (is_code) i += 2;
    }
    return name;
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
        if (uri.find('\\') != uri.npos) names.reset(); // escaped in some way
        else add(names, decode_percent(uri));
    }
}

// Readers look at nothing else than what lies beside the mesh or below.
bool is_beside(const fs::path& name) {
    return name.is_relative() && std::find(name.begin(), name.end(), "..") == name.end();
}

} // namespace

std::string mesh_cache_key(const vdtree::Mesh& mesh, std::uint64_t dropped_triangles, bool prelit, bool measures) {
    Hash hash;
    const auto add_all = [&](const auto& values) {
        hash.add({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0])});
    };
    add_all(std::as_bytes(perception::measurement_settings()));
    const std::uint64_t numbers[] = {revision,
                                     std::endian::native == std::endian::little,
                                     prelit,
                                     measures,
                                     dropped_triangles,
                                     static_cast<std::uint64_t>(mesh.texture.width),
                                     static_cast<std::uint64_t>(mesh.texture.height),
                                     static_cast<std::uint64_t>(mesh.texture.wrap_u),
                                     static_cast<std::uint64_t>(mesh.texture.wrap_v)};
    hash.add("a mesh alone");
    hash.add({reinterpret_cast<const char*>(numbers), sizeof numbers});
    add_all(mesh.positions), add_all(mesh.triangles), add_all(mesh.normals), add_all(mesh.colours), add_all(mesh.uvs);
    add_all(mesh.texture.texels), add_all(mesh.document);
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
                                     options.without_textures,
                                     options.prelit,
                                     options.drop.skins,
                                     options.drop.morph_targets,
                                     options.drop.animations,
                                     options.drop.extensions,
                                     options.skip_bad,
                                     options.weld};
    hash.add({reinterpret_cast<const char*>(numbers), sizeof numbers});
    hash.add(file.extension().string());

    const auto mesh = bytes_of(file);
    if (!mesh) return std::nullopt;
    hash.add(*mesh);
    Names names = std::set<std::string>();
    add_after("mtllib", *mesh, names);
    add_uris(*mesh, names);
    if (!names) return std::nullopt;
    const std::set<std::string> of_mesh = *names;
    for (const std::string& name : of_mesh) {
        const auto library = is_beside(name) ? bytes_of(file.parent_path() / name) : std::nullopt;
        if (library) add_after("map_", *library, names);
    }
    if (!names) return std::nullopt;
    for (const std::string& name : *names) {
        const auto bytes = is_beside(name) ? bytes_of(file.parent_path() / name) : std::nullopt;
        if (bytes) hash.add(name), hash.add(*bytes);
    }
    if (!options.texture.empty()) {
        const auto texture = bytes_of(options.texture);
        if (!texture) return std::nullopt;
        hash.add("texture"), hash.add(*texture);
    }
    return hash.digits();
}

} // namespace unseen::session
