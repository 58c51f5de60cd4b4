// Textures from files to pictures: OBJ with MTL, glTF with images in it and beside it, PNG and JPEG; and what is said
// of bad ones.
#include "run_command.h"

#include <unseen/perception/image.h>

#include "jpeg_file.h"
#include "tree_file.h"

namespace texture_command_test {

using namespace unseen::app::testing;
using unseen::perception::Image;
using unseen::perception::read_image;
using unseen::support::jpeg;

class TextureCommandTest : public CommandTest {
protected:
    // A square of n x n cells in z = 0 with the image once over it, `more` before its faces.
    std::string square(int n, const std::string& more) const {
        std::ostringstream obj;
        for (int i = 0; i <= n; ++i)
            for (int k = 0; k <= n; ++k)
                obj << "v " << k / static_cast<double>(n) << ' ' << i / static_cast<double>(n) << " 0\nvt "
                    << k / static_cast<double>(n) << ' ' << i / static_cast<double>(n) << '\n';
        obj << more;
        const auto corner = [&](int i, int k) {
            const std::string number = std::to_string(i * (n + 1) + k + 1);
            return ' ' + number + '/' + number;
        };
        for (int i = 0; i < n; ++i)
            for (int k = 0; k < n; ++k)
                obj << "f" << corner(i, k) << corner(i, k + 1) << corner(i + 1, k + 1) << corner(i + 1, k) << '\n';
        return obj.str();
    }
    void write_square(const std::string& image) const {
        write_text(path("square.obj"), square(8, "mtllib square.mtl\nusemtl paint\n"));
        write_text(path("square.mtl"), "newmtl paint\nKd 1 1 1\nmap_Kd " + image + "\n");
    }
    // Black below and white above.
    Image halves(int size = 16) const {
        Image image{size, size, 3, {}};
        for (int y = 0; y < size; ++y)
            for (int x = 0; x < 3 * size; ++x) image.values.push_back(y < size / 2 ? 1.0f : 0.0f);
        return image;
    }
    void write_png(const std::string& name, const Image& image) const {
        const auto written = require(unseen::perception::write_image(path(name), image));
    }
    // Pictures are drawn as they are, without light.
    Json build(const std::string& mesh, Words more = {}) const {
        const Outcome outcome = succeed(joined({"build", mesh, "-o", "t.vdt", "--prelit", "--json", "-"}, more));
        succeed({"info", "t.vdt", "--verify"});
        return outcome.json();
    }
    // The luminance in cd/m2 of the pictures' upper and lower halves; empty where nothing can be drawn.
    std::optional<std::pair<float, float>> draw(const std::string& model, Words more = {},
                                                Json* report = nullptr) const {
        const Outcome outcome = run(joined(
            {"render", model, "-o", "p.pfm", "--size", "64x64", "--fill", "1.2", "--samples", "4", "--json", "-"},
            more));
        if (outcome.err.find("No OpenGL") != std::string::npos) return std::nullopt;
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        if (report) *report = outcome.json();
        const auto picture = require(read_image(path("p.pfm")));
        const Image luminance = unseen::perception::to_luminance(*picture, {});
        return std::pair(luminance.at(32, 24), luminance.at(32, 40));
    }
    std::string complaint(const Words& words) const {
        const Outcome outcome = run(words);
        EXPECT_NE(outcome.status, 0) << outcome.out;
        EXPECT_THAT(outcome.err, IsAnErrorForPeople());
        return outcome.err;
    }
};

TEST_F(TextureCommandTest, OfObjectsWithMaterialsAreDrawnTheRightWayUp) {
    for (const std::string image : {"a picture.png", "picture.jpg"}) {
        if (image.ends_with(".png")) write_png(image, halves());
        else write_text(path(image), jpeg(halves()));
        write_square(image);
        const Json report = build("square.obj");
        EXPECT_EQ(report["texture"]["width"], 16) << report;
        Json drawn;
        if (const auto seen = draw("t.vdt", {}, &drawn)) {
            EXPECT_GT(seen->first, 95);
            EXPECT_LT(seen->second, 2);
            EXPECT_TRUE(effect_named(drawn, "texture")["on"].get<bool>());
            EXPECT_THAT(effect_named(drawn, "texture")["why"].get<std::string>(), HasSubstr("what they change of it"));
        }
    }
}

TEST_F(TextureCommandTest, CanBeLeftOutOrReplaced) {
    write_png("p.png", halves());
    write_square("p.png");
    EXPECT_TRUE(build("square.obj", {"--no-texture"})["texture"].is_null());
    write_png("grey.png", Image{1, 1, 1, {0.5f}});
    EXPECT_EQ(build("square.obj", {"--texture", "grey.png"})["texture"]["width"], 1);
    if (const auto seen = draw("t.vdt")) EXPECT_NEAR(seen->first, seen->second, 0.1);
    build("square.obj");
    Json drawn;
    if (const auto seen = draw("t.vdt", {"--no-texture"}, &drawn)) {
        EXPECT_NEAR(seen->first, seen->second, 0.1);
        EXPECT_FALSE(effect_named(drawn, "texture")["on"].get<bool>());
        EXPECT_THAT(effect_named(drawn, "texture")["why"].get<std::string>(), HasSubstr("--texture none"));
    }
    EXPECT_THAT(complaint({"render", "t.vdt", "-o", "x.png", "--texture", "grey.png"}), HasSubstr("unseen build"));
    EXPECT_THAT(run({"build", "square.obj", "-o", "x.vdt", "--texture", "grey.png", "--no-texture"}),
                fails(2, HasSubstr("--texture and --no-texture exclude each other")));
}

TEST_F(TextureCommandTest, OfSeveralMaterialsBecomeOne) {
    write_png("p.png", halves());
    Image green{2, 2, 3, {}};
    for (int i = 0; i < 4; ++i) green.values.insert(green.values.end(), {0.0f, 1.0f, 0.0f});
    write_png("green.png", green);
    // The lower half by one material, the upper by the other, and a corner by a third without an image.
    std::string obj = square(4, "mtllib m.mtl\nusemtl striped\n");
    std::size_t at = 0;
    for (int face = 0; face < 9; ++face) at = obj.find("\nf ", at + 1);
    obj.insert(at + 1, "usemtl green\n");
    for (int face = 0; face < 8; ++face) at = obj.find("\nf ", at + 1);
    obj.insert(at + 1, "usemtl plain\n");
    write_text(path("m.obj"), obj);
    write_text(path("m.mtl"),
               "newmtl striped\nmap_Kd -clamp on p.png\nnewmtl green\nmap_Kd green.png\nnewmtl plain\nKd 0 0 1\n");
    EXPECT_GT(build("m.obj")["texture"]["width"].get<int>(), 16);
    if (const auto seen = draw("t.vdt", {"--full"})) {
        EXPECT_NEAR(seen->first, 0.5 + 99.5 * 0.7152, 1);
        EXPECT_LT(seen->second, 2); // the picture's lower half
    }
}

std::string base64(const std::string& bytes) {
    const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        unsigned word = 0;
        for (std::size_t k = 0; k < 3; ++k)
            word = word << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
        for (std::size_t k = 0; k < 4; ++k) out += i + k > bytes.size() ? '=' : digits[word >> (18 - 6 * k) & 63];
    }
    return out;
}

TEST_F(TextureCommandTest, OfGltfAreFoundInTheFileAndBesideIt) {
    write_png("p.png", halves());
    // Two triangles; v runs downward.
    const float values[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 1, 1, 1, 1, 0, 0, 0};
    const unsigned short corners[] = {0, 1, 2, 0, 2, 3};
    std::string buffer(reinterpret_cast<const char*>(values), sizeof values);
    buffer.append(reinterpret_cast<const char*>(corners), sizeof corners);
    const std::string png = read_text(path("p.png"));
    const std::size_t image_at = buffer.size();
    buffer += png;
    const auto document = [&](const Json& image, const Json& factor) {
        return Json{
            {"asset", {{"version", "2.0"}}},
            {"buffers",
             {{{"byteLength", buffer.size()}, {"uri", "data:application/octet-stream;base64," + base64(buffer)}}}},
            {"bufferViews",
             {{{"buffer", 0}, {"byteLength", 48}},
              {{"buffer", 0}, {"byteOffset", 48}, {"byteLength", 32}},
              {{"buffer", 0}, {"byteOffset", 80}, {"byteLength", 12}},
              {{"buffer", 0}, {"byteOffset", image_at}, {"byteLength", png.size()}}}},
            {"accessors",
             {{{"bufferView", 0}, {"componentType", 5126}, {"count", 4}, {"type", "VEC3"}},
              {{"bufferView", 1}, {"componentType", 5126}, {"count", 4}, {"type", "VEC2"}},
              {{"bufferView", 2}, {"componentType", 5123}, {"count", 6}, {"type", "SCALAR"}}}},
            {"images", {image}},
            {"textures", {{{"source", 0}}}},
            {"materials",
             {{{"pbrMetallicRoughness", {{"baseColorFactor", factor}, {"baseColorTexture", {{"index", 0}}}}}}}},
            {"meshes",
             {{{"primitives",
                {{{"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}}, {"indices", 2}, {"material", 0}}}}}}},
            {"nodes", {{{"mesh", 0}}}},
            {"scenes", {{{"nodes", {0}}}}}};
    };
    const Json white = {1, 1, 1, 1}, half = {0.5, 0.5, 0.5, 1};
    for (const Json& image : {Json{{"uri", "p.png"}}, Json{{"bufferView", 3}, {"mimeType", "image/png"}},
                              Json{{"uri", "data:image/png;base64," + base64(png)}}}) {
        for (const bool is_dark : {false, true}) {
            write_text(path("q.gltf"), document(image, is_dark ? half : white).dump());
            EXPECT_EQ(build("q.gltf")["texture"]["height"], 16);
            if (const auto seen = draw("t.vdt", {"--full"})) {
                EXPECT_NEAR(seen->first, 0.5 + 99.5 * (is_dark ? 0.5 : 1.0), 1);
                EXPECT_LT(seen->second, 2);
            }
        }
    }
    const auto warning_of = [&](const Json& changed) {
        write_text(path("bad.gltf"), changed.dump());
        const Outcome outcome = succeed({"build", "bad.gltf", "-o", "x.vdt"});
        return outcome.err;
    };
    EXPECT_THAT(warning_of(document({{"uri", "nowhere.png"}}, white)),
                AllOf(HasSubstr("nowhere.png"), HasSubstr("--texture FOLDER")));
    EXPECT_THAT(warning_of(document({{"uri", "../p.png"}}, white)), HasSubstr("outside of the mesh's folder"));
    EXPECT_THAT(warning_of(document({{"bufferView", 9}}, white)), HasSubstr("there are 4 bufferViews"));
    EXPECT_THAT(warning_of(document({{"bufferView", 2}}, white)), HasSubstr("image of material"));
    EXPECT_THAT(warning_of(document({{"uri", "p.png"}}, {1, 2, 3, 4})), HasSubstr("baseColorFactor"));
    Json far_set = document({{"uri", "p.png"}}, white);
    far_set["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = 8;
    EXPECT_THAT(warning_of(far_set), HasSubstr("0 to 7"));
}

// Without its image a mesh is drawn in its colour; each run warns, those that read the tree from the cache, too.
TEST_F(TextureCommandTest, BadImagesAreNamed) {
    write_png("p.png", halves(64));
    const std::string png = read_text(path("p.png")), whole = jpeg(halves(64));
    // The height and width in the frame's header.
    const std::size_t frame = whole.find("\xFF\xC0");
    ASSERT_NE(frame, std::string::npos);
    std::string huge = whole, huger = whole;
    for (std::size_t i = 5; i < 9; ++i) huge[frame + i] = '\x3f', huger[frame + i] = '\x4f'; // 20,303
    const std::string pfm = "Pf\n1 1\n-1.0\n";
    struct {
        std::string name, bytes, warning;
    } const images[] = {{"missing.png", "", "'missing.png' is neither beside"},
                        {"empty.png", "", "is empty"},
                        {"text.png", "hello", "text.png: is neither PNG"},
                        {"cut.png", png.substr(0, png.size() / 2), "damaged PNG"},
                        {"cut3.jpg", whole.substr(0, 3), "damaged JPEG"},
                        {"cut40.jpg", whole.substr(0, 40), "damaged JPEG"},
                        {"cut.jpg", whole.substr(0, whole.size() - 40), "damaged JPEG"},
                        {"huge.jpg", huge, "cannot hold"},
                        {"huger.jpg", huger, "scale it down"},
                        {"nan.pfm", pfm + std::string("\x00\x00\xc0\x7f", 4), "not a finite number"},
                        {"two.pfm", pfm + std::string("\x00\x00\x00\x40", 4), "values from 0 to 1"},
                        {"../p.png", "", "outside of the mesh's folder"}};
    for (const auto& image : images) {
        if (image.name != "missing.png" && image.name != "../p.png") write_text(path(image.name), image.bytes);
        write_square(image.name);
        for (const int time : {1, 2}) {
            const Outcome outcome = succeed({"simplify", "square.obj", "-o", "x.ply"});
            EXPECT_THAT(outcome.err, AllOf(HasSubstr(image.warning),
                                           HasSubstr("drawn without an image of the material"), HasSubstr("--texture")))
                << time;
        }
        EXPECT_THAT(complaint({"build", "square.obj", "-o", "x.vdt", "--texture", image.name}), HasSubstr(image.name));
    }
    EXPECT_EQ(run({"build", "square.obj", "-o", "x.vdt", "--no-texture"}).err.find("image of the material"),
              std::string::npos);
}

TEST_F(TextureCommandTest, BadCoordinatesAreNamed) {
    write_png("p.png", halves());
    write_text(path("none.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    EXPECT_THAT(complaint({"build", "none.obj", "-o", "x.vdt", "--texture", "p.png"}),
                HasSubstr("no texture coordinates"));
    write_text(path("nan.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt nan 0\nvt 1 1\nf 1/1 2/2 3/3\n");
    EXPECT_THAT(succeed({"build", "nan.obj", "-o", "x.vdt", "--texture", "p.png"}).err,
                HasSubstr("1 texture coordinate was not finite"));
    write_text(path("normals.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvn nan 0 1\nf 1//1 2//2 3//2\n");
    EXPECT_THAT(succeed({"simplify", "normals.obj", "-o", "x.obj"}).err, HasSubstr("normal"));
    EXPECT_EQ(read_text(path("x.obj")).find("nan"), std::string::npos);
}

TEST_F(TextureCommandTest, MissingMaterialsAreNoted) {
    write_text(path("square.obj"), square(4, "mtllib nowhere.mtl\nusemtl paint\n"));
    EXPECT_THAT(succeed({"build", "square.obj", "-o", "t.vdt"}).err, HasSubstr("nowhere.mtl"));
}

TEST_F(TextureCommandTest, WhatCannotFollowThemSaysSo) {
    write_png("p.png", halves());
    write_square("p.png");
    build("square.obj");
    write_text(path("l.json"), R"({"ambient": 0.1, "lights": [{"type": "headlight", "intensity": 0.5}]})");
    if (const auto seen = draw("t.vdt", {"--lights", "l.json", "--full"})) {
        EXPECT_NEAR(seen->first, 0.5 + 99.5 * 0.6, 1);
        EXPECT_LT(seen->second, 2);
    }
    EXPECT_EQ(run({"simplify", "t.vdt", "-o", "lit.obj", "--lights", "l.json"}).status, 0)
        << "a test that knows both is found";
}

TEST_F(TextureCommandTest, AreMeasuredWithWhatFoldsChange) {
    write_png("p.png", halves());
    write_square("p.png");
    const Json built = build("square.obj", {"--lit-fold-errors"});
    EXPECT_TRUE(built["fold_errors"].get<bool>());
    EXPECT_TRUE(built["lit_fold_errors"].get<bool>());
    write_text(path("l.json"), R"({"lights": [{"type": "directional", "direction": [0, 0, 1], "intensity": 0.8}]})");
    for (const Words& lights : {Words{}, {"--lights", "l.json"}}) {
        const Outcome cut = succeed(joined({"simplify", "t.vdt", "-o", "x.obj", "--json", "-"}, lights));
        EXPECT_THAT(effect_named(cut.json(), "fold test")["why"].get<std::string>(), StartsWith("error:"));
        EXPECT_THAT(effect_named(cut.json(), "texture")["why"].get<std::string>(), HasSubstr("what they change of it"));
    }
}

TEST_F(TextureCommandTest, HoldFoldsBackWhereTheyWouldMove) {
    write_png("p.png", halves());
    write_square("p.png");
    build("square.obj");
    // Half black and half white: only folds within a half are free.
    const Outcome cut =
        succeed({"simplify", "t.vdt", "-o", "x.obj", "--fold-test", "luebke-hallen-safe", "--json", "-"});
    EXPECT_THAT(effect_named(cut.json(), "texture")["why"].get<std::string>(), HasSubstr("how far they move it"));
}

// As large as files are mapped, by a hole at the end: nobody looks at all of them first.
TEST_F(TextureCommandTest, OfDamagedTreesThatAreMappedLeadNobodyAstray) {
    using unseen::support::TreeFile;
    write_png("p.png", halves());
    write_square("p.png");
    const auto write_large = [&](const std::function<void(TreeFile&)>& damage) {
        TreeFile file = TreeFile::parse(read_text(path("t.vdt")));
        damage(file);
        std::string bytes = file.bytes();
        constexpr std::uint64_t mapped_bytes = 256 << 20;
        unseen::support::store(bytes, TreeFile::file_bytes_at, mapped_bytes);
        TreeFile::seal(bytes);
        write_text(path("large.vdt"), bytes);
        fs::resize_file(path("large.vdt"), mapped_bytes);
    };
    for (const Words& texture : {Words{}, {"--no-texture"}}) {
        build("square.obj", texture);
        write_large([](TreeFile&) {});
        EXPECT_EQ(run({"simplify", "large.vdt", "-o", "x.obj"}).status, 0);
        EXPECT_EQ(run({"simplify", "large.vdt", "-o", "x.obj", "--fold-test", "luebke-hallen-safe"}).status, 0);
        for (const std::uint32_t parent : {0x40000000u, 0xffffffffu, 0u}) {
            write_large([&](TreeFile& file) {
                const std::size_t interior = file["first_leaf"].count();
                // Far from the root, which is looked at first.
                for (std::size_t node = interior - 3; node < interior + 8; ++node) file["parents"].set(node, parent);
            });
            EXPECT_THAT(complaint({"simplify", "large.vdt", "-o", "x.obj", "--fold-test", "luebke-hallen-safe"}),
                        HasSubstr("large.vdt: Node "));
            EXPECT_THAT(complaint({"simplify", "large.vdt", "-o", "x.obj"}), HasSubstr("damaged"));
            EXPECT_THAT(complaint({"simplify", "large.vdt", "-o", "x.obj", "--fold-test", "luebke-hallen"}),
                        HasSubstr("damaged"));
            EXPECT_THAT(complaint({"simplify", "large.vdt", "-o", "x.obj", "--light", "1", "0", "0"}),
                        HasSubstr("damaged"));
            EXPECT_THAT(complaint({"info", "large.vdt"}), HasSubstr("Node"));
            EXPECT_THAT(complaint({"render", "large.vdt", "-o", "x.png"}),
                        AnyOf(HasSubstr("damaged"), HasSubstr("No OpenGL")));
            // What asks node by node goes as far as nodes are sound.
            for (const char* const test : {"extent", "displacement"})
                succeed({"simplify", "large.vdt", "-o", "x.obj", "--fold-test", test, "--pixels", "1"});
        }
    }
}

} // namespace texture_command_test
