// The nodes of a glTF scene, with their places in the world.
#pragma once

#include "gltf_data.h"

namespace unseen::meshio::gltf {

inline constexpr std::size_t no_parent = ~std::size_t{0};

struct ShownNode {
    std::size_t node = 0;           // of the document
    std::size_t parent = no_parent; // of the list; comes before
    glm::dmat4 to_world = glm::dmat4(1);
};

// Those of the scene that is shown, parents before their children, each once.
// Fails on cycles, nodes that are not there, and transforms that are none.
std::vector<ShownNode> shown_nodes(const MeshSource& source, const tinygltf::Model& model);

// The mesh of a node; fails where there is no such mesh.
std::optional<std::size_t> mesh_of(const tinygltf::Model& model, std::size_t node);

// Nodes with a mesh that are not shown, and are no other level of detail of one.
std::uint64_t hidden_meshes(const json& document, const tinygltf::Model& model, const std::vector<ShownNode>& shown);

inline constexpr const char* instancing_extension = "EXT_mesh_gpu_instancing";
// Gives each instance a node of its own below the node that has them, so that all else sees only nodes. Values that
// instances have beside their places are left out, with a warning.
void expand_instances(json& document, const Buffers& buffers, std::vector<Message>& warnings);

} // namespace unseen::meshio::gltf
