// Trees of meshes are built and measured once, and kept for the next time.
#include "run_command.h"

#include <unseen/session/session.h>
#include <unseen/vdtree/tree_io.h>

namespace cache_test {

using namespace unseen;
using namespace unseen::app::testing;
using session::CacheOptions;
using session::Scene;
using session::TreeCache;
using session::TreeOrigin;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

class CacheTest : public CommandTest {
protected:
    void SetUp() override {
        CommandTest::SetUp();
        ::setenv("UNSEEN_CACHE", path("cache").c_str(), 1);
        ::unsetenv("UNSEEN_CACHE_SIZE");
        write_ball("ball.obj", 8, 12);
    }
    void TearDown() override {
        ::unsetenv("UNSEEN_CACHE_SIZE");
        CommandTest::TearDown();
    }

    // Where the tree of a model came from.
    std::string origin(const std::string& model, Words options = {}) const {
        const Outcome run_through = succeed(joined({"simplify", model, "-o", "small.ply", "--json", "-"}, options));
        return run_through.json().value("tree", "missing");
    }

    // The sources of what is kept, the last used first.
    Words kept() const {
        Words sources;
        for (const auto& tree : TreeCache().trees()) sources.push_back(tree.source);
        return sources;
    }

    // Files tell times no finer than the system's clock ticks.
    static void let_time_pass() { ::usleep(20'000); }
};

TEST_F(CacheTest, TheSecondStartReads) {
    const Outcome first = succeed({"simplify", "ball.obj", "-o", "first.ply", "--json", "first.json"});
    EXPECT_EQ(Json::parse(read_text(path("first.json")))["tree"], "built");
    EXPECT_THAT(first.err, HasSubstr("built and measured the tree of ball.obj in "));
    EXPECT_THAT(first.err, HasSubstr("kept in " + path("cache").string() + " for the next time (unseen cache)"));
    EXPECT_THAT(kept(), ElementsAre("ball.obj"));

    const Outcome second = succeed({"simplify", "ball.obj", "-o", "second.ply", "--json", "second.json"});
    EXPECT_EQ(Json::parse(read_text(path("second.json")))["tree"], "cache");
    EXPECT_EQ(second.err, "");
    EXPECT_TRUE(read_text(path("first.ply")) == read_text(path("second.ply"))) << "another mesh";
    const Outcome anew = succeed({"simplify", "ball.obj", "-o", "anew.ply", "--no-cache"});
    EXPECT_TRUE(read_text(path("first.ply")) == read_text(path("anew.ply"))) << "what is kept changes the mesh";
}

TEST_F(CacheTest, WhatATreeDependsOnBuildsItAnew) {
    write_text(path("plain.obj"), "mtllib my paints.mtl\nusemtl paint\n" + read_text(path("ball.obj")));
    write_text(path("my paints.mtl"), "newmtl paint\nKd 0.5 0.5 0.5\n");
    EXPECT_EQ(origin("plain.obj"), "built");
    EXPECT_EQ(origin("plain.obj"), "cache");
    EXPECT_EQ(origin("plain.obj", {"--prelit"}), "built") << "an option";
    EXPECT_EQ(origin("plain.obj", {"--skip-bad"}), "built") << "an option";
    EXPECT_EQ(origin("plain.obj", {"--no-weld"}), "built") << "an option";
    for (const char* crease : {"30", "60", "smooth"})
        EXPECT_EQ(origin("plain.obj", {"--crease", crease}), "built") << "an option";
    EXPECT_EQ(origin("plain.obj", {"--crease", "180"}), "cache") << "the same angle";
    for (const char* what : {"borders", "borders:4", "material=paint", "material=paint:4"})
        EXPECT_EQ(origin("plain.obj", {"--protect", what}), "built") << "an option";
    EXPECT_EQ(origin("plain.obj", {"--lock-borders"}), "cache") << "the same option";
    EXPECT_EQ(origin("plain.obj", {"--triangles", "50%"}), "cache") << "not of the tree";
    write_text(path("my paints.mtl"), "newmtl paint\nKd 0.6 0.5 0.5\n");
    EXPECT_EQ(origin("plain.obj"), "built") << "a library";
    write_text(path("plain.obj"), read_text(path("plain.obj")) + "f 1 3 4\n");
    EXPECT_EQ(origin("plain.obj"), "built") << "the mesh";
    EXPECT_EQ(origin("plain.obj"), "cache");
}

TEST_F(CacheTest, ImagesAndBuffersCount) {
    const auto paint = [&](float texel) {
        const float texels[] = {texel, 0.55f};
        write_text(path("im age.pfm"),
                   "Pf\n2 1\n-1.0\n" + std::string(reinterpret_cast<const char*>(texels), sizeof texels));
    };
    write_text(path("square.obj"), "mtllib square.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\n"
                                   "usemtl paint\nf 1/1 2/2 3/3\nf 1/1 3/3 4/1\n");
    write_text(path("square.mtl"), "newmtl paint\nmap_Kd -clamp on im age.pfm\n");
    paint(0.5f);
    EXPECT_EQ(origin("square.obj", {"--full"}), "built");
    EXPECT_EQ(origin("square.obj", {"--full"}), "cache");
    paint(0.6f);
    EXPECT_EQ(origin("square.obj", {"--full"}), "built");
    EXPECT_EQ(origin("square.obj", {"--full", "--texture", "im age.pfm"}), "built");
    EXPECT_EQ(origin("square.obj", {"--full", "--texture", "im age.pfm"}), "cache");

    ASSERT_EQ(run({"simplify", "ball.obj", "--full", "-o", "a ball.gltf"}).status, 0);
    EXPECT_EQ(origin("a ball.gltf"), "built");
    EXPECT_EQ(origin("a ball.gltf"), "cache");
    std::string buffer = read_text(path("a ball.bin"));
    ASSERT_GT(buffer.size(), 2u);
    buffer[1] ^= 1; // a low digit of a coordinate
    write_text(path("a ball.bin"), buffer);
    EXPECT_EQ(origin("a ball.gltf"), "built");
}

TEST_F(CacheTest, DamagedTreesAreBuiltAgain) {
    EXPECT_EQ(origin("ball.obj"), "built");
    const fs::path file = TreeCache().trees().at(0).file;
    std::string bytes = read_text(file);
    bytes[bytes.size() / 2] ^= 4;
    write_text(file, bytes);
    EXPECT_EQ(origin("ball.obj"), "built");
    EXPECT_EQ(origin("ball.obj"), "cache");
    write_text(file, bytes.substr(0, 100));
    EXPECT_EQ(origin("ball.obj"), "built");
    EXPECT_THAT(kept(), SizeIs(1));
}

TEST_F(CacheTest, TwoProcessesAtOnce) {
    std::vector<pid_t> processes;
    for (const std::string name : {"one", "two"})
        processes.push_back(start({"simplify", "ball.obj", "-o", name + ".ply"}, folder().string() + "." + name,
                                  folder().string() + "." + name + "-err"));
    for (const pid_t process : processes) EXPECT_EQ(wait_for(process), 0);
    for (const std::string name : {"one", "two"})
        for (const std::string end : {"", "-err", ".in"}) fs::remove(folder().string() + "." + name + end);
    EXPECT_TRUE(read_text(path("one.ply")) == read_text(path("two.ply")));
    EXPECT_EQ(origin("ball.obj"), "cache");
    EXPECT_EQ(std::distance(fs::directory_iterator(path("cache")), {}), 1) << "nothing else is left";
}

TEST_F(CacheTest, WhatWasNotUsedForLongestGoesFirst) {
    for (const char* name : {"a.obj", "b.obj", "c.obj"})
        write_text(path(name), "# " + std::string(name) + "\n" + read_text(path("ball.obj")));
    EXPECT_EQ(origin("a.obj"), "built");
    const std::uint64_t bytes = TreeCache().trees().at(0).bytes;
    ::setenv("UNSEEN_CACHE_SIZE", std::to_string(bytes * 5 / 2).c_str(), 1);
    let_time_pass();
    EXPECT_EQ(origin("b.obj"), "built");
    let_time_pass();
    EXPECT_EQ(origin("a.obj"), "cache");
    let_time_pass();
    EXPECT_EQ(origin("c.obj"), "built");
    EXPECT_THAT(kept(), ElementsAre("c.obj", "a.obj"));

    ::setenv("UNSEEN_CACHE_SIZE", "1K", 1);
    EXPECT_THAT(succeed({"simplify", "b.obj", "-o", "small.ply"}).err, HasSubstr("larger than"));
    EXPECT_THAT(kept(), SizeIs(2)) << "nothing goes for what is not kept";
}

TEST_F(CacheTest, IsLeftAloneWhereNobodyWantsIt) {
    EXPECT_EQ(origin("ball.obj", {"--no-cache"}), "built");
    EXPECT_EQ(run({"build", "ball.obj", "-o", "ball.vdt"}).status, 0);
    EXPECT_EQ(origin("ball.vdt"), "file");
    ::setenv("UNSEEN_CACHE", "off", 1);
    EXPECT_EQ(origin("ball.obj"), "built");
    EXPECT_EQ(run({"cache", "--json", "-"}).json()["folder"], nullptr);
    EXPECT_FALSE(fs::exists(path("cache")));
}

TEST_F(CacheTest, AFolderThatCannotBeWrittenToIsNoFailure) {
    write_text(path("no-folder"), "");
    ::setenv("UNSEEN_CACHE", path("no-folder/cache").c_str(), 1);
    const Outcome outcome = succeed({"simplify", "ball.obj", "-o", "small.ply"});
    EXPECT_TRUE(fs::exists(path("small.ply")));
    EXPECT_THAT(outcome.err, HasSubstr("not kept for the next time: Cannot make '" + path("no-folder/cache").string()));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
}

TEST_F(CacheTest, LiesWhereTheUsersOtherCachesLie) {
    ::unsetenv("UNSEEN_CACHE");
    const auto set_or_unset = [](const char* name, const std::string& value) {
        return value.empty() ? ::unsetenv(name) : ::setenv(name, value.c_str(), 1);
    };
    const char *xdg = std::getenv("XDG_CACHE_HOME"), *home = std::getenv("HOME");
    const std::string xdg_before = xdg ? xdg : "", home_before = home ? home : "";
    ::setenv("XDG_CACHE_HOME", "/somewhere", 1);
    EXPECT_EQ(TreeCache().folder(), "/somewhere/unseen");
    ::setenv("XDG_CACHE_HOME", "relative", 1);
    ::setenv("HOME", "/home/somebody", 1);
    EXPECT_EQ(TreeCache().folder(), "/home/somebody/.cache/unseen");
    ::unsetenv("HOME");
    EXPECT_FALSE(TreeCache().is_on());
    set_or_unset("XDG_CACHE_HOME", xdg_before);
    set_or_unset("HOME", home_before);
}

TEST_F(CacheTest, TheVerbListsAndRemoves) {
    EXPECT_THAT(run({"cache"}).out, HasSubstr("0 trees"));
    write_text(path("other.obj"), "# another\n" + read_text(path("ball.obj")));
    EXPECT_EQ(origin("ball.obj"), "built");
    let_time_pass();
    EXPECT_EQ(origin("other.obj"), "built");
    const Json listed = run({"cache", "--json", "-"}).json();
    EXPECT_THAT(keys(listed), ::testing::UnorderedElementsAre("folder", "limit_bytes", "removed", "trees"));
    EXPECT_EQ(listed["folder"], path("cache").string());
    EXPECT_EQ(listed["limit_bytes"], 4ull << 30);
    ASSERT_EQ(listed["trees"].size(), 2u);
    EXPECT_EQ(listed["trees"][0]["source"], "other.obj");
    EXPECT_EQ(listed["trees"][0]["bytes"], fs::file_size(listed["trees"][0]["file"].get<std::string>()));
    EXPECT_THAT(listed["trees"][0]["last_use"].get<std::string>(), ::testing::StartsWith("20"));
    const std::string text = run({"cache"}).out;
    EXPECT_THAT(text, ::testing::AllOf(HasSubstr("ball.obj"), HasSubstr("other.obj"), HasSubstr("2 trees")));

    write_text(path("cache/note.txt"), "mine");
    const std::uint64_t bytes = listed["trees"][0]["bytes"];
    EXPECT_EQ(run({"cache", "--limit", std::to_string(bytes), "--json", "-"}).json()["removed"], 1);
    EXPECT_THAT(kept(), ElementsAre("other.obj"));
    EXPECT_THAT(run({"cache", "--clear"}).out, HasSubstr("removed 1 tree\n"));
    EXPECT_THAT(kept(), IsEmpty());
    EXPECT_TRUE(fs::exists(path("cache/note.txt"))) << "what is no tree of the cache is not its business";
    for (const char* size : {"0", "-1", "nan", "1.5G", "G", "20000000T", "4KB"})
        EXPECT_EQ(run({"cache", "--limit", size}).status, 2) << size;
}

TEST_F(CacheTest, MeasurementsOfTreeFilesAreKept) {
    ASSERT_EQ(run({"build", "ball.obj", "-o", "plain.vdt", "--no-fold-errors"}).status, 0);
    const Outcome first = run({"simplify", "plain.vdt", "-o", "first.ply"});
    EXPECT_THAT(first.err, HasSubstr("measured the tree of plain.vdt"));
    EXPECT_THAT(kept(), ElementsAre("plain.vdt"));
    const Outcome second = run({"simplify", "plain.vdt", "-o", "second.ply"});
    EXPECT_EQ(second.err, "");
    EXPECT_TRUE(read_text(path("first.ply")) == read_text(path("second.ply")));

    // Another light makes another tree of it.
    const Words lit = {"simplify", "plain.vdt", "--light", "0", "0", "1", "-o"};
    const auto with = [&](Words more) { return run(joined(lit, more)); };
    EXPECT_EQ(with({"lit.ply"}).status, 0);
    EXPECT_EQ(with({"lit-anew.ply", "--no-cache"}).status, 0);
    EXPECT_TRUE(read_text(path("lit.ply")) == read_text(path("lit-anew.ply")));
    EXPECT_THAT(kept(), SizeIs(1));
}

TEST_F(CacheTest, WhatFoldsChangeUnderLightsIsKept) {
    write_ball("ball.obj", 4, 6);
    write_text(path("lights.json"), R"({"ambient": 0.1, "lights": [{"type": "directional", "direction": [1, 2, 0.5],
                                        "intensity": 0.8}]})");
    write_text(path("other.json"), R"({"ambient": 0.2, "lights": [{"type": "directional", "direction": [-1, 0, 1],
                                        "intensity": 0.6}]})");
    const auto lit = [&](const std::string& model, const std::string& lights, const std::string& out, Words more = {}) {
        const Outcome outcome = succeed(joined({"simplify", model, "--lights", lights, "-o", out}, more));
        return outcome.err;
    };
    const std::string measured = "measured what the folds of ball.obj change under lights";
    EXPECT_THAT(lit("ball.obj", "lights.json", "first.ply"), HasSubstr(measured));
    EXPECT_THAT(kept(), ElementsAre("ball.obj+lights", "ball.obj"));
    EXPECT_THAT(run({"cache"}).out, HasSubstr("ball.obj+lights"));
    EXPECT_EQ(lit("ball.obj", "lights.json", "second.ply"), "") << "the second start reads";
    EXPECT_TRUE(read_text(path("first.ply")) == read_text(path("second.ply"))) << "another mesh";
    EXPECT_EQ(lit("ball.obj", "other.json", "other.ply"), "") << "of all lights";
    lit("ball.obj", "lights.json", "anew.ply", {"--no-cache"});
    EXPECT_TRUE(read_text(path("first.ply")) == read_text(path("anew.ply"))) << "what is kept changes the mesh";
    EXPECT_THAT(kept(), SizeIs(2));

    const auto file = [&] {
        for (const auto& tree : TreeCache().trees())
            if (tree.source == "ball.obj+lights") return tree.file;
        return fs::path();
    };
    std::string bytes = read_text(file());
    const std::string whole = bytes;
    bytes[bytes.size() - bytes.size() / 8] ^= 4; // attributes stand last
    write_text(file(), bytes);
    EXPECT_THAT(lit("ball.obj", "lights.json", "second.ply"), HasSubstr(measured));
    EXPECT_TRUE(read_text(path("first.ply")) == read_text(path("second.ply")));
    EXPECT_TRUE(read_text(file()) == whole);
    // Whole trees, but without what belongs there, or of another mesh.
    write_ball("smaller.obj", 4, 5);
    ASSERT_EQ(run({"build", "ball.obj", "-o", "plain.vdt"}).status, 0);
    ASSERT_EQ(run({"build", "smaller.obj", "-o", "smaller.vdt", "--lit-fold-errors"}).status, 0);
    for (const char* foreign : {"plain.vdt", "smaller.vdt"}) {
        write_text(file(), read_text(path(foreign)));
        EXPECT_THAT(lit("ball.obj", "lights.json", "second.ply"), HasSubstr(measured)) << foreign;
        EXPECT_TRUE(read_text(path("first.ply")) == read_text(path("second.ply"))) << foreign;
        EXPECT_TRUE(read_text(file()) == whole) << foreign;
    }
    write_text(path("ball.obj"), "# other bytes\n" + read_text(path("ball.obj")));
    EXPECT_THAT(lit("ball.obj", "lights.json", "second.ply"), HasSubstr(measured));
}

TEST_F(CacheTest, WhatFoldsChangeUnderLightsIsKeptInTreeFiles) {
    write_ball("ball.obj", 4, 6);
    write_text(path("lights.json"), R"({"ambient": 0.1, "lights": [{"type": "directional", "direction": [1, 2, 0.5],
                                        "intensity": 0.8}]})");
    ASSERT_EQ(run({"build", "ball.obj", "-o", "plain.vdt"}).status, 0);
    const Outcome built = succeed({"build", "ball.obj", "-o", "lit.vdt", "--lit-fold-errors", "--json", "-"});
    EXPECT_EQ(built.json()["lit_fold_errors"], true);
    const auto lit = [&](const std::string& tree, const std::string& out) {
        const Outcome outcome = succeed({"simplify", tree, "--lights", "lights.json", "-o", out});
        return outcome.err;
    };
    EXPECT_EQ(lit("lit.vdt", "lit.ply"), "");
    EXPECT_THAT(kept(), IsEmpty()) << "the file has it";
    EXPECT_THAT(lit("plain.vdt", "first.ply"), HasSubstr("measured what the folds of plain.vdt change under lights"));
    EXPECT_THAT(kept(), ElementsAre("plain.vdt+lights"));
    EXPECT_EQ(lit("plain.vdt", "second.ply"), "");
    EXPECT_TRUE(read_text(path("first.ply")) == read_text(path("second.ply")));
    EXPECT_TRUE(read_text(path("first.ply")) == read_text(path("lit.ply")));
}

TEST_F(CacheTest, WhatFoldsChangeUnderLightsIsKeptOfScenes) {
    write_text(path("lights.json"), R"({"ambient": 0.1, "lights": [{"type": "directional", "direction": [1, 2, 0.5],
                                        "intensity": 0.8}]})");
    ASSERT_EQ(run({"simplify", "ball.obj", "--full", "-o", "ball.gltf", "--no-cache"}).status, 0);
    const auto lit = [&](const std::string& out) {
        const Outcome outcome =
            succeed({"simplify", "ball.gltf", "--as", "scene", "--lights", "lights.json", "-o", out});
        return outcome.err;
    };
    EXPECT_THAT(lit("first.gltf"), HasSubstr("measured what the folds of ball.gltf change under lights"));
    EXPECT_THAT(kept(), ElementsAre("ball.gltf+lights", "ball.gltf"));
    EXPECT_EQ(lit("second.gltf"), "");
    EXPECT_TRUE(read_text(path("first.bin")) == read_text(path("second.bin")));
}

TEST_F(CacheTest, AnotherMeshsTreeUnderTheKeyIsRefused) {
    write_ball("smaller.obj", 6, 9);
    EXPECT_EQ(origin("smaller.obj"), "built");
    EXPECT_EQ(origin("ball.obj"), "built");
    fs::path of_ball, of_smaller;
    for (const auto& tree : TreeCache().trees()) (tree.source == "ball.obj" ? of_ball : of_smaller) = tree.file;
    fs::copy_file(of_smaller, of_ball, fs::copy_options::overwrite_existing);
    EXPECT_EQ(origin("ball.obj"), "built");
    EXPECT_EQ(origin("ball.obj"), "cache");
}

TEST_F(CacheTest, WrongSettingsAreSaid) {
    ::setenv("UNSEEN_CACHE_SIZE", "abc", 1);
    EXPECT_THAT(run({"simplify", "ball.obj", "-o", "o.ply"}).err,
                HasSubstr("$UNSEEN_CACHE_SIZE is passed over: 'abc' is no size"));
    write_text(path("file"), "");
    ::setenv("UNSEEN_CACHE", path("file").c_str(), 1);
    EXPECT_THAT(run({"cache"}), fails(1, HasSubstr("file' is no folder: no trees are kept.")));
}

TEST_F(CacheTest, AProgramChoosesTheFolderOrNone) {
    const auto load = [&](const CacheOptions& cache, session::Messages messages = {}) {
        return Scene::load(path("ball.obj"), {.cache = cache, .messages = std::move(messages)});
    };
    const CacheOptions own{.folder = path("own")};
    EXPECT_EQ(load({.is_off = true})->objects[0].origin, TreeOrigin::built);
    const auto cancelled =
        load(own, {.progress = [](double, const char* stage) { return std::string(stage) != "measuring folds"; }});
    ASSERT_FALSE(cancelled);
    EXPECT_EQ(cancelled.error().code, ErrorCode::cancelled);
    EXPECT_FALSE(fs::exists(path("own")));
    EXPECT_EQ(load(own)->objects[0].origin, TreeOrigin::built);
    const auto interrupted = load(own, {.progress = [](double, const char*) { return false; }});
    ASSERT_FALSE(interrupted);
    EXPECT_EQ(interrupted.error().code, ErrorCode::cancelled);
    EXPECT_EQ(load(own)->objects[0].origin, TreeOrigin::cache) << "a cancelled reader removes nothing";
    EXPECT_FALSE(fs::exists(path("cache")));
    EXPECT_THAT(TreeCache(own).trees(), SizeIs(1));
}

TEST_F(CacheTest, MeasuringTellsItsProgress) {
    const auto tree = require(session::load_tree(path("ball.obj"), {.measures = false, .cache = {.is_off = true}}));
    std::vector<double> shares;
    const auto note = [&](double share, const char*) { return shares.push_back(share), true; };
    ASSERT_TRUE(session::measured(*tree, 2, note));
    ASSERT_THAT(shares, Not(IsEmpty()));
    EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
    EXPECT_GE(shares.front(), 0);
    EXPECT_LE(shares.back(), 1);
}

TEST(Size, HasUnits) {
    EXPECT_EQ(*session::parse_size("12"), 12u);
    EXPECT_EQ(*session::parse_size("3K"), 3072u);
    EXPECT_EQ(*session::parse_size("4G"), 4ull << 30);
    for (const char* text : {"", "0", "0G", "G", "-1", "1k", "1 G", "1GM", "16777216T", "1e3"})
        EXPECT_FALSE(session::parse_size(text)) << text;
}

} // namespace cache_test
