#include "gltf_data.h"

#ifdef UNSEEN_MESHIO_WITH_MESHOPTIMIZER
#include <meshoptimizer.h>
#endif

#include <unseen/meshio/scene_file.h>

#include "text_scanner.h"
#include "value_types.h"

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

// Whether a buffer stands for what compressed views hold uncompressed; it may have no data.
bool is_fallback(const json& buffer) { return within(buffer, {"extensions", meshopt_extension, "fallback"}) == true; }

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

// Nothing where a file's number means no type.
std::optional<ValueType> type_of(int component) {
    switch (component) {
    case TINYGLTF_COMPONENT_TYPE_BYTE: return ValueType::int8;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE: return ValueType::uint8;
    case TINYGLTF_COMPONENT_TYPE_SHORT: return ValueType::int16;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: return ValueType::uint16;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT: return ValueType::uint32;
    case TINYGLTF_COMPONENT_TYPE_FLOAT: return ValueType::float32;
    default: return std::nullopt;
    }
}

std::optional<ValueType> index_type_of(int component) {
    const auto type = type_of(component);
    const bool is_index = type == ValueType::uint8 || type == ValueType::uint16 || type == ValueType::uint32;
    return is_index ? type : std::nullopt;
}

double component_at(const char* bytes, ValueType type, bool is_normalized) {
    return with_type(type, [&](auto tag) {
        using Stored = typename decltype(tag)::type;
        const auto value = static_cast<double>(load_value<Stored>(bytes));
        const bool is_share = is_normalized && sizeof(Stored) < 4; // of whole numbers
        // glTF 2.0, 3.6.2.2: the most negative integer stands for -1 as well.
        return is_share ? std::max(value / static_cast<double>(std::numeric_limits<Stored>::max()), -1.0) : value;
    });
}

Index index_at(const char* row, ValueType type) { return static_cast<Index>(component_at(row, type, false)); }

// Rows of bytes that are known to lie inside a buffer.
struct Rows {
    const char* first = nullptr;
    std::size_t stride = 0;
    std::size_t count = 0;
    const char* operator[](std::size_t i) const { return first + i * stride; }
};

Rows rows_of(const tinygltf::Model& model, const Buffers& buffers, int view_index, std::size_t offset,
             std::size_t count, std::size_t size, const std::string& where) {
    if (static_cast<std::size_t>(view_index) >= model.bufferViews.size())
        fail(where, " uses buffer view ", view_index, ", but there are ", model.bufferViews.size(),
             "; correct the JSON.");
    const tinygltf::BufferView& view = model.bufferViews[static_cast<std::size_t>(view_index)];
    if (static_cast<std::size_t>(view.buffer) >= buffers.count())
        fail("buffer view ", view_index, " uses buffer ", view.buffer, ", but there are ", buffers.count(),
             "; correct the JSON.");
    const std::string_view bytes = buffers[static_cast<std::size_t>(view.buffer)];
    if (view.byteOffset > bytes.size() || view.byteLength > bytes.size() - view.byteOffset)
        fail("buffer view ", view_index, " ends behind its buffer; the data are cut short or the JSON is wrong.");
    const std::size_t stride = view.byteStride == 0 ? size : view.byteStride;
    if (stride < size) fail(where, " has a stride smaller than its elements; correct the JSON.");
    const std::size_t room = view.byteLength - std::min(offset, view.byteLength);
    const bool fits = count == 0 || (room >= size && count - 1 <= (room - size) / stride);
    if (!fits) fail(where, " ends behind its buffer view; the data are cut short or the JSON is wrong.");
    return count == 0 ? Rows{} : Rows{bytes.data() + view.byteOffset + offset, stride, count};
}

} // namespace

const tinygltf::Accessor& Accessors::accessor(int index) const {
    if (index < 0 || static_cast<std::size_t>(index) >= model_.accessors.size())
        fail("accessor ", index, " is used, but there are ", model_.accessors.size(), "; correct the JSON.");
    return model_.accessors[static_cast<std::size_t>(index)];
}

int Accessors::components_of(int index) const {
    const int type = accessor(index).type;
    const bool is_vector = type == TINYGLTF_TYPE_VEC2 || type == TINYGLTF_TYPE_VEC3 || type == TINYGLTF_TYPE_VEC4;
    return is_vector ? tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(type)) : 0;
}

template <class Value, class Decode>
std::vector<Value> Accessors::read(int index, std::size_t size, Value missing, Decode&& decode) const {
    const tinygltf::Accessor& a = accessor(index);
    const std::string where = text_of("accessor ", index);
    const auto rows = [&](int view, std::size_t offset, std::size_t count, std::size_t row_size) {
        return rows_of(model_, buffers_, view, offset, count, row_size, where);
    };
    const Rows dense = a.bufferView < 0 ? Rows{} : rows(a.bufferView, a.byteOffset, a.count, size);
    std::vector<Value> values(a.count, missing);
    for (std::size_t i = 0; i < dense.count; ++i) decode(dense[i], values[i]);
    if (!a.sparse.isSparse) return values;
    const auto& indices = a.sparse.indices;
    const auto& others = a.sparse.values;
    const auto index_type = index_type_of(indices.componentType);
    if (!index_type) fail(where, " has sparse indices of a wrong type; correct the JSON.");
    const auto count = static_cast<std::size_t>(a.sparse.count);
    if (count > a.count) fail(where, " replaces more elements than it has; correct its sparse count.");
    const Rows at =
        rows(indices.bufferView, static_cast<std::size_t>(indices.byteOffset), count, byte_size(*index_type));
    const Rows replaced = rows(others.bufferView, static_cast<std::size_t>(others.byteOffset), count, size);
    for (std::size_t i = 0; i < count; ++i) {
        const Index target = index_at(at[i], *index_type);
        if (target >= a.count)
            fail(where, " replaces element ", target, " of ", a.count, "; correct its sparse indices.");
        decode(replaced[i], values[target]);
    }
    return values;
}

std::vector<glm::dvec4> Accessors::vectors(int index, int components, const char* use) const {
    const tinygltf::Accessor& a = accessor(index);
    const int found = components_of(index);
    const bool fits = components == 0 ? found == 3 || found == 4 : found == components;
    if (!fits) fail("accessor ", index, " has the wrong type for ", use, "; correct the JSON.");
    const auto type = type_of(a.componentType);
    if (!type) fail("accessor ", index, " has the unknown component type ", a.componentType, "; correct the JSON.");
    if (a.bufferView < 0 && !a.sparse.isSparse) fail("accessor ", index, " has no bufferView; correct the JSON.");
    const std::size_t bytes = byte_size(*type);
    return read(index, static_cast<std::size_t>(found) * bytes, glm::dvec4(0, 0, 0, 1),
                [&](const char* row, glm::dvec4& value) {
                    for (int i = 0; i < found; ++i)
                        value[i] = component_at(row + static_cast<std::size_t>(i) * bytes, *type, a.normalized);
                });
}

std::vector<Index> Accessors::indices(int index) const {
    const tinygltf::Accessor& a = accessor(index);
    const auto type = index_type_of(a.componentType);
    if (a.type != TINYGLTF_TYPE_SCALAR || !type || a.bufferView < 0)
        fail("accessor ", index, " cannot hold indices: they are unsigned integers in a bufferView; correct the JSON.");
    return read(index, byte_size(*type), Index{0},
                [&](const char* row, Index& value) { value = index_at(row, *type); });
}

// ---- buffer views that EXT_meshopt_compression made small ----

namespace {

#ifdef UNSEEN_MESHIO_WITH_MESHOPTIMIZER

// No codec of the extension stores less than two bits of sixteen bytes; what claims more is no such data. Bytes for each
// byte.
constexpr std::size_t most_growth = 64;
constexpr std::size_t least_bound = 4096; // bytes: headers count where there is little
// The bound of all views together for a small file: bytes.
constexpr std::size_t least_bound_of_all = std::size_t{16} << 20;

struct Packed {
    std::size_t count = 0, stride = 0;
    std::string_view bytes;
    std::string mode, filter;
};

std::size_t size_of(const json& in, const char* key, std::size_t missing, const std::string& where) {
    const json* value = member(in, key);
    if (value == nullptr) return missing;
    return static_cast<std::size_t>(to_integer_in_range(*value, max_size, where + ": " + key));
}

Packed packed_in(const json& extension, const Buffers& buffers, const std::string& where) {
    const auto text = [&](const char* key, const char* missing) {
        const json& value = within(extension, {key});
        return value.is_string() ? value.get<std::string>() : std::string(missing);
    };
    Packed packed;
    packed.count = size_of(extension, "count", 0, where), packed.stride = size_of(extension, "byteStride", 0, where);
    packed.mode = text("mode", ""), packed.filter = text("filter", "NONE");
    const std::size_t buffer = size_of(extension, "buffer", buffers.count(), where);
    const std::size_t offset = size_of(extension, "byteOffset", 0, where);
    const std::size_t length = size_of(extension, "byteLength", 0, where);
    if (buffer >= buffers.count() || offset > buffers[buffer].size() || length > buffers[buffer].size() - offset)
        fail(where, ": its compressed bytes end behind their buffer; the data are cut short or the JSON is wrong.");
    packed.bytes = buffers[buffer].substr(offset, length);
    return packed;
}

// What the library demands of its callers, and a size that such data can have.
void check(const Packed& packed, const std::string& where) {
    const bool is_vertices = packed.mode == "ATTRIBUTES";
    const bool fits = is_vertices ? packed.stride % 4 == 0 && packed.stride >= 4 && packed.stride <= 256
                                  : packed.stride == 2 || packed.stride == 4;
    if (!fits) fail(where, ": its byteStride is ", packed.stride, "; correct the JSON.");
    if (packed.mode == "TRIANGLES" && packed.count % 3 != 0)
        fail(where, ": ", packed.count, " indices make no whole number of triangles; correct it.");
    if (packed.count > (least_bound + most_growth * packed.bytes.size()) / packed.stride)
        fail(where, ": ", packed.bytes.size(), " bytes cannot hold its ", packed.count,
             " elements; the data are cut short or the JSON is wrong.");
}

void undo_filter(const Packed& packed, std::string& out, const std::string& where) {
    const bool has_filter = packed.filter != "NONE";
    const bool fits = packed.filter == "OCTAHEDRAL"    ? packed.stride == 4 || packed.stride == 8
                      : packed.filter == "QUATERNION"  ? packed.stride == 8
                      : packed.filter == "EXPONENTIAL" ? packed.stride % 4 == 0
                                                       : !has_filter;
    if (!fits || (has_filter && packed.mode != "ATTRIBUTES"))
        fail(where, ": its filter is not known, or does not go with its mode and byteStride; correct the JSON.");
    if (packed.filter == "OCTAHEDRAL") meshopt_decodeFilterOct(out.data(), packed.count, packed.stride);
    if (packed.filter == "QUATERNION") meshopt_decodeFilterQuat(out.data(), packed.count, packed.stride);
    if (packed.filter == "EXPONENTIAL") meshopt_decodeFilterExp(out.data(), packed.count, packed.stride);
}

std::string unpacked(const Packed& packed, const std::string& where) {
    check(packed, where);
    std::string out(packed.count * packed.stride, '\0');
    const auto* bytes = reinterpret_cast<const unsigned char*>(packed.bytes.data());
    const std::size_t size = packed.bytes.size();
    int failed = -1;
    if (packed.mode == "ATTRIBUTES")
        failed = meshopt_decodeVertexBuffer(out.data(), packed.count, packed.stride, bytes, size);
    else if (packed.mode == "TRIANGLES")
        failed = meshopt_decodeIndexBuffer(out.data(), packed.count, packed.stride, bytes, size);
    else if (packed.mode == "INDICES")
        failed = meshopt_decodeIndexSequence(out.data(), packed.count, packed.stride, bytes, size);
    else fail(where, ": its mode is ", in_quotes(packed.mode), ", which is none; correct the JSON.");
    if (failed != 0) fail(where, ": its compressed bytes are damaged.");
    undo_filter(packed, out, where);
    return out;
}

#endif

} // namespace

void unpack_views(json& document, Buffers& buffers) {
#ifdef UNSEEN_MESHIO_WITH_MESHOPTIMIZER
    const auto views = document.find("bufferViews");
    if (views == document.end() || !views->is_array()) return;
    std::size_t room = 0; // many views may name the same bytes
    for (std::size_t i = 0; i < buffers.count(); ++i) room += buffers[i].size();
    room = std::max(least_bound_of_all, most_growth * room);
    for (std::size_t i = 0; i < views->size(); ++i) {
        json& view = (*views)[i];
        const json& extension = within(view, {"extensions", meshopt_extension});
        if (!extension.is_object()) continue;
        const std::string where = numbered("buffer view", i);
        std::string bytes = unpacked(packed_in(extension, buffers, where), where);
        if (bytes.size() > room)
            fail("its compressed buffer views hold more than files of its size do; split the scene.");
        room -= bytes.size();
        view["byteLength"] = bytes.size();
        view["byteOffset"] = 0;
        view["buffer"] = buffers.add(std::move(bytes));
    }
#else
    (void)document, (void)buffers;
#endif
}

} // namespace unseen::meshio::gltf
