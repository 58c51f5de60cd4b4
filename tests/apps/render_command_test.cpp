// unseen render and sheet, where there is an OpenGL; and what they say where there is none.
#include "run_command.h"

#include <perception/image.h>

namespace {

using namespace unseen::app::testing;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using unseen::perception::read_image;

class RenderCommandTest : public CommandTest {
protected:
    void SetUp() override {
        CommandTest::SetUp();
        build_ball();
        const Outcome probe = run({"render", "ball.vdt", "-o", "probe.png", "--size", "8x8", "--samples", "1"});
        fs::remove(path("probe.png"));
        if (probe.err.find("No OpenGL") != std::string::npos) GTEST_SKIP() << probe.err;
        ASSERT_EQ(probe.status, 0) << probe.err;
    }
    Json render(std::vector<std::string> more, const std::string& out) const {
        std::vector<std::string> words = {"render", "ball.vdt", "-o", out, "--size", "200x160", "--json", "-"};
        words.insert(words.end(), more.begin(), more.end());
        const Outcome outcome = run(words);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        const Json report = outcome.json();
        expect_cut_report(report);
        EXPECT_TRUE(report["draw_ms"].is_number()) << report;
        return report;
    }
};

TEST_F(RenderCommandTest, DrawsForPeopleAndForJudging) {
    render({}, "ball.png");
    const auto picture = read_image(path("ball.png"));
    ASSERT_TRUE(picture) << picture.error().message;
    EXPECT_EQ(picture->image.width, 200);
    EXPECT_EQ(picture->image.height, 160);
    EXPECT_EQ(picture->image.channels, 3);
    EXPECT_EQ(picture->bits, 8);
    // 20 cd/m2 between 0.5 and 100, as sRGB code: 123 of 255.
    EXPECT_NEAR(picture->image.at(0, 0), 123.0 / 255, 1.0 / 255);

    for (const std::string name : {"ball.pfm", "ball.exr"}) {
        render({}, name);
        const auto luminance = read_image(path(name));
        ASSERT_TRUE(luminance) << luminance.error().message;
        EXPECT_EQ(luminance->image.channels, 1);
        EXPECT_TRUE(luminance->is_absolute);
        EXPECT_NEAR(luminance->image.at(0, 0), 20, 1e-4) << "the background";
        // The lit matt grey: from 0.16 to 0.8 of the display's span.
        const float middle = luminance->image.at(100, 60);
        EXPECT_GT(middle, 16.0f);
        EXPECT_LT(middle, 80.2f);
    }
}

TEST_F(RenderCommandTest, TheImperceptibleCutShowsNoDifference) {
    render({"--full"}, "full.pfm");
    const Json cut = render({"--gaze", "1500", "80"}, "cut.pfm");
    EXPECT_LT(cut["triangles"], ball_triangles);
    EXPECT_EQ(effect_named(cut, "back-face culling")["on"], true);
    EXPECT_EQ(effect_named(cut, "frustum culling")["on"], true);
    const Outcome same = run({"compare", "full.pfm", "cut.pfm", "--gaze", "1500", "80", "--fail-above", "0"});
    EXPECT_EQ(same.status, 0) << same.out << same.err;

    render({"--triangles", "60"}, "rough.pfm");
    const Outcome rough = run({"compare", "full.pfm", "rough.pfm", "--fail-above", "0"});
    EXPECT_EQ(rough.status, 1) << "the judge is not blind: " << rough.out;
}

TEST_F(RenderCommandTest, OptionsChangeThePicture) {
    render({}, "plain.png");
    const std::string plain = read_text(path("plain.png"));
    const std::vector<std::vector<std::string>> changes = {
        {"--wireframe"},      {"--shading", "flat"},  {"--light", "-1", "0", "0"},
        {"--ambient", "0.9"}, {"--background", "70"}, {"--direction", "1", "0", "0"},
        {"--fill", "0.3"},    {"--triangles", "60"},  {"--samples", "1"}};
    for (const auto& change : changes) {
        render(change, "changed.png");
        EXPECT_FALSE(read_text(path("changed.png")) == plain) << ::testing::PrintToString(change);
    }
    render({}, "again.png");
    EXPECT_TRUE(read_text(path("again.png")) == plain);
}

TEST_F(RenderCommandTest, FillIsTheShareOfTheHeight) {
    render({"--fill", "0.5", "--full"}, "half.pfm");
    const auto image = read_image(path("half.pfm"));
    ASSERT_TRUE(image);
    int top = 160, bottom = 0;
    for (int y = 0; y < 160; ++y)
        for (int x = 0; x < 200; ++x)
            if (std::abs(image->image.at(x, y) - 20) > 0.01f) top = std::min(top, y), bottom = std::max(bottom, y);
    // The bounding sphere takes 80 pixels; the ball's bumps reach up to 5 % beyond its poles.
    EXPECT_LE(bottom + 1 - top, 80);
    EXPECT_GE(bottom + 1 - top, 74);
}

TEST_F(RenderCommandTest, AnEyeInsideIsValid) { render({"--eye", "0", "0", "0.1"}, "inside.png"); }

TEST_F(RenderCommandTest, TheSheetShowsAndJudgesFourCuts) {
    const Outcome outcome = run({"sheet", "ball.vdt", "-o", "sheet.png", "--size", "256x256", "--samples", "4",
                                 "--cell", "64", "--json", "sheet.json"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr("gaze-directed"));
    const auto sheet = read_image(path("sheet.png"));
    ASSERT_TRUE(sheet) << sheet.error().message;
    EXPECT_GT(sheet->image.width, 4 * 64);
    EXPECT_GT(sheet->image.height, 2 * 64);
    const Json report = Json::parse(read_text(path("sheet.json")));
    ASSERT_EQ(report["cuts"].size(), 4u);
    std::vector<std::string> names;
    for (const Json& cut : report["cuts"]) names.push_back(cut["name"]);
    EXPECT_THAT(names, ElementsAre("full", "imperceptible", "budget", "gaze-directed"));
    const Json& cuts = report["cuts"];
    EXPECT_TRUE(cuts[0]["visible_pixels"].is_null()) << "the reference";
    EXPECT_EQ(cuts[0]["triangles"], ball_triangles);
    EXPECT_EQ(cuts[1]["visible_pixels"], 0);
    EXPECT_LE(cuts[2]["triangles"], ball_triangles / 4);
    EXPECT_EQ(cuts[3]["visible_pixels"], 0);
    EXPECT_LE(cuts[3]["triangles"], cuts[1]["triangles"]);
}

TEST_F(RenderCommandTest, WrongUsageIsStatusTwo) {
    const auto before = files();
    for (const std::vector<std::string>& words :
         std::vector<std::vector<std::string>>{{"render", "ball.vdt", "-o", "out.gif"},
                                               {"render", "ball.vdt", "-o", "out.png", "--samples", "257"},
                                               {"render", "ball.vdt", "-o", "out.png", "--samples", "0"},
                                               {"render", "ball.vdt", "-o", "out.png", "--shading", "toon"},
                                               {"sheet", "ball.vdt", "-o", "out.png", "--cell", "0"},
                                               {"sheet", "ball.vdt", "-o", "out.png", "--full"},
                                               {"view", "ball.vdt", "--frames", "0"},
                                               {"view", "ball.vdt", "--screenshot", "out.ply"}}) {
        const Outcome outcome = run(words);
        EXPECT_EQ(outcome.status, 2) << ::testing::PrintToString(words);
        EXPECT_EQ(outcome.err.rfind("unseen: ", 0), 0U) << outcome.err;
        EXPECT_EQ(files(), before);
    }
}

TEST_F(RenderCommandTest, VerbsThatDrawHaveHelpWithExamples) {
    for (const std::string verb : {"render", "sheet", "view"}) {
        const Outcome help = run({verb, "--help"});
        EXPECT_EQ(help.status, 0) << verb << help.err;
        EXPECT_THAT(help.out, ::testing::AllOf(HasSubstr("Examples:"), HasSubstr("unseen " + verb))) << verb;
    }
}

TEST_F(RenderCommandTest, FailuresLeaveNoFile) {
    const auto before = files();
    for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
             {"render", "ball.vdt", "-o", "missing/o.png", "--json", "o.json"},
             {"render", "missing.vdt", "-o", "o.png", "--json", "o.json"},
             {"sheet", "ball.vdt", "-o", "missing/o.png", "--size", "32x32", "--json", "o.json"}}) {
        const Outcome outcome = run(words);
        EXPECT_EQ(outcome.status, 1) << outcome.out;
        EXPECT_THAT(outcome.err, IsAnErrorForPeople());
        EXPECT_EQ(files(), before);
    }
}

class NoGpuTest : public CommandTest {
protected:
    void SetUp() override {
        CommandTest::SetUp();
        setenv("__EGL_VENDOR_LIBRARY_DIRS", "/nonexistent", 1); // a machine without any driver
    }
    void TearDown() override {
        unsetenv("__EGL_VENDOR_LIBRARY_DIRS");
        CommandTest::TearDown();
    }
};

TEST_F(NoGpuTest, RenderingSaysSoAndEverythingElseWorks) {
    build_ball();
    const auto before = files();
    for (const std::string verb : {"render", "sheet"}) {
        const Outcome outcome = run({verb, "ball.vdt", "-o", "o.png"});
        EXPECT_EQ(outcome.status, 1);
        EXPECT_THAT(outcome.err, IsAnErrorForPeople());
        EXPECT_THAT(outcome.err, HasSubstr("OpenGL"));
        EXPECT_EQ(files(), before);
    }
    EXPECT_EQ(run({"simplify", "ball.vdt", "-o", "o.ply"}).status, 0);
}

} // namespace
