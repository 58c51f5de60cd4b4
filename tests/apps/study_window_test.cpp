// unseen study run under X, driven by synthetic keys.
#include "window_test.h"

#include <unseen/perception/image.h>

namespace study_window_test {

using namespace unseen::app::testing;
using ::testing::HasSubstr;

class StudyWindowTest : public WindowTest {
protected:
    void SetUp() override {
        WindowTest::SetUp();
        if (IsSkipped()) return;
        // One white and one black picture, each with a mark that tells its corner.
        fs::create_directory(path("s"));
        for (const bool is_white : {true, false}) {
            unseen::perception::Image image{64, 48, 3, std::vector<float>(std::size_t{64} * 48 * 3, is_white ? 1 : 0)};
            image.at(0, 0, 0) = 0.5f;
            ASSERT_TRUE(unseen::perception::write_image(path(is_white ? "s/white.png" : "s/black.png"), image));
        }
        write_text(path("s/study.json"), R"({"format": "unseen study", "version": 1, "task": "which", "repeats": 4,
            "seed": 3, "pixels_per_degree": 34.357, "pairs": [
            {"condition": "plain", "original": "white.png", "other": "black.png", "training": true},
            {"condition": "black", "original": "white.png", "other": "black.png", "training": false}]})");
    }
    bool open(const Words& more = {}) { return WindowTest::open({"study", "run", "s", "--subject", "ann"}, more); }
    std::size_t answers() const {
        const std::string text = read_text(path("s/answers-ann.csv"));
        return static_cast<std::size_t>(std::max<std::ptrdiff_t>(std::ranges::count(text, '\n') - 1, 0));
    }
    void press_until(KeySym key, std::size_t count) {
        const auto end = std::chrono::steady_clock::now() + patience;
        while (answers() < count && std::chrono::steady_clock::now() < end) {
            window().press(XK_space); // begins, and goes on after training
            window().press(key);
            std::this_thread::sleep_for(poll_pause);
        }
        EXPECT_GE(answers(), count);
    }
};

TEST_F(StudyWindowTest, IsAnsweredWithKeysAndTakenUpAgain) {
    if (!open({"--screenshot", "shot.png"})) GTEST_SKIP() << "no window: " << errors();
    EXPECT_THAT(window().title_with("1 of 5"), HasSubstr("study"));
    press_until(XK_Left, 2);
    window().press(XK_q);
    EXPECT_EQ(ended(), 0) << errors();
    const std::size_t first = answers();
    ASSERT_LT(first, 5u);
    EXPECT_THAT(read_text(path("out.txt")), HasSubstr("of 5 trials are answered; the same command continues"));
    // Both pictures as they are, on grey.
    const auto shot = require(unseen::perception::read_image(path("shot.png")));
    const auto& image = shot->image;
    const int middle = image.width / 2, row = (image.height - 80 - 48) / 2 + 24;
    const float left = image.at(middle - 40, row, 1), right = image.at(middle + 40, row, 1);
    EXPECT_EQ(std::min(left, right), 0);
    EXPECT_EQ(std::max(left, right), 1);
    EXPECT_NEAR(image.at(middle, row, 1), 119.0f / 255, 1e-3f);

    ASSERT_TRUE(open());
    EXPECT_THAT(window().title_with(" of 5"), HasSubstr(std::to_string(first + 1) + " of 5"));
    press_until(XK_Right, 5);
    EXPECT_EQ(ended(), 0) << errors();
    const std::string text = read_text(path("s/answers-ann.csv"));
    EXPECT_EQ(answers(), 5u);
    EXPECT_THAT(text, HasSubstr(",which,,left,left,1,"));
    const Outcome analysed = run({"study", "analyse", "s/answers-ann.csv", "--json", "-"});
    EXPECT_EQ(analysed.json()["conditions"][0]["seen"]["of"], 4);
}

TEST_F(StudyWindowTest, SaysWhichPictureItCannotShow) {
    write_text(path("s/black.png"), "no picture");
    if (open()) return; // it was quicker
    EXPECT_EQ(ended(), 1);
    EXPECT_THAT(errors(), HasSubstr("black.png"));
}

} // namespace study_window_test
