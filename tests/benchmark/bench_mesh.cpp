#include "bench_mesh.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>

#include <perception/display.h>
#include <vdtree/builder.h>
#include <vdtree/mesh_io.h>

namespace unseen::bench {

namespace {

vdtree::Mesh bumpy_sphere(int rows) {
    vdtree::Mesh mesh;
    const int columns = 2 * rows;
    for (int i = 0; i <= rows; ++i) {
        for (int j = 0; j < columns; ++j) {
            const double theta = std::numbers::pi * i / rows, phi = 2 * std::numbers::pi * j / columns;
            const double r = 1 + 0.02 * std::sin(20 * theta) * std::cos(14 * phi);
            mesh.positions.push_back(r * glm::dvec3(std::sin(theta) * std::cos(phi), std::cos(theta),
                                                    std::sin(theta) * std::sin(phi)));
        }
    }
    const auto at = [&](int i, int j) { return static_cast<vdtree::Index>(i * columns + j % columns); };
    for (int i = 0; i < rows; ++i) {
        for (int j = 0; j < columns; ++j) {
            mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
            mesh.triangles.push_back({at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)});
        }
    }
    return mesh;
}

template <class T>
T expect(Result<T> result) {
    if (result) return std::move(*result);
    std::fprintf(stderr, "%s\n", result.error().message.c_str());
    std::exit(1);
}

} // namespace

const vdtree::Mesh& mesh() {
    static const vdtree::Mesh loaded = [] {
        const char* file = std::getenv("UNSEEN_BENCH_MESH");
        return file ? expect(vdtree::read_mesh(file)).mesh : bumpy_sphere(224);
    }();
    return loaded;
}

const vdtree::VertexTree& tree() {
    static const vdtree::VertexTree built = [] {
        vdtree::BuildOptions options;
        options.threads = 1;
        return expect(vdtree::build_tree(mesh().view(), options));
    }();
    return built;
}

vdtree::View orbit(double degrees) {
    const perception::Display display;
    vdtree::View window;
    window.fov_y_degrees = physical_field(display, window.height).value();
    const double angle = degrees * std::numbers::pi / 180;
    const vdtree::Sphere sphere = tree().bounding_sphere();
    return vdtree::frame_sphere(tree().origin() + glm::dvec3(sphere.centre), sphere.radius,
                                {std::sin(angle), 0, std::cos(angle)}, 0.9, window);
}

} // namespace unseen::bench
