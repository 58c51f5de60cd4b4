// unseen calibrate: a simulated observer from beginning to end, profiles for --csf, displays, and what is refused.
#include "run_command.h"

#include <unseen/perception/image.h>

namespace calibrate_command_test {

using namespace unseen::app::testing;
using ::testing::HasSubstr;

class CalibrateCommandTest : public CommandTest {};

TEST_F(CalibrateCommandTest, MeasuresASimulatedObserver) {
    const Outcome outcome =
        succeed({"calibrate", "--simulate", "castle:gain=0.7", "--seed", "3", "--trials", "400", "-o", "observer.json",
                 "--json", "report.json", "--date", "2001-06-25", "--conditions", "dim room"});
    EXPECT_THAT(outcome.out, HasSubstr("400 answers"));
    EXPECT_THAT(outcome.out, HasSubstr("dB (rms over what can be seen)"));
    const Json report = Json::parse(read_text(path("report.json")));
    EXPECT_LT(report["rms_error_db"], 1.5);
    EXPECT_EQ(report["answers"], 400);
    EXPECT_EQ(report["done"], true);
    for (const Json& row : report["measured"]) {
        EXPECT_LT(row["low"], row["sensitivity"]);
        EXPECT_GT(row["high"], row["sensitivity"]);
    }
    const Json profile = Json::parse(read_text(path("observer.json")));
    EXPECT_EQ(profile["version"], 3);
    EXPECT_LT(report["summation"]["low"], 1);
    EXPECT_GT(report["summation"]["high"], 1);
    EXPECT_NEAR(profile["summation"][0].get<double>(), report["summation"]["own"].get<double>(), 1e-14);
    EXPECT_THAT(outcome.out, HasSubstr("wide patches: unlimited ones are seen"));
    EXPECT_EQ(profile["date"], "2001-06-25");
    EXPECT_EQ(profile["conditions"], "dim room");
    EXPECT_EQ(profile["observer"], "simulated: castle:gain=0.7");
    EXPECT_EQ(profile["measured"].size() + profile["measured_wide"].size(), report["measured"].size());
    EXPECT_EQ(profile["measured_wide"].size(), 4u);

    // The table stands for the observer: 0.7 of the standard one.
    const auto sensitivity = [&](Words more) {
        more.insert(more.begin(),
                    {"csf", "--frequency", "3", "--luminance", "50.25", "--eccentricity", "7", "--json", "-"});
        return run(more).json()["sensitivity"].get<double>();
    };
    EXPECT_NEAR(20 * std::log10(sensitivity({"--csf", "observer.json"}) / (0.7 * sensitivity({"--table"}))), 0, 1.5);
}

TEST_F(CalibrateCommandTest, EveryVerbTakesTheProfile) {
    build_ball();
    ASSERT_EQ(run({"calibrate", "--simulate", "castle:gain=0.2", "--trials", "60", "-o", "poor.json"}).status, 0);
    const auto triangles = [&](Words more) {
        const Outcome outcome =
            succeed(joined({"simplify", "ball.vdt", "-o", "out.ply", "--json", "-", "--size", "256x256"}, more));
        return outcome.json()["triangles"].get<int>();
    };
    EXPECT_LT(triangles({"--csf", "poor.json"}), triangles({})) << "who sees less needs less";
}

TEST_F(CalibrateCommandTest, RepeatsWithItsSeedAndResumes) {
    const Words words = {"calibrate", "--simulate", "stela", "--trials", "40", "--date", "now"};
    const auto with = [&](Words more) { succeed(joined(words, more)); };
    with({"--seed", "5", "-o", "a.json"});
    with({"--seed", "5", "-o", "b.json", "--resume", "state.json"});
    with({"--seed", "6", "-o", "c.json"});
    EXPECT_TRUE(read_text(path("a.json")) == read_text(path("b.json")));
    EXPECT_FALSE(read_text(path("a.json")) == read_text(path("c.json")));
    // Half of the answers taken away: the rest comes again.
    Json state = Json::parse(read_text(path("state.json")));
    ASSERT_EQ(state["answers"].size(), 40u);
    state["answers"].erase(state["answers"].begin() + 20, state["answers"].end());
    write_text(path("state.json"), state.dump());
    with({"--seed", "5", "-o", "d.json", "--resume", "state.json"});
    EXPECT_TRUE(read_text(path("a.json")) == read_text(path("d.json")));
}

// A state's plan stays as it is: what is given and says otherwise is named.
TEST_F(CalibrateCommandTest, GoesOnOnlyAsItWasBegun) {
    const auto with = [&](Words more) {
        return run(joined({"calibrate", "--simulate", "castle", "--date", "now", "--resume", "state.json"}, more));
    };
    ASSERT_EQ(with({"--trials", "30", "--seed", "4", "--frequencies", "1", "4", "--eccentricities", "0", "10", "-o",
                    "a.json"})
                  .status,
              0);
    const auto takes_half_away = [&] {
        Json state = Json::parse(read_text(path("state.json")));
        state["answers"].erase(state["answers"].begin() + 15, state["answers"].end());
        write_text(path("state.json"), state.dump());
    };
    takes_half_away();
    const std::vector<std::pair<Words, const char*>> differing = {
        {{"--method", "adjustment"}, "--method (it was 2ifc)"},
        {{"--trials", "40"}, "--trials (it was 30)"},
        {{"--settings", "9"}, "--settings (it was 7)"},
        {{"--seed", "5"}, "--seed (it was 4)"},
        {{"--wide"}, "--wide"},
        {{"--luminance", "30"}, "--luminance (it was 50.25)"},
        {{"--frequencies", "1", "2", "--eccentricities", "0", "10"}, "--frequencies and --eccentricities"},
        {{"--trials", "40", "--seed", "5"}, "--trials (it was 30), --seed (it was 4)"},
        {{"--csf", "stela"}, "go on with the one that the calibration was begun with"}};
    for (const auto& [more, expected] : differing) {
        const Outcome outcome = with(more);
        EXPECT_EQ(outcome.status, 1) << expected;
        EXPECT_THAT(outcome.err, IsAnErrorForPeople());
        EXPECT_THAT(outcome.err, HasSubstr("state.json"));
        EXPECT_THAT(outcome.err, HasSubstr(expected));
    }
    // The simulated observer, too, goes on with the seed that is kept; and what is given again may be.
    EXPECT_EQ(with({"-o", "b.json"}).status, 0);
    EXPECT_TRUE(read_text(path("a.json")) == read_text(path("b.json")));
    takes_half_away();
    EXPECT_EQ(with({"--trials", "30", "--seed", "4", "--frequencies", "4", "1", "--eccentricities", "0", "10", "-o",
                    "c.json"})
                  .status,
              0);
    EXPECT_TRUE(read_text(path("a.json")) == read_text(path("c.json")));
}

// Places are chosen by what is seen at the luminance that is shown.
TEST_F(CalibrateCommandTest, PlacesAreVisibleAtTheLuminanceThatIsGiven) {
    const auto places = [&](const char* luminance) {
        const Json json =
            succeed({"calibrate", "--simulate", "castle", "--trials", "1", "--luminance", luminance, "--json", "-"})
                .json();
        for (const Json& row : json["measured"])
            EXPECT_GE(row["true_sensitivity"].get<double>() * json["highest_contrast"].get<double>(), 3);
        return json["measured"].size();
    };
    EXPECT_LT(places("0.6"), places("50"));
}

TEST_F(CalibrateCommandTest, WidePatchesAreLeftOutOrAddedAsAskedFor) {
    const auto report = [&](Words more) {
        const Outcome outcome = succeed(joined({"calibrate", "--simulate", "castle", "--json", "-"}, more));
        return outcome.json();
    };
    const Json all = report({}), small = report({"--no-wide"});
    EXPECT_EQ(all["answers"], 240);
    EXPECT_EQ(small["answers"], 200);
    EXPECT_FALSE(small.contains("summation"));
    EXPECT_EQ(all["measured"].size(), small["measured"].size() + 4);
    const Words named = {"--frequencies", "1", "4", "--eccentricities", "0", "--trials", "30"};
    EXPECT_EQ(report(named)["measured"].size(), 2u);
    Words wide = named;
    wide.push_back("--wide");
    const Json with_wide = report(wide);
    ASSERT_EQ(with_wide["measured"].size(), 4u);
    EXPECT_EQ(with_wide["measured"][2]["area_deg2"], 100);
    EXPECT_NEAR(with_wide["measured"][0]["area_deg2"].get<double>(), 7.07, 0.01);

    // Nobody sees wide patches worse than small ones; nothing is written.
    const Outcome worse =
        run({"calibrate", "--simulate", "castle:summation=0.15", "-o", "worse.json", "--json", "report.json"});
    EXPECT_EQ(worse.status, 1);
    EXPECT_THAT(worse.err, IsAnErrorForPeople());
    EXPECT_THAT(worse.err, HasSubstr("Wide patches were seen worse than small ones"));
    EXPECT_FALSE(fs::exists(path("worse.json")));
    EXPECT_FALSE(fs::exists(path("report.json")));
    EXPECT_THAT(run({"calibrate", "--simulate", "castle", "--frequencies", "60", "--eccentricities", "0", "--wide"}),
                fails(1, HasSubstr("No wide patch")));
}

TEST_F(CalibrateCommandTest, WhereNothingIsSeenThereIsNoError) {
    const Words words = {"calibrate",     "--simulate", "castle",           "--trials", "20",
                         "--frequencies", "60",         "--eccentricities", "40"};
    EXPECT_THAT(succeed(words).out, HasSubstr("this observer can see none of it"));
    Words with_json = words;
    with_json.insert(with_json.end(), {"--json", "-"});
    EXPECT_TRUE(run(with_json).json()["rms_error_db"].is_null());
}

TEST_F(CalibrateCommandTest, AdjustsToo) {
    const Outcome outcome =
        succeed({"calibrate", "--simulate", "castle:gain=0.5", "--method", "adjustment", "--json", "-"});
    EXPECT_LT(outcome.json()["rms_error_db"], 1.0);
    EXPECT_EQ(outcome.json()["method"], "adjustment");
}

TEST_F(CalibrateCommandTest, PhotometersMakeDisplays) {
    write_text(path("p.csv"), "code,cdm2\n0,0.2\n64,12\n128,50\n192,120\n255,240\n");
    EXPECT_THAT(succeed({"calibrate", "--photometer", "p.csv", "-o", "display.json"}).out, HasSubstr("peak 240 cd/m2"));
    const Json display = Json::parse(read_text(path("display.json")));
    EXPECT_EQ(display["transfer"], "table");
    EXPECT_NEAR(display["peak_cdm2"], 240, 1e-9);
    EXPECT_EQ(run({"calibrate", "--display", "display.json", "--simulate", "castle", "--trials", "5"}).status, 0);
}

TEST_F(CalibrateCommandTest, RefusesWhatMakesNoSense) {
    const std::vector<Words> wrong = {{"--simulate", "castle", "--trials", "0"},
                                      {"--simulate", "castle", "--trials", "1.5"},
                                      {"--simulate", "castle", "--trials", "nan"},
                                      {"--simulate", "castle", "--seed", "-1"},
                                      {"--simulate", "castle", "--method", "3ifc"},
                                      {"--simulate", "castle", "-o", "x.txt"},
                                      {"--photometer", "p.csv"},
                                      {"--simulate", "castle", "--luminance", "0"},
                                      {"--simulate", "castle", "--frequencies", "4"},
                                      {"--simulate", "castle", "--settings", "9"},
                                      {"--simulate", "castle", "--method", "adjustment", "--trials", "9"},
                                      {"--gamma", "--resume", "state.json"}};
    for (Words words : wrong) {
        words.insert(words.begin(), "calibrate");
        EXPECT_THAT(run(words), fails(2, HasSubstr("unseen: "))) << words[1] << " " << words.back();
    }
    write_text(path("bad.json"), "{\"format\": \"unseen-calibration\", \"version\": 1, \"method\": \"2ifc\"}");
    const std::vector<std::pair<Words, const char*>> failing = {
        {{"--simulate", "nobody"}, "nobody"},
        {{"--simulate", "castle:age=40"}, "age"},
        {{"--simulate", "missing.json"}, "missing.json"},
        {{"--simulate", "castle", "--luminance", "1e5"}, "--luminance"},
        {{"--simulate", "castle:gain=100"}, "0 degrees is 11746, but none above 3162 can be measured"},
        {{"--simulate", "castle", "-o", "/proc/nonexistent/me.json"}, "/proc/nonexistent"},
        {{"--simulate", "castle", "--json", "/proc/nonexistent/me.json"}, "/proc/nonexistent"},
        {{"--simulate", "castle", "--resume", "/proc/nonexistent/me.json"}, "/proc/nonexistent"},
        {{"--simulate", "castle", "--resume", "s.json", "-o", "s.json"}, "s.json' is named for two outputs"},
        {{"--simulate", "castle", "--frequencies", "4", "4", "--eccentricities", "0"}, "places[1]"},
        {{"--simulate", "castle", "--resume", "bad.json"}, "bad.json"},
        {{"--photometer", "missing.csv", "-o", "d.json"}, "missing.csv"},
        {{"--simulate", "castle", "--display", "missing.json"}, "missing.json"}};
    for (const auto& [more, expected] : failing) {
        const Outcome outcome = run(joined({"calibrate"}, more));
        EXPECT_EQ(outcome.status, 1) << expected;
        EXPECT_THAT(outcome.err, IsAnErrorForPeople());
        EXPECT_THAT(outcome.err, HasSubstr(expected));
    }
}

} // namespace calibrate_command_test
