// unseen render and sheet, where there is an OpenGL; and what they say where there is none.
#include "run_command.h"

#include <unseen/perception/image.h>

namespace render_command_test {

using namespace unseen::app::testing;
using unseen::perception::read_image;

class RenderCommandTest : public DrawingCommandTest {
protected:
    Json render(Words more, const std::string& out) const {
        const Json report =
            succeed(joined({"render", "ball.vdt", "-o", out, "--size", "200x160", "--json", "-"}, more)).json();
        expect_cut_report(report);
        EXPECT_TRUE(report["draw_ms"].is_number()) << report;
        return report;
    }
};

TEST_F(RenderCommandTest, DrawsForPeopleAndForJudging) {
    render({}, "ball.png");
    const auto picture = require(read_image(path("ball.png")));
    EXPECT_EQ(picture->image.width, 200);
    EXPECT_EQ(picture->image.height, 160);
    EXPECT_EQ(picture->image.channels, 3);
    EXPECT_EQ(picture->bits, 8);
    // 20 cd/m2 between 0.5 and 100, as sRGB code: 123 of 255.
    EXPECT_NEAR(picture->image.at(0, 0), 123.0 / 255, 1.0 / 255);

    for (const std::string name : {"ball.pfm", "ball.exr"}) {
        render({}, name);
        const auto luminance = require(read_image(path(name)));
        EXPECT_EQ(luminance->image.channels, 1);
        EXPECT_TRUE(luminance->is_absolute);
        EXPECT_NEAR(luminance->image.at(0, 0), 20, 1e-4) << "the background";
        // The lit matt grey: from 0.16 to 0.8 of the display's span.
        const float middle = luminance->image.at(100, 60);
        EXPECT_GT(middle, 16.0f);
        EXPECT_LT(middle, 80.2f);
    }
}

TEST_F(RenderCommandTest, TheImperceptibleCutShowsNoDifference) {
    render({"--full"}, "full.pfm");
    const Json cut = render({"--gaze", "1500", "80"}, "cut.pfm");
    EXPECT_LT(cut["triangles"], ball_triangles);
    EXPECT_EQ(effect_named(cut, "back-face culling")["on"], true);
    EXPECT_EQ(effect_named(cut, "frustum culling")["on"], true);
    succeed({"compare", "full.pfm", "cut.pfm", "--gaze", "1500", "80", "--fail-above", "0"});

    render({"--triangles", "60"}, "rough.pfm");
    const Outcome rough = run({"compare", "full.pfm", "rough.pfm", "--fail-above", "0"});
    EXPECT_EQ(rough.status, 1) << "the judge is not blind: " << rough.out;
}

std::vector<std::vector<double>> numbers_of(const std::string& csv) {
    std::vector<std::vector<double>> rows;
    std::istringstream lines(csv);
    std::string line;
    std::getline(lines, line);
    EXPECT_EQ(line, "frame,triangles,folds,unfolds,changes,node_tests,cut_ms,index_ms,uploaded_bytes,draw_ms,frame_ms,"
                    "drawn_triangles,gliding,change_v,flicker_v,picture_v");
    while (std::getline(lines, line)) {
        std::istringstream cells(line);
        rows.emplace_back();
        for (std::string cell; std::getline(cells, cell, ',');)
            rows.back().push_back(cell.empty() ? -1 : std::stod(cell));
        rows.back().resize(16, -1);
    }
    return rows;
}

// One request, one answer: a single picture and a flight's frame from the same place are cut alike; but what faces away
// stays in flights without a budget, as in meshes.
TEST_F(RenderCommandTest, APictureAndAFlightMakeTheSameCut) {
    const std::vector<Words> requests = {
        {"--fold-test", "luebke-hallen"},
        {"--fold-test", "luebke-hallen", "--gaze", "1500", "80"},
        {"--fold-test", "luebke-hallen", "--triangles", "500"},
        {"--fold-test", "luebke-hallen-safe"},
        {"--fold-test", "error"},
        {"--pixels", "2"},
        {"--pixels", "2", "--fold-test", "displacement"},
    };
    for (const Words& request : requests) {
        SCOPED_TRACE(::testing::PrintToString(request));
        // Flights do not fold what a picture hides.
        const bool has_budget = std::ranges::find(request, "--triangles") != request.end();
        const double still =
            has_budget ? render(joined(request, {"--visibility", "spheres"}), "still.png")["triangles"]
                       : succeed(joined({"simplify", "ball.vdt", "-o", "still.ply", "--size", "200x160", "--json", "-"},
                                        request))
                             .json()["triangles"];
        Words flight =
            joined({"fly", "ball.vdt", "--path", "orbit:0:1", "--no-draw", "--csv", "flight.csv", "--size", "200x160"},
                   request);
        succeed(flight);
        const auto rows = numbers_of(read_text(path("flight.csv")));
        ASSERT_EQ(rows.size(), 1u);
        EXPECT_GT(still, 0);
        EXPECT_NEAR(rows[0][1], still, 0.01 * still);
    }
}

TEST_F(RenderCommandTest, ANumberedPictureWithoutAPathIsAWalk) {
    succeed({"fly", "ball.vdt", "--path", "walk:-6000:5", "--no-draw", "--csv", "walk.csv"});
    const auto rows = numbers_of(read_text(path("walk.csv")));
    ASSERT_EQ(rows.size(), 5u);
    EXPECT_NE(rows[4][1], rows[0][1]) << "400 m farther away";
    const Outcome old = succeed({"render", "ball.vdt", "--path", "walk:-600:5", "--no-draw", "--csv", "old.csv"});
    EXPECT_EQ(numbers_of(read_text(path("old.csv"))).size(), 5u);
    succeed({"render", "ball.vdt", "-o", "walk/%02d.png", "--size", "24x24"});
    EXPECT_TRUE(std::filesystem::exists(path("walk/59.png")));
    for (const char* none : {"walk:", "walk:x", "walk:1:0", "walk:1:2:3", "walk:nan"})
        EXPECT_THAT(run({"fly", "ball.vdt", "--path", none, "--no-draw"}).err, HasSubstr("METRES_A_SECOND")) << none;
}

TEST_F(RenderCommandTest, WhatAPictureHidesIsOfThatPictureAlone) {
    EXPECT_THAT(run({"render", "ball.vdt", "--path", "orbit:1:6", "--visibility", "picture"}).err,
                HasSubstr("no option '--visibility' here"));
}

TEST_F(RenderCommandTest, AnOrbitFollowsWithOneCut) {
    const Json report = succeed({"fly", "ball.vdt", "--path", "orbit:2:24", "--size", "96x80", "--csv", "orbit.csv",
                                 "--plot", "orbit.png", "-o", "frames/%03d.png", "--quality", "3", "--json", "-"})
                            .json();
    EXPECT_EQ(report["frames"], 24);
    EXPECT_EQ(effect_named(report, "back-face folding")["on"], false);
    const auto rows = numbers_of(read_text(path("orbit.csv")));
    ASSERT_EQ(rows.size(), 24u);
    EXPECT_EQ(rows[0][8], 12 * rows[0][1]) << "the first frame uploads the whole";
    double changes = 0, uploaded = 0;
    for (std::size_t i = 1; i < rows.size(); ++i) {
        EXPECT_EQ(rows[i][0], static_cast<double>(i));
        EXPECT_EQ(rows[i][2] + rows[i][3], rows[i][4]);
        changes += rows[i][4];
        uploaded += rows[i][8];
    }
    EXPECT_GT(changes, 0);
    EXPECT_GT(uploaded, 0);
    EXPECT_EQ(read_image(path("orbit.png"))->image.width, 1200);
    EXPECT_EQ(std::distance(fs::directory_iterator(path("frames")), fs::directory_iterator()), 24);
    // A frame is the picture that is drawn of the same view alone, but for the cut, which is a little finer.
    EXPECT_EQ(require(read_image(path("frames/023.png")))->image.height, 80);
}

TEST_F(RenderCommandTest, PathsComeFromFiles) {
    write_text(path("path.csv"), "eye_x, eye_y,eye_z,target_x,target_y,target_z,gaze_x,gaze_y\r\n"
                                 "0,0,4,0,0,0,48,40\r\n\n+0.1,0,4,0,0,0,48,41\n0.1,0,4,0,0,0,48,41\n");
    EXPECT_THAT(
        succeed({"fly", "ball.vdt", "--path", "path.csv", "--size", "96x80", "--csv", "out.csv", "--no-draw"}).out,
        HasSubstr("frames"));
    const auto rows = numbers_of(read_text(path("out.csv")));
    ASSERT_EQ(rows.size(), 3u);
    EXPECT_EQ(rows[2][4], 0) << "a still view changes nothing";
    EXPECT_EQ(rows[2][5], 0) << "and tests nothing";
    EXPECT_EQ(rows[2][8], -1) << "nothing was drawn";
}

TEST_F(RenderCommandTest, GazesArePlayedAndRepeat) {
    const auto triangles = [&](Words more) {
        succeed(joined({"fly", "ball.vdt", "--path", "orbit:0:40", "--size", "800x640", "--observer", "median",
                        "--fold-test", "error", "--csv", "out.csv", "--no-draw"},
                       more));
        std::vector<double> column;
        for (const auto& row : numbers_of(read_text(path("out.csv")))) column.push_back(row[1]);
        EXPECT_EQ(column.size(), 40u);
        return column;
    };
    const auto sum = [](const std::vector<double>& v) { return std::accumulate(v.begin(), v.end(), 0.0); };
    const auto first = triangles({"--gaze-mode", "simulated", "--seed", "7"});
    EXPECT_EQ(triangles({"--gaze-mode", "simulated", "--seed", "7"}), first) << "the same gaze gives the same run";
    EXPECT_NE(triangles({"--gaze-mode", "simulated", "--seed", "8"}), first);
    const double everywhere = sum(triangles({}));
    EXPECT_LT(sum(first), everywhere);
    const double unsure = sum(triangles({"--gaze-mode", "simulated", "--seed", "7", "--gaze-error", "5"}));
    EXPECT_GT(unsure, sum(first)) << "an error widens the fovea";
    EXPECT_EQ(sum(triangles({"--gaze-mode", "simulated", "--tracker", "seed=7,error=5"})), unsure)
        << "as it is spelt now";
    EXPECT_LE(unsure, everywhere);
    EXPECT_LE(sum(triangles({"--gaze-mode", "simulated", "--seed", "7", "--gaze-latency", "60"})), everywhere);
    triangles({"--gaze-mode", "head"});

    // Half a second of looking at one corner, then at the middle: at 60 frames a second, after 30 frames.
    write_text(path("gaze.csv"), "time_s,x_px,y_px\n0,0,0\n0.499,0,0\n0.5,400,320\n1,400,320\n");
    const auto traced = triangles({"--gaze-trace", "gaze.csv"});
    EXPECT_EQ(traced[5], traced[25]);
    EXPECT_EQ(traced[32], traced[39]);
    EXPECT_LT(traced[25], traced[35]);
    const Outcome still =
        succeed({"render", "ball.vdt", "-o", "head.png", "--gaze-mode", "head", "--size", "96x80", "--json", "-"});
    EXPECT_THAT(effect_named(still.json(), "gaze")["why"].get<std::string>(), HasSubstr("give or take 15 degrees"));
}

TEST_F(RenderCommandTest, GazesAreReadAsTrackersWriteThem) {
    const auto triangles = [&](const std::string& trace) {
        const Outcome flown = succeed({"fly", "ball.vdt", "--path", "orbit:0:12", "--size", "800x640", "--fold-test",
                                       "error", "--csv", "out.csv", "--no-draw", "--gaze-trace", trace});
        std::vector<double> column;
        for (const auto& row : numbers_of(read_text(path("out.csv")))) column.push_back(row[1]);
        return std::pair(column, flown.err);
    };
    write_text(path("own.csv"), "time_s,x_px,y_px\n0,0,0\n0.0625,0,0\n0.125,400,320\n0.5,400,320\n");
    const auto [expected, silence] = triangles("own.csv");
    EXPECT_EQ(silence, "");
    EXPECT_NE(expected.front(), expected.back());
    write_text(path("tobii.tsv"),
               "Recording timestamp [us]\tSensor\tGaze point X [DACS px]\tGaze point Y [DACS px]\r\n"
               "0\tEye Tracker\t0\t0\r\n62500\t\t\t\r\n125000\t\t400\t320\r\n500000\t\t400\t320\r\n");
    EXPECT_EQ(triangles("tobii.tsv"), std::pair(expected, std::string()));
    // 0..1 runs across the window.
    write_text(path("pupil.csv"), "gaze_timestamp,world_index,confidence,norm_pos_x,norm_pos_y\n"
                                  "64,0,1,0,1\n64.0625,1,0.2,0.7,0.1\n64.125,2,1,0.5,0.5\n64.5,3,1,0.5,0.5\n");
    const auto [pupil, notes] = triangles("pupil.csv");
    EXPECT_EQ(pupil, expected);
    EXPECT_THAT(notes, HasSubstr("note: pupil.csv: times count from its first row, not by 'gaze_timestamp'"));
    EXPECT_THAT(run({"fly", "ball.vdt", "--path", "orbit:0:2", "--no-draw", "--gaze-trace",
                     fs::absolute("data/gaze/simulated-tobii.tsv")})
                    .err,
                "");
}

TEST_F(RenderCommandTest, BadGazesAreRefused) {
    const Words flight = {"fly", "ball.vdt", "--path", "orbit:0:2", "--no-draw"};
    const auto with = [&](Words more) { return run(joined(flight, more)); };
    write_text(path("gap.csv"), "time_s,x_px,y_px\n0,1,2\n3,1,2\n");
    const Outcome gap = with({"--gaze-trace", "gap.csv"});
    EXPECT_EQ(gap.status, 1);
    EXPECT_THAT(gap.err, IsAnErrorForPeople());
    EXPECT_THAT(gap.err, HasSubstr("gap.csv: line 3"));
    EXPECT_EQ(with({"--gaze-trace", "missing.csv"}).status, 1);
    // What is quickly read is told before the model is read and measured.
    EXPECT_THAT(run({"fly", "missing.vdt", "--path", "missing.csv"}).err, HasSubstr("missing.csv"));
    EXPECT_THAT(run({"fly", "missing.vdt", "--path", "orbit:1", "--gaze-trace", "missing.csv"}).err,
                HasSubstr("missing.csv"));
    EXPECT_THAT(run({"view", "missing.vdt", "--gaze-trace", "missing.csv"}).err, HasSubstr("missing.csv"));
    for (const Words& more : std::vector<Words>{{"--gaze-mode", "nobody"},
                                                {"--gaze-mode", "mouse"},
                                                {"--gaze-error", "-1"},
                                                {"--gaze-error", "nan"},
                                                {"--gaze-latency", "1e9"},
                                                {"--gaze", "1", "2", "--tracker", "jitter=1"},
                                                {"--gaze-mode", "head", "--gaze-trace", "gap.csv"},
                                                {"--gaze", "1", "2", "--gaze-mode", "head"},
                                                {"--seed", "3"},
                                                {"--gaze-mode", "head", "--gaze-latency", "20"},
                                                {"--gaze", "1", "2", "--suppression"}})
        EXPECT_EQ(with(more).status, 2) << more.back();
    EXPECT_EQ(run({"render", "ball.vdt", "-o", "o.png", "--gaze-mode", "simulated"}).status, 2)
        << "one picture has no time";
    EXPECT_EQ(run({"render", "ball.vdt", "-o", "o.png", "--gaze-error", "3"}).status, 2) << "of no gaze";
    // Clocks that have nothing to do with each other.
    write_text(path("late.csv"), "time_s,x_px,y_px\n1690000000,1,2\n1690000000.1,1,2\n");
    const Outcome late = with({"--gaze-trace", "late.csv"});
    EXPECT_EQ(late.status, 1);
    EXPECT_THAT(late.err, ::testing::AllOf(IsAnErrorForPeople(), HasSubstr("late.csv runs from")));
    write_text(path("short.csv"), "time_s,x_px,y_px\n0,1,2\n0.01,1,2\n");
    const Outcome ended = with({"--gaze-trace", "short.csv"});
    EXPECT_EQ(ended.status, 0) << ended.err;
    EXPECT_THAT(ended.err, HasSubstr("after its end"));
    write_text(path("seen.csv"), "eye_x,eye_y,eye_z,target_x,target_y,target_z,gaze_x,gaze_y\n0,0,5,0,0,0,10,10\n");
    EXPECT_THAT(run({"fly", "ball.vdt", "--path", "seen.csv", "--no-draw", "--gaze", "1", "2"}),
                fails(1, HasSubstr("says where the viewer looks")));
}

TEST_F(RenderCommandTest, BadPathsAreNamedByLineAndColumn) {
    const std::string header = "eye_x,eye_y,eye_z,target_x,target_y,target_z\n";
    const std::vector<std::pair<std::string, std::string>> files = {
        {"", "line 1"},
        {header, "no frame"},
        {"eye_x,eye_y\n", "no column 'eye_z'"},
        {"eye_x,eye_y,eye_z,target_x,target_y,target_z,up_x\n", "no column 'up_y'"},
        {"eye_x,eye_y,eye_z,target_x,target_y,target_z,eye_x\n", "twice"},
        {"eye_x,ear_y\n", "column 2, 'ear_y'"},
        {header + "0,0,4,0,0,0\n0,0,4,0,0\n", "line 3: there are 5 columns"},
        {header + "0,0,4,0,zero,0\n", "line 2: column 5 (target_y)"},
        {header + "0,0,inf,0,0,0\n", "line 2: column 3 (eye_z)"},
        {header + "1,2,3,1,2,3\n", "line 2: "},
    };
    for (const auto& [text, complaint] : files) {
        write_text(path("path.csv"), text);
        const Outcome outcome = run({"fly", "ball.vdt", "--path", "path.csv", "--no-draw", "--csv", "out.csv"});
        EXPECT_EQ(outcome.status, 1) << text;
        EXPECT_THAT(outcome.err, IsAnErrorForPeople()) << text;
        EXPECT_THAT(outcome.err, HasSubstr(complaint)) << text;
        EXPECT_FALSE(fs::exists(path("out.csv")));
    }
    for (const std::string orbit :
         {"orbit", "orbit:", "orbit:x", "orbit:1:0", "orbit:1:x", "orbit:0", "orbit:nan:5", "missing.csv"})
        EXPECT_EQ(run({"fly", "ball.vdt", "--path", orbit, "--no-draw"}).status, 1) << orbit;
    const std::vector<Words> wrong = {{"--csv", "a.csv"},
                                      {"--path", "orbit:1", "-o", "same.png"},
                                      {"--path", "orbit:1", "-o", "%d%d.png"},
                                      {"--path", "orbit:1", "-o", "%s.png"},
                                      {"--path", "orbit:1", "--quality", "0"},
                                      {"--geomorph", "0.2", "-o", "a.png"},
                                      {"--path", "orbit:1", "--geomorph", "-1"},
                                      {"--path", "orbit:1", "--geomorph", "nan"},
                                      {"--path", "orbit:1", "--fps", "30"},
                                      {"--path", "orbit:1", "--no-draw", "-o", "%d.png"}};
    for (auto words : wrong) {
        words.insert(words.begin(), {"render", "ball.vdt"});
        EXPECT_EQ(run(words).status, 2) << ::testing::PrintToString(words);
    }
}

// The ball goes away, so that its cut becomes coarser, in steps that one sees. Gliding hides them.
TEST_F(RenderCommandTest, AFlightSaysWhetherChangesCanBeSeen) {
    std::string away = "eye_x,eye_y,eye_z,target_x,target_y,target_z\n";
    for (int i = 0; i < 12; ++i) away += "0,0," + std::to_string(60 + 2 * i) + ",0,0,0\n";
    write_text(path("away.csv"), away);
    const auto fly = [&](Words more) {
        more.insert(more.begin(),
                    {"render", "ball.vdt", "--changes", "--size", "96x80", "--samples", "16", "--json", "-"});
        const Outcome flown = succeed(more);
        return flown.json();
    };
    const Json popping =
        fly({"--path", "away.csv", "--pixels", "6", "--fps", "25", "--csv", "popping.csv"})["changes_seen"];
    EXPECT_EQ(popping["judged"], 11);
    EXPECT_GT(popping["seen"], 0);
    EXPECT_GT(popping["largest_v"], 1);
    EXPECT_GT(popping["failing_pictures"], 0) << "six pixels can be seen";
    const auto rows = numbers_of(read_text(path("popping.csv")));
    ASSERT_EQ(rows.size(), 12u);
    for (const auto& row : rows) {
        if (row[13] > 0) EXPECT_GT(row[4], 0) << "the cut changes";
        EXPECT_GE(row[13], row[14]);
        EXPECT_GT(row[15], 0);
    }
    EXPECT_NEAR(rows[popping["frame"].get<std::size_t>()][13], popping["largest_v"].get<double>(), 1e-12);
    const Json gliding = fly({"--path", "away.csv", "--pixels", "6", "--fps", "25", "--geomorph", "1"})["changes_seen"];
    EXPECT_LT(gliding["largest_v"], 0.5 * popping["largest_v"].get<double>());
    EXPECT_EQ(gliding["judged"], 11);

    // Where nothing moves, nothing changes; a gaze that does is no change of the picture.
    const Json still = fly({"--path", "orbit:0:4"})["changes_seen"];
    EXPECT_EQ(still["largest_v"], 0);
    EXPECT_EQ(still["seen"], 0);
    EXPECT_FALSE(fly({"--path", "orbit:0:2", "--pixels", "6"})["changes_seen"].is_null());
    // What comes into the window is cut finer than it was outside: no change that anybody sees.
    std::string turning = "eye_x,eye_y,eye_z,target_x,target_y,target_z\n";
    for (int i = 0; i < 6; ++i) turning += "0,0,60," + std::to_string(-2 + 0.4 * i) + ",0,0\n";
    write_text(path("turning.csv"), turning);
    const Json entering = fly({"--path", "turning.csv", "--pixels", "0.2"})["changes_seen"];
    EXPECT_LT(entering["largest_v"], 0.5);
    for (const auto& wrong :
         {Words{"-o", "a.png"}, {"--path", "orbit:1", "--no-draw"}, {"--path", "orbit:1", "--wireframe"}}) {
        Words words = joined({"render", "ball.vdt", "--changes"}, wrong);
        EXPECT_EQ(run(words).status, 2) << ::testing::PrintToString(words);
    }
}

TEST_F(RenderCommandTest, AFlightGlidesWhenItIsAskedTo) {
    std::string away = "eye_x,eye_y,eye_z,target_x,target_y,target_z\n";
    for (int i = 0; i < 20; ++i) away += "0,0," + std::to_string(60 + 2 * i) + ",0,0,0\n";
    write_text(path("away.csv"), away);
    const Words flight = {"fly", "ball.vdt", "--path", "away.csv", "--size", "96x80", "--pixels", "6"};
    const auto fly = [&](Words more) {
        const Outcome flown = succeed(joined(flight, more));
        return flown.json();
    };
    const Json still = fly({"--csv", "still.csv", "-o", "still%d.png", "--json", "-"});
    EXPECT_EQ(effect_named(still, "geomorphs")["on"], false);
    EXPECT_TRUE(still["gliding"]["largest"].is_null());
    const Json gliding =
        fly({"--csv", "gliding.csv", "-o", "gliding%d.png", "--json", "-", "--geomorph", "0.25", "--fps", "25"});
    EXPECT_EQ(effect_named(gliding, "geomorphs")["on"], true);
    EXPECT_THAT(std::string(effect_named(gliding, "geomorphs")["why"]), HasSubstr("0.25 s"));
    EXPECT_GT(gliding["gliding"]["largest"], 0);
    EXPECT_EQ(gliding["triangles"], still["triangles"]) << "the followed cut is the same";
    const auto rows = numbers_of(read_text(path("gliding.csv")));
    ASSERT_EQ(rows.size(), 20u);
    for (const auto& row : rows) EXPECT_GE(row[11], row[1]) << "what folds is drawn until it is folded";
    EXPECT_TRUE(read_text(path("still0.png")) == read_text(path("gliding0.png"))) << "nothing glides at first";
    bool differs = false;
    for (int i = 1; i < 20; ++i)
        differs |= read_text(path("still" + std::to_string(i) + ".png")) !=
                   read_text(path("gliding" + std::to_string(i) + ".png"));
    EXPECT_TRUE(differs);
    // In no time, every frame is the one without.
    fly({"-o", "nothing%d.png", "--json", "-", "--geomorph", "0"});
    for (int i = 0; i < 20; ++i)
        EXPECT_TRUE(read_text(path("still" + std::to_string(i) + ".png")) ==
                    read_text(path("nothing" + std::to_string(i) + ".png")))
            << i;
}

TEST_F(RenderCommandTest, OptionsChangeThePicture) {
    render({}, "plain.png");
    const std::string plain = read_text(path("plain.png"));
    const std::vector<Words> changes = {
        {"--wireframe"},      {"--light", "1", "0", "0"}, {"--light", "-1", "0", "0"},
        {"--ambient", "0.9"}, {"--background", "70"},     {"--direction", "1", "0", "0"},
        {"--fill", "0.3"},    {"--triangles", "60"},      {"--samples", "1"}};
    for (const auto& change : changes) {
        render(change, "changed.png");
        EXPECT_FALSE(read_text(path("changed.png")) == plain) << ::testing::PrintToString(change);
    }
    render({}, "again.png");
    EXPECT_TRUE(read_text(path("again.png")) == plain);
}

TEST_F(RenderCommandTest, FillIsTheShareOfTheHeight) {
    render({"--fill", "0.5", "--full"}, "half.pfm");
    const auto image = require(read_image(path("half.pfm")));
    int top = 160, bottom = 0;
    for (int y = 0; y < 160; ++y)
        for (int x = 0; x < 200; ++x)
            if (std::abs(image->image.at(x, y) - 20) > 0.01f) top = std::min(top, y), bottom = std::max(bottom, y);
    // The bounding sphere takes 80 pixels; the ball's bumps reach up to 5 % beyond its poles.
    EXPECT_LE(bottom + 1 - top, 80);
    EXPECT_GE(bottom + 1 - top, 74);
}

// In parallel: in a window of half of the height the ball is twice as high, wherever the eye is, and nobody sees what is
// folded.
TEST_F(RenderCommandTest, OrthographicViewsAreDrawnAndJudged) {
    const auto height_of = [&](const std::string& name) {
        const auto picture = read_image(path(name));
        EXPECT_TRUE(picture);
        int rows = 0;
        for (int y = 0; y < picture->image.height; ++y)
            rows += std::abs(picture->image.at(picture->image.width / 2, y) - 20) > 0.1f;
        return rows;
    };
    render({"--full", "--orthographic", "fit", "--fill", "0.5"}, "fit.pfm");
    const int half = height_of("fit.pfm");
    EXPECT_LE(half, 80); // as in FillIsTheShareOfTheHeight
    EXPECT_GE(half, 74);
    for (const char* distance : {"0.1", "3", "500"}) {
        render({"--full", "--orthographic", "4", "--eye", "0", "0", distance, "--target", "0", "0", "-1"}, "far.pfm");
        const int rows = height_of("far.pfm");
        render({"--full", "--orthographic", "8", "--eye", "0", "0", distance, "--target", "0", "0", "-1"}, "small.pfm");
        EXPECT_NEAR(rows, 2 * height_of("small.pfm"), 2) << distance;
    }
    const Json cut = render({"--orthographic", "fit", "--fill", "0.5"}, "cut.pfm");
    EXPECT_LT(cut["triangles"], ball_triangles);
    EXPECT_EQ(effect_named(cut, "back-face culling")["on"], true);
    succeed({"compare", "fit.pfm", "cut.pfm", "--fail-above", "0"});
    EXPECT_THAT(succeed({"fly", "ball.vdt", "--path", "orbit:30", "--orthographic", "fit", "--csv", "turn.csv"}).out,
                HasSubstr("12 frames"));

    for (const auto& [words, complaint] :
         {std::pair<Words, std::string>{{"--orthographic", "0"}, "must be fit or a height above 0"},
          {{"--orthographic", "fit", "--fov", "30"}, "a parallel view has no field of view"},
          {{"--orthographic", "fit", "--eye", "0", "0", "3"}, "--orthographic fit frames the whole model"},
          {{"--orthographic", "2", "--fill", "0.5"}, "exclude each other"}}) {
        EXPECT_THAT(run(joined({"render", "ball.vdt", "-o", "none.png"}, words)), fails(2, HasSubstr(complaint)));
    }
    EXPECT_THAT(run({"simplify", "ball.vdt", "-o", "n.ply", "--orthographic", "fit", "--visibility", "picture"}),
                fails(1, HasSubstr("needs a perspective view")));
}

// Each eye sees the whole model from its own place, and the pictures lie side by side.
TEST_F(RenderCommandTest, TwoEyesShareACut) {
    const Words full = {"--full", "--fov", "60"};
    render(joined(full, {"--eye", "0", "0", "3", "--target", "0", "0", "0", "--eyes", "0.2,-0.02"}), "pair.pfm");
    const auto pair = read_image(path("pair.pfm"));
    ASSERT_TRUE(pair);
    ASSERT_EQ(pair->image.width, 400);
    ASSERT_EQ(pair->image.height, 160);
    const auto first_lit = [&](int from_x) { // column of the eye's own window
        for (int x = 0; x < 200; ++x)
            if (std::abs(pair->image.at(from_x + x, 80) - 20) > 0.1f) return x;
        return -1;
    };
    // The ball lies to the right of the left eye and to the left of the right one; windows shifted inward bring these
    // nearer.
    const int left = first_lit(0), right = first_lit(200);
    EXPECT_GT(left, right + 2);
    render(joined(full, {"--eye", "-0.1", "0", "3", "--target", "-0.1", "0", "0"}), "left.pfm");
    const auto one = read_image(path("left.pfm"));
    ASSERT_TRUE(one);
    constexpr int shift = 2; // a fiftieth of half of the window
    for (int x = 30; x < 170; ++x) ASSERT_NEAR(pair->image.at(x - shift, 80), one->image.at(x, 80), 2e-2) << x;

    const double both = render({"--eyes", "0.5"}, "both.png")["triangles"],
                 single = render({"--visibility", "spheres"}, "single.png")["triangles"];
    EXPECT_GE(both, single);
    EXPECT_LT(both, ball_triangles);
    EXPECT_THAT(succeed({"fly", "ball.vdt", "--path", "orbit:30", "--eyes", "0.063", "--csv", "turn.csv"}).out,
                HasSubstr("12 frames"));
    for (const auto& [words, complaint] :
         {std::pair<Words, std::string>{{"--eyes", "0"}, "must be METRES or METRES,SHIFT"},
          {{"--eyes", "0.06,2"}, "must be METRES or METRES,SHIFT"},
          {{"--eyes", "0.06", "--checked"}, "pictures of one eye"},
          {{"--eyes", "0.06", "--orthographic", "fit"}, "no two eyes"}})
        EXPECT_THAT(run(joined({"render", "ball.vdt", "-o", "none.png"}, words)), fails(2, HasSubstr(complaint)));
    EXPECT_THAT(run({"simplify", "ball.vdt", "-o", "n.ply", "--eyes", "0.06", "--visibility", "picture"}),
                fails(1, HasSubstr("is of one eye")));
    EXPECT_THAT(run({"view", "ball.vdt", "--eyes", "0.06"}), fails(2, HasSubstr("does not act in")));
}

TEST_F(RenderCommandTest, AnEyeInsideIsValid) { render({"--eye", "0", "0", "0.1"}, "inside.png"); }

TEST_F(RenderCommandTest, TheSheetShowsAndJudgesFourCuts) {
    EXPECT_THAT(succeed({"sheet", "ball.vdt", "-o", "sheet.png", "--size", "256x256", "--samples", "4", "--cell", "64",
                         "--json", "sheet.json"})
                    .out,
                HasSubstr("gaze-directed"));
    const auto sheet = require(read_image(path("sheet.png")));
    EXPECT_GT(sheet->image.width, 4 * 64);
    EXPECT_GT(sheet->image.height, 2 * 64);
    const Json report = Json::parse(read_text(path("sheet.json")));
    ASSERT_EQ(report["cuts"].size(), 4u);
    Words names;
    for (const Json& cut : report["cuts"]) names.push_back(cut["name"]);
    EXPECT_THAT(names, ElementsAre("full", "imperceptible", "budget", "gaze-directed"));
    const Json& cuts = report["cuts"];
    EXPECT_TRUE(cuts[0]["visible_pixels"].is_null()) << "the reference";
    EXPECT_EQ(cuts[0]["triangles"], ball_triangles);
    EXPECT_EQ(cuts[1]["visible_pixels"], 0);
    EXPECT_LE(cuts[2]["triangles"], ball_triangles / 4);
    EXPECT_EQ(cuts[3]["visible_pixels"], 0);
    EXPECT_LE(cuts[3]["triangles"], cuts[1]["triangles"]);
}

// A map has the window's size and a scale below; what is folded has a colour, what is not is grey.
TEST_F(RenderCommandTest, MapsShowWhatFoldsCost) {
    const auto share_of_colour = [&](const std::string& map, const Words& more) {
        render(joined({"--show", map}, more), map + ".png");
        const auto picture = read_image(path(map + ".png"));
        EXPECT_TRUE(picture) << picture.error().message;
        EXPECT_EQ(picture->image.width, 200);
        EXPECT_GT(picture->image.height, 160);
        double model = 0, coloured = 0;
        for (int y = 0; y < 160; ++y) {
            for (int x = 0; x < 200; ++x) {
                const float r = picture->image.at(x, y, 0), g = picture->image.at(x, y, 1),
                            b = picture->image.at(x, y, 2);
                model += r + g + b > 0;
                coloured += r != g || g != b;
            }
        }
        EXPECT_GT(model, 0.3 * 200 * 160) << "the ball fills most of the height";
        return coloured / model;
    };
    const Words aside = {"--gaze", "1191", "80"};
    for (const std::string map : {"cost", "frequency", "contrast", "eccentricity"})
        EXPECT_GT(share_of_colour(map, aside), 0.05) << map;
    EXPECT_GT(share_of_colour("cost", aside), share_of_colour("cost", {})) << "more is folded in the corner of the eye";
    // Angles are those on the screen: whatever field the camera shows there, the same place has nearly the same colour.
    for (const std::string field : {"4.65", "20"})
        render({"--show", "eccentricity", "--gaze", "1191", "80", "--fov", field, "--triangles", "60"}, field + ".png");
    const auto usual = read_image(path("4.65.png")), wide = read_image(path("20.png"));
    ASSERT_TRUE(wide && usual);
    double difference = 0, places = 0;
    for (int y = 0; y < 160; ++y) {
        for (int x = 0; x < 200; ++x) {
            const auto is_coloured = [&](const auto& image) { return image.at(x, y, 0) != image.at(x, y, 1); };
            if (!is_coloured(wide->image) || !is_coloured(usual->image)) continue;
            ++places;
            for (int k = 0; k < 3; ++k)
                difference += std::abs(static_cast<double>(wide->image.at(x, y, k) - usual->image.at(x, y, k)));
        }
    }
    EXPECT_GT(places, 2000);
    EXPECT_LT(difference / places, 0.1);
    EXPECT_EQ(run({"render", "ball.vdt", "-o", "map.png", "--show", "eccentricity"}).status, 2) << "of which gaze?";
    EXPECT_EQ(run({"render", "ball.vdt", "-o", "map.png", "--show", "cost", "--full"}).status, 2);
    EXPECT_FALSE(fs::exists(path("map.png")));
    EXPECT_EQ(run({"render", "ball.vdt", "-o", "map.pfm", "--show", "cost"}).status, 2) << "no luminance";
    EXPECT_EQ(run({"render", "ball.vdt", "-o", "map.png", "--show", "beauty"}).status, 2);
    EXPECT_EQ(run({"fly", "ball.vdt", "--path", "orbit:10", "--show", "cost"}).status, 2);
}

// Both sheets of one drawing are those that are asked for one by one.
TEST_F(RenderCommandTest, MapsComeOnASheetOfTheirOwn) {
    const auto sheet = [&](Words outputs) {
        outputs.insert(outputs.begin(), {"sheet", "ball.vdt"});
        outputs.insert(outputs.end(), {"--size", "256x256", "--samples", "4", "--cell", "64", "--json", "-"});
        const Outcome outcome = succeed(outputs);
        return outcome.json()["cuts"];
    };
    EXPECT_EQ(sheet({"--maps", "maps.png"}).size(), 3u) << "a budget has no map";
    EXPECT_EQ(sheet({"-o", "sheet.png"}).size(), 4u);
    const Json both = sheet({"-o", "both.png", "--maps", "both_maps.png"});
    EXPECT_EQ(both.size(), 4u);
    EXPECT_TRUE(read_text(path("maps.png")) == read_text(path("both_maps.png")));
    EXPECT_TRUE(read_text(path("sheet.png")) == read_text(path("both.png")));
    const auto maps = require(read_image(path("maps.png")));
    EXPECT_GT(maps->image.height, 6 * 64);
    EXPECT_EQ(run({"sheet", "ball.vdt"}).status, 2);
    EXPECT_EQ(run({"sheet", "ball.vdt", "--maps", "same.png", "-o", "same.png"}).status, 1);
    EXPECT_EQ(run({"sheet", "ball.vdt", "--maps", "m.png", "--triangles", "9"}).status, 2);
}

TEST_F(RenderCommandTest, WrongUsageIsStatusTwo) {
    const auto before = files();
    for (const Words& words :
         std::vector<Words>{{"render", "ball.vdt", "-o", "out.gif"},
                            {"render", "ball.vdt", "-o", "out.png", "--samples", "257"},
                            {"render", "ball.vdt", "-o", "out.png", "--samples", "0"},
                            {"render", "ball.vdt", "-o", "out.png", "--show", "cost", "--samples", "4"},
                            {"fly", "ball.vdt", "--samples", "4"},
                            {"sheet", "ball.vdt", "-o", "out.png", "--cell", "0"},
                            {"sheet", "ball.vdt", "-o", "out.png", "--full"},
                            {"fly", "ball.vdt", "--path", "orbit:0:2", "--quality", "2", "--triangles", "20"},
                            {"fly", "ball.vdt", "--path", "orbit:0:2", "-o", "%d/o.png"},
                            {"render", "ball.vdt", "-o", "out.png", "--show", "contrast", "--lights", "l.json"},
                            {"view", "ball.vdt", "--frames", "0"},
                            {"view", "ball.vdt", "--gaze", "1", "2", "--gaze-mode", "head"},
                            {"view", "ball.vdt", "--lights", "l.json", "--geomorph", "1"},
                            {"view", "ball.vdt", "--screenshot", "out.ply"}}) {
        const Outcome outcome = run(words);
        EXPECT_EQ(outcome.status, 2) << ::testing::PrintToString(words);
        EXPECT_EQ(outcome.err.rfind("unseen: ", 0), 0U) << outcome.err;
        EXPECT_EQ(files(), before);
    }
}

TEST_F(RenderCommandTest, FollowsLightsThatMove) {
    write_text(path("lights.json"),
               R"({"ambient": 0.1, "lights": [{"type": "directional", "direction": [1, 1, 1], "intensity": 0.8,
                             "orbit": {"axis": [0, 1, 0], "degrees_per_second": 60}}]})");
    const Json still = render({"--lights", "lights.json"}, "lit.png");
    const auto effect = [](const Json& report, const std::string& name) {
        for (const Json& e : report["effects"])
            if (e["name"] == name) return e;
        return Json();
    };
    EXPECT_TRUE(effect(still, "light")["on"]);
    EXPECT_THAT(effect(still, "light")["why"].get<std::string>(), HasSubstr("1 directional, ambient 0.1"));
    const Outcome flown = succeed({"fly", "ball.vdt", "--path", "orbit:0:30", "--lights", "lights.json", "--fps", "60",
                                   "-o", "f%02d.png", "--size", "96x96", "--json", "-"});
    EXPECT_GT(flown.json()["node_tests"]["largest"].get<double>(), 0);
    const auto first = require(read_image(path("f00.png"))), last = require(read_image(path("f29.png")));
    EXPECT_NE(first->image.values, last->image.values) << "the camera stands still, the light does not";
    EXPECT_EQ(run({"simplify", "ball.vdt", "-o", "lit.ply", "--lights", "lights.json"}).status, 0);
}

TEST_F(RenderCommandTest, LightsCastShadowsWhereTheyAreToldTo) {
    write_text(path("lights.json"),
               R"({"ambient": 0.1, "lights": [
                   {"type": "directional", "direction": [1, 1, 1], "intensity": 0.5, "shadow": true},
                   {"type": "directional", "direction": [1, -1, 1], "intensity": 0.3}]})");
    const auto effect = [](const Json& report) {
        for (const Json& e : report["effects"])
            if (e["name"] == "shadows") return e;
        return Json();
    };
    const Json own = render({"--lights", "lights.json"}, "own.png");
    EXPECT_EQ(own["shadows"]["casting_lights"], Json({0}));
    EXPECT_EQ(own["shadows"]["of_lights"], 2);
    EXPECT_EQ(own["shadows"]["map_size"], 2048);
    EXPECT_EQ(own["shadows"]["bytes"], 4 * 2048 * 2048);
    EXPECT_GE(own["shadows"]["draw_ms"].get<double>(), 0);
    EXPECT_EQ(effect(own)["on"], true);
    EXPECT_THAT(effect(own)["why"].get<std::string>(), HasSubstr("1 of 2 lights casts; folds are tested"));
    const Json all = render({"--lights", "lights.json", "--shadows"}, "all.png");
    EXPECT_EQ(all["shadows"]["casting_lights"], Json({0, 1}));
    const Json none = render({"--lights", "lights.json", "--no-shadows"}, "none.png");
    EXPECT_FALSE(none.contains("shadows"));
    EXPECT_EQ(effect(none)["on"], false);
    EXPECT_THAT(effect(none)["why"].get<std::string>(), HasSubstr("no light casts a shadow"));
    EXPECT_THAT(run({"render", "ball.vdt", "-o", "o.png", "--shadows"}), fails(1, HasSubstr("--shadows needs lights")));
    EXPECT_EQ(run({"simplify", "ball.vdt", "-o", "lit.ply", "--lights", "lights.json", "--shadows"}).status, 0);
    EXPECT_THAT(run({"sheet", "ball.vdt", "-o", "sheet.png", "--lights", "lights.json"}),
                fails(1, HasSubstr("--no-shadows")));
}

TEST_F(RenderCommandTest, NamesFileAndFieldOfBadLights) {
    const auto complaint = [&](const std::string& text) {
        write_text(path("bad.json"), text);
        const Outcome outcome = run({"render", "ball.vdt", "-o", "o.png", "--lights", "bad.json"});
        EXPECT_EQ(outcome.status, 1) << text;
        EXPECT_THAT(outcome.err, IsAnErrorForPeople());
        EXPECT_THAT(outcome.err, HasSubstr("bad.json"));
        return outcome.err;
    };
    const auto point_at = [](const std::string& where) {
        return "{\"lights\": [{\"type\": \"point\", \"intensity\": 1, \"distance\": 1, \"position\": " + where + "}]}";
    };
    EXPECT_THAT(complaint("{\"lights\": []}"), HasSubstr("black"));
    EXPECT_THAT(complaint(point_at("[0, 0, 0.1]")), HasSubstr("lights[0].position is inside"));
    EXPECT_THAT(complaint(point_at("[0, 0]")), HasSubstr("lights[0].position"));
    EXPECT_THAT(complaint("{\"lights\": [{\"type\": \"directional\", \"intensity\": 1, \"direction\": [0, 0, 0]}]}"),
                HasSubstr("lights[0].direction"));
    write_text(path("good.json"), point_at("[9, 9, 9]"));
    for (const Words& more : std::vector<Words>{{"--light", "0", "0", "1"}, {"--ambient", "0.5"}}) {
        EXPECT_EQ(run(joined({"render", "ball.vdt", "-o", "o.png", "--lights", "good.json"}, more)).status, 2);
    }
    write_text(path("shiny.json"), R"({"material": {"specular": 0.3, "shininess": 20},
        "lights": [{"type": "directional", "direction": [0, 0, 1], "intensity": 0.5}]})");
    succeed({"render", "ball.vdt", "-o", "o.png", "--lights", "shiny.json", "--fold-test", "error"});
    EXPECT_THAT(run({"simplify", "ball.vdt", "-o", "o.ply", "--lights", "shiny.json", "--fold-test", "error"}),
                fails(1, HasSubstr("--fold-test luebke-hallen")));
}

TEST_F(RenderCommandTest, FailuresLeaveNoFile) {
    const auto before = files();
    for (const Words& words :
         std::vector<Words>{{"render", "ball.vdt", "-o", "ball.obj/o.png", "--json", "o.json"},
                            {"render", "missing.vdt", "-o", "o.png", "--json", "o.json"},
                            {"sheet", "ball.vdt", "-o", "ball.obj/o.png", "--size", "32x32", "--json", "o.json"}}) {
        EXPECT_THAT(run(words), fails(1, IsAnErrorForPeople()));
        EXPECT_EQ(files(), before);
    }
    EXPECT_EQ(run({"fly", "ball.vdt", "--path", "orbit:0:2", "--no-draw", "--csv", "ball.vdt"}).status, 1)
        << "the model";
    EXPECT_EQ(run({"fly", "ball.vdt", "--path", "orbit:0:2", "--no-draw", "--csv", "o.csv", "--plot", "ball.obj/o.png"})
                  .status,
              1);
    EXPECT_EQ(files(), before);
    // A light that comes into the model in the third frame.
    write_text(path("l.json"), R"({"lights": [{"type": "point", "intensity": 1, "distance": 1, "position": [0, 0, 9],
                             "keyframes": [{"time_s": 0, "position": [0, 0, 9]},
                                           {"time_s": 0.04, "position": [0, 0, 0]}]}]})");
    const auto with_light = files();
    EXPECT_THAT(
        run({"fly", "ball.vdt", "--path", "orbit:0:4", "--lights", "l.json", "-o", "f%d.png", "--size", "16x16"}),
        fails(1, HasSubstr("Frame ")));
    EXPECT_EQ(files(), with_light);
}

TEST_F(RenderCommandTest, EndingsMayBeInUpperCase) {
    render({}, "a.png");
    render({}, "b.Png");
    EXPECT_TRUE(read_text(path("a.png")) == read_text(path("b.Png")));
}

class NoGpuTest : public CommandTest {
protected:
    void SetUp() override {
        CommandTest::SetUp();
        setenv("__EGL_VENDOR_LIBRARY_DIRS", "/nonexistent", 1); // a machine without any driver
    }
    void TearDown() override {
        unsetenv("__EGL_VENDOR_LIBRARY_DIRS");
        CommandTest::TearDown();
    }
};

TEST_F(NoGpuTest, RenderingSaysSoAndEverythingElseWorks) {
    build_ball();
    const auto before = files();
    for (const std::string verb : {"render", "levels", "sheet"}) {
        const Outcome outcome = run({verb, "ball.vdt", "-o", "o.png"});
        EXPECT_EQ(outcome.status, 1);
        EXPECT_THAT(outcome.err, IsAnErrorForPeople());
        EXPECT_THAT(outcome.err, HasSubstr("OpenGL"));
        EXPECT_EQ(files(), before);
    }
    EXPECT_EQ(run({"simplify", "ball.vdt", "-o", "o.ply"}).status, 0);
    EXPECT_EQ(run({"fly", "ball.vdt", "--path", "orbit:5:3", "--csv", "o.csv"}).status, 0) << "nothing is drawn";
}

TEST_F(RenderCommandTest, AnswersInThreeLines) {
    EXPECT_THAT(succeed({"render", "ball.vdt", "-o", "o.png", "--size", "96x80"}).out,
                ::testing::MatchesRegex("kept [0-9,]+ of 1,472 triangles \\([0-9.]+%\\)\n"
                                        "nobody sees a difference, looked at from 0.5 m or more: [^\n]+\n"
                                        "wrote o.png \\([0-9.]+ kB\\)\n"));
    const Outcome verbose = run({"render", "ball.vdt", "-o", "o.png", "--size", "96x80", "--verbose"});
    for (const std::string text : {"drawn in", "effects\n", "drawn by "}) EXPECT_THAT(verbose.out, HasSubstr(text));
}

TEST_F(RenderCommandTest, PicturesCheckHowFewDo) {
    const double bounded = render({}, "bounded.png")["triangles"];
    const Words checked = {"render", "ball.vdt", "-o", "o.png", "--size", "96x80", "--checked"};
    const Json report = succeed(joined(checked, {"--json", "-"})).json();
    EXPECT_LE(report["triangles"], bounded);
    const Json& check = report["check"];
    EXPECT_LT(std::max(check["v"].get<double>(), check["second_v"].get<double>()), 1);
    EXPECT_EQ(check["verified_views"], 3);
    EXPECT_EQ(check["settled"], true);
    EXPECT_THAT(
        succeed(checked).out,
        ::testing::ContainsRegex("neither judge sees a difference in 3 other pictures of this view, [^(]+\\(V "));
    EXPECT_THAT(succeed(joined(checked, {"--quality", "draft"})).out, HasSubstr("no more than 9 thresholds"));
    const auto refused = [&](Words more) { return run(joined(checked, more)).err; };
    EXPECT_THAT(refused({"--triangles", "20"}), HasSubstr("it finds the number of triangles itself"));
    EXPECT_THAT(refused({"--pixels", "2"}), HasSubstr("it finds the number of triangles itself"));
    EXPECT_THAT(refused({"--check-cell", "11"}), HasSubstr("--check-cell"));
    EXPECT_THAT(run({"render", "ball.vdt", "-o", "o.png", "--check-cell", "2"}).err, HasSubstr("--checked"));
}

TEST_F(RenderCommandTest, FlightsDrawWhatIsKept) {
    const Words flight = {"fly", "ball.vdt", "--path", "orbit:5:3", "--size", "96x80", "--csv", "o.csv"};
    const auto drawn = [&](Words more) {
        const Outcome outcome = succeed(joined(flight, more));
        EXPECT_THAT(outcome.out, HasSubstr("3 frames; the median frame kept "));
        EXPECT_THAT(outcome.out, HasSubstr("in the last frame"));
        EXPECT_THAT(outcome.out, HasSubstr("\nwrote o.csv ("));
        return outcome.out.find("nothing was drawn") == std::string::npos;
    };
    EXPECT_FALSE(drawn({}));
    EXPECT_FALSE(drawn({"--no-draw"}));
    EXPECT_TRUE(drawn({"--draw"}));
    EXPECT_TRUE(drawn({"-o", "f%d.png"}));
}

// A flight of minutes, on a terminal: it says how long it will take, and Ctrl-C keeps its rows.
TEST_F(RenderCommandTest, InterruptedFlightsKeepTheirRows) {
    const int terminal = posix_openpt(O_RDWR | O_NOCTTY);
    ASSERT_GE(terminal, 0);
    ASSERT_EQ(grantpt(terminal), 0);
    ASSERT_EQ(unlockpt(terminal), 0);
    const fs::path out = folder().string() + ".out";
    const pid_t process = start({"fly", "ball.vdt", "--path", "orbit:7:1000000", "--pixels", "2", "--csv", "o.csv"},
                                out, ptsname(terminal));
    ASSERT_GT(process, 0);
    std::string shown;
    std::array<char, 4096> block;
    bool is_interrupted = false;
    for (ssize_t got = 0; (got = read(terminal, block.data(), block.size())) > 0;) { // ends with the process
        shown.append(block.data(), static_cast<std::size_t>(got));
        if (is_interrupted || shown.find(" left") == std::string::npos) continue;
        is_interrupted = true;
        kill(process, SIGINT);
    }
    EXPECT_EQ(wait_for(process), -SIGINT);
    close(terminal);
    fs::remove(out);
    EXPECT_THAT(shown, ::testing::ContainsRegex("flying \\[[#.]+\\] +[0-9]+% frames, [0-9]+[^\r]* left"));
    EXPECT_THAT(shown, ::testing::ContainsRegex("interrupted after [0-9,]+ of 1,000,000 frames"));
    const std::string csv = read_text(path("o.csv"));
    EXPECT_TRUE(csv.ends_with('\n'));
    EXPECT_GT(std::count(csv.begin(), csv.end(), '\n'), 1);
    EXPECT_THAT(files(), ::testing::UnorderedElementsAre("ball.obj", "ball.vdt", "o.csv"));
}

TEST_F(RenderCommandTest, PathsAndTracesAreTextOfAnEnd) {
    const std::string mark = "\xef\xbb\xbf";
    write_text(path("p.csv"), mark + "eye_x,eye_y,eye_z,target_x,target_y,target_z\n0,0,3,0,0,0\n");
    write_text(path("g.csv"), mark + "time_s,x_px,y_px\n0,1,2\n");
    succeed({"fly", "ball.vdt", "--path", "p.csv", "--gaze-trace", "g.csv"});
    write_text(path("p.csv"), "eye_\x1b[31m\n");
    EXPECT_THAT(run({"fly", "ball.vdt", "--path", "p.csv"}).err,
                ::testing::AllOf(HasSubstr("eye_\\x1b[31m"), ::testing::Not(HasSubstr("\x1b"))));
}

} // namespace render_command_test
