// How far simplified surfaces stray, against meshoptimizer at equal triangle count: the bumpy sphere, loose leaves,
// and, from the folder UNSEEN_EXTRA_MESHES, the Stanford dragon and bunny.
#include <unseen/vdtree/builder.h>

#include <iostream>

#ifdef UNSEEN_TEST_WITH_MESHOPTIMIZER
#include <meshoptimizer.h>
#endif

#include <unseen/meshio/mesh_file.h>

#include "clustering_tools.h"
#include "extra_meshes.h"
#include "shapes.h"
#include "surface_distance.h"
#include "temp_folder.h"
#include "testing.h"

namespace unseen::vdtree {
namespace {

#ifdef UNSEEN_TEST_WITH_MESHOPTIMIZER

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
    const auto clustering = require(cluster_quadric(task.input()));
    const Mesh theirs = simplified_by_meshoptimizer(mesh, triangles, sloppy);
    ASSERT_FALSE(theirs.triangles.empty());
    const Mesh ours = support::simplified_by_deviation(mesh.view(), *clustering, theirs.triangles.size());
    ASSERT_FALSE(ours.triangles.empty());
    // Means over vertices of the original.
    const double their_distance = app::mean_surface_distance(mesh, theirs),
                 our_distance = app::mean_surface_distance(mesh, ours);
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
            auto mesh = require(meshio::read_mesh(support::uncompressed(file, scratch.path())));
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
