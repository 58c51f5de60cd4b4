// Every format and feature of the mesh readers on files small enough to check by eye, and what the writers give back.
#include <unseen/meshio/mesh_file.h>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/internal/atomic_file.h>

#include "mesh_files.h"
#include "mesh_readers.h"
#include "polygon_triangulator.h"
#include "read_bytes.h"
#include "shapes.h"
#include "temp_folder.h"

#include <stop_token>

namespace unseen::vdtree::mesh_file_test {

namespace fs = std::filesystem;
using namespace std::string_literals;
using support::error_of;
using support::read;

// A folder of its own for each test, removed with everything in it.
class MeshFiles : public testing::Test {
protected:
    void save(const std::string& name, const std::string& bytes) const {
        std::ofstream(folder_ / name, std::ios::binary) << bytes;
    }
    std::size_t files() const {
        return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
    }

private:
    const support::TempFolder own_;

protected:
    const fs::path folder_ = own_.path();
};

double area(const Mesh& mesh) {
    double sum = 0.0;
    for (const Triangle& t : mesh.triangles) {
        const glm::dvec3 a = mesh.positions[t[0]];
        sum += glm::length(glm::cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a)) / 2.0;
    }
    return sum;
}

void expect_unit_quad(const Mesh& mesh) {
    ASSERT_EQ(mesh.positions.size(), 4u);
    EXPECT_EQ(mesh.positions[0], glm::dvec3(0, 0, 0));
    EXPECT_EQ(mesh.positions[1], glm::dvec3(1, 0, 0));
    EXPECT_EQ(mesh.positions[2], glm::dvec3(1, 1, 0));
    EXPECT_EQ(mesh.positions[3], glm::dvec3(0, 1, 0));
    EXPECT_THAT(mesh.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}));
}

TEST(Ply, ReadsAsciiAndBothByteOrders) {
    expect_unit_quad(read(mesh_files::ascii_ply_quad(), "a.ply").mesh);
    expect_unit_quad(read(mesh_files::binary_ply_quad(std::endian::little), "a.ply").mesh);
    expect_unit_quad(read(mesh_files::binary_ply_quad(std::endian::big), "a.ply").mesh);
}

TEST(Ply, CountsFacesBeforeTriangulation) {
    const meshio::ReadResult result = read(mesh_files::ascii_ply_quad(), "a.ply");
    EXPECT_EQ(result.source_faces, 1u);
    EXPECT_EQ(result.dropped_triangles, 0u);
    EXPECT_TRUE(result.warnings.empty());
}

TEST(Ply, TakesEveryNewlineInItsHeader) {
    for (const std::string newline : {"\n", "\r\n", "\r"}) {
        std::string file;
        for (const char c : mesh_files::binary_ply_quad(std::endian::little)) {
            // Only in the header: the body starts behind end_header.
            if (c == '\n' && file.find("end_header") == std::string::npos) file += newline;
            else if (c == '\n' && file.ends_with("end_header")) file += newline;
            else file += c;
        }
        expect_unit_quad(read(file, "a.ply").mesh);
    }
}

TEST(Ply, TakesACrBeforeTheLastNewlineOfTheHeaderOnly) {
    std::string file = mesh_files::binary_ply_quad(std::endian::little);
    file.insert(file.find("end_header") + 10, "\r");
    expect_unit_quad(read(file, "a.ply").mesh);
}

TEST(Ply, DoesNotTakeTheFirstByteOfTheBodyForANewline) {
    // Lone CRs in the header, and a body that starts with byte 10.
    const std::string header = "ply\rformat binary_little_endian 1.0\relement vertex 3\rproperty uchar x\r"
                               "property uchar y\rproperty uchar z\relement face 1\r"
                               "property list uchar uchar vertex_index\rend_header\r";
    const Mesh mesh = read(header + "\n\n\n" + "\1\0\0"s + "\0\1\0"s + "\3\0\1\2"s, "a.ply").mesh;
    EXPECT_EQ(mesh.positions[0], glm::dvec3(10, 10, 10));
}

TEST(Ply, ReadsFacesThatStandBeforeTheVertices) {
    const Mesh mesh = read("ply\nformat ascii 1.0\nelement face 1\nproperty list uchar uint vertex_indices\n"
                           "element vertex 4\nproperty double x\nproperty double y\nproperty double z\nend_header\n"
                           "4 0 1 2 3\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n",
                           "a.ply")
                          .mesh;
    expect_unit_quad(mesh);
}

TEST(Ply, SkipsElementsAndListsItDoesNotKnow) {
    const std::string header =
        "ply\nformat binary_big_endian 1.0\nelement camera 2\nproperty list ushort double knots\n"
        "property char c\nelement vertex 3\nproperty list uchar short tags\nproperty float z\n"
        "property float y\nproperty float x\nelement face 1\nproperty uchar flag\n"
        "property list uint uchar vertex_indices\nproperty list uchar float texcoord\n"
        "element tail 1\nproperty int i\nend_header\n";
    const auto big = [](auto value) { return mesh_files::bytes(value, std::endian::big); };
    std::string body = big(std::uint16_t{2}) + big(1.5) + big(2.5) + "c" + big(std::uint16_t{0}) + "d";
    for (int i = 0; i < 3; ++i) {
        body += "\1"s + big(std::int16_t{7}) + big(0.25f * static_cast<float>(i)) + big(i == 2 ? 1.0f : 0.0f) +
                big(i == 1 ? 1.0f : 0.0f);
    }
    body += "\7"s + big(std::uint32_t{3}) + "\0\1\2"s + "\2"s + big(0.5f) + big(0.5f) + big(std::int32_t{-1});
    const meshio::ReadResult result = read(header + body, "a.ply");
    EXPECT_THAT(result.mesh.positions, ElementsAre(glm::dvec3(0, 0, 0), glm::dvec3(1, 0, 0.25), glm::dvec3(0, 1, 0.5)));
    EXPECT_THAT(result.mesh.triangles, ElementsAre(Triangle{0, 1, 2}));
    EXPECT_TRUE(result.warnings.empty());
}

TEST(Ply, UnrollsStripsWithTheirOrientation) {
    const Mesh mesh = read("ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
                           "property float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n"
                           "0 0 0\n0 1 0\n1 0 0\n1 1 0\n2 0 0\n9 0 1 2 3 -1 2 3 4 -1\n",
                           "a.ply")
                          .mesh;
    EXPECT_THAT(mesh.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{2, 1, 3}, Triangle{2, 3, 4}));
}

TEST(Ply, DropsTheSwapsOfStripsAndCountsThem) {
    const meshio::ReadResult result =
        read("ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
             "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
             "0 0 0\n0 1 0\n1 0 0\n1 1 0\n6 0 1 2 2 1 3\n",
             "a.ply");
    EXPECT_THAT(result.mesh.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{1, 2, 3}));
    EXPECT_EQ(result.dropped_triangles, 2u); // 1 2 2 and 2 2 1
    EXPECT_EQ(result.source_faces, 4u);
}

std::string ply_with(const std::string& properties, const std::string& values) {
    return "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n" +
           properties + "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 " + values +
           "\n1 0 0 " + values + "\n0 1 0 " + values + "\n3 0 1 2\n";
}

TEST(Ply, ReadsNormalsUvsAndColoursUnderTheirNames) {
    const std::string normals = "property float nx\nproperty float ny\nproperty float nz\n";
    EXPECT_EQ(read(ply_with(normals, "0 0.6 0.8"), "a.ply").mesh.normals[2], glm::vec3(0.0f, 0.6f, 0.8f));
    for (const std::string uv : {"property float s\nproperty float t\n", "property float u\nproperty float v\n",
                                 "property float texture_u\nproperty double texture_v\n"}) {
        EXPECT_EQ(read(ply_with(uv, "0.25 0.75"), "a.ply").mesh.uvs[1], glm::vec2(0.25f, 0.75f));
    }
    const std::string partial = "property uchar red\nproperty uchar green\n";
    EXPECT_TRUE(read(ply_with(partial, "1 2"), "a.ply").mesh.colours.empty());
}

TEST(Ply, ScalesColoursByTheirTypeAndDecodesThem) {
    meshio::ReadOptions linear;
    linear.colours = meshio::ColourEncoding::linear;
    const auto colour = [&](const std::string& type, const std::string& values, const meshio::ReadOptions& options) {
        const std::string properties = "property " + type + " red\nproperty " + type + " green\nproperty " + type +
                                       " blue\nproperty " + type + " alpha\n";
        return read(ply_with(properties, values), "a.ply", options).mesh.colours[1];
    };
    EXPECT_EQ(colour("uchar", "255 51 0 102", linear), glm::vec4(1.0f, 0.2f, 0.0f, 0.4f));
    EXPECT_EQ(colour("ushort", "65535 13107 0 26214", linear), glm::vec4(1.0f, 0.2f, 0.0f, 0.4f));
    EXPECT_EQ(colour("float", "1 0.2 0 0.4", linear), glm::vec4(1.0f, 0.2f, 0.0f, 0.4f));
    // IEC 61966-2-1: 0.5 encoded is 0.21404 linear. Alpha is linear already.
    const glm::vec4 decoded = colour("float", "0.5 1 0 0.5", {});
    EXPECT_NEAR(decoded.r, 0.2140411f, 1e-6f);
    EXPECT_EQ(decoded.g, 1.0f);
    EXPECT_EQ(decoded.b, 0.0f);
    EXPECT_EQ(decoded.a, 0.5f);
}

TEST(Ply, RepairsColoursAndUvsThatWouldSpreadNan) {
    const meshio::ReadResult colours =
        read(ply_with("property float red\nproperty float green\nproperty float blue\n", "nan 2 -1"), "a.ply");
    EXPECT_EQ(colours.mesh.colours[0], glm::vec4(0.0f, 1.0f, 0.0f, 1.0f));
    ASSERT_EQ(colours.warnings.size(), 1u);
    EXPECT_THAT(colours.warnings[0], HasSubstr("3 vertex colours were"));
    EXPECT_EQ(read(ply_with("property float s\nproperty float t\n", "inf 0"), "a.ply").mesh.uvs[0], glm::vec2(0.0f));
}

TEST(Ply, KeepsDoublePrecisionAtHugeOffsets) {
    const std::string file = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\n"
                             "property double z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
                             "1000000000.25 4785270.123456789 +1e-19\n1e30 0 0\n0 -1e-19 0\n3 0 1 2\n";
    const Mesh mesh = read(file, "a.ply").mesh;
    EXPECT_EQ(mesh.positions[0], glm::dvec3(1000000000.25, 4785270.123456789, 1e-19));
    EXPECT_EQ(mesh.positions[1].x, 1e30);
    EXPECT_EQ(mesh.positions[2].y, -1e-19);
}

TEST(Ply, DropsTrianglesThatUseAVertexTwiceAndKeepsCoincidentOnes) {
    const meshio::ReadResult result =
        read("ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
             "element face 3\nproperty list uchar int vertex_indices\nend_header\n"
             "0 0 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 2 3 2\n4 0 2 3 3\n",
             "a.ply");
    EXPECT_THAT(result.mesh.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}));
    EXPECT_EQ(result.dropped_triangles, 2u);
    EXPECT_EQ(result.mesh.positions.size(), 4u);
}

TEST(Ply, SaysHowManyFacesHadTooFewCorners) {
    std::string file = mesh_files::ascii_ply_quad();
    file.replace(file.find("face 1"), 6, "face 3");
    const meshio::ReadResult result = read(file + "2 0 1\n0\n", "a.ply");
    EXPECT_EQ(result.source_faces, 3u);
    EXPECT_THAT(result.warnings, ElementsAre("2 faces were left out for having fewer than 3 corners."));
}

TEST(Obj, KeepsTheNumberingOfPositionsOnly) {
    const Mesh mesh = read("v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\nf 2 3 4\n", "a.obj").mesh;
    EXPECT_EQ(mesh.positions.size(), 5u); // unreferenced ones too
    EXPECT_THAT(mesh.triangles, ElementsAre(Triangle{1, 2, 3}));
    EXPECT_TRUE(mesh.normals.empty() && mesh.uvs.empty() && mesh.colours.empty());
}

TEST(Obj, ReadsEveryFormOfCorner) {
    const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 0.25\nvn 0 0 2\n";
    for (const std::string face :
         {"f 1 2 3", "f 1/1 2/1 3/1", "f 1//1 2//1 3//1", "f 1/1/1 2/1/1 3/1/1", "f 1// 2/ 3", "f -3 -2 -1",
          "f -3/-1/-1 -2/-1/-1 -1/-1/-1", "f 1 2 3 # corners", "fo 1 2 3", "f\t1  2\t3 ", "f +1 +2 +3"}) {
        const Mesh mesh = read(vertices + face + "\n", "a.obj").mesh;
        EXPECT_THAT(mesh.triangles, ElementsAre(Triangle{0, 1, 2})) << face;
        EXPECT_EQ(mesh.positions.size(), 3u) << face;
        if (face.find("/1") != std::string::npos || face.find("/-1") != std::string::npos) {
            const bool has_uv = face.find("//") == std::string::npos;
            EXPECT_EQ(mesh.uvs.empty(), !has_uv) << face;
            if (has_uv) EXPECT_EQ(mesh.uvs[2], glm::vec2(0.5f, 0.25f));
            if (!mesh.normals.empty()) EXPECT_EQ(mesh.normals[1], glm::vec3(0.0f, 0.0f, 2.0f));
        }
    }
}

TEST(Obj, CountsNegativeIndicesFromTheFaceBackwards) {
    const Mesh mesh = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nf -4 -3 -1\n", "a.obj").mesh;
    EXPECT_THAT(mesh.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 1, 3}));
}

TEST(Obj, SplitsVerticesOnlyWhereAttributesDiffer) {
    // Two quads share the edge 2-3. UV 5 repeats the values of 2, UV 6 does not repeat those of 3.
    const std::string file = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\n"
                             "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 1 0\nvt 0.5 0.5\nvt 2 0\nvt 2 1\n"
                             "f 1/1 2/2 3/3 4/4\nf 2/5 5/7 6/8 3/6\n";
    const Mesh mesh = read(file, "a.obj").mesh;
    ASSERT_EQ(mesh.positions.size(), 7u);
    EXPECT_EQ(mesh.positions[6], mesh.positions[2]);
    EXPECT_EQ(mesh.uvs[2], glm::vec2(1.0f, 1.0f));
    EXPECT_EQ(mesh.uvs[6], glm::vec2(0.5f, 0.5f));
    EXPECT_THAT(mesh.triangles,
                ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{1, 4, 5}, Triangle{1, 5, 6}));
}

TEST(Obj, TakesEveryNewlineAndJoinsContinuedLines) {
    const std::string lines[] = {"v 0 0 0", "v 1 0 \\", "0",  "# a comment that ends in \\",
                                 "v 0 1 0", "f 1 2 \\", "  3"};
    for (const std::string newline : {"\n", "\r\n", "\r"}) {
        std::string file;
        for (const std::string& line : lines) file += line + newline;
        const Mesh mesh = read(file, "a.obj").mesh;
        EXPECT_EQ(mesh.positions[1], glm::dvec3(1, 0, 0));
        EXPECT_THAT(mesh.triangles, ElementsAre(Triangle{0, 1, 2}));
    }
    EXPECT_EQ(read("v 0 0 0\rv 1 0 0\r\nv 0 1 0\n\rf 1 2 3", "a.obj").mesh.triangles.size(), 1u);
}

TEST(Obj, NamesTheRightLineAfterMixedNewlines) {
    EXPECT_THAT(error_of("v 0 0 0\rv 1 0 0\r\nv 0 1 0\n\r\nf 1 2 4\r", "a.obj"),
                HasSubstr("a.obj: line 5: face 1 uses vertex 4"));
}

TEST(Obj, ReadsWeightsAndColoursOfVertices) {
    meshio::ReadOptions linear;
    linear.colours = meshio::ColourEncoding::linear;
    const Mesh mesh =
        read("v 2 0 0 0.5\nv 1 0 0 1 0.5 0\nv 0 1 0 0 0 1 0.25\nv 3 3 3\nf 1 2 3\n", "a.obj", linear).mesh;
    EXPECT_EQ(mesh.positions[0], glm::dvec3(2, 0, 0)); // a weight divides nothing
    EXPECT_THAT(mesh.colours, ElementsAre(glm::vec4(1.0f), glm::vec4(1.0f, 0.5f, 0.0f, 1.0f),
                                          glm::vec4(0.0f, 0.0f, 1.0f, 0.25f), glm::vec4(1.0f)));
}

TEST(Obj, KeepsGroupsAndMaterialsAsRanges) {
    const std::string file = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\ng left wing\nusemtl red\nf 1 2 3 4\n"
                             "g empty\no body\nusemtl blue\nf 1 2 3\nusemtl red\nf 2 3 4\n";
    const Mesh mesh = read(file, "a.obj").mesh;
    std::vector<std::string> shown;
    for (const MeshRange& range : mesh.ranges) {
        shown.push_back((range.kind == MeshRange::Kind::group ? "g " : "m ") + range.name + " " +
                        std::to_string(range.first_triangle) + "+" + std::to_string(range.triangle_count));
    }
    EXPECT_THAT(shown,
                testing::UnorderedElementsAre("g left wing 1+2", "m red 1+2", "g body 3+2", "m blue 3+1", "m red 4+1"));
    EXPECT_TRUE(validate(mesh.view()));
}

TEST(Obj, ShrinksRangesWithTheTrianglesTheyLose) {
    const Mesh mesh =
        read("v 0 0 0\nv 1 0 0\nv 1 1 0\ng a\nf 1 1 2\nf 1 2 3\nf 2 2 3\ng b\nf 3 3 1\ng c\nf 3 2 1\n", "a.obj").mesh;
    ASSERT_EQ(mesh.ranges.size(), 2u);
    EXPECT_EQ(mesh.ranges[0].first_triangle, 0u);
    EXPECT_EQ(mesh.ranges[0].triangle_count, 1u);
    EXPECT_EQ(mesh.ranges[1].name, "c");
    EXPECT_EQ(mesh.ranges[1].first_triangle, 1u);
    EXPECT_EQ(mesh.ranges[1].triangle_count, 1u);
}

TEST(Obj, KeepsSmoothingGroupsByTriangle) {
    const std::string vertices = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    const auto groups = [&](const std::string& faces) { return read(vertices + faces, "a.obj").mesh.smoothing; };
    EXPECT_THAT(groups("f 1 2 3 4\n"), IsEmpty()) << "nothing stated";
    EXPECT_THAT(groups("s 1\nf 1 2 3 4\nf 1 2 3\n"), ElementsAre(1, 1, 1)) << "a quadrangle is two triangles";
    EXPECT_THAT(
        groups("f 1 2 3\ns 7 # a comment\nf 1 2 3\ns off\nf 2 3 4\ng new\ns 4294967295\nf 2 3 4\ns 0\nf 1 2 4\n"),
        ElementsAre(0, 7, 0, 4294967295u, 0));
    EXPECT_THAT(groups("s OFF\nf 1 2 3\nf 1 1 3\ns 2\nf 1 1 2\nf 1 2 4\ns 3\n"), ElementsAre(0, 2))
        << "dropped triangles take theirs along";
    EXPECT_THAT(groups("f 1 2 3\ns 1\n"), ElementsAre(0)) << "flat before the first";
}

TEST(Obj, WarnsOfSmoothingGroupsThatAreNone) {
    const meshio::ReadResult result =
        read("v 0 0 0\nv 1 0 0\nv 1 1 0\ns 2\ns -1\ns on\ns\ns 4294967296\ns 1.5\nf 1 2 3\n", "a.obj");
    EXPECT_THAT(result.mesh.smoothing, ElementsAre(2));
    EXPECT_THAT(result.warnings,
                ElementsAre("5 smoothing groups were neither a number nor off, the first '-1' in line 5; "
                            "faces stay in the group before."));
    EXPECT_THAT(read("v 0 0 0\nv 1 0 0\nv 1 1 0\ns x\nf 1 2 3\n", "a.obj").mesh.smoothing, IsEmpty());
}

TEST(Obj, SaysWhichKeywordItDidNotKnow) {
    const meshio::ReadResult result = read("v 0 0 0\nv 1 0 0\nv 1 1 0\ns off\nwobble 3\nf 1 2 3\n", "a.obj");
    EXPECT_THAT(result.warnings,
                ElementsAre("1 line was skipped for an unknown keyword, the first 'wobble' in line 5."));
}

TEST(Obj, ReadsAFaceThatStandsBeforeItsVertices) {
    EXPECT_EQ(read("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 1 1 0\n", "a.obj").mesh.triangles.size(), 1u);
}

double cut_area(const std::vector<glm::dvec3>& polygon) {
    meshio::PolygonTriangulator polygons;
    Mesh mesh;
    mesh.positions = polygon;
    for (const Triangle& t : polygons.cut(polygon)) mesh.triangles.push_back(t);
    EXPECT_EQ(mesh.triangles.size(), polygon.size() - 2);
    EXPECT_EQ(polygons.fanned_concave(), 0u);
    return area(mesh);
}

TEST(Polygons, KeepTheirOrientationInEveryPlane) {
    const std::vector<glm::dvec2> star{{0, 3},    {-1, 1}, {-3, 1},     {-1.5, -0.5}, {-2, -3},
                                       {0, -1.5}, {2, -3}, {1.5, -0.5}, {3, 1},       {1, 1}};
    double expected = 0.0;
    for (std::size_t i = 0; i < star.size(); ++i) {
        const glm::dvec2 a = star[i], b = star[(i + 1) % star.size()];
        expected += (a.x * b.y - a.y * b.x) / 2.0;
    }
    const glm::dvec3 axes[][2] = {{{1, 0, 0}, {0, 1, 0}}, {{0, 1, 0}, {1, 0, 0}}, {{0, 1, 0}, {0, 0, 1}},
                                  {{0, 0, 1}, {1, 0, 0}}, {{1, 0, 0}, {0, 0, 1}}, {{0.6, 0.8, 0}, {0, 0, 1}}};
    for (const auto& axis : axes) {
        std::vector<glm::dvec3> polygon;
        for (const glm::dvec2& p : star) polygon.push_back(p.x * axis[0] + p.y * axis[1]);
        const glm::dvec3 up = glm::cross(axis[0], axis[1]);
        meshio::PolygonTriangulator polygons;
        double sum = 0.0;
        for (const Triangle& t : polygons.cut(polygon)) {
            const glm::dvec3 normal = glm::cross(polygon[t[1]] - polygon[t[0]], polygon[t[2]] - polygon[t[0]]);
            EXPECT_GE(glm::dot(normal, up), 0.0);
            sum += glm::length(normal) / 2.0;
        }
        EXPECT_NEAR(sum, std::abs(expected), 1e-12);
    }
}

TEST(Polygons, KeepTheirAreaAtExtremeScales) {
    Mesh arrow;
    arrow.positions = {{0, 0, 0}, {2, 2, 0}, {0, 4, 0}, {1, 2, 0}};
    for (const double scale : {1e-300, 1e-19, 1e30, 1e300}) {
        std::vector<glm::dvec3> scaled = arrow.positions;
        for (glm::dvec3& p : scaled) p *= scale;
        meshio::PolygonTriangulator polygons;
        arrow.triangles.clear();
        for (const Triangle& t : polygons.cut(scaled)) arrow.triangles.push_back(t);
        EXPECT_NEAR(area(arrow), 2.0, 1e-12) << scale; // of the cut at plain size: squares would leave the range
    }
}

TEST(Polygons, BridgeHolesThatComeAsOneRing) {
    // A 4 x 4 square with a 2 x 2 hole, joined by a doubled edge.
    EXPECT_NEAR(cut_area({{0, 0, 0},
                          {4, 0, 0},
                          {4, 4, 0},
                          {0, 4, 0},
                          {0, 0, 0},
                          {1, 1, 0},
                          {1, 3, 0},
                          {3, 3, 0},
                          {3, 1, 0},
                          {1, 1, 0}}),
                12.0, 1e-12);
}

TEST(Polygons, KeepTheAreaOfLargeRandomStars) {
    std::mt19937 random(7); // NOLINT: a fixed seed
    std::uniform_real_distribution<double> radius(0.2, 1.0);
    for (const int corners : {5, 40, 400}) {
        std::vector<glm::dvec3> star;
        double expected = 0.0;
        for (int i = 0; i < corners; ++i) {
            const double angle = 2.0 * 3.14159265358979 * i / corners, r = radius(random);
            star.push_back({r * std::cos(angle), r * std::sin(angle), 0.0});
        }
        for (std::size_t i = 0; i < star.size(); ++i)
            expected += glm::cross(star[i], star[(i + 1) % star.size()]).z / 2.0;
        EXPECT_NEAR(cut_area(star), expected, 1e-12);
    }
}

TEST(Polygons, GiveNMinusTwoTrianglesWhateverTheirShape) {
    std::mt19937 random(11);
    std::uniform_int_distribution<int> coordinate(0, 3); // many coincidences and collinear corners
    meshio::PolygonTriangulator polygons;
    for (int round = 0; round < 5000; ++round) {
        std::vector<glm::dvec3> polygon(static_cast<std::size_t>(3 + round % 12));
        for (glm::dvec3& p : polygon) p = {coordinate(random), coordinate(random), round % 2 ? coordinate(random) : 0};
        std::size_t count = 0;
        for (const Triangle& t : polygons.cut(polygon)) {
            ++count;
            for (const Index corner : t) EXPECT_LT(corner, polygon.size());
        }
        EXPECT_EQ(count, polygon.size() - 2);
    }
}

TEST(Polygons, AreFannedWhereCuttingThemWouldTakeForEver) {
    // A comb with 30,000 teeth needs about n^2 tests, more than a file may cost.
    std::vector<glm::dvec3> comb;
    for (int i = 0; i < 60000; ++i) comb.push_back({i, i % 2, 0});
    comb.push_back({60000, -1, 0});
    comb.push_back({-1, -1, 0});
    std::reverse(comb.begin(), comb.end());
    meshio::PolygonTriangulator polygons;
    const auto start = std::chrono::steady_clock::now();
    const std::size_t count = polygons.cut(comb).size() + polygons.cut(comb).size();
    EXPECT_EQ(count, 2 * (comb.size() - 2));
    EXPECT_GE(polygons.fanned_concave(), 1u);
    // The limit is a second or two of plain machine; sanitizers and shared machines take longer.
    EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(60));
}

TEST(Off, ReadsCountsOnEitherLineAndComments) {
    expect_unit_quad(read(mesh_files::off_quad(), "a.off").mesh);
    expect_unit_quad(read("OFF 4 1 0 # counts\n0 0 0\n1 0 0\n\n# more\n1 1 0\n0 1 0\n4 0 1 2 3\n", "a.off").mesh);
    expect_unit_quad(read("# first\r\nOFF\r\n4 1 0\r\n0 0 0\r\n1 0 0\r\n1 1 0\r\n0 1 0\r\n4 0 1 2 3", "x").mesh);
    expect_unit_quad(read("4 1 4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n", "no_keyword.off").mesh);
    expect_unit_quad(read("OFF\r4 1 0\r0 0 0\r1 0 0\r1 1 0\r0 1 0\r4 0 1 2 3\r", "a.off").mesh);
}

TEST(Off, ReadsItsVariants) {
    meshio::ReadOptions linear;
    linear.colours = meshio::ColourEncoding::linear;
    const auto file = [](const std::string& keyword, const std::string& extra) {
        return keyword + "\n3 1 0\n0 0 0 " + extra + "\n1 0 0 " + extra + "\n0 1 0 " + extra + "\n3 0 1 2\n";
    };
    EXPECT_EQ(read(file("COFF", "255 0 51 255"), "a.off", linear).mesh.colours[1], glm::vec4(1.0f, 0.0f, 0.2f, 1.0f));
    EXPECT_EQ(read(file("COFF", "255 0 51"), "a.off", linear).mesh.colours[1], glm::vec4(1.0f, 0.0f, 0.2f, 1.0f));
    EXPECT_EQ(read(file("COFF", "1 0 0.5 0.25"), "a.off", linear).mesh.colours[2], glm::vec4(1.0f, 0.0f, 0.5f, 0.25f));
    EXPECT_EQ(read(file("NOFF", "0 0 1"), "a.off").mesh.normals[0], glm::vec3(0.0f, 0.0f, 1.0f));
    EXPECT_EQ(read(file("STOFF", "0.5 0.75"), "a.off").mesh.uvs[0], glm::vec2(0.5f, 0.75f));
    const Mesh all = read(file("STCNOFF", "0 0 1 1 0 0 1 0.5 0.75"), "a.off", linear).mesh;
    EXPECT_EQ(all.normals[0], glm::vec3(0.0f, 0.0f, 1.0f));
    EXPECT_EQ(all.colours[0], glm::vec4(1.0f, 0.0f, 0.0f, 1.0f));
    EXPECT_EQ(all.uvs[0], glm::vec2(0.5f, 0.75f));
    EXPECT_THAT(error_of(file("NOFF", "0 0"), "a.off"), HasSubstr("line 3: vertex 0 has 2 numbers"));
}

TEST(Stl, KeepsThreeVerticesAFacet) {
    for (const std::string& file : {mesh_files::binary_stl_facet(), mesh_files::ascii_stl_facet(),
                                    mesh_files::binary_stl_facet("solid but binary")}) {
        const Mesh mesh = read(file, "a.stl").mesh;
        EXPECT_THAT(mesh.positions, ElementsAre(glm::dvec3(0, 0, 0), glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0)));
        EXPECT_THAT(mesh.normals, ElementsAre(glm::vec3(0, 0, 1), glm::vec3(0, 0, 1), glm::vec3(0, 0, 1)));
    }
    std::string two = mesh_files::binary_stl_facet();
    two += two.substr(84);
    two[80] = 2;
    meshio::ReadOptions apart;
    apart.weld = false;
    EXPECT_EQ(read(two, "a.stl", apart).mesh.positions.size(), 6u);
}

TEST(Stl, IsWeldedWherePositionsAreEqual) {
    // The two triangles of a square; 0 and -0 are equal.
    std::string square = mesh_files::binary_stl_facet();
    square += mesh_files::floats(0, 0, 1) + mesh_files::floats(1, -0.0f, 0) + mesh_files::floats(1, 1, 0) +
              mesh_files::floats(-0.0f, 1, 0) + std::string(2, '\0');
    square[80] = 2;
    const meshio::ReadResult welded = read(square, "a.stl");
    EXPECT_EQ(welded.mesh.positions.size(), 4u);
    EXPECT_THAT(welded.mesh.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{1, 3, 2}));
    EXPECT_TRUE(welded.mesh.normals.empty());
    ASSERT_EQ(welded.notes.size(), 1u);
    EXPECT_THAT(welded.notes[0], HasSubstr("its 6 vertices, three a facet, were welded to 4"));

    meshio::ReadOptions apart;
    apart.weld = false;
    const meshio::ReadResult kept = read(square, "a.stl", apart);
    EXPECT_EQ(kept.mesh.positions.size(), 6u);
    EXPECT_EQ(kept.mesh.normals.size(), 6u);
    EXPECT_TRUE(kept.notes.empty());

    const meshio::ReadResult alone = read(mesh_files::binary_stl_facet(), "a.stl");
    EXPECT_TRUE(alone.notes.empty());
    EXPECT_EQ(alone.mesh.normals.size(), 3u); // nothing to weld: nothing is lost
}

// Lines of a keyword.
std::size_t lines_with(const std::string& text, const std::string& keyword) {
    std::size_t count = 0;
    for (std::size_t at = 0; (at = text.find("\n" + keyword + " ", at)) != std::string::npos; ++at) ++count;
    return count + text.starts_with(keyword + " ");
}

// The corners as a set of triangles, whatever the order of the vertices.
std::multiset<std::string> corner_values(const Mesh& mesh) {
    std::multiset<std::string> found;
    for (const Triangle& t : mesh.triangles) {
        std::ostringstream values;
        for (const Index v : t) {
            const glm::dvec3 p = mesh.positions[v];
            const glm::vec3 n = mesh.normals[v];
            const glm::vec2 uv = mesh.uvs[v];
            values << p.x << ' ' << p.y << ' ' << p.z << ' ' << n.x << ' ' << n.y << ' ' << n.z << ' ' << uv.x << ' '
                   << uv.y << '\n';
        }
        found.insert(values.str());
    }
    return found;
}

TEST(Obj, SidesOfSeamsShareTheirPositions) {
    const support::TempFolder folder;
    Mesh mesh; // a box with normals and coordinates by face
    for (const Triangle& t : shapes::cube(1).triangles) {
        const Mesh cube = shapes::cube(1);
        const glm::dvec3 a = cube.positions[t[0]],
                         n = glm::normalize(glm::cross(cube.positions[t[1]] - a, cube.positions[t[2]] - a));
        for (const Index v : t) {
            mesh.positions.push_back(cube.positions[v]);
            mesh.normals.emplace_back(n);
            const glm::dvec3 p = cube.positions[v];
            mesh.uvs.emplace_back(n.x != 0 ? p.y : p.x, n.z != 0 ? p.y : p.z);
        }
        const auto last = static_cast<Index>(mesh.positions.size());
        mesh.triangles.push_back({last - 3, last - 2, last - 1});
    }
    const auto tree = require(build_tree(mesh.view()));
    EXPECT_EQ(tree->leaf_count(), 24u);
    Cut cut(*tree);
    cut.unfold_all();
    ASSERT_TRUE(meshio::write_cut(folder / "box.obj", cut));
    const std::string text = support::read_bytes(folder / "box.obj");
    EXPECT_EQ(lines_with(text, "v"), 8u);
    EXPECT_EQ(lines_with(text, "vt"), 4u);
    EXPECT_EQ(lines_with(text, "vn"), 6u);
    const auto again = require(meshio::read_mesh(folder / "box.obj"));
    EXPECT_EQ(again->mesh.positions.size(), 24u);
    EXPECT_EQ(corner_values(again->mesh), corner_values(extract_mesh(cut)));

    // Vertices of a mesh that just lie at one place stay apart.
    ASSERT_TRUE(meshio::write_mesh(folder / "soup.obj", mesh.view()));
    EXPECT_EQ(lines_with(support::read_bytes(folder / "soup.obj"), "v"), 36u);
}

TEST(Obj, UnweldedMeshesAreHintedAt) {
    const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    const auto notes = read(vertices + "f 1 2 3\nf 4 5 6\n", "a.obj").notes;
    ASSERT_EQ(notes.size(), 1u);
    EXPECT_THAT(notes[0], HasSubstr("vertices of its own"));
    EXPECT_THAT(read(vertices + "f 1 2 3\nf 2 5 3\n", "a.obj").notes,
                ElementsAre("2 vertices belong to no face; trees leave them out."));
    EXPECT_TRUE(
        read("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 0 0\nv 6 1 0\nv 5 1 0\nf 1 2 3\nf 4 5 6\n", "a.obj").notes.empty());
}

TEST(Stl, KeepsSolidsAsGroups) {
    const std::string solid = mesh_files::ascii_stl_facet();
    const Mesh mesh =
        read(solid + "solid\n" + solid.substr(15, solid.find("endsolid") - 15) + "endsolid\n", "a.stl").mesh;
    ASSERT_EQ(mesh.ranges.size(), 2u);
    EXPECT_EQ(mesh.ranges[0].name, "part one");
    EXPECT_EQ(mesh.ranges[1].first_triangle, 1u);
}

TEST(Stl, LeavesNormalsOutThatAreZeroOrNan) {
    std::string zero = mesh_files::ascii_stl_facet();
    const meshio::ReadResult without = read(zero.replace(zero.find("0 0 1"), 5, "0 -0 0"), "a.stl");
    EXPECT_TRUE(without.mesh.normals.empty());
    EXPECT_TRUE(without.warnings.empty()); // zero is how STL says that there is none
    std::string nan = mesh_files::binary_stl_facet();
    nan.replace(84, 4, mesh_files::floats(std::numeric_limits<float>::quiet_NaN()));
    const meshio::ReadResult strange = read(nan, "a.stl");
    EXPECT_TRUE(strange.mesh.normals.empty());
    EXPECT_THAT(strange.warnings, ElementsAre("1 facet normal was not finite and computed from the corners."));
}

TEST(Stl, TellsOfFacetsWithoutANormalAmongOthers) {
    const std::string one = mesh_files::ascii_stl_facet();
    std::string other = one;
    meshio::ReadOptions apart;
    apart.weld = false;
    const meshio::ReadResult result = read(one + other.replace(other.find("0 0 1"), 5, "0 0 0"), "a.stl", apart);
    ASSERT_EQ(result.mesh.normals.size(), 6u);
    EXPECT_EQ(result.mesh.normals[3], glm::vec3(0.0f));
    EXPECT_THAT(
        result.warnings,
        ElementsAre(
            "3 normals were zero, missing or not finite and computed from the faces, the first that of vertex 3."));
}

// Whatever the format: zero and what is not finite are told, and what no triangle uses does not matter.
TEST(Normals, AreNeverReplacedInSilence) {
    const std::string properties = "property float nx\nproperty float ny\nproperty float nz\n";
    const auto ply = [&](const std::string& normal) { return ply_with(properties, normal); };
    const auto off = [](const std::string& normal) {
        return "NOFF\n4 1 0\n0 0 0 0 0 1\n1 0 0 " + normal + "\n0 1 0 0 0 1\n9 9 9 nan 0 0\n3 0 1 2\n";
    };
    const auto obj = [](const std::string& normal) {
        return "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvn " + normal + "\nvn nan nan nan\nf 1//1 2//2 3//1\n";
    };
    EXPECT_THAT(
        read(ply("0 0 0"), "a.ply").warnings,
        ElementsAre(
            "3 normals were zero, missing or not finite and computed from the faces, the first that of vertex 0."));
    EXPECT_THAT(
        read(off("0 -0 0"), "a.off").warnings,
        ElementsAre(
            "1 normal was zero, missing or not finite and computed from the faces, the first that of vertex 1."));
    EXPECT_THAT(
        read(obj("0 0 0"), "a.obj").warnings,
        ElementsAre(
            "1 normal was zero, missing or not finite and computed from the faces, the first that of vertex 1."));
    for (const auto& good : {read(ply("0 1 0"), "a.ply"), read(off("1 1 1"), "a.off"), read(obj("0 0 1e-30"), "a.obj")})
        EXPECT_TRUE(good.warnings.empty());
    for (const std::string bad : {"nan 0 0", "0 inf 0", "0 0 -inf", "1e300 0 0"})
        for (const auto& result : {read(ply(bad), "a.ply"), read(off(bad), "a.off"), read(obj(bad), "a.obj")}) {
            EXPECT_THAT(result.warnings, ElementsAre(HasSubstr("zero, missing or not finite and computed"))) << bad;
            EXPECT_EQ(result.mesh.normals[1], glm::vec3(0));
        }
}

TEST(Stl, ReadsUpperCase) {
    std::string file = mesh_files::ascii_stl_facet();
    for (char& c : file) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    EXPECT_EQ(read(file, "A.STL").mesh.triangles.size(), 1u);
}

TEST(Stl, SaysWhenBytesAreLeft) {
    EXPECT_THAT(read(mesh_files::binary_stl_facet() + "more", "a.stl").warnings,
                ElementsAre("data behind the last facet were ignored."));
}

using mesh_files::glb;
using mesh_files::gltf_triangle_data;
using mesh_files::gltf_triangle_json;

TEST(Gltf, ReadsGlbAndDataUris) {
    const std::string uri = R"({"byteLength":42,"uri":"data:application/octet-stream;base64,)"
                            "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIA\"}";
    for (const std::string& file : {mesh_files::glb_triangle(), gltf_triangle_json(R"([{"mesh":0}])", uri)}) {
        const meshio::ReadResult result = read(file, "a.gltf");
        EXPECT_THAT(result.mesh.positions, ElementsAre(glm::dvec3(0, 0, 0), glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0)));
        EXPECT_THAT(result.mesh.triangles, ElementsAre(Triangle{0, 1, 2}));
        ASSERT_EQ(result.mesh.ranges.size(), 1u);
        EXPECT_EQ(result.mesh.ranges[0].kind, MeshRange::Kind::primitive);
        EXPECT_EQ(result.mesh.ranges[0].name, "tri");
    }
}

TEST_F(MeshFiles, GltfReadsBuffersBesideTheFileOnly) {
    save("my data.bin", gltf_triangle_data());
    fs::create_directory(folder_ / "inner");
    const auto with_uri = [](const std::string& uri) {
        return gltf_triangle_json(R"([{"mesh":0}])", R"({"byteLength":42,"uri":")" + uri + R"("})");
    };
    save("a.gltf", with_uri("my%20data.bin"));
    EXPECT_TRUE(meshio::read_mesh(folder_ / "a.gltf"));
    save("inner/a.gltf", with_uri("../my%20data.bin"));
    EXPECT_FALSE(meshio::read_mesh(folder_ / "inner/a.gltf"));
    for (const std::string uri :
         {"%2e%2e/x.bin", "/etc/passwd", "file:///etc/passwd", "http://a/b.bin", "missing.bin", "", "."}) {
        save("b.gltf", with_uri(uri));
        EXPECT_THAT(error_in(meshio::read_mesh(folder_ / "b.gltf")), HasSubstr("buffer 0")) << uri;
    }
    save("my data.bin", gltf_triangle_data().substr(1));
    EXPECT_FALSE(meshio::read_mesh(folder_ / "a.gltf")); // shorter than its byteLength
}

TEST(Gltf, AppliesTheTransformsOfNodes) {
    const std::string nodes = R"([{"children":[1],"translation":[10,0,0],"scale":[2,2,2]},)"
                              R"({"mesh":0,"rotation":[0,0,0.70710678118654752,0.70710678118654752]}])";
    const Mesh mesh = read(glb(gltf_triangle_json(nodes), gltf_triangle_data()), "a.glb").mesh;
    const glm::dvec3 expected[] = {{10, 0, 0}, {10, 2, 0}, {8, 0, 0}}; // a quarter turn, twice the size, then moved
    for (std::size_t i = 0; i < 3; ++i) EXPECT_LT(glm::length(mesh.positions[i] - expected[i]), 1e-15 * 10);
    EXPECT_THAT(mesh.triangles, ElementsAre(Triangle{0, 1, 2}));
}

TEST(Gltf, TurnsTheTrianglesOfMirroredNodes) {
    const Mesh mesh =
        read(glb(gltf_triangle_json(R"([{"mesh":0,"scale":[-1,1,1]}])"), gltf_triangle_data()), "a.glb").mesh;
    EXPECT_EQ(mesh.positions[1], glm::dvec3(-1, 0, 0));
    const glm::dvec3 a = mesh.positions[mesh.triangles[0][0]];
    const glm::dvec3 normal =
        glm::cross(mesh.positions[mesh.triangles[0][1]] - a, mesh.positions[mesh.triangles[0][2]] - a);
    EXPECT_EQ(normal, glm::dvec3(0, 0, 1)); // it looks the way it did
}

TEST(Gltf, KeepsThePrecisionOfTranslationsInDouble) {
    const std::string nodes = R"([{"mesh":0,"translation":[581311.123456789,4785270.000000001,1e9]}])";
    const Mesh mesh = read(glb(gltf_triangle_json(nodes), gltf_triangle_data()), "a.glb").mesh;
    EXPECT_EQ(mesh.positions[0], glm::dvec3(581311.123456789, 4785270.000000001, 1e9));
}

// Six vertices with every attribute: positions and normals as floats, colours as normalised bytes with a stride of 4,
// UVs as normalised 16-bit integers; no indices.
std::string gltf_with_attributes(int mode, const std::string& node = R"({"mesh":0})") {
    std::string data;
    for (int i = 0; i < 6; ++i) data += mesh_files::floats(i / 2, i % 2, 0);
    for (int i = 0; i < 6; ++i) data += mesh_files::floats(0.6, 0, 0.8);
    for (int i = 0; i < 6; ++i) data += "\xFF\x33"s + std::string(2, '\0');
    for (int i = 0; i < 6; ++i)
        data += mesh_files::little(std::uint16_t{65535}) + mesh_files::little(std::uint16_t{13107});
    return glb(
        R"({"asset":{"version":"2.0"},"nodes":[)" + node +
            R"(],"materials":[{"name":"stone"}],"meshes":[{"name":"m","primitives":[{"mode":)" + std::to_string(mode) +
            R"(,"material":0,"attributes":{"POSITION":0,"NORMAL":1,"COLOR_0":2,"TEXCOORD_0":3}}]}],"accessors":[)"
            R"({"bufferView":0,"componentType":5126,"count":6,"type":"VEC3"},)"
            R"({"bufferView":0,"byteOffset":72,"componentType":5126,"count":6,"type":"VEC3"},)"
            R"({"bufferView":1,"componentType":5121,"normalized":true,"count":6,"type":"VEC3"},)"
            R"({"bufferView":2,"componentType":5123,"normalized":true,"count":6,"type":"VEC2"}],"bufferViews":[)"
            R"({"buffer":0,"byteLength":144},{"buffer":0,"byteOffset":144,"byteLength":24,"byteStride":4},)"
            R"({"buffer":0,"byteOffset":168,"byteLength":24}],"buffers":[{"byteLength":192}]})",
        data);
}

TEST(Gltf, ComputesNormalsThatAreNotFinite) {
    std::string bad = gltf_with_attributes(4);
    const std::string good_normal = mesh_files::floats(0.6, 0, 0.8);
    const std::size_t second = bad.find(good_normal) + good_normal.size();
    for (const float y : {0.0f, std::numeric_limits<float>::infinity()})
        EXPECT_THAT(read(bad.replace(second, good_normal.size(), mesh_files::floats(0, y, 0)), "a.glb").warnings,
                    ElementsAre("1 normal was zero, missing or not finite and computed from the faces, the first that "
                                "of vertex 1."));
}

TEST(Gltf, ReadsEveryModeOfTriangles) {
    EXPECT_THAT(read(gltf_with_attributes(4), "a.glb").mesh.triangles,
                ElementsAre(Triangle{0, 1, 2}, Triangle{3, 4, 5}));
    EXPECT_THAT(read(gltf_with_attributes(5), "a.glb").mesh.triangles,
                ElementsAre(Triangle{0, 1, 2}, Triangle{2, 1, 3}, Triangle{2, 3, 4}, Triangle{4, 3, 5}));
    EXPECT_THAT(read(gltf_with_attributes(6), "a.glb").mesh.triangles,
                ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 3, 4}, Triangle{0, 4, 5}));
    EXPECT_THAT(error_of(gltf_with_attributes(1), "a.glb"), HasSubstr("no triangles"));
}

TEST(Gltf, ReadsAttributesWithLinearColours) {
    const Mesh mesh = read(gltf_with_attributes(4), "a.glb").mesh;
    EXPECT_EQ(mesh.colours[5], glm::vec4(1.0f, 0.2f, 0.0f, 1.0f));
    EXPECT_EQ(mesh.uvs[5], glm::vec2(1.0f, 0.2f));
    EXPECT_EQ(mesh.normals[5], glm::vec3(0.6f, 0.0f, 0.8f));
    ASSERT_EQ(mesh.ranges.size(), 2u);
    EXPECT_EQ(mesh.ranges[0].name, "stone");
    EXPECT_EQ(mesh.ranges[0].kind, MeshRange::Kind::material);
}

TEST(Gltf, TransformsNormalsByTheInverseTranspose) {
    const Mesh mesh = read(gltf_with_attributes(4, R"({"mesh":0,"scale":[2,1,-1]})"), "a.glb").mesh;
    // (0.6 / 2, 0, 0.8 / -1), normalised
    const glm::vec3 expected = glm::normalize(glm::vec3(0.3f, 0.0f, -0.8f));
    EXPECT_LT(glm::length(mesh.normals[0] - expected), 1e-6f);
    const Mesh flat = read(gltf_with_attributes(4, R"({"mesh":0,"scale":[1,1,0]})"), "a.glb").mesh;
    EXPECT_EQ(flat.normals[0], glm::vec3(0.0f, 0.0f, 1.0f)); // of a flattened shape
}

TEST(Gltf, SharesTheVerticesOfPrimitivesWithTheSameAccessors) {
    std::string json = gltf_triangle_json();
    const std::string primitive = R"({"attributes":{"POSITION":0},"indices":1})";
    json.insert(json.find(primitive), primitive + ",");
    const Mesh mesh = read(glb(json, gltf_triangle_data()), "a.glb").mesh;
    EXPECT_EQ(mesh.positions.size(), 3u);
    EXPECT_EQ(mesh.triangles.size(), 2u);
    EXPECT_EQ(mesh.ranges.size(), 2u);
}

TEST(Gltf, ReadsSparseAccessors) {
    std::string json = gltf_triangle_json();
    json.replace(json.find(R"("count":3,"type":"VEC3")"), 23,
                 R"("count":3,"type":"VEC3","sparse":{"count":1,"indices":{"bufferView":2,"componentType":5121},)"
                 R"("values":{"bufferView":3}})");
    json.replace(json.find(R"({"buffer":0,"byteOffset":36,"byteLength":6})"), 43,
                 R"({"buffer":0,"byteOffset":36,"byteLength":6},{"buffer":0,"byteOffset":42,"byteLength":2},)"
                 R"({"buffer":0,"byteOffset":44,"byteLength":12})");
    json.replace(json.find(R"("byteLength":42)"), 15, R"("byteLength":56)");
    const std::string data = gltf_triangle_data() + "\2\0"s + mesh_files::floats(7, 8, 9);
    EXPECT_EQ(read(glb(json, data), "a.glb").mesh.positions[2], glm::dvec3(7, 8, 9));
    EXPECT_THAT(error_of(glb(json, gltf_triangle_data() + "\3\0"s + mesh_files::floats(7, 8, 9)), "a.glb"),
                HasSubstr("replaces element 3 of 3"));
}

TEST(Gltf, ReadsOnlyTheSceneThatIsShown) {
    const std::string nodes = R"([{"mesh":0},{"mesh":0,"translation":[5,0,0]}])";
    const meshio::ReadResult result = read(glb(gltf_triangle_json(nodes), gltf_triangle_data()), "a.glb");
    EXPECT_EQ(result.mesh.positions.size(), 3u);
    EXPECT_THAT(result.warnings, ElementsAre("1 node was not in the scene that is shown and left out."));
}

TEST(MeshIo, TrustsTheContentMoreThanTheEnding) {
    EXPECT_EQ(read(mesh_files::ascii_ply_quad(), "a.obj").mesh.triangles.size(), 2u);
    EXPECT_EQ(read(mesh_files::off_quad(), "a.stl").mesh.triangles.size(), 2u);
    EXPECT_EQ(read(mesh_files::glb_triangle(), "a.ply").mesh.triangles.size(), 1u);
    EXPECT_EQ(read(mesh_files::binary_stl_facet(), "nothing").mesh.triangles.size(), 1u);
    EXPECT_EQ(read(mesh_files::ascii_stl_facet(), "nothing").mesh.triangles.size(), 1u);
    EXPECT_EQ(read("\xEF\xBB\xBF" + mesh_files::obj_quad(), "a.OBJ").mesh.triangles.size(), 2u);
    EXPECT_THAT(error_of("hello", "a.txt"), HasSubstr("neither PLY, OBJ, OFF, STL, glTF nor VTK"));
    EXPECT_THAT(error_of("\x28\xB5\x2F\xFD....", "a.ply.zst"), HasSubstr("compressed with zstd"));
}

TEST(MeshIo, StopsWhenTheCallerSaysSo) {
    for (const auto& [name, bytes] : mesh_files::samples()) {
        int calls = 0;
        const auto stop = [&](double share, const char*) {
            EXPECT_TRUE(share >= 0.0 && share <= 1.0);
            ++calls;
            return false;
        };
        meshio::ReadOptions options;
        options.progress = stop;
        const Result<meshio::ReadResult> result = meshio::read_mesh_bytes(bytes, name, options);
        if (calls == 0) continue; // a text of a few lines ends before the first call
        ASSERT_FALSE(result) << name;
        EXPECT_EQ(result.error().code, ErrorCode::cancelled) << name;
    }
}

TEST_F(MeshFiles, SayWhyAFileCannotBeOpened) {
    const Result<meshio::ReadResult> missing = meshio::read_mesh(folder_ / "missing.ply");
    ASSERT_FALSE(missing);
    EXPECT_EQ(missing.error().code, ErrorCode::io_failure);
    EXPECT_THAT(missing.error().message, HasSubstr("missing.ply"));
    EXPECT_FALSE(meshio::read_mesh(folder_));
    EXPECT_FALSE(meshio::read_mesh("/dev/zero"));
}

Mesh random_mesh(bool has_float_positions, bool has_attributes) {
    std::mt19937 random(23);
    std::uniform_real_distribution<double> coordinate(-1e3, 1e3);
    std::uniform_real_distribution<float> unit(0.0f, 1.0f);
    Mesh mesh;
    for (int i = 0; i < 200; ++i) {
        glm::dvec3 p(coordinate(random), coordinate(random), coordinate(random));
        if (has_float_positions) p = glm::dvec3(glm::vec3(p));
        mesh.positions.push_back(p);
        if (!has_attributes) continue;
        mesh.normals.push_back(glm::normalize(glm::vec3(unit(random), unit(random), unit(random) + 0.1f)));
        mesh.colours.push_back({unit(random), unit(random), unit(random), 1.0f});
        mesh.uvs.push_back({unit(random), unit(random)});
    }
    // Every vertex is in a face: OBJ says nothing about the attributes of others.
    for (Index i = 0; i + 2 < 200; ++i) mesh.triangles.push_back({i, i + 1, i + 2});
    std::uniform_int_distribution<Index> vertex(0, 199);
    while (mesh.triangles.size() < 300) {
        const Triangle t{vertex(random), vertex(random), vertex(random)};
        if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) mesh.triangles.push_back(t);
    }
    return mesh;
}

TEST_F(MeshFiles, ComeBackAsTheyWereWritten) {
    for (const bool has_attributes : {false, true}) {
        for (const std::string name : {"a.ply", "a.obj", "a.glb"}) {
            const Mesh mesh = random_mesh(true, has_attributes);
            const Result<void> written = require(meshio::write_mesh(folder_ / name, mesh.view()));
            const Result<meshio::ReadResult> again = require(meshio::read_mesh(folder_ / name));
            EXPECT_EQ(again->mesh.positions, mesh.positions) << name;
            EXPECT_EQ(again->mesh.triangles, mesh.triangles) << name;
            EXPECT_EQ(again->mesh.uvs, mesh.uvs) << name;
            ASSERT_EQ(again->mesh.normals.size(), mesh.normals.size()) << name;
            ASSERT_EQ(again->mesh.colours.size(), mesh.colours.size()) << name;
            // GLB scales normals to length 1 again; PLY keeps colours in 8 bits, which are at most 1/510 off before
            // decoding and 2.3 times that behind it.
            constexpr float normal_tolerance = 1e-6f, colour_tolerance = 2.3f / 510.0f;
            for (std::size_t i = 0; i < mesh.normals.size(); ++i) {
                EXPECT_LT(glm::length(again->mesh.normals[i] - mesh.normals[i]), normal_tolerance) << name;
                for (int c = 0; c < 4; ++c)
                    EXPECT_NEAR(again->mesh.colours[i][c], mesh.colours[i][c], colour_tolerance) << name;
            }
            EXPECT_TRUE(again->warnings.empty()) << name << ": " << again->warnings[0];
        }
    }
}

TEST_F(MeshFiles, KeepDoublesInPlyAndObj) {
    const Mesh mesh = random_mesh(false, false);
    for (const std::string name : {"a.ply", "a.obj"}) {
        ASSERT_TRUE(meshio::write_mesh(folder_ / name, mesh.view()));
        EXPECT_EQ(require(meshio::read_mesh(folder_ / name))->mesh.positions, mesh.positions) << name;
    }
}

TEST_F(MeshFiles, KeepOffsetsAndScalesInGlb) {
    for (const auto& [offset, size] : {std::pair(1e9, 1.0), std::pair(0.0, 1e-42), std::pair(0.0, 1e200)}) {
        Mesh mesh;
        mesh.positions = {
            {offset, offset, 0.1 * size}, {offset + 0.3 * size, offset, 0}, {offset, offset + 0.7 * size, 0}};
        mesh.triangles = {{0, 1, 2}};
        ASSERT_TRUE(meshio::write_mesh(folder_ / "a.glb", mesh.view()));
        const Result<meshio::ReadResult> again = require(meshio::read_mesh(folder_ / "a.glb"));
        // Half an ulp of a float relative to the size, and of the double at the offset.
        const double tolerance = size * 0x1p-23 + offset * 0x1p-52;
        for (std::size_t i = 0; i < 3; ++i)
            EXPECT_LE(glm::length((again->mesh.positions[i] - mesh.positions[i]) / tolerance), 2.0)
                << offset << " " << size;
    }
}

TEST_F(MeshFiles, KeepMaterialsAndGroups) {
    Mesh mesh = random_mesh(true, false);
    mesh.ranges = {{"wall", MeshRange::Kind::group, 0, 300},
                   {"stone \"grey\"", MeshRange::Kind::material, 10, 90},
                   {"glass", MeshRange::Kind::material, 100, 50},
                   {"stone \"grey\"", MeshRange::Kind::material, 200, 100}};
    ASSERT_TRUE(meshio::write_mesh(folder_ / "a.obj", mesh.view()));
    const Result<meshio::ReadResult> obj = require(meshio::read_mesh(folder_ / "a.obj"));
    ASSERT_EQ(obj->mesh.ranges.size(), 4u);
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(obj->mesh.ranges[i].name, mesh.ranges[i].name);
        EXPECT_EQ(obj->mesh.ranges[i].kind, mesh.ranges[i].kind);
        EXPECT_EQ(obj->mesh.ranges[i].first_triangle, mesh.ranges[i].first_triangle);
        EXPECT_EQ(obj->mesh.ranges[i].triangle_count, mesh.ranges[i].triangle_count);
    }
    ASSERT_TRUE(meshio::write_mesh(folder_ / "a.glb", mesh.view()));
    const Result<meshio::ReadResult> glb_file = require(meshio::read_mesh(folder_ / "a.glb"));
    EXPECT_EQ(glb_file->mesh.triangles, mesh.triangles);
    std::vector<std::string> materials;
    for (const MeshRange& range : glb_file->mesh.ranges) {
        if (range.kind == MeshRange::Kind::material)
            materials.push_back(range.name + std::to_string(range.first_triangle));
    }
    EXPECT_THAT(materials, ElementsAre("stone \"grey\"10", "glass100", "stone \"grey\"200"));
}

TEST_F(MeshFiles, NamesCannotBreakTheLinesOfAnObj) {
    Mesh mesh = random_mesh(true, false);
    mesh.ranges = {{"a\nv 1 2\\", MeshRange::Kind::material, 0, 300}};
    ASSERT_TRUE(meshio::write_mesh(folder_ / "a.obj", mesh.view()));
    EXPECT_EQ(require(meshio::read_mesh(folder_ / "a.obj"))->mesh.ranges[0].name, "a_v 1 2_");
}

TEST_F(MeshFiles, LeaveNothingBehindWhenWritingFails) {
    save("old.ply", "old");
    Mesh bad = random_mesh(true, false);
    bad.positions[7].y = std::nan("");
    EXPECT_THAT(error_in(meshio::write_mesh(folder_ / "old.ply", bad.view())), HasSubstr("Vertex 7"));
    EXPECT_FALSE(meshio::write_mesh(folder_ / "a.xyz", random_mesh(true, false).view()));
    EXPECT_FALSE(meshio::write_mesh(folder_ / "missing" / "a.ply", random_mesh(true, false).view()));
    EXPECT_FALSE(meshio::write_mesh(folder_, random_mesh(true, false).view()));
    EXPECT_EQ(fs::file_size(folder_ / "old.ply"), 3u);
    EXPECT_EQ(files(), 1u);
    ASSERT_TRUE(meshio::write_mesh(folder_ / "old.ply", random_mesh(true, false).view()));
    EXPECT_GT(fs::file_size(folder_ / "old.ply"), 1000u);
    EXPECT_EQ(files(), 1u);
}

TEST_F(MeshFiles, AnAbandonedAtomicFileLeavesNothing) {
    {
        Result<AtomicFile> file = require(AtomicFile::create(folder_ / "a.bin"));
        ASSERT_TRUE(file->write("half"));
        EXPECT_EQ(files(), 1u);
    }
    EXPECT_EQ(files(), 0u);
    EXPECT_FALSE(AtomicFile::create("/dev/null"));
}

// A file that is being renamed is not what a killed writer has left.
TEST_F(MeshFiles, AreNotTakenForOrphansWhileTheyAreWritten) {
    const fs::path target = folder_ / "a.bin";
    std::jthread remover([&](const std::stop_token& stop) {
        while (!stop.stop_requested()) AtomicFile::remove_orphans(target);
    });
    for (int i = 0; i < 200; ++i) {
        Result<AtomicFile> file = require(AtomicFile::create(target));
        ASSERT_TRUE(file->write("whole"));
        const Result<void> committed = require(file->commit());
    }
}

TEST(Mesh, ValidateNamesTheFirstOffender) {
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    mesh.triangles = {{0, 1, 2}};
    EXPECT_TRUE(validate(mesh.view()));
    const auto message = [](const Mesh& m) {
        const Result<void> valid = validate(m.view());
        return valid ? "" : valid.error().message;
    };
    Mesh bad = mesh;
    bad.positions[1].z = std::numeric_limits<double>::infinity();
    EXPECT_THAT(message(bad), HasSubstr("Vertex 1"));
    bad = mesh;
    bad.triangles.push_back({0, 1, 3});
    EXPECT_THAT(message(bad), HasSubstr("Triangle 1 of the mesh uses vertex 3"));
    bad = mesh;
    bad.normals.resize(2);
    EXPECT_THAT(message(bad), HasSubstr("2 normals for 3 vertices"));
    bad = mesh;
    bad.smoothing = {1, 1};
    EXPECT_THAT(message(bad), HasSubstr("2 smoothing groups for 1 triangles"));
    bad = mesh;
    bad.ranges = {{"r", MeshRange::Kind::group, 1, std::numeric_limits<std::uint64_t>::max()}};
    EXPECT_THAT(message(bad), HasSubstr("Range 0 ('r')"));
    bad.ranges = {{"r", MeshRange::Kind::group, 1, 0}, {"s", MeshRange::Kind::group, 0, 1}};
    EXPECT_THAT(message(bad), HasSubstr("Range 1 ('s')"));
}

} // namespace unseen::vdtree::mesh_file_test
