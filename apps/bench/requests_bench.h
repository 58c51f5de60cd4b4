// What usual requests keep of a model, what that takes, and what is seen of it.
#pragma once

#include <string>

#include "bench_table.h"

namespace unseen::app {

struct RequestsBenchResult {
    BenchTable table;
    Json requests = Json::array();
};

// Of a mesh or a tree, in the default view on the default display. Of each request: the triangles of the mesh that
// 'unseen simplify' writes and of the picture that 'unseen render' draws, the time of the first cut, the pixels of the
// picture that differ visibly from the full model's, and from where the difference is invisible. Needs OpenGL.
Result<RequestsBenchResult> bench_requests(const std::string& model);

} // namespace unseen::app
