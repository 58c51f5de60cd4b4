// A session remembers criteria, tables, trees, spheres and shadows from one request to the next. What it was asked before
// never decides: every field of what can be asked is varied, two at a time, in one session, and each answer is that of a
// session that has never been asked anything.

#include <unseen/session/session.h>

#include "built.h"
#include "measured.h"
#include "shapes.h"
#include "temp_folder.h"
#include "testing.h"

namespace session_memory_test {

using namespace unseen;
using session::FoldTest;
using session::Goal;
using session::Session;

// Everything that a session can be asked with.
struct Question {
    vdtree::View view;
    session::Request request;
    std::optional<session::Gaze> gaze;
    perception::DegreesPerSecond velocity{0};
    double seconds = 0;
    bool is_shown = false; // a picture of the view and of no other
};

// Makes the change of a number, and returns how many there are. A new field of any of these structs does not compile here
// before it has a name, and then wants a change below.
int change(Question& q, int number) {
    int count = 0;
    const auto set = [&](auto& field, const auto& value) {
        if (count++ == number) field = value;
    };
    auto& [eye, target, up, fov_y_degrees, width, height, shift, eye_distance, orthographic_height] = q.view;
    set(eye, glm::dvec3(0.3, 0.2, 4));
    set(target, glm::dvec3(0.4, 0, 0));
    set(up, glm::dvec3(1, 1, 0));
    set(fov_y_degrees, 20.0);
    set(width, 300);
    set(height, 150);
    set(shift, glm::dvec2(0.3, -0.2));
    set(eye_distance, 0.3);
    set(orthographic_height, 3.0);
    set(orthographic_height, 30.0);

    auto& [goal, fold_test, milliseconds, hysteresis, purpose, order, shown, keeps_shadows, may_measure, reasons] =
        q.request;
    set(goal, Goal::full());
    set(goal, Goal::budget(400));
    set(goal, Goal::budget(400, true));
    set(goal, Goal::pixels(2));
    set(goal, Goal::quality(session::Quality::good));
    for (const session::FoldTestFacts& facts : session::fold_tests()) set(fold_test, facts.test);
    set(milliseconds, 1e6);
    set(goal, Goal::up_to(3));
    set(hysteresis, 2.0f);
    set(purpose, session::Purpose::picture);
    set(purpose, session::Purpose::flight);
    set(order, session::Order::largest);
    set(keeps_shadows, false);
    set(may_measure, false);
    set(reasons, false);
    set(q.is_shown, true);
    static_cast<void>(shown); // made of the view when it is known

    const session::Observer whole;
    [[maybe_unused]] const auto& [display, person, csf, gaze, velocity] = whole; // the first three stay with a session
    auto [px, margin_deg] = session::Gaze{glm::dvec2(60, 100), 0};
    set(q.gaze, session::Gaze{px, margin_deg});
    set(q.gaze, session::Gaze{glm::dvec2(5000, 100), 0});
    set(q.gaze, session::Gaze{px, 3});
    set(q.velocity, perception::DegreesPerSecond(20));
    set(q.seconds, 1.5);
    return count;
}

session::Request with_picture(const Question& q) {
    session::Request request = q.request;
    const auto pixels = static_cast<std::size_t>(q.view.width) * static_cast<std::size_t>(q.view.height);
    if (q.is_shown) { // a wall through the middle
        const auto shown = vdtree::DepthPicture::create(q.view, std::vector<float>(pixels, 4));
        if (shown) request.shown = {*shown};
    }
    return request;
}

// The triangles of each object's cut, which test, and why; or the complaint.
struct Answer {
    std::vector<std::vector<vdtree::Index>> indices;
    std::string words;
    bool operator==(const Answer&) const = default;
};

Answer ask(Session& session, const Question& q) {
    session.set_gaze(q.gaze);
    session.set_velocity(q.velocity);
    session.set_time(q.seconds);
    const auto made = session.simplify(q.view, with_picture(q));
    if (!made) return {{}, made.error().message};
    Answer answer;
    for (const vdtree::Cut& cut : made->cuts) {
        const auto indices = cut.indices();
        answer.indices.emplace_back(indices.begin(), indices.end());
    }
    for (const FoldTest test : made->fold_tests) answer.words += session::name_of(test) + "\n";
    for (const session::Effect& effect : made->effects) answer.words += effect.name + ": " + effect.why + "\n";
    return answer;
}

// A scene. The pairs of changes are dealt out over the scenes, in three parts; every scene has all single changes.
struct SceneCase {
    int hand;
    std::string name;
    std::function<session::Scene()> make;
};

vdtree::Mesh coloured_ball() {
    vdtree::Mesh mesh = shapes::bumpy_sphere(2, 0.03);
    for (const glm::dvec3& p : mesh.positions)
        mesh.colours.emplace_back(0.5 + 0.4 * std::sin(3 * p.x), 0.5 + 0.3 * p.y, 0.5, 1);
    return mesh;
}

// Two objects of one tree and one of another, with a wall behind.
session::Scene three_balls(const vdtree::VertexTree& coloured, const vdtree::VertexTree& grey) {
    session::Scene scene = session::Scene::of(coloured.share());
    scene.objects.push_back({coloured.share(), {.scale = 0.3, .translation = {1.1, 0.2, 0.3}}, "small"});
    scene.objects.push_back({grey.share(), {.scale = 0.5, .translation = {-1.2, -0.3, -0.5}}, "grey"});
    scene.backdrop.push_back({grey.share(), {.scale = 2, .translation = {0, -2.5, -3}}, "behind"});
    return scene;
}

session::Scene measured_balls() {
    static const vdtree::VertexTree coloured = *session::measured_under_lights(
                                        *session::measured(support::built(coloured_ball()))),
                                    grey = *session::measured_under_lights(
                                        *session::measured(support::built(shapes::bumpy_sphere(2, 0.02))));
    return three_balls(coloured, grey);
}

vdtree::Lighting lighting(bool casts_shadow, double specular) {
    vdtree::Lighting lighting;
    lighting.ambient = 0.15;
    lighting.specular = specular;
    for (const glm::dvec3 towards : {glm::dvec3(0.3, 1, 0.5), glm::dvec3(-1, 0.3, 0.6)}) {
        vdtree::LightSource light;
        light.direction = glm::normalize(towards);
        light.intensity = 0.4;
        light.casts_shadow = casts_shadow && lighting.lights.empty();
        lighting.lights.push_back(light);
    }
    return lighting;
}

session::Scene lit(bool casts_shadow, double specular) {
    session::Scene scene = measured_balls();
    scene.lights = *calibration::LightRig::of(lighting(casts_shadow, specular), "lights of the test");
    return scene;
}

session::Scene under_moving_lights() {
    const support::TempFolder folder;
    const auto file = folder.path() / "lights.json";
    std::ofstream(file) << R"({"ambient": 0.1, "material": {"specular": 0.04, "shininess": 40}, "lights": [
        {"type": "directional", "direction": [0.4, 0.7, 0.6], "intensity": 0.6, "shadow": true,
         "orbit": {"axis": [0, 1, 0], "degrees_per_second": 60}},
        {"type": "headlight", "intensity": 0.2}]})";
    session::Scene scene = measured_balls();
    scene.lights = *calibration::LightRig::read(file);
    return scene;
}

std::vector<SceneCase> scene_cases() {
    const SceneCase scenes[] = {{0, "OwnLight", measured_balls},
                                {1, "StillLights", [] { return lit(false, 0); }},
                                {2, "Shadows", [] { return lit(true, 0); }},
                                {3, "Highlights", [] { return lit(true, 0.05); }},
                                {4, "MovingLights", under_moving_lights}};
    std::vector<SceneCase> cases;
    for (int part = 0; part < 3; ++part)
        for (const auto& [number, name, make] : scenes)
            cases.push_back({5 * part + number, name + "_" + std::to_string(part), make});
    return cases;
}

class SessionMemory : public testing::TestWithParam<SceneCase> {};

TEST_P(SessionMemory, DecidesNothing) {
    session::Observer observer;
    observer.person = perception::median_person;
    const auto fresh = [&] { return *Session::create(GetParam().make(), observer); };
    Question plain;
    plain.view = {.eye = {0.2, 0.1, 5}, .width = 200, .height = 200};
    const auto changed = [&](int first, int second) {
        Question q = plain;
        change(q, first);
        change(q, second);
        return q;
    };
    const int count = change(plain, -1);
    std::vector<Answer> alone;
    for (int i = 0; i < count; ++i) {
        Session session = fresh();
        alone.push_back(ask(session, changed(i, i)));
    }
    Session asked = fresh();
    int others = 0;
    for (int i = 0; i < count; ++i)
        for (int k = 0; k < i; ++k) {
            if ((i + k) % 15 != GetParam().hand) continue;
            Session session = fresh();
            const Answer both = ask(session, changed(i, k));
            others += both != alone[static_cast<std::size_t>(i)];
            ASSERT_EQ(ask(asked, changed(i, i)).words, alone[static_cast<std::size_t>(i)].words) << i << " after " << k;
            ASSERT_TRUE(ask(asked, changed(i, k)) == both) << "changes " << i << " and " << k;
            ASSERT_TRUE(ask(asked, changed(k, k)) == alone[static_cast<std::size_t>(k)]) << k << " after " << i;
        }
    EXPECT_GT(others, count / 2) << "most changes change something";
}

INSTANTIATE_TEST_SUITE_P(Scenes, SessionMemory, testing::ValuesIn(scene_cases()),
                         [](const auto& info) { return info.param.name; });

} // namespace session_memory_test
