// How much memory a build takes, and the limit that it is to keep to.
#pragma once

#include <cstdint>
#include <filesystem>

#include <unseen/vdtree/builder.h>

namespace unseen::app {

// The peak of a build that nothing limits, the mesh included; an estimate that lies above what was measured. Bytes.
std::uint64_t unlimited_peak(const vdtree::MeshView& mesh, vdtree::ClustererKind clusterer);

// What a build needs to have in memory at least, whatever is paged: an estimate likewise. Bytes.
std::uint64_t least_memory(std::size_t triangles, int threads);

// Keeps the process below a limit by paging (paged_memory.h). To be made before the mesh is read.
class MemoryLimit {
public:
    // 0 GiB: none. Temporary data lie in the folder of `out`. Fails where no mesh could be built with so little.
    static Result<MemoryLimit> set(double gib, const std::filesystem::path& out, int threads);

    // When the mesh is known: fails where the limit is too small for it; pages nothing more where that is not needed.
    Result<void> plan_for(const vdtree::MeshView& mesh, vdtree::ClustererKind clusterer) const;

private:
    std::uint64_t bytes_ = 0; // 0: none
    int threads_ = 1;
};

} // namespace unseen::app
