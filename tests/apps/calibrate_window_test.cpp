// unseen calibrate under X, driven by synthetic keys: trials go on with the keys, and what was answered ends in the
// profile.
#include "window_test.h"

#include <unseen/perception/image.h>

namespace calibrate_window_test {

using namespace unseen::app::testing;
using ::testing::HasSubstr;

class CalibrateWindowTest : public WindowTest {
protected:
    void SetUp() override {
        WindowTest::SetUp();
        if (IsSkipped()) return;
        // Small, so that software rendering keeps up.
        write_text(path("small.json"), R"({"name": "small", "width_px": 360, "height_px": 240, "pixel_pitch_m": 0.0005,
            "viewing_distance_m": 0.5, "peak_cdm2": 100, "black_cdm2": 0.5})");
    }
    bool open(const Words& more) { return WindowTest::open({"calibrate", "--display", "small.json"}, more); }
    Json state() const { return Json::parse(read_text(path("state.json")), nullptr, false); }

    std::size_t answers() const {
        const Json json = state(); // none or half of one yet: no answers
        return json.is_object() ? json["answers"].size() : 0;
    }
    // Presses a key until so many answers are kept; keys before the question do not count.
    void press_until(KeySym key, std::size_t count) {
        const auto end = std::chrono::steady_clock::now() + patience;
        while (answers() < count && std::chrono::steady_clock::now() < end) {
            window().press(key);
            std::this_thread::sleep_for(poll_pause);
        }
        EXPECT_GE(answers(), count);
    }
    void press_once(KeySym key, const std::string& title) {
        window().press(key);
        EXPECT_THAT(window().title_with(title), HasSubstr(title));
    }
};

TEST_F(CalibrateWindowTest, TwoIntervalsAreAnsweredWithKeysAndTakenUpAgain) {
    const Words words = {"--trials",      "20", "--interval",       "0.02", "--resume", "state.json",
                         "--frequencies", "2",  "--eccentricities", "0",    "5",        "--observer",
                         "anna",          "-o", "anna.json"};
    if (!open(words)) GTEST_SKIP() << "no window: " << errors();
    EXPECT_THAT(window().title_with("1 of 20"), HasSubstr("2 cpd"));
    press_until(XK_1, 1);
    press_until(XK_2, 2);
    window().press(XK_q);
    EXPECT_EQ(ended(), 1) << "-o was asked for: " << errors();
    EXPECT_THAT(errors(), HasSubstr("of 20 answers were given; go on with --resume 'state.json'"));
    EXPECT_THAT(errors(), HasSubstr("look at the cross"));
    EXPECT_EQ(read_text(path("out.txt")), "");
    EXPECT_FALSE(fs::exists(path("anna.json")));
    const std::size_t answered = answers();
    ASSERT_LT(answered, 20u);

    ASSERT_TRUE(open(words));
    EXPECT_THAT(window().title_with(" of 20"), HasSubstr(std::to_string(answered + 1) + " of 20"));
    press_until(XK_1, 20);
    EXPECT_EQ(ended(), 0) << errors();
    const Json profile = Json::parse(read_text(path("anna.json")));
    EXPECT_EQ(profile["observer"], "anna");
    EXPECT_EQ(profile["measured"].size(), 2u);
    EXPECT_EQ(profile["display"], "small");
}

TEST_F(CalibrateWindowTest, AdjustmentShowsAGratingAndTakesTheContrast) {
    const Words words = {"--method",         "adjustment", "--settings", "3",     "--frequencies", "2",
                         "--eccentricities", "0",          "--fade",     "0.001", "--resume",      "state.json",
                         "--screenshot",     "s.png"};
    if (!open(words)) GTEST_SKIP() << "no window: " << errors();
    window().title_with("1 of 3");
    for (int i = 0; i < 60; ++i) window().press(XK_Up); // to the top: a grating that anybody sees
    press_once(XK_space, "2 of 3");
    for (int i = 0; i < 20; ++i) window().press(XK_Down);
    press_once(XK_Return, "3 of 3");
    for (int i = 0; i < 100; ++i) window().press(XK_Up);
    std::this_thread::sleep_for(std::chrono::seconds(1)); // a frame with it
    window().press(XK_q);
    EXPECT_EQ(ended(), 0) << errors();
    const Json given = state()["answers"];
    ASSERT_EQ(given.size(), 2u);
    EXPECT_NEAR(given[0][1], std::log10(99.5 / 100.5), 0.01) << "the highest contrast";
    EXPECT_EQ(given[0][2], 0) << "which says that less was not seen";
    EXPECT_LT(given[1][1], -1);

    // A patch of 2 cpd in the middle: about 17.45 pixels a degree, so 8.7 a cycle, and grey at the edge.
    const auto picture = require(unseen::perception::read_image(path("s.png")));
    ASSERT_EQ(picture->image.width, 360);
    ASSERT_EQ(picture->image.height, 240);
    const int y = 240 / 2 + 12; // beside the cross
    float lo = 1, hi = 0;
    for (int x = 160; x < 200; ++x) {
        lo = std::min(lo, picture->image.at(x, y));
        hi = std::max(hi, picture->image.at(x, y));
    }
    EXPECT_GT(hi - lo, 0.3f); // of codes, off the middle of the patch
    EXPECT_NEAR(picture->image.at(5, 5), 0.735, 0.02) << "half of the white's luminance";
    int rises = 0;
    for (int x = 150; x < 210; ++x) rises += picture->image.at(x, y) < 0.7f && picture->image.at(x + 1, y) >= 0.7f;
    EXPECT_NEAR(rises, 60 / 8.7, 2.5);
}

TEST_F(CalibrateWindowTest, GammaIsMatched) {
    if (!open({"--gamma", "-o", "measured.json", "--screenshot", "g.png"})) GTEST_SKIP() << "no window: " << errors();
    // A quarter, a half and three quarters of white: a gamma of 2 gives codes 128, 180 and 221; it begins at 128.
    window().title_with("match 1 of 3");
    press_once(XK_Return, "match 2 of 3");
    for (int i = 0; i < 5; ++i) window().press(XK_Page_Up);
    window().press(XK_Up);
    window().press(XK_Up);
    press_once(XK_Return, "match 3 of 3");
    for (int i = 0; i < 9; ++i) window().press(XK_Page_Up);
    for (int i = 0; i < 3; ++i) window().press(XK_Up);
    window().press(XK_Return);
    EXPECT_EQ(ended(), 0) << errors();
    const Json display = Json::parse(read_text(path("measured.json")));
    EXPECT_NEAR(display["transfer"].get<double>(), 2, 0.05);
    EXPECT_EQ(display["width_px"], 360);
    EXPECT_TRUE(unseen::perception::read_image(path("g.png")));
}

} // namespace calibrate_window_test
