// What writers of cuts as glTF share.
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <unseen/meshio/source_document.h>

#include "gltf_document.h"
#include "gltf_writer.h"
#include "restore.h"

namespace unseen::meshio {

Error failed_to_write(const std::filesystem::path& file, const std::string& why);

// Writes what lay beside the mesh beside this file. What is there already must be the same.
Result<void> write_beside(const std::filesystem::path& file, const SourceDocument& document,
                          std::vector<Message>& notes);

// Images that lay in the source's file.
void add_images(nlohmann::json& out, const SourceDocument& document, GltfFile& file);

// Positions lie on the grid where it is used. The part must outlive the file's write(); it may be put in order.
nlohmann::json gltf_primitive(RestoredPart& restored, const SourceDocument& document, GltfFile& file,
                              const GltfGrid& grid = {});

// The node of a part, or a new one beside all others, where there is none or its frame cannot be turned back.
std::size_t node_for(nlohmann::json& out, const SourceDocument::Part& part, const RestoredPart& restored,
                     std::vector<Message>& notes);

// Runs what believes what a document says.
template <class Write>
Result<void> guarded_writing(Write&& write) {
    const auto damaged = [](const std::string& why) {
        return Error{ErrorCode::malformed_data,
                     "The source document of the tree cannot be used: " + why + " Build the tree again from its mesh."};
    };
    try {
        return write();
    } catch (const gltf::Broken& broken) {
        return damaged(broken.what);
    } catch (const nlohmann::json::exception&) {
        return damaged(gltf::wrong_type);
    } catch (const std::out_of_range&) {
        return damaged("texture coordinates are missing.");
    }
}

} // namespace unseen::meshio
