// unseen-bench perception, fit and people, on a mesh and in a window so small that the figures mean little: every
// row is there, and measured.
#include "run_bench.h"

namespace perception_bench_test {

using namespace unseen::app::testing;
using ::testing::HasSubstr;

class PerceptionBenchTest : public BenchTest {
protected:
    void SetUp() override {
        CommandTest::SetUp();
        build_ball();
        if (!no_opengl().empty()) GTEST_SKIP() << no_opengl();
    }
    Json perception(const std::string& groups) const {
        const Outcome outcome =
            bench({"perception", "--quick", "--window", "96", "--mesh", "ball.vdt", "--only", groups, "--json", "-"});
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return outcome.json();
    }
};

TEST_F(PerceptionBenchTest, JudgesViews) {
    const Json report = perception("savings,random,far");
    expect_measured(report, 12);
    // Two fills, two gazes; a random view of the model and one of waves; three distances: by three tests.
    ASSERT_EQ(report["views"].size(), 3u * (4 + 2 + 3));
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
}

TEST_F(PerceptionBenchTest, MeasuresTolerances) {
    const Json report = perception("tolerance");
    expect_measured(report, 0);
    EXPECT_GT(value(report, "safe extent at 29 degrees aside over that at the fovea"), 1);
}

TEST_F(PerceptionBenchTest, MakesHardMeshes) {
    const Json report = perception("hard");
    expect_measured(report, 3);
    ASSERT_EQ(report["views"].size(), 6u * 2 * 3); // meshes, gazes, tests
    for (const Json& view : report["views"]) {
        EXPECT_GT(view["of"], 1000) << view["mesh"];
        // What pokes through thin parts no node knows of: a known limit, and what the row is there to show.
        if (view["test"] == "luebke-hallen-safe" && view["mesh"] != "thin plates")
            EXPECT_EQ(view["visible_pixels"], 0) << view;
    }
}

TEST_F(PerceptionBenchTest, PeopleAreComparedWithModels) {
    const Outcome outcome = bench({"people", "--json", "-"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    std::map<std::string, double> above;
    const Json all = outcome.json();
    for (const Json& row : all["rows"])
        if (row.contains("model")) above[row["model"]] = row["share_above"];
    EXPECT_NEAR(above["castle times 2: observer default"], 0.087, 5e-4);
    EXPECT_NEAR(above["castle times 1: observer median"], 0.649, 5e-4);
    EXPECT_EQ(bench({"people", "--table", "nowhere.csv"}).status, 2);
}

// By eccentricity, on a mesh of its own beside the regular waves: nothing is visible to either judge.
TEST_F(PerceptionBenchTest, NothingIsSeenWhereverTheViewerLooks) {
    const Outcome outcome =
        bench({"perception", "--quick", "--only", "aside", "--window", "128", "--mesh", "ball.vdt", "--json", "-"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const Json views = outcome.json()["views"];
    ASSERT_EQ(views.size(), 16u); // two meshes, eight eccentricities
    for (const Json& view : views) {
        EXPECT_EQ(view["visible_pixels"], 0) << view;
        EXPECT_EQ(view["second_visible_pixels"], 0) << view;
    }
    EXPECT_LT(views[7]["triangles"], views[0]["triangles"]);
}

// A factor cut to a third keeps fewer triangles; the more it is, the more are kept.
TEST_F(PerceptionBenchTest, FactorsOfTheFoldModelAreVaried) {
    const Outcome outcome = bench({"fit", "--quick", "--factor", "needed_by_outlines", "--json", "-"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const Json rows = outcome.json()["rows"];
    ASSERT_EQ(rows.size(), 5u);
    for (std::size_t i = 0; i < rows.size(); ++i) {
        EXPECT_EQ(rows[i]["factor"], "needed_by_outlines");
        EXPECT_EQ(rows[i]["is_own"], rows[i]["value"] == 0.3);
        ASSERT_EQ(rows[i]["seen"].size(), 4u); // looked at, and aside
        EXPECT_GT(rows[i]["seen"][0]["largest_v"], 0);
        EXPECT_LT(rows[i]["seen"][3]["largest_v"], 1);
        if (i == 0) continue;
        EXPECT_GT(rows[i]["value"], rows[i - 1]["value"]);
        EXPECT_GE(rows[i]["triangles"], rows[i - 1]["triangles"]);
    }
    EXPECT_LT(rows.front()["of_own"], 1);
    EXPECT_GT(rows.back()["of_own"], 1);
    EXPECT_EQ(bench({"fit", "--factor", "pooling"}).status, 2);
}

// A machine without any OpenGL driver, which the EGL dispatcher's search path can pretend.
TEST_F(PerceptionBenchTest, NumbersNeedNoOpenGl) {
    setenv("__EGL_VENDOR_LIBRARY_DIRS", "/nonexistent", 1);
    const Outcome numbers = bench({"people", "--json", "-"});
    const Outcome pictures =
        bench({"perception", "--quick", "--only", "savings", "--mesh", "ball.vdt", "--window", "96"});
    unsetenv("__EGL_VENDOR_LIBRARY_DIRS");
    EXPECT_EQ(numbers.status, 0) << numbers.err;
    EXPECT_FALSE(numbers.json()["rows"].empty());
    EXPECT_EQ(pictures.status, 1);
    EXPECT_THAT(pictures.err, HasSubstr("No OpenGL"));
}

TEST_F(PerceptionBenchTest, RefusesWrongUsage) {
    for (const Words& words : std::vector<Words>{{"--only", "saving"}, {"--window", "1"}}) {
        EXPECT_EQ(bench(joined({"perception", "--quick"}, words)).status, 2) << words[0];
    }
    EXPECT_EQ(bench({"perception", "--mesh", "missing.ply"}).status, 1);
}

} // namespace perception_bench_test
