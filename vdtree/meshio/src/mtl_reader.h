// Material libraries of Wavefront OBJ.
#pragma once

#include "named_files.h"

namespace unseen::meshio {

struct MtlContents {
    std::vector<Material> materials;
    std::vector<Message> warnings;
    LostImages lost;
    std::vector<NamedFile> images; // that were found, each once
};

// Adds the materials of a Wavefront MTL file. `name`: the file's, for messages. `find` looks for an image by its name.
// Lines that make no sense are warnings: no material decides a shape. Returns the text with the names under which images
// are written again.
std::string read_mtl(std::string_view bytes, const std::string& name,
                     const FunctionRef<NamedFile(std::string_view)>& find, const std::filesystem::path& folder,
                     MtlContents& contents);

} // namespace unseen::meshio
