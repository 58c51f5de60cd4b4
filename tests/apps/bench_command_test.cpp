// unseen-bench engine, on a mesh so small that the figures mean nothing: every row is there, and measured.
#include "run_bench.h"

namespace bench_command_test {

using namespace unseen::app::testing;
using ::testing::HasSubstr;
using ::testing::Not;

class BenchCommandTest : public BenchTest {};

TEST_F(BenchCommandTest, MeasuresEveryRow) {
    write_ball("ball.obj"); // 1472 triangles
    const Outcome outcome =
        bench({"engine", "--quick", "--mesh", "ball.obj", "--sizes", "400,1472,5k", "--keep", "kept", "--json", "-"});
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
    int with_targets = 0;
    for (const Json& row : report["rows"]) {
        const std::string name = row["name"];
        with_targets += row["target"].is_number();
        if (row["value"].is_null()) {
            EXPECT_FALSE(row["note"].get<std::string>().empty()) << name << " is not available, and does not say why";
            continue;
        }
        if (row["unit"] == "%") {
            EXPECT_GE(row["value"], 0) << name;
        } else {
            EXPECT_GT(row["value"], 0) << name;
        }
    }
    EXPECT_GE(with_targets, 18);
    EXPECT_TRUE(fs::exists(path("kept/ball-5000.vdt")));
    const Outcome again = bench({"engine", "--quick", "--mesh", "ball.obj", "--sizes", "1472", "--keep", "kept"});
    EXPECT_EQ(again.status, 0) << again.err;
    EXPECT_THAT(again.out, HasSubstr("still view"));
    EXPECT_THAT(again.out, Not(::testing::ContainsRegex("[0-9]e[+-][0-9]"))) << "numbers as people write them";
    EXPECT_THAT(again.out, ::testing::ContainsRegex("still view [^\n]* us +1 ")) << "its target";
    EXPECT_THAT(again.err, Not(HasSubstr("building ball-1472.vdt"))) << "it is kept";
}

TEST_F(BenchCommandTest, ComparesClusterersAndRepair) {
    write_ball("ball.obj");
    // Three triangles at one edge: no manifold, which OpenMesh needs.
    write_text(path("pages.obj"), "v 0 0 0\nv 0 0 1\nv 1 0 0\nv 0 1 0\nv -1 -1 0\nf 1 2 3\nf 1 2 4\nf 1 2 5\n");
    const Outcome outcome = bench({"libraries", "ball.obj", "pages.obj", "--json", "-"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const Json report = outcome.json();
    const Json& rows = report["rows"];
    ASSERT_EQ(rows.size(), 12u); // two meshes, as they are and repaired, three clusterers
    EXPECT_EQ(rows[0]["clusterer"], "quadric");
    EXPECT_EQ(rows[0]["triangles"], 1472);
    EXPECT_EQ(rows[0]["bad_edges"], 0);
    EXPECT_GT(rows[0]["error_millionths"], 0);
    EXPECT_LT(rows[0]["error_millionths"], rows[1]["error_millionths"]) << "octree";
    EXPECT_EQ(rows[6]["bad_edges"], 7); // six at the border, one of three triangles
    EXPECT_TRUE(rows[8]["triangles"].is_null()) << "refused";
}

TEST_F(BenchCommandTest, DoesNotWriteOverItsMesh) {
    write_ball("ball.obj");
    const std::string before = read_text(path("ball.obj"));
    for (const char* verb : {"engine", "perception"}) {
        const Outcome outcome = bench({verb, "--quick", "--mesh", "ball.obj", "--json", "ball.obj"});
        EXPECT_EQ(outcome.status, 1) << verb;
        EXPECT_THAT(outcome.err, HasSubstr("ball.obj' is read"));
    }
    EXPECT_EQ(read_text(path("ball.obj")), before);
}

TEST_F(BenchCommandTest, RefusesWrongSizes) {
    for (const std::string sizes : {"", "0", "70k,70k", "70k,1k", "nan", "1e99", "50", "70q"})
        EXPECT_EQ(bench({"engine", "--sizes", sizes}).status, 2) << sizes;
    EXPECT_EQ(bench({}).status, 2);
    EXPECT_EQ(bench({"engine", "--mesh", "missing.ply"}).status, 1);
}

// Who looks for it there is told where it is.
TEST_F(BenchCommandTest, IsAProgramOfItsOwn) {
    EXPECT_THAT(run({"bench", "engine", "--quick"}), fails(2, HasSubstr("unseen-bench")));
    const Outcome help = bench({"--help"});
    EXPECT_EQ(help.status, 0);
    for (const char* verb : {"engine", "perception", "accuracy", "scenes"}) EXPECT_THAT(help.out, HasSubstr(verb));
}

TEST_F(BenchCommandTest, SuggestsWhatWasMeant) {
    EXPECT_THAT(bench({"percetion", "--quick"}).err,
                HasSubstr("unseen-bench: there is no verb 'percetion': did you mean "
                          "'perception'?"));
    EXPECT_THAT(bench({"engine", "--quik"}).err, HasSubstr("did you mean '--quick'?"));
    EXPECT_EQ(bench({"help", "engine"}).out, bench({"engine", "--help"}).out);
}

} // namespace bench_command_test
