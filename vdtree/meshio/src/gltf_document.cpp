#include "gltf_document.h"

#include <set>

#include <unseen/meshio/scene_file.h>

#include "gltf_nodes.h"
#include "kept_arrays.h"
#include "text_scanner.h"
#include "value_types.h"

namespace unseen::meshio::gltf {
namespace {

// Deeper JSON is found in attacks, not in scenes.
constexpr int max_json_depth = 256;
// Three bytes of JSON become a few hundred in memory, so their number is bounded, at more than scenes are made of.
constexpr std::size_t max_json_values = std::size_t{1} << 23;

constexpr std::uint32_t glb_version = 2;
constexpr std::uint32_t chunk_json = 0x4E4F534A;
constexpr std::uint32_t chunk_bin = 0x004E4942;
constexpr std::size_t glb_header_bytes = 12;
constexpr std::size_t chunk_header_bytes = 8;

std::uint32_t word_at(std::string_view bytes, std::size_t offset) {
    return load_value<std::uint32_t>(bytes.data() + offset);
}

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
            if (++depth > max_json_depth) fail("byte ", i, ": the JSON is nested too deeply; simplify it.");
        } else if (c == '}' || c == ']') {
            --depth;
        }
        if (!in_string && (c == '{' || c == '[' || c == ',') && ++values > max_json_values)
            fail("byte ", i, ": the JSON has too many values; split the scene.");
    }
}

} // namespace

std::string numbered(const char* what, std::size_t index) { return std::string(what) + " " + std::to_string(index); }

Container split_glb(std::string_view bytes) {
    if (bytes.size() < glb_header_bytes + chunk_header_bytes) fail("it is too short for a GLB file; it is cut short.");
    if (word_at(bytes, 4) != glb_version)
        fail("its GLB version is ", word_at(bytes, 4), ", and only 2 is read; convert it.");
    const std::size_t length = word_at(bytes, 8);
    if (length > bytes.size())
        fail("its header claims ", length, " bytes, but there are ", bytes.size(), "; the file is cut short.");
    bytes = bytes.substr(0, length);
    Container container;
    for (std::size_t at = glb_header_bytes; at + chunk_header_bytes <= bytes.size();) {
        const std::size_t size = word_at(bytes, at);
        const std::uint32_t type = word_at(bytes, at + 4);
        at += chunk_header_bytes;
        if (size > bytes.size() - at) fail("byte ", at, ": a chunk ends behind the file; it is cut short.");
        const std::string_view chunk = bytes.substr(at, size);
        if (type == chunk_json && container.json_text.empty()) container.json_text = chunk;
        else if (type == chunk_bin && !container.bin) container.bin = chunk;
        at += size;
    }
    // Chunks are filled up to words: with spaces, it is said, but some programs take NUL bytes.
    constexpr int most_filling = 3;
    for (int i = 0; i < most_filling && container.json_text.ends_with('\0'); ++i) container.json_text.remove_suffix(1);
    if (container.json_text.empty()) fail("it has no JSON chunk; the file is damaged.");
    return container;
}

json parse_json(std::string_view text) {
    // The parser takes one for the end, whatever follows.
    if (const std::size_t nul = text.find('\0'); nul != std::string_view::npos)
        fail("byte ", nul, ": a NUL byte, which no JSON contains; the file is damaged.");
    check_structure(text);
    try {
        json document = json::parse(text.begin(), text.end());
        if (!document.is_object()) fail("its JSON is no object; it is no glTF file.");
        return document;
    } catch (const json::parse_error& error) {
        fail("byte ", error.byte, ": the JSON cannot be parsed; the file is damaged or cut short.");
    } catch (const json::exception&) {
        fail("its JSON has a number that no double can hold; correct it.");
    }
}

std::string to_text(const json& document) { return document.dump(-1, ' ', false, json::error_handler_t::replace); }

TextureSource source_of(const json& texture) {
    const auto index_in = [](const json& object) -> std::optional<std::size_t> {
        const json& source = within(object, {"source"});
        if (!source.is_number_unsigned()) return std::nullopt;
        return source.get<std::size_t>();
    };
    if (const auto own = index_in(texture)) return {own, {}};
    if (const json& extensions = within(texture, {"extensions"}); extensions.is_object())
        for (const auto& [name, extension] : extensions.items())
            if (const auto other = index_in(extension)) return {other, name};
    return {};
}

const json& within(const json& value, std::initializer_list<const char*> keys) {
    static const json none;
    const json* found = &value;
    for (const char* key : keys) {
        if (!found->is_object() || !found->contains(key)) return none;
        found = &(*found)[key];
    }
    return *found;
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
    if (!array->is_array()) fail("its ", key, " are no array; correct the JSON.");
    return *array;
}

std::int64_t to_integer_in_range(const json& value, std::int64_t largest, const std::string& where) {
    const bool is_whole_float = value.is_number_float() && value.get<double>() == std::floor(value.get<double>());
    double as_double = -1.0;
    if (value.is_number_integer() || is_whole_float) as_double = value.get<double>();
    if (!(as_double >= 0.0 && as_double <= static_cast<double>(largest)))
        fail(where, " should be a whole number from 0 to ", largest, "; correct it.");
    return static_cast<std::int64_t>(as_double);
}

const json& leading_texture(const json& material) {
    const json* texture = &within(material, {"pbrMetallicRoughness", "baseColorTexture"});
    for (const char* other : {"normalTexture", "emissiveTexture"})
        if (texture->is_null()) texture = &within(material, {other});
    return *texture;
}

std::optional<std::uint32_t> uv_set_of(const json& texture) {
    const json* set = &within(texture, {"extensions", "KHR_texture_transform", "texCoord"});
    if (set->is_null()) set = &within(texture, {"texCoord"});
    if (set->is_null()) return 0;
    for (std::uint32_t known = 0; known <= last_uv_set; ++known)
        if (*set == known) return known;
    return std::nullopt;
}

std::string uv_attribute(std::uint32_t set) { return "TEXCOORD_" + std::to_string(set); }

namespace {

// Copies what describes triangles, element by element; what is not copied cannot do harm.
class Reducer {
public:
    explicit Reducer(const json& document) : document_(document) {}

    json reduce() {
        check_version();
        copy_array("bufferViews", "buffer view", [&](const json& in, json& out) {
            integer(in, out, "buffer", max_int, true);
            for (const char* key : {"byteOffset", "byteLength", "byteStride"})
                integer(in, out, key, max_size, std::string_view(key) == "byteLength");
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

    bool has_tangents() const { return has_tangents_; }
    bool has_other_attributes() const { return has_other_attributes_; }

private:
    void check_version() {
        const json& version = within(document_, {"asset", "version"});
        if (!version.is_string()) fail("it has no asset version; it is no glTF file.");
        if (!version.get_ref<const std::string&>().starts_with("2."))
            fail("its version is ", in_quotes(version.get_ref<const std::string&>()),
                 ", and only 2 is read; convert it.");
        reduced_["asset"]["version"] = "2.0";
    }

    template <class Copy>
    void copy_array(const char* key, const char* what, Copy&& copy) {
        const json& array = array_of(document_, key);
        if (array.size() > max_array_elements)
            fail("it has ", array.size(), " ", key, ", more than the ", max_array_elements,
                 " that are read; split the scene.");
        json& out = reduced_[key] = json::array();
        for (std::size_t i = 0; i < array.size(); ++i) {
            where_ = numbered(what, i);
            if (!array[i].is_object()) fail(where_, " is no object; correct the JSON.");
            json element = json::object();
            copy(array[i], element);
            out.push_back(std::move(element));
        }
    }

    void integer(const json& in, json& out, const char* key, std::int64_t largest, bool is_required) const {
        const json* value = member(in, key);
        if (value != nullptr) out[key] = to_integer_in_range(*value, largest, where_ + ": " + key);
        else if (is_required) fail(where_, " has no ", key, "; correct the JSON.");
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
        if (!is_valid) fail(where_, ": ", key, " should be ", count, " numbers; correct it.");
        out[key] = *values;
    }

    void name(const json& in, json& out) const {
        if (const json& value = within(in, {"name"}); value.is_string()) out["name"] = value;
    }

    // More sets of coordinates and colours are found in attacks, not in meshes.
    static bool is_read(std::string_view attribute) {
        const auto is_set = [&](std::string_view prefix, char last) {
            return attribute.size() == prefix.size() + 1 && attribute.starts_with(prefix) && attribute.back() >= '0' &&
                   attribute.back() <= last;
        };
        return attribute == "POSITION" || attribute == "NORMAL" || is_set("TEXCOORD_", '7') || is_set("COLOR_", '3');
    }

    const json& object(const json& in, const char* key) const {
        const json* value = member(in, key);
        if (value == nullptr || !value->is_object()) fail(where_, " has no ", key, "; correct the JSON.");
        return *value;
    }

    void accessor(const json& in, json& out) const {
        integer(in, out, "bufferView", max_int, false);
        integer(in, out, "byteOffset", max_size, false);
        integer(in, out, "componentType", max_int, true);
        integer(in, out, "count", max_size, true);
        const json& type = within(in, {"type"});
        if (!type.is_string()) fail(where_, " has no type; correct the JSON.");
        out["type"] = type;
        if (const json& normalized = within(in, {"normalized"}); normalized.is_boolean())
            out["normalized"] = normalized;
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
            if (!primitive.is_object()) fail(where_, " has a primitive that is no object; correct the JSON.");
            json copied = json::object();
            for (const char* key : {"indices", "material", "mode"}) integer(primitive, copied, key, max_int, false);
            json& attributes = copied["attributes"] = json::object();
            const json& attributes_in = object(primitive, "attributes");
            refuse_draco(primitive, attributes_in);
            for (const auto& [key, value] : attributes_in.items()) {
                const bool is_of_skin = key.starts_with("JOINTS_") || key.starts_with("WEIGHTS_");
                if (is_read(key)) integer(attributes_in, attributes, key.c_str(), max_int, false);
                else (key == "TANGENT" ? has_tangents_ : has_other_attributes_) |= !is_of_skin;
            }
            primitives.push_back(std::move(copied));
        }
    }

    // Files may offer plain data beside compressed ones; many do not, and yet call the extension optional.
    void refuse_draco(const json& primitive, const json& attributes) const {
        const json& position = within(attributes, {"POSITION"});
        const json& extensions = within(primitive, {"extensions"});
        if (!extensions.is_object() || !extensions.contains(draco_extension) || !position.is_number_unsigned()) return;
        const json& accessors = array_of(document_, "accessors");
        const auto index = position.get<std::size_t>();
        if (index < accessors.size() && accessors[index].is_object() && !accessors[index].contains("bufferView") &&
            !accessors[index].contains("sparse"))
            fail(where_, " is compressed by ", draco_extension, ", which is not read; export it without.");
    }

    void node(const json& in, json& out) {
        name(in, out);
        integer(in, out, "mesh", max_int, false);
        integers(in, out, "children");
        numbers(in, out, "matrix", 16);
        numbers(in, out, "translation", 3);
        numbers(in, out, "rotation", 4);
        numbers(in, out, "scale", 3);
    }

    const json& document_;
    json reduced_ = json::object();
    std::string where_;
    bool has_tangents_ = false, has_other_attributes_ = false;
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
        is_loaded =
            loader.LoadASCIIFromString(&model, &error, &warning, text.data(), static_cast<unsigned>(text.size()), "");
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& exception) {
        error = exception.what();
    }
    while (!error.empty() && is_space(error.back())) error.pop_back();
    constexpr std::size_t longest = 200; // it may quote the file
    if (!is_loaded) fail("it is no valid glTF: " + error.substr(0, longest) + (error.size() > longest ? "..." : "."));
    return model;
}

} // namespace

Reduced reduce(const json& document) {
    Reducer reducer(document);
    tinygltf::Model model = to_model(reducer.reduce());
    return {std::move(model), reducer.has_tangents(), reducer.has_other_attributes()};
}

// ---- what a cut can keep, and what it cannot

namespace {

// Extensions without which the positions or triangles cannot be read.
constexpr std::string_view unsupported_extensions[] = {draco_extension, "KHR_meshopt_compression"};
// Only of how vertices are stored, which is done otherwise when they are written.
constexpr std::string_view quantization = "KHR_mesh_quantization";

// Extensions of materials, textures, lights and descriptions name no vertices: they are kept as they are.
bool is_kept(std::string_view extension) {
    const auto has = [&](std::string_view part) { return extension.find(part) != std::string_view::npos; };
    return has("_materials_") || has("_texture_") || has("_lights_") || has("_xmp") ||
           extension == "KHR_node_visibility";
}

bool any_has(const json& elements, const char* key) {
    return std::any_of(elements.begin(), elements.end(),
                       [&](const json& element) { return element.is_object() && element.contains(key); });
}

bool has_morph_targets(const json& document) {
    const json& meshes = array_of(document, "meshes");
    return std::any_of(meshes.begin(), meshes.end(), [](const json& mesh) {
        return mesh.is_object() && any_has(array_of(mesh, "primitives"), "targets");
    });
}

// The names of required extensions that nobody here knows. Fails on those without which nothing can be read.
std::set<std::string> unknown_required(const json& document) {
    std::set<std::string> unknown;
    for (const json& extension : array_of(document, "extensionsRequired")) {
        if (!extension.is_string()) continue;
        const auto& required = extension.get_ref<const std::string&>();
        if (std::ranges::find(unsupported_extensions, required) != std::end(unsupported_extensions))
            fail("it needs the extension ", required, ", which is not read; export it without.");
        if (required == meshopt_extension && !has_meshoptimizer())
            fail("it needs the extension ", required,
                 ", and this build is without the library meshoptimizer; install "
                 "libmeshoptimizer-dev and build again, or export it without.");
        if (!is_kept(required) && required != quantization && required != meshopt_extension &&
            required != lod_extension && required != instancing_extension)
            unknown.insert(required);
    }
    return unknown;
}

// Removes the extensions of an object, and of all within it, that are not kept.
void strip_extensions(json& value, std::set<std::string>& stripped) {
    if (value.is_object()) {
        if (const auto found = value.find("extensions"); found != value.end() && found->is_object()) {
            for (auto extension = found->begin(); extension != found->end();) {
                if (is_kept(extension.key())) {
                    ++extension;
                    continue;
                }
                stripped.insert(extension.key());
                extension = found->erase(extension);
            }
            if (found->empty()) value.erase(found);
        }
        for (auto& [key, inner] : value.items())
            if (key != "extras") strip_extensions(inner, stripped);
    } else if (value.is_array()) {
        for (json& inner : value) strip_extensions(inner, stripped);
    }
}

void keep_names(json& document, const char* key) {
    const auto names = document.find(key);
    if (names == document.end()) return;
    json kept = json::array();
    for (const json& name : array_of(document, key))
        if (name.is_string() && is_kept(name.get_ref<const std::string&>())) kept.push_back(name);
    if (kept.empty()) document.erase(names);
    else *names = std::move(kept);
}

// Without what names accessors.
json kept_mesh(json mesh) {
    mesh.erase("weights");
    json primitives = json::array();
    for (const json& primitive : array_of(mesh, "primitives")) {
        json kept = json::object();
        for (const char* key : {"material", "extensions", "extras"})
            if (const json* value = member(primitive, key)) kept[key] = *value;
        if (any_has(json::array({primitive}), "targets") && mesh.contains("extras") && mesh["extras"].is_object())
            mesh["extras"].erase("targetNames");
        primitives.push_back(std::move(kept));
    }
    mesh["primitives"] = std::move(primitives);
    return mesh;
}

json kept_image(json image) {
    image.erase("bufferView");
    const json& uri = within(image, {"uri"});
    const std::string text = uri.is_string() ? uri.get<std::string>() : std::string();
    if (!text.starts_with("data:")) return image;
    if (!image.contains("mimeType")) image["mimeType"] = text.substr(5, text.find_first_of(";,") - 5);
    image.erase("uri");
    return image;
}

} // namespace

void check_kept(const json& document, const LeftOut& drop, std::vector<Message>& warnings) {
    const std::set<std::string> unknown = unknown_required(document);
    struct Thing {
        const char *what, *name;
        bool is_there, is_dropped;
        std::string details;
    };
    const Thing things[] = {
        {"skins", "skins", any_has(array_of(document, "nodes"), "skin"), drop.skins, "; the mesh is in its bind pose"},
        {"morph targets", "morph-targets", has_morph_targets(document), drop.morph_targets, ""},
        {"animations", "animations", !array_of(document, "animations").empty(), drop.animations, ""},
        {"unknown extensions", "extensions", !unknown.empty(), drop.extensions,
         ": " + listed({unknown.begin(), unknown.end()})}};
    std::string refused, names;
    for (const Thing& thing : things) {
        if (!thing.is_there) continue;
        if (thing.is_dropped) {
            warnings.push_back(std::string(thing.what) + " were left out" + thing.details + ".");
            continue;
        }
        refused += (refused.empty() ? "" : " and ") + std::string(thing.what);
        names += (names.empty() ? "" : ",") + std::string(thing.name);
    }
    if (!refused.empty())
        throw Fault{"it has " + refused + ", which a simplified mesh cannot keep" +
                    (unknown.empty() || drop.extensions ? "" : " (" + listed({unknown.begin(), unknown.end()}) + ")") +
                    "; leave them out with " + Message::of("{read.drop = }") + names + "."};
}

json without_geometry(json document, const std::vector<SourceDocument::File>& images, std::vector<Message>& warnings) {
    for (const char* key : {"accessors", "bufferViews", "buffers", "animations", "skins"}) document.erase(key);
    std::set<std::string> stripped;
    strip_extensions(document, stripped);
    stripped.erase(std::string(quantization));
    stripped.erase(meshopt_extension);
    stripped.erase(draco_extension); // there were plain data, too
    if (stripped.erase(lod_extension) > 0)
        warnings.push_back("of its levels of detail (MSFT_lod) the finest were read.");
    if (!stripped.empty())
        warnings.push_back(
            "what extensions say that are not known was left out: " + listed({stripped.begin(), stripped.end()}) + ".");
    for (const char* key : {"extensionsUsed", "extensionsRequired"}) keep_names(document, key);
    const auto change_each = [&](const char* key, auto&& change) {
        if (const auto found = document.find(key); found != document.end())
            for (json& element : *found) element = element.is_object() ? change(std::move(element)) : json::object();
    };
    change_each("meshes", kept_mesh);
    change_each("images", kept_image);
    for (std::size_t i = 0; i < images.size(); ++i)
        if (!images[i].uri.empty()) document["images"][i]["uri"] = images[i].uri; // as it is written again
    change_each("nodes", [](json node) {
        node.erase("skin");
        node.erase("weights");
        return node;
    });
    return document;
}

} // namespace unseen::meshio::gltf
