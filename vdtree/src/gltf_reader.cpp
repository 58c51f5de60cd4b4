// glTF 2.0, as JSON and as GLB. tinygltf maps the JSON to its structures; everything it would believe or fetch is kept
// from it: the document is first cut down to what describes triangles, with every integer in range, and buffers are
// resolved here, so that files cannot make it allocate, decode images or touch the file system.
#include "mesh_readers.h"
#include "text_scanner.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <nlohmann/json.hpp>
#include <tiny_gltf.h>

namespace unseen::vdtree {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

// Deeper JSON and node trees are found in attacks, not in scenes.
constexpr int max_json_depth = 256;
constexpr std::size_t max_node_depth = 512;
// Three bytes of JSON become a few hundred in memory, so their number is bounded, at more than scenes are made of.
constexpr std::size_t max_json_values = std::size_t{1} << 23;
constexpr std::size_t max_array_elements = std::size_t{1} << 20; // nodes, meshes, accessors, ...
// Instancing multiplies a file, so what may come out is bounded: bytes for each byte read, and bytes in any case.
constexpr std::uint64_t max_bytes_out_per_byte_in = 64;
constexpr std::uint64_t min_bytes_out = std::uint64_t{16} << 20;
constexpr std::uint64_t bytes_per_vertex = sizeof(glm::dvec3) + sizeof(glm::vec3) + sizeof(glm::vec4) + sizeof(glm::vec2);
constexpr std::uint64_t bytes_per_visit = 64; // of a primitive: takes time even where it is empty
constexpr std::uint64_t bytes_per_index = sizeof(Index) * 3; // in a strip an index makes a triangle
// Integers above are not exact in JSON.
constexpr std::int64_t max_size = std::int64_t{1} << 53;
constexpr std::int64_t max_int = std::numeric_limits<int>::max();

constexpr std::uint32_t glb_version = 2;
constexpr std::uint32_t chunk_json = 0x4E4F534A;
constexpr std::uint32_t chunk_bin = 0x004E4942;
constexpr std::size_t glb_header_bytes = 12;
constexpr std::size_t chunk_header_bytes = 8;

// Extensions without which the positions or triangles cannot be read.
constexpr std::string_view unsupported_extensions[] = {"KHR_draco_mesh_compression", "EXT_meshopt_compression",
                                                       "KHR_meshopt_compression", "EXT_mesh_gpu_instancing"};

// A broken rule of the format, thrown within this file only: it unwinds from deep inside a document.
struct Broken {
    std::string what;
};

[[noreturn]] void fail(std::string what) { throw Broken{std::move(what)}; }

std::string numbered(const char* what, std::size_t index) { return std::string(what) + " " + std::to_string(index); }

// ---- container ----

struct Container {
    std::string_view json_text;
    std::optional<std::string_view> bin;
};

std::uint32_t word_at(std::string_view bytes, std::size_t offset) {
    std::array<char, 4> raw;
    std::memcpy(raw.data(), bytes.data() + offset, raw.size());
    if constexpr (std::endian::native == std::endian::big) std::reverse(raw.begin(), raw.end());
    return std::bit_cast<std::uint32_t>(raw);
}

Container split_glb(std::string_view bytes) {
    if (bytes.size() < glb_header_bytes + chunk_header_bytes) fail("it is too short for a GLB file; it is cut short.");
    if (word_at(bytes, 4) != glb_version) {
        fail("its GLB version is " + std::to_string(word_at(bytes, 4)) + ", and only 2 is read; convert it.");
    }
    const std::size_t length = word_at(bytes, 8);
    if (length > bytes.size()) {
        fail("its header claims " + std::to_string(length) + " bytes, but there are " + std::to_string(bytes.size()) +
             "; the file is cut short.");
    }
    bytes = bytes.substr(0, length);
    Container container;
    for (std::size_t at = glb_header_bytes; at + chunk_header_bytes <= bytes.size();) {
        const std::size_t size = word_at(bytes, at);
        const std::uint32_t type = word_at(bytes, at + 4);
        at += chunk_header_bytes;
        if (size > bytes.size() - at) fail("byte " + std::to_string(at) + ": a chunk ends behind the file; it is cut short.");
        const std::string_view chunk = bytes.substr(at, size);
        if (type == chunk_json && container.json_text.empty()) container.json_text = chunk;
        else if (type == chunk_bin && !container.bin) container.bin = chunk;
        at += size;
    }
    if (container.json_text.empty()) fail("it has no JSON chunk; the file is damaged.");
    return container;
}

// ---- the document, cut down ----

// Recursive code behind the parser must not run out of stack, nor its structures of memory.
void check_structure(std::string_view text) {
    int depth = 0;
    std::size_t values = 0;
    bool in_string = false;
    for (std::size_t i = 0; i < text.size(); ++i) {
        const char c = text[i];
        if (in_string) {
            if (c == '\\') ++i;
            else if (c == '"') in_string = false;
        } else if (c == '"') {
            in_string = true;
        } else if (c == '{' || c == '[') {
            if (++depth > max_json_depth) fail("byte " + std::to_string(i) + ": the JSON is nested too deeply; simplify it.");
        } else if (c == '}' || c == ']') {
            --depth;
        }
        if (!in_string && (c == '{' || c == '[' || c == ',') && ++values > max_json_values) {
            fail("byte " + std::to_string(i) + ": the JSON has too many values; split the scene.");
        }
    }
}

json parse_json(std::string_view text) {
    check_structure(text);
    try {
        json document = json::parse(text.begin(), text.end());
        if (!document.is_object()) fail("its JSON is no object; it is no glTF file.");
        return document;
    } catch (const json::parse_error& error) {
        fail("byte " + std::to_string(error.byte) + ": the JSON cannot be parsed; the file is damaged or cut short.");
    } catch (const json::exception&) {
        fail("its JSON has a number that no double can hold; correct it.");
    }
}

const json* member(const json& object, const char* key) {
    const auto found = object.find(key);
    return found == object.end() ? nullptr : &*found;
}

// The array under a key; empty where it is missing.
const json& array_of(const json& object, const char* key) {
    static const json empty = json::array();
    const json* array = member(object, key);
    if (array == nullptr) return empty;
    if (!array->is_array()) fail(std::string("its ") + key + " are no array; correct the JSON.");
    return *array;
}

std::int64_t to_integer_in_range(const json& value, std::int64_t largest, const std::string& where) {
    const bool is_whole_float = value.is_number_float() && value.get<double>() == std::floor(value.get<double>());
    double as_double = -1.0;
    if (value.is_number_integer() || is_whole_float) as_double = value.get<double>();
    if (!(as_double >= 0.0 && as_double <= static_cast<double>(largest))) {
        fail(where + " should be a whole number from 0 to " + std::to_string(largest) + "; correct it.");
    }
    return static_cast<std::int64_t>(as_double);
}

// Copies what describes triangles, element by element; what is not copied cannot do harm.
class Reducer {
public:
    explicit Reducer(const json& document) : document_(document) {}

    json reduce() {
        check_version();
        check_extensions();
        copy_array("bufferViews", "buffer view", [&](const json& in, json& out) {
            integer(in, out, "buffer", max_int, true);
            integer(in, out, "byteOffset", max_size, false);
            integer(in, out, "byteLength", max_size, true);
            integer(in, out, "byteStride", max_size, false);
        });
        copy_array("accessors", "accessor", [&](const json& in, json& out) { accessor(in, out); });
        copy_array("materials", "material", [&](const json& in, json& out) { name(in, out); });
        copy_array("meshes", "mesh", [&](const json& in, json& out) { mesh(in, out); });
        copy_array("nodes", "node", [&](const json& in, json& out) { node(in, out); });
        copy_array("scenes", "scene", [&](const json& in, json& out) { integers(in, out, "nodes"); });
        where_ = "the document";
        integer(document_, reduced_, "scene", max_int, false);
        return std::move(reduced_);
    }

    bool has_skins() const { return has_skins_; }
    bool has_morph_targets() const { return has_morph_targets_; }

private:
    void check_version() {
        const json* asset = member(document_, "asset");
        const json* version = asset != nullptr && asset->is_object() ? member(*asset, "version") : nullptr;
        if (version == nullptr || !version->is_string()) fail("it has no asset version; it is no glTF file.");
        if (!version->get_ref<const std::string&>().starts_with("2.")) {
            fail("its version is " + in_quotes(version->get_ref<const std::string&>()) + ", and only 2 is read; convert it.");
        }
        reduced_["asset"]["version"] = "2.0";
    }

    void check_extensions() const {
        for (const json& extension : array_of(document_, "extensionsRequired")) {
            if (!extension.is_string()) continue;
            const auto& required = extension.get_ref<const std::string&>();
            if (std::find(std::begin(unsupported_extensions), std::end(unsupported_extensions), required) !=
                std::end(unsupported_extensions)) {
                fail("it needs the extension " + required + ", which is not read; export it without.");
            }
        }
    }

    template <class Copy>
    void copy_array(const char* key, const char* what, Copy&& copy) {
        const json& array = array_of(document_, key);
        if (array.size() > max_array_elements) {
            fail("it has " + std::to_string(array.size()) + " " + key + ", more than the " +
                 std::to_string(max_array_elements) + " that are read; split the scene.");
        }
        json& out = reduced_[key] = json::array();
        for (std::size_t i = 0; i < array.size(); ++i) {
            where_ = numbered(what, i);
            if (!array[i].is_object()) fail(where_ + " is no object; correct the JSON.");
            json element = json::object();
            copy(array[i], element);
            out.push_back(std::move(element));
        }
    }

    void integer(const json& in, json& out, const char* key, std::int64_t largest, bool is_required) const {
        const json* value = member(in, key);
        if (value != nullptr) out[key] = to_integer_in_range(*value, largest, where_ + ": " + key);
        else if (is_required) fail(where_ + " has no " + key + "; correct the JSON.");
    }

    void integers(const json& in, json& out, const char* key) const {
        const json& values = array_of(in, key);
        if (values.empty()) return;
        json& copied = out[key] = json::array();
        for (const json& value : values) copied.push_back(to_integer_in_range(value, max_int, where_ + ": " + key));
    }

    void numbers(const json& in, json& out, const char* key, std::size_t count) const {
        const json* values = member(in, key);
        if (values == nullptr) return;
        const bool is_valid = values->is_array() && values->size() == count &&
                              std::all_of(values->begin(), values->end(), [](const json& v) { return v.is_number(); });
        if (!is_valid) fail(where_ + ": " + key + " should be " + std::to_string(count) + " numbers; correct it.");
        out[key] = *values;
    }

    void name(const json& in, json& out) const {
        if (const json* value = member(in, "name"); value != nullptr && value->is_string()) out["name"] = *value;
    }

    const json& object(const json& in, const char* key) const {
        const json* value = member(in, key);
        if (value == nullptr || !value->is_object()) fail(where_ + " has no " + key + "; correct the JSON.");
        return *value;
    }

    void accessor(const json& in, json& out) const {
        integer(in, out, "bufferView", max_int, false);
        integer(in, out, "byteOffset", max_size, false);
        integer(in, out, "componentType", max_int, true);
        integer(in, out, "count", max_size, true);
        const json* type = member(in, "type");
        if (type == nullptr || !type->is_string()) fail(where_ + " has no type; correct the JSON.");
        out["type"] = *type;
        if (const json* normalized = member(in, "normalized"); normalized != nullptr && normalized->is_boolean()) {
            out["normalized"] = *normalized;
        }
        if (member(in, "sparse") == nullptr) return;
        const json& sparse = object(in, "sparse");
        json copied;
        integer(sparse, copied, "count", max_int, true);
        for (const char* part : {"indices", "values"}) {
            const json& part_in = object(sparse, part);
            json& part_out = copied[part] = json::object();
            integer(part_in, part_out, "bufferView", max_int, true);
            integer(part_in, part_out, "byteOffset", max_int, false);
            if (std::string_view(part) == "indices") integer(part_in, part_out, "componentType", max_int, true);
        }
        out["sparse"] = std::move(copied);
    }

    void mesh(const json& in, json& out) {
        name(in, out);
        json& primitives = out["primitives"] = json::array();
        for (const json& primitive : array_of(in, "primitives")) {
            if (!primitive.is_object()) fail(where_ + " has a primitive that is no object; correct the JSON.");
            json copied = json::object();
            integer(primitive, copied, "indices", max_int, false);
            integer(primitive, copied, "material", max_int, false);
            integer(primitive, copied, "mode", max_int, false);
            json& attributes = copied["attributes"] = json::object();
            const json& attributes_in = object(primitive, "attributes");
            for (const char* key : {"POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0"}) {
                integer(attributes_in, attributes, key, max_int, false);
            }
            has_morph_targets_ = has_morph_targets_ || member(primitive, "targets") != nullptr;
            primitives.push_back(std::move(copied));
        }
    }

    void node(const json& in, json& out) {
        name(in, out);
        integer(in, out, "mesh", max_int, false);
        integers(in, out, "children");
        numbers(in, out, "matrix", 16);
        numbers(in, out, "translation", 3);
        numbers(in, out, "rotation", 4);
        numbers(in, out, "scale", 3);
        has_skins_ = has_skins_ || member(in, "skin") != nullptr;
    }

    const json& document_;
    json reduced_ = json::object();
    std::string where_;
    bool has_skins_ = false;
    bool has_morph_targets_ = false;
};

bool ignore_image(tinygltf::Image*, const int, std::string*, std::string*, int, int, const unsigned char*, int, void*) {
    return true;
}

tinygltf::Model to_model(const json& reduced) {
    const std::string text = reduced.dump();
    if (text.size() > std::numeric_limits<unsigned>::max()) fail("its JSON is longer than 4 GiB; split the scene.");
    tinygltf::Model model;
    tinygltf::TinyGLTF loader;
    loader.SetImageLoader(ignore_image, nullptr);
    std::string error, warning;
    bool is_loaded = false;
    try {
        is_loaded = loader.LoadASCIIFromString(&model, &error, &warning, text.data(), static_cast<unsigned>(text.size()), "");
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& exception) {
        error = exception.what();
    }
    while (!error.empty() && is_space(error.back())) error.pop_back();
    if (!is_loaded) fail("it is no valid glTF: " + error + ".");
    return model;
}

// ---- buffers ----

int base64_value(char c) {
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    if (c == '+' || c == '-') return 62; // the second of each pair: RFC 4648's alphabet for URLs
    if (c == '/' || c == '_') return 63;
    return -1;
}

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

std::string decode_percent(std::string_view text) {
    std::string decoded;
    for (std::size_t i = 0; i < text.size(); ++i) {
        unsigned code = 0;
        if (text[i] == '%' && i + 2 < text.size()) {
            const auto [end, error] = std::from_chars(&text[i + 1], &text[i + 1] + 2, code, 16);
            if (error == std::errc() && end == &text[i + 1] + 2) {
                decoded += static_cast<char>(code);
                i += 2;
                continue;
            }
        }
        decoded += text[i];
    }
    return decoded;
}

// The bytes of the document's buffers, each read or decoded once.
class Buffers {
public:
    Buffers(const MeshSource& source, const json& document, std::optional<std::string_view> bin) : source_(source) {
        const json& array = array_of(document, "buffers");
        for (std::size_t i = 0; i < array.size(); ++i) {
            const std::string where = numbered("buffer", i);
            if (!array[i].is_object()) fail(where + " is no object; correct the JSON.");
            const json* length = member(array[i], "byteLength");
            if (length == nullptr) fail(where + " has no byteLength; correct the JSON.");
            const auto size = static_cast<std::size_t>(to_integer_in_range(*length, max_size, where + ": byteLength"));
            const json* uri = member(array[i], "uri");
            std::string_view bytes;
            if (uri != nullptr && uri->is_string()) bytes = resolve(uri->get_ref<const std::string&>(), where);
            else if (i == 0 && bin) bytes = *bin;
            else fail(where + " names no file and has no data of its own; correct the JSON.");
            if (size > bytes.size()) {
                fail(where + " claims " + std::to_string(size) + " bytes, but there are " + std::to_string(bytes.size()) +
                     "; the data are cut short.");
            }
            buffers_.push_back(bytes.substr(0, size));
        }
    }

    static std::string decode_data(std::string_view uri, const std::string& where) {
        const std::size_t comma = uri.find(',');
        if (comma == std::string_view::npos || !uri.substr(0, comma).ends_with(";base64")) {
            fail(where + " has a data URI that is not in base64; correct it.");
        }
        std::optional<std::string> bytes = decode_base64(uri.substr(comma + 1));
        if (!bytes) fail(where + " has a data URI with characters that are not base64; correct it.");
        return std::move(*bytes);
    }

    static fs::path below_folder(const std::string& uri, const std::string& where) {
        const auto path = path_beside(decode_percent(uri));
        if (!path) fail(where + " is " + in_quotes(uri) + ", and only files beside the mesh are read; move it there.");
        return *path;
    }

    std::size_t count() const { return buffers_.size(); }
    std::string_view operator[](std::size_t i) const { return buffers_[i]; }
    std::uint64_t external_bytes() const { return external_bytes_; }

private:
    std::string_view resolve(const std::string& uri, const std::string& where) {
        const auto [found, is_new] = loaded_.try_emplace(uri);
        if (!is_new) return found->second;
        found->second = uri.starts_with("data:") ? decode_data(uri, where) : read_beside(uri, where);
        return found->second;
    }

    // Only files in the mesh file's folder and below: a mesh must not be able to name any file of the machine.
    std::string read_beside(const std::string& uri, const std::string& where) {
        const fs::path relative = below_folder(uri, where);
        if (source_.folder.empty()) fail(where + " lies in another file, which a mesh in memory cannot have.");
        Result<std::string> bytes = read_whole_file(source_.folder / relative);
        if (!bytes) fail(where + ": " + bytes.error().message);
        external_bytes_ += bytes->size();
        return std::move(*bytes);
    }

    const MeshSource& source_;
    std::map<std::string, std::string> loaded_;
    std::vector<std::string_view> buffers_;
    std::uint64_t external_bytes_ = 0;
};

// ---- materials ----

// The colours and images of materials, straight from the document.
class MaterialReader {
public:
    MaterialReader(const json& document, const Buffers& buffers, std::vector<std::string>& warnings)
        : document_(document), buffers_(buffers), warnings_(warnings) {}

    // Alpha counts where it is not said to be ignored.
    Material read(std::size_t index, std::string name) {
        Material material{.name = std::move(name)};
        const json& of_file = array_of(document_, "materials")[index];
        where_ = numbered("material", index);
        const json* surface = optional_object(of_file, "pbrMetallicRoughness");
        if (surface == nullptr) return material;
        if (const json* factor = member(*surface, "baseColorFactor")) material.colour = colour(*factor);
        const json* mode = member(of_file, "alphaMode");
        if (mode == nullptr || *mode == "OPAQUE") material.colour.a = 1;
        if (const json* texture = optional_object(*surface, "baseColorTexture")) add_texture(*texture, material);
        return material;
    }

private:
    const json* optional_object(const json& in, const char* key) const {
        const json* value = member(in, key);
        if (value != nullptr && !value->is_object()) fail(where_ + ": its " + key + " is no object; correct the JSON.");
        return value;
    }

    glm::vec4 colour(const json& values) const {
        glm::vec4 colour(1);
        bool is_valid = values.is_array() && values.size() == 4;
        for (std::size_t i = 0; is_valid && i < 4; ++i) {
            is_valid = values[i].is_number() && values[i].get<double>() >= 0 && values[i].get<double>() <= 1;
            if (is_valid) colour[static_cast<int>(i)] = values[i].get<float>();
        }
        if (!is_valid) fail(where_ + ": its baseColorFactor should be 4 numbers from 0 to 1; correct it.");
        return colour;
    }

    const json& element(const char* key, const json& in, const char* of) {
        const json& array = array_of(document_, key);
        const json* value = member(in, of);
        if (value == nullptr) fail(where_ + " has no " + of + "; correct the JSON.");
        const auto index = static_cast<std::size_t>(to_integer_in_range(*value, max_int, where_ + ": " + of));
        if (index >= array.size() || !array[index].is_object()) {
            fail(where_ + ": its " + of + " is " + std::to_string(index) + ", but there are " + std::to_string(array.size()) + " " + key + "; correct the JSON.");
        }
        where_ = numbered(key, index);
        return array[index];
    }

    void add_texture(const json& info, Material& material) {
        if (const json* set = member(info, "texCoord"); set != nullptr && *set != 0) {
            fail(where_ + ": its texture lies by the texture coordinates " + set->dump() + ", and only 0 is read; export it without, or leave the textures out.");
        }
        if (member(info, "extensions") != nullptr) warnings_.push_back(where_ + ": the transform of its texture was ignored.");
        const json& texture = element("textures", info, "index");
        if (member(texture, "sampler") != nullptr) {
            const std::string of_texture = where_;
            const json& sampler = element("samplers", texture, "sampler");
            material.wrap_u = wrap(sampler, "wrapS");
            material.wrap_v = wrap(sampler, "wrapT");
            where_ = of_texture;
        }
        add_image(element("images", texture, "source"), material);
    }

    Wrap wrap(const json& sampler, const char* key) const {
        constexpr int clamps = 33071, mirrors = 33648;
        const json* value = member(sampler, key);
        if (value == nullptr) return Wrap::repeat;
        if (*value == mirrors) fail(where_ + ": a texture that is repeated in a mirror is not read; export it otherwise, or leave the textures out.");
        return *value == clamps ? Wrap::clamp : Wrap::repeat;
    }

    void add_image(const json& image, Material& material) {
        if (const json* uri = member(image, "uri")) {
            if (!uri->is_string()) fail(where_ + ": its uri is no text; correct the JSON.");
            const auto& text = uri->get_ref<const std::string&>();
            if (text.starts_with("data:")) material.image_bytes = Buffers::decode_data(text, where_);
            else material.image = Buffers::below_folder(text, where_);
            return;
        }
        const std::string of_image = where_;
        const json& view = element("bufferViews", image, "bufferView");
        const auto number = [&](const char* key, std::int64_t missing) {
            const json* value = member(view, key);
            if (value == nullptr && missing >= 0) return static_cast<std::size_t>(missing);
            if (value == nullptr) fail(where_ + " has no " + key + "; correct the JSON.");
            return static_cast<std::size_t>(to_integer_in_range(*value, max_size, where_ + ": " + key));
        };
        const std::size_t buffer = number("buffer", -1), offset = number("byteOffset", 0), length = number("byteLength", -1);
        if (buffer >= buffers_.count() || offset > buffers_[buffer].size() || length > buffers_[buffer].size() - offset) {
            fail(of_image + " ends behind its buffer; the data are cut short or the JSON is wrong.");
        }
        if (length == 0) fail(of_image + " is empty; correct the JSON.");
        material.image_bytes = buffers_[buffer].substr(offset, length);
    }

    const json& document_;
    const Buffers& buffers_;
    std::vector<std::string>& warnings_;
    std::string where_;
};

// ---- accessors ----

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

// Rows of bytes that are known to lie inside a buffer.
struct Rows {
    const char* first = nullptr;
    std::size_t stride = 0;
    std::size_t count = 0;
    const char* operator[](std::size_t i) const { return first + i * stride; }
};

class Accessors {
public:
    Accessors(const tinygltf::Model& model, const Buffers& buffers) : model_(model), buffers_(buffers) {}

    std::size_t count_of(int index) const { return accessor(index).count; }

    // The accessor's elements with `components` components (0: 3 or 4), others 1 where there is a fourth.
    std::vector<glm::dvec4> vectors(int index, int components, const char* use) const {
        const tinygltf::Accessor& a = accessor(index);
        const std::string where = numbered("accessor", static_cast<std::size_t>(index));
        const int found = a.type == TINYGLTF_TYPE_VEC2   ? 2
                          : a.type == TINYGLTF_TYPE_VEC3 ? 3
                          : a.type == TINYGLTF_TYPE_VEC4 ? 4
                                                         : 0;
        const bool fits = components == 0 ? found == 3 || found == 4 : found == components;
        if (!fits) fail(where + " has the wrong type for " + use + "; correct the JSON.");
        const std::size_t component_size = component_size_of(a.componentType, where);
        const std::size_t size = static_cast<std::size_t>(found) * component_size;

        if (a.bufferView < 0 && !a.sparse.isSparse) fail(where + " has no bufferView; correct the JSON.");
        const Rows rows = a.bufferView < 0 ? Rows{} : rows_of(a.bufferView, a.byteOffset, a.count, size, where);
        std::vector<glm::dvec4> values(a.count, glm::dvec4(0.0, 0.0, 0.0, 1.0));
        const auto decode = [&](const char* row, glm::dvec4& value) {
            for (int i = 0; i < found; ++i) {
                value[i] = component_at(row + static_cast<std::size_t>(i) * component_size, a.componentType, a.normalized);
            }
        };
        for (std::size_t i = 0; i < rows.count; ++i) decode(rows[i], values[i]);
        if (a.sparse.isSparse) {
            for_each_sparse(a, size, where, [&](std::size_t at, const char* row) { decode(row, values[at]); });
        }
        return values;
    }

    std::vector<Index> indices(int index) const {
        const tinygltf::Accessor& a = accessor(index);
        const std::string where = numbered("accessor", static_cast<std::size_t>(index));
        if (a.type != TINYGLTF_TYPE_SCALAR || !is_index_type(a.componentType) || a.bufferView < 0) {
            fail(where + " cannot hold indices: they are unsigned integers in a bufferView; correct the JSON.");
        }
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

private:
    const tinygltf::Accessor& accessor(int index) const {
        if (index < 0 || static_cast<std::size_t>(index) >= model_.accessors.size()) {
            fail("accessor " + std::to_string(index) + " is used, but there are " +
                 std::to_string(model_.accessors.size()) + "; correct the JSON.");
        }
        return model_.accessors[static_cast<std::size_t>(index)];
    }

    static bool is_index_type(int type) {
        return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE || type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
               type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    }

    static Index index_at(const char* row, int type) { return static_cast<Index>(component_at(row, type, false)); }

    static std::size_t component_size_of(int type, const std::string& where) {
        const std::size_t size = component_bytes(type);
        if (size == 0) fail(where + " has the unknown component type " + std::to_string(type) + "; correct the JSON.");
        return size;
    }

    Rows rows_of(int view_index, std::size_t offset, std::size_t count, std::size_t size, const std::string& where) const {
        if (static_cast<std::size_t>(view_index) >= model_.bufferViews.size()) {
            fail(where + " uses buffer view " + std::to_string(view_index) + ", but there are " +
                 std::to_string(model_.bufferViews.size()) + "; correct the JSON.");
        }
        const tinygltf::BufferView& view = model_.bufferViews[static_cast<std::size_t>(view_index)];
        if (static_cast<std::size_t>(view.buffer) >= buffers_.count()) {
            fail(numbered("buffer view", static_cast<std::size_t>(view_index)) + " uses buffer " +
                 std::to_string(view.buffer) + ", but there are " + std::to_string(buffers_.count()) +
                 "; correct the JSON.");
        }
        const std::string_view bytes = buffers_[static_cast<std::size_t>(view.buffer)];
        if (view.byteOffset > bytes.size() || view.byteLength > bytes.size() - view.byteOffset) {
            fail(numbered("buffer view", static_cast<std::size_t>(view_index)) +
                 " ends behind its buffer; the data are cut short or the JSON is wrong.");
        }
        const std::size_t stride = view.byteStride == 0 ? size : view.byteStride;
        if (stride < size) fail(where + " has a stride smaller than its elements; correct the JSON.");
        const std::size_t room = view.byteLength - std::min(offset, view.byteLength);
        const bool fits = count == 0 || (room >= size && count - 1 <= (room - size) / stride);
        if (!fits) fail(where + " ends behind its buffer view; the data are cut short or the JSON is wrong.");
        if (count == 0) return {};
        return {bytes.data() + view.byteOffset + offset, stride, count};
    }

    template <class Put>
    void for_each_sparse(const tinygltf::Accessor& a, std::size_t size, const std::string& where, Put&& put) const {
        const int index_type = a.sparse.indices.componentType;
        if (!is_index_type(index_type)) fail(where + " has sparse indices of a wrong type; correct the JSON.");
        const auto count = static_cast<std::size_t>(a.sparse.count);
        if (count > a.count) fail(where + " replaces more elements than it has; correct its sparse count.");
        const Rows at = rows_of(a.sparse.indices.bufferView, static_cast<std::size_t>(a.sparse.indices.byteOffset), count,
                                component_bytes(index_type), where);
        const Rows values = rows_of(a.sparse.values.bufferView, static_cast<std::size_t>(a.sparse.values.byteOffset),
                                    count, size, where);
        for (std::size_t i = 0; i < count; ++i) {
            const Index target = index_at(at[i], index_type);
            if (target >= a.count) {
                fail(where + " replaces element " + std::to_string(target) + " of " + std::to_string(a.count) +
                     "; correct its sparse indices.");
            }
            put(target, values[i]);
        }
    }

    const tinygltf::Model& model_;
    const Buffers& buffers_;
};

// ---- transforms ----

glm::dmat4 rotation_matrix(const std::vector<double>& q, const std::string& where) {
    const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(length > 0.0) || !std::isfinite(length)) fail(where + " has a rotation of length 0 or infinity; correct it.");
    const double x = q[0] / length, y = q[1] / length, z = q[2] / length, w = q[3] / length;
    glm::dmat4 m(1.0);
    m[0] = {1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w), 0};
    m[1] = {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w), 0};
    m[2] = {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y), 0};
    return m;
}

glm::dmat4 local_matrix(const tinygltf::Node& node, const std::string& where) {
    glm::dmat4 m(1.0);
    if (node.matrix.size() == 16) {
        for (int i = 0; i < 16; ++i) m[i / 4][i % 4] = node.matrix[static_cast<std::size_t>(i)];
        return m;
    }
    if (node.rotation.size() == 4) m = rotation_matrix(node.rotation, where);
    if (node.scale.size() == 3) {
        for (int i = 0; i < 3; ++i) m[i] *= node.scale[static_cast<std::size_t>(i)];
    }
    if (node.translation.size() == 3) {
        m[3] = {node.translation[0], node.translation[1], node.translation[2], 1.0};
    }
    return m;
}

// How positions, normals and orientation go to the world.
struct Placement {
    glm::dmat4 matrix{1.0};
    glm::dmat3 normal_matrix{1.0};
    bool is_mirrored = false;
};

Placement placement_of(const glm::dmat4& matrix) {
    Placement placement;
    placement.matrix = matrix;
    glm::dmat3 linear(matrix);
    double size = 0.0;
    for (int i = 0; i < 9; ++i) size = std::max(size, std::abs(linear[i / 3][i % 3]));
    if (size > 0.0 && std::isfinite(size)) linear /= size; // a determinant of tiny scales would underflow
    // The cofactors are the inverse transpose times the determinant, and exist where the inverse does not.
    const glm::dmat3 cofactors(glm::cross(linear[1], linear[2]), glm::cross(linear[2], linear[0]),
                               glm::cross(linear[0], linear[1]));
    placement.is_mirrored = glm::dot(linear[0], cofactors[0]) < 0.0;
    placement.normal_matrix = placement.is_mirrored ? -cofactors : cofactors;
    return placement;
}

glm::vec3 placed_normal(const Placement& placement, const glm::dvec3& normal) {
    const glm::dvec3 n = placement.normal_matrix * normal;
    const double length = glm::length(n);
    return length > 0.0 && std::isfinite(length) ? glm::vec3(n / length) : missing_normal;
}

// ---- scene ----

class SceneReader {
public:
    SceneReader(const MeshSource& source, const tinygltf::Model& model, const Buffers& buffers)
        : source_(source), model_(model), accessors_(model, buffers),
          bytes_left_(std::max(min_bytes_out,
                               max_bytes_out_per_byte_in * (source.bytes.size() + buffers.external_bytes()))) {}

    // Empty where the caller cancelled.
    std::optional<ReadResult> read() {
        if (model_.nodes.empty()) {
            for (std::size_t i = 0; i < model_.meshes.size(); ++i) add_mesh(model_.meshes[i], Placement{});
        } else {
            for (const int root : root_nodes()) {
                if (!add_tree(root)) return std::nullopt;
            }
        }
        if (skipped_primitives_ > 0) {
            result_.warnings.push_back(counted_were(skipped_primitives_, "primitive") +
                                       " left out for having no triangles or no positions.");
        }
        return std::move(result_);
    }

    // After read(): of the file, those that triangles have.
    void read_materials(MaterialReader& reader, ReadResult& result) const {
        for (const std::size_t index : used_materials_)
            result.materials.push_back(reader.read(index, material_name(static_cast<int>(index))));
    }

private:
    std::vector<int> root_nodes() const {
        if (!model_.scenes.empty()) {
            const auto scene = static_cast<std::size_t>(std::max(model_.defaultScene, 0));
            if (scene >= model_.scenes.size()) {
                fail("scene " + std::to_string(scene) + " is to be shown, but there are " +
                     std::to_string(model_.scenes.size()) + "; correct the JSON.");
            }
            return model_.scenes[scene].nodes;
        }
        std::vector<bool> is_child(model_.nodes.size());
        for (const tinygltf::Node& node : model_.nodes) {
            for (const int child : node.children) {
                if (static_cast<std::size_t>(child) < is_child.size()) is_child[static_cast<std::size_t>(child)] = true;
            }
        }
        std::vector<int> roots;
        for (std::size_t i = 0; i < is_child.size(); ++i) {
            if (!is_child[i]) roots.push_back(static_cast<int>(i));
        }
        if (roots.empty()) fail("its nodes have no root: each is the child of another; correct the JSON.");
        return roots;
    }

    struct Visit {
        std::size_t node;
        std::size_t depth;
        glm::dmat4 parent;
    };

    bool add_tree(int root) {
        reached_.resize(model_.nodes.size());
        std::vector<Visit> stack;
        push(stack, root, 0, glm::dmat4(1.0));
        while (!stack.empty()) {
            const Visit visit = stack.back();
            stack.pop_back();
            if (!source_.keep_going(source_.bytes.size() / 2, "reading glTF")) return false;
            const tinygltf::Node& node = model_.nodes[visit.node];
            const std::string where = numbered("node", visit.node);
            const glm::dmat4 world = visit.parent * local_matrix(node, where);
            if (node.mesh >= 0) {
                if (static_cast<std::size_t>(node.mesh) >= model_.meshes.size()) {
                    fail(where + " uses mesh " + std::to_string(node.mesh) + ", but there are " +
                         std::to_string(model_.meshes.size()) + "; correct the JSON.");
                }
                add_mesh(model_.meshes[static_cast<std::size_t>(node.mesh)], placement_of(world));
            }
            // Reversed, so that children come off the stack in their order.
            for (auto child = node.children.rbegin(); child != node.children.rend(); ++child) {
                push(stack, *child, visit.depth + 1, world);
            }
        }
        return true;
    }

    void push(std::vector<Visit>& stack, int node, std::size_t depth, const glm::dmat4& parent) {
        const auto index = static_cast<std::size_t>(node);
        const std::string where = numbered("node", index);
        if (index >= model_.nodes.size()) {
            fail(where + " is used, but there are " + std::to_string(model_.nodes.size()) + "; correct the JSON.");
        }
        // A second visit means a cycle or two parents; glTF allows neither.
        if (reached_[index]) fail(where + " is reached twice, but the nodes must form trees; correct the JSON.");
        reached_[index] = true;
        if (depth > max_node_depth) fail(where + " is nested too deeply; flatten the scene.");
        stack.push_back({index, depth, parent});
    }

    // Accessors of a primitive's vertices. Primitives of one mesh with the same ones share their vertices.
    using VertexSource = std::array<int, 4>; // position, normal, UV, colour; -1: none

    void add_mesh(const tinygltf::Mesh& mesh, const Placement& placement) {
        std::map<VertexSource, Index> first_vertices;
        for (const tinygltf::Primitive& primitive : mesh.primitives) {
            spend(1, bytes_per_visit);
            const bool has_triangles = primitive.mode == TINYGLTF_MODE_TRIANGLES ||
                                       primitive.mode == TINYGLTF_MODE_TRIANGLE_STRIP ||
                                       primitive.mode == TINYGLTF_MODE_TRIANGLE_FAN;
            const VertexSource vertices = vertex_source(primitive);
            if (!has_triangles || vertices[0] < 0) {
                ++skipped_primitives_;
                continue;
            }
            const auto [first, is_new] =
                first_vertices.try_emplace(vertices, static_cast<Index>(result_.mesh.positions.size()));
            if (is_new) add_vertices(vertices, placement);
            add_triangles(mesh, primitive, first->second, accessors_.count_of(vertices[0]), placement.is_mirrored);
        }
    }

    static VertexSource vertex_source(const tinygltf::Primitive& primitive) {
        const auto find = [&](const char* name) {
            const auto found = primitive.attributes.find(name);
            return found == primitive.attributes.end() ? -1 : found->second;
        };
        return {find("POSITION"), find("NORMAL"), find("TEXCOORD_0"), find("COLOR_0")};
    }

    void spend(std::uint64_t count, std::uint64_t bytes_each) {
        if (count > bytes_left_ / bytes_each) {
            fail("its instances and shared data multiply to far more than the file holds; split the scene.");
        }
        bytes_left_ -= count * bytes_each;
    }

    void add_vertices(const VertexSource& from, const Placement& placement) {
        Mesh& mesh = result_.mesh;
        const std::size_t first = mesh.positions.size();
        const std::size_t count = accessors_.count_of(from[0]);
        for (const int attribute : from) {
            if (attribute >= 0 && accessors_.count_of(attribute) != count) {
                fail(numbered("accessor", static_cast<std::size_t>(attribute)) + " has " +
                     std::to_string(accessors_.count_of(attribute)) + " elements for " + std::to_string(count) +
                     " positions; correct the JSON.");
            }
        }
        spend(count, bytes_per_vertex);
        if (count >= std::numeric_limits<Index>::max() - first) {
            fail("it has more vertices than 32-bit indices can number; split the scene.");
        }
        for (const glm::dvec4& p : accessors_.vectors(from[0], 3, "positions")) {
            mesh.positions.push_back(glm::dvec3(placement.matrix * glm::dvec4(p.x, p.y, p.z, 1.0)));
        }
        if (from[1] >= 0) {
            mesh.normals.resize(first, missing_normal);
            for (const glm::dvec4& n : accessors_.vectors(from[1], 3, "normals")) {
                if (!std::isfinite(n.x) || !std::isfinite(n.y) || !std::isfinite(n.z)) {
                    fail("normal " + std::to_string(mesh.normals.size() - first) + " of " +
                         numbered("accessor", static_cast<std::size_t>(from[1])) + " is NaN or infinite; correct it.");
                }
                mesh.normals.push_back(placed_normal(placement, glm::dvec3(n)));
            }
        }
        if (from[2] >= 0) {
            mesh.uvs.resize(first, glm::vec2(0.0f));
            for (const glm::dvec4& uv : accessors_.vectors(from[2], 2, "texture coordinates")) {
                mesh.uvs.emplace_back(uv.x, uv.y);
            }
        }
        if (from[3] >= 0) {
            mesh.colours.resize(first, missing_colour);
            for (const glm::dvec4& c : accessors_.vectors(from[3], 0, "colours")) mesh.colours.emplace_back(c);
        }
        if (!mesh.normals.empty()) mesh.normals.resize(mesh.positions.size(), missing_normal);
        if (!mesh.uvs.empty()) mesh.uvs.resize(mesh.positions.size(), glm::vec2(0.0f));
        if (!mesh.colours.empty()) mesh.colours.resize(mesh.positions.size(), missing_colour);
    }

    void add_triangles(const tinygltf::Mesh& mesh, const tinygltf::Primitive& primitive, Index first, std::size_t count,
                       bool is_mirrored) {
        const std::size_t index_count = primitive.indices >= 0 ? accessors_.count_of(primitive.indices) : count;
        spend(index_count, bytes_per_index);
        std::vector<Index> indices;
        if (primitive.indices >= 0) indices = accessors_.indices(primitive.indices);
        const auto vertex = [&](std::size_t i) {
            const Index index = indices.empty() ? static_cast<Index>(i) : indices[i];
            if (index >= count) {
                fail("mesh " + in_quotes(mesh.name) + ": index " + std::to_string(i) + " names vertex " +
                     std::to_string(index) + ", but there are " + std::to_string(count) + "; correct it.");
            }
            return first + index;
        };
        const bool is_list = primitive.mode == TINYGLTF_MODE_TRIANGLES;
        if (is_list && index_count % 3 != 0) {
            fail("mesh " + in_quotes(mesh.name) + ": " + std::to_string(index_count) +
                 " indices make no whole number of triangles; correct it.");
        }
        const std::uint64_t first_triangle = result_.mesh.triangles.size();
        for (std::size_t i = 2; i < index_count; i += is_list ? 3 : 1) {
            Triangle triangle{vertex(i - 2), vertex(i - 1), vertex(i)};
            if (primitive.mode == TINYGLTF_MODE_TRIANGLE_FAN) triangle[0] = vertex(0);
            const bool is_odd_in_strip = primitive.mode == TINYGLTF_MODE_TRIANGLE_STRIP && i % 2 != 0;
            if (is_odd_in_strip != is_mirrored) std::swap(triangle[0], triangle[1]);
            result_.mesh.triangles.push_back(triangle);
        }
        const std::uint64_t added = result_.mesh.triangles.size() - first_triangle;
        result_.source_faces += added;
        if (added == 0) return;
        if (primitive.material >= 0) {
            used_materials_.insert(static_cast<std::size_t>(primitive.material));
            add_range(material_name(primitive.material), MeshRange::Kind::material, first_triangle, added);
        }
        add_range(mesh.name, MeshRange::Kind::primitive, first_triangle, added);
    }

    // Names are repeated with every instance, so they count as well.
    void add_range(const std::string& name, MeshRange::Kind kind, std::uint64_t first, std::uint64_t count) {
        spend(1, sizeof(MeshRange) + name.size());
        result_.mesh.ranges.push_back({name, kind, first, count});
    }

    std::string material_name(int material) const {
        const auto index = static_cast<std::size_t>(material);
        if (index >= model_.materials.size()) {
            fail("material " + std::to_string(material) + " is used, but there are " +
                 std::to_string(model_.materials.size()) + "; correct the JSON.");
        }
        const std::string& name = model_.materials[index].name;
        const auto has_name = [&](const tinygltf::Material& other) { return other.name == name; };
        const auto first = std::find_if(model_.materials.begin(), model_.materials.end(), has_name);
        if (!name.empty() && first != model_.materials.begin() + static_cast<std::ptrdiff_t>(index)) return name + " (" + numbered("material", index) + ")";
        return name.empty() ? numbered("material", index) : name;
    }

    const MeshSource& source_;
    const tinygltf::Model& model_;
    Accessors accessors_;
    ReadResult result_;
    std::vector<bool> reached_;
    std::set<std::size_t> used_materials_;
    std::uint64_t bytes_left_;
    std::uint64_t skipped_primitives_ = 0;
};

Result<ReadResult> read_document(const MeshSource& source) {
    Container container{source.bytes, std::nullopt};
    if (source.bytes.starts_with("glTF")) container = split_glb(source.bytes);
    const json document = parse_json(container.json_text);
    if (!source.keep_going(source.bytes.size() / 4, "reading glTF")) return cancelled(source);

    Reducer reducer(document);
    const tinygltf::Model model = to_model(reducer.reduce());
    const Buffers buffers(source, document, container.bin);
    SceneReader scene(source, model, buffers);
    std::optional<ReadResult> result = scene.read();
    if (!result) return cancelled(source);
    result->uvs_from_top = true;
    if (source.options.materials) {
        MaterialReader materials(document, buffers, result->warnings);
        scene.read_materials(materials, *result);
    }
    if (reducer.has_skins()) result->warnings.push_back("skins were ignored; the mesh is in its bind pose.");
    if (reducer.has_morph_targets()) result->warnings.push_back("morph targets were ignored.");
    return std::move(*result);
}

} // namespace

Result<ReadResult> read_gltf(const MeshSource& source) {
    try {
        return read_document(source);
    } catch (const Broken& broken) {
        return malformed(source, broken.what);
    } catch (const json::exception& error) {
        return malformed(source, std::string("its JSON cannot be used: ") + error.what() + ".");
    }
}

} // namespace unseen::vdtree
