// unseen levels precompute and unseen-bench selection: levels selected beforehand, as a user asks for them; when it is killed on the way, and by several
// processes.
#include "run_command.h"

namespace select_command_test {

using namespace unseen::app::testing;

class SelectCommandTest : public CommandTest {
protected:
    void SetUp() override {
        CommandTest::SetUp();
        succeed({"make", "scene", "bunnies", "-o", "scene.glb", "--triangles", "12000"});
        if (!no_opengl().empty()) GTEST_SKIP() << no_opengl();
    }
    Words words(const std::string& out) const {
        return {"levels", "precompute", "scene.glb", "-o",      out, "--triangles", "8000", "--window",
                "64",     "--spacing",  "25",        "--depth", "1"};
    }
    // Selects as words() say, once for all tests.
    void select(const std::string& out) const {
        static std::string made;
        if (made.empty()) {
            succeed(words(out));
            made = read_text(path(out));
        }
        write_text(path(out), made);
    }
    std::string text(const std::string& out) const {
        std::string all = UNSEEN_COMMAND;
        for (const std::string& word : words(out)) all += " " + word;
        return all;
    }
};

TEST_F(SelectCommandTest, SelectsTellsAndDraws) {
    auto asked = words("a.sel");
    asked.insert(asked.end(), {"--json", "-"});
    const Json report = succeed(asked).json();
    EXPECT_GT(report["cameras"], 10);
    EXPECT_EQ(report["resumed_corners"], 0);
    EXPECT_GT(report["evaluations"], report["cameras"]);
    EXPECT_THAT(files(), UnorderedElementsAre("scene.glb", "a.sel"));

    const Outcome told = succeed({"levels", "info", "a.sel", "--json", "-"});
    EXPECT_EQ(told.json()["budget"], 8000);
    EXPECT_EQ(told.json()["objects"], 40);
    EXPECT_EQ(told.json()["cameras"], report["cameras"]);
    EXPECT_THAT(run({"levels", "info", "a.sel"}).out, HasSubstr("selected at level 4"));

    const Json flight = succeed({"levels", "scene.glb", "--method", "selection", "--selection", "a.sel", "--path",
                                 "walk:60:12", "--size", "160x90", "--json", "-"})
                            .json();
    EXPECT_EQ(flight["method"], "selection");
    ASSERT_EQ(flight["frames"].size(), 12u);
    int changed = 0;
    for (const Json& frame : flight["frames"]) {
        EXPECT_LE(frame["triangles"], 8000);
        EXPECT_GT(frame["triangles"], 2000);
        changed += frame["changed"].get<int>();
    }
    EXPECT_GT(changed, 0);
    const Outcome less = succeed({"levels", "scene.glb", "--method", "selection", "--selection", "a.sel", "--triangles",
                                  "5000", "--size", "160x90", "-o", "still.png", "--json", "-"});
    EXPECT_LE(less.json()["frames"][0]["triangles"], 5000);
}

TEST_F(SelectCommandTest, GoesOnAfterItWasKilled) {
    select("whole.sel");
    const fs::path out = folder().string() + ".kill.out", err = folder().string() + ".kill.err";
    int kills = 0, resumed = 0;
    for (const int signal : {SIGKILL, SIGINT, SIGKILL, SIGTERM}) {
        const pid_t process = start(words("parts.sel"), out, err);
        ASSERT_GT(process, 0);
        // Until something new is done.
        const auto size = [&] {
            std::error_code none;
            const auto bytes = fs::file_size(path("parts.sel.part"), none);
            return none ? std::uintmax_t{0} : bytes;
        };
        const auto before = size(), head = std::uintmax_t{100}; // bytes before the first corner are fewer
        const auto patience = std::chrono::steady_clock::now() + std::chrono::seconds(60);
        while (size() <= std::max(before, head) && !fs::exists(path("parts.sel")) &&
               std::chrono::steady_clock::now() < patience)
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        ::kill(process, signal);
        const int status = wait_for(process);
        if (fs::exists(path("parts.sel"))) break; // it was quicker
        EXPECT_EQ(status, -signal) << read_text(err);
        ++kills;
    }
    EXPECT_GT(kills, 0);
    auto asked = words("parts.sel");
    asked.insert(asked.end(), {"--json", "-"});
    const Outcome rest = succeed(asked);
    resumed = rest.json()["resumed_corners"];
    EXPECT_GE(resumed, kills);
    EXPECT_TRUE(read_text(path("parts.sel")) == read_text(path("whole.sel")));
    EXPECT_FALSE(fs::exists(path("parts.sel.part")));
    for (const fs::path& file : {out, err, fs::path(out.string() + ".in")}) fs::remove(file);
}

TEST_F(SelectCommandTest, WhatIsWrongIsSaid) {
    write_text(path("bad.sel"), "no selections");
    const Outcome bad = run({"levels", "info", "bad.sel"});
    EXPECT_EQ(bad.status, 1);
    EXPECT_THAT(bad.err, HasSubstr("no file of selections"));
    EXPECT_EQ(run({"levels", "scene.glb", "--method", "selection", "-o", "a.png"}).status, 2);
    EXPECT_EQ(run({"render", "scene.glb", "--selection", "bad.sel", "-o", "a.png"}).status, 2);
    EXPECT_EQ(run({"levels", "precompute", "scene.glb", "-o", "a.sel"}).status, 2);
    EXPECT_EQ(run({"levels", "precompute", "scene.glb", "-o", "a.png", "--triangles", "9"}).status, 2);
    // Of another scene.
    select("a.sel");
    ASSERT_EQ(run({"make", "scene", "bunnies", "-o", "scene.glb", "--triangles", "12000", "--seed", "2"}).status, 0);
    EXPECT_THAT(run({"levels", "scene.glb", "--method", "selection", "--selection", "a.sel", "-o", "a.png"}),
                fails(1, HasSubstr("another scene")));
}

TEST_F(SelectCommandTest, AFlightIsMeasured) {
    select("scene.sel");
    const Outcome measured =
        run_program({UNSEEN_BENCH_COMMAND, "selection", "scene.glb", "--selection", "scene.sel", "--triangles", "6000",
                     "--frames", "40", "--every", "20", "--size", "96", "54", "--samples", "1", "--json", "-"});
    ASSERT_EQ(measured.status, 0) << measured.err;
    const Json scene = measured.json()["scenes"][0];
    EXPECT_EQ(scene["scene"], "scene");
    ASSERT_EQ(scene["methods"].size(), 6u);
    for (const Json& method : scene["methods"]) {
        ASSERT_EQ(method["frames"].size(), 2u) << method["levels"];
        for (const Json& frame : method["frames"]) {
            EXPECT_GT(frame["ssim"], 0.5);
            EXPECT_LE(frame["ssim"], 1);
            const bool is_within = method["levels"] != "by area, the thesis's thresholds";
            EXPECT_LE(frame["triangles"], is_within ? 6000 : 12'000) << method["levels"];
        }
    }
}

TEST_F(SelectCommandTest, QualitiesAreMeasured) {
    const Outcome measured = run_shell("exec '" UNSEEN_BENCH_COMMAND
                                       "' selection scene.glb --triangles 6000 --spacing 25 --window 32 --frames 10 "
                                       "--every 10 --size 96 54 --samples 1 --quality pixels --quality ssim --json -");
    ASSERT_EQ(measured.status, 0) << measured.err;
    const Json scene = measured.json()["scenes"][0];
    ASSERT_EQ(scene["precompute"].size(), 2u);
    ASSERT_EQ(scene["methods"].size(), 7u);
    EXPECT_EQ(scene["methods"][0]["levels"], "selected, by ssim");
    EXPECT_EQ(scene["methods"][1]["levels"], "selected, by pixels");
}

TEST_F(SelectCommandTest, LevelsAreAsManyAsAreAskedFor) {
    ASSERT_EQ(run_shell(text("few.sel") + " --levels 3").status, 0);
    const Outcome told = run({"levels", "info", "few.sel", "--json", "-"});
    EXPECT_EQ(told.json()["levels"], 3);
    const Json flight = succeed({"levels", "scene.glb", "--method", "selection", "--selection", "few.sel", "-o",
                                 "few.png", "--json", "-"})
                            .json();
    for (const Json& object : flight["objects"]) EXPECT_LE(object["level_triangles"].size(), 3u);
    EXPECT_EQ(run_shell(text("one.sel") + " --levels 1").status, 2);
}

#ifdef UNSEEN_MPIRUN
TEST_F(SelectCommandTest, SeveralProcessesSelectTheSame) {
    select("alone.sel");
    for (const int processes : {2, 3}) {
        const Outcome done =
            run_shell("exec timeout -s KILL 120 '" UNSEEN_MPIRUN "' --allow-run-as-root --oversubscribe -np " +
                      std::to_string(processes) + " " + text("team.sel") + " --json -");
        ASSERT_EQ(done.status, 0) << done.err;
        EXPECT_EQ(done.json()["processes"], processes) << done.out;
        EXPECT_TRUE(read_text(path("team.sel")) == read_text(path("alone.sel"))) << processes << " processes";
        fs::remove(path("team.sel"));
    }
    // What is wrong for all is said once.
    write_text(path("scene.glb"), "no scene");
    const Outcome bad = run_shell(
        "exec timeout -s KILL 120 '" UNSEEN_MPIRUN "' --allow-run-as-root --oversubscribe -np 2 " + text("team.sel"));
    EXPECT_NE(bad.status, 0);
    EXPECT_THAT(bad.err, HasSubstr("unseen: "));
    EXPECT_EQ(bad.err.find("unseen: "), bad.err.rfind("unseen: ")) << bad.err;
    EXPECT_FALSE(fs::exists(path("team.sel")));
}
#endif

} // namespace select_command_test
