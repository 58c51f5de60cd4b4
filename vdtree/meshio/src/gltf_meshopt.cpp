// Buffer views that EXT_meshopt_compression made small.
#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>

#ifdef UNSEEN_MESHIO_WITH_MESHOPTIMIZER
#include <meshoptimizer.h>
#endif

#include <unseen/meshio/scene_file.h>

#include "gltf_data.h"

namespace unseen::meshio::gltf {

namespace {

#ifdef UNSEEN_MESHIO_WITH_MESHOPTIMIZER

// No codec of the extension stores less than two bits of sixteen bytes; what claims more is no such data. Bytes for each
// byte.
constexpr std::size_t most_growth = 64;
constexpr std::size_t least_bound = 4096; // bytes: headers count where there is little
// Of all views together, where a file is small: bytes.
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
        const json* value = member(extension, key);
        return value != nullptr && value->is_string() ? value->get<std::string>() : std::string(missing);
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
        if (!view.is_object()) continue;
        const json* extensions = member(view, "extensions");
        const json* extension =
            extensions && extensions->is_object() ? member(*extensions, meshopt_extension) : nullptr;
        if (extension == nullptr || !extension->is_object()) continue;
        const std::string where = numbered("buffer view", i);
        std::string bytes = unpacked(packed_in(*extension, buffers, where), where);
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
