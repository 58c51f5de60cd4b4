// Float render targets and their limits.
#include "gl_test.h"

#include <gmock/gmock.h>

#include <render/framebuffer.h>

namespace {

using namespace unseen::render;
using FramebufferTest = unseen::render::testing::GlTest;

TEST_F(FramebufferTest, IsMadeInAnyShape) {
    for (auto [width, height] : {std::pair{1, 1}, {640, 3}, {3, 640}})
        for (bool depth : {true, false}) {
            const auto made = Framebuffer::create(width, height, {.depth = depth, .label = "test"});
            ASSERT_TRUE(made) << made.error().message;
            EXPECT_EQ(made->width(), width);
            EXPECT_EQ(made->height(), height);
            EXPECT_NE(made->id(), 0u);
            EXPECT_NE(made->colour_texture(), 0u);
            EXPECT_EQ(context().take_errors(), "");
        }
}

TEST_F(FramebufferTest, RefusesNoPixels) {
    for (auto [width, height] : {std::pair{0, 1}, {1, 0}, {-5, 5}}) {
        const auto made = Framebuffer::create(width, height, {});
        ASSERT_FALSE(made);
        EXPECT_EQ(made.error().code, unseen::ErrorCode::invalid_argument);
    }
}

TEST_F(FramebufferTest, RefusesMoreThanTheDriverCanDraw) {
    const int most = largest_framebuffer_side();
    ASSERT_GE(most, 4096) << "OpenGL 4.5 promises 16384, but be patient";
    const auto made = Framebuffer::create(most + 1, 1, {});
    ASSERT_FALSE(made);
    EXPECT_EQ(made.error().code, unseen::ErrorCode::unsupported);
    EXPECT_THAT(made.error().message, ::testing::HasSubstr(std::to_string(most)));
}

TEST_F(FramebufferTest, HoldsNothingByDefault) {
    const Framebuffer none;
    EXPECT_EQ(none.id(), 0u);
    EXPECT_EQ(none.width(), 0);
}

} // namespace
