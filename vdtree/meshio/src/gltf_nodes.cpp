#include "gltf_nodes.h"

namespace unseen::meshio::gltf {
namespace {

constexpr std::size_t max_node_depth = 512; // deeper trees are found in attacks, not in scenes

glm::dmat4 rotation_matrix(const std::vector<double>& q, const std::string& where) {
    const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(length > 0.0) || !std::isfinite(length)) fail(where, " has a rotation of length 0 or infinity; correct it.");
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
    if (node.scale.size() == 3)
        for (int i = 0; i < 3; ++i) m[i] *= node.scale[static_cast<std::size_t>(i)];
    if (node.translation.size() == 3) m[3] = {node.translation[0], node.translation[1], node.translation[2], 1.0};
    return m;
}

std::vector<int> root_nodes(const tinygltf::Model& model) {
    if (!model.scenes.empty()) {
        const auto scene = static_cast<std::size_t>(std::max(model.defaultScene, 0));
        if (scene >= model.scenes.size())
            fail("scene ", scene, " is to be shown, but there are ", model.scenes.size(), "; correct the JSON.");
        return model.scenes[scene].nodes;
    }
    std::vector<bool> is_child(model.nodes.size());
    for (const tinygltf::Node& node : model.nodes) {
        for (const int child : node.children)
            if (static_cast<std::size_t>(child) < is_child.size()) is_child[static_cast<std::size_t>(child)] = true;
    }
    std::vector<int> roots;
    for (std::size_t i = 0; i < is_child.size(); ++i)
        if (!is_child[i]) roots.push_back(static_cast<int>(i));
    if (roots.empty() && !model.nodes.empty())
        fail("its nodes have no root: each is the child of another; correct the JSON.");
    return roots;
}

class Walk {
public:
    Walk(const MeshSource& source, const tinygltf::Model& model)
        : source_(source), model_(model), reached_(model.nodes.size()) {}

    std::vector<ShownNode> run() {
        for (const int root : root_nodes(model_)) visit_tree(root);
        return std::move(shown_);
    }

private:
    struct Visit {
        std::size_t node, depth, parent; // the parent in the list
    };

    void visit_tree(int root) {
        std::vector<Visit> stack;
        push(stack, root, 0, no_parent);
        while (!stack.empty()) {
            const Visit visit = stack.back();
            stack.pop_back();
            source_.report(source_.bytes.size() / 2, "reading glTF");
            const tinygltf::Node& node = model_.nodes[visit.node];
            const glm::dmat4 local = local_matrix(node, numbered("node", visit.node));
            const std::size_t number = shown_.size();
            shown_.push_back(
                {visit.node, visit.parent, visit.parent == no_parent ? local : shown_[visit.parent].to_world * local});
            // Reversed, so that children come off the stack in their order.
            for (auto child = node.children.rbegin(); child != node.children.rend(); ++child)
                push(stack, *child, visit.depth + 1, number);
        }
    }

    void push(std::vector<Visit>& stack, int node, std::size_t depth, std::size_t parent) {
        const auto index = static_cast<std::size_t>(node);
        const std::string where = numbered("node", index);
        if (index >= model_.nodes.size())
            fail(where, " is used, but there are ", model_.nodes.size(), "; correct the JSON.");
        // A second visit means a cycle or two parents; glTF allows neither.
        if (reached_[index]) fail(where, " is reached twice, but the nodes must form trees; correct the JSON.");
        reached_[index] = true;
        if (depth > max_node_depth) fail(where, " is nested too deeply; flatten the scene.");
        stack.push_back({index, depth, parent});
    }

    const MeshSource& source_;
    const tinygltf::Model& model_;
    std::vector<bool> reached_;
    std::vector<ShownNode> shown_;
};

} // namespace

std::vector<ShownNode> shown_nodes(const MeshSource& source, const tinygltf::Model& model) {
    if (model.nodes.empty()) return {}; // its meshes are shown as they are
    return Walk(source, model).run();
}

std::optional<std::size_t> mesh_of(const tinygltf::Model& model, std::size_t node) {
    const int mesh = model.nodes[node].mesh;
    if (mesh < 0) return std::nullopt;
    if (static_cast<std::size_t>(mesh) >= model.meshes.size())
        fail(numbered("node", node), " uses mesh ", mesh, ", but there are ", model.meshes.size(),
             "; correct the JSON.");
    return static_cast<std::size_t>(mesh);
}

std::uint64_t hidden_meshes(const json& document, const tinygltf::Model& model, const std::vector<ShownNode>& shown) {
    const std::size_t count = model.nodes.size();
    std::vector<bool> is_known(count, false);
    for (const ShownNode& node : shown) is_known[node.node] = true;
    // Other levels of detail, with what is below them.
    std::vector<std::size_t> open;
    const auto meet = [&](std::size_t node) {
        if (node < count && !is_known[node]) open.push_back(node);
    };
    for (const json& node : array_of(document, "nodes")) {
        const json& levels = within(node, {"extensions", lod_extension});
        if (!levels.is_object()) continue;
        for (const json& id : array_of(levels, "ids"))
            if (id.is_number_unsigned()) meet(id.get<std::size_t>());
    }
    while (!open.empty()) {
        const std::size_t node = open.back();
        open.pop_back();
        if (is_known[node]) continue;
        is_known[node] = true;
        for (const int child : model.nodes[node].children) meet(static_cast<std::size_t>(child));
    }
    std::uint64_t hidden = 0;
    for (std::size_t i = 0; i < count; ++i) hidden += model.nodes[i].mesh >= 0 && !is_known[i];
    return hidden;
}

// ---- EXT_mesh_gpu_instancing: nodes that show their mesh many times

namespace {

struct Place {
    const char *attribute, *key; // of the extension, and of a node
    int components;
};
constexpr Place places[] = {{"TRANSLATION", "translation", 3}, {"ROTATION", "rotation", 4}, {"SCALE", "scale", 3}};

// Null where a node has none.
const json& instances_of(const json& node) {
    const json& attributes = within(node, {"extensions", instancing_extension, "attributes"});
    return attributes.is_object() && node.contains("mesh") ? attributes : within(node, {""});
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
        if (instances_of(before[i]).is_object()) with_instances.push_back(i);
    if (with_instances.empty()) return;
    const Reduced reduced = reduce(document);
    const Accessors accessors(reduced.model, buffers);
    json& nodes = document["nodes"];
    bool has_values = false;
    for (const std::size_t i : with_instances) {
        const json& attributes = instances_of(nodes[i]);
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
