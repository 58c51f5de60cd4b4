// The files that a mesh file names: images and material libraries.
#pragma once

#include <map>
#include <set>

#include "mesh_readers.h"

namespace unseen::meshio {

struct NamedFile {
    std::string uri = {};                          // relative to the mesh file, under which it is written again
    std::shared_ptr<const std::string> bytes = {}; // null: it was not found
    Message why = {};                              // it was not found: "'a.png' is ..., do this"
};

// Looks for each file beside the file that names it, then beside the mesh, then in ReadOptions::search_folder: there as
// it is named, and by its bare name. Reads each once. Nothing outside of these folders is read.
class NamedFiles {
public:
    explicit NamedFiles(const MeshSource& source) : source_(source) {}

    // `folder`: that of the file that names it, relative to the mesh file's.
    NamedFile find(std::string_view name, const std::filesystem::path& folder = {});

private:
    struct Place {
        std::filesystem::path file, uri;
    };
    std::vector<Place> places_of(const std::filesystem::path& name, const std::filesystem::path& folder) const;
    NamedFile read(const Place& place);

    const MeshSource& source_;
    std::map<std::filesystem::path, NamedFile> read_; // by place on disk
    std::set<std::filesystem::path> uris_;
};

// A name in a file with slashes, without quotes and needless parts: "./a\b.png" is a/b.png. Nothing for an empty name.
std::optional<std::filesystem::path> plain_path(std::string_view name);

// What became of the images that materials name.
struct LostImages {
    std::vector<Message> whys;       // each once
    std::set<std::string> materials; // whose colour image was lost

    void add(const Message& why);
};

// Warns of triangles of textured materials that have no texture coordinates.
void warn_of_missing_uvs(std::uint64_t triangles, ReadResult& result);

// Notes whether all is unlit, and warns of what is not drawn of the materials that triangles have.
void warn_of_undrawn(ReadResult& result);

// Warns of lost images, with the number of triangles that are drawn without.
void warn_of_lost_images(const LostImages& lost, std::span<const MeshRange> ranges, std::vector<Message>& warnings);

} // namespace unseen::meshio
