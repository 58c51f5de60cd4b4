// unseen-bench accuracy, on a mesh so small that the figures mean little: every axis is there, with its default.
#include "run_bench.h"

#include <algorithm>
#include <set>

namespace {

using namespace unseen::app::testing;
using ::testing::HasSubstr;
using ::testing::Not;

class AccuracyBenchTest : public BenchTest {};

TEST_F(AccuracyBenchTest, EveryAxisHasAFrontAndADefault) {
    write_ball("ball.obj");
    const Outcome outcome = bench({"accuracy", "--quick", "ball.obj", "--seconds", "5", "--window", "96", "--csv",
                                   "points.csv", "--html", "page.html", "--json", "-"});
    if (outcome.err.find("No OpenGL") != std::string::npos) GTEST_SKIP() << outcome.err;
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const Json report = outcome.json();
    const Json& points = report["points"];
    std::set<std::string> axes, with_default, with_front;
    for (const Json& point : points) {
        const std::string axis = point["axis"];
        axes.insert(axis);
        if (point["default"]) with_default.insert(axis);
        if (point["pareto"]) with_front.insert(axis);
        EXPECT_GE(point["time"], 0) << point;
        EXPECT_GE(point["error"], 0) << point;
    }
    EXPECT_EQ(axes.size(), 3u) << "pictures of depth are of scenes";
    EXPECT_EQ(with_default, axes);
    EXPECT_EQ(with_front, axes);
    const auto named = [&](const std::string& name) {
        const auto found = std::ranges::find_if(points, [&](const Json& p) { return p["name"] == name; });
        return found == points.end() ? Json() : *found;
    };
    EXPECT_EQ(named("closed form, double")["error"], 0);
    EXPECT_LT(named("the program's table")["error"], 0.005) << "what csf.h promises";
    EXPECT_GT(named("table, 16 an axis, linear")["error"], named("table, 64 an axis, linear")["error"]);
    EXPECT_EQ(named("imperceptible, followed")["error"], 0) << "what a cut becomes does not depend on the way to it";
    EXPECT_EQ(named("full")["error"], 0);
    EXPECT_LT(named("imperceptible")["error"], 1) << "in thresholds";
    EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(read_text(path("points.csv")), '\n')), points.size() + 1);
    const std::string page = read_text(path("page.html"));
    EXPECT_THAT(page, HasSubstr("<svg"));
    EXPECT_THAT(page, HasSubstr("the program's table"));
    EXPECT_THAT(page, Not(HasSubstr("src="))) << "nothing is loaded from elsewhere";
}

} // namespace
