// What the GL tests share: a headless context, or a skip with the reason why there is none.
#pragma once

#include <unseen/render/context.h>

#include "testing.h"

namespace unseen::render::testing {

// Each test gets a context of its own, and fails if it leaves a GL error behind.
class GlTest : public ::testing::Test {
protected:
    void SetUp() override {
        auto made = Context::headless();
        if (!made) GTEST_SKIP() << made.error().message;
        context_ = std::move(*made);
        EXPECT_EQ(context_->take_errors(), "") << "after making the context";
    }

    void TearDown() override {
        if (context_) {
            EXPECT_EQ(context_->take_errors(), "") << "at the end of the test";
        }
    }

    Context& context() { return *context_; }

private:
    std::optional<Context> context_;
};

} // namespace unseen::render::testing
