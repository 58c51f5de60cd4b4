#include "gltf_writer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#ifdef UNSEEN_MESHIO_WITH_MESHOPTIMIZER
#include <meshoptimizer.h>
#endif

#include "file_output.h"
#include "gltf_data.h"

namespace unseen::meshio {

namespace fs = std::filesystem;
using nlohmann::json;
using vdtree::AtomicFile;
using vdtree::Triangle;

namespace {

constexpr int array_buffer = 34962, element_array_buffer = 34963, no_target = 0;
constexpr int float_component = 5126, unsigned_int_component = 5125, triangles_mode = 4;
constexpr int short_component = 5122, unsigned_short_component = 5123;
constexpr double grid_steps = 65535; // of 16 bits

constexpr std::uint64_t aligned(std::uint64_t bytes) { return (bytes + 3) / 4 * 4; }

template <class Value>
std::string_view bytes_of(std::span<const Value> values) {
    return {reinterpret_cast<const char*>(values.data()), values.size_bytes()};
}

#ifdef UNSEEN_MESHIO_WITH_MESHOPTIMIZER
std::string compressed_vertices(std::string_view bytes, std::size_t stride) {
    const std::size_t count = bytes.size() / stride;
    std::string out(meshopt_encodeVertexBufferBound(count, stride), '\0');
    out.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(out.data()), out.size(), bytes.data(), count,
                                          stride));
    return out;
}

std::string compressed_indices(std::string_view bytes) {
    std::vector<unsigned> indices(bytes.size() / sizeof(unsigned));
    std::memcpy(indices.data(), bytes.data(), bytes.size());
    const unsigned most = indices.empty() ? 0 : *std::max_element(indices.begin(), indices.end());
    meshopt_encodeIndexVersion(1); // that of the extension
    std::string out(meshopt_encodeIndexBufferBound(indices.size(), std::size_t{most} + 1), '\0');
    out.resize(meshopt_encodeIndexBuffer(reinterpret_cast<unsigned char*>(out.data()), out.size(), indices.data(),
                                         indices.size()));
    return out;
}
#else
std::string compressed_vertices(std::string_view, std::size_t) { return {}; }
std::string compressed_indices(std::string_view) { return {}; }
#endif

template <class Number>
void put(std::string& bytes, std::size_t at, double value) {
    constexpr double low = std::numeric_limits<Number>::lowest(), high = std::numeric_limits<Number>::max();
    const auto number = static_cast<Number>(std::lround(std::clamp(value, low, high)));
    for (std::size_t i = 0; i < sizeof(Number); ++i) // little-endian
        bytes[at + i] = static_cast<char>(static_cast<std::uint64_t>(number) >> (8 * i) & 0xFF);
}

} // namespace

#ifdef UNSEEN_MESHIO_WITH_MESHOPTIMIZER
bool has_meshoptimizer() noexcept { return true; }

GltfOrder optimized(std::span<const Triangle> triangles, std::size_t vertices) {
    GltfOrder order;
    order.triangles.resize(triangles.size());
    if (triangles.empty()) return order;
    auto* const indices = order.triangles[0].data();
    const std::size_t corners = 3 * triangles.size();
    meshopt_optimizeVertexCache(indices, triangles[0].data(), corners, vertices);
    std::vector<unsigned> remap(vertices);
    const std::size_t used = meshopt_optimizeVertexFetchRemap(remap.data(), indices, corners, vertices);
    meshopt_remapIndexBuffer(indices, indices, corners, remap.data());
    order.vertices.resize(used);
    for (std::size_t v = 0; v < vertices; ++v)
        if (remap[v] != ~0u) order.vertices[remap[v]] = static_cast<vdtree::Index>(v);
    return order;
}
#else
bool has_meshoptimizer() noexcept { return false; }

GltfOrder optimized(std::span<const Triangle> triangles, std::size_t vertices) {
    GltfOrder order;
    order.triangles.assign(triangles.begin(), triangles.end());
    for (std::size_t v = 0; v < vertices; ++v) order.vertices.push_back(static_cast<vdtree::Index>(v));
    return order;
}
#endif

// With a stride: vertices, which may be compressed.
std::size_t GltfFile::add_view(std::string_view bytes, std::size_t component_bytes, int target, std::size_t stride) {
    json view = {{"buffer", 0}, {"byteOffset", bytes_}, {"byteLength", bytes.size()}};
    if (target != no_target) view["target"] = target;
    if (options_.meshopt && target != no_target) {
        const bool is_index = target == element_array_buffer;
        packed_.push_back(is_index ? compressed_indices(bytes) : compressed_vertices(bytes, stride));
        const std::size_t element = is_index ? sizeof(vdtree::Index) : stride;
        view["extensions"][gltf::meshopt_extension] = {{"buffer", 0},
                                                       {"byteOffset", bytes_},
                                                       {"byteLength", packed_.back().size()},
                                                       {"byteStride", element},
                                                       {"count", bytes.size() / element},
                                                       {"mode", is_index ? "TRIANGLES" : "ATTRIBUTES"}};
        // Where the bytes would lie for readers that do not know the extension.
        view["buffer"] = 1;
        view["byteOffset"] = unpacked_bytes_;
        unpacked_bytes_ += aligned(bytes.size());
        bytes = packed_.back();
        component_bytes = 1;
    }
    if (stride > 0) view["byteStride"] = stride;
    views_.push_back(std::move(view));
    pieces_.push_back({bytes, component_bytes});
    bytes_ += aligned(bytes.size());
    return views_.size() - 1;
}

std::size_t GltfFile::add_vectors(std::span<const float> values, std::size_t components) {
    const std::size_t view =
        add_view(bytes_of(values), sizeof(float), array_buffer, options_.meshopt ? components * sizeof(float) : 0);
    accessors_.push_back({{"bufferView", view},
                          {"componentType", float_component},
                          {"count", values.size() / components},
                          {"type", components == 1 ? "SCALAR" : "VEC" + std::to_string(components)}});
    return accessors_.size() - 1;
}

std::size_t GltfFile::add_packed(std::string bytes, std::size_t stride, std::size_t components, int component_type,
                                 bool normalized) {
    packed_.push_back(std::move(bytes));
    const std::string_view packed = packed_.back();
    const std::size_t view = add_view(packed, 1, array_buffer, stride);
    accessors_.push_back({{"bufferView", view},
                          {"componentType", component_type},
                          {"count", packed.size() / stride},
                          {"type", "VEC" + std::to_string(components)}});
    if (normalized) accessors_.back()["normalized"] = true;
    is_quantized_ = true;
    return accessors_.size() - 1;
}

GltfGrid GltfFile::grid_for(glm::vec3 low, glm::vec3 high) const {
    GltfGrid grid;
    if (!options_.quantize) return grid;
    double extent = 0;
    for (int axis = 0; axis < 3; ++axis)
        extent = std::max(extent, static_cast<double>(high[axis]) - static_cast<double>(low[axis]));
    grid.origin = glm::dvec3(low);
    const double step = extent / grid_steps;
    if (std::isfinite(1 / step)) grid.step = step;
    return grid;
}

json GltfFile::transform_of(const GltfGrid& grid) {
    return {{"translation", {grid.origin.x, grid.origin.y, grid.origin.z}},
            {"scale", {grid.step, grid.step, grid.step}}};
}

// The only accessor whose bounds glTF wants.
std::size_t GltfFile::add_positions(std::span<const glm::vec3> positions, const GltfGrid& grid) {
    if (grid.is_used()) {
        constexpr std::size_t stride = 8; // three of 16 bits, in fours of bytes
        std::string bytes(positions.size() * stride, '\0');
        std::array<double, 3> low, high;
        low.fill(grid_steps), high.fill(0);
        for (std::size_t i = 0; i < positions.size(); ++i)
            for (int axis = 0; axis < 3; ++axis) {
                const auto k = static_cast<std::size_t>(axis);
                const double place = (static_cast<double>(positions[i][axis]) - grid.origin[axis]) / grid.step;
                const double number = std::clamp(std::round(place), 0.0, grid_steps);
                put<std::uint16_t>(bytes, i * stride + 2 * k, number);
                low[k] = std::min(low[k], number), high[k] = std::max(high[k], number);
            }
        const std::size_t accessor = add_packed(std::move(bytes), stride, 3, unsigned_short_component, false);
        for (std::size_t k = 0; k < 3; ++k) {
            accessors_[accessor]["min"].push_back(static_cast<int>(low[k]));
            accessors_[accessor]["max"].push_back(static_cast<int>(high[k]));
        }
        return accessor;
    }
    glm::vec3 low = positions[0], high = low;
    for (const glm::vec3& p : positions) {
        for (int axis = 0; axis < 3; ++axis) {
            low[axis] = std::min(low[axis], p[axis]);
            high[axis] = std::max(high[axis], p[axis]);
        }
    }
    const std::size_t accessor = add_vectors(floats_of(positions), 3);
    accessors_[accessor]["min"] = {low.x, low.y, low.z};
    accessors_[accessor]["max"] = {high.x, high.y, high.z};
    return accessor;
}

std::size_t GltfFile::add_attribute(const std::string& name, std::span<const float> values, std::size_t components) {
    const bool is_direction = name == "NORMAL";
    const bool is_share = name.starts_with("TEXCOORD_") || name.starts_with("COLOR_");
    // What lies outside of 0..1, such as a texture that repeats, stays as it is.
    const bool fits =
        std::all_of(values.begin(), values.end(), [&](float v) { return v <= 1 && v >= (is_direction ? -1.F : 0.F); });
    if (!options_.quantize || !fits || components < 2 || !(is_direction || is_share))
        return add_vectors(values, components);
    const std::size_t stride = aligned(2 * components), count = values.size() / components;
    std::string bytes(count * stride, '\0');
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t k = 0; k < components; ++k) {
            const auto value = static_cast<double>(values[i * components + k]);
            if (is_direction) put<std::int16_t>(bytes, i * stride + 2 * k, value * 32767);
            else put<std::uint16_t>(bytes, i * stride + 2 * k, value * 65535);
        }
    return add_packed(std::move(bytes), stride, components, is_direction ? short_component : unsigned_short_component,
                      true);
}

std::size_t GltfFile::add_indices(std::span<const Triangle> triangles) {
    return add_view(bytes_of(triangles), sizeof(vdtree::Index), element_array_buffer);
}

std::size_t GltfFile::add_bytes(std::string_view bytes) { return add_view(bytes, 1, no_target); }

json GltfFile::primitive(const json& attributes, std::size_t index_view, std::uint64_t first_triangle,
                         std::uint64_t count) {
    accessors_.push_back({{"bufferView", index_view},
                          {"byteOffset", first_triangle * sizeof(Triangle)},
                          {"componentType", unsigned_int_component},
                          {"count", count * 3},
                          {"type", "SCALAR"}});
    return {{"attributes", attributes}, {"indices", accessors_.size() - 1}, {"mode", triangles_mode}};
}

Result<void> GltfFile::write_data(const fs::path& file, std::string_view before) const {
    Result<AtomicFile> target = AtomicFile::create(file);
    if (!target) return target.error();
    FileOutput out(std::move(*target));
    out.text(before);
    for (const Piece& piece : pieces_) {
        if (std::endian::native == std::endian::little || piece.component_bytes == 1) {
            out.text(piece.bytes);
        } else {
            for (std::size_t i = 0; i < piece.bytes.size(); i += piece.component_bytes)
                for (std::size_t k = piece.component_bytes; k-- > 0;) out.text(piece.bytes.substr(i + k, 1));
        }
        out.text(std::string(aligned(piece.bytes.size()) - piece.bytes.size(), '\0'));
    }
    return out.finish();
}

Result<void> GltfFile::write(const fs::path& file, json document) const {
    if (options_.meshopt && !has_meshoptimizer())
        return Error{ErrorCode::unsupported,
                     "Cannot write '" + file.string() +
                         "' compressed: this build is without the library meshoptimizer; install libmeshoptimizer-dev "
                         "and build again, or write it without compression."};
    document["asset"]["version"] = "2.0";
    document["asset"]["generator"] = "Unseen";
    document["accessors"] = accessors_;
    document["bufferViews"] = views_;
    json buffer = {{"byteLength", bytes_}};
    const bool is_binary = lower_ending(file) == ".glb";
    const fs::path data = fs::path(file).replace_extension(".bin");
    if (!is_binary) buffer["uri"] = to_uri(data.filename());
    document["buffers"] = json::array({buffer});
    const auto require = [&](const char* extension) {
        for (const char* list : {"extensionsUsed", "extensionsRequired"}) {
            json& names = document[list];
            if (std::find(names.begin(), names.end(), extension) == names.end()) names.push_back(extension);
        }
    };
    if (is_quantized_) require("KHR_mesh_quantization");
    if (options_.meshopt) {
        require(gltf::meshopt_extension);
        document["buffers"].push_back(
            {{"byteLength", unpacked_bytes_}, {"extensions", {{gltf::meshopt_extension, {{"fallback", true}}}}}});
    }
    std::string text = document.dump(is_binary ? -1 : 1, ' ', false, json::error_handler_t::replace);
    if (!is_binary) {
        std::error_code unknown;
        if (fs::exists(data, unknown) && !fs::exists(file, unknown))
            return Error{ErrorCode::io_failure, "Cannot write '" + data.string() +
                                                    "': it is there already and belongs to something else; choose "
                                                    "another name."};
        if (const Result<void> written = write_data(data, {}); !written) return written;
        Result<AtomicFile> target = AtomicFile::create(file);
        if (!target) return target.error();
        FileOutput out(std::move(*target));
        out.text(text);
        return out.finish();
    }
    text.resize(aligned(text.size()), ' ');
    constexpr std::uint64_t headers = 12 + 8 + 8;
    const std::uint64_t total = headers + text.size() + bytes_;
    if (total > std::numeric_limits<std::uint32_t>::max()) {
        return Error{ErrorCode::unsupported,
                     "Cannot write '" + file.string() + "': it would exceed the 4 GiB of a GLB file; write PLY."};
    }
    const auto word = [](std::uint64_t value) {
        std::string bytes;
        for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xFF);
        return bytes;
    };
    return write_data(file, "glTF" + word(2) + word(total) + word(text.size()) + "JSON" + text + word(bytes_) +
                                std::string("BIN\0", 4));
}

std::string to_uri(const fs::path& path) {
    constexpr std::string_view digits = "0123456789ABCDEF";
    std::string uri;
    for (const char c : path.generic_string()) {
        const auto code = static_cast<unsigned char>(c);
        if (std::isalnum(code) || std::string_view("-._~/").find(c) != std::string_view::npos) uri += c;
        else uri += {'%', digits[code / 16], digits[code % 16]};
    }
    return uri;
}

} // namespace unseen::meshio
