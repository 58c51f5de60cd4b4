// Prints a line for each of some trees, cuts along a path over them, and budgets: a name and a hash of all their bits. For
// same_cuts.sh, which compares what builds with other compiler flags print.
//
// What goes in is exact, whatever the flags: whole numbers over powers of two.
#include <cstdio>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/cut.h>

using namespace unseen::vdtree;

namespace {

class Hash {
public:
    template <class T>
    void add(std::span<const T> values) {
        const auto bytes = std::as_bytes(values);
        for (const std::byte b : bytes) state_ = (state_ ^ static_cast<unsigned>(b)) * 0x100000001b3u; // FNV-1a
    }
    template <class T>
    void add(const T& value) {
        add(std::span<const T>(&value, 1));
    }
    void print(const std::string& name) const {
        std::printf("%s %016llx\n", name.c_str(), static_cast<unsigned long long>(state_));
    }

private:
    std::uint64_t state_ = 0xcbf29ce484222325u;
};

std::uint32_t noise(std::uint32_t i) {
    i = (i ^ 61u ^ (i >> 16)) * 9u;
    i = (i ^ (i >> 4)) * 0x27d4eb2du;
    return i ^ (i >> 15);
}

// A rough relief, in 4096ths.
Mesh relief(Index n) {
    Mesh mesh;
    for (Index y = 0; y <= n; ++y)
        for (Index x = 0; x <= n; ++x) {
            const int wave = static_cast<int>((x * x + 3 * y * y) % 97) + static_cast<int>(noise(y * n + x) % 61);
            mesh.positions.emplace_back(x / 64.0, y / 64.0, wave / 4096.0);
        }
    for (Index y = 0; y < n; ++y)
        for (Index x = 0; x < n; ++x) {
            const Index a = y * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
            mesh.triangles.push_back({a, b, d});
            mesh.triangles.push_back({a, d, c});
        }
    return mesh;
}

// A soup without any order.
Mesh soup(Index vertices, Index triangles) {
    Mesh mesh;
    for (Index v = 0; v < vertices; ++v)
        mesh.positions.emplace_back(noise(3 * v) % 4096 / 1024.0, noise(3 * v + 1) % 4096 / 1024.0,
                                    noise(3 * v + 2) % 4096 / 1024.0);
    for (Index t = 0; t < triangles; ++t)
        mesh.triangles.push_back({noise(7 * t) % vertices, noise(7 * t + 1) % vertices, noise(7 * t + 2) % vertices});
    return mesh;
}

bool print_all(const std::string& name, const Mesh& mesh, ClustererKind clusterer) {
    const auto tree = build_tree(mesh.view(), {.clusterer = clusterer});
    if (!tree) return std::fprintf(stderr, "%s: %s\n", name.c_str(), tree.error().message.c_str()), false;
    Hash of_tree;
    of_tree.add(tree->positions());
    of_tree.add(tree->support_spheres());
    of_tree.add(tree->displacement());
    of_tree.add(tree->luminance());
    of_tree.add(tree->normals());
    for (const NodeBounds& bounds : tree->bounds()) {
        of_tree.add(bounds.ring);
        of_tree.add(bounds.slabs);
    }
    for (NodeId node = 0; node < tree->interior_count(); ++node) of_tree.add(tree->mask(node));
    of_tree.print(name + " tree");

    const View view;
    const auto extent = extent_criterion(*tree, view, 8), displacement = displacement_criterion(*tree, view, 1);
    if (!extent || !displacement) return false;
    for (const auto& [kind, criterion] : {std::pair("extent", &*extent), {"displacement", &*displacement}}) {
        for (const bool has_budget : {false, true}) {
            Cut cut(*tree);
            Hash of_cut;
            for (int frame = 0; frame < 64; ++frame) {
                View there = view;
                there.eye = {1 + frame / 32.0, 1 - frame / 64.0, 2 + (frame % 16) / 4.0};
                there.target = {1, 1, 0};
                Viewpoint viewpoint{.eye = eye_in_tree(*tree, there, {}), .frusta = {frustum_of(*tree, there)}};
                FollowOptions options;
                if (has_budget) options.triangle_budget = tree->triangle_count() / 3;
                const auto stats = cut.follow(*criterion, viewpoint, options);
                if (!stats) return std::fprintf(stderr, "%s\n", stats.error().message.c_str()), false;
                of_cut.add(cut.indices());
                of_cut.add(stats->max_fold_cost);
            }
            of_cut.print(name + " " + kind + (has_budget ? " in a budget" : ""));
        }
    }
    return true;
}

} // namespace

int main() {
    bool is_done = true;
    for (const ClustererKind clusterer : {ClustererKind::quadric, ClustererKind::octree}) {
        const std::string by = " by " + std::string(name(clusterer));
        is_done &= print_all("relief" + by, relief(96), clusterer);
        is_done &= print_all("soup" + by, soup(500, 3000), clusterer);
    }
    return is_done ? 0 : 1;
}
