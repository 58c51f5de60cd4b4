// glTF files of other programs: what comes out of `unseen simplify` is what went in, but for triangles.
#include "exported_gltf.h"
#include "gltf_scene.h"
#include "painted_file.h"

namespace gltf_test {

using namespace unseen::app::testing;
using ::testing::HasSubstr;
using unseen::support::GltfContents;
using unseen::support::read_gltf;
using unseen::support::ValueBox;

using Uv = std::array<double, 2>;

class GltfUsers : public PaintedFileTest {
protected:
    // Names, materials, images, attributes; and how far the texture coordinates and colours of each part reach. Those
    // of what is left of a part lie within those of the part.
    void expect_the_same_but_triangles(const std::string& in_file, const std::string& out_file, bool is_whole) const {
        const GltfContents in = read_gltf(path(in_file)), out = read_gltf(path(out_file));
        EXPECT_EQ(in.rest, out.rest) << nlohmann::json::diff(in.rest, out.rest);
        EXPECT_EQ(in.images, out.images);
        EXPECT_EQ(in.attributes, out.attributes);
        for (const auto& [part, boxes] : in.boxes)
            for (const auto& [attribute, box] : boxes) {
                SCOPED_TRACE(part + " " + attribute);
                ASSERT_TRUE(out.boxes.contains(part));
                const ValueBox& left = out.boxes.at(part).at(attribute);
                for (std::size_t k = 0; k < box.lo.size(); ++k) {
                    const float size = box.hi[k] - box.lo[k], rounding = 1e-5f * (1 + size);
                    const float slack = is_whole ? rounding : 0.05f * size + rounding;
                    EXPECT_NEAR(box.lo[k], left.lo[k], slack);
                    EXPECT_NEAR(box.hi[k], left.hi[k], slack);
                    const bool is_place = attribute == "POSITION" || attribute == "NORMAL"; // proxies may lie outside
                    if (is_place) continue;
                    // Coordinates continue beyond a chart's border where its outline is drawn straight.
                    const float beyond = is_whole || !attribute.starts_with("TEXCOORD") ? rounding : 0.02f * size;
                    EXPECT_GE(left.lo[k], box.lo[k] - beyond);
                    EXPECT_LE(left.hi[k], box.hi[k] + beyond);
                }
            }
    }
    // Of what nobody sees gone, of a copy, and of something rougher.
    void expect_all_the_same_but_triangles(const std::string& in, const std::string& ending) const {
        expect_the_same_but_triangles(in, "out/small." + ending, false);
        expect_the_same_but_triangles(in, "out/whole." + ending, true);
        const Simplified rough = simplify(in, "out/rough." + ending, {"--triangles", "60%"});
        EXPECT_LT(rough.report["triangles"], rough.report["source_triangles"]);
        expect_the_same_but_triangles(in, "out/rough." + ending, false);
    }
};

// Several meshes under nodes that turn, scale and move; images in the file, repeated; factors; colours of vertices.
TEST_F(GltfUsers, ATexturedSceneInOneFile) {
    ExportedGltf file;
    const Patch floor(30, 30, hills), ball(40, 20, ball_at), shade(24, 16, ball_at);
    const auto tiled = file.add(floor, [](Uv uv) { return Uv{3 * uv[0] - 1, 2 - 3 * uv[1]}; });
    const auto glazed = file.add(ball, [](Uv uv) { return Uv{2 * uv[0], 1 - uv[1]}; });
    const auto shaded = file.add(
        shade, [](Uv uv) { return uv; },
        [](Uv uv) {
            return std::array{255, static_cast<int>(100 + 150 * uv[1]), 120, 255};
        });
    file.add_image(tiles());
    file.add_image(glaze());
    file.document.update(Json::parse(R"({
        "scenes": [{"name": "Scene", "nodes": [0]}],
        "nodes": [
            {"name": "House", "rotation": [0, 0.130526, 0, 0.991445], "children": [1, 2, 3], "extras": {"id": 7}},
            {"name": "Floor", "mesh": 0, "scale": [1.5, 1.25, 1]},
            {"name": "Vase", "mesh": 1, "scale": [0.4, 0.6, 0.4], "translation": [-0.5, -0.1, 0.6],
             "rotation": [0.2588190, 0, 0, 0.9659258]},
            {"name": "Lamp", "mesh": 2, "matrix": [0.4, 0, 0, 0, 0, 0.3, 0, 0, 0, 0, 0.4, 0, 0.7, 0.2, 0.5, 1]}],
        "samplers": [{"magFilter": 9729, "minFilter": 9987}],
        "textures": [{"sampler": 0, "source": 0}, {"sampler": 0, "source": 1}],
        "materials": [
            {"name": "Tiles", "doubleSided": true,
             "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 0.875, 0.75, 1],
                                      "metallicFactor": 0, "roughnessFactor": 0.5}},
            {"name": "Glaze",
             "pbrMetallicRoughness": {"baseColorTexture": {"index": 1}, "baseColorFactor": [0.5, 0.75, 1, 1]}},
            {"name": "Shade", "emissiveFactor": [0.25, 0.25, 0],
             "pbrMetallicRoughness": {"baseColorFactor": [0.75, 0.75, 0.5, 1]}}]})"));
    file.document["meshes"] = {{{"name", "Floor mesh"}, {"primitives", {primitive(tiled, 0)}}},
                               {{"name", "Vase mesh"}, {"primitives", {primitive(glazed, 1)}}},
                               {{"name", "Lamp mesh"}, {"primitives", {primitive(shaded, 2)}}}};
    write_text(path("house.glb"), file.glb());
    expect_invisible("house.glb", "glb");
    expect_all_the_same_but_triangles("house.glb", "glb");
}

// Data and image beside the file; two materials over one set of vertices.
TEST_F(GltfUsers, DataAndImagesBesideTheFile) {
    ExportedGltf file;
    const Patch ball(48, 32, ball_at);
    const auto vertices = file.add(ball, [](Uv uv) { return Uv{4 * uv[0] - 2, 2 - 2 * uv[1]}; });
    std::vector<std::array<int, 3>> upper, lower;
    for (const auto& triangle : ball.triangles)
        (ball.positions[static_cast<std::size_t>(triangle[0])][1] >= 0 ? upper : lower).push_back(triangle);
    ExportedGltf::Vertices top = vertices, bottom = vertices;
    top.indices = file.add_indices(upper);
    bottom.indices = file.add_indices(lower);
    file.document.update(Json::parse(R"({
        "scenes": [{"nodes": [0]}], "nodes": [{"name": "Buoy", "mesh": 0}],
        "images": [{"uri": "textures/wood%20grain.png"}], "textures": [{"source": 0}],
        "materials": [{"name": "Wood", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
                      {"name": "Paint", "pbrMetallicRoughness": {"baseColorFactor": [0.75, 0.25, 0.25, 1]}}]})"));
    file.document["meshes"] = {{{"name", "Buoy"}, {"primitives", {primitive(top, 0), primitive(bottom, 1)}}}};
    file.write(path("in/buoy.gltf"));
    fs::create_directories(path("in/textures"));
    write_text(path("in/textures/wood grain.png"), tiles());
    expect_invisible("in/buoy.gltf", "gltf");
    expect_all_the_same_but_triangles("in/buoy.gltf", "gltf");
    EXPECT_EQ(read_text(path("out/textures/wood grain.png")), tiles());
    EXPECT_TRUE(fs::exists(path("out/small.bin")));
}

struct Card {
    int wrap_s, wrap_t, set;
    bool is_beside_another; // with an image of its own, so that both are laid into one
};

class GltfCards : public GltfUsers, public ::testing::WithParamInterface<Card> {
protected:
    static constexpr int repeats = 10497, clamps = 33071, mirrors = 33648;
    static constexpr int codes[] = {60, 130, 190, 245}; // of the image's four blocks

    // What glTF says of a coordinate beyond 0..1: which of the two blocks lies there.
    static int block(double at, int wrap) {
        if (wrap == clamps) at = std::clamp(at, 0.0, 0.999);
        const double copy = std::floor(at);
        double along = at - copy;
        if (wrap == mirrors && static_cast<int>(copy) % 2 != 0) along = 1 - along;
        return along < 0.5 ? 0 : 1;
    }

    void expect_as_known(const std::string& model) const {
        constexpr int size = 128;
        const double half = 4 * std::tan(20 * std::numbers::pi / 180); // of the height seen in the card's plane
        const Outcome drawn =
            run({"render", model,      "-o", "card.pfm", "--full", "--size", "128x128", "--eye",     "0", "0",
                 "4",      "--target", "0",  "0",        "0",      "--fov",  "40",      "--samples", "4", "--prelit"});
        if (drawn.err.find("No OpenGL") != std::string::npos) GTEST_SKIP() << drawn.err;
        ASSERT_EQ(drawn.status, 0) << drawn.err;
        const auto picture = require(unseen::perception::read_image(path("card.pfm")));
        // The middles of 6 x 6 blocks: the card runs from -1 to 1, its coordinates from -1 to 2.
        for (int row = 0; row < 6; ++row)
            for (int column = 0; column < 6; ++column) {
                const double u = -1 + (column + 0.5) / 2, v = -1 + (row + 0.5) / 2;
                const double x = (u + 1) / 1.5 - 1, y = 1 - (v + 1) / 1.5;
                const int code = codes[2 * block(v, GetParam().wrap_t) + block(u, GetParam().wrap_s)];
                const double linear = std::pow((code / 255.0 + 0.055) / 1.055, 2.4);
                EXPECT_NEAR(picture->image.at(static_cast<int>((x / half + 1) / 2 * size),
                                              static_cast<int>((1 - y / half) / 2 * size)),
                            0.5 + 99.5 * linear, 0.5)
                    << "block " << column << ", " << row << " of " << model;
            }
    }
};

TEST_P(GltfCards, AreDrawnAsTheirSamplersSay) {
    const Card& card = GetParam();
    ExportedGltf file;
    const auto flat = [](double u, double v) { return std::array{2 * u - 1, 2 * v - 1, 0.0}; };
    const auto spread = [](Uv uv) { return Uv{3 * uv[0] - 1, 2 - 3 * uv[1]}; };
    const Patch patch(12, 12, flat);
    // Sets of 16 bits hold 0..1: a transform of the texture spreads them.
    const auto vertices = card.set == 0 ? file.add(patch, spread)
                                        : file.add(
                                              patch,
                                              [](Uv) {
                                                  return Uv{0.75, 0.75};
                                              },
                                              [](Uv) {
                                                  return std::array{255, 255, 255, 255};
                                              },
                                              patch.uvs);
    file.add_image(blocks({codes, codes + 4}, 2));
    Json texture = {{"index", 0}};
    if (card.set == 1) {
        texture["texCoord"] = 1;
        texture["extensions"]["KHR_texture_transform"] = {{"scale", {3, -3}}, {"offset", {-1, 2}}};
        file.document["extensionsUsed"] = {"KHR_texture_transform"};
    }
    file.document["samplers"] = {{{"wrapS", card.wrap_s}, {"wrapT", card.wrap_t}}};
    file.document["textures"] = {{{"source", 0}, {"sampler", 0}}};
    file.document["materials"] = {{{"name", "Card"}, {"pbrMetallicRoughness", {{"baseColorTexture", texture}}}}};
    file.document["meshes"] = {{{"primitives", {primitive(vertices, 0)}}}};
    file.document["nodes"] = {{{"name", "Card"}, {"mesh", 0}}};
    file.document["scenes"] = {{{"nodes", {0}}}};
    if (card.is_beside_another) {
        const Patch aside(4, 4, [&](double u, double v) { return std::array{u + 9, v, 0.0}; });
        const auto other = file.add(aside, [](Uv uv) { return uv; });
        file.add_image(glaze());
        file.document["textures"].push_back({{"source", 1}});
        file.document["materials"].push_back(
            {{"name", "Other"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 1}}}}}});
        file.document["meshes"].push_back({{"primitives", {primitive(other, 1)}}});
        file.document["nodes"].push_back({{"name", "Other"}, {"mesh", 1}});
        file.document["scenes"][0]["nodes"].push_back(1);
    }
    write_text(path("card.glb"), file.glb());
    expect_as_known("card.glb");
    for (const Words& request : {Words{"--full"}, {"--triangles", card.is_beside_another ? "120" : "100"}}) {
        const Simplified made = simplify("card.glb", "out/card.glb", request);
        EXPECT_LE(made.report["triangles"], made.report["source_triangles"]);
        expect_as_known("out/card.glb");
        const GltfContents in = read_gltf(path("card.glb")), out = read_gltf(path("out/card.glb"));
        EXPECT_EQ(in.rest["samplers"], out.rest["samplers"]);
        EXPECT_EQ(in.rest["materials"], out.rest["materials"]);
    }
}

INSTANTIATE_TEST_SUITE_P(Wraps, GltfCards,
                         ::testing::Values(Card{10497, 10497, 0, false}, Card{33648, 33071, 0, false},
                                           Card{33648, 33648, 0, true}, Card{10497, 33648, 1, false},
                                           Card{33648, 10497, 1, true}));

// What goes to a format without mirrors, second coordinates and materials is said.
TEST_F(GltfUsers, OtherFormatsGetTheCoordinatesThatAreDrawn) {
    ExportedGltf file;
    const Patch patch(24, 24, hills);
    std::vector<Uv> inner; // away from the borders, beyond which OBJ and PLY repeat
    for (const Uv& uv : patch.uvs) inner.push_back({0.1 + 0.8 * uv[0], 0.1 + 0.8 * uv[1]});
    const auto vertices = file.add(
        patch,
        [](Uv) {
            return Uv{0.5, 0.5};
        },
        [](Uv) {
            return std::array{255, 255, 255, 255};
        },
        inner);
    file.add_image(glaze());
    file.document.update(Json::parse(R"({
        "scenes": [{"nodes": [0]}], "nodes": [{"name": "Hills", "mesh": 0}],
        "samplers": [{"wrapS": 33648}], "textures": [{"source": 0, "sampler": 0}],
        "materials": [{"name": "Glaze", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}}]})"));
    file.document["meshes"] = {{{"primitives", {primitive(vertices, 0)}}}};
    write_text(path("hills.glb"), file.glb());
    EXPECT_THAT(succeed({"simplify", "hills.glb", "--full", "-o", "out/hills.obj"}), HasSubstr("mirrored"));
    EXPECT_TRUE(look_the_same("hills.glb", "out/hills.obj"));
    // PLY names no images.
    succeed({"simplify", "hills.glb", "--full", "-o", "out/hills.ply"});
    write_text(path("glaze.png"), glaze());
    succeed({"build", "out/hills.ply", "--texture", "glaze.png", "-o", "hills.vdt"});
    EXPECT_TRUE(look_the_same("hills.glb", "hills.vdt"));
}

} // namespace gltf_test
