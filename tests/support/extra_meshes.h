// The folder of further meshes that UNSEEN_EXTRA_MESHES names; files may be compressed with zstd.
#pragma once

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace unseen::support {

// Empty where the variable is not set.
inline std::filesystem::path extra_mesh_folder() {
    const char* folder = std::getenv("UNSEEN_EXTRA_MESHES");
    return folder ? folder : "";
}

// All mesh files in the folder and in those below it, compressed or not, in alphabetic order.
inline std::vector<std::filesystem::path> extra_meshes() {
    constexpr std::array<std::string_view, 6> endings = {".ply", ".obj", ".off", ".stl", ".gltf", ".glb"};
    std::vector<std::filesystem::path> files;
    if (extra_mesh_folder().empty()) return files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(extra_mesh_folder())) {
        const std::filesystem::path file = entry.path();
        const std::string ending = (file.extension() == ".zst" ? file.stem() : file).extension().string();
        if (entry.is_regular_file() && std::find(endings.begin(), endings.end(), ending) != endings.end())
            files.push_back(file);
    }
    std::sort(files.begin(), files.end());
    return files;
}

// The file itself, or what the program zstd makes of it in the folder `scratch`; empty where that fails.
inline std::filesystem::path uncompressed(const std::filesystem::path& file, const std::filesystem::path& scratch) {
    if (file.extension() != ".zst") return file;
    const std::filesystem::path plain = scratch / file.stem();
    const std::string command = "zstd -q -d -f -o '" + plain.string() + "' '" + file.string() + "'";
    return std::system(command.c_str()) == 0 ? plain : std::filesystem::path();
}

} // namespace unseen::support
