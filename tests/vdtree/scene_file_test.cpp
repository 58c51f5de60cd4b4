// glTF files as scenes: what is read of nodes, meshes, cameras and lights, and what is refused.
#include <unseen/meshio/scene_file.h>

#include "mesh_files.h"
#include "mesh_readers.h"
#include "temp_folder.h"
#include "testing.h"

#include <nlohmann/json.hpp>

#include <unseen/vdtree/builder.h>

namespace scene_file_test {

using namespace unseen;
using nlohmann::json;

// A triangle in a buffer of its own; the test adds nodes and so on.
json document(const std::string& rest) {
    json out = json::parse(mesh_files::gltf_triangle_json(R"([{"mesh":0}])", R"({"byteLength":42})"));
    out.erase("scene"), out.erase("scenes"); // all roots are shown, unless the test says which
    out.update(json::parse(rest));
    return out;
}

Result<meshio::SceneFile> open(const json& document, const std::string& name = "s.glb") {
    return meshio::SceneFile::from_bytes(mesh_files::glb(document.dump(), mesh_files::gltf_triangle_data()), name);
}

meshio::SceneContents contents(const std::string& rest) {
    auto file = require(open(document(rest)));
    return file->contents();
}

std::string complaint(const std::string& rest) {
    const auto file = open(document(rest));
    return file ? "" : file.error().message;
}

constexpr const char* two_lights = R"("extensionsUsed": ["KHR_lights_punctual"],
    "extensions": {"KHR_lights_punctual": {"lights": [
        {"type": "directional", "intensity": 3, "color": [1, 0.5, 0]},
        {"type": "spot", "intensity": 7, "range": 4, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}}]}})";

TEST(SceneFile, ReadsInstancesOfOneMesh) {
    const meshio::SceneContents read = contents(R"({"nodes": [
        {"mesh": 0, "name": "left", "translation": [-1, 0, 0]},
        {"mesh": 0, "name": "right", "translation": [1, 0, 0], "children": [2]},
        {"mesh": 0, "scale": [2, 2, 2], "translation": [0, 5, 0]}], "scenes": [{"nodes": [0, 1]}]})");
    ASSERT_EQ(read.nodes.size(), 3u);
    EXPECT_TRUE(read.is_scene);
    EXPECT_EQ(read.nodes[0].name, "left");
    EXPECT_EQ(read.nodes[2].to_world[3], glm::dvec4(1, 5, 0, 1)) << "below its parent";
    EXPECT_EQ(read.nodes[2].to_world[0], glm::dvec4(2, 0, 0, 0));
    for (const meshio::SceneNode& node : read.nodes) EXPECT_EQ(node.mesh, 0);
}

TEST(SceneFile, ReadsInstancesOfExtension) {
    json instanced = document(R"({"nodes": [{"mesh": 0, "name": "ball", "translation": [0, 0, 5], "children": [1],
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0, "SCALE": 0, "_ID": 1}}}},
        {"mesh": 0, "name": "child"}], "scenes": [{"nodes": [0]}],
        "extensionsUsed": ["EXT_mesh_gpu_instancing"], "extensionsRequired": ["EXT_mesh_gpu_instancing"]})");
    const auto file = require(open(instanced));
    const meshio::SceneContents& read = file->contents();
    EXPECT_TRUE(read.is_scene);
    ASSERT_EQ(read.nodes.size(), 4u);
    EXPECT_EQ(read.nodes[0].name, "child");
    for (int i = 0; i < 3; ++i) {
        const glm::dvec3 place = std::array{glm::dvec3(0), glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0)}[i];
        EXPECT_EQ(read.nodes[i + 1].name, "ball " + std::to_string(i));
        EXPECT_EQ(read.nodes[i + 1].to_world[3], glm::dvec4(place + glm::dvec3(0, 0, 5), 1));
        EXPECT_EQ(read.nodes[i + 1].to_world[0][0], place.x);
    }
    EXPECT_THAT(read.warnings, testing::ElementsAre("values of instances (EXT_mesh_gpu_instancing) were left out."));
    EXPECT_EQ(read.source.json.find("instancing"), std::string::npos) << "each is a node now";
    instanced["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"].erase("SCALE");
    const auto moved =
        meshio::read_mesh_bytes(mesh_files::glb(instanced.dump(), mesh_files::gltf_triangle_data()), "s.glb");
    ASSERT_TRUE(moved) << moved.error().message;
    EXPECT_EQ(moved->mesh.triangles.size(), 4u);
}

TEST(SceneFile, IsAModelWithoutCamerasLightsAndInstances) {
    EXPECT_FALSE(contents(R"({"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]})").is_scene);
    EXPECT_TRUE(contents(R"({"nodes": [{"mesh": 0, "extras": {"unseen": {"background": true}}}]})").is_scene);
    EXPECT_TRUE(contents(std::string(R"({"nodes": [{"mesh": 0},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}}],)") +
                         two_lights + "}")
                    .is_scene);
}

TEST(SceneFile, ReadsCameras) {
    const meshio::SceneContents read = contents(R"({"cameras": [
        {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "zfar": 2, "znear": 1}},
        {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}},
        {"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
        "nodes": [{"camera": 0}, {"rotation": [0, 0.7071067811865476, 0, 0.7071067811865476], "translation": [1, 2, 3],
                   "scale": [2, 2, 2], "children": [2]},
                  {"camera": 1, "name": "eye", "translation": [0, 0, 1]}, {"camera": 2}, {"mesh": 0}]})");
    ASSERT_TRUE(read.camera);
    EXPECT_EQ(read.camera->name, "eye");
    EXPECT_NEAR(glm::length(read.camera->eye - glm::dvec3(3, 2, 3)), 0, 1e-12);
    EXPECT_NEAR(glm::length(read.camera->forward - glm::dvec3(-1, 0, 0)), 0, 1e-12) << "scales do not count";
    EXPECT_NEAR(read.camera->fov_y_degrees, 0.5 * 180 / 3.14159265358979, 1e-9);
    EXPECT_THAT(read.notes, testing::Contains(HasSubstr("the first of its 2 perspective cameras")));
    EXPECT_THAT(read.notes, testing::Contains(HasSubstr("orthographic")));
}

TEST(SceneFile, ReadsLights) {
    const meshio::SceneContents read = contents(std::string(R"({"nodes": [{"mesh": 0},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}, "rotation": [-0.7071067811865476, 0, 0, 0.7071067811865476]},
        {"extensions": {"KHR_lights_punctual": {"light": 1}}, "translation": [0, 4, 0]}],
        "extras": {"unseen": {"exposure": 0.25, "ambient": 0.1}},)") +
                                                two_lights + "}");
    ASSERT_EQ(read.lights.size(), 2u);
    EXPECT_NEAR(read.lights[0].intensity, 3 * (0.2126 + 0.5 * 0.7152), 1e-6) << "its colour counts by its luminance";
    EXPECT_NEAR(glm::length(read.lights[0].direction - glm::dvec3(0, -1, 0)), 0, 1e-12);
    EXPECT_EQ(read.lights[1].kind, meshio::SceneLight::Kind::spot);
    EXPECT_EQ(read.lights[1].position, glm::dvec3(0, 4, 0));
    EXPECT_EQ(read.lights[1].inner_radians, 0.2);
    EXPECT_EQ(read.exposure, 0.25);
    EXPECT_EQ(read.ambient, 0.1);
    EXPECT_THAT(read.notes, testing::Contains(HasSubstr("coloured lights")));
}

TEST(SceneFile, KnowsWhatIsBackground) {
    const meshio::SceneContents read = contents(R"({"nodes": [
        {"mesh": 0, "name": "Background.001"}, {"mesh": 0, "name": "backgrounds"},
        {"name": "walls", "extras": {"unseen": {"background": true}}, "children": [3]}, {"mesh": 0, "name": "north"}]})");
    ASSERT_EQ(read.nodes.size(), 3u);
    EXPECT_TRUE(read.nodes[0].is_background);
    EXPECT_FALSE(read.nodes[1].is_background);
    EXPECT_TRUE(read.nodes[2].is_background) << "what is below is, too";
}

TEST(SceneFile, ReadsMeshesInTheirOwnFrameOrStretched) {
    auto file = require(open(document(R"({"nodes": [{"mesh": 0, "translation": [9, 9, 9]}]})")));
    const auto plain = file->mesh(0);
    ASSERT_TRUE(plain && *plain);
    const std::vector<glm::dvec3> own = (*plain)->mesh.positions;
    const auto stretched = file->mesh(0, glm::dmat3(2, 0, 0, 0, 1, 0, 0, 0, -1));
    ASSERT_TRUE(stretched && *stretched);
    for (std::size_t v = 0; v < own.size(); ++v)
        EXPECT_EQ((*stretched)->mesh.positions[v], glm::dvec3(2, 1, -1) * own[v]);
    EXPECT_NE((*stretched)->mesh.triangles, (*plain)->mesh.triangles) << "mirror images are turned inside out again";
    EXPECT_EQ((*plain)->document->parts.size(), 1u);
    EXPECT_EQ(json::parse((*plain)->document->json)["meshes"].size(), 1u);
}

TEST(SceneFile, LeavesOutMeshesOfLines) {
    json lines = document(R"({"nodes": [{"mesh": 0}]})");
    lines["meshes"][0]["primitives"][0]["mode"] = 1;
    auto file = require(open(lines));
    EXPECT_FALSE(*require(file->mesh(0)));
}

TEST(SceneFile, KeepsOfAMeshsDocumentWhatItUses) {
    auto file = require(open(document(R"({"nodes": [{"mesh": 0}], "meshes": [{"primitives": [
        {"attributes": {"POSITION": 0}, "indices": 1, "material": 1}]}],
        "images": [{"uri": "a.png"}, {"uri": "b.png"}], "textures": [{"source": 0}, {"source": 1}],
        "materials": [{"name": "unused", "normalTexture": {"index": 0}},
                      {"name": "used", "normalTexture": {"index": 1}}]})")));
    const auto read = file->mesh(0);
    ASSERT_TRUE(read && *read) << (read ? "no mesh" : read.error().message);
    const json kept = json::parse((*read)->document->json);
    EXPECT_EQ(kept["materials"].size(), 1u);
    EXPECT_EQ(kept["materials"][0]["name"], "used");
    EXPECT_EQ(kept["materials"][0]["normalTexture"]["index"], 0);
    EXPECT_EQ(kept["images"], json::parse(R"([{"uri": "b.png"}])"));
    EXPECT_EQ(json::parse(file->contents().source.json)["materials"].size(), 2u) << "the scene has all of them";
}

TEST(SceneFile, NamesWhatIsWrong) {
    EXPECT_THAT(complaint(R"({"nodes": [{"children": [1]}, {"children": [0]}]})"), HasSubstr("no root"));
    EXPECT_THAT(complaint(R"({"nodes": [{"children": [1]}, {"children": [0]}], "scenes": [{"nodes": [0]}]})"),
                HasSubstr("node 0 is reached twice"));
    EXPECT_THAT(complaint(R"({"nodes": [{"mesh": 7, "name": "x"}]})"), HasSubstr("node 0 uses mesh 7"));
    EXPECT_THAT(complaint(R"({"nodes": [{"children": [9]}], "scenes": [{"nodes": [0]}]})"), HasSubstr("node 9"));
    EXPECT_THAT(complaint(R"({"nodes": [{"camera": 2, "name": "eye"}]})"), HasSubstr("node 0 'eye' uses camera 2"));
    EXPECT_THAT(complaint(R"({"nodes": [{"camera": 0}], "cameras": [null]})"),
                HasSubstr("node 0 uses camera 0, which is no object"));
    EXPECT_EQ(complaint(R"({"nodes": [{"mesh": 0}], "images": [null], "cameras": [null]})"), "");
    EXPECT_THAT(complaint(R"({"nodes": [{"camera": 0}], "cameras": [{"type": "perspective"}]})"), HasSubstr("yfov"));
    EXPECT_THAT(complaint(R"({"nodes": [{"camera": 0}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 4}}]})"),
                HasSubstr("its yfov"));
    EXPECT_THAT(complaint(R"({"nodes": [{"camera": 0, "scale": [0, 0, 0]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1}}]})"),
                HasSubstr("no direction"));
    EXPECT_THAT(complaint(R"({"nodes": [{"name": "lamp", "extensions": {"KHR_lights_punctual": {"light": 0}}}]})"),
                HasSubstr("node 0 'lamp' uses light 0, but there are 0"));
    EXPECT_THAT(complaint(R"({"nodes": [{"extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "area"}]}}})"),
                HasSubstr("directional, point nor spot"));
    EXPECT_THAT(complaint(R"({"nodes": [{"extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": -1}]}}})"),
                HasSubstr("its intensity"));
    EXPECT_THAT(complaint(R"({"nodes": [{"extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "spot", "spot": {"innerConeAngle": 1, "outerConeAngle": 0.5}}]}}})"),
                HasSubstr("innerConeAngle"));
    EXPECT_THAT(complaint(R"({"nodes": [{"mesh": 0, "scale": [1e200, 1, 1], "name": "vast", "children": [1]},
        {"mesh": 0, "scale": [1e200, 1, 1]}]})"),
                HasSubstr("node 1: its transform, with those above it, is NaN or infinite"));
    EXPECT_THAT(complaint(R"({"nodes": [{"mesh": 0, "extras": {"unseen": {"background": "yes"}}}]})"),
                HasSubstr("extras.unseen.background"));
    EXPECT_THAT(complaint(R"({"nodes": [{"mesh": 0}], "extras": {"unseen": {"exposure": 0}}})"), HasSubstr("exposure"));
    EXPECT_THAT(complaint(R"({"nodes": [{"mesh": 0}], "extensionsRequired": ["KHR_draco_mesh_compression"]})"),
                HasSubstr("needs the extension KHR_draco_mesh_compression, which is not read; export it without"));
    EXPECT_THAT(complaint(R"({"nodes": [{"mesh": 0}], "extensionsRequired": ["VENDOR_magic"]})"),
                HasSubstr("VENDOR_magic"));
    EXPECT_THAT(complaint(R"({"nodes": [{"mesh": 0}], "buffers": [{"byteLength": 42, "uri": "gone.bin"}]})"),
                HasSubstr("buffer 0"));
    EXPECT_THAT(complaint(R"({"nodes": [{"mesh": 0}], "buffers": [{"byteLength": 99999999999}]})"),
                HasSubstr("buffer 0 claims"));
    json broken = document(R"({"nodes": [{"mesh": 0}]})");
    broken["meshes"][0]["name"] = "sail";
    broken["meshes"][0]["primitives"][0]["indices"] = 0;
    auto file = require(open(broken));
    EXPECT_THAT(error_in(file->mesh(0)), HasSubstr("mesh 0 'sail'"));
}

TEST(SceneFile, MayHoldNothing) {
    const meshio::SceneContents read =
        contents(R"({"nodes": [{"camera": 0}], "cameras": [{"type": "perspective", "perspective": {"yfov": 1}}]})");
    EXPECT_THAT(read.nodes, IsEmpty());
    EXPECT_TRUE(read.is_scene);
}

// Reads all of it, as a session does.
void read_all(const std::string& bytes) {
    meshio::ReadOptions options;
    options.drop = {true, true, true, true};
    auto file = meshio::SceneFile::from_bytes(bytes, "s.glb", options);
    if (!file) {
        EXPECT_FALSE(file.error().message.empty());
        return;
    }
    std::set<std::int32_t> meshes;
    for (const meshio::SceneNode& node : file->contents().nodes) meshes.insert(node.mesh);
    for (const std::int32_t mesh : meshes) {
        const auto read = file->mesh(static_cast<std::size_t>(mesh));
        if (!read || !*read) continue;
        EXPECT_TRUE(vdtree::validate((*read)->mesh.view()));
    }
}

TEST(SceneFile, SurvivesMutatedFiles) {
    const std::string good =
        mesh_files::glb(document(std::string(R"({"nodes": [{"mesh": 0, "name": "a", "children": [1, 2]},
            {"mesh": 0, "scale": [2, 1, -1], "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"camera": 0, "rotation": [0, 1, 0, 0], "extensions": {"KHR_lights_punctual": {"light": 1}}}],
            "scenes": [{"nodes": [0]}], "extras": {"unseen": {"exposure": 1}},
            "cameras": [{"type": "perspective", "perspective": {"yfov": 1}}],
            "materials": [{"normalTexture": {"index": 0}}], "textures": [{"source": 0}], "images": [{"bufferView": 0}],)") +
                                 two_lights + "}")
                            .dump(),
                        mesh_files::gltf_triangle_data());
    read_all(good);
    constexpr unsigned seed = 20260;
    std::mt19937 random(seed);
    constexpr std::string_view digits = "0123456789-.eE[]{},:\"";
    for (int i = 0; i < 6000; ++i) {
        std::string bad = good;
        const int changes = 1 + static_cast<int>(random() % 4);
        for (int k = 0; k < changes; ++k) {
            const std::size_t at = random() % bad.size();
            switch (random() % 4) {
            case 0: bad[at] = static_cast<char>(random()); break;
            case 1: bad[at] = digits[random() % digits.size()]; break;
            case 2: bad.erase(at, 1 + random() % 3); break;
            default: bad.insert(at, 1, digits[random() % digits.size()]); break;
            }
        }
        // The header's length is that of the file again, so that the parser is reached.
        for (std::size_t b = 0; b < 4 && bad.size() > 12; ++b)
            bad[8 + b] = static_cast<char>(bad.size() >> (8 * b) & 0xFF);
        read_all(bad);
    }
}

} // namespace scene_file_test
