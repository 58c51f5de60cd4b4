// unseen csf: one number, and the table.
#include "run_command.h"

#include <unseen/perception/image.h>

namespace csf_command_test {

using namespace unseen::app::testing;
using ::testing::AllOf;
using ::testing::HasSubstr;

class CsfCommandTest : public CommandTest {
protected:
    double sensitivity(Words words) const {
        const Outcome outcome = succeed(joined({"csf", "--json", "-"}, words));
        return outcome.status == 0 ? outcome.json()["sensitivity"].get<double>() : 0;
    }
};

TEST_F(CsfCommandTest, GivesThePublishedModels) {
    // From the published implementations of castleCSF and stelaCSF, at 0.125 cpd, 0.1 cd/m2, area 0.1, nasal.
    const Words stimulus = {"--frequency", "0.125", "--luminance", "0.1", "--area", "0.1", "--field", "nasal"};
    auto with_model = [&](const std::string& model) {
        auto words = stimulus;
        words.insert(words.end(), {"--model", model});
        return sensitivity(words);
    };
    EXPECT_NEAR(with_model("castle") / 1.07322587, 1, 1e-6);
    EXPECT_NEAR(with_model("stela") / 0.85490575, 1, 1e-6);
    EXPECT_EQ(sensitivity(stimulus), with_model("castle")) << "castle is the default";
}

TEST_F(CsfCommandTest, GivesTheClassicalModelsAndTheColourBranches) {
    // Daly and Barten with fifty digits at 4 cpd, 100 cd/m2 and 1 square degree; the colour branches by the published
    // program at 0.125 cpd, 1 cd/m2, area 0.1, 2 degrees into the temporal field.
    const auto at_four = [&](const std::string& model) {
        return sensitivity({"--model", model, "--frequency", "4", "--luminance", "100", "--area", "1"});
    };
    EXPECT_NEAR(at_four("daly") / 163.581025193870971, 1, 1e-9);
    EXPECT_NEAR(at_four("barten-1989") / 514.172040862812764, 1, 1e-9);
    EXPECT_NEAR(at_four("barten-1999") / 197.303125652949689, 1, 1e-9);
    EXPECT_NEAR(at_four("barten-2004") / 181.121293297037766, 1, 1e-9);
    EXPECT_NEAR(at_four("mannos-sakrison") / 206.582178769581418, 1, 1e-9);
    EXPECT_NEAR(at_four("rushmeier") / 248.715939623819111, 1, 1e-9);
    const auto colour = [&](const std::string& model) {
        return sensitivity({"--model", model, "--frequency", "0.125", "--luminance", "1", "--area", "0.1",
                            "--eccentricity", "2", "--field", "temporal"});
    };
    EXPECT_NEAR(colour("castle-red-green") / 2.59514887, 1, 1e-6);
    EXPECT_NEAR(colour("castle-yellow-violet") / 0.537259876, 1, 1e-6);
}

TEST_F(CsfCommandTest, MotionMakesFineDetailFadeAndPursuitBringsItBack) {
    const auto with = [&](Words more) { return sensitivity(joined({"--frequency", "8", "--luminance", "100"}, more)); };
    EXPECT_LT(with({"--velocity", "10"}), 0.1 * with({}));
    EXPECT_LT(with({"--temporal", "20"}), with({}));
    EXPECT_NEAR(with({"--velocity", "10", "--table"}) / with({"--velocity", "10"}), 1, 0.005);
    EXPECT_NEAR(with({"--temporal", "8", "--table", "--field", "nasal", "--eccentricity", "5"}) /
                    with({"--temporal", "8", "--field", "nasal", "--eccentricity", "5"}),
                1, 0.005);
    EXPECT_NE(with({"--model", "daly", "--distance", "3"}), with({"--model", "daly"}));
}

TEST_F(CsfCommandTest, ContradictionsAreRefused) {
    const std::vector<std::pair<Words, std::string>> bad = {
        {{"--temporal", "8", "--velocity", "1"}, "exclude each other"},
        {{"--model", "stela", "--csf", "castle"}, "--model and --csf exclude each other"},
        {{"--velocity", "-1"}, "0 or more"},
        {{"--distance", "0"}, "above 0"},
        {{"--distance", "3"}, "--distance needs --csf or --model daly"},
        {{"--table", "--save-table", "table.json"}, "it holds all of them"},
        {{"--table", "--area", "1"}, "--area"},
        {{"--model", "barten"}, "barten"},
        {{"--csf", "barten"}, "barten-1999"},
        {{"--csf", "castle-red-green"}, "colour"},
    };
    for (const auto& [options, expected] : bad) {
        const Outcome outcome = run(joined({"csf", "--frequency", "4", "--luminance", "100"}, options));
        EXPECT_NE(outcome.status, 0) << expected;
        EXPECT_EQ(outcome.out, "") << expected;
        EXPECT_THAT(outcome.err, ::testing::StartsWith("unseen: "));
        EXPECT_THAT(outcome.err, HasSubstr(expected));
    }
    ASSERT_EQ(run({"csf", "--table", "--save-table", "own.json"}).status, 0);
    EXPECT_THAT(run({"csf", "--csf", "own.json", "--frequency", "4", "--luminance", "9", "--velocity", "1"}),
                fails(1, HasSubstr("--velocity")));
}

TEST_F(CsfCommandTest, TheDefaultAreaIsAPatchOfOneAndAHalfCycles) {
    const double area = std::numbers::pi * (1.5 / 4) * (1.5 / 4);
    EXPECT_NEAR(sensitivity({"--frequency", "4", "--luminance", "100"}),
                sensitivity({"--frequency", "4", "--luminance", "100", "--area", std::to_string(area)}), 1e-4);
}

TEST_F(CsfCommandTest, TheWorstFieldIsTheMoreSensitive) {
    const Words words = {"--frequency", "4", "--luminance", "100", "--eccentricity", "20"};
    const auto in_field = [&](const std::string& field) {
        auto all = words;
        all.insert(all.end(), {"--field", field});
        return sensitivity(all);
    };
    EXPECT_GT(in_field("nasal"), in_field("temporal"));
    EXPECT_EQ(sensitivity(words), in_field("nasal"));
    EXPECT_EQ(in_field("worst"), in_field("nasal"));
}

TEST_F(CsfCommandTest, TablesCanBeSavedAndUsed) {
    ASSERT_EQ(run({"csf", "--table", "--save-table", "table.json"}).status, 0);
    const Words stimulus = {"--frequency", "5", "--luminance", "12"};
    auto by_file = stimulus, by_model = stimulus;
    by_file.insert(by_file.end(), {"--csf", "table.json"});
    by_model.push_back("--table");
    EXPECT_EQ(sensitivity(by_file), sensitivity(by_model));
}

TEST_F(CsfCommandTest, SaysWhereATableHasNoSamples) {
    const std::string table = R"({"format": "unseen-csf", "version": 1, "frequency_cpd": [1, 16],
        "eccentricity_deg": [0, 20], "luminance_cdm2": [1, 100], "sensitivity": [[[60, 5], [120, 10]], [[30, 1], [50, 2]]]})";
    write_text(path("own.json"), table);
    const auto at = [&](const char* degrees) {
        return run({"csf", "--csf", "own.json", "--frequency", "4", "--luminance", "9", "--eccentricity", degrees,
                    "--json", "-"})
            .json();
    };
    EXPECT_FALSE(at("20").contains("beyond_table"));
    EXPECT_EQ(at("40")["beyond_table"], "beyond the table's 20 degrees sensitivity is taken as there");
    EXPECT_EQ(at("40")["sensitivity"], at("20")["sensitivity"]);
    std::string upside_down = table;
    upside_down.replace(upside_down.find("[[60, 5], [120, 10]]"), 20, "[[3, 0.1], [9, 0.2]]");
    write_text(path("wrong.json"), upside_down);
    const Outcome outcome = run({"csf", "--csf", "wrong.json", "--frequency", "4", "--luminance", "9"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, IsAnErrorForPeople());
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("wrong.json"), HasSubstr("sensitivity[1][0][0] is 30"),
                                   HasSubstr("grows by 20 dB with eccentricity")));
}

// A measured profile says more than its table: it must not be lost to it.
TEST_F(CsfCommandTest, ATableIsNotWrittenOverTheOneThatIsRead) {
    ASSERT_EQ(run({"csf", "--table", "--save-table", "table.json"}).status, 0);
    EXPECT_THAT(run({"csf", "--csf", "table.json", "--save-table", "./table.json"}),
                fails(1, HasSubstr("table.json' is read")));
}

TEST_F(CsfCommandTest, ATableKeepsItsMotion) {
    ASSERT_EQ(
        run({"csf", "--model", "barten-1999", "--table", "--velocity", "5", "--save-table", "moving.json"}).status, 0);
    EXPECT_EQ(
        sensitivity({"--csf", "moving.json", "--frequency", "5", "--luminance", "12"}),
        sensitivity({"--model", "barten-1999", "--table", "--velocity", "5", "--frequency", "5", "--luminance", "12"}));
    EXPECT_EQ(sensitivity({"--csf", "daly", "--frequency", "5", "--luminance", "12"}),
              sensitivity({"--model", "daly", "--table", "--frequency", "5", "--luminance", "12"}));
}

} // namespace csf_command_test
