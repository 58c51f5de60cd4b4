#include "made_scenes.h"

#include <utility>

#include <unistd.h>

#include "make_scene.h"

namespace unseen::app {

MadeScenes::MadeScenes()
    : folder_(std::filesystem::temp_directory_path() / ("unseen-scenes-" + std::to_string(getpid()))) {}

MadeScenes::~MadeScenes() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
}

Result<void> MadeScenes::make_folder() const {
    std::error_code failed;
    std::filesystem::create_directories(folder_, failed);
    if (failed)
        return Error{ErrorCode::io_failure,
                     "Cannot make the folder '" + folder_.string() + "': " + failed.message() + "."};
    return {};
}

Result<std::vector<std::string>> MadeScenes::make_to_select_in(std::uint64_t triangles,
                                                               const std::vector<std::string>& statues) const {
    if (auto made = make_folder(); !made) return made.error();
    std::vector<std::string> files;
    for (const auto& [kind, name] : {std::pair{SceneKind::spheres, "spheres.glb"},
                                     {SceneKind::bunnies, "bunnies.glb"},
                                     {SceneKind::models, "models.glb"}}) {
        MakeSceneOptions options;
        options.kind = kind;
        options.triangles = triangles;
        options.statues.assign(statues.begin(), statues.end());
        files.push_back(file(name));
        if (const auto made = make_scene(files.back(), options); !made) return made.error();
    }
    return files;
}

Result<std::vector<std::string>> MadeScenes::make(std::uint64_t triangles) const {
    if (auto made = make_folder(); !made) return made.error();
    std::vector<std::string> files;
    for (const auto& [kind, name] : {std::pair{SceneKind::museum, "museum"},
                                     {SceneKind::treasure, "treasure"},
                                     {SceneKind::house, "house"},
                                     {SceneKind::forest, "forest"}}) {
        MakeSceneOptions options;
        options.kind = kind;
        options.triangles = triangles;
        files.push_back((folder_ / (std::string(name) + ".glb")).string());
        if (const auto made = make_scene(files.back(), options); !made) return made.error();
    }
    return files;
}

} // namespace unseen::app
