// A machine without any OpenGL driver, which the EGL dispatcher's search path can pretend.
#include <unseen/render/context.h>

#include "testing.h"

namespace {

using unseen::render::Context;

TEST(NoDevice, IsAnErrorThatSaysWhatToInstall) {
    setenv("__EGL_VENDOR_LIBRARY_DIRS", "/nonexistent", 1); // before this process's first call of EGL
    unsetenv("__EGL_VENDOR_LIBRARY_FILENAMES");
    for (int attempt = 0; attempt < 2; ++attempt) {
        const auto context = Context::headless();
        ASSERT_FALSE(context);
        EXPECT_EQ(context.error().code, unseen::ErrorCode::unsupported);
        EXPECT_THAT(context.error().message, ::testing::StartsWith("No OpenGL 4.5 device found"));
        EXPECT_THAT(context.error().message, ::testing::HasSubstr("libgl1-mesa-dri"));
    }
}

TEST(NoDevice, WindowsNeedADisplay) {
    unsetenv("DISPLAY");
    unsetenv("WAYLAND_DISPLAY");
    const auto window = Context::window();
    ASSERT_FALSE(window);
    EXPECT_EQ(window.error().code, unseen::ErrorCode::unsupported);
    EXPECT_THAT(window.error().message, ::testing::HasSubstr("DISPLAY"));
}

} // namespace
