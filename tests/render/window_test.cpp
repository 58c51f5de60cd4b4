// Windows through GLFW, under the display there is or an Xvfb of the test's own.
#include "gl_test.h"
#include "scenes.h"
#include "virtual_display.h"

#define GL_GLEXT_PROTOTYPES 1
#include <GL/glcorearb.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <unseen/render/context.h>
#include <unseen/render/renderer.h>

namespace {

using namespace unseen::render;
using namespace unseen::render::testing;
using unseen::require;
using unseen::vdtree::View;

// X servers and GLFW are the process's: one display for all tests, closed at exit after GLFW let go of it.
class Display : public ::testing::Environment {
public:
    void SetUp() override { display_ = std::make_unique<VirtualDisplay>(); }
    void TearDown() override {
        glfwTerminate();
        display_.reset();
    }
    static const std::string& reason() { return display_->reason(); }

private:
    static inline std::unique_ptr<VirtualDisplay> display_;
};

const ::testing::Environment* const display = ::testing::AddGlobalTestEnvironment(new Display);

class WindowTest : public ::testing::Test {
protected:
    void SetUp() override {
        if (!Display::reason().empty()) GTEST_SKIP() << "no display: " << Display::reason();
        auto made = Context::window({.width = 80, .height = 60, .title = "Unseen's test", .visible = true});
        if (!made) GTEST_SKIP() << made.error().message;
        window_ = std::move(*made);
        EXPECT_EQ(window_->take_errors(), "") << "after opening the window";
    }

    void TearDown() override {
        if (window_) EXPECT_EQ(window_->take_errors(), "") << "at the end of the test";
    }

    View view() const {
        View view = frontal_view(1, 1);
        glfwGetFramebufferSize(window_->glfw_window(), &view.width, &view.height);
        return view;
    }

    // A pixel of the back buffer, its row counted from the top, as the display gets it.
    std::array<int, 3> pixel(int column, int row) const {
        std::array<std::uint8_t, 4> rgba{};
        glBindFramebuffer(GL_READ_FRAMEBUFFER, 0);
        glReadBuffer(GL_BACK);
        glReadPixels(column, view().height - 1 - row, 1, 1, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data());
        return {rgba[0], rgba[1], rgba[2]};
    }

    Context& window() { return *window_; }

private:
    std::optional<Context> window_;
};

int srgb_byte(double linear) {
    const double encoded = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
    return static_cast<int>(std::lround(255 * encoded));
}

// One step of 8 bits: drivers encode by tables, and round in either direction.
::testing::Matcher<int> about(int byte) { return ::testing::AllOf(::testing::Ge(byte - 1), ::testing::Le(byte + 1)); }

TEST_F(WindowTest, GivesAWindowWithAContext) {
    ASSERT_NE(window().glfw_window(), nullptr);
    EXPECT_EQ(glfwGetCurrentContext(), window().glfw_window());
    EXPECT_FALSE(window().renderer_name().empty());
}

TEST_F(WindowTest, DrawsEncodedAsSrgb) {
    Mesh mesh = rectangle({-9, -9}, {0, 9}, 0, grey(0.5f)); // the left half
    const Scene scene(mesh);
    auto renderer = require(Renderer::create(window(), scene.tree));
    for (int frame = 0; frame < 3; ++frame) {
        ASSERT_TRUE(renderer->draw_to_window(scene.cut, view()));
        EXPECT_THAT(pixel(view().width / 4, view().height / 2), ::testing::Each(about(srgb_byte(0.5))));
        EXPECT_THAT(pixel(3 * view().width / 4, view().height / 2),
                    ::testing::Each(about(srgb_byte(DrawOptions{}.background))));
        glfwSwapBuffers(window().glfw_window());
        glfwPollEvents();
        EXPECT_EQ(window().take_errors(), "");
    }
}

TEST_F(WindowTest, DrawsUpAtTheTopAndNearInFront) {
    Mesh mesh;
    add_rectangle(mesh, {-9, 0}, {9, 9}, 0, grey(0.9f));     // the upper half, in front of ...
    add_rectangle(mesh, {-9, -9}, {9, 9}, -0.5, grey(0.1f)); // ... everything
    const Scene scene(mesh);
    auto renderer = require(Renderer::create(window(), scene.tree));
    ASSERT_TRUE(renderer->draw_to_window(scene.cut, view()));
    EXPECT_THAT(pixel(view().width / 2, view().height / 4), ::testing::Each(about(srgb_byte(0.9))));
    EXPECT_THAT(pixel(view().width / 2, 3 * view().height / 4), ::testing::Each(about(srgb_byte(0.1))));
}

TEST_F(WindowTest, CullsTheSameFacesAsOffScreen) {
    for (bool outward : {true, false}) {
        const Scene scene(cube(outward));
        auto renderer = require(Renderer::create(window(), scene.tree));
        View looking = view();
        looking.eye = {0, 0, 3};
        ASSERT_TRUE(renderer->draw_to_window(scene.cut, looking));
        EXPECT_THAT(pixel(view().width / 2, view().height / 2), ::testing::Each(about(srgb_byte(0.7))))
            << "the face of +z";
    }
}

TEST_F(WindowTest, DrawsWireframesAndFlatShading) {
    const Scene scene(rectangle({-9, -9}, {9, 9}, 0, grey(0.5f))); // its diagonal crosses the window's centre
    auto renderer = require(Renderer::create(window(), scene.tree));
    DrawOptions options;
    options.wireframe = true;
    options.shading = Shading::flat;
    ASSERT_TRUE(renderer->draw_to_window(scene.cut, view(), options));
    EXPECT_THAT(pixel(view().width / 2, view().height / 2), ::testing::Each(::testing::Lt(srgb_byte(0.4))));
    EXPECT_THAT(pixel(view().width / 2, view().height / 8), ::testing::Each(about(srgb_byte(0.5))));
}

TEST_F(WindowTest, DrawsOffScreenToo) {
    const Scene scene(rectangle({-9, -9}, {9, 9}, 0, grey(0.5f)));
    auto renderer = require(Renderer::create(window(), scene.tree));
    ASSERT_TRUE(renderer->draw_to_window(scene.cut, view()));
    const auto frame = require(renderer->draw(scene.cut, frontal_view(16, 16)));
    constexpr float stored_tolerance = 0.5f / 65535 + 1e-6f; // luminance is stored in 16 bits
    EXPECT_THAT(frame->luminance, ::testing::Each(::testing::FloatNear(0.5f, stored_tolerance)));
    ASSERT_TRUE(renderer->draw_to_window(scene.cut, view()));
    EXPECT_THAT(pixel(view().width / 2, view().height / 2), ::testing::Each(about(srgb_byte(0.5))));
}

TEST_F(WindowTest, TakesTurnsWithAHeadlessContext) {
    auto headless = Context::headless();
    if (!headless) GTEST_SKIP() << headless.error().message;
    const Scene scene(rectangle({-9, -9}, {9, 9}, 0, grey(0.5f)));
    auto off_screen = require(Renderer::create(*headless, scene.tree));
    auto on_screen = require(Renderer::create(window(), scene.tree));
    for (int i = 0; i < 2; ++i) {
        const auto frame = require(off_screen->draw(scene.cut, frontal_view(8, 8)));
        ASSERT_TRUE(on_screen->draw_to_window(scene.cut, view()));
    }
    EXPECT_EQ(headless->take_errors(), "");
}

} // namespace
