// Gazes from files, as trackers' programs write them.

#include <unistd.h>

#include <unseen/perception/gaze.h>

#include "testing.h"

namespace unseen::perception::gaze_file_test {

class GazeFileTest : public testing::Test {
protected:
    GazeFileTest()
        : file_(std::filesystem::path(testing::TempDir()) / ("unseen-gaze-" + std::to_string(::getpid()) + ".csv")) {}
    ~GazeFileTest() override { std::filesystem::remove(file_); }

    Result<GazeRecording> read(const std::string& text) const {
        std::ofstream(file_, std::ios::binary) << text;
        return read_gaze_recording(file_);
    }
    // The samples in a window of 1000x500 pixels; the notes go to `notes`.
    std::vector<GazeTrace::Sample> samples(const std::string& text, std::vector<std::string>* notes = nullptr) const {
        const auto recording = read(text);
        if (!recording) {
            ADD_FAILURE() << recording.error().message << "\n" << text;
            return {};
        }
        if (notes) *notes = recording->notes;
        const auto trace = recording->in_window(1000, 500);
        EXPECT_TRUE(trace);
        return trace ? trace->samples() : std::vector<GazeTrace::Sample>();
    }
    const std::filesystem::path file_;
};

TEST_F(GazeFileTest, ReadsItsOwnFormat) {
    std::vector<std::string> notes;
    EXPECT_THAT(samples("# a tracker\ntime_s,x_px,y_px\n0,100,200\r\n\n0.5,200, 100\n1.25,0.5,-50.5\n", &notes),
                ElementsAre(GazeTrace::Sample{0, {100, 200}}, GazeTrace::Sample{0.5, {200, 100}},
                            GazeTrace::Sample{1.25, {0.5, -50.5}}));
    EXPECT_THAT(notes, IsEmpty());
}

TEST_F(GazeFileTest, NeedsAFile) { EXPECT_FALSE(read_gaze_recording("/no/such/file.csv")); }

TEST_F(GazeFileTest, ReadsTobiiProLab) {
    std::vector<std::string> notes;
    // With a byte order mark, a combined gaze, events between the samples, and micro as a Greek letter.
    EXPECT_THAT(
        samples("\xef\xbb\xbfRecording timestamp [\xce\xbcs]\tSensor\tGaze point X [DACS px]\tGaze point Y [DACS px]\t"
                "Gaze point left X [DACS px]\tGaze point left Y [DACS px]\tGaze point X [MCS norm]\tGaze point Y "
                "[MCS norm]\tValidity left\tEvent\r\n"
                "2000\tEye Tracker\t960\t540\t950\t541\t0.5\t0.5\tInvalid\t\r\n"
                "2000\tMouse\t\t\t\t\t\t\t\tMouse \"left\"\r\n"
                "18667\tEye Tracker\t962\t538\t\t\t\t\t\t\r\n",
                &notes),
        ElementsAre(GazeTrace::Sample{0.002, {960, 540}}, GazeTrace::Sample{0.018667, {962, 538}}));
    EXPECT_THAT(notes, IsEmpty());
    // Two eyes: the mean of the valid ones.
    EXPECT_THAT(
        samples(
            "Recording timestamp [ms]\tGaze point left X [DACS px]\tGaze point left Y [DACS px]\tGaze point right X "
            "[DACS px]\tGaze point right Y [DACS px]\tValidity left\tValidity right\n"
            "0\t100\t200\t110\t220\tValid\tValid\n"
            "16\t100\t200\t110\t220\tInvalid\tValid\n"
            "33\t90\t80\t\t\tValid\tInvalid\n"
            "50\t\t\t\t\tInvalid\tInvalid\n"),
        ElementsAre(GazeTrace::Sample{0, {105, 210}}, GazeTrace::Sample{0.016, {110, 220}},
                    GazeTrace::Sample{0.033, {90, 80}}, GazeTrace::Sample{0.05, {90, 80}}));
    // Of the media alone; decimal commas.
    EXPECT_THAT(samples("Recording timestamp [ms]\tGaze point X [MCS norm]\tGaze point Y [MCS norm]\n8,5\t0,25\t0,5\n"),
                ElementsAre(GazeTrace::Sample{0.0085, {250, 250}}));
}

TEST_F(GazeFileTest, ReadsTobiiStudioAndSdk) {
    EXPECT_THAT(
        samples("ParticipantName\tRecordingTimestamp\tGazePointLeftX (ADCSpx)\tGazePointLeftY (ADCSpx)\tGazePointLeftX "
                "(ADCSmm)\tGazePointLeftY (ADCSmm)\tGazePointRightX (ADCSpx)\tGazePointRightY (ADCSpx)\tValidityLeft\t"
                "ValidityRight\t\n"
                "P01\t3\t640\t512\t170\t130\t660\t500\t0\t0\t\n"
                "P01\t7\t641\t513\t170\t130\t660\t500\t1\t4\t\n"),
        ElementsAre(GazeTrace::Sample{0.003, {650, 506}}, GazeTrace::Sample{0.007, {641, 513}}));
    std::vector<std::string> notes;
    EXPECT_THAT(samples("device_time_stamp,left_gaze_point_on_display_area_x,left_gaze_point_on_display_area_y,"
                        "left_gaze_point_validity,right_gaze_point_on_display_area_x,"
                        "right_gaze_point_on_display_area_y,right_gaze_point_validity\n"
                        "1000000,0.5,0.5,1,0.75,0.25,0\n1016000,nan,nan,0,0.75,0.25,1\n",
                        &notes),
                ElementsAre(GazeTrace::Sample{0, {500, 250}}, GazeTrace::Sample{0.016, {750, 125}}));
    EXPECT_THAT(notes, ElementsAre(HasSubstr("times count from its first row, not by 'device_time_stamp'")));
}

TEST_F(GazeFileTest, ReadsPupilCoreWhoseYPointsUp) {
    std::vector<std::string> notes;
    EXPECT_THAT(samples("gaze_timestamp,world_index,confidence,norm_pos_x,norm_pos_y,base_data\n"
                        "282726.25,0,0.98,0.5,0.75,282726.25-0 282726.25-1\n"
                        "282726.5,0,0.59,0.9,0.9,282726.5-0\n"
                        "282726.75,1,0.6,0.25,1,282726.75-0\n",
                        &notes),
                ElementsAre(GazeTrace::Sample{0, {500, 125}}, GazeTrace::Sample{0.25, {500, 125}},
                            GazeTrace::Sample{0.5, {250, 0}}));
    EXPECT_THAT(notes, ElementsAre(HasSubstr("times count from its first row"), HasSubstr("the head's camera"),
                                   HasSubstr("1 gap is longer than a blink (0.4 s), the longest 0.5 s")));
    EXPECT_THAT(
        samples("world_timestamp,world_index,gaze_timestamp,x_norm,y_norm,x_scaled,y_scaled,on_surf,confidence\n"
                "5,0,5.5,0.25,0.25,400,300,True,1.0\n"),
        ElementsAre(GazeTrace::Sample{0, {250, 375}}));
}

TEST_F(GazeFileTest, ReadsPupilNeon) {
    std::vector<std::string> notes;
    const auto s = samples("section id,recording id,timestamp [ns],gaze x [px],gaze y [px],worn,fixation id,blink id,"
                           "azimuth [deg],elevation [deg]\n"
                           "a,b,1669211225123456000,800.5,600.25,1,1,,1,2\n"
                           "a,b,1669211225128456000,1,2,1,,7,1,2\n"
                           "a,b,1669211225133456000,3,4,0,,,1,2\n"
                           "a,b,1669211225138456000,801,600,1,2,,1,2\n",
                           &notes);
    ASSERT_EQ(s.size(), 4u);
    const glm::dvec2 seen(800.5, 600.25);
    EXPECT_THAT((std::vector{s[0].px, s[1].px, s[2].px, s[3].px}), ElementsAre(seen, seen, seen, glm::dvec2(801, 600)));
    constexpr double spacing_s = 256e-9; // of doubles at nanoseconds since 1970
    for (std::size_t i = 0; i < s.size(); ++i) EXPECT_NEAR(s[i].time_s, 0.005 * static_cast<double>(i), spacing_s);
    EXPECT_THAT(notes, ElementsAre(HasSubstr("times count from its first row"), HasSubstr("the head's camera")));
}

TEST_F(GazeFileTest, ReadsEyeLink) {
    const std::string header =
        "RECORDING_SESSION_LABEL\tTRIAL_INDEX\tTIMESTAMP\tLEFT_GAZE_X\tLEFT_GAZE_Y\tLEFT_IN_BLINK\t"
        "RIGHT_GAZE_X\tRIGHT_GAZE_Y\tRIGHT_IN_BLINK\n";
    EXPECT_THAT(samples(header + "s1\t1\t771060.00\t512.0\t384.0\t0\t516.0\t380.0\t0\n"
                                 "s1\t1\t771061.00\t.\t.\t1\t520.0\t380.0\t0\n"
                                 "s1\t1\t771062.00\t9.0\t9.0\t1\t.\t.\t1\n"),
                ElementsAre(GazeTrace::Sample{0, {514, 382}}, GazeTrace::Sample{0.001, {520, 380}},
                            GazeTrace::Sample{0.002, {520, 380}}));
    EXPECT_THAT(samples("Time;Left X;Left Y;Right X;Right Y\n0;300;200;310;210\n0,01;300;200;;\n"),
                ElementsAre(GazeTrace::Sample{0, {305, 205}}, GazeTrace::Sample{0.01, {300, 200}}));
}

TEST_F(GazeFileTest, UnitsComeFromNames) {
    for (const auto& [name, text] :
         {std::pair("time_s", "0.25"), std::pair("TIME [s]", "0.25"), std::pair("Time (ms)", "250"),
          std::pair("time_ms", "250"), std::pair("t_us", "250000"), std::pair("time [\xc2\xb5s]", "250000"),
          std::pair("time_ns", "250000000"), std::pair("time", "0.25")})
        EXPECT_THAT(samples(std::string(name) + ",x_px,y_px\n" + text + ",1,2\n"),
                    ElementsAre(GazeTrace::Sample{0.25, {1, 2}}))
            << name;
    // The order of columns, names in quotes, and separators in quotes.
    EXPECT_THAT(samples("\"y_px\",\"note, or \"\"remark\"\"\",\"x_px\",\"time_s\"\n2,\"a, \"\"b, c\"\"\",\"1\",0.25\n"),
                ElementsAre(GazeTrace::Sample{0.25, {1, 2}}));
    EXPECT_THAT(samples("time_s,x_norm,y_norm\n0,0.25,1\n"), ElementsAre(GazeTrace::Sample{0, {250, 500}}));

    std::vector<std::string> notes;
    EXPECT_THAT(samples("time_s,x,y\n0,-0.5,1.5\n0.1,nan,\n", &notes),
                ElementsAre(GazeTrace::Sample{0, {-500, 750}}, GazeTrace::Sample{0.1, {-500, 750}}));
    EXPECT_THAT(notes, ElementsAre(HasSubstr("'x' and 'y' name no unit, and all are within -0.5..1.5")));
    EXPECT_THAT(samples("time_s,x,y\n0,0.5,0.5\n0.1,0.5,1.51\n", &notes),
                ElementsAre(GazeTrace::Sample{0, {0.5, 0.5}}, GazeTrace::Sample{0.1, {0.5, 1.51}}));
    EXPECT_THAT(notes, IsEmpty());
}

TEST_F(GazeFileTest, GapsHoldTheLastPosition) {
    std::vector<std::string> notes;
    EXPECT_THAT(samples("time_s,x_px,y_px\n0,,\n0.1,10,20\n0.2,NaN,nan\n0.3,NA,7\n0.4,.,-\n0.5,30,40\n0.6,,\n", &notes),
                ElementsAre(GazeTrace::Sample{0, {10, 20}}, GazeTrace::Sample{0.1, {10, 20}},
                            GazeTrace::Sample{0.2, {10, 20}}, GazeTrace::Sample{0.3, {10, 20}},
                            GazeTrace::Sample{0.4, {10, 20}}, GazeTrace::Sample{0.5, {30, 40}},
                            GazeTrace::Sample{0.6, {30, 40}}));
    EXPECT_THAT(notes, IsEmpty()) << "a blink is no news";
    samples("time_ms,x_px,y_px\n0,,\n500,1,2\n1000,,\n1700,1,2\n1800,,\n1900,1,2\n2900,,\n", &notes);
    EXPECT_THAT(notes, ElementsAre(AllOf(HasSubstr("3 gaps are longer than a blink"), HasSubstr("the longest 1.2 s"))));
    // Of one time the last that is seen counts.
    EXPECT_THAT(samples("time_s,x_px,y_px\n0,1,2\n0,3,4\n0,,\n"), ElementsAre(GazeTrace::Sample{0, {3, 4}}));
}

TEST_F(GazeFileTest, BadFilesNameTheLineAndTheColumn) {
    const std::string head = "time_s,x_px,y_px\n";
    const std::pair<std::string, const char*> cases[] = {
        {"", "no sample"},
        {head, "no sample"},
        {"when,x_px,y_px\n0,1,2\n",
         "line 1: no column is the time: name it time_s or time_ms; there are 'when', 'x_px'"},
        {"time_s,x_px,z_px\n0,1,2\n", "line 1: no two columns are the position"},
        {"time_s,x_px,y_norm\n0,1,2\n", "line 1: no two columns are the position"},
        {"time_s,x_px,y_px,X px\n0,1,2,3\n", "line 1: column 4, 'X px', says the same as column 2"},
        {"time_s,time_ms,x_px,y_px\n0,0,1,2\n", "line 1: column 2, 'time_ms', says the same as column 1"},
        {std::string("t\0i\0", 4) + "\n", "line 1: this is no UTF-8"},
        {head + "0,1,2\n0.1,1\n", "line 3: there are 2 cells, and the header names 3"},
        {head + "0,1,2,3\n", "line 2: there are 4 cells"},
        {head + "0,one,2\n", "line 2: column 2, 'x_px', is no finite number: 'one'"},
        {head + "0,1,2\n0.1,1,inf\n", "line 3: column 3, 'y_px', is no finite number"},
        {head + "0,1,2\n0.2,1,2\n0.1,1,2\n", "line 4: column 1, 'time_s', falls: 0.1 s comes after 0.2 s"},
        {head + "nan,1,2\n", "line 2: column 1, 'time_s', has no time"},
        {head + "0,1,2\n0.1,1,-1e300\n", "line 3: column 3, 'y_px', is -1e+300: at most 1e+06 pixels"},
        {"time_s,x_norm,y_norm\n0,1,51\n", "line 2: column 3, 'y_norm', is 51: at most 50 windows"},
        {head + "0,1,2\n\n1.5,1,2\n", "line 4: column 1, 'time_s', leaves a gap of 1.5 s"},
        {"time,x_px,y_px\n0,1,2\n4,1,2\n", "as seconds: name it time_ms where it counts milliseconds"},
        {"time,x_px,y_px\n0,1,2\n1,1,2\n2,1,2\n", "has less than ten rows a second; the name says no unit"},
        {head + "0,,\n0.1,nan,2\n", "no row has a position that is seen"},
        {"time_s,x_px,y_px,confidence\n0,1,2,95\n", "line 2: column 4, 'confidence', must be within 0..1, and is 95"},
        {"time_s,x_px,y_px,worn\n0,1,2,perhaps\n", "line 2: column 4, 'worn', is no finite number"},
    };
    for (const auto& [text, expected] : cases)
        EXPECT_THAT(error_in(read(text)), AllOf(HasSubstr(file_.string()), HasSubstr(expected))) << text;
}

// Bytes and pieces of tables in any order give a trace or an error.
TEST_F(GazeFileTest, AnyBytesGiveATraceOrAnError) {
    const std::string pieces[] = {"time_s", "x_px", "y_px", "left x", "right y", "confidence", "gaze_timestamp",
                                  "[ns]",   "(",    ")",    "\t",     ",",       ";",          "\"",
                                  "\n",     "\r\n", "0",    "1e9",    "nan",     "-",          "0.5",
                                  "1e308",  "inf",  "\xef", "\xce",   "\xbc",    " ",          "_",
                                  ".",      "#"};
    const std::string headers[] = {"", "time_s,x_px,y_px\n", "gaze_timestamp;x_norm;y_norm;on_surf;confidence\n",
                                   "t\tleft x\tleft y\tright x\tright y\tvalidity left\n"};
    std::mt19937 random(1);
    int traces = 0;
    for (int i = 0; i < 1000; ++i) {
        std::string text = headers[random() % std::size(headers)];
        for (auto n = random() % 40; n > 0; --n)
            text += random() % 8 == 0 ? std::string(1, static_cast<char>(random() % 256))
                                      : pieces[random() % std::size(pieces)];
        // Rows that may be right.
        const auto columns = std::count(
            text.begin(), text.begin() + static_cast<std::ptrdiff_t>(std::min(text.find('\n'), text.size())), ',');
        for (auto n = random() % 3; n > 0; --n) {
            text += "\n0." + std::to_string(random() % 10);
            for (auto c = columns; c > 0; --c) text += "," + std::to_string(random() % 3);
        }
        const auto recording = read(text);
        if (!recording) {
            EXPECT_THAT(recording.error().message, HasSubstr(": line ")) << text;
            continue;
        }
        ++traces;
        for (const GazeTrace::Sample& s : recording->trace.samples())
            ASSERT_TRUE(std::isfinite(s.time_s + s.px.x + s.px.y)) << text;
    }
    EXPECT_GT(traces, 5); // both happen
}

// data/README.md says how they were made.
TEST_F(GazeFileTest, SimulatedRecordingsAreMadeByTheirRule) {
    const auto truth = require(simulate_gaze(
        {.seed = 1, .duration_s = 5, .samples_per_s = 60, .width_px = 1600, .height_px = 1200}, Display()));
    std::vector<GazeTrace::Sample> expected = truth->samples();
    for (std::size_t i = 1; i < expected.size(); ++i)
        for (const auto& [from_s, to_s] : {std::pair(1.0, 1.15), std::pair(2.5, 2.7), std::pair(4.0, 4.25)})
            if (expected[i].time_s >= from_s && expected[i].time_s < to_s) expected[i].px = expected[i - 1].px;
    for (const char* name : {"data/gaze/simulated-pupil.csv", "data/gaze/simulated-tobii.tsv"}) {
        const auto recording = require(read_gaze_recording(name));
        const auto trace = require(recording->in_window(1600, 1200));
        ASSERT_EQ(trace->samples().size(), expected.size());
        for (std::size_t i = 0; i < expected.size(); ++i) {
            EXPECT_NEAR(trace->samples()[i].time_s, expected[i].time_s, 1e-6) << name;
            EXPECT_NEAR(trace->samples()[i].px.x, expected[i].px.x, 0.1) << name << " at " << expected[i].time_s;
            EXPECT_NEAR(trace->samples()[i].px.y, expected[i].px.y, 0.1) << name << " at " << expected[i].time_s;
        }
    }
}

} // namespace unseen::perception::gaze_file_test
