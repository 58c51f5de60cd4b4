// unseen bench perception and effects, on a mesh and in a window so small that the figures mean little: every row is there, and measured.
#include "run_command.h"

#include <cmath>

#include <perception/image.h>

namespace {

using namespace unseen::app::testing;
using ::testing::HasSubstr;

class PerceptionBenchTest : public CommandTest {
protected:
    void SetUp() override {
        CommandTest::SetUp();
        build_ball();
        const Outcome probe = run({"render", "ball.vdt", "-o", "probe.png", "--size", "8x8", "--samples", "1"});
        if (probe.err.find("No OpenGL") != std::string::npos) GTEST_SKIP() << probe.err;
    }
    Json bench(const std::string& groups) const {
        const Outcome outcome = run({"bench", "perception", "--quick", "--window", "96", "--mesh", "ball.vdt", "--only", groups, "--pictures", "pictures",
                                     "--json", "-"});
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return outcome.json();
    }
    static void expect_measured(const Json& report, int least_with_bounds) {
        int with_bounds = 0;
        for (const Json& row : report["rows"]) {
            const std::string name = row["name"];
            with_bounds += row["must"].is_number();
            EXPECT_TRUE(row["value"].is_number()) << name << ": " << row["note"];
            if (row["must"].is_number() && row["aim"].is_number() && row["value"].is_number()) {
                EXPECT_FALSE(row["holds_aim"].get<bool>() && !row["holds_must"].get<bool>()) << name;
            }
        }
        EXPECT_GE(with_bounds, least_with_bounds);
    }
    static double value(const Json& report, const std::string& name) {
        for (const Json& row : report["rows"])
            if (row["name"] == name) return row["value"].get<double>();
        ADD_FAILURE() << "no row '" << name << "'";
        return NAN;
    }
};

TEST_F(PerceptionBenchTest, JudgesViews) {
    const Json report = bench("savings,random,far");
    expect_measured(report, 12);
    // Two fills, two gazes; one random view; three distances: by three tests.
    ASSERT_EQ(report["views"].size(), 3u * (4 + 1 + 3));
    double visible = 0, kept[2] = {};
    for (const Json& view : report["views"]) {
        EXPECT_LE(view["triangles"], view["of"]);
        const bool is_first = view["test"] == "luebke-hallen";
        if (view["group"] == "savings" && is_first) visible += view["visible_pixels"].get<double>();
        if (view["group"] != "savings" || view["view"].get<std::string>().find("90%") == std::string::npos) continue;
        if (view["view"].get<std::string>().find("fovea") == std::string::npos) continue;
        if (is_first) kept[0] = view["triangles"];
        if (view["test"] == "error") kept[1] = view["triangles"];
    }
    EXPECT_EQ(visible, value(report, "visible pixels, these 4 views, luebke-hallen")) << "the sum of the views";
    EXPECT_NEAR(value(report, "fewer triangles, fovea, 90%, error"), kept[0] / kept[1], 1e-9);
    for (const std::string name : {"savings.png", "random.png", "far.png"})
        EXPECT_TRUE(unseen::perception::read_image(path("pictures/" + name))) << name;
}

TEST_F(PerceptionBenchTest, MeasuresModelsTolerancesAndCosts) {
    const Json report = bench("tolerance,csf,speed");
    expect_measured(report, 15);
    EXPECT_GT(value(report, "safe extent at 29 degrees aside over that at the fovea"), 1);
    EXPECT_LT(value(report, "deviation of castle"), 1000);
    EXPECT_LT(value(report, "error of the tables"), 0.5);
    EXPECT_GT(value(report, "full tests from scratch, error"), 0);
}

TEST_F(PerceptionBenchTest, MakesHardMeshes) {
    const Json report = bench("hard");
    expect_measured(report, 3);
    ASSERT_EQ(report["views"].size(), 6u * 2 * 3); // meshes, gazes, tests
    for (const Json& view : report["views"]) {
        EXPECT_GT(view["of"], 1000) << view["mesh"];
        // What pokes through thin parts no node knows of: a known limit, and what the row is there to show.
        if (view["test"] == "luebke-hallen-safe" && view["mesh"] != "thin plates") {
            EXPECT_EQ(view["visible_pixels"], 0) << view;
        }
    }
}

TEST_F(PerceptionBenchTest, EffectsAreComparedWithoutEach) {
    const Outcome outcome = run({"bench", "effects", "--quick", "--mesh", "ball.vdt", "--json", "-"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    std::map<std::string, double> kept;
    const Json report = outcome.json();
    for (const Json& one : report["effects"]) kept[one["variation"]] = one["triangles"];
    EXPECT_GT(kept["no gaze"], kept["luebke-hallen, all effects"]);
    EXPECT_GT(kept["no contrast"], kept["luebke-hallen, all effects"]);
    EXPECT_LE(kept["no silhouettes"], kept["luebke-hallen, all effects"]);
    EXPECT_GE(kept["luebke-hallen-safe"], kept["luebke-hallen, all effects"]);
    EXPECT_EQ(kept["chroma"], kept["luebke-hallen, all effects"]) << "the ball is grey";
    const Outcome people = run({"bench", "effects", "--quick", "--mesh", "ball.vdt"});
    EXPECT_THAT(people.out, HasSubstr("no silhouettes"));
}

// A machine without any OpenGL driver, which the EGL dispatcher's search path can pretend.
TEST_F(PerceptionBenchTest, NumbersNeedNoOpenGl) {
    setenv("__EGL_VENDOR_LIBRARY_DIRS", "/nonexistent", 1);
    const Outcome numbers = run({"bench", "perception", "--quick", "--only", "csf", "--json", "-"});
    const Outcome pictures = run({"bench", "perception", "--quick", "--only", "savings", "--mesh", "ball.vdt", "--window", "96"});
    unsetenv("__EGL_VENDOR_LIBRARY_DIRS");
    EXPECT_EQ(numbers.status, 0) << numbers.err;
    EXPECT_FALSE(numbers.json()["rows"].empty());
    EXPECT_EQ(pictures.status, 1);
    EXPECT_THAT(pictures.err, HasSubstr("No OpenGL"));
}

TEST_F(PerceptionBenchTest, BadReferencesAreNamedWithTheirLine) {
    fs::create_directory(path("figures"));
    for (const auto& [cell, column] : {std::pair("4x", "frequency"), {"", "frequency"}, {"nan", "frequency"}, {"1e999", "frequency"}}) {
        write_text(path("figures") / "csf_golden.csv", "# a remark\nfrequency,luminance,area,eccentricity,castle,stela\n4,100,1,0,200,200\n" +
                                                           std::string(cell) + ",100,1,0,200,200\n");
        const Outcome outcome = run({"bench", "perception", "--quick", "--only", "csf", "--reference", "figures"});
        EXPECT_EQ(outcome.status, 1) << cell;
        EXPECT_THAT(outcome.err, HasSubstr("csf_golden.csv: line 4: '" + std::string(cell) + "' in column '" + column + "' is no number"));
    }
    write_text(path("figures") / "csf_golden.csv", "frequency,luminance,area,eccentricity,castle,stela\n4,1e+2,1.0,0,2.0e+02,2e2\n");
    EXPECT_EQ(run({"bench", "perception", "--quick", "--only", "csf", "--reference", "figures"}).err.find("no number"), std::string::npos);
}

TEST_F(PerceptionBenchTest, RefusesWrongUsage) {
    for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
             {"--only", "saving"}, {"--window", "1"}, {"--second-judge", "castle-red-green"}, {"--reference", "missing"}}) {
        std::vector<std::string> all = {"bench", "perception", "--quick"};
        all.insert(all.end(), words.begin(), words.end());
        EXPECT_EQ(run(all).status, 2) << words[0];
    }
    EXPECT_EQ(run({"bench", "perception", "--mesh", "missing.ply"}).status, 1);
    EXPECT_EQ(run({"bench", "effects", "--mesh", "missing.ply"}).status, 1);
}

} // namespace
