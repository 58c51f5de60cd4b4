// Levels of detail by what the rest of a picture masks, in scenes made for it.
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include <make_scene.h>
#include <session_gpu/level_control.h>

#include "gl_test.h"
#include "temp_folder.h"

namespace {

using namespace unseen;
using namespace unseen::session;

TEST(Probe, Museum) {
    const auto context = *render::Context::headless();
    const support::TempFolder folder;
    const auto print = [&](const std::string& what, app::MakeSceneOptions o, LevelControlOptions lo) {
        const auto file = folder.path() / "m.glb";
        if (auto made = app::make_scene(file, o); !made) { ADD_FAILURE() << made.error().message; return; }
        auto scene = Scene::load(file, {.as = LoadAs::scene});
        ASSERT_TRUE(scene) << scene.error().message;
        auto s = Session::create(std::move(*scene));
        vdtree::View v = *s->camera_view({});
        v.width = v.height = 256; printf("fov %g\n", v.fov_y_degrees);
        auto control = LevelControl::create(context, *s, v, lo);
        ASSERT_TRUE(control) << control.error().message;
        const auto f = control->settle(v);
        ASSERT_TRUE(f) << f.error().message;
        printf("%s: %d levels:", what.c_str(), control->chain(0).size());
        for (int i = 0; i < control->chain(0).size(); ++i) printf(" %u(%.3g)", control->chain(0).triangles(i), control->chain(0).unseen_from(i));
        printf("\n  frames %d level %d settled %d;", (int)f->number, f->levels[0], control->is_settled());
        for (const auto& t : f->tests) printf(" [%d vs %d: %d]", t.level, t.compared_with, (int)t.pixels);
        printf("\n");
        const auto& t = f->times.back();
        printf("  passes %d %d bytes %d ms %g %g %g %g %g\n", f->surface_passes, f->full_screen_passes, (int)f->texture_bytes, t.layers_ms, t.combinations_ms, t.maps_ms, t.depth_ms, t.control_ms);
    };
    for (const auto recipe : {MapRecipe::modern, MapRecipe::rpg99}) {
        print("none", {.triangles = 20000, .bars = app::MuseumBars::none}, {.maps = recipe});
        for (double f : {1., 2., 4., 8., 16., 32., 64.})
            print("gate " + std::to_string(f), {.triangles = 20000, .bars_per_metre = f, .bars = app::MuseumBars::gate}, {.maps = recipe});
    }
}

} // namespace
