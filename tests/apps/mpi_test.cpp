// mpirun unseen build: the same tree as one process makes, said once; and no tree where a process fails or is killed.
#include "run_command.h"

namespace {

using namespace unseen::app::testing;
using ::testing::HasSubstr;

class TeamTest : public CommandTest {
protected:
    static constexpr int most_seconds = 60;

    // `mpirun -np N COMMAND`, each process a shell, where rank is $OMPI_COMM_WORLD_RANK. Where a process dies while it is
    // being started, mpirun itself may wait for ever when all are gone: it is killed then.
    Outcome run_team(int processes, const std::string& command) const {
        return run_shell("exec timeout -s KILL " + std::to_string(most_seconds) +
                         " '" UNSEEN_MPIRUN "' --allow-run-as-root --oversubscribe -np " + std::to_string(processes) +
                         " sh -c '" + command + "'");
    }

    // Several parts, of 2^15 vertices each at most.
    void write_parts() const { write_ball("large.obj", 250, 300); }
    void build_alone() const {
        succeed({"build", "large.obj", "--no-fold-errors", "-o", "alone.vdt", "--threads", "2"});
    }
    // Where a process was killed: one tree or none, never a part of one. Whoever is killed on the way out has left a
    // whole one.
    void expect_whole_or_none(const Outcome& built) const {
        const bool is_there = fs::exists(path("team.vdt"));
        const bool was_killed = built.err.empty() && built.status != 0; // mpirun, too
        EXPECT_TRUE(built.status != 0 || is_there) << built.err;
        if (was_killed) GTEST_LOG_(INFO) << "mpirun did not end within " << most_seconds << " s";
        EXPECT_TRUE(!is_there || read_text(path("team.vdt")) == read_text(path("alone.vdt"))) << "a part of a tree";
        fs::remove(path("team.vdt"));
    }
};

TEST_F(TeamTest, MakesTheSameTreeAndSaysSoOnce) {
    write_parts();
    build_alone();
    for (const int processes : {1, 2, 3}) {
        const Outcome built =
            run_team(processes, "exec " UNSEEN_COMMAND " build large.obj --no-fold-errors -o team.vdt --json -");
        ASSERT_EQ(built.status, 0) << built.err;
        EXPECT_TRUE(built.json().is_object()) << built.out;
        EXPECT_EQ(built.err, "");
        EXPECT_TRUE(read_text(path("team.vdt")) == read_text(path("alone.vdt"))) << processes << " processes";
        fs::remove(path("team.vdt"));
        EXPECT_THAT(files(), ::testing::UnorderedElementsAre("large.obj", "alone.vdt"));
    }
}

TEST_F(TeamTest, TheOctreeNeedsOneProcessButTakesMore) {
    write_ball("ball.obj");
    ASSERT_EQ(run({"build", "ball.obj", "-o", "alone.vdt", "--clusterer", "octree"}).status, 0);
    const Outcome built = run_team(2, "exec " UNSEEN_COMMAND " build ball.obj -o team.vdt --clusterer octree");
    ASSERT_EQ(built.status, 0) << built.err;
    EXPECT_TRUE(read_text(path("team.vdt")) == read_text(path("alone.vdt")));
}

TEST_F(TeamTest, ABadMeshIsSaidOnce) {
    write_text(path("bad.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n");
    const Outcome built = run_team(2, "exec " UNSEEN_COMMAND " build bad.obj -o team.vdt");
    EXPECT_NE(built.status, 0);
    EXPECT_EQ(built.out, "");
    EXPECT_THAT(built.err, HasSubstr("unseen: "));
    EXPECT_EQ(built.err.find("unseen: "), built.err.rfind("unseen: ")) << built.err;
    EXPECT_THAT(files(), ::testing::UnorderedElementsAre("bad.obj"));
}

TEST_F(TeamTest, MembersThatDoNotHaveTheSameMeshAreToldSo) {
    write_ball("0.obj");
    write_ball("1.obj", 25, 32);
    const Outcome differs = run_team(2, "exec " UNSEEN_COMMAND " build $OMPI_COMM_WORLD_RANK.obj -o team.vdt");
    EXPECT_NE(differs.status, 0);
    EXPECT_THAT(differs.err, HasSubstr("another mesh"));
    fs::remove(path("1.obj"));
    const Outcome missing = run_team(2, "exec " UNSEEN_COMMAND " build $OMPI_COMM_WORLD_RANK.obj -o team.vdt");
    EXPECT_NE(missing.status, 0);
    EXPECT_THAT(missing.err, HasSubstr("Process 1: "));
    EXPECT_THAT(files(), ::testing::UnorderedElementsAre("0.obj"));
}

TEST_F(TeamTest, AMemberThatDiesLeavesNoPartOfATree) {
    write_parts();
    build_alone();
    // Member 1 is killed while it clusters or before; the others must not wait for it for ever.
    for (const std::string seconds : {"0.05", "0.3"}) {
        const Outcome built =
            run_team(2, "if [ $OMPI_COMM_WORLD_RANK = 1 ]; then exec timeout -s KILL " + seconds +
                            " " UNSEEN_COMMAND
                            " build large.obj --no-fold-errors -o team.vdt --threads 1; else exec " UNSEEN_COMMAND
                            " build large.obj --no-fold-errors -o team.vdt --threads 1; fi");
        expect_whole_or_none(built);
    }
}

TEST_F(TeamTest, WhatADeadTeamLeavesIsRemovedAtTheNextStart) {
    write_parts();
    build_alone();
    // Member 0 is killed sooner or later, perhaps while it writes.
    for (const std::string seconds : {"0.1", "0.4", "0.6"}) {
        const Outcome built = run_team(2, "if [ $OMPI_COMM_WORLD_RANK = 0 ]; then exec timeout -s KILL " + seconds +
                                              " " UNSEEN_COMMAND
                                              " build large.obj --no-fold-errors -o team.vdt; else exec " UNSEEN_COMMAND
                                              " build large.obj --no-fold-errors -o team.vdt; fi");
        expect_whole_or_none(built);
    }
    succeed({"build", "large.obj", "--no-fold-errors", "-o", "team.vdt"});
    EXPECT_THAT(files(), ::testing::UnorderedElementsAre("large.obj", "alone.vdt", "team.vdt"));
}

} // namespace
