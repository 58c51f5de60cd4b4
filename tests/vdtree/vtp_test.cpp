// VTK's polygons in XML, in every encoding; what VTK itself wrote is in tests/data/vtp.
#include <unseen/meshio/mesh_file.h>

#include <zlib.h>

#include "mesh_readers.h"
#include "mesh_writers.h"
#include "read_bytes.h"
#include "shapes.h"
#include "temp_folder.h"
#include "value_types.h"
#include "vtp_data.h"
#include "vtp_files.h"

namespace unseen::vdtree::vtp_test {

namespace fs = std::filesystem;
using namespace std::string_literals;
using meshio::ValueType;
using meshio::VertexArray;
using support::error_of;
using support::read;
using vtp_files::Format;
using vtp_files::Style;

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

const VertexArray* find(const meshio::ReadResult& result, const std::string& name) {
    if (!result.document) return nullptr;
    for (const VertexArray& array : result.document->arrays)
        if (array.name == name) return &array;
    return nullptr;
}

template <class T>
std::vector<T> values_of(const VertexArray* array) {
    if (!array) return {};
    std::vector<T> values(array->values.size() / sizeof(T));
    std::memcpy(values.data(), array->values.data(), values.size() * sizeof(T));
    return values;
}

// By bits, so that NaN is equal to itself.
template <class T>
void expect_values(const meshio::ReadResult& result, const std::string& name, ValueType type, std::uint32_t components,
                   const std::vector<T>& expected) {
    const VertexArray* array = find(result, name);
    ASSERT_NE(array, nullptr) << name;
    EXPECT_EQ(array->type, type) << name;
    EXPECT_EQ(array->components, components) << name;
    const auto values = values_of<T>(array);
    ASSERT_EQ(values.size(), expected.size()) << name;
    EXPECT_EQ(std::memcmp(values.data(), expected.data(), values.size() * sizeof(T)), 0) << name;
}

void expect_unit_quad(const Mesh& mesh) {
    EXPECT_THAT(mesh.positions,
                ElementsAre(glm::dvec3(0, 0, 0), glm::dvec3(1, 0, 0), glm::dvec3(1, 1, 0), glm::dvec3(0, 1, 0)));
    EXPECT_THAT(mesh.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}));
}

TEST(Vtp, EveryEncodingSaysTheSame) {
    for (const Format format : {Format::ascii, Format::binary, Format::raw, Format::base64}) {
        for (const bool is_compressed : {false, true}) {
            for (const bool has_wide_headers : {false, true}) {
                for (const std::endian order : {std::endian::little, std::endian::big}) {
                    for (const std::size_t block : {1, 7, 16, 48, 100}) {
                        const meshio::ReadResult result =
                            read(vtp_files::vtp_quad({format, is_compressed, has_wide_headers, order, block}), "a.vtp");
                        expect_unit_quad(result.mesh);
                        EXPECT_EQ(result.source_faces, 1u);
                        EXPECT_TRUE(result.warnings.empty() && result.notes.empty());
                        expect_values(result, "height", ValueType::float64, 1, vtp_files::heights);
                        expect_values(result, "label", ValueType::int16, 1, vtp_files::labels);
                    }
                }
            }
        }
    }
}

// As its own files have it: a quad, a strip, a vertex cell, a line, and arrays of every kind.
TEST(Vtp, FilesOfVtkAreRead) {
    int files = 0;
    for (const fs::directory_entry& entry : fs::directory_iterator("tests/data/vtp")) {
        const std::string name = entry.path().filename().string();
        if (name.ends_with(".py")) continue;
        SCOPED_TRACE(name);
        ++files;
        const std::string bytes = support::read_bytes(entry.path());
        if (name.find("lz4") != std::string::npos) {
            EXPECT_THAT(error_of(bytes, name),
                        testing::MatchesRegex(".*line 6[0-9]: array 'Points': it is compressed by "
                                              "vtkLZ4DataCompressor, which is not read.*zlib.*"));
            continue;
        }
        const meshio::ReadResult result = read(bytes, name);
        EXPECT_THAT(result.mesh.triangles,
                    ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{1, 4, 2}, Triangle{2, 4, 5}));
        ASSERT_EQ(result.mesh.positions.size(), 6u);
        EXPECT_EQ(result.mesh.positions[5], glm::dvec3(2, 1, 0.5));
        EXPECT_EQ(result.mesh.normals, std::vector<glm::vec3>(6, glm::vec3(0, 0, 1)));
        ASSERT_EQ(result.mesh.uvs.size(), 6u);
        EXPECT_EQ(result.mesh.uvs[5], glm::vec2(10.f / 16, 11.f / 16));
        ASSERT_EQ(result.mesh.colours.size(), 6u);
        EXPECT_EQ(result.mesh.colours[2].r, 0.0f);
        EXPECT_NEAR(result.mesh.colours[2].g, 0.2158605f, 1e-6f); // 128 of 255 as sRGB
        EXPECT_EQ(result.mesh.colours[2].b, 1.0f);
        const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
        const auto temperatures = values_of<double>(find(result, "T in K"));
        ASSERT_EQ(temperatures.size(), 6u);
        for (std::size_t i = 0; i < 6; ++i) {
            const double expected = std::array{0.1, 0.2, nan, 4.0, 5.0, inf}[i];
            EXPECT_TRUE(temperatures[i] == expected || (std::isnan(expected) && std::isnan(temperatures[i]))) << i;
        }
        expect_values(result, "ids", ValueType::int64, 1, std::vector<std::int64_t>{3, 1, 4, 1, 5, 9});
        std::vector<float> velocity(18);
        for (std::size_t i = 0; i < velocity.size(); ++i) velocity[i] = static_cast<float>(i) / 8;
        expect_values(result, "velocity", ValueType::float32, 3, velocity);
        ASSERT_NE(find(result, "RGB"), nullptr);
        EXPECT_EQ(find(result, "RGB")->role, VertexArray::Role::colours);
        EXPECT_EQ(find(result, "TC")->role, VertexArray::Role::uvs);
        EXPECT_TRUE(find(result, "TC")->values.empty());
        EXPECT_THAT(result.warnings, ElementsAre(HasSubstr("1 vertex cell and 1 line were left out")));
        EXPECT_THAT(result.notes, ElementsAre(HasSubstr("values of cells were left out: 'quality'"),
                                              HasSubstr("'words' and 'bits'")));
    }
    EXPECT_EQ(files, 8);
}

TEST(Vtp, PiecesBecomeOneMesh) {
    vtp_files::VtpFile file({Format::raw});
    const auto piece = [&](float x, const std::string& data, int corner = 2) {
        return "<Piece NumberOfPoints=\"3\" NumberOfPolys=\"1\"><PointData>" + data + "</PointData><Points>" +
               file.array<float>("Float32", "Points", 3, {x, 0, 0, x + 1, 0, 0, x, 1, 0}) + "</Points><Polys>" +
               file.array<int>("Int32", "connectivity", 1, {0, 1, corner}) +
               file.array<int>("Int32", "offsets", 1, {3}) + "</Polys></Piece>\n";
    };
    const std::string empty = "<Piece NumberOfPoints=\"0\" NumberOfPolys=\"0\"><PointData/><Points/><Polys/></Piece>";
    const std::string first =
        piece(0, file.array<int>("Int32", "a", 1, {1, 2, 3}) + file.array<int>("Int32", "only here", 1, {1, 2, 3}) +
                     file.array<float>("Float32", "other type", 1, {1, 2, 3}));
    const std::string second = piece(5, file.array<double>("Float64", "other type", 1, {1, 2, 3}) +
                                            file.array<int>("Int32", "a", 1, {4, 5, 6}));
    const meshio::ReadResult result = read(file.whole(empty + first + empty + second), "a.vtp");
    EXPECT_THAT(result.mesh.triangles, ElementsAre(Triangle{0, 1, 2}, Triangle{3, 4, 5}));
    EXPECT_EQ(result.mesh.positions[3], glm::dvec3(5, 0, 0));
    expect_values(result, "a", ValueType::int32, 1, std::vector<int>{1, 2, 3, 4, 5, 6});
    EXPECT_EQ(result.document->arrays.size(), 1u);
    EXPECT_THAT(result.notes, ElementsAre(HasSubstr("not all pieces have alike were left out: 'only here' and 'other "
                                                    "type'.")));
    // A corner is a point of its own piece.
    EXPECT_THAT(error_of(file.whole(piece(0, "", 3) + piece(5, "")), "a.vtp"),
                HasSubstr("piece 0: polygon 0 uses vertex 3, but the vertices are numbered 0 to 2"));
    meshio::ReadOptions options;
    options.skip_bad = true;
    EXPECT_THAT(read(file.whole(piece(0, "", 3) + piece(5, "")), "a.vtp", options).mesh.triangles,
                ElementsAre(Triangle{3, 4, 5}));
}

TEST(Vtp, StripsPolygonsAndCellsOfNothing) {
    vtp_files::VtpFile file({Format::ascii});
    const std::string points =
        "<Points>" +
        file.array<double>("Float64", "Points", 3, {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0, 1, 2, 0}) +
        "</Points>";
    const meshio::ReadResult result =
        read(file.whole("<Piece NumberOfPoints=\"6\" NumberOfStrips=\"2\" NumberOfPolys=\"4\">" + points + "<Strips>" +
                        file.array<long>("Int64", "connectivity", 1, {0, 1, 2, 3, 4, 3, 5}) +
                        file.array<long>("Int64", "offsets", 1, {5, 7}) + "</Strips><Polys>" +
                        file.array<unsigned char>("UInt8", "connectivity", 1, {0, 1, 0, 1, 3, 2, 4, 5, 3}) +
                        file.array<unsigned char>("UInt8", "offsets", 1, {2, 2, 6, 9}) + "</Polys></Piece>"),
             "a.vtp");
    EXPECT_THAT(result.mesh.triangles, ElementsAre(Triangle{0, 1, 3}, Triangle{0, 3, 2}, Triangle{4, 5, 3},
                                                   Triangle{0, 1, 2}, Triangle{2, 1, 3}, Triangle{2, 3, 4}));
    EXPECT_EQ(result.source_faces, 4u + 3u);
    EXPECT_THAT(result.warnings, ElementsAre(HasSubstr("2 faces were left out for having fewer than 3 corners")));
}

TEST(Vtp, RolesGoByMarksThenNames) {
    const auto with = [](const std::string& marks, const std::string& arrays) {
        const std::string text = vtp_files::vtp_quad({Format::ascii});
        return replaced(text, "<PointData Scalars=\"height\">", "<PointData " + marks + ">" + arrays);
    };
    vtp_files::VtpFile file({Format::ascii});
    const std::string rgb = file.array<int>("UInt8", "RGB", 3, std::vector<int>(12, 255)),
                      paint = file.array<int>("UInt8", "paint", 3, std::vector<int>(12, 0)),
                      normals = file.array<float>("Float64", "NORMALS", 3, std::vector<float>(12, 1)),
                      n = file.array<float>("Float32", "n", 3, std::vector<float>(12, 2)),
                      uv = file.array<float>("Float32", "uv", 2, std::vector<float>(8, 0.5f));
    meshio::ReadResult result = read(with("", rgb + paint + normals + n + uv), "a.vtp");
    EXPECT_EQ(result.mesh.colours[0], glm::vec4(1));
    EXPECT_EQ(result.mesh.normals[0], glm::vec3(1));
    EXPECT_TRUE(result.mesh.uvs.empty());
    result = read(with("Scalars=\"paint\" Normals=\"n\" TCoords=\"uv\"", rgb + paint + normals + n + uv), "a.vtp");
    EXPECT_EQ(result.mesh.colours[0], glm::vec4(0, 0, 0, 1));
    EXPECT_EQ(result.mesh.normals[0], glm::vec3(2));
    EXPECT_EQ(result.mesh.uvs[3], glm::vec2(0.5f));
    EXPECT_EQ(find(result, "RGB")->role, VertexArray::Role::value);
    meshio::ReadOptions linear;
    linear.colours = meshio::ColourEncoding::linear;
    result = read(with("", file.array<int>("UInt8", "rgba", 4, std::vector<int>(16, 51))), "a.vtp", linear);
    EXPECT_EQ(result.mesh.colours[0], glm::vec4(0.2f));
    // Twice the same name: the first counts.
    result = read(with("", file.array<int>("Int32", "height", 1, {1, 2, 3, 4})), "a.vtp");
    EXPECT_EQ(find(result, "height")->type, ValueType::int32);
    EXPECT_THAT(result.notes, ElementsAre(HasSubstr("'height'")));
}

TEST(Vtp, SaysWhatIsWrongAndWhere) {
    const std::string text = vtp_files::vtp_quad({Format::ascii});
    const std::tuple<std::string, std::string, std::string> changes[] = {
        {"PolyData\" version", "UnstructuredGrid\" version", "line 2: it holds 'UnstructuredGrid', and only PolyData"},
        {"LittleEndian", "MiddleEndian", "line 2: its byte_order is 'MiddleEndian'"},
        {"UInt32", "UInt16", "line 2: its header_type is 'UInt16'"},
        {"NumberOfPoints=\"4\"", "NumberOfPoints=\"5\"", "line 14: array 'Points': it should have 15 values"},
        {"NumberOfPoints=\"4\"", "NumberOfPoints=\"3\"", "array 'Points': it has more than the 9 values"},
        {"NumberOfPoints=\"4\"", "NumberOfPoints=\"-4\"", "line 4: NumberOfPoints is '-4'"},
        {"NumberOfPoints=\"4\"", "NumberOfPoints=\"4000000000000\"", "for which its text is too short"},
        {"NumberOfPoints=\"4\"", "NumberOfPoints=\"18446744073709551615\"",
         "18446744073709551615 values of 3 components are no usable"},
        {"NumberOfComponents=\"1\"", "NumberOfComponents=\"0\"", "line 6: array 'height': 4 values of 0 components"},
        {"NumberOfComponents=\"1\"", "NumberOfComponents=\"4294967296\"", "components are no usable number"},
        {"NumberOfComponents=\"3\"", "NumberOfComponents=\"2\"", "has more than the 8 values"},
        {"7 -32768", "7 -32769", "line 9: array 'label': value 1 is '-32769', which is no int16"},
        {"7 -32768", "7 -3.5", "value 1 is '-3.5', which is no int16"},
        {"0.1 ", "0.1.1 ", "value 0 is '0.1.1', which is no float64"},
        {"format=\"ascii\"", "format=\"gibberish\"", "its format is 'gibberish'"},
        {"format=\"ascii\"", "format=\"appended\" offset=\"1\"", "begins 1 bytes behind the underscore"},
        {"\"connectivity\"", "\"konnectivity\"", "it has no array 'connectivity'"},
        {"4 \n</DataArray>\n</Polys>", "-4 \n</DataArray>\n</Polys>", "the last of its offsets is -4"},
        {"4 \n</DataArray>\n</Polys>", "5 \n</DataArray>\n</Polys>", "array 'connectivity': it ends after 4 of 5"},
        {"0 1 2 3", "0 1 2 4", "polygon 0 uses vertex 4, but the vertices are numbered 0 to 3"},
        {"0 1 2 3", "0 1 2 -1", "polygon 0 uses vertex -1"},
        {"type=\"Int32\" Name=\"offsets\"", "type=\"Float32\" Name=\"offsets\"", "must be of single whole numbers"},
        {"0 0 0 1", "0 nan 0 1", "point 0 has a NaN or infinite coordinate"},
        {"<Points>", "<Point>", "it is no XML"},
        {"<Points>", "<Pionts>", "it is no XML"},
        {"</VTKFile>", "", "it is no XML"},
    };
    for (const auto& [from, to, expected] : changes) {
        const std::string error = error_of(replaced(text, from, to), "a.vtp");
        EXPECT_THAT(error, HasSubstr(expected)) << to;
        EXPECT_TRUE(error.starts_with("a.vtp: ")) << error;
    }
    EXPECT_THAT(error_of(replaced(replaced(text, "<Points>", "<Elsewhere>"), "</Points>", "</Elsewhere>"), "a.vtp"),
                HasSubstr("line 4: it has no Points"));
    EXPECT_THAT(error_of("<file/>", "a.vtp"), HasSubstr("a.vtp: it has no element VTKFile"));
}

TEST(Vtp, SaysWhatIsWrongWithBytes) {
    const std::string raw = vtp_files::vtp_quad({Format::raw}), base64 = vtp_files::vtp_quad({Format::base64}),
                      inflated = vtp_files::vtp_quad({Format::raw, true});
    EXPECT_THAT(error_of(replaced(raw, "\"raw\"", "\"hex\""), "a.vtp"), HasSubstr("neither raw nor base64"));
    EXPECT_THAT(error_of(replaced(raw, "\n_", "\n"), "a.vtp"), HasSubstr("underscore"));
    EXPECT_THAT(error_of(replaced(raw, "offset=\"0\"", "offset=\"1\""), "a.vtp"),
                HasSubstr("where 32 are needed")); // bytes of four doubles
    EXPECT_THAT(error_of(replaced(raw, "NumberOfPoints=\"4\"", "NumberOfPoints=\"40\""), "a.vtp"),
                HasSubstr("array 'Points': it holds 48 bytes of data where 480 are needed"));
    EXPECT_THAT(error_of(replaced(base64, "\n_" + base64.substr(base64.find("\n_") + 2, 4), "\n_AA=A"), "a.vtp"),
                HasSubstr("array 'height': its data are no base64"));
    EXPECT_THAT(error_of(replaced(inflated, "\x78\x01", "\x78\x02"), "a.vtp"), HasSubstr("compressed block"));
    EXPECT_THAT(error_of(replaced(inflated, "\n_" + mesh_files::little(2u), "\n_" + mesh_files::little(3u)), "a.vtp"),
                HasSubstr("3 compressed blocks of 16 bytes"));
    EXPECT_THAT(error_of(replaced(inflated, "vtkZLibData", "vtkLZMAData"), "a.vtp"),
                HasSubstr("vtkLZMADataCompressor"));
}

TEST(Vtp, WhatIsCompressedMayNotGrowWithoutLimit) {
    const auto block = [](const std::string& data) {
        std::string packed(::compressBound(data.size()), '\0');
        uLongf size = packed.size();
        EXPECT_EQ(::compress(reinterpret_cast<Bytef*>(packed.data()), &size,
                             reinterpret_cast<const Bytef*>(data.data()), data.size()),
                  Z_OK);
        packed.resize(size);
        return packed;
    };
    constexpr std::uint32_t million = 1'000'000;
    const std::string zeros = block(std::string(million, '\0'));
    const auto size_of = [](const std::string& bytes) { return static_cast<std::uint32_t>(bytes.size()); };
    const std::string array = mesh_files::little(1u) + mesh_files::little(million) + mesh_files::little(0u) +
                              mesh_files::little(size_of(zeros)) + zeros;
    const meshio::VtpEncoding zlib{.compressor = "vtkZLibDataCompressor"};
    meshio::VtpDecoder decoder(zlib, Budget(0, 0, 2 * million));
    EXPECT_EQ(decoder.decode(array, false, million).size(), million);
    EXPECT_EQ(decoder.decode(array, false, million).size(), million);
    try {
        decoder.decode(array, false, million);
        FAIL() << "more than there may be";
    } catch (const meshio::Fault& fault) {
        EXPECT_THAT(fault.what, HasSubstr("far more than the file holds"));
    }
    // What zlib cannot make of so few bytes is not even tried.
    const std::string lie = mesh_files::little(1u) + mesh_files::little(4'000'000'000u) + mesh_files::little(0u) +
                            mesh_files::little(size_of(zeros)) + zeros;
    meshio::VtpDecoder generous(zlib, Budget(0, 0, std::uint64_t{1} << 40));
    EXPECT_THROW(generous.decode(lie, false, 4'000'000'000u), meshio::Fault);
    // Nor blocks that are not there.
    const std::string blocks = mesh_files::little(4'000'000'000u) + mesh_files::little(1u) + mesh_files::little(0u);
    EXPECT_THROW(generous.decode(blocks, false, 4'000'000'000u), meshio::Fault);
}

TEST(Vtp, ReadingStopsWhenTheCallerSaysSo) {
    for (const auto& [name, bytes] : vtp_files::samples()) {
        meshio::ReadOptions options;
        options.progress = [](double share, const char*) {
            EXPECT_LE(share, 1.0);
            return false;
        };
        const auto result = meshio::read_mesh_bytes(bytes, name, options);
        ASSERT_FALSE(result) << name;
        EXPECT_EQ(result.error().code, ErrorCode::cancelled) << name;
    }
}

template <class T>
VertexArray array_of(const std::string& name, ValueType type, std::uint32_t components, std::size_t vertices) {
    VertexArray array{.name = name, .type = type, .components = components};
    for (std::size_t i = 0; i < vertices * components; ++i) {
        T value = static_cast<T>(i * 37);
        if (i == 0) value = std::numeric_limits<T>::lowest();
        if (i == 1) value = std::numeric_limits<T>::max();
        if (i == 2 && std::is_floating_point_v<T>) value = std::numeric_limits<T>::quiet_NaN();
        if (i == 3 && std::is_floating_point_v<T>) value = -std::numeric_limits<T>::infinity();
        meshio::append_value(array.values, value);
    }
    return array;
}

std::vector<VertexArray> arrays_of_every_type(std::size_t vertices) {
    std::vector<VertexArray> arrays = {array_of<std::int8_t>("i8", ValueType::int8, 1, vertices),
                                       array_of<std::uint8_t>("u8", ValueType::uint8, 2, vertices),
                                       array_of<std::int16_t>("i 16", ValueType::int16, 1, vertices),
                                       array_of<std::uint16_t>("u\"16\"", ValueType::uint16, 1, vertices),
                                       array_of<std::int32_t>("<i32>", ValueType::int32, 3, vertices),
                                       array_of<std::uint32_t>("u&32;", ValueType::uint32, 1, vertices),
                                       array_of<std::int64_t>("100%25", ValueType::int64, 1, vertices),
                                       array_of<std::uint64_t>("\xC3\xA9t\xC3\xA9", ValueType::uint64, 1, vertices),
                                       array_of<float>("f'32'", ValueType::float32, 9, vertices),
                                       array_of<double>("Normals", ValueType::float64, 1, vertices)};
    return arrays;
}

TEST(Vtp, ComesBackAsItWasWritten) {
    const support::TempFolder folder;
    Mesh mesh = shapes::with_attributes(shapes::icosphere(1));
    for (const bool has_attributes : {true, false}) {
        if (!has_attributes) mesh.normals = {}, mesh.colours = {}, mesh.uvs = {};
        for (const bool has_doubles : {false, true}) {
            mesh.positions[0].x = has_doubles ? 1.0 / 3 : 0.25;
            const auto arrays = arrays_of_every_type(mesh.positions.size());
            for (const std::string name : {"a.vtp", "A.VTP"}) {
                std::vector<Message> notes;
                const auto written = require(meshio::write_mesh_with(folder / name, mesh.view(), arrays, notes));
                EXPECT_TRUE(notes.empty());
                const auto again = require(meshio::read_mesh(folder / name));
                EXPECT_TRUE(again->warnings.empty() && again->notes.empty());
                EXPECT_EQ(again->mesh.positions, mesh.positions);
                EXPECT_EQ(again->mesh.triangles, mesh.triangles);
                EXPECT_EQ(again->mesh.normals, mesh.normals);
                EXPECT_EQ(again->mesh.uvs, mesh.uvs);
                ASSERT_EQ(again->mesh.colours.size(), mesh.colours.size());
                for (std::size_t i = 0; i < mesh.colours.size(); ++i)
                    for (int c = 0; c < 4; ++c) // of 8 bits; see MeshFiles.ComeBackAsTheyWereWritten
                        EXPECT_NEAR(again->mesh.colours[i][c], mesh.colours[i][c], 2.3f / 510.0f);
                for (const VertexArray& array : arrays) {
                    const VertexArray* found = find(*again, array.name);
                    ASSERT_NE(found, nullptr) << array.name;
                    EXPECT_EQ(found->type, array.type) << array.name;
                    EXPECT_EQ(found->components, array.components) << array.name;
                    EXPECT_EQ(found->values, array.values) << array.name;
                }
                EXPECT_EQ(again->document->arrays.size(), arrays.size() + (has_attributes ? 3 : 0));
            }
        }
    }
}

TEST(Vtp, KeepsTheNamesOfWhatTheMeshHasTaken) {
    const support::TempFolder folder;
    const Mesh mesh = shapes::with_attributes(shapes::icosphere(1));
    const std::vector<VertexArray> roles = {
        {.name = "up", .type = ValueType::float32, .components = 3, .role = VertexArray::Role::normals},
        {.name = "paint", .type = ValueType::uint8, .components = 3, .role = VertexArray::Role::colours},
        {.name = "map", .type = ValueType::float32, .components = 2, .role = VertexArray::Role::uvs}};
    for (const std::string name : {"a.vtp"}) {
        std::vector<Message> notes;
        ASSERT_TRUE(meshio::write_mesh_with(folder / name, mesh.view(), roles, notes));
        const auto again = require(meshio::read_mesh(folder / name));
        for (const VertexArray& role : roles) {
            ASSERT_NE(find(*again, role.name), nullptr) << name << role.name;
            EXPECT_EQ(find(*again, role.name)->role, role.role) << name << role.name;
        }
        EXPECT_EQ(again->mesh.normals, mesh.normals);
        EXPECT_EQ(again->mesh.uvs, mesh.uvs);
    }
}

TEST(Vtp, OtherFormatsSayWhatTheyLeaveOut) {
    const support::TempFolder folder;
    const Mesh mesh = shapes::icosphere(1);
    const auto arrays = arrays_of_every_type(mesh.positions.size());
    for (const std::string name : {"a.obj", "a.glb"}) {
        std::vector<Message> notes;
        ASSERT_TRUE(meshio::write_mesh_with(folder / name, mesh.view(), arrays, notes));
        EXPECT_THAT(notes, ElementsAre(HasSubstr("values of vertices were left out: 'i8', 'u8', 'i 16', 'u\"16\"', "
                                                 "'<i32>', 'u&32;' and 4 more; .ply and .vtp hold them.")));
    }
    EXPECT_THAT(meshio::write_mesh(folder / "a.vtk", mesh.view()).error().message, HasSubstr(".ply, .obj, .glb"));
}

} // namespace unseen::vdtree::vtp_test
