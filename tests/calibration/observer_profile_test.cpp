// Sensitivity tables as JSON: exact round trips, and that bad files get one clear sentence.
#include <unseen/calibration/observer_profile.h>

#include "profile_files.h"

namespace unseen::calibration::observer_profile_test {

using perception::CsfModel;
using perception::CsfSamples;
using perception::CsfTable;

class ObserverProfileTest : public ProfileFiles {};

const std::string small = R"({
"format": "unseen-csf", "version": 1, "source": "measured by hand",
"frequency_cpd": [1, 4, 16],
"eccentricity_deg": [0, 10],
"luminance_cdm2": [3, 100],
"sensitivity": [
[[60, 40, 5], [120, 80, 10]],
[[30, 15, 0.5], [50, 25, 1.5]]
]
})";

void expect_same(const CsfSamples& a, const CsfSamples& b) {
    EXPECT_EQ(a.source, b.source);
    EXPECT_EQ(a.frequency_cpd, b.frequency_cpd); // bit for bit
    EXPECT_EQ(a.eccentricity_deg, b.eccentricity_deg);
    EXPECT_EQ(a.luminance_cdm2, b.luminance_cdm2);
    EXPECT_EQ(a.sensitivity, b.sensitivity);
}

TEST_F(ObserverProfileTest, ReadsASmallTable) {
    const auto table = require(read_csf(write(small)));
    const CsfSamples& s = table->samples();
    EXPECT_EQ(s.source, "measured by hand");
    EXPECT_EQ(s.frequency_cpd, (std::vector<double>{1, 4, 16}));
    EXPECT_EQ(s.eccentricity_deg, (std::vector<double>{0, 10}));
    EXPECT_EQ(s.luminance_cdm2, (std::vector<double>{3, 100}));
    EXPECT_EQ(s.sensitivity, (std::vector<double>{60, 40, 5, 120, 80, 10, 30, 15, 0.5, 50, 25, 1.5}));
}

TEST_F(ObserverProfileTest, TheSourceIsOptional) {
    const auto table = require(read_csf(write(replaced(small, ", \"source\": \"measured by hand\"", ""))));
    EXPECT_EQ(table->samples().source, "");
}

TEST_F(ObserverProfileTest, RoundTripOfTheModelsIsExact) {
    for (const CsfModel model : {CsfModel::castle, CsfModel::stela}) {
        const CsfTable table = CsfTable::from_model(model);
        const auto file = folder() / "model.json";
        const auto written = require(write_csf(file, table));
        const auto back = require(read_csf(file));
        expect_same(back->samples(), table.samples());
        using perception::Degrees, perception::Luminance;
        EXPECT_EQ(back->highest_visible_frequency(0.1, Degrees(7), Luminance(33)),
                  table.highest_visible_frequency(0.1, Degrees(7), Luminance(33)));
    }
    EXPECT_EQ(files_in_folder(), 1) << "no temporary file stays behind";
}

TEST_F(ObserverProfileTest, RoundTripOfOddNumbersIsExact) {
    CsfSamples samples;
    samples.source = "quotes \" and \\ and \n lines";
    samples.frequency_cpd = {1e-300, 1.0 / 3, 1e4 / 3};
    samples.eccentricity_deg = {0, 0.1 + 0.2};
    samples.luminance_cdm2 = {std::numeric_limits<double>::denorm_min(), 0.1};
    samples.sensitivity = {1e6 / 3, 2.0 / 3, 1e-308, 5e-324, 1e-300, 4, 2, 3, 4, 1.5, 0.1, 7};
    const auto table = require(CsfTable::create(samples));
    const auto file = folder() / "odd.json";
    ASSERT_TRUE(write_csf(file, *table));
    const auto back = require(read_csf(file));
    expect_same(back->samples(), samples);
}

TEST_F(ObserverProfileTest, ErrorsNameTheFileAndThePlace) {
    struct Case {
        const char *from, *to, *expected;
    };
    const Case cases[] = {
        {"\"unseen-csf\"", "\"unseen\"", "\"format\" must be \"unseen-csf\""},
        {"\"format\": \"unseen-csf\", ", "", "\"format\""},
        {"\"unseen-csf\"", "1", "\"format\" must be a string"},
        {"\"version\": 1, ", "", "\"version\" is missing"},
        {"\"version\": 1", "\"version\": 1.5", "version"},
        {"\"version\": 1", "\"version\": \"1\"", "version"},
        {"\"measured by hand\"", "7", "\"source\" must be a string"},
        {"\"frequency_cpd\": [1, 4, 16],", "", "\"frequency_cpd\" is missing"},
        {"[1, 4, 16]", "16", "\"frequency_cpd\" must be an array"},
        {"[1, 4, 16]", "[]", "\"frequency_cpd\" is empty"},
        {"[1, 4, 16]", "[1, 4]", "\"sensitivity[0][0]\" must have 2 values, but has 3"},
        {"[1, 4, 16]", "[1, 4, 4]", "frequency_cpd[2]"},
        {"[1, 4, 16]", "[0, 4, 16]", "frequency_cpd[0]"},
        {"[1, 4, 16]", "[1, \"4\", 16]", "\"frequency_cpd[1]\" must be a number, but is \"4\""},
        {"[1, 4, 16]", "[1, null, 16]", "\"frequency_cpd[1]\" must be a number"},
        {"[1, 4, 16]", "[1, [4], 16]", "\"frequency_cpd[1]\" must be a number"},
        {"[0, 10]", "[0, 10, 20]", "\"sensitivity\" must be an array of 3"},
        {"[0, 10]", "[]", "\"eccentricity_deg\" is empty"},
        {"[0, 10]", "[1, 10]", "eccentricity_deg[0]"},
        {"[0, 10]", "[0, -10]", "eccentricity_deg[1]"},
        {"[0, 10]", "{}", "\"eccentricity_deg\" must be an array"},
        {"[3, 100]", "[3]", "\"sensitivity[0]\" must be an array of 1"},
        {"[3, 100]", "[100, 3]", "luminance_cdm2[1]"},
        {"[3, 100]", "[-3, 100]", "luminance_cdm2[0]"},
        {"[30, 15, 0.5]", "[200, 15, 0.5]", "sensitivity[1][0][0] is 200 (10 degrees, 3 cd/m2, 1 cpd)"},
        {"[30, 15, 0.5]", "[30, 15]", "\"sensitivity[1][0]\" must have 3 values, but has 2"},
        {"[30, 15, 0.5]", "[30, 15, 0.5, 0.1]", "\"sensitivity[1][0]\" must have 3 values, but has 4"},
        {"[30, 15, 0.5]", "[30, 0, 0.5]", "sensitivity[1][0][1]"},
        {"[30, 15, 0.5]", "[30, -15, 0.5]", "sensitivity[1][0][1]"},
        {"[30, 15, 0.5]", "[30, true, 0.5]", "sensitivity[1][0][1]"},
        {"[30, 15, 0.5]", "30", "\"sensitivity[1][0]\" must be an array of numbers, but is 30"},
        {"[[30, 15, 0.5], [50, 25, 1.5]]", "null", "\"sensitivity[1]\" must be an array of 2"},
        {"0.5", "1e999", ":8:"},
        {"0.5", "NaN", ":8:"},
        {"0.5]", "0.5", ":10:"},
        {"\"version\": 1", "\"version\": 1, \"viewer\": \"me\"", "\"viewer\" is unknown"},
        {"\"version\": 1", "\"version\": 1, \"observer\": \"me\"", "\"observer\" is unknown in version 1"},
        {"\"version\": 1", "\"version\": 2", "\"measured_at_cdm2\" is missing"},
        {"\"version\": 1", "\"version\": 2, \"measured_at_cdm2\": 50", "\"measured\" is missing"},
        {"\"version\": 1", "\"version\": 2, \"measured_at_cdm2\": 0, \"measured\": []", "measured_at_cdm2"},
        {"\"version\": 1", "\"version\": 2, \"measured_at_cdm2\": 50, \"measured\": [[1, 0, 50, 40, 60]]",
         "measured[0]"},
        {"\"version\": 1", "\"version\": 2, \"measured_at_cdm2\": 50, \"measured\": [[1, 0, 50, 55, 60, 7]]",
         "measured[0]"},
        {"\"version\": 1", "\"version\": 2, \"measured_at_cdm2\": 50, \"measured\": [[0, 0, 50, 40, 60, 7]]",
         "measured[0]"},
        {"\"version\": 1", "\"version\": 2, \"date\": 7, \"measured_at_cdm2\": 50, \"measured\": []", "date"},
        {"\"version\": 1", "\"version\": 1, \"version\": 1", "\"version\" twice"},
        {"\"version\": 1", "\"version\": 2, \"measured_at_cdm2\": 50, \"measured\": [], \"summation\": [1, 1, 1]",
         "\"summation\" is unknown before version 3"},
        {"\"version\": 1", "\"version\": 3, \"measured_at_cdm2\": 50, \"measured\": [], \"summation\": [1, 1, 1]",
         "\"measured_wide\" is missing"},
        {"\"version\": 1", "\"version\": 3, \"measured_at_cdm2\": 50, \"measured\": [], \"measured_wide\": []",
         "\"summation\" is missing"},
        {"\"version\": 1",
         "\"version\": 3, \"measured_at_cdm2\": 50, \"measured\": [], \"measured_wide\": [], \"summation\": [1, 1.1, "
         "2]",
         "\"summation\" must be a factor, and the interval in which it lies"},
        {"\"version\": 1",
         "\"version\": 3, \"measured_at_cdm2\": 50, \"measured\": [], \"measured_wide\": [], \"summation\": [0, 0, 2]",
         "\"summation\" must begin with a factor from 0.01 to 100"},
        {"\"version\": 1",
         "\"version\": 3, \"measured_at_cdm2\": 50, \"measured\": [], \"summation\": [1, 1, 1], "
         "\"measured_wide\": [[1, 0, 0, 50, 40, 60, 7]]",
         "measured_wide[0]"},
    };
    for (const Case& bad : cases) {
        const auto table = read_csf(write(replaced(small, bad.from, bad.to), "bad.json"));
        ASSERT_FALSE(table) << bad.expected;
        EXPECT_THAT(table.error().message, AllOf(HasSubstr("bad.json"), HasSubstr(bad.expected)));
        EXPECT_THAT(table.error().message, testing::Not(HasSubstr("\n")));
        EXPECT_EQ(table.error().code, ErrorCode::malformed_data);
    }
}

TEST_F(ObserverProfileTest, NewerVersionsAreUnsupported) {
    const auto table = read_csf(write(replaced(small, "\"version\": 1", "\"version\": 4")));
    ASSERT_FALSE(table);
    EXPECT_EQ(table.error().code, ErrorCode::unsupported);
    EXPECT_THAT(table.error().message, HasSubstr("version"));
}

TEST_F(ObserverProfileTest, SurvivesMutatedFiles) {
    int accepted = 0;
    for_each_mutation(small, 5000, [&](const std::string& text) {
        const auto table = read_csf(write(text));
        if (table) {
            ++accepted;
            const auto cpd = table->highest_visible_frequency(0.1, perception::Degrees(3), perception::Luminance(10));
            EXPECT_FALSE(std::isnan(cpd.value())) << text;
        } else {
            EXPECT_THAT(table.error().message, HasSubstr("profile.json"));
        }
    });
    EXPECT_GT(accepted, 0);
}

TEST_F(ObserverProfileTest, MeasurementsGoThereAndBack) {
    ObserverProfile profile;
    profile.observer = "anna \"a\"";
    profile.date = "2001-06-25";
    profile.method = "2ifc";
    profile.display = "20-inch";
    profile.conditions = "dim room\nafter 10 minutes";
    profile.measured_at_cdm2 = 50.25;
    profile.measured = {{{0.5, 0}, 60.1, 50, 70, 12}, {{8, 10}, 1.0 / 3, 0.25, 0.5, 0}};
    const auto file = folder() / "anna.json";
    ASSERT_TRUE(write_observer(file, profile));
    const auto back = require(read_observer(file));
    EXPECT_EQ(back->observer, profile.observer);
    EXPECT_EQ(back->date, profile.date);
    EXPECT_EQ(back->method, profile.method);
    EXPECT_EQ(back->display, profile.display);
    EXPECT_EQ(back->conditions, profile.conditions);
    EXPECT_EQ(back->measured_at_cdm2, profile.measured_at_cdm2);
    EXPECT_FALSE(back->has_summation());
    EXPECT_EQ(back->summation.own, 1) << "castle's law";
    ASSERT_EQ(back->measured.size(), 2u);
    EXPECT_EQ(back->measured[1].place, profile.measured[1].place);
    EXPECT_EQ(back->measured[1].sensitivity, 1.0 / 3);
    EXPECT_EQ(back->measured[0].low, 50);
    EXPECT_EQ(back->measured[0].high, 70);
    EXPECT_EQ(back->measured[0].answers, 12);
    expect_same(back->table.samples(), profile.table.samples());
    const auto table = require(read_csf(file));
    expect_same(table->samples(), profile.table.samples());
    EXPECT_TRUE(require(read_observer(write(small)))->measured.empty());
}

TEST_F(ObserverProfileTest, SummationGoesThereAndBack) {
    ObserverProfile profile;
    profile.measured_at_cdm2 = 50;
    profile.measured = {{{0.5, 0}, 60.1, 50, 70, 12}, {{0.5, 20, 100}, 1.0 / 3, 0.25, 0.5, 9}};
    profile.summation = {1.25, 1.0 / 3, 2};
    const auto file = folder() / "wide.json";
    ASSERT_TRUE(write_observer(file, profile));
    const auto back = require(read_observer(file));
    EXPECT_EQ(back->summation, profile.summation);
    EXPECT_TRUE(back->has_summation());
    const auto table = require(read_csf(file));
    EXPECT_EQ(table->samples().summation, 1.25);
    ASSERT_TRUE(write_csf(folder() / "table.json", *table));
    EXPECT_EQ(require(read_csf(folder() / "table.json"))->samples().summation, 1.25);
    ASSERT_EQ(back->measured.size(), 2u);
    EXPECT_EQ(back->measured[0].place, profile.measured[0].place);
    EXPECT_EQ(back->measured[1].place, profile.measured[1].place);
    EXPECT_EQ(back->measured[1].sensitivity, 1.0 / 3);
    EXPECT_EQ(back->measured[1].answers, 9);
    // A profile without is of the version that older programs read.
    profile.summation = {};
    profile.measured.pop_back();
    ASSERT_TRUE(write_observer(file, profile));
    EXPECT_THAT(read(file), HasSubstr("\"version\": 2"));
}

TEST_F(ObserverProfileTest, WritingFailsWithoutLeavingAFile) {
    const auto nowhere = write_csf(folder() / "no" / "folder.json", CsfTable::standard());
    ASSERT_FALSE(nowhere);
    EXPECT_EQ(nowhere.error().code, ErrorCode::io_failure);
    EXPECT_EQ(files_in_folder(), 0);
}

} // namespace unseen::calibration::observer_profile_test
