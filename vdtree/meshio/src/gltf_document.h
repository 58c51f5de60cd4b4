// A glTF document: split from its container, and cut down to what describes triangles, so that nothing that tinygltf
// would believe or fetch reaches it.
#pragma once

#include <nlohmann/json.hpp>
#include <tiny_gltf.h>

#include <unseen/meshio/mesh_file.h>
#include <unseen/meshio/source_document.h>

#include "mesh_readers.h"

namespace unseen::meshio::gltf {

using nlohmann::json;

// What is said of a document in which the library of JSON does not find what glTF asks for.
inline constexpr const char* wrong_type =
    "its JSON lacks a value, or has one of another type than glTF asks for; correct it.";

std::string numbered(const char* what, std::size_t index); // "buffer 3"

// False if the value is not an array of as many numbers, each in the range.
template <class Vector>
bool numbers_in(const json& values, double low, double high, Vector& to) {
    bool is_valid = values.is_array() && values.size() == static_cast<std::size_t>(Vector::length());
    for (int i = 0; is_valid && i < Vector::length(); ++i) {
        const json& value = values[static_cast<std::size_t>(i)];
        is_valid = value.is_number() && value.get<double>() >= low && value.get<double>() <= high;
        if (is_valid) to[i] = value.get<typename Vector::value_type>();
    }
    return is_valid;
}

struct Container {
    std::string_view json_text;
    std::optional<std::string_view> bin;
};
Container split_glb(std::string_view bytes);

// Not deeper and not of more values than scenes are.
json parse_json(std::string_view text);
std::string to_text(const json& document);

// Compressed vertices and triangles, which are not read.
inline constexpr const char* draco_extension = "KHR_draco_mesh_compression";

inline constexpr std::size_t max_array_elements = std::size_t{1} << 20; // nodes, meshes, accessors, ...

// Names of nodes with coarser meshes, which stand in no scene.
inline constexpr const char* lod_extension = "MSFT_lod";

const json* member(const json& object, const char* key);   // null: it has none
const json& array_of(const json& object, const char* key); // empty: it has none
// The value at the end of a path of keys, null where there is none.
const json& within(const json& value, std::initializer_list<const char*> keys);
std::int64_t to_integer_in_range(const json& value, std::int64_t largest, const std::string& where); // from 0 on
inline constexpr std::int64_t max_size = std::int64_t{1} << 53; // integers above are not exact in JSON
inline constexpr std::int64_t max_int = std::numeric_limits<int>::max();

// The texture by whose coordinates a material is drawn: that of its colour, or else of its normals, or of its emission; null
// where it has none of them.
const json& leading_texture(const json& material);
// The number of a texture's coordinates: 0 where nothing else is said, nothing where the number is not read.
inline constexpr std::uint32_t last_uv_set = 7;
std::optional<std::uint32_t> uv_set_of(const json& texture);
std::string uv_attribute(std::uint32_t set); // "TEXCOORD_0"

// What describes triangles, every integer in range, without buffers and images.
struct Reduced {
    tinygltf::Model model;
    bool has_tangents = false, has_other_attributes = false; // which were left out
};
Reduced reduce(const json& document);

// Fails on what no cut can keep, unless it is to be dropped; what is dropped is told in the warnings.
void check_kept(const json& document, const LeftOut& drop, std::vector<Message>& warnings);

// The document as far as it is kept beside the triangles: without geometry, what is dropped, extensions that nobody
// here knows, and images that lie in the file.
json without_geometry(json document, const std::vector<SourceDocument::File>& images, std::vector<Message>& warnings);

// The image of a texture: its own, or the one that an extension names, in a format that not everybody decodes.
struct TextureSource {
    std::optional<std::size_t> image;
    std::string extension;
};
TextureSource source_of(const json& texture);

} // namespace unseen::meshio::gltf
