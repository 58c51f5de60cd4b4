// Files as people have them: what does not decide the shape is a warning that says what is lost, and the rest is read;
// what decides it is an error that says what to do.

#include <nlohmann/json.hpp>

#include <unseen/meshio/mesh_file.h>
#include <unseen/vdtree/builder.h>

#include "mesh_files.h"
#include "mesh_readers.h"
#include "temp_folder.h"
#include "testing.h"

namespace unseen::vdtree::flawed_mesh_test {

namespace fs = std::filesystem;
using nlohmann::json;
using Files = std::map<std::string, std::string>;

void write(const fs::path& folder, const Files& files) {
    for (const auto& [name, bytes] : files) {
        fs::create_directories((folder / name).parent_path());
        std::ofstream(folder / name, std::ios::binary) << bytes;
    }
}

std::string in_lines(const std::vector<Message>& sentences) {
    std::string text;
    for (const Message& sentence : sentences) text += sentence + "\n";
    return text;
}

// What nobody decodes here.
const std::string picture = "\x89PNG, a picture", other = "another picture";
const std::string square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
const std::string textured = square + "usemtl m\nf 1/1 2/2 3/3 4/4\n";
const std::string bare = "v 0 0 0\nv 1 0 0\nv 1 1 0\n";
std::string mtl(const std::string& image) { return "newmtl m\nKd 1 0 0\nmap_Kd " + image + "\n"; }

// A triangle with a material whose texture is that; the image is embedded.
std::string glb(const std::string& texture, const std::string& image = R"({"bufferView":2,"mimeType":"image/webp"})",
                const std::string& nodes = R"([{"mesh":0}])", const std::string& rest = "",
                const std::string& look = "{}") {
    const std::string data = mesh_files::gltf_triangle_data() + "  " + picture;
    json document = json::parse(mesh_files::gltf_triangle_json(
        nodes, R"({"byteLength":)" + std::to_string(data.size()) + "}",
        R"(,"materials":[{"name":"m","pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],"textures":[)" +
            texture + R"(],"images":[)" + image + "]" + rest));
    document["materials"][0].update(json::parse(look));
    document["meshes"][0]["primitives"][0]["material"] = 0;
    document["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = 2;
    document["accessors"].push_back({{"bufferView", 0}, {"componentType", 5126}, {"count", 3}, {"type", "VEC2"}});
    document["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 44}, {"byteLength", picture.size()}});
    return mesh_files::glb(document.dump(), data);
}

struct Case {
    std::string what;
    Files files;
    std::string name; // of the mesh
    std::size_t triangles;
    std::vector<std::string> warnings = {}; // parts of them, in their order
    std::string image = {};                 // of the first material
};

const std::vector<Case>& cases() {
    static const std::vector<Case> all = {
        {"an object without a name", {{"a.obj", "o\n" + bare + "f 1 2 3\n"}}, "a.obj", 1},
        {"a material without a name", {{"a.obj", "usemtl\n" + bare + "f 1 2 3\n"}}, "a.obj", 1},
        {"groups end before the first face", {{"a.obj", "o a\ng\n" + bare + "f 1 2 3\n"}}, "a.obj", 1},
        {"a library named ./a.mtl",
         {{"a.obj", "mtllib ./a.mtl\n" + textured}, {"a.mtl", mtl("./x/../t.png")}, {"t.png", picture}},
         "a.obj",
         2,
         {},
         picture},
        {"a library with blanks in its name",
         {{"a.obj", "mtllib my a.mtl\n" + textured}, {"my a.mtl", mtl("my t.png")}, {"my t.png", picture}},
         "a.obj",
         2,
         {},
         picture},
        {"several libraries, in quotes",
         {{"a.obj", "mtllib \"a.mtl\" \"n.mtl\"\n" + textured},
          {"a.mtl", mtl("\"t.png\"")},
          {"n.mtl", "newmtl n\n"},
          {"t.png", picture}},
         "a.obj",
         2,
         {},
         picture},
        {"backslashes",
         {{"a.obj", "mtllib s\\a.mtl\n" + textured}, {"s/a.mtl", mtl("i\\t.png")}, {"s/i/t.png", picture}},
         "a.obj",
         2,
         {},
         picture},
        {"an image beside the library comes before one beside the mesh",
         {{"a.obj", "mtllib s/a.mtl\n" + textured}, {"s/a.mtl", mtl("t.png")}, {"s/t.png", picture}, {"t.png", other}},
         "a.obj",
         2,
         {},
         picture},
        {"an image beside the mesh",
         {{"a.obj", "mtllib s/a.mtl\n" + textured}, {"s/a.mtl", mtl("t.png")}, {"t.png", other}},
         "a.obj",
         2,
         {},
         other},
        {"an image in a folder beside the library's",
         {{"a.obj", "mtllib s/a.mtl\n" + textured}, {"s/a.mtl", mtl("../tex/t.png")}, {"tex/t.png", picture}},
         "a.obj",
         2,
         {},
         picture},
        {"no library", {{"a.obj", "mtllib a.mtl\n" + textured}}, "a.obj", 2, {"left out: 'a.mtl' is neither beside"}},
        {"no image",
         {{"a.obj", "mtllib a.mtl\n" + textured}, {"a.mtl", mtl("gone.png") + "bump gone.png\nnorm n.png\n"}},
         "a.obj",
         2,
         {"2 images were not read, so 2 triangles are drawn without an image of the material; the first: "
          "'gone.png' is neither beside the file that names it nor beside the mesh; read.search_folder",
          "what materials have of bump maps is not drawn: what is said of visibility does not know it."}},
        {"light of its own",
         {{"a.obj", "mtllib a.mtl\n" + textured}, {"a.mtl", "newmtl m\nKe 0 0.5 0\nnewmtl n\nmap_d d.png\n"}},
         "a.obj",
         2,
         {"1 image was not read"}},
        {"black light", {{"a.obj", "mtllib a.mtl\n" + textured}, {"a.mtl", "newmtl m\nKe 0 0 0\n"}}, "a.obj", 2},
        {"an image outside",
         {{"s/a.obj", "mtllib a.mtl\n" + textured}, {"s/a.mtl", mtl("../t.png")}, {"t.png", picture}},
         "s/a.obj",
         2,
         {"'../t.png' is outside of the mesh's folder, where nothing is read; read.search_folder = FOLDER"}},
        {"no coordinates",
         {{"a.obj", "mtllib a.mtl\nusemtl m\n" + bare + "f 1 2 3\n"}, {"a.mtl", mtl("t.png")}, {"t.png", picture}},
         "a.obj",
         1,
         {"1 triangle has an image but no texture coordinates; the colour"},
         picture},
        {"coordinates of some faces",
         {{"a.obj", "mtllib a.mtl\n" + textured + "f 1 2 3 4\n"}, {"a.mtl", mtl("t.png")}, {"t.png", picture}},
         "a.obj",
         4,
         {"2 triangles have an image but no texture coordinates, and shows what is at 0, 0"},
         picture},
        {"numbers of materials that make no sense",
         {{"a.obj", "mtllib a.mtl\n" + textured}, {"a.mtl", "newmtl m\nKd 1 2 0\nd much\nmap_Kd\n"}},
         "a.obj",
         2,
         {"a.mtl: line 2: values of material 'm' beyond 0..1 were clamped; 2 more such lines."}},
        {"normals that are not there",
         {{"a.obj", bare + "f 1//1 2//1 3//1\n"}},
         "a.obj",
         1,
         {"3 corners go without a normal or texture coordinate that is not there, the first normal 1 in line 4"}},
        {"coordinates that are not there",
         {{"a.obj", square + "f 1/1 2/-9 3/0 4/4\n"}},
         "a.obj",
         2,
         {"2 corners go without a normal or texture coordinate that is not there, the first texture coordinate -9"}},
        {"a normal that is no number",
         {{"a.obj", bare + "vn 0 0 -1.#IND\nf 1//1 2//1 3//1\n"}},
         "a.obj",
         1,
         {"3 normals were zero, missing or not finite and computed from the faces, the first that of vertex 0"}},
        {"infinite vertices that no face uses",
         {{"a.obj", bare + "v nan(ind) 1.#QNAN -1.#INF00\nf 1 2 3\n"}},
         "a.obj",
         1,
         {"line 4: vertex 4 has a NaN or infinite coordinate; no face uses it."}},
        {"the same in PLY",
         {{"a.ply", "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
                    "element face 1\nproperty list uchar int vertex_index\nend_header\n"
                    "0 0 0\n1 0 0\n0 1 0\n-1.#IND 1.#INF 0\n3 0 1 2\n"}},
         "a.ply",
         1,
         {"vertex 3 has a NaN or infinite coordinate; no face uses it."}},
        {"ends in two words",
         {{"a.stl",
           "Solid x\nfacet normal 0 0 -1.#IND\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nend loop\n"
           "End Facet\nEND SOLID x\nsolid y\nend solid\n"}},
         "a.stl",
         1,
         {"1 facet normal was not finite"}},
        {"an image of WebP alone",
         {{"a.glb", glb(R"({"extensions":{"EXT_texture_webp":{"source":0}}})")}},
         "a.glb",
         1,
         {"1 image was not read, so 1 triangle is drawn without an image of the material: texture 0 is an image of "
          "the extension EXT_texture_webp, which is not decoded."}},
        {"one of KTX2 that is required",
         {{"a.glb",
           glb(R"({"extensions":{"KHR_texture_basisu":{"source":0}}})", R"({"bufferView":2,"mimeType":"image/ktx2"})",
               R"([{"mesh":0}])", R"(,"extensionsRequired":["KHR_texture_basisu"])")}},
         "a.glb",
         1,
         {"extension KHR_texture_basisu"}},
        {"one of WebP with another to fall back on",
         {{"a.glb", glb(R"({"source":0,"extensions":{"EXT_texture_webp":{"source":0}}})")}},
         "a.glb",
         1,
         {},
         picture},
        {"a texture without an image",
         {{"a.glb", glb("{}")}},
         "a.glb",
         1,
         {"texture 0 has no source; correct the JSON. "
          "Material 'm' is drawn without that."}},
        {"an image that is missing",
         {{"a.glb", glb(R"({"source":0})", R"({"uri":"gone.png"})")}},
         "a.glb",
         1,
         {"image 0: 'gone.png' is neither beside"}},
        {"what nobody draws",
         {{"a.glb", glb(R"({"source":0})", R"({"bufferView":2,"mimeType":"image/png"})", R"([{"mesh":0}])", "", R"(
             {"normalTexture":{"index":0},"emissiveFactor":[1,1,1],"alphaMode":"BLEND","extensions":{
              "KHR_materials_ior":{"ior":1.5},"KHR_materials_clearcoat":{}}})")}},
         "a.glb",
         1,
         {"of KHR_materials_clearcoat is not drawn"},
         picture},
        {"maps with coordinates of their own",
         {{"a.glb", glb(R"({"source":0})", R"({"bufferView":2,"mimeType":"image/png"})", R"([{"mesh":0}])", "", R"(
             {"normalTexture":{"index":0,"texCoord":1},"emissiveFactor":[1,1,1],"emissiveTexture":{"index":0,
              "extensions":{"KHR_texture_transform":{"scale":[2,2]}}}})")}},
         "a.glb",
         1,
         {"of emission with coordinates or a sampler of their own and normal maps with coordinates or a sampler of "
          "their own"},
         picture},
        {"an emission that is no colour",
         {{"a.glb", glb(R"({"source":0})", R"({"bufferView":2,"mimeType":"image/png"})", R"([{"mesh":0}])", "",
                        R"({"emissiveFactor":[1,2,-1],"normalTexture":{"index":0,"scale":"x"}})")}},
         "a.glb",
         1,
         {"material 0: the scale of its normalTexture should be a number; correct it. Material 'm' is drawn without "
          "that.",
          "material 0: its emissiveFactor should be 3 numbers from 0 to 1; correct it. Material 'm' is drawn without "
          "that."},
         picture},
        {"a cut-off that is no number",
         {{"a.glb", glb(R"({"source":0})", R"({"bufferView":2,"mimeType":"image/png"})", R"([{"mesh":0}])", "",
                        R"({"alphaMode":"MASK","alphaCutoff":"x"})")}},
         "a.glb",
         1,
         {"material 0: its alphaCutoff should be a number, 0 or more; correct it. Material 'm' is drawn without "
          "that."}},
        {"an image of nothing",
         {{"a.glb", glb(R"({"source":0})", R"({"bufferView":99})")}},
         "a.glb",
         1,
         {"image 0: its bufferView is 99"}},
    };
    return all;
}

TEST(FlawedMesh, WhatDoesNotDecideTheShapeIsAWarning) {
    for (const Case& c : cases()) {
        SCOPED_TRACE(c.what);
        const support::TempFolder folder;
        write(folder.path(), c.files);
        const auto read = require(meshio::read_mesh(folder / c.name));
        EXPECT_EQ(read->mesh.triangles.size(), c.triangles);
        EXPECT_EQ(read->warnings.size(), c.warnings.size()) << in_lines(read->warnings);
        for (std::size_t i = 0; i < std::min(c.warnings.size(), read->warnings.size()); ++i)
            EXPECT_THAT(read->warnings[i], HasSubstr(c.warnings[i]));
        const auto image = read->materials.empty() ? nullptr : read->materials[0].image_bytes;
        EXPECT_EQ(image ? *image : "", c.image);
    }
}

// All of them, in every format that is written; what lies beside the mesh goes along.
TEST(FlawedMesh, CanBeWrittenAgain) {
    for (const Case& c : cases()) {
        const support::TempFolder folder;
        write(folder.path(), c.files);
        auto read = require(meshio::read_mesh(folder / c.name));
        if (read->document) {
            read->document->vertex_parts.assign(read->mesh.positions.size(), 0);
            read->mesh.document = meshio::pack(*read->document);
        }
        const auto tree = require(build_tree(read->mesh.view()));
        Cut cut(*tree);
        cut.unfold_all();
        for (const std::string& ending : meshio::written_endings()) {
            SCOPED_TRACE(c.what + ", as " + ending);
            fs::create_directory(folder / "out");
            const fs::path out = folder / ("out/out" + ending);
            const auto written = require(meshio::write_cut(out, cut));
            const auto again = require(meshio::read_mesh(out));
            EXPECT_EQ(again->mesh.triangles.size(), c.triangles);
            const bool holds_images = ending == ".obj" || ending == ".glb" || ending == ".gltf";
            if (holds_images && !c.image.empty() && !again->mesh.uvs.empty()) {
                ASSERT_FALSE(again->materials.empty());
                ASSERT_TRUE(again->materials[0].has_image());
                EXPECT_EQ(*again->materials[0].image_bytes, c.image);
            }
            fs::remove_all(folder / "out");
        }
    }
}

// Materials that no light changes make a mesh whose colours are its light.
TEST(FlawedMesh, IsUnlitWhereAllMaterialsAre) {
    for (const bool is_unlit : {false, true}) {
        const support::TempFolder folder;
        write(folder.path(),
              {{"a.glb", glb(R"({"source":0})", R"({"bufferView":2,"mimeType":"image/png"})", R"([{"mesh":0}])", "",
                             is_unlit ? R"({"extensions":{"KHR_materials_unlit":{}}})" : "{}")}});
        const auto read = require(meshio::read_mesh(folder / "a.glb"));
        EXPECT_EQ(read->is_unlit, is_unlit);
        EXPECT_TRUE(read->warnings.empty()) << in_lines(read->warnings);
    }
}

// What lies outside of the mesh's folder is found there, and is written beside what names it.
TEST(FlawedMesh, SearchFolderIsTheWayOut) {
    for (const std::string image :
         {"../tex/t.png", "C:\\Users\\me\\t.png", "/home/me/t.png", "t.png", "http://x.org/t.png"}) {
        SCOPED_TRACE(image);
        const support::TempFolder folder;
        write(folder.path(),
              {{"m/a.obj", "mtllib s/a.mtl\n" + textured}, {"m/s/a.mtl", mtl(image)}, {"tex/t.png", picture}});
        meshio::ReadOptions options;
        options.search_folder = folder / "tex";
        auto read = require(meshio::read_mesh(folder / "m/a.obj", options));
        ASSERT_TRUE(read->warnings.empty()) << in_lines(read->warnings);
        ASSERT_TRUE(read->materials[0].has_image());
        read->document->vertex_parts.assign(read->mesh.positions.size(), 0);
        read->mesh.document = meshio::pack(*read->document);
        const auto tree = require(build_tree(read->mesh.view()));
        Cut cut(*tree);
        cut.unfold_all();
        ASSERT_TRUE(meshio::write_cut(folder / "out/b.obj", cut));
        const auto again = require(meshio::read_mesh(folder / "out/b.obj"));
        EXPECT_TRUE(again->warnings.empty()) << in_lines(again->warnings);
        ASSERT_TRUE(again->materials.at(0).has_image());
        EXPECT_EQ(*again->materials[0].image_bytes, picture);
        EXPECT_TRUE(fs::exists(folder / "out/s/t.png"));
    }
}

TEST(FlawedMesh, ImagesThatNobodyDecodesAreKeptByteForByte) {
    const support::TempFolder folder;
    write(folder.path(), {{"a.glb", glb(R"({"extensions":{"EXT_texture_webp":{"source":0}}})")}});
    const auto read = require(meshio::read_mesh(folder / "a.glb"));
    ASSERT_TRUE(read->document);
    ASSERT_EQ(read->document->files.size(), 1u);
    ASSERT_TRUE(read->document->files[0].bytes);
    EXPECT_EQ(*read->document->files[0].bytes, picture);
}

TEST(FlawedMesh, WhatDecidesTheShapeSaysTheWayOut) {
    const json instanced = {{"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", 7}}}}}}},
                            {"mesh", 0}};
    json draco = json::parse(mesh_files::gltf_triangle_json());
    draco["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", 0}};
    json plain = draco;
    draco["accessors"][0].erase("bufferView");
    struct {
        std::string name, bytes, error;
    } const wrong[] = {
        {"a.obj", bare + "f 1 2 9\n",
         "line 4: face 1 uses vertex 9, but there are 3. Correct it, or leave out the faces concerned with "
         "read.skip_bad"},
        {"a.obj", bare + "v 0 nan 0\nf 1 2 4\n",
         "line 4: vertex 4 has a NaN or infinite coordinate. Correct it, or leave out"},
        {"a.vtk", "# vtk DataFile Version 3.0\n", "save it as .vtp"},
        {"a.glb", mesh_files::glb(draco.dump(), mesh_files::gltf_triangle_data()),
         "mesh 0 is compressed by KHR_draco_mesh_compression, which is not read; export it without"},
        {"a.glb",
         mesh_files::glb(mesh_files::gltf_triangle_json("[" + instanced.dump() + "]"),
                         mesh_files::gltf_triangle_data()),
         "accessor 7 is used, but there are 2"},
    };
    for (const auto& c : wrong)
        EXPECT_THAT(error_in(meshio::read_mesh_bytes(c.bytes, c.name)), HasSubstr(c.error)) << c.error;
    const auto read =
        require(meshio::read_mesh_bytes(mesh_files::glb(plain.dump(), mesh_files::gltf_triangle_data()), "a.glb"));
    EXPECT_TRUE(read->warnings.empty()) << in_lines(read->warnings);
}

} // namespace unseen::vdtree::flawed_mesh_test
