// The meshes of a glTF document, each read by itself.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <glm/mat3x3.hpp>

#include "gltf_data.h"

namespace unseen::meshio::gltf {

class Meshes {
public:
    // All must outlive this. What all meshes together may take is bounded as for one file.
    Meshes(const MeshSource& source, const json& document, const tinygltf::Model& model, const Buffers& buffers);
    ~Meshes();

    // With materials, and a document of its parts alone (mesh 0, no node, no JSON); without triangles where it has
    // none. Precondition: there is such a mesh.
    ReadResult read(std::size_t mesh, const glm::dmat3& stretch);
    // All images of the document.
    std::vector<SourceDocument::File> files(std::vector<Message>& warnings);

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::meshio::gltf
