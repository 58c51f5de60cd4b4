// What writers of cuts share.
#pragma once

#include <unseen/meshio/source_document.h>

#include "gltf_document.h"

namespace unseen::meshio {

Error failed_to_write(const std::filesystem::path& file, const std::string& why);

// Writes what lay beside the mesh beside this file. What is there already must be the same.
Result<void> write_beside(const std::filesystem::path& file, const SourceDocument& document,
                          std::vector<Message>& notes);

// ---- source documents of one format as those of the other, as far as it can say the same

// The materials of OBJ libraries as glTF materials, objects as nodes. What got lost is told in the notes.
SourceDocument as_gltf(SourceDocument document, std::vector<Message>& notes);

// The materials of glTF as a library LIBRARY.mtl, its nodes as objects, all in the world's frame; images that lay in
// the file become files beside it. May throw what nlohmann::json and the glTF reader throw.
SourceDocument as_obj(SourceDocument document, const std::string& library, std::vector<Message>& notes);

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
