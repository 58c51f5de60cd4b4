// Brings the images that a mesh file, or its user, names to the mesh.
#pragma once

#include <filesystem>
#include <string>

#include <vdtree/mesh_io.h>

#include "options.h"

namespace unseen::app {

// Gives the mesh the texture that the options, or else its materials, name, if they do: several become one, and the colours of materials
// become those of the vertices. Where nothing has an image, nothing changes. Errors name the image's file.
Result<void> lay_texture(const std::filesystem::path& mesh_file, vdtree::ReadResult& read, const TextureOptions& options);

} // namespace unseen::app
