// What went into a simplification besides triangles comes out again: nodes, names, materials, images, texture
// coordinates, colours.
#include "run_command.h"

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
    const Words view = {"--size", "400x200", "--eye", "0", "0.5", "6", "--target", "0", "0", "0", "--fov", "40"};
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
    EXPECT_TRUE(look_the_same("in.glb", "fine.glb"));
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
        EXPECT_NEAR(picture->image.at(46, 16), 0.5 + 99.5 * gold, 1.5) << option.size();
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

} // namespace material_command_test
