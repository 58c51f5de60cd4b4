// Meshes made to be hard, under the oracle's eyes.
#include <hard_mesh.h>

#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <perception/criterion.h>
#include <perception/fold_measurement.h>
#include <render/context.h>
#include <render/renderer.h>
#include <session/observer.h>
#include <vdtree/conserve_light.h>

#include "measured.h"
#include "oracle.h"

namespace unseen::app {
namespace {

using vdtree::VertexTree;

struct Direction {
    glm::dvec3 towards_eye;
    double fill; // of the window's height
};

VertexTree built(const HardMesh& hard) {
    auto tree = build_hard_tree(hard);
    if (!tree) throw std::runtime_error(tree.error().message);
    return std::move(*tree);
}

// Looked at, and so many degrees aside.
constexpr double degrees_aside[] = {0, 12, 29, 50};

template <class MakeCriterion>
void expect_unseen(const VertexTree& tree, std::span<const Direction> directions, const MakeCriterion& make_criterion) {
    auto context = render::Context::headless();
    ASSERT_TRUE(context) << context.error().message;
    auto renderer = render::Renderer::create(*context, tree);
    ASSERT_TRUE(renderer) << renderer.error().message;
    vdtree::Cut whole(tree);
    whole.unfold_all();
    for (const Direction& from : directions) {
        oracle::Look look = oracle::looks_at(tree, {.window_px = 512, .count = 1}).front();
        const vdtree::Sphere sphere = tree.bounding_sphere();
        look.view = vdtree::frame_sphere(tree.origin() + glm::dvec3(sphere.centre), sphere.radius, from.towards_eye,
                                         from.fill, look.view);
        const perception::Image before = oracle::draw(*renderer, whole, look.view);
        for (const double aside : degrees_aside) {
            if (aside > 0) look.options.gaze_px = session::gaze_aside(look.options.display, look.view, aside);
            const auto criterion = make_criterion(look.view, look.options);
            ASSERT_TRUE(criterion) << criterion.error().message;
            vdtree::Cut cut(tree);
            ASSERT_TRUE(cut.follow(*criterion, perception::viewpoint_of(tree, look.view, look.options)));
            const perception::Judgement judged =
                oracle::judge(before, oracle::draw(*renderer, cut, look.view), look, perception::CsfModel::castle);
            EXPECT_EQ(judged.visible_pixels, 0u)
                << "from " << oracle::words(look) << ", " << aside << " degrees aside, " << cut.triangle_count()
                << " of " << tree.triangle_count() << " triangles, largest V " << judged.max_ratio;
        }
    }
}

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
    const VertexTree tree = support::measured(built(all()[GetParam()]), 0);
    const Direction directions[] = {{{0, 0, 1}, 0.9}, {{0.5, 0.2, 1}, 0.5}, {{0.5, 0.2, 1}, 0.2}};
    expect_unseen(tree, directions, [&](const vdtree::View& view, const perception::FoldTestOptions& options) {
        return perception::error_distances(tree, view, options);
    });
}

} // namespace
} // namespace unseen::app
