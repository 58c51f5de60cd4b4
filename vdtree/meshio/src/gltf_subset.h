// A glTF document cut down to one of its meshes.
#pragma once

#include <cstddef>
#include <vector>

#include "gltf_document.h"

namespace unseen::meshio::gltf {

struct Subset {
    json document;                           // one mesh, and the materials, textures, samplers and images that it uses
    std::vector<SourceDocument::File> files; // of these images
};
// Of a document as without_geometry() leaves it, with its images.
Subset subset_of(const json& kept, const std::vector<SourceDocument::File>& files, std::size_t mesh);

} // namespace unseen::meshio::gltf
