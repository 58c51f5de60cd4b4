// What of a glTF document a cut can keep, and what it cannot.
#include <algorithm>
#include <set>
#include <string>
#include <string_view>

#include <unseen/meshio/scene_file.h>

#include "gltf_data.h"
#include "gltf_document.h"
#include "kept_arrays.h"
#include "mesh_readers.h"

namespace unseen::meshio::gltf {

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
        if (std::find(std::begin(unsupported_extensions), std::end(unsupported_extensions), required) !=
            std::end(unsupported_extensions))
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
    if (const json* uri = member(image, "uri"); uri != nullptr && uri->is_string()) {
        const auto& text = uri->get_ref<const std::string&>();
        if (text.starts_with("data:")) {
            if (!image.contains("mimeType")) image["mimeType"] = text.substr(5, text.find_first_of(";,") - 5);
            image.erase("uri");
        }
    }
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
