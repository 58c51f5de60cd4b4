#include "gltf_data.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <utility>

#include "text_scanner.h"

namespace unseen::meshio::gltf {

namespace fs = std::filesystem;

// ---- buffers ----

namespace {

std::optional<std::string> decode_base64(std::string_view text) {
    while (text.ends_with('=')) text.remove_suffix(1);
    std::string bytes;
    bytes.reserve(text.size() / 4 * 3 + 3);
    unsigned bits = 0;
    int bit_count = 0;
    for (const char c : text) {
        const int value = base64_value(c);
        if (value < 0) return std::nullopt;
        bits = (bits << 6 | static_cast<unsigned>(value)) & 0xFFFFFF;
        bit_count += 6;
        if (bit_count >= 8) {
            bit_count -= 8;
            bytes += static_cast<char>(bits >> bit_count & 0xFF);
        }
    }
    return bytes;
}

bool is_data(std::string_view uri) { return uri.starts_with("data:"); }

// Of views that are compressed: stands for what they hold uncompressed, and may have no data.
bool is_fallback(const json& buffer) {
    const json* extensions = member(buffer, "extensions");
    const json* extension = extensions && extensions->is_object() ? member(*extensions, meshopt_extension) : nullptr;
    const json* fallback = extension && extension->is_object() ? member(*extension, "fallback") : nullptr;
    return fallback != nullptr && *fallback == true;
}

} // namespace

Buffers::Buffers(const MeshSource& source, const json& document, std::optional<std::string_view> bin)
    : source_(source) {
    const json& array = array_of(document, "buffers");
    const auto size_of = [&](std::size_t i) {
        const std::string where = numbered("buffer", i);
        if (!array[i].is_object()) fail(where, " is no object; correct the JSON.");
        const json* length = member(array[i], "byteLength");
        if (length == nullptr) fail(where, " has no byteLength; correct the JSON.");
        return static_cast<std::size_t>(to_integer_in_range(*length, max_size, where + ": byteLength"));
    };
    const auto uri_of = [&](std::size_t i) {
        const json* uri = member(array[i], "uri");
        return uri != nullptr && uri->is_string() ? &uri->get_ref<const std::string&>() : nullptr;
    };
    for (std::size_t i = 0; i < array.size(); ++i) { // the same file in several spellings is read once
        const std::size_t size = size_of(i);
        if (const std::string* uri = uri_of(i); uri != nullptr && !is_data(*uri)) {
            External& file = external_[place_of(*uri, numbered("buffer", i))];
            file.wanted = std::max(file.wanted, size);
        }
    }
    for (std::size_t i = 0; i < array.size(); ++i) {
        const std::string where = numbered("buffer", i);
        const std::size_t size = size_of(i);
        const std::string* uri = uri_of(i);
        std::string_view bytes;
        if (uri != nullptr) bytes = resolve(*uri, where);
        else if (i == 0 && bin) bytes = *bin;
        else if (is_fallback(array[i])) {
            buffers_.emplace_back();
            continue;
        } else if (const json* extensions = member(array[i], "extensions");
                   extensions && !extensions->empty() && extensions->is_object())
            fail(where, " has no data but by the extension ", in_quotes(extensions->begin().key()),
                 ", which is not read; export it without.");
        else fail(where, " names no file and has no data of its own; correct the JSON.");
        if (size > bytes.size())
            fail(where, " claims ", size, " bytes, but there are ", bytes.size(), "; the data are cut short.");
        buffers_.push_back(bytes.substr(0, size));
    }
}

std::size_t Buffers::add(std::string bytes) {
    buffers_.push_back(added_.emplace_back(std::move(bytes)));
    return buffers_.size() - 1;
}

std::string Buffers::decode_data(std::string_view uri, const std::string& where) {
    const std::size_t comma = uri.find(',');
    if (comma == std::string_view::npos || !uri.substr(0, comma).ends_with(";base64"))
        fail(where, " has a data URI that is not in base64; correct it.");
    std::optional<std::string> bytes = decode_base64(uri.substr(comma + 1));
    if (!bytes) fail(where, " has a data URI with characters that are not base64; correct it.");
    return std::move(*bytes);
}

fs::path Buffers::below_folder(const std::string& uri, const std::string& where) {
    const auto path = path_beside(decode_percent(uri));
    if (!path) fail(where, " is ", in_quotes(uri), ", and only files beside the mesh are read; move it there.");
    return *path;
}

std::string_view Buffers::resolve(const std::string& uri, const std::string& where) {
    if (is_data(uri)) {
        const auto [found, is_new] = decoded_.try_emplace(uri);
        if (is_new) found->second = decode_data(uri, where);
        return found->second;
    }
    External& file = external_[place_of(uri, where)];
    if (!file.bytes) {
        file.bytes = read_beside(uri, where, file.wanted);
        external_bytes_ += file.bytes->size();
        if (external_bytes_ > machine_memory())
            fail("its buffers need more memory than this machine has; split the scene.");
    }
    return *file.bytes;
}

fs::path Buffers::place_of(const std::string& uri, const std::string& where) const {
    std::error_code unknown;
    const fs::path file = source_.folder / below_folder(uri, where), real = fs::weakly_canonical(file, unknown);
    return unknown ? file : real;
}

// Only files in the mesh file's folder and below: a mesh must not be able to name any file of the machine.
std::string Buffers::read_beside(const std::string& uri, const std::string& where, std::uint64_t most_bytes) const {
    const fs::path relative = below_folder(uri, where);
    if (source_.folder.empty()) fail(where, " lies in another file, which a mesh in memory cannot have.");
    Result<std::string> bytes = read_regular_file(source_.folder / relative, most_bytes);
    if (!bytes) fail(where, ": ", bytes.error().message);
    return std::move(*bytes);
}

// ---- accessors ----

namespace {

std::size_t component_bytes(int type) {
    switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE: return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT: return 4;
    default: return 0;
    }
}

template <class Stored>
Stored stored_at(const char* bytes) {
    std::array<char, sizeof(Stored)> raw;
    std::memcpy(raw.data(), bytes, sizeof(Stored));
    if constexpr (std::endian::native == std::endian::big) std::reverse(raw.begin(), raw.end());
    return std::bit_cast<Stored>(raw);
}

template <class Stored>
double scaled_at(const char* bytes, bool is_normalized) {
    const double value = static_cast<double>(stored_at<Stored>(bytes));
    // glTF 2.0, 3.6.2.2: the most negative integer stands for -1 as well.
    return is_normalized ? std::max(value / static_cast<double>(std::numeric_limits<Stored>::max()), -1.0) : value;
}

double component_at(const char* bytes, int type, bool is_normalized) {
    switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE: return scaled_at<std::int8_t>(bytes, is_normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE: return scaled_at<std::uint8_t>(bytes, is_normalized);
    case TINYGLTF_COMPONENT_TYPE_SHORT: return scaled_at<std::int16_t>(bytes, is_normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: return scaled_at<std::uint16_t>(bytes, is_normalized);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT: return static_cast<double>(stored_at<std::uint32_t>(bytes));
    default: return static_cast<double>(stored_at<float>(bytes));
    }
}

bool is_index_type(int type) {
    return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE || type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
           type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

Index index_at(const char* row, int type) { return static_cast<Index>(component_at(row, type, false)); }

std::size_t component_size_of(int type, const std::string& where) {
    const std::size_t size = component_bytes(type);
    if (size == 0) fail(where, " has the unknown component type ", type, "; correct the JSON.");
    return size;
}

} // namespace

// Rows of bytes that are known to lie inside a buffer.
struct Accessors::Rows {
    const char* first = nullptr;
    std::size_t stride = 0;
    std::size_t count = 0;
    const char* operator[](std::size_t i) const { return first + i * stride; }
};

const tinygltf::Accessor& Accessors::accessor(int index) const {
    if (index < 0 || static_cast<std::size_t>(index) >= model_.accessors.size())
        fail("accessor ", index, " is used, but there are ", model_.accessors.size(), "; correct the JSON.");
    return model_.accessors[static_cast<std::size_t>(index)];
}

Accessors::Rows Accessors::rows_of(int view_index, std::size_t offset, std::size_t count, std::size_t size,
                                   const std::string& where) const {
    if (static_cast<std::size_t>(view_index) >= model_.bufferViews.size())
        fail(where, " uses buffer view ", view_index, ", but there are ", model_.bufferViews.size(),
             "; correct the JSON.");
    const tinygltf::BufferView& view = model_.bufferViews[static_cast<std::size_t>(view_index)];
    if (static_cast<std::size_t>(view.buffer) >= buffers_.count())
        fail(numbered("buffer view", static_cast<std::size_t>(view_index)), " uses buffer ", view.buffer,
             ", but there are ", buffers_.count(), "; correct the JSON.");
    const std::string_view bytes = buffers_[static_cast<std::size_t>(view.buffer)];
    if (view.byteOffset > bytes.size() || view.byteLength > bytes.size() - view.byteOffset)
        fail(numbered("buffer view", static_cast<std::size_t>(view_index)),
             " ends behind its buffer; the data are cut short or the JSON is wrong.");
    const std::size_t stride = view.byteStride == 0 ? size : view.byteStride;
    if (stride < size) fail(where, " has a stride smaller than its elements; correct the JSON.");
    const std::size_t room = view.byteLength - std::min(offset, view.byteLength);
    const bool fits = count == 0 || (room >= size && count - 1 <= (room - size) / stride);
    if (!fits) fail(where, " ends behind its buffer view; the data are cut short or the JSON is wrong.");
    if (count == 0) return {};
    return {bytes.data() + view.byteOffset + offset, stride, count};
}

template <class Put>
void Accessors::for_each_sparse(const tinygltf::Accessor& a, std::size_t size, const std::string& where,
                                Put&& put) const {
    const int index_type = a.sparse.indices.componentType;
    if (!is_index_type(index_type)) fail(where, " has sparse indices of a wrong type; correct the JSON.");
    const auto count = static_cast<std::size_t>(a.sparse.count);
    if (count > a.count) fail(where, " replaces more elements than it has; correct its sparse count.");
    const Rows at = rows_of(a.sparse.indices.bufferView, static_cast<std::size_t>(a.sparse.indices.byteOffset), count,
                            component_bytes(index_type), where);
    const Rows values =
        rows_of(a.sparse.values.bufferView, static_cast<std::size_t>(a.sparse.values.byteOffset), count, size, where);
    for (std::size_t i = 0; i < count; ++i) {
        const Index target = index_at(at[i], index_type);
        if (target >= a.count)
            fail(where, " replaces element ", target, " of ", a.count, "; correct its sparse indices.");
        put(target, values[i]);
    }
}

int Accessors::components_of(int index) const {
    switch (accessor(index).type) {
    case TINYGLTF_TYPE_VEC2: return 2;
    case TINYGLTF_TYPE_VEC3: return 3;
    case TINYGLTF_TYPE_VEC4: return 4;
    default: return 0;
    }
}

std::vector<glm::dvec4> Accessors::vectors(int index, int components, const char* use) const {
    const tinygltf::Accessor& a = accessor(index);
    const std::string where = numbered("accessor", static_cast<std::size_t>(index));
    const int found = components_of(index);
    const bool fits = components == 0 ? found == 3 || found == 4 : found == components;
    if (!fits) fail(where, " has the wrong type for ", use, "; correct the JSON.");
    const std::size_t component_size = component_size_of(a.componentType, where);
    const std::size_t size = static_cast<std::size_t>(found) * component_size;

    if (a.bufferView < 0 && !a.sparse.isSparse) fail(where, " has no bufferView; correct the JSON.");
    const Rows rows = a.bufferView < 0 ? Rows{} : rows_of(a.bufferView, a.byteOffset, a.count, size, where);
    std::vector<glm::dvec4> values(a.count, glm::dvec4(0.0, 0.0, 0.0, 1.0));
    const auto decode = [&](const char* row, glm::dvec4& value) {
        for (int i = 0; i < found; ++i)
            value[i] = component_at(row + static_cast<std::size_t>(i) * component_size, a.componentType, a.normalized);
    };
    for (std::size_t i = 0; i < rows.count; ++i) decode(rows[i], values[i]);
    if (a.sparse.isSparse)
        for_each_sparse(a, size, where, [&](std::size_t at, const char* row) { decode(row, values[at]); });
    return values;
}

std::vector<Index> Accessors::indices(int index) const {
    const tinygltf::Accessor& a = accessor(index);
    const std::string where = numbered("accessor", static_cast<std::size_t>(index));
    if (a.type != TINYGLTF_TYPE_SCALAR || !is_index_type(a.componentType) || a.bufferView < 0)
        fail(where, " cannot hold indices: they are unsigned integers in a bufferView; correct the JSON.");
    const std::size_t size = component_bytes(a.componentType);
    const Rows rows = rows_of(a.bufferView, a.byteOffset, a.count, size, where);
    std::vector<Index> values(a.count);
    for (std::size_t i = 0; i < a.count; ++i) values[i] = index_at(rows[i], a.componentType);
    if (a.sparse.isSparse) {
        for_each_sparse(a, size, where,
                        [&](std::size_t at, const char* row) { values[at] = index_at(row, a.componentType); });
    }
    return values;
}

} // namespace unseen::meshio::gltf
