#include <system_error>

#include "named_files.h"

namespace unseen::meshio {

namespace fs = std::filesystem;

namespace {

bool is_within(const fs::path& relative) {
    return !relative.empty() && relative.is_relative() && *relative.begin() != ".." && relative.has_filename();
}

// With a drive or the beginning of an address: of such names only the last part counts.
bool is_elsewhere(const fs::path& name) { return name.is_absolute() || name.string().find(':') != std::string::npos; }

bool is_below(const fs::path& file, const fs::path& folder) {
    return is_within(fs::absolute(file).lexically_normal().lexically_relative(fs::absolute(folder).lexically_normal()));
}

} // namespace

std::optional<fs::path> plain_path(std::string_view name) {
    if (name.size() > 2 && name.front() == '"' && name.back() == '"') name = name.substr(1, name.size() - 2);
    std::string slashes(name);
    std::replace(slashes.begin(), slashes.end(), '\\', '/');
    if (slashes.empty() || slashes.find('\0') != std::string::npos) return std::nullopt;
    return fs::path(slashes).lexically_normal();
}

std::optional<fs::path> path_beside(std::string_view name) {
    const auto path = plain_path(name);
    if (!path || !is_within(*path) || is_elsewhere(*path)) return std::nullopt;
    return path;
}

std::vector<NamedFiles::Place> NamedFiles::places_of(const fs::path& name, const fs::path& folder) const {
    const fs::path& search = source_.options.search_folder;
    std::vector<Place> places;
    if (!is_elsewhere(name)) {
        for (const fs::path& path : {(folder / name).lexically_normal(), name})
            if (is_within(path)) places.push_back({source_.folder / path, path});
        if (!search.empty()) {
            const fs::path beside = source_.folder / folder / name;
            if (is_below(beside, search)) places.push_back({beside, folder / name.filename()});
            if (is_within(name)) places.push_back({search / name, (folder / name).lexically_normal()});
        }
    }
    if (!search.empty() && name.has_filename()) places.push_back({search / name.filename(), folder / name.filename()});
    return places;
}

NamedFile NamedFiles::find(std::string_view name, const fs::path& folder) {
    const auto path = plain_path(name);
    if (!path) return {.why = "a name is empty"};
    NamedFile lost{.why = in_quotes(name)};
    if (source_.folder.empty()) {
        lost.why += " was not looked for, as the mesh has no folder";
        return lost;
    }
    std::error_code unknown;
    for (const Place& place : places_of(*path, folder))
        if (fs::exists(place.file, unknown)) return read(place);
    if (is_within(*path) && !is_elsewhere(*path)) lost.uri = path->generic_string();
    const bool is_outside = is_elsewhere(*path) || !is_within((folder / *path).lexically_normal());
    const fs::path& search = source_.options.search_folder;
    if (!search.empty()) lost.why += " is neither beside the mesh nor in " + search.string();
    else
        lost.why = lost.why + Message::of(is_outside ? " is outside of the mesh's folder, where nothing is read; "
                                                       "{read.search_folder = }FOLDER says where else to look"
                                                     : " is neither beside the file that names it nor beside the mesh; "
                                                       "{read.search_folder = }FOLDER says where else to look");
    return lost;
}

NamedFile NamedFiles::read(const Place& place) {
    const auto [found, is_new] = read_.try_emplace(place.file.lexically_normal());
    NamedFile& file = found->second;
    if (!is_new) return file;
    fs::path uri = place.uri;
    while (!uris_.insert(uri).second) uri.replace_filename("_" + uri.filename().string());
    file.uri = uri.generic_string();
    Result<std::string> bytes = read_regular_file(place.file);
    if (bytes) file.bytes = std::make_shared<const std::string>(std::move(*bytes));
    else file.why = bytes.error().message.substr(0, bytes.error().message.size() - 1);
    return file;
}

void warn_of_missing_uvs(std::uint64_t triangles, ReadResult& result) {
    if (triangles == 0) return;
    result.warnings.push_back(
        std::to_string(triangles) + (triangles == 1 ? " triangle has" : " triangles have") +
        " an image but no texture coordinates" +
        (result.mesh.uvs.empty() ? "; the colour of the material is shown alone." : ", and shows what is at 0, 0."));
}

void warn_of_undrawn(ReadResult& result) {
    std::map<std::string, std::uint64_t> used; // triangles of materials
    for (const MeshRange& range : result.mesh.ranges)
        if (range.kind == MeshRange::Kind::material && range.triangle_count > 0)
            used[range.name] += range.triangle_count;
    std::set<std::string> undrawn;
    std::uint64_t unlit = 0; // triangles
    for (const Material& material : result.materials) {
        const auto found = used.find(material.name);
        if (found == used.end()) continue;
        undrawn.insert(material.undrawn.begin(), material.undrawn.end());
        if (material.is_unlit) unlit += found->second;
    }
    result.is_unlit = unlit > 0 && unlit == result.mesh.triangles.size();
    if (unlit > 0 && !result.is_unlit) undrawn.insert("KHR_materials_unlit beside lit ones");
    if (undrawn.empty()) return;
    std::string all;
    for (auto what = undrawn.begin(); what != undrawn.end(); ++what)
        all += (what == undrawn.begin() ? "" : std::next(what) == undrawn.end() ? " and " : ", ") + *what;
    result.warnings.push_back("what materials have of " + all +
                              " is not drawn: what is said of visibility does not know it.");
}

void LostImages::add(const Message& why) {
    if (std::find(whys.begin(), whys.end(), why) == whys.end()) whys.push_back(why);
}

void warn_of_lost_images(const LostImages& lost, std::span<const MeshRange> ranges, std::vector<Message>& warnings) {
    if (lost.whys.empty()) return;
    std::uint64_t triangles = 0;
    for (const MeshRange& range : ranges)
        if (range.kind == MeshRange::Kind::material && lost.materials.contains(range.name))
            triangles += range.triangle_count;
    std::string warning = counted_were(lost.whys.size(), "image") + " not read";
    if (!lost.materials.empty())
        warning += text_of(", so ", triangles, triangles == 1 ? " triangle is" : " triangles are",
                           " drawn without an image of the material");
    warnings.push_back(warning + (lost.whys.size() == 1 ? ": " : "; the first: ") + lost.whys.front() + ".");
}

} // namespace unseen::meshio
