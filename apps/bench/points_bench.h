// What usual requests keep of a model, what that takes, and what is seen of it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "bench_table.h"
#include "options.h"

namespace unseen::app {

struct PointsBenchOptions {
    std::vector<std::string> models; // meshes or trees; empty: the installed ones, or a made sphere
    std::optional<glm::dvec3> direction, up;
    TriangleCount budget = {.triangles = 10'000}; // at most those of the model
    int samples = 64;                             // a pixel, of what is judged
};

struct PointsBenchResult {
    std::vector<BenchTable> tables; // one a model
    Json points = Json::array();
};

// Every request on the default display: triangles of the mesh that 'unseen simplify' writes and of the picture that
// 'unseen render' draws, times, what two judges see, and the distance from which nobody sees a difference. Needs OpenGL.
Result<PointsBenchResult> bench_points(const PointsBenchOptions& options);

} // namespace unseen::app
