// unseen csf: one number, rows of numbers, the table, and the plot.
#include "run_command.h"

#include <perception/image.h>

namespace {

using namespace unseen::app::testing;
using ::testing::HasSubstr;

class CsfCommandTest : public CommandTest {
protected:
    double sensitivity(std::vector<std::string> words) const {
        words.insert(words.begin(), "csf");
        const Outcome outcome = run(words);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return std::strtod(outcome.out.c_str(), nullptr);
    }
};

TEST_F(CsfCommandTest, GivesThePublishedModels) {
    // From the published implementations of castleCSF and stelaCSF, at 0.125 cpd, 0.1 cd/m2, area 0.1, nasal.
    const std::vector<std::string> stimulus = {"--frequency", "0.125", "--luminance", "0.1",
                                               "--area",      "0.1",   "--field",     "nasal"};
    auto with_model = [&](const std::string& model) {
        auto words = stimulus;
        words.insert(words.end(), {"--model", model});
        return sensitivity(words);
    };
    EXPECT_NEAR(with_model("castle") / 1.07322587, 1, 1e-6);
    EXPECT_NEAR(with_model("stela") / 0.85490575, 1, 1e-6);
    EXPECT_EQ(sensitivity(stimulus), with_model("castle")) << "castle is the default";
}

TEST_F(CsfCommandTest, TheDefaultAreaIsAPatchOfOneAndAHalfCycles) {
    const double area = std::numbers::pi * (1.5 / 4) * (1.5 / 4);
    EXPECT_NEAR(sensitivity({"--frequency", "4", "--luminance", "100"}),
                sensitivity({"--frequency", "4", "--luminance", "100", "--area", std::to_string(area)}), 1e-4);
}

TEST_F(CsfCommandTest, TheWorstFieldIsTheMoreSensitive) {
    const std::vector<std::string> words = {"--frequency", "4", "--luminance", "100", "--eccentricity", "20"};
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
    const Outcome outcome = run({"csf", "--csv", "-"}, rows);
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    std::istringstream lines(outcome.out);
    std::vector<std::string> line(5);
    for (std::string& l : line) ASSERT_TRUE(std::getline(lines, l));
    EXPECT_EQ(line[0], "# measured on a rainy day");
    EXPECT_EQ(line[1], "subject,frequency,luminance,eccentricity,area,field,sensitivity");
    EXPECT_EQ(line[3], "");
    ASSERT_THAT(line[2], HasSubstr("anna,4,100,0,1,nasal,"));
    ASSERT_THAT(line[4], HasSubstr("ben,8, 20 ,10,,,"));
    const auto last = [](const std::string& l) { return std::strtod(l.c_str() + l.rfind(',') + 1, nullptr); };
    EXPECT_EQ(last(line[2]),
              sensitivity({"--frequency", "4", "--luminance", "100", "--area", "1", "--field", "nasal"}));
    EXPECT_EQ(last(line[4]), sensitivity({"--frequency", "8", "--luminance", "20", "--eccentricity", "10"}));
}

TEST_F(CsfCommandTest, MissingColumnsTakeTheOptions) {
    write_text(path("s.csv"), "frequency\n4\n");
    const Outcome outcome = run({"csf", "--csv", "s.csv", "--luminance", "50", "--eccentricity", "5"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const double expected = sensitivity({"--frequency", "4", "--luminance", "50", "--eccentricity", "5"});
    EXPECT_EQ(std::strtod(outcome.out.c_str() + outcome.out.rfind(',') + 1, nullptr), expected);
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
        EXPECT_NEAR(table / formula, 1, 0.01) << frequency;
        EXPECT_NE(table, formula) << frequency;
    }
}

TEST_F(CsfCommandTest, TablesCanBeSavedAndUsed) {
    ASSERT_EQ(run({"csf", "--table", "--save-table", "table.json"}).status, 0);
    const std::vector<std::string> stimulus = {"--frequency", "5", "--luminance", "12"};
    auto by_file = stimulus, by_model = stimulus;
    by_file.insert(by_file.end(), {"--csf", "table.json"});
    by_model.push_back("--table");
    EXPECT_EQ(sensitivity(by_file), sensitivity(by_model));
}

TEST_F(CsfCommandTest, PlotsCurves) {
    ASSERT_EQ(run({"csf", "--plot", "csf.png"}).status, 0);
    const auto plot = unseen::perception::read_image(path("csf.png"));
    ASSERT_TRUE(plot) << plot.error().message;
    EXPECT_GE(plot->image.width, 600);
    std::size_t coloured = 0; // curves are, axes and text are not
    for (std::size_t i = 0; i + 2 < plot->image.values.size(); i += 3)
        coloured += std::abs(plot->image.values[i] - plot->image.values[i + 2]) > 0.2f;
    EXPECT_GT(coloured, 2000u);
}

} // namespace
