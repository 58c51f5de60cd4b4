// What bars mask: a statue in a museum, behind a gate of bars or in the shadow of bars in a window. Levels by the pipeline
// of Drettakis and others (their figure 1).
#include <initializer_list>

#include <make_scene.h>
#include <unseen/session/load.h>
#include <unseen/session_gpu/level_control.h>

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

    static Museum museum(MuseumBars bars, double bars_per_metre) {
        const support::TempFolder folder;
        const auto file = folder / "museum.glb";
        EXPECT_TRUE(app::make_scene(file, {.triangles = 20'000, .bars_per_metre = bars_per_metre, .bars = bars}));
        auto scene = Scene::load(file, {.as = LoadAs::scene, .measures = false});
        EXPECT_TRUE(scene);
        // The statue is the same whatever stands before it: it is measured once.
        vdtree::VertexTree& statue = scene->objects[0].tree;
        static const vdtree::VertexTree measured = *measured_under_lights(statue);
        statue = measured.share();
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

} // namespace unseen::session::museum_test
