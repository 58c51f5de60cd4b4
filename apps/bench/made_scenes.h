// The four scenes of `unseen scene make`, for benchmarks.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <vdtree/result.h>

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

private:
    std::filesystem::path folder_;
};

} // namespace unseen::app
