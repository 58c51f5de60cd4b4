// Scenes of several items: depth across trees, shared trees, layers, depth-only and display targets, and nothing made
// that is not asked for.
#include "gl_test.h"
#include "scenes.h"

#define GL_GLEXT_PROTOTYPES 1
#include <GL/glcorearb.h>

#include <unseen/render/renderer.h>
#include <unseen/render/sample_sum.h>

namespace scene_test {

using namespace unseen::render;
using namespace unseen::render::testing;
using unseen::vdtree::Cut;
using unseen::vdtree::Geomorph;
using unseen::vdtree::Similarity;
using unseen::vdtree::View;

constexpr int window = 128;
constexpr float value_tolerance = 1e-5f; // relative luminance: a rasteriser's interpolation in float
// The share of pixels that may differ. Where surfaces meet, depths are rounded in each tree's own frame and may tell
// another one the nearer; pixels at outlines may lie on the other side.
constexpr double most_flipped = 0.002;

Similarity at(glm::dvec3 place, double scale = 1) {
    Similarity placement;
    placement.translation = place;
    placement.scale = scale;
    return placement;
}

View oblique_view() {
    View view = frontal_view(window, window);
    view.eye = {1.5, 2, 4};
    view.fov_y_degrees = 45;
    return view;
}

class SceneTest : public GlTest {
protected:
    GpuTree on_gpu(const Scene& scene) {
        auto made = require(GpuTree::create(context(), scene.tree));
        return *made;
    }
    GpuCut cut_on_gpu(const Scene& scene) {
        GpuCut cut(on_gpu(scene));
        EXPECT_TRUE(cut.follow(scene.cut));
        return cut;
    }
    Target target(const TargetOptions& options = {}) {
        return std::move(*require(Target::create(context(), window, window, options)));
    }
    std::vector<float> picture(const std::vector<Item>& items, const View& view) {
        Target to = target();
        const auto drawn = draw(items, {.view = view}, to);
        EXPECT_TRUE(drawn) << drawn.error().message;
        auto read = read_luminance(to);
        EXPECT_TRUE(read) << read.error().message;
        return read ? *read : std::vector<float>{};
    }
};

double flipped_share(const std::vector<float>& a, const std::vector<float>& b) {
    EXPECT_EQ(a.size(), b.size());
    std::size_t flipped = 0;
    for (std::size_t i = 0; i < a.size(); ++i) flipped += !(std::abs(a[i] - b[i]) <= value_tolerance);
    return static_cast<double>(flipped) / static_cast<double>(a.size());
}

Mesh merged(Mesh a, const Mesh& b) {
    const Index first = static_cast<Index>(a.positions.size());
    a.positions.insert(a.positions.end(), b.positions.begin(), b.positions.end());
    a.colours.insert(a.colours.end(), b.colours.begin(), b.colours.end());
    for (const auto& t : b.triangles) a.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    return a;
}

Mesh painted(Mesh mesh, float luminance) {
    std::fill(mesh.colours.begin(), mesh.colours.end(), grey(luminance));
    return mesh;
}

TEST_F(SceneTest, TreesThatInterpenetrateLookLikeOneMesh) {
    const Mesh ball = painted(bumpy_sphere(40), 0.8f);
    // The ball sticks out of the cube's faces; it is its own size, or comes from a tree in other units.
    for (const double size : {1.0, 1e-3, 1e5}) {
        const glm::dvec3 place(0.5, 0.6, 0.4);
        const Scene box(cube()), sphere(transformed(ball, [&](glm::dvec3 p) { return p * size; }));
        const Scene both(merged(cube(), transformed(ball, [&](glm::dvec3 p) { return p + place; })));
        const GpuCut box_cut = cut_on_gpu(box), sphere_cut = cut_on_gpu(sphere), both_cut = cut_on_gpu(both);
        for (const glm::dvec3 eye :
             {glm::dvec3(1.5, 2, 4), glm::dvec3(3, 0.5, 1), glm::dvec3(40, 50, 30), glm::dvec3(-0.7, -0.6, -0.6)}) {
            View view = oblique_view();
            view.eye = eye;
            view.target = place; // the last eye is inside of the cube
            view.fov_y_degrees = glm::length(eye) > 10 ? 3 : 60;
            const auto expected = picture({{.cut = both_cut}}, view);
            const Item first{.cut = box_cut}, second{.cut = sphere_cut, .placement = at(place, 1 / size)};
            EXPECT_LT(flipped_share(picture({first, second}, view), expected), most_flipped) << size << ", " << eye.x;
            EXPECT_LT(flipped_share(picture({second, first}, view), expected), most_flipped) << size << ", " << eye.x;
            // Or else it would not be seen whether depth is compared across items.
            EXPECT_GT(flipped_share(picture({first}, view), expected), 25 * most_flipped);
        }
    }
}

TEST_F(SceneTest, SamplesAreAddedAcrossItems) {
    const Scene box(cube()), sphere(painted(bumpy_sphere(40), 0.8f));
    const Scene both(merged(
        cube(), transformed(painted(bumpy_sphere(40), 0.8f), [](glm::dvec3 p) { return p + glm::dvec3(1, 1, 1); })));
    const std::vector<Item> items = {{.cut = cut_on_gpu(box)}, {.cut = cut_on_gpu(sphere), .placement = at({1, 1, 1})}};
    const Item merged_item{.cut = cut_on_gpu(both)};
    auto sum = require(SampleSum::create(context(), window, window));
    const auto mean = [&](std::span<const Item> drawn) {
        EXPECT_TRUE(sum->draw(drawn, oblique_view(), {.samples = 8}));
        const auto pixels = sum->mean();
        EXPECT_TRUE(pixels);
        return std::vector(pixels->begin(), pixels->end());
    };
    const auto expected = mean({&merged_item, 1}), drawn = mean(items);
    double difference = 0;
    for (std::size_t i = 0; i < drawn.size(); ++i)
        difference += std::abs(drawn[i].a - expected[i].a) / static_cast<double>(drawn.size());
    EXPECT_LT(difference, most_flipped * 0.1) << "flipped samples differ by a part of the range";
    EXPECT_EQ(drawn[0].a, default_background);
}

TEST_F(SceneTest, OneTreeIsSharedByCutsOfItsOwn) {
    Scene scene(bumpy_sphere(40));
    const GpuTree tree = on_gpu(scene);
    GpuCut fine(tree), coarse(tree);
    ASSERT_TRUE(fine.follow(scene.cut));
    const auto criterion = require(unseen::vdtree::extent_criterion(scene.tree, oblique_view(), 12));
    Cut folded(scene.tree);
    ASSERT_TRUE(folded.follow(*criterion, {.eye = {1.5, 2, 4}}));
    ASSERT_TRUE(coarse.follow(folded));
    ASSERT_LT(folded.triangle_count(), scene.cut.triangle_count() / 2);
    const auto left = at({-1.1, 0, 0}), right = at({1.1, 0, 0});
    const auto both =
        picture({{.cut = fine, .placement = left}, {.cut = coarse, .placement = right}}, frontal_view(window, window));
    const auto alone = [&](const GpuCut& cut, const Similarity& placement) {
        return picture({{.cut = cut, .placement = placement}}, frontal_view(window, window));
    };
    const auto fine_left = alone(fine, left), coarse_right = alone(coarse, right);
    for (std::size_t i = 0; i < both.size(); ++i)
        ASSERT_EQ(both[i], i % window < window / 2 ? fine_left[i] : coarse_right[i]) << i;
    EXPECT_NE(fine_left, alone(coarse, left));
}

TEST_F(SceneTest, GlidesOfOneCutDoNotMoveAnotherOfItsTree) {
    Scene scene(bumpy_sphere(24));
    const GpuTree tree = on_gpu(scene);
    GpuCut still(tree), gliding(tree);
    ASSERT_TRUE(still.follow(scene.cut));
    Cut followed(scene.tree);
    auto geomorph = require(Geomorph::create(scene.tree, 1, std::numeric_limits<double>::infinity()));
    ASSERT_TRUE(geomorph->step(followed, 0));
    followed.unfold_all();
    ASSERT_TRUE(geomorph->step(followed, 0));
    ASSERT_TRUE(geomorph->step(followed, 0.5));
    ASSERT_TRUE(geomorph->is_gliding());
    ASSERT_TRUE(gliding.follow(*geomorph));

    const View view = oblique_view();
    const Item a{.cut = still, .placement = at({-1, 0, 0})}, b{.cut = gliding, .placement = at({1, 0, 0})};
    const auto still_alone = picture({a}, view), gliding_alone = picture({b}, view);
    EXPECT_GT(gliding.uploaded_bytes(), 32 * geomorph->moved().size());
    for (int i = 0; i < 2; ++i) EXPECT_EQ(picture({a, b}, view), picture({b, a}, view));
    EXPECT_EQ(picture({a}, view), still_alone);
    EXPECT_EQ(picture({b}, view), gliding_alone);
    const auto uploaded = gliding.uploaded_bytes();
    EXPECT_EQ(picture({b}, view), gliding_alone);
    EXPECT_EQ(gliding.uploaded_bytes(), uploaded) << "nothing came between";
}

TEST_F(SceneTest, DrawsIntoWhatIsThereWhereNothingIsCleared) {
    const Scene box(cube()), sphere(painted(bumpy_sphere(40), 0.8f));
    const Item first{.cut = cut_on_gpu(box)}, second{.cut = cut_on_gpu(sphere), .placement = at({1, 1, 1})};
    const std::vector<Item> both = {first, second};
    const auto near = require(near_plane(both, oblique_view()));
    const Camera camera{.view = oblique_view(), .near_plane = *near};
    Target to = target();
    ASSERT_TRUE(draw({&second, 1}, camera, to));
    ASSERT_TRUE(draw({&first, 1}, camera, to, {.colour = {}, .depth = false}));
    EXPECT_EQ(*read_luminance(to), picture(both, oblique_view()));
    // A layer in front of everything: colours are kept, depth is not.
    ASSERT_TRUE(draw({&first, 1}, camera, to));
    ASSERT_TRUE(draw({&second, 1}, camera, to, {.colour = {}}));
    const auto alone = picture({second}, oblique_view()), layered = *read_luminance(to);
    for (std::size_t i = 0; i < alone.size(); ++i)
        if (alone[i] != default_background) ASSERT_EQ(layered[i], alone[i]) << i;
}

TEST_F(SceneTest, DrawsOneOfSeveralColours) {
    const Scene box(cube());
    const Item item{.cut = cut_on_gpu(box)};
    Target to = target({.colours = {ColourFormat::rgba32f, ColourFormat::rgba32f}});
    ASSERT_TRUE(draw({}, {.view = oblique_view()}, to, {.colour = glm::vec4(0.3f)}, 0));
    ASSERT_TRUE(draw({&item, 1}, {.view = oblique_view()}, to, {}, 1));
    EXPECT_THAT(*read_luminance(to, 0), Each(0.3f));
    EXPECT_EQ(*read_luminance(to, 1), picture({item}, oblique_view()));
    EXPECT_FALSE(draw({&item, 1}, {.view = oblique_view()}, to, {}, 2));
}

TEST_F(SceneTest, DepthIsTheNearPlanesShareOfTheDistance) {
    const Scene wall(rectangle({-9, -9}, {9, 9}, 0, grey(0.5f)));
    const Item item{
        .cut = cut_on_gpu(wall), .wireframe = true, .lighting = unseen::vdtree::Lighting{.lights = {}, .ambient = 1}};
    Target to = target({.colours = {}});
    for (const double near : {0.5, 0.01}) { // the wall is 1 away
        ASSERT_TRUE(draw({&item, 1}, {.view = frontal_view(window, window), .near_plane = near}, to));
        EXPECT_THAT(*read_depth(to), Each(FloatNear(static_cast<float>(near), 1e-6f)));
    }
    ASSERT_TRUE(draw({}, {.view = frontal_view(window, window)}, to));
    EXPECT_THAT(*read_depth(to), Each(0.0f)) << "nothing is infinitely far";
}

TEST_F(SceneTest, DisplaysGetOpaqueSrgb) {
    const Scene wall(rectangle({-9, 0}, {9, 9}, 0, grey(0.5f))); // the upper half
    const Item item{.cut = cut_on_gpu(wall)};
    Target own = target({.colours = {ColourFormat::srgb8}}), floats = target();
    auto foreign =
        Target::foreign(context(), window, window, {.id = floats.id()}); // whose floats encode nothing themselves
    ASSERT_TRUE(foreign);
    const auto encoded = [](double linear) { return 1.055 * std::pow(linear, 1 / 2.4) - 0.055; };
    for (Target* to : {&own, &*foreign}) {
        ASSERT_TRUE(draw({&item, 1}, {.view = frontal_view(window, window)}, *to));
        const auto pixels = require(read_pixels(*to));
        constexpr double code = 1.0 / 255; // drivers round in either direction
        EXPECT_NEAR(pixels->front().g, encoded(0.5), code);
        EXPECT_NEAR(pixels->back().g, encoded(default_background), code);
        EXPECT_EQ(pixels->front().a, 1);
        EXPECT_EQ(pixels->back().a, 1);
    }
}

TEST_F(SceneTest, AnEmptySceneIsTheBackground) {
    EXPECT_THAT(picture({}, oblique_view()), Each(default_background));
    auto sum = require(SampleSum::create(context(), 4, 4));
    ASSERT_TRUE(sum->draw({}, frontal_view(4, 4), {.samples = 3, .background = 0.4f}));
    EXPECT_THAT(*sum->mean(), Each(glm::vec4(0.4f)));
    const auto drawn = [&](const Sampling& sampling) {
        return sum->draw({}, frontal_view(4, 4), sampling).has_value();
    };
    EXPECT_TRUE(drawn({.samples = 256}));
    EXPECT_FALSE(drawn({.samples = 257})) << "the sum's rounding would show";
    EXPECT_FALSE(drawn({.background = std::numeric_limits<float>::quiet_NaN()}));
    GpuCut untouched(on_gpu(Scene(cube())));
    EXPECT_THAT(picture({{.cut = untouched}}, oblique_view()), Each(default_background)) << "it follows no cut yet";
}

TEST_F(SceneTest, CutsOfOneTreeAddOneBufferEach) {
    const auto living_buffers = [] { // GL names are small numbers, given out in turn
        int living = 0;
        for (GLuint name = 1; name < 4096; ++name) living += glIsBuffer(name) == GL_TRUE;
        return living;
    };
    const Scene scene(cube());
    const GpuTree tree = on_gpu(scene);
    const int before = living_buffers();
    {
        std::vector<GpuCut> cuts;
        for (int i = 0; i < 3; ++i) ASSERT_TRUE(cuts.emplace_back(tree).follow(scene.cut));
        picture({{.cut = cuts[0]}, {.cut = cuts[1]}, {.cut = cuts[2], .placement = at({1, 0, 0})}}, oblique_view());
        EXPECT_EQ(living_buffers(), before + 3) << "index buffers, and nothing for changes, glides and lights";
    }
    EXPECT_EQ(living_buffers(), before);
}

TEST_F(SceneTest, TilesAreThatPartOfTheWindow) {
    const Scene scene(bumpy_sphere(40));
    const GpuCut cut = cut_on_gpu(scene);
    const Item item{.cut = cut, .placement = at({0.4, -0.3, 0})};
    View view = oblique_view();
    view.eye *= 1.5;
    const auto whole = picture({item}, view);
    const auto shown = require(pixels_of({&item, 1}, view));
    ASSERT_GT(shown->width, 8);
    ASSERT_LT(shown->width * shown->height, window * window / 2);
    for (int i = 0; i < window * window; ++i) {
        const int x = i % window - shown->left, y = i / window - shown->top;
        const bool is_in_box = x >= 0 && y >= 0 && x < shown->width && y < shown->height;
        if (!is_in_box) ASSERT_EQ(whole[static_cast<std::size_t>(i)], default_background) << i;
    }

    auto sheet = require(Target::create(context(), 700, 300));
    const float untouched = 0.9f;
    View of_sheet = view;
    of_sheet.width = 700, of_sheet.height = 300;
    ASSERT_TRUE(draw({}, {.view = of_sheet}, *sheet, {.colour = glm::vec4(untouched)}));
    const PixelBox right{shown->left + shown->width / 2, shown->top, shown->width - shown->width / 2, shown->height};
    const std::vector<Tile> tiles = {{*shown, 10, 20}, {right, 700 - right.width, 300 - right.height}};
    for (const Tile& tile : tiles) ASSERT_TRUE(draw({&item, 1}, {.view = view, .tile = tile}, *sheet));
    const auto pixels = require(read_luminance(*sheet));
    std::vector<float> expected(pixels->size(), untouched);
    for (const Tile& tile : tiles)
        for (int y = 0; y < tile.part.height; ++y)
            for (int x = 0; x < tile.part.width; ++x)
                expected[static_cast<std::size_t>((tile.top + y) * 700 + tile.left + x)] =
                    whole[static_cast<std::size_t>((tile.part.top + y) * window + tile.part.left + x)];
    EXPECT_LT(flipped_share(*pixels, expected), most_flipped / 10);
}

TEST_F(SceneTest, NothingIsShownBesideTheWindow) {
    const Scene scene(cube());
    const GpuCut cut = cut_on_gpu(scene);
    const auto box = [&](glm::dvec3 place) {
        const Item item{.cut = cut, .placement = at(place)};
        return *pixels_of({&item, 1}, frontal_view(window, window));
    };
    EXPECT_EQ(box({200, 0, -5}).width, 0);
    EXPECT_EQ(box({0, -200, -5}).height, 0);
    EXPECT_EQ(pixels_of({}, frontal_view(window, window))->width, 0);
    const Item around{.cut = cut, .placement = at(frontal_view(window, window).eye)};
    EXPECT_EQ(pixels_of({&around, 1}, frontal_view(window, window))->width, window) << "parts are behind the eye";
}

TEST_F(SceneTest, RefusesWhatCannotBeDrawn) {
    const Scene scene(cube());
    const GpuCut cut = cut_on_gpu(scene);
    Target to = target();
    const auto why_not = [&](const Item& item, const Camera& camera) {
        const auto drawn = draw({&item, 1}, camera, to);
        return drawn ? "drawn" : drawn.error().message;
    };
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const View view = oblique_view();
    EXPECT_THAT(why_not({.cut = cut}, {.view = frontal_view(5, 7)}), HasSubstr("5x7"));
    EXPECT_THAT(why_not({.cut = cut}, {.view = view, .point = {0.5, nan}}), HasSubstr("point"));
    for (const double near : {nan, 0.0, -1.0})
        EXPECT_THAT(why_not({.cut = cut}, {.view = view, .near_plane = near}), HasSubstr("near plane"));
    for (const double scale : {nan, 0.0})
        EXPECT_THAT(why_not({.cut = cut, .placement = at({}, scale)}, {.view = view}), HasSubstr("scale"));
    EXPECT_THAT(why_not({.cut = cut, .placement = at({nan, 0, 0})}, {.view = view}), HasSubstr("translation"));

    const PixelBox all{0, 0, window, window}, none{3, 3, 0, 5};
    EXPECT_THAT(why_not({.cut = cut}, {.view = view, .tile = Tile{none, 0, 0}}), HasSubstr("the view's window"));
    EXPECT_THAT(why_not({.cut = cut}, {.view = view, .tile = Tile{all, 1, 0}}), HasSubstr("the target"));
    EXPECT_THAT(why_not({.cut = cut}, {.view = view, .shadow_mask = 0, .tile = Tile{all, 0, 0}}), HasSubstr("mask"));

    auto other = require(Context::headless());
    auto stranger = require(GpuTree::create(*other, scene.tree));
    EXPECT_THAT(why_not({.cut = GpuCut(*stranger)}, {.view = view}), HasSubstr("another OpenGL context"));
    EXPECT_EQ(why_not({.cut = cut}, {.view = view}), "drawn");
}

} // namespace scene_test
