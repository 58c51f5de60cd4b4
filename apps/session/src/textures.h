// Brings the images that a mesh file, or its user, names to the mesh.
#pragma once

#include <unseen/session/load.h>

namespace unseen::session {

// Whether LoadOptions::texture is a folder in which images are looked for.
bool names_folder(const LoadOptions& options);

// What the options leave of images, skins and so on.
meshio::ReadOptions reading_options(const LoadOptions& options, meshio::ReadOptions reading = {});

// Gives the mesh the texture that the options, or else its materials, name, if they do: several become one. The colours
// of materials become those of the vertices. What else the file said goes with the mesh (Mesh::document). A material's
// image that cannot be decoded is a warning.
Result<void> lay_texture(const std::filesystem::path& mesh_file, meshio::ReadResult& read, const LoadOptions& options);

} // namespace unseen::session
