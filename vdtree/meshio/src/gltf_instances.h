// EXT_mesh_gpu_instancing: nodes that show their mesh many times.
#pragma once

#include <string>
#include <vector>

#include "gltf_data.h"

namespace unseen::meshio::gltf {

inline constexpr const char* instancing_extension = "EXT_mesh_gpu_instancing";

// Gives each instance a node of its own below the node that has them, so that all else sees only nodes. Values that
// instances have beside their places are left out, with a warning.
void expand_instances(json& document, const Buffers& buffers, std::vector<Message>& warnings);

} // namespace unseen::meshio::gltf
