// Meshes made to be hard, under the oracle's eyes.
#include <hard_mesh.h>

#include <unseen/perception/criterion.h>
#include <unseen/perception/fold_measurement.h>
#include <unseen/perception/internal/cut_rings.h>
#include <unseen/perception/internal/lit_folds.h>
#include <unseen/render/context.h>
#include <unseen/render/renderer.h>
#include <unseen/session/observer.h>
#include <unseen/vdtree/internal/light_bounds.h>

#include "measured.h"
#include "oracle.h"

namespace unseen::app::hard_mesh_test {

using vdtree::VertexTree;

struct Direction {
    glm::dvec3 towards_eye;
    double fill; // of the window's height

    bool operator==(const Direction&) const = default;
};

VertexTree built(const HardMesh& hard) { return std::move(*require(build_hard_tree(hard))); }

// Looked at, and so many degrees aside.
constexpr double degrees_aside[] = {0, 12, 50}; // the fold oracle looks 29 degrees aside

// A tree as it is seen, in light of its own or under lights.
class Seen {
public:
    explicit Seen(VertexTree tree, std::optional<vdtree::Lighting> lighting = {})
        : tree_(std::move(tree)), lighting_(std::move(lighting)), context_(*render::Context::headless()),
          renderer_(*render::Renderer::create(context_, tree_)) {}

    const VertexTree& tree() const { return tree_; }

    // How the cut of a criterion is judged that make_criterion(view, options) makes.
    template <class MakeCriterion>
    perception::Judgement judge(const Direction& from, double aside, const MakeCriterion& make_criterion) {
        oracle::Look look = oracle::looks_at(tree_, {.window_px = 512, .count = 1}).front();
        const vdtree::Sphere sphere = tree_.bounding_sphere();
        look.view = vdtree::frame_sphere(tree_.origin() + glm::dvec3(sphere.centre), sphere.radius, from.towards_eye,
                                         from.fill, look.view);
        if (aside > 0) look.options.gaze_px = session::gaze_aside(look.options.display, look.view, aside);
        const auto criterion = require(make_criterion(look.view, look.options));
        vdtree::Viewpoint viewpoint = perception::viewpoint_of(tree_, look.view, look.options);
        if (lighting_) viewpoint.lighting = *lighting_;
        vdtree::Cut cut(tree_);
        EXPECT_TRUE(cut.follow(*criterion, viewpoint));
        triangles_ = cut.triangle_count();
        return oracle::judge(whole_from(from, look.view), oracle::draw(renderer_, cut, look.view, samples, lighting_),
                             look, perception::CsfModel::castle);
    }

    template <class MakeCriterion>
    void expect_nothing(std::span<const Direction> directions, const MakeCriterion& make_criterion) {
        for (const Direction& from : directions)
            for (const double aside : degrees_aside) {
                const perception::Judgement judged = judge(from, aside, make_criterion);
                EXPECT_EQ(judged.visible_pixels, 0u)
                    << "from " << from.towards_eye.x << " " << from.towards_eye.y << " " << from.towards_eye.z
                    << ", fill " << from.fill << ", " << aside << " degrees aside: " << triangles_ << " of "
                    << tree_.triangle_count() << " triangles, largest V " << judged.max_ratio;
            }
    }

private:
    static constexpr int samples = 64;

    // Drawn once for all gazes.
    const perception::Image& whole_from(const Direction& from, const vdtree::View& view) {
        if (!whole_ || whole_->first != from) {
            vdtree::Cut whole(tree_);
            whole.unfold_all();
            whole_.emplace(from, oracle::draw(renderer_, whole, view, samples, lighting_));
        }
        return whole_->second;
    }

    VertexTree tree_;
    std::optional<vdtree::Lighting> lighting_;
    render::Context context_;
    render::Renderer renderer_;
    std::optional<std::pair<Direction, perception::Image>> whole_; // and from where
    vdtree::Index triangles_ = 0;                                  // of the last cut
};

class OpenSheets : public testing::TestWithParam<std::size_t> {
public:
    static const std::vector<HardMesh>& all() {
        static const std::vector<HardMesh> sheets = open_sheets(20'000);
        return sheets;
    }
};
INSTANTIATE_TEST_SUITE_P(All, OpenSheets, testing::Range(std::size_t{0}, OpenSheets::all().size()),
                         [](const auto& test) {
                             std::string name = OpenSheets::all()[test.param].name;
                             for (char& c : name)
                                 if (c == ' ') c = '_';
                             return name;
                         });

// On a sheet without depth nothing but its border shows, and creases: a notch there is all that an eye sees.
TEST_P(OpenSheets, AreFoldedUnseen) {
    Seen seen(support::measured(built(all()[GetParam()]), 0));
    const Direction directions[] = {{{0, 0, 1}, 0.9}, {{0.5, 0.2, 1}, 0.5}, {{0.5, 0.2, 1}, 0.2}};
    seen.expect_nothing(directions, [&](const vdtree::View& view, const perception::FoldTestOptions& options) {
        return perception::error_distances(seen.tree(), view, options);
    });
}

// A ship, of slender quads: a bright deck beside dark sides, which share their edges' places and no vertices, as CAD
// programs write them.
HardMesh ship_hull(const std::string& name, float bright, float dark) {
    constexpr int along = 1000, across = 16; // quads of a deck, and of a side
    vdtree::Mesh mesh;
    const auto add_net = [&](float grey, const auto& place) {
        const auto at = [first = mesh.positions.size()](int row, int column) {
            return static_cast<vdtree::Index>(first) + static_cast<vdtree::Index>(row * (across + 1) + column);
        };
        for (int row = 0; row <= along; ++row)
            for (int column = 0; column <= across; ++column) {
                mesh.positions.push_back(place(12 * (double(row) / along) - 6, double(column) / across));
                mesh.colours.emplace_back(grey, grey, grey, 1);
            }
        for (int row = 0; row < along; ++row)
            for (int column = 0; column < across; ++column) {
                mesh.triangles.push_back({at(row, column), at(row, column + 1), at(row + 1, column)});
                mesh.triangles.push_back({at(row + 1, column), at(row, column + 1), at(row + 1, column + 1)});
            }
    };
    const auto half_width = [](double z) {
        return 1.2 * std::sqrt(std::max(0.02, 1 - std::pow(z / 6.2, 4))) * (1 + 0.01 * std::sin(9 * z));
    };
    add_net(bright, [&](double z, double right) {
        const double x = 2 * right - 1;
        return glm::dvec3(x * half_width(z), 0.05 * (1 - x * x), z);
    });
    for (const double sign : {1.0, -1.0})
        add_net(dark, [&](double z, double below) {
            return glm::dvec3(sign * half_width(z) * (1 - 0.3 * below * below), -below, z);
        });
    return {name, std::move(mesh)};
}
std::vector<HardMesh> ship_hulls() { return {ship_hull("hull", 0.85f, 0.06f), ship_hull("grey hull", 0.6f, 0.25f)}; }

// Beside a bright deck a side's nodes, all dark, fold at any size. Then triangles stretch from the deck's edge over the
// side, with a gradient of luminances that no ring of the mesh's own has: the safe test knows of it. And far from the
// gaze, lower frequencies than that of half a wave show in a row of such triangles.
class ShipHulls : public testing::TestWithParam<std::size_t> {};
INSTANTIATE_TEST_SUITE_P(All, ShipHulls, testing::Values(0, 1));

TEST_P(ShipHulls, AreFoldedUnseenByTheSafeTest) {
    Seen seen(built(ship_hulls()[GetParam()]));
    const perception::CutRings rings = *perception::bound_cut_rings(seen.tree());
    const Direction directions[] = {{{0.1, 1, 0.2}, 0.2}, {{1, 0.5, 0.1}, 0.5}};
    seen.expect_nothing(directions, [&](const vdtree::View& view, const perception::FoldTestOptions& options) {
        return perception::luebke_hallen_safe_distances(seen.tree(), rings, view, options);
    });
}

// The same by light that comes from above.
TEST_P(ShipHulls, AreFoldedUnseenUnderLights) {
    vdtree::Lighting from_above;
    from_above.ambient = 0.1;
    from_above.lights.push_back({.intensity = 0.8, .direction = glm::normalize(glm::dvec3(0.2, 1, 0.1))});
    Seen seen(built(ship_hulls()[GetParam()]), from_above);
    const perception::CutRings rings = *perception::bound_cut_rings(seen.tree());
    const auto bounds =
        std::make_shared<const vdtree::LightBounds>(*perception::bound_lit_cut_rings(seen.tree(), rings));
    const Direction directions[] = {{{0.1, 1, 0.2}, 0.2}, {{1, 0.5, 0.1}, 0.2}};
    seen.expect_nothing(directions, [&](const vdtree::View& view, perception::FoldTestOptions options) {
        options.scene = perception::lit_scene(seen.tree(), *bounds, from_above,
                                              vdtree::eye_in_tree(seen.tree(), view, {}), oracle::background);
        return perception::lit_safe_distances(seen.tree(), rings, bounds, view, options);
    });
}

// Measured once for all lights: a far one, a near one, and a spot that ends on the mesh.
TEST(LitFolds, AreUnseenUnderLightsThatStandStill) {
    for (HardMesh& hard : tuning_meshes(8'000)) {
        SCOPED_TRACE(hard.name);
        VertexTree tree = built(hard);
        const vdtree::Sphere sphere = tree.bounding_sphere();
        const auto radius = static_cast<double>(sphere.radius);
        const glm::dvec3 middle(sphere.centre);
        vdtree::Lighting lighting;
        lighting.ambient = 0.15;
        lighting.lights.push_back({.intensity = 0.4, .direction = glm::normalize(glm::dvec3(0.5, 1, 0.3))});
        lighting.lights.push_back({.kind = vdtree::LightSource::Kind::point,
                                   .intensity = 0.3,
                                   .position = middle + 1.6 * radius * glm::normalize(glm::dvec3(-1, 0.3, 0.8)),
                                   .distance = 1.6 * radius});
        lighting.lights.push_back({.kind = vdtree::LightSource::Kind::spot,
                                   .intensity = 0.4,
                                   .direction = glm::dvec3(0, 0, -1),
                                   .position = middle + 3 * radius * glm::dvec3(0, 0, 1),
                                   .distance = 3 * radius,
                                   .inner_cosine = std::cos(0.15),
                                   .outer_cosine = std::cos(0.25)});
        const auto folds = require(perception::LitFolds::measure(tree));
        const auto lit = require(folds->under(tree, lighting));
        Seen seen(std::move(tree), lighting);
        const Direction directions[] = {{{0, 0, 1}, 0.5}, {{0.6, 0.5, 0.6}, 0.5}};
        seen.expect_nothing(directions, [&](const vdtree::View& view, perception::FoldTestOptions options) {
            const vdtree::LuminanceRange range = lit->luminance_range();
            options.scene = {std::min(range.lo, oracle::background), std::max(range.hi, oracle::background)};
            return perception::error_distances(*lit, view, options);
        });
    }
}

} // namespace unseen::app::hard_mesh_test
