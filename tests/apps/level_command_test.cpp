// unseen levels: discrete levels of detail as a user asks for them.
#include "run_command.h"

#include "temp_folder.h"

namespace level_command_test {

using namespace unseen::app::testing;

constexpr int width = 80, height = 60; // pixels

class LevelCommandTest : public CommandTest {
protected:
    void SetUp() override {
        CommandTest::SetUp();
        succeed({"make", "scene", "treasure", "-o", "scene.glb", "--triangles", "12000"});
        if (!no_opengl().empty()) GTEST_SKIP() << no_opengl();
    }
    Outcome render(Words more) const {
        return run(
            joined({"levels", "scene.glb", "--size", std::to_string(width) + "x" + std::to_string(height)}, more));
    }
};

TEST_F(LevelCommandTest, AStillPictureAndItsFigures) {
    const Outcome drawn = render({"--method", "perceptual", "-o", "still.png", "--json", "-"});
    ASSERT_EQ(drawn.status, 0) << drawn.err;
    const Json json = drawn.json();
    EXPECT_EQ(json["method"], "perceptual");
    EXPECT_EQ(json["maps"], "modern");
    EXPECT_EQ(json["is_settled"], true);
    EXPECT_GT(json["settling_frames"], 1);
    ASSERT_EQ(json["frames"].size(), 1u);
    const Json& frame = json["frames"][0];
    EXPECT_EQ(frame["layers"], 5);
    // One of the lamps casts shadows, six maps of them, and on some of each layer.
    EXPECT_EQ(frame["shadow_maps"], 6);
    EXPECT_EQ(frame["masked_layers"], 5);
    EXPECT_EQ(frame["surface_passes"], 7 + 5) << "5 layers, the background, the depth; and masks";
    EXPECT_GT(frame["full_screen_passes"], 5);
    EXPECT_GT(frame["texture_bytes"], width * height * 16 * 6);
    EXPECT_LT(frame["triangles"], json["source_triangles"]);
    for (const char* stage : {"layers", "combinations", "maps", "depth", "control"}) EXPECT_GE(frame["ms"][stage], 0);
    std::uint64_t triangles = 0;
    for (std::size_t i = 0; i < frame["levels"].size(); ++i)
        if (frame["levels"][i] >= 0)
            triangles +=
                json["objects"][i]["level_triangles"][frame["levels"][i].get<std::size_t>()].get<std::uint64_t>();
    EXPECT_EQ(triangles, frame["triangles"]);
    EXPECT_FALSE(frame["tests"].empty());
    for (const Json& test : frame["tests"]) {
        EXPECT_NE(test["level"], test["compared_with"]);
        EXPECT_EQ(test["decision"], "keep");
        EXPECT_GE(test["p_pass"], 0);
    }
    EXPECT_EQ(require(unseen::perception::read_image(path("still.png")))->image.width, width);
    // Luminance for judging, and a summary for people.
    const Outcome judged = render({"--method", "perceptual", "--maps", "rpg99", "-o", "still.pfm"});
    ASSERT_EQ(judged.status, 0) << judged.err;
    EXPECT_THAT(judged.out, HasSubstr("for control"));
    EXPECT_TRUE(unseen::perception::read_image(path("still.pfm")));
}

TEST_F(LevelCommandTest, APathAndItsTotals) {
    const Outcome flown = render({"--method", "perceptual", "--maps", "rpg99", "--path", "orbit:1:9", "-o", "f%02d.png",
                                  "--json", "stats.json"});
    ASSERT_EQ(flown.status, 0) << flown.err;
    const Json json = Json::parse(read_text(path("stats.json")));
    ASSERT_EQ(json["frames"].size(), 9u);
    EXPECT_TRUE(fs::exists(path("f08.png")));
    std::uint64_t tested = 0, triangles = 0;
    for (const Json& frame : json["frames"]) {
        EXPECT_FALSE(frame["ms"].is_null());
        tested += frame["tests"].size();
        triangles += frame["triangles"].get<std::uint64_t>();
    }
    const Json& totals = json["totals"];
    EXPECT_EQ(totals["control_renderings"], tested) << "every count has come";
    EXPECT_EQ(totals["triangles"], triangles);
    const auto sum = [](const Json& by_level) {
        const auto counts = by_level.get<std::vector<std::uint64_t>>();
        return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
    };
    EXPECT_EQ(totals["renderings"], sum(totals["renderings_by_level"]));
    EXPECT_LT(totals["control_renderings"], totals["renderings"]);
    EXPECT_GT(totals["mean_ms"]["maps"], 0);
    // The same once more.
    const Outcome again = render({"--method", "perceptual", "--maps", "rpg99", "--path", "orbit:1:9", "--json", "-"});
    ASSERT_EQ(again.status, 0) << again.err;
    for (std::size_t i = 0; i < 9; ++i)
        EXPECT_EQ(again.json()["frames"][i]["levels"], json["frames"][i]["levels"]) << i;
}

TEST_F(LevelCommandTest, TheBiasSaysHowManyTriangles) {
    for (const std::string method : {"distance", "area"}) {
        int before = 0;
        for (const std::string bias : {"1e-6", method == "area" ? "3" : "0.03", "1e6"}) {
            const Outcome drawn = render({"--method", method, "--bias", bias, "--no-shadows", "--json", "-"});
            ASSERT_EQ(drawn.status, 0) << drawn.err;
            const int triangles = drawn.json()["frames"][0]["triangles"];
            EXPECT_GT(triangles, before) << method << " " << bias;
            before = triangles;
        }
    }
}

TEST_F(LevelCommandTest, ShowsWhatItGoesBy) {
    for (const std::string show : {"maps", "levels"}) {
        const Outcome drawn = render({"--method", "perceptual", "-o", show + ".png", "--show", show, "--no-shadows"});
        ASSERT_EQ(drawn.status, 0) << drawn.err;
        const auto picture = require(unseen::perception::read_image(path(show + ".png")));
        const int panels = show == "levels" ? 1 : 5;
        EXPECT_GE(picture->image.width, panels * width + (panels - 1) * 4) << show;
    }
    // One object is in no layers.
    ASSERT_EQ(run({"make", "scene", "museum", "-o", "scene.glb", "--triangles", "10000"}).status, 0);
    for (const std::string show : {"maps", "levels"}) {
        succeed({"levels", "scene.glb", "--size", "48x36", "--method", "perceptual", "-o", show + ".png", "--show",
                 show, "--no-shadows"});
    }
}

// The background alone: by every method, and whatever is to be shown of it.
TEST_F(LevelCommandTest, ASceneWithoutObjectsHasItsBackground) {
    ASSERT_EQ(run({"make", "scene", "museum", "-o", "museum.glb", "--triangles", "10000"}).status, 0);
    const std::string bytes = read_text(path("museum.glb"));
    const auto length = static_cast<std::size_t>(static_cast<unsigned char>(bytes[12])) |
                        static_cast<std::size_t>(static_cast<unsigned char>(bytes[13])) << 8 |
                        static_cast<std::size_t>(static_cast<unsigned char>(bytes[14])) << 16;
    Json json = Json::parse(bytes.substr(20, length));
    for (Json& node : json["nodes"])
        if (node.contains("mesh")) node["extras"]["unseen"]["background"] = true;
    json["buffers"][0]["uri"] = "data.bin";
    write_text(path("data.bin"), bytes.substr(20 + length + 8));
    write_text(path("scene.gltf"), json.dump());
    std::string first;
    for (const std::string method : {"perceptual", "distance", "area"}) {
        const Outcome drawn = succeed(
            {"levels", "scene.gltf", "--size", "64x48", "--method", method, "-o", method + ".pfm", "--json", "-"});
        EXPECT_EQ(drawn.json()["frames"][0]["triangles"], 0);
        EXPECT_TRUE(drawn.json()["is_settled"]);
        const std::string picture = read_text(path(method + ".pfm"));
        if (first.empty()) first = picture;
        EXPECT_EQ(picture, first) << method;
    }
    const auto picture = require(unseen::perception::read_image(path("area.pfm")));
    const auto [least, most] = std::ranges::minmax(picture->image.values);
    EXPECT_GT(most, 2 * least) << "there are walls";
    for (const std::string show : {"maps", "levels"})
        EXPECT_EQ(run({"levels", "scene.gltf", "--size", "64x48", "--method", "perceptual", "-o", show + ".png",
                       "--show", show})
                      .status,
                  0)
            << show;
}

TEST_F(LevelCommandTest, RefusesWhatDoesNotGoTogether) {
    const auto refused = [&](const Words& words) {
        const Outcome outcome = render(words);
        EXPECT_EQ(outcome.status, 2) << outcome.out;
        return outcome.err;
    };
    const std::vector<std::pair<Words, std::string>> wrong = {
        {{}, "-o is required, or --json"},
        {{"--bias", "2", "--json", "-"}, "--bias needs --method distance or --method area"},
        {{"--method", "area", "--maps", "rpg99", "--json", "-"}, "--maps and --method area exclude each other"},
        {{"--method", "area", "--fade", "3", "-o", "a.png"}, "--fade needs --path"},
        {{"--method", "area", "--show", "maps", "-o", "a.png"}, "only --method perceptual"},
        {{"--method", "area", "--show", "cost", "-o", "a.png"}, "must be maps"},
        {{"--method", "area", "--full", "--json", "-"}, "no option '--full'"},
        {{"--method", "area", "--samples", "4", "--json", "-"}, "no option '--samples'"},
        {{"--method", "area", "--triangles", "9", "--json", "-"}, "--triangles needs --selection"},
        {{"--method", "area", "--path", "orbit:1:3", "-o", "a.png"}, "%d"},
        {{"--method", "area", "--show", "levels", "-o", "a.pfm"}, ".png"},
        {{"--method", "nearest", "-o", "a.png"}, "--method"},
        {{"--fps", "30", "-o", "a.png"}, "--fps needs --lights"}};
    for (const auto& [words, sentence] : wrong) EXPECT_THAT(refused(words), HasSubstr(sentence));
    EXPECT_THAT(run({"render", "scene.glb", "--show", "levels", "-o", "a.png"}).err, HasSubstr("--show"));
    EXPECT_THAT(run({"render", "scene.glb", "--method", "area"}).err, HasSubstr("-o is required, or --json"))
        << "an old spelling";
    EXPECT_EQ(files(), std::set<std::string>({"scene.glb"}));
}

} // namespace level_command_test
