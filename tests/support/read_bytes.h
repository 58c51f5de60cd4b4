// Reads meshes from memory, as tests expect them to be read or refused.
#pragma once

#include <unseen/meshio/mesh_file.h>

#include "testing.h"

namespace unseen::support {

inline meshio::ReadResult read(const std::string& bytes, const std::string& name,
                               const meshio::ReadOptions& options = {}) {
    Result<meshio::ReadResult> result = meshio::read_mesh_bytes(bytes, name, options);
    EXPECT_TRUE(result) << result.error().message;
    return result ? std::move(*result) : meshio::ReadResult{};
}

inline std::string error_of(const std::string& bytes, const std::string& name) {
    const Result<meshio::ReadResult> result = meshio::read_mesh_bytes(bytes, name);
    EXPECT_FALSE(result) << name << " was read";
    return result ? "" : result.error().message;
}

} // namespace unseen::support
