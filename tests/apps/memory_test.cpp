// unseen build --memory: the same tree in less memory, and one clear sentence where memory or the disk is too small. And
// trees that are too large to be read into memory.
#include <csignal>
#include <vector>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/tree_io.h>

#include "run_command.h"
#include "shapes.h"

namespace {

using namespace unseen::app::testing;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;

class MemoryTest : public CommandTest {
protected:
    // Takes more than the least limit, in each way of clustering.
    void write_large() const {
        write_ball("ball.obj", 80, 80);
        const Outcome made = run({"make", "subdivide", "ball.obj", "-o", "large.ply", "--triangles", "600000"});
        ASSERT_EQ(made.status, 0) << made.err;
        fs::remove(path("ball.obj"));
    }

    Outcome build(const std::string& out, const std::string& clusterer, std::vector<std::string> more) const {
        std::vector<std::string> words = {
            "build", "large.ply",        "-o",     out, "--clusterer", clusterer, "--threads",
            "1",     "--no-fold-errors", "--json", "-"};
        words.insert(words.end(), more.begin(), more.end());
        return run(words);
    }

    // With a disk that has room for so many bytes of temporary data.
    Outcome build_with_room(long long bytes, const std::string& clusterer) const {
        return run_shell("UNSEEN_TEST_ROOM=" + std::to_string(bytes) +
                         " ASAN_OPTIONS=verify_asan_link_order=0 LD_PRELOAD='" UNSEEN_FULL_DISK "' '" UNSEEN_COMMAND
                         "' build large.ply -o large.vdt --no-fold-errors --clusterer " +
                         clusterer + " --threads 1 --memory " + limit);
    }

    static bool is_not_empty(const fs::path& file) {
        std::error_code gone; // it has got its name, perhaps
        const auto size = fs::file_size(file, gone);
        return !gone && size > 0;
    }
    bool lies_in_memory() const {
        return run({"build", "large.ply", "-o", "t.vdt", "--no-fold-errors", "--memory", limit})
                   .err.find("lies in memory") != std::string::npos;
    }

    static constexpr const char* limit = "0.1";
};

// Trees of 256 MiB and more are read in place.
TEST_F(MemoryTest, ATreeCutShortWhileItIsDrawnIsAnError) {
    const auto tree = unseen::vdtree::build_tree(unseen::shapes::bumpy_sphere(4).view());
    ASSERT_TRUE(tree);
    constexpr std::size_t ballast = (std::size_t{256} << 20) / sizeof(float);
    const auto heavy =
        tree->with_attribute("ballast", unseen::vdtree::AttributeDomain::tree, std::vector<float>(ballast, 1.0f));
    ASSERT_TRUE(heavy);
    ASSERT_TRUE(unseen::vdtree::write_tree(path("heavy.vdt"), *heavy));
    if (run({"render", "heavy.vdt", "--pixels", "1", "-o", "o.png"}).err.find("No OpenGL") != std::string::npos)
        GTEST_SKIP() << "no OpenGL";
    const fs::path log = folder().string() + ".log";
    const pid_t process = start(
        {"render", "heavy.vdt", "--pixels", "1", "--path", "orbit:0.01:1000000", "--csv", "frames.csv"}, log, log);
    ASSERT_GT(process, 0);
    const fs::path maps = "/proc/" + std::to_string(process) + "/maps";
    for (int i = 0; i < 3000 && read_text(maps).find("heavy.vdt") == std::string::npos; ++i) usleep(10'000);
    usleep(300'000); // the first frames
    fs::resize_file(path("heavy.vdt"), 0);
    EXPECT_EQ(wait_for(process), 1);
    EXPECT_THAT(read_text(log), HasSubstr("heavy.vdt' was cut short while it was read: write it anew"));
    EXPECT_THAT(files(), UnorderedElementsAre("heavy.vdt", "o.png"));
    for (const fs::path& file : {log, fs::path(log.string() + ".in")}) fs::remove(file);
}

TEST_F(MemoryTest, TheTreeIsTheSame) {
    write_large();
    if (lies_in_memory()) GTEST_SKIP() << "the folder for temporary files lies in memory";
    fs::remove(path("t.vdt"));
    for (const std::string clusterer : {"octree", "quadric"}) {
        const Outcome usual = build("usual.vdt", clusterer, {}),
                      limited = build("limited.vdt", clusterer, {"--memory", limit});
        ASSERT_EQ(usual.status, 0) << usual.err;
        ASSERT_EQ(limited.status, 0) << limited.err;
        EXPECT_TRUE(read_text(path("limited.vdt")) == read_text(path("usual.vdt"))) << clusterer;
        if (clusterer == "quadric") { // which takes half as much again as the limit
            EXPECT_LT(limited.json()["peak_bytes"].get<double>(), usual.json()["peak_bytes"].get<double>());
        }
        EXPECT_THAT(files(), UnorderedElementsAre("large.ply", "usual.vdt", "limited.vdt"));
    }
}

TEST_F(MemoryTest, ALimitThatIsTooSmallIsSaid) {
    write_ball("ball.obj");
    for (const std::string gib : {"0.001", "0.07"}) {
        const Outcome built = run({"build", "ball.obj", "-o", "ball.vdt", "--memory", gib});
        EXPECT_EQ(built.status, 1);
        EXPECT_THAT(built.err, IsAnErrorForPeople());
        EXPECT_THAT(built.err, HasSubstr("--memory " + gib + " GiB is too small"));
        EXPECT_THAT(built.err, HasSubstr("at least"));
        EXPECT_THAT(files(), ElementsAre("ball.obj"));
    }
    write_large();
    const Outcome built =
        build("large.vdt", "quadric", {"--memory", "0.08"}); // enough for a ball, but not for this one
    EXPECT_EQ(built.status, 1);
    EXPECT_THAT(built.err, HasSubstr("--memory 0.08 GiB is too small"));
    EXPECT_THAT(files(), ElementsAre("large.ply"));
}

TEST_F(MemoryTest, ADiskThatIsFullBeforeTheBuildIsDoneLeavesNothing) {
    write_large();
    if (lies_in_memory()) GTEST_SKIP() << "the folder for temporary files lies in memory";
    fs::remove(path("t.vdt"));
    for (const std::string clusterer : {"octree", "quadric"}) {
        int failures = 0;
        // It fails while it reads, clusters, orders and bounds.
        for (long long room = 1'000'000;; room *= 2) {
            const Outcome built = build_with_room(room, clusterer);
            if (built.status == 0) break;
            ++failures;
            ASSERT_EQ(built.status, 1) << clusterer << " with room for " << room << " bytes: " << built.err;
            EXPECT_THAT(built.err, IsAnErrorForPeople()) << built.err;
            ASSERT_THAT(built.err, HasSubstr("there is no room for")) << built.err;
            EXPECT_THAT(files(), ElementsAre("large.ply"));
        }
        EXPECT_GT(failures, 7) << clusterer;
        fs::remove(path("large.vdt"));
    }
}

TEST_F(MemoryTest, ATreeThatTheDiskHasNoRoomForLeavesNothing) {
    write_ball("ball.obj", 80, 80);
    // Files of 100 blocks of 512 bytes at most.
    for (const std::string memory : {"", " --memory 0.1"}) {
        const Outcome built = run_shell("ulimit -f 100; exec '" UNSEEN_COMMAND "' build ball.obj -o ball.vdt" + memory);
        EXPECT_EQ(built.status, 1) << memory;
        EXPECT_THAT(built.err, IsAnErrorForPeople());
        EXPECT_THAT(files(), ElementsAre("ball.obj")) << memory;
    }
}

TEST_F(MemoryTest, WhatAKilledBuildLeavesIsRemovedAtTheNextStart) {
    write_large();
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
    ASSERT_EQ(build("large.vdt", "octree", {}).status, 0);
    EXPECT_THAT(files(), UnorderedElementsAre("large.ply", "large.vdt"));
}

} // namespace
