// Source documents of one format as those of the other, as far as it can say the same.
#pragma once

#include <unseen/meshio/source_document.h>

namespace unseen::meshio {

// The materials of OBJ libraries as glTF materials, objects as nodes. What got lost is told in the notes.
SourceDocument as_gltf(SourceDocument document, std::vector<Message>& notes);

// The materials of glTF as a library LIBRARY.mtl, its nodes as objects, all in the world's frame; images that lay in
// the file become files beside it. May throw what nlohmann::json and the glTF reader throw.
SourceDocument as_obj(SourceDocument document, const std::string& library, std::vector<Message>& notes);

} // namespace unseen::meshio
