// Builds and trees that are cut short: by a full disk, a kill, or somebody who truncates or overwrites a mapped tree.
#include <csignal>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/tree_io.h>

#include "run_command.h"
#include "shapes.h"

namespace cut_short_test {

using namespace unseen::app::testing;

class CutShortTest : public CommandTest {
protected:
    static bool is_not_empty(const fs::path& file) {
        std::error_code gone; // it has got its name, perhaps
        const auto size = fs::file_size(file, gone);
        return !gone && size > 0;
    }
};

// Trees of 256 MiB and more are mapped.
TEST_F(CutShortTest, ATreeCutShortOrOverwrittenWhileItIsDrawnIsAnError) {
    const auto tree = require(unseen::vdtree::build_tree(unseen::shapes::bumpy_sphere(4).view()));
    constexpr std::size_t ballast = (std::size_t{256} << 20) / sizeof(float);
    const auto heavy =
        tree->with_attribute("ballast", unseen::vdtree::AttributeDomain::tree, std::vector<float>(ballast, 1.0f));
    ASSERT_TRUE(heavy);
    ASSERT_TRUE(unseen::vdtree::write_tree(path("heavy.vdt"), *heavy));
    if (run({"render", "heavy.vdt", "--pixels", "1", "-o", "o.png"}).err.find("No OpenGL") != std::string::npos)
        GTEST_SKIP() << "no OpenGL";
    const fs::path log = folder().string() + ".log";
    for (const bool is_overwritten : {true, false}) {
        const pid_t process = start(
            {"fly", "heavy.vdt", "--pixels", "1", "--path", "orbit:0.01:1000000", "--csv", "frames.csv"}, log, log);
        ASSERT_GT(process, 0);
        const fs::path maps = "/proc/" + std::to_string(process) + "/maps";
        for (int i = 0; i < 3000 && read_text(maps).find("heavy.vdt") == std::string::npos; ++i) usleep(10'000);
        usleep(300'000); // the first frames
        if (is_overwritten) {
            std::fstream file(path("heavy.vdt"), std::ios::binary | std::ios::in | std::ios::out);
            file << std::string(4096, 'Z');
        } else {
            fs::resize_file(path("heavy.vdt"), 0);
        }
        EXPECT_EQ(wait_for(process), 1);
        EXPECT_THAT(read_text(log), HasSubstr("heavy.vdt' was cut short or changed while it was read: write it anew"));
        EXPECT_THAT(files(), UnorderedElementsAre("heavy.vdt", "o.png"));
        ASSERT_TRUE(unseen::vdtree::write_tree(path("heavy.vdt"), *heavy));
    }
    for (const fs::path& file : {log, fs::path(log.string() + ".in")}) fs::remove(file);
}

TEST_F(CutShortTest, ATreeThatTheDiskHasNoRoomForLeavesNothing) {
    write_ball("ball.obj", 80, 80);
    // Files of 100 blocks of 512 bytes at most.
    const Outcome built = run_shell("ulimit -f 100; exec '" UNSEEN_COMMAND "' build ball.obj -o ball.vdt");
    EXPECT_EQ(built.status, 1);
    EXPECT_THAT(built.err, IsAnErrorForPeople());
    EXPECT_THAT(files(), ElementsAre("ball.obj"));
}

TEST_F(CutShortTest, WhatAKilledBuildLeavesIsRemovedAtTheNextStart) {
    write_ball("ball.obj", 80, 80);
    ASSERT_EQ(run({"make", "subdivide", "ball.obj", "-o", "large.ply", "--triangles", "600000"}).status, 0);
    fs::remove(path("ball.obj"));
    // While it writes: the tree lies there under a temporary name.
    bool left_something = false;
    for (int attempt = 0; attempt < 20 && !left_something; ++attempt) {
        const fs::path log = folder().string() + ".log";
        const pid_t building =
            start({"build", "large.ply", "-o", "large.vdt", "--clusterer", "octree", "--no-fold-errors"}, log, log);
        ASSERT_GT(building, 0);
        while (waitpid(building, nullptr, WNOHANG) == 0) {
            for (const std::string& name : files())
                if (name.ends_with(".tmp") && is_not_empty(path(name))) kill(building, SIGKILL);
        }
        fs::remove(log), fs::remove(log.string() + ".in");
        left_something = files().size() > 1 && !fs::exists(path("large.vdt"));
        fs::remove(path("large.vdt"));
    }
    ASSERT_TRUE(left_something);
    ASSERT_EQ(run({"build", "large.ply", "-o", "large.vdt", "--no-fold-errors"}).status, 0);
    EXPECT_THAT(files(), UnorderedElementsAre("large.ply", "large.vdt"));
}

} // namespace cut_short_test
