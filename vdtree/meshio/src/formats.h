// The formats of mesh files, a line each: how they are known, read and written.
#pragma once

#include <array>
#include <filesystem>
#include <span>
#include <string_view>

#include "mesh_readers.h"
#include "mesh_writers.h"

namespace unseen::meshio {

struct Format {
    std::string_view name; // for people
    std::array<std::string_view, 2> endings;
    bool (*has_signature)(std::string_view bytes); // null: the format has none
    ReadResult (*read)(const MeshSource& source);  // throws Fault
    Result<void> (*write)(const MeshToWrite& mesh);
    bool holds_values;    // of vertices
    bool holds_materials; // and nodes: write_cut() writes such files from source documents
};

std::span<const Format> formats();

// The format of a file's name, by its ending, or null.
const Format* format_named(const std::filesystem::path& file);

} // namespace unseen::meshio
