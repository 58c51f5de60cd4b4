// What masking and occlusion save in scenes, what shows of it, and what discrete levels of detail make of the same.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "bench_table.h"

namespace unseen::app {

struct ScenesBenchOptions {
    std::vector<std::string> scenes; // glTF files; empty: the four of `unseen make scene`, of about `triangles` each
    std::uint64_t triangles = 500'000;
    int window_px = 512;
    int samples = 64;        // a pixel of what is judged
    bool has_shadows = true; // where lights of the scenes cast some
    int path_frames = 24;    // of the walk that times and renderings are summed over
};

struct ScenesBenchResult {
    std::vector<BenchTable> tables; // of triangles and visible pixels; of renderings by level; of times
    Json rows = Json::array(), walks = Json::array();
};

// Each scene from its camera, with its lights. Everything is judged against the full scene. Fails where a scene has no
// camera.
Result<ScenesBenchResult> bench_scenes(const ScenesBenchOptions& options);

} // namespace unseen::app
