// Geomorphs on the GPU: folds come and go without a visible step, and nothing is made or moved without them.
#include "gl_test.h"
#include "scenes.h"

#define GL_GLEXT_PROTOTYPES 1
#include <GL/glcorearb.h>

#include <unseen/render/renderer.h>

namespace geomorph_test {

using namespace unseen::render;
using namespace unseen::render::testing;
using unseen::vdtree::Cut;
using unseen::vdtree::Geomorph;
using unseen::vdtree::NodeId;
using unseen::vdtree::View;

constexpr double frame_seconds = 1 / 60.0;

class GeomorphTest : public GlTest {
protected:
    void SetUp() override {
        GlTest::SetUp();
        if (IsSkipped()) return;
        scene_ = std::make_unique<Scene>(bumpy_sphere(48));
        renderer_ = make_renderer();
        View view = view_from(0);
        auto made = require(unseen::vdtree::extent_criterion(tree(), view, 6));
        criterion_ = std::make_unique<unseen::vdtree::DistanceCriterion>(std::move(*made));
    }

    const unseen::vdtree::VertexTree& tree() const { return scene_->tree; }

    std::unique_ptr<Renderer> make_renderer() {
        auto made = Renderer::create(context(), tree());
        EXPECT_TRUE(made) << made.error().message;
        return made ? std::make_unique<Renderer>(std::move(*made)) : nullptr;
    }

    static View view_from(double degrees, double distance = 4) {
        const double angle = degrees * std::acos(-1.0) / 180;
        View view;
        view.eye = distance * glm::dvec3(std::sin(angle), 0.2, std::cos(angle));
        view.width = view.height = 96;
        return view;
    }

    std::uint64_t follow(Cut& cut, const View& view) {
        const auto stats = cut.follow(*criterion_, {.eye = view.eye - tree().origin()});
        EXPECT_TRUE(stats) << stats.error().message;
        return stats ? stats->folds + stats->unfolds : 0;
    }

    Geomorph geomorph(double seconds) { return std::move(*require(Geomorph::create(tree(), seconds))); }

    template <class Drawn>
    Frame draw(Renderer& renderer, const Drawn& drawn, const View& view, int samples = 4) {
        auto frame = renderer.draw(drawn, view, {.samples = samples});
        EXPECT_TRUE(frame) << frame.error().message;
        return frame ? std::move(*frame) : Frame{};
    }

    static float largest_change(const Frame& a, const Frame& b) {
        float most = 0;
        for (std::size_t i = 0; i < a.luminance.size(); ++i)
            most = std::max(most, std::abs(a.luminance[i] - b.luminance[i]));
        return most;
    }

    std::unique_ptr<Scene> scene_;
    std::unique_ptr<Renderer> renderer_;
    std::unique_ptr<unseen::vdtree::DistanceCriterion> criterion_;
};

// GL names are small numbers, given out in turn.
int living_buffers() {
    int living = 0;
    for (GLuint name = 1; name < 4096; ++name) living += glIsBuffer(name) == GL_TRUE;
    return living;
}

TEST_F(GeomorphTest, FoldsDoNotPopInASlowMotion) {
    // The eye draws back slowly; what a single frame changes at most, with geomorphs and without.
    Cut cut(tree());
    Geomorph gliding = geomorph(0.5);
    const auto other_renderer = make_renderer();
    Frame before, before_gliding;
    constexpr int samples = 16; // so that outlines move smoothly
    float popped = 0, glided = 0;
    std::uint64_t changes = 0;
    for (int frame = 0; frame < 60; ++frame) {
        const View view = view_from(0, 4 + 0.01 * frame);
        changes += follow(cut, view) * (frame > 0);
        ASSERT_TRUE(gliding.step(cut, frame_seconds));
        Frame now = draw(*renderer_, cut, view, samples), now_gliding = draw(*other_renderer, gliding, view, samples);
        if (frame > 0) {
            popped = std::max(popped, largest_change(before, now));
            glided = std::max(glided, largest_change(before_gliding, now_gliding));
        }
        before = std::move(now);
        before_gliding = std::move(now_gliding);
    }
    ASSERT_GT(changes, 30u) << "there must be folds to be seen";
    RecordProperty("popped", std::to_string(popped));
    RecordProperty("glided", std::to_string(glided));
    std::printf("largest change of a pixel: %.4f without geomorphs, %.4f with them\n", static_cast<double>(popped),
                static_cast<double>(glided));
    // What is left is the camera's motion: a full model changes as much.
    EXPECT_LT(glided, 0.7f * popped);
}

TEST_F(GeomorphTest, BeginsAtOnePictureAndEndsAtTheOther) {
    const View view = view_from(20);
    Cut cut(tree());
    follow(cut, view_from(20, 5));
    Geomorph gliding = geomorph(0.25);
    ASSERT_TRUE(gliding.step(cut, 0));
    const Frame coarse = draw(*make_renderer(), cut, view);
    EXPECT_EQ(draw(*renderer_, gliding, view).luminance, coarse.luminance);

    follow(cut, view);
    const Frame fine = draw(*make_renderer(), cut, view);
    ASSERT_TRUE(gliding.step(cut, 0));
    ASSERT_TRUE(gliding.is_gliding());
    // Not bit for bit: edges that have no area yet split others, which rounds.
    EXPECT_LT(largest_change(draw(*renderer_, gliding, view), coarse), 0.3f * largest_change(coarse, fine));
    EXPECT_GE(renderer_->uploaded_bytes(), 32 * gliding.moved().size());
    ASSERT_TRUE(gliding.step(cut, 0.125));
    const Frame between = draw(*renderer_, gliding, view);
    EXPECT_NE(between.luminance, coarse.luminance);
    EXPECT_NE(between.luminance, fine.luminance);
    ASSERT_TRUE(gliding.step(cut, 0.125));
    EXPECT_FALSE(gliding.is_gliding());
    EXPECT_EQ(draw(*renderer_, gliding, view).luminance, fine.luminance);
    EXPECT_EQ(draw(*renderer_, gliding, view).luminance, fine.luminance);
    EXPECT_EQ(renderer_->uploaded_bytes(), 0u);
}

TEST_F(GeomorphTest, AVertexInTheMiddleIsDrawnThere) {
    // One triangle at a time, of a quad whose four vertices come from one proxy: their shares of the way scale the
    // picture.
    Scene scene(rectangle({-0.5, -0.5}, {0.5, 0.5}, 0, grey(0.8f)));
    auto renderer = require(Renderer::create(context(), scene.tree));
    auto made = require(Geomorph::create(scene.tree, 1));
    Cut cut(scene.tree);
    ASSERT_TRUE(made->step(cut, 0));
    cut.unfold_all();
    ASSERT_TRUE(made->step(cut, 0));
    const View view = frontal_view(64, 64);
    for (const double share : {0.25, 0.5, 0.75, 1.0}) {
        ASSERT_TRUE(made->step(cut, 0.25));
        const auto frame = require(renderer->draw(*made, view, {.samples = 1, .background = 0}));
        const auto bright =
            std::count_if(frame->luminance.begin(), frame->luminance.end(), [](float l) { return l > 0.1f; });
        const double side = 32 * share; // of the quad in pixels: half of the window when it is whole
        EXPECT_NEAR(static_cast<double>(bright), side * side, 2 * side + 4) << share;
    }
}

TEST_F(GeomorphTest, CutsAreDrawnWithoutGlidesThatWereDrawnBefore) {
    const View view = view_from(20);
    Cut cut(tree());
    follow(cut, view_from(20, 5));
    Geomorph gliding = geomorph(0.25);
    ASSERT_TRUE(gliding.step(cut, 0));
    follow(cut, view);
    ASSERT_TRUE(gliding.step(cut, 0));
    ASSERT_TRUE(gliding.step(cut, 0.1));
    const Frame moved = draw(*renderer_, gliding, view);
    const Frame still = draw(*renderer_, cut, view);
    EXPECT_EQ(still.luminance, draw(*make_renderer(), cut, view).luminance);
    EXPECT_NE(still.luminance, moved.luminance);
    EXPECT_EQ(draw(*renderer_, gliding, view).luminance, moved.luminance);
}

TEST_F(GeomorphTest, WithoutGlidesNothingIsMadeAndPixelsAreTheSame) {
    const View view = view_from(20);
    Cut cut(tree());
    follow(cut, view);
    const Frame plain = draw(*renderer_, cut, view);
    const int buffers = living_buffers();
    EXPECT_GT(buffers, 0);
    Geomorph still = geomorph(0.25);
    ASSERT_TRUE(still.step(cut, 0));
    const Frame drawn = draw(*renderer_, still, view);
    EXPECT_EQ(drawn.luminance, plain.luminance);
    EXPECT_EQ(drawn.colour, plain.colour);
    draw(*renderer_, cut, view);
    EXPECT_EQ(living_buffers(), buffers);
    follow(cut, view_from(20, 4.5));
    ASSERT_TRUE(still.step(cut, 0));
    ASSERT_TRUE(still.is_gliding());
    draw(*renderer_, still, view);
    EXPECT_EQ(living_buffers(), buffers + 1);
}

} // namespace geomorph_test
