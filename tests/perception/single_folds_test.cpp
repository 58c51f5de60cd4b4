// The oracle of single folds: each is drawn before and after at many points around it, and what changed is held against
// what the fold tests count on: how much the luminance changes, and where. Points are exact, unlike pixels, which
// average.

#include <unseen/perception/internal/cut_rings.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/internal/normal_mask.h>

#include "shapes.h"
#include "sound.h"
#include "testing.h"

namespace unseen::perception {

using namespace vdtree;

namespace single_folds_test {

// In all, over all meshes; UNSEEN_FOLDS sets it.
int wanted_folds() {
    const char* text = std::getenv("UNSEEN_FOLDS");
    return text ? std::max(1, std::atoi(text)) : 1000;
}

constexpr double luminance_rounding = 2e-5; // of luminances in steps of 1/65535, and of what is interpolated in float
constexpr double place_rounding = 1e-5;     // of the sphere's distance: trees keep floats
// A known limit: masks hold the normals of each fold as it was first made. In other cuts triangles may turn over
// nevertheless, and lie on others for which they are then seen. So many of a mesh's folds did, at most.
constexpr double folds_turned_over = 0.02;
constexpr int rows = 48; // and as many columns of points

double luminance_of(const VertexTree& tree, WedgeId wedge) {
    return static_cast<double>(static_cast<float>(tree.luminance()[wedge]));
}

struct Seen {
    double nearness = 0; // 1 / depth; 0: the background
    double luminance = 0;
    std::array<WedgeId, 3> corners = {no_node, no_node, no_node};
    bool operator==(const Seen& other) const { return nearness == other.nearness && luminance == other.luminance; }
};

// Points of a square in front of the eye: a grid whose rows and columns are shifted at random, so that no two lie in
// line.
class Window {
public:
    // Around a sphere, so many times as wide.
    Window(glm::dvec3 eye, glm::dvec3 centre, double radius, double times, std::mt19937_64& random) : eye_(eye) {
        const glm::dvec3 ahead = centre - eye;
        distance_ = glm::length(ahead);
        ahead_ = ahead / distance_;
        const glm::dvec3 up = std::abs(ahead_.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0);
        right_ = glm::normalize(glm::cross(ahead_, up));
        up_ = glm::cross(right_, ahead_);
        half_ = times * radius / std::sqrt(std::max(distance_ * distance_ - radius * radius, 1e-300));
        for (double& offset : offsets_) offset = shapes::random_unit(random);
    }

    // The points at which anything is nearer than what was seen before are filled in.
    void draw(const VertexTree& tree, std::span<const WedgeId> indices, std::vector<Seen>& seen) const {
        seen.assign(std::size_t{rows} * rows, Seen());
        for (std::size_t i = 0; i + 2 < indices.size(); i += 3)
            draw(tree, {indices[i], indices[i + 1], indices[i + 2]}, seen);
    }
    // The direction of a point from the eye.
    glm::dvec3 direction(std::size_t point) const {
        const glm::dvec2 at = place(static_cast<int>(point) % rows, static_cast<int>(point) / rows);
        return glm::normalize(ahead_ + at.x * right_ + at.y * up_);
    }

private:
    // Each row is shifted by its own share of a column, each column by its own share of a row.
    glm::dvec2 place(int column, int row) const {
        const double x = column + offsets_[static_cast<std::size_t>(row)],
                     y = row + offsets_[static_cast<std::size_t>(column)];
        return {half_ * (2 * x / rows - 1), half_ * (2 * y / rows - 1)};
    }

    void draw(const VertexTree& tree, const std::array<WedgeId, 3>& corners, std::vector<Seen>& seen) const {
        std::array<glm::dvec3, 3> p; // tangents and nearness
        for (std::size_t i = 0; i < 3; ++i) {
            const glm::dvec3 from_eye = glm::dvec3(tree.positions()[corners[i]]) - eye_;
            const double depth = glm::dot(from_eye, ahead_);
            if (!(depth > 1e-3 * distance_)) return; // eyes are outside of the meshes: nothing reaches behind them
            p[i] = {glm::dot(from_eye, right_) / depth, glm::dot(from_eye, up_) / depth, 1 / depth};
        }
        const double area = (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[2].x - p[0].x) * (p[1].y - p[0].y);
        if (!(std::abs(area) > 0)) return;
        const auto first = [&](double low) {
            return std::max(0, static_cast<int>(std::floor((low / half_ + 1) / 2 * rows)) - 1);
        };
        const auto last = [&](double high) {
            return std::min(rows - 1, static_cast<int>(std::floor((high / half_ + 1) / 2 * rows)) + 1);
        };
        const auto [left, right] = std::minmax({p[0].x, p[1].x, p[2].x});
        const auto [bottom, top] = std::minmax({p[0].y, p[1].y, p[2].y});
        if (!(left < half_ && right > -half_ && bottom < half_ && top > -half_)) return;
        for (int row = first(bottom); row <= last(top); ++row) {
            for (int column = first(left); column <= last(right); ++column) {
                const glm::dvec2 q = place(column, row);
                std::array<double, 3> w;
                for (std::size_t i = 0; i < 3; ++i) {
                    const glm::dvec3 &a = p[(i + 1) % 3], &b = p[(i + 2) % 3];
                    w[i] = ((b.x - a.x) * (q.y - a.y) - (q.x - a.x) * (b.y - a.y)) / area;
                }
                if (!(w[0] >= 0 && w[1] >= 0 && w[2] >= 0)) continue;
                const double nearness = w[0] * p[0].z + w[1] * p[1].z + w[2] * p[2].z;
                Seen& point = seen[static_cast<std::size_t>(row) * rows + static_cast<std::size_t>(column)];
                if (!(nearness > point.nearness)) continue;
                point.nearness = nearness;
                point.luminance = 0; // perspective: shares of the corners go by their nearness
                for (std::size_t i = 0; i < 3; ++i)
                    point.luminance += w[i] * p[i].z / nearness * luminance_of(tree, corners[i]);
                point.corners = corners;
            }
        }
    }

    glm::dvec3 eye_, ahead_, right_, up_;
    double distance_ = 0, half_ = 0; // tangent
    std::array<double, rows> offsets_;
};

struct Bound {
    Sphere sphere;           // nothing changes beyond
    LuminanceRange range;    // what changes has luminances of this, before and after
    bool is_outline = false; // may uncover anything
};

bool may_be_outline(const VertexTree& tree, NodeId node, glm::dvec3 eye) {
    const NodeBounds& around = tree.bounds()[node];
    const glm::dvec3 to_eye = eye - glm::dvec3(around.ring.centre);
    const double distance = glm::length(to_eye);
    return (around.flags & irregular_ring) || !(static_cast<double>(around.ring.radius) < distance) ||
           facing(
               around.slabs, [&] { return tree.mask(node); }, glm::vec3(to_eye / distance),
               static_cast<float>(distance), around.ring.radius) == Facing::mixed;
}

// What a fold did, and how it broke its bound.
struct Found {
    std::size_t changed = 0; // points
    double largest = 0;      // change of luminance
    int outside = 0, beyond = 0,
        uncovered = 0; // points: of another place, of more than the range allows, of something else than the ring
    int turned = 0;    // the same as uncovered, where triangles have turned over that the mask knows nothing of
};

Found compare(const Window& window, const std::vector<Seen>& before, const std::vector<Seen>& after, const Bound& bound,
              glm::dvec3 eye, const std::function<bool(const Seen&)>& touches) {
    Found found;
    const glm::dvec3 to_centre = glm::dvec3(bound.sphere.centre) - eye;
    const double distance = glm::length(to_centre);
    const double allowed =
        static_cast<double>(bound.range.hi) - static_cast<double>(bound.range.lo) + luminance_rounding;
    for (std::size_t i = 0; i < before.size(); ++i) {
        if (before[i] == after[i]) continue;
        const double change = std::abs(before[i].luminance - after[i].luminance);
        if (!(change > luminance_rounding)) continue;
        ++found.changed;
        found.largest = std::max(found.largest, change);
        const double aside = glm::length(glm::cross(to_centre, window.direction(i)));
        found.outside += aside > static_cast<double>(bound.sphere.radius) + place_rounding * distance;
        if (bound.is_outline) continue;
        if (touches(before[i]) && touches(after[i])) found.beyond += change > allowed;
        else ++found.uncovered;
    }
    return found;
}

// The nodes whose fold shall be looked at: any, but seldom the largest, of which there are few.
NodeId random_node(const VertexTree& tree, std::mt19937_64& random) {
    return static_cast<NodeId>(random() % tree.interior_count());
}

// Everything unfolded but the node's own subtree, down to its children or, half of the times, as it may come.
void unfold_around(Cut& cut, NodeId node, std::mt19937_64& random, const std::function<bool(NodeId)>& may_fold) {
    const VertexTree& tree = cut.tree();
    cut.unfold_all();
    const NodeId end = support::sound(tree).subtree_end()[node];
    // Children before parents: a node may fold where all of its own children are folded.
    const bool is_rough = random() % 2;
    for (NodeId other = tree.interior_count(); other-- > 0;) {
        const bool is_below = other > node && other < end;
        if (other == node || !(is_below ? is_rough : may_fold(other)) || random() % 3 == 0) continue;
        bool can_fold = true;
        tree.for_each_child(other, [&](NodeId child) { can_fold &= tree.is_place(child) || !cut.is_unfolded(child); });
        if (can_fold) cut.fold(other);
    }
}

// Then the node itself, with all that is below.
void fold_whole(Cut& cut, NodeId node) { cut.fold_subtree(node); }

struct Case {
    const char* name;
    Mesh (*make)();
    bool prelit = true;
};

Mesh painted(Mesh mesh, double (*grey)(glm::dvec3)) {
    for (const glm::dvec3& p : mesh.positions) {
        const auto g = static_cast<float>(grey(p));
        mesh.colours.push_back({g, g, g, 1});
    }
    return mesh;
}
double noise_at(glm::dvec3 p) {
    const double n = std::sin(glm::dot(p, glm::dvec3(1271.3, 3117.7, 741.9))) * 43758.5453;
    return n - std::floor(n);
}
double checks_at(glm::dvec3 p) { return std::sin(12 * p.x) * std::sin(12 * p.y) > 0 ? 0.9 : 0.1; }

const Case cases[] = {
    {"organic", [] { return shapes::bumpy_sphere(3, 0.02); }},
    {"cad",
     [] {
         return shapes::together(shapes::cube(8), shapes::placed(shapes::torus(30, 12), 0.5, {4, 0.5, 0}));
     }},
    {"checkerboard", [] { return painted(shapes::icosphere(3), checks_at); }},
    {"lit_checkerboard", [] { return painted(shapes::icosphere(3), checks_at); }, false},
    {"noise", [] { return painted(shapes::icosphere(3), noise_at); }},
    {"star", [] { return shapes::spiky_star(3); }},
    {"inside_out", [] { return shapes::inside_out(shapes::bumpy_sphere(3, 0.03)); }},
    {"open", [] { return painted(shapes::grid(20), noise_at); }},
    {"soup", [] { return painted(shapes::random_soup(300, 500, 9), noise_at); }},
};

class SingleFolds : public testing::TestWithParam<Case> {
protected:
    SingleFolds()
        : tree_(std::move(*build_tree(GetParam().make().view(), {.prelit = GetParam().prelit}))),
          rings_(*bound_cut_rings(tree_)), cut_(tree_) {}

    // Folds as many nodes as this mesh's share. `prepare` makes the cut before, `bound` says what is claimed of it.
    template <class MayFold, class BoundOf>
    Found run(std::uint64_t seed, MayFold&& may_fold, BoundOf&& bound_of) {
        std::mt19937_64 random(seed);
        const int folds = std::max(1, wanted_folds() / static_cast<int>(std::size(cases)));
        const Sphere whole = tree_.bounding_sphere();
        Found all;
        std::vector<Seen> before, after;
        std::vector<WedgeId> indices;
        for (int i = 0; i < folds; ++i) {
            const NodeId node = random_node(tree_, random);
            const double away = static_cast<double>(whole.radius) * (1.2 + 4 * shapes::random_unit(random));
            const glm::dvec3 eye = glm::dvec3(whole.centre) + away * shapes::random_direction(random);
            const Bound bound = bound_of(node, eye);
            if (!(glm::length(glm::dvec3(bound.sphere.centre) - eye) > 1.05 * static_cast<double>(bound.sphere.radius)))
                continue; // never folds
            unfold_around(cut_, node, random, [&](NodeId other) { return may_fold(node, other); });
            // Now and then the whole mesh is in the window: nothing changes far away, either.
            const bool is_wide = i % 16 == 0;
            const Window window(eye, is_wide ? glm::dvec3(whole.centre) : glm::dvec3(bound.sphere.centre),
                                static_cast<double>(is_wide ? whole.radius : bound.sphere.radius), is_wide ? 1.0 : 1.25,
                                random);
            indices.assign(cut_.indices().begin(), cut_.indices().end());
            window.draw(tree_, indices, before);
            fold_whole(cut_, node);
            window.draw(tree_, cut_.indices(), after);
            const auto is_below = [&](NodeId corner) { return is_in_subtree(corner, node); };
            const auto touches = [&](const Seen& seen) {
                return std::any_of(seen.corners.begin(), seen.corners.end(), is_below);
            };
            Found found = compare(window, before, after, bound, eye, touches);
            if (found.uncovered > 0 && turns_over({indices, cut_.indices()}, node, eye))
                std::swap(found.uncovered, found.turned);
            if (found.outside + found.beyond + found.uncovered > 0 && ++reported_ <= 5)
                std::printf("%s: fold %d of node %u: %d outside, %d beyond %g (largest %g), %d uncovered\n",
                            GetParam().name, i, node, found.outside, found.beyond,
                            static_cast<double>(bound.range.hi) - static_cast<double>(bound.range.lo), found.largest,
                            found.uncovered);
            all.changed += found.changed;
            all.outside += found.outside > 0;
            all.beyond += found.beyond > 0;
            all.uncovered += found.uncovered > 0;
            all.turned += found.turned > 0;
            all.largest = std::max(all.largest, found.largest);
        }
        std::printf("%s: %d folds, %zu changed points, largest change %g; folds that break: place %d, luminance %d, "
                    "uncover %d, turn over %d\n",
                    GetParam().name, folds, all.changed, all.largest, all.outside, all.beyond, all.uncovered,
                    all.turned);
        return all;
    }

    bool is_in_subtree(WedgeId corner, NodeId node) const {
        if (corner == no_node) return false;
        if (corner < tree_.interior_wedge_count()) {
            const NodeId of = support::node_of(tree_, corner);
            return of >= node && of < support::sound(tree_).subtree_end()[node];
        }
        const Index leaf = corner - tree_.interior_wedge_count();
        return leaf >= support::sound(tree_).first_leaf()[node] && leaf < support::sound(tree_).leaf_end()[node];
    }
    // Whether the triangles around a node do not all face the eye, or all face away, in one of the surfaces or the
    // other.
    bool turns_over(std::initializer_list<std::span<const WedgeId>> surfaces, NodeId node, glm::dvec3 eye) const {
        bool has_front = false, has_back = false;
        for (const std::span<const WedgeId> indices : surfaces) {
            for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
                if (!is_in_subtree(indices[i], node) && !is_in_subtree(indices[i + 1], node) &&
                    !is_in_subtree(indices[i + 2], node))
                    continue;
                const glm::dvec3 a = tree_.positions()[indices[i]], b = tree_.positions()[indices[i + 1]],
                                 c = tree_.positions()[indices[i + 2]];
                (glm::dot(glm::cross(b - a, c - a), eye - a) > 0 ? has_front : has_back) = true;
            }
        }
        return has_front && has_back;
    }

    VertexTree tree_;
    CutRings rings_;
    Cut cut_;
    int reported_ = 0;
};
INSTANTIATE_TEST_SUITE_P(Meshes, SingleFolds, testing::ValuesIn(cases),
                         [](const auto& test) { return std::string(test.param.name); });

// What `luebke-hallen` counts on, beside neighbours that are unfolded: the mesh's own ring.
TEST_P(SingleFolds, StayWithinTheMeshsRing) {
    const Found found = run(
        1, [](NodeId, NodeId) { return false; },
        [&](NodeId node, glm::dvec3 eye) {
            return Bound{tree_.bounds()[node].ring, tree_.ring_luminance()[node], may_be_outline(tree_, node, eye)};
        });
    EXPECT_GT(found.changed, 0u);
    EXPECT_EQ(found.outside, 0);
    EXPECT_EQ(found.beyond, 0);
    EXPECT_EQ(found.uncovered, 0);
    EXPECT_LE(found.turned, folds_turned_over * wanted_folds() / static_cast<double>(std::size(cases)) + 2);
}

// What `luebke-hallen-safe` counts on, whatever smaller nodes around are folded.
TEST_P(SingleFolds, StayWithinTheCutsRing) {
    const auto is_smaller = [&](NodeId node, NodeId other) {
        const float a = tree_.support_spheres()[other].radius, b = tree_.support_spheres()[node].radius;
        return a < b || (a == b && other > node);
    };
    const Found found = run(2, is_smaller, [&](NodeId node, glm::dvec3 eye) {
        return Bound{{tree_.bounds()[node].ring.centre, rings_.radius[node]},
                     rings_.luminance[node],
                     may_be_outline(tree_, node, eye)};
    });
    EXPECT_GT(found.changed, 0u);
    EXPECT_EQ(found.outside, 0);
    EXPECT_EQ(found.beyond, 0);
    EXPECT_EQ(found.uncovered, 0);
    EXPECT_LE(found.turned, folds_turned_over * wanted_folds() / static_cast<double>(std::size(cases)) + 2);
}

} // namespace single_folds_test
} // namespace unseen::perception
