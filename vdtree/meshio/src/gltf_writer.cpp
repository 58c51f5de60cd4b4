#include "gltf_writer.h"

#include <cstring>
#include <system_error>

#include <glm/common.hpp>

#ifdef UNSEEN_MESHIO_WITH_MESHOPTIMIZER
#include <meshoptimizer.h>
#endif

#include "gltf_data.h"
#include "mesh_writers.h"

namespace unseen::meshio {

namespace fs = std::filesystem;
using nlohmann::json;
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
    std::memcpy(bytes.data() + at, &number, sizeof number);
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
std::size_t GltfFile::add_view(std::string_view bytes, int target, std::size_t stride) {
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
    }
    if (stride > 0) view["byteStride"] = stride;
    views_.push_back(std::move(view));
    pieces_.push_back(bytes);
    bytes_ += aligned(bytes.size());
    return views_.size() - 1;
}

std::size_t GltfFile::add_accessor(std::size_t view, int component_type, std::size_t count, const std::string& type) {
    accessors_.push_back({{"bufferView", view}, {"componentType", component_type}, {"count", count}, {"type", type}});
    return accessors_.size() - 1;
}

std::size_t GltfFile::add_vectors(std::span<const float> values, std::size_t components) {
    const std::size_t view =
        add_view(bytes_of(values), array_buffer, options_.meshopt ? components * sizeof(float) : 0);
    return add_accessor(view, float_component, values.size() / components,
                        components == 1 ? "SCALAR" : text_of("VEC", components));
}

std::size_t GltfFile::add_packed(std::string bytes, std::size_t stride, std::size_t components, int component_type,
                                 bool normalized) {
    const std::string_view packed = packed_.emplace_back(std::move(bytes));
    const std::size_t accessor = add_accessor(add_view(packed, array_buffer, stride), component_type,
                                              packed.size() / stride, text_of("VEC", components));
    if (normalized) accessors_[accessor]["normalized"] = true;
    is_quantized_ = true;
    return accessor;
}

GltfGrid GltfFile::grid_for(glm::vec3 low, glm::vec3 high) const {
    GltfGrid grid;
    if (!options_.quantize) return grid;
    const glm::dvec3 size = glm::dvec3(high) - glm::dvec3(low);
    const double extent = std::max({size.x, size.y, size.z});
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
    glm::dvec3 low(std::numeric_limits<double>::infinity()), high = -low;
    std::size_t accessor = 0;
    if (grid.is_used()) {
        constexpr std::size_t stride = 8; // three of 16 bits, in fours of bytes
        std::string bytes(positions.size() * stride, '\0');
        for (std::size_t i = 0; i < positions.size(); ++i) {
            const glm::dvec3 place = (glm::dvec3(positions[i]) - grid.origin) / grid.step;
            const glm::dvec3 number = glm::clamp(glm::round(place), 0.0, grid_steps);
            for (int k = 0; k < 3; ++k)
                put<std::uint16_t>(bytes, i * stride + 2 * static_cast<std::size_t>(k), number[k]);
            low = glm::min(low, number), high = glm::max(high, number);
        }
        accessor = add_packed(std::move(bytes), stride, 3, unsigned_short_component, false);
    } else {
        for (const glm::vec3& p : positions) low = glm::min(low, glm::dvec3(p)), high = glm::max(high, glm::dvec3(p));
        accessor = add_vectors(floats_of(positions), 3);
    }
    const auto bounds = [&](const glm::dvec3& of) {
        if (grid.is_used()) return json{static_cast<int>(of.x), static_cast<int>(of.y), static_cast<int>(of.z)};
        return json{static_cast<float>(of.x), static_cast<float>(of.y), static_cast<float>(of.z)};
    };
    accessors_[accessor]["min"] = bounds(low);
    accessors_[accessor]["max"] = bounds(high);
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
    return add_view(bytes_of(triangles), element_array_buffer);
}

std::size_t GltfFile::add_bytes(std::string_view bytes) { return add_view(bytes, no_target); }

json GltfFile::primitive(const json& attributes, std::size_t index_view, std::uint64_t first_triangle,
                         std::uint64_t count) {
    const std::size_t indices = add_accessor(index_view, unsigned_int_component, count * 3, "SCALAR");
    accessors_[indices]["byteOffset"] = first_triangle * sizeof(Triangle);
    return {{"attributes", attributes}, {"indices", indices}, {"mode", triangles_mode}};
}

Result<void> GltfFile::write_data(const fs::path& file, std::string_view before) const {
    return write_file(file, [&](FileOutput& out) {
        out.text(before);
        for (const std::string_view piece : pieces_) {
            out.text(piece);
            out.text(std::string(aligned(piece.size()) - piece.size(), '\0'));
        }
    });
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
        return write_file(file, [&](FileOutput& out) { out.text(text); });
    }
    text.resize(aligned(text.size()), ' ');
    constexpr std::uint64_t headers = 12 + 8 + 8;
    const std::uint64_t total = headers + text.size() + bytes_;
    if (total > std::numeric_limits<std::uint32_t>::max()) {
        return Error{ErrorCode::unsupported,
                     "Cannot write '" + file.string() + "': it would exceed the 4 GiB of a GLB file; write PLY."};
    }
    const auto word = [](std::uint64_t value) {
        std::string bytes(4, '\0');
        std::memcpy(bytes.data(), &value, bytes.size());
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
