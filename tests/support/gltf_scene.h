// A glTF scene with all that files say beside triangles, as .glb or as .gltf with files beside it; and what a scene
// holds, read back by code of its own, for comparison.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <numbers>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "mesh_files.h"
#include "temp_folder.h"

namespace unseen::support {

using nlohmann::json;

// Balls whose coordinates have few binary digits, so that transforms by powers of two bring them back exactly.
struct Ball {
    std::vector<float> positions, normals, uvs, second_uvs, colours;
    std::vector<std::uint32_t> indices;
    std::size_t vertices = 0;
};

inline Ball ball(int rings, int sectors) {
    Ball out;
    for (int r = 0; r <= rings; ++r) {
        for (int s = 0; s <= sectors; ++s) {
            const double polar = std::numbers::pi * r / rings, turn = 2 * std::numbers::pi * s / sectors;
            const double p[] = {std::sin(polar) * std::sin(turn), std::cos(polar), std::sin(polar) * std::cos(turn)};
            for (const double x : p) {
                out.positions.push_back(static_cast<float>(std::round(x * 1024) / 1024));
                out.normals.push_back(static_cast<float>(x));
            }
            const auto u = static_cast<float>(s) / static_cast<float>(sectors),
                       v = static_cast<float>(r) / static_cast<float>(rings);
            out.uvs.insert(out.uvs.end(), {2 * u, v});
            out.second_uvs.insert(out.second_uvs.end(), {v, u});
            out.colours.insert(out.colours.end(), {1, 0.25f + 0.5f * v, 0.5f, 1});
        }
    }
    out.vertices = out.positions.size() / 3;
    const auto at = [&](int r, int s) { return static_cast<std::uint32_t>(r * (sectors + 1) + s); };
    for (int r = 0; r < rings; ++r) {
        for (int s = 0; s < sectors; ++s) {
            if (r > 0) out.indices.insert(out.indices.end(), {at(r, s), at(r + 1, s), at(r, s + 1)});
            if (r + 1 < rings) out.indices.insert(out.indices.end(), {at(r, s + 1), at(r + 1, s), at(r + 1, s + 1)});
        }
    }
    return out;
}

// Images are the caller's: colour, surface, normals.
struct GltfScene {
    json document;
    std::string data;

    explicit GltfScene(int rings = 24, int sectors = 32) {
        document = json::parse(R"({"asset": {"version": "2.0", "copyright": "somebody"}, "scene": 0,
            "scenes": [{"name": "room", "nodes": [0, 3]}],
            "nodes": [{"name": "table", "translation": [0.5, 0, 0], "children": [1, 2], "extras": {"legs": 4}},
                      {"name": "checkered ball", "mesh": 0, "scale": [0.5, 0.5, -0.5], "translation": [-1.5, 0, 0]},
                      {"name": "gold ball", "mesh": 1, "translation": [1, 0.25, 0]},
                      {"name": "eye", "camera": 0, "translation": [0, 0, 8]}],
            "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.125}}],
            "meshes": [{"name": "checkers", "extras": {"made": "by hand"}},
                       {"name": "gold"}],
            "samplers": [{"wrapS": 10497, "wrapT": 33071, "magFilter": 9729}],
            "textures": [{"name": "colour", "source": 0, "sampler": 0}, {"source": 1}, {"source": 2}],
            "materials": [
                {"name": "checkers", "doubleSided": true,
                 "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions":
                     {"KHR_texture_transform": {"scale": [2, 0.5], "offset": [0.25, 0.125]}}},
                     "metallicFactor": 0.25, "roughnessFactor": 0.75, "metallicRoughnessTexture": {"index": 1}},
                 "normalTexture": {"index": 2, "scale": 0.5}, "occlusionTexture": {"index": 1, "texCoord": 1},
                 "emissiveFactor": [0.125, 0, 0], "extensions": {"KHR_materials_ior": {"ior": 1.25}}},
                {"name": "gold",
                 "pbrMetallicRoughness": {"baseColorFactor": [1, 0.75, 0.25, 1], "roughnessFactor": 0.25}}],
            "extensionsUsed": ["KHR_materials_ior", "KHR_texture_transform"]})");
        const Ball checkered = ball(rings, sectors), gold = ball(rings / 2, sectors / 2);
        document["meshes"][0]["primitives"] = {{{"material", 0},
                                                {"attributes",
                                                 {{"POSITION", add(checkered.positions, 3)},
                                                  {"NORMAL", add(checkered.normals, 3)},
                                                  {"TEXCOORD_0", add(checkered.uvs, 2)},
                                                  {"TEXCOORD_1", add(checkered.second_uvs, 2)}}},
                                                {"indices", add(checkered.indices)}}};
        document["meshes"][1]["primitives"] = {{{"material", 1},
                                                {"attributes",
                                                 {{"POSITION", add(gold.positions, 3)},
                                                  {"NORMAL", add(gold.normals, 3)},
                                                  {"COLOR_0", add(gold.colours, 4)}}},
                                                {"indices", add(gold.indices)}}};
    }

    // As a GLB with the images in it.
    std::string glb(const std::array<std::string, 3>& images) const {
        GltfScene whole = *this;
        for (const std::string& image : images) {
            whole.document["images"].push_back(
                {{"bufferView", whole.document["bufferViews"].size()}, {"mimeType", "image/png"}});
            whole.add_view(image);
        }
        whole.document["buffers"] = {{{"byteLength", whole.data.size()}}};
        return mesh_files::glb(whole.document.dump(), whole.data);
    }

    // NAME.gltf with its data and images beside it and in a folder there.
    void write_beside(const std::filesystem::path& file, const std::array<std::string, 3>& images) const {
        GltfScene whole = *this;
        whole.document["images"] = {
            {{"uri", "a%20colour.png"}}, {{"uri", "more/surface.png"}}, {{"uri", "normals.png"}}};
        whole.document["buffers"] = {{{"byteLength", data.size()}, {"uri", "scene%20data.bin"}}};
        const std::filesystem::path folder = file.parent_path();
        std::filesystem::create_directories(folder / "more");
        write_bytes(folder / "a colour.png", images[0]);
        write_bytes(folder / "more/surface.png", images[1]);
        write_bytes(folder / "normals.png", images[2]);
        write_bytes(folder / "scene data.bin", data);
        write_bytes(file, whole.document.dump());
    }

private:
    void add_view(const std::string& bytes) {
        document["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", data.size()}, {"byteLength", bytes.size()}});
        data += bytes;
        data.resize((data.size() + 3) / 4 * 4, '\0');
    }
    template <class Value>
    std::size_t add(const std::vector<Value>& values, std::size_t components = 1) {
        std::string bytes;
        for (const Value value : values) bytes += mesh_files::little(value);
        document["accessors"].push_back({{"bufferView", document["bufferViews"].size()},
                                         {"componentType", std::is_same_v<Value, float> ? 5126 : 5125},
                                         {"count", values.size() / components},
                                         {"type", components == 1 ? "SCALAR" : "VEC" + std::to_string(components)}});
        add_view(bytes);
        return document["accessors"].size() - 1;
    }
};

// A triangle as the values of all attributes of its corners, the least first.
using Row = std::vector<float>;
using TriangleRows = std::array<Row, 3>;

// Of each component, over the vertices that triangles use.
struct ValueBox {
    Row lo, hi;

    void include(const Row& values) {
        if (lo.empty()) lo = hi = values;
        for (std::size_t k = 0; k < values.size(); ++k) {
            lo[k] = std::min(lo[k], values[k]);
            hi[k] = std::max(hi[k], values[k]);
        }
    }
};

struct GltfContents {
    json rest;                                                    // without geometry
    std::vector<std::string> images;                              // as bytes; of those beside the file, their names
    std::map<std::string, std::multiset<TriangleRows>> triangles; // by node's name and material's number
    std::map<std::string, std::set<std::string>> attributes;      // likewise
    std::map<std::string, std::map<std::string, ValueBox>> boxes; // likewise, then by attribute
};

inline TriangleRows rotated(TriangleRows t) {
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    return t;
}

inline GltfContents read_gltf(const std::filesystem::path& file) {
    std::string text = read_bytes(file), data;
    if (text.starts_with("glTF")) {
        std::uint32_t size = 0;
        std::memcpy(&size, text.data() + 12, 4);
        data = text.substr(20 + size + 8);
        text = text.substr(20, size);
    }
    GltfContents out;
    json document = json::parse(text);
    if (document["buffers"][0].contains("uri")) {
        std::string name = document["buffers"][0]["uri"];
        while (name.find("%20") != std::string::npos) name.replace(name.find("%20"), 3, " ");
        data = read_bytes(file.parent_path() / name);
    }
    const auto bytes_of = [&](std::size_t number) {
        const json& view = document["bufferViews"].at(number);
        return data.substr(view.value("byteOffset", std::size_t{0}), view["byteLength"]);
    };
    // Elements may lie apart (byteStride); normalised integers stand for 0..1, or -1..1.
    const auto values = [&]<class Value>(std::size_t number, Value) {
        const json& accessor = document["accessors"].at(number);
        const std::string type = accessor["type"];
        const std::size_t components = type == "SCALAR" ? 1 : static_cast<std::size_t>(type[3] - '0');
        const std::size_t view = accessor["bufferView"];
        const std::string bytes = bytes_of(view).substr(accessor.value("byteOffset", std::size_t{0}));
        std::vector<std::vector<Value>> rows(accessor["count"], std::vector<Value>(components));
        const auto read_as = [&]<class Stored>(Stored) {
            const std::size_t stride =
                document["bufferViews"].at(view).value("byteStride", components * sizeof(Stored));
            const bool is_share = accessor.value("normalized", false);
            for (std::size_t i = 0; i < rows.size(); ++i)
                for (std::size_t k = 0; k < components; ++k) {
                    Stored stored{};
                    std::memcpy(&stored, &bytes.at(i * stride + k * sizeof stored), sizeof stored);
                    if (is_share)
                        rows[i][k] = static_cast<Value>(static_cast<double>(stored) /
                                                        static_cast<double>(std::numeric_limits<Stored>::max()));
                    else rows[i][k] = static_cast<Value>(stored);
                }
        };
        switch (accessor["componentType"].get<int>()) {
        case 5121: read_as(std::uint8_t{}); break;
        case 5123: read_as(std::uint16_t{}); break;
        case 5125: read_as(std::uint32_t{}); break;
        case 5126: read_as(float{}); break;
        default: throw std::runtime_error("a type of components that no test writes");
        }
        return rows;
    };
    for (json& node : document["nodes"]) {
        if (!node.contains("mesh")) continue;
        for (const json& primitive : document["meshes"].at(node["mesh"].get<std::size_t>())["primitives"]) {
            const std::string key =
                node.value("name", std::string()) + " " + std::to_string(primitive.value("material", -1));
            std::vector<Row> rows;
            const auto indices = values(primitive["indices"].get<std::size_t>(), std::uint32_t{});
            for (const auto& [name, accessor] : primitive["attributes"].items()) {
                out.attributes[key].insert(name);
                const auto of_vertices = values(accessor.get<std::size_t>(), float{});
                rows.resize(of_vertices.size());
                for (std::size_t i = 0; i < rows.size(); ++i)
                    rows[i].insert(rows[i].end(), of_vertices[i].begin(), of_vertices[i].end());
                for (const auto& index : indices) out.boxes[key][name].include(of_vertices.at(index[0]));
            }
            for (std::size_t i = 0; i + 2 < indices.size(); i += 3)
                out.triangles[key].insert(
                    rotated({rows.at(indices[i][0]), rows.at(indices[i + 1][0]), rows.at(indices[i + 2][0])}));
        }
    }
    for (json& image : document["images"]) {
        out.images.push_back(image.contains("uri") ? image["uri"].get<std::string>() : bytes_of(image["bufferView"]));
        image.erase("bufferView");
    }
    for (const char* key : {"accessors", "bufferViews", "buffers"}) document.erase(key);
    document["asset"].erase("generator");
    for (json& mesh : document["meshes"])
        for (json& primitive : mesh["primitives"])
            for (const char* key : {"attributes", "indices", "mode"}) primitive.erase(key);
    out.rest = std::move(document);
    return out;
}

} // namespace unseen::support
