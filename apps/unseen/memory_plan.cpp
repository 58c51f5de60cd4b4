#include "memory_plan.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "paged_memory.h"
#include "terminal.h"

namespace unseen::app {
namespace {

constexpr double bytes_of_gib = 1 << 30;
constexpr double most_gib = 1 << 20; // more than any machine has

// Measured as the highest resident set of whole builds with one thread: bunny, dragon, and the dragon with four times
// the triangles; the program and its libraries, and bytes for each triangle and its half a vertex.
constexpr std::uint64_t program_bytes = std::uint64_t{32} << 20;
constexpr std::uint64_t quadric_triangle_bytes = 260, octree_triangle_bytes = 190;
// Meshes with more vertices than closed surfaces, and with attributes.
constexpr std::uint64_t vertex_bytes = 200;

// What is not paged: blocks that are too small for it, and what each thread works on.
constexpr std::uint64_t least_program_bytes = std::uint64_t{64} << 20;
constexpr std::uint64_t least_thread_bytes = std::uint64_t{16} << 20;
constexpr std::uint64_t least_triangle_bytes = 16;

Error too_small(std::uint64_t least, double gib) {
    const double needed = std::ceil(static_cast<double>(least) / bytes_of_gib * 100) / 100; // two digits, rounded up
    return {ErrorCode::invalid_argument, "--memory " + rounded(gib, 3) +
                                             " GiB is too small for this: it takes at least " + shortest(needed) +
                                             " GiB."};
}

} // namespace

std::uint64_t unlimited_peak(const vdtree::MeshView& mesh, vdtree::ClustererKind clusterer) {
    const std::uint64_t triangles = mesh.triangles.size(), vertices = mesh.positions.size();
    const std::uint64_t usual = triangles / 2; // of a closed surface
    const bool octree = clusterer == vdtree::ClustererKind::octree;
    return program_bytes + 2 * mesh.document.size() +
           triangles * (octree ? octree_triangle_bytes : quadric_triangle_bytes) +
           (vertices > usual ? vertices - usual : 0) * vertex_bytes;
}

std::uint64_t least_memory(std::size_t triangles, int threads) {
    return least_program_bytes + static_cast<std::uint64_t>(threads) * least_thread_bytes +
           triangles * least_triangle_bytes;
}

Result<MemoryLimit> MemoryLimit::set(double gib, const std::filesystem::path& out, int threads) {
    MemoryLimit limit;
    if (!(gib > 0)) return limit;
    limit.bytes_ = static_cast<std::uint64_t>(std::min(gib, most_gib) * bytes_of_gib);
    limit.threads_ = threads;
    if (const std::uint64_t least = least_memory(0, threads); !(limit.bytes_ >= least)) return too_small(least, gib);
    if (const auto ok = start_paging(out.parent_path(), limit.bytes_); !ok) return ok.error();
    return limit;
}

Result<void> MemoryLimit::plan_for(const vdtree::MeshView& mesh, vdtree::ClustererKind clusterer) const {
    if (bytes_ == 0) return {};
    if (const std::uint64_t least = least_memory(mesh.triangles.size(), threads_); bytes_ < least)
        return too_small(least, static_cast<double>(bytes_) / bytes_of_gib);
    if (unlimited_peak(mesh, clusterer) <= bytes_) page_no_more();
    return {};
}

} // namespace unseen::app
