// The session library: requests that contradict themselves, plans, several objects.

#include <thread>

#include <unseen/meshio/mesh_file.h>
#include <unseen/perception/fold_measurement.h>
#include <unseen/session/follower.h>
#include <unseen/session/session.h>
#include <unseen/vdtree/builder.h>

#include "extra_meshes.h"
#include "shapes.h"
#include "temp_folder.h"
#include "testing.h"
#include "textures.h"
#include "tree_checks.h"

namespace session_test {

using namespace unseen;
using session::FoldTest;
using session::Goal;
using session::Request;
using session::Session;

vdtree::VertexTree tree_of(const vdtree::Mesh& mesh, const vdtree::BuildOptions& options = {}) {
    return *vdtree::build_tree(mesh.view(), options);
}

// Two balls beside each other, the second one half as large.
Session two_balls() {
    session::Scene scene = session::Scene::of(tree_of(shapes::bumpy_sphere(4, 0.03)));
    scene.objects.push_back({tree_of(shapes::bumpy_sphere(4, 0.03)), {.scale = 0.5, .translation = {4, 0, 0}}, "half"});
    return *Session::create(std::move(scene));
}

std::string complaint_about(const Request& request) {
    const auto valid = session::validate(request);
    return valid ? "" : valid.error().message;
}

TEST(Request, NamesTheFieldThatIsWrong) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(complaint_about({}), "");
    EXPECT_EQ(complaint_about({.goal = Goal::budget(100, true), .milliseconds = 0.0}), "");
    EXPECT_THAT(complaint_about({.goal = Goal::budget(0)}), HasSubstr("request.goal.triangles"));
    EXPECT_THAT(complaint_about({.goal = Goal::pixels(nan)}), HasSubstr("request.goal.pixels"));
    EXPECT_THAT(complaint_about({.goal = Goal::pixels(1), .fold_test = FoldTest::error}),
                HasSubstr("request.fold_test"));
    EXPECT_THAT(complaint_about({.fold_test = FoldTest::extent}), HasSubstr("request.fold_test = extent"));
    EXPECT_THAT(complaint_about({.milliseconds = nan}), HasSubstr("request.milliseconds"));
    EXPECT_THAT(complaint_about({.goal = Goal::up_to(nan)}), HasSubstr("request.goal.cost"));
    EXPECT_THAT(complaint_about({.goal = {.summed_cost = -1}}), HasSubstr("request.goal.cost"));
    EXPECT_THAT(complaint_about({.hysteresis = 3}), HasSubstr("request.hysteresis"));
}

TEST(Session, RefusesWhatCannotBeSeen) {
    EXPECT_FALSE(Session::create({}));
    session::Scene scene = session::Scene::of(tree_of(shapes::cube(4)));
    scene.background = perception::Luminance(1e6);
    EXPECT_THAT(error_in(Session::create(std::move(scene))), HasSubstr("scene.background"));
    auto session = Session::create(session::Scene::of(tree_of(shapes::cube(4))));
    vdtree::View blind = session->default_view();
    blind.target = blind.eye;
    EXPECT_FALSE(session->simplify(blind));
    EXPECT_FALSE(session->plan(blind, {}));
}

TEST(Session, PlansBeforeItMeasures) {
    auto session = Session::create(session::Scene::of(tree_of(shapes::bumpy_sphere(3, 0.03))));
    const vdtree::View view = session->default_view();
    const auto first = require(session->plan(view, {}));
    EXPECT_EQ(first->fold_test, FoldTest::error);
    EXPECT_TRUE(first->measures);
    EXPECT_FALSE(perception::has_fold_measurement(session->tree())) << "a plan changes nothing";
    const auto hurried = require(session->plan(view, {.may_measure = false}));
    EXPECT_EQ(hurried->fold_test, FoldTest::luebke_hallen_safe);
    EXPECT_THAT(hurried->why, HasSubstr("takes long"));
    EXPECT_FALSE(session->plan(view, {.fold_test = FoldTest::error, .may_measure = false}));

    EXPECT_FALSE(require(session->prepare(view, {}))->front().measures);
    EXPECT_TRUE(perception::has_fold_measurement(session->tree()));
    EXPECT_EQ(session->plan(view, {.may_measure = false})->fold_test, FoldTest::error);
}

TEST(Session, SaysOfEachEffectWhyItIsOnOrOff) {
    auto session = Session::create(session::Scene::of(tree_of(shapes::bumpy_sphere(3, 0.03))));
    const auto simplified = require(session->simplify({.fold_test = FoldTest::luebke_hallen}));
    const auto plan = require(session->plan(session->default_view(), {.fold_test = FoldTest::luebke_hallen}));
    ASSERT_EQ(plan->effects.size() + 1, simplified->effects.size()) << "the cut adds geomorphs";
    for (std::size_t i = 0; i < plan->effects.size(); ++i) {
        EXPECT_EQ(plan->effects[i].name, simplified->effects[i].name);
        EXPECT_FALSE(plan->effects[i].why.empty()) << plan->effects[i].name;
    }
}

TEST(Session, RefusesObjectsThatAreNotThere) {
    Session session = two_balls();
    const vdtree::View view = session.default_view();
    EXPECT_THAT(error_in(session.plan(view, {}, 2)), HasSubstr("There is no object 2: the scene has 2"));
    EXPECT_FALSE(session.recipe(view, {}, 2));
    EXPECT_DEATH(session.tree(2), "There is no object 2");
}

TEST(Session, SharesABudgetAmongItsObjects) {
    Session session = two_balls();
    const auto shared = require(session.simplify({.goal = Goal::budget(1500), .fold_test = FoldTest::luebke_hallen}));
    ASSERT_EQ(shared->cuts.size(), 2u);
    const vdtree::Index whole = shared->cuts[0].triangle_count(), half = shared->cuts[1].triangle_count();
    EXPECT_EQ(shared->stats.triangles, whole + half);
    EXPECT_LE(whole + half, 1500u);
    EXPECT_GT(whole + half, 1400u);
    EXPECT_GT(whole, half) << "what is smaller needs fewer";
    EXPECT_EQ(shared->mesh(1).triangles.size(), half);
    EXPECT_EQ(shared->source_triangles, session.tree(0).triangle_count() + session.tree(1).triangle_count());
    EXPECT_THAT(error_in(session.simplify({.goal = Goal::budget(1500, true)})), HasSubstr("request.goal.fill"));
}

TEST(Session, FoldsObjectsBeforeTheLuminanceOfAll) {
    // A white object behind may be uncovered by the outline of a grey one, so this keeps more than it would alone.
    vdtree::Mesh grey = shapes::bumpy_sphere(4, 0.03), white = shapes::cube(2);
    grey.colours.assign(grey.positions.size(), glm::vec4(0.2f, 0.2f, 0.2f, 1));
    white.colours.assign(white.positions.size(), glm::vec4(1));
    vdtree::BuildOptions prelit;
    prelit.prelit = true;
    const auto triangles_of_grey = [](Session& session) {
        vdtree::View view = session.default_view();
        view.eye = {0, 0, 100};
        view.target = {0, 0, 0};
        auto simplified = session.simplify(view, {.fold_test = FoldTest::luebke_hallen});
        return simplified->cuts[0].triangle_count();
    };
    session::Scene both = session::Scene::of(tree_of(grey, prelit));
    both.objects.push_back({tree_of(white, prelit), {.translation = {0, 0, -5}}});
    const session::Observer median{.person = perception::median_person};
    auto alone = Session::create(session::Scene::of(tree_of(grey, prelit)), median);
    auto together = Session::create(std::move(both), median);
    EXPECT_GT(triangles_of_grey(*together), triangles_of_grey(*alone));
}

TEST(Session, FramesAllObjectsWhereTheyArePlaced) {
    const Session session = two_balls();
    const session::WorldSphere sphere = session.bounding_sphere();
    EXPECT_NEAR(sphere.radius, 2.75, 0.3);
    EXPECT_NEAR(sphere.centre.x, 1.75, 0.3);
    EXPECT_EQ(session.default_view().target, sphere.centre);
}

// What is beside the window folds; what is before the eye, behind it or around it does not.
TEST(Session, OrthographicViewsKeepWhatTheWindowShows) {
    auto session = two_balls(); // around 0 0 0 and 4 0 0
    vdtree::View view{.width = 400, .height = 400, .orthographic_height = 2.4};
    const auto kept = [&](double x, double z) {
        view.eye = {x, 0, z};
        view.target = {x, 0, z - 1};
        auto made =
            require(session.simplify(view, {.goal = Goal::imperceptible(), .purpose = session::Purpose::picture}));
        return std::pair{made->cuts[0].triangle_count(), made->cuts[1].triangle_count()};
    };
    const auto at_first = kept(0, 5);
    EXPECT_GT(at_first.first, 100u);
    EXPECT_EQ(at_first.second, 0u);
    EXPECT_EQ(kept(0, 0), at_first) << "the eye is in the middle of the ball";
    EXPECT_EQ(kept(0, -5), at_first) << "the ball is behind the eye";
    const auto at_second = kept(4, 5);
    EXPECT_EQ(at_second.first, 0u);
    EXPECT_GT(at_second.second, 100u);
    EXPECT_TRUE(session::is_in_sight({{4, 0, 9}, 0.5}, view));
    EXPECT_FALSE(session::is_in_sight({{0, 0, 0}, 1}, view));

    auto follower = session::Follower(session);
    view.eye = {0, 0, 5}, view.target = {0, 0, 0};
    const auto followed =
        require(follower.follow(view, {.goal = Goal::imperceptible(), .purpose = session::Purpose::picture}));
    EXPECT_EQ(followed->stats.triangles, at_first.first);
}

// What faces away: a picture folds it, a flight within budgets, a mesh never.
TEST(Session, FoldsWhatFacesAwayWhereThatPays) {
    Session session = two_balls();
    const auto triangles = [&](session::Purpose purpose, const Goal& goal) {
        const auto made =
            require(session.simplify({.goal = goal, .fold_test = FoldTest::luebke_hallen, .purpose = purpose}));
        const auto effect = std::ranges::find(made->effects, "back-face folding", &session::Effect::name);
        EXPECT_TRUE(effect != made->effects.end());
        return std::pair{made->stats.triangles, effect != made->effects.end() && effect->on};
    };
    using enum session::Purpose;
    const auto [of_picture, picture_folds] = triangles(picture, Goal::imperceptible());
    const auto [of_flight, flight_folds] = triangles(flight, Goal::imperceptible());
    const auto [of_mesh, mesh_folds] = triangles(mesh, Goal::imperceptible());
    EXPECT_TRUE(picture_folds && !flight_folds && !mesh_folds);
    EXPECT_LT(of_picture, of_flight);
    EXPECT_EQ(of_flight, of_mesh) << "all is in the window";
    EXPECT_TRUE(triangles(flight, Goal::budget(500)).second);
    EXPECT_FALSE(triangles(mesh, Goal::budget(500)).second);
}

TEST(Follower, ComesWhereACutFromScratchIs) {
    Session session = two_balls();
    session::Follower follower(session);
    const Request request = {.fold_test = FoldTest::luebke_hallen, .purpose = session::Purpose::picture};
    vdtree::View view = session.default_view();
    for (int frame = 0; frame < 5; ++frame) {
        view.eye.x += 0.2;
        const auto followed = require(follower.follow(view, request));
        const auto anew = require(session.simplify(view, request));
        for (std::size_t object = 0; object < 2; ++object) {
            EXPECT_EQ(support::sorted_triangles(follower.cut(object)), support::sorted_triangles(anew->cuts[object]))
                << "frame " << frame;
            EXPECT_EQ(support::fault_in_needs(follower.cut(object)), "") << "frame " << frame;
        }
    }
}

// Cuts for a gaze, budgets and half of the model in the window, from scratch, followed, and for both eyes of a pair.
// How many triangles would be turned over but for what nodes need.
vdtree::Index expect_nothing_turned(const vdtree::VertexTree& tree) {
    auto session = *Session::create(session::Scene::of(tree.share()));
    const auto on_mirror = tree.uvs().empty() ? std::vector<bool>() : support::wedges_on_mirrors(tree);
    vdtree::Index turned = 0;
    const auto check = [&](const vdtree::Cut& cut) {
        EXPECT_EQ(support::fault_in_needs(cut), "");
        turned += support::turned_triangles(cut.tree(), on_mirror, [&](vdtree::NodeId node) {
                      return cut.is_wanted(node);
                  }).in_space;
    };
    const vdtree::Index most = tree.triangle_count() / 4;
    const Request requests[] = {{.purpose = session::Purpose::picture},
                                {.fold_test = FoldTest::luebke_hallen},
                                {.goal = Goal::budget(most, true)},
                                {.goal = Goal::budget(most / 4), .purpose = session::Purpose::picture},
                                {.goal = Goal::pixels(6)}};
    for (const Request& request : requests) {
        session::Follower follower(session);
        vdtree::View view = session.default_view();
        const double radius = session.bounding_sphere().radius;
        for (int frame = 0; frame < 5; ++frame) {
            SCOPED_TRACE("request " + std::to_string(&request - requests) + ", frame " + std::to_string(frame));
            if (frame == 2) session.set_gaze(session::Gaze{{-100, 300}, 2});
            if (frame == 3) view.target.x += radius; // half of it is in the window
            view.eye += radius * (frame == 4 ? glm::dvec3(1, 2, 3) : glm::dvec3(0.03, -0.02, 0.01));
            const auto followed = require(follower.follow(view, request));
            check(follower.cut());
            const auto anew = require(session.simplify(view, request));
            check(anew->cuts[0]);
            EXPECT_EQ(support::fault_in_cut(anew->cuts[0]), "");
            vdtree::View other = view; // 64 mm apart, at arm's length of a model of half a metre
            other.eye.x += 0.25 * radius, other.target.x += 0.25 * radius;
            auto recipe = require(session.recipe(view, request));
            recipe->viewpoint = *require(vdtree::viewpoint_of_pair(session.tree(), view, other));
            recipe->viewpoint.lighting = require(session.recipe(view, request))->viewpoint.lighting;
            vdtree::Cut pair(session.tree());
            EXPECT_TRUE(pair.follow(*recipe->criterion, recipe->viewpoint, recipe->options));
            check(pair);
        }
        session.set_gaze({});
    }
    return turned;
}

TEST(Session, TurnsNoTriangleOver) {
    const vdtree::Texture checks = textures::checkerboard(16, 16, 4, 0, 255);
    vdtree::Index turned = 0;
    for (const vdtree::Mesh& mesh :
         {shapes::bumpy_sphere(3, 0.03), shapes::spiky_star(3), shapes::cube(8),
          textures::with_seams(textures::textured_sphere(3, checks)), textures::textured_grid(16, checks)})
        turned += expect_nothing_turned(tree_of(mesh));
    EXPECT_GT(turned, 0u) << "of these there are some to find";
}

TEST(Session, TurnsNoTriangleOfFurtherMeshesOver) {
    const support::TempFolder scratch;
    int meshes = 0;
    for (const auto& file : support::extra_meshes()) {
        constexpr std::uintmax_t most_bytes = 300'000; // compressed: some ten thousand triangles, measured in seconds
        if (file.parent_path().filename() == "malformed" || std::filesystem::file_size(file) > most_bytes) continue;
        const auto read = require(meshio::read_mesh(support::uncompressed(file, scratch.path())));
        SCOPED_TRACE(file);
        const vdtree::VertexTree tree = tree_of(read->mesh);
        if (tree.triangle_count() > 50'000) continue;
        std::cout << file.filename() << ", " << tree.triangle_count() << " triangles: " << expect_nothing_turned(tree)
                  << " would be turned over\n";
        ++meshes;
    }
    if (meshes == 0) GTEST_SKIP() << "UNSEEN_EXTRA_MESHES names no folder of further meshes";
}

// Of what moves fast over the retina less is kept; what stands still again is refined at once, by the next call.
TEST(Follower, RefinesWhatStandsStillAgain) {
    auto session = *Session::create(session::Scene::of(tree_of(shapes::bumpy_sphere(6, 0.003))),
                                    {.person = perception::median_person});
    const vdtree::View view = session.default_view();
    const Request request{.fold_test = FoldTest::luebke_hallen};
    session::Follower follower(session);
    const auto triangles = [&] {
        const auto report = follower.follow(view, request);
        EXPECT_TRUE(report) << report.error().message;
        return report->stats.triangles;
    };
    const auto still = triangles();
    const perception::DegreesPerSecond fast(40);
    session.set_velocity(fast);
    const auto moving = triangles();
    EXPECT_LT(moving, still);
    const auto simplified = session.simplify(view, request);
    EXPECT_EQ(simplified->stats.triangles, moving) << "as from scratch";
    const auto effect = [&](const char* name) {
        const auto found = std::find_if(simplified->effects.begin(), simplified->effects.end(),
                                        [&](const session::Effect& e) { return e.name == name; });
        return *found;
    };
    EXPECT_TRUE(effect("motion").on);
    EXPECT_THAT(effect("motion").why, HasSubstr("40 degrees/s"));
    session.set_velocity(perception::DegreesPerSecond(0.05)); // the eye is never at rest
    EXPECT_EQ(triangles(), still);
    session.set_velocity(fast);
    EXPECT_EQ(triangles(), moving);
    session.set_velocity(perception::DegreesPerSecond(0));
    EXPECT_EQ(triangles(), still);
    // With a gaze that is known to a margin only, too.
    session.set_gaze(session::Gaze{{-400, 512}, 4});
    const auto aside = triangles();
    session.set_velocity(fast);
    EXPECT_NE(triangles(), aside);
    session.set_velocity(perception::DegreesPerSecond(0));
    EXPECT_EQ(triangles(), aside);
}

TEST(Session, SaysWhereItsTableHasNoSamples) {
    perception::CsfSamples samples{"own", {1, 16}, {0, 20}, {1, 40}, {60, 5, 120, 10, 30, 1, 50, 2}};
    session::Observer observer;
    observer.csf = std::make_shared<const perception::CsfTable>(*perception::CsfTable::create(samples));
    auto session = *Session::create(session::Scene::of(tree_of(shapes::bumpy_sphere(3, 0.03))), observer);
    const auto beyond = [&]() -> session::Effect {
        const auto plan = session.plan(session.default_view(), {.fold_test = FoldTest::luebke_hallen});
        return *std::find_if(plan->effects.begin(), plan->effects.end(),
                             [](const session::Effect& e) { return e.name == "beyond the csf table"; });
    };
    EXPECT_TRUE(beyond().on);
    EXPECT_THAT(beyond().why, AllOf(HasSubstr("above the table's 40 cd/m2"), Not(HasSubstr("degrees"))));
    session.set_gaze(session::Gaze{session::gaze_aside({}, session.default_view(), 29)});
    EXPECT_THAT(beyond().why, HasSubstr("beyond the table's 20 degrees sensitivity is taken as there"));
    Session by_default = two_balls();
    const auto plan = by_default.plan(by_default.default_view(), {.fold_test = FoldTest::luebke_hallen});
    for (const session::Effect& e : plan->effects)
        if (e.name == "beyond the csf table") EXPECT_FALSE(e.on) << e.why;
}

TEST(Observer, AVelocityIsOneThatTablesKnow) {
    for (const double bad : {-1.0, 81.0, std::numeric_limits<double>::quiet_NaN()}) {
        EXPECT_THAT(error_in(Session::create(session::Scene::of(tree_of(shapes::cube(2))),
                                             {.velocity = perception::DegreesPerSecond(bad)})),
                    HasSubstr("observer.velocity"));
    }
}

TEST(Follower, OutlivesItsSessionAndTakesUpMeasuredTrees) {
    std::optional<session::Follower> follower;
    vdtree::View view;
    {
        auto session = Session::create(session::Scene::of(tree_of(shapes::bumpy_sphere(3, 0.03))));
        view = session->default_view();
        view.eye = view.target + 100.0 * (view.eye - view.target);
        follower.emplace(*session);
    }
    const auto whole = require(follower->follow(view, {.goal = Goal::full()}));
    EXPECT_EQ(whole->stats.triangles, whole->source_triangles);
    const auto folded = follower->follow(view, {}); // by errors that are measured now: of another tree
    ASSERT_TRUE(folded);
    EXPECT_EQ(folded->fold_tests.front(), FoldTest::error);
    EXPECT_TRUE(perception::has_fold_measurement(follower->cut().tree()));
    EXPECT_LT(folded->stats.triangles, whole->stats.triangles);
}

// As a viewer shows coarse pictures while another thread makes what the fine ones need.
TEST(Follower, SessionsOfTheSameTreesMayWorkAtTheSameTime) {
    session::Scene scene = session::Scene::of(tree_of(shapes::bumpy_sphere(5, 0.03)));
    const auto coarse = require(Session::create(scene.share())), alone = require(Session::create(scene.share())),
               fine = require(Session::create(std::move(scene)));
    const Request goal{
        .goal = Goal::up_to(30), .fold_test = FoldTest::luebke_hallen, .purpose = session::Purpose::picture};
    const Request draft{
        .goal = Goal::budget(2000), .fold_test = FoldTest::extent, .purpose = session::Purpose::picture};
    const vdtree::View first = fine->default_view();
    std::vector<vdtree::Index> triangles(12);
    std::thread maker([&] {
        session::Follower follower(*fine);
        for (std::size_t i = 0; i < triangles.size(); ++i)
            triangles[i] = require(follower.follow(vdtree::orbited(first, 7.0 * double(i)), goal))->stats.triangles;
    });
    session::Follower follower(*coarse);
    for (int i = 0; i < 40; ++i) {
        const auto report = follower.follow(vdtree::orbited(first, i), draft);
        ASSERT_TRUE(report);
        EXPECT_LE(report->stats.triangles, 2000u);
    }
    maker.join();
    session::Follower again(*alone);
    for (std::size_t i = 0; i < triangles.size(); ++i)
        EXPECT_EQ(require(again.follow(vdtree::orbited(first, 7.0 * double(i)), goal))->stats.triangles, triangles[i]);
}

TEST(Observer, ACircleAroundTheGazeIsOneOfAngles) {
    const perception::Display display;
    vdtree::View view;
    view.width = 800;
    view.height = 600;
    const double distance_px = display.distance / display.pixel_pitch;
    const auto direction = [&](glm::dvec2 px) {
        return glm::normalize(glm::dvec3(px - glm::dvec2(400, 300), distance_px));
    };
    for (const glm::dvec2 gaze : {glm::dvec2(400, 300), glm::dvec2(30, 580), glm::dvec2(2000, -700)}) {
        for (const double degrees : {1.0, 15.0}) {
            const auto circle = session::gaze_circle(display, view, gaze, degrees, 40);
            ASSERT_EQ(circle.size(), 40u);
            for (const glm::dvec2 px : circle) {
                const double cosine = glm::dot(direction(px), direction(gaze));
                EXPECT_NEAR(std::acos(cosine) * 180 / std::numbers::pi, degrees, 1e-9);
            }
        }
    }
    const auto middle = session::gaze_circle(display, view, {400, 300}, 1);
    EXPECT_NEAR(middle.front().x - 400, std::tan(std::numbers::pi / 180) * distance_px, 1e-9) << "34 pixels a degree";
    // A part of the circle is beside and behind the viewer, where no screen is.
    for (const glm::dvec2 px : session::gaze_circle(display, view, {30000, 300}, 40))
        EXPECT_TRUE(std::isfinite(px.x) && std::isfinite(px.y));
}

} // namespace session_test
