// What writers of cuts share.
#pragma once

#include <unseen/meshio/source_document.h>

#include "gltf_document.h"

namespace unseen::meshio {

Error failed_to_write(const std::filesystem::path& file, const std::string& why);

// Writes what lay beside the mesh beside this file. What is there already must be the same.
Result<void> write_beside(const std::filesystem::path& file, const SourceDocument& document,
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
    } catch (const Fault& fault) {
        return damaged(fault.what);
    } catch (const nlohmann::json::exception&) {
        return damaged(gltf::wrong_type);
    } catch (const std::out_of_range&) {
        return damaged("texture coordinates are missing.");
    }
}

} // namespace unseen::meshio
