// Levels of detail by what the rest of a picture masks: in scenes made for it. For museums see museum_test.cpp.
#include <unseen/session_gpu/level_control.h>

#include <unseen/calibration/light_rig.h>
#include <unseen/perception/judge.h>
#include <unseen/render/internal/layers.h>
#include <unseen/render/renderer.h>
#include <unseen/session/load.h>
#include <unseen/session_gpu/internal/level_pictures.h>
#include <unseen/session_gpu/picture_judge.h>
#include <unseen/session_gpu/scene_renderer.h>

#include "gl_test.h"
#include "measured.h"
#include "shapes.h"
#include "textures.h"

namespace level_control_test {

using namespace unseen;
using namespace unseen::session;
using LevelControlTest = render::testing::GlTest;

const vdtree::VertexTree& body() {
    static const vdtree::VertexTree tree = support::measured(support::built(shapes::bumpy_sphere(5, 0.05)));
    return tree;
}

// Bodies of radius about 1 at these places, all of one tree.
Session bodies(const std::vector<glm::dvec3>& places) {
    Scene scene;
    for (const glm::dvec3& at : places) {
        Object& object = scene.objects.emplace_back(Object{body().share()});
        object.placement.translation = at;
    }
    return *Session::create(std::move(scene));
}

vdtree::View ahead(int side) {
    vdtree::View view;
    view.eye = {0, 0, 0}, view.target = {0, 0, -1};
    view.fov_y_degrees = 40;
    view.width = view.height = side;
    return view;
}

// A row of them that goes away, side by side.
const std::vector<glm::dvec3> row = {{-1, 0.3, -5}, {1.4, -0.5, -8}, {-3, 0.4, -13}, {4, -1, -20},
                                     {-6, 1, -33},  {8, -2, -60},    {-18, 3, -100}};

perception::JudgeOptions judging(const Session& session) {
    return {.display = session.observer().display, .gain = session.observer().person.gain};
}

// The loop of a program that shows frames and never waits: what the GPU counts decides all the same.
TEST_F(LevelControlTest, ChangesLevelsWithoutBeingWaitedFor) {
    Session session = bodies(row);
    auto control = require(LevelControl::create(context(), session, ahead(128)));
    int changed = 0;
    const auto start = std::chrono::steady_clock::now();
    while (changed == 0 && std::chrono::steady_clock::now() - start < std::chrono::seconds(20)) {
        const auto frame = require(control->draw(ahead(128)));
        changed += frame->changed;
    }
    EXPECT_GT(changed, 0);
}

// What draws a session shares it: the session may move or go.
TEST_F(LevelControlTest, OutlivesItsSession) {
    auto session = std::make_unique<Session>(bodies(row));
    auto renderer = SceneRenderer::create(context(), *session);
    auto control = LevelControl::create(context(), *session, ahead(64));
    auto pictures = LevelPictures::create(context(), *session, 2);
    auto judge = PictureJudge::create(context(), *session, ahead(64), 1);
    ASSERT_TRUE(renderer && control && pictures && judge);
    const auto cuts = whole_cuts(*session);
    Session moved = std::move(*session);
    session.reset();
    EXPECT_TRUE(renderer->draw(drawn_cuts(cuts), ahead(64), {}));
    EXPECT_TRUE(control->draw(ahead(64)));
    EXPECT_TRUE(pictures->draw(ahead(64), SelectionQuality::ssim));
    EXPECT_TRUE(judge->judge(cuts));
    moved.set_gaze(Gaze{{10, 10}});
    EXPECT_TRUE(control->draw(ahead(64))) << "which goes by the gaze of the session";
}

TEST(LevelChain, GetsCoarserByOneFactorOfDistance) {
    Session session = bodies({{0, 0, -3}});
    const auto chain = require(level_chain(session, ahead(256), {}));
    ASSERT_EQ(chain->size(), 6);
    EXPECT_EQ(chain->triangles(0), body().triangle_count());
    EXPECT_EQ(chain->unseen_from(0), 0);
    EXPECT_LE(chain->triangles(1), body().triangle_count() / 2);
    for (int level = 0; level < 6; ++level) {
        EXPECT_EQ(chain->cut(level).triangle_count(), chain->triangles(level)) << level;
        if (level > 0) EXPECT_LT(chain->triangles(level), chain->triangles(level - 1));
        if (level > 2)
            EXPECT_NEAR(chain->unseen_from(level) / chain->unseen_from(level - 1),
                        chain->unseen_from(2) / chain->unseen_from(1), 1e-6);
    }
    for (const LevelChainOptions& bad :
         {LevelChainOptions{.levels = 0}, LevelChainOptions{.levels = 17}, LevelChainOptions{.most_share = 0},
          LevelChainOptions{.least_share = -1}, LevelChainOptions{.least_share = std::nan("")},
          LevelChainOptions{.most_share = 0.1, .least_share = 0.2}})
        EXPECT_FALSE(level_chain(session, ahead(256), {}, 0, bad));
    EXPECT_EQ(level_chain(session, ahead(256), {}, 0, {.levels = 1})->size(), 1);
    EXPECT_EQ(level_chain(session, ahead(256), {}, 0, {.levels = 2})->size(), 2);
    // All of a small mesh is its only level.
    Session small = *Session::create(Scene::of(support::measured(support::built(shapes::cube(1)))));
    EXPECT_EQ(level_chain(small, small.default_view(), {})->size(), 1);
}

// Of a textured mesh the pictures of few stages tell from how far most folds are seen.
TEST(LevelChain, MeetsTheTrianglesAskedForThoughFoldsAreSeenFromAsFar) {
    const vdtree::Mesh mesh = textures::with_seams(textures::textured_sphere(5, textures::noise(512, 512, 5)));
    Session session = *Session::create(Scene::of(support::measured(support::built(mesh))));
    const auto recipe = require(session.recipe(session.default_view(), {}));
    const double all = session.tree().triangle_count();
    for (const double share : {0.5, 0.3, 0.2, 0.1, 0.05}) {
        const auto chain = require(
            LevelChain::by_triangles(session.tree(), *recipe->criterion,
                                     {.levels = 2, .most_share = share, .least_share = share, .least_triangles = 1}));
        ASSERT_EQ(chain->size(), 2) << share;
        EXPECT_NEAR(chain->triangles(1), share * all, 0.03 * share * all) << share;
    }
}

TEST(LevelChain, FoldsThatShowFromNowhereAreALevelThatBeginsAtOnce) {
    const vdtree::VertexTree tree = support::built(shapes::cube(16));
    vdtree::DistanceCriterion::Parts parts{.switch_distance = {5}};
    for (const float displacement : tree.displacement()) parts.lengths.push_back(displacement < 0.5f ? 0.0f : 1.0f);
    const auto criterion = require(vdtree::DistanceCriterion::create(tree, parts));
    const auto chain = require(LevelChain::create(tree, *criterion));
    ASSERT_GT(chain->size(), 1);
    EXPECT_EQ(chain->unseen_from(1), 0);
    EXPECT_LT(chain->triangles(1), tree.triangle_count() / 2);
}

// How visible a level is, over how visible the one before was: alike from level to level, and more so than where
// triangles shrink by one factor.
TEST_F(LevelControlTest, LevelsAreEven) {
    Session session = bodies({{0, 0, 0}});
    vdtree::View window;
    window.width = window.height = 400;
    window.fov_y_degrees = 15;
    ASSERT_TRUE(session.prepare(session.default_view(), {}));
    const auto recipe = require(session.recipe(session.default_view(), {}));
    auto renderer = require(render::Renderer::create(context(), session.tree()));
    const auto spread = [&](const LevelChain& chain, glm::dvec3 direction) {
        std::vector<perception::Image> pictures;
        for (int level = 0; level < chain.size(); ++level) {
            const auto frame = renderer->draw(chain.cut(level), session.frame(direction, 0.8, window));
            EXPECT_TRUE(frame);
            pictures.push_back({frame->width, frame->height, 1, frame->luminance});
            for (float& v : pictures.back().values)
                v = static_cast<float>(
                    perception::to_luminance(session.observer().display, static_cast<double>(v)).value());
        }
        const auto judge = perception::Judge::create(pictures[0], judging(session));
        double before = 0, least = 1e300, most = 0;
        for (std::size_t level = 1; level < pictures.size(); ++level) {
            const double v = judge->judge(pictures[level])->max_ratio;
            if (level > 1) least = std::min(least, v / before), most = std::max(most, v / before);
            before = v;
        }
        return most / least;
    };
    const auto even = require(LevelChain::create(session.tree(), *recipe->criterion)),
               halving = require(LevelChain::by_triangles(session.tree(), *recipe->criterion));
    ASSERT_EQ(even->triangles(5), halving->triangles(5)) << "the same ends";
    double ours = 0, theirs = 0;
    for (const glm::dvec3 direction : {glm::dvec3(0.3, 0.2, 1), {1, 0, 0}, {-0.5, 0.7, -0.4}}) {
        ours += std::log(spread(*even, direction)) / 3;
        theirs += std::log(spread(*halving, direction)) / 3;
    }
    EXPECT_LT(ours, theirs);
    RecordProperty("spread", std::to_string(std::exp(ours)));
    RecordProperty("spread_by_triangles", std::to_string(std::exp(theirs)));
}

TEST_F(LevelControlTest, AStillPictureSettlesAndStays) {
    Session session = bodies(row);
    for (const MapRecipe maps : {MapRecipe::modern, MapRecipe::rpg99}) {
        auto control = require(LevelControl::create(context(), session, ahead(128), {.maps = maps}));
        EXPECT_FALSE(control->is_settled());
        int frames = 0;
        for (; frames < 300 && !control->is_settled(); ++frames) ASSERT_TRUE(control->draw(ahead(128)));
        ASSERT_LT(frames, 300) << "it does not settle";
        const std::vector<int> levels = control->draw(ahead(128))->levels;
        for (int i = 0; i < 20; ++i) {
            const auto frame = require(control->draw(ahead(128)));
            ASSERT_EQ(frame->levels, levels) << i << " frames after it was settled in " << frames;
        }
        // Near ones are finer than far ones, and there are both.
        EXPECT_LT(levels.front(), levels.back());
        // Waiting or not, it settles alike.
        auto other = LevelControl::create(context(), session, ahead(128), {.maps = maps});
        const auto settled = require(other->settle(ahead(128)));
        EXPECT_TRUE(other->is_settled());
        for (std::size_t i = 0; i < levels.size(); ++i) EXPECT_LE(std::abs(settled->levels[i] - levels[i]), 1) << i;
        for (const LevelTest& test : settled->tests) EXPECT_NE(test.level, test.compared_with);
        ASSERT_FALSE(settled->times.empty());
        EXPECT_GT(settled->times.front().layers_ms, 0);
        EXPECT_GT(settled->times.front().maps_ms, 0);
    }
}

TEST_F(LevelControlTest, CountsDecideALaterFrame) {
    Session session = bodies({{0, 0, -4}, {3, 0, -9}});
    auto control = require(LevelControl::create(context(), session, ahead(128)));
    const int worst = control->chain(0).size() - 1;
    const auto first = require(control->draw(ahead(128)));
    EXPECT_THAT(first->levels, Each(worst)) << "it begins with the worst";
    EXPECT_THAT(first->tested_with, Each(0)) << "and asks for the best";
    EXPECT_TRUE(first->tests.empty());
    EXPECT_EQ(first->triangles, 2u * control->chain(0).triangles(worst));
    EXPECT_EQ(first->layers, 2);
    // Two layers, the background, the depth; the composite, and a combination and a map for each layer.
    EXPECT_EQ(first->surface_passes, 4);
    EXPECT_GT(first->full_screen_passes, 3);
    ASSERT_TRUE(context().finish());
    const auto second = control->draw(ahead(128));
    ASSERT_EQ(second->tests.size(), 2u);
    for (const LevelTest& test : second->tests) {
        EXPECT_EQ(test.frame, 0u);
        EXPECT_EQ(test.level, worst);
        EXPECT_EQ(test.compared_with, 0);
        EXPECT_EQ(test.decision, LevelDecision::better);
        EXPECT_EQ(second->levels[test.object], worst - 1);
    }
    EXPECT_EQ(second->changed, 2);
    // Without layers all is drawn at once, and the background apart for the map.
    Session one = bodies({{0, 0, -4}});
    auto alone = LevelControl::create(context(), one, ahead(128));
    const auto frame = alone->draw(ahead(128));
    EXPECT_EQ(frame->layers, 0);
    EXPECT_EQ(frame->surface_passes, 3) << "the picture, the background, the depth";
}

// Both ends of the chain.
TEST_F(LevelControlTest, TheBestIsHeldAgainstTheNextAndTheWorstToo) {
    Session session = bodies({{0, 0, -2.5}, {300, 0, -2000}});
    auto control = LevelControl::create(context(), session, ahead(256), {.maps = MapRecipe::rpg99});
    const auto settled = control->settle(ahead(256));
    ASSERT_TRUE(settled && control->is_settled());
    const int worst = control->chain(0).size() - 1;
    ASSERT_EQ(settled->levels[0], 0);
    ASSERT_EQ(settled->levels[1], worst);
    for (int i = 0; i < 8; ++i) {
        const auto frame = control->draw(ahead(256));
        EXPECT_THAT(frame->tested_with[0], ::testing::AnyOf(-1, 1));
        EXPECT_THAT(frame->tested_with[1], ::testing::AnyOf(-1, worst - 1));
    }
}

// l_HQ: the farther the layer, the worse is what its levels are held against; every so many frames.
TEST_F(LevelControlTest, FartherLayersAreTestedLessOftenAndAgainstLess) {
    Session session = bodies(row);
    auto control = LevelControl::create(context(), session, ahead(64));
    ASSERT_TRUE(control->settle(ahead(64)));
    const auto centres = [&] {
        std::vector<glm::dvec3> all;
        for (const glm::dvec3& at : row) all.push_back(at);
        return all;
    }();
    const auto split = require(render::split_into_layers(centres, ahead(64)));
    ASSERT_EQ(split->count, 5);
    std::vector<int> tested(row.size(), 0);
    constexpr int frames = 240; // of which 60, 30, 20, 15, 12 are a layer's
    for (int i = 0; i < frames; ++i) {
        const auto frame = control->draw(ahead(64));
        ASSERT_TRUE(context().finish()); // so that no test waits for another
        for (std::size_t k = 0; k < row.size(); ++k) {
            if (frame->tested_with[k] < 0) continue;
            ++tested[k];
            const int level = frame->levels[k], worst = control->chain(k).size() - 1, layer = split->layer_of[k];
            if (level > 0 && level < worst) {
                EXPECT_LT(frame->tested_with[k], level);
                EXPECT_LE(frame->tested_with[k], layer);
            }
        }
    }
    for (std::size_t k = 0; k < row.size(); ++k) EXPECT_EQ(tested[k], frames / (4 * (split->layer_of[k] + 1))) << k;
}

TEST_F(LevelControlTest, AChangeFades) {
    Session session = bodies({{0, 0, -4}, {3, 0, -9}});
    auto control = LevelControl::create(context(), session, ahead(128), {.fade_frames = 3});
    ASSERT_TRUE(control->draw(ahead(128)));
    ASSERT_TRUE(context().finish());
    const auto sum = [&](const std::vector<int>& levels) {
        return std::uint64_t{control->chain(0).triangles(levels[0])} + control->chain(1).triangles(levels[1]);
    };
    for (int i = 0; i < 3; ++i) {
        const auto frame = require(control->draw(ahead(128)));
        EXPECT_EQ(frame->changed, i == 0 ? 2 : 0);
        EXPECT_GT(frame->triangles, sum(frame->levels)) << "both levels are drawn";
        EXPECT_THAT(frame->tested_with, Each(-1)) << "what fades is not tested";
        ASSERT_TRUE(context().finish());
    }
    const auto after = control->draw(ahead(128));
    EXPECT_EQ(after->triangles, sum(after->levels));
    EXPECT_THAT(after->tested_with, Each(0));
    // At rest there is nothing of it to be seen.
    auto plain = LevelControl::create(context(), session, ahead(128));
    ASSERT_TRUE(plain->settle(ahead(128)) && control->settle(ahead(128)));
    EXPECT_EQ(*render::read_pixels(control->picture()), *render::read_pixels(plain->picture()));
}

TEST_F(LevelControlTest, MapsAreThoseOfTheCpu) {
    Session session = bodies(row);
    for (const MapRecipe maps : {MapRecipe::modern, MapRecipe::rpg99}) {
        auto control = require(LevelControl::create(context(), session, ahead(127), {.maps = maps}));
        ASSERT_TRUE(control->draw(ahead(127)));
        const auto map = require(control->thresholds(1));
        const auto relative = render::read_luminance(control->layers().combination());
        perception::Image picture{control->map_width(), control->map_height(), 1, *relative};
        ASSERT_EQ(picture.width, 127);
        for (float& v : picture.values)
            v = static_cast<float>(
                perception::to_luminance(session.observer().display, static_cast<double>(v)).value());
        const auto options = judging(session);
        const double field = perception::physical_field(options.display, picture.width).value();
        const std::vector<float> wanted = maps == MapRecipe::modern
                                              ? perception::threshold_map_modern(picture, options)->values
                                              : perception::rpg99_map(picture, picture, field)->threshold.values;
        std::vector<double> errors;
        for (std::size_t i = 0; i < wanted.size(); ++i)
            errors.push_back(std::abs(static_cast<double>((*map)[i]) / static_cast<double>(wanted[i]) - 1));
        std::sort(errors.begin(), errors.end());
        EXPECT_LT(errors[errors.size() - 1 - errors.size() / 1000], 1e-3);
    }
}

TEST_F(LevelControlTest, OtherMethodsGoByDistanceAndByArea) {
    Session session = bodies(row);
    for (const LevelMethod method : {LevelMethod::distance, LevelMethod::area}) {
        std::uint64_t before = ~0ull;
        for (const double bias : {1e6, 10.0, 0.3, 1e-2, 1e-6}) {
            auto control =
                require(LevelControl::create(context(), session, ahead(128), {.method = method, .bias = bias}));
            const auto frame = require(control->draw(ahead(128)));
            EXPECT_EQ(frame->surface_passes, 1);
            EXPECT_EQ(frame->full_screen_passes, 0);
            // Above 1 is finer: by distance the bias stretches how far a level is unseen from.
            EXPECT_TRUE(std::is_sorted(frame->levels.begin(), frame->levels.end())) << "the farther, the coarser";
            EXPECT_LE(frame->triangles, before);
            before = frame->triangles;
            EXPECT_FALSE(control->thresholds(0));
        }
    }
}

TEST_F(LevelControlTest, TakesWhatComes) {
    Session session = bodies({{0, 0, -4}, {0, 0, 30}, {1, 1, -7}});
    auto control = LevelControl::create(context(), session, ahead(64));
    const auto frame = require(control->draw(ahead(64)));
    EXPECT_EQ(frame->levels[1], -1) << "behind the eye";
    // Another size, and a view of nothing.
    const auto wide = [] {
        vdtree::View view = ahead(50);
        view.width = 81;
        return view;
    }();
    ASSERT_TRUE(control->settle(wide));
    EXPECT_EQ(control->picture().width(), 81);
    vdtree::View aside = ahead(64);
    aside.target = {0, 1, 0}, aside.up = {1, 0, 0};
    const auto nothing = require(control->draw(aside));
    EXPECT_THAT(nothing->levels, Each(-1));
    EXPECT_EQ(nothing->triangles, 0u);
    EXPECT_TRUE(control->is_settled());
    aside.target = aside.eye;
    EXPECT_FALSE(control->draw(aside));

    // Larger than this GPU draws: the picture of before stays, and the next one is drawn.
    vdtree::View huge = ahead(64);
    huge.width = render::largest_target_side() + 1;
    EXPECT_THAT(error_in(control->draw(huge)), HasSubstr("choose a smaller size"));
    EXPECT_EQ(control->picture().width(), 64);
    EXPECT_TRUE(control->read_levels());
    EXPECT_TRUE(control->wait());
    EXPECT_TRUE(control->draw(ahead(64)));
    EXPECT_FALSE(LevelControl::create(context(), session, huge));

    const auto refused = [&](const LevelControlOptions& options) {
        const auto made = LevelControl::create(context(), session, ahead(64), options);
        return made ? "none" : made.error().message;
    };
    EXPECT_THAT(refused({.bias = 0}), HasSubstr("bias"));
    EXPECT_THAT(refused({.bias = std::nan("")}), HasSubstr("bias"));
    EXPECT_THAT(refused({.chain = {.levels = 0}}), HasSubstr("1 to 16 levels"));
    EXPECT_THAT(refused({.layers = 0}), HasSubstr("1 to 16 layers"));
    EXPECT_THAT(refused({.layers = 17}), HasSubstr("1 to 16 layers"));
    EXPECT_THAT(refused({.upper_share = 0.1, .lower_share = 0.2}), HasSubstr("shares"));
    EXPECT_THAT(refused({.object_share = 2}), HasSubstr("share"));
    EXPECT_THAT(refused({.fade_frames = -1}), HasSubstr("fade"));
    EXPECT_THAT(refused({.frames_a_layer = 0}), HasSubstr("every frame"));
}

// Contexts are shared: one lasts as long as anything that draws in it.
TEST_F(LevelControlTest, OutlivesTheHandleOfItsContext) {
    Session session = bodies({{0, 0, -4}, {1, 1, -7}});
    auto own = std::optional(*render::Context::headless());
    auto control = require(LevelControl::create(*own, session, ahead(64)));
    own.reset();
    EXPECT_TRUE(context().make_current());
    EXPECT_TRUE(control->settle(ahead(64)));
    EXPECT_TRUE(control->thresholds(0));
}

// Bodies in a sun from this direction.
Session sunlit(const std::vector<glm::dvec3>& places, glm::dvec3 towards, bool casts) {
    static const vdtree::VertexTree plain =
        *session::measured_under_lights(support::built(shapes::bumpy_sphere(4, 0.02))); // once for all
    Scene scene;
    for (const glm::dvec3& at : places) scene.objects.emplace_back(Object{plain.share()}).placement.translation = at;
    vdtree::Lighting lighting;
    lighting.ambient = 0.2;
    vdtree::LightSource& sun = lighting.lights.emplace_back();
    sun.direction = glm::normalize(towards);
    sun.intensity = 0.7;
    sun.casts_shadow = casts;
    scene.lights = *calibration::LightRig::of(lighting, "the test's lights");
    return *Session::create(std::move(scene));
}

TEST_F(LevelControlTest, OnlyWhatOthersShadeHasMasks) {
    const std::vector<glm::dvec3> places = {{-1.5, 0, -6}, {2.5, 0, -10}};
    const auto first_frame = [&](glm::dvec3 towards, bool casts) {
        Session session = sunlit(places, towards, casts);
        auto control = LevelControl::create(context(), session, ahead(96), {.maps = MapRecipe::rpg99});
        EXPECT_TRUE(control) << control.error().message;
        const auto frame = control->draw(ahead(96));
        EXPECT_TRUE(frame) << frame.error().message;
        EXPECT_EQ(frame->layers, 2);
        EXPECT_EQ(control->layers().mask() != nullptr, frame->masked_layers > 0 && control->layers().mask());
        return *frame;
    };
    const LevelFrame without = first_frame({0, 0.3, 1}, false), above = first_frame({0.1, 1, 0.1}, true),
                     along = first_frame({-4, 0, 4}, true);
    // No light casts any: nothing is made.
    EXPECT_EQ(without.shadow_maps, 0);
    EXPECT_EQ(without.shadow_passes, 0);
    EXPECT_EQ(without.masked_layers, 0);
    // From above none falls on another body. Pictures and tests have shadows; masks have none.
    EXPECT_EQ(above.shadow_maps, 1);
    EXPECT_EQ(above.masked_layers, 0);
    EXPECT_EQ(above.shadow_passes, 2);
    EXPECT_EQ(above.surface_passes, without.surface_passes);
    // Along the two, the near one's falls on the far one, and nothing falls on the near one.
    EXPECT_EQ(along.masked_layers, 1);
    EXPECT_EQ(along.shadow_passes, 3);
    EXPECT_EQ(along.surface_passes, without.surface_passes + 1);
    EXPECT_EQ(along.full_screen_passes, without.full_screen_passes);
    constexpr std::uint64_t map_bytes = 4ull * 2048 * 2048, mask_bytes = 20ull * 96 * 96;
    EXPECT_EQ(above.texture_bytes, without.texture_bytes + 2 * map_bytes);
    EXPECT_EQ(along.texture_bytes, above.texture_bytes + mask_bytes);
}

// What is out of the window casts shadows into it, and a picture has those of SceneRenderer.
TEST_F(LevelControlTest, PicturesHaveTheScenesShadows) {
    Session session = sunlit({{0, 0, -6}, {4, 0, -2}}, {1, 0, 1}, true);
    auto control =
        require(LevelControl::create(context(), session, ahead(96), {.method = LevelMethod::distance, .bias = 1e-6}));
    const auto frame = require(control->draw(ahead(96)));
    ASSERT_EQ(frame->levels[1], -1);
    std::vector<vdtree::Cut> cuts;
    for (std::size_t i = 0; i < 2; ++i)
        cuts.push_back(control->chain(i).cut(i == 0 ? frame->levels[0] : control->chain(1).size() - 1));
    auto renderer = SceneRenderer::create(context(), session);
    const auto items = require(renderer->items(drawn_cuts(cuts), ahead(96)));
    auto target = render::Target::create(context(), 96, 96);
    ASSERT_TRUE(
        render::draw(std::span(items->items).first(1),
                     {.view = ahead(96), .near_plane = control->layers().near_plane(), .shadows = items->shadows},
                     *target, {.colour = glm::vec4(session.background())}));
    EXPECT_EQ(*render::read_pixels(control->picture()), *render::read_pixels(*target));
    // It is in the shadow: half of it is at the ambient light.
    const auto dark = *render::read_luminance(control->picture());
    EXPECT_GT(std::ranges::count_if(dark, [](float v) { return v < 0.17f; }), 200);
}

// A change of level fades under lights that cast shadows, and is tested again after it.
TEST_F(LevelControlTest, LevelsFadeUnderShadows) {
    Session session = sunlit({{-1.5, 0, -6}, {2.5, 0, -10}}, {-4, 0, 4}, true);
    auto control = require(LevelControl::create(context(), session, ahead(96), {.fade_frames = 2}));
    for (int i = 0; i < 8; ++i) {
        const auto frame = require(control->draw(ahead(96)));
        ASSERT_TRUE(context().finish());
    }
}

} // namespace level_control_test
