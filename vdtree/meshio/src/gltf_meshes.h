// A glTF file, opened: all of it as one mesh, or its meshes by themselves.
#pragma once

#include <glm/mat3x3.hpp>

#include "gltf_data.h"

namespace unseen::meshio::gltf {

class File {
public:
    // Reads all but the meshes. The source must outlive this. What all meshes together may take is bounded as for one
    // file. Fails on what no cut can keep, unless it is to be dropped.
    explicit File(const MeshSource& source);
    ~File();

    const json& document() const;
    const tinygltf::Model& model() const;
    std::uint64_t bytes() const; // with its buffers

    // The scene that is shown, with materials and its document.
    ReadResult read_all();
    // With materials, and a document of its parts alone (mesh 0, no node, no JSON); without triangles where it has
    // none. Precondition: there is such a mesh.
    ReadResult read_mesh(std::size_t mesh, const glm::dmat3& stretch);
    // The document without geometry, and its images. Adds what the file lost by now to the warnings.
    json kept(std::vector<SourceDocument::File>& images, std::vector<Message>& warnings);

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

} // namespace unseen::meshio::gltf
