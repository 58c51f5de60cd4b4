// Two ways to spend one triangle budget, side by side: node extent, and the perceptual fold test. After figure 5 of
// Luebke and Hallen 2001.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include <unseen/vdtree/vertex_tree.h>

#include "bench_table.h"
#include "options.h"

namespace unseen::app {

struct BudgetBenchOptions {
    std::string mesh;    // or a tree
    std::string picture; // of the two wireframes, side by side; empty: none
    TriangleCount triangles = {.triangles = 18'000};
    glm::dvec3 direction = {1, 0, 0}; // from the model towards the eye; not 0
    std::optional<glm::dvec3> up;     // in the picture; not along the direction; default: +Y, or -Z where that is
};

// Of each: triangles; pixels that differ visibly from the full model, and their largest V; and the share of triangles
// with a corner within four pixels of the full model's contour.
struct BudgetBenchResult {
    BenchTable table;
    Json tests = Json::array();
};

// Needs OpenGL.
Result<BudgetBenchResult> bench_budget(const BudgetBenchOptions& options);

} // namespace unseen::app
