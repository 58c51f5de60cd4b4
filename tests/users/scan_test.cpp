// Meshes of scanners and CAD programs: PLY with colours, STL, OFF, in other units, and with what goes wrong in them.

#include "mesh_files.h"
#include "testing.h"
#include "user_file.h"

namespace scan_test {

using namespace unseen::app::testing;
using mesh_files::little;

class ScanUsers : public UserFileTest {
protected:
    // Drops the triangles of no area at the poles of balls, and joins their vertices and those of the seam, as programs
    // that know no texture coordinates do.
    static Patch joined(const Patch& given) {
        Patch out = given;
        std::map<std::array<long, 3>, int> numbers;
        std::vector<int> number;
        out.positions.clear(), out.normals.clear(), out.uvs.clear(), out.triangles.clear();
        for (std::size_t v = 0; v < given.positions.size(); ++v) {
            const auto& p = given.positions[v];
            const auto [found, is_new] =
                numbers.try_emplace({std::lround(1e6 * p[0]), std::lround(1e6 * p[1]), std::lround(1e6 * p[2])},
                                    static_cast<int>(out.positions.size()));
            if (is_new) {
                out.positions.push_back(p);
                out.normals.push_back(given.normals[v]);
                out.uvs.push_back(given.uvs[v]);
            }
            number.push_back(found->second);
        }
        for (auto triangle : given.triangles) {
            for (int& corner : triangle) corner = number[static_cast<std::size_t>(corner)];
            if (triangle[0] != triangle[1] && triangle[1] != triangle[2] && triangle[2] != triangle[0])
                out.triangles.push_back(triangle);
        }
        return out;
    }
    static Patch bumpy_ball(int columns, int rows) {
        return joined(Patch(columns, rows, [](double u, double v) {
            auto p = ball_at(u, v);
            const double bump = 1 + 0.05 * std::sin(10 * p[0]) * std::sin(8 * p[1]);
            for (double& x : p) x *= bump;
            return p;
        }));
    }
    static std::array<float, 3> as_floats(const std::array<double, 3>& p) {
        return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    }

    // As VCG's programs write it.
    template <class Colour>
    static std::string ply(const Patch& mesh, Colour&& colour) {
        std::string text = "ply\nformat binary_little_endian 1.0\ncomment VCGLIB generated\nelement vertex " +
                           std::to_string(mesh.positions.size()) +
                           "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
                           "property uchar green\nproperty uchar blue\nproperty uchar alpha\nelement face " +
                           std::to_string(mesh.triangles.size()) +
                           "\nproperty list uchar int vertex_indices\nend_header\n";
        for (const auto& p : mesh.positions) {
            for (const float x : as_floats(p)) text += little(x);
            for (const int code : colour(p)) text += static_cast<char>(code);
            text += '\xff';
        }
        for (const auto& triangle : mesh.triangles) {
            text += '\3';
            for (const int corner : triangle) text += little(std::int32_t{corner});
        }
        return text;
    }

    // The properties of the vertices of a PLY as we write it, by name.
    std::vector<std::map<std::string, double>> read_ply(const std::string& file) const {
        const std::string text = read_text(path(file));
        std::istringstream header(text);
        std::size_t count = 0;
        bool is_of_vertices = false;
        std::vector<std::pair<std::string, std::string>> properties; // type and name
        for (std::string line; std::getline(header, line) && line != "end_header";) {
            std::istringstream words(line);
            std::string keyword, type, name;
            words >> keyword >> type >> name;
            if (keyword == "element") is_of_vertices = type == "vertex";
            if (keyword == "element" && is_of_vertices) count = std::stoul(name);
            if (keyword == "property" && is_of_vertices) properties.emplace_back(type, name);
        }
        std::vector<std::map<std::string, double>> out(count);
        auto at = static_cast<std::size_t>(header.tellg());
        const auto read = [&]<class Value>(Value value) {
            std::memcpy(&value, text.data() + at, sizeof value);
            at += sizeof value;
            return static_cast<double>(value);
        };
        for (auto& vertex : out)
            for (const auto& [type, name] : properties)
                vertex[name] = type == "float" ? read(0.0f) : type == "double" ? read(0.0) : read(std::uint8_t{});
        return out;
    }

    static std::array<double, 3> facet_normal(const Patch& mesh, const std::array<int, 3>& triangle) {
        const auto& a = mesh.positions[static_cast<std::size_t>(triangle[0])];
        const auto& b = mesh.positions[static_cast<std::size_t>(triangle[1])];
        const auto& c = mesh.positions[static_cast<std::size_t>(triangle[2])];
        std::array<double, 3> n{};
        for (std::size_t k = 0; k < 3; ++k)
            n[k] = (b[(k + 1) % 3] - a[(k + 1) % 3]) * (c[(k + 2) % 3] - a[(k + 2) % 3]) -
                   (b[(k + 2) % 3] - a[(k + 2) % 3]) * (c[(k + 1) % 3] - a[(k + 1) % 3]);
        const double length = std::hypot(n[0], n[1], n[2]);
        for (double& x : n) x /= length;
        return n;
    }
    Json examination(const std::string& file) const { return run({"info", file, "--json"}).json()["examination"]; }
};

TEST_F(ScanUsers, ColoursOfVertices) {
    const auto colour = [](const std::array<double, 3>& p) {
        return std::array{static_cast<int>(std::lround(128 + 80 * p[0])),
                          static_cast<int>(std::lround(140 + 70 * p[1])),
                          static_cast<int>(std::lround(120 + 60 * p[2]))};
    };
    write_text(path("scan.ply"), ply(bumpy_ball(48, 24), colour));
    expect_invisible("scan.ply", "ply");
    for (const std::string out : {"out/small.ply", "out/whole.ply"}) {
        const auto vertices = read_ply(out);
        EXPECT_GT(vertices.size(), 300u);
        for (const auto& vertex : vertices) {
            const auto there = colour({vertex.at("x"), vertex.at("y"), vertex.at("z")});
            // A vertex that stands for others lies among them, where colours are mixed as light.
            const int slack = out == "out/whole.ply" ? 1 : 8;
            for (std::size_t k = 0; k < 3; ++k)
                ASSERT_NEAR(vertex.at(std::array{"red", "green", "blue"}[k]), there[k], slack) << out;
        }
    }
}

TEST_F(ScanUsers, BinaryStl) {
    const Patch mesh = bumpy_ball(40, 20);
    std::string stl = "exported from a CAD program";
    stl.resize(80, ' ');
    stl += little(static_cast<std::uint32_t>(mesh.triangles.size()));
    for (const auto& triangle : mesh.triangles) {
        for (const float x : as_floats(facet_normal(mesh, triangle))) stl += little(x);
        for (const int corner : triangle)
            for (const float x : as_floats(mesh.positions[static_cast<std::size_t>(corner)])) stl += little(x);
        stl += std::string(2, '\0');
    }
    write_text(path("part.stl"), stl);
    const Json found = examination("part.stl");
    EXPECT_EQ(found["closed_components"], 1) << "facets are welded: " << found;
    EXPECT_EQ(found["boundary_edges"], 0);
    expect_invisible("part.stl", "ply");
    EXPECT_EQ(examination("out/small.ply")["boundary_edges"], 0) << "it stays closed";
    EXPECT_EQ(read_ply("out/whole.ply").size(), mesh.positions.size()) << "each vertex once";
}

TEST_F(ScanUsers, AsciiStl) {
    // A block that stands askew: flat faces and sharp edges, of which only the corners matter.
    Patch mesh(12, 12, [](double u, double v) { return std::array{2 * u - 1, 2 * v - 1, 1.0}; });
    const Patch face = mesh;
    // The face at z = 1 to one of six: the axes go round, and half a turn brings it to the other side.
    const auto turned = [](std::array<double, 3> p, int axis, bool is_opposite) {
        std::rotate(p.begin(), p.begin() + axis, p.end());
        const auto facing = static_cast<std::size_t>((5 - axis) % 3);
        if (is_opposite) p[facing] = -p[facing], p[(facing + 1) % 3] = -p[(facing + 1) % 3];
        return p;
    };
    mesh.positions.clear(), mesh.triangles.clear();
    for (int axis = 0; axis < 3; ++axis)
        for (const bool is_opposite : {false, true}) {
            const int first = static_cast<int>(mesh.positions.size());
            for (const auto& p : face.positions) {
                const auto q = turned(p, axis, is_opposite);
                constexpr double c = 0.8, s = 0.6;
                mesh.positions.push_back({c * q[0] + s * q[2], 0.7 * q[1], c * q[2] - s * q[0]});
            }
            for (const auto& triangle : face.triangles)
                mesh.triangles.push_back({first + triangle[0], first + triangle[1], first + triangle[2]});
        }
    std::ostringstream stl;
    stl << "solid block\r\n" << std::scientific;
    for (const auto& triangle : mesh.triangles) {
        const auto n = facet_normal(mesh, triangle);
        stl << "  facet normal " << n[0] << ' ' << n[1] << ' ' << n[2] << "\r\n    outer loop\r\n";
        for (const int corner : triangle) {
            const auto& p = mesh.positions[static_cast<std::size_t>(corner)];
            stl << "      vertex " << p[0] << ' ' << p[1] << ' ' << p[2] << "\r\n";
        }
        stl << "    endloop\r\n  endfacet\r\n";
    }
    stl << "endsolid block\r\n";
    write_text(path("block.stl"), stl.str());
    expect_invisible("block.stl", "obj");
    const Json small = Json::parse(read_text(path("out/small.obj.json")));
    EXPECT_LT(small["triangles"].get<int>(), 60) << "of 1,728 in six planes";
    EXPECT_EQ(examination("block.stl")["boundary_edges"], 0);
    EXPECT_EQ(examination("out/small.obj")["boundary_edges"], 0);
}

TEST_F(ScanUsers, VerticesThatAreNoNumbers) {
    Patch mesh = bumpy_ball(40, 20);
    std::size_t faces = 0;
    for (const int bad : {100, 700}) {
        mesh.positions[static_cast<std::size_t>(bad)][1] = std::numeric_limits<double>::quiet_NaN();
        for (const auto& triangle : mesh.triangles) faces += std::count(triangle.begin(), triangle.end(), bad) > 0;
    }
    const auto grey = [](const std::array<double, 3>&) { return std::array{190, 190, 190}; };
    write_text(path("scan.ply"), ply(mesh, grey));
    for (const Words& words :
         {Words{"simplify", "scan.ply", "-o", "small.ply"}, {"build", "scan.ply", "-o", "scan.vdt"}})
        EXPECT_THAT(refused(words), AllOf(HasSubstr("scan.ply"), HasSubstr("vertex 100 "),
                                          HasSubstr("the first of 2 such"), HasSubstr("--skip-bad")));
    EXPECT_FALSE(fs::exists(path("small.ply")));
    EXPECT_EQ(examination("scan.ply")["bad_vertices"], 2);
    // What is left has holes there.
    const Simplified whole = simplify("scan.ply", "out/whole.ply", {"--full", "--skip-bad"});
    EXPECT_EQ(whole.report["triangles"], mesh.triangles.size() - faces);
    EXPECT_THAT(whole.said, HasSubstr(std::to_string(faces) + " faces"));
    EXPECT_EQ(examination("out/whole.ply")["boundary_edges"], faces);
    EXPECT_EQ(examination("out/whole.ply")["bad_vertices"], 0);
    expect_invisible("out/whole.ply", "glb");
}

TEST_F(ScanUsers, Millimetres) {
    const Patch mesh = bumpy_ball(40, 20);
    std::ostringstream off;
    off << "OFF\n" << mesh.positions.size() << ' ' << mesh.triangles.size() << " 0\n";
    for (const auto& p : mesh.positions) off << 45 * p[0] << ' ' << 45 * p[1] << ' ' << 45 * p[2] << '\n';
    for (const auto& t : mesh.triangles) off << "3 " << t[0] << ' ' << t[1] << ' ' << t[2] << '\n';
    write_text(path("knob.off"), off.str());
    EXPECT_THAT(succeed({"info", "knob.off"}), AllOf(HasSubstr("0.09"), HasSubstr("--unit 0.001 (millimetres)")));
    // Nine centimetres, seen from half a metre: 10 degrees. What is written is in the file's units.
    view = {"--size", "512x512", "--unit", "0.001", "--eye", "0", "0.05", "0.5", "--target", "0", "0", "0"};
    expect_invisible("knob.off", "ply");
    double highest = 0;
    for (const auto& p : mesh.positions) highest = std::max(highest, 45 * p[1]);
    EXPECT_NEAR(examination("out/small.ply")["high"][1].get<double>(), highest, 0.5);
    // Of what is smaller in the view, less is kept.
    const Json near = Json::parse(read_text(path("out/small.ply.json")));
    view = {"--size", "512x512", "--unit", "0.001", "--eye", "0", "0.5", "5", "--target", "0", "0", "0"};
    EXPECT_LT(simplify("knob.off", "out/far.ply").report["triangles"], near["triangles"]);
}

TEST_F(ScanUsers, InsideOut) {
    Patch mesh = bumpy_ball(40, 20);
    for (auto& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
    const auto grey = [](const std::array<double, 3>&) { return std::array{190, 190, 190}; };
    write_text(path("in.ply"), ply(mesh, grey));
    EXPECT_EQ(examination("in.ply")["inside_out_components"], 1);
    EXPECT_THAT(succeed({"info", "in.ply"}), HasSubstr("inside out components: 1: closed parts that face inward"));
    expect_invisible("in.ply", "ply");
}

TEST_F(ScanUsers, HolesAndDuplicates) {
    Patch mesh = bumpy_ball(40, 20);
    // Every 50th triangle is not there, and every 37th twice.
    std::vector<std::array<int, 3>> kept;
    std::size_t twice = 0;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        if (t % 50 == 7) continue;
        kept.push_back(mesh.triangles[t]);
        if (t % 37 == 3) kept.push_back(mesh.triangles[t]), ++twice;
    }
    mesh.triangles = kept;
    const auto grey = [](const std::array<double, 3>&) { return std::array{190, 190, 190}; };
    write_text(path("in.ply"), ply(mesh, grey));
    const Json found = examination("in.ply");
    EXPECT_EQ(found["duplicate_triangles"], twice);
    EXPECT_GT(found["boundary_loops"], 20) << found;
    EXPECT_THAT(succeed({"info", "in.ply"}),
                AllOf(HasSubstr("boundary edges: "), HasSubstr("duplicate triangles: " + std::to_string(twice))));
    expect_invisible("in.ply", "ply");
}

// As ParaView writes the surface of a simulation: raw data behind the XML, and a value of each vertex.
TEST_F(ScanUsers, ParaViewsPolygons) {
    const Patch mesh = bumpy_ball(40, 20);
    const auto pressure = [](double x, double y, double z) { return 1000 + 300 * x + 200 * y - 100 * z; };
    std::string data;
    const auto block = [&](const std::string& bytes) {
        const std::size_t offset = data.size();
        data += little(std::uint64_t{bytes.size()}) + bytes;
        return std::to_string(offset);
    };
    std::string points, values, connectivity, offsets;
    for (const auto& p : mesh.positions) {
        for (const float x : as_floats(p)) points += little(x);
        values += little(pressure(p[0], p[1], p[2]));
    }
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        for (const int corner : mesh.triangles[t]) connectivity += little(std::int64_t{corner});
        offsets += little(static_cast<std::int64_t>(3 * t + 3));
    }
    const auto array = [](const std::string& type, const std::string& name, const std::string& more,
                          const std::string& offset) {
        return "<DataArray type=\"" + type + "\" Name=\"" + name + "\" " + more + "format=\"appended\" offset=\"" +
               offset + "\"/>\n";
    };
    const std::string head =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" "
        "header_type=\"UInt64\">\n<PolyData>\n<Piece NumberOfPoints=\"" +
        std::to_string(mesh.positions.size()) +
        "\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"" +
        std::to_string(mesh.triangles.size()) + "\">\n<PointData Scalars=\"Pressure\">\n" +
        array("Float64", "Pressure", "", block(values)) + "</PointData>\n<Points>\n" +
        array("Float32", "Points", "NumberOfComponents=\"3\" ", block(points)) + "</Points>\n<Polys>\n" +
        array("Int64", "connectivity", "", block(connectivity)) + array("Int64", "offsets", "", block(offsets)) +
        "</Polys>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_";
    write_text(path("flow.vtp"), head + data + "\n</AppendedData>\n</VTKFile>\n");
    expect_invisible("flow.vtp", "vtp");
    expect_invisible("flow.vtp", "ply");
    for (const std::string out : {"out/small.ply", "out/whole.ply"})
        for (const auto& vertex : read_ply(out))
            ASSERT_NEAR(vertex.at("Pressure"), pressure(vertex.at("x"), vertex.at("y"), vertex.at("z")),
                        out == "out/whole.ply" ? 1e-3 : 25)
                << out;
}

} // namespace scan_test
