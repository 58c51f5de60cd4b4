// What went into a simplification besides triangles comes out again: nodes, names, materials, images, texture
// coordinates, colours.
#include "run_command.h"

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <unseen/perception/image.h>

#include "gltf_scene.h"
#include "obj_file.h"

namespace material_command_test {

using namespace unseen::app::testing;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using unseen::perception::Image;
using unseen::support::GltfContents;
using unseen::support::GltfScene;
using unseen::support::read_gltf;
using unseen::support::read_obj;

class MaterialCommandTest : public CommandTest {
protected:
    std::string png(int size, float dark, float bright) const {
        Image image{size, size, 3, {}};
        for (int y = 0; y < size; ++y)
            for (int x = 0; x < size; ++x)
                for (int c = 0; c < 3; ++c) image.values.push_back((x / 4 + y / 4) % 2 ? dark : bright);
        const auto written = require(unseen::perception::write_image(path("made.png"), image));
        const std::string bytes = read_text(path("made.png"));
        fs::remove(path("made.png"));
        return bytes;
    }
    std::array<std::string, 3> images() const {
        return {png(16, 0.25f, 0.75f), png(4, 0.5f, 0.5f), png(8, 0.5f, 1.0f)};
    }

    std::string complaint(const Words& words) const {
        const Outcome outcome = run(words);
        EXPECT_NE(outcome.status, 0);
        EXPECT_THAT(outcome.err, IsAnErrorForPeople());
        return outcome.err;
    }
    // Directly, and by way of a tree: calls f(model to simplify).
    template <class F>
    void each_way(const std::string& mesh, F&& f) const {
        f(mesh);
        succeed({"build", mesh, "-o", "way.vdt"});
        f("way.vdt");
    }

    // From where the scene is seen.
    ::testing::AssertionResult look_the_same(const std::string& a, const std::string& b) const {
        return CommandTest::look_the_same(a, b,
                                          {"--as", "model", "--size", "400x200", "--eye", "0", "0.5", "6", "--target",
                                           "0", "0", "0", "--samples", "4", "--light", "1", "1", "1"});
    }
};

void expect_equal(const GltfContents& in, const GltfContents& out) {
    EXPECT_EQ(in.rest, out.rest) << nlohmann::json::diff(in.rest, out.rest);
    EXPECT_EQ(in.images, out.images);
    EXPECT_EQ(in.attributes, out.attributes);
    EXPECT_TRUE(in.triangles == out.triangles);
}

TEST_F(MaterialCommandTest, FullGlbComesOutAsItCameIn) {
    write_text(path("in.glb"), GltfScene().glb(images()));
    const GltfContents in = read_gltf(path("in.glb"));
    ASSERT_EQ(in.triangles.size(), 2u);
    each_way("in.glb", [&](const std::string& model) {
        for (const std::string out : {"out.glb", "out.gltf"}) {
            succeed({"simplify", model, "--full", "-o", out});
            expect_equal(in, read_gltf(path(out)));
        }
    });
}

TEST_F(MaterialCommandTest, FilesBesideItAreCopiedAndNeverOverwritten) {
    GltfScene().write_beside(path("in/scene.gltf"), images());
    const GltfContents in = read_gltf(path("in/scene.gltf"));
    fs::create_directories(path("out"));
    each_way("in/scene.gltf", [&](const std::string& model) {
        for (const std::string out : {"out/scene.gltf", "out/scene.glb", "in/small.glb"}) {
            succeed({"simplify", model, "--full", "-o", out});
            expect_equal(in, read_gltf(path(out)));
        }
        for (const char* image : {"a colour.png", "more/surface.png", "normals.png"})
            EXPECT_EQ(read_text(path("in") / image), read_text(path("out") / image)) << image;
        fs::remove_all(path("out/more"));
        fs::remove(path("out/normals.png"));
    });
    write_text(path("out/normals.png"), "somebody else's");
    EXPECT_THAT(complaint({"simplify", "way.vdt", "-o", "out/scene.glb"}), HasSubstr("another file of that name"));
    EXPECT_EQ(read_text(path("out/normals.png")), "somebody else's");
    fs::create_directories(path("other"));
    write_text(path("other/scene.bin"), "somebody else's");
    EXPECT_THAT(complaint({"simplify", "way.vdt", "-o", "other/scene.gltf"}), HasSubstr("scene.bin"));
    // A tree knows its images even where they have gone.
    fs::remove_all(path("in"));
    fs::remove_all(path("out"));
    fs::create_directories(path("out"));
    succeed({"simplify", "way.vdt", "--full", "-o", "out/scene.glb"});
    EXPECT_TRUE(fs::exists(path("out/more/surface.png")));
}

TEST_F(MaterialCommandTest, CutsKeepEverythingAndLookTheSame) {
    write_text(path("in.glb"), GltfScene(48, 64).glb(images()));
    const GltfContents in = read_gltf(path("in.glb"));
    succeed({"build", "in.glb", "-o", "in.vdt"});
    // What nobody sees, and a rough one.
    const Words view = {"--size", "400x200", "--eye", "0", "0.5", "12", "--target", "0", "0", "0", "--fov", "40"};
    const auto simplified = [&](Words words) {
        words.insert(words.begin(), {"simplify", "in.vdt"});
        words.insert(words.end(), view.begin(), view.end());
        succeed(words);
        return read_gltf(path(words[3]));
    };
    const GltfContents fine = simplified({"-o", "fine.glb", "--observer", "median"}),
                       out = simplified({"-o", "rough.glb", "--triangles", "2000"});
    for (const GltfContents& cut : {fine, out}) {
        EXPECT_EQ(in.rest, cut.rest) << nlohmann::json::diff(in.rest, cut.rest);
        EXPECT_EQ(in.images, cut.images);
        EXPECT_EQ(in.attributes, cut.attributes);
    }
    std::size_t before = 0, after = 0;
    for (const auto& [name, triangles] : fine.triangles) {
        before += in.triangles.at(name).size();
        after += triangles.size();
    }
    EXPECT_LT(after, before);
    std::size_t left = 0;
    for (const auto& [name, triangles] : out.triangles) {
        EXPECT_LT(triangles.size(), in.triangles.at(name).size()) << name;
        EXPECT_GT(triangles.size(), 20u) << name;
        left += triangles.size();
    }
    EXPECT_LE(left, 2000u);
    // As it was made: under the tree's light, and to that observer.
    if (no_opengl().empty() && !CommandTest::look_the_same("in.glb", "fine.glb", joined(view, {"--samples", "64"}))) {
        const Json judged = succeed({"compare", "a.pfm", "b.pfm", "--observer", "median", "--json", "-"}).json();
        EXPECT_EQ(judged["visible_pixels"], 0) << judged;
    }
    EXPECT_TRUE(look_the_same("in.glb", "in.vdt"));
    // Attributes: normal, position and coordinates, in the order of names.
    for (const auto& triangle : out.triangles.at("checkered ball 0"))
        for (const auto& row : triangle) {
            ASSERT_EQ(row.size(), 10u);
            const double radius = std::hypot(row[3], row[4], row[5]);
            EXPECT_NEAR(radius, 1, 0.05) << "in the frame of its node";
            if (std::abs(row[4]) > 0.9f) continue;
            EXPECT_NEAR(std::cos(std::numbers::pi * static_cast<double>(row[7])), static_cast<double>(row[4]), 0.05);
        }
}

// Whatever image lies over it, or none that can be drawn: no triangle runs through the image beside the seam.
TEST_F(MaterialCommandTest, SeamsHoldUnderMapsOfEveryKind) {
    const Json map = {{"index", 0}}, maps[] = {{{"emissiveTexture", map}, {"emissiveFactor", {1, 1, 1}}},
                                               {{"pbrMetallicRoughness", {{"metallicRoughnessTexture", map}}}},
                                               {{"occlusionTexture", map}},
                                               {{"normalTexture", map}},
                                               {{"pbrMetallicRoughness", {{"baseColorTexture", map}}}}};
    for (const Json& material : maps) {
        SCOPED_TRACE(material.dump());
        GltfScene scene(16, 24);
        scene.document["materials"][0] = material;
        scene.document["materials"][0]["name"] = "checkers";
        scene.document["materials"].push_back({{"name", "of no triangle"}});
        scene.document["extensionsUsed"] = {"KHR_texture_transform"};
        auto images = this->images();
        std::swap(images[0], images[1]); // the first one is of one colour
        write_text(path("in.glb"), scene.glb(images));
        const GltfContents in = read_gltf(path("in.glb"));
        for (const Words& budget : {Words{}, {"--triangles", "400"}}) {
            succeed(joined({"simplify", "in.glb", "--as", "model", "-o", "out.glb"}, budget));
            const GltfContents out = read_gltf(path("out.glb"));
            EXPECT_EQ(in.rest, out.rest) << nlohmann::json::diff(in.rest, out.rest);
            EXPECT_EQ(in.images, out.images);
            EXPECT_EQ(in.attributes, out.attributes);
            const auto& ball = out.triangles.at("checkered ball 0");
            EXPECT_GT(ball.size(), 100u);
            for (const auto& triangle : ball)
                for (const auto& row : triangle) { // normal, position, and coordinates: u twice round, v downward
                    ASSERT_EQ(row.size(), 10u);
                    if (std::abs(row[4]) > 0.9f) continue;
                    const double turn = std::atan2(row[3], row[5]) / std::numbers::pi - static_cast<double>(row[6]);
                    EXPECT_LT(std::abs(turn - 2 * std::round(turn / 2)), 0.1) << row[6];
                    EXPECT_NEAR(row[9], row[6] / 2, 0.01) << "the second set is the first, turned";
                    EXPECT_LT(std::abs(row[6] - triangle[0][6]), 0.6) << "not through the image";
                }
        }
    }
}

// Grey, 8 x 8; alpha 60 in the left half, 255 in the right one.
const std::string half_there = [] {
    const std::string_view hex =
        "89504e470d0a1a0a0000000d4948445200000008000000080806000000c40fbe8b000000154944415478da633871e2840d"
        "1afe8f8c1946860200f918bd61ff432eba0000000049454e44ae426082";
    std::string bytes;
    for (std::size_t i = 0; i < hex.size(); i += 2)
        bytes.push_back(static_cast<char>(std::stoi(std::string(hex.substr(i, 2)), nullptr, 16)));
    return bytes;
}();

TEST_F(MaterialCommandTest, WhatAlphaLeavesOutIsNotDrawn) {
    const auto drawn = [&](const Json& look) {
        GltfScene scene(16, 24);
        Json& material = scene.document["materials"][0];
        material = {{"name", "checkers"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}};
        material.merge_patch(look);
        scene.document["nodes"][0]["children"] = {1};
        auto images = this->images();
        images[0] = half_there;
        write_text(path("in.glb"), scene.glb(images));
        const std::string said = succeed({"render", "in.glb", "--as", "model", "--full", "--size", "128x128",
                                          "--samples", "16", "--background", "100", "-o", "out.pfm"})
                                     .err;
        EXPECT_THAT(said, Not(HasSubstr("not drawn")));
        return require(unseen::perception::read_image(path("out.pfm")))->image.values;
    };
    const auto different = [](const std::vector<float>& a, const std::vector<float>& b) {
        std::size_t count = 0;
        for (std::size_t i = 0; i < a.size(); ++i) count += std::abs(a[i] - b[i]) > 0.01f * b[i];
        return count;
    };
    const std::vector<float> all = drawn(Json::object()), nothing(all.size(), all[0]);
    EXPECT_GT(different(all, nothing), 5000u);
    EXPECT_EQ(drawn({{"alphaMode", "OPAQUE"}}), all);
    EXPECT_EQ(different(drawn({{"alphaMode", "MASK"}, {"alphaCutoff", 0}}), all), 0u);
    EXPECT_EQ(different(drawn({{"alphaMode", "MASK"}, {"alphaCutoff", 0.2}}), all), 0u); // 60 / 255 is more
    const std::vector<float> half = drawn({{"alphaMode", "MASK"}});
    const std::size_t cut_out = different(half, all);
    EXPECT_GT(cut_out, 2000u);
    EXPECT_GT(different(half, nothing), 1000u);
    EXPECT_LT(4 * different(drawn({{"alphaMode", "MASK"}, {"alphaCutoff", 0.3}}), half), cut_out); // its outlines
    const Json half_as_opaque = {{"baseColorFactor", {1, 1, 1, 0.5}}};
    const Json both = {{"alphaMode", "MASK"}, {"alphaCutoff", 0.2}, {"pbrMetallicRoughness", half_as_opaque}};
    EXPECT_LT(4 * different(drawn(both), half), cut_out);
    EXPECT_EQ(different(drawn({{"alphaMode", "MASK"}, {"alphaCutoff", 2}}), nothing), 0u);

    // Where the image has an alpha of 60, as much of it is drawn, and before it the factor's share.
    for (const double factor : {1.0, 0.5}) {
        const auto blended =
            drawn({{"alphaMode", "BLEND"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, factor}}}}});
        double apart = 0, pixels = 0;
        for (std::size_t i = 0; i < all.size(); ++i) {
            const double share = factor * (half[i] == nothing[i] ? 60.0 / 255 : 1.0);
            if (all[i] == nothing[i]) continue;
            apart += blended[i] - (share * all[i] + (1 - share) * nothing[i]), ++pixels;
        }
        EXPECT_NEAR(apart / pixels, 0, 2.5) << factor; // cd/m2; a sample is 6
    }
}

// Green of a normal map is up: light from above brightens what it tilts there.
TEST_F(MaterialCommandTest, GreenOfNormalMapsIsUp) {
    const auto map = [&](float green) {
        const Image tilt{1, 1, 3, {128.0f / 255, green / 255, 230.0f / 255}};
        EXPECT_TRUE(unseen::perception::write_image(path("n.png"), tilt));
        write_text(path("in.mtl"), "newmtl m\nKd 0.5 0.5 0.5\nnorm n.png\n");
        write_text(path("in.obj"), "mtllib in.mtl\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\n"
                                   "vt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n");
        succeed({"render", "in.obj", "--full", "--size", "32", "--light", "0", "1", "1", "-o", "o.pfm"});
        const auto picture = require(unseen::perception::read_image(path("o.pfm")));
        return unseen::perception::to_luminance(*picture, {}).at(16, 16);
    };
    EXPECT_GT(map(204), 1.2 * map(128));
    EXPECT_LT(map(52), 0.7 * map(128));
}

// The same images and colours in MTL: what stops light in part, by a number and by an image's alpha; light of its own.
TEST_F(MaterialCommandTest, ObjectsBlendAndShine) {
    write_text(path("half.png"), half_there);
    write_text(path("in.obj"), "mtllib in.mtl\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\n"
                               "vt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n");
    const auto mean = [&](const std::string& material) {
        write_text(path("in.mtl"), "newmtl m\n" + material);
        const std::string said = succeed({"render", "in.obj", "--full", "--size", "64", "--samples", "64",
                                          "--background", "50", "-o", "out.pfm"})
                                     .err;
        EXPECT_THAT(said, Not(HasSubstr("not drawn")));
        const auto picture = require(unseen::perception::read_image(path("out.pfm")));
        const auto luminance = unseen::perception::to_luminance(*picture, {});
        double sum = 0;
        for (int y = 24; y < 40; ++y)
            for (int x = 24; x < 40; ++x) sum += luminance.at(x, y) / 256;
        return sum;
    };
    const double whole = mean("Kd 0.9 0.9 0.9\n"), black = mean("Kd 0 0 0\n");
    EXPECT_NEAR(mean("Kd 0.9 0.9 0.9\nd 0.25\n"), 0.25 * whole + 0.75 * 50, 1);
    EXPECT_NEAR(mean("Kd 0.9 0.9 0.9\nmap_d half.png\n"), 0.5 * (1 + 60.0 / 255) * whole + 0.5 * (1 - 60.0 / 255) * 50,
                1.5);
    EXPECT_NEAR(mean("Kd 0 0 0\nKe 1 1 1\n"), 100, 0.5);
    EXPECT_GT(mean("Kd 0 0 0\nKe 0 1 0\n"), black + 60);
}

TEST_F(MaterialCommandTest, PartsThatVanishLeaveTheirNodes) {
    write_text(path("in.glb"), GltfScene().glb(images()));
    succeed({"simplify", "in.glb", "--triangles", "8", "-o", "out.glb"});
    const GltfContents out = read_gltf(path("out.glb"));
    EXPECT_LE(out.triangles.size(), 2u);
    EXPECT_EQ(out.rest["nodes"].size(), 4u);
    EXPECT_EQ(out.rest["materials"].size(), 2u);
    for (const auto& mesh : out.rest["meshes"]) EXPECT_FALSE(mesh["primitives"].empty());
}

TEST_F(MaterialCommandTest, WhatNoCutCanKeepIsRefusedOrDropped) {
    GltfScene scene;
    auto& document = scene.document;
    document["skins"] = {{{"joints", {0}}}};
    document["nodes"][1]["skin"] = 0;
    document["animations"] = {{{"channels", nlohmann::json::array()}, {"samplers", nlohmann::json::array()}}};
    document["meshes"][0]["weights"] = {0.5};
    document["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", 0}}};
    document["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = 0;
    document["extensionsUsed"].push_back("NOBODY_knows");
    document["extensionsRequired"] = {"NOBODY_knows"};
    document["nodes"][2]["extensions"] = {{"NOBODY_knows", {{"accessor", 3}}}};
    write_text(path("in.glb"), scene.glb(images()));
    EXPECT_THAT(complaint({"build", "in.glb", "-o", "t.vdt"}),
                AllOf(HasSubstr("skins and morph targets and animations and unknown extensions"),
                      HasSubstr("NOBODY_knows"), HasSubstr("--drop skins,morph-targets,animations,extensions")));
    EXPECT_THAT(complaint({"simplify", "in.glb", "-o", "out.glb", "--drop", "skins,morph-targets,extensions"}),
                HasSubstr("leave them out with --drop animations"));
    EXPECT_EQ(run({"build", "in.glb", "-o", "t.vdt", "--drop", "everything"}).status, 2);
    const std::string said =
        succeed({"build", "in.glb", "-o", "t.vdt", "--drop", "skins,morph-targets,animations,extensions"}).err;
    for (const char* what : {"skins were left out", "morph targets were left out", "animations were left out",
                             "unknown extensions were left out", "tangents were left out"})
        EXPECT_THAT(said, HasSubstr(what));
    succeed({"simplify", "t.vdt", "--full", "-o", "out.glb"});
    write_text(path("plain.glb"), GltfScene().glb(images()));
    expect_equal(read_gltf(path("plain.glb")), read_gltf(path("out.glb")));
    EXPECT_EQ(run({"info", "in.glb"}).status, 0) << "it is looked at only";
}

TEST_F(MaterialCommandTest, InstancesGetMeshesOfTheirOwn) {
    GltfScene scene(12, 16);
    scene.document["nodes"][2]["mesh"] = 0;
    // A node of no size, which nothing brings back.
    scene.document["nodes"].push_back(
        {{"name", "flat"}, {"mesh", 1}, {"scale", {1, 1, 0}}, {"translation", {0, 3, 0}}});
    scene.document["scenes"][0]["nodes"].push_back(4);
    write_text(path("in.glb"), scene.glb(images()));
    const std::string said = succeed({"simplify", "in.glb", "--as", "model", "--full", "-o", "out.glb"}).err;
    EXPECT_THAT(said, AllOf(HasSubstr("1 mesh was under several nodes"), HasSubstr("no inverse")));
    const GltfContents in = read_gltf(path("in.glb")), out = read_gltf(path("out.glb"));
    EXPECT_EQ(out.rest["meshes"].size(), 3u);
    for (const char* name : {"checkered ball 0", "gold ball 0"})
        EXPECT_TRUE(in.triangles.at(name) == out.triangles.at(name)) << name;
    EXPECT_EQ(in.triangles.at("flat 1").size(), out.triangles.at("flat 1").size());
    EXPECT_TRUE(look_the_same("in.glb", "out.glb"));
}

class ObjMaterialTest : public MaterialCommandTest {
protected:
    // Two squares of cells, one with an image and one with a colour, side by side.
    void write_model() const {
        std::ostringstream obj;
        obj << "mtllib paint.mtl\nvn 0 0 1\n";
        int first = 1;
        for (const std::string side : {"left", "right"}) {
            obj << "o " << side << "\n";
            for (int i = 0; i <= 8; ++i)
                for (int k = 0; k <= 8; ++k)
                    obj << "v " << (side == "left" ? -2 : 0.25) + k / 4.0 << ' ' << i / 4.0 - 1 << " 0\nvt " << k / 4.0
                        << ' ' << i / 8.0 << '\n';
            obj << "usemtl " << (side == "left" ? "check" : "gold") << "\n";
            for (int i = 0; i < 8; ++i) {
                if (i == 4) obj << "g upper\n";
                for (int k = 0; k < 8; ++k) {
                    obj << "f";
                    for (const int corner : {i * 9 + k, i * 9 + k + 1, (i + 1) * 9 + k + 1, (i + 1) * 9 + k})
                        obj << ' ' << first + corner << '/' << first + corner << "/1";
                    obj << '\n';
                }
            }
            first += 81;
        }
        fs::create_directories(path("in/images"));
        write_text(path("in/model.obj"), obj.str());
        write_text(path("in/paint.mtl"),
                   "# by hand\nnewmtl check\nKd 1 1 1\nNs 10\nmap_Kd images/check.png\nmap_Bump -bm 0.5 bumps.png\n"
                   "newmtl gold\nKd 1 0.8 0.1\nKs 0.5 0.5 0.5\nillum 2\n");
        write_text(path("in/images/check.png"), images()[0]);
        write_text(path("in/bumps.png"), images()[1]);
    }

    // Corners by object, group and material.
    std::map<std::string, std::multiset<std::string>> contents(const std::string& file) const {
        return read_obj(read_text(path(file))).corners();
    }
    template <class Set>
    static std::set<typename Set::value_type> as_set(const Set& values) {
        return {values.begin(), values.end()};
    }
};

TEST_F(ObjMaterialTest, FullModelComesOutAsItCameIn) {
    write_model();
    const auto in = contents("in/model.obj");
    ASSERT_EQ(in.size(), 3u);
    fs::create_directories(path("out"));
    each_way("in/model.obj", [&](const std::string& model) {
        succeed({"simplify", model, "--full", "-o", "out/model.obj"});
        const auto out = contents("out/model.obj");
        ASSERT_EQ(in.size(), out.size());
        for (const auto& [name, corners] : in) {
            ASSERT_TRUE(out.contains(name)) << name;
            EXPECT_EQ(as_set(corners), as_set(out.at(name))) << name;
            EXPECT_EQ(out.at(name).size(), corners.size() / 4 * 6) << "two triangles a quad";
        }
        for (const char* file : {"paint.mtl", "images/check.png", "bumps.png"})
            EXPECT_EQ(read_text(path("in") / file), read_text(path("out") / file)) << file;
        fs::remove_all(path("out/images"));
    });
}

// With the materials' file lost, corners without coordinates, and a material of no triangle: what is there stays right.
TEST_F(ObjMaterialTest, WhatIsMissingIsMissedAloneAtEveryBudget) {
    write_model();
    fs::remove(path("in/paint.mtl"));
    std::string text = read_text(path("in/model.obj")), gaps;
    std::istringstream lines(text);
    bool is_left = false, is_upper = false; // groups go on from object to object
    for (std::string line; std::getline(lines, line); gaps += line + '\n') {
        if (line.starts_with("o ")) is_left = line == "o left";
        is_upper = is_left && (is_upper || line == "g upper");
        if (line.starts_with("usemtl gold")) gaps += "usemtl nothing\n";
        if (!is_upper || !line.starts_with("f ")) continue;
        for (std::size_t at = 2; (at = line.find('/', at)) != std::string::npos;) { // V/T/N to V//N
            const std::size_t second = line.find('/', at + 1);
            line.erase(at + 1, second - at - 1);
            at += 2;
        }
    }
    write_text(path("in/model.obj"), gaps);
    fs::create_directories(path("out"));
    for (const Words& budget : {Words{"--full"}, {"--triangles", "60"}, {"--triangles", "20"}, {}}) {
        SCOPED_TRACE(::testing::PrintToString(budget));
        EXPECT_THAT(succeed(joined({"simplify", "in/model.obj", "-o", "out/model.obj"}, budget)).err,
                    HasSubstr("paint.mtl"));
        const auto out = read_obj(read_text(path("out/model.obj")));
        std::set<std::string> names;
        for (const auto& [name, faces] : out.faces) {
            names.insert(name);
            for (const auto& face : faces)
                for (const auto& corner : face) {
                    EXPECT_EQ(corner[1] < 0, name == "left upper check") << name;
                    if (corner[1] < 0) continue;
                    const auto &p = out.vector(0, corner[0]), &uv = out.vector(1, corner[1]);
                    EXPECT_NEAR(uv[0], p[0] + (p[0] < 0.1 ? 2 : -0.25), 1e-4) << name;
                    EXPECT_NEAR(uv[1], (p[1] + 1) / 2, 1e-4) << name;
                }
        }
        EXPECT_THAT(names, ::testing::ElementsAre("left  check", "left upper check", "right upper gold"));
    }
}

TEST_F(ObjMaterialTest, FormatsBecomeEachOther) {
    write_model();
    fs::create_directories(path("out"));
    const std::string said = succeed({"simplify", "in/model.obj", "--full", "-o", "out/model.glb"}).err;
    EXPECT_THAT(said, HasSubstr("glTF gets"));
    const GltfContents out = read_gltf(path("out/model.glb"));
    EXPECT_EQ(out.rest["materials"][0]["name"], "check");
    EXPECT_EQ(out.rest["nodes"][1]["name"], "right");
    EXPECT_EQ(out.images, Words{"images/check.png"});
    EXPECT_NEAR(out.rest["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"][1].get<double>(), 0.6038, 1e-3);
    EXPECT_TRUE(look_the_same("in/model.obj", "out/model.glb"));

    write_text(path("scene.glb"), GltfScene().glb(images()));
    EXPECT_THAT(succeed({"simplify", "scene.glb", "--full", "-o", "out/scene.obj"}).err, HasSubstr("OBJ gets"));
    EXPECT_THAT(read_text(path("out/scene.mtl")), AllOf(HasSubstr("newmtl gold"), HasSubstr("norm scene_image2.png")));
    EXPECT_EQ(read_text(path("out/scene_image0.png")), images()[0]);
    EXPECT_THAT(succeed({"simplify", "scene.glb", "--full", "-o", "out/scene.ply"}).err,
                HasSubstr("PLY holds no materials"));
}

// OBJ and glTF, with an image somewhere and without: the same surfaces look the same.
TEST_F(ObjMaterialTest, ColoursOfMaterialsCount) {
    write_model();
    for (const Words& option : {Words{}, {"--no-texture"}}) {
        const Outcome drawn = run(
            joined({"render", "in/model.obj", "-o", "p.pfm", "--full", "--size",    "64x32", "--eye", "0",  "0",
                    "4",      "--target",     "0",  "0",     "0",      "--samples", "4",     "--fov", "40", "--prelit"},
                   option));
        if (drawn.err.find("No OpenGL") != std::string::npos) GTEST_SKIP() << drawn.err;
        ASSERT_EQ(drawn.status, 0) << drawn.err;
        const auto picture = require(unseen::perception::read_image(path("p.pfm")));
        const double gold = 0.2126 * 1 + 0.7152 * 0.6038 + 0.0722 * 0.0100; // decoded from sRGB
        const auto luminance = unseen::perception::to_luminance(*picture, {});
        EXPECT_NEAR(luminance.at(46, 16), 0.5 + 99.5 * gold, 1.5) << option.size();
    }
    for (const std::string model : {"in/model.obj", "scene.glb"}) {
        if (model == "scene.glb") write_text(path(model), GltfScene().glb(images()));
        succeed({"build", model, "-o", "t.vdt", "--no-texture", "--prelit"});
        const std::string info = run({"info", "t.vdt"}).out;
        double darkest = 0, brightest = 0;
        ASSERT_EQ(std::sscanf(info.c_str() + info.find("luminance"), "luminance %lf to %lf", &darkest, &brightest), 2);
        EXPECT_GT(brightest, darkest + 0.2) << model;
    }
}

// Two squares side by side, each with the whole image on it: at the seam u is 1 on the left and 0 on the right.
TEST_F(MaterialCommandTest, SeamOfTwoSquaresStaysWhereItIs) {
    std::ostringstream obj;
    constexpr int cells = 4; // so that few digits do
    int first = 1;
    for (const int left : {0, 1}) {
        for (int i = 0; i <= cells; ++i)
            for (int k = 0; k <= cells; ++k) {
                const double u = double(k) / cells, v = double(i) / cells;
                obj << "v " << left + u << ' ' << v << " 0\nvt " << u << ' ' << v << '\n';
            }
        for (int i = 0; i < cells; ++i)
            for (int k = 0; k < cells; ++k) {
                const int a = first + i * (cells + 1) + k, b = a + cells + 1;
                for (const auto& t : {std::array{a, a + 1, b + 1}, std::array{a, b + 1, b}}) {
                    obj << 'f';
                    for (const int v : t) obj << ' ' << v << '/' << v;
                    obj << '\n';
                }
            }
        first += (cells + 1) * (cells + 1);
    }
    write_text(path("in.obj"), obj.str());
    for (const Words& budget : {Words{"--triangles", "64"}, {"--triangles", "20"}, {"--triangles", "4"}, {}}) {
        succeed(joined({"simplify", "in.obj", "-o", "out.obj"}, budget));
        const auto out = read_obj(read_text(path("out.obj")));
        std::size_t triangles = 0;
        double area = 0;
        for (const auto& [name, of_part] : out.faces)
            for (const auto& face : of_part) {
                ++triangles;
                std::array<glm::dvec2, 3> p, uv;
                for (std::size_t k = 0; k < 3; ++k) {
                    const auto &at = out.vector(0, face[k][0]), &coordinates = out.vector(1, face[k][1]);
                    p[k] = {at[0], at[1]}, uv[k] = {coordinates[0], coordinates[1]};
                }
                const double left = (p[0].x + p[1].x + p[2].x) / 3 < 1 ? 0 : 1;
                for (std::size_t k = 0; k < 3; ++k) EXPECT_LT(glm::length(uv[k] - (p[k] - glm::dvec2(left, 0))), 1e-6);
                const glm::dvec2 e = p[1] - p[0], f = p[2] - p[0];
                area += (e.x * f.y - e.y * f.x) / 2;
            }
        EXPECT_NEAR(area, 2, 1e-6) << "and no triangle is turned over";
        EXPECT_GE(triangles, 4u);
        if (!budget.empty()) EXPECT_LE(triangles, std::stoul(budget[1]));
    }
}

// A box of 1,536 triangles. Each side is an object with texture coordinates from 0 to 1 and a normal of its own; the
// sides along z are of another material.
class BoxTest : public MaterialCommandTest {
protected:
    static constexpr int cells = 16, faces = 6 * cells * cells * 2;

    // The sides are called x0, x1, y0, ...
    static glm::dvec3 normal_of(const std::string& side) {
        glm::dvec3 n(0);
        n[side[0] - 'x'] = side[1] == '1' ? 1 : -1;
        return n;
    }
    static glm::dvec2 uv_of(const std::string& side, const glm::dvec3& p) {
        const int axis = side[0] - 'x';
        return {p[(axis + 1) % 3], p[(axis + 2) % 3]};
    }

    void write_box() const {
        std::ostringstream obj;
        obj << "mtllib box.mtl\n";
        int first = 1, number = 1;
        for (const std::string side : {"x0", "x1", "y0", "y1", "z0", "z1"}) {
            const glm::dvec3 n = normal_of(side);
            const int axis = side[0] - 'x';
            obj << "o " << side << "\nusemtl " << (axis == 2 ? "lid" : "body") << "\nvn " << n.x << ' ' << n.y << ' '
                << n.z << '\n';
            for (int i = 0; i <= cells; ++i)
                for (int k = 0; k <= cells; ++k) {
                    glm::dvec3 p(0);
                    p[axis] = side[1] == '1' ? 1 : 0;
                    p[(axis + 1) % 3] = double(i) / cells, p[(axis + 2) % 3] = double(k) / cells;
                    const glm::dvec2 uv = uv_of(side, p);
                    obj << "v " << p.x << ' ' << p.y << ' ' << p.z << "\nvt " << uv.x << ' ' << uv.y << '\n';
                }
            for (int i = 0; i < cells; ++i)
                for (int k = 0; k < cells; ++k) {
                    const int a = first + i * (cells + 1) + k, b = a + cells + 1;
                    std::vector<int> quad{a, b, b + 1, a + 1};
                    if (side[1] == '0') std::ranges::reverse(quad);
                    for (const int t : {1, 2}) {
                        obj << 'f';
                        for (const int v : {quad[0], quad[t], quad[t + 1]})
                            obj << ' ' << v << '/' << v << '/' << number;
                        obj << '\n';
                    }
                }
            first += (cells + 1) * (cells + 1);
            ++number;
        }
        write_text(path("box.obj"), obj.str());
        write_text(path("box.mtl"), "newmtl body\nKd 1 1 1\nmap_Kd check.png\nnewmtl lid\nKd 1 0.8 0.1\n");
        write_text(path("check.png"), images()[0]);
    }

    static void expect_corner(const std::string& side, const glm::dvec3& p, const glm::dvec2& uv, const glm::dvec3& n) {
        constexpr double near = 1e-5;
        EXPECT_LT(glm::length(n - normal_of(side)), 1e-4) << side;
        EXPECT_NEAR(p[side[0] - 'x'], side[1] == '1' ? 1 : 0, near) << side;
        // Nobody sees where the lid's coordinates lie, for it has no image.
        EXPECT_LT(glm::length(uv - uv_of(side, p)), side[0] == 'z' ? 0.05 : near)
            << side << ": " << p.x << ' ' << p.y << ' ' << p.z;
    }
    static const std::vector<int>& budgets() {
        static const std::vector<int> all{faces, faces / 2, faces / 10, faces / 50}; // 100, 50, 10, 2%
        return all;
    }
    ::testing::AssertionResult look_the_same(const std::string& a, const std::string& b) const {
        return CommandTest::look_the_same(a, b,
                                          {"--size", "300x300", "--eye", "2.5", "2", "3", "--target", "0.5", "0.5",
                                           "0.5", "--samples", "4", "--light", "1", "2", "3"});
    }
};

TEST_F(BoxTest, HasItsSeamsEdgesAndNamesInObjAtEveryBudget) {
    write_box();
    fs::create_directories(path("out"));
    for (const int budget : budgets()) {
        succeed({"simplify", "box.obj", "--triangles", std::to_string(budget), "-o", "out/box.obj"});
        const auto out = read_obj(read_text(path("out/box.obj")));
        EXPECT_EQ(out.faces.size(), 6u) << budget;
        std::size_t triangles = 0;
        for (const auto& [name, of_part] : out.faces) {
            const std::string side = name.substr(0, 2);
            EXPECT_EQ(name, side + "  " + (side[0] == 'z' ? "lid" : "body"));
            triangles += of_part.size();
            for (const auto& face : of_part)
                for (const auto& corner : face) {
                    const auto &p = out.vector(0, corner[0]), &uv = out.vector(1, corner[1]),
                               &n = out.vector(2, corner[2]);
                    expect_corner(side, {p[0], p[1], p[2]}, {uv[0], uv[1]}, {n[0], n[1], n[2]});
                }
        }
        EXPECT_LE(triangles, static_cast<std::size_t>(budget));
        EXPECT_GE(triangles, 12u);
        const auto& positions = out.vectors.at("v");
        EXPECT_EQ(std::set(positions.begin(), positions.end()).size(), positions.size()) << "sides share their edges";
        EXPECT_EQ(out.vectors.at("vn").size(), 6u);
        EXPECT_TRUE(look_the_same("box.obj", "out/box.obj")) << budget;
        fs::remove(path("out/box.obj"));
    }
}

TEST_F(BoxTest, HasItsSeamsEdgesAndNamesInGltfAtEveryBudget) {
    write_box();
    succeed({"simplify", "box.obj", "--full", "-o", "box.glb"});
    const GltfContents in = read_gltf(path("box.glb"));
    for (const int budget : budgets()) {
        succeed({"simplify", "box.glb", "--as", "model", "--triangles", std::to_string(budget), "-o", "out.glb"});
        const GltfContents out = read_gltf(path("out.glb"));
        EXPECT_EQ(in.rest, out.rest) << nlohmann::json::diff(in.rest, out.rest);
        EXPECT_EQ(in.attributes, out.attributes);
        std::size_t triangles = 0;
        for (const auto& [name, of_part] : out.triangles) {
            triangles += of_part.size();
            for (const auto& triangle : of_part)
                for (const auto& row : triangle) { // normal, position and coordinates, which glTF has downward
                    ASSERT_EQ(row.size(), 8u);
                    expect_corner(name.substr(0, 2), {row[3], row[4], row[5]}, {row[6], 1 - row[7]},
                                  {row[0], row[1], row[2]});
                }
        }
        EXPECT_LE(triangles, static_cast<std::size_t>(budget));
        EXPECT_TRUE(look_the_same("box.glb", "out.glb")) << budget;
    }
}

// What the file does not state, but the picture shows.
TEST_F(BoxTest, GetsTheNormalsThatItIsDrawnWith) {
    write_box();
    std::string text = read_text(path("box.obj"));
    for (std::size_t at = 0; (at = text.find("vn ", at)) != std::string::npos;)
        text.erase(at, text.find('\n', at) + 1 - at);
    std::string bare;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line); bare += line + '\n')
        if (line.starts_with("f "))
            for (std::size_t at = 2; (at = line.find('/', at)) != std::string::npos;) { // V/T/N to V/T
                const std::size_t second = line.find('/', at + 1);
                line.erase(second, std::min(line.find(' ', second), line.size()) - second);
                at = second;
            }
    write_text(path("bare.obj"), bare);
    succeed({"simplify", "bare.obj", "--full", "-o", "out.obj"});
    const auto out = read_obj(read_text(path("out.obj")));
    EXPECT_EQ(out.vectors.at("vn").size(), 6u) << "its edges are sharp";
    for (const auto& [name, of_part] : out.faces)
        for (const auto& face : of_part)
            for (const auto& corner : face) {
                const auto &p = out.vector(0, corner[0]), &uv = out.vector(1, corner[1]), &n = out.vector(2, corner[2]);
                expect_corner(name.substr(0, 2), {p[0], p[1], p[2]}, {uv[0], uv[1]}, {n[0], n[1], n[2]});
            }
    succeed({"simplify", "bare.obj", "--full", "-o", "out.glb"});
    for (const auto& [name, attributes] : read_gltf(path("out.glb")).attributes)
        EXPECT_TRUE(attributes.contains("NORMAL")) << name;
}

// STL of many boxes, whose facets share no vertices: a tenth of them has all corners.
TEST_F(MaterialCommandTest, BoxesOfAnStlKeepTheirCorners) {
    constexpr int n = 8, boxes = 20;
    std::ostringstream stl;
    std::vector<glm::dvec3> corners;
    stl << "solid boxes\n";
    for (int box = 0; box < boxes; ++box) {
        const glm::dvec3 at(15.0 * (box % 5), 15.0 * (box / 5), 0);
        for (int k = 0; k < 8; ++k) corners.push_back(at + glm::dvec3(k & 1 ? 10 : 0, k & 2 ? 10 : 0, k & 4 ? 10 : 0));
        for (int side = 0; side < 6; ++side)
            for (int i = 0; i < n * n; ++i) {
                const auto p = [&](int u, int v) {
                    glm::dvec3 q(0);
                    q[side / 2] = side % 2 ? 10 : 0;
                    q[(side / 2 + 1) % 3] = 10.0 * (i % n + u) / n, q[(side / 2 + 2) % 3] = 10.0 * (i / n + v) / n;
                    return at + q;
                };
                std::array<std::array<glm::dvec3, 3>, 2> facets{
                    {{p(0, 0), p(1, 0), p(1, 1)}, {p(0, 0), p(1, 1), p(0, 1)}}};
                for (auto& facet : facets) {
                    if (side % 2 == 0) std::swap(facet[1], facet[2]);
                    stl << "facet normal 0 0 0\nouter loop\n";
                    for (const glm::dvec3& q : facet) stl << "vertex " << q.x << ' ' << q.y << ' ' << q.z << '\n';
                    stl << "endloop\nendfacet\n";
                }
            }
    }
    stl << "endsolid boxes\n";
    write_text(path("boxes.stl"), stl.str());
    succeed({"simplify", "boxes.stl", "-o", "out.obj", "--triangles", "10%"});
    const auto out = read_obj(read_text(path("out.obj")));
    EXPECT_LE(out.faces.begin()->second.size(), boxes * 12 * n * n / 10u);
    for (const glm::dvec3& corner : corners) {
        double nearest = std::numeric_limits<double>::infinity();
        for (const auto& p : out.vectors.at("v"))
            nearest = std::min(nearest, glm::distance(corner, glm::dvec3(p[0], p[1], p[2])));
        EXPECT_LT(nearest, 0.01);
    }
}

// A tube of 24 sides, flat by `s off` and round in a smoothing group: drawn and written so, at every budget.
TEST_F(MaterialCommandTest, SmoothingOfObjectsIsWrittenAsNormals) {
    constexpr int sides = 24, rows = 8;
    std::ostringstream obj, faces;
    for (int r = 0; r <= rows; ++r)
        for (int s = 0; s < sides; ++s) {
            const double turn = 2 * std::numbers::pi * s / sides;
            obj << "v " << std::cos(turn) << ' ' << std::sin(turn) << ' ' << r / 4.0 << '\n';
        }
    for (int r = 0; r < rows; ++r)
        for (int s = 0; s < sides; ++s) {
            const int a = r * sides + s + 1, b = r * sides + (s + 1) % sides + 1;
            faces << "f " << a << ' ' << b << ' ' << b + sides << ' ' << a + sides << '\n';
        }
    for (const bool is_flat : {true, false}) {
        write_text(path("tube.obj"), obj.str() + (is_flat ? "s off\n" : "s 1\n") + faces.str());
        for (const Words& budget : {Words{"--full"}, {"--triangles", "192"}, {"--triangles", "96"}}) {
            succeed(joined({"simplify", "tube.obj", "-o", "out.obj"}, budget));
            const auto out = read_obj(read_text(path("out.obj")));
            ASSERT_FALSE(out.faces.empty());
            double worst = 1; // cosine to the face
            for (const auto& face : out.faces.begin()->second) {
                std::array<glm::dvec3, 3> p, n;
                for (std::size_t k = 0; k < 3; ++k) {
                    const auto &at = out.vector(0, face[k][0]), &normal = out.vector(2, face[k][2]);
                    p[k] = {at[0], at[1], at[2]}, n[k] = {normal[0], normal[1], normal[2]};
                }
                const glm::dvec3 own = glm::normalize(glm::cross(p[1] - p[0], p[2] - p[0]));
                for (const glm::dvec3& normal : n) worst = std::min(worst, glm::dot(own, normal));
            }
            if (is_flat) EXPECT_GT(worst, 0.9999) << budget.back();
            else EXPECT_LT(worst, 0.995) << budget.back();
            EXPECT_GT(worst, 0.9) << budget.back();
        }
    }
}

class ProtectTest : public CommandTest {
protected:
    static constexpr int n = 24;

    // Hills of n x n squares, the left half of glass; paints.txt marks its vertices.
    void SetUp() override {
        CommandTest::SetUp();
        std::string vertices, glass = "usemtl glass\n", paint = "usemtl paint\n", marks;
        for (int i = 0; i <= n; ++i)
            for (int j = 0; j <= n; ++j) {
                vertices += "v " + std::to_string(j) + ' ' + std::to_string(std::sin(0.7 * i) * std::cos(0.9 * j)) +
                            ' ' + std::to_string(i) + '\n';
                marks += j <= n / 2 ? "1\n" : "0\n";
            }
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n; ++j) {
                const auto at = [&](int row, int column) { return std::to_string(row * (n + 1) + column + 1) + ' '; };
                (j < n / 2 ? glass : paint) += "f " + at(i, j) + at(i + 1, j) + at(i + 1, j + 1) + "\nf " + at(i, j) +
                                               at(i + 1, j + 1) + at(i, j + 1) + '\n';
            }
        write_text(path("hills.obj"), vertices + glass + paint);
        write_text(path("marks.txt"), marks);
    }

    // How many triangles of glass are left.
    std::size_t glass(const Words& more, const std::string& triangles = "60%") {
        Words words = {"simplify", "hills.obj",   "-o", "out.obj", "--triangles",
                       triangles,  "--direction", "0",  "1",       "1"};
        words.insert(words.end(), more.begin(), more.end());
        said_ = succeed(words).err;
        for (const auto& [name, faces] : read_obj(read_text(path("out.obj"))).faces)
            if (name.ends_with("glass")) return faces.size();
        return 0;
    }
    std::string said_;
};

TEST_F(ProtectTest, KeepsMaterialsAndVerticesByTheirWeights) {
    const std::size_t free = glass({}), twice = glass({"--protect", "material=glass:2"}),
                      often = glass({"--protect", "material=glass:8"}), all = glass({"--protect", "material=glass"});
    EXPECT_LT(free, twice);
    EXPECT_LE(twice, often);
    EXPECT_EQ(all, 1u * n * n) << "every triangle of it";
    const std::string marks = path("marks.txt").string();
    EXPECT_EQ(glass({"--protect", marks}), all);
    EXPECT_EQ(glass({"--protect", marks + ":2"}), twice);
    EXPECT_EQ(glass({"--protect", "material=paint:2", "--protect", "material=glass:2"}, "60%"), free) << "all the same";
}

TEST_F(ProtectTest, SaysWhereTheBudgetCannotBeMet) {
    EXPECT_EQ(glass({"--protect", "material=glass"}, "50"), 1u * n * n);
    EXPECT_THAT(said_, HasSubstr("triangles never fold, for --protect says so"));
    const Outcome info = succeed({"simplify", "hills.obj", "-o", "out.obj", "--triangles", "10", "--lock-borders"});
    EXPECT_THAT(info.err, HasSubstr(std::to_string(4 * n) + " triangles never fold"));
    EXPECT_THAT(info.out, HasSubstr("kept 96 of"));
    succeed({"build", "hills.obj", "-o", "hills.vdt", "--lock-borders"});
    EXPECT_THAT(succeed({"info", "hills.vdt"}).out, HasSubstr("96 triangles never fold"));
    EXPECT_THAT(succeed({"lod", "hills.obj", "-o", "hills.glb", "--lock-borders"}).err, Not(HasSubstr("error")));
}

} // namespace material_command_test
