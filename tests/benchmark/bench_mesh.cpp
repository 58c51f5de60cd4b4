#include "bench_mesh.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>

#include <unseen/meshio/mesh_io.h>
#include <unseen/perception/display.h>
#include <unseen/vdtree/builder.h>

#include "sample_mesh.h"
#include "subdivide.h"

namespace unseen::bench {

namespace {

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
        return file ? expect(meshio::read_mesh(file)).mesh : app::bumpy_sphere(224);
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

const vdtree::VertexTree& large_tree() {
    static const vdtree::VertexTree built = [] {
        app::SubdivideOptions subdividing;
        subdividing.times = 2;
        const vdtree::Mesh large = expect(app::subdivide(mesh(), subdividing));
        vdtree::BuildOptions options;
        options.clusterer = vdtree::ClustererKind::octree;
        return expect(vdtree::build_tree(large.view(), options));
    }();
    return built;
}

vdtree::View orbit(double degrees) { return orbit(tree(), degrees); }

vdtree::View orbit(const vdtree::VertexTree& around, double degrees) {
    const perception::Display display;
    vdtree::View window;
    window.fov_y_degrees = physical_field(display, window.height).value();
    const double angle = degrees * std::numbers::pi / 180;
    const vdtree::Sphere sphere = around.bounding_sphere();
    return vdtree::frame_sphere(around.origin() + glm::dvec3(sphere.centre), sphere.radius,
                                {std::sin(angle), 0, std::cos(angle)}, 0.9, window);
}

} // namespace unseen::bench
