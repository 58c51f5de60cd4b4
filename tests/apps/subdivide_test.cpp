// Subdivision: no crack anywhere, counts as asked for, attributes and ranges where they belong.

#include "build/leaves.h"
#include "build/surface.h"
#include "shapes.h"
#include "subdivide.h"
#include "testing.h"

namespace subdivide_test {

using namespace unseen;
using app::subdivide;
using app::SubdivideOptions;
using vdtree::Closedness;
using vdtree::Mesh;

Closedness closedness(const Mesh& mesh) {
    const vdtree::MeshView view = mesh.view();
    return vdtree::analyse_surface(vdtree::PlaceMesh(view).mesh()).closedness;
}

Mesh subdivided(const Mesh& mesh, const SubdivideOptions& options) {
    auto result = subdivide(mesh, options);
    EXPECT_TRUE(result) << result.error().message;
    return result ? std::move(*result) : Mesh{};
}

SubdivideOptions rounds(int times, double noise = SubdivideOptions::default_noise) {
    SubdivideOptions options;
    options.times = times;
    options.noise = noise;
    return options;
}

SubdivideOptions up_to(std::uint64_t triangles, double noise = SubdivideOptions::default_noise) {
    SubdivideOptions options;
    options.triangles = triangles;
    options.noise = noise;
    return options;
}

double area(const Mesh& mesh, std::uint64_t first, std::uint64_t count) {
    double sum = 0;
    for (std::uint64_t t = first; t < first + count; ++t) {
        const auto& [a, b, c] = mesh.triangles[t];
        sum +=
            glm::length(glm::cross(mesh.positions[b] - mesh.positions[a], mesh.positions[c] - mesh.positions[a])) / 2;
    }
    return sum;
}

double area(const Mesh& mesh) { return area(mesh, 0, mesh.triangles.size()); }

TEST(Subdivide, ClosedMeshesStayClosed) {
    const std::vector<Mesh> closed = {shapes::icosphere(2),
                                      shapes::torus(24, 10),
                                      shapes::cube(3),
                                      shapes::unwelded(shapes::bumpy_sphere(2)),
                                      shapes::in_floats(shapes::bumpy_sphere(2)),
                                      shapes::placed(shapes::bumpy_sphere(2), 30, {5.0e5, 5.0e6, 120})};
    for (const Mesh& mesh : closed) {
        ASSERT_EQ(closedness(mesh), Closedness::closed_outward);
        const std::uint64_t n = mesh.triangles.size();
        const Mesh twice = subdivided(mesh, rounds(2));
        EXPECT_EQ(twice.triangles.size(), n * 16);
        EXPECT_EQ(closedness(twice), Closedness::closed_outward);
        for (const std::uint64_t wanted : {n + 2, n + n / 3, 2 * n, 3 * n + 1, 4 * n, 5 * n + 7}) {
            const Mesh some = subdivided(mesh, up_to(wanted));
            EXPECT_LE(some.triangles.size(), wanted);
            EXPECT_GE(some.triangles.size() + 3, wanted) << "two triangles around an edge, one edge short at most";
            EXPECT_EQ(closedness(some), Closedness::closed_outward) << wanted << " of " << n;
        }
    }
    EXPECT_EQ(closedness(subdivided(shapes::inside_out(shapes::torus(12, 8)), rounds(1))), Closedness::closed_inward);
}

TEST(Subdivide, SharesVerticesWithoutWelding) {
    const Mesh mesh = shapes::torus(24, 10); // Euler characteristic 0: as many vertices as half the triangles
    const Mesh twice = subdivided(mesh, rounds(2));
    EXPECT_EQ(twice.positions.size(), twice.triangles.size() / 2);
}

TEST(Subdivide, WithoutNoiseTheSurfaceIsTheSame) {
    const Mesh mesh = shapes::with_attributes(shapes::bumpy_sphere(2));
    for (const SubdivideOptions& options : {rounds(2, 0), up_to(mesh.triangles.size() * 7 / 2, 0)}) {
        const Mesh finer = subdivided(mesh, options);
        EXPECT_NEAR(area(finer), area(mesh), 1e-9);
        ASSERT_EQ(finer.ranges.size(), mesh.ranges.size());
        for (std::size_t i = 0; i < mesh.ranges.size(); ++i) {
            const auto &before = mesh.ranges[i], &after = finer.ranges[i];
            EXPECT_EQ(after.name, before.name);
            EXPECT_NEAR(area(finer, after.first_triangle, after.triangle_count),
                        area(mesh, before.first_triangle, before.triangle_count), 1e-9);
        }
        EXPECT_TRUE(vdtree::validate(finer.view()));
        EXPECT_TRUE(finer.normals.empty());
    }
}

TEST(Subdivide, NoiseMovesNewVerticesByItsShareOfTheEdge) {
    Mesh mesh = shapes::single_triangle();
    const Mesh flat = subdivided(mesh, rounds(1, 0)), rough = subdivided(mesh, rounds(1, 0.5));
    ASSERT_EQ(rough.positions.size(), 6u);
    double largest = 0;
    for (std::size_t v = 0; v < 6; ++v) {
        const double moved = glm::length(rough.positions[v] - flat.positions[v]);
        if (v < 3) EXPECT_EQ(moved, 0) << "the mesh's own vertices stay";
        EXPECT_LE(moved, 0.5 * std::sqrt(2.0) + 1e-12);
        largest = std::max(largest, moved);
    }
    EXPECT_GT(largest, 0.01);
    SubdivideOptions other = rounds(1, 0.5);
    other.seed = 2;
    EXPECT_NE(subdivided(mesh, other).positions, rough.positions);
    EXPECT_EQ(subdivided(mesh, rounds(1, 0.5)).positions, rough.positions);
}

TEST(Subdivide, InterpolatesAttributes) {
    const Mesh mesh = shapes::with_attributes(shapes::single_triangle());
    const Mesh finer = subdivided(mesh, rounds(1));
    ASSERT_EQ(finer.colours.size(), 6u);
    ASSERT_EQ(finer.uvs.size(), 6u);
    // The corner triangle at the first vertex: itself and the middles of its edges.
    const auto& corner = finer.triangles[0];
    EXPECT_EQ(finer.colours[corner[1]],
              (mesh.colours[mesh.triangles[0][0]] + mesh.colours[mesh.triangles[0][1]]) * 0.5f);
    EXPECT_EQ(finer.uvs[corner[2]], (mesh.uvs[mesh.triangles[0][0]] + mesh.uvs[mesh.triangles[0][2]]) * 0.5f);
}

TEST(Subdivide, TakesAnyMesh) {
    for (const shapes::Named& shape : shapes::all()) {
        const Mesh finer = subdivided(shape.mesh, rounds(1));
        EXPECT_TRUE(vdtree::validate(finer.view())) << shape.name;
        EXPECT_EQ(finer.triangles.size(), shape.mesh.triangles.size() * 4) << shape.name;
        const Mesh some = subdivided(shape.mesh, up_to(shape.mesh.triangles.size() * 2));
        EXPECT_TRUE(vdtree::validate(some.view())) << shape.name;
        EXPECT_LE(some.triangles.size(), shape.mesh.triangles.size() * 2) << shape.name;
    }
    const Mesh largest = shapes::placed(shapes::icosphere(1), std::numeric_limits<double>::max() / 2);
    EXPECT_TRUE(vdtree::validate(subdivided(largest, rounds(1)).view()));
}

TEST(Subdivide, RefusesWhatCannotBe) {
    const Mesh mesh = shapes::icosphere(1);
    const auto message = [&](const SubdivideOptions& options) {
        const auto result = subdivide(mesh, options);
        return result ? "" : result.error().message;
    };
    EXPECT_THAT(message(up_to(10)), testing::HasSubstr("80 triangles already"));
    EXPECT_THAT(message(rounds(-1)), testing::HasSubstr("not -1"));
    EXPECT_THAT(message(rounds(17)), testing::HasSubstr("0 to 16 times"));
    EXPECT_THAT(message(rounds(16)), testing::HasSubstr("indices can count"));
    EXPECT_THAT(message(rounds(1, std::nan(""))), testing::HasSubstr("noise"));
    EXPECT_THAT(message(rounds(1, 1.5)), testing::HasSubstr("noise"));
    SubdivideOptions cancelled = rounds(1);
    const auto stop = [](double, const char*) { return false; };
    cancelled.progress = stop;
    EXPECT_EQ(subdivide(mesh, cancelled).error().code, ErrorCode::cancelled);
}

} // namespace subdivide_test
