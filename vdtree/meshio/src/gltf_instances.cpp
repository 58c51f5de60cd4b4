// EXT_mesh_gpu_instancing: nodes that show their mesh many times.
#include "gltf_data.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace unseen::meshio::gltf {
namespace {

struct Place {
    const char *attribute, *key; // of the extension, and of a node
    int components;
};
constexpr Place places[] = {{"TRANSLATION", "translation", 3}, {"ROTATION", "rotation", 4}, {"SCALE", "scale", 3}};

const json* instances_of(const json& node) {
    const json* extensions = node.is_object() ? member(node, "extensions") : nullptr;
    const json* extension = extensions && extensions->is_object() ? member(*extensions, instancing_extension) : nullptr;
    const json* attributes = extension && extension->is_object() ? member(*extension, "attributes") : nullptr;
    return attributes && attributes->is_object() && node.contains("mesh") ? attributes : nullptr;
}

// One node an instance, with its place.
std::vector<json> read_instances(const json& attributes, const Accessors& accessors, std::size_t most,
                                 const std::string& where) {
    std::vector<json> instances;
    bool is_first = true;
    for (const Place& place : places) {
        const json* index = member(attributes, place.attribute);
        if (index == nullptr) continue;
        const std::string what = where + ": " + place.attribute + " of its instances";
        const int accessor = static_cast<int>(to_integer_in_range(*index, max_int, what));
        const std::size_t count = accessors.count_of(accessor);
        if (count > most) fail(where, " has more instances than are read; split the scene.");
        if (std::exchange(is_first, false)) instances.resize(count, json::object());
        if (count != instances.size())
            fail(what, " are ", count, ", and others ", instances.size(), "; correct the JSON.");
        const auto values = accessors.vectors(accessor, place.components, "instances");
        for (std::size_t i = 0; i < count; ++i) {
            json& numbers = instances[i][place.key] = json::array();
            for (int k = 0; k < place.components; ++k) {
                if (!std::isfinite(values[i][k])) fail(what, ": number ", i, " is NaN or infinite; correct it.");
                numbers.push_back(values[i][k]);
            }
        }
    }
    return instances;
}

} // namespace

void expand_instances(json& document, const Buffers& buffers, std::vector<Message>& warnings) {
    std::vector<std::size_t> with_instances;
    const json& before = array_of(document, "nodes");
    for (std::size_t i = 0; i < before.size(); ++i)
        if (instances_of(before[i]) != nullptr) with_instances.push_back(i);
    if (with_instances.empty()) return;
    const Reduced reduced = reduce(document);
    const Accessors accessors(reduced.model, buffers);
    json& nodes = document["nodes"];
    bool has_values = false;
    for (const std::size_t i : with_instances) {
        const json& attributes = *instances_of(nodes[i]);
        std::vector<json> instances =
            read_instances(attributes, accessors, max_array_elements - std::min(nodes.size(), max_array_elements),
                           numbered("node", i));
        for (const auto& [name, accessor] : attributes.items()) has_values = has_values || name.starts_with('_');
        const json mesh = nodes[i]["mesh"], name = nodes[i].value("name", json());
        nodes[i].erase("mesh");
        nodes[i]["extensions"].erase(instancing_extension);
        json& children = nodes[i]["children"];
        if (!children.is_array()) children = json::array();
        for (std::size_t k = 0; k < instances.size(); ++k) {
            children.push_back(nodes.size() + k);
            instances[k]["mesh"] = mesh;
            if (name.is_string()) instances[k]["name"] = name.get<std::string>() + " " + std::to_string(k);
        }
        for (json& instance : instances) nodes.push_back(std::move(instance));
    }
    if (has_values) warnings.push_back("values of instances (EXT_mesh_gpu_instancing) were left out.");
}

} // namespace unseen::meshio::gltf
