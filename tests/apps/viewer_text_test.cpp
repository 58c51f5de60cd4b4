// What the viewer says of a frame: in its title, over its picture, and of its keys.

#include "testing.h"
#include "viewer_text.h"

namespace {

using namespace unseen;
using namespace unseen::app;
using session::FoldTest;
using session::GazeSource;
using session::Goal;

// The bunny as the viewer first shows it.
ViewerState bunny() {
    ViewerState state;
    state.model = "bunny.vdt";
    state.report.source_triangles = 69666;
    state.report.stats.triangles = 34294;
    state.report.stats.max_fold_cost = 1;
    state.report.imperceptible_from_m = 0.5;
    state.report.fold_tests = {FoldTest::error};
    state.window_px = {1024, 1024};
    state.frame_ms = 63.24;
    state.adapt_ms = 1.04;
    return state;
}

std::vector<std::string> lines_of(const ViewerState& state) {
    std::vector<std::string> lines;
    for (const TextLine& line : viewer_lines(state)) lines.push_back(line.lead + ": " + line.text);
    return lines;
}

std::string line_of(const ViewerState& state, const std::string& lead) {
    for (const TextLine& line : viewer_lines(state))
        if (line.lead == lead) return line.text;
    return "none";
}

TEST(ViewerText, SaysWhatIsShown) {
    EXPECT_THAT(lines_of(bunny()), ElementsAre("shown: 34,294 of 69,666 triangles (49%)", "mode: imperceptible",
                                               "visible: nobody sees a difference, looked at from 0.5 m or more",
                                               "fold test: measured errors",
                                               "time: 63 ms a frame, 1 ms of it to follow the view", "keys: press h"));
    EXPECT_EQ(viewer_title(bunny()), "bunny.vdt - imperceptible: 34,294 of 69,666 triangles - Unseen");
}

TEST(ViewerText, ParallelViewsSayHowHighTheyAre) {
    ViewerState state = bunny();
    EXPECT_EQ(line_of(state, "view"), "none");
    state.orthographic_height = 0.2346;
    EXPECT_EQ(line_of(state, "view"), "in parallel, 0.235 m high");
}

TEST(ViewerText, TheWholeModelIsFoldedByNoTest) {
    ViewerState state = bunny();
    state.goal = Goal::full();
    state.report.stats.triangles = 69666;
    state.report.stats.max_fold_cost = 0;
    EXPECT_THAT(lines_of(state), ElementsAre("shown: 69,666 of 69,666 triangles (100%)", "mode: whole",
                                             "time: 63 ms a frame, 1 ms of it to follow the view", "keys: press h"));
    EXPECT_EQ(viewer_title(state), "bunny.vdt - whole: 69,666 of 69,666 triangles - Unseen");
}

TEST(ViewerText, BudgetsSayFromHowFarNobodySeesThem) {
    ViewerState state = bunny();
    state.goal = Goal::budget(10000);
    state.report.stats.triangles = 10000;
    state.report.imperceptible_from_m = 18.04;
    EXPECT_EQ(line_of(state, "mode"), "budget of 10,000");
    EXPECT_EQ(line_of(state, "visible"), "a difference can be seen; looked at from 18 m or more, nobody sees it");
    state.report.imperceptible_from_m = std::numeric_limits<double>::infinity();
    EXPECT_EQ(line_of(state, "visible"), "a difference can be seen from any distance");
    state.display.distance = perception::Metres(20);
    state.report.imperceptible_from_m = 18.04;
    EXPECT_THAT(line_of(state, "visible"), HasSubstr("nobody sees a difference")) << "who sits so far away";
}

TEST(ViewerText, TestsInPixelsDoNotKnowWhatIsSeen) {
    ViewerState state = bunny();
    state.goal = Goal::pixels(2.5);
    state.report.fold_tests = {FoldTest::extent};
    state.report.imperceptible_from_m = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(line_of(state, "mode"), "up to 2.5 pixels");
    EXPECT_THAT(line_of(state, "visible"), HasSubstr("is not known"));
    EXPECT_EQ(line_of(state, "fold test"), "extent in pixels");
}

// A word by itself must not read like a failure.
TEST(ViewerText, NoFoldTestIsCalledAnError) {
    std::set<std::string> names;
    for (const FoldTest test : {FoldTest::error, FoldTest::luebke_hallen, FoldTest::luebke_hallen_safe,
                                FoldTest::extent, FoldTest::displacement}) {
        ViewerState state = bunny();
        state.report.fold_tests = {test};
        EXPECT_THAT(viewer_title(state), Not(HasSubstr("error")));
        const std::string name = line_of(state, "fold test");
        EXPECT_NE(name, "error");
        names.insert(name);
    }
    EXPECT_EQ(names.size(), 5u);
}

TEST(ViewerText, TimesAreWrittenAsPeopleDo) {
    ViewerState state = bunny();
    const auto time = [&](double frame_ms, std::optional<double> adapt_ms) {
        state.frame_ms = frame_ms;
        state.adapt_ms = adapt_ms;
        return line_of(state, "time");
    };
    EXPECT_EQ(time(712.3, 0.0065), "710 ms a frame, under 0.1 ms of it to follow the view");
    EXPECT_EQ(time(2140, {}), "2.14 s a frame");
    EXPECT_EQ(time(16.666, 0.35), "17 ms a frame, 0.35 ms of it to follow the view");
    state.frame_ms.reset();
    EXPECT_EQ(line_of(state, "time"), "none") << "nothing is known before the second frame";
}

TEST(ViewerText, TheGazeIsSaidWhereItIsInForce) {
    ViewerState state = bunny();
    EXPECT_EQ(line_of(state, "gaze"), "none");
    state.gaze = session::Gaze{{512, 700}};
    state.gaze_source = GazeSource::mouse;
    EXPECT_EQ(line_of(state, "gaze"), "the pointer; the ring is the fovea, 2 degrees");
    EXPECT_EQ(viewer_mode(state), "gaze-directed");
    state.gaze->margin_deg = 0.5;
    EXPECT_THAT(line_of(state, "gaze"), EndsWith("2 degrees; give or take 0.5 (dashed)"));
    state.gaze_source = GazeSource::trace;
    EXPECT_THAT(line_of(state, "gaze"), HasSubstr("recorded"));
    state.gaze_source = GazeSource::simulated;
    EXPECT_THAT(line_of(state, "gaze"), HasSubstr("simulated"));
    state.gaze_source = GazeSource::head;
    state.gaze->margin_deg = 15;
    EXPECT_EQ(line_of(state, "gaze"), "somewhere within 15 degrees of the middle (dashed)");

    state.gaze_source = GazeSource::none;
    state.gaze = session::Gaze{{1603, -12}};
    EXPECT_EQ(line_of(state, "gaze"), "pixel 1,603, -12, outside of the window");
    state.goal = Goal::budget(500);
    EXPECT_EQ(viewer_mode(state), "budget of 500");
}

TEST(ViewerText, WhatGoesOnIsSaid) {
    ViewerState state = bunny();
    state.limit_ms = 2;
    EXPECT_EQ(line_of(state, "limit"), "none") << "it was enough";
    state.report.stats.is_complete = false;
    EXPECT_EQ(line_of(state, "limit"), "refining, 2 ms a frame");
    EXPECT_THAT(viewer_title(state), EndsWith(" triangles, refining - Unseen"));
    state.report.stats.is_complete = true;
    EXPECT_EQ(line_of(state, "occlusion"), "none");
    state.report.passes = {{"occlusion", true, "it saves time"}};
    EXPECT_EQ(line_of(state, "occlusion"), "on, it saves time");
    state.report.gliding = 1204;
    EXPECT_EQ(line_of(state, "gliding"), "1,204 vertices");
    EXPECT_THAT(viewer_title(state), EndsWith(" triangles, gliding - Unseen"));
}

TEST(ViewerText, EveryKeyIsListedOnce) {
    std::set<std::string> leads;
    for (const TextLine& key : viewer_keys()) {
        EXPECT_FALSE(key.text.empty());
        EXPECT_TRUE(leads.insert(key.lead).second) << key.lead;
        EXPECT_THAT(viewer_help(), HasSubstr(key.lead));
        EXPECT_THAT(viewer_help(), HasSubstr(key.text));
    }
    for (const char* key : {"1", "2", "3", "4", "drag", "shift + drag", "wheel", "r", "w", "f", "s", "S", "i", "h"})
        EXPECT_THAT(leads, Contains(key));
}

} // namespace
