// Drawing under lights: every vertex in the luminance that its formula says, and simplifications that nobody tells from
// the whole.

#include <unseen/perception/criterion.h>
#include <unseen/perception/display.h>
#include <unseen/perception/judge.h>
#include <unseen/render/context.h>
#include <unseen/render/renderer.h>
#include <unseen/vdtree/internal/light_bounds.h>

#include "built.h"
#include "oracle.h"
#include "shapes.h"

namespace unseen::lit_test {

using support::built;
using vdtree::Cut;
using vdtree::Lighting;
using vdtree::LightSource;
using vdtree::Mesh;
using vdtree::VertexTree;
using vdtree::View;
using Kind = LightSource::Kind;

struct Lights {
    const char* name;
    Lighting lighting; // for a model of radius about 1 at the origin
};
std::vector<Lights> all_lights() {
    LightSource sun;
    sun.direction = glm::normalize(glm::dvec3(0.4, 0.7, 0.6));
    sun.intensity = 0.7;
    LightSource lamp;
    lamp.kind = Kind::point;
    lamp.position = {1.5, 1.2, 1.6};
    lamp.intensity = 0.6;
    lamp.distance = 1.6;
    LightSource torch = lamp;
    torch.kind = Kind::spot;
    torch.direction = glm::normalize(-torch.position);
    torch.inner_cosine = std::cos(0.2);
    torch.outer_cosine = std::cos(0.45);
    const auto with = [](std::vector<LightSource> lights, double ambient, double specular) {
        Lighting lighting;
        lighting.lights = std::move(lights);
        lighting.ambient = ambient;
        lighting.specular = specular;
        lighting.shininess = 30;
        return lighting;
    };
    return {{"directional", with({sun}, 0.15, 0)},
            {"point", with({lamp}, 0.05, 0)},
            {"spot", with({torch}, 0.1, 0)},
            {"highlights", with({sun}, 0.1, 0.06)},
            {"all", with({sun, lamp, torch}, 0, 0.03)}};
}

class Lit : public testing::TestWithParam<std::size_t> {
protected:
    void SetUp() override {
        auto context = render::Context::headless();
        if (!context) GTEST_SKIP() << context.error().message;
        context_ = std::make_unique<render::Context>(std::move(*context));
    }
    Lights lights() const { return all_lights()[GetParam()]; }
    std::unique_ptr<render::Context> context_;
};

// A large triangle a pixel: what is drawn in its corner is its vertex.
TEST_P(Lit, VerticesAreAsBrightAsTheFormulaSays) {
    Mesh mesh = shapes::with_attributes(shapes::icosphere(2));
    mesh.normals.clear(); // they point anywhere; the vertices have to be seen
    const VertexTree tree = built(mesh);
    auto renderer = require(render::Renderer::create(*context_, tree));
    Cut cut(tree);
    cut.unfold_all();
    const Lighting lighting = lights().lighting;
    int compared = 0;
    for (vdtree::Index leaf = 0; leaf < tree.leaf_count(); leaf += 5) {
        const vdtree::WedgeId wedge = tree.wedge_of_leaf(leaf);
        const glm::dvec3 position(tree.positions()[wedge]), normal(glm::vec3(tree.normals()[wedge]));
        View view;
        view.width = view.height = 1;
        view.fov_y_degrees = 1e-4; // a hair around the vertex
        view.target = tree.origin() + position;
        view.eye = view.target + 3.0 * normal + glm::dvec3(0.3, 0.2, 0.1);
        if (std::abs(normal.y) > 0.9) view.up = {1, 0, 0};
        render::DrawOptions options;
        options.samples = 1;
        options.lighting = lighting;
        const auto frame = require(renderer->draw(cut, view, options));
        const double expected = vdtree::lit_luminance(
            lighting, position, normal, static_cast<double>(vdtree::albedo_of(tree, wedge)), view.eye - tree.origin());
        EXPECT_NEAR(frame->luminance[0], expected, 1e-4) << lights().name << ", leaf " << leaf;
        const glm::dvec3 rgb(frame->colour[0], frame->colour[1], frame->colour[2]);
        EXPECT_NEAR(glm::dot(rgb, glm::dvec3(0.2126, 0.7152, 0.0722)), expected, 1e-4)
            << "the colour is scaled to the luminance";
        ++compared;
    }
    EXPECT_GT(compared, 20);
}

TEST_P(Lit, SimplificationsCannotBeToldFromTheWhole) {
    const Lighting lighting = lights().lighting;
    for (const Mesh& mesh : {shapes::bumpy_sphere(5, 0.0005), shapes::torus(120, 60, 0.8, 0.3)}) {
        const VertexTree tree = built(mesh);
        const auto bounds = std::make_shared<vdtree::LightBounds>(*vdtree::LightBounds::measure(tree));
        auto renderer = require(render::Renderer::create(*context_, tree));
        double kept = 0, all = 0;
        for (oracle::Look look : oracle::looks_at(tree, {.window_px = 256, .count = 3, .far_fill = 0.3})) {
            vdtree::Viewpoint viewpoint = perception::viewpoint_of(tree, look.view, look.options);
            viewpoint.lighting = lighting;
            look.options.scene = perception::lit_scene(tree, *bounds, lighting, viewpoint.eye, oracle::background);
            const auto criterion = require(perception::lit_distances(tree, bounds, look.view, look.options));
            Cut whole(tree), cut(tree);
            whole.unfold_all();
            ASSERT_TRUE(cut.follow(*criterion, viewpoint));
            kept += cut.triangle_count();
            all += whole.triangle_count();
            const auto draw = [&](const Cut& of) { return oracle::draw(*renderer, of, look.view, 36, lighting); };
            const perception::Judgement judged =
                oracle::judge(draw(whole), draw(cut), look, perception::CsfModel::castle);
            EXPECT_EQ(judged.visible_pixels, 0) << lights().name << ", from " << oracle::words(look) << ", "
                                                << cut.triangle_count() << " of " << whole.triangle_count();
        }
        EXPECT_LT(kept, 0.9 * all);
    }
}
INSTANTIATE_TEST_SUITE_P(Lights, Lit, testing::Range<std::size_t>(0, 5),
                         [](const auto& of) { return std::string(all_lights()[of.param].name); });

TEST_P(Lit, RefusesLightsThatCannotBe) {
    const VertexTree tree = built(shapes::icosphere(2));
    auto renderer = require(render::Renderer::create(*context_, tree));
    render::DrawOptions options;
    options.lighting = Lighting(); // dark
    View view;
    view.eye = {0, 0, 5};
    const auto frame = renderer->draw(Cut(tree), view, options);
    ASSERT_FALSE(frame);
    EXPECT_NE(frame.error().message.find("The scene is black"), std::string::npos);
}

} // namespace unseen::lit_test
