// unseen view under X, driven by synthetic events: what the window's title says follows the keys and the mouse.
#include "window_test.h"

#include <glm/common.hpp>
#include <glm/vec2.hpp>
#include <unseen/perception/image.h>

namespace view_test {

using namespace unseen::app::testing;
using unseen::perception::Image;

class ViewCommandTest : public WindowTest {
protected:
    void SetUp() override {
        WindowTest::SetUp();
        if (IsSkipped()) return;
        build_ball();
    }
    bool open(const Words& more, const std::string& size = "200x160") {
        return WindowTest::open({"view", "ball.vdt", "--size", size}, more);
    }
    // The pictures that keys were pressed for, in their order.
    std::vector<Image> screenshots() const {
        Words names;
        for (const std::string& name : files())
            if (name.starts_with("unseen-")) names.push_back(name);
        // "unseen-DATE-TIME-NUMBER.png"
        const auto number = [](const std::string& name) { return std::atoi(name.c_str() + name.rfind('-') + 1); };
        std::ranges::sort(names, {}, number);
        std::vector<Image> images;
        for (const std::string& name : names) {
            auto read = unseen::perception::read_image(path(name));
            EXPECT_TRUE(read) << name;
            if (read) images.push_back(std::move(read->image));
        }
        return images;
    }
    void take(const std::string& key, std::size_t count) {
        window().press(key == "S" ? XK_s : XStringToKeysym(key.c_str()), key == "S" ? ShiftMask : 0);
        const auto end = std::chrono::steady_clock::now() + patience;
        const std::string wrote = "-" + std::to_string(count) + ".png";
        while (errors().find(wrote) == std::string::npos && std::chrono::steady_clock::now() < end)
            std::this_thread::sleep_for(poll_pause);
        EXPECT_THAT(errors(), HasSubstr(wrote));
    }
    // "... budget of 368: ..." -> 368
    static int budget_in(const std::string& title) {
        const std::size_t at = title.find("budget of ");
        return at == std::string::npos ? -1 : std::atoi(title.c_str() + at + 10);
    }
};

TEST_F(ViewCommandTest, FollowsKeysAndMouse) {
    ::setenv("UNSEEN_CACHE", "off", 1); // so that nothing is said of what is kept
    if (!open({"--screenshot", "last.png"})) GTEST_SKIP() << "no window: " << errors();
    EXPECT_THAT(window().title_with("imperceptible"), HasSubstr("triangles"));

    window().press(XK_1);
    EXPECT_THAT(window().title_with("whole"), HasSubstr("1,472 of 1,472"));

    window().press(XK_3);
    const int budget = budget_in(window().title_with("budget"));
    EXPECT_EQ(budget, ball_triangles / 4);
    window().press(XK_minus);
    EXPECT_EQ(budget_in(window().title_with("budget of 294")), 294); // 368 / 1.25
    window().press(XK_plus, ShiftMask);
    EXPECT_EQ(budget_in(window().title_with("budget of 368")), 368);

    window().press(XK_4);
    window().move_to(190, 80);
    EXPECT_THAT(window().title_with("gaze-directed"), AllOf(StartsWith("ball.vdt - "), EndsWith(" - Unseen")));

    window().press(XK_w);
    window().press(XK_f);
    window().press(XK_s);
    window().press(XK_h);
    window().press(XK_q);
    EXPECT_EQ(ended(), 0) << errors();
    EXPECT_EQ(read_text(path("out.txt")), "");
    EXPECT_THAT(errors(), StartsWith("unseen: note: press h in the window to see its keys.\n"));
    EXPECT_THAT(errors(), HasSubstr("wrote 'unseen-"));
    EXPECT_EQ(require(unseen::perception::read_image(path("last.png")))->image.width, 200);
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
    const auto background = [](const Image& image) {
        const float corner = image.at(0, 0);
        return std::count(image.values.begin(), image.values.end(), corner);
    };
    EXPECT_LT(background(moved->image), background(still->image) * 9 / 10);
}

// Half a million triangles, which take longer to draw in software than a picture may while somebody turns them.
TEST_F(ViewCommandTest, LargeModelsAreCoarseAtFirstAndWhileTheyMove) {
    write_ball("large.obj", 500, 500);
    succeed({"build", "large.obj", "-o", "large.vdt", "--clusterer", "octree", "--no-fold-errors"});
    if (!WindowTest::open({"view", "large.vdt", "--size", "600x600", "--full"}, {"--screenshot", "whole.png"}))
        GTEST_SKIP() << "no window: " << errors();
    EXPECT_THAT(window().title_with("whole"), HasSubstr("whole: 499,000 of 499,000"));
    window().button(Button1, true, 100, 80);
    std::string title;
    const auto end = std::chrono::steady_clock::now() + patience;
    for (int x = 100; title.find("coarse") == std::string::npos && std::chrono::steady_clock::now() < end; ++x) {
        window().move_to(100 + x % 100, 80, Button1Mask);
        std::this_thread::sleep_for(poll_pause);
        title = window().title();
    }
    EXPECT_THAT(title, HasSubstr("coarse"));
    EXPECT_THAT(window().title_with("whole"), HasSubstr("whole: 499,000 of 499,000")); // at rest
    window().button(Button1, false, 100, 80);
    window().press(XK_q);
    ASSERT_EQ(ended(), 0) << errors();
    EXPECT_TRUE(unseen::perception::read_image(path("whole.png")));

    // The picture that is asked for is the goal's, not the one that stands in for it.
    ASSERT_TRUE(WindowTest::open({"view", "large.vdt", "--size", "600x600", "--fold-test", "luebke-hallen"},
                                 {"--frames", "1", "--screenshot", "goal.png"}));
    ASSERT_EQ(ended(), 0) << errors();
    succeed({"render", "large.vdt", "--size", "600x600", "--fold-test", "luebke-hallen", "-o", "render.png"});
    EXPECT_EQ(require(unseen::perception::read_image(path("goal.png")))->image.values,
              require(unseen::perception::read_image(path("render.png")))->image.values);
}

// What is as far as the target keeps its size, so the ball covers about as much in parallel; a gaze needs perspective.
TEST_F(ViewCommandTest, ParallelViewsZoomAndComeBack) {
    if (!open({"--triangles", "400", "--fill", "0.5"})) GTEST_SKIP() << "no window: " << errors();
    window().title_with("budget");
    take("s", 1);
    window().press(XK_o);
    take("s", 2);
    for (int notch = 0; notch < 3; ++notch) {
        window().button(Button4, true, 100, 80);
        window().button(Button4, false, 100, 80);
    }
    take("s", 3);
    window().press(XK_o);
    take("s", 4);
    window().press(XK_o);
    take("s", 5);
    window().press(XK_4);
    EXPECT_THAT(window().title_with("gaze-directed"), HasSubstr("gaze-directed"));
    window().press(XK_q);
    ASSERT_EQ(ended(), 0) << errors();
    const std::vector<Image> images = screenshots();
    ASSERT_EQ(images.size(), 5u);
    std::vector<double> covered;
    for (const Image& image : images)
        covered.push_back(static_cast<double>(
            std::ranges::count_if(image.values, [&](float value) { return value != image.at(0, 0); })));
    EXPECT_NE(images[1].values, images[0].values);
    EXPECT_GT(covered[1] / covered[0], 0.8);
    EXPECT_LT(covered[1] / covered[0], 1); // in perspective an outline lies before the middle
    EXPECT_NEAR(covered[2] / covered[1], std::pow(0.9, -6), 0.05);
    EXPECT_NE(images[3].values, images[2].values);
    EXPECT_EQ(images[4].values, images[2].values);

    ASSERT_TRUE(open({"--full", "--orthographic", "fit", "--screenshot", "fit.png"}));
    window().title_with("whole");
    window().press(XK_q);
    ASSERT_EQ(ended(), 0) << errors();
    succeed({"render", "ball.vdt", "--full", "--orthographic", "fit", "--size", "200x160", "-o", "same.png"});
    EXPECT_TRUE(read_text(path("fit.png")) == read_text(path("same.png")));
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
        if (title.find("refining") == std::string::npos) break;
        std::this_thread::sleep_for(poll_pause);
    }
    EXPECT_THAT(title, Not(HasSubstr("refining")));
    // All modes can be reached, the full model too, which has no limit.
    window().press(XK_1);
    EXPECT_THAT(window().title_with("whole"), HasSubstr("1,472 of 1,472"));
    window().press(XK_2);
    EXPECT_THAT(window().title_with(": " + whole + " triangles"), HasSubstr(whole));
    window().press(XK_q);
    EXPECT_EQ(ended(), 0) << errors();
}

TEST_F(ViewCommandTest, GlidesComeToRestByThemselves) {
    if (!open({"--triangles", "400", "--geomorph", "2"})) GTEST_SKIP() << "no window: " << errors();
    EXPECT_THAT(window().title_with("budget of 400"), HasSubstr("triangles"));
    window().press(XK_plus, ShiftMask); // few enough changes to glide
    EXPECT_THAT(window().title_with("gliding"), HasSubstr("gliding"));
    std::string title;
    const auto end = std::chrono::steady_clock::now() + patience;
    while (std::chrono::steady_clock::now() < end) {
        title = window().title();
        if (title.find("gliding") == std::string::npos) break;
        std::this_thread::sleep_for(poll_pause);
    }
    EXPECT_THAT(title, Not(HasSubstr("gliding")));
    window().press(XK_s);
    window().press(XK_q);
    EXPECT_EQ(ended(), 0) << errors();
}

TEST_F(ViewCommandTest, FoldingCanBeginAtTheFullModel) {
    succeed({"build", "ball.obj", "-o", "ball.vdt", "--no-fold-errors"});
    const auto imperceptible = [&](const Words& words, bool begins_whole) {
        if (!open(joined(words, {"--fill", "0.2"}))) return std::string(); // so small that something folds
        if (begins_whole) {
            window().title_with("whole");
            window().press(XK_2);
        }
        const std::string title = window().title_with("imperceptible");
        window().press(XK_q);
        EXPECT_EQ(ended(), 0) << errors();
        return triangles_in(title);
    };
    const std::string from_whole = imperceptible({"--full"}, true);
    if (from_whole.empty()) GTEST_SKIP() << "no window: " << errors();
    EXPECT_EQ(from_whole, imperceptible({"--fold-test", "luebke-hallen"}, false))
        << "nobody waits for errors to be measured";
    EXPECT_NE(from_whole, imperceptible({}, false)) << "which would keep less";
}

TEST_F(ViewCommandTest, AClosedWindowTakesNoKeysAndHarmsNobody) {
    if (!open({"--full"})) GTEST_SKIP() << "no window: " << errors();
    window().title_with("whole");
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

// The share of the window that is not background, and its middle.
struct Blob {
    double pixels = 0;
    glm::dvec2 middle = glm::dvec2(0);
};
Blob blob_in(const Image& image) {
    Blob blob;
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            if (image.at(x, y) == image.at(0, 0)) continue;
            ++blob.pixels;
            blob.middle += glm::dvec2(x, y);
        }
    }
    blob.middle /= std::max(1.0, blob.pixels);
    return blob;
}

TEST_F(ViewCommandTest, OtherButtonsAndShiftMoveThePicture) {
    if (!open({"--full", "--fill", "0.3"}, "300x240")) GTEST_SKIP() << "no window: " << errors();
    window().title_with("whole");
    const auto drag = [&](unsigned button, unsigned modifiers, unsigned mask) {
        window().move_to(100, 80);
        window().button(button, true, 100, 80, modifiers);
        window().move_to(140, 60, mask);
        window().button(button, false, 140, 60, modifiers);
    };
    take("s", 1);
    drag(Button2, 0, Button2Mask);
    take("s", 2);
    drag(Button3, 0, Button3Mask);
    take("s", 3);
    window().press(XK_r);
    drag(Button1, ShiftMask, Button1Mask);
    take("s", 4);
    window().press(XK_r);
    take("s", 5);
    window().press(XK_q);
    ASSERT_EQ(ended(), 0) << errors();
    const std::vector<Image> pictures = screenshots();
    ASSERT_EQ(pictures.size(), 5u);
    const Blob first = blob_in(pictures[0]);
    const int steps[] = {0, 1, 2, 1, 0};
    for (std::size_t i = 0; i < pictures.size(); ++i) {
        const Blob blob = blob_in(pictures[i]);
        // As far as the pointer; a ball beside the axis is seen a little longer than round.
        EXPECT_NEAR(blob.middle.x - first.middle.x, 40 * steps[i], 0.6) << i;
        EXPECT_NEAR(blob.middle.y - first.middle.y, -20 * steps[i], 0.6) << i;
        EXPECT_NEAR(blob.pixels, first.pixels, 0.02 * first.pixels) << i;
    }
    EXPECT_EQ(pictures[4].values, pictures[0].values) << "the first view again";
}

// Text and ring are where they should be, over a picture that is otherwise the same, and in no picture of the model.
TEST_F(ViewCommandTest, TextAndRingLieOverThePictureAlone) {
    constexpr int width = 640, height = 480;
    const glm::dvec2 gaze(400, 330);
    if (!open({"--gaze-mode", "mouse"}, "640x480")) GTEST_SKIP() << "no window: " << errors();
    window().title_with("triangles"); // so it is on the screen, and has heard of the screen's own pointer
    window().move_to(int(gaze.x), int(gaze.y));
    take("S", 1);
    take("s", 2);
    window().press(XK_h);
    take("S", 3);
    window().press(XK_i);
    take("s", 4);
    take("S", 5); // without the message of the one before, too
    window().press(XK_q);
    ASSERT_EQ(ended(), 0) << errors();
    const std::vector<Image> pictures = screenshots();
    ASSERT_EQ(pictures.size(), 5u);
    EXPECT_EQ(pictures[1].values, pictures[3].values) << "of the model";
    const Image &first = pictures[0], &with_keys = pictures[2], &plain = pictures[4];
    const double radius = 34.36; // a degree, in pixels of the default display
    int ring = 0, text = 0;
    glm::ivec2 low(width, height), high(0);
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            if (first.at(x, y) == plain.at(x, y)) continue;
            if (std::abs(glm::length(glm::dvec2(x, y) + 0.5 - gaze) - radius) < 4.5) {
                ++ring;
            } else {
                ++text;
                low = glm::min(low, glm::ivec2(x, y));
                high = glm::max(high, glm::ivec2(x, y));
            }
        }
    }
    // About six pixels wide: a light one between rims.
    EXPECT_NEAR(ring, 2 * 3.1416 * radius * 6, 2 * 3.1416 * radius * 1.5);
    const glm::ivec2 size = high - low + 1;
    EXPECT_GT(text, 0.98 * size.x * size.y) << "a panel, but for its round corners";
    EXPECT_EQ(low, glm::ivec2(11)) << "at the top left";
    EXPECT_LE(high.y, height / 3 + 11);
    // The list of keys is a panel below it.
    int below = 0;
    constexpr int message = 60;
    for (int y = high.y + 1; y < height - message; ++y)
        for (int x = 0; x < width; ++x) below += with_keys.at(x, y) != first.at(x, y);
    EXPECT_GT(below, 0.1 * width * height);
}

// Its folder is gone.
TEST_F(ViewCommandTest, AFailedScreenshotIsSaidAndNoEnd) {
    fs::create_directory(path("gone"));
    const std::string view = std::string("exec ") + UNSEEN_COMMAND + " view ../ball.vdt --size 200x160";
    if (!open_program({"/bin/sh", "-c", "cd gone && " + view})) GTEST_SKIP() << "no window: " << errors();
    window().title_with("imperceptible");
    fs::remove(path("gone"));
    for (const unsigned modifiers : {0u, unsigned(ShiftMask)}) {
        window().press(XK_s, modifiers);
        const std::string said = "unseen: Cannot create 'unseen-";
        const auto end = std::chrono::steady_clock::now() + patience;
        const std::string number = modifiers ? "-2.png'" : "-1.png'";
        while (errors().find(number) == std::string::npos && std::chrono::steady_clock::now() < end)
            std::this_thread::sleep_for(poll_pause);
        EXPECT_THAT(errors(), AllOf(HasSubstr(said), HasSubstr(number)));
    }
    window().press(XK_1);
    EXPECT_THAT(window().title_with("whole"), HasSubstr("1,472 of 1,472")) << "it goes on";
    window().press(XK_q);
    EXPECT_EQ(ended(), 0) << "nobody asked for --screenshot";
}

TEST_F(ViewCommandTest, ThePictureThatWasAskedForDecidesTheStatus) {
    fs::create_directory(path("gone"));
    const std::string view = std::string("exec ") + UNSEEN_COMMAND + " view ../ball.vdt --size 200x160";
    if (!open_program({"/bin/sh", "-c", "cd gone && " + view + " --screenshot last.png"}))
        GTEST_SKIP() << "no window: " << errors();
    window().title_with("imperceptible");
    fs::remove(path("gone"));
    window().press(XK_q);
    EXPECT_EQ(ended(), 1);
    EXPECT_THAT(errors(), HasSubstr("last.png"));
}

} // namespace view_test
