// OBJ files with materials, as modelling programs write them.
#include "obj_file.h"
#include "painted_file.h"

namespace obj_test {

using namespace unseen::app::testing;
using ::testing::ElementsAre;
using unseen::support::ObjContents;
using unseen::support::read_obj;

class ObjUsers : public PaintedFileTest {
protected:
    // Quads, as modelling programs keep them. Numbers go on from those of the objects before.
    struct Writer {
        std::ostringstream text;
        long positions = 0, uvs = 0, normals = 0;

        Writer() { text << std::fixed << std::setprecision(6); }

        // `paint`: what stands before a row of faces. Texture coordinates `repeats` times 0..1; 0: none.
        template <class Paint>
        void add(const std::string& name, const Patch& patch, double repeats, Paint&& paint) {
            text << "o " << name << '\n';
            for (const auto& p : patch.positions) text << "v " << p[0] << ' ' << p[1] << ' ' << p[2] << '\n';
            for (const auto& n : patch.normals) text << "vn " << n[0] << ' ' << n[1] << ' ' << n[2] << '\n';
            for (const auto& uv : patch.uvs)
                if (repeats > 0) text << "vt " << repeats * uv[0] - 1 << ' ' << repeats * uv[1] << '\n';
            for (int r = 0; r < patch.rows; ++r) {
                text << paint(r);
                for (int c = 0; c < patch.columns; ++c) {
                    text << 'f';
                    for (const auto& [row, column] :
                         {std::pair(r, c), std::pair(r, c + 1), std::pair(r + 1, c + 1), std::pair(r + 1, c)}) {
                        const long v = 1 + row * (patch.columns + 1) + column;
                        text << ' ' << positions + v << '/';
                        if (repeats > 0) text << uvs + v;
                        text << '/' << normals + v;
                    }
                    text << '\n';
                }
            }
            positions += static_cast<long>(patch.positions.size());
            normals += static_cast<long>(patch.normals.size());
            if (repeats > 0) uvs += static_cast<long>(patch.uvs.size());
        }
    };

    static Words names(const ObjContents& contents) {
        Words out;
        for (const auto& [name, faces] : contents.faces) out.push_back(name);
        return out;
    }
    // The least and the largest texture coordinates of a part.
    static std::array<double, 4> uv_box(const ObjContents& contents, const std::string& part) {
        std::array<double, 4> box = {1e9, 1e9, -1e9, -1e9};
        for (const auto& face : contents.faces.at(part))
            for (const auto& corner : face)
                for (std::size_t k = 0; k < 2; ++k) {
                    const double x = contents.vector(1, corner[1])[k];
                    box[k] = std::min(box[k], x), box[k + 2] = std::max(box[k + 2], x);
                }
        return box;
    }
};

TEST_F(ObjUsers, ColoursOfMaterialsAlone) {
    Writer obj;
    obj.text << "# Blender 3.6.5\nmtllib toy.mtl\n";
    const Patch ball(48, 24, ball_at), ground(24, 24, [](double u, double v) {
        const auto p = hills(u, v);
        return std::array{1.5 * p[0], 1.2 * p[1], p[2] - 1};
    });
    obj.add("Ball", ball, 0, [](int r) {
        return std::string(r == 0 ? "usemtl Red\ns 1\n" : r == 12 ? "usemtl Cream\n" : "");
    });
    obj.add("Ground", ground, 0, [](int r) { return std::string(r == 0 ? "usemtl Moss\ns 0\n" : ""); });
    fs::create_directories(path("in"));
    write_text(path("in/toy.obj"), obj.text.str());
    const std::string materials =
        "# Blender 3.6.5 MTL File: 'toy.blend'\n# www.blender.org\n\n"
        "newmtl Red\nNs 250.000000\nKa 1.000000 1.000000 1.000000\nKd 0.800000 0.120000 0.100000\n"
        "Ks 0.500000 0.500000 0.500000\nKe 0.000000 0.000000 0.000000\nNi 1.450000\nd 1.000000\nillum 2\n\n"
        "newmtl Cream\nKd 0.900000 0.850000 0.700000\nd 1.000000\nillum 1\n\n"
        "newmtl Moss\nKd 0.300000 0.450000 0.200000\nillum 1\n";
    write_text(path("in/toy.mtl"), materials);
    expect_invisible("in/toy.obj", "obj");
    for (const std::string out : {"out/small.obj", "out/whole.obj"}) {
        EXPECT_THAT(names(read_obj(read_text(path(out)))), ElementsAre("Ball  Cream", "Ball  Red", "Ground  Moss"));
        EXPECT_EQ(read_text(path("out/toy.mtl")), materials);
    }
    // With Kd of its own each third has another luminance: drawn pre-lit, a pixel of each is known.
    const Outcome drawn = run({"render", "out/small.obj", "-o", "flat.pfm", "--full", "--prelit", "--size", "128x128",
                               "--eye", "0", "0", "6", "--target", "0", "0", "0", "--fov", "40"});
    if (drawn.err.find("No OpenGL") != std::string::npos) GTEST_SKIP() << drawn.err;
    ASSERT_EQ(drawn.status, 0) << drawn.err;
    const auto picture = require(unseen::perception::read_image(path("flat.pfm")));
    const auto luminance = [](double r, double g, double b) {
        const auto linear = [](double code) { return std::pow((code + 0.055) / 1.055, 2.4); };
        return 0.5 + 99.5 * (0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b));
    };
    const auto seen = unseen::perception::to_luminance(*picture, {});
    EXPECT_NEAR(seen.at(64, 80), luminance(0.8, 0.12, 0.1), 0.3) << "below the middle";
    EXPECT_NEAR(seen.at(64, 48), luminance(0.9, 0.85, 0.7), 0.3);
    EXPECT_NEAR(seen.at(98, 64), luminance(0.3, 0.45, 0.2), 0.3);
}

TEST_F(ObjUsers, ImagesCoordinatesAndGroups) {
    Writer obj;
    obj.text << "mtllib garden set.mtl\n";
    obj.add("Vase", Patch(40, 24, ball_at), 3, [](int r) {
        return std::string(r == 0 ? "g foot\nusemtl glaze\n" : r == 12 ? "g neck\n" : "");
    });
    obj.add("Wall",
            Patch(24, 24,
                  [](double u, double v) {
                      const auto p = hills(u, v);
                      return std::array{1.5 * p[0], 1.2 * p[1], p[2] - 1};
                  }),
            2, [](int r) { return std::string(r == 0 ? "g wall\nusemtl tiles\n" : ""); });
    fs::create_directories(path("in/maps"));
    write_text(path("in/garden.obj"), obj.text.str());
    const std::string materials = "newmtl glaze\r\nKd 0.9 0.9 1.0\r\nmap_Kd maps/glaze.png\r\n\r\n"
                                  "newmtl tiles\r\nKd 1.0 1.0 1.0\r\nmap_Kd maps/floor tiles.png\r\n";
    write_text(path("in/garden set.mtl"), materials);
    write_text(path("in/maps/glaze.png"), glaze());
    write_text(path("in/maps/floor tiles.png"), tiles());
    expect_invisible("in/garden.obj", "obj");
    const Simplified rough = simplify("in/garden.obj", "out/rough.obj", {"--triangles", "60%"});
    EXPECT_LT(rough.report["triangles"], rough.report["source_triangles"]);
    const ObjContents in = read_obj(read_text(path("in/garden.obj")));
    for (const std::string out : {"out/small.obj", "out/whole.obj", "out/rough.obj"}) {
        const ObjContents left = read_obj(read_text(path(out)));
        // Where groups meet, vertices stand for some of both.
        const double slack = out == "out/whole.obj" ? 1e-6 : out == "out/small.obj" ? 0.05 : 0.15;
        ASSERT_THAT(names(left), ElementsAre("Vase foot glaze", "Vase neck glaze", "Wall wall tiles"));
        for (const std::string& part : names(in)) {
            const auto before = uv_box(in, part), after = uv_box(left, part);
            for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(before[k], after[k], slack) << part;
        }
        EXPECT_EQ(read_text(path("out/garden set.mtl")), materials);
        EXPECT_EQ(read_text(path("out/maps/glaze.png")), glaze());
        EXPECT_EQ(read_text(path("out/maps/floor tiles.png")), tiles());
    }
}

} // namespace obj_test
