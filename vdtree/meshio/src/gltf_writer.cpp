#include "gltf_writer.h"

#include <algorithm>
#include <bit>
#include <cctype>
#include <limits>
#include <string>

#include "file_output.h"

namespace unseen::meshio {

namespace fs = std::filesystem;
using nlohmann::json;
using vdtree::AtomicFile;
using vdtree::Triangle;

namespace {

constexpr int array_buffer = 34962, element_array_buffer = 34963, no_target = 0;
constexpr int float_component = 5126, unsigned_int_component = 5125, triangles_mode = 4;

constexpr std::uint64_t aligned(std::uint64_t bytes) { return (bytes + 3) / 4 * 4; }

template <class Value>
std::string_view bytes_of(std::span<const Value> values) {
    return {reinterpret_cast<const char*>(values.data()), values.size_bytes()};
}

} // namespace

std::size_t GltfFile::add_view(std::string_view bytes, std::size_t component_bytes, int target) {
    views_.push_back({{"buffer", 0}, {"byteOffset", bytes_}, {"byteLength", bytes.size()}});
    if (target != no_target) views_.back()["target"] = target;
    pieces_.push_back({bytes, component_bytes});
    bytes_ += aligned(bytes.size());
    return views_.size() - 1;
}

std::size_t GltfFile::add_vectors(std::span<const float> values, std::size_t components) {
    const std::size_t view = add_view(bytes_of(values), sizeof(float), array_buffer);
    accessors_.push_back({{"bufferView", view},
                          {"componentType", float_component},
                          {"count", values.size() / components},
                          {"type", components == 1 ? "SCALAR" : "VEC" + std::to_string(components)}});
    return accessors_.size() - 1;
}

// The only accessor whose bounds glTF wants.
std::size_t GltfFile::add_positions(std::span<const glm::vec3> positions) {
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
    document["asset"]["version"] = "2.0";
    document["asset"]["generator"] = "Unseen";
    document["accessors"] = accessors_;
    document["bufferViews"] = views_;
    json buffer = {{"byteLength", bytes_}};
    const bool is_binary = lower_ending(file) == ".glb";
    const fs::path data = fs::path(file).replace_extension(".bin");
    if (!is_binary) buffer["uri"] = to_uri(data.filename());
    document["buffers"] = json::array({buffer});
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
