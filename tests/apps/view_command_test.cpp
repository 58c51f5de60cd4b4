// unseen view under X, driven by synthetic events: what the window's title says follows the keys and the mouse.
#include "window_test.h"

#include <perception/image.h>

namespace {

using namespace unseen::app::testing;
using ::testing::HasSubstr;

class ViewCommandTest : public WindowTest {
protected:
    void SetUp() override {
        WindowTest::SetUp();
        if (IsSkipped()) return;
        build_ball();
    }
    bool open(const std::vector<std::string>& more) {
        return WindowTest::open({"view", "ball.vdt", "--size", "200x160"}, more);
    }
    // "... budget of 368: ..." -> 368
    static int budget_in(const std::string& title) {
        const std::size_t at = title.find("budget of ");
        return at == std::string::npos ? -1 : std::atoi(title.c_str() + at + 10);
    }
};

TEST_F(ViewCommandTest, FollowsKeysAndMouse) {
    if (!open({"--screenshot", "last.png"})) GTEST_SKIP() << "no window: " << errors();
    EXPECT_THAT(window().title_with("imperceptible"), HasSubstr("triangles"));

    window().press(XK_1);
    EXPECT_THAT(window().title_with("full"), HasSubstr("1,472 of 1,472"));

    window().press(XK_3);
    const int budget = budget_in(window().title_with("budget"));
    EXPECT_EQ(budget, ball_triangles / 4);
    window().press(XK_minus);
    EXPECT_EQ(budget_in(window().title_with("budget of 294")), 294); // 368 / 1.25
    window().press(XK_plus, ShiftMask);
    EXPECT_EQ(budget_in(window().title_with("budget of 368")), 368);

    window().press(XK_4);
    window().move_to(190, 80);
    EXPECT_THAT(window().title_with("gaze-directed"), HasSubstr("error"));

    window().press(XK_w);
    window().press(XK_f);
    window().press(XK_s);
    window().press(XK_h);
    window().press(XK_q);
    EXPECT_EQ(ended(), 0) << errors();
    EXPECT_THAT(read_text(path("out.txt")), HasSubstr("wireframe")) << "the help";
    EXPECT_THAT(errors(), HasSubstr("wrote 'unseen-"));
    const auto last = unseen::perception::read_image(path("last.png"));
    ASSERT_TRUE(last) << last.error().message;
    EXPECT_EQ(last->image.width, 200);
    int pictures = 0;
    for (const std::string& name : files()) pictures += name.ends_with(".png");
    EXPECT_EQ(pictures, 2);
}

TEST_F(ViewCommandTest, DraggingTurnsAndTheWheelZooms) {
    if (!open({"--triangles", "200", "--screenshot", "moved.png"})) GTEST_SKIP() << "no window: " << errors();
    window().title_with("budget");
    window().button(Button1, true, 100, 80);
    window().move_to(160, 110, Button1Mask);
    window().button(Button1, false, 160, 110);
    for (int notch = 0; notch < 5; ++notch) {
        window().button(Button4, true, 160, 110);
        window().button(Button4, false, 160, 110);
    }
    window().press(XK_Escape);
    ASSERT_EQ(ended(), 0) << errors();

    ASSERT_TRUE(open({"--triangles", "200", "--screenshot", "still.png", "--frames", "2"}));
    ASSERT_EQ(ended(), 0) << errors();
    const auto moved = unseen::perception::read_image(path("moved.png"));
    const auto still = unseen::perception::read_image(path("still.png"));
    ASSERT_TRUE(moved && still);
    // Nearer: the ball covers more of the window, so less of it is background.
    const auto background = [](const unseen::perception::Image& image) {
        const float corner = image.at(0, 0);
        return std::count(image.values.begin(), image.values.end(), corner);
    };
    EXPECT_LT(background(moved->image), background(still->image) * 9 / 10);
}

// "... 368 of 1,472 triangles ..." -> "368 of 1,472 triangles"
std::string triangles_in(const std::string& title) {
    const std::size_t end = title.find(" triangles"), begin = title.rfind(": ", end);
    return end == std::string::npos || begin == std::string::npos ? title : title.substr(begin + 2, end - begin - 2);
}

TEST_F(ViewCommandTest, ATimeLimitIsGoneOnWithUntilTheCutIsMade) {
    if (!open({})) GTEST_SKIP() << "no window: " << errors();
    const std::string whole = triangles_in(window().title_with("imperceptible"));
    window().press(XK_q);
    ASSERT_EQ(ended(), 0) << errors();

    // So little that it takes many frames; nobody touches anything meanwhile.
    ASSERT_TRUE(open({"--milliseconds", "0.005"})) << errors();
    EXPECT_THAT(window().title_with(": " + whole + " triangles"), HasSubstr(whole));
    std::string title;
    for (int look = 0; look < 100; ++look) {
        title = window().title();
        if (title.find("to be continued") == std::string::npos) break;
        std::this_thread::sleep_for(poll_pause);
    }
    EXPECT_THAT(title, ::testing::Not(HasSubstr("to be continued")));
    // All modes can be reached, the full model too, which has no limit.
    window().press(XK_1);
    EXPECT_THAT(window().title_with("full"), HasSubstr("1,472 of 1,472"));
    window().press(XK_2);
    EXPECT_THAT(window().title_with(": " + whole + " triangles"), HasSubstr(whole));
    window().press(XK_q);
    EXPECT_EQ(ended(), 0) << errors();
}

TEST_F(ViewCommandTest, GlidesComeToRestByThemselves) {
    if (!open({"--triangles", "400", "--geomorph", "2"})) GTEST_SKIP() << "no window: " << errors();
    EXPECT_THAT(window().title_with("budget of 400"), HasSubstr("triangles"));
    window().press(XK_plus, ShiftMask); // few enough changes to glide
    EXPECT_THAT(window().title_with("vertices glide"), HasSubstr("vertices glide"));
    std::string title;
    const auto end = std::chrono::steady_clock::now() + patience;
    while (std::chrono::steady_clock::now() < end) {
        title = window().title();
        if (title.find("glide") == std::string::npos) break;
        std::this_thread::sleep_for(poll_pause);
    }
    EXPECT_THAT(title, ::testing::Not(HasSubstr("glide")));
    window().press(XK_s);
    window().press(XK_q);
    EXPECT_EQ(ended(), 0) << errors();
}

TEST_F(ViewCommandTest, FoldingCanBeginAtTheFullModel) {
    if (!open({"--full"})) GTEST_SKIP() << "no window: " << errors();
    window().title_with("full");
    window().press(XK_2);
    EXPECT_THAT(window().title_with("imperceptible"), HasSubstr("luebke-hallen"))
        << "nobody waits for errors to be measured";
    window().press(XK_q);
    EXPECT_EQ(ended(), 0) << errors();
}

TEST_F(ViewCommandTest, AClosedWindowTakesNoKeysAndHarmsNobody) {
    if (!open({"--full"})) GTEST_SKIP() << "no window: " << errors();
    window().title_with("full");
    window().press(XK_q);
    ASSERT_EQ(ended(), 0) << errors();
    window().press(XK_w);
    EXPECT_EQ(window().title(), "");
}

TEST_F(ViewCommandTest, ResetGoesBackToTheFirstView) {
    if (!open({"--screenshot", "reset.png"})) GTEST_SKIP() << "no window: " << errors();
    window().title_with("imperceptible"); // a budget's cut depends on the way, within its hysteresis
    window().button(Button1, true, 100, 80);
    window().move_to(160, 110, Button1Mask);
    window().button(Button1, false, 160, 110);
    window().press(XK_r);
    window().press(XK_q);
    ASSERT_EQ(ended(), 0) << errors();
    ASSERT_TRUE(open({"--screenshot", "still.png", "--frames", "1"}));
    ASSERT_EQ(ended(), 0) << errors();
    EXPECT_TRUE(read_text(path("reset.png")) == read_text(path("still.png"))); // not EQ, which would print them
}

} // namespace
