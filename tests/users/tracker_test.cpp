// A recording of an eye tracker, as its program exports it, played over a flight.
#include <unseen/perception/image.h>

#include "user_file.h"

namespace tracker_test {

using namespace unseen::app::testing;

class TrackerUsers : public UserFileTest {
protected:
    static constexpr int window = 512, frames = 15; // pixels; half a second

    // 120 Hz: the viewer looks at the middle, blinks for 100 ms, and looks to the right from then on. Between the samples
    // are rows of another sensor, in the middle of columns that nobody asks for.
    std::string tobii() const {
        std::ostringstream text;
        text << "\xef\xbb\xbfRecording timestamp [\xce\xbcs]\tParticipant name\tSensor\tGaze point X [DACS px]\t"
                "Gaze point Y [DACS px]\tPupil diameter left [mm]\tEye movement type\tEvent\r\n";
        for (int i = 0; i < 72; ++i) {
            const long time_us = 8333L * i;
            if (i % 9 == 4) text << time_us << "\tP07\tMouse\t\t\t\t\tMouseEvent\r\n";
            const bool is_blink = i >= 20 && i < 32;
            text << time_us << "\tP07\tEye Tracker\t";
            if (is_blink) text << "\t\t\tEyesNotFound\t\r\n";
            else text << (i < 20 ? window / 2 : 2 * window) << '\t' << window / 2 << "\t3.12\tFixation\t\r\n";
        }
        return text.str();
    }

    // By frame.
    std::vector<double> triangles(const Words& more) const {
        fs::remove(path("out.csv"));
        succeed(joined({"fly", "ball.vdt", "--path", "still.csv", "--csv", "out.csv", "--size", "512x512"}, more));
        std::istringstream lines(read_text(path("out.csv")));
        std::string line;
        std::getline(lines, line);
        std::vector<double> out;
        while (std::getline(lines, line)) out.push_back(std::stod(line.substr(line.find(',') + 1)));
        return out;
    }
};

TEST_F(TrackerUsers, BlinksHoldTheGaze) {
    write_ball("ball.obj", 48, 64);
    succeed({"build", "ball.obj", "-o", "ball.vdt"});
    std::string still = "eye_x,eye_y,eye_z,target_x,target_y,target_z\n";
    for (int i = 0; i < frames; ++i) still += "0,0.5,7,0,0,0\n";
    write_text(path("still.csv"), still);
    write_text(path("P07.tsv"), tobii());

    const auto wherever = triangles({"--no-draw"}), at_middle = triangles({"--no-draw", "--gaze", "256", "256"}),
               aside = triangles({"--no-draw", "--gaze", "1024", "256"});
    const auto played =
        triangles({"--gaze-trace", "P07.tsv", "--fps", "30", "-o", "frames/%02d.png", "--samples", "16"});
    ASSERT_EQ(played.size(), static_cast<std::size_t>(frames));
    ASSERT_LT(aside.back(), 0.9 * at_middle.back());
    for (int i = 0; i < frames; ++i) {
        // A frame is four samples; the blink ends with sample 32.
        if (i == 8) continue;
        const double expected = i < 8 ? at_middle.back() : aside.back();
        EXPECT_NEAR(played[static_cast<std::size_t>(i)], expected, 0.02 * expected) << "frame " << i;
        EXPECT_LE(expected, wherever.back() * 1.01);
    }
    // What was drawn shows no difference to who looked there.
    const Outcome drawn = run({"render", "ball.vdt", "-o", "full.png", "--full", "--eye", "0", "0.5", "7", "--target",
                               "0", "0", "0", "--size", "512x512", "--samples", "16"});
    if (drawn.err.find("No OpenGL") != std::string::npos) GTEST_SKIP() << drawn.err;
    for (const auto& [frame, gaze] : {std::pair("05", "256"), std::pair("12", "1024")}) {
        succeed({"compare", "full.png", std::string("frames/") + frame + ".png", "--gaze", gaze, "256", "--fail-above",
                 "0"});
    }
}

} // namespace tracker_test
