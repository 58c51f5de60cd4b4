// Mesh files as strings, put together byte by byte.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace mesh_files {

template <class Value>
std::string bytes(Value value, std::endian order) {
    auto raw = std::bit_cast<std::array<char, sizeof(Value)>>(value);
    if (order != std::endian::native) std::reverse(raw.begin(), raw.end());
    return {raw.data(), raw.size()};
}
template <class Value>
std::string little(Value value) {
    return bytes(value, std::endian::little);
}
template <class... Values>
std::string floats(Values... values) {
    return (little(static_cast<float>(values)) + ...);
}

// One quad, 0 0 0 - 1 0 0 - 1 1 0 - 0 1 0, as four vertices and a face of four corners.
inline std::string binary_ply_quad(std::endian order) {
    std::string file = std::string("ply\nformat binary_") + (order == std::endian::little ? "little" : "big") +
                       "_endian 1.0\nelement vertex 4\nproperty float x\nproperty double y\nproperty short z\n"
                       "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    const int corners[4][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    for (const auto& c : corners) {
        file += bytes(static_cast<float>(c[0]), order) + bytes(static_cast<double>(c[1]), order) +
                bytes(static_cast<std::int16_t>(c[2]), order);
    }
    file += '\4';
    for (std::int32_t i = 0; i < 4; ++i) file += bytes(i, order);
    return file;
}

inline std::string ascii_ply_quad() {
    return "ply\nformat ascii 1.0\ncomment a quad\nelement vertex 4\nproperty float x\nproperty float y\n"
           "property float z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n"
           "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
}

inline std::string binary_stl_facet(std::string header = "a facet") {
    header.resize(80, ' ');
    return header + little(std::uint32_t{1}) + floats(0, 0, 1) + floats(0, 0, 0) + floats(1, 0, 0) + floats(0, 1, 0) +
           std::string(2, '\0');
}

inline std::string ascii_stl_facet() {
    return "solid part one\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
           "endfacet\nendsolid part one\n";
}

inline std::string obj_quad() {
    return "o quad\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nusemtl red\n"
           "f 1/1/1 2/2/1 3/3/1 4/4/1\n";
}

inline std::string off_quad() { return "OFF\n# a quad\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 255 0 0\n"; }

inline std::string glb(std::string json, std::string bin) {
    json.resize((json.size() + 3) / 4 * 4, ' ');
    bin.resize((bin.size() + 3) / 4 * 4, '\0');
    const auto size = [](std::size_t n) { return little(static_cast<std::uint32_t>(n)); };
    std::string chunks = size(json.size()) + "JSON" + json;
    if (!bin.empty()) chunks += size(bin.size()) + std::string("BIN\0", 4) + bin;
    return "glTF" + little(std::uint32_t{2}) + size(12 + chunks.size()) + chunks;
}

// Three positions (36 bytes), three indices of 16 bits (6 bytes).
inline std::string gltf_triangle_data() {
    std::string data = floats(0, 0, 0) + floats(1, 0, 0) + floats(0, 1, 0);
    for (std::uint16_t i = 0; i < 3; ++i) data += little(i);
    return data;
}

// A triangle under the given nodes and scenes; `buffer` describes where its 42 bytes lie.
inline std::string gltf_triangle_json(const std::string& nodes = R"([{"mesh":0}])",
                                      const std::string& buffer = R"({"byteLength":42})",
                                      const std::string& extra = "") {
    return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":)" + nodes +
           R"(,"meshes":[{"name":"tri","primitives":[{"attributes":{"POSITION":0},"indices":1}]}],"accessors":[)"
           R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},)"
           R"({"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],"bufferViews":[)"
           R"({"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],"buffers":[)" +
           buffer + "]" + extra + "}";
}

inline std::string glb_triangle() { return glb(gltf_triangle_json(), gltf_triangle_data()); }

// One small valid file of every kind: name and bytes.
inline std::vector<std::pair<std::string, std::string>> samples() {
    return {{"ascii.ply", ascii_ply_quad()},
            {"little.ply", binary_ply_quad(std::endian::little)},
            {"big.ply", binary_ply_quad(std::endian::big)},
            {"quad.obj", obj_quad()},
            {"quad.off", off_quad()},
            {"ascii.stl", ascii_stl_facet()},
            {"binary.stl", binary_stl_facet()},
            {"triangle.glb", glb_triangle()}};
}

} // namespace mesh_files
