// unseen demo: without a file, with a display and without one.

#include "run_command.h"
#include "virtual_display.h"

namespace demo_command_test {

using namespace unseen::app::testing;

class DemoCommandTest : public CommandTest {
protected:
    void SetUp() override {
        CommandTest::SetUp();
        ::setenv("UNSEEN_CACHE", path("cache").c_str(), 1); // in the test's own folder
    }
};

TEST_F(DemoCommandTest, MakesAndShowsAModel) {
    const unseen::render::testing::VirtualDisplay display;
    if (!display.reason().empty()) GTEST_SKIP() << "no display: " << display.reason();
    const Outcome shown = succeed({"demo", "--made", "-o", "look", "--frames", "3"});
    if (shown.err.find("pictures are left out") != std::string::npos) GTEST_SKIP() << shown.err;
    EXPECT_EQ(shown.err.find("no viewer"), std::string::npos) << shown.err;
    EXPECT_THAT(shown.out, HasSubstr("the viewer is open"));
    EXPECT_THAT(shown.out, HasSubstr("of 57,360 triangles"));
    for (const std::string file : {"ball.vdt", "ball_small.ply", "ball_sheet.png", "ball_maps.png"}) {
        EXPECT_TRUE(fs::exists(path("look") / file)) << file;
        EXPECT_THAT(shown.out, HasSubstr("look/" + file));
    }
    // The mesh is what simplify writes of the tree.
    EXPECT_EQ(run({"simplify", "look/ball.vdt", "-o", "again.ply"}).status, 0);
    EXPECT_TRUE(read_text(path("again.ply")) == read_text(path("look/ball_small.ply")));
    write_text(path("file"), "");
    EXPECT_THAT(run({"demo", "--made", "-o", "file"}).err, IsAnErrorForPeople());
}

// And makes the same once more, over what is there.
TEST_F(DemoCommandTest, SaysHowToLookAtItWhereThereIsNoDisplay) {
    unsetenv("DISPLAY");
    std::string sheet;
    for (int time = 0; time < 2; ++time) {
        const Outcome made = succeed({"demo", "--made", "-o", "look"});
        if (made.err.find("pictures are left out") != std::string::npos) GTEST_SKIP() << made.err;
        EXPECT_THAT(made.out, HasSubstr("where there is a display:  unseen view look/ball.vdt"));
        const std::string before = std::exchange(sheet, read_text(path("look/ball_sheet.png")));
        EXPECT_TRUE(time == 0 || sheet == before);
    }
}

} // namespace demo_command_test
