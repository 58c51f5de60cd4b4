// A stereo pair drawn from one cut, judged eye by eye.

#include <unseen/render/context.h>
#include <unseen/render/renderer.h>

#include "measured.h"
#include "oracle.h"
#include "shapes.h"

namespace unseen::stereo_test {

using vdtree::Cut;
using vdtree::View;

// The eyes look ahead in parallel, 63 mm apart, and both see the same screen: windows off centre to both sides.
TEST(Stereo, OneCutForBothEyesIsUnseenByEither) {
    auto context = render::Context::headless();
    if (!context) GTEST_SKIP() << context.error().message;
    const vdtree::VertexTree tree =
        support::measured(support::built(shapes::placed(shapes::bumpy_sphere(5, 0.02), 0.1, {0, 0, 0})), 0);
    auto renderer = require(render::Renderer::create(*context, tree));
    for (const oracle::Look& look : oracle::looks_at(tree, {.window_px = 320, .count = 4, .far_fill = 0.3})) {
        const vdtree::CameraFrame frame = vdtree::camera_frame(look.view);
        const double apart = 0.063, screen = glm::length(look.view.eye - look.view.target); // world units
        View pair = look.view;
        pair.eye_distance = apart;
        pair.shift.x = 0.5 * apart / screen / frame.half_window.x;
        const std::array<View, 2> eyes = vdtree::eyes_of(pair);
        for (int i = 0; i < 2; ++i) {
            const double aside = (i == 0 ? -0.5 : 0.5) * apart;
            ASSERT_EQ(eyes[i].eye, look.view.eye + aside * frame.right);
            ASSERT_EQ(eyes[i].target, look.view.target + aside * frame.right);
            ASSERT_DOUBLE_EQ(eyes[i].shift.x, -aside / screen / frame.half_window.x);
        }
        perception::FoldTestOptions options = look.options;
        options.gaze_px = {};
        const auto criterion = require(perception::error_distances(tree, eyes[0], options));
        const vdtree::Viewpoint viewpoint = perception::viewpoint_of(tree, pair, options);
        ASSERT_EQ(viewpoint.frusta.size(), 2u);
        const vdtree::FollowOptions follow{.cull_back_faces = true};
        Cut whole(tree), both(tree);
        whole.unfold_all();
        ASSERT_TRUE(both.follow(*criterion, viewpoint, follow));
        EXPECT_LT(both.triangle_count(), whole.triangle_count());
        for (const View& eye : eyes) {
            Cut one(tree);
            ASSERT_TRUE(one.follow(*criterion, vdtree::viewpoint_of(tree, eye), follow));
            for (vdtree::NodeId node = 0; node < tree.interior_count(); ++node)
                ASSERT_TRUE(both.is_wanted(node) || !one.is_wanted(node)) << node;
            const oracle::Look as_seen{eye, options};
            const perception::Image before = oracle::draw(*renderer, whole, eye),
                                    after = oracle::draw(*renderer, both, eye);
            const auto judged = oracle::judge(before, after, as_seen, perception::CsfModel::castle);
            EXPECT_EQ(judged.visible_pixels, 0u) << oracle::words(look) << ", largest V " << judged.max_ratio;

            std::printf("%u of %u triangles for both eyes, %u for one; largest V %.2f\n",
                        static_cast<unsigned>(both.triangle_count()), static_cast<unsigned>(whole.triangle_count()),
                        static_cast<unsigned>(one.triangle_count()), static_cast<double>(judged.max_ratio));
        }
    }
}

} // namespace unseen::stereo_test
