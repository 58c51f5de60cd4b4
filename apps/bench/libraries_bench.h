// OpenMesh's clusterer beside ours, and CGAL's repair, on meshes as they come.
#pragma once

#include <string>
#include <vector>

#include "bench_table.h"

namespace unseen::app {

struct LibrariesBenchResult {
    BenchTable table;
    Json rows = Json::array();
};

// Builds each mesh with each clusterer, as it is and repaired, by the command `unseen` of this build. Of each: what is
// left of borders and of edges that are not manifold or not consistent, how far the cut to a tenth of the triangles
// strays, and the time and memory of the whole process.
Result<LibrariesBenchResult> bench_libraries(const std::vector<std::string>& meshes);

} // namespace unseen::app
