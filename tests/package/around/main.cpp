// A tetrahedron becomes a tree, from a project that has Unseen's sources in it.
#include <cstdio>

#include <unseen/vdtree/vdtree.h>

using namespace unseen::vdtree;

int main() {
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    const auto tree = build_tree(mesh.view());
    if (!tree) return std::fprintf(stderr, "%s\n", tree.error().message.c_str()), 1;
    return tree->triangle_count() == 4 ? 0 : 1;
}
