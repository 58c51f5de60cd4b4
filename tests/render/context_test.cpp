// Headless contexts.
#include "gl_test.h"

#define GL_GLEXT_PROTOTYPES 1
#include <GL/glcorearb.h>

#include "gl_object.h"

namespace context_test {

using namespace unseen::render;
// A call that any GL must refuse.
void raise_error() { glBindBuffer(GL_TEXTURE_2D, 0); }

using ContextTest = unseen::render::testing::GlTest;

TEST_F(ContextTest, NamesItsRendererAndVersion) {
    EXPECT_FALSE(context().renderer_name().empty());
    EXPECT_NE(context().renderer_name(), "unknown");
    EXPECT_THAT(context().version(), ::testing::MatchesRegex("4\\.[5-9].*"));
    EXPECT_EQ(context().glfw_window(), nullptr);
}

TEST_F(ContextTest, FinishWaitsForWhatWasAsked) {
    const GLsync fence = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    ASSERT_TRUE(context().finish());
    EXPECT_EQ(glClientWaitSync(fence, 0, 0), static_cast<GLenum>(GL_ALREADY_SIGNALED));
    glDeleteSync(fence);
    raise_error();
    EXPECT_TRUE(context().finish()) << "an older error is not its own";
    EXPECT_NE(context().take_errors(), "");
}

TEST_F(ContextTest, ReportsErrorsOnceAndInWords) {
    raise_error();
    const std::string errors = context().take_errors();
    EXPECT_FALSE(errors.empty());
    EXPECT_EQ(context().take_errors(), "");
}

TEST_F(ContextTest, KeepsABoundedNumberOfErrors) {
    for (int i = 0; i < 10000; ++i) raise_error();
    const std::string errors = context().take_errors();
    EXPECT_THAT(errors, ::testing::HasSubstr("more"));
    EXPECT_LT(errors.size(), 20000u);
    EXPECT_EQ(context().take_errors(), "");
}

TEST_F(ContextTest, SurvivesAMove) {
    Context moved = std::move(context());
    EXPECT_FALSE(moved.renderer_name().empty());
    raise_error(); // is reported to where the debug output was routed before the move
    EXPECT_NE(moved.take_errors(), "");
    context() = std::move(moved); // back, for TearDown
    EXPECT_EQ(context().take_errors(), "");
}

TEST_F(ContextTest, LivesAsLongAsOneOfItsHandles) {
    auto first = require(Context::headless());
    std::optional<Context> gone = std::move(*first);
    Context second = *gone;
    gone.reset();
    ASSERT_TRUE(second.make_current());
    raise_error();
    EXPECT_NE(second.take_errors(), "");
}

TEST_F(ContextTest, LivesBesideAnotherOne) {
    auto other = require(Context::headless());
    const Buffer in_other = Buffer::create("in the other context");
    raise_error();
    ASSERT_TRUE(context().make_current());
    EXPECT_EQ(context().take_errors(), "") << "the error was the other context's";
    EXPECT_NE(other->take_errors(), "");
}

TEST_F(ContextTest, StaysUsableAfterAnotherOneEnds) {
    { auto other = require(Context::headless()); }
    ASSERT_TRUE(context().make_current());
    const Buffer buffer = Buffer::create("after the other context");
    EXPECT_NE(buffer.id(), 0u);
}

TEST_F(ContextTest, CanBeMadeOnSeveralThreads) {
    std::vector<std::thread> threads;
    std::vector<std::string> failures(4);
    for (std::string& failure : failures)
        threads.emplace_back([&failure] {
            auto made = Context::headless();
            failure = made ? made->take_errors() : std::string(made.error().message);
        });
    for (std::thread& thread : threads) thread.join();
    EXPECT_THAT(failures, ::testing::Each(""));
}

TEST_F(ContextTest, CannotBeStolenByAnotherThread) {
    bool stolen = true;
    std::string why;
    std::thread([&] {
        const auto current = context().make_current();
        stolen = current.has_value();
        if (!current) why = current.error().message;
    }).join();
    EXPECT_FALSE(stolen);
    EXPECT_THAT(why, ::testing::HasSubstr("thread"));
}

TEST(WindowOptions, MustHaveASize) {
    const auto window = Context::window({.width = 0, .height = 10});
    ASSERT_FALSE(window);
    EXPECT_EQ(window.error().code, unseen::ErrorCode::invalid_argument);
    EXPECT_THAT(window.error().message, ::testing::HasSubstr("0x10"));
}

} // namespace context_test
