// What files say of materials: colours, opacity and the names of images; nothing of it is decoded here.

#include <unseen/meshio/mesh_file.h>

#include "mesh_files.h"
#include "temp_folder.h"
#include "testing.h"

namespace unseen::vdtree::materials_test {

class Materials : public testing::Test {
protected:
    void write(const std::string& name, const std::string& text) const {
        std::filesystem::create_directories((folder_ / name).parent_path());
        std::ofstream(folder_ / name, std::ios::binary) << text;
    }
    Result<meshio::ReadResult> read(const std::string& mtl, const std::string& library = "m.mtl",
                                    meshio::ReadOptions options = {}) const {
        write("m.mtl", mtl);
        write("m.obj", "mtllib " + library + "\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
        return meshio::read_mesh(folder_ / "m.obj", options);
    }
    meshio::Material first(const std::string& mtl) const {
        const auto result = require(read(mtl));
        return result->materials.at(0);
    }
    support::TempFolder folder_;
};

TEST_F(Materials, OfObjectsAreRead) {
    const meshio::Material plain = first("# by hand\nKd 0.1 0.1 0.1\nnewmtl a\nKd 1 0 0.5\nillum 2\nd 0.25\n");
    EXPECT_EQ(plain.name, "a");
    EXPECT_NEAR(plain.colour.r, 1, 1e-6);
    EXPECT_NEAR(plain.colour.b, 0.2140411, 1e-5); // decoded from sRGB
    EXPECT_EQ(plain.colour.a, 0.25f);
    EXPECT_FALSE(plain.has_image());
    EXPECT_EQ(first("newmtl a\nTr 0.25\n").colour.a, 0.75f);
    EXPECT_NEAR(first("newmtl a\nKd 0.5\n").colour.g, 0.2140411, 1e-5);
    EXPECT_EQ(first("newmtl a\nKd spectral f.rfl\n").colour, glm::vec4(1));

    for (const char* image : {"my image.png", "textures/p.jpg", "p.png"}) write(image, "a picture");
    EXPECT_EQ(first("newmtl a\nmap_Kd  my image.png \r\n").image, "my image.png");
    const meshio::Material clamped = first("newmtl a\nmap_Kd -blendu on -mm 0 1 -s 2 3 -clamp on textures\\p.jpg\n");
    EXPECT_EQ(clamped.image, "textures/p.jpg");
    EXPECT_EQ(clamped.wrap_u, Wrap::clamp);
    EXPECT_EQ(clamped.wrap_v, Wrap::clamp);
    const auto scaled = require(read("newmtl a\nmap_Kd -s 2 3 4 p.png\n"));
    EXPECT_EQ(scaled->materials[0].image, "p.png");
    ASSERT_EQ(scaled->warnings.size(), 1u);
    EXPECT_NE(scaled->warnings[0].find("'-s' of an image was ignored"), std::string::npos) << scaled->warnings[0];

    // The first of a name counts, and a library that is named twice is read once.
    write("n.mtl", "newmtl a\nKd 0 0 0\nnewmtl b\n");
    const auto several = require(read("newmtl a\nKd 1 1 1\n", "m.mtl n.mtl\nmtllib m.mtl"));
    ASSERT_EQ(several->materials.size(), 2u);
    EXPECT_EQ(several->materials[0].colour, glm::vec4(1));
    EXPECT_EQ(several->materials[1].name, "b");
}

TEST_F(Materials, ThatCannotBeReadAreNoted) {
    const std::pair<std::string, std::string> odd[] = {
        {"newmtl a\nKd 1 2 1\n", "m.mtl: line 2: values of material 'a' beyond 0..1 were clamped"},
        {"newmtl a\nKd 1 nan 1\n", "the colour of material 'a' should be 3 numbers, not '1 nan 1'"},
        {"newmtl a\nKd\n", "should be 3 numbers"},
        {"newmtl a\nd x\n", "the opacity of material 'a' should be a number"},
        {"newmtl a\nmap_Kd -clamp on\n", "names no image"},
        {"newmtl a\nmap_Kd ../p.png\n", "outside of the mesh's folder"},
        {"newmtl a\nmap_Kd /etc/p.png\n", "outside of the mesh's folder"},
        {"newmtl a\nmap_Kd C:\\p.png\n", "outside of the mesh's folder"},
        {"newmtl a\nmap_Kd http://a/p.png\n", "outside of the mesh's folder"},
        {"newmtl a\nmap_Kd x/../../p.png\n", "outside of the mesh's folder"},
        {std::string("newmtl a\nKd 1 1 1\0\n", 20), "should be 3 numbers"}};
    for (const auto& [mtl, warning] : odd) {
        const auto result = require(read(mtl));
        ASSERT_EQ(result->warnings.size(), 1u) << mtl;
        EXPECT_NE(result->warnings[0].find(warning), std::string::npos) << result->warnings[0];
        EXPECT_FALSE(result->materials.at(0).has_image());
    }
    for (const char* library : {"nowhere.mtl", "../m.mtl", ""}) {
        const auto result = require(read("newmtl a\n", library));
        EXPECT_TRUE(result->materials.empty());
        EXPECT_EQ(result->warnings.size(), *library ? 1u : 0u);
    }
    const auto other = require(read("newmtl other\n"));
    ASSERT_EQ(other->warnings.size(), 1u);
    EXPECT_NE(other->warnings[0].find("1 material is in no library that was read, the first 'a'"), std::string::npos)
        << other->warnings[0];
    meshio::ReadOptions without;
    without.images = false;
    const auto result = require(read("newmtl a\nKd 0 0 0\nmap_Kd ../p.png\n", "m.mtl", without));
    EXPECT_FALSE(result->materials.at(0).has_image());
}

// A file of many materials over one image, or over many images of one buffer view, is not much larger when it has been
// read.
TEST_F(Materials, OfGltfShareTheirImage) {
    constexpr int count = 200;
    const std::string picture(1 << 20, 'x');
    const auto glb = [&](bool has_one_image) {
        std::string primitives, materials, textures, images;
        for (int i = 0; i < count; ++i) {
            const std::string comma = i > 0 ? "," : "", number = std::to_string(i);
            primitives += comma + R"({"attributes":{"POSITION":0},"indices":1,"material":)" + number + "}";
            materials +=
                comma + R"({"name":"same","pbrMetallicRoughness":{"baseColorTexture":{"index":)" + number + "}}}";
            textures += comma + R"({"source":)" + (has_one_image ? "0" : number) + "}";
            if (i == 0 || !has_one_image) images += comma + R"({"bufferView":2,"mimeType":"image/png"})";
        }
        return mesh_files::glb(
            R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
            R"("meshes":[{"primitives":[)" +
                primitives + R"(]}],"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},)" +
                R"({"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],)"
                R"("bufferViews":[{"buffer":0,"byteLength":36},)" +
                R"({"buffer":0,"byteOffset":36,"byteLength":6},{"buffer":0,"byteOffset":44,"byteLength":1048576}],)"
                R"("buffers":[)" +
                R"({"byteLength":1048620}],"materials":[)" + materials + R"(],"textures":[)" + textures +
                R"(],"images":[)" + images + "]}",
            mesh_files::gltf_triangle_data() + "  " + picture);
    };
    write("one.glb", glb(true));
    const auto one = require(meshio::read_mesh(folder_ / "one.glb"));
    ASSERT_EQ(one->materials.size(), std::size_t{count});
    write("many.glb", glb(false));
    const auto many = require(meshio::read_mesh(folder_ / "many.glb"));
    for (const auto* read : {&*one, &*many}) {
        ASSERT_TRUE(read->materials[0].image_bytes);
        EXPECT_EQ(*read->materials[0].image_bytes, picture);
        for (const meshio::Material& material : read->materials)
            EXPECT_EQ(material.image_bytes, read->materials[0].image_bytes);
    }
    EXPECT_EQ(one->materials[0].name, "same");
    EXPECT_EQ(one->materials[7].name, "same (material 7)");
}

} // namespace unseen::vdtree::materials_test
