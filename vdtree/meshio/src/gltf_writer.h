// A glTF file put together: accessors over arrays in memory, and bytes of images, are numbered as they are added and
// written at the end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>

#include <unseen/vdtree/mesh.h>

namespace unseen::meshio {

template <class Vectors>
std::span<const float> floats_of(const Vectors& vectors) {
    if (vectors.empty()) return {};
    return {&vectors[0][0], vectors.size() * sizeof(vectors[0]) / sizeof(float)};
}

class GltfFile {
public:
    // Values and bytes must outlive write(). These return numbers of accessors ...
    std::size_t add_positions(std::span<const glm::vec3> positions); // not empty
    std::size_t add_vectors(std::span<const float> values, std::size_t components);
    // ... and of buffer views.
    std::size_t add_indices(std::span<const vdtree::Triangle> triangles);
    std::size_t add_bytes(std::string_view bytes);

    // Some triangles of a view of indices, with these attributes.
    nlohmann::json primitive(const nlohmann::json& attributes, std::size_t index_view, std::uint64_t first_triangle,
                             std::uint64_t count);

    // Adds asset, accessors, bufferViews and buffers to the document. By the name's ending one GLB file, or JSON with
    // the data in a .bin of the same name; that file is not replaced where there is no JSON beside it yet.
    Result<void> write(const std::filesystem::path& file, nlohmann::json document) const;

private:
    struct Piece {
        std::string_view bytes;
        std::size_t component_bytes;
    };
    std::size_t add_view(std::string_view bytes, std::size_t component_bytes, int target);
    Result<void> write_data(const std::filesystem::path& file, std::string_view before) const;

    std::vector<Piece> pieces_;
    nlohmann::json views_ = nlohmann::json::array(), accessors_ = nlohmann::json::array();
    std::uint64_t bytes_ = 0;
};

// A path as glTF names it.
std::string to_uri(const std::filesystem::path& path);

} // namespace unseen::meshio
