// Brings the images that a mesh file, or its user, names to the mesh.
#pragma once

#include <filesystem>

#include <unseen/session/load.h>

namespace unseen::session {

// Gives the mesh the texture that the options, or else its materials, name, if they do: several become one. The colours
// of materials become those of the vertices. What else the file said goes with the mesh (Mesh::document). Errors name
// the image's file.
Result<void> lay_texture(const std::filesystem::path& mesh_file, meshio::ReadResult& read, const LoadOptions& options);

} // namespace unseen::session
