// unseen bench engine, on a mesh so small that the figures mean nothing: every row is there, and measured.
#include "run_command.h"

namespace {

using namespace unseen::app::testing;
using ::testing::HasSubstr;

class BenchCommandTest : public CommandTest {};

TEST_F(BenchCommandTest, MeasuresEveryRow) {
    write_ball("ball.obj"); // 1472 triangles
    const Outcome outcome = run({"bench", "engine", "--quick", "--mesh", "ball.obj", "--sizes", "400,1472,5k", "--keep", "kept",
                                 "--json", "-"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const Json report = outcome.json();
    ASSERT_EQ(report["sizes"].size(), 3u);
    EXPECT_LE(report["sizes"][0]["triangles"], 400) << "simplified";
    EXPECT_EQ(report["sizes"][1]["triangles"], 1472);
    EXPECT_EQ(report["sizes"][2]["triangles"], 5000) << "subdivided";
    // Where it can be, so many triangles are active at every size.
    const double active = report["sizes"][1]["active"], finer = report["sizes"][2]["active"];
    EXPECT_NEAR(active, 736, 40);
    EXPECT_NEAR(finer, active, 40);
    int with_bounds = 0;
    for (const Json& row : report["rows"]) {
        const std::string name = row["name"];
        with_bounds += row["must"].is_number();
        if (row["value"].is_null()) {
            EXPECT_FALSE(row["note"].get<std::string>().empty()) << name << " is not available, and does not say why";
            continue;
        }
        if (row["unit"] == "%") { EXPECT_GE(row["value"], 0) << name; }
        else { EXPECT_GT(row["value"], 0) << name; }
        if (row["must"].is_number()) {
            EXPECT_EQ(row["holds_aim"].get<bool>() && !row["holds_must"].get<bool>(), false) << name;
        }
    }
    EXPECT_GE(with_bounds, 20);
    EXPECT_TRUE(fs::exists(path("kept/ball-5000.vdt")));
    const Outcome again = run({"bench", "engine", "--quick", "--mesh", "ball.obj", "--sizes", "1472", "--keep", "kept"});
    EXPECT_EQ(again.status, 0) << again.err;
    EXPECT_THAT(again.out, HasSubstr("still view"));
    EXPECT_THAT(again.err, ::testing::Not(HasSubstr("building ball-1472.vdt"))) << "it is kept";
}

TEST_F(BenchCommandTest, DoesNotWriteOverItsMesh) {
    write_ball("ball.obj");
    const std::string before = read_text(path("ball.obj"));
    for (const char* bench : {"engine", "perception", "effects"}) {
        const Outcome outcome = run({"bench", bench, "--quick", "--mesh", "ball.obj", "--json", "ball.obj"});
        EXPECT_EQ(outcome.status, 1) << bench;
        EXPECT_THAT(outcome.err, HasSubstr("ball.obj' is read"));
    }
    EXPECT_EQ(read_text(path("ball.obj")), before);
}

TEST_F(BenchCommandTest, RefusesWrongSizes) {
    for (const std::string sizes : {"", "0", "70k,70k", "70k,1k", "nan", "1e99", "50", "70q"})
        EXPECT_EQ(run({"bench", "engine", "--sizes", sizes}).status, 2) << sizes;
    EXPECT_EQ(run({"bench"}).status, 2);
    EXPECT_EQ(run({"bench", "engine", "--mesh", "missing.ply"}).status, 1);
}

} // namespace
