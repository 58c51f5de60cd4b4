// What the command does by libraries that a build may lack: OpenMesh's clusterer, CGAL's repair and exact checks.
#pragma once

#include <cstdint>
#include <string>

#include <unseen/vdtree/builder.h>

#include "report.h"

namespace unseen::app {

// Whether this build has them. Without, the functions below fail, and say how to get them.
bool has_openmesh() noexcept;

bool has_cgal() noexcept;

Result<vdtree::VertexTree> build_by_openmesh(const vdtree::MeshView& mesh, const vdtree::BuildOptions& options);

// `unseen build --repair`: see unseen::repair.
struct Repaired {
    vdtree::Mesh mesh;
    Json json;
    std::string sentence; // what was done, for people
};
Result<Repaired> repair_by_cgal(vdtree::Mesh&& mesh, double gap, double largest_hole);

// `unseen info --verify --exact`: see unseen::exact.
struct ExactCheck {
    std::uint64_t comparisons = 0, in_rationals = 0;
};
Result<ExactCheck> verify_by_cgal(const vdtree::VertexTree& tree, const Progress& progress);

// For `--version`: the libraries of this build whose licences bind it, one line each; empty where none do.
std::string licence_notes();

} // namespace unseen::app
