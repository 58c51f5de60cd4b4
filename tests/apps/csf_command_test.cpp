// unseen csf: one number, rows of numbers, the table, and the plot.
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
    EXPECT_EQ(with({"--velocity", "10", "--pursuit"}), with({"--velocity", std::to_string(10 - 8.35)}));
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
        {{"--pursuit"}, "--velocity"},
        {{"--distance", "0"}, "above 0"},
        {{"--distance", "3"}, "--distance needs --model daly"},
        {{"--plot", "csf.png"}, "leave --frequency away"},
        {{"--table", "--save-table", "table.json"}, "leave these options away"},
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

TEST_F(CsfCommandTest, AppendsSensitivityToRows) {
    const std::string rows = "# measured on a rainy day\n"
                             "subject,frequency,luminance,eccentricity,area,field\n"
                             "anna,4,100,0,1,nasal\n"
                             "\n"
                             "ben,8, 20 ,10,,\r\n";
    const Outcome outcome = succeed({"csf", "--csv", "-"}, rows);
    std::istringstream lines(outcome.out);
    Words line(5);
    for (std::string& l : line) ASSERT_TRUE(std::getline(lines, l));
    EXPECT_EQ(line[0], "# measured on a rainy day");
    EXPECT_EQ(line[1], "subject,frequency,luminance,eccentricity,area,field,sensitivity");
    EXPECT_EQ(line[3], "");
    ASSERT_THAT(line[2], HasSubstr("anna,4,100,0,1,nasal,"));
    ASSERT_THAT(line[4], HasSubstr("ben,8, 20 ,10,,,"));
    const auto last = [](const std::string& l) { return std::strtod(l.c_str() + l.rfind(',') + 1, nullptr); };
    EXPECT_NEAR(last(line[2]),
                sensitivity({"--frequency", "4", "--luminance", "100", "--area", "1", "--field", "nasal"}), 1e-11);
    EXPECT_NEAR(last(line[4]), sensitivity({"--frequency", "8", "--luminance", "20", "--eccentricity", "10"}), 1e-11);
}

TEST_F(CsfCommandTest, MissingColumnsTakeTheOptions) {
    write_text(path("s.csv"), "frequency\n4\n");
    const Outcome outcome = succeed({"csf", "--csv", "s.csv", "--luminance", "50", "--eccentricity", "5"});
    const double expected = sensitivity({"--frequency", "4", "--luminance", "50", "--eccentricity", "5"});
    EXPECT_NEAR(std::strtod(outcome.out.c_str() + outcome.out.rfind(',') + 1, nullptr), expected, 1e-11);
}

TEST_F(CsfCommandTest, BadRowsNameTheirLineAndPrintNothing) {
    const std::vector<std::pair<std::string, std::string>> bad = {
        {"", "names of the columns"},
        {"frequency,luminance\n4,100\n4\n", "line 3"},
        {"frequency,luminance\n4,many\n", "line 2: luminance"},
        {"frequency,luminance\nnan,100\n", "line 2: frequency"},
        {"frequency,luminance\n0,100\n", "line 2"},
        {"frequency,luminance\n4,1e400\n", "line 2: luminance"},
        {"frequency,luminance,field\n4,100,upper\n", "line 2: field"},
        {"frequency\n4\n", "line 2: --luminance"},
        {"frequency,luminance,velocity\n4,100,-1\n", "line 2"},
        {"frequency,luminance,frequency\n4,100,5\n", "line 1: column 3, 'frequency', is there before"},
        {"frequency,lumi\x1b[31mnance\n4,100\n", "line 1: column 15 is a control character"},
        {"frequency,luminance,note\n4,100,\xc2\x9b\n", "line 2: column 7 is a control character"},
        {std::string("frequency,luminance\n4,100\n\0", 27), "line 3: column 1 is a control character"},
        {"frequency,luminance,velocity,temporal\n4,100,1,8\n", "line 2: no sensitivity: give a temporal"},
    };
    for (const auto& [rows, expected] : bad) {
        const Outcome outcome = run({"csf", "--csv", "-"}, rows);
        EXPECT_EQ(outcome.status, 1) << rows;
        EXPECT_EQ(outcome.out, "") << rows;
        EXPECT_THAT(outcome.err, IsAnErrorForPeople());
        EXPECT_THAT(outcome.err, HasSubstr(expected)) << rows;
    }
}

TEST_F(CsfCommandTest, TheTableFollowsTheFormula) {
    for (const std::string frequency : {"0.3", "1", "3", "10"}) {
        const double formula = sensitivity({"--frequency", frequency, "--luminance", "37", "--eccentricity", "3"});
        const double table =
            sensitivity({"--frequency", frequency, "--luminance", "37", "--eccentricity", "3", "--table"});
        EXPECT_NEAR(table / formula, 1, 0.005) << frequency;
        EXPECT_NE(table, formula) << frequency;
    }
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
    // A row cannot have conditions that the table has not.
    EXPECT_THAT(run({"csf", "--table", "--csv", "-"}, "frequency,luminance,velocity\n4,100,3\n"),
                fails(1, HasSubstr("line 2")));
}

TEST_F(CsfCommandTest, PlotsCurves) {
    ASSERT_EQ(run({"csf", "--plot", "csf.png"}).status, 0);
    const auto plot = require(unseen::perception::read_image(path("csf.png")));
    EXPECT_GE(plot->image.width, 600);
    std::size_t coloured = 0; // curves are, axes and text are not
    for (std::size_t i = 0; i + 2 < plot->image.values.size(); i += 3)
        coloured += std::abs(plot->image.values[i] - plot->image.values[i + 2]) > 0.2f;
    EXPECT_GT(coloured, 2000u);
    ASSERT_EQ(run({"csf", "--plot", "csf.svg"}).status, 0);
    EXPECT_THAT(read_text(path("csf.svg")), HasSubstr("<svg"));
    EXPECT_EQ(run({"csf", "--plot", "csf.gif"}).status, 2);
}

} // namespace csf_command_test
