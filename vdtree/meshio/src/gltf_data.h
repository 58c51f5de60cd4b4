// The bytes that a glTF document describes: its buffers, each read or decoded once, and the typed rows in them.
#pragma once

#include <deque>
#include <map>

#include "gltf_document.h"

namespace unseen::meshio::gltf {

// Runs what believes that values of JSON have the types that glTF asks for.
template <class Do>
auto with_types(Do&& run) {
    try {
        return run();
    } catch (const json::exception&) {
        fail(wrong_type);
    }
}

class Buffers {
public:
    // The source must outlive the buffers. `bin`: the container's own, for the first.
    Buffers(const MeshSource& source, const json& document, std::optional<std::string_view> bin);

    static std::string decode_data(std::string_view uri, const std::string& where); // "data:...;base64,..."
    static std::filesystem::path below_folder(const std::string& uri, const std::string& where);

    // The first bytes of a file beside the mesh file; fails if it cannot be read.
    std::string read_beside(const std::string& uri, const std::string& where,
                            std::uint64_t most_bytes = std::numeric_limits<std::uint64_t>::max()) const;

    // A buffer that no file has; its number.
    std::size_t add(std::string bytes);

    std::size_t count() const { return buffers_.size(); }
    std::string_view operator[](std::size_t i) const { return buffers_[i]; }
    std::uint64_t external_bytes() const { return external_bytes_; }

private:
    struct External {
        std::size_t wanted = 0; // bytes
        std::optional<std::string> bytes = {};
    };
    std::string_view resolve(const std::string& uri, const std::string& where);
    std::filesystem::path place_of(const std::string& uri, const std::string& where) const;

    const MeshSource& source_;
    std::map<std::string, std::string> decoded_;         // by data URI
    std::map<std::filesystem::path, External> external_; // by the file that a name leads to
    std::deque<std::string> added_;
    std::vector<std::string_view> buffers_;
    std::uint64_t external_bytes_ = 0;
};

// Decodes the buffer views that are compressed, and has them name the buffers with the result. Without the library
// meshoptimizer nothing: files that need the extension have been refused then (check_kept()).
inline constexpr const char* meshopt_extension = "EXT_meshopt_compression";
void unpack_views(json& document, Buffers& buffers);

class Accessors {
public:
    Accessors(const tinygltf::Model& model, const Buffers& buffers) : model_(model), buffers_(buffers) {}

    std::size_t count_of(int index) const { return accessor(index).count; }
    int components_of(int index) const; // 2, 3 or 4; 0: of another type

    // The accessor's elements with `components` components (0: 3 or 4), others 1 where there is a fourth.
    std::vector<glm::dvec4> vectors(int index, int components, const char* use) const;
    std::vector<Index> indices(int index) const;

private:
    const tinygltf::Accessor& accessor(int index) const;
    // Reads rows of `size` bytes.
    template <class Value, class Decode>
    std::vector<Value> read(int index, std::size_t size, Value missing, Decode&& decode) const;

    const tinygltf::Model& model_;
    const Buffers& buffers_;
};

} // namespace unseen::meshio::gltf
