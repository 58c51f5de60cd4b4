// Cuts of scenes whose lights cast shadows: nobody tells their pictures from those of the full scene, with the shadows in
// both.

#include <unseen/perception/judge.h>
#include <unseen/session/load.h>
#include <unseen/session/session.h>
#include <unseen/session_gpu/scene_renderer.h>

#include "built.h"
#include "gl_test.h"
#include "shadow_reach.h"
#include "shapes.h"

namespace unseen::app::shadow_cut_test {

using Kind = vdtree::LightSource::Kind;
using vdtree::LightSource;

constexpr int window_px = 256, samples = 64;
// What an object out of the window may keep although its shadow is not in it, either: spheres around its largest nodes
// are much larger than the object.
constexpr vdtree::Index of_largest_nodes = 20;

LightSource sun(glm::dvec3 towards, double intensity) {
    LightSource light;
    light.direction = glm::normalize(towards);
    light.intensity = intensity;
    light.casts_shadow = true;
    return light;
}

LightSource lamp(glm::dvec3 at, double intensity, double distance) {
    LightSource light;
    light.kind = Kind::point;
    light.position = at;
    light.intensity = intensity;
    light.distance = distance;
    light.casts_shadow = true;
    return light;
}

LightSource torch(glm::dvec3 at, glm::dvec3 to, double intensity) {
    LightSource light = lamp(at, intensity, glm::length(to - at));
    light.kind = Kind::spot;
    light.direction = glm::normalize(to - at);
    light.inner_cosine = std::cos(0.4);
    light.outer_cosine = std::cos(0.5);
    return light;
}

// The plane y = 0, of squares.
vdtree::Mesh floor(double half_side, int squares) {
    vdtree::Mesh mesh;
    for (int i = 0; i <= squares; ++i)
        for (int j = 0; j <= squares; ++j)
            mesh.positions.push_back({half_side * (2.0 * i / squares - 1), 0, half_side * (2.0 * j / squares - 1)});
    const auto at = [&](int i, int j) { return static_cast<vdtree::Index>(i * (squares + 1) + j); };
    for (int i = 0; i < squares; ++i)
        for (int j = 0; j < squares; ++j) {
            mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j + 1)});
            mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i + 1, j)});
        }
    return mesh;
}

struct Setting {
    const char* name;
    vdtree::Lighting lighting;
    double radius = 0.5; // of the ball
    glm::dvec3 at = {0, 0.6, 0};
    glm::dvec3 eye = {0.6, 1.6, 2.6}, target = {-0.1, 0.35, 0};
    double fov_y_degrees = 30;
    float grey = 0.8f; // of the ball
    enum class Seen { ball, shadow, nothing } seen = Seen::ball;
};

vdtree::Lighting lit(std::vector<LightSource> lights, double specular = 0) {
    vdtree::Lighting lighting;
    lighting.lights = std::move(lights);
    lighting.ambient = 0.2;
    lighting.specular = specular;
    return lighting;
}

std::vector<Setting> settings() {
    std::vector<Setting> all;
    all.push_back({"Sun", lit({sun({0.5, 1, 0.3}, 0.7)})});
    all.push_back({"GrazingSun", lit({sun({1, 0.2, 0.2}, 0.7)})});
    all.push_back({"SunAndLamp", lit({sun({0.5, 1, 0.3}, 0.4), lamp({-1.2, 1.8, 0.6}, 0.4, 1.5)})});
    all.push_back({"Spot", lit({torch({1, 2.2, 0.3}, {0, 0.5, 0}, 0.7)})});
    all.push_back({"SunWithHighlights", lit({sun({0.5, 1, 0.3}, 0.6)}, 0.05)});
    // The ball is far above the eye, the light as far above the ball, and the edge of the shadow right before the eye.
    // The ball is black, so that the eye sees nothing of it but its outline.
    LightSource narrow = torch({0, 80, 0}, {0, 0, 0}, 0.7);
    narrow.inner_cosine = std::cos(0.03);
    narrow.outer_cosine = std::cos(0.04);
    all.push_back({"NearShadow", lit({narrow}), 0.5, {0, 40, 0}, {1.5, 0.4, 0}, {1.05, 0, 0}, 45, 0.001f});
    // Out of the window: the edge of its shadow is seen, the middle of it alone, and nothing.
    const auto beside = [&](const char* name, vdtree::Lighting lighting, glm::dvec3 target, Setting::Seen seen) {
        all.push_back(
            {name, std::move(lighting), 0.5, {0, 0.6, 0}, target + glm::dvec3(0, 1.5, 0.4), target, 20, 0.8f, seen});
    };
    const vdtree::Lighting slanting = lit({sun({1, 1, 0}, 0.7)});
    const vdtree::Lighting bulb = lit({lamp({1.2, 1.8, 0}, 0.5, 1.5)});
    beside("EdgeOfUnseen", slanting, {-1.3, 0, 0}, Setting::Seen::shadow);
    beside("MiddleOfUnseen", slanting, {-0.85, 0, 0}, Setting::Seen::shadow);
    beside("AwayFromUnseen", slanting, {4, 0, 0}, Setting::Seen::nothing);
    beside("BulbEdgeOfUnseen", bulb, {-1.45, 0, 0}, Setting::Seen::shadow);
    beside("BulbAwayFromUnseen", lit({lamp({2.4, 3, 0}, 0.5, 3)}), {4.5, 0, 1}, Setting::Seen::nothing);
    beside("EdgesOfTwoLights", lit({sun({1, 1, 0}, 0.4), lamp({1.2, 1.8, 0}, 0.3, 1.5)}), {-1.35, 0, 0},
           Setting::Seen::shadow);
    return all;
}

// Measured under lights once: that takes longer than all else here.
vdtree::VertexTree ball_of(float grey) {
    static std::map<float, vdtree::VertexTree> measured;
    const auto found = measured.find(grey);
    if (found != measured.end()) return found->second.share();
    vdtree::Mesh mesh = shapes::bumpy_sphere(4, 0.0001);
    mesh.colours.assign(mesh.positions.size(), glm::vec4(glm::vec3(grey), 1));
    auto tree = require(session::measured_under_lights(support::built(mesh)));
    return measured.emplace(grey, std::move(*tree)).first->second.share();
}

class ShadowCut : public render::testing::GlTest, public ::testing::WithParamInterface<std::size_t> {
protected:
    static session::Scene scene_of(const Setting& setting, const vdtree::VertexTree& ball,
                                   const vdtree::VertexTree& ground, bool casts) {
        session::Scene scene = session::Scene::of(ball.share(), setting.radius);
        scene.objects[0].placement.translation = setting.at;
        scene.backdrop.push_back({ground.share()});
        vdtree::Lighting lighting = setting.lighting;
        for (LightSource& light : lighting.lights) light.casts_shadow = casts;
        scene.lights = *calibration::LightRig::of(lighting, "the test's lights");
        return scene;
    }

    static vdtree::View view_of(const Setting& setting) {
        vdtree::View view;
        view.eye = setting.eye;
        view.target = setting.target;
        view.width = view.height = window_px;
        view.fov_y_degrees = setting.fov_y_degrees;
        return view;
    }

    static perception::Image image_of(session::SceneRenderer& renderer, const std::vector<vdtree::Cut>& cuts,
                                      const vdtree::View& view, float background) {
        return image_of(renderer, session::drawn_cuts(cuts), view, background);
    }
    static perception::Image image_of(session::SceneRenderer& renderer, const std::vector<session::DrawnCut>& cuts,
                                      const vdtree::View& view, float background) {
        render::DrawOptions options;
        options.samples = samples;
        options.background = background;
        const auto frame = renderer.draw(cuts, view, options);
        EXPECT_TRUE(frame) << frame.error().message;
        perception::Image image{frame->width, frame->height, 1, frame->luminance};
        for (float& value : image.values)
            value = static_cast<float>(perception::to_luminance({}, static_cast<double>(value)).value());
        return image;
    }
};

TEST_P(ShadowCut, CannotBeToldFromTheWhole) {
    const Setting setting = settings()[GetParam()];
    const vdtree::VertexTree ball = ball_of(setting.grey), ground = support::built(floor(6, 48));
    const vdtree::View view = view_of(setting);
    auto session = require(session::Session::create(scene_of(setting, ball, ground, true)));
    session::Request request;
    request.purpose = session::Purpose::picture;
    const auto cut = require(session->simplify(view, request));
    request.goal = session::Goal::full();
    const auto full = require(session->simplify(view, request));
    auto renderer = require(session::SceneRenderer::create(context(), *session));
    const auto judged = [&](const std::vector<vdtree::Cut>& cuts) {
        const auto difference =
            perception::judge_modern(image_of(*renderer, full->cuts, view, session->background()),
                                     image_of(*renderer, cuts, view, session->background()),
                                     {.csf = perception::CsfModel::castle, .gain = perception::default_person.gain});
        EXPECT_TRUE(difference);
        return *difference;
    };
    const perception::Judgement judgement = judged(cut->cuts);
    EXPECT_EQ(judgement.visible_pixels, 0) << judgement.max_ratio;
    // With highlights the test goes by what the lights can make of a node, hidden and not: from so near it keeps all.
    if (setting.lighting.specular == 0) EXPECT_LT(cut->stats.triangles, full->stats.triangles);
    if (setting.seen == Setting::Seen::nothing) EXPECT_LE(cut->stats.triangles, of_largest_nodes);
    for (const session::Effect& effect : cut->effects) {
        if (effect.name == "frustum culling") EXPECT_TRUE(effect.on) << effect.why;
        if (effect.name == "shadows") {
            const bool keeps_none = effect.why.find("as all do here") != std::string::npos;
            EXPECT_TRUE(!keeps_none || setting.seen == Setting::Seen::nothing) << effect.why;
        }
    }
    if (setting.seen == Setting::Seen::shadow) { // and not for the eye
        EXPECT_GT(cut->stats.triangles, 0u);
        EXPECT_LT(cut->stats.triangles, full->stats.triangles / 2);
        const std::vector<vdtree::Cut> none = [&] {
            std::vector<vdtree::Cut> cuts;
            cuts.emplace_back(session->tree());
            return cuts;
        }();
        EXPECT_GT(judged(none).visible_pixels, 0);
    }
    RecordProperty("triangles", static_cast<int>(cut->stats.triangles));
    RecordProperty("of", static_cast<int>(full->stats.triangles));
    RecordProperty("ratio", std::to_string(judgement.max_ratio));
    ASSERT_TRUE(renderer->shadows());
    EXPECT_EQ(static_cast<std::size_t>(renderer->shadows()->lights), setting.lighting.lights.size());

    // The cut for the eye alone does not do.
    if (std::string(setting.name) != "NearShadow") return;
    auto unaware = require(session::Session::create(scene_of(setting, ball, ground, false)));
    const auto for_eye = require(unaware->simplify(view, {.purpose = session::Purpose::picture}));
    EXPECT_LT(for_eye->stats.triangles, cut->stats.triangles);
    const perception::Judgement seen = judged(for_eye->cuts);
    RecordProperty("eye", static_cast<int>(for_eye->stats.triangles));
    RecordProperty("eyeratio", std::to_string(seen.max_ratio));
    EXPECT_GT(seen.visible_pixels, 0) << seen.max_ratio;
}

// From where nothing of the shadow is seen past its edge and into its middle, frame by frame.
TEST_F(ShadowCut, FollowsAnEyeThatMoves) {
    Setting setting = settings()[6];
    ASSERT_STREQ(setting.name, "EdgeOfUnseen");
    const vdtree::VertexTree ball = ball_of(setting.grey), ground = support::built(floor(6, 48));
    auto session = require(session::Session::create(scene_of(setting, ball, ground, true)));
    auto renderer = require(session::SceneRenderer::create(context(), *session));
    session::Follower follower(*session);
    session::Request request;
    request.purpose = session::Purpose::picture;
    std::vector<vdtree::Cut> full;
    full.emplace_back(session->tree()).unfold_all();
    constexpr int frames = 30, judged_every = 10;
    for (int frame = 0; frame <= frames; ++frame) {
        const double x = -4 + 3.0 * frame / frames;
        setting.eye.x = setting.target.x = x;
        const vdtree::View view = view_of(setting);
        const auto report = require(follower.follow(view, request));
        if (frame == 0) EXPECT_LE(report->stats.triangles, of_largest_nodes);
        if (frame % judged_every != 0) continue;
        const auto difference =
            perception::judge_modern(image_of(*renderer, full, view, session->background()),
                                     image_of(*renderer, session::drawn_cuts(follower, 1), view, session->background()),
                                     {.csf = perception::CsfModel::castle, .gain = perception::default_person.gain});
        ASSERT_TRUE(difference);
        EXPECT_EQ(difference->visible_pixels, 0) << "frame " << frame << ": " << difference->max_ratio;
    }
}

// What a cut made from scratch keeps for its shadows is told by its own view, whatever was looked at before.
TEST_P(ShadowCut, FromScratchDependsOnNoViewBefore) {
    const Setting setting = settings()[GetParam()];
    const vdtree::VertexTree ball = ball_of(setting.grey), ground = support::built(floor(6, 48));
    const vdtree::View view = view_of(setting);
    session::Request request;
    request.purpose = session::Purpose::picture;
    const auto triangles_of = [&](session::Session& session) {
        const auto made = session.simplify(view, request);
        EXPECT_TRUE(made);
        const auto indices = made ? made->cuts[0].indices() : std::span<const vdtree::NodeId>();
        return std::vector<vdtree::NodeId>(indices.begin(), indices.end());
    };
    auto unused = require(session::Session::create(scene_of(setting, ball, ground, true)));
    const auto first = triangles_of(*unused);
    EXPECT_EQ(triangles_of(*unused), first);

    auto used = require(session::Session::create(scene_of(setting, ball, ground, true)));
    session::Follower follower(*used);
    for (const double degrees : {0.0, 0.5, 1.0, 20.0}) {
        ASSERT_TRUE(follower.follow(vdtree::orbited(view, degrees), request));
        EXPECT_EQ(triangles_of(*used), first) << degrees;
    }
    request.goal = session::Goal::up_to(0.5);
    ASSERT_TRUE(used->simplify(view, request));
    ASSERT_TRUE(unused->simplify(view, request));
    EXPECT_EQ(triangles_of(*used), triangles_of(*unused));
}

INSTANTIATE_TEST_SUITE_P(Settings, ShadowCut, ::testing::Range<std::size_t>(0, 12),
                         [](const auto& of) { return std::string(settings()[of.param].name); });

} // namespace unseen::app::shadow_cut_test
