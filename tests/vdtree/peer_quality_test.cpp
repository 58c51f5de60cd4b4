// How far simplified surfaces stray, against meshoptimizer at equal triangle count: the bumpy sphere, loose leaves,
// and, from the folder UNSEEN_EXTRA_MESHES, the Stanford dragon and bunny.
#include <unseen/vdtree/builder.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <random>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <gtest/gtest.h>
#ifdef UNSEEN_TEST_WITH_MESHOPTIMIZER
#include <meshoptimizer.h>
#endif

#include <unseen/meshio/mesh_io.h>

#include "clustering_tools.h"
#include "extra_meshes.h"
#include "shapes.h"
#include "temp_folder.h"
#include "triangle_distance.h"

namespace unseen::vdtree {
namespace {

#ifdef UNSEEN_TEST_WITH_MESHOPTIMIZER

// The triangles by the cells of a cubic grid that their boxes meet.
class TriangleGrid {
public:
    explicit TriangleGrid(const Mesh& mesh) : mesh_(mesh) {
        glm::dvec3 high = low_ = mesh.positions[mesh.triangles[0][0]];
        for (const Triangle& t : mesh.triangles) {
            for (const Index v : t) {
                low_ = glm::min(low_, mesh.positions[v]);
                high = glm::max(high, mesh.positions[v]);
            }
        }
        const glm::dvec3 size = high - low_;
        cell_ = std::max({size.x, size.y, size.z}) / cells;
        lists_.resize(cells * cells * cells);
        for (Index t = 0; t < mesh.triangles.size(); ++t) {
            const auto p = [&](std::size_t k) { return mesh.positions[mesh.triangles[t][k]]; };
            const glm::ivec3 from = cell_of(glm::min(p(0), glm::min(p(1), p(2))));
            const glm::ivec3 to = cell_of(glm::max(p(0), glm::max(p(1), p(2))));
            for (int z = from.z; z <= to.z; ++z)
                for (int y = from.y; y <= to.y; ++y)
                    for (int x = from.x; x <= to.x; ++x) list(x, y, z).push_back(t);
        }
    }

    // Looks through shells of cells around the point's until none farther out can hold anything nearer.
    double distance(glm::dvec3 p) {
        const glm::ivec3 c = cell_of(p);
        const double outside = glm::distance(p, glm::clamp(p, low_, low_ + cell_ * cells)); // from the grid
        double nearest = std::numeric_limits<double>::infinity();
        for (int r = 0; r < cells && nearest > std::max(outside, (r - 1) * cell_); ++r) {
            const glm::ivec3 from = glm::max(c - r, glm::ivec3(0)), to = glm::min(c + r, glm::ivec3(cells - 1));
            for (int z = from.z; z <= to.z; ++z) {
                for (int y = from.y; y <= to.y; ++y) {
                    for (int x = from.x; x <= to.x; ++x) {
                        if (std::max({std::abs(x - c.x), std::abs(y - c.y), std::abs(z - c.z)}) != r) continue;
                        for (const Index t : list(x, y, z)) nearest = std::min(nearest, distance_to(p, t));
                    }
                }
            }
        }
        return nearest;
    }

private:
    static constexpr int cells = 64;
    glm::ivec3 cell_of(glm::dvec3 p) const {
        return glm::clamp(glm::ivec3(glm::floor((p - low_) / cell_)), glm::ivec3(0), glm::ivec3(cells - 1));
    }
    std::vector<Index>& list(int x, int y, int z) {
        return lists_[static_cast<std::size_t>((z * cells + y) * cells + x)];
    }
    double distance_to(glm::dvec3 p, Index t) const {
        const Triangle& tri = mesh_.triangles[t];
        return support::distance_to_triangle(p, mesh_.positions[tri[0]], mesh_.positions[tri[1]],
                                             mesh_.positions[tri[2]]);
    }

    const Mesh& mesh_;
    glm::dvec3 low_;
    double cell_;
    std::vector<std::vector<Index>> lists_;
};

// Mean distance of (a sample of) the original vertices from the simplified surface, as a share of the extent.
double mean_distance(const Mesh& original, const Mesh& simple) {
    glm::dvec3 low = original.positions[0], high = low;
    for (const glm::dvec3& p : original.positions) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    const glm::dvec3 size = high - low;
    TriangleGrid grid(simple);
    constexpr std::size_t sample = 50000;
    const std::size_t step = original.positions.size() / sample | 1; // odd: not the same corner of every quad
    double sum = 0, count = 0;
    for (std::size_t v = 0; v < original.positions.size(); v += step, ++count)
        sum += grid.distance(original.positions[v]);
    return sum / count / std::max({size.x, size.y, size.z});
}

Mesh simplified_by_meshoptimizer(const Mesh& mesh, std::size_t triangles, bool sloppy) {
    std::vector<float> positions;
    for (const glm::dvec3& p : mesh.positions)
        for (int k = 0; k < 3; ++k) positions.push_back(static_cast<float>(p[k]));
    const std::size_t vertices = mesh.positions.size(), corners = mesh.triangles.size() * 3;
    const unsigned* indices = mesh.triangles[0].data();
    std::vector<unsigned> out(corners);
    constexpr float any_error = 1e9f;
    const std::size_t left = sloppy ? meshopt_simplifySloppy(out.data(), indices, corners, positions.data(), vertices,
                                                             3 * sizeof(float), triangles * 3, any_error, nullptr)
                                    : meshopt_simplify(out.data(), indices, corners, positions.data(), vertices,
                                                       3 * sizeof(float), triangles * 3, any_error, 0, nullptr);
    Mesh simple;
    simple.positions = mesh.positions;
    for (std::size_t i = 0; i < left; i += 3) simple.triangles.push_back({out[i], out[i + 1], out[i + 2]});
    return simple;
}

void compare(const char* what, const Mesh& mesh, std::size_t triangles, bool sloppy) {
    const support::ClusteringTask task(mesh);
    const auto clustering = cluster_quadric(task.input());
    ASSERT_TRUE(clustering);
    const Mesh theirs = simplified_by_meshoptimizer(mesh, triangles, sloppy);
    ASSERT_FALSE(theirs.triangles.empty());
    const Mesh ours = support::simplified_by_deviation(mesh, *clustering, theirs.triangles.size());
    ASSERT_FALSE(ours.triangles.empty());
    const double their_distance = mean_distance(mesh, theirs), our_distance = mean_distance(mesh, ours);
    std::cout << what << ": " << mesh.triangles.size() << " triangles to " << ours.triangles.size()
              << ", mean distance " << our_distance << " of the extent, meshoptimizer " << their_distance << " ("
              << theirs.triangles.size() << " triangles), ratio " << our_distance / their_distance << '\n';
    EXPECT_LE(our_distance, their_distance);
}

// So many rectangles of two triangles, strewn in a ball.
Mesh leaves(int count) {
    std::mt19937_64 random(1);
    Mesh m;
    for (int i = 0; i < count; ++i) {
        const glm::dvec3 centre = std::cbrt(shapes::random_unit(random)) * shapes::random_direction(random);
        const glm::dvec3 normal = shapes::random_direction(random);
        const glm::dvec3 along = 0.01 * glm::normalize(glm::cross(normal, shapes::random_direction(random)));
        const glm::dvec3 across = 0.5 * glm::cross(normal, along);
        const Index first = static_cast<Index>(m.positions.size());
        for (const glm::dvec3& corner : {-along - across, along - across, along + across, across - along})
            m.positions.push_back(centre + corner);
        m.triangles.push_back({first, first + 1, first + 2});
        m.triangles.push_back({first, first + 2, first + 3});
    }
    return m;
}

TEST(PeerQuality, BumpySphere) {
    Mesh mesh = shapes::icosphere(6);
    for (glm::dvec3& p : mesh.positions) p *= 1 + 0.03 * std::sin(9 * p.x) * std::sin(11 * p.y) * std::cos(7 * p.z);
    compare("bumpy sphere", mesh, 12000, false);
    compare("bumpy sphere", mesh, 2500, false);
}

TEST(PeerQuality, LooseLeaves) { compare("leaves", leaves(50000), 18000, true); }

struct Scan {
    const char* file; // in UNSEEN_EXTRA_MESHES, perhaps compressed
    std::vector<std::size_t> triangles;
};

TEST(PeerQuality, Scans) {
    const Scan scans[] = {{"dragon.ply", {46000, 9600}}, {"bunny.ply", {13000}}};
    const support::TempFolder scratch;
    std::size_t found = 0;
    for (const std::filesystem::path& file : support::extra_meshes()) {
        for (const Scan& scan : scans) {
            const std::string name = file.filename().string();
            if (name != scan.file && name != std::string(scan.file) + ".zst") continue;
            auto mesh = meshio::read_mesh(support::uncompressed(file, scratch.path()));
            ASSERT_TRUE(mesh) << mesh.error().message;
            for (const std::size_t triangles : scan.triangles) compare(scan.file, mesh->mesh, triangles, false);
            ++found;
        }
    }
    if (found == 0) GTEST_SKIP() << "no dragon.ply or bunny.ply in the folder that UNSEEN_EXTRA_MESHES names";
}

#else
TEST(PeerQuality, NeedsMeshoptimizer) { GTEST_SKIP() << "meshoptimizer was not found"; }
#endif

} // namespace
} // namespace unseen::vdtree
