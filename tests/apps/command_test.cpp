// The verbs that need no GPU, and what all verbs have in common: exit status, errors, files.

#include "mesh_files.h"
#include "run_command.h"
#include "tree_file.h"

namespace command_test {

using namespace unseen::app::testing;

class UsageTest : public CommandTest {};
class BuildTest : public CommandTest {};
class MakeTest : public CommandTest {};
class InfoTest : public CommandTest {};
class SimplifyTest : public CommandTest {
protected:
    void SetUp() override {
        CommandTest::SetUp();
        build_ball();
    }
    Json simplify(Words more, const std::string& out = "out.ply") {
        const Json report = succeed(joined({"simplify", "ball.vdt", "-o", out, "--json", "-"}, more)).json();
        expect_cut_report(report);
        return report;
    }
    Json info(const std::string& file) {
        const Outcome outcome = succeed({"info", file, "--json"});
        return outcome.json();
    }
};

TEST_F(UsageTest, EveryVerbHasHelpWithExamples) {
    const Outcome top = succeed({"--help"});
    for (const std::string verb :
         {"build", "info", "simplify", "render", "fly", "levels", "sheet", "view", "compare", "csf", "make"}) {
        EXPECT_THAT(top.out, HasSubstr("\n  " + verb + " ")) << top.out;
        const Outcome help = succeed({verb, "--help"});
        EXPECT_THAT(help.out, AllOf(HasSubstr("Examples:"), HasSubstr("unseen " + verb))) << verb;
        EXPECT_EQ(help.err, "");
    }
}

TEST_F(UsageTest, SaysItsVersion) {
    EXPECT_THAT(succeed({"--version"}).out,
                ::testing::MatchesRegex("unseen [0-9]+\\.[0-9]+\\.[0-9]+\n(With CGAL's .* GPL.*\n)?"));
}

TEST_F(UsageTest, WrongUsageIsStatusTwoAndLeavesNothing) {
    write_ball("ball.obj");
    const std::vector<Words> wrong = {
        {},
        {"frobnicate"},
        {"--frobnicate"},
        {"build"},
        {"build", "ball.obj"},
        {"build", "ball.obj", "-o", "ball.ply"},
        {"build", "ball.obj", "-o", "ball.vdt", "--clusterer", "kmeans"},
        {"build", "ball.obj", "-o", "ball.vdt", "--threads", "0"},
        {"build", "ball.obj", "-o", "ball.vdt", "--threads", "-1"},
        {"build", "ball.obj", "-o", "ball.vdt", "extra"},
        {"info"},
        {"info", "ball.obj", "--frobnicate"},
        {"simplify", "ball.obj", "-o", "out.xyz"},
        {"simplify", "ball.obj", "-o", "out.ply", "--eye", "1", "2"},
        {"simplify", "ball.obj", "-o", "out.ply", "--eye", "nan", "0", "0"},
        {"simplify", "ball.obj", "-o", "out.ply", "--eye", "1", "inf", "0"},
        {"simplify", "ball.obj", "-o", "out.ply", "--eye", "1e999", "0", "0"},
        {"simplify", "ball.obj", "-o", "out.ply", "--eye", "0", "0", "5", "--direction", "0", "0", "1"},
        {"simplify", "ball.obj", "-o", "out.ply", "--eye", "0", "0", "5", "--target", "0", "0", "5"},
        {"simplify", "ball.obj", "-o", "out.ply", "--target", "0", "0", "5"},
        {"simplify", "ball.obj", "-o", "out.ply", "--direction", "0", "0", "0"},
        {"simplify", "ball.obj", "-o", "out.ply", "--fill", "0"},
        {"simplify", "ball.obj", "-o", "out.ply", "--fov", "180"},
        {"simplify", "ball.obj", "-o", "out.ply", "--size", "0x100"},
        {"simplify", "ball.obj", "-o", "out.ply", "--size", "0"},
        {"simplify", "ball.obj", "-o", "out.ply", "--full", "--fold-test", "error"},
        {"simplify", "picture.png", "-o", "out.ply"},
        {"csf", "--frequency", "4", "--luminance", "1", "--light", "1", "0", "0"},
        {"compare", "a.png", "b.png", "--light", "1", "0", "0"},
        {"info", "ball.obj", "--size", "512"},
        {"simplify", "ball.obj", "-o", "out.ply", "--size", "100000x100"},
        {"simplify", "ball.obj", "-o", "out.ply", "--ambient", "1.5"},
        {"simplify", "ball.obj", "-o", "out.ply", "--unit", "0"},
        {"simplify", "ball.obj", "-o", "out.ply", "--ppd", "-30"},
        {"simplify", "ball.obj", "-o", "out.ply", "--distance", "nan"},
        {"simplify", "ball.obj", "-o", "out.ply", "--triangles", "-1"},
        {"simplify", "ball.obj", "-o", "out.ply", "--triangles", "0"},
        {"simplify", "ball.obj", "-o", "out.ply", "--triangles", "1.5"},
        {"simplify", "ball.obj", "-o", "out.ply", "--pixels", "0"},
        {"simplify", "ball.obj", "-o", "out.ply", "--full", "--triangles", "5"},
        {"simplify", "ball.obj", "-o", "out.ply", "--pixels", "1", "--fold-test", "luebke-hallen"},
        {"simplify", "ball.obj", "-o", "out.ply", "--fold-test", "extent"},
        {"simplify", "ball.obj", "-o", "out.ply", "--fold-test", "guess"},
        {"simplify", "ball.obj", "-o", "out.ply", "--gaze", "1"},
        {"compare", "a.png"},
        {"compare", "a.png", "b.png", "--model", "rpg99", "--gaze", "1", "1"},
        {"make"},
        {"make", "ball.obj"},
        {"make", "subdivide"},
        {"make", "subdivide", "ball.obj", "-o", "out.ply"},
        {"make", "subdivide", "ball.obj", "-o", "out.ply", "--times", "-1"},
        {"make", "subdivide", "ball.obj", "-o", "out.ply", "--times", "1", "--triangles", "5000"},
        {"make", "subdivide", "ball.obj", "-o", "out.ply", "--times", "1", "--noise", "2"},
        {"make", "subdivide", "ball.obj", "-o", "out.vdt", "--times", "1"},
        {"csf", "--frequency", "4"},
        {"csf", "--frequency", "0", "--luminance", "1"},
    };
    for (const auto& words : wrong) {
        const Outcome outcome = run(words);
        const std::string shown = ::testing::PrintToString(words) + "\n" + outcome.err;
        EXPECT_EQ(outcome.status, 2) << shown;
        EXPECT_EQ(outcome.out, "") << shown;
        EXPECT_EQ(outcome.err.rfind("unseen: ", 0), 0U) << shown;
        EXPECT_THAT(files(), ElementsAre("ball.obj")) << shown;
    }
}

TEST_F(UsageTest, TakesNegativeNumbersWithoutLeadingZero) {
    write_ball("ball.obj", 6, 8);
    succeed({"simplify", "ball.obj", "-o", "o.ply", "--eye", "-4", "-.5", "-1e0", "--gaze", "-.5", "-30", "--full"});
}

TEST_F(UsageTest, BadInputIsStatusOneWithOneSentenceAndLeavesNothing) {
    build_ball();
    const std::string tree = read_text(path("ball.vdt"));
    write_text(path("empty.ply"), "");
    write_text(path("noise.vdt"), "this is no tree");
    write_text(path("cut.vdt"), tree.substr(0, tree.size() / 2));
    std::string flipped = tree;
    flipped[flipped.size() / 2] = static_cast<char>(flipped[flipped.size() / 2] ^ 0x10);
    write_text(path("flipped.vdt"), flipped);
    write_text(path("nan.obj"), "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n");
    write_text(path("range.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    write_text(path("points.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    write_text(path("lines.obj"), "v 0 0 0\nv 1 0 0\nf 1 2 2\n");
    write_text(path("display.json"), "{\"width_px\": -5}");
    const auto before = files();
    const std::vector<Words> bad = {
        {"build", "missing.ply", "-o", "o.vdt"},
        {"build", "empty.ply", "-o", "o.vdt"},
        {"build", "nan.obj", "-o", "o.vdt"},
        {"build", "range.obj", "-o", "o.vdt"},
        {"build", "points.obj", "-o", "o.vdt"},
        {"build", "lines.obj", "-o", "o.vdt"},
        {"build", "ball.vdt", "-o", "o.vdt"},
        {"build", "ball.obj", "-o", "ball.obj/o.vdt"},
        {"build", ".", "-o", "o.vdt"},
        {"info", "missing.vdt"},
        {"info", "noise.vdt"},
        {"info", "cut.vdt"},
        {"info", "flipped.vdt", "--verify"},
        {"info", "empty.ply", "--json"},
        {"simplify", "cut.vdt", "-o", "o.ply"},
        {"simplify", "flipped.vdt", "-o", "o.ply", "--json", "o.json"},
        {"simplify", "ball.vdt", "-o", "ball.obj/o.ply", "--json", "o.json"},
        {"simplify", "ball.vdt", "-o", "o.ply", "--json", "ball.obj/o.json"},
        {"simplify", "ball.vdt", "-o", "o.ply", "--display", "display.json"},
        {"simplify", "ball.vdt", "-o", "o.ply", "--csf", "display.json"},
        {"simplify", "ball.vdt", "-o", "o.ply", "--peak", "0.1"},
        {"simplify", "ball.vdt", "-o", "o.ply", "--background", "1000"},
        {"simplify", "ball.vdt", "-o", "o.ply", "--direction", "0", "0", "1", "--up", "0", "0", "2"},
        {"compare", "missing.png", "ball.obj"},
        {"compare", "ball.obj", "ball.obj", "--json", "o.json", "--map", "o.png"},
    };
    for (const auto& words : bad) {
        const Outcome outcome = run(words);
        const std::string shown = ::testing::PrintToString(words) + "\n" + outcome.err;
        EXPECT_EQ(outcome.status, 1) << shown;
        EXPECT_EQ(outcome.out, "") << shown;
        EXPECT_THAT(outcome.err, IsAnErrorForPeople()) << shown;
        EXPECT_EQ(files(), before) << shown;
    }
}

TEST_F(UsageTest, DoesNotOverwriteItsInput) {
    build_ball();
    const std::string tree = read_text(path("ball.vdt")), mesh = read_text(path("ball.obj"));
    EXPECT_EQ(run({"simplify", "ball.obj", "-o", "./ball.obj"}).status, 1);
    EXPECT_EQ(run({"build", "ball.vdt", "-o", "ball.vdt"}).status, 1);
    const fs::path link = path("link.obj");
    fs::create_symlink("ball.obj", link);
    EXPECT_EQ(run({"simplify", "ball.vdt", "-o", "o.obj", "--json", "ball.vdt"}).status, 1);
    EXPECT_EQ(run({"simplify", "ball.obj", "-o", "link.obj"}).status, 1);
    EXPECT_EQ(run({"make", "subdivide", "ball.obj", "--times", "1", "-o", "o.obj", "--json", "ball.obj"}).status, 1);
    fs::remove(link);
    EXPECT_FALSE(fs::exists(path("o.obj")));
    EXPECT_EQ(read_text(path("ball.obj")), mesh);
    EXPECT_TRUE(read_text(path("ball.vdt")) == tree);
}

TEST_F(UsageTest, TwoOutputsAreTwoFiles) {
    build_ball();
    const auto before = files();
    for (const std::string json : {"o.ply", "./o.ply"}) {
        EXPECT_THAT(run({"simplify", "ball.vdt", "-o", "o.ply", "--json", json}),
                    fails(1, AllOf(IsAnErrorForPeople(), HasSubstr("two outputs"))));
        EXPECT_EQ(files(), before);
    }
}

TEST_F(UsageTest, SubVerbsHaveHelpWithExamples) {
    const Outcome help = succeed({"make", "subdivide", "--help"});
    EXPECT_THAT(help.out, AllOf(HasSubstr("Examples:"), HasSubstr("unseen make subdivide"), HasSubstr("--noise")));
    EXPECT_THAT(run({"make", "subdivide"}).err, HasSubstr("'unseen make subdivide --help'"));
}

TEST_F(MakeTest, SubdividedMeshesStayClosed) {
    write_ball("ball.obj", 6, 8); // 80 triangles
    const Outcome twice = succeed({"make", "subdivide", "ball.obj", "-o", "twice.ply", "--times", "2", "--json", "-"});
    EXPECT_EQ(twice.json()["source_triangles"], 80);
    EXPECT_EQ(twice.json()["triangles"], 1280);
    EXPECT_EQ(twice.json()["vertices"], 642) << "Euler: 2 + half the triangles";
    const Outcome some = succeed({"make", "subdivide", "ball.obj", "-o", "some.ply", "--triangles", "1000"});
    EXPECT_THAT(some.out, HasSubstr("made 1,000 triangles of 80, with 502 vertices\nwrote some.ply ("));
    for (const std::string name : {"twice", "some"}) {
        ASSERT_EQ(run({"build", name + ".ply", "-o", name + ".vdt"}).status, 0);
        EXPECT_EQ(run({"info", name + ".vdt", "--json"}).json()["closed"], true) << name;
    }
}

TEST_F(MakeTest, SaysWhatCannotBe) {
    write_ball("ball.obj", 6, 8);
    EXPECT_THAT(run({"make", "subdivide", "ball.obj", "-o", "out.ply", "--triangles", "10"}),
                fails(1, HasSubstr("80 triangles already")));
    EXPECT_EQ(run({"make", "subdivide", "ball.obj", "-o", "ball.obj", "--times", "1"}).status, 1);
    EXPECT_EQ(run({"make", "subdivide", "missing.obj", "-o", "out.ply", "--times", "1"}).status, 1);
    EXPECT_THAT(files(), ElementsAre("ball.obj"));
}

TEST_F(BuildTest, ReportsATreeWithEitherClusterer) {
    write_ball("ball.obj");
    for (const std::string clusterer : {"quadric", "octree"}) {
        const Outcome built = succeed({"build", "ball.obj", "-o", "t.vdt", "--clusterer", clusterer, "--json", "-"});
        EXPECT_EQ(built.err, "") << "quiet in pipes";
        const Json report = built.json();
        EXPECT_EQ(report["vertices"], ball_vertices);
        EXPECT_EQ(report["triangles"], ball_triangles);
        EXPECT_EQ(report["dropped"], 0);
        EXPECT_GT(report["nodes"], ball_vertices);
        EXPECT_GT(report["bytes"], 0);
        const Outcome verified = succeed({"info", "t.vdt", "--verify", "--json"});
        EXPECT_EQ(verified.json()["closed"], true);
    }
}

bool is_missing(const Outcome& outcome) { return outcome.err.find("for it was made without") != std::string::npos; }

TEST_F(BuildTest, TakesOpenMeshsDecimater) {
    write_ball("ball.obj");
    const Outcome built = run({"build", "ball.obj", "-o", "t.vdt", "--clusterer", "openmesh", "--json", "-"});
    if (is_missing(built)) GTEST_SKIP() << built.err;
    ASSERT_EQ(built.status, 0) << built.err;
    EXPECT_EQ(built.json()["triangles"], ball_triangles);
    EXPECT_EQ(run({"info", "t.vdt", "--verify"}).status, 0);
    write_text(path("pages.obj"), "v 0 0 0\nv 0 0 1\nv 1 0 0\nv 0 1 0\nv -1 -1 0\nf 1 2 3\nf 1 2 4\nf 1 2 5\n");
    EXPECT_THAT(run({"build", "pages.obj", "-o", "p.vdt", "--clusterer", "openmesh"}), fails(1, HasSubstr("manifold")));
    EXPECT_THAT(files(), Not(::testing::Contains("p.vdt")));
}

TEST_F(BuildTest, RepairsWhereAsked) {
    // A cube of which one square faces inward and another one is not there.
    write_text(path("box.obj"), "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
                                "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 4 8 7 3\nf 2 6 7 3\n");
    const Outcome built = run({"build", "box.obj", "-o", "box.vdt", "--repair", "--largest-hole", "1", "--json", "-"});
    if (is_missing(built)) GTEST_SKIP() << built.err;
    ASSERT_EQ(built.status, 0) << built.err;
    const Json report = built.json();
    EXPECT_EQ(report["triangles"], 12);
    EXPECT_EQ(report["repair"]["turned_triangles"], 2);
    EXPECT_EQ(report["repair"]["capped_holes"], 1);
    const Outcome info = succeed({"info", "box.vdt", "--verify", "--exact", "--json"});
    const Json found = info.json();
    EXPECT_EQ(found["closed"], true);
    EXPECT_GT(found["verified_exactly"]["comparisons"], 0);
    const Outcome plain = run({"build", "box.obj", "-o", "plain.vdt"});
    EXPECT_THAT(plain.out, Not(HasSubstr("repaired")));
    EXPECT_EQ(run({"build", "box.obj", "-o", "b.vdt", "--largest-hole", "0.5"}).status, 2) << "without --repair";
    EXPECT_EQ(run({"build", "box.obj", "-o", "b.vdt", "--repair", "--stitch", "0.5"}).status, 2);
    EXPECT_EQ(run({"info", "box.vdt", "--exact"}).status, 2) << "without --verify";
    EXPECT_THAT(run({"info", "box.obj", "--verify", "--exact"}), fails(1, HasSubstr("is no tree")));
}

TEST_F(BuildTest, TheTreeDoesNotDependOnTheThreads) {
    write_ball("ball.obj");
    ASSERT_EQ(run({"build", "ball.obj", "-o", "one.vdt", "--threads", "1"}).status, 0);
    ASSERT_EQ(run({"build", "ball.obj", "-o", "two.vdt", "--threads", "2"}).status, 0);
    EXPECT_TRUE(read_text(path("one.vdt")) == read_text(path("two.vdt")));
}

TEST_F(BuildTest, LeavesOutBadFacesWhereAsked) {
    write_text(path("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 1 0\nf 1 2 3\nf 2 4 3\nf 1 2 9\n");
    EXPECT_THAT(run({"build", "m.obj", "-o", "m.vdt"}),
                fails(1, AllOf(HasSubstr("line 4: vertex 4"), HasSubstr("line 7: face 3"), HasSubstr("--skip-bad"))));
    EXPECT_THAT(succeed({"build", "m.obj", "-o", "m.vdt", "--skip-bad"}).err, HasSubstr("2 faces were left out"));
    EXPECT_EQ(run({"info", "m.vdt", "--json"}).json()["triangles"], 1);
    EXPECT_EQ(run({"make", "subdivide", "m.obj", "-o", "n.ply", "--times", "1", "--skip-bad"}).status, 0);
}

TEST_F(BuildTest, WeldsStlUnlessAskedNotTo) {
    write_text(path("m.stl"), "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
                              "endloop\nendfacet\nfacet normal 0 1 1\nouter loop\nvertex 1 0 0\nvertex 1 1 0\n"
                              "vertex 0 1 0\nendloop\nendfacet\nendsolid\n"); // not the normal of its face
    const Outcome welded = run({"build", "m.stl", "-o", "m.vdt"});
    EXPECT_THAT(welded.err, AllOf(HasSubstr("6 vertices"), HasSubstr("welded to 4"), HasSubstr("--no-weld")));
    EXPECT_EQ(run({"info", "m.vdt", "--json"}).json()["vertices"], 4);
    ASSERT_EQ(run({"build", "m.stl", "-o", "m.vdt", "--no-weld"}).status, 0);
    EXPECT_EQ(run({"info", "m.vdt", "--json"}).json()["vertices"], 6);
}

TEST_F(BuildTest, RefusesCreasesThatAreNoAngleOrComeTooLate) {
    write_text(path("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    for (const char* bad : {"-1", "181", "nan", "soft", "30deg"})
        EXPECT_THAT(run({"build", "m.obj", "-o", "m.vdt", "--crease", bad}),
                    fails(2, HasSubstr("--crease must be smooth or an angle from 0 to 180 degrees")))
            << bad;
    ASSERT_EQ(run({"build", "m.obj", "-o", "m.vdt", "--crease", "smooth"}).status, 0);
    EXPECT_THAT(run({"simplify", "m.vdt", "-o", "o.ply", "--crease", "30"}),
                fails(1, AllOf(HasSubstr("m.vdt is a tree"), HasSubstr("Give --crease with the mesh"))));
}

TEST_F(BuildTest, RefusesProtectionThatIsNoneOrComesTooLate) {
    write_text(path("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl 'red'\nf 1 2 3\nusemtl blue\nf 1 3 2\n");
    write_text(path("few.txt"), "1\n0\n");
    write_text(path("bad.txt"), "1\n0\n1.5\n");
    const auto build = [&](const std::string& what) {
        return run({"build", "m.obj", "-o", "m.vdt", "--protect", what});
    };
    for (const char* bad : {"borders:0.5", "material=blue:-1", "few.txt:1001", "borders:nan"})
        EXPECT_THAT(build(bad), fails(2, HasSubstr("must be from 1 to 1000"))) << bad;
    EXPECT_THAT(build("material=blu"),
                fails(1, HasSubstr("m.obj: --protect: there is no material 'blu'; there are ''red'', 'blue'.")));
    EXPECT_THAT(build("nowhere.txt"), fails(1, HasSubstr("'nowhere.txt': there is no such file")));
    EXPECT_THAT(build(path("few.txt").string()), fails(1, HasSubstr("few.txt has 2 numbers for 3 vertices")));
    EXPECT_THAT(build(path("bad.txt").string()), fails(1, HasSubstr("bad.txt:3: '1.5' must be a number from 0 to 1")));
    ASSERT_EQ(build("material=blue").status, 0);
    EXPECT_THAT(run({"simplify", "m.vdt", "-o", "o.ply", "--lock-borders"}),
                fails(1, AllOf(HasSubstr("m.vdt is a tree"), HasSubstr("Give --protect with the mesh"))));
}

TEST_F(BuildTest, SaysWhereHardEdgesComeFrom) {
    const std::string box = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n",
                      faces = "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    write_text(path("box.obj"), box + faces);
    write_text(path("round.obj"), box + "s 1\n" + faces);
    const auto creases = [&](const Words& words, const std::string& text) {
        Words all = {"build", "-o", "b.vdt", "--verbose"};
        all.insert(all.end(), words.begin(), words.end());
        EXPECT_THAT(succeed(all).out, HasSubstr(text));
        const Outcome info = succeed({"info", "b.vdt"});
        EXPECT_THAT(info.out, HasSubstr(text));
        const Json json = run({"info", "b.vdt", "--json"}).json();
        return std::tuple(json["creases"], json["vertices"].get<int>());
    };
    EXPECT_EQ(creases({"box.obj"}, "above 30 degrees, as its edges suggest"),
              std::tuple(Json({{"source", "rule"}, {"degrees", 30}}), 24));
    EXPECT_EQ(creases({"box.obj", "--crease", "95"}, "above 95 degrees, as asked"),
              std::tuple(Json({{"source", "asked"}, {"degrees", 95}}), 8));
    EXPECT_EQ(creases({"box.obj", "--crease", "smooth"}, "none, as asked"),
              std::tuple(Json({{"source", "asked"}, {"degrees", 180}}), 8));
    EXPECT_EQ(creases({"round.obj"}, "as the mesh says"),
              std::tuple(Json({{"source", "file"}, {"degrees", nullptr}}), 8));
}

TEST_F(BuildTest, TreesOfAnEarlierVersionAreRefused) {
    using unseen::support::TreeFile;
    build_ball();
    std::string bytes = read_text(path("ball.vdt"));
    unseen::support::store(bytes, TreeFile::version_at, std::uint32_t{6});
    TreeFile::seal(bytes);
    write_text(path("old.vdt"), bytes);
    for (const Words& words : {Words{"simplify", "old.vdt", "-o", "x.obj"}, {"info", "old.vdt"}})
        EXPECT_THAT(run(words), fails(1, AllOf(IsAnErrorForPeople(), HasSubstr("old.vdt was written by an earlier"),
                                               HasSubstr("unseen build MESH -o FILE"))));
    EXPECT_FALSE(fs::exists(path("x.obj")));
}

TEST_F(InfoTest, SaysWhatIsUnusualAboutAMesh) {
    write_text(path("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv nan 1 0\nf 1 2 3\nf 2 3 4\nf 2 5 3\n");
    const Json found = run({"info", "m.obj", "--json"}).json()["examination"];
    EXPECT_EQ(found["boundary_edges"], 4);
    EXPECT_EQ(found["inconsistent_edges"], 1);
    EXPECT_EQ(found["bad_vertices"], 1);
    EXPECT_EQ(found["components"], 1);
    EXPECT_EQ(found["high"], Json({1, 1, 0}));
    const Outcome table = run({"info", "m.obj"});
    EXPECT_THAT(table.out, AllOf(HasSubstr("\nboundary edges: 4: open"), HasSubstr("\ninconsistent edges: 1: "),
                                 Not(HasSubstr("duplicate")), HasSubstr("1 m, or 0.001 m with --unit 0.001")));
    EXPECT_THAT(run({"info", "m.obj", "--verbose"}).out, HasSubstr("\nduplicate triangles: 0\n"));
    EXPECT_EQ(run({"info", "m.obj", "--verify"}).status, 1);
    write_ball("ball.obj");
    EXPECT_THAT(run({"info", "ball.obj"}).out, HasSubstr("nothing unusual"));
}

// In every format with normals and texture coordinates: also in reports, and where the tree comes from the cache.
TEST_F(InfoTest, CountsNormalsAndTextureCoordinatesThatAreNotFinite) {
    write_text(path("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt nan 0\nvt 0 inf\nvn 0 0 1\nvn 0 nan 1\n"
                              "f 1/1/1 2/2/1 3/3/2\n");
    write_text(path("m.ply"), "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
                              "float z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float s\n"
                              "property float t\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
                              "0 0 0 0 0 1 0 0\n1 0 0 0 0 1 nan 0\n0 1 0 0 -inf 1 0 inf\n3 0 1 2\n");
    Json gltf = Json::parse(mesh_files::gltf_triangle_json(R"([{"mesh":0}])", R"({"byteLength":128})"));
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const std::string data = mesh_files::gltf_triangle_data() + std::string(2, '\0') +
                             mesh_files::floats(0, 0, 1, 0, 0, 1, 0, nan, 1) + // normals
                             mesh_files::floats(0, 0, nan, 0, 0, 1) +          // the first coordinates
                             mesh_files::floats(0, 0, 1, 0, 0, -INFINITY);     // the second ones
    for (const auto& [name, type, at, size] :
         {std::tuple("NORMAL", "VEC3", 44, 36), {"TEXCOORD_0", "VEC2", 80, 24}, {"TEXCOORD_1", "VEC2", 104, 24}}) {
        gltf["meshes"][0]["primitives"][0]["attributes"][name] = gltf["accessors"].size();
        gltf["accessors"].push_back(
            {{"bufferView", gltf["bufferViews"].size()}, {"componentType", 5126}, {"count", 3}, {"type", type}});
        gltf["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", at}, {"byteLength", size}});
    }
    write_text(path("m.glb"), mesh_files::glb(gltf.dump(), data));
    for (const std::string file : {"m.obj", "m.ply", "m.glb"})
        for (const Words& words : {Words{"info", file},
                                   {"simplify", file, "-o", "o" + file, "--triangles", "1"},
                                   {"simplify", file, "-o", "again" + file, "--triangles", "1"}}) {
            const auto tells = AllOf(HasSubstr("1 normal was zero, missing or not finite and computed from the faces"),
                                     HasSubstr("2 texture coordinates were not finite and set to 0, the first that of "
                                               "vertex 1."));
            EXPECT_THAT(succeed(words).err, tells) << file;
            const Json report =
                succeed(joined(words, words[0] == "info" ? Words{"--json"} : Words{"--json", "-"})).json();
            EXPECT_THAT(report["warnings"].dump(), tells) << file;
            if (words[0] == "info") continue;
            EXPECT_FALSE(succeed({"info", words[3], "--json"}).json().contains("warnings"))
                << "what is written is finite";
        }
}

TEST_F(BuildTest, RemembersDroppedTriangles) {
    write_text(path("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 1 2\nf 3 2 3\n");
    ASSERT_EQ(run({"build", "m.obj", "-o", "m.vdt"}).status, 0);
    for (const std::string file : {"m.obj", "m.vdt"}) {
        const Json info = run({"info", file, "--json"}).json();
        EXPECT_EQ(info["triangles"], 1) << file;
        EXPECT_EQ(info["dropped"], 2) << file;
    }
    const Json report = run({"simplify", "m.vdt", "-o", "o.ply", "--full", "--json", "-"}).json();
    EXPECT_EQ(report["source_triangles"], 1);
    EXPECT_EQ(report["dropped"], 2);
}

TEST_F(BuildTest, ColoursAreReflectanceUnlessTheyArePrelit) {
    // The ball in greys that a light from +x made.
    std::istringstream ball(read_text(write_ball("grey.obj")));
    std::ostringstream shaded;
    for (std::string line; std::getline(ball, line);) {
        shaded << line;
        double x = 0;
        if (std::sscanf(line.c_str(), "v %lf", &x) == 1) {
            const double grey = 0.3 + 0.6 * std::clamp(x, 0.0, 1.0);
            shaded << ' ' << grey << ' ' << grey << ' ' << grey;
        }
        shaded << '\n';
    }
    write_text(path("shaded.obj"), shaded.str());

    const Outcome lit = run({"build", "shaded.obj", "-o", "lit.vdt"}),
                  prelit = run({"build", "shaded.obj", "-o", "prelit.vdt", "--prelit"});
    EXPECT_EQ(lit.status + prelit.status, 0) << lit.err << prelit.err;
    EXPECT_THAT(lit.err, AllOf(HasSubstr("a light from 1 "), HasSubstr("%"), HasSubstr("if so, use --prelit")));
    EXPECT_EQ(prelit.err, "");
    EXPECT_EQ(run({"info", "lit.vdt", "--json"}).json()["prelit"], false);
    EXPECT_EQ(run({"info", "prelit.vdt", "--json"}).json()["prelit"], true);
    EXPECT_THAT(run({"info", "lit.vdt"}).out, HasSubstr("reflectance"));
    EXPECT_THAT(run({"info", "prelit.vdt"}).out, HasSubstr("pre-lit"));

    const auto is_prelit = [&](Words words) {
        return effect_named(
                   run(joined({"simplify", "shaded.obj", "-o", "o.ply", "--full", "--json", "-"}, words)).json(),
                   "pre-lit colours")["on"]
            .get<bool>();
    };
    EXPECT_FALSE(is_prelit({}));
    EXPECT_TRUE(is_prelit({"--prelit"}));
    EXPECT_THAT(run({"simplify", "lit.vdt", "-o", "o.ply", "--prelit"}),
                fails(1, AllOf(IsAnErrorForPeople(), HasSubstr("decided when it was built"))));
    EXPECT_THAT(run({"simplify", "shaded.obj", "-o", "o.ply", "--prelit", "--ambient", "0.3"}),
                fails(2, HasSubstr("--prelit and --ambient exclude each other")));
}

TEST_F(InfoTest, HasTheStableKeys) {
    build_ball();
    for (const std::string file : {"ball.obj", "ball.vdt"}) {
        const Json info = succeed({"info", file, "--json"}).json();
        EXPECT_EQ(info["vertices"], ball_vertices);
        EXPECT_EQ(info["triangles"], ball_triangles);
        EXPECT_TRUE(info["dropped"].is_number_unsigned());
        EXPECT_TRUE(info["bytes"].is_number_unsigned());
        EXPECT_EQ(info["nodes"].is_null(), file == "ball.obj");
        EXPECT_THAT(succeed({"info", file}).out, HasSubstr("triangles"));
    }
}

TEST_F(SimplifyTest, TheMeshHasTheReportedTriangles) {
    for (const std::string out : {"out.ply", "out.obj", "out.glb"}) {
        const Json report = simplify({"--triangles", "300"}, out);
        EXPECT_EQ(report["source_triangles"], ball_triangles);
        EXPECT_EQ(report["dropped"], 0);
        EXPECT_THAT(report["triangles"].get<int>(), AllOf(Ge(250), Le(300)));
        EXPECT_GT(report["node_tests"], 0);
        EXPECT_TRUE(report["draw_ms"].is_null());
        EXPECT_EQ(info(out)["triangles"], report["triangles"]) << out;
    }
}

TEST_F(SimplifyTest, FullIsTheInput) {
    const Json report = simplify({"--full"});
    EXPECT_EQ(report["triangles"], ball_triangles);
    EXPECT_EQ(report["max_fold_cost"], 0.0);
    EXPECT_EQ(report["imperceptible_from_m"], 0.0);
    const Json mesh = info("out.ply");
    EXPECT_EQ(mesh["triangles"], ball_triangles);
    EXPECT_EQ(mesh["vertices"], ball_vertices);
}

TEST_F(SimplifyTest, TheImperceptibleDistanceIsTheDisplaysTimesTheCost) {
    const Json near = simplify({"--triangles", "300", "--distance", "0.5", "--ppd", "34"});
    ASSERT_TRUE(near["max_fold_cost"].is_number());
    EXPECT_GT(near["max_fold_cost"], 1);
    EXPECT_NEAR(near["imperceptible_from_m"].get<double>(), 0.5 * near["max_fold_cost"].get<double>(), 1e-9);
    EXPECT_EQ(effect_named(near, "imperceptible distance")["on"], true);
    // Twice as far away with as many pixels a degree, the picture is the same.
    const Json far = simplify({"--triangles", "300", "--distance", "1", "--ppd", "34"});
    EXPECT_NEAR(far["imperceptible_from_m"].get<double>(), 2 * near["imperceptible_from_m"].get<double>(), 1e-6);
    EXPECT_EQ(far["triangles"], near["triangles"]);
}

TEST_F(SimplifyTest, ImperceptibleCutsKeepMoreNearTheGaze) {
    const Json anywhere = simplify({});
    EXPECT_EQ(effect_named(anywhere, "gaze")["on"], false);
    EXPECT_TRUE(anywhere["max_fold_cost"] <= 1);
    const Json beside = simplify({"--gaze", "3000", "512"});
    EXPECT_EQ(effect_named(beside, "gaze")["on"], true);
    EXPECT_LT(beside["triangles"], anywhere["triangles"]);
}

TEST_F(SimplifyTest, TheSafeTestKeepsNoLess) {
    const Json plain = simplify({"--fold-test", "luebke-hallen"}),
               safe = simplify({"--fold-test", "luebke-hallen-safe"});
    EXPECT_GE(safe["triangles"], plain["triangles"]);
    EXPECT_THAT(effect_named(safe, "fold test")["why"], HasSubstr("luebke-hallen-safe"));
    EXPECT_TRUE(safe["max_fold_cost"] <= 1);
}

TEST_F(SimplifyTest, TheDefaultTestGoesByErrorsWhereTheseKnowTheScene) {
    const auto fold_test = [](const Json& report) {
        return effect_named(report, "fold test")["why"].get<std::string>();
    };
    EXPECT_THAT(fold_test(simplify({})), StartsWith("error"));
    write_text(path("lights.json"),
               R"({"ambient": 0.2, "lights": [{"type": "directional", "direction": [0, 0, 1], "intensity": 0.8}]})");
    EXPECT_THAT(fold_test(simplify({"--lights", "lights.json"})),
                AllOf(StartsWith("error:"), HasSubstr("from whichever side the lights come")));
    write_text(path("shiny.json"), R"({"ambient": 0.2, "material": {"specular": 0.3, "shininess": 20},
                "lights": [{"type": "directional", "direction": [0, 0, 1], "intensity": 0.8}]})");
    EXPECT_THAT(fold_test(simplify({"--lights", "shiny.json"})),
                AllOf(StartsWith("luebke-hallen-safe:"), HasSubstr("knows highlights in single pictures alone")));
    write_text(path("turning.json"), R"({"ambient": 0.2, "lights": [{"type": "directional", "direction": [0, 0, 1],
                "intensity": 0.8, "orbit": {"axis": [0, 1, 0], "degrees_per_second": 10}}]})");
    EXPECT_THAT(fold_test(simplify({"--lights", "turning.json"})),
                AllOf(StartsWith("error:"), HasSubstr("from whichever side the lights come")));
    write_text(path("shadows.json"), R"({"ambient": 0.2, "lights": [{"type": "directional", "direction": [0, 0, 1],
                "intensity": 0.8, "shadow": true, "orbit": {"axis": [0, 1, 0], "degrees_per_second": 10}}]})");
    EXPECT_THAT(fold_test(simplify({"--lights", "shadows.json"})),
                AllOf(StartsWith("luebke-hallen-safe:"), HasSubstr("shadows of lights that move")));
}

// The ball in red and green of one luminance, or in a grey of it, with an alpha for all vertices.
class PaintedBallTest : public SimplifyTest {
protected:
    void paint(float alpha, bool is_grey = false) {
        std::istringstream grey(read_text(write_ball("ball.obj")));
        std::string painted;
        int vertex = 0;
        for (std::string line; std::getline(grey, line);) {
            const bool is_red = (vertex / 4) % 2 == 0;
            if (line.rfind("v ", 0) == 0) {
                ++vertex;
                // sRGB of linear (0.44, 0.2586, 0.24) and (0.16, 0.3297, 0.36): both of the luminance 0.296
                line += (is_grey  ? " 0.5806 0.5806 0.5806 "
                         : is_red ? " 0.6944 0.5455 0.5271 "
                                  : " 0.4366 0.6095 0.6343 ") +
                        std::to_string(alpha);
            }
            painted += line + "\n";
        }
        write_text(path("ball.obj"), painted);
        succeed({"build", "ball.obj", "--prelit", "-o", "ball.vdt", "--threads", "1"});
    }
};

TEST_F(PaintedBallTest, ColourKeepsWhatLuminanceFolds) {
    const std::vector<std::string> tests = {"error", "luebke-hallen", "luebke-hallen-safe"};
    paint(1, true);
    std::vector<int> grey;
    for (const std::string& test : tests) {
        const Json report = simplify({"--fold-test", test});
        EXPECT_EQ(effect_named(report, "colour")["on"], false);
        grey.push_back(report["triangles"]);
    }
    paint(1);
    for (std::size_t i = 0; i < tests.size(); ++i) {
        const Json report = simplify({"--fold-test", tests[i]});
        EXPECT_EQ(effect_named(report, "colour")["on"], true);
        EXPECT_GT(report["triangles"].get<int>(), grey[i] * 5 / 4);
    }
}

TEST_F(PaintedBallTest, KeepsWhatTheSceneMayShowThrough) {
    paint(1, true);
    const Json opaque = simplify({});
    EXPECT_EQ(effect_named(opaque, "translucency")["on"], false);
    paint(0.5f, true);
    const Json translucent = simplify({});
    EXPECT_EQ(effect_named(translucent, "translucency")["on"], true);
    EXPECT_GT(translucent["triangles"].get<int>(), opaque["triangles"].get<int>() * 5 / 4);
}

TEST_F(SimplifyTest, PixelTestsKnowNoDistance) {
    int last = 0;
    for (const std::string test : {"extent", "displacement"}) {
        const Json report = simplify({"--pixels", "20", "--fold-test", test});
        EXPECT_TRUE(report["imperceptible_from_m"].is_null());
        EXPECT_TRUE(report["max_fold_cost"].get<double>() <= 1);
        EXPECT_EQ(effect_named(report, "imperceptible distance")["on"], false);
        EXPECT_THAT(effect_named(report, "imperceptible distance")["why"], HasSubstr(test));
        EXPECT_NE(report["triangles"], last);
        last = report["triangles"];
    }
    EXPECT_EQ(simplify({"--pixels", "20"})["triangles"],
              simplify({"--pixels", "20", "--fold-test", "extent"})["triangles"]);
    EXPECT_GT(simplify({"--pixels", "5"})["triangles"], simplify({"--pixels", "50"})["triangles"]);
}

TEST_F(SimplifyTest, UnboundedCostsAreNull) {
    // With the eye at a vertex, the folds above that vertex can be seen from any distance; ten triangles do not do
    // without them.
    const Json report = simplify({"--eye", "0", "1", "0", "--up", "1", "0", "0", "--triangles", "10"});
    EXPECT_TRUE(report["max_fold_cost"].is_null());
    EXPECT_TRUE(report["imperceptible_from_m"].is_null());
}

TEST_F(SimplifyTest, TheUnitScalesTheWorldAndTheFrameWithIt) {
    const Json metres = simplify({"--triangles", "300"});
    const Json millimetres = simplify({"--triangles", "300", "--unit", "0.001"});
    EXPECT_EQ(metres["triangles"], millimetres["triangles"]);
    EXPECT_NEAR(metres["max_fold_cost"].get<double>(), millimetres["max_fold_cost"].get<double>(),
                1e-5 * metres["max_fold_cost"].get<double>());
    // An eye of its own does not scale: a smaller ball needs fewer triangles.
    const Json large = simplify({"--eye", "0", "0", "9", "--pixels", "10"});
    const Json small = simplify({"--eye", "0", "0", "9", "--pixels", "10", "--unit", "0.1"});
    EXPECT_GT(large["triangles"], small["triangles"]);
}

TEST_F(SimplifyTest, SaysWhichEffectsRan) {
    const Json plain = simplify({});
    EXPECT_EQ(effect_named(plain, "light")["on"], false);
    EXPECT_EQ(effect_named(plain, "frustum culling")["on"], false);
    EXPECT_EQ(effect_named(plain, "magnification")["on"], false);
    EXPECT_EQ(effect_named(plain, "silhouettes")["on"], true);
    EXPECT_EQ(effect_named(plain, "csf table")["on"], false);
    const Json changed = simplify({"--light", "1", "0", "0", "--ambient", "0.5", "--fov", "5"});
    EXPECT_EQ(effect_named(changed, "light")["on"], true);
    EXPECT_EQ(effect_named(changed, "magnification")["on"], true);
}

TEST_F(SimplifyTest, ReportsToAFileBesideTheTable) {
    EXPECT_THAT(succeed({"simplify", "ball.vdt", "-o", "o.ply", "--json", "o.json"}).out, HasSubstr("triangles"));
    expect_cut_report(Json::parse(read_text(path("o.json"))));
    EXPECT_THAT(files(), ElementsAre("ball.obj", "ball.vdt", "o.json", "o.ply"));
}

TEST_F(SimplifyTest, TakesMeshesToo) {
    ::setenv("UNSEEN_CACHE", "off", 1);
    const Outcome outcome = succeed({"simplify", "ball.obj", "-o", "o.ply", "--triangles", "300", "--json", "-"});
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("note"), HasSubstr("unseen build")));
    EXPECT_EQ(outcome.json()["triangles"], simplify({"--triangles", "300"})["triangles"]);
}

TEST_F(SimplifyTest, ReadsDisplaysAndViewers) {
    write_text(path("far.json"), R"({"width_px": 1920, "height_px": 1080, "diagonal_m": 0.6, "viewing_distance_m": 12,
                                     "peak_cdm2": 100, "black_cdm2": 0.5})");
    ASSERT_EQ(run({"csf", "--table", "--model", "stela", "--save-table", "stela.json"}).status, 0);
    EXPECT_LT(simplify({"--display", "far.json"})["triangles"], simplify({"--distance", "0.3"})["triangles"]);
    const Json by_file = simplify({"--csf", "stela.json"}), by_name = simplify({"--csf", "stela"});
    EXPECT_EQ(effect_named(by_file, "csf table")["on"], true);
    EXPECT_EQ(effect_named(by_name, "csf table")["on"], true);
    EXPECT_EQ(by_file["triangles"], by_name["triangles"]);
    for (const std::string model :
         {"castle", "daly", "barten-1989", "barten-1999", "barten-2004", "mannos-sakrison", "rushmeier"})
        EXPECT_GT(simplify({"--csf", model})["triangles"], 0) << model;
    EXPECT_THAT(run({"simplify", "ball.vdt", "-o", "o.ply", "--csf", "stella"}),
                fails(1, AllOf(HasSubstr("stella"), HasSubstr("barten-1999"))));
}

TEST_F(SimplifyTest, ASingleTriangleIsValid) {
    write_text(path("one.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    const Outcome outcome = succeed({"simplify", "one.obj", "-o", "one.ply", "--full", "--json", "-"});
    EXPECT_EQ(outcome.json()["triangles"], 1);
}

TEST_F(SimplifyTest, FoldsWhatIsHiddenWhereAskedTo) {
    const auto triangles = [&](Words more) {
        return run(joined({"simplify", "ball.vdt", "-o", "x.ply", "--json", "-"}, more)).json()["triangles"].get<int>();
    };
    EXPECT_LT(triangles({"--visibility", "spheres"}), triangles({}) * 3 / 4) << "what faces away is folded";
}

TEST_F(SimplifyTest, AnswersInThreeLines) {
    EXPECT_THAT(
        succeed({"simplify", "ball.vdt", "-o", "small.glb"}).out,
        ::testing::MatchesRegex("kept [0-9,]+ of 1,472 triangles \\([0-9.]+%\\)\n"
                                "nobody sees a difference, looked at from 0.5 m or more: by the model \\(fold test "
                                "error\\), which can be wrong, for the default observer \\(castleCSF x 2: of measured "
                                "people, 8.7% see more\\), in this view, on the default display, wherever they look\n"
                                "wrote small.glb \\([0-9.]+ kB\\)\n"));
    const auto second_line = [&](Words more) {
        const std::string out = run(joined({"simplify", "ball.vdt", "-o", "small.glb"}, more)).out;
        return out.substr(out.find('\n') + 1, out.find("\nwrote") - out.find('\n') - 1);
    };
    EXPECT_THAT(second_line({"--gaze", "3000", "512"}), ::testing::EndsWith("with the gaze at pixel 3000 512"));
    EXPECT_THAT(
        second_line({"--triangles", "100"}),
        ::testing::ContainsRegex("^a difference can be seen; looked at from [0-9.]+ m or more, nobody sees it: "));
    EXPECT_THAT(second_line({"--csf", "daly", "--peak", "200"}),
                AllOf(HasSubstr("for the observer of 2 x daly"), HasSubstr("on this display")));
    EXPECT_THAT(second_line({"--observer", "strict"}), HasSubstr("for the strict observer (castleCSF x 2.7: "));
    EXPECT_THAT(second_line({"--fold-test", "luebke-hallen"}),
                HasSubstr("(fold test luebke-hallen, which misses some changes)"));
    EXPECT_EQ(second_line({"--full"}), "nothing is folded");
    EXPECT_THAT(second_line({"--pixels", "5"}), HasSubstr("not known: the fold test extent counts pixels"));
}

TEST_F(SimplifyTest, SaysMoreWhenItIsAsked) {
    const Outcome verbose = succeed({"simplify", "ball.vdt", "-o", "o.ply", "--verbose"});
    for (const std::string text :
         {"nodes tested", "adapted in", "effects\n", "  on   fold test: error", "  off  gaze: "})
        EXPECT_THAT(verbose.out, HasSubstr(text));
}

TEST_F(BuildTest, SaysWhatItWrote) {
    write_ball("ball.obj");
    const Outcome built = run({"build", "ball.obj", "-o", "ball.vdt", "--json", "r.json"});
    EXPECT_THAT(built.out,
                ::testing::MatchesRegex("built a tree over 1,472 triangles in [0-9.]+ m?s\n"
                                        "wrote ball.vdt \\([0-9.]+ kB\\)\nwrote r.json \\([0-9]+ bytes\\)\n"));
    EXPECT_THAT(run({"build", "ball.obj", "-o", "ball.vdt", "--verbose"}).out, HasSubstr("bytes a triangle"));
}

TEST_F(SimplifyTest, ABudgetMayBeMoreThanThereAre) {
    const std::uint64_t whole = simplify({"--full"})["triangles"];
    for (const std::string budget : {"4294967295", "4294967296", "18446744073709551615"}) {
        const Json report = simplify({"--triangles", budget, "--fill-budget"});
        EXPECT_EQ(report["triangles"], whole) << budget;
    }
    EXPECT_THAT(run({"simplify", "ball.vdt", "-o", "o.ply", "--triangles", "1"}),
                fails(1, AllOf(IsAnErrorForPeople(), HasSubstr("No triangle is left"))));
    EXPECT_FALSE(fs::exists(path("o.ply")));
}

TEST_F(SimplifyTest, ABudgetMayBeAShare) {
    const int count = simplify({"--triangles", "368"})["triangles"];
    EXPECT_LE(count, 368);
    EXPECT_EQ(simplify({"--triangles", "25%"})["triangles"], count);
    EXPECT_EQ(simplify({"--ratio", "0.25"})["triangles"], count);
    const int thousand = simplify({"--triangles", "1000"})["triangles"];
    EXPECT_GT(thousand, count);
    for (const std::string spelled : {"1k", "1e3", "1,000", "0.001M"})
        EXPECT_EQ(simplify({"--triangles", spelled})["triangles"], thousand) << spelled;
    const Outcome more = run({"simplify", "ball.vdt", "-o", "o.ply", "--triangles", "200%"});
    EXPECT_THAT(more.err, HasSubstr("note: --triangles 200%: a model has no more than 100%"));
    for (const Words& wrong : std::vector<Words>{{"--triangles", "0%"},
                                                 {"--triangles", "%"},
                                                 {"--triangles", "nan%"},
                                                 {"--triangles", "-5%"},
                                                 {"--triangles", "k"},
                                                 {"--triangles", "1,00"},
                                                 {"--triangles", "1,0000"},
                                                 {"--triangles", "0.0001k"},
                                                 {"--ratio", "0"},
                                                 {"--ratio", "1.5"},
                                                 {"--ratio", "50%"},
                                                 {"--ratio", "0.5", "--triangles", "5"}}) {
        EXPECT_EQ(run(joined({"simplify", "ball.vdt", "-o", "o.ply"}, wrong)).status, 2)
            << ::testing::PrintToString(wrong);
    }
}

TEST_F(UsageTest, SuggestsWhatWasMeant) {
    const auto complaint = [&](const Words& words) {
        const Outcome outcome = run(words);
        EXPECT_EQ(outcome.status, 2) << outcome.err;
        return outcome.err;
    };
    EXPECT_THAT(complaint({"simplfy"}), HasSubstr("no verb 'simplfy': did you mean 'simplify'?\n"));
    EXPECT_THAT(complaint({"redner", "ball.vdt", "-o", "o.png"}), HasSubstr("'render'?"));
    EXPECT_THAT(complaint({"simplify", "b.vdt", "-o", "o.ply", "--triangle", "500"}),
                HasSubstr("no option '--triangle': did you mean '--triangles'?\n"));
    EXPECT_THAT(complaint({"simplify", "b.vdt", "--ouptut", "o.ply"}), HasSubstr("did you mean '--output'?"))
        << "and not that -o is missing";
    EXPECT_THAT(complaint({"make", "subdivid"}), HasSubstr("'subdivide'?"));
    EXPECT_THAT(complaint({"frobnicate"}), AllOf(HasSubstr("no verb 'frobnicate'."), Not(HasSubstr("mean"))));
    EXPECT_THAT(complaint({"info", "a.vdt", "b.vdt"}), HasSubstr("'b.vdt' is one word too many"));
    EXPECT_THAT(complaint({"bunny.vdt"}), HasSubstr("no verb 'bunny.vdt': did you mean 'unseen view bunny.vdt'?\n"));
    EXPECT_THAT(complaint({"simplify", "b.vdt", "-o", "o.ply", "--clusterer", "octree"}),
                HasSubstr("no option '--clusterer' here; see 'unseen build'.\n"));
    EXPECT_THAT(complaint({"simplify", "b.png", "-o", "o.ply"}), HasSubstr("'b.png' is a picture"));
}

// Each option acts in its verb, or is refused; what the verbs share is documented once.
TEST_F(UsageTest, OptionsOfTheSetupActOrAreRefused) {
    const Words verbs = {"build m.obj -o t.vdt",
                         "info m.obj",
                         "simplify m.obj -o o.ply",
                         "render m.obj -o o.png",
                         "fly m.obj",
                         "view m.obj",
                         "compare a.png b.png",
                         "sheet m.obj -o s.png",
                         "tradeoff m.obj",
                         "lod m.obj -o l.glb",
                         "levels m.obj -o l.png",
                         "levels precompute s.glb -o s.sel --triangles 9",
                         "levels info s.sel",
                         "csf --frequency 4 --luminance 1",
                         "calibrate --simulate castle",
                         "study make m.obj -o f",
                         "study run f",
                         "study analyse a.csv",
                         "demo --no-view",
                         "make subdivide m.obj --times 1 -o o.ply",
                         "make scene museum -o m.glb",
                         "cache"};
    const Words options = {"--eye 1 2 3",      "--eye 0 0 9 --target 1 2 3",
                           "--up 0 0 1",       "--direction 1 0 0",
                           "--fill 0.5",       "--fov 30",
                           "--size 512",       "--orthographic fit",
                           "--display d.json", "--ppd 30",
                           "--distance 1",     "--peak 200",
                           "--black 0.1",      "--observer strict",
                           "--csf castle",     "--light 1 0 0",
                           "--ambient 0.1",    "--fill-light 0.1",
                           "--lights l.json",  "--no-shadows",
                           "--background 10",  "--unit 0.1",
                           "--texture t.png",  "--no-texture",
                           "--drop skins",     "--no-weld",
                           "--prelit",         "--skip-bad",
                           "--crease smooth",  "--no-cache",
                           "--as model",       "--protect borders",
                           "--lock-borders"};
    const std::string setup = run({"help", "setup"}).out;
    for (const std::string& verb : verbs) {
        const auto parse = [&](const std::string& more) {
            return run_shell("'" UNSEEN_COMMAND "' --parse-only " + verb + " " + more);
        };
        std::string name = verb.substr(0, verb.find(' '));
        if (name == "levels" || name == "study" || name == "make") {
            const std::string part = verb.substr(name.size() + 1, verb.find(' ', name.size() + 1) - name.size() - 1);
            if (part.find('.') == std::string::npos) name += " " + part;
        }
        const std::string help = run_shell("'" UNSEEN_COMMAND "' " + name + " --help").out;
        if (help.find("Not in this build") != std::string::npos) continue;
        ASSERT_EQ(parse("").status, 0) << parse("").err;
        std::string script; // one shell for all of them
        for (const std::string& option : options)
            script += "'" UNSEEN_COMMAND "' --parse-only " + verb + " " + option + " >/dev/null 2>&1; echo $?\n";
        std::istringstream statuses(run_shell(script).out);
        for (const std::string& option : options) {
            int status = -1;
            statuses >> status;
            const std::string first =
                option.substr(option.rfind("--"), option.find(' ', option.rfind("--")) - option.rfind("--"));
            const bool is_field =
                std::set<std::string>{"--black", "--ambient", "--fill-light", "--no-weld", "--crease", "--skip-bad"}
                    .contains(first);
            const std::string shown = first == "--no-shadows"     ? "--shadows"
                                      : first == "--no-texture"   ? "--texture"
                                      : first == "--lock-borders" ? "--protect"
                                                                  : first;
            const std::string named = is_field ? shown.substr(2) : shown;
            if (help.find("\n  " + shown) != std::string::npos) continue; // the verb's own
            const bool acts =
                help.find(" " + named + " ") != std::string::npos || help.find(" " + named + "\n") != std::string::npos;
            EXPECT_EQ(status, acts ? 0 : 2) << name << " " << option << "\n" << parse(option).err;
            EXPECT_THAT(setup, HasSubstr("\n    " + shown)) << "documented";
        }
    }
}

TEST_F(UsageTest, VerbsHaveFewOptions) {
    std::istringstream lines(run({"help", "--options"}).out);
    std::map<std::string, int> counts;
    std::map<std::string, std::set<std::string>> accepted;
    int all = 0;
    for (std::string line; std::getline(lines, line);) {
        const std::string name = line.substr(line.find(" --") + 1);
        if (!line.starts_with("setup "))
            accepted[line.substr(0, line.find_first_of("- "))].insert(name.substr(0, name.find(' ')));
        if (line.ends_with(" setup")) continue; // counted once, as options of "setup"
        ++counts[line.substr(0, line.find_first_of("- "))], ++all;
    }
    for (const auto& [verb, count] : counts) EXPECT_LE(count, 45) << verb;
    for (const auto& [verb, names] : accepted) EXPECT_LE(names.size(), 50u) << verb << ", those of the setup included";
    EXPECT_GT(counts["simplify"], 5);
    EXPECT_LE(all, 300);
}

TEST_F(SimplifyTest, ASetupComesFromAFile) {
    fs::create_directory(path("lab"));
    write_text(path("lab/far.json"), R"({"width_px": 1920, "height_px": 1080, "diagonal_m": 0.6,
                                         "viewing_distance_m": 3, "peak_cdm2": 100, "black_cdm2": 0.5})");
    write_text(path("lab/setup.json"), R"({"display": "far.json", "size": "256x256", "light": [1, 0, 0],
                                           "observer": "strict", "shadows": false, "no-cache": true})");
    const Words spelled = {"--display", "lab/far.json", "--size", "256", "--light", "1", "0",
                           "0",         "--observer",   "strict"};
    const auto with = [](Words words, Words more) {
        words.insert(words.end(), more.begin(), more.end());
        return words;
    };
    const int by_file = simplify({"--setup", "lab/setup.json"})["triangles"];
    EXPECT_EQ(simplify(spelled)["triangles"], by_file);
    EXPECT_NE(simplify({})["triangles"], by_file);
    const int nearer = simplify({"--setup", "lab/setup.json", "--distance", "0.2"})["triangles"];
    EXPECT_EQ(simplify(with(spelled, {"--distance", "0.2"}))["triangles"], nearer) << "the command line counts more";
    // What does not act in a verb is passed over.
    EXPECT_EQ(run({"build", "ball.obj", "-o", "b.vdt", "--setup", "lab/setup.json"}).status, 0);
    EXPECT_EQ(run({"cache", "--setup", "lab/setup.json"}).status, 2);
    const std::vector<std::pair<std::string, std::string>> wrong = {
        {"[]", "is no JSON object of options"},
        {R"({"sise": 1})", "'wrong.json': there is no option 'sise' of the setup: did you mean 'size'?"},
        {R"({"triangles": 5})", "there is no option 'triangles' of the setup"},
        {R"({"light": [1, 2]})", "'wrong.json', light: "},
        {R"({"ambient": 2})", "'wrong.json', ambient: --ambient: must be a number from 0 to 1, not '2'"},
        {R"({"size": null})", "'wrong.json', size: must be a number, a text, true, false, or an array"},
        {R"({"eye": [1, 2, 3], "direction": [1, 0, 0]})", "--eye and --direction exclude each other"}};
    for (const auto& [text, sentence] : wrong) {
        write_text(path("wrong.json"), text);
        EXPECT_THAT(run({"simplify", "ball.vdt", "-o", "o.ply", "--setup", "wrong.json"}),
                    fails(2, HasSubstr(sentence)))
            << text;
    }
    EXPECT_THAT(
        run({"simplify", "ball.vdt", "-o", "o.ply", "--json", "lab/setup.json", "--setup", "lab/setup.json"}).err,
        HasSubstr("is read: give the output another name"));
    EXPECT_EQ(run({"simplify", "ball.vdt", "-o", "o.ply", "--setup", "gone.json"}).status, 2);
}

TEST_F(MakeTest, OldSpellingsAreTaken) {
    EXPECT_EQ(run({"scene", "make", "museum", "--triangles", "10000", "-o", "m.glb"}).status, 0);
    EXPECT_EQ(run({"--parse-only", "simplify", "m.glb", "-o", "o.glb", "--ratio", "0.5"}).status, 0);
    EXPECT_EQ(run({"simplify", "m.glb", "-o", "o.glb", "--imperceptible", "--full"}).status, 2);
}

TEST_F(UsageTest, HelpIsAVerb) {
    EXPECT_EQ(run({"help"}).out, run({"--help"}).out);
    EXPECT_EQ(run({"help", "simplify"}).out, run({"simplify", "--help"}).out);
    EXPECT_EQ(run({"help", "make", "subdivide"}).out, run({"make", "subdivide", "--help"}).out);
    EXPECT_THAT(run({"help", "simplfy"}), fails(2, HasSubstr("'simplify'?")));
}

TEST_F(UsageTest, OptionsSayHowManyNumbersTheyNeed) {
    EXPECT_THAT(run({"simplify", "b.vdt", "--gaze", "500", "-o", "x.ply"}).err,
                HasSubstr("--gaze: needs two finite numbers, and '-o' is none"));
    EXPECT_THAT(run({"simplify", "b.vdt", "-o", "x.ply", "--eye", "1", "2", "--full"}).err,
                HasSubstr("--eye: needs three finite numbers, and '--full' is none"));
}

TEST_F(SimplifyTest, TooLittleTimeIsNotBlamedOnTheView) {
    EXPECT_THAT(run({"simplify", "ball.vdt", "-o", "o.ply", "--milliseconds", "0"}),
                fails(1, AllOf(IsAnErrorForPeople(), HasSubstr("--milliseconds"), Not(HasSubstr("move nearer")))));
}

TEST_F(SimplifyTest, MakesTheFoldersOfItsOutputs) {
    succeed({"simplify", "ball.vdt", "-o", "new/deep/o.ply", "--json", "new/r.json"});
    EXPECT_TRUE(fs::exists(path("new/deep/o.ply")) && fs::exists(path("new/r.json")));
    const auto before = files();
    EXPECT_EQ(run({"simplify", "missing.vdt", "-o", "other/deep/o.ply"}).status, 1);
    EXPECT_EQ(files(), before) << "not even a folder";
}

TEST_F(SimplifyTest, AReplacedFileKeepsItsPermissions) {
    constexpr auto secret = fs::perms::owner_read | fs::perms::owner_write;
    write_text(path("o.ply"), "");
    fs::permissions(path("o.ply"), secret);
    ASSERT_EQ(run({"simplify", "ball.vdt", "-o", "o.ply"}).status, 0);
    EXPECT_EQ(fs::status(path("o.ply")).permissions(), secret);
    EXPECT_EQ(run({"info", "o.ply", "--json"}).json()["kind"], "mesh");
}

// Also where the folder would let it be replaced. Root may write to any file: then nobody tries.
TEST_F(SimplifyTest, AFileThatMayNotBeWrittenToIsRefused) {
    write_text(path("o.ply"), "old");
    fs::permissions(path("o.ply"), fs::perms::owner_read);
    fs::permissions(folder(), fs::perms::all);
    std::string nobody;
    if (::geteuid() == 0) nobody = "setpriv --reuid=65534 --regid=65534 --clear-groups ";
    if (run_shell(nobody + "'" UNSEEN_COMMAND "' --version").status != 0) GTEST_SKIP() << "nobody cannot run it";
    const Outcome refused = run_shell(nobody + "'" UNSEEN_COMMAND "' simplify ball.vdt --triangles 100 -o o.ply");
    EXPECT_EQ(refused.status, 1);
    EXPECT_THAT(refused.err, AllOf(IsAnErrorForPeople(), HasSubstr("'o.ply', which is there: Permission denied")));
    EXPECT_EQ(read_text(path("o.ply")), "old");
    EXPECT_THAT(files(), ::testing::Each(Not(StartsWith("."))));
}

TEST_F(SimplifyTest, AFolderThatMayNotBeWrittenToIsRefused) {
    fs::create_directory(path("locked"));
    fs::permissions(path("locked"),
                    fs::perms::owner_read | fs::perms::owner_exec | fs::perms::others_read | fs::perms::others_exec);
    fs::permissions(folder(), fs::perms::all);
    std::string nobody;
    if (::geteuid() == 0) nobody = "setpriv --reuid=65534 --regid=65534 --clear-groups ";
    if (run_shell(nobody + "'" UNSEEN_COMMAND "' --version").status != 0) GTEST_SKIP() << "nobody cannot run it";
    for (const std::string words :
         {"simplify ball.vdt --triangles 100 -o locked/o.ply", "build ball.obj -o locked/o.vdt",
          "simplify ball.vdt --triangles 100 -o o.ply --json locked/o.json"}) {
        const Outcome refused = run_shell(nobody + "'" UNSEEN_COMMAND "' " + words);
        EXPECT_EQ(refused.status, 1) << words;
        EXPECT_THAT(refused.err, AllOf(IsAnErrorForPeople(), HasSubstr("locked"), HasSubstr("Permission denied")))
            << words;
        EXPECT_TRUE(fs::is_empty(path("locked"))) << words;
        EXPECT_FALSE(fs::exists(path("o.ply"))) << words;
    }
}

// Before there is anything to be waited for: here, a look at what is read.
TEST_F(UsageTest, NamesThatCannotBeAreRefusedFirst) {
    const std::string name(300, 'a');
    for (const Words& words :
         std::vector<Words>{{"build", "missing.ply", "-o", name + ".vdt"},
                            {"simplify", "missing.ply", "-o", name + ".ply"},
                            {"simplify", "missing.ply", "-o", "o.ply", "--json", name},
                            {"render", "missing.ply", "-o", name + ".png"},
                            {"fly", "missing.ply", "--path", "orbit", "-o", name + "%04d.png"},
                            {"sheet", "missing.ply", "-o", name + ".png"},
                            {"make", "scene", "museum", "-o", name + ".glb"},
                            {"make", "subdivide", "missing.ply", "--times", "1", "-o", name + ".ply"}}) {
        const Outcome outcome = run(words);
        EXPECT_EQ(outcome.status, 1) << words[0];
        EXPECT_THAT(outcome.err, HasSubstr("name too long")) << words[0];
    }
    EXPECT_THAT(run({"build", "missing.ply", "-o", "/proc/nothing/here.vdt"}),
                fails(1, AllOf(IsAnErrorForPeople(), HasSubstr("'/proc/nothing'"), Not(HasSubstr("missing.ply")))));
    EXPECT_TRUE(files().empty());
}

TEST_F(SimplifyTest, AFullStandardOutputIsAnErrorThatSaysWhatIsThere) {
    const std::string unseen = UNSEEN_COMMAND;
    const Outcome built = run_shell(unseen + " build ball.obj -o q.vdt > /dev/full");
    EXPECT_EQ(built.status, 1);
    EXPECT_THAT(built.err, AllOf(HasSubstr("is the disk full?"), HasSubstr("Written: q.vdt")));
    EXPECT_EQ(run({"info", "q.vdt", "--verify"}).status, 0);
    for (const std::string words : {"--help", "--version", "simplify --help", "help", "help build"})
        EXPECT_EQ(run_shell(unseen + " " + words + " > /dev/full").status, 1) << words;
}

// Files of two blocks of 512 bytes at most, as of a disk that has no more room.
TEST_F(SimplifyTest, AFullDiskLeavesTheOldOutputs) {
    const std::string unseen = "ulimit -f 2; exec '" UNSEEN_COMMAND "' ";
    for (const auto& [out, words] : std::vector<std::pair<std::string, std::string>>{
             {"o.ply", "simplify ball.vdt --triangles 500 -o o.ply"},
             {"o.glb", "simplify ball.vdt --triangles 500 -o o.glb"},
             {"o.obj", "make subdivide ball.obj --times 1 -o o.obj"},
             {"m.glb", "make scene museum -o m.glb"},
             {"t.json", "csf --table --save-table t.json"},
             {"r.json", "simplify ball.vdt --triangles 500 -o s.ply --verbose --json r.json"}}) {
        write_text(path(out), "old");
        const auto before = files();
        const Outcome full = run_shell(unseen + words);
        EXPECT_EQ(full.status, 1) << words << full.err;
        EXPECT_THAT(full.err, IsAnErrorForPeople()) << words;
        EXPECT_EQ(read_text(path(out)), "old") << words;
        EXPECT_EQ(files(), before) << words;
    }
}

TEST_F(SimplifyTest, AClosedStandardOutputIsAnErrorThatSaysWhatIsThere) {
    const std::string unseen = "'" UNSEEN_COMMAND "'";
    const std::string closed = " 2>err.txt; echo $? >status.txt; } | true; cat status.txt; cat err.txt";
    const Outcome built = run_shell("{ sleep 0.2; " + unseen + " build ball.obj -o q.vdt" + closed);
    EXPECT_THAT(built.out, AllOf(StartsWith("1\n"), HasSubstr("has closed it"), HasSubstr("Written: q.vdt")));
    EXPECT_EQ(run({"info", "q.vdt", "--verify"}).status, 0);
    const Outcome help = run_shell("{ sleep 0.2; " + unseen + " --help" + closed);
    EXPECT_THAT(help.out, AllOf(StartsWith("1\n"), HasSubstr("has closed it")));
}

TEST_F(UsageTest, NamesDoNotSteerTheTerminal) {
    const std::string evil = "\x1b[31m\xc2\x9b\xff\n";
    EXPECT_THAT(run({"info", "a" + evil + ".ply"}),
                fails(1, AllOf(HasSubstr("a\\x1b[31m\\xc2\\x9b\\xff\\x0a.ply"), Not(HasSubstr("\x1b")))));
    write_text(path("m.obj"), "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl p\n"
                              "f 1/1 2/2 3/3\n");
    write_text(path("m.mtl"), "newmtl p\nmap_Kd \x1b[31m.png\n");
    const Outcome image = run({"build", "m.obj", "-o", "gr\xc3\xbcn\x1b.vdt"});
    EXPECT_THAT(image.err + image.out, AllOf(HasSubstr("\\x1b"), Not(HasSubstr("\x1b"))));
    const Outcome verb = run({"\x1b[31m"});
    EXPECT_THAT(verb.err, AllOf(HasSubstr("\\x1b"), Not(HasSubstr("\x1b"))));
    write_ball("gr\xc3\xbcn.obj");
    EXPECT_THAT(run({"build", "gr\xc3\xbcn.obj", "-o", "gr\xc3\xbcn.vdt"}).out, HasSubstr("wrote gr\xc3\xbcn.vdt"));
}

// JSON may hold U+0080 to U+009F as they are, which terminals take for commands.
TEST_F(SimplifyTest, ReportsDoNotSteerTheTerminal) {
    write_ball("m.obj");
    write_text(path("m.obj"), "g a\xc2\x9b\x7f\xc3\xbc\n" + read_text(path("m.obj")));
    const Outcome report = succeed({"info", "m.obj", "--json"});
    EXPECT_TRUE(report.json().is_object());
    EXPECT_THAT(report.out, AllOf(Not(HasSubstr("\xc2\x9b")), Not(HasSubstr("\x7f"))));
    fs::rename(path("ball.vdt"), path("b\xc2\x9b\xc3\xbc.vdt"));
    const Outcome kept =
        succeed({"simplify", "b\xc2\x9b\xc3\xbc.vdt", "--triangles", "9", "-o", "o.ply", "--json", "-"});
    EXPECT_THAT(kept.out + kept.err, Not(HasSubstr("\xc2\x9b")));
}

TEST_F(SimplifyTest, NumbersBeyondAllRangesAreNamedPlainly) {
    write_text(path("d.json"), "{\"width_px\": 1e999}");
    EXPECT_THAT(run({"simplify", "ball.vdt", "-o", "o.ply", "--display", "d.json"}),
                fails(1, AllOf(HasSubstr("1e999"), Not(HasSubstr("exception")))));
}

TEST_F(UsageTest, ByteOrderMarksAreNoText) {
    const std::string mark = "\xef\xbb\xbf";
    const auto complaint = [&](const std::string& text) {
        write_text(path("table.json"), text);
        return run({"csf", "--csf", "table.json", "--frequency", "4", "--luminance", "100"}).err;
    };
    EXPECT_EQ(complaint(mark + "{}"), complaint("{}")) << "a table that lacks everything, but JSON";
    EXPECT_NE(complaint("{"), complaint("{}"));
}

class SignalTest : public CommandTest {
protected:
    std::set<std::string> temporaries() const {
        std::set<std::string> names;
        for (const std::string& name : files())
            if (name.starts_with(".unseen-")) names.insert(name);
        return names;
    }
};

TEST_F(SignalTest, NothingHalfDoneIsLeft) {
    write_ball("ball.obj");
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        const fs::path log = folder().string() + ".log";
        const pid_t process =
            start({"make", "subdivide", "ball.obj", "-o", "large.ply", "--times", "6", "--json", "r.json"}, log, log);
        ASSERT_GT(process, 0);
        bool has_begun = false; // what is looked for first may be gone when it is looked for again
        for (int i = 0; i < 6000 && !has_begun; ++i) {
            usleep(10'000);
            has_begun = !temporaries().empty();
        }
        EXPECT_TRUE(has_begun);
        kill(process, signal);
        EXPECT_EQ(wait_for(process), -signal);
        EXPECT_THAT(files(), ElementsAre("ball.obj"));
        fs::remove(log);
        fs::remove(log.string() + ".in");
    }
}

// At any moment of a build: the output is the old one or the new one, whole.
TEST_F(SignalTest, AKilledBuildLeavesTheOldOutputOrTheNewOne) {
    write_ball("ball.obj", 60, 60);
    const auto build = [&](const std::string& out) {
        return Words{"build", "ball.obj", "-o", out, "--no-fold-errors", "--threads", "1"};
    };
    const auto now = [] { return std::chrono::steady_clock::now(); };
    const auto start_of_build = now();
    ASSERT_EQ(run(build("new.vdt")).status, 0);
    const auto whole = std::chrono::duration_cast<std::chrono::microseconds>(now() - start_of_build).count();
    const std::string old = "old", fresh = read_text(path("new.vdt"));
    const fs::path log = folder().string() + ".log";
    constexpr int rounds = 40;
    int kept = 0;
    for (int i = 0; i < rounds; ++i) {
        write_text(path("o.vdt"), old);
        const pid_t process = start(build("o.vdt"), log, log);
        ASSERT_GT(process, 0);
        usleep(static_cast<useconds_t>(whole * (i + 1) / rounds));
        const int signal = i % 3 == 0 ? SIGKILL : i % 3 == 1 ? SIGTERM : SIGINT;
        kill(process, signal);
        const int status = wait_for(process);
        EXPECT_TRUE(status == 0 || status == -signal) << status;
        const std::string out = read_text(path("o.vdt"));
        kept += out == old;
        EXPECT_TRUE(out == old || out == fresh) << out.size() << " bytes";
        if (signal != SIGKILL) {
            EXPECT_TRUE(temporaries().empty()) << "after signal " << signal;
        } else {
            for (const std::string& name : temporaries()) fs::remove(path(name)); // nobody could
        }
    }
    EXPECT_GT(kept, 0);
    for (const fs::path& file : {log, fs::path(log.string() + ".in")}) fs::remove(file);
}

TEST_F(SignalTest, TwoWritersOfOneOutputLeaveOneOfTheTwo) {
    write_ball("a.obj", 40, 40);
    write_ball("b.obj", 30, 30);
    for (const std::string name : {"a", "b"})
        ASSERT_EQ(run({"build", name + ".obj", "-o", name + ".vdt", "--no-fold-errors"}).status, 0);
    const std::string a = read_text(path("a.vdt")), b = read_text(path("b.vdt"));
    for (int i = 0; i < 10; ++i) {
        std::vector<pid_t> writers;
        for (int k = 0; k < 4; ++k) {
            const fs::path log = folder().string() + ".log" + std::to_string(k);
            writers.push_back(start({"build", k % 2 ? "a.obj" : "b.obj", "-o", "o.vdt", "--no-fold-errors"}, log, log));
        }
        for (const pid_t writer : writers) EXPECT_EQ(wait_for(writer), 0);
        const std::string out = read_text(path("o.vdt"));
        EXPECT_TRUE(out == a || out == b) << out.size() << " bytes";
        EXPECT_TRUE(temporaries().empty());
    }
    for (int k = 0; k < 4; ++k)
        for (const char* end : {"", ".in"}) fs::remove(folder().string() + ".log" + std::to_string(k) + end);
}

// Other causes of that signal than lost pages end the process as they always do.
TEST_F(SignalTest, ABusErrorIsNotBlamedOnAFile) {
    write_ball("ball.obj");
    const fs::path log = folder().string() + ".log";
    const pid_t process = start({"make", "subdivide", "ball.obj", "-o", "large.ply", "--times", "6"}, log, log);
    ASSERT_GT(process, 0);
    for (int i = 0; i < 6000 && temporaries().empty(); ++i) usleep(10'000);
    kill(process, SIGBUS);
    EXPECT_EQ(wait_for(process), -SIGBUS);
    EXPECT_THAT(read_text(log), Not(HasSubstr("cut short")));
    EXPECT_THAT(files(), ElementsAre("ball.obj"));
    fs::remove(log);
    fs::remove(log.string() + ".in");
}

} // namespace command_test
