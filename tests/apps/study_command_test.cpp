// unseen study: pictures, answers of a simulated observer, and what they come to.
#include "run_command.h"

namespace study_command_test {

using namespace unseen::app::testing;
using ::testing::HasSubstr;

class StudyCommandTest : public DrawingCommandTest {
protected:
    Outcome make(const Words& more = {}) const {
        return run(joined(
            {"study", "make", "ball.vdt", "-o", "s", "--size", "200x160", "--views", "4", "--samples", "4"}, more));
    }
    Json analysis(const Words& files) const {
        Words words = joined({"study", "analyse"}, files);
        words.insert(words.end(), {"--json", "-"});
        const Outcome outcome = succeed(words);
        return outcome.json();
    }
};

TEST_F(StudyCommandTest, WhatIsPlainIsToldAndWhatIsImperceptibleIsNot) {
    const Outcome made = make({"--repeats", "25", "--condition", "imperceptible", "--condition", "triangles:5%"});
    ASSERT_EQ(made.status, 0) << made.err;
    // Training: a view each; two conditions of four views, 25 times.
    EXPECT_THAT(made.out, HasSubstr("12 pairs, 204 trials"));
    EXPECT_TRUE(fs::exists(path("s/ball-view4-original.png")));
    succeed({"study", "run", "s", "--simulate", "default", "--subject", "nobody"});
    const Json result = analysis({"s/answers-nobody.csv"});
    ASSERT_EQ(result["conditions"].size(), 2u);
    for (const Json& condition : result["conditions"]) {
        EXPECT_EQ(condition["seen"]["of"], 100);
        if (condition["condition"] == "imperceptible") {
            EXPECT_LT(condition["seen"]["low"], 0.5);
            EXPECT_GT(condition["chance"], 0.01);
        } else {
            EXPECT_GT(condition["seen"]["share"], 0.9);
            EXPECT_LT(condition["chance"], 1e-6);
        }
    }
    EXPECT_TRUE(result["careless"].empty());
}

TEST_F(StudyCommandTest, GoesOnWhereItWasLeft) {
    ASSERT_EQ(make().status, 0);
    ASSERT_EQ(run({"study", "run", "s", "--simulate", "median"}).status, 0);
    const std::string whole = read_text(path("s/answers-unnamed.csv"));
    std::size_t end = 0;
    for (int line = 0; line < 5; ++line) end = whole.find('\n', end) + 1;
    write_text(path("s/answers-unnamed.csv"), whole.substr(0, end));
    ASSERT_EQ(run({"study", "run", "s", "--simulate", "median"}).status, 0);
    EXPECT_EQ(read_text(path("s/answers-unnamed.csv")), whole);
    EXPECT_THAT(
        run({"study", "run", "s", "--simulate", "median", "--subject", "bob", "--answers", "s/answers-unnamed.csv"}),
        fails(1, HasSubstr("the column subject is 'unnamed'")));
    EXPECT_EQ(read_text(path("s/answers-unnamed.csv")), whole);
}

TEST_F(StudyCommandTest, LevelsArePairedByWhatIsDecided) {
    // Small and far away a coarser level is kept than from near by.
    succeed({"study", "make", "ball.vdt", "-o", "s", "--levels", "--maps", "rpg99", "--size", "200x160", "--views", "2",
             "--distances", "1", "8", "--samples", "4", "--repeats", "2"});
    const Json study = Json::parse(read_text(path("s/study.json")));
    int maintained = 0;
    for (const Json& pair : study["pairs"]) {
        const std::string condition = pair["condition"];
        if (condition == "original") continue;
        const int kept = std::stoi(condition.substr(6));
        const auto shows = [&](const char* which, int level) {
            return std::string(pair[which]).ends_with("-level" + std::to_string(level) + ".png");
        };
        if (condition.ends_with("decrease")) {
            EXPECT_TRUE(shows("original", 0) && shows("other", kept - 1) && !pair["predicted_seen"]) << condition;
        } else if (condition.ends_with("maintain")) {
            EXPECT_TRUE(shows("original", kept - 1) && shows("other", kept) && !pair["predicted_seen"]) << condition;
            ++maintained;
        } else {
            EXPECT_TRUE(shows("original", 0) && shows("other", kept + 1) && pair["predicted_seen"]) << condition;
        }
    }
    EXPECT_GT(maintained, 0);
    ASSERT_EQ(run({"study", "run", "s", "--simulate", "median"}).status, 0);
    const Json result = analysis({"s/answers-unnamed.csv"});
    EXPECT_FALSE(result["steps"].empty());
    EXPECT_EQ(result["steps_of_2007"].size(), 12u);
    const Outcome printed = run({"study", "analyse", "s/answers-unnamed.csv"});
    EXPECT_THAT(printed.out, HasSubstr("people, 2007"));
    EXPECT_EQ(make({"--maps", "rpg99"}).status, 2);
}

TEST_F(StudyCommandTest, RefusesWhatItCannotDo) {
    const Outcome unknown = make({"--condition", "twice"});
    EXPECT_EQ(unknown.status, 1);
    EXPECT_THAT(unknown.err, HasSubstr("'twice' is no condition"));
    EXPECT_EQ(make({"--condition", "triangles:-5"}).status, 1);
    EXPECT_EQ(make({"--levels", "--task", "which"}).status, 2);
    const Outcome nowhere = run({"study", "run", "nowhere", "--simulate", "median"});
    EXPECT_EQ(nowhere.status, 1);
    EXPECT_THAT(nowhere.err, HasSubstr("nowhere"));
    ASSERT_EQ(make().status, 0);
    EXPECT_EQ(run({"study", "run", "s", "--simulate", "somebody"}).status, 1);
    EXPECT_EQ(run({"study", "run", "s", "--simulate", "median", "--subject", "../x"}).status, 2);
    const Outcome near = run({"study", "run", "s", "--simulate", "median", "--distance", "1"});
    EXPECT_THAT(near.err, HasSubstr("made for 34.4 pixels a degree"));
    fs::remove(path("s/ball-view2-1.png"));
    fs::remove(path("s/answers-unnamed.csv"));
    EXPECT_THAT(run({"study", "run", "s", "--simulate", "median"}), fails(1, HasSubstr("ball-view2-1.png")));
}

} // namespace study_command_test
