// Scenes of `unseen make scene`, for benchmarks.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <unseen/vdtree/result.h>

namespace unseen::app {

// A folder that goes with this.
class MadeScenes {
public:
    MadeScenes();
    MadeScenes(const MadeScenes&) = delete;
    MadeScenes& operator=(const MadeScenes&) = delete;
    ~MadeScenes();

    // museum.glb, treasure.glb, house.glb and forest.glb, of about so many triangles each. Fails as make_scene() does.
    Result<std::vector<std::string>> make(std::uint64_t triangles) const;
    // spheres.glb, bunnies.glb and models.glb, with these statues; 0 triangles: as the kinds have them.
    Result<std::vector<std::string>> make_to_select_in(std::uint64_t triangles,
                                                       const std::vector<std::string>& statues) const;

    Result<void> make_folder() const;                                                     // where it is not there yet
    std::string file(const std::string& name) const { return (folder_ / name).string(); } // another one in the folder

private:
    std::filesystem::path folder_;
};

} // namespace unseen::app
