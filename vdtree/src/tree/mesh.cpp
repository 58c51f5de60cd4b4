// Checks and repairs of triangle soups.
#include <unseen/vdtree/mesh.h>

#include <unseen/vdtree/internal/vectors.h>

namespace unseen::vdtree {

namespace {

Error invalid(const std::string& what) { return {ErrorCode::malformed_data, what}; }

Result<void> check_ranges(const MeshView& mesh) {
    std::uint64_t previous_first = 0;
    for (std::size_t i = 0; i < mesh.ranges.size(); ++i) {
        const MeshRange& range = mesh.ranges[i];
        const std::uint64_t triangles = mesh.triangles.size();
        // Not first + count: that sum can wrap around.
        const std::string which = "Range " + std::to_string(i) + " ('" + range.name + "') of the mesh ";
        if (range.first_triangle > triangles || range.triangle_count > triangles - range.first_triangle)
            return invalid(which + "ends after the last of " + std::to_string(triangles) + " triangles; shorten it.");
        if (range.first_triangle < previous_first)
            return invalid(which + "starts before the range in front of it; order them by first triangle.");
        previous_first = range.first_triangle;
    }
    return {};
}

} // namespace

Result<void> validate(const MeshView& mesh) {
    const std::size_t vertices = mesh.positions.size();
    for (std::size_t i = 0; i < vertices; ++i)
        if (!is_finite(mesh.positions[i]))
            return invalid("Vertex " + std::to_string(i) +
                           " of the mesh has a NaN or infinite coordinate; remove it or give it a place.");
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
        for (const Index corner : mesh.triangles[i])
            if (corner >= vertices)
                return invalid("Triangle " + std::to_string(i) + " of the mesh uses vertex " + std::to_string(corner) +
                               ", but there are only " + std::to_string(vertices) + "; correct its indices.");
    for (const auto& [name, length] : {std::pair("normals", mesh.normals.size()),
                                       {"colours", mesh.colours.size()},
                                       {"UVs", mesh.uvs.size()},
                                       {"numbers of further values", mesh.further.size()},
                                       {"weights", mesh.weights.size()}})
        if (length != 0 && length != vertices)
            return invalid("The mesh has " + std::to_string(length) + " " + name + " for " + std::to_string(vertices) +
                           " vertices; give one for each vertex or none.");
    if (!mesh.smoothing.empty() && mesh.smoothing.size() != mesh.triangles.size())
        return invalid("The mesh has " + std::to_string(mesh.smoothing.size()) + " smoothing groups for " +
                       std::to_string(mesh.triangles.size()) + " triangles; give one for each triangle or none.");
    if (const auto wrong = std::ranges::find_if_not(mesh.weights, is_fold_weight); wrong != mesh.weights.end())
        return invalid("The weight of vertex " + std::to_string(wrong - mesh.weights.begin()) +
                       " of the mesh must be from 1 to 1000, or infinite for what never folds.");
    if (Result<void> checked = validate(mesh.texture); !checked) return checked;
    if (!mesh.texture.empty() && mesh.uvs.empty())
        return invalid(
            "The mesh has a texture but no UVs, which say where it lies; give one for each vertex or no texture.");
    return check_ranges(mesh);
}

std::uint64_t drop_degenerate_triangles(Mesh& mesh) {
    // Numbers of the dropped triangles: few as a rule, so that ranges are moved by a search in them.
    std::vector<std::uint64_t> dropped;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        if (uses_a_vertex_twice(mesh.triangles[i])) dropped.push_back(i);
        else {
            if (i < mesh.smoothing.size()) mesh.smoothing[kept] = mesh.smoothing[i];
            mesh.triangles[kept++] = mesh.triangles[i];
        }
    }
    if (dropped.empty()) return 0;
    mesh.triangles.resize(kept);
    if (!mesh.smoothing.empty()) mesh.smoothing.resize(kept);

    const auto dropped_before = [&](std::uint64_t triangle) {
        const auto found = std::lower_bound(dropped.begin(), dropped.end(), triangle);
        return static_cast<std::uint64_t>(found - dropped.begin());
    };
    for (MeshRange& range : mesh.ranges) {
        const std::uint64_t end = range.first_triangle + range.triangle_count;
        const std::uint64_t new_end = end - dropped_before(end);
        range.first_triangle -= dropped_before(range.first_triangle);
        range.triangle_count = new_end - range.first_triangle;
    }
    std::erase_if(mesh.ranges, [](const MeshRange& range) { return range.triangle_count == 0; });
    return dropped.size();
}

} // namespace unseen::vdtree
