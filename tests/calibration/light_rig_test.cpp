// Files of lights: what they say, where the lights are in time, and what is wrong with bad ones.
#include <unseen/calibration/light_rig.h>

#include <unseen/vdtree/builder.h>

#include "profile_files.h"
#include "shapes.h"

namespace unseen::calibration::light_rig_test {

using Kind = vdtree::LightSource::Kind;

constexpr const char* good = R"({"ambient": 0.1, "material": {"specular": 0.05, "shininess": 40},
  "lights": [{"type": "directional", "direction": [0, 0, 2],
              "intensity": 0.7, "orbit": {"axis": [0, 1, 0], "degrees_per_second": 90}},
             {"type": "point", "position": [4, 0, 0], "intensity": 0.5, "distance": 3,
              "keyframes": [{"time_s": 0, "position": [4, 0, 0], "intensity": 0.5},
                            {"time_s": 2, "position": [0, 4, 0], "intensity": 1}]},
             {"type": "spot", "position": [0, 6, 0], "direction": [0, -1, 0], "inner_degrees": 20, "outer_degrees": 30,
              "intensity": 1, "distance": 3,
              "orbit": {"axis": [0, 0, 1], "degrees_per_second": 90, "centre": [0, 5, 0]}},
             {"type": "headlight", "intensity": 0.3}]})";

class LightRigTest : public ProfileFiles {
protected:
    LightRigTest() : tree_(std::move(*vdtree::build_tree(shapes::icosphere(2).view()))) {}
    vdtree::Lighting at(const LightRig& rig, double seconds) const { return rig.at(seconds, tree_, view_, {}); }
    std::string complaint(const std::string& text) const {
        const auto rig = LightRig::read(write(text, "lights.json"));
        return rig ? "" : rig.error().message;
    }
    static void expect_near(glm::dvec3 a, glm::dvec3 b) {
        EXPECT_LT(glm::length(a - b), 1e-6) << a.x << " " << a.y << " " << a.z;
    }

    vdtree::VertexTree tree_;
    vdtree::View view_{.eye = {0, 0, 8}};
};

TEST_F(LightRigTest, PutsLightsWhereTheyAreAtATime) {
    const auto rig = require(LightRig::read(write(good)));
    EXPECT_TRUE(rig->moves());
    EXPECT_EQ(rig->description(), "1 directional, 1 headlight, 1 point, 1 spot, ambient 0.1, highlights of 0.05");
    const vdtree::Lighting first = at(*rig, 0), second = at(*rig, 1), last = at(*rig, 100);
    ASSERT_EQ(first.lights.size(), 4u);
    EXPECT_EQ(first.ambient, 0.1);
    EXPECT_EQ(first.specular, 0.05);
    EXPECT_EQ(first.shininess, 40);
    EXPECT_TRUE(vdtree::validate(first));
    expect_near(first.lights[0].direction, {0, 0, 1});
    expect_near(second.lights[0].direction, {1, 0, 0});
    EXPECT_EQ(first.lights[1].kind, Kind::point);
    expect_near(first.lights[1].position, glm::dvec3(4, 0, 0) - tree_.origin());
    expect_near(second.lights[1].position, glm::dvec3(2, 2, 0) - tree_.origin());
    EXPECT_DOUBLE_EQ(second.lights[1].intensity, 0.75);
    expect_near(last.lights[1].position, glm::dvec3(0, 4, 0) - tree_.origin());
    EXPECT_NEAR(first.lights[2].inner_cosine, std::cos(20 * M_PI / 180), 1e-15);
    expect_near(second.lights[2].position, glm::dvec3(-1, 5, 0) - tree_.origin());
    expect_near(second.lights[2].direction, {1, 0, 0});
    expect_near(first.lights[3].direction, {0, 0, 1});
}

TEST_F(LightRigTest, TurnsAndScalesWithThePlacement) {
    const auto rig = require(LightRig::read(write(good)));
    vdtree::Similarity placement;
    placement.scale = 2;
    const vdtree::Lighting lighting = rig->at(0, tree_, view_, placement);
    expect_near(lighting.lights[1].position, glm::dvec3(2, 0, 0) - tree_.origin());
    EXPECT_DOUBLE_EQ(lighting.lights[1].distance, 1.5);
}

TEST_F(LightRigTest, NamesTheFileAndTheKeyOfWhatIsWrong) {
    const auto with = [](const char* from, const char* to) { return replaced(good, from, to); };
    struct Case {
        std::string text, key;
    };
    for (const Case& bad :
         {Case{with("[0, 0, 2]", "[0, 0, 0]"), "lights[0].direction"},
          Case{with("[0, 0, 2]", "[0, 0]"), "lights[0].direction"},
          Case{with("[0, 0, 2]", "[0, 0, 1e999]"), ""},
          Case{with("\"intensity\": 0.7", "\"intensity\": -1"), "lights[0].intensity"},
          Case{with("\"intensity\": 0.7", "\"intensity\": \"much\""), "lights[0].intensity"},
          Case{with("\"intensity\": 0.7", "\"intensity\": 1e300"), "lights[0].intensity"},
          Case{with("\"distance\": 3,", "\"distance\": 1e300,"), "lights[1].distance"},
          Case{with("[0, 4, 0]", "[0, 1e300, 0]"), "lights[1].keyframes[1].position"},
          Case{with("\"intensity\": 0.7, ", ""), "lights[0].intensity"},
          Case{with("\"intensity\": 0.7", "\"intensty\": 0.7"), "lights[0].intensty"},
          Case{with("\"type\": \"spot\"", "\"type\": \"lava\""), "lights[2].type"},
          Case{with("\"distance\": 3,", "\"distance\": 0,"), "lights[1].distance"},
          Case{with("\"inner_degrees\": 20", "\"inner_degrees\": 35"), "lights[2].inner_degrees"},
          Case{with("\"axis\": [0, 1, 0]", "\"axis\": [0, 0, 0]"), "lights[0].orbit.axis"},
          Case{with("\"time_s\": 2", "\"time_s\": 0"), "lights[1].keyframes[1].time_s"},
          Case{with("\"position\": [0, 4, 0], \"intensity\": 1}", "\"position\": [0, 4, 0]}"),
               "lights[1].keyframes[1].intensity"},
          Case{with("\"ambient\": 0.1", "\"ambient\": 1.5"), "ambient"},
          Case{with("\"shininess\": 40", "\"shininess\": 0"), "material.shininess"},
          Case{with("\"specular\": 0.05, ", ""), "material.specular"},
          Case{"{\"ambient\": 1}", "lights"},
          Case{"[1]", "must hold a JSON object"},
          Case{"{\"lights\": []}", "black"},
          Case{"{\"lights\": [{\"type\": \"headlight\", \"intensity\": 0}]}", "black"},
          Case{R"({"lights": [{"type": "directional", "direction": [0, 0, 1], "intensity": 1, "keyframes": [
                                     {"time_s": 0, "intensity": 0}, {"time_s": 1, "intensity": 0}]}]})",
               "black"}}) {
        const std::string found = complaint(bad.text);
        EXPECT_NE(found.find("lights.json"), std::string::npos) << bad.text;
        EXPECT_NE(found.find(bad.key), std::string::npos) << found;
        EXPECT_EQ(found.find('\n'), std::string::npos) << found;
    }
    EXPECT_NE(complaint(good).find(""), std::string::npos);
    EXPECT_FALSE(LightRig::read(folder() / "missing.json"));
    std::string many = "{\"lights\": [";
    for (int i = 0; i < 17; ++i) many += std::string(i ? "," : "") + "{\"type\": \"headlight\", \"intensity\": 1}";
    EXPECT_NE(complaint(many + "]}").find("at most 16"), std::string::npos);
}

TEST_F(LightRigTest, NeverCrashesOnMutatedFiles) {
    for_each_mutation(good, 1500, [&](const std::string& text) {
        const auto rig = LightRig::read(write(text));
        if (!rig) return;
        const vdtree::Lighting lighting = at(*rig, 0.7);
        EXPECT_LE(lighting.lights.size(), vdtree::most_lights);
    });
}

TEST_F(LightRigTest, LightsCastShadowsWhereTheySaySo) {
    const auto light = [](const char* more) {
        return std::string(R"({"type": "directional", "direction": [0, 0, 2], "intensity": 0.7)") + more + "}";
    };
    const auto of = [](const std::string& lights) { return "{\"lights\": [" + lights + "]}"; };
    const std::string casts = light(R"(, "shadow": true)"), head = R"({"type": "headlight", "intensity": 0.3})";
    auto rig = require(LightRig::read(write(of(light("") + "," + casts + "," + head))));
    EXPECT_EQ(rig->light_count(), 3u);
    EXPECT_EQ(rig->casting(), std::vector<std::size_t>{1});
    EXPECT_FALSE(at(*rig, 0).lights[0].casts_shadow);
    EXPECT_TRUE(at(*rig, 0).lights[1].casts_shadow);
    ASSERT_TRUE(rig->set_shadows(true));
    EXPECT_EQ(rig->casting(), (std::vector<std::size_t>{0, 1})) << "a headlight's shadows are behind what casts them";
    ASSERT_TRUE(rig->set_shadows(false));
    EXPECT_TRUE(rig->casting().empty());

    std::string many = casts;
    for (int i = 0; i < 4; ++i) many += "," + casts;
    EXPECT_NE(complaint(of(many)).find("5 lights that cast shadows, but at most 4"), std::string::npos);
    EXPECT_NE(complaint(of(light(R"(, "shadow": 1)"))).find("shadow"), std::string::npos);
    EXPECT_NE(complaint(of(R"({"type": "headlight", "intensity": 0.3, "shadow": true})")).find("shadow"),
              std::string::npos);
    std::string five = light("");
    for (int i = 0; i < 4; ++i) five += "," + light("");
    auto full = require(LightRig::read(write(of(five))));
    EXPECT_FALSE(full->set_shadows(true));
    EXPECT_TRUE(full->casting().empty());
}

} // namespace unseen::calibration::light_rig_test
