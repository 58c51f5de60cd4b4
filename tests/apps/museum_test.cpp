// What bars mask: a statue in a museum, behind a gate of bars or in the shadow of bars in a window. Levels by the pipeline
// of Drettakis and others (their figure 1), and cuts of the vertex tree.
#include <initializer_list>

#include <make_scene.h>
#include <unseen/perception/judge.h>
#include <unseen/session/load.h>
#include <unseen/session_gpu/as_seen.h>
#include <unseen/session_gpu/level_control.h>
#include <unseen/session_gpu/scene_renderer.h>

#include "gl_test.h"
#include "temp_folder.h"

namespace unseen::session::museum_test {

using app::MuseumBars;

constexpr int side_px = 256;

class MuseumTest : public render::testing::GlTest {
protected:
    struct Museum {
        Session session;
        vdtree::View view;
    };

    static Museum museum(MuseumBars bars, double bars_per_metre, std::uint64_t triangles = 20'000) {
        const support::TempFolder folder;
        const auto file = folder / "museum.glb";
        EXPECT_TRUE(app::make_scene(file, {.triangles = triangles, .bars_per_metre = bars_per_metre, .bars = bars}));
        auto scene = Scene::load(file, {.as = LoadAs::scene, .measures = false});
        EXPECT_TRUE(scene);
        // The statue is the same whatever stands before it: it is measured once.
        static std::map<std::uint64_t, vdtree::VertexTree> statues;
        vdtree::VertexTree& statue = scene->objects[0].tree;
        if (!statues.contains(triangles)) statues.emplace(triangles, *measured_under_lights(statue));
        statue = statues.at(triangles).share();
        Museum made{*Session::create(std::move(*scene)), {}};
        made.view = *made.session.camera_view({});
        made.view.width = made.view.height = side_px;
        return made;
    }

    // The statue's level, of 0 to 5, by rpg99's maps.
    int level(MuseumBars bars, double bars_per_metre = 8) {
        static std::map<std::pair<MuseumBars, double>, int> known; // two tests ask for some
        const auto [found, is_new] = known.try_emplace({bars, bars_per_metre}, 0);
        if (is_new) found->second = settled_level(bars, bars_per_metre);
        return found->second;
    }
    int settled_level(MuseumBars bars, double bars_per_metre) {
        Museum in = museum(bars, bars_per_metre);
        auto control = LevelControl::create(context(), in.session, in.view, {.maps = MapRecipe::rpg99});
        EXPECT_TRUE(control) << control.error().message;
        const auto settled = control->settle(in.view);
        EXPECT_TRUE(settled && control->is_settled());
        EXPECT_EQ(settled->masked_layers, 1) << "the window's frame, or its bars, cast a shadow on the statue";
        return settled->levels[0];
    }

    // Behind a bar a metre the statue has the level that it has behind none, and behind finer ones no better than before.
    // Returns that of the finest.
    int falling_level(MuseumBars bars, std::initializer_list<double> finer) {
        int before = level(bars, 1);
        EXPECT_EQ(before, level(MuseumBars::none));
        for (const double bars_per_metre : finer) {
            const int now = level(bars, bars_per_metre);
            EXPECT_GE(now, before) << bars_per_metre;
            before = now;
        }
        return before;
    }

    perception::Image picture(Museum& in, const std::vector<vdtree::Cut>& cuts) {
        auto renderer = SceneRenderer::create(context(), in.session);
        render::DrawOptions options;
        options.samples = 16;
        options.background = in.session.background();
        const auto frame = renderer->draw(drawn_cuts(cuts), in.view, options);
        EXPECT_TRUE(frame) << frame.error().message;
        EXPECT_TRUE(renderer->shadows()) << "the sun casts some";
        return luminance_image(*frame, in.session.observer().display);
    }

    // Triangles of the statue's cut for a picture, of which nobody sees anything.
    struct Kept {
        double masked = 0, unmasked = 0;
    };
    Kept kept(MuseumBars bars, double bars_per_metre) {
        Museum in = museum(bars, bars_per_metre, 100'000);
        const auto unmasked = in.session.simplify(in.view, {.purpose = Purpose::picture});
        const auto masked = simplify_as_seen(in.session, context(), in.view, {.purpose = Purpose::picture},
                                             {.folds_hidden = false, .masking = Masking::scene});
        EXPECT_TRUE(unmasked && masked);
        std::vector<vdtree::Cut> full;
        full.emplace_back(in.session.tree(0)).unfold_all();
        const auto judged = perception::judge_modern(
            picture(in, full), picture(in, masked->cuts),
            {.display = in.session.observer().display, .gain = in.session.observer().person.gain});
        EXPECT_TRUE(judged);
        EXPECT_EQ(judged->visible_pixels, 0u) << judged->max_ratio << " at " << bars_per_metre << " bars a metre";
        return {static_cast<double>(masked->stats.triangles), static_cast<double>(unmasked->stats.triangles)};
    }
};

TEST_F(MuseumTest, TheFinerTheBarsBeforeTheStatueTheCoarserItsLevel) {
    EXPECT_GE(falling_level(MuseumBars::gate, {12, 32}), level(MuseumBars::none) + 2);
}

TEST_F(MuseumTest, TheFinerTheBarsShadowsTheCoarserTheLevel) {
    EXPECT_GE(falling_level(MuseumBars::window, {8, 32}), level(MuseumBars::none) + 1);
}

TEST_F(MuseumTest, TheLevelFallsAgainFromShadowToGate) {
    for (const double bars_per_metre : {8.0, 16.0})
        EXPECT_GE(level(MuseumBars::gate, bars_per_metre), level(MuseumBars::window, bars_per_metre)) << bars_per_metre;
    EXPECT_GT(level(MuseumBars::gate, 32), level(MuseumBars::window, 32));
}

TEST_F(MuseumTest, CutsBehindBarsNeedFewerTriangles) {
    const Kept coarse = kept(MuseumBars::gate, 1), fine = kept(MuseumBars::gate, 32),
               shadows = kept(MuseumBars::window, 32);
    EXPECT_EQ(fine.unmasked, coarse.unmasked);
    EXPECT_LT(coarse.unmasked, 100'000);
    // What masks a little at any frequency is the room, and the statue's own pattern.
    EXPECT_GT(coarse.masked, 0.99 * coarse.unmasked);
    EXPECT_LE(coarse.masked, coarse.unmasked);
    EXPECT_LT(fine.masked, 0.99 * coarse.masked);
    // A cut holds what it promises wherever the shadows are: theirs take nothing from it, and add nothing.
    EXPECT_LE(shadows.masked, shadows.unmasked);
    EXPECT_LT(fine.masked / fine.unmasked, shadows.masked / shadows.unmasked);
    RecordProperty("triangles", std::to_string(coarse.unmasked) + " " + std::to_string(coarse.masked) + " " +
                                    std::to_string(fine.masked) + " " + std::to_string(shadows.masked));
}

} // namespace unseen::session::museum_test
