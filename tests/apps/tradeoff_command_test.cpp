// unseen tradeoff: its points are what the options that it names make.
#include "run_command.h"

namespace tradeoff_command_test {

using namespace unseen::app::testing;

class TradeoffCommandTest : public DrawingCommandTest {
protected:
    Json tradeoff(const Words& more = {}) const {
        const Outcome outcome =
            succeed(joined({"tradeoff", "ball.vdt", "--size", "200x160", "--samples", "16", "--json", "-"}, more));
        return outcome.json();
    }
};

Words words_of(const std::string& text) {
    std::istringstream stream(text);
    return {std::istream_iterator<std::string>(stream), {}};
}

TEST_F(TradeoffCommandTest, EachPointIsWhatItsOptionsMake) {
    const Json report = tradeoff({"--csv", "points.csv"});
    const Json& points = report["points"];
    ASSERT_GT(points.size(), 15u);
    EXPECT_EQ(points[0]["options"], "--full");
    EXPECT_EQ(points[0]["triangles"], report["source_triangles"]);
    EXPECT_EQ(points[0]["v"], 0);
    for (const Json& point : points) {
        Words words = {"render", "ball.vdt", "--size", "200x160", "-o", "x.png", "--json", "-"};
        for (const std::string& word : words_of(point["options"])) words.push_back(word);
        if (point["holds_for"] == "all views") words.insert(words.end(), {"--visibility", "spheres"});
        const Json cut = succeed(words).json();
        EXPECT_EQ(cut["triangles"], point["triangles"]) << point;
        EXPECT_GT(point["draw_ms"], 0) << point;
        EXPECT_LE(point["draw_ms_from"], point["draw_ms"]) << point;
        EXPECT_GE(point["draw_ms_to"], point["draw_ms"]) << point;
        EXPECT_EQ(point["follow_ms"].is_null(), point["holds_for"] == "this view") << point;
    }
    const std::string csv = read_text(path("points.csv"));
    EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(csv, '\n')), points.size() + 1);
}

TEST_F(TradeoffCommandTest, TheFrontHasNothingBetter) {
    const Json report = tradeoff();
    std::size_t recommended = 0;
    for (const Json& point : report["points"]) {
        bool has_better = false;
        for (const Json& other : report["points"])
            has_better = has_better || (other["triangles"] <= point["triangles"] && other["v"] <= point["v"] &&
                                        (other["triangles"] < point["triangles"] || other["v"] < point["v"]));
        EXPECT_EQ(point["pareto"], !has_better) << point;
        if (point["recommended"] == false) continue;
        ++recommended;
        EXPECT_EQ(point["visible_pixels"], 0);
        EXPECT_EQ(point["second_visible_pixels"], 0);
        EXPECT_EQ(point["holds_for"], "all views");
        EXPECT_NE(point["name"], "luebke-hallen") << "which is unsafe";
        for (const Json& other : report["points"]) {
            const std::string options = other["options"];
            if (options == "--quality invisible" || options == "--quality invisible --fold-test luebke-hallen-safe")
                EXPECT_LE(point["triangles"], other["triangles"]) << options;
        }
    }
    EXPECT_EQ(recommended, 1u);
    // Coarse ways are seen: the judges are not blind.
    EXPECT_TRUE(std::ranges::any_of(report["points"], [](const Json& p) { return p["visible_pixels"] > 0; }));
}

TEST_F(TradeoffCommandTest, WhatDoesNotFitIsLeftOutAndSaid) {
    const Json report = tradeoff({"--seconds", "0.001"});
    EXPECT_EQ(report["points"].size(), 1u);
    EXPECT_GT(report["left_out"].size(), 15u);
    EXPECT_EQ(report["points"][0]["recommended"], true);
    EXPECT_THAT(run({"tradeoff", "ball.vdt", "--seconds", "0"}).err, HasSubstr("--seconds"));
    EXPECT_THAT(run({"tradeoff", "missing.vdt"}).err, HasSubstr("missing.vdt"));
    EXPECT_THAT(succeed({"tradeoff", "ball.vdt", "--size", "64x64", "--samples", "1", "--seconds", "0.2"}).out,
                HasSubstr("recommended, as the safe way with the fewest triangles that shows nothing: --"));
}

TEST_F(TradeoffCommandTest, QualitiesLeaveMoreOrLess) {
    for (const auto& [verb, out] : {std::pair("simplify", "x.ply"), {"render", "x.png"}}) {
        const auto report = [&](const std::string& quality) {
            return run({verb, "ball.vdt", "-o", out, "--fill", "0.2", "--quality", quality, "--json", "-"}).json();
        };
        const Json invisible = report("invisible"), lossless = report("lossless"), good = report("good"),
                   draft = report("draft");
        EXPECT_LE(invisible["max_fold_cost"], 1);
        EXPECT_GT(draft["max_fold_cost"], 1);
        EXPECT_LE(lossless["triangles"], invisible["triangles"]);
        EXPECT_LE(good["triangles"], lossless["triangles"]);
        EXPECT_LE(draft["triangles"], good["triangles"]);
        EXPECT_LT(draft["triangles"], invisible["triangles"]) << verb;
    }
    EXPECT_THAT(run({"simplify", "ball.vdt", "-o", "x.ply", "--quality", "best"}).err,
                HasSubstr("--quality: must be invisible, lossless, good, draft, or a cost above 0, not 'best'"));
    EXPECT_THAT(run({"simplify", "ball.vdt", "-o", "x.ply", "--quality", "good", "--triangles", "9"}).err,
                HasSubstr("--quality"));
    EXPECT_THAT(run({"simplify", "ball.vdt", "-o", "x.ply", "--quality", "good", "--fold-test", "extent"}).err,
                HasSubstr("cannot tell what is imperceptible"));
}

TEST_F(TradeoffCommandTest, CostsAreOfImperceptibleCuts) {
    const auto kept = [&](const char* threshold) {
        return run({"simplify", "ball.vdt", "-o", "x.ply", "--quality", threshold, "--json", "-"}).json()["triangles"];
    };
    EXPECT_LE(kept("4"), kept("1"));
    EXPECT_LE(kept("1"), kept("0.25"));
    EXPECT_THAT(run({"simplify", "ball.vdt", "-o", "x.ply", "--quality", "2", "--full"}).err,
                HasSubstr("--full and --quality exclude each other"));
    EXPECT_THAT(run({"simplify", "ball.vdt", "-o", "x.ply", "--quality", "0"}).err, HasSubstr("--quality"));
}

} // namespace tradeoff_command_test
