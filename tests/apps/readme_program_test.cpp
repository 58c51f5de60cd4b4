// The program in README.md gives what the command gives: the same numbers and the same mesh.
#include "run_command.h"

namespace {

using namespace unseen::app::testing;

class ReadmeProgramTest : public CommandTest {
protected:
    void expect_same_as_command(const std::string& mesh) const {
        const Outcome command = succeed({"simplify", mesh, "-o", "command.ply", "--json", "-"});
        const Json report = command.json();
        const Outcome program = run_program({UNSEEN_README_PROGRAM, mesh, "program.ply"});
        ASSERT_EQ(program.status, 0) << program.err;
        char expected[200];
        std::snprintf(expected, sizeof expected, "%u of %u triangles, imperceptible from %g m\n",
                      report["triangles"].get<unsigned>(), report["source_triangles"].get<unsigned>(),
                      report["imperceptible_from_m"].get<double>());
        EXPECT_EQ(program.out, expected);
        EXPECT_EQ(program.err, "");
        EXPECT_LT(report["triangles"], report["source_triangles"]) << "else nothing is compared";
        EXPECT_TRUE(read_text(path("program.ply")) == read_text(path("command.ply"))) << "the meshes differ";
    }
};

TEST_F(ReadmeProgramTest, SimplifiesTheBunnyAsTheCommandDoes) {
    const std::string bunny = "/usr/share/glmark2/models/bunny.obj"; // of Debian's glmark2-data
    if (!fs::exists(bunny)) GTEST_SKIP() << "there is no " << bunny;
    expect_same_as_command(bunny);
}

TEST_F(ReadmeProgramTest, SimplifiesATexturedMeshAsTheCommandDoes) {
    // A dense square, one half of it a little brighter.
    std::ostringstream obj;
    constexpr int n = 60;
    obj << "mtllib square.mtl\n";
    for (int i = 0; i <= n; ++i)
        for (int k = 0; k <= n; ++k)
            obj << "v " << k / double(n) << ' ' << i / double(n) << " 0\nvt " << k / double(n) << ' ' << i / double(n)
                << '\n';
    obj << "usemtl paint\n";
    const auto corner = [&](int i, int k) {
        const std::string number = std::to_string(i * (n + 1) + k + 1);
        return ' ' + number + '/' + number;
    };
    for (int i = 0; i < n; ++i)
        for (int k = 0; k < n; ++k)
            obj << "f" << corner(i, k) << corner(i, k + 1) << corner(i + 1, k + 1) << corner(i + 1, k) << '\n';
    write_text(path("square.obj"), obj.str());
    write_text(path("square.mtl"), "newmtl paint\nKd 1 1 1\nmap_Kd image.pfm\n");
    const float texels[] = {0.5f, 0.55f}; // one row
    write_text(path("image.pfm"),
               "Pf\n2 1\n-1.0\n" + std::string(reinterpret_cast<const char*>(texels), sizeof texels));
    expect_same_as_command("square.obj");
}

TEST_F(ReadmeProgramTest, TellsWhatIsWrong) {
    EXPECT_EQ(run_program({UNSEEN_README_PROGRAM}).status, 2);
    const Outcome missing = run_program({UNSEEN_README_PROGRAM, "missing.ply", "out.ply"});
    EXPECT_EQ(missing.status, 1);
    EXPECT_THAT(missing.err, ::testing::HasSubstr("missing.ply"));
}

} // namespace
