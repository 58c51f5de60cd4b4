// Display profiles: what is read and written, and that bad files get one clear sentence.
#include <unseen/calibration/display_profile.h>

#include "profile_files.h"

namespace unseen::calibration::display_profile_test {

using perception::Display;
using perception::TransferFunction;

class DisplayProfile : public ProfileFiles {};

const std::string minimal = R"({
    "width_px": 1920,
    "height_px": 1200,
    "pixel_pitch_m": 0.00027,
    "viewing_distance_m": 0.6,
    "peak_cdm2": 200,
    "black_cdm2": 0.2
})";

void expect_same(const Display& a, const Display& b) {
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.width_px, b.width_px);
    EXPECT_EQ(a.height_px, b.height_px);
    EXPECT_EQ(a.pixel_pitch, b.pixel_pitch);
    EXPECT_EQ(a.distance, b.distance);
    EXPECT_EQ(a.peak, b.peak);
    EXPECT_EQ(a.black, b.black);
    EXPECT_EQ(a.transfer, b.transfer);
    if (a.transfer == TransferFunction::gamma) EXPECT_EQ(a.gamma, b.gamma);
    EXPECT_EQ(a.ambient, b.ambient);
    EXPECT_EQ(a.reflectivity, b.reflectivity);
}

TEST_F(DisplayProfile, MissingOptionalKeysTakeTheDefaults) {
    const auto display = require(read_display(write(minimal, "desk.json")));
    EXPECT_EQ(display->name, "desk");
    EXPECT_EQ(display->width_px, 1920);
    EXPECT_EQ(display->height_px, 1200);
    EXPECT_EQ(display->pixel_pitch, perception::Metres(0.00027));
    EXPECT_EQ(display->distance, perception::Metres(0.6));
    EXPECT_EQ(display->peak, perception::Luminance(200));
    EXPECT_EQ(display->black, perception::Luminance(0.2));
    EXPECT_EQ(display->transfer, Display().transfer);
    EXPECT_EQ(display->ambient, Display().ambient);
    EXPECT_EQ(display->reflectivity, Display().reflectivity);
}

TEST_F(DisplayProfile, TablesAndLensesGoThereAndBack) {
    Display display;
    display.transfer = TransferFunction::table;
    display.table = {0, 0.1, 1.0 / 3, 1};
    display.lens = {{0, 20.5}, {30, 1.0 / 3}};
    display.field_deg = 98.5;
    const auto file = folder() / "headset.json";
    ASSERT_TRUE(write_display(file, display));
    const auto back = require(read_display(file));
    expect_same(*back, display);
    EXPECT_EQ(back->table, display.table);
    ASSERT_EQ(back->lens.size(), 2u);
    EXPECT_EQ(back->lens[1].angle_deg, 30);
    EXPECT_EQ(back->lens[1].pixels_per_degree, 1.0 / 3);
    EXPECT_EQ(back->field_deg, 98.5);
    const std::pair<const char*, const char*> bad[] = {
        {"{\"transfer\": \"table\",", "\"transfer_table\" is missing"},
        {"{\"transfer_table\": [0, 0.5, 1],", "\"transfer_table\" needs"},
        {"{\"transfer\": \"table\", \"transfer_table\": [0, 0.5, 0.4, 1],", "transfer_table[2]"},
        {"{\"transfer\": \"table\", \"transfer_table\": [0, null, 1],", "transfer_table[1]"},
        {"{\"pixels_per_degree_at\": [],", "pixels_per_degree_at"},
        {"{\"pixels_per_degree_at\": [[0, 20], [10]],", "pixels_per_degree_at[1]"},
        {"{\"pixels_per_degree_at\": [[0, 20], [10, 0]],", "pixels_per_degree_at[1]"},
        {"{\"field_deg\": 400,", "field_deg"},
        {"{\"ambient_lux\": 1e9,", "ambient_lux"},
        {"{\"transfer\": 1e-9,", "transfer"},
        {"{\"field_deg\": 1e-9,", "field_deg"},
    };
    for (const auto& [start, expected] : bad)
        EXPECT_THAT(error_in(read_display(write(replaced(minimal, "{", start), "bad.json"))),
                    AllOf(HasSubstr("bad.json"), HasSubstr(expected)))
            << start;
}

TEST_F(DisplayProfile, TheDiagonalGivesThePitch) {
    const std::string text = replaced(minimal, "\"pixel_pitch_m\": 0.00027", "\"diagonal_m\": 0.508");
    const auto display = require(read_display(write(replaced(text, "1920", "1600"))));
    EXPECT_DOUBLE_EQ(display->pixel_pitch.value(), 0.000254); // a 20-inch screen of 1600x1200
}

TEST_F(DisplayProfile, ReadsEveryTransferFunction) {
    const auto with = [&](const char* value) {
        return read_display(write(replaced(minimal, "{", std::string("{\"transfer\": ") + value + ",")));
    };
    EXPECT_EQ(with("\"srgb\"")->transfer, TransferFunction::srgb);
    EXPECT_EQ(with("\"linear\"")->transfer, TransferFunction::linear);
    EXPECT_EQ(with("2.4")->transfer, TransferFunction::gamma);
    EXPECT_EQ(with("2.4")->gamma, 2.4);
    EXPECT_EQ(with("\"pq\"")->transfer, TransferFunction::pq);
    for (const char* bad : {"\"gamma\"", "\"\"", "0", "-2.2", "null", "true", "[2.2]", "{}"}) {
        EXPECT_THAT(error_in(with(bad)), HasSubstr("transfer")) << bad;
    }
}

TEST_F(DisplayProfile, RoundTripIsExact) {
    Display display;
    display.name = "a \"quoted\" name,\n\tUmlaut: \xc3\xa4";
    display.width_px = 3840;
    display.height_px = 2160;
    display.pixel_pitch = perception::Metres(0.1 / 3);
    display.distance = perception::Metres(1.0 / 3);
    display.peak = perception::Luminance(1e5 / 3);
    display.black = perception::Luminance(1e-5 / 3);
    display.gamma = 2.2 + 1e-15;
    display.ambient = perception::Lux(1e-300);
    display.reflectivity = 1.0 / 3;
    for (const auto transfer : {TransferFunction::srgb, TransferFunction::gamma, TransferFunction::linear}) {
        display.transfer = transfer;
        const auto file = folder() / "round.json";
        const auto written = require(write_display(file, display));
        const auto back = require(read_display(file));
        expect_same(*back, display);
    }
    EXPECT_EQ(files_in_folder(), 1) << "no temporary file stays behind";
}

TEST_F(DisplayProfile, TheDisplaysThatComeWithUnseenAreValid) {
    int count = 0;
    for (const auto& entry : std::filesystem::directory_iterator("data/displays")) {
        const auto display = require(read_display(entry.path()));
        EXPECT_THAT(read(entry.path()), HasSubstr("\"source\""));
        ++count;
    }
    EXPECT_GE(count, 4);
    const auto standard = require(read_display("data/displays/monitor-20in-1600x1200.json"));
    expect_same(*standard, Display());
}

TEST_F(DisplayProfile, ErrorsNameTheFileAndTheKey) {
    struct Case {
        const char *from, *to, *expected;
    };
    const Case cases[] = {
        {"\"width_px\": 1920,", "", "\"width_px\" is missing"},
        {"\"height_px\": 1200,", "", "\"height_px\" is missing"},
        {"\"pixel_pitch_m\": 0.00027,", "", "\"diagonal_m\""},
        {"\"viewing_distance_m\": 0.6,", "", "\"viewing_distance_m\" is missing"},
        {"\"peak_cdm2\": 200,", "", "\"peak_cdm2\" is missing"},
        {",\n    \"black_cdm2\": 0.2", "", "\"black_cdm2\" is missing"},
        {"1920", "0", "\"width_px\" must be a whole number of at least 1"},
        {"1920", "-1920", "width_px"},
        {"1920", "1920.5", "width_px"},
        {"1920", "1e300", "width_px"},
        {"1920", "99999999999999999999", "width_px"},
        {"1920", "\"1920\"", "but is \"1920\""},
        {"1920", "null", "but is null"},
        {"1200", "[1200]", "but is an array"},
        {"1200", "{}", "but is an object"},
        {"0.00027", "0", "\"pixel_pitch_m\" must be a number above 0"},
        {"0.00027", "-1", "pixel_pitch_m"},
        {"0.00027", "1e-320", "pixel"},
        {"\"viewing_distance_m\": 0.6", "\"viewing_distance_m\": 0", "viewing_distance_m"},
        {": 200,\n", ": 0,\n", "peak_cdm2"},
        {": 200,\n", ": true,\n", "peak_cdm2"},
        {"0.2", "0", "black_cdm2"},
        {"0.2", "200", "\"black_cdm2\" must be below peak_cdm2"},
        {"0.2", "300", "black_cdm2"},
        {"{", "{\"diagonal_m\": 0.5,", "remove one"},
        {"{", "{\"name\": 7,", "\"name\" must be a string, but is 7"},
        {"{", "{\"source\": [],", "\"source\" must be a string"},
        {"{", "{\"ambient_lux\": -1,", "ambient_lux"},
        {"{", "{\"ambient_lux\": \"dark\",", "ambient_lux"},
        {"{", "{\"reflectivity\": 1.5,", "reflectivity"},
        {"{", "{\"peak_cd_m2\": 100,", "\"peak_cd_m2\" is unknown"},
        {"{", "{\"peak_cdm2\": 100,", "\"peak_cdm2\" twice"},
        {"1920", "NaN", ":2:"},
        {"1920", "Infinity", ":2:"},
        {"1920", "1e999", ":2:"},
        {"1200,", "1200", ":4:19: is no valid JSON"},
        {"0.2", "0.2,", "JSON"},
    };
    for (const Case& bad : cases) {
        const auto display = read_display(write(replaced(minimal, bad.from, bad.to), "bad.json"));
        ASSERT_FALSE(display) << bad.expected;
        EXPECT_THAT(display.error().message, AllOf(HasSubstr("bad.json"), HasSubstr(bad.expected)));
        EXPECT_THAT(display.error().message, testing::Not(HasSubstr("\n")));
        EXPECT_EQ(display.error().code, ErrorCode::malformed_data);
    }
}

TEST_F(DisplayProfile, RefusesWhatIsNoProfile) {
    const std::string deep(200000, '[');
    const std::string texts[] = {"",
                                 " ",
                                 "{",
                                 "[]",
                                 "7",
                                 "\"text\"",
                                 "null",
                                 "\xff\xfe",
                                 "{}{}",
                                 minimal + "x",
                                 deep,
                                 std::string(3, '\0'),
                                 "{\"name\": \"\xc3\x28\"}",
                                 "{\"a\":" + deep};
    for (const std::string& text : texts) {
        const auto display = read_display(write(text));
        ASSERT_FALSE(display);
        EXPECT_THAT(display.error().message, HasSubstr("profile.json"));
        EXPECT_LT(display.error().message.size(), 1000u);
    }
    const std::string long_key(1000000, 'k');
    EXPECT_LT(read_display(write("{\"" + long_key + "\": 1}")).error().message.size(), 1000u);
    EXPECT_THAT(read_display(write("{\"line\\nbreak\": 1}")).error().message, HasSubstr("line\\nbreak"));
    EXPECT_THAT(read_display(write("{}{}")).error().message, HasSubstr("profile.json:1:3"));
    EXPECT_THAT(read_display(write(minimal + '\0')).error().message, HasSubstr("a NUL byte"));
    EXPECT_THAT(read_display(write(std::string("{\n \0}", 5))).error().message, HasSubstr("profile.json:2:2"));
}

TEST_F(DisplayProfile, RefusesWhatIsNoFile) {
    for (const auto& path : {folder() / "missing.json", folder(), folder() / "no" / "folder.json"}) {
        const auto display = read_display(path);
        ASSERT_FALSE(display);
        EXPECT_EQ(display.error().code, ErrorCode::io_failure);
        EXPECT_THAT(display.error().message, HasSubstr(path.string()));
    }
}

TEST_F(DisplayProfile, EndlessInputEnds) {
    if (!std::filesystem::exists("/dev/zero")) GTEST_SKIP() << "no /dev/zero here";
    EXPECT_THAT(error_in(read_display("/dev/zero")), HasSubstr("it is no"));
}

TEST_F(DisplayProfile, SurvivesMutatedFiles) {
    int accepted = 0;
    for_each_mutation(minimal, 3000, [&](const std::string& text) {
        const auto display = read_display(write(text));
        if (display) {
            ++accepted;
            EXPECT_TRUE(validate(*display)) << text;
        } else {
            EXPECT_THAT(display.error().message, HasSubstr("profile.json"));
        }
    });
    EXPECT_GT(accepted, 0);
}

TEST_F(DisplayProfile, WritingFailsWithoutLeavingAFile) {
    Display bad;
    bad.peak = perception::Luminance(std::numeric_limits<double>::infinity());
    EXPECT_FALSE(write_display(folder() / "bad.json", bad));
    const auto nowhere = write_display(folder() / "no" / "folder.json", Display());
    ASSERT_FALSE(nowhere);
    EXPECT_EQ(nowhere.error().code, ErrorCode::io_failure);
    EXPECT_THAT(nowhere.error().message, HasSubstr("folder.json"));
    EXPECT_FALSE(write_display(folder(), Display())) << "a folder is not replaced by a file";
    EXPECT_EQ(files_in_folder(), 0);
}

TEST_F(DisplayProfile, WritingThroughALinkKeepsTheLink) {
    const auto target = write("old", "target.json");
    std::filesystem::create_symlink(target, folder() / "link.json");
    ASSERT_TRUE(write_display(folder() / "link.json", Display()));
    EXPECT_TRUE(std::filesystem::is_symlink(folder() / "link.json"));
    EXPECT_TRUE(read_display(target));
    EXPECT_EQ(files_in_folder(), 2);
}

} // namespace unseen::calibration::display_profile_test
