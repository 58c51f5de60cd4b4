// unseen lod: the files that it writes.
#include "run_command.h"

namespace lod_command_test {

using namespace unseen::app::testing;

class LodCommandTest : public DrawingCommandTest {
protected:
    Outcome lod(const Words& more) const {
        return run(joined({"lod", "ball.vdt", "-o", "out.glb", "--directions", "2", "--samples", "8"}, more));
    }
    // The document of a GLB file.
    Json document(const std::string& name) const {
        const std::string bytes = read_text(path(name));
        std::uint32_t size = 0;
        std::memcpy(&size, bytes.data() + 12, 4);
        return Json::parse(bytes.substr(20, size));
    }
    static std::uint64_t triangles_below(const Json& document, std::size_t node) {
        std::uint64_t count = 0;
        const Json& shown = document["nodes"][node];
        if (shown.contains("mesh"))
            for (const Json& primitive : document["meshes"][shown["mesh"].get<std::size_t>()]["primitives"])
                count +=
                    document["accessors"][primitive["indices"].get<std::size_t>()]["count"].get<std::uint64_t>() / 3;
        if (shown.contains("children"))
            for (const Json& child : shown["children"]) count += triangles_below(document, child.get<std::size_t>());
        return count;
    }
};

TEST_F(LodCommandTest, OneFileHasAllLevelsAndOthersOneEach) {
    const Outcome made = lod({"--separate", "--csv", "out.csv", "--json", "-"});
    ASSERT_EQ(made.status, 0) << made.err;
    const Json report = made.json();
    const Json levels = report["objects"][0]["levels"];
    ASSERT_GE(levels.size(), 2u);
    const Json file = document("out.glb");
    const Json roots = file["scenes"][0]["nodes"];
    ASSERT_EQ(roots.size(), 1u);
    const auto root = roots[0].get<std::size_t>();
    const Json ids = file["nodes"][root]["extensions"]["MSFT_lod"]["ids"];
    const Json coverages = file["nodes"][root]["extras"]["MSFT_screencoverage"];
    ASSERT_EQ(ids.size() + 1, levels.size());
    ASSERT_EQ(coverages.size(), levels.size());
    EXPECT_EQ(coverages.back(), 0); // nothing is left out however far it is
    EXPECT_THAT(file["extensionsUsed"], ::testing::Contains("MSFT_lod"));
    for (std::size_t i = 0; i < levels.size(); ++i) {
        const auto node = i == 0 ? root : ids[i - 1].get<std::size_t>();
        EXPECT_EQ(triangles_below(file, node), levels[i]["triangles"]) << i;
        if (i > 0) {
            EXPECT_NEAR(coverages[i - 1].get<double>() / levels[i]["coverage"].get<double>(), 1, 1e-14)
                << i; // 15 digits
        }
        const std::string name = "out_lod" + std::to_string(i) + ".glb";
        const Json alone = document(name);
        EXPECT_FALSE(alone.contains("extensionsUsed")) << name;
        EXPECT_EQ(triangles_below(alone, alone["scenes"][0]["nodes"][0].get<std::size_t>()), levels[i]["triangles"]);
        EXPECT_EQ(report["files"][i]["bytes"], fs::file_size(path(name)));
    }
    EXPECT_FALSE(fs::exists(path("out_lod" + std::to_string(levels.size()) + ".glb")));
    const std::string csv = read_text(path("out.csv"));
    EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(csv, '\n')), levels.size() + 1);
    // Who does not know the extension sees the full mesh alone.
    EXPECT_EQ(run({"simplify", "out.glb", "-o", "x.ply", "--full", "--json", "-"}).json()["triangles"],
              levels[0]["triangles"]);
}

TEST_F(LodCommandTest, ScenesHaveLevelsByNodeWithNamesAndPlaces) {
    ASSERT_EQ(run({"simplify", "ball.vdt", "-o", "ball.glb", "--full"}).status, 0);
    Json scene = document("ball.glb");
    // Two nodes show one mesh, one of them with a child that is no part of it.
    scene["nodes"] = Json::parse(R"([{"name": "left", "mesh": 0, "translation": [-3, 0, 0]},
                                     {"name": "right", "mesh": 0, "children": [2]}, {"name": "hook"}])");
    scene["scenes"] = Json::parse(R"([{"nodes": [0, 1]}])");
    const std::string whole = read_text(path("ball.glb"));
    std::uint32_t before = 0;
    std::memcpy(&before, whole.data() + 12, 4);
    std::string text = scene.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    const auto word = [](std::size_t value) {
        const auto number = static_cast<std::uint32_t>(value);
        std::string bytes(4, '\0');
        std::memcpy(bytes.data(), &number, 4);
        return bytes;
    };
    const std::string rest = whole.substr(20 + before);
    write_text(path("two.glb"),
               "glTF" + word(2) + word(20 + text.size() + rest.size()) + word(text.size()) + "JSON" + text + rest);
    const Json report =
        succeed({"lod", "two.glb", "-o", "two_lods.glb", "--directions", "1", "--samples", "4", "--json", "-"}).json();
    ASSERT_EQ(report["objects"].size(), 2u);
    EXPECT_EQ(report["objects"][1]["same_as"], "left");
    const Json file = document("two_lods.glb");
    const Json& left = file["nodes"][0];
    EXPECT_EQ(left["name"], "left");
    const Json ids = left["extensions"]["MSFT_lod"]["ids"];
    ASSERT_EQ(ids.size() + 1, report["objects"][0]["levels"].size());
    for (const Json& id : ids) {
        EXPECT_EQ(file["nodes"][id.get<std::size_t>()]["translation"], left["translation"]);
        EXPECT_THAT(file["nodes"][id.get<std::size_t>()]["name"].get<std::string>(), HasSubstr("left_lod"));
    }
    // The child stays whatever the level.
    const Json& right = file["nodes"][1];
    EXPECT_FALSE(right.contains("mesh"));
    EXPECT_FALSE(right.contains("extensions"));
    EXPECT_EQ(right["children"][0], 2);
    EXPECT_EQ(file["nodes"][right["children"][1].get<std::size_t>()]["extensions"]["MSFT_lod"]["ids"].size(),
              ids.size());
    EXPECT_EQ(file["meshes"].size(), report["objects"][0]["levels"].size()); // shared by both
}

TEST_F(LodCommandTest, SmallFilesNameWhatTheyNeed) {
    ASSERT_EQ(lod({}).status, 0);
    const auto plain = fs::file_size(path("out.glb"));
    ASSERT_EQ(lod({"--quantize"}).status, 0);
    const auto quantized = fs::file_size(path("out.glb"));
    const Json file = document("out.glb");
    EXPECT_THAT(file["extensionsRequired"], ::testing::ElementsAre("KHR_mesh_quantization"));
    EXPECT_LT(quantized, plain);
    const Outcome packed = lod({"--quantize", "--meshopt"});
    if (packed.err.find("meshoptimizer") != std::string::npos) GTEST_SKIP() << packed.err;
    ASSERT_EQ(packed.status, 0) << packed.err;
    EXPECT_LT(fs::file_size(path("out.glb")), quantized);
    const Json small = document("out.glb");
    EXPECT_THAT(small["extensionsRequired"], ::testing::Contains("EXT_meshopt_compression"));
    EXPECT_EQ(small["buffers"][1]["extensions"]["EXT_meshopt_compression"]["fallback"], true);
}

TEST_F(LodCommandTest, ASheetShowsEachLevel) {
    const Outcome made = lod({"--sheet", "levels.png", "--json", "-"});
    ASSERT_EQ(made.status, 0) << made.err;
    const std::size_t levels = made.json()["objects"][0]["levels"].size();
    const auto sheet = require(unseen::perception::read_image(path("levels.png")));
    EXPECT_GT(sheet->image.width, 280 * static_cast<int>(levels - 1));
    EXPECT_GT(sheet->image.height, 4 * 280);
    // Its cells are no empty ones.
    const auto [least, most] = std::ranges::minmax(sheet->image.values);
    EXPECT_GT(most - least, 0.5f);
}

TEST_F(LodCommandTest, WrongUsageIsNamed) {
    EXPECT_THAT(run({"lod", "ball.vdt", "-o", "out.ply"}).err, HasSubstr("out.ply"));
    EXPECT_THAT(run({"lod", "missing.glb", "-o", "out.glb"}).err, HasSubstr("missing.glb"));
    EXPECT_THAT(lod({"--levels", "1"}).err, HasSubstr("--levels"));
    EXPECT_THAT(lod({"--directions", "0"}).err, HasSubstr("--directions"));
    EXPECT_THAT(lod({"--fov", "nan"}).err, HasSubstr("--fov"));
    EXPECT_FALSE(fs::exists(path("out.glb")));
}

} // namespace lod_command_test
