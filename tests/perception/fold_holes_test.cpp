// The holes of the rule as it is usually read: for each, a small exact scene in which the literal rule folds what a
// judge then sees, while luebke_hallen_safe_distances() keeps it.
#include <unseen/perception/criterion.h>

#include <unseen/perception/internal/cut_rings.h>
#include <unseen/perception/judge.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>

#include "sound.h"
#include "testing.h"

namespace unseen::perception::fold_holes_test {

using vdtree::Cut;
using vdtree::Index;
using vdtree::Mesh;
using vdtree::NodeId;
using vdtree::VertexTree;
using vdtree::View;
using vdtree::WedgeId;

constexpr int window_px = 128;
constexpr int samples = 64; // a pixel, along an additive recurrence in both directions
constexpr float background = 0.2f;

float relative(double cdm2) { return static_cast<float>(to_relative(Display(), Luminance(cdm2))); }

Index add_vertex(Mesh& mesh, glm::dvec3 at, float luminance) {
    mesh.positions.push_back(at);
    mesh.colours.push_back({luminance, luminance, luminance, 1});
    return static_cast<Index>(mesh.positions.size() - 1);
}

// Vertices that merge, and where to.
struct Group {
    std::vector<Index> vertices;
    glm::dvec3 proxy;
};

// The groups and all other vertices under one root. Group g is the node whose leaves are its vertices.
struct Scene {
    Mesh mesh;
    std::vector<Group> groups;
    std::optional<VertexTree> tree;
    std::vector<NodeId> nodes; // of the groups

    void build() {
        const auto merge = [&](const vdtree::ClusterInput&) -> Result<vdtree::Clustering> {
            const Index vertices = static_cast<Index>(mesh.positions.size()),
                        root = vertices + static_cast<Index>(groups.size());
            vdtree::Clustering clustering;
            clustering.parents.assign(root + 1, root);
            for (std::size_t g = 0; g < groups.size(); ++g) {
                for (const Index v : groups[g].vertices) clustering.parents[v] = vertices + static_cast<Index>(g);
                clustering.positions.push_back(groups[g].proxy);
            }
            clustering.positions.push_back({0, 0, 0});
            return clustering;
        };
        auto built = require(vdtree::build_tree(mesh.view(), merge, {.prelit = true}));
        tree = std::move(*built);
        std::vector<NodeId> parent_of_vertex(mesh.positions.size());
        for (Index leaf = 0; leaf < tree->leaf_count(); ++leaf)
            parent_of_vertex[tree->source_vertices()[leaf]] =
                support::sound(*tree).parents()[tree->place_of_leaf(leaf)];
        for (const Group& group : groups) nodes.push_back(parent_of_vertex[group.vertices.front()]);
    }
};

View view_of_screen() {
    const Display display;
    View view;
    view.width = view.height = window_px;
    view.fov_y_degrees = physical_field(display, window_px).value();
    view.eye = {0, 0, display.distance.value() / display.pixel_pitch.value()}; // a unit of length is a pixel at z = 0
    return view;
}

FoldTestOptions fold_test(const VertexTree& tree) {
    FoldTestOptions options;
    options.csf = csf_of(median_person); // whose holes these are: others have smaller ones
    options.scene = {std::min(tree.luminance_range().lo, background), std::max(tree.luminance_range().hi, background)};
    return options;
}

// By the ring alone, of the groups: what it costs to fold them.
std::vector<float> ring_costs(const Scene& scene, const View& view) {
    const FoldTestOptions options = fold_test(*scene.tree);
    const auto criterion = luebke_hallen_distances(*scene.tree, view, options);
    EXPECT_TRUE(criterion);
    const std::vector<float> all =
        *find_every_cost(*scene.tree, *criterion, viewpoint_of(*scene.tree, view, options, {}, false));
    std::vector<float> costs;
    for (const NodeId node : scene.nodes) costs.push_back(all[node]);
    return costs;
}

double literal_cost(const VertexTree& tree, NodeId node, const View& view, const FoldTestOptions& options) {
    const WedgeId leaves = tree.interior_wedge_count();
    const Index first = support::sound(tree).first_leaf()[node], end = support::sound(tree).leaf_end()[node];
    const glm::dvec3 eye = view.eye - tree.origin();
    glm::dvec3 low(std::numeric_limits<double>::max()), high(-low);
    float darkest = 1, brightest = 0;
    for (Index leaf = first; leaf < end; ++leaf) {
        const glm::dvec3 p = tree.positions()[leaves + leaf];
        low = glm::min(low, p), high = glm::max(high, p);
        darkest = std::min<float>(darkest, tree.luminance()[leaves + leaf]);
        brightest = std::max<float>(brightest, tree.luminance()[leaves + leaf]);
    }
    bool has_front = false, has_back = false;
    for (const auto& t : support::sound(tree).triangles()) {
        const bool is_own = std::any_of(t.begin(), t.end(), [&](Index leaf) { return first <= leaf && leaf < end; });
        if (!is_own) continue;
        const glm::dvec3 a = tree.positions()[leaves + t[0]], b = tree.positions()[leaves + t[1]],
                         c = tree.positions()[leaves + t[2]];
        (glm::dot(glm::cross(b - a, c - a), eye - a) > 0 ? has_front : has_back) = true;
    }
    if (has_front && has_back) {
        darkest = std::min(darkest, options.scene.darkest);
        brightest = std::max(brightest, options.scene.brightest);
    }
    const double lo = to_luminance(options.display, static_cast<double>(darkest)).value(),
                 hi = to_luminance(options.display, static_cast<double>(brightest)).value();
    if (lo == hi) return 0;
    const double pixel = 1 / pixels_per_degree(options.display).value();
    const double extent =
        2 * std::asin(glm::length(high - low) / 2 / glm::length(eye - (low + high) * 0.5)) * 180 / M_PI;
    const double frequency = CsfTable::standard()
                                 .highest_visible_frequency((hi - lo) / (hi + lo), Degrees(0), Luminance((lo + hi) / 2))
                                 .value();
    return 2 * std::max(extent, pixel) * frequency;
}

Image picture(const Cut& cut, const View& view) {
    const VertexTree& tree = cut.tree();
    const vdtree::CameraFrame frame = vdtree::camera_frame(view);
    const double focal_px = window_px / 2.0 / std::tan(view.fov_y_degrees * M_PI / 360);
    const std::size_t count = std::size_t{window_px} * window_px * samples;
    std::vector<float> nearness(count, 0), luminance(count, background);
    std::array<glm::dvec2, samples> offsets; // the R2 sequence (Roberts 2018): even in two dimensions at any length
    for (int s = 0; s < samples; ++s)
        offsets[static_cast<std::size_t>(s)] = {std::fmod(0.5 + 0.7548776662466927 * s, 1),
                                                std::fmod(0.5 + 0.5698402909980532 * s, 1)};
    const auto indices = cut.indices();
    for (std::size_t i = 0; i < indices.size(); i += 3) {
        std::array<glm::dvec3, 3> on_screen; // x, y in pixels, 1 / depth
        std::array<double, 3> shade;
        for (std::size_t k = 0; k < 3; ++k) {
            const glm::dvec3 from_eye = glm::dvec3(tree.positions()[indices[i + k]]) + tree.origin() - view.eye;
            const double depth = -glm::dot(from_eye, frame.back);
            on_screen[k] = {window_px / 2.0 + focal_px * glm::dot(from_eye, frame.right) / depth,
                            window_px / 2.0 - focal_px * glm::dot(from_eye, frame.up) / depth, 1 / depth};
            shade[k] = static_cast<double>(static_cast<float>(tree.luminance()[indices[i + k]]));
        }
        const auto [a, b, c] = on_screen;
        const double area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        if (area == 0) continue;
        const auto first = [](double v) { return std::clamp(static_cast<int>(std::floor(v)), 0, window_px); };
        const int left = first(std::min({a.x, b.x, c.x})), right = first(std::max({a.x, b.x, c.x}) + 1);
        const int top = first(std::min({a.y, b.y, c.y})), bottom = first(std::max({a.y, b.y, c.y}) + 1);
        for (int y = top; y < bottom; ++y) {
            for (int x = left; x < right; ++x) {
                for (int s = 0; s < samples; ++s) {
                    const glm::dvec2 p = glm::dvec2(x, y) + offsets[static_cast<std::size_t>(s)];
                    const double v = ((p.x - a.x) * (c.y - a.y) - (p.y - a.y) * (c.x - a.x)) / area;
                    const double w = ((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x)) / area;
                    if (v < 0 || w < 0 || v + w > 1) continue;
                    const double near = (1 - v - w) * a.z + v * b.z + w * c.z;
                    const auto at = static_cast<std::size_t>((y * window_px + x) * samples + s);
                    if (!(near > static_cast<double>(nearness[at]))) continue;
                    nearness[at] = static_cast<float>(near);
                    luminance[at] = static_cast<float>(
                        ((1 - v - w) * a.z * shade[0] + v * b.z * shade[1] + w * c.z * shade[2]) / near);
                }
            }
        }
    }
    Image image{window_px, window_px, 1, {}};
    for (std::size_t pixel = 0; pixel < count / samples; ++pixel) {
        double sum = 0;
        for (std::size_t s = 0; s < samples; ++s) sum += static_cast<double>(luminance[pixel * samples + s]);
        image.values.push_back(static_cast<float>(to_luminance(Display(), sum / samples).value()));
    }
    return image;
}

std::uint64_t visible_pixels(const Cut& cut, const View& view) {
    Cut whole(cut.tree());
    whole.unfold_all();
    const auto judged = require(judge_modern(picture(whole, view), picture(cut, view), {.gain = median_person.gain}));
    return judged->visible_pixels;
}

// What the safe test makes of the scene.
Cut safe_cut(const Scene& scene, const View& view) {
    const auto criterion = require(luebke_hallen_safe_distances(*scene.tree, *perception::bound_cut_rings(*scene.tree),
                                                                view, fold_test(*scene.tree)));
    EXPECT_TRUE(criterion->is_monotone());
    Cut cut(*scene.tree);
    EXPECT_TRUE(cut.follow(*criterion, viewpoint_of(*scene.tree, view, fold_test(*scene.tree))));
    return cut;
}

// That the literal rule folds all groups, that this is seen, and that the safe one keeps the first and shows nothing.
void expect_hole(Scene& scene) {
    scene.build();
    const View view = view_of_screen();
    Cut literal(*scene.tree);
    literal.unfold_all();
    for (const NodeId node : scene.nodes) {
        EXPECT_LE(literal_cost(*scene.tree, node, view, fold_test(*scene.tree)), 1);
        literal.fold_subtree(node);
    }
    EXPECT_GT(visible_pixels(literal, view), 20u);
    const Cut safe = safe_cut(scene, view);
    EXPECT_TRUE(safe.is_unfolded(scene.nodes.front()));
    EXPECT_EQ(visible_pixels(safe, view), 0u);
}

// A flat grid at z = 0 whose lines are at these places in both directions, and whose frame is wider than the window.
template <class Luminance>
Mesh flat_grid(std::vector<double> lines, Luminance&& luminance_at) {
    lines.insert(lines.begin(), -window_px);
    lines.push_back(window_px);
    Mesh mesh;
    const int n = static_cast<int>(lines.size());
    for (int row = 0; row < n; ++row)
        for (int column = 0; column < n; ++column)
            add_vertex(mesh, {lines[static_cast<std::size_t>(column)], lines[static_cast<std::size_t>(row)], 0},
                       luminance_at(row - 1, column - 1));
    const auto at = [&](int row, int column) { return static_cast<Index>(row * n + column); };
    for (int row = 0; row + 1 < n; ++row) {
        for (int column = 0; column + 1 < n; ++column) {
            mesh.triangles.push_back({at(row, column), at(row, column + 1), at(row + 1, column + 1)});
            mesh.triangles.push_back({at(row, column), at(row + 1, column + 1), at(row + 1, column)});
        }
    }
    return mesh;
}
// The vertex of such a grid of `lines` lines, the frame not counted.
Index grid_vertex(int row, int column, int lines) { return static_cast<Index>((row + 1) * (lines + 2) + column + 1); }

std::vector<double> even_lines(int count, double step) {
    std::vector<double> lines;
    for (int i = 0; i < count; ++i) lines.push_back(step * (i - (count - 1) / 2.0));
    return lines;
}

//   44    44    44    44       The two differ by next to nothing, but where they go the ring comes along.
//   44  16.4  16.6    44
//   44    44    44    44
TEST(FoldHoles, OneTheRingChangesToo) {
    constexpr int lines = 6;
    constexpr double step = 6;
    Scene scene;
    scene.mesh = flat_grid(even_lines(lines, step), [](int row, int column) {
        if (row != 2 || (column != 2 && column != 3)) return relative(44);
        return relative(column == 2 ? 16.4 : 16.6);
    });
    scene.groups = {{{grid_vertex(2, 2, lines), grid_vertex(2, 3, lines)}, {0, -step / 2, 0}}};
    expect_hole(scene);
}

// A lens seen from the front. Two vertices behind its edge, all of whose triangles face away, fold to a place that
// sticks out.
TEST(FoldHoles, TwoWhatFacesAwayMovesTheContour) {
    constexpr int around = 24;
    constexpr double radius = 30;
    Scene scene;
    Mesh& mesh = scene.mesh;
    const auto on_circle = [](double r, double turn, double z) {
        const double angle = 2 * M_PI * turn / around;
        return glm::dvec3(r * std::cos(angle), r * std::sin(angle), z);
    };
    for (int i = 0; i < around; ++i) add_vertex(mesh, on_circle(radius, i, 0), 0.5f);
    for (int i = 0; i < around; ++i) add_vertex(mesh, on_circle(0.9 * radius, i, -10), 0.5f);
    const Index front = add_vertex(mesh, {0, 0, 10}, 0.5f), back = add_vertex(mesh, {0, 0, -15}, 0.5f);
    for (Index i = 0; i < around; ++i) {
        const Index next = (i + 1) % around;
        mesh.triangles.push_back({front, i, next});
        mesh.triangles.push_back({i, around + i, around + next});
        mesh.triangles.push_back({i, around + next, next});
        mesh.triangles.push_back({back, around + next, around + i});
    }
    scene.groups = {{{around, around + 1}, on_circle(1.15 * radius, 0.5, -10)}};
    expect_hole(scene);
    EXPECT_EQ(scene.tree->closedness(), vdtree::Closedness::closed_outward);
}

// A fine even square inside of a fine line that is a little brighter. Pairs across the line are below a pixel and may
// fold; the square is even, and so are its neighbours in the mesh. But once the pairs have folded, the square's
// triangles reach to them.
TEST(FoldHoles, ThreeTheNeighboursMayHaveFolded) {
    constexpr int lines = 65, first = 12, last = lines - 1 - first; // of the square
    constexpr double step = 0.25, grey = 0.5;
    const auto lies_on = [](int row, int column, int line) {
        const int outward = std::max(std::abs(row - (lines - 1) / 2), std::abs(column - (lines - 1) / 2));
        return outward == (lines - 1) / 2 - first + line;
    };
    Scene scene;
    scene.mesh = flat_grid(even_lines(lines, step), [&](int row, int column) {
        return static_cast<float>(lies_on(row, column, 2) ? 1.19 * grey : grey);
    });
    scene.groups.resize(1);
    for (int row = first; row <= last; ++row)
        for (int column = first; column <= last; ++column)
            scene.groups[0].vertices.push_back(grid_vertex(row, column, lines));
    scene.groups[0].proxy = {0, 0, 0};
    const auto pair_up = [&](int row, int column, int up, int aside) {
        const Index inner = grid_vertex(row, column, lines), outer = grid_vertex(row + up, column + aside, lines);
        scene.groups.push_back({{inner, outer}, scene.mesh.positions[inner]});
    };
    for (int i = first; i <= last; ++i) {
        pair_up(first - 1, i, -1, 0);
        pair_up(last + 1, i, 1, 0);
        pair_up(i, first - 1, 0, -1);
        pair_up(i, last + 1, 0, 1);
    }
    expect_hole(scene);

    // The range of the mesh's own ring does not do: the one is even, the others are small.
    const View view = view_of_screen();
    const std::vector<float> costs = ring_costs(scene, view);
    EXPECT_LE(*std::max_element(costs.begin(), costs.end()), 1);
}

//   o---O---o       All but O have the same grey; a and b fold to the middle between them. At every vertex, before and
//   | \/ \/ |       after, the surface has the luminance that it had; between O and a it has not.
//   o--a-b--o
//   | /\ /\ |
//   o---O---o
TEST(FoldHoles, FourFacesChangeWhereVerticesDoNot) {
    constexpr double step = 8, far = window_px;
    Scene scene;
    Mesh& mesh = scene.mesh;
    const float grey = 0.4f, bright = 0.7f;
    const Index a = add_vertex(mesh, {-step, 0, 0}, grey), b = add_vertex(mesh, {step, 0, 0}, grey);
    const Index left = add_vertex(mesh, {-2 * step, 0, 0}, grey), right = add_vertex(mesh, {2 * step, 0, 0}, grey);
    const Index top_left = add_vertex(mesh, {-2 * step, step, 0}, grey), top = add_vertex(mesh, {0, step, 0}, bright),
                top_right = add_vertex(mesh, {2 * step, step, 0}, grey);
    const Index low_left = add_vertex(mesh, {-2 * step, -step, 0}, grey), low = add_vertex(mesh, {0, -step, 0}, bright),
                low_right = add_vertex(mesh, {2 * step, -step, 0}, grey);
    const Index frame[] = {add_vertex(mesh, {-far, far, 0}, grey), add_vertex(mesh, {far, far, 0}, grey),
                           add_vertex(mesh, {far, -far, 0}, grey), add_vertex(mesh, {-far, -far, 0}, grey)};
    mesh.triangles = {{a, b, top},
                      {a, top, top_left},
                      {a, top_left, left},
                      {b, top_right, top},
                      {b, right, top_right},
                      {b, a, low},
                      {a, low_left, low},
                      {a, left, low_left},
                      {b, low, low_right},
                      {b, low_right, right},
                      {frame[0], top_left, top},
                      {frame[0], top, frame[1]},
                      {frame[1], top, top_right},
                      {frame[1], top_right, right},
                      {frame[1], right, frame[2]},
                      {frame[2], right, low_right},
                      {frame[2], low_right, low},
                      {frame[2], low, frame[3]},
                      {frame[3], low, low_left},
                      {frame[3], low_left, left},
                      {frame[3], left, frame[0]},
                      {frame[0], left, top_left}};
    scene.groups = {{{a, b}, {0, 0, 0}}};
    expect_hole(scene);

    // Along the line from left to right, on which a, b and the proxy lie, all is grey in both.
    const VertexTree& tree = *scene.tree;
    EXPECT_NEAR(static_cast<float>(tree.luminance()[tree.first_wedge(scene.nodes[0])]), grey, 1e-4f);
    const vdtree::LuminanceRange support = tree.support_luminance()[scene.nodes[0]];
    EXPECT_EQ(support.lo, support.hi);
}

// Rows of which every third is brighter, below a pixel; the two dark ones between fold. Each fold merges equal vertices
// and cannot be seen. All of them make the half of the area bright where it was a third.
Scene rows(float bright, float dark) {
    constexpr int lines = 161;
    Scene scene;
    scene.mesh = flat_grid(even_lines(lines, 0.25), [&](int row, int column) {
        const bool is_frame = row < 0 || column < 0 || row >= lines || column >= lines;
        return is_frame ? (bright + 2 * dark) / 3 : row % 3 == 0 ? bright : dark;
    });
    for (int row = 1; row + 1 < lines; row += 3) {
        for (int column = 0; column < lines; ++column) {
            const Index first = grid_vertex(row, column, lines), second = grid_vertex(row + 1, column, lines);
            scene.groups.push_back(
                {{first, second}, (scene.mesh.positions[first] + scene.mesh.positions[second]) * 0.5});
        }
    }
    return scene;
}

TEST(FoldHoles, FiveManyShiftTheMeanTogether) {
    Scene scene = rows(0.58f, 0.5f);
    expect_hole(scene);
    // Nor does the ring see it: the rows are finer than pixels.
    std::vector<float> costs = ring_costs(scene, view_of_screen());
    std::sort(costs.begin(), costs.end());
    EXPECT_LE(costs[costs.size() / 2], 1); // but at the frame
}

// The test keeps what has to be kept, and no more: the same rows fold where the shift is too small to be seen.
TEST(FoldHoles, AShiftThatNobodySeesFolds) {
    Scene scene = rows(0.501f, 0.5f);
    scene.build();
    const Cut safe = safe_cut(scene, view_of_screen());
    std::size_t folded = 0;
    for (const NodeId node : scene.nodes) folded += !safe.is_wanted(node);
    EXPECT_GT(folded, scene.nodes.size() * 9 / 10);
    EXPECT_EQ(visible_pixels(safe, view_of_screen()), 0u);
}

// Whatever the test of the mesh's own rings keeps, the safe one keeps.
TEST(LuebkeHallenSafe, FoldsNothingThatLuebkeHallenKeeps) {
    Mesh mesh;
    constexpr int lines = 40;
    mesh = flat_grid(even_lines(lines, 1), [](int row, int column) {
        return 0.5f + 0.1f * static_cast<float>(std::sin(0.7 * row) * std::cos(1.3 * column));
    });
    for (glm::dvec3& p : mesh.positions) p.z = 3 * std::sin(0.2 * p.x) * std::cos(0.3 * p.y);
    const VertexTree tree = std::move(*vdtree::build_tree(mesh.view(), {.prelit = true}));
    const perception::CutRings rings = *perception::bound_cut_rings(tree);
    View view = view_of_screen();
    std::size_t kept = 0, more = 0;
    for (int trial = 0; trial < 8; ++trial) {
        FoldTestOptions options = fold_test(tree);
        view.eye = glm::dvec3(400 * trial, 300 - 200 * trial, 2000 * std::exp2(trial % 4));
        if (trial % 2) options.gaze_px = glm::dvec2(64 + 200 * trial, 64);
        Cut plain(tree), safe(tree);
        const auto viewpoint = viewpoint_of(tree, view, options);
        ASSERT_TRUE(plain.follow(*luebke_hallen_distances(tree, view, options), viewpoint));
        ASSERT_TRUE(safe.follow(*luebke_hallen_safe_distances(tree, rings, view, options), viewpoint));
        for (NodeId node = 0; node < tree.interior_count(); ++node) {
            kept += plain.is_wanted(node);
            more += safe.is_wanted(node) && !plain.is_wanted(node);
            EXPECT_TRUE(safe.is_wanted(node) || !plain.is_wanted(node)) << "trial " << trial << " node " << node;
        }
    }
    EXPECT_GT(kept, 100u);
    EXPECT_GT(more, 10u);
}

} // namespace unseen::perception::fold_holes_test
