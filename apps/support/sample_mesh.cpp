#include "sample_mesh.h"

#include <cmath>
#include <numbers>

namespace unseen::app {

vdtree::Mesh bumpy_sphere(int rows) {
    vdtree::Mesh mesh;
    const int columns = 2 * rows;
    for (int i = 0; i <= rows; ++i) {
        for (int j = 0; j < columns; ++j) {
            const double theta = std::numbers::pi * i / rows, phi = 2 * std::numbers::pi * j / columns;
            const double r = 1 + 0.02 * std::sin(20 * theta) * std::cos(14 * phi);
            mesh.positions.push_back(
                r * glm::dvec3(std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi)));
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

} // namespace unseen::app
