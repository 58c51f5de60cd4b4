// A glTF file put together: accessors over arrays in memory, and bytes of images, are numbered as they are added and
// written at the end.
#pragma once

#include <deque>

#include <nlohmann/json.hpp>

#include <unseen/meshio/scene_file.h>
#include <unseen/vdtree/mesh.h>

namespace unseen::meshio {

template <class Vectors>
std::span<const float> floats_of(const Vectors& vectors) {
    if (vectors.empty()) return {};
    return {&vectors[0][0], vectors.size() * sizeof(vectors[0]) / sizeof(float)};
}

// What whole numbers of positions stand for: origin + step * number.
struct GltfGrid {
    glm::dvec3 origin = glm::dvec3(0);
    double step = 0; // 0: positions are floats

    bool is_used() const { return step > 0; }
};

class GltfFile {
public:
    explicit GltfFile(const GltfOptions& options = {}) : options_(options) {}

    // The grid for all positions of a mesh; unused if they are not quantized, or all lie at one place.
    GltfGrid grid_for(glm::vec3 low, glm::vec3 high) const;
    // A node's transform for a mesh on the grid.
    static nlohmann::json transform_of(const GltfGrid& grid);

    // Values and bytes must outlive write(). These return numbers of accessors ...
    std::size_t add_positions(std::span<const glm::vec3> positions, const GltfGrid& grid = {}); // not empty
    // An attribute by its name in glTF.
    std::size_t add_attribute(const std::string& name, std::span<const float> values, std::size_t components);
    // ... and of buffer views.
    std::size_t add_indices(std::span<const vdtree::Triangle> triangles);
    std::size_t add_bytes(std::string_view bytes);

    bool reorders() const { return options_.meshopt; } // meshes should come in the order of optimized()

    // Some triangles of a view of indices, with these attributes.
    nlohmann::json primitive(const nlohmann::json& attributes, std::size_t index_view, std::uint64_t first_triangle,
                             std::uint64_t count);

    std::uint64_t bytes() const { return bytes_; } // so far

    // Adds asset, accessors, bufferViews and buffers to the document. By the name's ending one GLB file, or JSON with
    // the data in a .bin of the same name; that file is not replaced where there is no JSON beside it yet.
    Result<void> write(const std::filesystem::path& file, nlohmann::json document) const;

private:
    std::size_t add_view(std::string_view bytes, int target, std::size_t stride = 0);
    std::size_t add_accessor(std::size_t view, int component_type, std::size_t count, const std::string& type);
    std::size_t add_vectors(std::span<const float> values, std::size_t components);
    std::size_t add_packed(std::string bytes, std::size_t stride, std::size_t components, int component_type,
                           bool normalized);
    Result<void> write_data(const std::filesystem::path& file, std::string_view before) const;

    GltfOptions options_;
    std::vector<std::string_view> pieces_;
    std::deque<std::string> packed_; // what pieces refer to that was made here
    nlohmann::json views_ = nlohmann::json::array(), accessors_ = nlohmann::json::array();
    std::uint64_t bytes_ = 0, unpacked_bytes_ = 0;
    bool is_quantized_ = false;
};

// An order of triangles and vertices that suits graphics cards and compression. Where there is no meshoptimizer, or
// nothing is compressed, the order that is. `vertices`: by new vertex, the old one.
struct GltfOrder {
    std::vector<vdtree::Triangle> triangles;
    std::vector<vdtree::Index> vertices;
};
GltfOrder optimized(std::span<const vdtree::Triangle> triangles, std::size_t vertices);

// A path as glTF names it.
std::string to_uri(const std::filesystem::path& path);

} // namespace unseen::meshio
