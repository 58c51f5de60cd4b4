// Values of vertices from a file to another one, by way of trees, and VTK's files as models.
#include "run_command.h"

namespace values_command_test {

using namespace unseen::app::testing;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class ValuesCommandTest : public CommandTest {
protected:
    // A grid of 15 x 15 vertices with a real value, which is x, a number, and NaN in some places.
    void write_grid(const std::string& name) const {
        constexpr int n = 15;
        std::ostringstream ply;
        ply << "ply\nformat ascii 1.0\nelement vertex " << n * n
            << "\nproperty float x\nproperty float y\nproperty float z\nproperty double height\nproperty int number\n"
               "property float holes\nelement face "
            << 2 * (n - 1) * (n - 1) << "\nproperty list uchar int vertex_indices\nend_header\n";
        for (int i = 0; i < n * n; ++i)
            ply << i % n << ' ' << i / n << " 0 " << i % n << ' ' << 1000 + i << (i % 7 == 0 ? " nan\n" : " 0.5\n");
        for (int y = 0; y + 1 < n; ++y) {
            for (int x = 0; x + 1 < n; ++x) {
                const int v = n * y + x;
                ply << "3 " << v << ' ' << v + 1 << ' ' << v + n << "\n3 " << v + 1 << ' ' << v + n + 1 << ' ' << v + n
                    << '\n';
            }
        }
        write_text(path(name), ply.str());
    }

    Json arrays(const std::string& file) const { return succeed({"info", file, "--json"}).json()["arrays"]; }
};

TEST_F(ValuesCommandTest, GoFromFileToFile) {
    write_grid("in.ply");
    const Json in = arrays("in.ply");
    EXPECT_EQ(in, Json::parse(R"([
        {"name": "height", "type": "float64", "components": 1, "ranges": [[0.0, 14.0]], "not_finite": 0},
        {"name": "number", "type": "int32", "components": 1, "ranges": [[1000.0, 1224.0]], "not_finite": 0},
        {"name": "holes", "type": "float32", "components": 1, "ranges": [[0.5, 0.5]], "not_finite": 33}])"));
    EXPECT_THAT(succeed({"info", "in.ply"}).out, AllOf(HasSubstr("\nvalues 'height': float64, 0 to 14\n"),
                                                       HasSubstr("\nvalues 'number': int32, 1,000 to 1,224\n"),
                                                       HasSubstr("0.5 to 0.5; 33 NaN or infinite\n")));
    succeed({"build", "in.ply", "-o", "grid.vdt", "--no-fold-errors"});
    EXPECT_EQ(arrays("grid.vdt"), in);
    EXPECT_THAT(succeed({"info", "grid.vdt"}).out, HasSubstr("\nvalues 'height': float64, 0 to 14\n"));
    for (const std::string out : {"full.ply", "full.vtp"}) {
        EXPECT_THAT(succeed({"simplify", "grid.vdt", "--full", "-o", out}).err, Not(HasSubstr("left out")));
        EXPECT_EQ(arrays(out), in) << out;
        succeed({"simplify", "grid.vdt", "--triangles", "40", "--fold-test", "extent", "-o", "small-" + out});
    }
    EXPECT_THAT(succeed({"simplify", "grid.vdt", "--full", "-o", "full.glb"}).err,
                HasSubstr("note: full.glb: values of vertices were left out: 'height', 'number' and 'holes'"));
    // NaN does not spread: there are means of the others.
    for (const std::string out : {"small-full.ply", "small-full.vtp"}) {
        const Json small = arrays(out);
        EXPECT_GE(small[0]["ranges"][0][0], 0.0) << out;
        EXPECT_LE(small[0]["ranges"][0][1], 14.0) << out;
        EXPECT_EQ(small[2]["ranges"], in[2]["ranges"]) << out;
        EXPECT_LT(small[2]["not_finite"], 10) << out;
    }
}

TEST_F(ValuesCommandTest, VtkFilesAreModels) {
    write_ball("ball.obj");
    for (const std::string file : {"ball.vtp"}) {
        succeed({"simplify", "ball.obj", "--full", "-o", file});
        EXPECT_EQ(succeed({"info", file, "--json", "--verify"}).json()["triangles"], ball_triangles) << file;
        succeed({"build", file, "-o", "ball.vdt", "--no-fold-errors"});
        EXPECT_EQ(succeed({"info", "ball.vdt", "--json"}).json()["triangles"], ball_triangles) << file;
        EXPECT_THAT(succeed({"make", "subdivide", file, "--times", "1", "-o", "large.ply"}).out,
                    HasSubstr("made 5,888 triangles of 1,472"));
    }
    write_text(path("grid.vtu"), "<VTKFile type=\"UnstructuredGrid\"></VTKFile>");
    EXPECT_THAT(run({"build", "grid.vtu", "-o", "grid.vdt"}),
                fails(1, AllOf(IsAnErrorForPeople(), HasSubstr("Extract Surface"))));
}

TEST_F(ValuesCommandTest, AreKeptInEveryWayOfBuilding) {
    write_grid("in.ply");
    const Json in = arrays("in.ply");
    // A tree that is kept for the next time.
    ::setenv("UNSEEN_CACHE", path("cache").c_str(), 1);
    for (const std::string from : {"built", "cache"}) {
        const Outcome done = succeed({"simplify", "in.ply", "--full", "-o", "out.vtp", "--json", "-"});
        EXPECT_EQ(done.json()["tree"], from);
        EXPECT_EQ(arrays("out.vtp"), in);
    }
    EXPECT_THAT(succeed({"make", "subdivide", "in.ply", "--times", "1", "-o", "large.ply"}).err,
                HasSubstr("values of vertices are left out"));
    EXPECT_THAT(arrays("large.ply"), IsEmpty());
}

} // namespace values_command_test
