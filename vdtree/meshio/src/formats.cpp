#include "formats.h"

#include <algorithm>

#include "file_output.h"
#include "text_scanner.h"

namespace unseen::meshio {

namespace {

bool is_ply(std::string_view bytes) { return bytes.starts_with("ply") && bytes.size() > 3 && is_space(bytes[3]); }
bool is_glb(std::string_view bytes) { return bytes.starts_with("glTF"); }

constexpr Format all[] = {
    // name, endings, signature, reader, writer, values of vertices, materials
    {"PLY", {".ply", ""}, is_ply, read_ply, write_ply, true, false},
    {"OBJ", {".obj", ""}, nullptr, read_obj, write_obj, false, true},
    {"glTF", {".glb", ".gltf"}, is_glb, read_gltf, write_gltf, false, true},
    {"VTP", {".vtp", ""}, is_vtk_xml, read_vtp, write_vtp, true, false},
    {"STL", {".stl", ""}, nullptr, read_stl, write_stl, false, false},
    {"OFF", {".off", ""}, starts_with_off_keyword, read_off, write_off, false, false},
};

} // namespace

std::span<const Format> formats() { return all; }

const Format* format_named(const std::filesystem::path& file) {
    const std::string ending = lower_ending(file);
    for (const Format& format : all)
        if (!ending.empty() && std::find(format.endings.begin(), format.endings.end(), ending) != format.endings.end())
            return &format;
    return nullptr;
}

std::vector<std::string> written_endings() {
    std::vector<std::string> endings;
    for (const Format& format : all)
        for (const std::string_view ending : format.endings)
            if (!ending.empty()) endings.emplace_back(ending);
    return endings;
}

} // namespace unseen::meshio
